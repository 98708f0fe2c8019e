"""Rough surfaces that reflect others: against the sky of the same light, one tracer beside the
other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.sampling import lobe_points, patterns
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
    World,
)

BACKENDS = ("NATIVE", "NUMPY")


def metal(exponent: float, k: float = 1.0, **more) -> Material:
    """A highlight that gives about as much as it gets, of GGX's masking."""
    scale = k * (exponent + 2) / 8
    lobe = Lobe("SPECULAR", (Input((scale,) * 3),), exponent=exponent, masking=0.3, **more)
    return Material("metal", (lobe,))


def glowing(value: float) -> Material:
    return Material("glow", (Lobe("EMISSION", (Input((value,) * 3),)),))


def camera(resolution: int = 12) -> Camera:
    """Looks at the origin from 45° above."""
    s = np.sqrt(0.5)
    matrix = np.array([[1, 0, 0, 0], [0, s, -s, -2], [0, s, s, 2]])
    return Camera("PERSPECTIVE", matrix, (-0.35, 0.35, -0.35, 0.35), (resolution, resolution))


def placed(number: int, **more) -> Instances:
    return Instances(f"thing {number}", number, np.eye(3, 4)[None], (number,), **more)


def square(*corners) -> Mesh:
    return Mesh(
        "square", np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    )


TABLE = square((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0))
WALL = square((-3, 1, 0), (-3, 1, 3), (3, 1, 3), (3, 1, 0))


