"""Many lamps that share the shadow rays of a sample (semantics/many_lamps.md)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint import engine
from glint.engine import Settings
from glint.engine.lights import lamps
from glint.engine.lights.lamps import (
    cluster_levels,
    first_mark,
    in_order,
    may_share,
    shared_rays,
    shared_samples,
)
from glint.engine.linear.columns import dot, length
from glint.engine.reference.lamp_clusters import _above_horizon, _mean_above
from glint.engine.reference.shared_lamps import choose
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Scene,
    Spheres,
)
from native_tools import assert_instruction_sets_agree

BACKENDS = ("NATIVE", "NUMPY")
MATT = Material("matt", (Lobe("DIFFUSE", (Input((0.7, 0.6, 0.5)),)),))
GLOSS = Material(
    "gloss",
    (
        Lobe("DIFFUSE", (Input((0.5, 0.5, 0.5)),)),
        Lobe("SPECULAR", (Input((0.4, 0.3, 0.2)),), exponent=60.0),
    ),
)
GLASS = Material(
    "coloured pane",
    (
        Lobe("DIFFUSE", (Input((0.2, 0.2, 0.2)),)),
        Lobe("TRANSPARENT", (Input((0.7, 0.4, 0.2)),)),
    ),
)


def at(x: float, y: float, z: float, scale: float = 1.0) -> np.ndarray:
    return np.column_stack([scale * np.eye(3), (x, y, z)])


def lamp(x: float, y: float, z: float, kind: str = "POINT", **more) -> Light:
    """It shines down."""
    return Light(f"{kind} {x:.2f}", kind, at(x, y, z), strength=more.pop("strength", 20.0), **more)


def grid(count: int = 49, **more) -> tuple[Light, ...]:
    side = int(np.ceil(np.sqrt(count)))
    rng = np.random.default_rng(7)
    places = [
        ((i % side + 0.5) / side * 6 - 3, (i // side + 0.5) / side * 6 - 3) for i in range(count)
    ]
    return tuple(
        lamp(x, y, 2 + rng.uniform(0, 1), color=tuple(rng.uniform(0.2, 1, 3)), **more)
        for x, y in places
    )


def cloud(count: int, height: float, **more) -> tuple[Light, ...]:
    """As many above the floor as below it."""
    rng = np.random.default_rng(5)
    places, colors = (
        rng.uniform(-1, 1, (count, 3)) * (6, 6, height),
        rng.uniform(0.2, 1, (count, 3)),
    )
    return tuple(
        lamp(*place, color=tuple(color), **more)
        for place, color in zip(places, colors, strict=True)
    )


def scene_of(
    lights: tuple[Light, ...], material: Material = MATT, blocks: bool = True, size: int = 24
) -> Scene:
    """A floor with balls on it, seen from above. None of its edges goes through a pixel's centre:
    rounding would decide.
    """
    e = 4.001
    corners = np.array([(-e, -e, 0), (e, -e, 0), (e, e, 0), (-e, e, 0)], np.float32)
    floor = Mesh("floor", corners, np.array([(0, 1, 2), (0, 2, 3)], np.uint32))
    rng = np.random.default_rng(3)
    centers = np.column_stack([rng.uniform(-3, 3, (12, 2)), np.full(12, 0.6)]).astype(np.float32)
    balls = Spheres("balls", centers, np.full(12, 0.35, np.float32))
    down = np.array([[1, 0, 0, 0], [0, 0.8, -0.6, -5.4], [0, 0.6, 0.8, 7.2]])
    camera = Camera("PERSPECTIVE", down, (-0.4, 0.4, -0.4, 0.4), (size, size))
    instances = (
        Instances("floor", 0, at(0, 0, 0)[None], (0,)),
        Instances("balls", 1, at(0, 0, 0)[None], (1,)),
    )
    return Scene(
        camera, (floor, balls), instances if blocks else instances[:1], (material, MATT), (), lights
    )


def under_a_lid(scene: Scene, height: float) -> Scene:
    """That the camera does not see."""
    corners = np.array([(-9, -9, height), (9, -9, height), (9, 9, height), (-9, 9, height)])
    faces = np.array([(0, 1, 2), (0, 2, 3)], np.uint32)
    lid = Mesh("lid", corners.astype(np.float32), faces)
    hidden = Instances("lid", 2, at(0, 0, 0)[None], (0,), visible_camera=False)
    return replace(scene, geometries=(*scene.geometries, lid), instances=(*scene.instances, hidden))


def drawn(scene: Scene, backend: str = "NATIVE", **settings) -> engine.Film:
    return engine.render(scene, Settings(backend=backend, **settings))


def mirror(share: float) -> Material:
    lobes = (Lobe("DIFFUSE", (Input((0.5, 0.5, 0.5)),)), Lobe("MIRROR", (Input((share,) * 3),)))
    return Material(f"mirror {share}", lobes)


def rms(a: np.ndarray) -> float:
    return float(np.sqrt((a.astype(float) ** 2).mean()))


def apart(a: engine.Film, b: engine.Film) -> float:
    return rms(a.combined - b.combined) / rms(b.combined)


SCENES = {
    "points": scene_of(grid()),
    "gloss": scene_of(grid(), GLOSS),
    "balls": scene_of(grid(25, radius=0.3), GLOSS),
    "discs": scene_of(grid(25, radius=0.3, soft_falloff=True), GLOSS),
    "spots": scene_of(grid(kind="SPOT", spot_size=1.4, spot_blend=0.3), GLOSS),
    "areas": scene_of(grid(25, kind="AREA", size_x=0.5, size_y=0.4), GLOSS),
    "ellipses": scene_of(grid(25, kind="AREA", size_x=0.5, size_y=0.4, shape="ELLIPSE"), GLOSS),
    "suns": scene_of(grid(40, kind="SUN", strength=0.2, angle=0.2), GLOSS),
    "mixed": scene_of(
        grid(30) + grid(12, kind="AREA", size_x=0.5, size_y=0.4) + (lamp(0, 0, 5, "SUN"),), GLOSS
    ),
    "clusters": scene_of(grid(81)),
    "clusters of balls": scene_of(grid(81, radius=0.1), GLOSS),
    "clusters of discs": scene_of(grid(81, radius=0.1, soft_falloff=True)),
    "clusters and more": scene_of(
        grid(12, kind="AREA", size_x=0.5, size_y=0.4) + grid(70) + (lamp(0, 0, 5, "SUN"),), GLOSS
    ),
    # the floor's horizon, and the balls', goes through them
    "clusters in the floor": scene_of(cloud(100, 3.0), GLOSS),
    # what the first one reflects is faint: it takes few samples of other lights
    "mirrors": replace(scene_of(grid(81, radius=0.1)), materials=(mirror(0.03), mirror(0.7))),
}


@pytest.mark.parametrize("name", SCENES)
def test_both_tracers_draw_the_same(name: str) -> None:
    passes = {"Cost", "Shadow", "Diffuse Direct", "Glossy Direct"}
    settings = {"samples": 2, "light_samples": 2, "lamp_shadows": 7, "passes": passes}
    films = [drawn(SCENES[name], backend, **settings) for backend in BACKENDS]
    for film in films:
        assert "feature: shared lamp shadows" in film.stats
    for part in passes | {"Combined"}:
        one, other = (film.passes[part].astype(float) for film in films)
        assert np.abs(one - other).max() <= 1e-6 * np.abs(other).max(), part
    shadow = films[0].passes["Shadow"]
    assert (shadow < 0).any()
    assert 0 < films[0].stats["shadow rays"] == films[1].stats["shadow rays"]


def test_coloured_shadows_and_linked_lamps_are_the_same_in_both_tracers() -> None:
    lights = grid()
    linked = tuple(
        replace(light, receivers=0b10 if k % 5 == 0 else light.receivers)
        for k, light in enumerate(lights)
    )
    scene = scene_of(linked, GLOSS)
    scene = replace(
        scene,
        materials=(GLOSS, GLASS),
        instances=(scene.instances[0], replace(scene.instances[1], light_set=1)),
    )
    films = [drawn(scene, backend, samples=2, lamp_shadows=9) for backend in BACKENDS]
    assert apart(*films) < 1e-6
    assert apart(films[0], drawn(scene_of(lights, GLOSS), samples=2, lamp_shadows=9)) > 1e-2


def test_lamps_share_beside_a_sky_bounced_light_and_sheen() -> None:
    """What other lights are set to lights nothing of the lamps' highlights."""
    velvet = Material(
        "velvet",
        (*GLOSS.lobes, Lobe("SHEEN", (Input((0.5, 0.4, 0.3)),), width=0.5, lean=0.3)),
    )
    sky = Light("sky", "DOME", at(0, 0, 0), radiance=np.full((4, 8, 3), 0.1, np.float32))
    scene = scene_of((*grid(), sky), velvet, size=16)
    settings = {"samples": 2, "light_samples": 1, "diffuse_bounces": 1, "lamp_shadows": 8}
    films = [drawn(scene, backend, **settings) for backend in BACKENDS]
    assert apart(*films) < 1e-6


