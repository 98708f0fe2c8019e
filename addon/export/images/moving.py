"""Images that show another picture in each frame: sequences of files, and movies."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePath
from typing import Any

KINDS = ("SEQUENCE", "MOVIE")


def shown_number(user: Any, frame: int) -> int:
    """Number of the file or of the movie's picture that an ImageUser shows in the scene's frame,
    Auto Refresh or not, as in Cycles.
    """
    number, length = frame - user.frame_start + 1, user.frame_duration
    number = (number - 1) % length + 1 if user.use_cyclic else min(max(number, 0), length)
    return number + user.frame_offset


def numbered(path: str, number: int) -> str:
    """The path of the file with this number in a sequence: its last digits are the number."""
    file = PurePath(path)
    stem = re.sub(
        r"\d+(?=\D*$)", lambda found: f"{max(number, 0):0{len(found[0])}}", file.stem, count=1
    )
    return str(file.with_name(stem + file.suffix))


@contextmanager
def movie_picture(path: str, number: int) -> Iterator[Any]:
    """A Blender image whose pixels are a movie's picture of this number, of the first or the last
    where it has none of it. Raises RuntimeError where there is no movie.

    Blender decodes for a texture that is asked for a colour, and `Image.pixels` gives what was
    decoded last. Both are data of their own, so that the file that is open does not change.
    """
    import bpy

    with bpy.data.temp_data() as data:
        texture = data.textures.new("movie", "IMAGE")
        texture.image = image = data.images.load(path)
        texture.image_user.frame_current = number
        texture.evaluate((0.0, 0.0, 0.0))
        yield image
