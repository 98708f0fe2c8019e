"""Passes of light, of shadow catchers: names in the file that Blender writes, layer by layer."""

import bpy
import numpy as np

from blender_process import Blender
from glint.addon.render.result import blender_name
from glint.engine.film import BY_SURFACE
from test_addon_passes import DRAW, read_channels


def test_light_and_caught_shadows_reach_the_file_under_blenders_names(tmp_path):
    """Of the view layer that asks for them; what they put together is the picture."""
    blender = Blender(tmp_path)
    run = blender.run(
        DRAW
        + """
scene.glint.final.samples = 4
layer, other = scene.view_layers[0], scene.view_layers.new("Plain")
for surface in ("diffuse", "glossy", "transmission"):
    for what in ("direct", "indirect", "color"):
        setattr(layer, f"use_pass_{surface}_{what}", True)
layer.use_pass_emit = layer.use_pass_environment = True
other.cycles.use_pass_shadow_catcher = True
bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -1))
bpy.context.object.is_shadow_catcher = True
layer.update_render_passes()
scene.render.filepath = str(FOLDER / "light.exr")
bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 0, run.output
    channels = read_channels(tmp_path / "light.exr")

    def image(layer: str, name: str) -> np.ndarray:
        return np.stack([channels[f"{layer}.{blender_name(name)}.{c}"] for c in "RGB"], -1)

    total = image("ViewLayer", "Emission") + image("ViewLayer", "Environment")
    for k in range(0, 9, 3):
        direct, indirect, color = (image("ViewLayer", name) for name in BY_SURFACE[k : k + 3])
        total += (direct + indirect) * color
    np.testing.assert_allclose(total, image("ViewLayer", "Combined"), atol=1e-5)
    assert image("Plain", "Shadow Catcher").min() < 1
    assert not [key for key in channels if key.startswith("Plain.Diff")]
    assert bpy.app.version < (5, 0, 0) or "ViewLayer.Diffuse Direct.R" in channels


def test_light_groups_reach_the_file_under_cycles_names(tmp_path):
    """Of the view layer that has them, also where frames are kept; they add up to the picture."""
    blender = Blender(tmp_path)
    run = blender.run(
        DRAW
        + """
scene.glint.final.samples = 4
scene.render.use_persistent_data = True
layer = scene.view_layers[0]
for name in ("Lamp", "World", "Nothing"):
    layer.lightgroups.add(name=name)
next(thing for thing in scene.objects if thing.type == "LIGHT").lightgroup = "Lamp"
scene.world.lightgroup = "World"
layer.update_render_passes()
for k in range(2):
    scene.render.filepath = str(FOLDER / f"groups{k}.exr")
    bpy.ops.render.render(write_still=True)
    bpy.data.objects["Cube"].location.x += 0.1
"""
    )
    assert run.returncode == 0, run.output
    for k in range(2):
        channels = read_channels(tmp_path / f"groups{k}.exr")

        def image(name: str, channels=channels) -> np.ndarray:
            return np.stack([channels[f"ViewLayer.{name}.{c}"] for c in "RGB"], -1)

        lamp, world = image("Combined_Lamp"), image("Combined_World")
        np.testing.assert_allclose(lamp + world, image("Combined"), atol=1e-5)
        assert lamp.max() > 0.1 and world.max() > 0.01
        assert not image("Combined_Nothing").any()
        assert "ViewLayer.Combined_Lamp.A" not in channels
