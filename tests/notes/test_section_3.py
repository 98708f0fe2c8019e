"""Section 3 of the lecture notes, Raster Images: samples, pixel values, coverage and
compositing.
"""

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import raster, sampling
from glint.engine.scene import World
from notes_scenes import ball, paint, scene, view

GRID = (np.stack(np.meshgrid(np.arange(16), np.arange(16)), -1).reshape(-1, 2) + 0.5) / 16 - 0.5
"""16 × 16 regular samples of a pixel."""


def disc_scene(resolution, **world):
    """A glowing ball of radius 0.7 about (0.1, -0.05), seen without perspective: a disc."""
    camera = view("ORTHOGRAPHIC", eye=(0, 0, 5), resolution=resolution)
    return scene(
        camera,
        (ball((0.1, -0.05, 0.0), 0.7), paint(emission=(0.75, 0.5, 0.25))),
        world=World(**world),
    )


def in_disc(resolution):
    """The same disc as I(x, y) in pixels; its radius is the float32 that the scene holds."""
    nx, ny = resolution
    center, radius = np.float32([0.1, -0.05]).astype(np.float64), float(np.float32(0.7))

    def image(x, y):
        return (
            np.hypot((x + 0.5) * 2 / nx - 1 - center[0], (y + 0.5) * 2 / ny - 1 - center[1])
            < radius
        )

    return image


def test_3_2_a_raster_image_holds_a_value_per_pixel_bottom_row_first(draw):
    film = draw(disc_scene((6, 4)))
    assert film.combined.shape == (4, 6, 4)
    image = raster.point_sample(lambda x, y: np.stack([x, y], -1), 6, 4)
    np.testing.assert_array_equal(image[0, 5], [5.0, 0.0])


@pytest.mark.parametrize("resolution", [(8, 8), (24, 24), (40, 16)])
def test_3_3_a_shape_is_rasterised_at_any_resolution(draw, resolution):
    lit = draw.colors(disc_scene(resolution))[..., 0] > 0
    np.testing.assert_array_equal(lit, raster.point_sample(in_disc(resolution), *resolution) == 1.0)


def test_3_4_a_pixel_is_a_point_sample_at_its_centre(draw):
    lit = raster.point_sample(in_disc((16, 16)), 16, 16)
    draw.check(draw.colors(disc_scene((16, 16))), lit[..., None] * [0.75, 0.5, 0.25])


def test_3_4_a_pixel_is_a_local_average_of_the_image(draw):
    offsets = sampling.pixel_offsets(16, 1.5)
    share = raster.point_sample(in_disc((16, 16)), 16, 16, offsets)
    assert np.any((share > 0) & (share < 1))
    draw.check(
        draw.colors(disc_scene((16, 16)), samples=16, filter_width=1.5),
        share[..., None] * [0.75, 0.5, 0.25],
    )


def test_3_5_fewer_bits_clip():
    values = np.linspace(-0.5, 2.0, 11)
    shown = raster.dequantize(raster.quantize(values, 8), 8)
    np.testing.assert_array_equal(shown[values >= 1], 1.0)
    np.testing.assert_array_equal(shown[values <= 0], 0.0)


@pytest.mark.parametrize("bits", [1, 3, 8])
def test_3_5_fewer_bits_band(bits):
    ramp = np.linspace(0, 1, 4097)
    shown = raster.dequantize(raster.quantize(ramp, bits), bits)
    assert len(np.unique(shown)) == 2**bits
    assert np.max(np.abs(shown - ramp)) == pytest.approx(0.5 / (2**bits - 1), abs=0.5 / 4096)
    assert np.all(np.diff(shown) >= 0)


def test_3_6a_coverage_is_the_covered_share_of_the_pixel():
    # The half plane x < 2.25 covers pixels 0 and 1 whole, three quarters of pixel 2, nothing of
    # pixel 3.
    alpha = raster.coverage(lambda x, y: x < 2.25, 4, 1, GRID)
    np.testing.assert_array_equal(alpha, [[1.0, 1.0, 0.75, 0.0]])


def test_3_6b_compositing_keeps_the_minus():
    front, back = np.array([1.0, 0.5, 0.0]), np.array([0.0, 0.5, 1.0])
    np.testing.assert_array_equal(raster.composite(front, back, 0.25), [0.25, 0.5, 0.75])
    np.testing.assert_array_equal(raster.composite(front, back, 1.0), front)
    # (1 α) without its minus would give black
    np.testing.assert_array_equal(raster.composite(front, back, 0.0), back)


def test_3_6c_an_alpha_mask_is_a_grey_image_or_a_fourth_channel():
    alpha = raster.coverage(in_disc((8, 8)), 8, 8, GRID)
    front, back = np.full((8, 8, 3), [1.0, 0.5, 0.0]), np.full((8, 8, 3), [0.0, 0.25, 1.0])
    with_mask = raster.composite(front, back, alpha)
    four = raster.premultiply(np.concatenate([front, alpha[..., None]], -1))
    np.testing.assert_allclose(
        raster.over(four, np.concatenate([back, np.ones((8, 8, 1))], -1))[..., :3],
        with_mask,
        rtol=1e-15,
    )


def test_3_6c_a_transparent_picture_over_a_colour_equals_the_picture_with_that_background(draw):
    many = {"samples": 16, "filter_width": 1.5}
    back = (0.125, 0.25, 0.5)
    seen = disc_scene((16, 16), background=back)
    clear = draw(replace(seen, world=replace(seen.world, transparent=True)), **many).combined
    assert np.any((clear[..., 3] > 0) & (clear[..., 3] < 1))
    composed = raster.over(clear, np.array([*back, 1.0]))
    # Two pictures of float32 take part, so two roundings.
    np.testing.assert_allclose(
        composed[..., :3],
        draw.colors(seen, **many),
        rtol=1e-5 if draw.backend == "NATIVE" else 4 * 2.0**-24,
    )
