"""White noise and fractal Perlin noise in one to four dimensions, as Cycles (kernel/svm).

Points are (d, n) float64. Lattice hashes are those of integers; seeds of offsets are hashed
as float32.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from itertools import product
from operator import add, mul

import numpy as np

from ..operations_noise import NoiseType
from .hashing import hash_color, hash_integers, hash_numbers

SIGNED_SCALES = {
    1: 0.25,
    2: 0.6616,
    3: 0.982,
    4: 0.8344,
}  # to about [-1, 1], found by the OSL developers


def coordinates(vector: np.ndarray, w: np.ndarray, dimensions: int) -> np.ndarray:
    """The (d, n) point of a texture: W alone, XY, XYZ or XYZW."""
    if dimensions == 1:
        return np.asarray(w, np.float64)[None]
    if dimensions == 4:
        return np.concatenate([vector, np.asarray(w, np.float64)[None]])
    return np.asarray(vector[:dimensions], np.float64)


def white_noise(
    vector: np.ndarray, w: np.ndarray, *, dimensions: int
) -> tuple[np.ndarray, np.ndarray]:
    """Value (n,) and colour (3, n) of the float32 bits of the coordinates."""
    color = hash_color(*coordinates(vector, w, dimensions))
    return color[0], color


def _gradient(word: np.ndarray, to_point: list[np.ndarray]) -> np.ndarray:
    """Dot product of the gradient that the hash `word` picks with the way to the point."""

    def signed(value: np.ndarray, bit: int) -> np.ndarray:
        return np.where(word & np.uint32(bit), -value, value)

    dimensions = len(to_point)
    if dimensions == 1:
        return signed(1.0 + (word & np.uint32(7)), 8) * to_point[0]
    x, y, *rest = to_point
    if dimensions == 2:
        first = (word & np.uint32(7)) < 4
        return signed(np.where(first, x, y), 1) + signed(2.0 * np.where(first, y, x), 2)
    if dimensions == 3:
        h = word & np.uint32(15)
        third = np.where((h == 12) | (h == 14), x, rest[0])
        return signed(np.where(h < 8, x, y), 1) + signed(np.where(h < 4, y, third), 2)
    h = word & np.uint32(31)
    z, w = rest
    return (
        signed(np.where(h < 24, x, y), 1)
        + signed(np.where(h < 16, y, z), 2)
        + signed(np.where(h < 8, z, w), 4)
    )


_CORNERS = {
    d: np.array(list(product((0, 1), repeat=d)), np.float64)[..., None] for d in range(1, 5)
}
"""(2^d, d, 1): the corners of a cell."""
_CHUNK = 4096
"""Points that are worked on at a time, all corners together: few operations, in the cache."""


def perlin(p: np.ndarray) -> np.ndarray:
    """Perlin's gradient noise (n,) at the points (d, n), not scaled."""
    chunks = range(0, p.shape[1], _CHUNK)
    return np.concatenate([np.zeros(0), *(_perlin(p[:, k : k + _CHUNK]) for k in chunks)])


def _perlin(p: np.ndarray) -> np.ndarray:
    far, cell = _CORNERS[len(p)], np.floor(p)
    local = p - cell
    weight = local**3 * (local * (local * 6.0 - 15.0) + 10.0)
    shares = np.where(far, weight, 1.0 - weight).swapaxes(0, 1)
    words = hash_integers(*(cell + far).swapaxes(0, 1))
    parts = reduce(mul, shares) * _gradient(words, list((local - far).swapaxes(0, 1)))
    return reduce(add, parts, np.zeros(p.shape[1]))  # corner by corner, whatever their number


def signed_noise(p: np.ndarray) -> np.ndarray:
    """Perlin noise (n,) in about [-1, 1], repeated every 100000 units.

    From a million units on it is read half a unit aside, as Cycles does.
    """
    wrapped = np.fmod(p, 100000.0) + np.where(np.abs(p) >= 1e6, 0.5, 0.0)
    return SIGNED_SCALES[len(p)] * perlin(wrapped)


def fbm(p: np.ndarray, detail, roughness, lacunarity, normalize: bool) -> np.ndarray:
    """Sum of octaves; normalised it is divided by the sum of amplitudes, 0 where these cancel out,
    and brought to [0, 1].
    """
    total, most, value = (np.zeros(p.shape[1]) for _ in range(3))
    amplitude = np.ones(p.shape[1])
    for share in _shares(detail):
        total, most = total + signed_noise(p) * amplitude, most + amplitude
        mean = np.where(most != 0.0, total / np.where(most != 0.0, most, 1.0), 0.0)
        value = value + share * ((mean if normalize else total) - value)
        amplitude, p = amplitude * roughness, p * lacunarity
    return 0.5 * value + 0.5 if normalize else value


