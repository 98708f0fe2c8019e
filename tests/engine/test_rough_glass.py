"""What is seen through glass that is rough: closed forms, one tracer beside the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import HERE, ball
from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.graph import Graph, Value
from glint.engine.program.operations_math import MathOperation
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Polygons,
    Scene,
    World,
)

BACKENDS = ("NATIVE", "NUMPY")


def glass(exponent: float, k: float = 1.0, **more) -> Material:
    lobe = Lobe("REFRACTION", (Input((k, k, k)),), exponent=exponent, ior=1.45, **more)
    return Material("glass", (lobe,))


def glowing(color) -> Material:
    return Material("glow", (Lobe("EMISSION", (Input(color),)),))


def above(geometry, material: Material, height: float = 1.0, background=(1.0, 1.0, 1.0)) -> Scene:
    """What stands over a square of which one half glows, seen from above."""
    half = Polygons(
        "half",
        np.array([(0, -9, 0), (9, -9, 0), (9, 9, 0), (0, 9, 0)], np.float32),
        np.array([0, 4], np.uint32),
        np.arange(4, dtype=np.uint32),
    )
    place = HERE.copy()
    place[2, 3] = height
    camera = Camera(
        "ORTHOGRAPHIC", np.column_stack([np.eye(3), (0, 0, 9)]), (-1, 1, -1, 1), (24, 24)
    )
    return Scene(
        camera,
        (half, geometry),
        (Instances("half", 0, HERE[None], (0,)), Instances("glass", 1, place[None], (1,))),
        (glowing((0.2, 0.5, 1.0)), material),
        world=World(background=background),
    )


def pane() -> Polygons:
    corners = np.array([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], np.float32)
    return Polygons("pane", corners, np.array([0, 4], np.uint32), np.arange(4, dtype=np.uint32))


def drawn(scene: Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    chosen = {"samples": 16, "max_bounces": 6, "filter_width": 0.0, "backend": backend}
    film = render(scene, Settings(**{**chosen, **settings}))
    return film.passes["Combined"][..., :3].astype(np.float64)


def alone(scene: Scene) -> Scene:
    """Without what glows: in a world of one brightness, 1."""
    body = replace(scene.instances[1], geometry=0)
    return replace(scene, geometries=scene.geometries[1:], instances=(body,))


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_is_lost_where_all_facets_let_light_out(backend: str) -> None:
    """Every ray through a ball of k = 1 ends in the world, whatever way it takes."""
    picture = drawn(alone(above(ball(0.9), glass(1e4))), backend, max_bounces=64)
    assert np.abs(picture[6:18, 6:18] - 1).max() < 1e-6


def slab() -> Polygons:
    """What lies between two planes, 0.1 apart, wide."""
    top = np.array([(-99, -99, 0), (99, -99, 0), (99, 99, 0), (-99, 99, 0)], np.float32)
    corners = np.concatenate([top, top[::-1] - (0, 0, 0.1)]).astype(np.float32)
    return Polygons("slab", corners, np.array([0, 4, 8], np.uint32), np.arange(8, dtype=np.uint32))


def share_through(exponent: float, fresnel: bool, rays: int = 20_000) -> float:
    """What of the rays that fall straight onto the slab gets out, by random facets."""
    chance = np.random.default_rng(5)
    return float(np.mean([one_through(exponent, fresnel, chance) for _ in range(rays)]))


def one_through(exponent: float, fresnel: bool, chance: np.random.Generator) -> float:
    d, inside, weight = np.array([0.0, 0.0, -1.0]), False, 1.0
    while weight > 0:
        n = np.array([0.0, 0.0, -np.sign(d[2])])
        cosine, turn = chance.random() ** (1 / (exponent + 1)), 2 * np.pi * chance.random()
        across = np.sqrt(1 - cosine**2) * np.array([np.cos(turn), np.sin(turn), 0.0])
        h = cosine * n + across if d @ (cosine * n + across) < 0 else cosine * n - across
        d, weight, inside = at_facet(d, h, n, inside, weight, fresnel, chance)
        if not inside:
            return weight
    return 0.0


def at_facet(d, h, n, inside: bool, weight: float, fresnel: bool, chance):
    """How a ray goes on: direction, weight, and whether within the slab."""
    index = 1 / 1.45 if inside else 1.45
    cosine = -(d @ h)
    inner2 = 1 - (1 - cosine**2) / index**2
    mirrored = reflectance(cosine, index) if inner2 > 0 else 1.0
    if inside and fresnel and chance.random() < mirrored:
        back = d + 2 * cosine * h
        return back, weight * (back @ n > 0), inside
    if inner2 <= 0:
        return d, 0.0, inside
    out = d / index + (cosine / index - np.sqrt(inner2)) * h
    weight *= 1 - mirrored if fresnel and not inside else 1.0
    return out, weight * (out @ n < 0), not inside


def reflectance(cosine: float, index: float) -> float:
    """Fresnel's, unpolarised, by the angles."""
    a = np.arccos(cosine)
    b = np.arcsin(np.sin(a) / index)
    if a < 1e-6:
        return ((index - 1) / (index + 1)) ** 2
    across, along = np.sin(a - b) / np.sin(a + b), np.tan(a - b) / np.tan(a + b)
    return (across**2 + along**2) / 2


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("exponent", [8.0, 30.0])
@pytest.mark.parametrize("fresnel", [False, True])
def test_as_much_gets_through_a_slab_as_its_facets_let(
    fresnel: bool, exponent: float, backend: str
) -> None:
    """What facets mirror inside is lost without Fresnel, and what they mirror outside with it."""
    scene = alone(above(slab(), glass(exponent, fresnel=fresnel)))
    scene = replace(scene, camera=replace(scene.camera, resolution=(1, 1)))
    mean = drawn(scene, backend, samples=512, max_bounces=64).mean()
    assert abs(mean - share_through(exponent, fresnel)) < 0.01


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_highlight_of_the_outer_side_is_none_on_the_inner_one(backend: str) -> None:
    for outside in (False, True):
        lobe = Lobe("SPECULAR", exponent=20.0, masking=0.3, outside=outside)
        turned = np.column_stack([np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 1.0)])
        place = np.column_stack([np.eye(3), (0.0, 0.0, 5.0)])
        lamp = Light("lamp", "POINT", place, strength=999.0)
        front = alone(above(pane(), Material("shiny", (lobe,)), background=(0.0, 0.0, 0.0)))
        front = replace(front, lights=(lamp,))
        back = replace(front.instances[0], world_from_object=turned[None])
        seen = [drawn(x, backend) for x in (front, replace(front, instances=(back,)))]
        assert seen[0][10:14, 10:14].min() > 0.01
        if outside:
            assert seen[1].max() == 0
        else:
            np.testing.assert_allclose(seen[1], seen[0], atol=1e-3)


