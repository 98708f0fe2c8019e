"""Picture files: their pixels, and the texts in their headers."""

from __future__ import annotations

import os
import socket
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np

_EXR = b"v/1\x01"
_PNG = b"\x89PNG\r\n\x1a\n"
_MULTIPART = 0x1000
_EXR_BLOCK_LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256)
"""Lines of a block by compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB."""
_PNG_END = b"IEND\xaeB`\x82"


def render_result() -> bpy.types.Image:
    """The image that holds the last render; its name is the user's to change. Raises RuntimeError
    before the first render.
    """
    found = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    if found is None:
        raise RuntimeError("Blender has no Render Result: nothing was rendered")
    return found


def read_picture(path: Path) -> np.ndarray:
    """(h, w, 4) float32, row 0 at the bottom, of a file with one picture. Raises RuntimeError where
    Blender cannot read it.
    """
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.empty(width * height * 4, np.float32)
        if not pixels.size:
            raise RuntimeError(f"{path}: there are no pixels in it")
        image.pixels.foreach_get(pixels)
        return pixels.reshape(height, width, 4)
    finally:
        bpy.data.images.remove(image)


def write_picture(path: Path, picture: np.ndarray) -> None:
    """An OpenEXR file of 32 bits of what `read_picture` gives. Raises RuntimeError or OSError."""
    height, width = picture.shape[:2]
    image = bpy.data.images.new(path.name, width, height, alpha=True, float_buffer=True)
    try:
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.ascontiguousarray(picture, np.float32).ravel())
        image.file_format, image.filepath_raw = "OPEN_EXR", str(path)
        image.save()
    finally:
        bpy.data.images.remove(image)
    check_whole(path)


def read_planes(path: Path) -> dict[str, np.ndarray] | None:
    """Every channel of every layer by name, (h, w) float32 each, row 0 at the bottom; None for a
    multilayer file where this Blender has no OpenImageIO to look into it.
    """
    oiio = _find_image_io()
    if oiio is None:
        return (
            None
            if is_multilayer(path)
            else dict(zip("RGBA", np.moveaxis(read_picture(path), -1, 0), strict=True))
        )
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise RuntimeError(f"{path}: {oiio.geterror()}")
    planes, part = {}, 0
    while source.seek_subimage(part, 0):
        names = source.spec().channelnames
        pixels = np.asarray(source.read_image(part, 0, 0, len(names), oiio.FLOAT), np.float32)
        planes |= {name: np.flipud(pixels[..., number]) for number, name in enumerate(names)}
        part += 1
    source.close()
    return planes


def open_image_io() -> ModuleType:
    """The module OpenImageIO. Raises RuntimeError where this Blender has none."""
    oiio = _find_image_io()
    if oiio is None:
        raise RuntimeError(
            "this Blender has no OpenImageIO, which tiles are kept with: install it into its "
            "Python (pip install OpenImageIO), or draw whole frames"
        )
    return oiio


def _find_image_io() -> ModuleType | None:
    """Blender's wheel hides its OpenImageIO until it is asked; the one of 4.2 has none."""
    if hasattr(bpy.utils, "expose_bundled_modules"):
        bpy.utils.expose_bundled_modules()
    try:
        import OpenImageIO
    except ImportError:
        return None
    return OpenImageIO


@contextmanager
def hidden(path: Path) -> Iterator[Path]:
    """Another name in the same folder, to write to and to look at; what is there at the end gets
    its own, and where an error leaves nothing does.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    worker = f"{socket.gethostname()}-{os.getpid()}"
    part = path.with_name(f".{path.stem}.{worker}{path.suffix}")
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file, or none: what was there before stays. Raises OSError."""
    with hidden(path) as part:
        part.write_bytes(data)


# --- headers
# --------------------------------------------------------------------------------------------------


def header_texts(path: Path) -> dict[str, str]:
    """The texts in the header of an OpenEXR or PNG file. Raises ValueError for any other file or a
    broken one.
    """
    data = path.read_bytes()
    try:
        if data.startswith(_EXR):
            return {
                name: value.decode(errors="replace")
                for name, kind, value in _exr_attributes(data)
                if kind == "string"
            }
        if data.startswith(_PNG):
            return dict(_png_texts(data))
    except (IndexError, ValueError, struct.error, zlib.error) as error:
        raise ValueError(f"{path}: the header is broken: {error}") from error
    raise ValueError(f"{path} is neither OpenEXR nor PNG, so it carries no stamp")


