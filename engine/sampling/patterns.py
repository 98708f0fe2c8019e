"""Where samples fall: the same few points for every pixel, or for each class of pixels of a block,
so pictures carry no random noise and repeat bit for bit.

Pixels use the first two dimensions of the Sobol' sequence, lamps the next two, the sky and what
glows the two after these, scrambled (Owen 1995), so that all are spread well each for itself and
together. They are kept in 32-bit integers.
"""

from __future__ import annotations

import functools

import numpy as np

MOST_TABLED = 1 << 20
"""Directions or points of a light that all pixels share; later samples take the first ones again.
"""
MOST_LOBE_POINTS = MOST_NODE_POINTS = 1 << 16
BOUNCE_LEVELS = 16
"""Bounces of a path, by which light goes on, whose directions are independent."""
LOBE_LEVELS = 32
"""The same of reflections and refractions. Light that is mirrored inside rough glass would stay
there where the same points came again.
"""
_BOUNCE_SEEDS = range(8, 8 + BOUNCE_LEVELS)
_LOBE_SEEDS = (*range(8), *range(_BOUNCE_SEEDS.stop, BOUNCE_LEVELS + LOBE_LEVELS))
"""Of the shuffles of either: no two are the same."""
_ASIDE = 0.7
"""Radians."""
TILE_SIDE = 32
"""Of the squares of the frame that are traced one by one: the core's tiles."""
MOST_SUBSURFACE_POINTS = 1 << 12
_BOUNCE, _BOUNCE_SCRAMBLES = (2, 1, 3), (511, 512, 513)
"""The first two are, of the pairs of the Sobol' sequence below 13, the one of which a pixel's
points, and those of a block together, are the least off in wedges of the disc with a soft side, at
16 to 512 points a pixel.
"""
BOUNCE_PARTS = 4
"""Bounces are dealt over blocks of pixels of twice the side: parts of the run of a class."""
_WORD = np.uint64((1 << 32) - 1)
_STEP = np.uint64(0x9E3779B1)
_POLYNOMIALS = (
    None,
    ((), (1,)),
    ((1,), (1, 3)),
    ((2,), (1, 3, 1)),
    ((1,), (1, 1, 1)),
    ((3,), (1, 1, 3, 3)),
    ((1,), (1, 3, 5, 13)),
    ((3,), (1, 1, 5, 5, 17)),
    ((2,), (1, 1, 5, 5, 5)),
    ((2, 3, 4), (1, 1, 7, 11, 19)),
    ((1, 3, 4), (1, 1, 5, 1, 1)),
    ((1, 2, 4), (1, 1, 1, 3, 11)),
    ((1, 2, 3), (1, 3, 5, 5, 31)),
)
"""By dimension, None for van der Corput's: which of the last direction numbers make the next one,
and the first ones (Joe, Kuo 2008).
"""
_PIXEL, _LIGHT, _DOME, _LENS = (0, 1), (2, 3), (4, 5), (6, 9)
"""Dimensions. Of the pairs from 6 to 11 that of lenses has the least error of half planes that lens
and pixel share, over 8 to 64 samples: 2 % more than (2, 3), where (6, 7) has 44 % more at 16.
"""
_SCRAMBLES = (8910, 8911, 13970, 31666, 40241, 52907)
"""By dimension. Of 12 000 scrambles for pixels the one whose first 4 to 128 of up to 256 points
are, as the filter spreads them, the least off the pixel's middle and the filter's width: 4 of 64 by
0.03 pixels, where the plain sequence is off by 0.24. Of 300 for lights the one with the least
error, over 1 to 256 pixel samples of 2 and 4 points each, of half planes that hide a part of the
light, which the place in the pixel shifts: 0.96 of the median's.
"""
_LENS_SCRAMBLES = (101, 202)
_SHUTTER, _SHUTTER_SCRAMBLES = (7,), (303,)
_SCATTER, _SCATTER_SCRAMBLES = (10,), (404,)
_BELOW, _BELOW_SCRAMBLES = (10, 11, 8), (404, 405, 406)
_SHARED_SHUTTER, _LENS_SHARED_SHUTTER, _SHARED_SHUTTER_SCRAMBLES = (9,), (12,), (11,)
"""Of 4 and 6 to 12 the dimension whose pictures of what moves are the least off in FLIP at 8 to 64
samples where all pixels share times; the lens has that one too, and 12 is the next.
"""


