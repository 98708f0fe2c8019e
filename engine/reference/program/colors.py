"""Operations on colours (3, n), float64."""

from __future__ import annotations

import numpy as np


def rgb_to_bw(color: np.ndarray) -> np.ndarray:
    """Rec. 709 luminance, as Cycles has it for its default working space."""
    return 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]