def drawn(scene: Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    chosen = {"samples": 64, "light_samples": 2, "filter_width": 0.0, "max_bounces": 2}
    film = render(scene, Settings(**chosen | settings, backend=backend))
    return film.passes["Combined"][..., :3]


def enclosed(material: Material) -> Scene:
    """A table in a hollow ball that glows, which the camera does not see."""
    ball = Spheres("ball", np.zeros((1, 3), np.float32), np.array([50], np.float32))
    things = (placed(0), placed(1, visible_camera=False))
    return Scene(camera(), (TABLE, ball), things, (material, glowing(0.5)))


def under_a_sky(material: Material) -> Scene:
    sky = Light("sky", "DOME", np.eye(3, 4), radiance=np.full((1, 1, 3), 0.5, np.float32))
    return Scene(camera(), (TABLE,), (placed(0),), (material,), (), (sky,))


@pytest.mark.parametrize("exponent", [5.0, 100.0, 5000.0])
def test_a_metal_shows_surfaces_as_it_shows_the_sky(exponent):
    """By the core; and both tracers along the same rays, pixel by pixel."""
    sky = drawn(under_a_sky(metal(exponent)), samples=1024)
    dealt = {"mesh_light": "OFF", "soft_light": "DEALT"}
    few = [drawn(enclosed(metal(exponent)), x, samples=4, **dealt) for x in BACKENDS]
    np.testing.assert_allclose(*few, rtol=1e-5)
    reflected = drawn(enclosed(metal(exponent)), samples=256, **dealt)
    assert sky.mean() > 0.2
    blocks = [picture.reshape(3, 4, 3, 4, 3).mean((1, 3)) for picture in (reflected, sky)]
    np.testing.assert_allclose(*blocks, rtol=0.01)  # among whose pixels directions are dealt


@pytest.mark.parametrize("exponent", [20.0, 100.0, 5000.0])
def test_what_glows_is_not_counted_twice(exponent):
    """As a light it has highlights: reflected rays leave it out."""
    alone = drawn(enclosed(metal(exponent)), max_bounces=0, samples=256)
    np.testing.assert_array_equal(drawn(enclosed(metal(exponent)), samples=256), alone)
    seen = drawn(enclosed(metal(exponent)), mesh_light="OFF", samples=256)
    np.testing.assert_allclose(alone, seen, rtol=0.03)


def test_the_sky_is_not_counted_twice():
    scene = under_a_sky(metal(100.0))
    np.testing.assert_array_equal(drawn(scene), drawn(scene, max_bounces=0))


def behind_glass(*passed: Lobe) -> Scene:
    """A metal table under a sky, in a hollow ball that refracts 0.6 of what is behind it straight
    on, which the camera does not see. passed: its other lobes.
    """
    scene = under_a_sky(metal(100.0))
    ball = Spheres("ball", np.zeros((1, 3), np.float32), np.array([50], np.float32))
    glass = Material("glass", (Lobe("REFRACTION", (Input((0.6,) * 3),), ior=1.0), *passed))
    things = (placed(0), placed(1, visible_camera=False))
    return replace(
        scene,
        geometries=(TABLE, ball),
        instances=things,
        materials=(*scene.materials, glass),
        world=World(background=(0.5, 0.5, 0.5)),
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_sky_behind_glass_is_not_counted_twice(backend):
    """Shadow rays see it where they pass the glass, and reflected rays where they do not."""
    part = {"region": (4, 4, 8, 8)} if backend == "NUMPY" else {}
    few = {"samples": {"NATIVE": 32, "NUMPY": 4}[backend], "backend": backend, **part}
    clear = Lobe("TRANSPARENT", (Input((0.3,) * 3),))
    lit = drawn(behind_glass(clear), max_bounces=0, **few)
    assert lit.mean() > 0.06
    np.testing.assert_array_equal(drawn(behind_glass(clear), **few), lit)
    seen = drawn(behind_glass(), backend, samples=256 if backend == "NATIVE" else 32, **part)
    assert drawn(behind_glass(), max_bounces=0, **few).max() == 0
    np.testing.assert_allclose(
        seen, drawn(under_a_sky(metal(100.0)), samples=1024, **part) * 0.6, rtol=0.02
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_mirror_shows_gloss_the_sky_behind_glass(backend):
    """No shadow ray finds it there."""
    clear, mirror = Lobe("TRANSPARENT", (Input((0.3,) * 3),)), Lobe("MIRROR", (Input((0.5,) * 3),))
    samples = {"NATIVE": 32, "NUMPY": 8}[backend]  # of the same directions in both
    few = {"samples": samples, "max_bounces": 3, "backend": backend}
    scene = behind_glass(clear)
    walled = replace(
        scene,
        geometries=(*scene.geometries, WALL),
        instances=(*scene.instances, placed(2, visible_shadow=False, visible_camera=False)),
        materials=(*scene.materials, Material("mirror", (mirror,))),
    )
    added = drawn(walled, **few) - drawn(walled, **few | {"max_bounces": 0})
    plain = replace(walled, instances=(walled.instances[0], walled.instances[2]))
    bare = drawn(plain, **few) - drawn(plain, **few | {"max_bounces": 0})
    assert bare.max() > 0.05
    np.testing.assert_allclose(added, 0.9 * bare, rtol=1e-4, atol=1e-6)


def room(material: Material, **world) -> Scene:
    """A table before a wall under a lamp that is seen."""
    lamp = np.array([[1.0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 1, 3]])
    light = Light("lamp", "POINT", lamp, strength=300.0, radius=0.2, visible_mirror=True)
    paint = Material("paint", (Lobe("DIFFUSE", (Input((0.8, 0.3, 0.1)),)), Lobe("AMBIENT")))
    things = (placed(0), placed(1))
    return Scene(camera(24), (TABLE, WALL), things, (material, paint), (), (light,), World(**world))


@pytest.mark.parametrize("exponent", [5.0, 100.0, 5000.0])
def test_both_tracers_reflect_the_same(exponent):
    scene = room(metal(exponent), ambient=(0.1, 0.1, 0.1), background=(0.2, 0.3, 0.4))
    settings = {"samples": 8, "filter_width": 1.5, "max_bounces": 3}
    core, reference = (drawn(scene, backend, **settings) for backend in BACKENDS)
    assert np.abs(reference - drawn(scene, max_bounces=0, samples=8)).max() > 0.05
    wrong = np.abs(core - reference) > 1e-4 * (1 + np.abs(reference))
    assert wrong.any(2).mean() <= 0.004  # a pixel at an edge may turn


def test_highlights_on_the_way_are_as_wide_as_the_narrowest_lobe() -> None:
    """Also of directions that are drawn from wide ones beside it, in both tracers."""
    narrow, wide = metal(300.0).lobes[0], metal(4.0).lobes[0]
    before = replace(room(metal(2000.0)), materials=(Material("both", (narrow, wide)), metal(2e3)))
    few = {"samples": 16, "max_bounces": 3}
    core, reference = (drawn(before, backend, **few) for backend in BACKENDS)
    wrong = np.abs(core - reference) > 1e-4 * (1 + np.abs(reference))
    assert wrong.any(2).mean() <= 0.004  # a pixel at an edge may turn
    assert np.abs(core - drawn(before, **few, reflections="OFF")).max() > 0.01


def mutual(exponent: float) -> Scene:
    """Metal before metal, with something to see."""
    scene = room(metal(exponent, 0.8))
    behind = square((-9, -6, -1), (9, -6, -1), (9, -6, 9), (-9, -6, 9))
    paint = Material("paint", (Lobe("DIFFUSE", (Input((0.1, 0.3, 0.8)),)),))
    return replace(
        scene,
        geometries=(*scene.geometries, behind),
        instances=(scene.instances[0], replace(scene.instances[1], materials=(0,)), placed(2)),
        materials=(*scene.materials, paint),
    )


def test_metal_reflects_metal():
    wanted = mutual(60.0)
    core, reference = (drawn(wanted, b, samples=4, max_bounces=4) for b in BACKENDS)
    once = drawn(wanted, samples=4, max_bounces=1)
    assert np.abs(reference - once).max() > 0.02
    wrong = np.abs(core - reference) > 1e-4 * (1 + np.abs(reference))
    assert wrong.any(2).mean() <= 0.01


def test_the_sky_that_metal_shows_of_metal_does_not_depend_on_light_samples() -> None:
    """What rough metal shows takes the sky's directions in parts, of which highlights draw as many
    of their own as each of these stands for.
    """
    both = (placed(0), replace(placed(1), materials=(0,)))
    scene = replace(under_a_sky(metal(60.0, 0.9)), geometries=(TABLE, WALL), instances=both)
    dealt = {"samples": 16, "soft_light": "DEALT"}
    few, many = (drawn(scene, **dealt, light_samples=n)[:6].mean() for n in (2, 16))
    alone = drawn(scene, **dealt, max_bounces=0)[:6].mean()
    assert many > 1.2 * alone  # the wall is seen
    assert few == pytest.approx(many, rel=0.02)
    core, reference = (drawn(scene, x, **dealt | {"samples": 2}) for x in BACKENDS)
    wrong = np.abs(core - reference) > 1e-4 * (1 + np.abs(reference))
    assert wrong.any(2).mean() <= 0.01


def test_bits_are_the_same_for_all_threads_and_regions():
    scene = mutual(60.0)
    whole = drawn(scene, samples=16, threads=1)
    np.testing.assert_array_equal(whole, drawn(scene, samples=16, threads=3))
    part = drawn(scene, samples=16, region=(5, 7, 19, 20))
    np.testing.assert_array_equal(part, whole[7:20, 5:19])


@pytest.mark.parametrize("setting", [{"reflections": "OFF"}, {"max_bounces": 0}])
def test_it_can_be_off(setting):
    scene = room(metal(100.0))
    none = drawn(replace(scene, materials=(metal(100.0), glowing(0.0))), **setting)
    assert np.abs(drawn(scene, **setting) - none)[:8].max() < 1e-6


def test_plastic_reflects_where_all_do():
    plastic = metal(100.0, ior=1.5, fresnel=True)
    scene = room(plastic)
    off, metals, everything = (
        drawn(scene, reflections=which) for which in ("OFF", "METALS", "ALL")
    )
    np.testing.assert_array_equal(off, metals)
    assert np.abs(everything - off).max() > 0.01


def test_explain_follows_reflected_rays():
    scene, settings = mutual(60.0), Settings(samples=1, filter_width=0.0, max_bounces=3)
    explainer = PixelExplainer(scene, settings)
    picture = render(scene, settings).passes["Combined"]
    kinds = set()
    for x, y in ((12, 12), (5, 20), (20, 9)):
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-4, atol=1e-6)
        while ray.follow:
            ray = ray.follow[0]
            kinds.add(ray.kind)
    assert kinds == {"reflection"}


def test_reflections_of_a_path_are_independent():
    """Of each quarter of the disc at one reflection as many points lie in each at another. All runs
    of four samples but that with the middle have two on either side.
    """
    points = lobe_points(1024)
    quarter = (points[..., 0] > 0) + 2 * (points[..., 1] > 0)
    for first in range(3):
        for second in range(first + 1, 4):
            pairs = np.bincount(4 * quarter[first] + quarter[second], minlength=16)
            assert np.abs(pairs - 64).max() < 4 * np.sqrt(64), pairs  # four standard deviations
    for level in points:
        runs = level.reshape(-1, 4, 2)
        halves = (runs > 0).sum(1)[(runs != 0).any(2).all(1)]
        assert len(halves) == 255 and (halves == 2).all()


def test_points_begin_again(monkeypatch):
    monkeypatch.setattr(patterns, "MOST_LOBE_POINTS", 4)
    monkeypatch.setattr(patterns, "LOBE_LEVELS", 2)
    wanted = mutual(60.0)
    core, reference = (drawn(wanted, b, samples=16, max_bounces=4) for b in BACKENDS)
    wrong = np.abs(core - reference) > 1e-4 * (1 + np.abs(reference))
    assert wrong.any(2).mean() <= 0.01


def room_of_metals() -> Scene:
    """A dull table between two shining walls, a lamp over it."""
    behind = square((-3, -3, 0), (3, -3, 0), (3, -3, 3), (-3, -3, 3))
    lamp = Light("lamp", "POINT", np.c_[np.eye(3), [0.5, -0.5, 1.5]], strength=50.0)
    materials = (metal(4.0), metal(300.0), metal(300.0))
    things = tuple(placed(k) for k in range(3))
    return Scene(camera(), (TABLE, WALL, behind), things, materials, (), (lamp,))


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_rough_metals_reflect_is_glossy(backend):
    passes = frozenset({"Glossy Indirect", "Transmission Indirect", "Transmission Direct"})
    plan = {"samples": 4, "filter_width": 0.0, "max_bounces": 2, "reflections": "ALL"}
    found = render(room_of_metals(), Settings(passes=passes, backend=backend, **plan)).passes
    assert found["Glossy Indirect"].any()
    assert not found["Transmission Indirect"].any() and not found["Transmission Direct"].any()


# --- before mirrors and glass


FLOOR = square((-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0))
PAINTED = square((-4, 1, 0), (-4, 1, 3), (4, 1, 3), (4, 1, 0))
# the floor shows nothing but what it reflects
LAMP = Light("lamp", "POINT", np.c_[np.eye(3), [0.5, -0.5, 0.8]], strength=4e3, lights_gloss=False)


def tinted(color: tuple[float, ...], exponent: float = 40.0) -> Material:
    (lobe,) = metal(exponent).lobes
    return Material("metal", (replace(lobe, factors=(Input(color),)),))


def paint(*color: float) -> Material:
    return Material("paint", (Lobe("DIFFUSE", (Input(color),)),))


def above(size: tuple[int, int], half: float = 0.9) -> Camera:
    """Looks down on the floor before the wall."""
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 2.5)])
    width = half * size[0] / size[1]
    return Camera("ORTHOGRAPHIC", frame, (-width, width, -half, half), size)


