"""FIBRE lobes: Kajiya and Kay's on strands, in closed form and in both tracers."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.reference.closures.fibre import fibre_diffuse, fibre_highlight
from native_tools import lamp, needs_core, pixel_centers, placed, square, view_from_above
from surface_scenes import SUN, P, balls

EXPONENTS = (0.0, 1.0, 30.0, 1e4)
TANGENT = "along"


def lobe(kind: str, k: float = 0.7, exponent: float = 0.0, **more) -> s.Lobe:
    inputs = (s.Input((k, k / 2, k / 4)),)
    return s.Lobe(f"FIBRE_{kind}", inputs, exponent, fibre_output=0, **more)


def of_strands(*lobes: s.Lobe) -> s.Material:
    """A material that reads the tangent."""
    graph = Graph()
    along = graph.apply(BY_NAME["attribute"], attribute=TANGENT, shift=0)[0]
    world = graph.apply(BY_NAME["normal_to_world"], along)[0]
    return s.Material("hair", lobes, program=compile_program(graph, [world]))


def strand(a=(-3.0, 0.0, 0.0), b=(3.0, 0.0, 0.0), radius=0.5, **more) -> s.Strands:
    ends = np.array([a, b], np.float32)
    tangent = np.zeros((2, 4), np.float32)
    tangent[:, :3] = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    told = (s.Attribute(TANGENT, "POINT", tangent),)
    return s.Strands("hair", ends, np.full(2, radius, np.float32), np.zeros(1, np.uint32), **more,
                     attributes=told)  # fmt: skip


def scene(*lobes: s.Lobe, lights=(SUN,), world=None, geometry=None, **more) -> s.Scene:
    return s.Scene(
        view_from_above(),
        (geometry or strand(),),
        (placed(),),
        (of_strands(*lobes),),
        (),
        lights,
        world or s.World(),
        **more,
    )


@functools.cache
def sphere() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(3, m) directions round the tangent x, the solid angle that each stands for, and their
    azimuth off z: Gauss's nodes of the latitude, dense enough for the narrowest lobe.
    """
    nodes, weights = np.polynomial.legendre.leggauss(500)
    theta, size = nodes * np.pi / 2, weights * np.pi / 2 * np.cos(nodes * np.pi / 2)
    turn = (np.arange(64) + 0.5) / 64 * 2 * np.pi
    theta, turn = (each.ravel() for each in np.meshgrid(theta, turn))
    l = np.stack([np.sin(theta), np.cos(theta) * np.sin(turn), np.cos(theta) * np.cos(turn)])  # noqa: E741
    return l, np.tile(size, 64) * (2 * np.pi / 64), turn


def seen_share(turn: np.ndarray, behind: bool) -> np.ndarray:
    """How much of a fibre's seen width a light at that azimuth is before, or behind."""
    return (1 - np.cos(turn)) / 2 if behind else (1 + np.cos(turn)) / 2


@pytest.mark.parametrize("height", [0.0, 0.5, 1.2, 1.5])
def test_matt_fibres_give_back_all_of_a_uniform_world(height: float) -> None:
    """From any side: 1/pi times the integral over the sphere is 1."""
    l, size, turn = sphere()  # noqa: E741
    t = np.broadcast_to(np.array([[1.0], [0.0], [0.0]]), l.shape)
    total = (fibre_diffuse(t, l) * seen_share(turn, False) * size).sum() / np.pi
    assert abs(total - 1) < 1e-4


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("exponent", EXPONENTS)
@pytest.mark.parametrize("fan", [0.0, 0.1, 0.6, 1.0])
@pytest.mark.parametrize("height", [0.0, 0.5, 1.2, 1.5])
@pytest.mark.parametrize("tilt", [0.0, 0.3, -0.3])
def test_highlights_give_back_what_comes(exponent, height, fan, behind, tilt) -> None:
    """All of it, seen from anywhere; the size of fans is within 1 %."""
    l, size, turn = sphere()  # noqa: E741
    t = np.broadcast_to(np.array([[1.0], [0.0], [0.0]]), l.shape)
    v = np.broadcast_to(np.array([[np.sin(height)], [0.0], [np.cos(height)]]), l.shape)
    given = fibre_highlight(5 * t, v, l, exponent, fan, behind, tilt) * seen_share(turn, behind)
    total = (given * size).sum() / np.pi
    assert total == pytest.approx(1.0, abs=1e-8 if fan == 0 else 0.01)
    assert total < 1 + 1e-3


