"""Things that some rays do not see, behind a pane of glass, beside Cycles."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, cube, moved, new_material, plane

SIDE = 32


def shader(kind: str, **inputs):
    material, tree, output = new_material(kind)
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def behind_a_pane(kind: str, roughness: float, ior: float):
    """A sheet that glows."""
    scene = cycles.empty_scene(SIDE, SIDE)
    cycles.set_world(scene, (0.5, 0.6, 0.8))
    pane = shader(kind, Color=(0.9, 0.8, 0.6, 1.0), Roughness=roughness, IOR=ior)
    add(scene, "pane", cube(pane), moved(0, 0, 0, 3.0, 0.1, 3.0))
    glow = shader("ShaderNodeEmission", Color=(1.0, 0.5, 0.2, 1.0), Strength=3.0)
    box = add(scene, "box", plane(1, glow), moved(0, 2, 0, 1.5, 1.5, 1.5))
    box.rotation_euler = (np.pi / 2, 0, 0)
    add_camera(scene, (0, -6, 0.6), (0, 1, 0), lens=50)
    return scene, box


def means(scene) -> tuple[np.ndarray, np.ndarray]:
    """Of the middle, of both engines."""
    glint = render_glint(
        scene, "NATIVE", samples=32, max_bounces=12, reflections="ALL", mesh_light="OFF"
    ).combined
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 128, False
    scene.cycles.use_adaptive_sampling = False
    truth = cycles.render_passes(scene)["Combined"]
    here = np.s_[SIDE // 3 : SIDE * 2 // 3, SIDE // 3 : SIDE * 2 // 3, :3]
    return glint[here].mean((0, 1)), truth[here].mean((0, 1))


@pytest.mark.parametrize("flag", [None, "visible_glossy", "visible_transmission"])
def test_a_lamp_behind_a_pane_is_as_bright(flag) -> None:
    scene, box = behind_a_pane("ShaderNodeBsdfRefraction", 0.0, 1.2)
    bpy.data.objects.remove(box)
    lamp = add_light(scene, "AREA", (0, 2, 0), (0, -6, 0), energy=100)
    lamp.data.size = 3.0
    if flag:
        setattr(lamp, flag, False)
    glint, truth = means(scene)
    assert glint == pytest.approx(truth, rel=0.05)


@pytest.mark.parametrize("flag", [None, "visible_glossy", "visible_transmission"])
@pytest.mark.parametrize(
    ("kind", "roughness", "ior"),
    [
        ("ShaderNodeBsdfRefraction", 0.0, 1.0),
        ("ShaderNodeBsdfRefraction", 0.0, 1.45),
        ("ShaderNodeBsdfGlass", 0.0, 1.45),
        ("ShaderNodeBsdfRefraction", 0.2, 1.45),
    ],
)
def test_what_is_behind_a_pane_is_as_bright(kind, roughness, ior, flag) -> None:
    scene, box = behind_a_pane(kind, roughness, ior)
    if flag:
        setattr(box, flag, False)
    glint, truth = means(scene)
    assert glint == pytest.approx(truth, rel=0.05)
