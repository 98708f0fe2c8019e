"""What gloss throws on, and what it shows of the light that surfaces throw: the core in closed
form, and the reference beside the core, pixel by pixel.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import (
    ALBEDO,
    BACKENDS,
    VARNISH,
    added,
    ball,
    drawn,
    lamp,
    matt,
    room,
    wall_over_ground,
)
from glint.engine import Settings, render
from glint.engine.reference.closures import Term
from glint.engine.reference.closures.microfacet import blinn_phong, gloss
from glint.engine.reference.gloss import even_gloss
from glint.engine.scene import Input, Lobe, Material, Medium, Scene
from media_scenes import filled


def given_back(lobe: Lobe, cosine: float, l: np.ndarray) -> np.ndarray:  # noqa: E741
    """(m,) of light along l (3, m) towards a direction so far from the normal, which is z."""
    n = np.repeat([[0.0], [0.0], [1.0]], l.shape[1], 1)
    towards = np.repeat([[np.sqrt(1 - cosine * cosine)], [0.0], [cosine]], l.shape[1], 1)
    shape = gloss(n, towards, l, lobe.masking, lobe.ior, lobe.fresnel, lobe.schlick)
    return blinn_phong(n, towards, l, lobe.exponent) * shape * lobe.factors[0].value[0]


def reflected_of_even_light(lobe: Lobe, cosine: float) -> float:
    """Of radiance 1 from all sides of a surface, towards a direction so far from its normal."""
    u, v = np.meshgrid((np.arange(800) + 0.5) / 800, (np.arange(800) + 0.5) / 800)
    z, turn = u.ravel(), 2 * np.pi * v.ravel()
    side = np.sqrt(1 - z * z)
    l = np.stack([side * np.cos(turn), side * np.sin(turn), z])  # noqa: E741, the notes' letter
    return 2 * given_back(lobe, cosine, l).mean()


def as_bounced(lobe: Lobe) -> Lobe:
    """As wide as what bounced shows it, and as bright in all."""
    least = min(lobe.exponent, 8.0)
    size = lobe.factors[0].value[0] * (least + 1) / (lobe.exponent + 1)
    return replace(lobe, factors=(Input((size,) * 3),), exponent=least)


def thrown(lobe: Lobe, cosines: np.ndarray) -> float:
    """The mean of what it gives back, towards directions so far from the normal, of light 1 along
    that.
    """
    up, wide = np.array([[0.0], [0.0], [1.0]]), as_bounced(lobe)
    return float(np.mean([given_back(wide, c, up)[0] for c in cosines]))


METAL = replace(VARNISH[0], factors=(Input((2.0,) * 3),), exponent=14.0, fresnel=False)
PAINT = replace(METAL, fresnel=True)


BY_NOTES = replace(METAL, masking=0.0)
MATT = Lobe("DIFFUSE", (Input((0.5,) * 3),))


def ground_of(*lobes: Lobe) -> Scene:
    """In the sun, before a wall."""
    scene = wall_over_ground(lamp("SUN", strength=2.0))
    return replace(scene, materials=(Material("ground", lobes), scene.materials[1]))


@pytest.mark.parametrize("lobe", [METAL, PAINT, BY_NOTES])
def test_gloss_throws_light_on(lobe: Lobe) -> None:
    """From a ground in the sun onto a wall, beside what is matt, widened: that of metals, of
    dielectrics and of the notes' formula; what the world lights evenly has no part in it.
    """

    def added_to_wall(*lobes: Lobe) -> np.ndarray:
        return added(ground_of(*lobes), samples=64).mean((0, 1))

    plain = added_to_wall(MATT)
    np.testing.assert_allclose(plain, 2.0 / np.pi * 0.5 / 2, rtol=2 / 64)
    ambient = Lobe("AMBIENT", (Input((0.6,) * 3),))
    np.testing.assert_allclose(added_to_wall(MATT, ambient), plain, rtol=1e-6)
    k = np.arange(4000) + 0.5
    down = np.sqrt(k / 4000) * np.sin(k * np.pi * (3 - np.sqrt(5)))  # of directions from the wall
    share = thrown(lobe, down[down > 0]) / 0.5
    assert share > 0.05
    more = added_to_wall(MATT, lobe) / plain - 1
    np.testing.assert_allclose(more, share, rtol=2 / 64)


SAMPLES = 256

SIDES = np.sqrt((np.arange(400) + 0.5) / 400)
"""The cosines of directions that are as dense as these."""


@functools.cache
def added_to_matt_room() -> np.ndarray:
    return added(room(lamp()), samples=SAMPLES)


def room_of(*gloss: Lobe) -> Scene:
    return replace(room(lamp()), materials=(matt(ALBEDO, *gloss),))


def varnish(exponent: float) -> Lobe:
    size, alpha = (exponent + 2) / 8, float(np.sqrt(2 / (exponent + 2)))
    return replace(VARNISH[0], factors=(Input((size,) * 3),), exponent=exponent, masking=alpha)


@pytest.mark.parametrize("exponent", [14.0, 32.0, 400.0])
def test_gloss_on_paint_shows_what_surfaces_throw(exponent: float) -> None:
    """A ball that is lit alike all over is as bright in its gloss as that gives back of what the
    other sides throw, matt and by gloss.
    """
    lobe = varnish(exponent)
    ratio = added(room_of(lobe), samples=SAMPLES) / added_to_matt_room()
    even = reflected_of_even_light(lobe, 1.0)
    truth = (1 + even / ALBEDO) * (1 + thrown(lobe, SIDES) / ALBEDO)
    assert np.abs(ratio[3:5, 3:5].mean((0, 1)) / truth - 1).max() < 0.04  # as `even_gloss` has it
    assert np.abs(ratio.mean((0, 1)) / truth - 1).max() < 0.04


PAINTS = {
    0.2: ((0.0169, 7.2), (0.499, 53.0), (12.96, 305.7), (130.15, 1742.9)),
    0.5: ((0.0441, 0.7), (0.599, 9.9), (3.179, 50.4)),
}
"""The sizes and exponents of the lobes of a Principled BSDF's gloss of a roughness."""


