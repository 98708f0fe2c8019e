"""Many lamps: which share the shadow rays of a sample, and in which order
(semantics/many_lamps.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from ..scene import EVERYTHING, Light
from ..settings import Settings
from .mesh_lights import along_a_curve, curve_codes

Array = np.ndarray

MOST_RAYS = 4096
"""That lamps share at a point in a pixel's sample."""
SORTED = 16
"""So many lamps at most stay in the order in which they came."""
FIRST_MARK = 0.3819660112501051
"""Where the first mark of the first sample is: no mark falls between two of a few lamps alike."""
SEEN_EACH = 64
"""So many lamps at most are never seen in clusters."""
LAMPS = ("POINT", "SPOT", "SUN", "AREA")


def may_share(light: Light) -> bool:
    """Whether it shares shadow rays where there are many lamps: it casts shadows, and has no
    program.
    """
    return light.kind in LAMPS and light.cast_shadow and light.program is None


def is_soft(light: Light) -> bool:
    """Whether it is a lamp that has an extent to sample."""
    if light.kind not in LAMPS:
        return False
    if light.kind == "AREA":
        return light.size_x > 0 or light.size_y > 0
    return light.angle > 0 if light.kind == "SUN" else light.radius > 0


def is_clustered(light: Light) -> bool:
    """Whether it is one of those that far points see in clusters: a POINT lamp that lights all."""
    if light.kind != "POINT" or not may_share(light) or light.receivers != EVERYTHING:
        return False
    color = [channel * light.strength for channel in light.color]
    return bool(light.lights_matt and light.lights_gloss and min(color) >= 0 and any(color))


def cluster_levels(lights: Sequence[Light]) -> Array:
    """(n,) int32: for lamps that are seen in clusters, at which level of a tree along Morton's
    curve they are parted from the one before them (the first bit in which their codes and then
    their numbers differ), 0 for the first of a light group, which has a tree of its own; -1 for all
    lights where these are few, and for others.
    """
    levels = np.full(len(lights), -1, np.int32)
    numbers = [k for k, light in enumerate(lights) if is_clustered(light)]
    if len(numbers) <= SEEN_EACH:
        return levels
    for _, group in groupby(numbers, lambda k: lights[k].light_group):
        first, *others = lamps = list(group)
        places = np.array([lights[k].world_from_light[:, 3] for k in lamps], np.float64)
        codes = [(int(code) << 32) + k for k, code in enumerate(curve_codes(places))]
        levels[first] = 0
        for number, before, code in zip(others, codes, codes[1:], strict=False):
            levels[number] = (before ^ code).bit_length()
    return levels


def shared_samples(lights: Sequence[Light], settings: Settings) -> int:
    """How many samples of lamps share the shadow rays of a pixel's sample; 0 where each has its
    own.
    """
    lamps = [light for light in lights if may_share(light)]
    if not 0 < 2 * settings.lamp_shadows < len(lamps):
        return 0
    return sum(settings.light_samples if is_soft(light) else 1 for light in lamps)


def shared_rays(lights: Sequence[Light], settings: Settings) -> int:
    """How many shadow rays they share: Lamp Shadows for each of the samples of a soft one."""
    if not shared_samples(lights, settings):
        return 0
    soft = any(is_soft(light) for light in lights if may_share(light))
    return min(settings.lamp_shadows * (settings.light_samples if soft else 1), MOST_RAYS)


def sharing_stats(lights: Sequence[Light], settings: Settings) -> dict[str, float]:
    """For `Film.stats`: a feature where lamps share shadow rays."""
    return {"feature: shared lamp shadows": 1.0} if shared_samples(lights, settings) else {}


def group_stats(light_groups: Sequence[str]) -> dict[str, float]:
    """For `Film.stats`: a feature where light is told apart by groups."""
    count = len(light_groups)
    return {f"feature: {count} light group{'s' if count > 1 else ''}": 1.0} if count else {}


def first_mark(sample: int) -> float:
    """Where in [0, 1) between two marks the first one of a pixel's sample is: of n samples each in
    another of n places (van der Corput's sequence).
    """
    reversed_ = int(f"{sample:032b}"[::-1], 2)
    return (reversed_ * 2.0**-32 + FIRST_MARK) % 1.0


def in_order(lights: tuple[Light, ...]) -> tuple[Light, ...]:
    """The same, but many lamps along a curve through space: what hides one hides its neighbours, so
    that marks even in their row are even in what they see. Those that light from afar are first,
    those that may be seen in clusters last, light group by light group.
    """
    lamps = [light for light in lights if light.kind in LAMPS]
    if len(lamps) <= SORTED:
        return lights
    near = [light for light in lamps if light.kind != "SUN"]
    clustered = [light for light in near if is_clustered(light)]
    if len(clustered) > SEEN_EACH:
        clustered.sort(key=lambda light: light.light_group)
        parts = [list(group) for _, group in groupby(clustered, lambda light: light.light_group)]
    else:
        parts = [clustered]
    return (
        *(light for light in lamps if light.kind == "SUN"),
        *_along_curve([light for light in near if not is_clustered(light)]),
        *(light for part in parts for light in _along_curve(part)),
        *(light for light in lights if light.kind not in LAMPS),
    )


def _along_curve(lamps: list[Light]) -> list[Light]:
    if len(lamps) < 2:
        return lamps
    places = np.array([light.world_from_light[:, 3] for light in lamps], np.float64)
    return [lamps[k] for k in along_a_curve(places)]
