"""Light that bounces from strand to strand along directions drawn from their lobes."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.reference.closures import Term
from glint.engine.reference.closures.fibre import Sampler, fibre_highlight
from glint.engine.reference.coefficients import Coefficients
from glint.engine.reference.fibre_sampling import sampled
from glint.engine.sampling import BOUNCE_LEVELS
from native_tools import constant, needs_core
from test_fibres import lobe, placed, sphere, strand, view_from_above
from test_fibres import of_strands as material_of

BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
SIDE = 256
"""Directions that are sampled, along each side of the square of numbers."""
STRANDS = 8
"""So few that eight bounces let out all but .4 % of the light between them (512 samples)."""


def grid() -> np.ndarray:
    """(2, m) the middles of cells of the unit disc of equal area."""
    first, second = (np.mgrid[:SIDE, :SIDE].reshape(2, -1) + 0.5) / SIDE
    return np.sqrt(first) * np.array([np.cos(2 * np.pi * second), np.sin(2 * np.pi * second)])


class Point:
    """Of a surface seen from `height`, radians off the plane across the strand along x, as often
    as there are directions.
    """

    def __init__(self, height: float, count: int) -> None:
        v = np.array([np.sin(height), 0.0, np.cos(height)])
        self.v, self.n = (np.repeat(x[:, None], count, 1) for x in (v, np.array([0.0, 0.0, 1.0])))

    def __len__(self) -> int:
        return self.v.shape[1]


def term(kind: str, exponent: float, fan: float, lean: float, count: int) -> Term:
    made = lobe(kind, exponent=exponent, fan=fan, tilt=lean)
    numbers = {"exponent": exponent, "fan": fan, "tilt": lean}
    along = np.repeat(np.array([[1.0], [0.0], [0.0]]), count, 1)
    every = np.arange(count)
    return Term(every, np.full((3, count), 0.7), made, numbers, fibre=along)


@pytest.mark.parametrize("kind", ["SPECULAR", "TRANSMISSION"])
@pytest.mark.parametrize("exponent", [0.0, 3.0, 200.0])
@pytest.mark.parametrize(("fan", "lean"), [(0.0, 0.0), (0.16, 0.1)])
@pytest.mark.parametrize("height", [0.0, -0.6, 1.3])
def test_directions_are_drawn_as_densely_as_is_told(kind, exponent, fan, lean, height) -> None:
    """Mean of what the lobe gives there over its pdf: its integral over the sphere."""
    disc = grid()
    point, behind = Point(height, disc.shape[1]), kind == "TRANSMISSION"
    of = Sampler(point, term(kind, exponent, fan, lean, len(point)), np.arange(len(point)))
    l = of.sample(disc)  # noqa: E741
    length = np.sqrt((l * l).sum(0))
    assert ((np.abs(length - 1) < 1e-9) | (length == 0)).all()
    pdf = of.pdf(l)
    t = np.repeat(np.array([[1.0], [0.0], [0.0]]), len(point), 1)
    found = fibre_highlight(t, point.v, l, exponent, fan, behind, lean)
    good = (pdf > 0) & (length > 0)
    mean = np.where(good, found / np.where(good, pdf, 1.0), 0.0).mean()
    every, size, _ = sphere()
    t, v = (np.repeat(x[:, :1], every.shape[1], 1) for x in (t, point.v))
    expected = (fibre_highlight(t, v, every, exponent, fan, behind, lean) * size).sum()
    assert mean == pytest.approx(expected, rel=0.01)


def test_numbers_choose_lobes_by_what_they_give_and_are_whole_again() -> None:
    """Of three lobes: the first number is even over [0, 1) in each, and as many are of each as its
    share of T says.
    """
    count = 4000
    point = Point(0.3, count)
    terms = [
        term("DIFFUSE", 0.0, 0.0, 0.0, count),
        term("SPECULAR", 30.0, 0.0, 0.0, count),
        term("TRANSMISSION", 30.0, 0.2, 0.0, count),
    ]
    shares = np.array([0.2, 0.5, 0.3])
    terms = [replace(x, k=np.full((3, count), k)) for x, k in zip(terms, shares, strict=True)]
    none = np.zeros((3, count))
    coefficients = Coefficients(none, none, none, none, none, none, [], [], [], [], terms)
    number, every = (np.arange(count) + 0.5) / count, np.arange(count)
    disc = np.repeat(np.array([[0.3], [0.4]]), count, 1)
    told = sampled(point, coefficients, np.ones((3, count)), every, disc, number)
    direction, pdf, left = told
    kinds, first = np.unique(direction.round(9), axis=1, return_index=True)
    assert kinds.shape[1] == 3 and (pdf > 0).all()
    ends = np.append(np.sort(first), count)
    np.testing.assert_allclose(np.diff(ends) / count, shares, atol=2 / count)
    for a, b in itertools.pairwise(ends):
        np.testing.assert_allclose(left[a:b], (np.arange(b - a) + 0.5) / (b - a), atol=2e-3)


def bundle(*lobes: s.Lobe) -> s.Scene:
    """Some strands beside and before each other under an even sky."""
    chance = np.random.default_rng(4)
    ends = chance.uniform(-1, 1, (STRANDS, 2, 3)) * (1.4, 1.4, 0.6)
    ends[:, 1, 0] += 4.0
    ends[:, 0, 0] -= 4.0
    ends = ends.reshape(-1, 3).astype(np.float32)
    ways = np.repeat(ends[1::2] - ends[::2], 2, 0)
    tangent = np.zeros((2 * STRANDS, 4), np.float32)
    tangent[:, :3] = ways / np.linalg.norm(ways, axis=1)[:, None]
    hair = strand()
    hair = replace(
        hair,
        vertices=ends,
        radii=np.full(2 * STRANDS, 0.1, np.float32),
        starts=np.arange(0, 2 * STRANDS, 2, dtype=np.uint32),
        attributes=(replace(hair.attributes[0], values=tangent),),
    )
    sky = s.Light("sky", "DOME", np.eye(4)[:3], radiance=np.ones((4, 8, 3), np.float32))
    world = s.World(background=(1.0, 1.0, 1.0))
    made = (material_of(*lobes),)
    return s.Scene(view_from_above(), (hair,), (placed(),), made, (), (sky,), world)


WHITE = s.Lobe("FIBRE_DIFFUSE", constant(1.0), fibre_output=0)


@needs_core
def test_white_strands_vanish_in_an_even_sky() -> None:
    """Matt ones give back all that reaches them, from the sky or from each other: the more light
    bounces, the less of them is seen. Both tracers draw them below.
    """
    scene, found = bundle(WHITE), []
    for bounces in (0, 1, 8):
        plan = Settings(samples=64, diffuse_bounces=bounces, filter_width=0.0, soft_light="DEALT")
        found.append(float(render(scene, plan).combined[..., 0].mean()))
    assert found[0] < found[1] - 0.03 < found[2] - 0.03
    assert found[2] == pytest.approx(1.0, abs=0.012)


def matt_things(hair: s.Strands) -> dict:
    """A floor, a ball on it and strands, for a material each of the first two and of the last."""
    floor = np.array([[-9, -9, -1], [9, -9, -1], [9, 9, -1], [-9, 9, -1]], np.float32)
    mesh = s.Mesh("floor", floor, np.uint32([[0, 1, 2], [0, 2, 3]]))
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    every = [replace(placed(), geometry=k, materials=(k == 2,)) for k in range(3)]
    return {"geometries": (mesh, ball, hair), "instances": tuple(every)}


@pytest.mark.parametrize("backend", BACKENDS)
def test_strands_send_light_on_as_often_as_bounces_says(backend: str) -> None:
    """Where any bounces, by what is not matt; matt lobes, of strands too, throw it on as often as
    Diffuse Bounces says.
    """
    shining = [lobe("SPECULAR", 0.5, 9.0), lobe("TRANSMISSION", 0.5, 9.0, fan=0.3)]
    hair, matt, both = bundle(*shining), bundle(WHITE), bundle(lobe("DIFFUSE", 0.4), *shining)
    paint = s.Material("matt", (s.Lobe("DIFFUSE", constant(1.0)),))
    dark = material_of(lobe("SPECULAR", 0.0, 9.0))
    beside = replace(hair, materials=(paint, dark), **matt_things(hair.geometries[0]))

    def picture(scene: s.Scene, diffuse: int, bounces: int) -> np.ndarray:
        plan = {"samples": 2, "filter_width": 0.0, "backend": backend, "soft_light": "DEALT"}
        plan |= {"diffuse_bounces": diffuse, "max_bounces": bounces}
        return render(scene, Settings(**plan)).combined

    assert (picture(hair, 1, 6) == picture(hair, 6, 6)).all()
    assert picture(hair, 1, 6).mean() > picture(hair, 1, 1).mean() + 0.01
    assert (picture(hair, 0, 6) == picture(hair, 0, 0)).all()
    assert (picture(hair, 1, 64) == picture(hair, 1, BOUNCE_LEVELS)).all()
    for scene in (matt, beside):
        assert (picture(scene, 1, 6) == picture(scene, 1, 1)).all()
        assert picture(scene, 6, 6).mean() > picture(scene, 1, 1).mean() + 0.001
    least, some, most = (picture(both, *plan).mean() for plan in ((1, 1), (1, 6), (6, 6)))
    assert least + 0.001 < some < most - 0.001


@needs_core
def test_both_tracers_send_light_on_alike() -> None:
    """Beyond Diffuse Bounces, where strands have matt lobes and others."""
    kinds = (lobe("DIFFUSE", 0.4), lobe("SPECULAR", 0.3, 9.0), lobe("TRANSMISSION", 0.4, 9.0))
    plan = Settings(samples=8, filter_width=0.0, soft_light="DEALT")
    plan = replace(plan, diffuse_bounces=1, max_bounces=6)
    films = [render(bundle(*kinds), replace(plan, backend=each)) for each in ("NATIVE", "NUMPY")]
    np.testing.assert_allclose(films[0].combined, films[1].combined, rtol=2e-4, atol=2e-5)
    white = replace(plan, samples=2, diffuse_bounces=8)
    films = [render(bundle(WHITE), replace(white, backend=each)) for each in ("NATIVE", "NUMPY")]
    np.testing.assert_allclose(films[0].combined, films[1].combined, rtol=2e-4, atol=2e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_bounced_to_strands_has_their_colour(backend: str) -> None:
    """Of lobes of all kinds, so that it is resolved like other light that bounced."""
    colors = np.array([0.7, 0.35, 0.175])
    kinds = ("DIFFUSE", "SPECULAR", "TRANSMISSION")
    passes = frozenset({"Diffuse Color", "Glossy Color"})
    plan = Settings(samples=1, filter_width=0.0, backend=backend, passes=passes)
    found = {kind: render(bundle(lobe(kind, exponent=3.0)), plan).passes for kind in kinds}
    for kind in kinds:
        told = found[kind]["Diffuse Color"]
        on = told[..., 0] > 0
        assert on.sum() > 40
        np.testing.assert_allclose(told[on], np.broadcast_to(colors, told[on].shape), rtol=1e-5)
        glossy = found[kind]["Glossy Color"]
        np.testing.assert_allclose(glossy, told * (kind != "DIFFUSE"), rtol=1e-5)