def sobol_points(count: int) -> np.ndarray:
    """(count, 2) float64 in (0, 1): van der Corput and the second Sobol' dimension, scrambled, in
    the middle of the cells that `count` points stratify; point 0 is (0.5, 0.5). The first 4, 8, 16
    … are stratified as well and have nearly the middle as their mean, for pixels that stop there.
    """
    return _sobol(count, _PIXEL)


def _sobol(count: int, dimensions: tuple[int, ...], numbers: tuple[int, ...] = ()) -> np.ndarray:
    """(count, dimensions) float64 in (0, 1), scrambled, in the middle of the cells that `count`
    points stratify on each axis; point 0 is in the middle.  numbers: other scrambles than the
    dimensions' own.
    """
    bits = max(count - 1, 0).bit_length()
    index = np.arange(count, dtype=np.uint64)
    columns = np.zeros((count, len(dimensions)), np.uint64)
    words_of_digits = list(zip(*map(_directions, dimensions), strict=True))
    for digit, words in enumerate(words_of_digits[:bits]):
        columns ^= (index >> np.uint64(digit) & np.uint64(1))[:, None] * np.array(words, np.uint64)
    numbers = numbers or tuple(_SCRAMBLES[k] for k in dimensions)
    scrambles = np.array(numbers, np.uint64) * _STEP
    points = _scrambled(columns, bits, scrambles) / 2.0**32 + 0.5 / (1 << bits)
    points[:1] = 0.5
    return points


def _directions(dimension: int) -> list[int]:
    """32-bit direction numbers by digit of the index."""
    polynomial = _POLYNOMIALS[dimension]
    if polynomial is None:
        return [1 << (31 - digit) for digit in range(32)]
    taps, first = polynomial
    words = [odd << (31 - digit) for digit, odd in enumerate(first)]
    for digit in range(len(first), 32):
        words.append(words[-len(first)] ^ words[-len(first)] >> len(first))
        for tap in taps:
            words[digit] ^= words[digit - tap]
    return words


def _scrambled(columns: np.ndarray, bits: int, scrambles: np.ndarray) -> np.ndarray:
    """32-bit fractions (n, d) with each of the first `bits` binary digits turned or not, by a hash
    of the digits before it: cells of any size stay stratified. Digits after zeros alone are not,
    but for the first: 0 becomes a half.  scrambles: (d,).
    """
    scrambled = columns.copy()
    for place in range(bits):
        before = columns >> np.uint64(32 - place) if place else np.zeros_like(columns)
        turn = _hash(before * np.uint64(64) + np.uint64(place) + scrambles) & np.uint64(1)
        scrambled ^= np.where(before == 0, np.uint64(place == 0), turn) << np.uint64(31 - place)
    return scrambled


def _hash(x: np.ndarray) -> np.ndarray:
    """32 mixed bits (Wellons 2018, lowbias32)."""
    x = x & _WORD
    x = (x ^ x >> np.uint64(16)) * np.uint64(0x7FEB352D) & _WORD
    x = (x ^ x >> np.uint64(15)) * np.uint64(0x846CA68B) & _WORD
    return x ^ x >> np.uint64(16)


def blackman_harris(x: np.ndarray) -> np.ndarray:
    """The four-term Blackman-Harris window over x in [-0.5, 0.5] (Harris 1978), 1 in the middle."""
    angle = 2 * np.pi * (x + 0.5)
    return (
        0.35875
        - 0.48829 * np.cos(angle)
        + 0.14128 * np.cos(2 * angle)
        - 0.01168 * np.cos(3 * angle)
    )


