"""Light that surfaces let through in all directions: what is matt on their other sides
(semantics/lobes.md).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..linear.columns import pick
from .coefficients import Coefficients
from .paths import Interaction
from .stage import Stage
from .surface import surface_at

Array = np.ndarray


def other_side(stage: Stage, at: Interaction, depth: Array) -> Interaction:
    """Those of the points which let light through, as rays meet them that come the other way: with
    DIFFUSE lobes in place of their TRANSLUCENT ones, and nothing else. depth: (m,) of the rays.
    """
    some = np.flatnonzero(at.coefficients.translucent.any(0))
    hit, surface = at.hit[some], at.surface.take(some)
    found = surface_at(
        stage.geometry,
        stage.attributes,
        at.paths.rays,
        hit,
        surface.primitive,
        depth[some],
        stage.cancellation,
        backwards=True,
    )
    n, bump = stage.shader.lifted(surface)
    turned = replace(
        surface,
        g=-surface.g,
        n=-n,
        start=found.start,
        unbent=-surface.unbent,
        bump=bump,
        lowering=np.ones(len(some)),
    )
    none = np.zeros((3, len(some)))
    matt = pick(at.coefficients.translucent, some)
    lobes = Coefficients(none, matt, none, none, none, none, [], [], [], [], [])
    return Interaction(at.paths, hit, turned, lobes)
