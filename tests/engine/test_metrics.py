"""Error measures against closed forms."""

import numpy as np
import pytest

from glint.engine.analysis import metrics

EPS = np.finfo(np.float64).eps
SHAPE = (4, 5, 3)


def flat(value, shape=SHAPE):
    return np.full(shape, value, np.float32)


def test_a_constant_offset_is_every_mean_and_maximum():
    picture, reference = flat(0.75), flat(0.5)
    assert metrics.rmse(picture, reference) == 0.25
    assert metrics.relative_rmse(picture, reference) == 0.5
    assert metrics.max_absolute_error(picture, reference) == 0.25
    assert metrics.max_relative_error(picture, reference) == 0.5
    assert metrics.psnr(picture, reference) == pytest.approx(20 * np.log10(4), rel=4 * EPS)
    assert metrics.psnr(picture, reference, peak=2.0) == pytest.approx(
        20 * np.log10(8), rel=4 * EPS
    )


def test_one_wrong_value_counts_by_its_share():
    reference, picture = flat(1.0), flat(1.0)
    picture[1, 2, 0] = 2.0
    assert metrics.rmse(picture, reference) == pytest.approx(np.sqrt(1 / 60), rel=4 * EPS)
    assert metrics.max_absolute_error(picture, reference) == 1.0
    assert metrics.wrong_fraction(picture, reference) == 1 / 20
    assert np.argwhere(metrics.wrong_pixels(picture, reference)).tolist() == [[1, 2]]


def test_the_wave_of_known_power():
    # A sine over whole periods has the root mean square 1/√2.
    x = np.arange(64) / 64
    wave = np.sin(2 * np.pi * 3 * x)[:, None, None]
    assert metrics.rmse(2 + wave, 2 + 0 * wave) == pytest.approx(np.sqrt(0.5), rel=16 * EPS)


def test_equal_pictures_have_no_error():
    picture = np.random.default_rng(9).normal(size=SHAPE)
    assert (
        metrics.rmse(picture, picture)
        == metrics.relative_rmse(picture, picture)
        == metrics.max_relative_error(picture, picture)
        == 0.0
    )
    assert metrics.psnr(picture, picture) == np.inf
    assert metrics.wrong_fraction(picture, picture) == 0.0
    assert (
        metrics.max_relative_error(flat(0), flat(0))
        == metrics.relative_rmse(flat(0), flat(0))
        == 0.0
    )


def test_the_threshold_is_strict():
    reference = flat(1.0, (1, 2, 1)).astype(np.float64)
    picture = reference + np.array([0.25, 0.25 + EPS]).reshape(1, 2, 1)
    assert metrics.wrong_pixels(picture, reference, threshold=0.25).tolist() == [[False, True]]
    assert metrics.wrong_pixels(4 * picture, 4 * reference, threshold=0.25).tolist() == [
        [False, True]
    ]


def test_a_dark_channel_is_judged_by_its_pixel():
    reference = np.array([[[1.0, 1e-6, 0.0]]])
    assert metrics.wrong_fraction(reference + np.array([0.0, 1e-3, 1e-3]), reference) == 0.0
    assert metrics.wrong_fraction(reference + np.array([0.0, 0.02, 0.0]), reference) == 1.0


def test_the_floor_scales_with_the_picture_unless_given():
    reference = np.array([1.0, 1.0, 1.0, 0.0])
    picture = reference + np.array([0.0, 0.0, 0.0, 1e-6])
    for scale in (1e-20, 1.0, 1e20):
        assert metrics.max_relative_error(scale * picture, scale * reference) == pytest.approx(
            1e-3, rel=1e-9
        )
    assert metrics.max_relative_error(picture, reference, floor=1e-2) == pytest.approx(
        1e-4, rel=1e-9
    )
    assert metrics.max_relative_error(picture, reference, floor=0.0) == np.inf


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("side", [0, 1])
def test_non_finite_values_are_infinite_errors(bad, side):
    pair = [flat(1.0), flat(1.0)]
    pair[side][0, 0, 0] = bad
    for measure in (
        metrics.rmse,
        metrics.relative_rmse,
        metrics.max_absolute_error,
        metrics.max_relative_error,
    ):
        assert measure(*pair) == np.inf
    assert metrics.psnr(*pair) == -np.inf
    assert metrics.wrong_fraction(*pair) == 1 / 20


def test_no_square_overflows():
    assert metrics.rmse(np.array([3e200, 4e200]), np.zeros(2)) == pytest.approx(
        np.sqrt(12.5) * 1e200, rel=8 * EPS
    )


def test_an_error_beside_a_black_reference_is_infinite_relative_to_it():
    assert (
        metrics.relative_rmse(flat(0.5), flat(0.0))
        == metrics.max_relative_error(flat(0.5), flat(0.0))
        == np.inf
    )
    assert metrics.wrong_fraction(flat(1e-9), flat(0.0)) == 1.0


def test_integers_do_not_wrap_round():
    assert metrics.max_absolute_error(np.array([0], np.uint8), np.array([255], np.uint8)) == 255.0


def test_different_shapes_are_refused():
    with pytest.raises(ValueError, match="equal shapes"):
        metrics.rmse(flat(1.0), flat(1.0, (5, 4, 3)))


def test_empty_pictures_have_no_error():
    empty = np.zeros((0, 0, 3))
    assert (
        metrics.rmse(empty, empty)
        == metrics.max_absolute_error(empty, empty)
        == metrics.wrong_fraction(empty, empty)
        == 0.0
    )
