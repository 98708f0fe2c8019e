"""Sample points: the middle first, stratified, distributed as the filter, areas kept."""

import numpy as np
import pytest

from glint.engine import sampling

EPS = np.finfo(np.float64).eps
POWERS = pytest.mark.parametrize("power", range(11))


def assert_net(points):
    """One point in every elementary interval 2^-a × 2^-b with a + b = log2 of the count: a (0, m,
    2)-net.
    """
    count = len(points)
    power = count.bit_length() - 1
    for a in range(power + 1):
        cells = np.floor(points * [2**a, 2 ** (power - a)]).astype(int)
        assert len(np.unique(cells[:, 0] * 2 ** (power - a) + cells[:, 1])) == count


@POWERS
def test_powers_of_two_are_nets(power):
    points = sampling.sobol_points(2**power)
    assert np.all((points > 0) & (points < 1))
    assert_net(points)


@pytest.mark.parametrize("count", [5, 16, 100, 1000])
def test_prefixes_of_powers_of_two_are_nets_too(count):
    # So a wave that stops after 2^k of the samples has spread them as well as 2^k points can be.
    points = sampling.sobol_points(count)
    for power in range(count.bit_length()):
        assert_net(points[: 2**power])


@pytest.mark.parametrize("count", [1, 2, 3, 16, 100])
def test_the_first_point_is_the_middle(count):
    np.testing.assert_array_equal(sampling.sobol_points(count)[0], [0.5, 0.5])
    np.testing.assert_array_equal(sampling.pixel_offsets(count, 1.5)[0], [0.0, 0.0])
    for points in sampling.light_points(count):
        np.testing.assert_array_equal(points[0], [0.0, 0.0])


@POWERS
def test_each_axis_of_a_net_sits_in_the_middle_of_its_cells(power):
    count = 2**power
    for axis in sampling.sobol_points(count)[1:].T:
        np.testing.assert_allclose((axis * count) % 1, 0.5, rtol=0, atol=count * 2.0**-32)


@pytest.mark.parametrize("count", [32, 100, 1024])
def test_prefixes_of_light_points_are_spread_evenly_along_both_axes(count):
    # One in each cell of an axis, so that n points miss the middle by half a cell at most, 1 / n of
    # the light's half.
    square = sampling.light_points(count)[0]
    assert np.all(np.abs(square) < 1)
    for n in (2**power for power in range(count.bit_length())):
        assert all(len(np.unique(np.floor((axis + 1) / 2 * n))) == n for axis in square[:n].T)
        assert np.max(np.abs(np.mean(square[:n], axis=0))) <= 1 / n


def half_planes(*scales):
    """(axes, 400) normals, each pair of axes of random direction and given length, and (400,)
    places of planes that part the space.
    """
    rng = np.random.default_rng(4)
    angle = rng.uniform(0, 2 * np.pi, (len(scales), 400))
    normals = np.stack([np.cos(angle), np.sin(angle)], 1) * np.array(scales)[:, None, None]
    return normals.reshape(-1, 400), rng.uniform(-1.2, 1.2, 400) * max(scales)


@pytest.mark.parametrize(("count", "most"), [(16, 0.045), (32, 0.03), (128, 0.01), (512, 0.004)])
def test_light_points_tell_how_much_of_a_light_an_edge_hides(count, most):
    # Independent points would be off by 0.35 / √n: 0.09 at 16 and 0.015 at 512.
    normals, place = half_planes(1)
    axis = (np.arange(400) + 0.5) / 200 - 1
    hidden = np.mean(np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2) @ normals > place, 0)
    told = np.mean(sampling.light_points(1024)[0][:count] @ normals > place, 0)
    assert np.sqrt(np.mean((told - hidden) ** 2)) <= most