def pixel_offsets(samples: int, filter_width: float) -> np.ndarray:
    """(samples, 2) float64 offsets from the pixel's centre, in pixels, distributed as the filter;
    the first is exactly 0.

    filter_width as Blender gives it: the Blackman-Harris window spans twice that.
    """
    offsets = 2 * filter_width * _inverse_blackman_harris(sobol_points(samples))
    offsets[0] = 0.0
    return offsets


def dealt_offsets(samples: int, rays: int, filter_width: float) -> np.ndarray:
    """(rays, rays * samples, 2) float64, pixels: for each of `rays` classes of pixels
    (`offset_classes`) the same `pixel_offsets`, in an order of its own. The first `samples` are
    those of its samples: exactly 0, then a run that no other class has.
    """
    offsets = pixel_offsets(rays * samples, filter_width)
    own = samples * np.arange(rays)[:, None] + np.arange(samples)
    own[:, 0] = 0
    rest = [np.setdiff1d(np.arange(rays * samples), run) for run in own]
    return offsets[np.concatenate([own, np.stack(rest)], 1)]


def _inverse_blackman_harris(u: np.ndarray) -> np.ndarray:
    """The x with a share u of the window's area to its left, by table and linear interpolation."""
    x = np.linspace(-0.5, 0.5, 4097)
    middle = blackman_harris((x[1:] + x[:-1]) / 2)
    area = np.concatenate(([0.0], np.cumsum(middle)))
    return np.interp(u, area / area[-1], x)


def light_points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """The same points in the square [-1, 1]² and, by the concentric map (Shirley, Chiu 1997), in
    the unit disc; both (count, 2) float64, the first exactly in the middle.
    """
    square = 2 * _sobol(count, _LIGHT) - 1
    return square, concentric_disc(square)


def scatter_offsets(samples: int) -> np.ndarray:
    """(samples,) float64 in (0, 1): by how much what `scatter_share` gives is shifted."""
    offsets = _sobol(samples, _SCATTER, _SCATTER_SCRAMBLES)[:, 0]
    offsets[0] += 0.5 / _cells(samples)  # in the middle of its cell, as the others
    return offsets


def scatter_share(offsets: np.ndarray, sample: int, number: int, count: int) -> float:
    """In (0, 1): where along rays point `number` of `count` of a sample lies that media scatter
    light from. Each number goes all the way over the samples, and all of them fill it evenly.
    """
    own = ((number + 0.5) / count - 0.5) / _cells(len(offsets))
    return (number / count + offsets[sample] + own) % 1.0


def _cells(samples: int) -> int:
    return 1 << max(samples - 1, 0).bit_length()


@functools.lru_cache(maxsize=4)
def dome_points(count: int) -> np.ndarray:
    """(count, 2) float64 in (0, 1), not to be written to, from which the directions of the sky's
    light are drawn. All lights of a scene ask for the same.
    """
    points = _sobol(count, _DOME)
    points.flags.writeable = False
    return points


@functools.lru_cache(maxsize=4)
def occlusion_points(samples: int, each: int) -> np.ndarray:
    """(k, 2) float64 in the unit disc, not to be written to: what lies below the directions of
    samples that look round, `each` of one after those of the one before. A viewport asks for the
    same all the time.
    """
    points = concentric_disc(2 * dome_points(tabled(samples, each)) - 1)
    points.flags.writeable = False
    return points


