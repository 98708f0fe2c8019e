"""What settings of Cycles and Eevee are in Glint: which of Glint's follow from them, and which have
no counterpart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ..addon.export.unsupported import ROLLING_SHUTTER, rolls
from ..engine.settings import DECLARED, OFFERED

EEVEES = ("BLENDER_EEVEE", "BLENDER_EEVEE_NEXT")
NAMES = {"CYCLES": "Cycles", **dict.fromkeys(EEVEES, "Eevee")}
"""Engine -> how people call it, of those that scenes can come from."""

_FEWEST, _MOST = 4, 256
"""Samples of a pixel that are taken over from a number of Cycles'."""
_ENOUGH = "without noise, and as pixels share what they find, about a quarter of the root is enough"
_GROUPS = ("final", "viewport")


@dataclass(frozen=True)
class Carried:
    """A setting of Glint that follows from one of another engine. group: "final" or "viewport".
    source: what it follows from, in words.
    """

    group: str
    name: str
    value: Any
    source: str

    @property
    def key(self) -> str:
        return f"{self.group}.{self.name}"

    @property
    def label(self) -> str:
        return f"{DECLARED[self.name].label} ({'Render' if self.group == 'final' else 'Viewport'})"


def carried(scene: Any) -> list[Carried]:
    """What follows from the settings of the scene's engine, one of `NAMES`."""
    of_engine = _of_cycles if scene.render.engine == "CYCLES" else _of_eevee
    return list(of_engine(scene))


def without_counterpart(scene: Any) -> list[str]:
    """What the scene's engine does by its settings and Glint does otherwise, where no note of the
    export tells of it: a sentence each, with what to do.
    """
    of_engine = _unlike_cycles if scene.render.engine == "CYCLES" else _unlike_eevee
    return list(of_engine(scene))


def _of_cycles(scene: Any) -> Iterator[Carried]:
    cycles = scene.cycles
    for group, prefix in zip(_GROUPS, ("", "preview_"), strict=True):
        samples = getattr(cycles, f"{prefix}samples")
        why = f"; {_ENOUGH}" if samples > 0 else ", without a limit"
        yield Carried(group, "samples", samples_for(samples), f"Max Samples {samples}{why}")
        is_adaptive = getattr(
            cycles, "use_preview_adaptive_sampling" if prefix else "use_adaptive_sampling"
        )
        threshold = getattr(cycles, f"{prefix}adaptive_threshold")
        said = f"{threshold:.4g}; so few samples go to all pixels" if is_adaptive else "off"
        yield Carried(group, "error_threshold", 0.0, f"Noise Threshold {said}")
        mirrors = min(cycles.max_bounces, max(cycles.glossy_bounces, cycles.transmission_bounces))
        yield Carried(
            group,
            "max_bounces",
            _within("max_bounces", mirrors),
            f"Glossy {cycles.glossy_bounces}, Transmission {cycles.transmission_bounces}, "
            f"Total {cycles.max_bounces}",
        )
    diffuse = min(cycles.max_bounces, cycles.diffuse_bounces)
    yield Carried(
        "final",
        "diffuse_bounces",
        _within("diffuse_bounces", diffuse),
        f"Diffuse {cycles.diffuse_bounces}, Total {cycles.max_bounces}",
    )
    yield Carried(
        "final",
        "volume_bounces",
        _within("volume_bounces", cycles.volume_bounces),
        f"Volume {cycles.volume_bounces}",
    )
    for kind in ("reflective", "refractive"):
        is_on = getattr(cycles, f"caustics_{kind}")
        on = "ON" if is_on else "OFF"
        yield Carried("final", f"{kind}_caustics", on, f"Caustics {kind.title()} {on.lower()}")
    clamp = cycles.sample_clamp_indirect
    yield Carried("final", "clamp_indirect", clamp, f"Clamp Indirect {clamp:.4g}")


def _of_eevee(scene: Any) -> Iterator[Carried]:
    eevee = scene.eevee
    for group, name in zip(_GROUPS, ("taa_render_samples", "taa_samples"), strict=True):
        samples = getattr(eevee, name)
        few = min(_MOST, max(_FEWEST, samples // 4))  # neighbours share what they find
        chosen = few if samples > 0 else OFFERED.samples  # 0: no limit
        yield Carried(group, "samples", chosen, f"Samples {samples}")


def samples_for(samples: int) -> int:
    """Samples without noise for a number of Cycles', 0 for no limit: the power of two at or above a
    quarter of the root, as noise falls with the root of their number and what few points miss with
    the number itself, and a block of 4 x 4 pixels shares what they find.
    """
    if samples <= 0:
        return OFFERED.samples
    return min(_MOST, max(_FEWEST, 1 << max(math.ceil(math.log2(math.sqrt(samples) / 4)), 0)))


def _within(name: str, value: int) -> int:
    return int(min(DECLARED[name].high, max(DECLARED[name].low, value)))


def _unlike_cycles(scene: Any) -> Iterator[str]:
    cycles, render = scene.cycles, scene.render
    if cycles.filter_width != render.filter_size or cycles.pixel_filter_type != "BLACKMAN_HARRIS":
        yield (
            f"The pixel filter is {render.filter_size:.2f} px wide, in Cycles "
            f"{cycles.filter_width:.2f} px: set Film → Pixel Filter"
        )
    if cycles.diffuse_bounces > DECLARED["diffuse_bounces"].high:
        yield "Light bounces 8 times at most; what more bounces add can hardly be seen"
    if cycles.sample_clamp_direct > 0:
        yield "Clamp Direct is not rendered: very bright spots stay; lower their lights' power"
    if cycles.use_fast_gi:
        yield "Fast GI Approximation is not rendered: light bounces as Diffuse Bounces say"
    if render.use_motion_blur and rolls(scene):
        yield ROLLING_SHUTTER
    if cycles.use_denoising:
        yield "Denoise has no effect: there is no noise to take away"


def _unlike_eevee(scene: Any) -> Iterator[str]:
    eevee = scene.eevee
    yield (
        "Surfaces throw light onto each other, which Eevee shows by light probes and ray tracing "
        "alone: set Diffuse Bounces to 0 for light from lamps and the world alone"
    )
    if not getattr(eevee, "use_raytracing", True):
        yield "Mirrors and glass show the scene, also without Eevee's Ray Tracing"
    if not getattr(eevee, "use_shadows", True):
        yield "Shadows are off in Eevee: turn off Cast Shadow of the lights"
