"""Tiles of frames: regions that are drawn by themselves and kept in OpenEXR files of their own, at
their places in the frame, until all are there and make the film of the whole.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .. import engine
from ..addon.render import stamp
from ..addon.render.final import Job
from ..addon.render.result import channel_names
from ..engine.analysis.fingerprint import picture_fingerprint
from .pictures import open_image_io

_GRID = re.compile(r"([1-9]\d{0,3})x([1-9]\d{0,3})")
_FILM = "glint.film"
"""Name of the attribute that holds what a film has beside its pixels, as JSON."""
_SUMMED = (" rays", "media points", "build", "trace")
"""How names of statistics end that add up; the others are the frame's in every tile."""

Region = tuple[int, int, int, int]
"""x0, y0, x1, y1: half-open, in pixels of the frame, origin bottom left."""


@dataclass(frozen=True)
class Grid:
    """How many tiles a frame has beside and above each other. They count from 1, row by row from
    the bottom left.
    """

    columns: int
    rows: int

    @classmethod
    def parse(cls, text: str) -> Grid:
        """Of a text like "2x2". Raises ValueError."""
        read = _GRID.fullmatch(text)
        if not read:
            raise ValueError(f"tiles {text!r}: write columns x rows, as in 2x2")
        return cls(int(read[1]), int(read[2]))

    def __str__(self) -> str:
        return f"{self.columns}x{self.rows}"

    @property
    def count(self) -> int:
        return self.columns * self.rows

    def region(self, tile: int, whole: Region) -> Region:
        """Where a tile lies in the part of the frame that is rendered. Raises ValueError where
        there are more tiles than pixels.
        """
        if not 1 <= tile <= self.count:
            raise ValueError(f"tile {tile}: there are tiles 1 to {self.count} of {self}")
        x0, y0, x1, y1 = whole
        if self.columns > x1 - x0 or self.rows > y1 - y0:
            raise ValueError(f"tiles {self}: the picture has {x1 - x0} by {y1 - y0} pixels only")
        row, column = divmod(tile - 1, self.columns)
        return (
            _cut(x0, x1, column, self.columns),
            _cut(y0, y1, row, self.rows),
            _cut(x0, x1, column + 1, self.columns),
            _cut(y0, y1, row + 1, self.rows),
        )


def _cut(first: int, last: int, number: int, count: int) -> int:
    """Where part `number` of so many begins: of large ones with a tile of the tracer, as pixels of
    one share reflections and all of it is traced.
    """
    at = first + (last - first) * number // count
    is_large = last - first >= 2 * engine.TILE_SIDE * count
    return (
        round(at / engine.TILE_SIDE) * engine.TILE_SIDE if is_large and 0 < number < count else at
    )


def whole_region(job: Job) -> Region:
    """The part of the frame that is rendered: the border if there is one."""
    return job.settings.region or (0, 0, *job.scene.camera.resolution)


def draw_tile(job: Job, region: Region, should_stop: Callable[[], bool]) -> engine.Film:
    """Raises KeyboardInterrupt where it was stopped."""
    film = engine.render(job.scene, replace(job.settings, region=region), should_stop=should_stop)
    if not film.complete:
        raise KeyboardInterrupt
    return film


# --- files
# --------------------------------------------------------------------------------------------------


def write_tile(path: Path, tile: str, drawn: Sequence[tuple[Job, Region, engine.Film]]) -> None:
    """An OpenEXR file with a part for each job: all passes in full precision, its place in the
    frame, and the stamp that the whole frame would have, but for the hash, which is of these
    pixels. Raises OSError.
    """
    oiio = open_image_io()
    specs = [_spec(oiio, tile, job, region, film) for job, region, film in drawn]
    out = oiio.ImageOutput.create(str(path))
    if out is None or not out.open(str(path), tuple(specs)):
        raise OSError(f"{path}: {out.geterror() if out else oiio.geterror()}")
    for number, (spec, (_, _, film)) in enumerate(zip(specs, drawn, strict=True)):
        pixels = np.concatenate([np.flipud(values) for values in film.passes.values()], axis=2)
        ready = number == 0 or out.open(str(path), spec, "AppendSubimage")
        if not ready or not out.write_image(np.ascontiguousarray(pixels, np.float32)):
            raise OSError(f"{path}: {out.geterror()}")
    if not out.close():
        raise OSError(f"{path}: {out.geterror()}")