def floor_before_wall(size: tuple[int, int] = (24, 20), *more: Lobe) -> Scene:
    """A dull metal floor beside a painted wall, which has a mirror or glass in front of some."""
    front = square((-4, 0.95, 0), (-4, 0.95, 3), (0, 0.95, 3), (0, 0.95, 0))
    things = [Instances(f"{k}", k, np.eye(3, 4)[None], (k,)) for k in range(2)]
    materials = [tinted((0.9, 0.7, 0.4)), paint(0.2, 0.5, 0.8)]
    geometries = [FLOOR, PAINTED]
    if more:
        geometries.append(front)
        things.append(Instances("front", 2, np.eye(3, 4)[None], (2,)))
        materials.append(Material("front", more))
    return Scene(above(size), tuple(geometries), tuple(things), tuple(materials), (), (LAMP,))


FRONTS = {
    "alone": (),
    "mirror": (Lobe("MIRROR", (Input((0.8, 0.8, 0.8)),)),),
    "glass": (
        Lobe("REFRACTION", (Input((0.6, 0.8, 0.8)),), ior=1.4),
        Lobe("MIRROR", (Input((0.3, 0.3, 0.3)),)),
    ),
    "clear": (
        Lobe("TRANSPARENT", (Input((0.5, 0.6, 0.5)),)),
        Lobe("DIFFUSE", (Input((0.1, 0.1, 0.1)),)),
    ),
}
PASSES = frozenset({"Mirror", "Glossy Direct", "Glossy Indirect", "Diffuse Direct", "Cost"})


