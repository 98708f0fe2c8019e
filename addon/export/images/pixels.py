"""Pixels of a Blender image, by OpenImageIO from its file or packed bytes, or from Blender itself;
row 0 at the bottom, straight alpha.

OpenImageIO is preferred: it decodes without loading the image into Blender. Where it is not there,
or where only Blender knows the pixels (generated, painted, movies), `Image.pixels` gives the same
values: bytes come back exactly.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from . import colorspace
from .colorspace import openimageio
from .moving import movie_picture

MAGENTA = np.array([[[255, 0, 255, 255]]], np.uint8)
"""What a missing image looks like, as in Cycles."""


class ImageError(Exception):
    """Why an image cannot be read, in words that follow the image's name."""


@dataclass(frozen=True, eq=False)
class Pixels:
    """pixels (h, w, 4) uint8 or float32 and encoding as in `engine.scene.Texture`; associated:
    colours count times alpha where a node uses the colour alone. repaired: values that are not
    finite count as 0. premultiplied: the file's colours held alpha, so that they may be there where
    alpha is 0. stored: as decoded, of colours that Cycles multiplies by alpha under their
    sRGB curve.
    """

    pixels: np.ndarray
    encoding: str
    associated: bool = False
    repaired: bool = False
    premultiplied: bool = False
    stored: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Raw:
    """Decoded values: (h, w, 4) uint8 or float32; opaque: alpha is 1 everywhere; linear: already
    scene-linear; premultiplied: colours hold alpha already. is_grey: of one or two channels.
    """

    rgba: np.ndarray
    opaque: bool
    is_grey: bool = False
    linear: bool = False
    premultiplied: bool = False


@dataclass(frozen=True)
class Source:
    """What an image is decoded from, apart from Blender: its packed bytes or, without any, the file
    at `path`.
    """

    path: str
    packed: bytes | None
    alpha_mode: str


def read(
    image: Any,
    path: str,
    decoded: Raw | ImageError | None,
    number: int = 0,
    unsaved: Callable[[], bytes | None] = lambda: None,
) -> Pixels:
    """Pixels of `image` (original data-block), of the file `path` where the image stands for
    several files. Raises ImageError.

    decoded: what `decode` gave for its `source`; None where it has none. number: of a movie's
    picture. unsaved: as of `source`.
    """
    if decoded is None:
        source(image, path, unsaved)  # raises where a file is missing
    if image.source == "MOVIE":
        return _managed(_from_movie(image, path, number), image)
    if image.source == "TILED" and not isinstance(decoded, Raw):
        raise decoded or ImageError("is tiled, which cannot be read without OpenImageIO")
    raw = decoded if isinstance(decoded, Raw) else _from_blender(image)
    return _managed(raw, image)


def _from_movie(image: Any, path: str, number: int) -> Raw:
    try:
        with movie_picture(path, number) as picture:
            picture.alpha_mode = image.alpha_mode
            return _from_blender(picture)
    except RuntimeError as error:
        raise ImageError(f"cannot be read: {str(error).strip()}") from error


def source(
    image: Any, path: str, unsaved: Callable[[], bytes | None] = lambda: None
) -> Source | None:
    """What there is to decode; None where only Blender knows the pixels. Raises ImageError where
    there is no file.

    unsaved: gives the bytes of a file of what only Blender has of a tiled image.
    """
    is_tiled, is_unsaved = image.source == "TILED", image.source == "GENERATED" or image.is_dirty
    if openimageio() is None or (is_unsaved and not is_tiled):
        return None
    if image.source == "MOVIE" and Path(path).is_file():
        return None
    packed = None if is_unsaved else _packed_bytes(image, path)
    if packed is None and (is_unsaved or not Path(path).is_file()):
        packed = unsaved()
        if packed is None:
            lack = "has tiles that are not saved" if is_unsaved else f"has no file at '{path}'"
            raise ImageError(lack)
    return Source(path, packed, image.alpha_mode)


def recipe(image: Any) -> tuple | None:
    """What Blender makes the values of a generated image from that nobody has painted; None for any
    other.
    """
    if image.source != "GENERATED" or image.is_dirty:
        return None
    made_as = (
        image.generated_type,
        image.generated_width,
        image.generated_height,
        tuple(image.generated_color),
    )
    return ("generated", *made_as, tuple(image.size), image.channels, image.is_float)


def decode(origin: Source) -> Raw | ImageError | MemoryError:
    """The values, or why there are none. Asks nothing of Blender: any thread may call it."""
    try:
        if origin.packed is not None:
            return _from_bytes(origin.packed, origin.path, origin.alpha_mode)
        return _from_file(origin.path, origin.alpha_mode)
    except (ImageError, MemoryError) as error:
        return error


