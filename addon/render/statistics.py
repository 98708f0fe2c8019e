"""What a render took and what its scene required, as text: for the log, the files' metadata, the
panel and the command line.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import bpy

from ... import engine

STAGES = ("sync", "build", "trace", "write")
"""sync: Blender → scene; build: acceleration structures; trace: rays and shading; write: film →
Blender's passes (→ files).
"""

_DIGITS = 24
"""Of a hash, which the panel shows."""
_COUNTS = ("meshes", "instances", "triangles", "segments", "lights", "materials", "textures")
_FEATURE = "feature: "
_TRACERS = {"NATIVE": "the native core", "NUMPY": "Python (reference)"}
_READ = tuple((name, f"anew: {name}") for name in ("meshes", "materials", "worlds", "walks"))
"""What `LiveExport.work` counts, of frames of which only the changes are read."""

_last: dict[str, dict[str, Statistics]] = {}
_views: dict[str, tuple[str, ...]] = {}


@dataclass
class Statistics:
    """samples, backend: of the film.  spent: samples of the mean pixel and of the one that took
    most, where these are known.  may_stop: whether pixels may take fewer.  seconds: stage →
    seconds, and "engine": all that the engine took, with its checks.  exported, traced:
    `Export.stats` and `Film.stats`.  stamp: field → text, of `stamp.Stamping`.  skipped: kind →
    names of what nothing reads.  notes: what was dropped or changed, and why.  memory: of the
    process, at the render's end and at most during it, in MB as Blender counts them.  target: what
    was asked for, chosen, predicted and reached, if anything was.
    """

    samples: int
    backend: str
    exported: Mapping[str, float]
    traced: Mapping[str, float] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    stamp: dict[str, str] = field(default_factory=dict)
    skipped: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    spent: tuple[float, int] | None = None
    may_stop: bool = False
    memory: tuple[float, float] = (0.0, 0.0)
    target: str = ""

    @property
    def stages_line(self) -> str:
        return ", ".join(f"{name} {self.seconds.get(name, 0.0):.3f} s" for name in STAGES)

    @property
    def scene_line(self) -> str:
        """What was exported, which features the scene made the tracer use, and what came of it."""
        counts = [_count(self.exported[name], name) for name in _COUNTS if self.exported.get(name)]
        features = [
            name.removeprefix(_FEATURE) for name in self.traced if name.startswith(_FEATURE)
        ]
        parts = [
            *counts,
            f"features: {' + '.join(features) or 'none'}",
            f"{self.megabytes:.1f} MB",
            self._samples_text,
        ]
        read = {name: self.exported[key] for name, key in _READ if key in self.exported}
        if read:
            anew = [_count(number, name) for name, number in read.items() if number]
            parts.append(f"read anew: {' + '.join(anew) or 'nothing'}")
        work = (("rays", "rays"), ("media points", "volume points"))
        parts += [_count(self.traced[key], name) for key, name in work if self.traced.get(key)]
        return ", ".join([*parts, f"traced by {_TRACERS[self.backend]}"])

    @property
    def _samples_text(self) -> str:
        if self.spent is None and self.may_stop:
            return f"at most {_count(self.samples, 'samples')} per pixel"
        mean, most = self.spent or (self.samples, self.samples)
        if mean == most:
            return _count(most, "samples") + " per pixel"
        return f"{mean:.1f} samples per pixel on average and {most} at most"

    @property
    def skipped_line(self) -> str:
        """What was not read because nothing needs it; "" when that is nothing."""
        return "; ".join(f"{kind} {names}" for kind, names in self.skipped.items())

    @property
    def sections(self) -> dict[str, list[str]]:
        """Title → lines, for the panel, where `notes` have a place of their own; none is empty."""
        sections = {
            "Time": [f"{name}: {self.seconds.get(name, 0.0):.3f} s" for name in STAGES],
            "Memory of Blender": _memory_lines(*self.memory),
            "Target error": re.split(r"[;:,] ", self.target) if self.target else [],
            "Required": self.scene_line.split(", "),
            "Not needed, not read": [f"{kind}: {names}" for kind, names in self.skipped.items()],
            "Stamp": [
                f"{name}: {text if name == 'tracer' else text[:_DIGITS]}"
                for name, text in self.stamp.items()
                if name in ("pixels", "geometry", "tracer")
            ],
        }
        return {title: lines for title, lines in sections.items() if lines}

    @property
    def megabytes(self) -> float:
        """Memory of the exported arrays and the acceleration structures."""
        return (self.exported.get("bytes", 0.0) + self.traced.get("bytes", 0.0)) / 1e6


def _count(value: float, name: str) -> str:
    """12345, "triangles" → "12 345 triangles"; 1, "meshes" → "1 mesh" """
    if value == 1:
        name = "mesh" if name == "meshes" else name.removesuffix("s")
    return f"{int(value):,} {name}".replace(",", " ")


def spent_samples(film: engine.Film) -> tuple[float, int] | None:
    """Samples of the mean pixel and of the one that took most, by the pass Samples if there is
    one.
    """
    samples = film.passes.get("Samples")
    return None if samples is None else (float(samples.mean()), int(samples.max()))


def _memory_lines(now: float, most: float) -> list[str]:
    return [f"now: {now:.0f} MB", f"at most: {most:.0f} MB"] if now else []


def remember(scene_name: str, layer_name: str, statistics: Statistics) -> None:
    """Keep them for the panel and the command line; nothing that a picture depends on."""
    layers = _last.setdefault(scene_name, {})
    layers.pop(layer_name, None)
    layers[layer_name] = statistics


def add_note(scene_name: str, note: str) -> None:
    """Add what was found out after a render of the scene to its last layer's notes."""
    last = of_last_render(scene_name)
    if last is not None:
        last.notes = (*last.notes, note)


def remember_view(scene_name: str, notes: tuple[str, ...]) -> None:
    """Keep what a 3D view could not show of a scene as it is."""
    _views[scene_name] = notes


def of_views(scene_name: str) -> tuple[str, ...]:
    """What the 3D view of this scene that was read last could not show as it is."""
    return _views.get(scene_name, ())


@bpy.app.handlers.persistent
def forget_all(*_: object) -> None:
    """Another file was loaded: nothing of it was rendered yet."""
    _last.clear()
    _views.clear()


def forget(scene_name: str) -> None:
    """Drop what is known of earlier renders of a scene."""
    _last.pop(scene_name, None)


def by_layer(scene_name: str) -> dict[str, Statistics]:
    """View layer → statistics of its last final render in this session, the latest at the end."""
    return dict(_last.get(scene_name, {}))


def of_last_render(scene_name: str) -> Statistics | None:
    """Of the view layer of this scene that was rendered last; None before the first."""
    return next(reversed(by_layer(scene_name).values()), None)


def register() -> None:
    bpy.app.handlers.load_post.append(forget_all)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(forget_all)
