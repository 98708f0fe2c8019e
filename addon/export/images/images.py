"""Blender images to textures, each read once per export; a missing one is magenta, with a note that
names its file.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from ....engine.futures import parallel_map
from ....engine.scene import Input, Texture
from ..report import Report
from . import colorspace, moving, pixels
from .cache import ImageCache, ImageKey, TextureKey
from .decoded import Decoded
from .pixels import ImageError, Pixels, Raw

EXTENSIONS = {"REPEAT": "REPEAT", "EXTEND": "EXTEND", "CLIP": "CLIP", "MIRROR": "MIRROR"}
FILTERS = {"Closest": "CLOSEST", "Cubic": "CUBIC", "Smart": "CUBIC"}
"""By Blender's names of how images are read between their texels; others are linear."""
FIRST, TILES_IN_A_ROW = 1001, 10
"""Number of the tile at the origin of a UV map, and how many numbers further the tile above is."""
IS_MAGENTA = "it is magenta"
"""In the note of an image without a file."""
FIRST_TILE = "Only the first tile of tiled images is rendered here ({}): bake them into one image"


class Images:
    """The textures of one material, lamp or world, and what it asks about them."""

    def __init__(
        self, report: Report, decoded: Decoded | None = None, cache: ImageCache | None = None
    ) -> None:
        """decoded: what an export before has decoded, and where this one's images are kept for the
        next.  cache: what need not be read again.
        """
        self._decode = decoded.decode if decoded is not None else pixels.decode
        self._memoized = decoded.memoized if decoded is not None else _work
        self._made = decoded.made if decoded is not None else _make
        self.textures: list[Texture] = []
        self.report = report
        self.reads_memory = False  # an image whose pixels only Blender has
        self._cache = cache if cache is not None else ImageCache()
        self._decoded: dict[ImageKey, Raw | ImageError | MemoryError] = {}
        self._indices: dict[TextureKey, int] = {}
        self._means: dict[tuple[int, str], np.ndarray] = {}

    @property
    def keys(self) -> tuple[TextureKey, ...]:
        """Of `textures`."""
        return tuple(self._indices)

    def texture(
        self,
        image: Any,
        user: Any,
        extension: str,
        interpolation: str,
        associated: bool = False,
        tile: int = 0,
    ) -> int:
        """Index of the texture of a Blender image (None: magenta) for an image texture node's
        settings.

        associated: colours times alpha, where the image's alpha is not of the kind that is kept
        apart. tile: number of a tiled image's tile, 0 for its first.
        """
        found = self.pixels(image, user, tile)
        associated = associated and found.associated
        filtering = FILTERS.get(interpolation, "LINEAR")
        extension = EXTENSIONS.get(extension, "REPEAT")
        key = TextureKey(self._key(image, user, tile), extension, filtering, associated)

        def make() -> Texture:
            name = image.name if image is not None else "no image"
            values = found.pixels
            if associated:
                with _that_fits(name):
                    values = self._memoized(values, "associated", lambda: pixels.associated(found))
            return Texture(name, values, found.encoding, extension, filtering)

        return self._index(key, make)

    def made(self, key: tuple, make: Callable[[], Texture]) -> int:
        """Index of a texture that is no image of Blender's, made where there is none of this key,
        which must say all that it is made of.
        """
        return self._index(TextureKey(None, recipe=key), make)

    def _index(self, key: TextureKey, make: Callable[[], Texture]) -> int:
        if key not in self._indices:
            known = self._cache.textures
            if key not in known:
                known[key] = make()
            self._indices[key] = len(self.textures)
            self.textures.append(known[key])
        return self._indices[key]

    def expect(self, wanted: Iterable[tuple[Any, Any]], tile: int = 0) -> None:
        """Decodes several images at once, a thread each, ahead of being asked for them: pairs of a
        Blender image and its ImageUser.
        """
        sources = {}
        for image, user in wanted:
            key = self._key(image, user, tile)
            if image is not None and key not in self._cache.pixels and key not in self._decoded:
                sources[key] = _source(_original(image), key.path, self._unsaved(image, tile))
        sources = {key: source for key, source in sources.items() if source is not None}
        if len(sources) > 1:
            found = parallel_map(self._decode, list(sources.values()))
            self._decoded.update(zip(sources, found, strict=True))
        else:
            self._decoded.update({key: self._decode(source) for key, source in sources.items()})

    def pixels(self, image: Any, user: Any, tile: int = 0) -> Pixels:
        """The pixels of a Blender image at the frame that `user` (its ImageUser) shows."""
        key, known = self._key(image, user, tile), self._cache.pixels
        if key not in known:
            report = Report()
            if tile == 0 and image is not None and image.source == "TILED":
                report.note(FIRST_TILE, image.name)
            self.expect([(image, user)], tile)
            decoded = self._decoded.pop(key, None)
            found = self._load(image, key, decoded, report, self._unsaved(image, tile))
            if found.repaired:
                report.note(
                    "Images have pixels that are not finite, which count as 0 ({}): repair them",
                    image.name,
                )
            known[key] = found, report
        found, report = known[key]
        self.report.add(report)
        return found

    def mean(self, source: Input) -> np.ndarray:
        """(3,) float64: the mean of a factor over its texture; an attribute counts as one half."""
        value = np.array(source.value, np.float64)
        if source.texture >= 0:
            value = value * self._mean(source.texture, source.channel)
        if source.attribute:
            value = value * 0.5
        value = np.clip(value + source.offset, source.low, source.high)
        return 1 - value if source.complement else value

    def range(self, source: Input) -> tuple[float, float]:
        """The least and the largest value that a factor's texture can give; of bytes 0 and 1."""
        texture = self.textures[source.texture]
        if texture.pixels.dtype == np.uint8:
            return 0.0, 1.0
        key = ("range", source.channel)
        low, high = self._memoized(
            texture.pixels, key, lambda: _range_of(texels(texture, source.channel))
        )
        return (min(low, 0.0), max(high, 0.0)) if texture.extension == "CLIP" else (low, high)

    def _mean(self, index: int, channel: str) -> np.ndarray:
        if (index, channel) not in self._means:
            texture = self.textures[index]
            key = ("mean", texture.encoding, channel)
            self._means[index, channel] = self._memoized(
                texture.pixels, key, lambda: mean_color(texture, channel)
            )
        return self._means[index, channel]

    def _key(self, image: Any, user: Any, tile: int = 0) -> ImageKey:
        if image is None:
            return ImageKey()
        original = _original(image)
        number = moving.shown_number(user, self._cache.frame) if user is not None else 0
        path = _path(original, user, tile, number)
        key = self._cache.key(image, original.as_pointer(), path)
        key = key._replace(number=number if image.source == "MOVIE" else tile)
        self.reads_memory = self.reads_memory or key.is_in_memory
        return key

    def _load(
        self,
        image: Any,
        key: ImageKey,
        decoded: Raw | ImageError | MemoryError | None,
        report: Report,
        unsaved: Callable[[], bytes | None],
    ) -> Pixels:
        if image is None:
            return Pixels(pixels.MAGENTA, "SRGB")
        try:
            with _that_fits(image.name):
                if isinstance(decoded, MemoryError):
                    raise decoded
                return self._read(_original(image), key, decoded, unsaved)
        except ImageError as error:
            report.note(
                f"Image '{image.name}' {error}: {IS_MAGENTA}; find or pack its file ('{key.path}')"
            )
            return Pixels(pixels.MAGENTA, "SRGB")

    def _unsaved(self, image: Any, tile: int) -> Callable[[], bytes | None]:
        """As `pixels.source` takes it."""
        return lambda: self._cache.saved_tile(_original(image), tile)

    def _read(
        self,
        image: Any,
        at: ImageKey,
        decoded: Raw | ImageError | None,
        unsaved: Callable[[], bytes | None],
    ) -> Pixels:
        space = image.colorspace_settings
        key = (image.alpha_mode, space.name, space.is_data, colorspace.working_space())
        read = partial(pixels.read, image, at.path, decoded, at.number, unsaved)
        if not isinstance(decoded, Raw):
            recipe = pixels.recipe(image)
            return self._made((*recipe, *key), read) if recipe is not None else read()
        return self._memoized(decoded.rgba, key, read)