@pytest.mark.parametrize("count", [40, 80])
@pytest.mark.parametrize("backend", BACKENDS)
def test_lamps_at_one_place_are_one_lamp_of_their_power(backend: str, count: int) -> None:
    """With and without clusters."""
    many = tuple(replace(lamp(0.5, 0, 3), name=f"{k}") for k in range(count))
    one = (lamp(0.5, 0, 3, strength=20.0 * count),)
    films = [drawn(scene_of(lights, GLOSS), backend, samples=2) for lights in (many, one)]
    assert "feature: shared lamp shadows" in films[0].stats
    assert apart(*films) < 1e-6


def test_what_nothing_hides_is_exact_with_any_number_of_rays() -> None:
    """Highlights and colours too: one ray in a sample is enough."""
    scene = scene_of(grid(), GLOSS, blocks=False)
    assert (
        apart(drawn(scene, samples=1, lamp_shadows=1), drawn(scene, samples=1, lamp_shadows=0))
        < 1e-6
    )


@pytest.mark.parametrize("material", [MATT, GLOSS])
@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_light_of_clusters_is_that_of_their_lamps(material: Material, radius: float) -> None:
    """In every pixel, highlights and colours too."""
    lights = grid(400, radius=radius, soft_falloff=True)
    scene = scene_of(lights, material, blocks=False, size=48)
    clusters, each = (
        drawn(scene, samples=1, light_samples=4, lamp_shadows=n).combined[..., :3] for n in (1, 0)
    )
    lit = each > 0.1 * each.max()
    assert (clusters != each).any()
    assert np.abs(clusters[lit] / each[lit] - 1).max() < 0.01
    assert rms(clusters - each) < 0.002 * rms(each)


