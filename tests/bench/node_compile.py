"""Seconds of processor time in which materials of 5 000 nodes are read and compiled, as in exports.

    python tests/bench/node_compile.py [--rounds 5]

The nodes stand in 104 uses of a group of 48, as Blender's own time for links grows with the square
of a tree's nodes. Exit code 1 where one takes more than half a second.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

TARGET = 0.5
USES, STEPS = 104, 48


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    worst = 0.0
    for add in (sums, colors, noises):
        made = material(add)
        best = min(seconds(made) for _ in range(rounds))
        print(f"{add.__name__:<8}{best:6.3f} s (target {TARGET:g})")
        worst = max(worst, best)
    return int(worst > TARGET)


def seconds(made: Any) -> float:
    """Of one compilation, without Python's search for garbage, as in exports."""
    from glint.addon.export.images.images import Images
    from glint.addon.export.materials.materials import compile_material
    from glint.addon.export.report import Report

    report = Report()
    gc.disable()
    start = time.process_time()
    compiled = compile_material(made, Images(report), report)
    taken = time.process_time() - start
    gc.enable()
    assert compiled.program is not None and not report.notes()
    return taken


def material(add: Callable[[Any, Any], Any]) -> Any:
    """A Diffuse BSDF whose colour comes through all uses of a group; add(tree, socket) puts nodes
    behind a socket and gives the last one's.
    """
    import bpy

    import glint_tree  # noqa: F401  (makes the package importable as glint)

    bpy.ops.wm.read_factory_settings(use_empty=True)
    made = bpy.data.materials.new("M")
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    inner = _group(bpy, add)
    socket = tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"]
    for _ in range(USES):
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = inner
        tree.links.new(socket, node.inputs[0])
        socket = node.outputs[0]
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(socket, shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def _group(bpy: Any, add: Callable[[Any, Any], Any]) -> Any:
    inner = bpy.data.node_groups.new("G", "ShaderNodeTree")
    for way in ("INPUT", "OUTPUT"):
        inner.interface.new_socket("Vector", in_out=way, socket_type="NodeSocketVector")
    entry, end = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
    socket = entry.outputs[0]
    while len(inner.nodes) < STEPS + 2:
        socket = add(inner, socket)
    inner.links.new(socket, end.inputs[0])
    return inner


def sums(tree: Any, socket: Any) -> Any:
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.inputs[1].default_value = (1.0, 2.0, 0.5)
    tree.links.new(socket, node.inputs[0])
    return node.outputs[0]


def colors(tree: Any, socket: Any) -> Any:
    """Four nodes."""
    moved = sums(tree, socket)
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "SOFT_LIGHT"
    tree.links.new(moved, mix.inputs[6])
    tree.links.new(socket, mix.inputs[7])
    parts, whole = (tree.nodes.new(f"ShaderNode{name}") for name in ("SeparateColor", "CombineXYZ"))
    tree.links.new(mix.outputs[2], parts.inputs[0])
    tree.links.new(parts.outputs[0], whole.inputs["Y"])
    tree.links.new(parts.outputs[2], whole.inputs["X"])
    return whole.outputs[0]


def noises(tree: Any, socket: Any) -> Any:
    """Four nodes: a noise and a ramp over it, mixed."""
    noise, ramp, span, mix = (
        tree.nodes.new(f"ShaderNode{name}") for name in ("TexNoise", "ValToRGB", "MapRange", "Mix")
    )
    mix.data_type = "RGBA"
    noise.inputs["Scale"].default_value = 2.0 + len(tree.nodes)
    tree.links.new(socket, noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(noise.outputs[0], span.inputs[0])
    tree.links.new(span.outputs[0], mix.inputs[0])
    tree.links.new(ramp.outputs[0], mix.inputs[6])
    tree.links.new(noise.outputs[1], mix.inputs[7])
    return mix.outputs[2]


if __name__ == "__main__":
    sys.exit(main())
