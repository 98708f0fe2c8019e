"""What a render engine keeps between the frames of an animation, where the scene says Persistent
Data.
"""

from __future__ import annotations

from typing import Any

import bpy

from ... import engine
from ..export import Export
from ..export.materials.aovs import Aov
from ..export.sync.frames import export_frame
from ..export.sync.incremental import LiveExport
from .motion import blurs


class Kept:
    """The last frame's scene, as Blender has it and as the tracer does."""

    def __init__(self) -> None:
        self._export, self._made_for = LiveExport(), ((), False)
        self.renderer = engine.KeptRender()

    def export(
        self,
        depsgraph: bpy.types.Depsgraph,
        *,
        aovs: tuple[Aov, ...] = (),
        keeps_collapsed: bool = False,
        **options: Any,
    ) -> Export:
        """As `export_frame`, and as `export_scene` with AOVs and collapsed placements."""
        made_for = aovs, keeps_collapsed
        if made_for != self._made_for:
            self._export, self._made_for = LiveExport(*made_for), made_for
        return export_frame(self._export, depsgraph, **options)

    def close(self) -> None:
        self.renderer.close()


def keeps(render_engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether the depsgraph's updates will tell all that changes: Blender keeps one for all view
    layers. Motion blur and the pass Vector take it to other frames and back, of which no update
    tells: it changes nothing for good but where scripts hear of each frame.
    """
    scene, layer = depsgraph.scene, depsgraph.view_layer
    render = scene.render
    layers = 1 if render.use_single_layer else sum(some.use for some in scene.view_layers)
    goes = blurs(depsgraph) or layer.use_pass_vector
    return (
        render.use_persistent_data
        and not render_engine.is_preview
        and layers == 1
        and not (goes and _scripts_hear_of_frames())
    )


def _scripts_hear_of_frames() -> bool:
    """Whether others than Glint do."""
    handlers = bpy.app.handlers.frame_change_pre[:] + bpy.app.handlers.frame_change_post[:]
    own = __name__.rpartition(".addon.")[0]
    return not all(getattr(one, "__module__", "").startswith(own) for one in handlers)
