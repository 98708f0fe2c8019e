"""Shading Offset of even light and of what bounces: closed forms, in both tracers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import added, wall_over_ground
from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.table import BY_NAME
from glint.engine.reference.closures import Term
from glint.engine.reference.closures.microfacet import directional_albedo
from glint.engine.reference.terminator import mean_lowered_gloss
from glint.engine.scene import Input, Light, Lobe, Material, Scene
from test_lens import BACKENDS, card, scene, seen
from test_program_render import new_graph, shown

OFFSET = 0.6
F = 1 / (1 - OFFSET / 2)
COLOR, LIGHT = Input((0.5, 0.25, 0.75)), (1.0, 2.0, 0.5)
GLOW = Lobe("EMISSION", (Input((0.3, 0.1, 0.2)),))
VARNISH = Lobe("SPECULAR", (COLOR,), exponent=30.0, masking=0.3, fresnel=True)


def low(made: Scene) -> Scene:
    blocks = tuple(replace(block, shading_offset=OFFSET) for block in made.instances)
    return replace(made, instances=blocks)


def varying() -> Material:
    graph = new_graph()
    return shown(graph, graph.apply(BY_NAME["position"], shift=0)[0], "AMBIENT")


MATERIALS = {
    "even": Material("even", (Lobe("AMBIENT", (COLOR,)), GLOW)),
    "grazing": Material("grazing", (Lobe("AMBIENT", (COLOR,), exponent=2.0), GLOW)),
    "varying": varying(),
}
ROUGH = [0.05, 0.1, 0.25, 0.5, 1.0]
METAL = Lobe("SPECULAR", (COLOR,), exponent=30.0, masking=0.25)


def lit(material: Material) -> Scene:
    """A card in an even light."""
    camera = seen("PERSPECTIVE", None, 8)
    made = scene(camera, card("card", -3.0, -5, 5, -5, 5), materials=(material,))
    return replace(made, world=replace(made.world, ambient=LIGHT))


def even_share() -> float:
    """Of an even sky's light, by a sum over the angles off the normal."""
    angle = (np.arange(20_000) + 0.5) / 20_000 * np.pi / 2
    kept = np.maximum(np.cos(F * angle), 0.0) * np.sin(angle)
    return kept.sum() / (np.cos(angle) * np.sin(angle)).sum()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", MATERIALS)
def test_ambient_light_is_the_mean_over_an_even_sky(name, backend):
    passes = frozenset({"Ambient", "Emission", "Diffuse Direct"})
    settings = Settings(samples=1, backend=backend, passes=passes)
    full, less = (
        render(made, settings).passes for made in (lit(MATERIALS[name]), low(lit(MATERIALS[name])))
    )
    assert full["Ambient"].any() and np.array_equal(full["Emission"], less["Emission"])
    for part in ("Ambient", "Diffuse Direct"):
        np.testing.assert_allclose(less[part], even_share() * full[part], rtol=2e-6)
    glow = full["Combined"][..., :3] - full["Ambient"]
    rest = less["Combined"][..., :3] - less["Ambient"]
    np.testing.assert_allclose(rest, glow, atol=2e-7)


def even_share_of_gloss(masking: float, seen: float) -> float:
    """The same of what GGX shows, by a sum over half vectors that are seen (Dupuy and Benyoub 2023,
    Sampling visible GGX normals with spherical caps).
    """
    u, turn = np.meshgrid(*(2 * [(np.arange(400) + 0.5) / 400]))
    v = np.array([np.sqrt(1 - seen**2), 0.0, seen])
    x, _, z = (masking, 1, 1) * v / np.hypot(masking * v[0], v[2])
    height = (1 - u) * (1 + z) - z
    across = np.sqrt(np.maximum(1 - height**2, 0.0))
    angle = 2 * np.pi * turn
    h = masking * (across * np.cos(angle) + x), masking * across * np.sin(angle), height + z
    size = np.linalg.norm(h, axis=0)
    cosine = 2 * (h[0] * v[0] + h[2] * v[2]) / size * h[2] / size - v[2]
    cosine = np.where(cosine > 0, cosine, 1e-9)
    slope, slope_v = (np.sqrt(masking**2 / c**2 + 1 - masking**2) for c in (cosine, seen))
    weight = np.where(cosine > 1e-9, 1 / (slope + slope_v), 0.0)
    kept = np.maximum(np.cos(np.minimum(F * np.arccos(cosine), np.pi / 2)), 0.0) / cosine
    return (weight * kept).sum() / weight.sum()


