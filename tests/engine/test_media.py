"""What light loses in media (semantics/media.md): Beer and Lambert's law in closed form, and the
core against the reference.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import added, room
from bounced_scenes import lamp as bulb
from engine_scenes import at, ball_mesh, box_mesh, constant, grid_mesh, surface
from glint import engine
from glint.engine import scene as s
from glint.engine.scene.problems import scene_problems
from media_scenes import DENSE, GLASS, both, filled, orthographic, rich, things

SIGMA = np.array(DENSE.absorption)
WHITE = s.World(background=(1.0, 1.0, 1.0))
BACKENDS = ("NATIVE", "NUMPY")
INSIDE = filled("inside")


def seen(scene: s.Scene, backend: str, **settings) -> np.ndarray:
    """(h, w, 3) float64 through the pixels' centres."""
    plan = {"samples": 1, "light_samples": 1, "backend": backend, **settings}
    return engine.render(scene, engine.Settings(**plan)).combined[..., :3].astype(float)


def centers(size: int = 16, half: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """x and y (size, size) of what the pixels of `orthographic` see."""
    line = half * ((2 * np.arange(size) + 1) / size - 1)
    return np.meshgrid(line, line)


def lamp_above(kind: str, height: float, turned: bool = False, **more) -> s.Light:
    """It shines down, or up."""
    axes = np.diag([1.0, -1.0, -1.0]) if turned else np.eye(3)
    return s.Light(kind, kind, np.column_stack([axes, (0.0, 0.0, height)]), **more)


def assert_passed(picture: np.ndarray, way: np.ndarray, sigma: np.ndarray = SIGMA) -> None:
    """The white of the surroundings is seen through `way` (h, w) of a medium."""
    np.testing.assert_allclose(picture, np.exp(-way[..., None] * sigma), atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_through_a_box_and_a_ball(backend: str) -> None:
    x, y = centers()
    in_box = 2.0 * ((np.abs(x) < 1) & (np.abs(y) < 1))
    scene = things((box_mesh(), at(), INSIDE), camera=orthographic(), world=WHITE)
    assert_passed(seen(scene, backend), in_box)
    sphere = s.Spheres("ball", np.zeros((1, 3), np.float32), np.array([1.5], np.float32))
    in_ball = 2 * np.sqrt(np.maximum(1.5**2 - x * x - y * y, 0.0))
    scene = things((sphere, at(), INSIDE), camera=orthographic(), world=WHITE)
    assert_passed(seen(scene, backend), in_ball)
    across = things((sphere, at(), INSIDE), (box_mesh(), at(), INSIDE), camera=orthographic())
    assert_passed(seen(replace(across, world=WHITE), backend), in_ball + in_box)


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_through_edges_and_corners(backend: str) -> None:
    """Each pixel's centre lies above an edge of the box, or a diagonal of its faces."""
    camera = replace(orthographic(size=(5, 5)), window=(-2.5, 2.5, -2.5, 2.5))
    scene = things((box_mesh(), at(), INSIDE), camera=camera, world=WHITE)
    picture = seen(scene, backend)
    assert_passed(picture[2, 2], np.array(2.0))
    outside = np.ones((5, 5), bool)
    outside[1:4, 1:4] = False
    np.testing.assert_array_equal(picture[outside], 1.0)
    way = -np.log(picture) / SIGMA
    assert ((way > -1e-6) & (way < 2 + 1e-6)).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 2, 0.5), (1, 1, 0)])
def test_scaled_mirrored_and_flat(backend: str, scale: tuple[float, ...]) -> None:
    matrix = at(linear=np.diag(np.array(scale, float)))
    scene = things((box_mesh(), matrix, INSIDE), camera=orthographic(), world=WHITE)
    x, y = centers()
    inside = (np.abs(x) < abs(scale[0])) & (np.abs(y) < abs(scale[1]))
    assert_passed(seen(scene, backend), 2 * scale[2] * inside)


