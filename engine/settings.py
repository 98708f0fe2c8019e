"""How to render: everything a picture depends on that is not the scene."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from .film import PASSES

ILLUMINATIONS = ("PHYSICAL", "CLASSIC")
WORLD_LIGHTS = ("OCCLUDED", "CONSTANT")
DOME_SHARE = 8
"""Directions of a DOME light for each sample of another light: the sky is all round, lamps are not.
"""
BACKENDS = ("NATIVE", "NUMPY")
BUILDS = ("FAST", "BALANCED", "FINE")
"""Ways to build the core's trees, in the order of their time."""
ACCELERATIONS = ("AUTO", *BUILDS)
MOST_LIGHT_POINTS = 1 << 23
"""Largest samples × light_samples: the table of points on the lights is made before the first ray.
"""


@dataclass(frozen=True)
class Settings:
    """Render settings.

    samples: per pixel; one goes through the pixel's centre.
    error_threshold: largest visible error that is good enough, in 8-bit levels of an sRGB screen
    (SEMANTICS.md, Refinement). A pixel
        whose estimated error is smaller after a wave of 4, 8, 16 … samples takes no more; 0 gives
        all samples to all pixels.
    light_samples: per soft light and pixel sample; 1 is the notes' hard shadow from the light's
    centre. max_bounces: depth of mirror and refraction rays; 0 traces none. cutoff: mirror and
    refraction rays that weigh less (the largest of red, green and blue of what they carry to the
    pixel) are not
        traced; 0 traces all.
    illumination, backend: one of ILLUMINATIONS, BACKENDS.
    world_light: one of WORLD_LIGHTS: whether surfaces hide the world's light from each other. With
    CLASSIC illumination they do not.
    acceleration: one of ACCELERATIONS: how much time the core's trees may take to build, and how
    little its rays. AUTO builds BALANCED
        ones. Never changes a bit of the picture.
    threads: 0 for one per core. Never changes a bit of the picture.
    filter_width: Blender's pixel filter size in pixels (the Blackman-Harris window spans twice
    that); 0 samples the centre only. passes: names from `film.PASSES` beyond Combined. region: (x0,
    y0, x1, y1) half-open pixel rectangle of the full frame, origin bottom left; None for all of it.
    """

    samples: int = 16
    error_threshold: float = 0.0
    light_samples: int = 4
    max_bounces: int = 4
    cutoff: float = 0.0
    illumination: str = "PHYSICAL"
    world_light: str = "OCCLUDED"
    backend: str = "NATIVE"
    acceleration: str = "AUTO"
    threads: int = 0
    filter_width: float = 1.5
    passes: frozenset[str] = frozenset()
    region: tuple[int, int, int, int] | None = None

    def __post_init__(self) -> None:
        """NumPy's whole numbers become Python's, and names of passes a set."""
        for name in _WHOLE:
            if _is_whole(value := getattr(self, name)):
                object.__setattr__(self, name, int(value))
        if isinstance(self.passes, (set, list, tuple)):
            object.__setattr__(self, "passes", frozenset(self.passes))

    @property
    def occludes_world(self) -> bool:
        """Whether the world's light is one that surfaces hide."""
        return self.illumination == "PHYSICAL" and self.world_light == "OCCLUDED"

    @property
    def dome_samples(self) -> int:
        """Directions of a DOME light for each sample of a pixel."""
        return DOME_SHARE * self.light_samples

    def problems(self) -> list[str]:
        """What is wrong with these settings, one sentence each."""
        strange = [
            f"{name} is {getattr(self, name)!r}: use a whole number"
            for name in _WHOLE
            if not _is_whole(getattr(self, name))
        ]
        strange += [
            f"{name} is {getattr(self, name)!r}: use a number"
            for name in _REAL
            if not isinstance(getattr(self, name), Real)
        ]
        if not isinstance(self.passes, frozenset):
            strange.append(f"passes is {self.passes!r}: use a set of names")
        if strange:
            return strange
        unknown = sorted(str(name) for name in self.passes if name not in PASSES)
        rules = (
            (self.samples >= 1, f"samples is {self.samples}: use at least 1"),
            (
                0 <= self.error_threshold < 256,
                f"error_threshold is {self.error_threshold}: use 0 (off) or up to 255 levels",
            ),
            (self.light_samples >= 1, f"light_samples is {self.light_samples}: use at least 1"),
            (
                self.samples * self.light_samples <= MOST_LIGHT_POINTS,
                f"samples × light_samples is {self.samples * self.light_samples}: use at most "
                f"{MOST_LIGHT_POINTS}",
            ),
            (0 <= self.max_bounces <= 64, f"max_bounces is {self.max_bounces}: use 0 to 64"),
            (0 <= self.cutoff <= 1, f"cutoff is {self.cutoff}: use 0 (off) to 1"),
            (
                self.illumination in ILLUMINATIONS,
                f"illumination {self.illumination!r} is not one of {', '.join(ILLUMINATIONS)}",
            ),
            (
                self.world_light in WORLD_LIGHTS,
                f"world_light {self.world_light!r} is not one of {', '.join(WORLD_LIGHTS)}",
            ),
            (
                self.backend in BACKENDS,
                f"backend {self.backend!r} is not one of {', '.join(BACKENDS)}",
            ),
            (
                self.acceleration in ACCELERATIONS,
                f"acceleration {self.acceleration!r} is not one of {', '.join(ACCELERATIONS)}",
            ),
            (self.threads >= 0, f"threads is {self.threads}: use 0 (all cores) or more"),
            (
                0 <= self.filter_width <= 100,
                f"filter_width is {self.filter_width}: use 0 to 100 pixels",
            ),
            (not unknown, f"no such pass: {', '.join(unknown)}"),
            (
                self.region is None or _is_region(self.region),
                f"region is {self.region!r}: use whole numbers 0 <= x0 < x1 and 0 <= y0 < y1",
            ),
        )
        return [text for good, text in rules if not good]


_WHOLE = ("samples", "light_samples", "max_bounces", "threads")
_REAL = ("error_threshold", "cutoff", "filter_width")


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _is_region(region: Any) -> bool:
    if not isinstance(region, (tuple, list)) or len(region) != 4 or not all(map(_is_whole, region)):
        return False
    x0, y0, x1, y1 = region
    return 0 <= x0 < x1 and 0 <= y0 < y1


OFFERED = Settings(samples=64, error_threshold=4.0, light_samples=2)
"""What a user gets who chooses nothing: on the front of time against error of the scenes that were
measured (docs/decisions/0012-defaults.md). `Settings()` itself stops no pixel early, so that a
picture's samples are those that were asked for.
"""