@pytest.mark.parametrize("roughness", PAINTS)
def test_what_gloss_gives_back_of_even_light(roughness: float) -> None:
    """Beside sums over directions."""
    lobes = [
        replace(
            VARNISH[0], factors=(Input((size,) * 3),), exponent=p, masking=roughness * roughness
        )
        for size, p in PAINTS[roughness]
    ]
    terms = [
        Term(np.arange(1), np.full((3, 1), lobe.factors[0].value[0]), lobe,
             {"exponent": lobe.exponent, "masking": lobe.masking, "ior": lobe.ior})
        for lobe in lobes
    ]  # fmt: skip
    for cosine in (1.0, 0.8, 0.5, 0.3):
        found = even_gloss(np.array([cosine]), terms)[0, 0]
        truth = sum(reflected_of_even_light(lobe, cosine) for lobe in lobes)
        assert abs(found / truth - 1) < 0.08, cosine


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_gloss_shows_of_surfaces_is_diffuse_indirect(backend: str) -> None:
    lobe = replace(VARNISH[0], factors=(Input((2.0,) * 3),), exponent=14.0)
    scene = replace(room(lamp()), materials=(matt(ALBEDO, lobe),))
    names = {"Direct", "Indirect", "Color"}
    settings = Settings(
        samples=16,
        light_samples=2,
        filter_width=0.0,
        diffuse_bounces=1,
        backend=backend,
        passes={
            "Combined",
            *(f"{kind} {name}" for kind in ("Diffuse", "Glossy") for name in names),
        },
    )
    found = render(scene, settings).passes
    none = render(scene, replace(settings, diffuse_bounces=0)).passes
    assert np.allclose(found["Glossy Direct"], none["Glossy Direct"], rtol=1e-6)
    assert not none["Glossy Indirect"].any()
    shown = found["Combined"] - none["Combined"]
    parts = sum(
        found[f"{kind} Indirect"] * found[f"{kind} Color"] for kind in ("Diffuse", "Glossy")
    )
    assert not found["Glossy Indirect"].any()
    assert found["Diffuse Indirect"].min() > 0
    np.testing.assert_allclose(parts, shown[..., :3], rtol=1e-4)


