"""Lobes with shading normals of their own, and normals that are lifted so that mirrors see nothing
below the surface.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.reference.bumps import lifted
from glint.engine.scene.problems import scene_problems
from native_tools import constant, lamp, needs_core
from surface_scenes import balls, plane
from test_bump_shadow import BACKENDS, MATT, NARROW, SHEEN, in_middle, lights, sun_from, vector

GLOSS = s.Lobe("SPECULAR", constant(0.4), 30.0, 1.5, fresnel=True, masking=0.3)
MIRROR = s.Lobe("MIRROR", constant(0.5), ior=1.5, fresnel=True)
GLASS = s.Lobe("REFRACTION", constant(0.6), ior=1.4, fresnel=True)


def with_normals(
    own: tuple[s.Lobe, ...], others: tuple[s.Lobe, ...], kind: str = "NONE", bends: bool = False
) -> s.Material:
    """Waves of normals: of the lobes `own` alone, or of the whole surface where it bends."""
    graph = Graph()
    waves = vector(graph, "SINE", graph.apply(BY_NAME["position"], shift=0)[0])
    high = graph.apply(BY_NAME["scaled_sum"], waves, graph.constant(9.0), waves)[0]
    normal = graph.apply(BY_NAME["normal"])[0]
    bent = vector(graph, "ADD", normal, vector(graph, "SINE", high))
    program = compile_program(graph, [bent, normal])
    output = 1 if bends else 0
    return s.Material(
        "coated",
        (*(replace(lobe, normal_output=output) for lobe in own), *others),
        program=program,
        normal_output=0 if bends else -1,
        bump_shadowing=kind,
    )


SETTINGS = {"samples": 2, "max_bounces": 2, "reflections": "ALL"}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", sorted(set(lights()) - {"many"}))
def test_a_lobes_normal_is_as_the_surfaces(name: str, backend: str) -> None:
    """Where all lobes have the same one: of each light, of reflections and mirrors. (Clusters of
    lamps are as one to points without such lobes alone.)
    """
    lobes = (GLOSS, MIRROR, NARROW)
    own = with_normals(lobes, ())
    all_ = replace(with_normals((), lobes), normal_output=0)
    scene = balls(MATT, lights=lights()[name], world=s.World(background=(0.2, 0.3, 0.4)))
    found, expected = (
        render(replace(scene, materials=(m,)), Settings(backend=backend, **SETTINGS)).passes
        for m in (own, all_)
    )
    assert expected["Combined"].std() > 0.01
    np.testing.assert_allclose(found["Combined"], expected["Combined"], rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_lobe_is_lit_before_its_own_normal_alone(backend: str) -> None:
    """A plane whose normal is up, with a highlight at a normal that lies over to x."""
    n = np.array([0.8, 0.0, 0.6])
    graph = Graph()
    point, none = graph.apply(BY_NAME["normal"])[0], graph.constant(0.0)
    value = graph.apply(BY_NAME["scaled_sum"], point, none, graph.constant(tuple(map(float, n))))
    program = compile_program(graph, [value[0]])
    shine = s.Lobe("SPECULAR", constant(0.5), 5.0, normal_output=0)
    material = s.Material("m", (MATT, shine), program=program)
    up = np.array([0.0, 0.0, 1.0])
    for direction in ((0.5, 0.2, 0.8), (0.95, 0.1, -0.1), (-0.9, 0.0, 0.4)):
        l = np.array(direction) / np.linalg.norm(direction)  # noqa: E741
        light = replace(sun_from(l), cast_shadow=False)
        h = (l + up) / np.linalg.norm(l + up)
        diffuse = np.array([0.5, 0.4, 0.3]) * max(l @ up, 0)
        expected = diffuse + 0.5 * max(n @ h, 0) ** 5 * (n @ l > 0)
        scene = replace(plane(MATT, lights=(light,)), materials=(material,))
        np.testing.assert_allclose(in_middle(scene, backend), expected, rtol=3e-6, atol=1e-7)


def test_lifted_normals_mirror_to_just_above_the_surface() -> None:
    random = np.random.default_rng(1)
    n, g, v = random.normal(size=(3, 3, 20000))
    n, g, v = (x / np.linalg.norm(x, axis=0) for x in (n, g, v))
    g = np.where((g * v).sum(0) < 0, -g, g)
    found = lifted(n, g, v)
    np.testing.assert_allclose(np.linalg.norm(found, axis=0), 1, rtol=1e-9)

    def above(n: np.ndarray) -> np.ndarray:
        return (g * (2 * (n * v).sum(0) * n - v)).sum(0)

    least = np.minimum(0.9 * (v * g).sum(0), 0.01)
    low = above(n) < least
    assert 0.2 < low.mean() < 0.8
    np.testing.assert_array_equal(found[:, ~low], n[:, ~low])
    np.testing.assert_allclose(above(found)[low], least[low], atol=2e-6)
    assert ((found * np.cross(n, g, axis=0)).sum(0)[low] < 1e-9).all()  # in the plane of n and g


SCENES = {
    "bumped": ((), (MATT, GLOSS, MIRROR, NARROW), "GGX", True),
    "bumped, without correction": ((), (MATT, GLOSS, MIRROR, NARROW), "SIDES", True),
    "bumped glass": ((), (MIRROR, GLASS, replace(GLASS, exponent=40.0)), "CHIANG", True),
    "smooth coat on bumps": ((GLOSS, MIRROR), (MATT, NARROW, SHEEN, MIRROR), "GGX", True),
    "bumped coat": ((GLOSS, MIRROR), (MATT, NARROW), "GGX", False),
}


@needs_core
@pytest.mark.parametrize("light", ["area", "sky", "many", "sun"])
@pytest.mark.parametrize("name", SCENES)
def test_both_tracers_draw_the_same(name: str, light: str) -> None:
    own, others, kind, bends = SCENES[name]
    scene = balls(MATT, lights=lights()[light], world=s.World(background=(0.2, 0.3, 0.4)))
    scene = replace(scene, materials=(with_normals(own, others, kind, bends),))
    core, reference = (
        render(scene, Settings(backend=backend, **SETTINGS)).passes["Combined"]
        for backend in BACKENDS
    )
    off = np.abs(core - reference).max(-1) > 1e-3 * (1 + reference[..., :3].max())
    assert core.std() > 0.01 and off.mean() <= 0.01


@needs_core
def test_threads_and_borders_change_no_bit() -> None:
    scene = balls(MATT, lights=lights()["area"])
    scene = replace(scene, materials=(with_normals(*SCENES["smooth coat on bumps"]),))
    whole = render(scene, Settings(threads=1, **SETTINGS)).passes["Combined"]
    assert (whole == render(scene, Settings(threads=3, **SETTINGS)).passes["Combined"]).all()
    part = render(scene, Settings(region=(3, 4, 11, 12), **SETTINGS)).passes["Combined"]
    assert (whole[4:12, 3:11] == part).all()


@needs_core
def test_other_materials_keep_their_bits() -> None:
    """Beside one with lobes that have normals of their own."""
    light = lamp("AREA", strength=900.0, size_x=2.0, size_y=1.0)
    one = balls(MATT, GLOSS, lights=(light,))
    far = np.eye(4)[None, :3].copy()
    far[0, :, 3] = 0.5, 0.5, -0.6
    two = replace(one, instances=(*one.instances, s.Instances("far", 0, far, (1,))))
    pictures = [
        render(replace(two, materials=(one.materials[0], other)), Settings(samples=4))
        for other in (one.materials[0], with_normals(*SCENES["bumped coat"]))
    ]
    first, second = (film.passes["Combined"] for film in pictures)
    assert (first == second).all(-1)[:8, :8].all() and (first != second).any()


def test_explained_pixels_have_the_colours_of_the_picture() -> None:
    scene = balls(MATT, lights=lights()["sun"])
    scene = replace(scene, materials=(with_normals(*SCENES["bumped coat"]),))
    settings = Settings(samples=1, reflections="OFF")
    picture = render(scene, settings).passes["Combined"]
    explainer = PixelExplainer(scene, settings)
    for x, y in ((8, 8), (5, 9), (12, 6)):
        np.testing.assert_allclose(
            explainer.pixel(x, y).color, picture[y, x, :3], rtol=1e-3, atol=1e-6
        )


def test_an_output_that_is_not_there_is_told() -> None:
    scene = balls(MATT, replace(GLOSS, normal_output=3))
    assert any("normal_output" in problem for problem in scene_problems(scene))
