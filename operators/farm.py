"""Frames for render farms: each is drawn once, is there whole or not at all, and says by its stamp
whether it is the scene's; and the Open Job Description template that hands them out.
"""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from ..addon.export.images.images import IS_MAGENTA
from ..addon.render import final, stamp, statistics
from .pictures import check_whole, header_texts
from .verify import read_stamps

_FORMATS = ("PNG", "OPEN_EXR", "OPEN_EXR_MULTILAYER")
_RANGE = re.compile(r"(-?\d+)(?:-(-?\d+)(?::(\d+))?)?")
_MOST_FRAMES = 1_048_574
"""As many as a scene of Blender can have."""


def frame_numbers(text: str) -> list[int]:
    """The frames of a range expression of Open Job Description, such as "1-10:2,15", in order.
    Raises ValueError.
    """
    found: set[int] = set()
    for part in text.split(","):
        read = _RANGE.fullmatch(part.strip())
        if not read:
            raise ValueError(f"frames {text!r}: write them as in 1-240, 1-240:2 or 1,5,9")
        first, last, step = int(read[1]), int(read[2] or read[1]), int(read[3] or 1)
        if step == 0 or last < first or last - first > _MOST_FRAMES:
            raise ValueError(f"frames {part}: from the lower to the higher, in steps of 1 or more")
        found.update(range(first, last + 1, step))
    return sorted(found)


class Frames:
    """The frames of an opened file, in a folder."""

    def __init__(self, scene: bpy.types.Scene, folder: Path) -> None:
        """Raises ValueError where the scene's output cannot tell what it was made of."""
        image, render = scene.render.image_settings, scene.render
        if image.file_format not in _FORMATS:
            raise ValueError(
                f"the output is {image.file_format}, which keeps no stamp: choose OpenEXR or PNG "
                "in Output"
            )
        if render.use_multiview and image.views_format == "INDIVIDUAL":
            raise ValueError(
                "each view has a file of its own, and a frame is one file: choose Views Format "
                "Stereo 3D or Multi-View in Output"
            )
        if not any(layer.use for layer in scene.view_layers):  # Blender crashes
            raise ValueError("none of its view layers is rendered: choose Use for Rendering in one")
        if scene.glint.target != "NONE":
            raise ValueError(
                "a Quality Target finds settings anew for each frame, so that a stamp cannot tell "
                "whether a frame is the scene's: set Samples instead (Tune Settings finds them)"
            )
        self._scene, self._folder = scene, folder.resolve()
        self._stem = Path(bpy.data.filepath).stem or "frame"
        render.engine = "GLINT"

    def path(self, frame: int) -> Path:
        """Where a frame is once it is whole."""
        name = f"{self._stem}_{frame:04d}{self._scene.render.file_extension}"
        return self._folder / name

    def state(self, frame: int) -> str:
        """ "" where the frame is there and its stamps are those that the scene would give now, else
        what is wrong with it. Reads the scene, and traces nothing.
        """
        path = self.path(frame)
        if not path.is_file():
            return "missing"
        try:
            check_whole(path)
            stamps = read_stamps(header_texts(path))
        except (OSError, ValueError) as error:
            return str(error)
        wanted = self._stamps(frame)
        if stamps.keys() != wanted.keys():
            return "of other view layers" if stamps else "without a stamp"
        changed = sorted(
            {
                field
                for layer, fields in wanted.items()
                for field, text in fields.items()
                if stamps[layer][field] != text
            }
        )
        return f"of another {', '.join(changed)}" if changed else ""

    def draw(self, frame: int) -> None:
        """Render a frame under another name, look at what was written, and give it its own name.
        Raises RuntimeError, ValueError or OSError with the reason; then nothing has its name.
        """
        path, scene = self.path(frame), self._scene
        self._folder.mkdir(parents=True, exist_ok=True)
        worker = f"{socket.gethostname()}-{os.getpid()}"
        part = path.with_name(f".{path.stem}.{worker}{path.suffix}")
        scene.frame_set(frame)
        scene.render.filepath, scene.render.use_file_extension = str(part), True
        statistics.forget(scene.name)
        try:
            bpy.ops.render.render(write_still=True, scene=scene.name)
            check_whole(part)
            if not read_stamps(header_texts(part)):
                raise ValueError(
                    f"frame {frame} has no stamp: Glint must draw it itself (no strips, a view "
                    "layer that renders)"
                )
            self._check_images(frame)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        for left in path.parent.glob(f".{path.stem}.*{path.suffix}"):  # of workers that were killed
            left.unlink(missing_ok=True)

    def _check_images(self, frame: int) -> None:
        layers = statistics.by_layer(self._scene.name).values()
        missing = [note for layer in layers for note in layer.notes if IS_MAGENTA in note]
        if missing:
            raise ValueError(f"frame {frame}: {missing[0]}")

    def _stamps(self, frame: int) -> dict[str, dict[str, str]]:
        """View layer → what its stamp would say, but for the hash of the pixels."""
        self._scene.frame_set(frame)
        with final.reading_only() as jobs:
            bpy.ops.render.render(scene=self._scene.name)
        return {job.title: stamp.expected(job.scene, job.settings, job.frame) for job in jobs}


