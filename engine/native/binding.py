"""The core's library, loaded by ctypes."""

from __future__ import annotations

import ctypes
import functools
import os
from ctypes import POINTER, c_char_p, c_double, c_int32, c_size_t, c_uint32, c_uint64, c_void_p

from . import core_types
from .core_types import (
    AccelData,
    AccelStatsData,
    HitsData,
    ProgressData,
    RaysData,
    RenderSettingsData,
    SceneData,
    StatsData,
    TangentData,
)
from .intact import damage

LIBRARY_VARIABLE = "GLINT_CORE_LIBRARY"
"""Environment variable with the path of another build of the core."""

ISA_VARIABLE = "GLINT_ISA"
"""Environment variable that picks one of the core's instruction sets."""

ERROR_BYTES = 8192

_SIGNATURES = {
    "glint_scene_create": (c_void_p, [POINTER(SceneData), c_char_p, c_size_t]),
    "glint_scene_create_like": (
        c_void_p,
        [c_void_p, POINTER(SceneData), c_int32, c_char_p, c_size_t],
    ),
    "glint_scene_destroy": (None, [c_void_p]),
    "glint_render_start": (c_void_p, [c_void_p, POINTER(RenderSettingsData), c_char_p, c_size_t]),
    "glint_render_wait": (ProgressData, [c_void_p, c_uint32]),
    "glint_render_move": (
        c_int32,
        [c_void_p, c_void_p, POINTER(RenderSettingsData), c_char_p, c_size_t],
    ),
    "glint_render_resume": (None, [c_void_p]),
    "glint_render_cancel": (None, [c_void_p]),
    "glint_render_picture": (c_void_p, [c_void_p, c_int32, c_uint64]),
    "glint_picture_values": (c_void_p, [c_void_p]),
    "glint_picture_free": (None, [c_void_p]),
    "glint_render_stats": (StatsData, [c_void_p]),
    "glint_render_error": (c_char_p, [c_void_p]),
    "glint_render_destroy": (None, [c_void_p]),
    "glint_isa": (c_char_p, []),
    "glint_accel_create": (
        c_void_p,
        [POINTER(AccelData), c_int32, c_uint32, c_char_p, c_size_t],
    ),
    "glint_accel_destroy": (None, [c_void_p]),
    "glint_accel_stats": (AccelStatsData, [c_void_p]),
    **{
        f"glint_accel_{question}_{precision}": (
            c_int32,
            [c_void_p, POINTER(RaysData), answer, c_char_p, c_size_t],
        )
        for question, answer in (("closest", POINTER(HitsData)), ("occluded", c_void_p))
        for precision in ("f32", "f64")
    },
    "glint_universal_hash": (None, [c_void_p, c_uint64, c_void_p]),
    "glint_function": (
        c_int32,
        [c_char_p, POINTER(c_double), POINTER(c_double), POINTER(c_double), c_uint64],
    ),
    "glint_math": (
        None,
        [c_int32, POINTER(c_double), POINTER(c_double), POINTER(c_double), c_uint64],
    ),
    "glint_tangents": (c_int32, [POINTER(TangentData), c_void_p]),
    "glint_program_run": (
        c_int32,
        [c_void_p, c_uint64, c_void_p, c_uint64, c_void_p, c_uint32, c_void_p, c_uint64],
    ),
}


def load_error() -> str | None:
    """Why the core's library cannot be used here; None when it can."""
    try:
        library()
    except (ImportError, OSError) as error:
        return str(error)
    return None


def library() -> ctypes.CDLL:
    """The core's library: the one that GLINT_CORE_LIBRARY names, else the installed `glint_core`
    wheel's.

    Raises ImportError when there is none, its version differs or it is damaged, OSError when it
    cannot be loaded.
    """
    path = os.environ.get(LIBRARY_VARIABLE)
    if not path:
        import glint_core

        installed = glint_core.library_path()
        if damage(installed):
            raise ImportError(f"{damage(installed)}: install Glint again")
        path = str(installed)
    return _load(path)


@functools.cache
def _load(path: str) -> ctypes.CDLL:
    core = ctypes.CDLL(path)
    version = getattr(core, "glint_abi_version", None)
    found = version() if version else None
    if found != core_types.ABI_VERSION:
        raise ImportError(
            f"{path} speaks version {found} of the core's interface, this is version "
            f"{core_types.ABI_VERSION}: after an update restart Blender"
        )
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(core, name)
        function.restype, function.argtypes = result, arguments
    return core