@pytest.mark.parametrize("front", FRONTS)
def test_both_tracers_reflect_the_same_behind_others(front: str) -> None:
    """Straight on, and in what a mirror, glass or a pane before the wall shows: all passes."""
    scene = floor_before_wall((35, 11), *FRONTS[front])
    named = replace(LAMP, light_group=0)
    scene = replace(scene, lights=(named,), light_groups=("lamps",))
    plan = {"samples": 8, "filter_width": 0.0, "max_bounces": 4, "reflections": "ALL"}
    core, reference = (
        render(scene, Settings(**plan, passes=PASSES, backend=b)).passes for b in BACKENDS
    )
    assert core.keys() == reference.keys()
    assert reference["Glossy Indirect"].any()
    for name in core:
        wrong = np.abs(core[name] - reference[name]) > 1e-4 * (1 + np.abs(reference[name]))
        assert wrong.mean() <= 0.01, name  # rays may turn at an edge
    lit = [name for name in core if "lamps" in name]
    assert lit
    np.testing.assert_allclose(
        core[lit[0]][..., :3], core["Combined"][..., :3], rtol=1e-5, atol=1e-6
    )


def two_metals(left: tuple[float, ...], right: tuple[float, ...]) -> Scene:
    """In one plane: 7 columns of pixels of the one, 5 of the other."""
    scene, edge = floor_before_wall((12, 12)), 0.015
    floors = (
        square((-4, -4, 0), (edge, -4, 0), (edge, 4, 0), (-4, 4, 0)),
        square((edge, -4, 0), (4, -4, 0), (4, 4, 0), (edge, 4, 0)),
    )
    return replace(
        scene,
        camera=above((12, 12), 0.09),
        geometries=(floors[0], PAINTED, floors[1]),
        instances=(*scene.instances, Instances("right", 2, np.eye(3, 4)[None], (2,))),
        materials=(tinted(left), scene.materials[1], tinted(right)),
    )