def test_gloss_that_rays_show_surfaces_in_has_no_bounced_light_beside() -> None:
    """Of metals, and of all rough surfaces where these reflect as well."""
    varnished, metal = room_of(PAINT), room_of(METAL)

    def ratio(scene: Scene, **settings) -> np.ndarray:
        """Of what bounces add to what they add where all is matt."""
        found = added(scene, **{"max_bounces": 0, "samples": SAMPLES, **settings})
        return (found / added_to_matt_room()).mean((0, 1))

    even = reflected_of_even_light(PAINT, 1.0)
    by_paint, by_metal = (1 + thrown(lobe, SIDES) / ALBEDO for lobe in (PAINT, METAL))
    np.testing.assert_allclose(ratio(varnished), (1 + even / ALBEDO) * by_paint, rtol=0.04)
    off = ratio(varnished, reflections="OFF")
    np.testing.assert_allclose(off, (1 + even / ALBEDO) * by_paint, rtol=0.04)
    np.testing.assert_allclose(ratio(metal), by_metal, rtol=0.02)
    # rays end where light is thrown: they find it one bounce on, and not twice
    every = ratio(varnished, reflections="ALL", max_bounces=1)
    np.testing.assert_allclose(every, (1 + even) * by_paint, rtol=0.04)


WIDE = replace(VARNISH[0], exponent=8.0, masking=float(np.sqrt(0.2)), fresnel=False)


@pytest.mark.parametrize("fresnel", [False, True])
def test_gloss_throws_on_what_bounced(fresnel: bool) -> None:
    """The second bounce in a ball lit alike all over, of which no rays show the gloss between."""
    lobe = replace(WIDE, fresnel=fresnel)
    settings = {"max_bounces": 0, "samples": SAMPLES}
    one, two = (added(room_of(lobe), bounces=bounces, **settings) for bounces in (1, 2))
    between = np.mean([reflected_of_even_light(lobe, c) for c in SIDES[::40]])
    found = ((two - one) / one).mean((0, 1)) - ALBEDO
    np.testing.assert_allclose(found, between, rtol=0.2)  # as `even_gloss` has it of wide lobes


def full_of_gas(*gloss: Lobe) -> Scene:
    """That glows, in a room of metal or a matt one."""
    gas = filled("gas", Medium(emission=(50.0, 50.0, 50.0)))
    return room(more=(ball(0.2),), materials=(gas,), walls=matt(ALBEDO, *gloss))


@pytest.mark.parametrize("reflections", ["METALS", "ALL"])
def test_gloss_throws_on_what_gas_gives(reflections: str) -> None:
    """A ball of metal round gas that glows, which lights it alike all over: rays show metal where
    the camera sees it, and nowhere else.
    """
    settings = {"max_bounces": 1, "reflections": reflections, "samples": 64}
    ratio = added(full_of_gas(WIDE), **settings) / added(full_of_gas(), **settings)
    by_rays = 1 + reflected_of_even_light(WIDE, 1.0)
    thrown_on = (ratio.mean((0, 1)) / by_rays - 1) * ALBEDO
    between = np.mean([reflected_of_even_light(WIDE, c) for c in SIDES[::40]])
    np.testing.assert_allclose(thrown_on, between, rtol=0.2)  # as `even_gloss` has it of wide lobes


NO_RAYS = {"max_bounces": 0}
ALIKE = {
    "ground of metal": (ground_of(MATT, METAL), {}),
    "ground of paint": (ground_of(MATT, PAINT), {}),
    "ground by the notes": (ground_of(MATT, BY_NOTES), {}),
    "wide gloss": (room_of(varnish(14.0)), {}),
    "narrower gloss": (room_of(varnish(32.0)), {}),
    "narrow gloss": (room_of(varnish(400.0)), {}),
    "paint without rays": (room_of(PAINT), NO_RAYS),
    "metal without rays": (room_of(METAL), NO_RAYS),
    "no rays wanted": (room_of(PAINT), {**NO_RAYS, "reflections": "OFF"}),
    "rays": (room_of(PAINT), {"max_bounces": 1, "reflections": "ALL"}),
    "two bounces by metal": (room_of(WIDE), {**NO_RAYS, "bounces": 2}),
    "two bounces by paint": (room_of(replace(WIDE, fresnel=True)), {**NO_RAYS, "bounces": 2}),
    "gas": (full_of_gas(WIDE), {"max_bounces": 1, "reflections": "ALL", "light_samples": 1}),
}
"""Those of the tests above, with what they set."""


@pytest.mark.parametrize("name", ALIKE)
def test_both_tracers_throw_gloss_on_alike(name: str) -> None:
    """All pixels, along the same paths."""
    scene, chosen = ALIKE[name]
    settings = {"bounces": 1, "samples": 1 if name == "gas" else 2, "soft_light": "DEALT", **chosen}
    native, exact = (drawn(scene, backend=backend, **settings) for backend in BACKENDS)
    assert exact.max() > drawn(scene, **{**settings, "bounces": 0}).max()
    np.testing.assert_allclose(native, exact, rtol=1e-5)