@pytest.mark.parametrize("material", [MATT, GLOSS])
def test_light_of_clusters_that_the_horizon_cuts_is_that_of_lamps_above_it(
    material: Material,
) -> None:
    scene = scene_of(cloud(400, 0.8), material, blocks=False, size=32)
    clusters, each = (
        drawn(scene, samples=1, lamp_shadows=n).combined[..., :3].astype(float) for n in (1, 0)
    )
    lit = each > 0
    assert (clusters != each).any()
    assert abs(clusters.mean() / each.mean() - 1) < 1e-3
    assert rms(clusters[lit] / each[lit] - 1) < 0.0025


def test_the_mean_height_above_a_horizon_is_that_of_what_is_spread_evenly() -> None:
    half, middle = 0.3, np.array([-0.4, -0.2, 0.0, 0.1, 0.29, 0.5])
    spread = middle + half * (2 * (np.arange(1000) + 0.5) / 1000 - 1)[:, None]
    above = np.where(spread > 0, spread, 0.0).mean(0)
    assert np.abs(_mean_above(middle, np.full(6, half)) - above).max() < 1e-6
    up, right = np.eye(3)[2][:, None], np.eye(3)[0][:, None]
    l = middle * up + np.sqrt(1 - middle**2) * right  # noqa: E741
    share, turned = _above_horizon(np.tile(up, 6), l, np.full(6, half))
    assert np.abs(share - (spread > 0).mean(0)).max() < 1e-3
    assert np.abs(share * dot(np.tile(up, 6), turned) - above).max() < 1e-6
    assert np.allclose(length(turned), 1)


@pytest.mark.parametrize("backend", BACKENDS)
def test_bounced_light_that_is_dealt_asks_for_a_quarter_of_the_rays(backend: str) -> None:
    """It is averaged over blocks of four times as many pixels."""
    scene, asked = under_a_lid(scene_of(grid(), size=16), 5), []
    for soft_light in ("SHARED", "DEALT"):
        rays = [
            drawn(
                scene, backend, samples=2, lamp_shadows=16, soft_light=soft_light, diffuse_bounces=n
            ).stats["shadow rays"]
            for n in (0, 1)
        ]
        asked.append(rays[1] - rays[0])
    assert 0.2 < asked[1] / asked[0] < 0.35


