"""Frames for render farms, and their tiles: each is drawn once, is there whole or not at all, and
says by its stamp whether it is the scene's.
"""

from __future__ import annotations

import glob
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import bpy

from .. import engine
from ..addon.export.images.images import IS_MAGENTA
from ..addon.render import final, stamp, statistics
from ..addon.render.interrupts import interrupts_held
from . import tiles
from .opened import has_strips
from .pictures import check_whole, header_texts, hidden
from .tiles import Grid
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
        if has_strips(scene):  # their scenes would be rendered, with their compositors
            raise ValueError(
                "strips are rendered in its place: turn off Sequencer in Post Processing, or mute "
                "them"
            )
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

    def tile_path(self, frame: int, grid: Grid, tile: int) -> Path:
        """Where a tile is until its frame is whole."""
        return self._folder / f"{self._stem}_{frame:04d}.{grid}-{tile}.exr"

    def state(self, frame: int) -> str:
        """ "" where the frame is there and its stamps are those that the scene would give now, else
        what is wrong with it. Reads the scene, and traces nothing.
        """
        stamps, wrong = _stamps_of(self.path(frame))
        return wrong or _difference(stamps, self._jobs(frame))

    def draw(self, frame: int) -> None:
        """Render a frame under another name, look at what was written, and give it its own name.
        Raises RuntimeError, ValueError or OSError with the reason; then nothing has its name.
        """
        try:
            with _hidden(self.path(frame)) as part:
                self._render(frame, part)
        except OSError:
            if self.state(frame):  # not drawn meanwhile by another worker, which then cleaned up
                raise

    def draw_tile(self, frame: int, grid: Grid, tile: int) -> str:
        """The same of a tile, where neither it nor its frame is there as the scene gives it now;
        "" or what was wrong with the tile.
        """
        jobs, path = self._jobs(frame), self.tile_path(frame, grid, tile)
        if not _wrong(self.path(frame), jobs):
            return ""
        wrong = _wrong(path, jobs)
        if wrong:
            try:
                with _hidden(path) as part:
                    self._draw_tile(frame, grid, tile, jobs, part)
            except OSError:
                if _wrong(path, jobs):  # not drawn meanwhile by another worker
                    raise
        return wrong

    def _draw_tile(
        self, frame: int, grid: Grid, tile: int, jobs: list[final.Job], part: Path
    ) -> None:
        drawn = []
        with interrupts_held() as is_interrupted:
            for job in jobs:
                region = grid.region(tile, tiles.whole_region(job))
                film = tiles.draw_tile(job, region, is_interrupted)
                _check_images(frame, (*job.notes, *film.notes))
                drawn.append((job, region, film))
        tiles.write_tile(part, f"{tile} of {grid}", drawn)
        check_whole(part)

    def merge(self, frame: int, grid: Grid) -> str:
        """Give Blender the tiles of a frame as if it had been drawn here, and take the tiles away;
        "" where the frame is there already as the scene gives it now, else what was wrong with it.
        Raises ValueError or OSError where a tile is not as the scene gives it now.
        """
        jobs = self._jobs(frame)
        wrong = _wrong(self.path(frame), jobs)
        paths = [self.tile_path(frame, grid, tile) for tile in range(1, grid.count + 1)]
        if wrong:
            films = self._merged(frame, grid, paths, jobs)
            with final.films_from(lambda job: films[job.title]):
                self.draw(frame)
        for path in paths:
            path.unlink(missing_ok=True)
        return wrong

    def _merged(
        self, frame: int, grid: Grid, paths: list[Path], jobs: list[final.Job]
    ) -> dict[str, engine.Film]:
        """Title of a job → the film of its whole frame."""
        found = []
        for tile, path in enumerate(paths, start=1):
            wrong = _wrong(path, jobs)
            if wrong:
                raise ValueError(
                    f"frame {frame}: tile {tile} of {grid} is {wrong}: draw it first (frames "
                    f"--tiles {grid} --tile {tile})"
                )
            found.append(tiles.read_tile(path))
        return {
            job.title: tiles.merge(tiles.whole_region(job), [part[job.title] for part in found])
            for job in jobs
        }

    def _render(self, frame: int, part: Path) -> None:
        scene = self._scene
        scene.frame_set(frame)
        scene.render.filepath, scene.render.use_file_extension = str(part), True
        statistics.forget(scene.name)
        bpy.ops.render.render(write_still=True, scene=scene.name)
        check_whole(part)
        if not read_stamps(header_texts(part)):
            _refuse(frame)
        layers = statistics.by_layer(scene.name).values()
        _check_images(frame, [note for layer in layers for note in layer.notes])

    def _jobs(self, frame: int) -> list[final.Job]:
        """What a render of the frame would trace. Raises ValueError where Blender asks Glint for
        nothing.
        """
        scene = self._scene
        scene.frame_set(frame)
        render = scene.render
        added = render.use_compositing, render.use_freestyle
        # before 5.0 Blender composites the blank picture, and writes its nodes' files; Freestyle
        # runs scripts
        render.use_compositing = render.use_freestyle = False
        try:
            with final.reading_only() as jobs:
                bpy.ops.render.render(scene=scene.name)
        finally:
            render.use_compositing, render.use_freestyle = added
        if not jobs:
            _refuse(frame)
        return jobs


