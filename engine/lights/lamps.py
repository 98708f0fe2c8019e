"""Many lamps: which share the shadow rays of a sample, and in which order (SEMANTICS.md, Many
lamps).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..scene import Light
from .mesh_lights import along_a_curve

if TYPE_CHECKING:
    from ..settings import Settings

MOST_RAYS = 4096
"""That lamps share at a point in a pixel's sample."""
SORTED = 16
"""So many lamps at most stay in the order in which they came."""
FIRST_MARK = 0.3819660112501051
"""Where the first mark of the first sample is: no mark falls between two of a few lamps alike."""
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


def first_mark(sample: int) -> float:
    """Where in [0, 1) between two marks the first one of a pixel's sample is: of n samples each in
    another of n places (van der Corput's sequence).
    """
    reversed_ = int(f"{sample:032b}"[::-1], 2)
    return (reversed_ * 2.0**-32 + FIRST_MARK) % 1.0


def in_order(lights: tuple[Light, ...]) -> tuple[Light, ...]:
    """The same, but many lamps along a curve through space, those that light from afar first: what
    hides one hides its neighbours, so that marks even in their row are even in what they see.
    """
    lamps = [light for light in lights if light.kind in LAMPS]
    if len(lamps) <= SORTED:
        return lights
    near = [light for light in lamps if light.kind != "SUN"]
    places = np.array([light.world_from_light[:, 3] for light in near], np.float64)
    order = along_a_curve(places.reshape(-1, 3)) if len(near) > 1 else range(len(near))
    return (
        *(light for light in lamps if light.kind == "SUN"),
        *(near[k] for k in order),
        *(light for light in lights if light.kind not in LAMPS),
    )
