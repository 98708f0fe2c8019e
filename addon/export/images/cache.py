"""What exports know of images, from one to the next."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from ....engine.scene import Texture
from ..report import Report
from .moving import KINDS
from .pixels import Pixels
from .tiles import saved_tiles


class ImageKey(NamedTuple):
    """Equal for the same pixels. address: of the image data-block, 0 for none.  path: of the file
    shown now.  file: when it was written and its size, None for what only Blender has, of which
    `epoch` counts the changes.  settings: how it is read.  number: of a movie's picture
    or of a tile.
    """

    address: int = 0
    path: str = ""
    file: tuple[int, int] | None = None
    epoch: int = 0
    settings: tuple = ()
    number: int = 0

    @property
    def is_in_memory(self) -> bool:
        return self.address != 0 and self.file is None


class TextureKey(NamedTuple):
    """Equal for the same texture. image: None for what is no image, but made as `recipe` says."""

    image: ImageKey | None
    extension: str = ""
    interpolation: str = ""
    associated: bool = False
    recipe: tuple = ()


class ImageCache:
    """Pixels, with what is told of them, and textures as they were read last; a new one knows
    nothing. frame: the scene's, which sequences and movies follow.
    """

    def __init__(self) -> None:
        self.pixels: dict[ImageKey, tuple[Pixels, Report]] = {}
        self.textures: dict[TextureKey, Texture] = {}
        self.frame = 1
        self._epoch = 0
        self._tiles: dict[int, dict[int, bytes]] = {}

    def key(self, image: Any, address: int, path: str) -> ImageKey:
        """Of an image, with what a change of it shows in, should Blender not tell of it: reloaded
        files and other ways to read them.
        """
        if image.source == "MOVIE":
            _ = image.size[:]  # Blender sets a movie's colour space when it opens it
        space, packed = image.colorspace_settings, image.packed_file
        settings = (image.source, image.alpha_mode, space.name, space.is_data)
        if image.is_dirty or image.source == "GENERATED":
            settings = (*settings, tuple(image.size))  # of a file it would have Blender read that
        elif packed:
            settings = (*settings, packed.size)
        elif Path(path).is_file():
            file = Path(path).stat()
            return ImageKey(address, path, (file.st_mtime_ns, file.st_size), 0, settings)
        return ImageKey(address, path, None, self._epoch, settings)

    def saved_tile(self, image: Any, tile: int) -> bytes | None:
        """A picture file of what Blender has of a tiled image's tile (0: its first), None where it
        has nothing.
        """
        if image.source != "TILED":
            return None
        address = image.as_pointer()
        if address not in self._tiles:
            self._tiles[address] = saved_tiles(image)
        return self._tiles[address].get(tile or image.tiles[0].number)

    def forget(self) -> None:
        """Read all anew."""
        self.pixels, self.textures, self._tiles = {}, {}, {}

    def forget_memory(self) -> None:
        """Read anew what only Blender has."""
        self._epoch += 1
        self._tiles = {}
        self.pixels = {key: found for key, found in self.pixels.items() if not key.is_in_memory}

    def forget_moving(self) -> None:
        """Drop what sequences and movies showed, of which each frame has others."""
        self.pixels = {
            key: found
            for key, found in self.pixels.items()
            if not key.settings or key.settings[0] not in KINDS
        }

    def keep_textures(self, used: Iterable[TextureKey]) -> None:
        """Drop the others."""
        kept = set(used)
        self.textures = {key: texture for key, texture in self.textures.items() if key in kept}
