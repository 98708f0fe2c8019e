"""Camera rays that light does not follow tell how much of a pixel shows what (SEMANTICS.md,
"Visibility samples").
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from engine import test_path_bounces as bounces

from glint import engine
from glint.engine import scene as s
from glint.engine.film import LIGHTING, OCCLUSION, PARTS

PLAN = {"samples": 4, "visibility_samples": 3, "soft_light": "RESOLVED", "filter_width": 1.5}
PASSES = frozenset({*PARTS, *LIGHTING, OCCLUSION})
SCENES = {name: bounces.SCENES[name] for name in bounces.SCENES}


@pytest.mark.parametrize("name", SCENES)
def test_both_tracers_draw_the_same(name: str) -> None:
    scene = SCENES[name]()
    core, reference = (
        bounces.film(scene, 1, backend, passes=PASSES, **bounces.PLAN | PLAN).passes
        for backend in bounces.BACKENDS
    )
    for key, values in reference.items():
        near = 1e-4 * (np.abs(values) + np.abs(values).mean() + 1e-6)
        apart = (np.abs(core[key] - values) > near).any(-1).mean()
        print(key, apart)
        assert apart <= bounces.EDGES, key