@functools.lru_cache(maxsize=4)
def node_points(samples: int, each: int) -> np.ndarray:
    """(k, 5) float64, not to be written to: where programs that ask for rays look, of which each
    sample takes `each` rows or fewer.

    A point of the unit disc, as `occlusion_points` has it; a point of it as dense as (1 - r)³, r
    its distance from the middle; and an axis: 0 half of the time, else 1 or 2.
    """
    count = min(samples * each, MOST_NODE_POINTS)
    u, v = dome_points(count).T
    axis = np.where(u < 0.5, 0, np.where(u < 0.75, 1, 2))
    # not along the axes, where rays would lie in faces
    turn = 2 * np.pi * (np.where(axis == 0, 2 * u, 4 * u) % 1) + _ASIDE
    dense = _dense_radius(v) * np.stack([np.cos(turn), np.sin(turn)])
    points = np.column_stack([occlusion_points(1, count), dense.T, axis])
    points.flags.writeable = False
    return points


def _dense_radius(share: np.ndarray) -> np.ndarray:
    """(k,) the radius within which the share (k,) of (1 - r)³ over the unit disc lies."""
    low, high = np.zeros_like(share), np.ones_like(share)
    for _ in range(60):
        r = (low + high) / 2
        inside = r * r * (10 - r * (20 - r * (15 - 4 * r))) < share
        low, high = np.where(inside, r, low), np.where(inside, high, r)
    return (low + high) / 2


@functools.lru_cache(maxsize=2)
def lobe_points(count: int) -> np.ndarray:
    """(LOBE_LEVELS, k, 2) float64 in the unit disc, not to be written to: where in the lobes of
    rough surfaces `count` samples of a pixel reflect their rays, at each of their first
    reflections. Later reflections, and samples beyond k = MOST_LOBE_POINTS, take these again.

    The same points in another order each time, and in another than lights have them, so that they
    are independent (Burley 2020, Practical hash-based Owen scrambling: shuffling).
    """
    count = min(count, MOST_LOBE_POINTS)
    bits = max(count - 1, 0).bit_length()
    disc = concentric_disc(2 * _sobol(1 << bits, _DOME) - 1)
    points = np.stack([disc[_shuffled(bits, seed)[:count]] for seed in _LOBE_SEEDS])
    points.flags.writeable = False
    return points


def places_in_blocks(x: tuple[int, int], y: tuple[int, int], side: int) -> np.ndarray:
    """(pixels,) which pixel of a square of `side` on a side each is, row by row, of those from x[0]
    and y[0] to before x[1] and y[1] of the frame.
    """
    return ((np.arange(*y) % side)[:, None] * side + np.arange(*x) % side).ravel()


@functools.lru_cache(maxsize=4)
def bounce_points(samples: int) -> np.ndarray:
    """(BOUNCE_LEVELS, k, 3) float64, not to be written to: how light bounces, at each bounce of a
    path; samples beyond k = MOST_LOBE_POINTS take these again. A point of the unit disc below the
    direction, turned so that rays do not lie in faces along the axes; and a number of [0, 1) that
    what goes on of the light is not below, else the path ends there (Russian roulette: Arvo, Kirk
    1990, Particle transport and image synthesis). The same points in another order each time, as
    `lobe_points`.
    """
    count = min(samples, MOST_LOBE_POINTS)
    bits = max(count - 1, 0).bit_length()
    numbers = _sobol(1 << bits, _BOUNCE, _BOUNCE_SCRAMBLES)
    x, y = concentric_disc(2 * numbers[:, :2] - 1).T
    cosine, sine = np.cos(_ASIDE), np.sin(_ASIDE)
    all_points = np.column_stack([cosine * x - sine * y, sine * x + cosine * y, numbers[:, 2]])
    points = np.stack([all_points[_shuffled(bits, seed)[:count]] for seed in _BOUNCE_SEEDS])
    points.flags.writeable = False
    return points


