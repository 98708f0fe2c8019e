"""What Measure tells of light that has no lamps beside the whole frame: a sky, things that glow,
walls that light each other.
"""

import pytest

from blender_process import REGISTER_TREE, Blender

pytestmark = pytest.mark.once

FACTOR = 1.5
SCENE = (
    REGISTER_TREE
    + """
import math, warnings
warnings.simplefilter("ignore", DeprecationWarning)
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 120, 96, 100
cube = bpy.data.objects["Cube"]
bpy.ops.mesh.primitive_plane_add(size=30, location=(0, 0, -1))
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.7, location=(1.5, -1.8, -0.3))
world = scene.world.node_tree
background = world.nodes["Background"]

def without_lamp():
    bpy.data.objects.remove(bpy.data.objects["Light"])

def sky():
    without_lamp()
    texture = world.nodes.new("ShaderNodeTexSky")
    texture.sky_type = "PREETHAM"
    world.links.new(texture.outputs[0], background.inputs[0])

def panel():
    without_lamp()
    background.inputs[1].default_value = 0
    bpy.ops.mesh.primitive_plane_add(size=2, location=(0, -3, 3), rotation=(math.radians(50), 0, 0))
    glow = bpy.data.materials.new("Glow")
    glow.use_nodes = True
    shader = glow.node_tree.nodes["Principled BSDF"]
    shader.inputs["Emission Strength"].default_value = 10
    bpy.context.object.data.materials.append(glow)

def gas():
    without_lamp()
    background.inputs[1].default_value = 0
    bpy.ops.mesh.primitive_cube_add(size=1.5, location=(0, -2, 2))
    glow = bpy.data.materials.new("Gas")
    glow.use_nodes = True
    tree = glow.node_tree
    tree.nodes.clear()
    out, shader = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
    shader.inputs["Strength"].default_value = 10
    tree.links.new(shader.outputs[0], out.inputs["Volume"])
    bpy.context.object.data.materials.append(glow)

def bounces():
    background.inputs[1].default_value = 0
    bpy.ops.mesh.primitive_plane_add(size=30, location=(-4, 0, 0), rotation=(0, math.radians(90), 0))
    scene.glint.final.diffuse_bounces = 2
"""  # noqa: E501 - a script for another Blender
)
MEASURE = """
{name}()
from dataclasses import replace
from glint import engine
from glint.engine.analysis import metrics, trade
from glint.operators.scene_copy import read_job

bpy.context.view_layer.update()
job = read_job(scene, bpy.context.view_layer.name)
values = {{"samples": (1, 4, 16), "error_threshold": (8.0, 0.0), "light_samples": (1, 4)}}
found = trade.measure(
    job.scene, job.settings, values=values, reference_samples=64, reference_seconds=0, repeats=1, squares=64
)
plain = replace(job.settings, passes=frozenset())
grid = trade.settings_grid(job.scene, plain, values)
draw = lambda settings: engine.render(job.scene, settings).combined[..., :3]
truth = draw(trade.reference_settings(job.scene, plain, grid, 64))
true = lambda row: metrics.relative_rmse(draw(replace(plain, **row.tunables)), truth)
answer({{
    "lit": float(truth.mean()),
    "front": [(row.relative_rmse, row.bound, true(row), list(row.tunables.values())) for row in found.front],
}})
"""  # noqa: E501 - a script for another Blender


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sky", "panel", "gas", "bounces"])
def test_the_measured_error_is_the_whole_frames(tmp_path, name):
    run = Blender(tmp_path).run(SCENE + MEASURE.format(name=name))
    assert run.returncode == 0, run.output
    told = run.answer
    assert told["lit"] > 0.01 and len(told["front"]) >= 3
    for measured, bound, true, tunables in told["front"]:
        if bound:
            assert true <= bound, tunables
        else:
            assert true / FACTOR <= measured <= true * FACTOR, tunables