def check_whole(path: Path) -> None:
    """Raises OSError where an OpenEXR or PNG file is missing or cut off: Blender says on a full
    disk, too, that it saved the picture.
    """
    data = path.read_bytes() if path.is_file() else b""
    try:
        is_whole = _exr_is_whole(data) if data.startswith(_EXR) else data.endswith(_PNG_END)
    except (IndexError, KeyError, ValueError, struct.error):
        is_whole = False
    if not is_whole:
        raise OSError(
            f"{path} is not whole ({len(data)} bytes are there): make room on its disk or write "
            "elsewhere, then render again"
        )


def is_multilayer(path: Path) -> bool:
    """Whether an EXR file names its channels by layer."""
    data = path.read_bytes()
    return data.startswith(_EXR) and any(
        kind == "chlist" and b"." in value for _, kind, value in _exr_attributes(data)
    )


def sample_bits(path: Path) -> int:
    """Bits of a colour value: 16 or 32 in an EXR file, 8 or 16 in a PNG."""
    data = path.read_bytes()
    if data.startswith(_PNG):
        return 16 if data[24] == 16 else 8
    channels = next(value for _, kind, value in _exr_attributes(data) if kind == "chlist")
    first_kind = channels.index(b"\0") + 1
    return 16 if struct.unpack_from("<i", channels, first_kind)[0] == 1 else 32


def _exr_headers(data: bytes) -> tuple[list[dict[str, tuple[str, bytes]]], int]:
    """Every part's attributes, name → (type, value), and where the tables of blocks begin (OpenEXR
    file layout).
    """
    multipart, place, parts = struct.unpack_from("<I", data, 4)[0] & _MULTIPART, 8, []
    while data[place] and (multipart or not parts):
        parts.append({})
        while data[place]:
            name_end = data.index(b"\0", place)
            kind_end = data.index(b"\0", name_end + 1)
            (size,) = struct.unpack_from("<I", data, kind_end + 1)
            start = kind_end + 5
            parts[-1][data[place:name_end].decode()] = (
                data[name_end + 1 : kind_end].decode(),
                data[start : start + size],
            )
            place = start + size
        place += 1
    return parts, place + bool(multipart)


def _exr_attributes(data: bytes) -> Iterator[tuple[str, str, bytes]]:
    """(name, type, value) of every part's header."""
    for part in _exr_headers(data)[0]:
        for name, (kind, value) in part.items():
            yield name, kind, value


def _exr_is_whole(data: bytes) -> bool:
    """Whether the tables name a place for every block of lines, and the last of them lies inside
    the file.
    """
    multipart = struct.unpack_from("<I", data, 4)[0] & _MULTIPART
    parts, tables = _exr_headers(data)
    places = struct.unpack_from(f"<{sum(map(_exr_blocks, parts))}Q", data, tables)
    # behind the part's number, in files of several, and that of the block's first line
    size_at = max(places) + (8 if multipart else 4)
    return min(places) > 0 and size_at + 4 + struct.unpack_from("<i", data, size_at)[0] <= len(data)


def _exr_blocks(part: dict[str, tuple[str, bytes]]) -> int:
    """Blocks of lines in a part, none of which Blender makes of tiles."""
    _, low, _, high = struct.unpack("<4i", part["dataWindow"][1])
    return -(-(high - low + 1) // _EXR_BLOCK_LINES[part["compression"][1][0]])


def _png_texts(data: bytes) -> Iterator[tuple[str, str]]:
    """tEXt, zTXt and iTXt chunks (PNG specification, section 11.3.4)."""
    place = len(_PNG)
    while place + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, place)
        chunk = data[place + 8 : place + 8 + size]
        if kind in (b"tEXt", b"zTXt", b"iTXt"):
            name, value = chunk.split(b"\0", 1)
            yield name.decode("latin-1"), _png_value(kind, value)
        place += size + 12


def _png_value(kind: bytes, value: bytes) -> str:
    if kind == b"tEXt":
        return value.decode("latin-1")
    if kind == b"zTXt":
        return zlib.decompress(value[1:]).decode("latin-1")
    packed, text = value[0], value[2:].split(b"\0", 2)[2]
    return (zlib.decompress(text) if packed else text).decode()