@functools.lru_cache(maxsize=4)
def subsurface_points(samples: int) -> np.ndarray:
    """(k, 6) float64, not to be written to: where samples look for the light that comes out of a
    surface elsewhere; samples beyond k = MOST_SUBSURFACE_POINTS take these again.

    Each sample stands for one of k equal shares of the light, the rings round the point that it
    comes out of: where a share begins, its middle, where it ends; the cosine and sine of an angle;
    and an axis across the normal, 1 or 2. Any aligned run is spread well over rings, angles and
    axes.
    """
    count = min(samples, MOST_SUBSURFACE_POINTS)
    share, angle, across = _sobol(count, _BELOW, _BELOW_SCRAMBLES).T
    ring = np.argsort(np.argsort(share))
    points = np.zeros((count, 6))
    points[:, 0], points[:, 1] = ring / count, (ring + 0.5) / count
    points[:, 2] = (ring + 1) / count
    turn = 2 * np.pi * angle + _ASIDE
    points[:, 3], points[:, 4] = np.cos(turn), np.sin(turn)
    points[:, 5] = 1 + (across >= 0.5)
    points.flags.writeable = False
    return points


def _shuffled(bits: int, seed: int) -> np.ndarray:
    """The numbers below 2^bits in an order that keeps aligned runs of powers of two together: each
    binary digit turned or not, by a hash of those before it.
    """
    order = np.arange(1 << bits, dtype=np.uint64)
    for place in range(bits):
        before = np.arange(1 << place, dtype=np.uint64)
        turn = _hash(before * np.uint64(64) + np.uint64(place) + np.uint64(seed + 1) * _STEP)
        runs = order.reshape(1 << place, -1)
        runs ^= ((turn & np.uint64(1)) << np.uint64(bits - 1 - place))[:, None]
    return order.astype(np.intp)


def lens_square(block: int, samples: int) -> np.ndarray:
    """(block², samples, 2) float64 in [-1, 1]²: of each pixel of a block² square, row by row, where
    its samples look through the lens's square.

    Each pixel's are consecutive points of one sequence, so that they are spread well, and those of
    all pixels of a block fill the gaps (Keller, Heidrich 2001, interleaved sampling). Neighbours
    get numbers far apart, as ordered dither has them (Bayer 1973).  block: a power of 2.
    """
    each = 1 << max(samples - 1, 0).bit_length()
    points = 2 * _sobol(block * block * each, _LENS, _LENS_SCRAMBLES) - 1
    return points.reshape(block * block, each, 2)[_bayer(block).ravel(), :samples]


def shutter_times(block: int, samples: int) -> np.ndarray:
    """(block², samples) float64 in (0, 1): the times of the samples of each pixel of a block, as
    `lens_square` deals its points.
    """
    each = 1 << max(samples - 1, 0).bit_length()
    times = _sobol(block * block * each, _SHUTTER, _SHUTTER_SCRAMBLES)
    return times.reshape(block * block, each)[_bayer(block).ravel(), :samples]


def shared_shutter_times(samples: int, has_lens: bool) -> np.ndarray:
    """(samples,) float64 in (0, 1): the times that all pixels share; the first in the middle."""
    dimension = _LENS_SHARED_SHUTTER if has_lens else _SHARED_SHUTTER
    return _sobol(samples, dimension, _SHARED_SHUTTER_SCRAMBLES)[:, 0]


_TURNS = (6, 4, 8, 13)
"""By binary digit of a class, which digits of a sample's number it turns: of 1500 linear maps the
one with which a sample's points of all 16 classes lie in the most of 16 intervals of each axis and
of 4 x 4 squares, of the points of lamps, domes and gather rays at 4, 16 and 64 samples: in 13.3 on
average, where reversed digits have 8.9.
"""


def dealt_samples(samples: int, side: int) -> int:
    """Samples of the tables that the pixels of a block of side² deal among themselves, of which
    each takes `samples`.
    """
    return samples if side == 1 else side * side << max(samples - 1, 0).bit_length()


def interleaving_classes(x: tuple[int, int], y: tuple[int, int], side: int) -> np.ndarray:
    """(pixels,) the class of each pixel in its block of side², a power of 2, row by row, of those
    from x[0] and y[0] to before x[1] and y[1] of the frame. Neighbours get numbers far apart, as
    ordered dither has them (Bayer 1973).
    """
    column, row = np.arange(*x) % side, np.arange(*y) % side
    return _bayer(side)[row[:, None], column].ravel()


