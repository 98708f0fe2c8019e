"""Light that surfaces let through in all directions: what is matt on their other sides
(SEMANTICS.md, TRANSLUCENT).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .materials import Coefficients
from .paths import Paths
from .surface import Surface, surface_at
from .vectors import pick

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray


def other_side(
    stage: Stage,
    paths: Paths,
    hit: Array,
    depth: Array,
    surface: Surface,
    coefficients: Coefficients,
) -> tuple[Array, Surface, Coefficients]:
    """Those of the points that the rays `hit` meet at `depth` which let light through, as rays meet
    them that come the other way: with DIFFUSE lobes in place of their TRANSLUCENT ones, and nothing
    else.
    """
    some = np.flatnonzero(coefficients.translucent.any(0))
    hit, surface = hit[some], surface.take(some)
    found = surface_at(
        stage.geometry,
        stage.attributes,
        paths.rays,
        hit,
        surface.primitive,
        depth[some],
        stage.cancellation,
        backwards=True,
    )
    n, bump = stage.shader.lifted(surface)
    turned = replace(
        surface, g=-surface.g, n=-n, start=found.start, unbent=-surface.unbent, bump=bump
    )
    none = np.zeros((3, len(some)))
    matt = pick(coefficients.translucent, some)
    return hit, turned, Coefficients(none, matt, none, none, none, [], [], [], [], [])
