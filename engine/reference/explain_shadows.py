"""What stands between a point and a light."""

from __future__ import annotations

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import dot, length, unit
from .closures import Term
from .lights import LightSample, Source
from .lobe_light import ways_through
from .rays import IncoherentRays
from .stage import Stage
from .terminator import start_towards
from .visibility import NOTHING

Array = np.ndarray


def shadow_of(
    stage: Stage, surface: Surface, source: Source, sample: LightSample, terms: list[Term]
) -> tuple[Array, str, float]:
    """S, and the first thing that stands between the point and the light's sample."""
    if not source.light.cast_shadow:
        return np.ones(3), "", np.inf
    shadows = stage.lighting.shadows_of(source)
    seen = np.zeros(1, np.intp)
    through = ways_through(surface, terms, seen, sample)
    shadow = shadows.towards(surface, seen, sample, through)[0]
    if (shadow == 1).all():
        return shadow, "", np.inf
    origin = start_towards(surface, seen, sample.direction)
    towards = sample.direction if sample.end is None else sample.end - origin
    beside = np.where(dot(surface.g, towards) < 0, -1.0, 1.0)
    start = origin + beside * surface.offset * surface.g
    start = start + (0.0 if through is None else through) * sample.direction
    far = (
        np.array([np.inf])
        if sample.end is None
        else length(sample.end - start) - sample.short * np.abs(sample.end).max(0)
    )
    direction = sample.direction if sample.end is None else unit(sample.end - start)
    met_by = shadows.met_by(sample.met_by)
    found = met_by.first_met(IncoherentRays.of(start, direction, np.zeros(1), far))
    if found.primitive[0] == NOTHING:
        return shadow, "", np.inf
    row = stage.geometry.row[found.primitive[0]]
    name = stage.scene.instances[int(stage.geometry.placements.block[row])].name
    return shadow, name, float(found.depth[0])
