"""Pixels of a Blender image, by OpenImageIO from its file or packed bytes, or from Blender itself; row 0 at the bottom, straight alpha.

OpenImageIO is preferred: it decodes without loading the image into Blender. Where it is not there, or where only Blender knows the pixels
(generated, painted, movies), `Image.pixels` gives the same values: bytes come back exactly.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from . import colorspace

MAGENTA = np.array([[[255, 0, 255, 255]]], np.uint8)
"""What a missing image looks like, as in Cycles."""


class ImageError(Exception):
    """Why an image cannot be read, in words that follow the image's name."""


@dataclass(frozen=True, eq=False)
class Pixels:
    """pixels (h, w, 4) uint8 or float32 and encoding as in `engine.scene.Texture`; associated: colours count times alpha where a node
    uses the colour alone."""

    pixels: np.ndarray
    encoding: str
    associated: bool = False


@dataclass(frozen=True, eq=False)
class Raw:
    """Decoded values: (h, w, 1-4) uint8 or float32; linear: already scene-linear; premultiplied: colours hold alpha already."""

    values: np.ndarray
    linear: bool = False
    premultiplied: bool = False


def openimageio() -> Any:
    """The module, also where the bpy wheel hides it; None where there is none."""
    try:
        import OpenImageIO
    except ImportError:
        import bpy

        try:
            bpy.utils.expose_bundled_modules()
            import OpenImageIO
        except (AttributeError, ImportError):
            return None
    return OpenImageIO


def read(image: Any, path: str) -> Pixels:
    """Pixels of `image` (original data-block), of the file `path` where the image stands for several files. Raises ImageError."""
    raw = _raw(image, path)
    if raw.values.size == 0:
        raise ImageError("is empty")
    rgba = _four_channels(raw.values, image.alpha_mode)
    return _managed(rgba, raw, image)


def _raw(image: Any, path: str) -> Raw:
    """From the packed bytes or the file, or from Blender where only it knows."""
    if image.source in ("GENERATED", "MOVIE") or image.is_dirty or openimageio() is None:
        return _from_blender(image)
    packed = _packed_bytes(image, path)
    if packed is None and not Path(path).is_file():
        raise ImageError(f"has no file at '{path}'")
    try:
        values = _from_bytes(packed, path) if packed is not None else _from_file(path)
    except ImageError:
        return _from_blender(image)
    return Raw(values[0], premultiplied=values[1] and image.alpha_mode == "PREMUL")


def _packed_bytes(image: Any, path: str) -> bytes | None:
    files = list(image.packed_files)
    same = [file for file in files if PurePath(file.filepath).name == PurePath(path).name]
    if not files or (image.source != "FILE" and not same):
        return None
    return bytes((same or files)[0].packed_file.data if (same or files)[0].packed_file else b"")


def _from_bytes(data: bytes, path: str) -> tuple[np.ndarray, bool]:
    """OpenImageIO's Python door reads files only, so packed bytes pass through a temporary one."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / ("packed" + (PurePath(path).suffix or ".png"))
        file.write_bytes(data)
        return _from_file(str(file))


def _from_file(path: str) -> tuple[np.ndarray, bool]:
    """(h, w, 1-4) values as they lie in the file, and whether its format holds colours times alpha (OpenEXR does, PNG does not)."""
    oiio = openimageio()
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    file = oiio.ImageInput.open(path, config)
    if file is None:
        raise ImageError(f"cannot be read: {oiio.geterror().strip()}")
    try:
        spec = file.spec()
        bytes_only = spec.format == oiio.TypeDesc("uint8")
        values = file.read_image(0, 0, 0, spec.nchannels, "uint8" if bytes_only else "float")
        if values is None:
            raise ImageError(f"cannot be decoded: {file.geterror().strip()}")
        picked = np.asarray(values)[::-1][:, :, _color_channels(list(spec.channelnames))]
        return picked, not spec.get_int_attribute("oiio:UnassociatedAlpha", 0)
    finally:
        file.close()


def _color_channels(names: list[str]) -> list[int]:
    """Red, green, blue and alpha of a file with many channels; else its first four."""
    if len(names) <= 4:
        return list(range(len(names)))
    last = [name.rsplit(".", 1)[-1].upper() for name in names]
    found = [last.index(letter) for letter in "RGBA" if letter in last]
    return found if len(found) >= 3 else [0, 1, 2, 3]


def _from_blender(image: Any) -> Raw:
    """`Image.pixels`: bytes in the image's own colour space with straight alpha, or floats that are scene-linear and premultiplied."""
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
    if image.is_float:
        return Raw(values, linear=True, premultiplied=image.alpha_mode in ("STRAIGHT", "PREMUL"))
    return Raw(np.rint(values * 255).astype(np.uint8))


def _four_channels(values: np.ndarray, alpha_mode: str) -> np.ndarray:
    """(h, w, 4): grey and grey-alpha spread out, missing or ignored alpha opaque."""
    height, width, channels = values.shape
    rgba = np.empty((height, width, 4), values.dtype)
    rgba[:, :, :3] = values[:, :, :3] if channels >= 3 else values[:, :, :1]
    opaque = 255 if values.dtype == np.uint8 else 1.0
    has_alpha = channels in (2, 4) and alpha_mode != "NONE"
    rgba[:, :, 3] = values[:, :, -1] if has_alpha else opaque
    return rgba


def _managed(rgba: np.ndarray, raw: Raw, image: Any) -> Pixels:
    """Into scene-linear colour with straight alpha, as bytes with the sRGB curve where that loses nothing."""
    space, has_alpha = image.colorspace_settings, not _opaque(rgba)
    if raw.premultiplied and has_alpha:
        rgba = _straight(rgba)
    encoding = "LINEAR" if raw.linear else colorspace.stored_encoding(space.name, space.is_data)
    if encoding is None or (encoding == "SRGB" and rgba.dtype != np.uint8):
        try:
            rgba, encoding = colorspace.to_scene_linear(rgba, space.name, openimageio()), "LINEAR"
        except LookupError as error:
            raise ImageError(f"has the colour space {error}, which cannot be converted here") from error
    if rgba.dtype != np.uint8 and not np.isfinite(rgba.sum(dtype=np.float64)):
        rgba = np.nan_to_num(rgba, nan=0.0, posinf=0.0, neginf=0.0)
    return Pixels(np.ascontiguousarray(rgba), encoding, has_alpha and image.alpha_mode in ("STRAIGHT", "PREMUL"))


def associated(found: Pixels) -> np.ndarray:
    """(h, w, 4): colours times alpha, opaque. Bytes are multiplied as they are, under their curve and rounded down, as Cycles does."""
    color, alpha = found.pixels[:, :, :3], found.pixels[:, :, 3:]
    if color.dtype == np.uint8:
        product, opaque = (color.astype(np.uint16) * alpha // 255).astype(np.uint8), np.full_like(alpha, 255)
    else:
        product, opaque = color * alpha, np.ones_like(alpha)
    return np.concatenate([product, opaque], -1)


def _opaque(rgba: np.ndarray) -> bool:
    return bool((rgba[:, :, 3] == (255 if rgba.dtype == np.uint8 else 1)).all())


def _straight(rgba: np.ndarray) -> np.ndarray:
    """(h, w, 4) float32: colours divided by alpha, where there is any."""
    values = colorspace.as_float(rgba)
    alpha = values[:, :, 3:]
    return np.concatenate([np.divide(values[:, :, :3], alpha, where=alpha > 0, out=values[:, :, :3].copy()), alpha], -1)