def _spec(oiio, tile: str, job: Job, region: Region, film: engine.Film):
    width, height = job.scene.camera.resolution
    x0, y0, x1, y1 = region
    names = [f"{job.title}.{name}" for name in _channels(film)]
    spec = oiio.ImageSpec(x1 - x0, y1 - y0, len(names), oiio.FLOAT)
    spec.channelnames = tuple(names)
    spec.x, spec.y = x0, height - y1
    spec.full_width, spec.full_height = width, height
    kept = {
        "title": job.title,
        "passes": {name: values.shape[2] for name, values in film.passes.items()},
        "samples": film.samples,
        "stats": film.stats,
        "notes": film.notes,
    }
    fields = stamp.expected(job.scene, job.settings, job.frame)
    fields["pixels"] = picture_fingerprint(film.passes)
    texts = {f"glint.{job.title}.{field}": text for field, text in fields.items()}
    texts |= {"compression": "zip", "oiio:subimagename": job.title, "glint.tile": tile}
    for name, text in (texts | {_FILM: json.dumps(kept)}).items():
        spec.attribute(name, text)
    return spec


def _channels(film: engine.Film) -> list[str]:
    return [
        channel
        for name, values in film.passes.items()
        for channel in channel_names(name, values.shape[2])
    ]


def read_tile(path: Path) -> dict[str, tuple[Region, engine.Film]]:
    """Title of a job → where the tile lies, and its film. Raises OSError where it cannot be read,
    or where its pixels are not those that were written.
    """
    oiio = open_image_io()
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise OSError(f"{path}: {oiio.geterror()}")
    found, part = {}, 0
    while source.seek_subimage(part, 0):
        spec = source.spec()
        pixels = source.read_image(part, 0, 0, spec.nchannels, oiio.FLOAT)
        if pixels is None:
            raise OSError(f"{path}: {source.geterror()}")
        try:
            title, film = _film(spec, np.flipud(np.asarray(pixels, np.float32)))
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            raise OSError(f"{path} is no tile that Glint wrote: draw it again") from error
        y0 = spec.full_height - spec.y - spec.height
        region = (spec.x, y0, spec.x + spec.width, y0 + spec.height)
        hashed = spec.get_string_attribute(f"glint.{title}.pixels")
        if picture_fingerprint(film.passes) != hashed:
            raise OSError(f"{path} has other pixels than were written: draw it again")
        found[title] = region, film
        part += 1
    source.close()
    return found


def _film(spec, pixels: np.ndarray) -> tuple[str, engine.Film]:
    kept = json.loads(spec.get_string_attribute(_FILM))
    places = {name: number for number, name in enumerate(spec.channelnames)}
    passes = {
        name: np.stack(
            [
                pixels[..., places[f"{kept['title']}.{channel}"]]
                for channel in channel_names(name, count)
            ],
            axis=-1,
        )
        for name, count in kept["passes"].items()
    }
    film = engine.Film(passes, kept["samples"], True, kept["stats"], tuple(kept["notes"]))
    return kept["title"], film


# --- the whole
# --------------------------------------------------------------------------------------------------


def merge(whole: Region, tiles: Sequence[tuple[Region, engine.Film]]) -> engine.Film:
    """The film of a frame whose tiles these are, with the work that they took."""
    x0, y0, x1, y1 = whole
    first = tiles[0][1]
    passes = {
        name: np.empty((y1 - y0, x1 - x0, values.shape[2]), np.float32)
        for name, values in first.passes.items()
    }
    stats: dict[str, float] = {}
    for region, film in tiles:
        left, bottom, right, top = region
        for name, values in film.passes.items():
            passes[name][bottom - y0 : top - y0, left - x0 : right - x0] = values
        for name, value in film.stats.items():
            adds = f" {name}".endswith(_SUMMED)
            stats[name] = stats.get(name, 0.0) + value if adds else max(stats.get(name, 0.0), value)
    notes = tuple(dict.fromkeys(note for _, film in tiles for note in film.notes))
    return engine.Film(passes, first.samples, True, stats, notes)
