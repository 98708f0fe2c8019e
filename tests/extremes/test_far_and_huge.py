"""N3 and N5: the same picture anywhere and at any size."""

from __future__ import annotations

import numpy as np
import pytest

import extreme_scenes as extreme
from glint_picture import render_glint
from measuring import largest_error, measure, wrong_pixels
from truth import true_picture

DIRECTION = np.array([1.0, -0.7, 0.4])


@pytest.mark.parametrize("exponent", [3, 4, 5, 6, 7])
def test_far_from_the_origin(exponent, rows):
    """N3: object, camera and light moved to 10^k; no wrong pixel, and at most twice the largest
    error at the origin.
    """
    at_home = extreme.still_life()
    home = render_glint(at_home, "NATIVE").combined
    truth = true_picture(at_home)
    own = largest_error(home, truth, ~wrong_pixels(home, truth))
    scene = extreme.still_life(shift=np.round(10.0**exponent * DIRECTION))
    row = measure(rows, "N3", f"all moved to 1e{exponent}", scene, true_picture(scene))
    assert row.glint == 0
    assert row.glint_error <= 2 * own


@pytest.mark.parametrize("exponent", [-6, -3, 0, 3, 6, 8, 10, 15])
def test_any_scale(exponent, rows):
    """N5: 1e-6 to 1e15."""
    scale = 10.0**exponent
    scene = extreme.still_life(scale)
    row = measure(rows, "N5", f"all scaled by 1e{exponent}", scene, true_picture(scene, scale))
    assert row.glint == 0