@pytest.mark.parametrize("backend", BACKENDS)
def test_nested_and_touching(backend: str) -> None:
    """A box in a box, and one that stands on it: media add up."""
    other = filled("other", s.Medium((1.0, 0.5, 0.25)))
    scene = things(
        (box_mesh(), at(), INSIDE),
        (box_mesh(), at(linear=0.5), other),
        (box_mesh(), at((0.0, 0.0, 2.0)), other),
        camera=orthographic(size=(4, 4), half=0.4),
        world=WHITE,
    )
    sigma = 2 * SIGMA + (1 + 2) * np.array(other.medium.absorption)
    np.testing.assert_allclose(seen(scene, backend), np.broadcast_to(np.exp(-sigma), (4, 4, 3)))


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_camera_inside(backend: str) -> None:
    """From the middle of a box, and of what wears nothing that is seen."""
    scene = things(
        (box_mesh(), at(), INSIDE),
        (box_mesh(), at(linear=3.0), INSIDE),
        camera=orthographic((0.0, 0.0, 0.25), size=(4, 4), half=0.5),
        world=WHITE,
    )
    assert_passed(seen(scene, backend), np.full((4, 4), 1.25 + 3.25))


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_world_of_it(backend: str) -> None:
    """Black where nothing is hit; else by the distance, in mirrors too."""
    mirror = s.Material("mirror", (s.Lobe("MIRROR", constant(1.0)),))
    glow = s.Material("glow", (s.Lobe("EMISSION", constant(1.0)),))
    scene = things(
        (grid_mesh(extent=1.0), at(), mirror),
        (grid_mesh(extent=8.0), at((0.0, 0.0, 12.0)), glow),
        camera=orthographic(),
        world=replace(WHITE, medium=s.Medium((0.05, 0.1, 0.2))),
    )
    x, y = centers()
    met = (np.abs(x) < 1) & (np.abs(y) < 1)
    picture = seen(scene, backend)
    assert not picture[~met].any()
    expected = np.exp(-np.array([0.05, 0.1, 0.2]) * (9 + 12))
    np.testing.assert_allclose(picture[met], np.broadcast_to(expected, (met.sum(), 3)), atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["SUN", "POINT"])