@pytest.mark.parametrize("soft_light", ["SHARED", "RESOLVED"])
@pytest.mark.parametrize("backend", BACKENDS)
def test_each_pixel_gives_back_in_its_own_color(backend: str, soft_light: str) -> None:
    """Beside a metal of another color as much as if all were like it; averaging mixes no colors of
    metals.
    """
    plan = {"samples": 16, "max_bounces": 4, "soft_light": soft_light}
    left, right = (0.9, 0.6, 0.0), (0.0, 0.3, 0.8)
    found = drawn(two_metals(left, right), backend, **plan)
    assert found.max() > 0.05
    for color, columns in ((left, slice(0, 7)), (right, slice(7, 12))):
        alone = drawn(two_metals(color, color), backend, **plan)
        assert not found[:, columns][..., np.array(color) == 0].any()
        near = {"rtol": 2e-5, "atol": 1e-7} if soft_light == "SHARED" else {"rtol": 0.2}
        np.testing.assert_allclose(found[:, columns], alone[:, columns], **near)


@pytest.mark.parametrize("front", FRONTS)
def test_explain_tells_what_is_reflected_behind_others(front: str) -> None:
    """Under a roof: the first sample's place is where the normal mirrors."""
    scene = floor_before_wall((13, 11), *FRONTS[front])
    roof = square((-4, -4, 3), (4, -4, 3), (4, 4, 3), (-4, 4, 3))
    number = len(scene.geometries)
    scene = replace(
        scene,
        geometries=(*scene.geometries, roof),
        instances=(*scene.instances, Instances("roof", number, np.eye(3, 4)[None], (1,))),
    )
    plan = Settings(samples=1, filter_width=0.0, max_bounces=4, reflections="ALL")
    picture = render(scene, plan).passes["Combined"]
    explainer = PixelExplainer(scene, plan)
    lit = 0
    for x in range(0, 13, 2):
        for y in (0, 7, 8, 9, 10):
            ray = explainer.pixel(x, y)
            np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-4, atol=1e-6)
            lit += any(after.kind == "reflection" and any(after.color) for after in ray.follow)
    assert lit >= 5
