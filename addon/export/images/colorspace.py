"""Colour spaces of images: which can stay bytes with the sRGB curve, and the rest to scene-linear
by Blender's own OpenColorIO config.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

REC709 = "Linear Rec.709"
LUMA = (0.2126, 0.7152, 0.0722)
"""Rec. 709 luminance: how a colour becomes a number where sockets of the two kinds are joined."""


def working_space() -> str:
    """The name of Blender's scene-linear space: Rec. 709 before 5.0, a choice of the file from then
    on.
    """
    import bpy

    settings = getattr(bpy.data, "colorspace", None)
    return settings.working_space if settings is not None else REC709


def stored_encoding(name: str, is_data: bool) -> str | None:
    """LINEAR or SRGB when values in the space `name` can be kept as they are, None when they must
    be converted.
    """
    working = working_space()
    if is_data or name in ("", "Non-Color", working):
        return "LINEAR"
    return "SRGB" if name == "sRGB" and working == REC709 else None


def srgb_to_linear(values: np.ndarray) -> np.ndarray:
    """The sRGB curve (IEC 61966-2-1) undone, elementwise, in the dtype of `values`."""
    return np.where(
        values <= 0.04045, values / 12.92, ((np.maximum(values, 0) + 0.055) / 1.055) ** 2.4
    ).astype(values.dtype)


BYTE = (np.arange(256) / 255).astype(np.float32)
"""What a byte is worth in 0 to 1."""
SRGB_BYTE = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
"""What a byte with the sRGB curve is worth, scene-linear."""


def as_float(rgba: np.ndarray) -> np.ndarray:
    """(h, w, 4) float32 of bytes or floats; bytes become 0 to 1."""
    return BYTE[rgba] if rgba.dtype == np.uint8 else rgba.astype(np.float32)


def to_scene_linear(rgba: np.ndarray, name: str, oiio: Any) -> np.ndarray:
    """(h, w, 4) float32 scene-linear colours of `rgba` in the space `name`, alpha untouched.

    Raises LookupError where the space needs OpenImageIO and OpenColorIO and they cannot convert it.
    """
    values = as_float(rgba)
    if name == "sRGB" and working_space() == REC709:
        values[:, :, :3] = srgb_to_linear(values[:, :, :3])
        return values
    if oiio is None:
        raise LookupError(name)
    return _converted(values, name, oiio)


def _converted(values: np.ndarray, name: str, oiio: Any) -> np.ndarray:
    import bpy

    config = str(Path(bpy.utils.system_resource("DATAFILES")) / "colormanagement" / "config.ocio")
    source = oiio.ImageBuf(np.ascontiguousarray(values[:, :, :3]))
    result = oiio.ImageBufAlgo.colorconvert(source, name, working_space(), False, "", "", config)
    if result.has_error:
        raise LookupError(f"{name}: {result.geterror().strip()}")
    values[:, :, :3] = result.get_pixels("float")
    return values
