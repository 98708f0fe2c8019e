"""What panels grey out changes no picture, with the reason that they give; what they offer beside
it, and in every other state, changes one.
"""

import ast
from pathlib import Path

import pytest

from blender_process import PUT_AND_LOOK, REGISTER_TREE, Blender

pytestmark = pytest.mark.once

UI = Path(__file__).resolve().parents[2] / "addon" / "ui"
PROGRAM = (
    REGISTER_TREE
    + PUT_AND_LOOK
    + """
import math
import numpy as np
from glint.addon.render import statistics
bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
scene, layer = bpy.context.scene, bpy.context.view_layer
render, final = scene.render, scene.glint.final
render.engine, render.resolution_x, render.resolution_y = "GLINT", 24, 24
final.samples, final.error_threshold, final.light_samples, final.diffuse_bounces = 2, 0.0, 1, 1

eye = scene.camera = put("eye", bpy.data.cameras.new("eye"), 0, -9, 3)
eye.rotation_euler = (math.radians(72), 0, 0)
floor = look(box("floor", (9, 9, 0.1), 0, 0, -1), "ShaderNodeBsdfDiffuse")
metal = look(box("metal", (1, 1, 1), -2, 0, 0), "ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=0.4)
fog = look(box("fog", (2, 2, 1.8), 2, 0, 0.1), "ShaderNodeVolumeScatter", "Volume", Density=1.0)
glow = look(box("glow", (1, 1, 0.05), 2, 0, 1.6), "ShaderNodeEmission", Strength=20.0)
plain = look(box("plain", (0.3, 0.3, 0.3), 2.8, 0.9, 1.4), "ShaderNodeBsdfDiffuse")
metal.keyframe_insert("location", frame=1)
metal.location.z += 20
metal.keyframe_insert("location", frame=2)
scene.frame_set(1)
area = put("area", bpy.data.lights.new("area", "AREA"), 0, 0, 4)
area.data.energy, area.data.spread = 200, math.pi
lamp = put("lamp", bpy.data.lights.new("lamp", "POINT"), 2, -1, 2.5)
lamp.data.energy = 100
scene.world = bpy.data.worlds.new("sky")
scene.world.use_nodes = True

def picture():
    bpy.ops.render.render()
    return statistics.of_last_render(scene.name).stamp["pixels"]

def changes(owner, name, value, before=None):
    # before: the picture without, where it is at hand
    before, old = before or picture(), getattr(owner, name)
    setattr(owner, name, value)
    after = picture()
    setattr(owner, name, old)
    return before != after

def change(settings):
    before = picture()
    return [changes(*setting, before) for setting in settings]

def during(state, *settings):
    # (owner, name, value) of the state that greys out, and of each setting: whether they change
    free = change(settings)
    owner, name, value = state
    old = getattr(owner, name)
    setattr(owner, name, value)
    grey = change(settings)
    setattr(owner, name, old)
    return [free, grey]

def during_each(states, *settings):
    # the same of several states
    free, grey = zip(*(during(state, *settings) for state in states))
    return [sum(free, []), sum(grey, [])]

told = {
    "Classic illumination has none of these": during(
        (final, "illumination", "CLASSIC"), (final, "world_light", "CONSTANT"), (final, "mesh_light", "OFF"),
        (final, "diffuse_bounces", 0), (final, "reflections", "OFF"), (final, "soft_light", "SHARED")),
    "Rough Reflections need Bounces of Render": during((final, "max_bounces", 0), (final, "reflections", "OFF")),
}
blurred = [setting for setting in ((metal.cycles, "use_motion_blur", False), (layer, "use_motion_blur", False))
           if hasattr(setting[0], setting[1])]
render.use_motion_blur, final.samples = True, 16  # few samples lie near the middle of the shutter
told["Motion Blur is off in Render properties"] = during((render, "use_motion_blur", False), *blurred)
render.use_motion_blur, final.samples = False, 2
scene.cycles.use_camera_cull, scene.cycles.camera_cull_margin = True, 0.0
mirror = look(box("mirror", (9, 0.1, 5), 0, 4, 1), "ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=0.0)
behind = look(box("behind", (2, 2, 2), 0, -14, 2), "ShaderNodeEmission", Strength=3.0)
told["Photons need Bounces of Render, Diffuse Bounces and Caustics"] = during(
    (final, "diffuse_bounces", 0), (final, "photons", 4096))
render.use_simplify = True
told["Simplify in Render properties says whether and where objects are culled"] = during(
    (render, "use_simplify", False), (behind.cycles, "use_camera_cull", True))
render.use_simplify = False
render.resolution_x = render.resolution_y = 6  # as the reference is slow
told["Of the native tracer alone"] = [[], during((final, "backend", "NUMPY"), (final, "acceleration", "FAST"), (final, "threads", 1))[1]]
render.resolution_x = render.resolution_y = 24
told["Volume Scatter is for what gives light: volumes see the object whatever it says"] = [
    [changes(thing, "visible_volume_scatter", False) for thing in (lamp, glow, area)],
    [changes(plain, "visible_volume_scatter", False)]]
scene.glint.target_rmse, final.samples = 50.0, 16
told["Quality Target finds the first two"] = during(
    (scene.glint, "target", "RMSE"), (final, "samples", 9), (final, "error_threshold", 8.0))
physical = (final, "illumination", "CLASSIC")
told["Visibility Samples need Soft Light Resolved, and Physical illumination"] = during_each(
    ((final, "soft_light", "DEALT"), physical), (final, "visibility_samples", 1))
told["Volume Bounces and Reflective Caustics need Diffuse Bounces and Physical illumination"] = during_each(
    ((final, "diffuse_bounces", 0), physical),
    (final, "volume_bounces", 1), (final, "reflective_caustics", "OFF"))
scene.glint.target = "RMSE"
light_samples = changes(final, "light_samples", 2)  # 1 is a hard shadow from the lamp's centre
scene.glint.target = "NONE"
scene.cycles.use_camera_cull = False
mirror.hide_render = behind.hide_render = True
put("spot", bpy.data.lights.new("spot", "SPOT"), -1, -2, 5).data.energy = 100
skin = look(box("skin", (1, 1, 1), -0.5, -2, 0), "ShaderNodeBsdfPrincipled", **{"Subsurface Weight": 1.0, "Subsurface Scale": 1.0})
pane = look(box("pane", (1, 1, 0.1), -0.5, 1, 1), "ShaderNodeBsdfGlass")
still = picture()
acts = {name: changes(final, name, value, still) for name, value in {
    "samples": 9, "visibility_samples": 1, "error_threshold": 64.0, "light_samples": 2, "lamp_shadows": 1, "volume_samples": 1,
    "max_bounces": 0, "cutoff": 0.9, "illumination": "CLASSIC", "world_light": "CONSTANT",
    "mesh_light": "OFF", "reflections": "OFF", "subsurface": "OFF", "soft_light": "SHARED",
    "diffuse_bounces": 0, "volume_bounces": 1, "clamp_indirect": 1e-3, "acceleration": "FAST",
    "reflective_caustics": "OFF", "refractive_caustics": "OFF", "photons": 4096,
    "threads": 1}.items()}
answer([told, {
    "spread": changes(area.data, "spread", math.radians(20)),
    "light samples with a target": light_samples,
    "world": changes(scene.world.cycles_visibility, "scatter", False),
}, acts, [name for name in final.bl_rna.properties.keys() if name not in ("rna_type", "name")]])
"""  # noqa: E501 - a script for another Blender
)
NO_PICTURE = {
    "The add-on of Cycles, which is off, keeps these settings",
    "Needs the OpenVDB module of Blender 4.5",
    "Vector is empty with Motion Blur",
}
"""Reasons about another Blender or its add-ons, and about a pass that has a test of its own
(test_neighbour_frames.py).
"""