def test_highlights_are_reciprocal() -> None:
    """As much of light along l is seen along v as the other way."""
    rng = np.random.default_rng(5)
    v, l, t = rng.normal(size=(3, 3, 500))  # noqa: E741
    v, l = v / np.linalg.norm(v, axis=0), l / np.linalg.norm(l, axis=0)  # noqa: E741
    t /= np.linalg.norm(t, axis=0)
    there, back = fibre_highlight(t, v, l, 20.0, 0.3), fibre_highlight(t, l, v, 20.0, 0.3)
    np.testing.assert_allclose(there, back, rtol=1e-9)


@needs_core
@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize("kind", ["DIFFUSE", "SPECULAR", "TRANSMISSION"])
@pytest.mark.parametrize("below", [False, True])
@pytest.mark.parametrize("lean", [0.0, 0.2, -0.2])
def test_a_strand_under_a_sun_in_closed_form(backend, kind, below, lean) -> None:
    """Along x, lit obliquely from above or from below, which what passes through shows alone; lean:
    radians of the lobe, against the strand.
    """
    height = 0.4
    axis = np.array([np.sin(height), 0.0, -np.cos(height) if below else np.cos(height)])
    sun = replace(SUN, world_from_light=_towards(axis))
    film = render(
        scene(lobe(kind, 1.0, 8.0, tilt=np.tan(lean)), lights=(sun,)),
        Settings(samples=1, filter_width=0.0, backend=backend),
    )
    found = film.passes["Combined"][..., 0]
    on = np.abs(P[..., 1]) < 0.45
    seen = kind == "TRANSMISSION" if below else kind != "TRANSMISSION"
    if not seen:
        assert not found.any()
        return
    expected = 2 / np.pi * np.cos(height)
    if kind != "DIFFUSE":
        # of d'Eon and others' M, with 1 / v = 2
        aside = np.exp(-2 * np.sin(height) * np.sin(2 * lean) - 2)
        expected = 2 / (1 - np.exp(-4)) * np.i0(2 * np.cos(height) * np.cos(2 * lean)) * aside
    assert on.sum() > 40
    np.testing.assert_allclose(found[on], expected, rtol=1e-6)


def _towards(direction: np.ndarray) -> np.ndarray:
    """A light's frame whose -z leaves a sun that is seen in a direction."""
    z = direction / np.linalg.norm(direction)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z, np.zeros(3)], 1)


def lights() -> dict[str, tuple[s.Light, ...]]:
    rows = np.linspace(0.1, 2.0, 16)[:, None, None]
    sky = np.broadcast_to(rows, (16, 32, 3)).astype(np.float32).copy()
    lamps = tuple(lamp("POINT", _place(k), strength=60.0, radius=0.1 * (k % 3)) for k in range(80))
    return {
        "point": (lamp("POINT", strength=900.0, radius=0.0),),
        "ball": (lamp("POINT", (1.0, 1.0, -4.0), strength=900.0, radius=0.5),),
        "area": (lamp("AREA", strength=900.0, size_x=2.0, size_y=1.0),),
        "sun": (SUN, lamp("SUN", strength=1.0, angle=0.2)),
        "sky": (s.Light("sky", "DOME", np.eye(4)[:3], radiance=sky),),
        "many": lamps,
    }


def _place(k: int) -> np.ndarray:
    return 4 * np.array([np.cos(2.4 * k), np.sin(2.4 * k), (k % 9 - 4) / 4])


