"""A white plane below lamps, and what the core gives there."""

from __future__ import annotations

import numpy as np

from glint.engine import scene as s
from native_tools import (
    constant,
    material,
    pixel_centers,
    placed,
    square,
    view_from_above,
)

WHITE = material(s.Lobe("DIFFUSE", constant(1.0)))
TINT = np.array([0.9, 0.5, 0.2])
P = pixel_centers()
UP = np.array([0.0, 0.0, 1.0])
# Combined is rounded to float32 once; the rest is double.
ROUNDING = 2.0**-23


def plane(
    *lights: s.Light, extra: tuple[s.Instances, ...] = (), geometries=(), materials=(), **more
) -> s.Scene:
    return s.Scene(
        view_from_above(),
        (square(), *geometries),
        (placed(), *extra),
        (WHITE, *materials),
        (),
        lights,
        **more,
    )


def agree(measured: np.ndarray, truth: np.ndarray, rounding: float = ROUNDING) -> None:
    assert truth.max() > 0
    assert (np.abs(measured - truth) <= rounding * np.abs(truth) + 1e-30).all()


def unit(a: np.ndarray) -> np.ndarray:
    return a / np.linalg.norm(a, axis=-1, keepdims=True)
