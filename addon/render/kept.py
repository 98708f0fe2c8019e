"""What a render engine keeps between the frames of an animation, where the scene says Persistent
Data.
"""

from __future__ import annotations

from typing import Any

import bpy

from ... import engine
from ..export import Export
from ..export.sync.frames import export_frame
from ..export.sync.incremental import LiveExport
from .motion import blurs


class Kept:
    """The last frame's scene, as Blender has it and as the tracer does."""

    def __init__(self) -> None:
        self._export = LiveExport()
        self.renderer = engine.KeptRender()

    def export(self, depsgraph: bpy.types.Depsgraph, **options: Any) -> Export:
        """As `export_frame`."""
        return export_frame(self._export, depsgraph, **options)

    def close(self) -> None:
        self.renderer.close()


def keeps(render_engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether the depsgraph's updates will tell all that changes. Motion blur and the pass Vector
    take it to other frames and back, of which no update tells: that changes nothing for good but
    where scripts hear of each frame.
    """
    goes = blurs(depsgraph) or depsgraph.view_layer.use_pass_vector
    return (
        depsgraph.scene.render.use_persistent_data
        and not render_engine.is_preview
        and not (goes and _scripts_hear_of_frames())
    )


def _scripts_hear_of_frames() -> bool:
    """Whether others than Glint do."""
    handlers = bpy.app.handlers.frame_change_pre[:] + bpy.app.handlers.frame_change_post[:]
    own = __name__.rpartition(".addon.")[0]
    return not all(getattr(one, "__module__", "").startswith(own) for one in handlers)
