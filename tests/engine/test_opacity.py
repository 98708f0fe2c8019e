"""Holes that images make in surfaces: the core passes them without a stop, and the picture is what
it is with one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import scene as s
from native_tools import (
    color,
    constant,
    draw,
    lamp,
    material,
    needs_core,
    placed,
    square,
    view_from_above,
)

pytestmark = needs_core

SIZE = 12
SLANTED = ((1.7, 0.4, 0.13), (-0.3, 2.1, -0.41))


def cards(
    pixels: np.ndarray,
    channel: str = "ALPHA",
    lights: tuple[s.Light, ...] = (),
    count: int = 6,
    **texture,
) -> s.Scene:
    """Sheets, mixed from glow and dullness where the image is 1 and a hole where it is 0, over
    a floor.
    """
    fac = s.Input(texture=0, channel=channel, uv_transform=SLANTED)
    hole = s.Input(texture=0, channel=channel, uv_transform=SLANTED, complement=True)
    card = material(
        s.Lobe("DIFFUSE", (fac, *constant(0.6))),
        s.Lobe("EMISSION", (fac, *constant(0.1))),
        s.Lobe("TRANSPARENT", (hole,)),
    )
    floor = s.Material("floor", (s.Lobe("DIFFUSE", constant(0.8)),))
    turned = np.array([[0.9, 0.3, 0.1], [-0.3, 0.9, 0.0], [0.0, 0.2, 1.0]])
    sheets = [
        placed(0, (0,), z=0.3 + 0.2137 * 5 * k / (count - 1), linear=turned if k % 2 else 0.8)
        for k in range(count)
    ]
    image = s.Texture("holes", pixels, **texture)
    return s.Scene(
        view_from_above(SIZE),
        (square(1.5),),
        (placed(0, (1,)), *sheets),
        (card, floor),
        (image,),
        lights,
    )


def aside(scene: s.Scene) -> s.Scene:
    """Seen a little from the side: edges of the pieces that glow do not lie straight above what
    pixels see.
    """
    frame = scene.camera.world_from_camera.copy()
    frame[:2, 3] += 0.0137, 0.0096
    return replace(scene, camera=replace(scene.camera, world_from_camera=frame))


def dots(kind: type = np.uint8, seed: int = 1) -> np.ndarray:
    """(9, 12, 4): blocks of 0, of 1 and of what lies between."""
    values = (
        np.random.default_rng(seed)
        .choice([0.0, 1.0, 1.0, 0.0, 0.4], (3, 4))
        .repeat(3, 0)
        .repeat(3, 1)
    )
    pixels = np.repeat(values[..., None], 4, 2)
    return (255 * pixels).astype(np.uint8) if kind is np.uint8 else pixels.astype(np.float32)


SUN = lamp("SUN", strength=2.0)
SOFT = lamp("POINT", (0.4, -0.3, 3.0), radius=0.3, strength=60.0)


@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize(("channel", "kind"), [("ALPHA", np.uint8), ("COLOR", np.float32)])
def test_holes_are_passed_to_the_same_picture(
    interpolation: str, extension: str, channel: str, kind: type
) -> None:
    """Beside the reference, and beside the core that stops at every surface because the Cost pass
    counts them.
    """
    scene = cards(
        dots(kind), channel, (SUN, SOFT), extension=extension, interpolation=interpolation
    )
    scene = aside(scene)
    settings = {"light_samples": 2}
    found = color(scene, **settings)
    assert np.array_equal(found, draw(scene, "Cost", **settings).combined[..., :3])
    truth = color(scene, backend="NUMPY", **settings)
    # a texel's edge may fall on a pixel's ray
    assert np.isclose(found, truth, rtol=1e-5, atol=1e-6).all(-1).mean() > 0.98


def test_many_layers_give_the_picture_of_one_after_the_other() -> None:
    """More than are found at a time, of camera and of shadow rays: a little of each sheet, holes,
    and here and there all of it.
    """
    thin = np.random.default_rng(3).choice(
        [0.0, 0.02, 0.05, 0.1, 1.0], (9, 12), p=[0.3, 0.3, 0.2, 0.19, 0.01]
    )
    pixels = np.repeat(thin[..., None], 4, 2).astype(np.float32)
    scene = cards(pixels, lights=(SUN, SOFT), count=60, interpolation="CLOSEST")
    found = color(scene)
    assert np.array_equal(found, draw(scene, "Cost").combined[..., :3])
    truth = color(scene, backend="NUMPY")
    assert np.isclose(found, truth, rtol=1e-5, atol=1e-6).all(-1).mean() > 0.98


def test_sixty_sheets_of_glass() -> None:
    """What a glowing floor sends up, and what reaches it of the sun: each sheet lets 0.95 of it
    through.
    """
    glass = material(s.Lobe("TRANSPARENT", constant(0.95)))
    sheets = [placed(0, (0,), z=0.3 + 0.01 * k) for k in range(60)]

    def seen(floor: s.Material, *lights: s.Light) -> np.ndarray:
        instances = (placed(0, (1,)), *sheets)
        return color(
            s.Scene(view_from_above(SIZE), (square(3.0),), instances, (glass, floor), (), lights)
        )

    glow = seen(material(s.Lobe("EMISSION", constant(1.0))))
    np.testing.assert_allclose(glow, 0.95**60, rtol=1e-6)
    lit = seen(material(s.Lobe("DIFFUSE", constant(1.0))), SUN)
    np.testing.assert_allclose(lit, 2.0 / np.pi * 0.95**120, rtol=1e-5)


@pytest.mark.parametrize(("value", "offset"), [(0.5, 0.25), (2.0, -0.5), (-1.0, 1.0)])
def test_holes_are_where_bounded_inputs_make_them(value: float, offset: float) -> None:
    """An image times a value plus an offset, clamped: no holes, some where it is 0, and some where
    it is 1.
    """
    scene = cards(dots(), lights=(SUN,))

    def bounded(factor: s.Input) -> s.Input:
        return (
            replace(factor, value=(value,) * 3, offset=(offset,) * 3, low=0.0, high=1.0)
            if factor.texture >= 0
            else factor
        )

    card, floor = scene.materials
    lobes = tuple(replace(lobe, factors=tuple(map(bounded, lobe.factors))) for lobe in card.lobes)
    scene = replace(scene, materials=(replace(card, lobes=lobes), floor))
    scene = aside(scene)
    found = color(scene)
    assert np.array_equal(found, draw(scene, "Cost").combined[..., :3])
    truth = color(scene, backend="NUMPY")
    assert np.isclose(found, truth, rtol=1e-5, atol=1e-6).all(-1).mean() > 0.98


def test_a_ray_passes_holes_at_once() -> None:
    """One ray a pixel through six sheets, and its shadow ray."""
    scene = cards(np.zeros((4, 4, 4), np.uint8), lights=(SUN,))
    assert draw(scene).stats["rays"] == 2 * SIZE**2
    assert draw(scene, "Cost").stats["rays"] == 8 * SIZE**2


def test_holes_of_a_holdout_are_holes() -> None:
    scene = cards(np.zeros((4, 4, 4), np.uint8))
    held = replace(
        scene, instances=tuple(replace(i, holdout=k == 3) for k, i in enumerate(scene.instances))
    )
    assert (draw(held).combined == draw(scene).combined).all()
