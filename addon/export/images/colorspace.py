"""Colour spaces: which images can stay bytes with the sRGB curve, the rest to scene-linear by the
OpenColorIO configuration that Blender runs with; and what the working space makes of XYZ.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np

REC709 = "Linear Rec.709"
LUMA = (0.2126, 0.7152, 0.0722)
"""Rec. 709 luminance: how a colour becomes a number where sockets of the two kinds are joined."""
RGB_FROM_XYZ = np.array(
    [
        [3.2409699419, -1.5373831776, -0.4986107603],
        [-0.9692436363, 1.8759675015, 0.0415550574],
        [0.0556300797, -0.2039769589, 1.0569715142],
    ]
    if bpy.app.version >= (5, 0, 0)
    else [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
"""Rec. 709's, as the Blender that runs rounds it."""
_XYZ_FROM_ACES = np.array(
    [
        [0.938279849239345, -0.00445144581227847, 0.0166275235564231],
        [0.337368890823117, 0.729521566676754, -0.066890457499083],
        [0.00117395084939056, -0.00371070640198378, 1.09159450636463],
    ]
)
"""ACES AP0 to CIE XYZ with the white of D65, as Cycles has it."""
_ACES, _SCENE_LINEAR = "aces_interchange", "scene_linear"
"""Roles of configurations."""
_NEARLY = 1e-3
"""How far a matrix may be off Rec. 709's to be it."""


def own_configuration() -> str:
    """The user's configuration by OpenColorIO's own variable; "" for Blender's."""
    return os.environ.get("OCIO", "")


def working_space() -> str:
    """The name of Blender's scene-linear space: Rec. 709 before 5.0 but of a configuration of the
    user's own, a choice of the file from then on.
    """
    settings = getattr(bpy.data, "colorspace", None)
    if settings is not None:
        return settings.working_space
    return _SCENE_LINEAR if own_configuration() else REC709


def is_rec709() -> bool:
    """Whether the working space is Rec. 709 as Blender itself has it."""
    return working_space() == REC709 and not own_configuration()


def rgb_from_xyz() -> np.ndarray:
    """(3, 3): the working space's colours from CIE XYZ with the white of D65; Rec. 709's where that
    is not known.
    """
    if is_rec709():
        return RGB_FROM_XYZ
    return _rgb_from_xyz(_configuration(), working_space())


def from_rec709() -> np.ndarray:
    """(3, 3): the working space's colours from Rec. 709's."""
    found = rgb_from_xyz()
    return np.eye(3) if found is RGB_FROM_XYZ else found @ np.linalg.inv(RGB_FROM_XYZ)


def luma() -> tuple[float, float, float]:
    """The luminance of the working space's red, green and blue."""
    found = rgb_from_xyz()
    return LUMA if found is RGB_FROM_XYZ else tuple(np.linalg.inv(found)[1].tolist())


def openimageio() -> Any:
    """The module, also where the bpy wheel hides it; None where there is none."""
    try:
        import OpenImageIO
    except ImportError:
        try:
            bpy.utils.expose_bundled_modules()
            import OpenImageIO
        except (AttributeError, ImportError):
            return None
    return OpenImageIO


@lru_cache(maxsize=4)
def _rgb_from_xyz(configuration: str, working: str) -> np.ndarray:
    oiio, unit = openimageio(), np.eye(3, dtype=np.float32)[None]
    try:
        columns = _between(unit, _ACES, working, configuration, oiio)[0]
    except LookupError:
        return RGB_FROM_XYZ
    found = columns.T.astype(np.float64) @ np.linalg.inv(_XYZ_FROM_ACES)
    return RGB_FROM_XYZ if np.abs(found - RGB_FROM_XYZ).max() < _NEARLY else found


def stored_encoding(name: str, is_data: bool) -> str | None:
    """LINEAR or SRGB when values in the space `name` can be kept as they are, None when they must
    be converted.
    """
    if is_data or name in ("", "Non-Color", _SCENE_LINEAR, working_space()):
        return "LINEAR"
    return "SRGB" if name == "sRGB" and is_rec709() else None


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
    if name == "sRGB" and is_rec709():
        values[:, :, :3] = srgb_to_linear(values[:, :, :3])
        return values
    values[:, :, :3] = _between(values[:, :, :3], name, working_space(), _configuration(), oiio)
    return values


def _configuration() -> str:
    """The one that Blender runs with."""
    folder = Path(bpy.utils.system_resource("DATAFILES")) / "colormanagement"
    return own_configuration() or str(folder / "config.ocio")


def _between(
    values: np.ndarray, source: str, target: str, configuration: str, oiio: Any
) -> np.ndarray:
    """(h, w, 3) colours of one space in another. Raises LookupError where they cannot be had."""
    if oiio is None:
        raise LookupError(source)
    given = oiio.ImageBuf(np.ascontiguousarray(values))
    result = oiio.ImageBufAlgo.colorconvert(given, source, target, False, "", "", configuration)
    if result.has_error:
        raise LookupError(f"{source}: {result.geterror().strip()}")
    return result.get_pixels("float")