@pytest.mark.parametrize("masking", ROUGH)
def test_gloss_sees_even_light_where_it_mirrors(masking):
    seen = np.array([0.2, 0.4, 0.6, 0.8, 0.97])
    true = [even_share_of_gloss(masking, c) for c in seen]
    found = mean_lowered_gloss(np.full(5, F), seen, masking)
    np.testing.assert_allclose(found, true, atol=0.09)
    assert masking > 0.3 or np.ptp(true) > 0.3


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("varies", [False, True])
def test_ambient_light_of_gloss_is_less_by_what_it_sees(backend, varies):
    """What is more than the gloss gives back is matt; both as constants and by programs."""
    given = Lobe("AMBIENT", (Input((9.0, 9.0, 9.0)),))
    lobes = (given, METAL, *((GLOW,) if not varies else (varying().lobes[0],)))
    material = Material("metal", lobes, program=varying().program if varies else None)
    passes = frozenset({"Ambient"})
    settings = Settings(samples=1, backend=backend, passes=passes)
    plain = replace(material, lobes=tuple(lobe for lobe in lobes if lobe is not METAL))
    full, less, matt = (
        render(made, settings).passes["Ambient"]
        for made in (lit(material), low(lit(material)), low(lit(plain)))
    )
    numbers = {"exponent": METAL.exponent, "masking": METAL.masking, "ior": 1.0}
    term = Term(np.zeros(1, int), np.ones((3, 1)), METAL, numbers)
    here = np.array([1.0])
    gloss = directional_albedo(term, here) * np.array(COLOR.value) * LIGHT
    low_gloss = mean_lowered_gloss(np.array([F]), here, METAL.masking)
    middle = full.shape[0] // 2
    rest = gloss * (low_gloss - even_share())
    np.testing.assert_allclose(less[middle, middle] - matt[middle, middle], rest, rtol=0.02)


@pytest.mark.parametrize("name", MATERIALS)
def test_so_it_is_explained(name):
    made = low(lit(MATERIALS[name]))
    picture = render(made, Settings(samples=1)).combined
    for x, y in ((1, 2), (6, 5)):
        found = PixelExplainer(made, Settings(samples=1)).pixel(x, y)
        np.testing.assert_allclose(found.color, picture[y, x, :3], rtol=2**-22, atol=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("gloss", [(), (VARNISH, Lobe("AMBIENT", (COLOR,)))], ids=["", "varnish"])
def test_surfaces_throw_on_what_they_see_of_their_light(gloss, backend):
    """A ground under a sun that leans along a wall, and sees it lower."""
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    sun = Light("sun", "SUN", np.array([[1, 0, 0, 0], [0, c, s, 0], [0, -s, c, 0.0]]), strength=3.0)
    made = wall_over_ground(sun)
    matt = Material("matt", (Lobe("DIFFUSE", (COLOR,)), *gloss))
    made = replace(made, materials=(matt, made.materials[1]))
    ground, wall = made.instances
    lower = replace(made, instances=(replace(ground, shading_offset=OFFSET), wall))
    full, less = (added(each, backend, samples=16) for each in (made, lower))
    assert full.min() > 0.01
    np.testing.assert_allclose(less, np.cos(F * angle) / c * full, rtol=1e-5)
