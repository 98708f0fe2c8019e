"""Light that goes below a surface and comes out of it elsewhere: closed forms, and both tracers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import grid_mesh
from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.program.graph import Graph
from glint.engine.program.operations_vector import VectorOperation
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.reference.subsurface import REACH, Profile, within
from glint.engine.sampling import subsurface_points
from glint.engine.scene.problems import scene_problems
from native_tools import lamp, needs_core, pixel_centers, placed, square, view_from_above
from surface_scenes import SUN

BACKENDS = ["NATIVE", "NUMPY"]
K = (0.8, 0.5, 0.3)
RADIUS = (0.05, 0.02, 0.01)


def skin(radius=RADIUS, k=K) -> s.Lobe:
    return s.Lobe("DIFFUSE", (s.Input(k),), radius=radius)


def picture(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    plan = {"samples": 16, "filter_width": 0.0, **settings}
    return render(scene, Settings(backend=backend, **plan)).combined[..., :3]


def slab(lobe: s.Lobe, *lights: s.Light, size: float = 20.0, **more) -> s.Scene:
    look = s.Material("slab", (lobe,))
    return s.Scene(
        view_from_above(), (square(size),), (placed(),), (look,), (), lights, s.World(), **more
    )


@pytest.mark.parametrize("radius", [(1.0, 1.0, 1.0), (1.0, 0.3, 0.02)])
def test_the_profile_is_whole_and_its_rings_are_shares_of_it(radius: tuple) -> None:
    def of(count: int) -> Profile:
        d = np.repeat(np.array(radius)[:, None], count, 1)
        return Profile(d, d > 0)

    r = np.linspace(0, REACH, 200001)
    middle = (r[1:] + r[:-1]) / 2
    dense = (np.exp(-middle) + np.exp(-middle / 3)) / (8 * np.pi * middle)
    total = (dense * 2 * np.pi * middle).sum() * (r[1] - r[0])
    assert abs(total - within(np.array(REACH), np.array(1.0))) < 1e-6 and total > 0.996
    shares = np.array([0.1, 0.5, 0.9])
    np.testing.assert_allclose(of(3).mean(of(3).radius(shares)), shares, atol=1e-12)
    bounds = of(9).radius(np.linspace(0, 1, 9))
    rings = of(8).ring(bounds[:-1], bounds[1:])
    np.testing.assert_allclose(rings.mean(1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(rings.mean(0), 1.0, rtol=1e-9)


@pytest.mark.parametrize("samples", [1, 6, 16, 64])
def test_samples_divide_the_light_among_them(samples: int) -> None:
    points = subsurface_points(samples)
    assert points.shape == (samples, 6)
    edges = np.sort(points[:, 0])
    np.testing.assert_allclose(edges, np.arange(samples) / samples)
    np.testing.assert_allclose(points[..., 2] - points[..., 0], 1 / samples)
    assert (points[..., 0] < points[..., 1]).all() and (points[..., 1] < points[..., 2]).all()
    np.testing.assert_allclose(np.hypot(points[..., 3], points[..., 4]), 1)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("samples", [16, 64])
@pytest.mark.parametrize("radius", [RADIUS, (0.3, 0.0, 0.1), (1e-6, 1e-6, 1e-6)])
def test_an_evenly_lit_slab_is_as_diffuse(radius: tuple, samples: int, backend: str) -> None:
    found = picture(slab(skin(radius), SUN), backend, samples=samples)
    matt = picture(slab(replace(skin(), radius=(0.0, 0.0, 0.0)), SUN), backend, samples=1)
    np.testing.assert_allclose(found, matt, rtol=1e-3)
    assert matt.min() > 0.1


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("samples", [16, 64])
def test_so_it_is_under_an_even_sky(samples: int, backend: str) -> None:
    even = s.Light("sky", "DOME", np.eye(4)[:3], radiance=np.ones((16, 32, 3), np.float32))
    found, matt = (
        picture(slab(lobe, even), backend, samples=samples, light_samples=2)
        for lobe in (skin(), skin((0.0,) * 3))
    )
    np.testing.assert_allclose(found, matt, rtol=1e-3)
    np.testing.assert_allclose(matt, np.broadcast_to(K, matt.shape), rtol=0.01)


@pytest.mark.parametrize("backend", BACKENDS)
def test_without_the_setting_it_is_diffuse(backend: str) -> None:
    scene, matt = (half_lit(skin(radius)) for radius in (RADIUS, (0.0, 0.0, 0.0)))
    assert np.abs(picture(scene, backend) - picture(matt, backend)).max() > 0.02
    found = picture(scene, backend, subsurface="OFF")
    np.testing.assert_array_equal(found, picture(matt, backend))


def half_lit(lobe: s.Lobe) -> s.Scene:
    """The sun comes past the edge of a sheet at x = 0 that no camera sees."""
    scene = slab(lobe, SUN)
    sheet = replace(placed(z=1.0), visible_camera=False)
    sheet.world_from_object[0, 0, 3] = 20.0
    return replace(scene, instances=(*scene.instances, sheet))


def spread(x: np.ndarray, d: float) -> np.ndarray:
    """The share of the light at x that was given to the half plane below 0."""
    r = np.linspace(0, 40 * d, 40001)
    middle = ((r[1:] + r[:-1]) / 2)[:, None]
    ring = (np.exp(-middle / d) + np.exp(-middle / (3 * d))) / (4 * d) * (r[1] - r[0])
    inside = np.arccos(np.clip(x / middle, -1, 1)) / np.pi
    return (ring * inside).sum(0)


@needs_core
def test_the_edge_of_light_is_as_wide_as_the_profile() -> None:
    """The integral of the profile over the lit half plane."""
    radius = (0.10, 0.05, 0.02)
    scene = half_lit(skin(radius, (1.0, 1.0, 1.0)))
    found = picture(scene, samples=1024).mean(0)
    full = picture(slab(skin(radius, (1.0, 1.0, 1.0)), SUN), samples=4).mean((0, 1))
    x = pixel_centers()[0, :, 0]
    for c, d in enumerate(radius):
        expected = spread(x, d)
        assert np.abs(found[:, c] / full[c] - expected).max() < 0.015, (c, found[:, c], expected)
        assert expected.max() > 0.9 and expected.min() < 0.1


def hills(lobe: s.Lobe, *lights: s.Light, **more) -> s.Scene:
    """A smooth hilly sheet with a small plate over it."""
    sheet = grid_mesh(12, 2.0, lambda x, y: 0.3 * np.sin(2 * x) * np.cos(3 * y), smooth=True)
    plate = s.Material("plate", (s.Lobe("DIFFUSE", (s.Input((0.5,) * 3),)),))
    look = s.Material("sheet", (lobe, s.Lobe("SPECULAR", (s.Input((0.2,) * 3),), 20.0)))
    instances = (placed(), replace(placed(1, (1,), z=1.0), visible_camera=False))
    view = view_from_above()
    return s.Scene(
        view, (sheet, square(0.5)), instances, (look, plate), (), lights, s.World(), **more
    )


def sky() -> np.ndarray:
    rows = np.linspace(0.1, 2.0, 16)[:, None, None]
    return np.broadcast_to(rows, (16, 32, 3)).astype(np.float32).copy()


LIGHTS = {
    "sun": lamp("SUN", (0, 0, 0), np.eye(3), strength=3.0, angle=0.2),
    "area": lamp("AREA", (0.3, 0.2, 3), np.eye(3), strength=300.0, size_x=2.0, size_y=1.0),
    "point": lamp("POINT", (0.3, 0.2, 3), np.eye(3), strength=300.0, radius=0.0),
    "sky": s.Light("sky", "DOME", np.eye(4)[:3], radiance=sky()),
}


@needs_core
@pytest.mark.parametrize("more", [{}, {"diffuse_bounces": 2}], ids=["direct", "bounced"])
@pytest.mark.parametrize("name", LIGHTS)
def test_both_tracers_agree(name: str, more: dict) -> None:
    """Of what bounced rays meet rounding may choose another at a pixel."""
    scene = hills(skin((0.2, 0.1, 0.05)), LIGHTS[name])
    found, expected = (
        picture(scene, backend, samples=4, light_samples=2, **more) for backend in BACKENDS
    )
    off = (np.abs(found - expected) > 1e-4 * (expected + expected.max())).any(-1).mean()
    assert off <= (0.005 if more else 0)
    np.testing.assert_allclose(found, expected, atol=0.01 * expected.max())
    assert np.abs(expected - picture(scene, samples=4, subsurface="OFF", **more)).max() > 0.01


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_wall_lets_through_what_lies_round_rings_beyond(backend: str) -> None:
    """Lit from behind: of the light of a ring of radius r the share that the profile has at √(r² +
    t²) over what it has at r, as much as comes out in all at most.
    """
    t, d, k = 0.2, (0.2, 0.1, 0.05), (0.4, 0.4, 0.4)
    sides = replace(square(30.0), triangles=np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    back = replace(
        sides,
        vertices=np.concatenate([sides.vertices, sides.vertices - np.float32([0, 0, t])]),
        triangles=np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]], np.uint32),
        attributes=(),
    )
    below = lamp("SUN", (0, 0, -2), np.diag([1.0, -1.0, -1.0]), strength=np.pi)
    found = picture(replace(slab(skin(d, k), below), geometries=(back,)), backend, samples=128)
    r = np.linspace(0, REACH * max(d), 200001)
    r = (r[1:] + r[:-1]) / 2
    for c, width in enumerate(d):
        e, f = (np.exp(-x / (3 * width)) for x in (r, np.sqrt(r * r + t * t)))
        ring = (e**3 + e) / (4 * width) * (r[1] - r[0])
        inside = np.sqrt(r * r + t * t) < REACH * max(d)
        expected = k[c] * (ring * (f**3 + f) / (e**3 + e) * inside).sum()
        np.testing.assert_allclose(found[..., c], expected, rtol=0.05, atol=1e-4)
        assert expected > 0.005


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("thick", [0.001, 0.1])
def test_a_thin_wall_gives_back_no_more_than_it_gets(thick: float, backend: str) -> None:
    sides = square(30.0)
    back = replace(
        sides,
        vertices=np.concatenate([sides.vertices, sides.vertices - np.float32([0, 0, thick])]),
        triangles=np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]], np.uint32),
        attributes=(),
    )
    below = lamp("SUN", (0, 0, -2), np.diag([1.0, -1.0, -1.0]), strength=np.pi)
    scene = replace(slab(skin((0.3, 0.2, 0.1), (0.9,) * 3), SUN, below), geometries=(back,))
    found = picture(scene, backend)
    assert found.min() > 0.9 * (1 - 1e-3) and found.max() < 1 + 1e-3


def body(lobe: s.Lobe, matrix: np.ndarray, *more: s.Instances, **lit) -> s.Scene:
    """A closed bumpy ball of triangles under a matrix."""
    sheet = grid_mesh(24, 1.0)
    u, v = np.pi * sheet.vertices[:, 0], np.pi / 2 * sheet.vertices[:, 1]
    r = 1 + 0.1 * np.sin(3 * u)
    points = np.stack([r * np.cos(v) * np.cos(u), r * np.cos(v) * np.sin(u), r * np.sin(v)], -1)
    ball = s.Mesh("ball", points.astype(np.float32), sheet.triangles)
    look = s.Material("body", (lobe,))
    light = lamp("SUN", axes=axes_towards((1.0, 0.3, 0.4)), strength=np.pi)
    matrices = np.zeros((1, 3, 4))
    matrices[0, :, :3] = matrix
    here = s.Instances("body", 0, matrices, (0,))
    return s.Scene(
        view_from_above(half=1.5), (ball,), (here, *more), (look,), (), (light,), s.World(), **lit
    )


def axes_towards(to: tuple) -> np.ndarray:
    """Axes of a light that comes from there."""
    z = np.array(to) / np.linalg.norm(to)
    x = np.cross((0.0, 1.0, 0.0), z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


TURNED = {
    "even": np.eye(3),
    "stretched": np.diag([1.2, 0.5, 0.9]),
    "mirrored": np.diag([-1.0, 1.0, 1.0]),
}


@needs_core
@pytest.mark.parametrize("name", TURNED)
def test_bodies_under_matrices_agree_and_are_those_of_their_points(name: str) -> None:
    scene = body(skin((0.3, 0.1, 0.05)), TURNED[name])
    found, expected = (picture(scene, backend, samples=4) for backend in BACKENDS)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
    ball, matrix = scene.geometries[0], TURNED[name]
    flat = replace(ball, vertices=(ball.vertices @ matrix.T).astype(np.float32))
    if np.linalg.det(matrix) < 0:
        flat = replace(flat, triangles=flat.triangles[:, ::-1].copy())
    same = replace(body(skin((0.3, 0.1, 0.05)), np.eye(3)), geometries=(flat,))
    np.testing.assert_allclose(picture(same, samples=4), found, atol=2e-3)
    matt = picture(body(skin((0.0,) * 3), matrix), samples=4)
    assert (found > 0.02 + matt).any() and found.max() < 1


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_comes_out_of_its_own_object_alone(backend: str) -> None:
    """A ball inside, and one around that lets all through, have no part in it."""
    lobe = skin((0.3, 0.1, 0.05))
    alone = picture(body(lobe, np.eye(3)), backend, samples=4)
    small = replace(placed(0, (0,), linear=0.5), name="inner")
    clear = s.Material("clear", (s.Lobe("TRANSPARENT", (s.Input((1.0,) * 3),)),))
    scene = body(lobe, np.eye(3), small, replace(placed(0, (1,), linear=1.2), name="outer"))
    scene = replace(scene, materials=(*scene.materials, clear))
    np.testing.assert_allclose(picture(scene, backend, samples=4), alone, rtol=1e-5, atol=1e-6)


@needs_core
@pytest.mark.parametrize("radius", [(1e6,) * 3, (1e-6, 1e3, 1.0), (1e30, 0.0, 1e-30)])
def test_extreme_radii_stay_finite_and_agree(radius: tuple) -> None:
    scene = body(skin(radius), np.eye(3))
    found, expected = (picture(scene, backend, samples=4) for backend in BACKENDS)
    assert np.isfinite(found).all() and found.min() >= 0 and found.max() < 1.5
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3)


def of_program(value: tuple) -> s.Scene:
    """A slab whose radius is what its program gives."""
    graph = Graph()
    n = graph.apply(BY_NAME["normal"])[0]
    zero = graph.constant(0.0)
    given = graph.apply(BY_NAME["scaled_sum"], n, zero, graph.constant(value))[0]
    scene = half_lit(skin((0.0,) * 3))
    look = scene.materials[0]
    lobe = replace(look.lobes[0], radius_output=0)
    look = replace(look, lobes=(lobe,), program=compile_program(graph, [given]))
    return replace(scene, materials=(look,))


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_program_may_give_the_radius(backend: str) -> None:
    radius = (0.2, 0.1, 0.05)
    found = picture(of_program(radius), backend, samples=4)
    np.testing.assert_allclose(
        found, picture(half_lit(skin(radius)), backend, samples=4), rtol=1e-6
    )
    strange = picture(of_program((np.nan, -1.0, np.inf)), backend, samples=4)
    matt = picture(half_lit(skin((0.0,) * 3)), backend, samples=4)
    np.testing.assert_allclose(strange, matt, rtol=1e-6)
    assert np.abs(found - matt).max() > 0.05


def test_a_radius_below_0_or_not_finite_is_refused() -> None:
    for radius in ((-1.0, 0, 0), (np.nan, 0, 0), (1.0, 1.0)):
        scene = slab(skin(radius), SUN)
        assert any("radius" in problem for problem in scene_problems(scene))


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_passes_have_it_as_diffuse_light(backend: str) -> None:
    scene = hills(skin((0.2, 0.1, 0.05)), LIGHTS["area"])
    names = frozenset(("Diffuse Direct", "Diffuse Indirect", "Diffuse Color", "Glossy Direct"))
    plan = {"samples": 4, "light_samples": 2, "filter_width": 0.0, "backend": backend}
    plan |= {"passes": names | {"Glossy Color", "Diffuse", "Shadow", "Specular"}}
    films = [render(scene, Settings(**plan, subsurface=on)) for on in ("ON", "OFF")]
    for film in films:
        p = film.passes
        total = p["Diffuse Direct"] * p["Diffuse Color"] + p["Glossy Direct"] * p["Glossy Color"]
        np.testing.assert_allclose(total, film.combined[..., :3], rtol=1e-4, atol=1e-5)
        parts = p["Diffuse"] + p["Shadow"] + p["Specular"]
        np.testing.assert_allclose(parts, film.combined[..., :3], rtol=1e-4, atol=1e-5)
    on, off = films
    np.testing.assert_allclose(on.passes["Diffuse Color"], off.passes["Diffuse Color"], rtol=1e-5)
    np.testing.assert_allclose(on.passes["Glossy Direct"], off.passes["Glossy Direct"], rtol=1e-4)
    assert on.stats["probe rays"] == 2 * 4 * 16 * 16 and not off.stats.get("probe rays")


@needs_core
def test_same_bits_for_threads_and_borders() -> None:
    scene = hills(skin((0.2, 0.1, 0.05)), *LIGHTS.values())
    plan = {"samples": 4, "light_samples": 2, "diffuse_bounces": 2}
    whole = picture(scene, threads=1, **plan)
    np.testing.assert_array_equal(picture(scene, threads=4, **plan), whole)
    part = picture(scene, region=(3, 5, 12, 14), **plan)
    np.testing.assert_array_equal(part, whole[5:14, 3:12])


def test_a_pixel_is_explained_by_what_comes_out_where() -> None:
    scene = hills(skin((0.2, 0.1, 0.05)), LIGHTS["area"])
    settings = Settings(light_samples=2)
    ray = PixelExplainer(scene, settings).pixel(9, 5)
    drawn = picture(scene, "NUMPY", samples=1, light_samples=2)[5, 9]
    np.testing.assert_allclose(ray.color, drawn, rtol=1e-5)
    assert "subsurface" in [after.kind for after in ray.follow]
    assert any("comes out" in line for line in explanation_lines(ray))


@needs_core
@pytest.mark.parametrize("bump_shadowing", ["NONE", "GGX"])
def test_bumps_are_seen_where_light_comes_out(bump_shadowing: str) -> None:
    scene = hills(skin((0.2, 0.1, 0.05)), LIGHTS["sun"])
    graph = Graph()
    n = graph.apply(BY_NAME["normal"])[0]
    slope, zero = graph.constant((1.0, 0.5, 0.0)), graph.constant(0.0)
    across = graph.apply(
        BY_NAME["vector_math"], n, slope, n, zero, operation=VectorOperation.CROSS_PRODUCT
    )[0]
    bent = graph.apply(BY_NAME["scaled_sum"], across, graph.constant(0.5), n)[0]
    look = replace(
        scene.materials[0],
        program=compile_program(graph, [bent, n]),
        normal_output=0,
        base_normal_output=1,
        bump_shadowing=bump_shadowing,
    )
    bumpy = replace(scene, materials=(look, *scene.materials[1:]))
    found, expected = (picture(bumpy, backend, samples=4) for backend in BACKENDS)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
    assert np.abs(found - picture(scene, samples=4)).max() > 0.05


@needs_core
def test_mirrors_glass_groups_and_fog_show_it_alike() -> None:
    """Both tracers, and a mirror shows no less than what it stands before."""
    scene = hills(skin((0.2, 0.1, 0.05)), replace(LIGHTS["area"], light_group=0), LIGHTS["sun"])
    mirror = s.Material("mirror", (s.Lobe("MIRROR", (s.Input((0.9,) * 3),)),))
    glass = s.Material("glass", (s.Lobe("REFRACTION", (s.Input((1.0,) * 3),), ior=1.0),))
    turn = np.array([[0.5, 0, 0.866], [0, 1, 0], [-0.866, 0, 0.5]])
    leaning = placed(1, (2,), z=1.5, linear=turn)
    pane = placed(1, (3,), z=2.0)
    pane.world_from_object[0, 0, 3] = -0.5
    scene = replace(
        scene,
        instances=(*scene.instances, leaning, pane),
        materials=(*scene.materials, mirror, glass),
        light_groups=("lamp",),
    )
    plan = {"samples": 4, "light_samples": 2, "max_bounces": 3, "filter_width": 0.0}
    for world in (s.World(), s.World(medium=s.Medium((0.1,) * 3, (0.05,) * 3))):
        drawn = replace(scene, world=world)
        films = [render(drawn, Settings(backend=backend, **plan)) for backend in BACKENDS]
        native, exact = films
        for name in native.passes:
            found, expected = native.passes[name], exact.passes[name]
            np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3, err_msg=name)
        matt = render(drawn, Settings(subsurface="OFF", **plan)).combined
        assert (np.abs(native.combined - matt).max(-1) > 0.003).mean() > 0.5


@needs_core
def test_what_rough_metal_shows_of_it_is_matt() -> None:
    scene = hills(skin((0.2, 0.1, 0.05)), LIGHTS["sun"])
    rough = s.Lobe("SPECULAR", (s.Input((5.0,) * 3),), 60.0, masking=0.2)
    plate = s.Material("rough", (rough,))
    turn = np.array([[0.5, 0, 0.866], [0, 1, 0], [-0.866, 0, 0.5]])
    wall = placed(1, (2,), z=1.5, linear=turn)
    scene = replace(scene, instances=(*scene.instances, wall), materials=(*scene.materials, plate))
    plan = {"samples": 4, "max_bounces": 1, "passes": frozenset({"Mirror"}), "filter_width": 0.0}
    on, off = (
        render(scene, Settings(subsurface=x, **plan)).passes["Mirror"] for x in ("ON", "OFF")
    )
    assert on.max() > 0.01
    np.testing.assert_allclose(on, off, rtol=1e-6)