@pytest.mark.parametrize("geometry", [ball(0.9), pane()], ids=["ball", "pane"])
@pytest.mark.parametrize("exponent", [0.5, 6.0, 200.0])
def test_both_tracers_draw_the_same(geometry, exponent: float) -> None:
    scene = above(geometry, glass(exponent, 0.8, fresnel=True))
    native, exact = (drawn(scene, backend) for backend in BACKENDS)
    off = np.abs(native - exact).max(2)
    assert np.median(off) < 1e-6
    assert (off > 1e-4).mean() < 0.01


def test_a_narrow_lobe_is_clear_glass() -> None:
    clear, rough = (drawn(above(ball(0.9), glass(exponent))) for exponent in (0.0, 1e12))
    assert np.abs(clear - rough).mean() < 1e-4


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_cannot_enter_is_of_no_refraction(backend: str) -> None:
    """From where the sine of the view is above an index below 1 on: highlights mirror there."""
    lobe = replace(glass(1e12, fresnel=True).lobes[0], ior=0.5)
    scene = above(ball(0.9), Material("air", (lobe,)))
    x, y = np.meshgrid(*2 * [(np.arange(24) + 0.5) / 12 - 1])
    sine = np.hypot(x, y) / 0.9
    picture = drawn(scene, backend, samples=1).max(-1)
    assert picture[(sine > 0.55) & (sine < 0.95)].max() == 0
    assert picture[sine < 0.45].min() > 0.1


def test_an_edge_behind_a_pane_is_blurred_by_its_lobe() -> None:
    """Small angles: a half vector at the angle a bends the ray by a (1 - 1 / ior), and the share
    (1 - cos^(p + 1) a) of all lies within a: a normal distribution of variance 1 / (p + 1).
    """
    exponent, height = 400.0, 2.0
    scene = above(pane(), glass(exponent), height, background=(0, 0, 0))
    picture = drawn(scene, samples=4096)[..., 2].mean(0)
    place = (np.arange(24) + 0.5) / 12 - 1
    from math import erf

    sigma = height * (1 - 1 / 1.45) / np.sqrt(exponent + 1)
    truth = [0.5 * (1 + erf(x / sigma / np.sqrt(2))) for x in place]
    assert np.abs(picture - truth).max() < 0.01
    assert 0.05 < truth[11] < 0.95