def draw_frames(scene: bpy.types.Scene, numbers: list[int], folder: Path) -> Iterator[str]:
    """Draw the frames that are not there yet as the scene gives them now; a line for each."""
    frames = Frames(scene, folder)
    for number in numbers:
        before = frames.state(number)
        if before:
            frames.draw(number)
        yield f"frame {number}: {f'drawn (was {before})' if before else 'there'}"


def check_frames(
    scene: bpy.types.Scene, numbers: list[int], folder: Path
) -> Iterator[tuple[bool, str]]:
    """Whether each frame is there as the scene gives it now, and a line of a table."""
    frames = Frames(scene, folder)
    for number in numbers:
        state = frames.state(number)
        yield not state, f"{number:6d}  {state or 'verified'}"


def job_template(blend: Path, text: str, chunk: int, folder: Path, place: Path) -> dict[str, Any]:
    """The template that draws these frames into a folder, several at a time, and then looks at all
    of them. place: of the template; only paths below its folder can be defaults there.
    """
    numbers = frame_numbers(text)
    task = ["-b", "--command", "glint", "frames", "{{Param.Scene}}"]
    where = ["--out", "{{Param.Out}}"]
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": f"{blend.stem[:40]}, {len(numbers)} frames",
        "parameterDefinitions": [
            _path("Scene", "FILE", "IN", blend, place),
            _path("Out", "DIRECTORY", "OUT", folder, place),
            {"name": "Frames", "type": "STRING", "default": text},
            {"name": "FramesPerTask", "type": "INT", "default": chunk, "minValue": 1},
            {"name": "Blender", "type": "STRING", "default": bpy.app.binary_path or "blender"},
        ],
        "steps": [
            {
                "name": "Frames",
                "parameterSpace": {
                    "taskParameterDefinitions": [
                        {
                            "name": "Frames",
                            "type": "CHUNK[INT]",
                            "range": "{{Param.Frames}}",
                            "chunks": {
                                "defaultTaskCount": "{{Param.FramesPerTask}}",
                                "rangeConstraint": "NONCONTIGUOUS",
                            },
                        }
                    ]
                },
                "script": _script([*task, "{{Task.Param.Frames}}", *where]),
            },
            {
                "name": "Check",
                "dependencies": [{"dependsOn": "Frames"}],
                "script": _script([*task, "{{Param.Frames}}", *where, "--check"]),
            },
        ],
    }


def _script(arguments: list[str]) -> dict[str, Any]:
    return {"actions": {"onRun": {"command": "{{Param.Blender}}", "args": arguments}}}


def _path(name: str, kind: str, flow: str, path: Path, place: Path) -> dict[str, str]:
    told = {"name": name, "type": "PATH", "objectType": kind, "dataFlow": flow}
    top = place.resolve().parent
    if path.resolve().is_relative_to(top):
        told["default"] = path.resolve().relative_to(top).as_posix()
    return told


def without_default(template: dict[str, Any], values: dict[str, Path]) -> list[str]:
    """What has to be given on the command line of `openjd run`."""
    given = [told["name"] for told in template["parameterDefinitions"] if "default" not in told]
    return [word for name in given for word in ("-p", f"{name}={values[name].resolve()}")]
