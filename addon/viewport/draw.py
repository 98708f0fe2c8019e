"""A picture on the screen: a half-float texture through Blender's display transform. Only here does
the viewport touch `gpu`.
"""

from __future__ import annotations

from typing import Any

import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d
from mathutils import Matrix


class Picture:
    """A texture and where it lies in the region, in screen pixels."""

    def __init__(
        self, pixels: np.ndarray, corner: tuple[float, float], size: tuple[float, float]
    ) -> None:
        """pixels: (h, w, 4) float32 scene-linear, premultiplied, row 0 at the bottom. Needs
        Blender's graphics context.
        """
        height, width = pixels.shape[:2]
        buffer = gpu.types.Buffer(
            "FLOAT", width * height * 4, np.ascontiguousarray(pixels, np.float32).reshape(-1)
        )
        self._texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)
        self._corner, self._size = corner, size

    def draw(self, render_engine: Any, scene: Any) -> None:
        """Into the active framebuffer of the region that is being drawn."""
        gpu.state.blend_set("ALPHA_PREMULT")
        render_engine.bind_display_space_shader(scene)
        try:
            with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
                gpu.matrix.load_identity()
                gpu.matrix.load_projection_matrix(_pixel_projection(*gpu.state.viewport_get()[2:]))
                draw_texture_2d(self._texture, self._corner, *self._size)
        finally:
            render_engine.unbind_display_space_shader()
            gpu.state.blend_set("NONE")


def _pixel_projection(width: int, height: int) -> Matrix:
    """Of coordinates in whole pixels. Blender's own is off by a hundredth of a pixel, which would
    mix each pixel with its neighbours.
    """
    return Matrix(((2 / width, 0, 0, -1), (0, 2 / height, 0, -1), (0, 0, -1, 0), (0, 0, 0, 1)))


_FULL_SCALE = {"Error": 8.0, "Samples": None, "Cost": None}
"""Passes shown as heat, and what is hottest: None for the largest value of the picture."""
_HEAT = np.array(
    [[0.0, 0.0, 0.02], [0.05, 0.02, 0.3], [0.5, 0.03, 0.25], [0.95, 0.25, 0.02], [1.0, 0.9, 0.4]],
    np.float32,
)
"""Colours from none to the most, evenly spaced, ever brighter."""


def as_colors(values: np.ndarray, name: str = "Combined") -> np.ndarray:
    """(h, w, c) of a pass as (h, w, 4) premultiplied colours: heat for what counts work or error,
    other numbers as grey, three channels as they are.
    """
    if values.shape[2] == 4:
        return values
    colors = np.ones((*values.shape[:2], 4), np.float32)
    colors[..., :3] = _heat(values[..., 0], _FULL_SCALE[name]) if name in _FULL_SCALE else values
    return colors


def _heat(values: np.ndarray, full_scale: float | None) -> np.ndarray:
    """(h, w, 3) scene-linear colours of (h, w) numbers from 0 to `full_scale`."""
    top = float(values.max()) if full_scale is None else full_scale
    place = np.clip(values / max(top, 1e-30), 0.0, 1.0) * (len(_HEAT) - 1)
    return np.stack(
        [np.interp(place, np.arange(len(_HEAT)), channel) for channel in _HEAT.T], -1
    ).astype(np.float32)