def test_threads_and_borders_change_no_bit() -> None:
    scene = above(ball(0.9), glass(6.0))
    whole = drawn(scene, error_threshold=4.0, samples=32, threads=1)
    assert (whole == drawn(scene, error_threshold=4.0, samples=32, threads=3)).all()
    part = drawn(scene, error_threshold=4.0, samples=32, region=(5, 3, 17, 20))
    assert (whole[3:20, 5:17] == part).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_pixels_do_not_stop_because_their_first_samples_agree(backend: str) -> None:
    scene = above(pane(), glass(2.0), 3.0, background=(0, 0, 0))
    settings = Settings(samples=64, error_threshold=4.0, passes={"Samples"}, backend=backend)
    clear = replace(scene, materials=(scene.materials[0], glass(0.0)))
    assert render(clear, settings).passes["Samples"].min() == 4
    assert render(scene, settings).passes["Samples"].min() > 4


def test_explained_pixels_have_the_colours_of_the_picture() -> None:
    scene, settings = above(ball(0.9), glass(6.0, fresnel=True)), Settings(samples=1)
    picture = render(scene, settings).passes["Combined"]
    explainer = PixelExplainer(scene, settings)
    for x, y in ((12, 12), (5, 9), (16, 14)):
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-4, atol=1e-6)
        assert "refraction" in {after.kind for after in ray.follow}


def computed(number: float) -> tuple[Graph, Value]:
    """A number that a program gives at every point."""
    graph = Graph()
    x = graph.apply(BY_NAME["position"], shift=0)[0]
    zero = graph.apply(BY_NAME["product"], x, graph.constant((0.0, 0.0, 0.0)))[0]
    none = graph.apply(BY_NAME["separate_xyz"], zero)[0]
    given = (none, graph.constant(number), graph.constant(0.0))
    return graph, graph.apply(BY_NAME["math"], *given, operation=MathOperation.ADD, clamp=0)[0]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("fresnel", [False, True])
@pytest.mark.parametrize(
    ("number", "output"),
    [(6.0, "exponent_output"), (0.0, "exponent_output"), (1.45, "ior_output")],
)
def test_numbers_of_a_program_are_as_good_as_constants(number, output, fresnel, backend) -> None:
    constant = glass(number if output == "exponent_output" else 6.0, fresnel=fresnel)
    graph, value = computed(number)
    (lobe,) = constant.lobes
    most = {"exponent": 200.0} if output == "exponent_output" else {"ior": 1.9}
    varied = replace(
        constant,
        lobes=(replace(lobe, **most, **{output: 0}),),
        program=compile_program(graph, [value]),
    )
    expected = drawn(above(ball(0.9), constant), backend)
    np.testing.assert_allclose(drawn(above(ball(0.9), varied), backend), expected, atol=1e-6)


def test_what_is_no_index_leaves_the_lobes_own() -> None:
    for number in (0.0, -1.0, float("nan"), float("inf")):
        graph, value = computed(number)
        constant = glass(6.0)
        program = compile_program(graph, [value])
        lobe = replace(constant.lobes[0], ior_output=0)
        varied = replace(constant, lobes=(lobe,), program=program)
        for backend in BACKENDS:
            found = drawn(above(ball(0.9), varied), backend)
            expected = drawn(above(ball(0.9), constant), backend)
            np.testing.assert_allclose(found, expected, atol=1e-6)