@contextmanager
def _that_fits(name: str) -> Iterator[None]:
    """Names the image in a MemoryError."""
    try:
        yield
    except MemoryError as error:
        raise MemoryError(
            f"image '{name}' does not fit into it: use a smaller one, or close programs"
        ) from error


def _work(values: np.ndarray, key: Hashable, work: Callable[[], Any]) -> Any:
    """`Decoded.memoized` where nothing is kept."""
    return work()


def _make(recipe: Hashable, work: Callable[[], Any]) -> Any:
    """`Decoded.made` where nothing is kept."""
    return work()


def _range_of(values: np.ndarray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def texels(texture: Texture, channel: str) -> np.ndarray:
    """(h w, 3) float32 scene-linear colours of a texture, or its alpha or luminance as grey."""
    rgba = texture.pixels.reshape(-1, 4)
    if channel == "ALPHA":
        return np.repeat(colorspace.as_float(rgba[:, 3:]), 3, 1)
    rgb = rgba[:, :3]
    colors = colorspace.SRGB_BYTE[rgb] if texture.encoding == "SRGB" else colorspace.as_float(rgb)
    if channel == "COLOR":
        return colors
    return np.repeat(colors @ np.array(colorspace.LUMA, np.float32)[:, None], 3, 1)


def mean_color(texture: Texture, channel: str) -> np.ndarray:
    """(3,) float64: the mean of `texels`. Bytes are counted instead of decoded one by one."""
    stored = texture.pixels
    if stored.dtype != np.uint8:
        return texels(texture, channel).mean(0, dtype=np.float64)
    columns = [3] if channel == "ALPHA" else [0, 1, 2]
    if texture.encoding == "SRGB" and channel != "ALPHA":
        counts = [np.bincount(stored[..., k].reshape(-1), minlength=256) for k in columns]
        means = np.array(
            [colorspace.SRGB_BYTE.astype(np.float64) @ count / count.sum() for count in counts]
        )
    else:  # column by column first: 32 bits hold the sums of 16 M rows
        means = stored.sum(0, dtype=np.uint32).sum(0, dtype=np.uint64)[columns] / (
            255.0 * stored.shape[0] * stored.shape[1]
        )
    if channel == "LUMINANCE":
        means = means @ np.array(colorspace.LUMA)
    return means if channel == "COLOR" else np.full(3, means)


def _source(image: Any, path: str, unsaved: Callable[[], bytes | None]) -> pixels.Source | None:
    """None where there is nothing to decode: reading the image says why."""
    try:
        return pixels.source(image, path, unsaved)
    except ImageError:
        return None


def _original(image: Any) -> Any:
    return image.original or image


def _path(image: Any, user: Any, tile: int, number: int) -> str:
    """The absolute path of the file shown now; of a tiled image, that of the tile with this number,
    or of its first for 0. number: of a sequence's file.
    """
    if tile:
        import bpy

        row, column = divmod(tile - FIRST, TILES_IN_A_ROW)
        named = bpy.path.abspath(image.filepath, library=image.library)
        named = named.replace("<UDIM>", str(tile))
        return named.replace("<UVTILE>", f"u{column + 1}_v{row + 1}")
    path = (
        image.filepath_from_user(image_user=user)
        if user is not None
        else image.filepath_from_user()
    )
    if user is not None and image.source == "SEQUENCE" and number != user.frame_current:
        return moving.numbered(path, number)
    return path.replace("<UDIM>", str(image.tiles[0].number if image.tiles else FIRST)).replace(
        "<UVTILE>", "u1_v1"
    )
