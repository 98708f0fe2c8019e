"""Highlights narrower than the light: directions drawn from the lobe beside points of the light,
against closed forms and plain sums.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import scene as s
from glint.engine.sampling import light_points
from native_tools import (
    NO_WORLD,
    color,
    constant,
    draw,
    lamp,
    material,
    needs_core,
    pixel_centers,
    placed,
    square,
    view_from_above,
)

pytestmark = needs_core

TILT = np.array([[np.cos(0.3), 0, np.sin(0.3)], [0, 1, 0], [-np.sin(0.3), 0, np.cos(0.3)]])
LIGHTS = {
    "sphere": lamp("POINT", (0.6, 0.2, 1.5), strength=80.0, radius=0.5),
    "disc": lamp("POINT", (0.6, 0.2, 1.5), strength=80.0, radius=0.5, soft_falloff=True),
    "spot": lamp("SPOT", (0.6, 0.2, 1.5), strength=80.0, radius=0.5, spot_size=1.2, spot_blend=0.5),
    "sun": lamp("SUN", axes=TILT, strength=3.0, angle=0.6),
    "rectangle": lamp("AREA", (0.6, 0.2, 1.5), TILT, strength=30.0, size_x=1.2, size_y=0.5),
    "far rectangle": lamp("AREA", (0.6, 0.2, 3.5), TILT, strength=30.0, size_x=1.2, size_y=0.5),
    "ellipse": lamp(
        "AREA", (0.6, 0.2, 1.5), TILT, strength=30.0, shape="ELLIPSE", size_x=1.2, size_y=0.5
    ),
    "strip": lamp("AREA", (0.6, 0.2, 1.5), TILT, strength=30.0, size_x=1.2, size_y=0.0),
    "touching": lamp("AREA", (0.6, 0.2, 1e-9), strength=30.0, size_x=1.2, size_y=0.5),
    "around": lamp("POINT", (0.6, 0.2, 0.3), strength=80.0, radius=0.5),
    "behind": lamp(
        "AREA", (0.6, 0.2, 1.5), np.diag([1.0, -1, -1]), strength=30.0, size_x=1.2, size_y=0.5
    ),
    "tiny": lamp("POINT", (0.6, 0.2, 1.5), strength=80.0, radius=1e-12),
    "huge": lamp("POINT", (0.6, 0.2, 1e9), strength=1e20, radius=0.99e9),
}


def shine(*exponents: float, diffuse: float = 0.0) -> s.Material:
    tints = ((0.9, 0.5, 0.2), (0.1, 0.3, 0.4))
    matt = s.Lobe("DIFFUSE", constant(diffuse))
    return material(
        matt, *(s.Lobe("SPECULAR", constant(*k), p) for k, p in zip(tints, exponents, strict=False))
    )


def floor(light: s.Light, *exponents: float, size: int = 16, diffuse: float = 0.0) -> s.Scene:
    return s.Scene(
        view_from_above(size),
        (square(),),
        (placed(),),
        (shine(*exponents, diffuse=diffuse),),
        (),
        (light,),
    )


@pytest.mark.parametrize("exponent", [10, 100, 1e4, 1e6])
@pytest.mark.parametrize("angle", [0.2, 1.0, 2.5])
def test_the_whole_lobe_in_a_sun(exponent: float, angle: float) -> None:
    """Seen along the normal, n·h is the cosine of half the angle to l: 8π / (p + 2) (1 −
    cos^(p+2)(α/2)) steradians of the sun's light.
    """
    picture = color(
        floor(lamp("SUN", strength=5.0, angle=angle), exponent), samples=4, light_samples=16
    )
    radiance = 5 / (np.pi * np.sin(angle / 2) ** 2) / np.pi
    truth = radiance * 8 * np.pi / (exponent + 2) * (1 - np.cos(angle / 4) ** (exponent + 2))
    assert picture == pytest.approx(
        np.broadcast_to(truth * np.array([0.9, 0.5, 0.2]), picture.shape), rel=0.04
    )


def lobe_sum(light: s.Light, exponent: float, count: int) -> np.ndarray:
    """(h, w) highlights under the old rule, with points of the light alone: the mean over its
    shape, straight from semantics/lights.md.
    """
    x, o = pixel_centers().reshape(-1, 3), np.array([0.0, 0, 1])
    square_points, disc = light_points(count)
    axes, center = light.world_from_light[:, :3], light.world_from_light[:, 3]
    a, b = (square_points if light.shape == "RECTANGLE" else disc).T[:, :, None, None]
    to = center + a * light.size_x / 2 * axes[:, 0] + b * light.size_y / 2 * axes[:, 1] - x
    d = np.linalg.norm(to, axis=-1, keepdims=True)
    half = to / d + o
    lobe = (half[..., 2] / np.linalg.norm(half, axis=-1)) ** exponent
    cosine = np.maximum(0, to @ axes[:, 2] / d[..., 0])
    return (light.strength * cosine / (np.pi**2 * d[..., 0] ** 2) * lobe).mean(0).reshape(16, 16)


@pytest.mark.parametrize(
    ("name", "exponent"),
    [("rectangle", 300), ("far rectangle", 2000), ("ellipse", 300), ("ellipse", 30)],
)
def test_the_sum_is_that_of_points_of_the_light_alone(name: str, exponent: float) -> None:
    """Also where only a part of the lobe meets the light."""
    light = LIGHTS[name]
    truth = lobe_sum(light, exponent, 4096)
    found = color(floor(light, exponent), samples=64, light_samples=8)[..., 1] / 0.5
    # The core's rays spread over a pixel: its sum over the filter is held against the mean over the
    # middles.
    assert found.sum() == pytest.approx(truth.sum(), rel=0.01)
    assert np.abs(found - truth).max() < 0.05 * truth.max()


@pytest.mark.parametrize("exponents", [(30.0,), (1e3, 60.0), (1e6, 1e4)])
@pytest.mark.parametrize("name", LIGHTS)
def test_core_and_reference_draw_the_same_directions(
    name: str, exponents: tuple[float, ...]
) -> None:
    scene = floor(LIGHTS[name], *exponents, size=12, diffuse=0.1)
    core, reference = (
        draw(scene, "Specular", "Cost", samples=2, light_samples=3, backend=b)
        for b in ("NATIVE", "NUMPY")
    )
    for film in (core, reference):
        assert np.isfinite(film.combined).all()
    for passed in ("Specular", "Cost"):
        one, other = (np.asarray(film.passes[passed], float) for film in (core, reference))
        assert np.abs(one - other).max() <= 1e-5 * max(np.abs(other).max(), 1e-30)


@pytest.mark.parametrize("illumination", ["PHYSICAL", "CLASSIC"])
@pytest.mark.parametrize("name", ["sun", "disc", "ellipse"])
def test_what_stands_between_hides_drawn_directions(name: str, illumination: str) -> None:
    """A card half over a floor that is seen through it, for shadow rays alone."""
    card = placed(z=0.5, linear=0.1, visible_camera=False)
    scene, plan = (
        floor(LIGHTS[name], 1e5, size=24),
        {"samples": 2, "light_samples": 2, "illumination": illumination},
    )
    scene = replace(scene, instances=(*scene.instances, card))
    core, reference = (color(scene, **plan, backend=b) for b in ("NATIVE", "NUMPY"))
    assert np.abs(core - reference).max() <= 1e-5 * reference.max()
    free = color(replace(scene, instances=scene.instances[:1]), **plan)
    assert 0.02 * free.sum() < (free - core).sum() < 0.98 * free.sum()


@pytest.mark.parametrize("name", ["sphere", "rectangle"])
def test_the_highlight_of_a_ball_is_smooth(name: str) -> None:
    """As two lobes stand for a roughness of 0.06; by points of the light alone it is dots."""
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    lobes = (
        s.Lobe("DIFFUSE", constant(0.5)),
        s.Lobe("SPECULAR", constant(600.0), 1.2e5),
        s.Lobe("SPECULAR", constant(300.0), 8e3),
    )
    light = replace(
        LIGHTS[name],
        world_from_light=LIGHTS[name].world_from_light
        + np.array([[0, 0, 0, 1], [0, 0, 0, 0], [0, 0, 0, 1.0]]),
    )
    scene = s.Scene(
        view_from_above(32, 0.6), (ball,), (placed(),), (material(*lobes),), (), (light,), NO_WORLD
    )
    found, truth = (color(scene, samples=n, light_samples=m) for n, m in ((64, 2), (128, 16)))
    assert np.sqrt(((found - truth) ** 2).mean() / (truth**2).mean()) < 0.03
