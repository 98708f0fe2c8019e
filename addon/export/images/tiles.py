"""Tiles of a tiled image as Blender has them: painted, generated, or packed under another name."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import bpy


def can_save_copies() -> bool:
    """Whether this Blender saves images without taking them for saved, as 4.5 does."""
    return "save_copy" in bpy.types.Image.bl_rna.functions["save"].parameters


def saved_tiles(image: Any) -> dict[int, bytes]:
    """Number of a tile → bytes of a picture file of it, without those that Blender cannot write.
    Blender's Python has the pixels of the first tile alone. The image stays as it is, unsaved.
    """
    if not can_save_copies():
        return {}
    with tempfile.TemporaryDirectory() as folder, _written_as_floats(image):
        with suppress(RuntimeError):  # of one tile
            image.save(filepath=str(Path(folder) / "tile.<UDIM>"), save_copy=True)
        files = Path(folder).iterdir()
        return {int(file.name.split(".")[1]): file.read_bytes() for file in files}


@contextmanager
def _written_as_floats(image: Any) -> Iterator[None]:
    """Where it has floats."""
    before = image.file_format
    if image.is_float:
        image.file_format = "OPEN_EXR"
    try:
        yield
    finally:
        if image.is_float:
            image.file_format = before