def scenes() -> dict[str, s.Scene]:
    all_lobes = (
        lobe("DIFFUSE", 0.5),
        lobe("SPECULAR", 0.3, 25.0),
        lobe("TRANSMISSION", 0.4, 9.0, fan=0.3),
    )
    shine = s.Lobe("SPECULAR", (s.Input((0.3,) * 3),), 60.0, masking=0.2)
    matt = s.Lobe("DIFFUSE", (s.Input((0.2, 0.3, 0.4)),))
    oblique = strand((-2.0, -1.0, -1.0), (2.0, 1.0, 1.5), 0.4)
    made = {
        name: scene(*all_lobes, shine, matt, lights=each, geometry=oblique)
        for name, each in lights().items()
    }
    fan = lobe("SPECULAR", 0.3, 25.0, fan=0.5)
    made["fan"] = scene(fan, lights=lights()["area"], geometry=oblique)
    leaning = {"geometry": oblique, "lights": lights()["sun"]}
    made["leaning"] = scene(
        lobe("SPECULAR", 0.3, 25.0, tilt=0.4),
        lobe("TRANSMISSION", 0.4, 9.0, fan=0.3, tilt=-0.6),
        **leaning,
    )
    made["bare"] = scene(*all_lobes, lights=lights()["sun"])
    made["glossy"] = scene(lobe("TRANSMISSION", 0.4, 9.0, fan=0.1), lights=lights()["ball"])
    return made


@needs_core
@pytest.mark.parametrize("name", scenes())
def test_both_tracers_draw_the_same(name: str) -> None:
    passes = frozenset(
        {"Diffuse", "Specular", "Shadow", "Denoising Albedo", "Diffuse Color", "Glossy Direct"}
    )
    films = [
        render(scenes()[name], Settings(samples=2, passes=passes, backend=backend))
        for backend in ("NATIVE", "NUMPY")
    ]
    assert films[0].passes["Combined"].max() > 0.01
    for each in films[0].passes:
        found, expected = (film.passes[each] for film in films)
        np.testing.assert_allclose(found, expected, rtol=2e-4, atol=2e-5, err_msg=each)


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_what_is_no_fibre_is_matt_and_shines(backend) -> None:
    """On a ball, which has no tangents, as the notes' lobes; nothing passes through."""
    fibres = balls()
    given = (lobe("DIFFUSE"), lobe("SPECULAR", 0.4, 30.0), lobe("TRANSMISSION", 0.4, 9.0))
    fibres = replace(fibres, materials=(of_strands(*given),))
    k = tuple(4.0 * x for x in (0.4, 0.2, 0.1))
    usual = balls(
        s.Lobe("DIFFUSE", (s.Input((0.7, 0.35, 0.175)),)), s.Lobe("SPECULAR", (s.Input(k),), 30.0)
    )
    found, expected = (
        render(each, Settings(samples=1, backend=backend)).passes["Combined"]
        for each in (fibres, usual)
    )
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@needs_core
def test_threads_and_borders_change_no_bit() -> None:
    made = scenes()["area"]
    whole = render(made, Settings(samples=8, threads=1)).passes["Combined"]
    assert (whole == render(made, Settings(samples=8, threads=3)).passes["Combined"]).all()
    part = render(made, Settings(samples=8, region=(3, 4, 11, 12))).passes["Combined"]
    assert (whole[4:12, 3:11] == part).all()


@pytest.mark.parametrize("name", ["point", "bare", "glossy"])
def test_explained_pixels_have_the_colours_of_the_picture(name) -> None:
    made, settings = scenes()[name], Settings(samples=1)
    picture = render(made, settings).passes["Combined"]
    explainer = PixelExplainer(made, settings)
    for x, y in ((8, 8), (7, 8)):
        np.testing.assert_allclose(explainer.pixel(x, y).color, picture[y, x, :3], rtol=1e-3)


@needs_core
@pytest.mark.parametrize("tangent", [3e38, 1e30, 1e-30, 1e-40, 0.0])
def test_odd_tangents_stay_finite(tangent) -> None:
    geometry = strand()
    values = geometry.attributes[0].values * np.float32(tangent)
    geometry = replace(geometry, attributes=(s.Attribute(TANGENT, "POINT", values),))
    lobes = (lobe("DIFFUSE", 0.5), lobe("SPECULAR", 0.3, 25.0), lobe("TRANSMISSION", 0.4, 1e30))
    for backend in ("NATIVE", "NUMPY"):
        film = render(scene(*lobes, geometry=geometry), Settings(samples=2, backend=backend))
        assert np.isfinite(film.passes["Combined"]).all()


