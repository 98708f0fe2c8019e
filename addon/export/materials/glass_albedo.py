"""The directional albedo of rough glass whose microfacets scatter light once, and what glass is
times where they scatter it until it is out: one over that, as in Cycles (Turquin 2019, Practical
multiple scattering compensation for microfacet models).
"""

from __future__ import annotations

import functools

import numpy as np

from ....engine.program.graph import Value
from ....engine.program.operations_vector import VectorMeasure
from ....engine.program.table import BY_NAME
from .evaluator import NodeView
from .roughness import ROUGHNESS, between, width
from .terms import ONE, Sum
from .varying import Ior, Of, Roughness

Array = np.ndarray

ROWS = 48
"""Of tables over the root of n·v, evenly from 0 to 1."""
RINGS, TURNS = 16, 16
"""Half vectors for each of them."""
SHAPES = 3
"""Products of a function of the view and one of roughness that stand for one of both: within 4 %
but for grazing views, on average within 1 %.
"""
_PLACES = ROUGHNESS.tolist()


def directional_albedo(roughness: float, index: float) -> Array:
    """(ROWS,) the shares of uniform light that GGX reflects and refracts once. index: of refraction
    beyond the surface, over that before it.
    """
    alpha, cosine = width(roughness), np.linspace(0, 1, ROWS)[:, None] ** 2
    cosine = np.maximum(cosine, 1e-4)
    v = np.stack([np.sqrt(1 - cosine * cosine), np.zeros_like(cosine), cosine])
    h = _seen_half_vectors(alpha, v)
    vh = np.clip((v * h).sum(0), 0.0, 1.0)
    sine2 = (1 - vh * vh) / (index * index)
    inner = np.sqrt(np.maximum(1 - sine2, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        across = (vh - index * inner) / (vh + index * inner)
        along = (index * vh - inner) / (index * vh + inner)
    back = np.where(sine2 < 1, 0.5 * (across * across + along * along), 1.0)
    mirrored = 2 * vh * h[2] - v[2]
    refracted = (vh / index - inner) * h[2] - v[2] / index
    shown = back * _shown(alpha, cosine, mirrored)
    return np.mean(shown + (1 - back) * _shown(alpha, cosine, -refracted), 1)


def _seen_half_vectors(alpha: float, v: Array) -> Array:
    """(3, rows, RINGS · TURNS) as densely as they are seen from v (3, rows, 1) (Heitz 2018,
    Sampling the GGX Distribution of Visible Normals).
    """
    share, turn = np.meshgrid((np.arange(RINGS) + 0.5) / RINGS, (np.arange(TURNS) + 0.5) / TURNS)
    r, angle = np.sqrt(share.ravel()), 2 * np.pi * turn.ravel()
    x, y = r * np.cos(angle), r * np.sin(angle)
    s = np.stack([alpha * v[0], v[1], v[2]]) / np.hypot(alpha * v[0], v[2])
    bent = 0.5 * (1 + s[2])
    up = (1 - bent) * np.sqrt(np.maximum(1 - x * x, 0.0)) + bent * y
    out = np.sqrt(np.maximum(1 - x * x - up * up, 0.0))
    # across is (0, 1, 0), and up's direction s × across
    h = np.stack([alpha * (out * s[0] - up * s[2]), alpha * x + 0 * up, up * s[0] + out * s[2]])
    return h / np.sqrt((h * h).sum(0))


def _shown(alpha: float, seen: Array, leaving: Array) -> Array:
    """Smith's shadowing and masking over the masking; 0 behind the side that light leaves on."""
    out = np.clip(leaving, 0.0, 1.0)
    by_view, by_light = (np.sqrt(c * c + alpha * alpha * (1 - c * c)) for c in (seen, out))
    return (seen + by_view) * out / (by_view * out + by_light * seen)


@functools.lru_cache(maxsize=256)
def _lacking(roughness: float, index: float) -> tuple[float, ...]:
    """(ROWS,) what is scattered again over what leaves at once."""
    return tuple((1 / directional_albedo(roughness, index) - 1).tolist())


@functools.lru_cache(maxsize=32)
def _shapes(index: float) -> tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]:
    """The same as a sum of SHAPES products of two functions: (ROWS,), and over `ROUGHNESS`."""
    rows = np.array([_lacking(float(roughness), index) for roughness in ROUGHNESS])
    left, sizes, right = np.linalg.svd(rows, full_matrices=False)
    return tuple(
        (tuple(right[k].tolist()), tuple((left[:, k] * sizes[k]).tolist())) for k in range(SHAPES)
    )


def _at_roughness(values: tuple[float, ...], roughness: float) -> float:
    """values: at `ROUGHNESS`."""
    return between(roughness, _PLACES, values)


def scattered_until_out(view: NodeView, roughness: Roughness, ior: Ior) -> Sum:
    """What rough glass is times that scatters light until it is out. Light that passes it straight
    on is not scattered, so that it is 1 for that.
    """
    if roughness.is_mirror():
        return ONE
    expressions = view.evaluator.expressions
    do, math = expressions.apply, expressions.math
    normal = view.evaluator.normal_at(view.input("Normal"))
    cosine = do("vector_measure", do("incoming"), normal, measure=VectorMeasure.DOT_PRODUCT)
    place = math("SQRT", math("MINIMUM", math("ABSOLUTE", cosine), 1.0))
    outside, inside = (
        _lacking_at(view, place, roughness, index) for index in (ior.number, 1 / ior.number)
    )
    turned = math("MULTIPLY", do("backfacing"), math("SUBTRACT", inside, outside))
    shadow = expressions.graph.apply(BY_NAME["light_path"])[1]
    lacking = math("MULTIPLY", math("ADD", outside, turned), math("SUBTRACT", 1.0, shadow))
    return expressions.sum_of(math("ADD", 1.0, lacking))


def _lacking_at(view: NodeView, place: Value, roughness: Roughness, index: float) -> Value:
    """`_lacking` at the root of n·v."""
    expressions = view.evaluator.expressions
    if not roughness.varies:
        return expressions.looked_up(place, _lacking(roughness.value, index))
    total = expressions.constant(0.0)
    for by_view, by_roughness in _shapes(index):
        share = expressions.number(
            expressions.value_of(roughness.number(Of(_at_roughness, (by_roughness,))))
        )
        product = expressions.math("MULTIPLY", expressions.looked_up(place, by_view), share)
        total = expressions.math("ADD", total, product)
    return total
