"""Highlights that are stretched along the surface, in closed form and in both tracers."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.reference.closures import stretching
from glint.engine.reference.closures.microfacet import sample
from glint.engine.reference.lights import LightPoint
from native_tools import assert_instruction_sets_agree, constant, needs_core
from surface_scenes import balls, plane
from test_bump_shadow import BACKENDS, MATT, in_middle, lights, sun_from

UP = np.array([0.0, 0.0, 1.0])


def brushed(along, *lobes: s.Lobe) -> s.Material:
    """A material whose highlights are stretched along a constant direction."""
    graph = Graph()
    point, none = graph.apply(BY_NAME["normal"])[0], graph.constant(0.0)
    value = graph.constant(tuple(map(float, along)))
    program = compile_program(graph, [graph.apply(BY_NAME["scaled_sum"], point, none, value)[0]])
    return s.Material(
        "brushed",
        tuple(replace(x, stretch_output=0) if x.kind == "SPECULAR" else x for x in lobes),
        program=program,
    )


def wanted(
    p: float,
    alpha: float,
    t: np.ndarray,
    l: np.ndarray,  # noqa: E741
    distribution: str = "BLINN_PHONG",
) -> float:
    """A highlight at a plane seen from above: in slopes x along t and y across it, x |t|, y / |t|,
    and masking of as much (Walter, Marschner, Li, Torrance 2007).
    """
    size = np.linalg.norm(t)
    x, y = t / size, np.cross(UP, t / size)
    h = (l + UP) / np.linalg.norm(l + UP)
    slope = np.array([h @ x * size, h @ y / size]) / h[2]
    power = (1 + slope @ slope) ** (-(p + 4) / 2) / h[2] ** 4
    if alpha == 0:
        return power
    if distribution == "GGX":
        power = 1 / (4 * alpha**2 * h[2] ** 4 * (1 + slope @ slope / alpha**2) ** 2)
    elif distribution == "BECKMANN":
        power = np.exp(-slope @ slope / alpha**2) / (4 * alpha**2 * h[2] ** 4)
    elif distribution == "ASHIKHMIN_SHIRLEY":
        power = (1 + slope @ slope) ** (-(2 / alpha**2 + 2) / 2) / (4 * alpha**2 * h[2] ** 4)
        return power * (1 - alpha**2 / 2) * l[2] / h[2]  # n·v is 1
    tangents = np.array([l @ x / size, l @ y * size]) * alpha / l[2]
    if distribution == "BECKMANN":
        a = 1 / np.sqrt(tangents @ tangents)
        whole = (3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2)
        return power * (whole if a < 1.6 else 1.0)
    return power * 2 / (1 + np.sqrt(1 + tangents @ tangents))  # v along n: no masking of it


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("alpha", "distribution"), [(0.0, "BLINN_PHONG"), *((0.3, name) for name in s.DISTRIBUTIONS)]
)
@pytest.mark.parametrize("size", [0.3, 1.0, 4.0])
def test_a_plane_under_a_sun(size: float, alpha: float, distribution: str, backend: str) -> None:
    t = size * np.array([0.8, 0.6, 0.0])
    lobe = s.Lobe("SPECULAR", constant(0.5), 12.0, masking=alpha, distribution=distribution)
    for direction in ((0.6, 0.2, 0.8), (-0.5, 0.9, 0.6), (0.1, 0.05, 1.0)):
        l = np.array(direction) / np.linalg.norm(direction)  # noqa: E741
        scene = replace(plane(MATT, lights=(sun_from(l),)), materials=(brushed(t, lobe),))
        expected = 0.5 * wanted(12.0, alpha, t, l, distribution)
        np.testing.assert_allclose(in_middle(scene, backend), expected, rtol=2e-5, atol=1e-7)


def hemisphere(count: int = 700) -> tuple[np.ndarray, np.ndarray]:
    """(3, m) directions above z = 0, and the solid angle of each."""
    z = (np.arange(count) + 0.5) / count
    turn = 2 * np.pi * (np.arange(count) + 0.5) / count
    z, turn = (x.ravel() for x in np.meshgrid(z**2, turn))
    weight = np.tile(2 * (np.arange(count) + 0.5) / count, count) * 2 * np.pi / count**2
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z]), weight


@pytest.mark.parametrize("size", [0.4, 2.0])
@pytest.mark.parametrize("p", [3.0, 40.0])
def test_stretching_keeps_what_half_vectors_add_up_to(p: float, size: float) -> None:
    h, weight = hemisphere()
    n = np.repeat(UP[:, None], h.shape[1], 1)
    t = np.zeros_like(h)
    t[0] = size
    given = (stretching.power(n, t, h, p, 4) * h[2] * weight).sum()
    assert abs(given * (p + 2) / (2 * np.pi) - 1) < 2e-3
    drawn = stretching.power(n, t, h, p, 3) * weight * (p + 1) / (2 * np.pi)
    assert abs(drawn.sum() - 1) < 2e-3

    # directions are drawn as densely: moments of the drawn ones
    places = (np.arange(4000) + 0.5) / 4000
    radius, turn = np.sqrt(places), 2 * np.pi * np.modf(np.arange(4000) * 0.6180339887)[0]
    found = np.concatenate(
        [
            sample(
                UP[:, None],
                UP[:, None],
                LightPoint((0, 0), (r * np.cos(a), r * np.sin(a))),
                min(r * r, 1 - 2.0**-53),
                p,
                t[:, :1],
            )
            for r, a in zip(radius, turn, strict=True)
        ],
        1,
    )
    np.testing.assert_allclose((found**2).mean(1), (h**2 * drawn).sum(1), rtol=0.03)


GLOSS = s.Lobe("SPECULAR", constant(0.4), 30.0, 1.5, fresnel=True, masking=0.3)
NARROW = s.Lobe("SPECULAR", constant(0.3), 300.0, masking=0.05)
SLOPES = tuple(
    s.Lobe("SPECULAR", constant(0.2), masking=0.2, distribution=name)
    for name in s.DISTRIBUTIONS[1:]
)
SETTINGS = {"samples": 4, "max_bounces": 2, "reflections": "ALL"}


def lit(name: str, along=(0.3, 0.1, 0.05)) -> s.Scene:
    scene = balls(MATT, lights=lights()[name], world=s.World(background=(0.2, 0.3, 0.4)))
    return replace(scene, materials=(brushed(along, MATT, GLOSS, NARROW, *SLOPES),))


@needs_core
@pytest.mark.parametrize("name", lights())
def test_both_tracers_draw_the_same(name: str) -> None:
    core, reference = (
        render(lit(name), Settings(backend=backend, **SETTINGS)).passes["Combined"]
        for backend in BACKENDS
    )
    off = np.abs(core - reference).max(-1) > 1e-3 * (1 + reference[..., :3].max())
    assert core.std() > 0.01 and off.mean() <= 0.01
    round_ = render(lit(name, (0, 0, 0)), Settings(**SETTINGS)).passes["Combined"]
    assert np.abs(round_ - core).max() > 0.005


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("along", [(0, 0, 0), (np.nan, 0, 0), (0, np.inf, 0)])
def test_without_a_direction_nothing_is_stretched(along, backend: str) -> None:
    settings = Settings(backend=backend, **SETTINGS)
    found = render(lit("area", along), settings).passes["Combined"]
    plain = lit("area")
    lobes = (MATT, GLOSS, NARROW, *SLOPES)
    plain = replace(plain, materials=(s.Material("plain", lobes),))
    np.testing.assert_array_equal(found, render(plain, settings).passes["Combined"])


@functools.cache
def hashes() -> str:
    pictures = (
        render(lit(name), Settings(light_samples=2, **SETTINGS)).passes["Combined"]
        for name in lights()
    )
    return " ".join(hashlib.sha256(picture.tobytes()).hexdigest() for picture in pictures)


@needs_core
def test_same_bits_from_every_instruction_set() -> None:
    assert_instruction_sets_agree(hashes)


@needs_core
def test_threads_and_borders_change_no_bit() -> None:
    whole = render(lit("area"), Settings(threads=1, **SETTINGS)).passes["Combined"]
    assert (whole == render(lit("area"), Settings(threads=3, **SETTINGS)).passes["Combined"]).all()
    part = render(lit("area"), Settings(region=(3, 4, 11, 12), **SETTINGS)).passes["Combined"]
    assert (whole[4:12, 3:11] == part).all()


def test_explained_pixels_have_the_colours_of_the_picture() -> None:
    settings = Settings(samples=1, reflections="OFF")
    picture = render(lit("sun"), settings).passes["Combined"]
    explainer = PixelExplainer(lit("sun"), settings)
    for x, y in ((8, 8), (5, 9), (12, 6)):
        np.testing.assert_allclose(
            explainer.pixel(x, y).color, picture[y, x, :3], rtol=1e-3, atol=1e-6
        )