def test_shadows_of_clusters_are_as_those_of_each_lamp(monkeypatch: pytest.MonkeyPatch) -> None:
    """Marks within clusters fall on their lamps evenly: pictures come to the truth as fast."""
    scene, counts = scene_of(grid(100), size=32), (4, 16, 64)
    truth = drawn(scene, samples=64, lamp_shadows=0)
    clusters = [apart(drawn(scene, samples=n, lamp_shadows=8), truth) for n in counts]
    monkeypatch.setattr(lamps, "SEEN_EACH", 1000)
    each = [apart(drawn(scene, samples=n, lamp_shadows=8), truth) for n in counts]
    assert clusters != each
    assert all(one < 1.15 * other for one, other in zip(clusters, each, strict=True))


def test_instruction_sets_draw_the_same_clusters() -> None:
    scene = SCENES["clusters and more"]
    assert_instruction_sets_agree(
        lambda: drawn(scene, samples=2, light_samples=2).combined.tobytes()
    )


def test_some_lamps_are_never_in_clusters() -> None:
    lights = grid(100)
    odd = (
        replace(lights[0], strength=-1.0),
        replace(lights[1], strength=0.0),
        replace(lights[2], receivers=0b10),
        replace(lights[3], cast_shadow=False),
        lamp(0, 0, 3, "SPOT"),
    )
    ordered = in_order(odd + lights)
    levels = cluster_levels(ordered)
    assert set(ordered[: len(odd)]) == set(odd)
    assert (levels < 0).tolist() == [True] * len(odd) + [False] * len(lights)
    assert (cluster_levels(lights[:64]) < 0).all()
    films = [drawn(scene_of(odd + lights, size=16), each, samples=1) for each in BACKENDS]
    assert apart(*films) < 1e-6


def test_lamps_of_one_place_are_halved_in_clusters() -> None:
    levels = cluster_levels(tuple(lamp(0, 0, 3) for _ in range(128)))
    assert levels[0] == 0
    assert levels.max() == 7 == levels[64]
    assert (levels[1:] == [(k ^ (k - 1)).bit_length() for k in range(1, 128)]).all()


def test_what_is_hidden_from_all_is_black() -> None:
    scene = under_a_lid(scene_of(grid(), GLOSS), 1.5)
    assert not drawn(scene, samples=2, lamp_shadows=5).combined[..., :3].any()


def test_more_samples_and_more_rays_come_to_a_ray_for_each_lamp() -> None:
    scene = scene_of(grid(), size=32)
    truth = drawn(scene, samples=64, lamp_shadows=0)
    errors = [apart(drawn(scene, samples=n, lamp_shadows=8), truth) for n in (4, 16, 64)]
    assert errors[0] > 1.5 * errors[1] > 2.2 * errors[2]
    assert errors[2] < 0.012
    rays = [apart(drawn(scene, samples=64, lamp_shadows=n), truth) for n in (2, 8, 24)]
    assert rays[0] > 1.5 * rays[1] > 2.2 * rays[2] > 0


def test_light_before_shadows_is_that_of_all_lamps_and_parts_sum_to_combined() -> None:
    passes = {"Diffuse", "Specular", "Shadow"}
    shared, each = (
        drawn(SCENES["areas"], samples=2, light_samples=2, lamp_shadows=n, passes=passes)
        for n in (6, 0)
    )
    for name in ("Diffuse", "Specular"):
        assert rms(shared.passes[name] - each.passes[name]) < 1e-6 * rms(each.passes[name])
    total = sum(shared.passes[name].astype(float) for name in passes)
    assert np.abs(total - shared.combined[..., :3]).max() < 1e-6 * total.max()
    alone = drawn(SCENES["areas"], samples=2, light_samples=2, lamp_shadows=6)
    assert apart(shared, alone) < 1e-6


@pytest.mark.parametrize(
    "name", ["mixed", "clusters and more", "clusters of balls", "clusters in the floor", "mirrors"]
)
def test_regions_threads_and_waves_change_no_bit(name: str) -> None:
    scene, settings = SCENES[name], {"samples": 8, "light_samples": 2, "error_threshold": 2.0}
    whole = drawn(scene, **settings, threads=1)
    assert (drawn(scene, **settings, threads=2).combined == whole.combined).all()
    part = drawn(scene, **settings, region=(3, 5, 17, 22)).combined
    assert (part == whole.combined[5:22, 3:17]).all()
    watched = engine.render(scene, Settings(**settings), on_wave=lambda film: None)
    assert (watched.combined == whole.combined).all()