def chain(count: int, radius: float) -> s.Strands:
    """A quarter of a circle of segments, as thick as the tangents are long."""
    turn = np.linspace(0.25, 0.75, count + 1) * np.pi
    ends = 3 * np.stack([np.cos(turn), np.sin(turn) - 1, 0 * turn], 1).astype(np.float32)
    tangent = np.zeros((count + 1, 4), np.float32)
    tangent[:, :2] = 2 * radius * np.stack([-np.sin(turn), np.cos(turn)], 1)
    told = (s.Attribute(TANGENT, "POINT", tangent),)
    return s.Strands("bent", ends, np.full(count + 1, radius, np.float32),
                     np.arange(count, dtype=np.uint32), attributes=told)  # fmt: skip


@needs_core
@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_light_passes_bent_strands_whatever_they_are_cut_to(backend) -> None:
    """Neighbours of the segment that it goes through are no strands of their own."""
    sun = replace(SUN, world_from_light=_towards(np.array([0.0, 0.3, -1.0])))
    found = [
        render(
            scene(lobe("TRANSMISSION", 1.0, 2.0), lights=(sun,), geometry=chain(count, 0.4)),
            Settings(samples=4, backend=backend),
        ).passes["Combined"][..., 0]
        for count in (8, 40)
    ]
    lit = found[0] > 0.1
    assert lit.sum() > 10
    np.testing.assert_allclose(found[1][lit].mean(), found[0][lit].mean(), rtol=0.03)
    assert (found[1][lit] > 0.5 * found[0][lit]).mean() > 0.9


@needs_core
@pytest.mark.parametrize("kind", ["DIFFUSE", "SPECULAR", "TRANSMISSION"])
def test_what_a_floor_throws_on_lights_fibres_as_if_it_glowed(kind: str) -> None:
    """A strand over a floor in the sun, which neither reaches the strand nor meets it, and over a
    floor that gives as much by itself. Both tracers draw all three kinds below.
    """
    paint = s.Material("floor", (s.Lobe("DIFFUSE", (s.Input((0.8, 0.8, 0.8)),)),))
    sun = replace(
        SUN, receivers=2, blockers=2, world_from_light=_towards(np.array([0.0, 0.0, 1.0]))
    )
    corners = 4.0 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    floor = s.Mesh("floor", corners - np.float32([0, 0, 2]), np.uint32([[0, 1, 2], [0, 2, 3]]))
    hair = strand(a=(-1.0, 0.0, 0.0), b=(1.0, 0.0, 0.0))
    bare = scene(lobe(kind, exponent=2.0), lights=(sun,), geometry=hair)
    below = replace(placed(), geometry=1, materials=(1,), light_set=1)
    lit = replace(
        bare,
        geometries=(hair, floor),
        instances=(*bare.instances, below),
        materials=(*bare.materials, paint),
    )
    plan = Settings(
        samples=64,
        diffuse_bounces=1,
        filter_width=0.0,
        soft_light="DEALT",
    )
    picture = render(lit, plan).combined
    alone = render(replace(lit, instances=(below,), lights=(sun,)), replace(plan, samples=1))
    alone = alone.combined
    given = float(alone[..., 0].max())
    glow = s.Material("floor", (s.Lobe("EMISSION", (s.Input((given,) * 3),)),))
    glows = replace(lit, materials=(bare.materials[0], glow), lights=())
    shining = render(glows, plan).combined
    on_strand = np.abs(picture - given)[..., 2] > 1e-3
    assert on_strand.sum() > 20
    mine, other = (p[on_strand][:, :3].mean(0) for p in (picture, shining))
    assert other[0] > 0.01 * given
    np.testing.assert_allclose(mine, other, rtol=0.05)