def test_shadows(backend: str, kind: str) -> None:
    """Light comes to a floor through a slab; what does not cast shadows is not dimmed."""
    lamp = lamp_above(kind, 6.0, strength=100.0)
    scene = things(
        (grid_mesh(extent=9.0), at((0.0, 0.0, -3.0)), surface()),
        (box_mesh(), at(linear=np.diag([5.0, 5.0, 1.0])), INSIDE),
        camera=orthographic((0.0, 0.0, -2.0)),
        lights=(lamp,),
    )
    lit = seen(scene, backend)
    free = seen(replace(scene, lights=(replace(lamp, cast_shadow=False),)), backend)
    x, y = centers()
    way = 2.0 * (np.sqrt(x * x + y * y + 81) / 9 if kind == "POINT" else np.ones_like(x))
    np.testing.assert_allclose(lit / free, np.exp(-way[..., None] * SIGMA), rtol=2e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_refracted_rays(backend: str) -> None:
    """Straight through glass as dense as air, and back from its inside."""
    glass = filled("glass", DENSE, (s.Lobe("REFRACTION", constant(1.0), ior=1.0),))
    scene = things((box_mesh(), at(), glass), camera=orthographic(), world=WHITE)
    x, y = centers()
    assert_passed(seen(scene, backend), 2.0 * ((np.abs(x) < 1) & (np.abs(y) < 1)))


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_lights_show_of_themselves_is_dimmed(backend: str) -> None:
    lamp = lamp_above("AREA", -3.0, size_x=8.0, size_y=8.0, visible_camera=True, turned=True)
    scene = things((box_mesh(), at(), INSIDE), camera=orthographic(), lights=(lamp,))
    free = seen(replace(scene, instances=()), backend)
    x, y = centers()
    assert free.min() > 0
    assert_passed(seen(scene, backend) / free, 2.0 * ((np.abs(x) < 1) & (np.abs(y) < 1)))


@pytest.mark.parametrize("backend", BACKENDS)
def test_alpha(backend: str) -> None:
    """What a medium hides of the surroundings it covers."""
    scene = things((box_mesh(), at(), INSIDE), camera=orthographic())
    scene = replace(scene, world=replace(WHITE, transparent=True))
    film = engine.render(scene, engine.Settings(samples=1, backend=backend))
    inside = film.combined[8, 8]
    np.testing.assert_allclose(inside, [0, 0, 0, 1 - np.exp(-2 * SIGMA).mean()], atol=1e-6)
    assert film.combined[0, 0, 3] == 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_open_surfaces_hold_it_within_their_own_bounds(backend: str) -> None:
    """A box without the side where rays leave it holds nothing, one without its near side what it
    bounds; a lone square nothing.
    """
    box = box_mesh()
    corners = box.vertices[box.triangles][:, :, 2]
    for z in (-1, 1):
        rest = replace(box, triangles=box.triangles[~(corners == z).all(1)])
        scene = things((rest, at(), INSIDE), camera=orthographic(), world=WHITE)
        x, y = centers()
        inside = (np.abs(x) < 1) & (np.abs(y) < 1)
        assert_passed(seen(scene, backend), (2.0 if z > 0 else 0.0) * inside)
    scene = things((grid_mesh(extent=1.0), at(), INSIDE), camera=orthographic(), world=WHITE)
    np.testing.assert_array_equal(seen(scene, backend), 1.0)


@pytest.mark.parametrize("sigma", [0.0, 1e-30, 1e30])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_extreme_densities_and_sizes(sigma: float, scale: float) -> None:
    medium = s.Medium((sigma, sigma, sigma))
    base = orthographic((0.0, 0.0, 9.0 * scale), half=2.0 * scale)
    scene = things((box_mesh(), at(linear=scale), filled("x", medium)), camera=base, world=WHITE)
    for world in (WHITE, replace(WHITE, medium=medium)):
        pictures = [seen(replace(scene, world=world), backend) for backend in BACKENDS]
        np.testing.assert_array_equal(*pictures)
        expected = 1.0 if sigma * scale < 1 and (world is WHITE or sigma == 0) else 0.0
        np.testing.assert_allclose(pictures[0][8, 8], expected, atol=1e-6)


def test_the_core_against_the_reference() -> None:
    native, reference = both(rich(), samples=2, light_samples=2)
    np.testing.assert_allclose(native.combined, reference.combined, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("count", [9, 17, 40])
def test_media_that_coincide_add_up(count: int) -> None:
    """More than the core finds at a time at one distance, twice of each where triangles meet."""
    box, x_y = box_mesh(), centers(8)
    thin = [
        filled(f"medium {k}", s.Medium((0.9 / count, k * 1e-3, 2 / count))) for k in range(count)
    ]
    sigma = np.sum([material.medium.absorption for material in thin], 0)
    way = 2.0 * ((np.abs(x_y[0]) < 1) & (np.abs(x_y[1]) < 1))
    scene = things(
        *((box, at(), material) for material in thin),
        camera=orthographic(size=(8, 8)),
        world=WHITE,
    )
    for backend in BACKENDS:
        assert_passed(seen(scene, backend, max_bounces=64), way, sigma)


def test_balls_that_coincide_add_up() -> None:
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.array([1.5], np.float32))
    thin = [filled(f"medium {k}", s.Medium((0.05, 0.01, 0.1))) for k in range(20)]
    x, y = centers(8)
    way = 2 * np.sqrt(np.maximum(1.5**2 - x * x - y * y, 0.0))
    scene = things(
        *((ball, at(), material) for material in thin),
        camera=orthographic(size=(8, 8)),
        world=WHITE,
    )
    for backend in BACKENDS:
        assert_passed(seen(scene, backend, max_bounces=64), way, np.array([1.0, 0.2, 2.0]))


def test_the_same_bits_in_regions_and_with_any_threads() -> None:
    whole = engine.render(rich(), engine.Settings(samples=2, threads=2)).combined
    alone = engine.render(rich(), engine.Settings(samples=2, threads=1)).combined
    np.testing.assert_array_equal(whole, alone)
    part = engine.render(rich(), engine.Settings(samples=2, region=(9, 5, 50, 40))).combined
    np.testing.assert_array_equal(part, whole[5:40, 9:50])


@pytest.mark.parametrize("backend", BACKENDS)
def test_blockers_that_a_light_passes_do_not_dim_it(backend: str) -> None:
    lamp = lamp_above("SUN", 5.0, strength=3.0, blockers=s.EVERYTHING & ~2)
    scene = things(
        (grid_mesh(extent=9.0), at((0.0, 0.0, -3.0)), surface()),
        (box_mesh(), at(linear=2.0), INSIDE),
        camera=orthographic((0.0, 0.0, -2.5), size=(4, 4)),
        lights=(lamp,),
    )
    free = seen(replace(scene, instances=scene.instances[:1]), backend)
    dimmed = seen(scene, backend)
    passed = replace(scene.instances[1], light_set=1)
    linked = seen(replace(scene, instances=(scene.instances[0], passed)), backend)
    np.testing.assert_allclose(linked, free, rtol=1e-6)
    assert dimmed.max() < 0.5 * free.max()


def test_fog_that_moves() -> None:
    """Each sample is a scene that takes over from the one before."""
    scene = rich()
    keys = np.repeat(scene.instances[1].world_from_object[None], 3, 0)
    keys[:, :, 0, 3] += np.array([0.0, 0.3, 0.8])[:, None]
    moving = (scene.instances[0], replace(scene.instances[1], motion=keys), *scene.instances[2:])
    films = both(replace(scene, instances=moving), samples=2, light_samples=1)
    np.testing.assert_allclose(films[0].combined, films[1].combined, rtol=1e-4, atol=1e-5)
    assert (films[0].combined != both(scene, samples=2, light_samples=1)[0].combined).any()


def test_pictures_while_media_change() -> None:
    """Of scenes that take over from each other, as a viewport's do."""
    live = engine.LiveRender()
    settings = engine.Settings(samples=1, threads=1)
    try:
        for medium in (DENSE, None, s.Medium((0.1, 0.0, 0.3))):
            scene = rich()
            materials = (scene.materials[0], replace(scene.materials[1], medium=medium))
            scene = replace(scene, materials=(*materials, *scene.materials[2:]))
            live.start([engine.Task(scene, settings)])
            while live.busy:
                time.sleep(0.002)
            assert live.error is None
            drawn, fresh = live.newest.film.combined, engine.render(scene, settings).combined
            np.testing.assert_allclose(drawn, fresh, atol=1e-6)
    finally:
        live.close()


def test_what_is_refused() -> None:
    for medium, word in (
        (s.Medium((np.nan, 0, 0)), "absorption"),
        (s.Medium(scattering=(-1.0, 0.0, 0.0)), "at least 0"),
        (s.Medium(emission=(np.inf, 0.0, 0.0)), "emission"),
        (s.Medium(anisotropy=1.5), "anisotropy"),
        ("fog", "Medium"),
    ):
        scene = things((box_mesh(), at(), filled("x", medium)))
        (problem,) = scene_problems(scene)
        assert word in problem and "'x'" in problem
        assert any(
            word in text for text in scene_problems(replace(scene, world=s.World(medium=medium)))
        )


def test_features() -> None:
    """A scene without media has no part in them."""
    assert engine.render(rich(), engine.Settings(samples=1)).stats["feature: media"]
    scene = things((ball_mesh(4), at(), filled("none", None, GLASS)), (box_mesh(), at(), surface()))
    assert "feature: media" not in engine.render(scene, engine.Settings(samples=1)).stats


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_way_of_bounced_light_is_dimmed(backend: str) -> None:
    """A lamp in the middle of a matt ball in a foggy world: to the wall, from there to all others,
    as far as twice the cosine, and from these to the eye.
    """
    sigma = np.array([0.3, 0.6, 1.2])
    fog = s.World(medium=s.Medium(absorption=tuple(sigma)))
    scene = replace(room(bulb()), world=fog)
    samples = {"NATIVE": 64, "NUMPY": 8}[backend]
    found = added(scene, backend, samples=samples)
    clear = added(room(bulb()), backend, samples=samples)
    chord = (1 - (1 + 2 * sigma) * np.exp(-2 * sigma)) / (2 * sigma**2)
    cells = (np.arange(8) + 0.5) / 4 - 1
    x, y = np.meshgrid(cells, cells)
    z = -1 / np.sqrt(x * x + y * y + 1)  # of the unit ray from (0, 0, 0.3)
    to_the_eye = -0.3 * z + np.sqrt((0.3 * z) ** 2 + 1 - 0.09)
    truth = np.exp(-sigma) * chord * np.exp(-sigma * to_the_eye[..., None])
    np.testing.assert_allclose(clear, clear.mean((0, 1)) + 0 * clear, rtol=1e-4)
    assert np.abs((found / clear / truth).mean((0, 1)) - 1).max() < 0.01
