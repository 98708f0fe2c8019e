"""The views of a stereoscopic or multi-view render, and where each looks from."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..export import Looker

_SIDES = {"left": -1, "right": 1}


def view_names(render: Any) -> tuple[str, ...]:
    """Of the views that Blender wants a picture of; "" alone where it wants but the camera's."""
    if not render.use_multiview:
        return ("",)
    stereo = render.views_format == "STEREO_3D"
    names = tuple(
        view.name for view in render.views if view.use and (not stereo or view.name in _SIDES)
    )
    return names or ("",)


def looker_of(
    render_engine: bpy.types.RenderEngine, view: str, depsgraph: bpy.types.Depsgraph
) -> Looker | None:
    """Where a view looks from at the frame that is evaluated; None for the scene's camera."""
    if not view:
        return None
    render_engine.active_view_set(view)
    camera = render_engine.camera_override
    if camera is None:
        return None
    camera = camera.evaluated_get(depsgraph)
    is_spherical = render_engine.use_spherical_stereo(camera)
    matrix = render_engine.camera_model_matrix(camera, use_spherical_stereo=is_spherical)
    return Looker(
        camera,
        np.array(matrix, np.float64),
        render_engine.camera_shift_x(camera, use_spherical_stereo=is_spherical),
        _SIDES.get(view, 0) if is_spherical else 0,
    )
