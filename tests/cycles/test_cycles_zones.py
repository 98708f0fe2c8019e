"""Nodes that Blender takes out of trees (from 5.0 on): zones that repeat, closures, bundles and
menus, beside Cycles.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export import export_scene
from glint_picture import render_pair, surface_interior
from small_scenes import add, add_camera, ball, new_material

pytestmark = pytest.mark.skipif(
    bpy.app.version < (5, 0), reason="this Blender has none of these nodes"
)


def repeated(tree, position):
    """Three times x → sin(2 x)."""
    start = tree.nodes.new("GeometryNodeRepeatInput")
    end = tree.nodes.new("GeometryNodeRepeatOutput")
    start.pair_with_output(end)
    end.repeat_items.new("FLOAT", "x")
    start.inputs["Iterations"].default_value = 3
    double, sine = (tree.nodes.new("ShaderNodeMath") for _ in range(2))
    double.operation, sine.operation = "MULTIPLY", "SINE"
    double.inputs[1].default_value = 2.0
    part = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(position, part.inputs[0])
    tree.links.new(part.outputs["X"], start.inputs["x"])
    tree.links.new(start.outputs["x"], double.inputs[0])
    tree.links.new(double.outputs[0], sine.inputs[0])
    tree.links.new(sine.outputs[0], end.inputs["x"])
    return end.outputs["x"]


def switched(tree, position):
    node = tree.nodes.new("GeometryNodeMenuSwitch")
    node.data_type = "RGBA"
    node.inputs["Menu"].default_value = "B"
    node.inputs["A"].default_value = (1, 0, 0, 1)
    tree.links.new(position, node.inputs["B"])
    return node.outputs["Output"]


def bundled(tree, position):
    pack, unpack = (tree.nodes.new(f"Node{kind}Bundle") for kind in ("Combine", "Separate"))
    pack.bundle_items.new("VECTOR", "place")
    unpack.bundle_items.new("VECTOR", "place")
    tree.links.new(position, pack.inputs["place"])
    tree.links.new(pack.outputs[0], unpack.inputs[0])
    return unpack.outputs["place"]


def closed(tree, position):
    """A closure that adds to a vector, evaluated at the position."""
    start, end = tree.nodes.new("NodeClosureInput"), tree.nodes.new("NodeClosureOutput")
    start.pair_with_output(end)
    end.input_items.new("VECTOR", "v")
    end.output_items.new("VECTOR", "w")
    moved = tree.nodes.new("ShaderNodeVectorMath")
    moved.inputs[1].default_value = (0.1, 0.2, 0.3)
    tree.links.new(start.outputs["v"], moved.inputs[0])
    tree.links.new(moved.outputs[0], end.inputs["w"])
    run = tree.nodes.new("NodeEvaluateClosure")
    run.input_items.new("VECTOR", "v")
    run.output_items.new("VECTOR", "w")
    tree.links.new(end.outputs[0], run.inputs["Closure"])
    tree.links.new(position, run.inputs["v"])
    return run.outputs["w"]


@pytest.mark.parametrize("build", [repeated, switched, bundled, closed])
def test_it_is_cycles(build) -> None:
    scene = cycles.empty_scene(64, 64)
    material, tree, output = new_material("zone")
    emission = tree.nodes.new("ShaderNodeEmission")
    position = tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"]
    tree.links.new(build(tree, position), emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    add(scene, "ball", ball(material=material))
    add_camera(scene)
    pair = render_pair(scene, "NATIVE", build.__name__)
    found, wanted = (p["Combined"][..., :3] for p in (pair.glint, pair.cycles))
    inside = surface_interior(pair.cycles)
    assert inside.sum() > 150 and wanted[inside].std() > 0.1
    assert np.abs(found - wanted)[inside].max() <= 1e-4
    assert not export_scene(bpy.context.evaluated_depsgraph_get(), width=8, height=8).notes