@pytest.mark.parametrize("scale", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("light_samples", [2, 4])
def test_points_of_pixel_and_light_do_not_line_up(scale, light_samples):
    # Edges that both the place in the pixel and the point on the light cross. The pixel's own two
    # dimensions for lights are off by 0.03.
    pixel = np.repeat(2 * sampling.sobol_points(256) - 1, light_samples, axis=0)
    points = np.concatenate([pixel, sampling.light_points(256 * light_samples)[0]], 1)
    normals, place = half_planes(1, scale)
    truth = np.mean(np.random.default_rng(5).uniform(-1, 1, (200_000, 4)) @ normals > place, 0)
    assert np.sqrt(np.mean((np.mean(points @ normals > place, 0) - truth) ** 2)) <= 0.012


def window_share(x):
    """Closed form of the Blackman-Harris window's area left of x, as a share."""
    t = np.clip(x + 0.5, 0, 1)
    waves = sum(
        c * np.sin(2 * np.pi * k * t) / (2 * np.pi * k)
        for k, c in ((1, -0.48829), (2, 0.14128), (3, -0.01168))
    )
    return (0.35875 * t + waves) / 0.35875


def test_blackman_harris_is_even_and_one_in_the_middle():
    x = np.linspace(-0.5, 0.5, 101)
    window = sampling.blackman_harris(x)
    assert window[50] == pytest.approx(1.0, abs=4 * EPS)
    assert window[0] == pytest.approx(6e-5, abs=4 * EPS)
    np.testing.assert_allclose(window, window[::-1], rtol=0, atol=16 * EPS)


@pytest.mark.parametrize("width", [1.5, 0.01, 4.0])
@pytest.mark.parametrize("count", [64, 1024, 4096])
def test_offsets_are_distributed_as_the_filter(width, count):
    offsets = sampling.pixel_offsets(count, width)
    assert np.max(np.abs(offsets)) < width
    # Kolmogorov-Smirnov: stratified points in the middle of their cells are within half a step of
    # the distribution, the first one within a whole step. The table's linear interpolation and
    # midpoint sums add h²/8 + h²/24 of the largest slope of the density, 2π(0.48829 + 2·0.14128 +
    # 3·0.01168)/0.35875 < 14.2, with h = 1/4096.
    table = 14.2 / 4096**2 / 6
    for axis in np.sort(offsets, 0).T:
        share = window_share(axis / (2 * width))
        assert (
            np.max(np.abs(share - (np.arange(count) + 0.5) / count))
            <= 0.5 / count + table + 2.0**-32
        )


@pytest.mark.parametrize("count", [16, 64, 256, 1024])
def test_pixels_that_stop_early_are_not_shifted(count):
    # In the lower corners of their cells n points miss the middle by half a cell, which is 1 / n
    # pixels through this filter: so did the sequence before it was scrambled.
    offsets = sampling.pixel_offsets(count, 1.5)
    for power in range(2, count.bit_length() - 1):
        assert np.max(np.abs(np.mean(offsets[: 2**power], axis=0))) < 0.3 / 2**power


def test_a_filter_of_no_width_samples_the_centre_only():
    np.testing.assert_array_equal(sampling.pixel_offsets(16, 0.0), np.zeros((16, 2)))


def test_the_concentric_map_keeps_areas():
    rng = np.random.default_rng(10)
    square = rng.uniform(-0.999, 0.999, (2000, 2))
    # Off the diagonals, where the map has its creases.
    square = square[np.abs(np.abs(square[:, 0]) - np.abs(square[:, 1])) > 1e-3]
    step = 1e-4
    moves = step * np.eye(2)
    dx, dy = (
        (sampling.concentric_disc(square + move) - sampling.concentric_disc(square - move))
        / (2 * step)
        for move in moves
    )
    jacobian = dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0]
    # Central differences err by h²/6 of the third derivatives: r φ''' grows as 1/r², so stay off
    # the middle by 0.1.
    away = np.max(np.abs(square), 1) > 0.1
    np.testing.assert_allclose(jacobian[away], np.pi / 4, rtol=0, atol=step**2 * 6 / 0.1**2 + 1e-11)


def test_the_concentric_map_takes_rims_to_circles():
    for size in (0.25, 1.0):
        t = np.linspace(-size, size, 101)
        rim = np.concatenate(
            [
                np.stack([t, 0 * t + side], -1)[:, order]
                for side in (size, -size)
                for order in ([0, 1], [1, 0])
            ]
        )
        np.testing.assert_allclose(
            np.hypot(*sampling.concentric_disc(rim).T), size, rtol=0, atol=4 * EPS
        )


def test_the_concentric_map_is_one_to_one_and_keeps_the_axes():
    on_axes = np.array([[0.5, 0.0], [0.0, 0.5], [-0.5, 0.0], [0.0, -0.5]])
    np.testing.assert_allclose(sampling.concentric_disc(on_axes), on_axes, rtol=0, atol=EPS)
    t = (np.arange(40) + 0.5) / 20 - 1
    disc = sampling.concentric_disc(np.stack(np.meshgrid(t, t), -1).reshape(-1, 2))
    apart = np.hypot(*np.moveaxis(disc[:, None] - disc[None], -1, 0))
    # Neighbours in the square are 0.05 apart; the map shrinks no length by more than the smaller
    # singular value of its Jacobian, > 0.5.
    assert np.min(apart[~np.eye(len(disc), dtype=bool)]) > 0.025
