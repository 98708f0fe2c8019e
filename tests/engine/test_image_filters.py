"""How images are read between their texels, in closed form and in both tracers, at any size."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from glint import engine
from glint.engine import scene as s
from native_tools import NO_WORLD, needs_core, placed, square, view_from_above

pytestmark = needs_core

WAYS = [*product(s.INTERPOLATIONS, s.EXTENSIONS)]


def showing(texture: s.Texture, scale: float = 1.0, start: float = 0.0) -> s.Scene:
    """A square from -1 to 1 that shows an image with its alpha as what covers the background."""
    turn = ((scale, 0.0, start), (0.0, scale, start))
    color = s.Input(texture=0, uv_transform=turn)
    alpha = s.Input(texture=0, channel="ALPHA", uv_transform=turn)
    lobes = (s.Lobe("EMISSION", (color, alpha)),)
    material = s.Material("shown", lobes)
    return s.Scene(
        view_from_above(), (square(1.0),), (placed(),), (material,), (texture,), world=NO_WORLD
    )


def drawn(scene: s.Scene, backend: str = "NATIVE") -> np.ndarray:
    settings = engine.Settings(samples=1, filter_width=0.0, backend=backend)
    return engine.render(scene, settings).passes["Combined"][..., :3]


def test_a_cubic_ramp_is_straight() -> None:
    """A B-spline reproduces what is linear, away from the edges."""
    pixels = np.ones((8, 8, 4), np.float32)
    pixels[..., :3] = np.arange(8)[None, :, None]
    texture = s.Texture("ramp", pixels, interpolation="CUBIC", extension="EXTEND")
    for backend in ("NATIVE", "NUMPY"):
        row = drawn(showing(texture, 0.5, 0.25), backend)[4, :, 0]
        place = (np.arange(16) + 0.5) / 16
        np.testing.assert_allclose(row, 8 * (0.25 + 0.5 * place) - 0.5, atol=1e-5)


def test_a_cubic_texel_has_the_weights_of_the_spline() -> None:
    """Of a single bright texel 4 / 6 are left in its middle, one third half a texel off."""
    pixels = np.zeros((1, 16, 4), np.float32)
    pixels[..., 3] = 1
    pixels[0, 8, :3] = 1
    texture = s.Texture("dot", pixels, interpolation="CUBIC", extension="EXTEND")
    row = drawn(showing(texture))[8, :, 0]
    np.testing.assert_allclose(row[6:11], [0, 1 / 6, 4 / 6, 1 / 6, 0], atol=1e-6)


@pytest.mark.parametrize(("interpolation", "extension"), WAYS)
@pytest.mark.parametrize("size", [(1, 1), (2, 3), (4, 16384), (16384, 4)], ids=str)
@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_both_tracers_read_the_same(interpolation, extension, size, kind) -> None:
    """Within the image and three widths beyond its edges."""
    random = np.random.default_rng(4)
    pixels = random.random((*size, 4))
    pixels = (255 * pixels).astype(np.uint8) if kind is np.uint8 else pixels.astype(np.float32)
    encoding = "SRGB" if kind is np.uint8 else "LINEAR"
    texture = s.Texture("odd", pixels, encoding, extension, interpolation)
    scene = showing(texture, 7.03, -3.013)
    native, exact = (drawn(scene, backend) for backend in ("NATIVE", "NUMPY"))
    assert np.isfinite(native).all()
    assert native.any()
    np.testing.assert_allclose(native, exact, atol=1e-6)


@pytest.mark.parametrize("extension", s.EXTENSIONS)
def test_threads_change_no_bit_of_a_cubic_image(extension) -> None:
    pixels = np.random.default_rng(4).random((5, 7, 4)).astype(np.float32)
    scene = showing(s.Texture("odd", pixels, "LINEAR", extension, "CUBIC"), 3.0, -1.0)
    one, three = (
        engine.render(scene, engine.Settings(samples=4, threads=count)).passes["Combined"]
        for count in (1, 3)
    )
    assert one.tobytes() == three.tobytes()