def offset_classes(x: tuple[int, int], y: tuple[int, int], count: int) -> np.ndarray:
    """(pixels,) which of `count` `dealt_offsets` each pixel has, in the order of
    `interleaving_classes`; of four or a multiple, pixels that touch have different ones.
    """
    column, row = np.arange(*x), np.arange(*y)[:, None]
    low, high = (
        (2 * (u ^ v) + v) for u, v in ((column & 1, row & 1), (column >> 1 & 1, row >> 1 & 1))
    )
    return ((low + 4 * high) % count).ravel()


def bounce_parts(x: tuple[int, int], y: tuple[int, int], side: int) -> np.ndarray:
    """(pixels,) which part of the run of its class the bounces of each pixel are of, of the blocks
    of side² that deal samples, row by row, of those from x[0] and y[0] to before x[1] and y[1] of
    the frame: the last digit of `interleaving_classes` of blocks twice as wide.
    """
    if side == 1:
        return np.zeros((x[1] - x[0]) * (y[1] - y[0]), np.intp)
    return interleaving_classes(x, y, 2 * side) % BOUNCE_PARTS


def dealt_sample(sample: int, number: int, samples: int, side: int) -> int:
    """Which sample of the tables a pixel of the class `number` takes as its `sample` of `samples`.

    Each class has an aligned run of them, a net by itself (Sobol' 1967), and goes through it from
    another one on, so that the first samples of all classes are spread as well (Keller, Heidrich
    2001, Interleaved sampling).
    """
    if side == 1:
        return sample
    run, first = 1 << max(samples - 1, 0).bit_length(), 0
    for digit, turn in enumerate(_TURNS):
        first ^= turn if number >> digit & 1 else 0
    return number * run + (sample ^ first & (run - 1))


def class_beyond(number: int, round_: int, side: int) -> int:
    """The class whose samples of the tables a pixel of the class `number`, below side², takes in
    that round of as many camera rays as it has samples. In round 0 it is its own; after that one of
    another four, the same for each four classes, as no shadows come of these rays. side: of blocks.
    """
    return number & ~3 ^ (side**2 // 2 + round_) % side**2 if round_ else number


def _bayer(size: int) -> np.ndarray:
    """(size, size) the numbers 0 to size² − 1 in the order of ordered dither; size a power of 2."""
    order = np.zeros((1, 1), np.intp)
    while len(order) < size:
        order = np.block([[4 * order, 4 * order + 2], [4 * order + 3, 4 * order + 1]])
    return order


def concentric_disc(square: np.ndarray) -> np.ndarray:
    """(k, 2) points of [-1, 1]² to the unit disc, areas and neighbours kept."""
    a, b = square[:, 0], square[:, 1]
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    ratio = np.where(wide, b, a) / np.where(radius == 0, 1, radius)
    angle = np.where(wide, np.pi / 4 * ratio, np.pi / 2 - np.pi / 4 * ratio)
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)


def tabled(samples: int, each: int) -> int:
    """How many points a table has of which each of so many samples of a pixel takes `each`: those
    of whole samples, at most MOST_TABLED unless one takes more.
    """
    return each * min(samples, max(MOST_TABLED // each, 1))


def chosen(weights: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of the weights (m,), laid end to end, the shares u (n,) of their sum fall into, and
    where in them, from 0 to 1.
    """
    ends = np.concatenate([[0.0], np.cumsum(weights)])
    at = u * ends[-1]
    index = np.clip(np.searchsorted(ends, at, "right") - 1, 0, len(weights) - 1)
    inside = (at - ends[index]) / np.where(weights[index] > 0, weights[index], 1.0)
    return index, np.clip(inside, 0.0, 1.0)
