"""Rays that are asked of a scene's geometry."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

Array = np.ndarray


class RayBatch(NamedTuple):
    """Checked rays of one dtype, float32 or float64, C-contiguous. origins, directions: (n, 3), or
    (1, 3) for all n.  t_min, t_max: (n,), or (1,) for all.  size: n.  visibility: one of
    `accelerator.KINDS`, or None for whatever any kind of ray sees.
    """

    origins: Array
    directions: Array
    t_min: Array
    t_max: Array
    size: int
    visibility: str | None