def _packed_bytes(image: Any, path: str) -> bytes | None:
    files = list(image.packed_files)
    same = [file for file in files if PurePath(file.filepath).name == PurePath(path).name]
    if not files or (image.source != "FILE" and not same):
        return None
    return bytes((same or files)[0].packed_file.data if (same or files)[0].packed_file else b"")


def _from_bytes(data: bytes, path: str, alpha_mode: str) -> Raw:
    """OpenImageIO's Python API reads files only, so packed bytes pass through a temporary one."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / ("packed" + _suffix(data, path))
        file.write_bytes(data)
        return _from_file(str(file), alpha_mode)


_FIRST_BYTES = {b"\xff\xd8\xff": ".jpg", b"\x89PNG": ".png", b"v/1\x01": ".exr"}
"""OpenImageIO tries the format that the name says first; from another it decodes some images twice.
"""
_LONGEST_SUFFIX = 8
"""Letters; longer ones name no format, and systems refuse names of hundreds."""


def _suffix(data: bytes, path: str) -> str:
    """What the name of a file with these bytes should end with."""
    known = next((suffix for first, suffix in _FIRST_BYTES.items() if data.startswith(first)), None)
    named = PurePath(path).suffix[1:]
    return known or (f".{named}" if named.isalnum() and len(named) <= _LONGEST_SUFFIX else ".png")


def _from_file(path: str, alpha_mode: str) -> Raw:
    """The values as they lie in the file."""
    oiio = openimageio()
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(path, config)
    if file is None:
        raise ImageError(f"cannot be read: {oiio.geterror().strip()}")
    try:
        spec = file.spec()
        is_bytes = spec.format == oiio.TypeDesc("uint8")
        channels = _color_channels(list(spec.channelnames))
        rgba = np.empty((spec.height, spec.width, 4), np.uint8 if is_bytes else np.float32)
        upward = rgba[::-1]
        for row, band in _bands(file, spec, "uint8" if is_bytes else "float"):
            values = band if len(channels) == spec.nchannels else band[:, :, channels]
            _spread(values, alpha_mode, upward[row : row + len(band)])
        # OpenEXR holds colours times alpha, PNG does not
        premultiplied = not spec.get_int_attribute("oiio:UnassociatedAlpha", 0)
        return _raw(rgba, len(channels), premultiplied=premultiplied)
    finally:
        file.close()


_BAND = 256
"""Rows: no format packs more of them together, and they are spread while caches hold them."""


def _bands(file: Any, spec: Any, kind: str) -> Iterator[tuple[int, np.ndarray]]:
    """First row and (rows, w, n) values of bands of a file, from the top; of one in tiles all at
    once.
    """
    rows = _BAND if spec.tile_width == 0 else max(spec.height, 1)
    for row in range(0, spec.height, rows):
        few = min(rows, spec.height - row)
        if few == spec.height:
            values = file.read_image(0, 0, 0, spec.nchannels, kind)
        else:
            y = spec.y + row
            values = file.read_scanlines(y, y + few, 0, 0, spec.nchannels, kind)
        if values is None:
            raise ImageError(f"cannot be decoded: {file.geterror().strip()}")
        yield row, np.asarray(values).reshape(few, spec.width, spec.nchannels)


def _color_channels(names: list[str]) -> list[int]:
    """Red, green, blue and alpha of a file with more than four channels, or its first four; all of
    one with fewer.
    """
    if len(names) <= 4:
        return list(range(len(names)))
    last = [name.rsplit(".", 1)[-1].upper() for name in names]
    found = [last.index(letter) for letter in "RGBA" if letter in last]
    return found if len(found) >= 3 else [0, 1, 2, 3]


def _from_blender(image: Any) -> Raw:
    """`Image.pixels`: bytes in the image's own colour space with straight alpha, or floats that are
    scene-linear and premultiplied.
    """
    width, height = image.size
    channels = image.channels
    if width * height * channels == 0:
        raise ImageError("cannot be read or is empty")
    values = np.empty(width * height * channels, np.float32)
    try:
        image.pixels.foreach_get(values)
    except (RuntimeError, TypeError) as error:
        raise ImageError(f"cannot be read: {error}") from error
    values = values.reshape(height, width, channels)
    if not image.is_float:
        values *= 255  # in place, and rounded by hand: half the time
        values += 0.5
        values = values.astype(np.uint8)
    rgba = np.empty((height, width, 4), values.dtype)
    _spread(values, image.alpha_mode, rgba)
    premultiplied = image.is_float and image.alpha_mode in ("STRAIGHT", "PREMUL")
    return _raw(rgba, channels, image.is_float, premultiplied)


def _spread(values: np.ndarray, alpha_mode: str, rgba: np.ndarray) -> None:
    """Values (h, w, 1-4) into (h, w, 4): grey and grey-alpha spread out, missing or ignored alpha
    opaque.
    """
    channels = values.shape[2]
    has_alpha = channels in (2, 4) and alpha_mode != "NONE"
    if channels == 4 and has_alpha:
        rgba[:] = values
        return
    if channels == 3 and values.dtype == np.uint8 and values.flags.c_contiguous:
        # four bytes at once take a quarter of the time; those of the last row would end beyond it
        words = np.ndarray((len(values) - 1, values.shape[1]), "<u4", values, 0, values.strides[:2])
        np.bitwise_or(words, np.uint32(0xFF000000), out=rgba[:-1].view("<u4")[:, :, 0])
        values, rgba = values[-1:], rgba[-1:]
    for k in range(3):  # NumPy takes twice as long for the three at once
        rgba[:, :, k] = values[:, :, k if channels >= 3 else 0]
    rgba[:, :, 3] = values[:, :, -1] if has_alpha else 255 if values.dtype == np.uint8 else 1


def _raw(rgba: np.ndarray, channels: int, linear: bool = False, premultiplied: bool = False) -> Raw:
    """Of an image that had so many channels. Raises ImageError where there are no values."""
    if rgba.size == 0 or channels == 0:
        raise ImageError("is empty")
    return Raw(rgba, channels in (1, 3) or _opaque(rgba), channels < 3, linear, premultiplied)


def _managed(raw: Raw, image: Any) -> Pixels:
    """Into scene-linear colour with straight alpha, as bytes with the sRGB curve where that loses
    nothing. Data, such as normal maps, is left as it is, and packed channels, and grey beside
    alpha, as in Cycles.
    """
    space, rgba, has_alpha = image.colorspace_settings, raw.rgba, not raw.opaque
    is_apart = has_alpha and not space.is_data and image.alpha_mode in ("STRAIGHT", "PREMUL")
    divides = raw.premultiplied and is_apart
    is_apart = is_apart and (divides or not raw.is_grey)
    stored = None
    encoding = "LINEAR" if raw.linear else colorspace.stored_encoding(space.name, space.is_data)
    if encoding is None or (encoding == "SRGB" and (divides or rgba.dtype != np.uint8)):
        try:
            stored = rgba if is_apart and encoding == "SRGB" and not divides else None
            rgba, encoding = colorspace.to_scene_linear(rgba, space.name, openimageio()), "LINEAR"
        except LookupError as error:
            raise ImageError(
                f"has the colour space {error}, which cannot be converted here"
            ) from error
    if divides:
        rgba = _straight(rgba)
    broken = rgba.dtype != np.uint8 and not np.isfinite(rgba.sum(dtype=np.float64))
    if broken:
        rgba = np.nan_to_num(rgba, nan=0.0, posinf=0.0, neginf=0.0)
    return Pixels(np.ascontiguousarray(rgba), encoding, is_apart, broken, divides, stored)


def associated(found: Pixels) -> np.ndarray:
    """(h, w, 4): colours times alpha, opaque; as in the file where that held the product. Bytes are
    multiplied as they are, under their curve and rounded down, as Cycles does.
    """
    if found.stored is not None:
        rgba = colorspace.as_float(found.stored)
        rgba[:, :, :3] = colorspace.srgb_to_linear(rgba[:, :, :3] * rgba[:, :, 3:])
        rgba[:, :, 3] = 1
        return rgba
    color, alpha = found.pixels[:, :, :3], found.pixels[:, :, 3:]
    if color.dtype == np.uint8:
        product, opaque = (
            (color.astype(np.uint16) * alpha // 255).astype(np.uint8),
            np.full_like(alpha, 255),
        )
    else:
        factor = np.where(alpha > 0, alpha, 1) if found.premultiplied else alpha
        product, opaque = color * factor, np.ones_like(alpha)
    return np.concatenate([product, opaque], -1)


def _opaque(rgba: np.ndarray) -> bool:
    return bool((rgba[:, :, 3] == (255 if rgba.dtype == np.uint8 else 1)).all())


def _straight(rgba: np.ndarray) -> np.ndarray:
    """(h, w, 4) float32: colours divided by alpha, where there is any."""
    values = colorspace.as_float(rgba)
    alpha = values[:, :, 3:]
    return np.concatenate(
        [np.divide(values[:, :, :3], alpha, where=alpha > 0, out=values[:, :, :3].copy()), alpha],
        -1,
    )
