"""Light that bumps hide: in closed form, as Cycles' kernel has it, and in both tracers."""

from __future__ import annotations

import functools
import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest

from glint import engine
from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.program.graph import Graph, Value
from glint.engine.program.operations_vector import VectorOperation
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.scene.problems import scene_problems
from native_tools import assert_instruction_sets_agree, constant, lamp, needs_core
from surface_scenes import balls, plane

BACKENDS = ("NATIVE", "NUMPY")
KINDS = ("SIDES", "CHIANG", "GGX")
SHINE = s.Lobe("SPECULAR", constant(0.3), 8.0)


def cycles(kind: str, n: np.ndarray, m: np.ndarray, l: np.ndarray) -> float:  # noqa: E741
    """What Cycles' bump_shadowing_term gives, of 4.2 (CHIANG) and 4.5 (GGX), for n·l > 0."""
    ml, mn, nl = m @ l, m @ n, n @ l
    if ml * mn < 0:
        return 0.0
    if kind == "CHIANG":
        g = ml / (nl * mn)
        return 1.0 if g >= 1 else g + g**2 - g**3
    if kind == "SIDES" or abs(mn) >= 1 or abs(ml) >= 1:
        return 1.0
    if abs(ml) < 1e-6:
        return 0.0
    alpha2 = min(max(0.125 * (1 / mn**2 - 1), 0), 1)
    return 2 / (1 + math.sqrt(1 + alpha2 * (1 / ml**2 - 1)))


def vector(graph: Graph, name: str, *arguments: Value) -> Value:
    zero = graph.constant(0.0)
    given = (*arguments, graph.constant((0.0, 0.0, 0.0)), graph.constant((0.0, 0.0, 0.0)))[:3]
    operation = BY_NAME["vector_math"]
    return graph.apply(operation, *given, zero, operation=VectorOperation[name])[0]


def tilted(lobes, kind: str, n, base=None) -> s.Material:
    """A material whose normal is n, bent from `base`, the mesh's where there is none."""
    graph = Graph()
    point, none = graph.apply(BY_NAME["normal"])[0], graph.constant(0.0)
    values = [  # constants have no slots
        graph.apply(BY_NAME["scaled_sum"], point, none, graph.constant(tuple(map(float, each))))[0]
        for each in (n, base)
        if each is not None
    ]
    program = compile_program(graph, values)
    return s.Material(
        "bent",
        tuple(lobes),
        program=program,
        normal_output=0,
        bump_shadowing=kind,
        base_normal_output=-1 if base is None else 1,
    )


def bumpy(lobes, kind: str) -> s.Material:
    """Waves of normals in the world's x and z, steep as bumps are."""
    graph = Graph()
    waves = vector(graph, "SINE", graph.apply(BY_NAME["position"], shift=0)[0])
    high = graph.apply(BY_NAME["scaled_sum"], waves, graph.constant(9.0), waves)[0]
    bent = vector(graph, "ADD", graph.apply(BY_NAME["normal"])[0], vector(graph, "SINE", high))
    program = compile_program(graph, [bent])
    return s.Material("bumpy", tuple(lobes), program=program, normal_output=0, bump_shadowing=kind)


def sun_from(direction) -> s.Light:
    z = np.array(direction) / np.linalg.norm(direction)
    x = np.cross(z, [0.3, 0.9, 0.1])
    x /= np.linalg.norm(x)
    axes = np.stack([x, np.cross(z, x), z], 1)
    return lamp("SUN", axes=axes, strength=np.pi)


def in_middle(scene: s.Scene, backend: str, **settings) -> np.ndarray:
    options = {"samples": 1, "backend": backend, "region": (8, 8, 9, 9), **settings}
    return render(scene, Settings(**options)).passes["Combined"][0, 0, :3].astype(float)