@contextmanager
def _hidden(path: Path) -> Iterator[Path]:
    """As `pictures.hidden`, and takes away what workers that were killed left of it."""
    with hidden(path) as part:
        yield part
    ours = f".{glob.escape(path.stem)}.*{glob.escape(path.suffix)}"
    for left in path.parent.glob(ours):
        left.unlink(missing_ok=True)


def _stamps_of(path: Path) -> tuple[dict[str, dict[str, str]], str]:
    """What stands in a file, and what is wrong with it."""
    if not path.is_file():
        return {}, "missing"
    try:
        check_whole(path)
        return read_stamps(header_texts(path)), ""
    except (OSError, ValueError) as error:
        return {}, str(error)


def _wrong(path: Path, jobs: Sequence[final.Job]) -> str:
    """What is wrong with a file that these jobs are to have made; "" where nothing is."""
    stamps, wrong = _stamps_of(path)
    return wrong or _difference(stamps, jobs)


def _difference(stamps: Mapping[str, Mapping[str, str]], jobs: Sequence[final.Job]) -> str:
    """From what the stamps of these jobs would say, but for the hash of the pixels."""
    wanted = {job.title: stamp.expected(job.scene, job.settings, job.frame) for job in jobs}
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


def _refuse(frame: int) -> NoReturn:
    raise ValueError(
        f"frame {frame} has no stamp: Glint must draw it itself (no strips, a view "
        "layer that renders)"
    )


def _check_images(frame: int, notes: Sequence[str]) -> None:
    missing = [note for note in notes if IS_MAGENTA in note]
    if missing:
        raise ValueError(f"frame {frame}: {missing[0]}")


def draw_frames(scene: bpy.types.Scene, numbers: list[int], folder: Path) -> Iterator[str]:
    """Draw the frames that are not there yet as the scene gives them now; a line for each."""
    frames = Frames(scene, folder)
    for number in numbers:
        before = frames.state(number)
        if before:
            frames.draw(number)
        yield f"frame {number}: {f'drawn (was {before})' if before else 'there'}"


def draw_tiles(
    scene: bpy.types.Scene, numbers: list[int], folder: Path, grid: Grid, tile: int
) -> Iterator[str]:
    """The same of a tile of each frame."""
    frames = Frames(scene, folder)
    for number in numbers:
        before = frames.draw_tile(number, grid, tile)
        yield (
            f"frame {number}, tile {tile} of {grid}: "
            f"{f'drawn (was {before})' if before else 'there'}"
        )


def merge_frames(
    scene: bpy.types.Scene, numbers: list[int], folder: Path, grid: Grid
) -> Iterator[str]:
    """Make frames of their tiles; a line for each."""
    frames = Frames(scene, folder)
    for number in numbers:
        before = frames.merge(number, grid)
        yield f"frame {number}: {f'merged (was {before})' if before else 'there'}"


def check_frames(
    scene: bpy.types.Scene, numbers: list[int], folder: Path
) -> Iterator[tuple[bool, str]]:
    """Whether each frame is there as the scene gives it now, and a line of a table."""
    frames = Frames(scene, folder)
    for number in numbers:
        state = frames.state(number)
        yield not state, f"{number:6d}  {state or 'verified'}"