def _octaves(detail: np.ndarray) -> int:
    """Octaves that any of the points needs, the one of the fraction included."""
    return int(np.ceil(np.max(detail, initial=0.0))) + 1


def _shares(detail: np.ndarray, first: int = 0):
    """Share (n,) of each octave from `first` on: 1 for whole ones, then the detail's fraction."""
    for octave in range(first, _octaves(detail)):
        yield np.clip(detail - octave + 1.0, 0.0, 1.0)


def multifractal(p: np.ndarray, detail, roughness, lacunarity, offset, gain) -> np.ndarray:
    """Product of octaves 1 + noise · roughness^i."""
    value, power = np.ones(p.shape[1]), np.ones(p.shape[1])
    for share in _shares(detail):
        value = value * (share * power * signed_noise(p) + 1.0)
        power, p = power * roughness, p * lacunarity
    return value


def hetero_terrain(p: np.ndarray, detail, roughness, lacunarity, offset, gain) -> np.ndarray:
    """Octaves weighted by the height so far: valleys are smooth."""
    value, power = offset + signed_noise(p), roughness
    for share in _shares(detail, 1):
        p = p * lacunarity
        value = value + share * (signed_noise(p) + offset) * power * value
        power = power * roughness
    return value


def hybrid_multifractal(p: np.ndarray, detail, roughness, lacunarity, offset, gain) -> np.ndarray:
    """Octaves weighted by the signal before; a point whose weight falls to 0.001 is done."""
    value, power, weight = np.zeros(p.shape[1]), np.ones(p.shape[1]), np.ones(p.shape[1])
    for share in _shares(detail):
        going = weight > 0.001
        weight = np.minimum(weight, 1.0)
        signal = (signed_noise(p) + offset) * power
        value = np.where(going, value + share * weight * signal, value)
        weight = np.where(going, weight * gain * signal, 0.0)
        power, p = power * roughness, p * lacunarity
    return value


def ridged_multifractal(p: np.ndarray, detail, roughness, lacunarity, offset, gain) -> np.ndarray:
    """Octaves (offset − |noise|)², weighted by the one before; whole octaves only, as Cycles."""
    power = roughness
    signal = (offset - np.abs(signed_noise(p))) ** 2
    value = signal
    for octave in range(1, _octaves(detail)):
        p = p * lacunarity
        weight = np.clip(signal * gain, 0.0, 1.0)
        signal = (offset - np.abs(signed_noise(p))) ** 2 * weight
        value = value + np.where(octave <= detail, signal * power, 0.0)
        power = power * roughness
    return value


_FRACTALS: dict[NoiseType, Callable[..., np.ndarray]] = {
    NoiseType.MULTIFRACTAL: multifractal,
    NoiseType.HYBRID_MULTIFRACTAL: hybrid_multifractal,
    NoiseType.RIDGED_MULTIFRACTAL: ridged_multifractal,
    NoiseType.HETERO_TERRAIN: hetero_terrain,
}


def _seed_offset(seed: int, dimensions: int) -> np.ndarray:
    """Offset (d, 1) in [100, 200] that stands for a seed, a float32 as in Cycles."""
    hashes = [
        hash_numbers([seed]) if dimensions == 1 else hash_numbers([seed], [axis])
        for axis in range(dimensions)
    ]
    return (100.0 + np.stack(hashes) * 100.0).astype(np.float32).astype(np.float64)


def noise_texture(
    vector,
    w,
    scale,
    detail,
    roughness,
    lacunarity,
    offset,
    gain,
    distortion,
    *,
    dimensions: int,
    noise_type: int,
    normalize: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Factor (n,) and Color (3, n) of the Noise Texture node; all arguments (n,), vector (3, n).

    Detail is clamped to [0, 15], roughness to 0 and more. Some types read no offset or gain.
    """
    p = coordinates(vector, w, dimensions) * scale
    detail, roughness = np.clip(detail, 0.0, 15.0), np.maximum(roughness, 0.0)
    if np.any(distortion):
        moves = [
            signed_noise(p + _seed_offset(axis, dimensions)) * distortion
            for axis in range(dimensions)
        ]
        p = p + np.stack(moves)
    seeds = [_seed_offset(dimensions + extra, dimensions) for extra in range(2)]
    p = np.concatenate([p, *(p + seed for seed in seeds)], 1)  # all three at once
    octaves = [np.tile(x, 3) for x in (detail, roughness, lacunarity)]
    if noise_type == NoiseType.FBM:
        found = fbm(p, octaves[0], octaves[1], octaves[2], bool(normalize))
    else:
        shifts = (np.tile(x, 3) for x in (offset, gain))
        found = _FRACTALS[NoiseType(noise_type)](p, *octaves, *shifts)
    color = found.reshape(3, -1)
    return color[0], color
