"""Lights seen in a mirror: shape and radiance as Cycles shows them."""

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint_picture import BACKENDS, render_pair, same_around, verdict

LAMPS = {
    "point": ("POINT", {"energy": 100.0, "shadow_soft_size": 0.4}),
    "spot": ("SPOT", {"energy": 100.0, "shadow_soft_size": 0.4, "spot_size": 2.0}),
    "rectangle": ("AREA", {"energy": 100.0, "shape": "RECTANGLE", "size": 1.0, "size_y": 0.5}),
    "ellipse": ("AREA", {"energy": 100.0, "shape": "ELLIPSE", "size": 1.0, "size_y": 0.5}),
    "slats": ("AREA", {"energy": 100.0, "size": 1.0, "spread": 2.5}),
    "sun": ("SUN", {"energy": 2.0, "angle": 0.3}),
}
MIRRORED_VIEW = (-4.2, 5.6, 4.0)
"""Where the default camera's view of the origin goes after a level mirror."""


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("lamp", LAMPS)
def test_lamp_in_a_mirror(lamp, backend):
    kind, properties = LAMPS[lamp]
    scene = cycles.empty_scene(96, 96)
    build.add(scene, "Mirror", build.plane(4.0, build.mirror((0.9, 0.8, 0.7))))
    build.add_camera(scene)
    build.add_light(scene, kind, MIRRORED_VIEW if kind == "SUN" else (-1.5, 2.0, 3.0), **properties)
    pair = render_pair(scene, backend, f"lamp-{lamp}", bounces=1)
    truth, picture = (color.astype(float) for color in pair.colors())
    seen, seen_here = truth.sum(-1) > 0, picture.sum(-1) > 0
    assert seen.sum() > 40
    verdict(pair, "shape", (seen != seen_here) & same_around(seen), 0)
    both = seen & seen_here
    verdict(pair, "radiance", np.abs(picture - truth).max(-1) / truth.max() * both, 1e-5)