def test_both_tracers_draw_glass_that_varies_the_same() -> None:
    graph = Graph()
    x, y, _ = graph.apply(BY_NAME["separate_xyz"], graph.apply(BY_NAME["position"], shift=0)[0])
    do = lambda name, *given: graph.apply(  # noqa: E731
        BY_NAME["math"],
        *(graph.constant(g) if isinstance(g, float) else g for g in given),
        operation=MathOperation[name],
        clamp=0,
    )[0]
    exponent = do("MULTIPLY_ADD", x, 100.0, 50.0)
    ior = do("MULTIPLY_ADD", y, 0.2, 1.4)
    shape = {"exponent_output": 0, "ior_output": 1}
    lobes = (
        Lobe("SPECULAR", ior=1.5, fresnel=True, exponent=40.0, masking=0.3, ior_output=1),
        Lobe("MIRROR", ior=1.5, fresnel=True, ior_output=1),
        Lobe("REFRACTION", (Input((0.8,) * 3),), 200.0, 1.5, fresnel=True, **shape),
    )
    material = Material("glass", lobes, program=compile_program(graph, [exponent, ior]))
    for geometry in (ball(0.9), pane()):
        native, exact = (drawn(above(geometry, material), backend) for backend in BACKENDS)
        off = np.abs(native - exact).max(2)
        assert np.median(off) < 1e-6
        assert (off > 1e-4).mean() < 0.01
        assert exact.std() > 0.02


def shown_by_facets(cosine: float, alpha: float, ior: float, distribution: str) -> float:
    """What of an even world facets refract once to a viewer at that cosine, integrated over all
    half vectors (Walter, Marschner, Li, Torrance 2007, equations 20, 21, 25 and 27; Heitz 2014).
    """
    count = 400
    up, turn = np.meshgrid(
        (np.arange(count) + 0.5) / count, 2 * np.pi * (np.arange(count) + 0.5) / count
    )
    across = np.sqrt(1 - up * up)
    v = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    vh = v[0] * across * np.cos(turn) + v[2] * up
    tangent2 = (across / up) ** 2
    if distribution == "GGX":
        density = alpha**2 / (np.pi * up**4 * (alpha**2 + tangent2) ** 2)
    else:
        density = np.exp(-tangent2 / alpha**2) / (np.pi * alpha**2 * up**4)
    inner = np.sqrt(1 - (1 - vh**2) / ior**2)
    parallel, perpendicular = (
        (ior * vh - inner) / (ior * vh + inner),
        (vh - ior * inner) / (vh + ior * inner),
    )
    through = 1 - 0.5 * (parallel**2 + perpendicular**2)
    below = -((vh / ior - inner) * up - cosine / ior)  # the cosine of the refracted ray
    masking = 1 / (1 + hidden(cosine, alpha, distribution) + hidden(below, alpha, distribution))
    given = density * masking * through * vh / cosine
    return float(np.where((vh > 0) & (below > 0), given, 0).mean() * 2 * np.pi)


def hidden(cosine, alpha: float, distribution: str):
    """Smith's lambda."""
    cosine = np.clip(cosine, 1e-9, 1.0)
    slope = cosine / np.sqrt(np.maximum(1 - cosine**2, 1e-18)) / alpha
    if distribution == "GGX":
        return 0.5 * (np.sqrt(1 + 1 / slope**2) - 1)
    return np.where(
        slope < 1.6, (1 - 1.259 * slope + 0.396 * slope**2) / (3.535 * slope + 2.181 * slope**2), 0
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("distribution", ["GGX", "BECKMANN"])
@pytest.mark.parametrize("degrees", [0, 60, 75])
def test_facets_hide_light_that_others_refract(degrees: float, distribution: str, backend: str):
    """A plane of rough glass in an even world, seen aslant."""
    tilt, alpha = np.radians(degrees), 0.6
    turn = np.eye(3, 4)
    turn[0, 0] = turn[2, 2] = np.cos(tilt)
    turn[0, 2], turn[2, 0] = np.sin(tilt), -np.sin(tilt)
    wide = Polygons(
        "wide",
        np.array([(-99, -99, 0), (99, -99, 0), (99, 99, 0), (-99, 99, 0)], np.float32),
        np.array([0, 4], np.uint32),
        np.arange(4, dtype=np.uint32),
    )
    camera = Camera(
        "ORTHOGRAPHIC", np.column_stack([np.eye(3), (0, 0, 500)]), (-1, 1, -1, 1), (8, 8)
    )
    rough = glass(2 / alpha**2 - 2, fresnel=True, distribution=distribution)
    scene = Scene(
        camera,
        (wide,),
        (Instances("wide", 0, turn[None], (0,)),),
        (rough,),
        world=World(background=(1.0, 1.0, 1.0)),
    )
    found = render(scene, Settings(samples=256, max_bounces=1, backend=backend)).combined[..., :3]
    truth = shown_by_facets(np.cos(tilt), alpha, 1.45, distribution)
    assert found.mean() == pytest.approx(truth, rel=0.02)