def glowing_and_lit() -> s.Scene:
    """A strand between a panel that glows and a wall that throws its light on, in a sky."""

    def square(name: str, x: float) -> s.Mesh:
        corners = [(x, y, z) for y in (-2, 2) for z in (-2, 2)]
        return s.Mesh(
            name,
            np.array(corners, np.float32),
            np.array([(0, 1, 2), (2, 1, 3)], np.uint32),
        )

    given = (
        lobe("DIFFUSE", 0.5),
        lobe("SPECULAR", 0.3, 2.0),
        lobe("TRANSMISSION", 0.4, 9.0, fan=0.3),
    )
    shine = s.Lobe("SPECULAR", (s.Input((0.3,) * 3),), 60.0, masking=0.2)
    made = scene(
        *given, shine, lights=lights()["sky"], geometry=strand((-1.0, -1.0, -1), (1.0, 1.0, 1.5))
    )
    glow = s.Material("glow", (s.Lobe("EMISSION", (s.Input((4.0, 2.0, 1.0)),)),))
    matt = s.Material("matt", (s.Lobe("DIFFUSE", (s.Input((0.8,) * 3),)),))
    here = np.eye(4)[None, :3]
    return replace(
        made,
        geometries=(*made.geometries, square("panel", -2.5), square("wall", 2.5)),
        instances=(
            *made.instances,
            s.Instances("panel", 1, here, (1,)),
            s.Instances("wall", 2, here, (2,)),
        ),
        materials=(*made.materials, glow, matt),
    )


@needs_core
def test_both_tracers_light_strands_by_the_same_parts_of_tables() -> None:
    passes = frozenset({"Diffuse Direct", "Diffuse Indirect", "Glossy Direct", "Cost"})
    made = glowing_and_lit()
    films = [
        render(
            made,
            Settings(
                samples=6, diffuse_bounces=2, passes=passes, backend=backend, soft_light="DEALT"
            ),
        )
        for backend in ("NATIVE", "NUMPY")
    ]
    assert films[0].passes["Diffuse Indirect"].max() > 0.01
    for each in films[0].passes:
        found, expected = (film.passes[each] for film in films)
        np.testing.assert_allclose(found, expected, rtol=2e-4, atol=2e-5, err_msg=each)


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize(("light_samples", "rays"), [(1, 2), (2, 4)])
def test_strands_see_a_quarter_of_the_sky_a_sample(backend, light_samples, rays) -> None:
    """Half of which is before each point; and all of it over the samples, so that they lose nothing
    of an even one.
    """
    sky = s.Light("sky", "DOME", np.eye(4)[:3], radiance=np.ones((16, 32, 3), np.float32))
    made = scene(lobe("DIFFUSE", 1.0), lights=(sky,))
    settings = Settings(
        samples=64, light_samples=light_samples, passes={"Cost"}, backend=backend, filter_width=0.0
    )
    on = np.abs(P[..., 1]) < 0.45
    film = render(made, settings)
    assert (film.passes["Cost"][..., 0][on] / 64 - 1).mean() == pytest.approx(rays / 2, rel=0.1)
    assert film.combined[..., 0][on].mean() == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("backend", [pytest.param("NATIVE", marks=needs_core), "NUMPY"])
def test_what_starts_inside_a_strand_does_not_see_it(backend: str) -> None:
    """As skin does in thick roots, and fog, whichever end shadow rays are traced from."""
    root = strand((0.0, 0.0, -9.0), (0.0, 0.0, 5.0), 0.5)
    floor = placed(1)
    given = s.Scene(
        view_from_above(16, 1.0),
        (root, square(5.0)),
        (placed(0, visible_camera=False), floor),
        (s.Material("matt", (s.Lobe("DIFFUSE"),)),),
        lights=(lamp("POINT", position=(0.0, 0.0, 40.0), radius=0.0),),
        world=s.World(medium=s.Medium(scattering=(0.01, 0.02, 0.03))),
    )
    plan = Settings(samples=1, backend=backend, filter_width=0.0)
    bare = replace(given, instances=(floor,))
    with_root, without = (render(x, plan).combined[..., :3] for x in (given, bare))
    inside = np.hypot(*np.moveaxis(pixel_centers(16, 1.0)[..., :2], -1, 0)) < 0.45
    assert without.min() > 0
    np.testing.assert_array_equal(with_root[inside], without[inside])
