"""Raster helpers at their edges: bit depths, non-finite values, the sRGB curve, compositing
algebra.
"""

import numpy as np
import pytest

from glint.engine import raster

EPS = np.finfo(np.float64).eps
RNG = np.random.default_rng(8)


@pytest.mark.parametrize("bits", [1, 2, 5, 8, 10, 16])
def test_quantizing_loses_at_most_half_a_level_and_keeps_levels(bits):
    top = 2**bits - 1
    values = RNG.uniform(0, 1, 10_000)
    levels = raster.quantize(values, bits)
    assert levels.dtype == (np.uint8 if bits <= 8 else np.uint16)
    assert np.max(np.abs(raster.dequantize(levels, bits) - values)) <= (0.5 + 4 * EPS * top) / top
    every = np.arange(top + 1)
    np.testing.assert_array_equal(raster.quantize(raster.dequantize(every, bits), bits), every)


def test_quantizing_clips_and_has_an_answer_for_non_finite_values():
    np.testing.assert_array_equal(
        raster.quantize([-0.5, 1.5, np.inf, -np.inf, np.nan], 8), [0, 255, 255, 0, 0]
    )


@pytest.mark.parametrize("bits", [0, 17])
def test_other_bit_depths_are_refused(bits):
    with pytest.raises(ValueError, match="use 1 to 16"):
        raster.quantize(0.5, bits)


def test_srgb_anchors_and_round_trip():
    # IEC 61966-2-1: 18 % grey is 0.4614 encoded; the ends are 0 and 1, the slope in between 12.92
    # first.
    np.testing.assert_allclose(raster.srgb_from_linear([0.0, 0.001]), [0.0, 0.01292], rtol=EPS)
    assert raster.srgb_from_linear(1.0) == pytest.approx(1.0, abs=2 * EPS)
    assert raster.srgb_from_linear(0.18) == pytest.approx(0.46135612950044164, rel=8 * EPS)
    values = np.concatenate([RNG.uniform(-2, 4, 1000), [0.0031308, 0.04045]])
    # The power 2.4 stretches relative rounding by 2.4, twice over.
    np.testing.assert_allclose(
        raster.linear_from_srgb(raster.srgb_from_linear(values)), values, rtol=16 * EPS, atol=2e-8
    )
    away = values[np.abs(np.abs(values) - 0.0031308) > 1e-6]
    np.testing.assert_allclose(
        raster.linear_from_srgb(raster.srgb_from_linear(away)), away, rtol=16 * EPS
    )


def test_every_byte_survives_the_srgb_round_trip():
    codes = np.arange(256)
    linear = raster.linear_from_srgb(raster.dequantize(codes, 8))
    np.testing.assert_array_equal(raster.quantize(raster.srgb_from_linear(linear), 8), codes)


def test_over_is_associative_and_equals_the_straight_form():
    a, b, c = (raster.premultiply(x) for x in RNG.uniform(0, 1, (3, 50, 4)))
    np.testing.assert_allclose(
        raster.over(raster.over(a, b), c), raster.over(a, raster.over(b, c)), rtol=0, atol=8 * EPS
    )
    straight, background = RNG.uniform(0, 1, (50, 4)), RNG.uniform(0, 1, (50, 3))
    opaque = np.concatenate([background, np.ones((50, 1))], 1)
    expected = raster.composite(straight[:, :3], background, straight[:, 3])
    np.testing.assert_allclose(
        raster.over(raster.premultiply(straight), opaque)[:, :3], expected, rtol=0, atol=4 * EPS
    )


def test_premultiplication_is_undone_where_there_is_cover():
    straight = RNG.uniform(0.01, 1, (50, 4))
    np.testing.assert_allclose(
        raster.unpremultiply(raster.premultiply(straight)), straight, rtol=4 * EPS
    )
    np.testing.assert_array_equal(
        raster.unpremultiply([0.5, 0.25, 0.0, 0.0]), [0.5, 0.25, 0.0, 0.0]
    )


def test_premultiplying_leaves_its_argument_alone():
    straight = np.full((1, 4), 0.5)
    raster.premultiply(straight)
    raster.unpremultiply(straight)
    np.testing.assert_array_equal(straight, np.full((1, 4), 0.5))


def test_samples_fall_where_their_offsets_say():
    image = raster.point_sample(lambda x, y: x + 10 * y, 2, 2, np.array([[0.25, 0.5], [0.25, 0.0]]))
    np.testing.assert_array_equal(image, [[2.75, 3.75], [12.75, 13.75]])


def test_rows_count_upwards_and_channels_stay():
    image = raster.point_sample(lambda x, y: np.stack([x, y], -1), 4, 3)
    assert image.shape == (3, 4, 2)
    np.testing.assert_array_equal(image[2, 1], [1.0, 2.0])