NORMALS = [(0.5, 0.0, 1.0), (2.0, 0.3, 0.6), (0.0, -4.0, 0.5), (0.2, 0.1, -0.5)]
DIRECTIONS = [(1.0, 0.2, 0.5), (0.9, -0.4, 0.05), (0.3, 0.1, 2.0), (-0.3, -1.0, 0.4)]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_plane_under_a_sun(kind: str, backend: str) -> None:
    """The matt lobes of a bent normal, against Cycles' formula."""
    up = np.array([0.0, 0.0, 1.0])
    for n in NORMALS:
        for direction in DIRECTIONS:
            scene = plane(lights=(sun_from(direction),))
            scene = replace(scene, materials=(tilted([s.Lobe("DIFFUSE")], kind, n),))
            unit_n, l = (np.array(x) / np.linalg.norm(x) for x in (n, direction))  # noqa: E741
            expected = max(unit_n @ l, 0) * (cycles(kind, unit_n, up, l) if unit_n @ l > 0 else 0)
            found = in_middle(scene, backend)
            np.testing.assert_allclose(found, expected, rtol=2e-6, atol=2e-7, err_msg=str(n))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", KINDS)
def test_what_was_bent_twice(kind: str, backend: str) -> None:
    """From a normal of the program, as where displacement bumps what a Bump node bends on."""
    n, base, direction = (2.0, 0.3, 0.6), (0.3, 0.2, 1.0), (0.2, -0.9, 0.8)
    scene = plane(lights=(sun_from(direction),))
    scene = replace(scene, materials=(tilted([s.Lobe("DIFFUSE")], kind, n, base),))
    n, m, l = (np.array(x) / np.linalg.norm(x) for x in (n, base, direction))  # noqa: E741
    np.testing.assert_allclose(
        in_middle(scene, backend), max(n @ l, 0) * cycles(kind, n, m, l), rtol=2e-6, atol=1e-7
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_highlights_are_hidden_from_behind_alone(backend: str) -> None:
    """By a plane that hides nothing itself, as light from behind is to be stopped by the rule."""
    for direction, share in (((1.0, 0.0, 0.2), 1.0), ((1.0, 0.0, -0.2), 0.0)):
        light = replace(sun_from(direction), cast_shadow=False)
        found = {}
        for kind in ("NONE", "GGX"):
            scene = plane(lights=(light,))
            scene = replace(scene, materials=(tilted([SHINE], kind, (1.0, 0.0, 0.6)),))
            found[kind] = in_middle(scene, backend)
        assert found["NONE"].all()
        np.testing.assert_array_equal(found["GGX"], share * found["NONE"])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", KINDS)
def test_layers_are_seen_as_their_microfacets(kind: str, backend: str) -> None:
    """What lies below gloss, (1 - n·v)^p, over the normal that the gloss has: seen from above a
    lifted one mirrors the view to 0.01 over the plane.
    """
    direction, p = np.array((0.9, -0.4, 0.5)), 3.0
    scene = plane(lights=(sun_from(direction),))
    for n in ((0.5, 0.0, 1.0), (2.0, 0.3, 0.6), (0.2, 0.1, -0.5)):
        lobes = s.Lobe("DIFFUSE"), s.Lobe("DIFFUSE", exponent=p)
        always, both = (
            in_middle(replace(scene, materials=(tilted(lobes[:k], kind, n),)), backend)
            for k in (1, 2)
        )
        seen = max(n[2] / np.linalg.norm(n), 0)
        if kind != "SIDES":
            seen = max(seen, math.sqrt((1 + 0.01) / 2))
        np.testing.assert_allclose(both, always * (1 + (1 - seen) ** p), rtol=1e-5, err_msg=str(n))


def integral(kind: str, n, of=lambda l: 1.0) -> float:  # noqa: E741
    """∫ n·l B(l) L(l) / π over the directions before n."""
    count, up = 400, np.array([0.0, 0.0, 1.0])
    n = np.array(n) / np.linalg.norm(n)
    x = np.cross(n, [0.1, 1.0, 0.2])
    x /= np.linalg.norm(x)
    y, total = np.cross(n, x), 0.0
    for i in range(count):
        radius = math.sqrt((i + 0.5) / count)
        for turn in np.arange(120) * 2 * np.pi / 120:
            a, b = radius * math.cos(turn), radius * math.sin(turn)
            l = a * x + b * y + math.sqrt(1 - radius**2) * n  # noqa: E741
            total += cycles(kind, n, up, l) * of(l)
    return total / (count * 120)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", KINDS)
def test_an_even_sky(kind: str, backend: str) -> None:
    """Over an open plane: what is before both normals, less what bumps hide of it. The last row of
    a sky is black: what shines from below is hidden by the plane as well.
    """
    n = (1.5, 0.0, 1.0)
    sky = np.ones((64, 128, 3), np.float32)
    light = s.Light("sky", "DOME", np.eye(4)[:3], radiance=sky)
    scene = replace(plane(lights=(light,)), materials=(tilted([s.Lobe("DIFFUSE")], kind, n),))
    expected = integral(kind, n)
    found = in_middle(scene, backend, samples={"NATIVE": 64, "NUMPY": 32}[backend])
    np.testing.assert_allclose(found, expected, rtol=0.01)


def lights() -> dict[str, tuple[s.Light, ...]]:
    many = tuple(
        lamp("POINT", (6 * math.cos(k), 6 * math.sin(k), 3 + k % 3), strength=90.0, radius=0.0)
        for k in range(90)
    )
    rows = np.linspace(0.1, 2.0, 16)[:, None, None]
    sky = np.broadcast_to(rows, (16, 32, 3)).astype(np.float32).copy()
    return {
        "point": (lamp("POINT", (2, 1, 2), strength=900.0, radius=0.0),),
        "ball": (lamp("POINT", (2, 1, 2), strength=900.0, radius=0.5),),
        "area": (lamp("AREA", strength=900.0, size_x=2.0, size_y=1.0),),
        "sun": (sun_from((1, 0.3, 0.4)), lamp("SUN", strength=1.0, angle=0.2)),
        "sky": (s.Light("sky", "DOME", np.eye(4)[:3], radiance=sky),),
        "many": many,
    }


MATT = s.Lobe("DIFFUSE", constant(0.5, 0.4, 0.3))
NARROW = s.Lobe("SPECULAR", constant(0.3), 60.0, masking=0.2)
SHEEN = s.Lobe("SHEEN", constant(0.2), width=0.3, lean=0.1)
BELOW = s.Lobe("DIFFUSE", constant(-0.2), 2.0)


def lit(name: str, kind: str = "GGX") -> s.Scene:
    material = bumpy((MATT, BELOW, NARROW, SHEEN), kind)
    return replace(balls(MATT, lights=lights()[name]), materials=(material,))


@needs_core
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", lights())
def test_both_tracers_draw_the_same(name: str, kind: str) -> None:
    passes = frozenset({"Diffuse", "Specular", "Shadow", "Combined"})
    films = [
        render(lit(name, kind), Settings(samples=2, passes=passes, backend=backend))
        for backend in BACKENDS
    ]
    plain = render(lit(name, "NONE"), Settings(samples=2, passes=passes))
    assert np.abs(plain.passes["Diffuse"] - films[0].passes["Diffuse"]).max() > 1e-3
    for each in films[0].passes:
        found, expected = (film.passes[each] for film in films)
        np.testing.assert_allclose(found, expected, rtol=5e-4, atol=2e-5, err_msg=each)


def room() -> s.Scene:
    """A ball on a floor that both throw light on, one of them bumped; a panel glows."""
    scene = balls(MATT)
    floor = plane(MATT).geometries[0]
    panel = replace(floor, vertices=0.1 * floor.vertices)
    down = np.array([[[1.0, 0, 0, 1.2], [0, -1, 0, 0], [0, 0, -1, 2.0]]])
    under = np.eye(4)[None, :3].copy()
    under[0, 2, 3] = -0.9
    glow = s.Material("glow", (s.Lobe("EMISSION", constant(9.0)),))
    return replace(
        scene,
        geometries=(*scene.geometries, floor, panel),
        instances=(
            *scene.instances,
            s.Instances("floor", 1, under, (1,)),
            s.Instances("panel", 2, down, (2,)),
        ),
        materials=(bumpy((MATT, NARROW), "GGX"), bumpy((MATT,), "GGX"), glow),
        lights=(sun_from((-0.4, 0.2, 1.0)),),
    )


@needs_core
def test_bounced_and_mesh_light_are_the_same_in_both_tracers() -> None:
    name, bounces = "Diffuse Indirect", {"diffuse_bounces": 2, "mesh_light": "ON"}
    settings = {"samples": 4, "passes": frozenset({"Combined", name}), **bounces}
    found, expected = (render(room(), Settings(backend=b, **settings)).passes for b in BACKENDS)
    for each in ("Combined", name):
        off = np.abs(found[each] - expected[each]).max(-1) > 1e-3 * expected[each].max()
        assert off.mean() <= 0.02 and abs(found[each].mean() / expected[each].mean() - 1) < 1e-3
    none = tuple(replace(m, bump_shadowing="NONE") for m in room().materials)
    brighter = render(replace(room(), materials=none), Settings(**settings)).passes
    assert brighter[name].mean() > 1.01 * found[name].mean()


@needs_core
def test_threads_borders_and_other_materials_change_no_bit() -> None:
    scene = lit("area")
    whole = render(scene, Settings(samples=8, threads=1)).passes["Combined"]
    assert (whole == render(scene, Settings(samples=8, threads=3)).passes["Combined"]).all()
    part = render(scene, Settings(samples=8, region=(3, 4, 11, 12))).passes["Combined"]
    assert (whole[4:12, 3:11] == part).all()


@functools.cache
def hashes() -> str:
    lines = []
    for name in lights():
        film = render(lit(name), Settings(samples=4, light_samples=2))
        lines.append(hashlib.sha256(film.passes["Combined"].tobytes()).hexdigest())
    return " ".join(lines)


@needs_core
def test_same_bits_from_every_instruction_set() -> None:
    assert_instruction_sets_agree(hashes)


@needs_core
def test_surfaces_without_a_bent_normal_keep_their_bits() -> None:
    """Beside one that has it."""
    one = balls(MATT, NARROW, lights=lights()["area"])
    far = np.eye(4)[None, :3].copy()
    far[0, :, 3] = 0.5, 0.5, -0.6
    two = replace(one, instances=(*one.instances, s.Instances("far", 0, far, (1,))))
    pictures = [
        render(
            replace(two, materials=(one.materials[0], bumpy((MATT, SHINE), kind))),
            Settings(samples=4, passes=frozenset({"Material Index", "Combined"})),
        ).passes
        for kind in ("NONE", "GGX")
    ]
    same = (pictures[0]["Combined"] == pictures[1]["Combined"]).all(-1)
    assert same[:8, :8].all() and not same.all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_strands_are_not_bumped(backend: str) -> None:
    points = np.array([[-0.5, 0, 0], [0.5, 0.1, 0]], np.float32)
    hair = s.Strands("hair", points, np.full(2, 0.3, np.float32), np.zeros(1, np.uint32))
    found = []
    for kind in ("NONE", "GGX"):
        scene = balls(MATT, lights=(sun_from((1, 0.3, 0.4)),))
        scene = replace(scene, geometries=(hair,), materials=(bumpy((MATT,), kind),))
        found.append(render(scene, Settings(samples=1, backend=backend)).passes["Combined"])
    assert found[0].any()
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("base", [(0, 0, 0), (math.nan, 1, 0), (1, 0, 0), (-1, 0, 1e-30)])
def test_odd_normals_stay_finite(base, backend: str) -> None:
    """The last two are across what is lit, or all but; the first two fall back to the mesh's."""
    found = []
    for kind in KINDS:
        for n in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1e-200, 0.0, 1e-200)):
            scene = plane(lights=(sun_from((0.3, 0.5, 1.0)),))
            scene = replace(scene, materials=(tilted([MATT, NARROW], kind, n, base),))
            found.append(in_middle(scene, backend))
    assert np.isfinite(found).all() and np.max(found) < 2


def test_explained_pixels_have_the_colours_of_the_picture() -> None:
    scene, settings = lit("sun"), Settings(samples=1)
    picture = render(scene, settings).passes["Combined"]
    explainer, texts = PixelExplainer(scene, settings), []
    for x, y in ((8, 8), (5, 9), (12, 6), (3, 7)):
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-3, atol=1e-6)
        texts += explanation_lines(ray)
    assert any("bumps leave" in text for text in texts)


def test_problems_are_told() -> None:
    scene = lit("point")
    wrong = replace(scene.materials[0], bump_shadowing="BUMPY", base_normal_output=7)
    problems = scene_problems(replace(scene, materials=(wrong,)))
    assert any("bump_shadowing" in p for p in problems)
    assert any("base_normal_output" in p for p in problems)
    assert engine.scene.BUMP_SHADOWING[0] == s.Material("m", ()).bump_shadowing