def test_few_lamps_have_a_ray_each() -> None:
    """Up to twice as many samples as rays: the same bits as without sharing."""
    scene = scene_of(grid(32), GLOSS)
    films = [drawn(scene, samples=2, lamp_shadows=n) for n in (16, 0)]
    assert (films[0].combined == films[1].combined).all()
    assert films[0].stats["shadow rays"] == films[1].stats["shadow rays"]
    assert shared_samples(scene.lights, Settings()) == 0


@pytest.mark.parametrize("kind", ["SPOT", "AREA", "SUN"])
def test_lamps_that_reach_nothing_change_nothing(kind: str) -> None:
    """Cones that pass by, backs, and what shines from below: no ray, no bit."""
    lights = grid(49)
    up = np.diag([1.0, -1.0, -1.0])
    away = tuple(
        Light(
            f"away {k}",
            kind,
            np.column_stack([up, light.world_from_light[:, 3]]),
            strength=50.0,
            spot_size=0.5,
            size_x=0.2,
            size_y=0.2,
        )
        for k, light in enumerate(lights)
    )
    flat = {"blocks": False}
    films = [
        drawn(scene_of(some, GLOSS, **flat), samples=2, light_samples=1)
        for some in (lights, lights + away)
    ]
    assert (films[0].combined == films[1].combined).all()
    assert films[0].stats["shadow rays"] == films[1].stats["shadow rays"]


def test_lamps_with_programs_or_without_shadows_have_no_share() -> None:
    lights = tuple(replace(light, cast_shadow=False) for light in grid())
    assert shared_samples(lights, Settings()) == 0
    mixed = lights + grid(40)
    assert shared_samples(mixed, Settings()) == 40
    films = [drawn(scene_of(mixed), backend, samples=2) for backend in BACKENDS]
    assert apart(*films) < 1e-6


def test_many_lamps_are_in_the_order_of_a_curve() -> None:
    lights = grid()
    order = np.random.default_rng(1).permutation(len(lights))
    shuffled = tuple(lights[k] for k in order)
    assert in_order(shuffled) == in_order(lights)
    assert in_order(shuffled[:16]) == shuffled[:16]
    a, b = (drawn(scene_of(some), samples=2) for some in (lights, shuffled))
    assert (a.combined == b.combined).all()


def test_marks_lie_in_proportion_to_light() -> None:
    rng = np.random.default_rng(5)
    given = rng.uniform(0, 1, (30, 50)) ** 4
    times = np.mean([choose(given, 8, sample) for sample in range(256)], 0)
    assert (np.stack([choose(given, 8, s).sum(0) for s in range(8)]) == 8).all()
    assert np.abs(times - 8 * given / given.sum(0)).max() < 1 / 256 + 1e-9
    offsets = sorted(first_mark(sample) for sample in range(16))
    assert np.allclose(np.diff(offsets), 1 / 16)
    assert not choose(np.zeros((3, 2)), 8, 0).any()


def test_negative_and_huge_lamps_give_finite_pixels() -> None:
    lights = grid(40) + (lamp(0, 0, 2, strength=-300.0), lamp(1, 1, 2, strength=1e38))
    films = [drawn(scene_of(lights, GLOSS), backend, samples=1) for backend in BACKENDS]
    assert all(np.isfinite(film.combined).all() for film in films)


def test_explain_pixel_tells_of_shared_shadows() -> None:
    scene = scene_of(grid())
    text = engine.explanation_lines(engine.PixelExplainer(scene, Settings()).pixel(12, 12))[0]
    assert "16 of 49 samples of lamps" in text
    few = scene_of(grid(4))
    assert (
        "samples of lamps"
        not in engine.explanation_lines(engine.PixelExplainer(few, Settings()).pixel(12, 12))[0]
    )


def test_samples_of_few_soft_lamps_are_not_shared() -> None:
    """What counts is lamps: light samples are what was asked for of each."""
    scene = SCENES["areas"]
    few = replace(scene, lights=tuple(light for light in scene.lights if may_share(light))[:9])
    films = [drawn(few, samples=2, light_samples=8, lamp_shadows=n) for n in (16, 0)]
    assert (films[0].combined == films[1].combined).all()
    assert films[0].stats["shadow rays"] == films[1].stats["shadow rays"]


def test_more_light_samples_are_more_rays_of_many_soft_lamps() -> None:
    scene = SCENES["areas"]
    asked = [shared_rays(scene.lights, Settings(light_samples=n, lamp_shadows=6)) for n in (1, 3)]
    assert asked == [6, 18]
