"""Ray queries through the native core."""

from __future__ import annotations

import ctypes
from ctypes import byref
from typing import Any

import numpy as np

from ..errors import SceneError
from ..scene import Scene
from ..scene.ray_batch import RayBatch
from . import binding
from .binding import ERROR_BYTES
from .core_types import AccelData, Build, HitsData, InstanceFlags, RaysData
from .packer import address
from .packing import pack_scene

Array = np.ndarray

_VISIBLE: dict[str | None, int] = {
    kind: InstanceFlags[f"VISIBLE_{kind.upper()}"].value
    for kind in ("camera", "mirror", "shadow", "transmission", "diffuse")
}
_VISIBLE[None] = sum(_VISIBLE.values())


class NativeQueries:
    """Geometry in the core. Lives as long as anybody holds it, so that closing an accelerator never
    pulls trees from under a query.
    """

    def __init__(self, scene: Scene, threads: int, quick: bool) -> None:
        """scene: sound (`scene_problems`).  Raises SceneError for what the core refuses,
        MemoryError, ImportError and OSError.
        """
        self._core, self._threads, self._handle = binding.library(), threads, None
        self._packed = pack_scene(scene)
        table = self._packed.data
        names = (name for name, *_ in AccelData._fields_)
        data = AccelData(**{name: getattr(table, name) for name in names})
        error = ctypes.create_string_buffer(ERROR_BYTES)
        self._handle = self._core.glint_accel_create(
            byref(data), Build.FAST if quick else Build.BALANCED, threads, error, ERROR_BYTES
        )
        if not self._handle:
            raise _refusal(error)
        found = self._core.glint_accel_stats(self._handle)
        self.bounds = np.array([found.low, found.high])
        self.stats = {
            name: float(getattr(found, name))
            for name in ("instances", "primitives", "dropped", "bytes", "nodes")
        }
        self.stats["build"] = found.build_seconds

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._core.glint_accel_destroy(self._handle)

    def closest(self, rays: RayBatch) -> tuple[Array, Array, Array, Array, Array]:
        """t, instance, primitive, u, v of `accelerator.Hits`."""
        dtypes = (rays.origins.dtype, np.int32, np.int32, np.float32, np.float32)
        t, instance, primitive, u, v = (np.empty(rays.size, dtype) for dtype in dtypes)
        hits = HitsData(*(answer.ctypes.data for answer in (t, instance, primitive, u, v)))
        self._ask("closest", byref(hits), rays)
        return t, instance, primitive, u, v

    def occluded(self, rays: RayBatch) -> Array:
        """(size,) bool."""
        blocked = np.empty(rays.size, bool)
        self._ask("occluded", blocked.ctypes.data, rays)
        return blocked

    def _ask(self, question: str, room: Any, rays: RayBatch) -> None:
        arrays = rays.origins, rays.directions, rays.t_min, rays.t_max
        strides = [
            0 if len(array) == 1 else columns
            for array, columns in zip(arrays, (3, 3, 1, 1), strict=True)
        ]
        asked = RaysData(
            *map(address, arrays), rays.size, *strides, _VISIBLE[rays.visibility], self._threads
        )
        width = "f32" if rays.origins.dtype == np.float32 else "f64"
        ask = getattr(self._core, f"glint_accel_{question}_{width}")
        error = ctypes.create_string_buffer(ERROR_BYTES)
        if ask(self._handle, byref(asked), room, error, ERROR_BYTES):
            raise _refusal(error)


def _refusal(error: ctypes.Array) -> Exception:
    text = error.value.decode(errors="replace")
    return (
        MemoryError("the core ran out of memory") if text == "out of memory" else SceneError(text)
    )
