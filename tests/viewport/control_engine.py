"""Runs inside a Blender with a window: a render engine that shows ready pictures at once. What it
takes is what Blender itself takes.
"""

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d


class ControlEngine(bpy.types.RenderEngine):
    """Fills the region with `color` through the display transform, from a half-float texture of the
    region's size that is made once.
    """

    bl_idname = "CONTROL"
    bl_label = "Control"
    bl_use_shading_nodes_custom = False

    color = (0.0, 0.0, 0.0)
    _textures: dict = {}

    def view_update(self, context, depsgraph):
        pass

    def view_draw(self, context, depsgraph):
        size = context.region.width, context.region.height
        key = (size, self.color)
        if key not in self._textures:
            pixels = np.tile(np.array([*self.color, 1.0], np.float32), size[0] * size[1])
            pixels = gpu.types.Buffer("FLOAT", len(pixels), pixels)
            self._textures[key] = gpu.types.GPUTexture(size, format="RGBA16F", data=pixels)
        self.bind_display_space_shader(depsgraph.scene)
        draw_texture_2d(self._textures[key], (0, 0), *size)
        self.unbind_display_space_shader()


def register():
    bpy.utils.register_class(ControlEngine)


def show(color):
    """From the next drawing on."""
    ControlEngine.color = color
