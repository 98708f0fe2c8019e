"""TRANSLUCENT lobes: what is matt on the other side of a surface, in closed form and in both
tracers.
"""

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
from native_tools import lamp, needs_core, pixel_centers, placed, square, view_from_above
from surface_scenes import SUN, plane

BACKENDS = ["NATIVE", "NUMPY"]
K = (0.7, 0.35, 0.175)
LEAF = s.Lobe("TRANSLUCENT", (s.Input(K),))
MATT = s.Lobe("DIFFUSE", (s.Input(K),))
UPWARDS = np.diag([1.0, -1.0, -1.0])
"""Axes of a light that shines up."""


def picture(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    return render(scene, Settings(backend=backend, **{"samples": 1, **settings})).combined[..., :3]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("angle", [0.0, 0.5, 1.3])
def test_a_sun_from_behind_shines_by_its_cosine_and_one_before_not(
    angle: float, backend: str
) -> None:
    c, r = np.cos(angle), np.sin(angle)
    turned = np.array([[c, 0, r], [0, 1, 0], [-r, 0, c]]) @ UPWARDS
    behind = plane(LEAF, lights=(replace(lamp("SUN", axes=turned), strength=np.pi),))
    np.testing.assert_allclose(picture(behind, backend), np.ones((16, 16, 1)) * c * K, rtol=1e-6)
    assert not picture(plane(LEAF, lights=(SUN,)), backend).any()


def sheet(lobe: s.Lobe, light: s.Light, bumps: bool = False) -> s.Scene:
    """A smooth hilly sheet between two small plates."""
    hills = grid_mesh(12, 2.0, lambda x, y: 0.2 * np.sin(2 * x) * np.cos(3 * y), smooth=True)
    look = s.Material("sheet", (lobe,))
    if bumps:
        graph = Graph()
        n = graph.apply(BY_NAME["normal"])[0]
        slope = graph.constant((1.0, 0.5, 0.0))
        zero = graph.constant(0.0)
        across = graph.apply(
            BY_NAME["vector_math"], n, slope, n, zero, operation=VectorOperation.CROSS_PRODUCT
        )[0]
        bent = graph.apply(BY_NAME["scaled_sum"], across, graph.constant(0.3), n)[0]
        program = compile_program(graph, [bent, n])
        look = replace(
            look, program=program, normal_output=0, base_normal_output=1, bump_shadowing="GGX"
        )
    plate = s.Material("plate", (s.Lobe("DIFFUSE", (s.Input((0.5,) * 3),)),))
    return s.Scene(
        view_from_above(),
        (hills, square(0.3)),
        (placed(), placed(1, (1,), z=-1.0), placed(1, (1,), z=1.0)),
        (look, plate),
        (),
        (light,),
        s.World(),
    )


def from_below(scene: s.Scene) -> s.Scene:
    """Along the same lines from their other ends; the picture is upside down."""
    matrix = np.column_stack([UPWARDS, (0, 0, -10)])
    return replace(scene, camera=replace(scene.camera, world_from_camera=matrix))


def sky() -> np.ndarray:
    rows = np.linspace(0.1, 2.0, 16)[:, None, None]
    return np.broadcast_to(rows, (16, 32, 3)).astype(np.float32).copy()


LIGHTS = {
    "point": lamp("POINT", (0.3, 0.2, -3), UPWARDS, strength=300.0, radius=0.0),
    "ball": lamp("POINT", (0.3, 0.2, -3), UPWARDS, strength=300.0, radius=0.5),
    "area": lamp("AREA", (0.3, 0.2, -3), UPWARDS, strength=300.0, size_x=2.0, size_y=1.0),
    "sun": lamp("SUN", (0, 0, 0), UPWARDS, strength=3.0, angle=0.2),
    "sky": s.Light("sky", "DOME", np.eye(4)[:3], radiance=sky()),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("bumps", [False, True], ids=["smooth", "bumpy"])
@pytest.mark.parametrize("name", LIGHTS)
def test_it_shows_what_a_matt_one_shows_from_the_other_side(
    name: str, bumps: bool, backend: str
) -> None:
    """Where shadow rays start, horizons and bumps are those of the other side."""
    through, matt = (sheet(lobe, LIGHTS[name], bumps) for lobe in (LEAF, MATT))
    plate = slice(6, 10)  # before the camera in one of them
    found, expected = (
        picture(scene, backend, samples=2, filter_width=0.0, light_samples=4)
        for scene in (through, from_below(matt))
    )
    found, expected = found.copy(), expected[::-1].copy()
    found[plate, plate] = expected[plate, plate] = 0
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6)
    assert found.max() > 0.05


@needs_core
def test_so_it_does_with_what_a_wall_throws_on() -> None:
    """A wall that stands at it."""

    def at_a_wall(lobe: s.Lobe) -> s.Scene:
        matt = s.Material("wall", (s.Lobe("DIFFUSE", (s.Input((0.8,) * 3),)),))
        upright = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        wall = placed(1, (1,), z=-0.6, linear=upright, visible_camera=False)
        scene = plane(lobe, lights=(lamp("POINT", (0.5, 0.2, -0.4), strength=30.0),))
        return replace(
            scene,
            geometries=(*scene.geometries, square(0.6)),
            instances=(*scene.instances, wall),
            materials=(*scene.materials, matt),
        )

    def beside(scene: s.Scene, backend: str, samples: int) -> np.ndarray:
        few = {"samples": samples, "region": (8, 0, 12, 16), "soft_light": "DEALT"}
        thrown = picture(scene, backend, diffuse_bounces=1, **few) - picture(scene, backend, **few)
        return thrown.mean((0, 1))

    through, matt = at_a_wall(LEAF), from_below(at_a_wall(MATT))
    found = beside(through, "NATIVE", 1024)
    np.testing.assert_allclose(found, beside(matt, "NATIVE", 1024), rtol=0.01)
    assert found[0] > 0.1
    few = [beside(through, backend, 16) for backend in BACKENDS]
    np.testing.assert_allclose(*few, rtol=1e-4)


@needs_core
def test_a_plain_one_stands_beside_what_is_bumped() -> None:
    """Materials without a program have no bumps, where others have."""
    scene = sheet(MATT, replace(LIGHTS["area"], cast_shadow=False), bumps=True)
    scene = replace(scene, materials=(scene.materials[0], s.Material("leaf", (LEAF,))))
    found, expected = (picture(scene, backend, samples=4) for backend in BACKENDS)
    assert np.isclose(found, expected, rtol=1e-4, atol=2e-5).mean() > 0.99
    assert found[8, 8].max() > 0.1


def under_a_sheet(high: float) -> s.Scene:
    """A floor that a sheet hides from a sun, and from nothing else."""
    floor = s.Material("floor", (s.Lobe("DIFFUSE", (s.Input((0.6,) * 3),)),))
    cover = placed(1, (1,), z=high, visible_camera=False)
    return s.Scene(
        view_from_above(half=0.5),
        (square(0.6), square(1.0)),
        (placed(0, (0,)), cover),
        (floor, s.Material("sheet", (LEAF,))),
        (),
        (SUN,),
        s.World(),
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("high", [0.3, 1.0])
def test_it_throws_light_on_behind(high: float, backend: str) -> None:
    """The sun gives π to the sheet, which is as bright as K below: the floor's radiance by an
    integral over it.
    """
    scene, points = under_a_sheet(high), pixel_centers(half=0.5)
    x, y = np.meshgrid(*[(np.arange(200) + 0.5) / 100 - 1] * 2)
    to = np.stack([x.ravel(), y.ravel(), np.full(x.size, high)]) - points[..., None]
    form = (to[..., 2, :] / (to * to).sum(-2)) ** 2
    truth = 0.6 * np.array(K) * (form.mean(-1) * 4 / np.pi)[..., None]
    samples = {"NATIVE": 1024, "NUMPY": 64}[backend]
    bounced = {"samples": samples, "diffuse_bounces": 1, "soft_light": "DEALT"}
    found = picture(scene, backend, **bounced)
    assert not picture(scene, backend).any()
    assert np.abs(found.mean((0, 1)) / truth.mean((0, 1)) - 1).max() < 0.02
    blocks = [values.reshape(4, 4, 4, 4, 3).mean((1, 3)) for values in (found, truth)]
    off, scale = ((values**2).mean() for values in (blocks[0] - blocks[1], blocks[1]))
    assert np.sqrt(off / scale) < 0.04


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("cells", [4, 6])
def test_an_arch_shows_nothing_above_of_the_light_below(cells: int, backend: str) -> None:
    """Nothing of it sees its upper side, whatever the normals and the shadow rays' starts of coarse
    smooth meshes are.
    """
    arch = grid_mesh(cells, 1.0, lambda x, y: -0.5 * x * x, smooth=True)
    sun = lamp("SUN", axes=UPWARDS, strength=np.pi)
    scene = plane(MATT, lights=(sun,), mesh=arch)
    samples = {"NATIVE": 8, "NUMPY": 2}[backend]
    assert picture(scene, backend, samples=samples, diffuse_bounces=1).max() < 1e-3
    assert picture(from_below(scene), backend, diffuse_bounces=1).max() > 0.5


def room(height: float = 0.1) -> s.Scene:
    """A box that a sheet with hills parts, half glossy and half matt, with lamps in both parts."""
    leaf = s.Material(
        "sheet",
        (
            LEAF,
            s.Lobe("DIFFUSE", (s.Input((0.1, 0.2, 0.3)),)),
            s.Lobe("SPECULAR", (s.Input((0.2,) * 3),), 40.0, masking=0.2),
        ),
    )
    wall = s.Material("wall", (s.Lobe("DIFFUSE", (s.Input((0.6, 0.5, 0.4)),)),))
    hills = grid_mesh(6, 1.0, lambda x, y: height * np.sin(4 * x) * np.cos(3 * y), smooth=True)
    tilted = np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    lights = (
        lamp("POINT", (0.3, 0.2, 0.7), strength=60.0, radius=0.1),
        lamp("AREA", (0.0, 0.0, -0.8), UPWARDS, strength=60.0, size_x=0.5, size_y=0.5),
    )
    return s.Scene(
        view_from_above(),
        (hills, square(1.5)),
        (placed(0, (0,), linear=tilted), placed(1, (1,), z=-0.9)),
        (leaf, wall),
        (),
        lights,
        s.World(ambient=(0.1,) * 3),
        light_groups=("key",),
    )


PASSES = frozenset(
    {"Diffuse", "Specular", "Shadow", "Diffuse Direct", "Diffuse Indirect", "Diffuse Color"}
    | {"Denoising Albedo", "Cost"}
)


@needs_core
@pytest.mark.parametrize("bounces", [0, 2])
def test_both_tracers_draw_the_same(bounces: int) -> None:
    films = [
        render(
            room(),
            Settings(samples=2, passes=PASSES, backend=backend, diffuse_bounces=bounces),
        )
        for backend in BACKENDS
    ]
    for each in films[0].passes:
        found, expected = (film.passes[each] for film in films)
        off = ~np.isclose(found, expected, rtol=1e-4, atol=2e-5)
        assert off.mean() < 0.01, each  # edges
    diffuse = films[0].passes["Diffuse Color"][8, 8, :3]
    np.testing.assert_allclose(diffuse, np.add(K, (0.1, 0.2, 0.3)), rtol=1e-6)


@pytest.mark.parametrize(("bounces", "height"), [(0, 0.1), (1, 0.0)])
def test_explained_pixels_have_the_colours_of_the_picture(bounces: int, height: float) -> None:
    """With what bounces to a flat sheet, and straight light on hills."""
    scene, settings = room(height), Settings(samples=1, diffuse_bounces=bounces)
    found = picture(scene, diffuse_bounces=bounces)
    explainer = PixelExplainer(scene, settings)
    for x, y in ((8, 8), (5, 9)):
        explained = explainer.pixel(x, y)
        np.testing.assert_allclose(explained.color, found[y, x], rtol=1e-6)
        lines = explanation_lines(explained)
        assert any("area (from behind)" in line for line in lines)
        assert any("'area' on the other side: n·l = " in line for line in lines)


@needs_core
def test_threads_and_borders_change_no_bit() -> None:
    settings = Settings(samples=8, diffuse_bounces=1)
    whole = render(room(), replace(settings, threads=1)).combined
    assert (whole == render(room(), replace(settings, threads=3)).combined).all()
    part = render(room(), replace(settings, region=(3, 4, 11, 12))).combined
    assert (whole[4:12, 3:11] == part).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_catchers_and_holdouts_show_nothing_of_it(backend: str) -> None:
    behind = lamp("SUN", axes=UPWARDS, strength=np.pi)
    for flags in ({"catcher": True}, {"holdout": True}):
        scene = plane(LEAF, lights=(behind,))
        scene = replace(scene, instances=(replace(scene.instances[0], **flags),))
        assert not picture(scene, backend).any()
