"""What a render engine keeps between the frames of an animation, where the scene says Persistent
Data.
"""

from __future__ import annotations

from typing import Any

import bpy

from ... import engine
from ..export import Export, aovs_of
from ..export.culling import culls
from ..export.sync.frames import export_frame
from ..export.sync.incremental import LiveExport


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
    """Whether the depsgraph's updates will tell all that changes: Blender keeps one for all view
    layers, and motion blur and the pass Vector take it to other frames. AOVs and light groups are
    read by whole exports alone, and what Simplify culls changes as the camera moves.
    """
    scene, layer = depsgraph.scene, depsgraph.view_layer
    render = scene.render
    layers = 1 if render.use_single_layer else sum(some.use for some in scene.view_layers)
    blurs = render.use_motion_blur and layer.use_motion_blur
    return (
        render.use_persistent_data
        and not render_engine.is_preview
        and layers == 1
        and not blurs
        and not layer.use_pass_vector
        and not aovs_of(layer)
        and not layer.lightgroups
        and not culls(scene)
    )