OF_TIME = {"acceleration", "threads"}
"""Settings that a picture does not depend on."""
ELSEWHERE = {
    "backend",
    "use_mesh_light",
    "use_reflective_caustics",
    "use_refractive_caustics",
    "use_subsurface",
}
"""The other tracer, which gives the same to float precision, and checkboxes of choices."""


def _reasons() -> set[str]:
    """Every text that `draw_reason` is given in the panels."""
    found = set()
    for path in UI.glob("*.py"):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef) and function.name != "draw_reason":
                found |= _reasons_in(function)
    return found


def _reasons_in(function: ast.FunctionDef) -> set[str]:
    named = {
        target.id: node.value.value
        for node in ast.walk(function)
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    given = [
        node.args[2]
        for node in ast.walk(function)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "draw_reason"
    ]
    return {named[text.id] if isinstance(text, ast.Name) else text.value for text in given}


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    run = Blender(tmp_path_factory.mktemp("greyed")).run(PROGRAM)
    assert run.returncode == 0, run.output
    return run.answer


def test_every_reason_has_its_pictures(told):
    assert told[0].keys() | NO_PICTURE == _reasons()


def test_what_is_grey_changes_nothing_and_else_it_does(told):
    wrong = {
        reason: states for reason, states in told[0].items() if not all(states[0]) or any(states[1])
    }
    assert wrong == {}


def test_every_render_setting_changes_a_picture_or_is_of_time(told):
    acts, names = told[2:]
    assert acts.keys() | ELSEWHERE == set(names)
    assert {name for name, acted in acts.items() if not acted} == OF_TIME


def test_what_was_grey_and_acted_is_offered(told):
    assert all(told[1].values()), told[1]
    text = (UI / "data_panels.py").read_text(encoding="utf-8")
    assert "active = False" not in text
