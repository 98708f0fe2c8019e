"""A render engine whose picture is ready: what a frame takes with it is what Blender itself takes,
the least of any engine.
"""

from __future__ import annotations

import bpy

from glint import engine
from glint.addon.render import final
from glint.addon.render.result import Picture


class ReadyEngine(bpy.types.RenderEngine):
    """Engine "READY" hands `film` over as Glint hands over its own, and does nothing else."""

    bl_idname = "READY"
    bl_label = "Ready"

    film: engine.Film

    def render(self, depsgraph):
        size = self.resolution_x, self.resolution_y
        Picture(self, depsgraph.view_layer.name, size).finish(ReadyEngine.film)


def hold_glints_picture(scene) -> None:
    """Has Glint trace `scene` by its settings and holds that picture ready; the scene's engine is
    READY from here on.
    """
    if not ReadyEngine.is_registered:
        bpy.utils.register_class(ReadyEngine)
    scene.render.engine = "GLINT"
    with final.reading_only() as jobs:
        bpy.ops.render.render()
    ReadyEngine.film = engine.render(jobs[0].scene, jobs[0].settings)
    scene.render.engine = "READY"
