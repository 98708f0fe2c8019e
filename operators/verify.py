"""Render a stamped picture again and say whether it is the same, and where it is not."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ..addon.render import stamp, statistics
from .opened import composites, has_strips, open_blend, unrun
from .pictures import check_whole, header_texts, is_multilayer, read_planes, sample_bits

_PREFIX = "glint."
_LAST_FRAME = 1_048_574
"""Of a scene of Blender."""


class NoStampError(ValueError):
    """The picture cannot be verified; the message says why."""


@dataclass(frozen=True)
class Verdict:
    """same: every bit that could be compared is.  lines: what was compared and how it came out."""

    same: bool
    lines: tuple[str, ...]


def verify(picture: Path, blend: Path | None = None, *, scripts: bool = False) -> Verdict:
    """Open the .blend file (None: the one that the picture names), render the picture's frame and
    compare with stamp and pixels. The file's compositor, strips and Freestyle do not run, and its
    scripts and drivers only with scripts: a picture to be verified may come from anybody.

    Raises NoStampError, OSError for a picture that is cut off, and RuntimeError with Blender's
    message when the file cannot be opened or rendered.
    """
    texts = header_texts(picture)
    stamps = read_stamps(texts)
    if not stamps:
        raise NoStampError(
            f"{picture} carries no stamp of Glint: only files that a render itself wrote do "
            "(metadata must be on)"
        )
    if "glint.tile" in texts:
        raise NoStampError(f"{picture} is tile {texts['glint.tile']} of a frame: merge it first")
    source = blend or Path(texts.get("File", ""))
    if not source.is_file():
        raise NoStampError(
            f"{picture} was made from {texts.get('File', 'an unknown file')}, which is not there: "
            "name the .blend file"
        )
    check_whole(picture)
    frame = _frame_of(picture, stamps)
    open_blend(source, scripts=scripts)
    scene = bpy.data.scenes.get(texts.get("Scene", "")) or bpy.context.scene
    statistics.forget(scene.name)
    added = _switch_off_additions(scene)
    with tempfile.TemporaryDirectory() as folder:
        again = _render_again(scene, picture, frame, Path(folder))
        new = {name: layer.stamp for name, layer in statistics.by_layer(scene.name).items()}
        verdicts = [_compare_stamps(name, old, new.get(name, {})) for name, old in stamps.items()]
        verdicts.append(_compare_files(picture, again, added))
    same = all(v.same for v in verdicts)
    lines = [line for v in verdicts for line in v.lines]
    return Verdict(same, (*lines, *([] if same else unrun())))


def verify_all(
    folder: Path, blend: Path | None = None, *, scripts: bool = False
) -> Iterator[tuple[int, str]]:
    """Verify every picture of a folder; for each the exit code of `verify` on the command line, and
    a row of a table.
    """
    pictures = sorted(path for path in folder.iterdir() if path.suffix.lower() in (".exr", ".png"))
    pictures = [path for path in pictures if not path.name.startswith(".")]
    if not pictures:
        raise ValueError(f"there are no EXR or PNG pictures in {folder}")
    width = max(len(path.name) for path in pictures)
    for path in pictures:
        try:
            verdict = verify(path, blend, scripts=scripts)
            code, said = (0, "same") if verdict.same else (1, f"different: {verdict.lines[-1]}")
        except (ValueError, OSError, RuntimeError) as error:
            code, said = 2, " ".join(str(error).split())
        yield code, f"{path.name:{width}}  {said}"


def read_stamps(texts: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """View layer → field → text, of the layers whose stamp is whole."""
    layers: dict[str, dict[str, str]] = {}
    for name, value in texts.items():
        layer, _, field = name.removeprefix(_PREFIX).rpartition(".")
        if name.startswith(_PREFIX) and field in stamp.FIELDS:
            layers.setdefault(layer, {})[field] = value
    return {layer: fields for layer, fields in layers.items() if len(fields) == len(stamp.FIELDS)}


def _frame_of(picture: Path, stamps: Mapping[str, Mapping[str, str]]) -> float:
    """The frame that the stamps name. Raises NoStampError where their fields are not those that a
    render writes.
    """
    try:
        frame = float(next(iter(stamps.values()))["frame"])
        readable = all(isinstance(json.loads(old["settings"]), dict) for old in stamps.values())
    except (ValueError, RecursionError):
        readable = False
    if not readable or not abs(frame) <= _LAST_FRAME:
        raise NoStampError(
            f"{picture} carries a stamp that no render wrote: use the file as Blender saved it"
        )
    return frame


def _switch_off_additions(scene: bpy.types.Scene) -> bool:
    """Leave Glint's own picture: the compositor writes files, strips render other scenes with
    theirs, and Freestyle runs scripts. Gives whether any of them may have changed the pixels.
    """
    render = scene.render
    added = composites(scene) or has_strips(scene) or render.use_freestyle
    render.use_compositing = render.use_sequencer = render.use_freestyle = False
    return added


def _render_again(scene: bpy.types.Scene, picture: Path, frame: float, folder: Path) -> Path:
    """Into a file of the same kind; returns its path."""
    render, image = scene.render, scene.render.image_settings
    render.engine = "GLINT"
    whole = math.floor(frame)
    scene.frame_set(whole, subframe=frame - whole)
    multilayer, is_exr = is_multilayer(picture), picture.suffix.lower() == ".exr"
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "OPEN_EXR" if is_exr else "PNG"
    image.color_depth = str(sample_bits(picture))
    render.filepath, render.use_file_extension = str(folder / "again"), True
    bpy.ops.render.render(write_still=True, scene=scene.name)
    again = _written(render, picture, folder)
    check_whole(again)
    return again


def _written(render: bpy.types.RenderSettings, picture: Path, folder: Path) -> Path:
    """What the render wrote: views of their own have files of their own, with a suffix."""
    plain = folder / f"again{render.file_extension}"
    if plain.is_file() or not render.use_multiview:
        return plain
    suffixes = (view.file_suffix for view in render.views)
    own = next((suffix for suffix in suffixes if picture.stem.endswith(suffix)), "")
    return folder / f"again{own}{render.file_extension}"


def _compare_stamps(layer: str, old: Mapping[str, str], new: Mapping[str, str]) -> Verdict:
    if not new:
        return Verdict(False, (f"{layer}: the file does not render this view layer any more",))
    same = old["pixels"] == new["pixels"]
    lines = [
        f"{layer}: {'the same bits in every pass' if same else 'other bits'} "
        f"({old['pixels'][:12]}, {new['pixels'][:12]})"
    ]
    if old["settings"] != new["settings"]:
        before, after = json.loads(old["settings"]), json.loads(new["settings"])
        changed = [
            name for name in sorted({*before, *after}) if before.get(name) != after.get(name)
        ]
        lines.append(
            f"{layer}: the settings changed: "
            + ", ".join(f"{n} {before.get(n)} → {after.get(n)}" for n in changed)
        )
    if old["geometry"] != new["geometry"]:
        lines.append(f"{layer}: the scene changed: objects, materials, lights, camera or frame")
    if old["tracer"] != new["tracer"]:
        lines.append(f"{layer}: the tracer changed: {old['tracer']} → {new['tracer']}")
    return Verdict(same, tuple(lines))


def _compare_files(picture: Path, again: Path, added: bool) -> Verdict:
    """The files' pixels, as they were written. added: Blender may have added to the first one's
    what the second one's are without.
    """
    verdict = _compare_pixels(picture, again)
    if verdict.same or not added:
        return verdict
    return Verdict(
        True,
        (
            "file: compositor, strips and Freestyle do not run here, so the hashes alone were "
            "compared",
        ),
    )


def _compare_pixels(picture: Path, again: Path) -> Verdict:
    old, new = read_planes(picture), read_planes(again)
    if old is None or new is None:
        return Verdict(
            True,
            (
                "file: this Blender cannot look into multilayer files, so the hashes alone were "
                "compared",
            ),
        )
    if old.keys() != new.keys():
        return Verdict(
            False, (f"file: other channels: {', '.join(sorted(old.keys() ^ new.keys()))}",)
        )
    if any(old[name].shape != new[name].shape for name in old):
        return Verdict(False, (f"file: another size: {_size(old)} → {_size(new)}",))
    return describe_difference(old, new)


def _size(planes: Mapping[str, np.ndarray]) -> str:
    height, width = next(iter(planes.values())).shape
    return f"{width} × {height}"


def describe_difference(old: Mapping[str, np.ndarray], new: Mapping[str, np.ndarray]) -> Verdict:
    """Where planes (h, w) of the same names and sizes differ: the bounding box and the largest
    difference. NaN equals NaN.
    """
    differs = {
        name: ~((old[name] == new[name]) | (np.isnan(old[name]) & np.isnan(new[name])))
        for name in old
    }
    anywhere = np.any(list(differs.values()), axis=0)
    if not anywhere.any():
        return Verdict(True, ("file: every pixel is the same",))
    rows, columns = np.nonzero(anywhere)
    with np.errstate(invalid="ignore"):
        sizes = {
            name: np.where(mask, np.abs(old[name].astype(np.float64) - new[name]), 0.0)
            for name, mask in differs.items()
        }
    largest = {
        name: float(np.max(np.where(np.isnan(size), np.inf, size))) for name, size in sizes.items()
    }
    worst = max(largest, key=lambda name: largest[name])
    place = (
        f"columns {columns.min()} to {columns.max()}, rows {rows.min()} to {rows.max()} from "
        "the bottom"
    )
    return Verdict(
        False,
        (
            f"file: {anywhere.sum()} of {anywhere.size} pixels differ, in {place}, by up to "
            f"{largest[worst]:.6g} ({worst})",
        ),
    )
