"""Six materials of many nodes beside Cycles' pictures of them, direct light alone."""

from __future__ import annotations

import numpy as np
import pytest

from glint_picture import render_pair, surface_interior
from node_scenes import MATERIALS, show


@pytest.mark.parametrize("build", MATERIALS, ids=lambda build: build.__name__)
def test_picture_is_that_of_cycles(build):
    """Up to 2 % of the light on all but one pixel of a hundred: edges inside of patterns."""
    scene = show(build, 96, 96)
    pair = render_pair(scene, "NATIVE", build.__name__)
    found, wanted = pair.colors()
    inside = surface_interior(pair.cycles, bend=2.0)
    assert inside.sum() > 1000
    error = np.abs(found - wanted).max(-1)[inside]
    assert np.mean(error > 0.02) <= 0.01, f"{np.mean(error > 0.02):.3f}, {np.sort(error)[-5:]}"
