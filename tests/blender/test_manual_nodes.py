"""The manual's list of nodes is that of the code, and every shader node of this Blender is told of.

`GLINT_WRITE_MANUAL=1` writes the list anew.
"""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import pytest

from export_support import Shader, scene  # noqa: F401
from glint.addon.export.materials.evaluator import CLOSURE_NODES
from glint.addon.export.materials.graph import INLINED
from glint.addon.export.shader_nodes import READERS
from node_coverage import APPROXIMATED, NOTED, STRUCTURE

PAGE = Path(__file__).parents[2] / "docs/manual/materials.md"
START = "<!-- nodes: kept by tests/blender/test_manual_nodes.py -->\n"
END = "<!-- end of nodes -->"
FAMILIES = (
    (
        "Input",
        "approximated",
        "basic",
        "inputs",
        "objects",
        "rays",
        "strands",
        "tangents",
        "volume",
    ),
    ("Texture", "atmosphere", "ies", "noise", "patterns", "sky", "voronoi"),
    ("Color and Converter", "colors", "math", "spectra"),
    ("Vector", "normals", "vectors"),
)
LATER = {"ShaderNodeRaycast": "Raycast", "ShaderNodeTexPointDensity": "Point Density"}
"""Nodes that Blender 5.0 has not, and their names."""
NO_NODES = {"ShaderNode", "ShaderNodeTree", "ShaderNodeCustomGroup", "ShaderNodeGroup"}
OTHERS = {"ShaderNodeTexImage": "Texture", "ShaderNodeLightFalloff": "Color and Converter"}


def label(identifier: str) -> str:
    """A node's name in the Add menu; without Blender's class the end of its identifier."""
    kind = getattr(bpy.types, identifier, None)
    name = kind.bl_rna.name if kind else LATER.get(identifier)
    return name if name else identifier.removeprefix("ShaderNode")


def listed() -> str:
    """The manual's table of nodes."""
    rows = {family: set() for family, *_ in FAMILIES}
    for identifier, reader in READERS.items():
        if not hasattr(bpy.types, identifier):
            continue
        module = reader.__module__.rsplit(".", 1)[1]
        family = OTHERS.get(identifier) or next(f for f, *m in FAMILIES if module in m)
        rows[family].add(label(identifier))
    lines = ["| kind | nodes |", "|---|---|"]
    lines += [f"| {family} | {', '.join(sorted(names))} |" for family, names in rows.items()]
    return "\n".join([*lines, "", *_others()]) + "\n"


def _others() -> list[str]:
    """What is not as in Cycles."""
    rows = [(label(name), f"nearly: {how}") for name, how in APPROXIMATED.items() if _is_here(name)]
    rows += [(label(name), f"with a warning: {how}") for name, how in NOTED.items()]
    return ["| not as in Cycles | how it is drawn |", "|---|---|"] + [
        f"| {name} | {how} |" for name, how in sorted(dict(rows).items())
    ]


def _is_here(identifier: str) -> bool:
    return hasattr(bpy.types, identifier) or identifier in LATER


def test_the_manuals_nodes_are_those_of_the_code():
    text = PAGE.read_text()
    before, rest = text.split(START)
    _, after = rest.split(END)
    if os.environ.get("GLINT_WRITE_MANUAL"):
        PAGE.write_text(before + START + listed() + END + after)
    elif bpy.app.version[:2] == (5, 0):
        assert rest.split(END)[0] == listed(), "run with GLINT_WRITE_MANUAL=1"


def test_readers_and_shaders_are_nodes_of_some_blender():
    known = set(READERS) | set(CLOSURE_NODES) - {"unknown"}
    assert all(name.startswith("ShaderNode") for name in known if name != "BLINN_PHONG")


def test_every_node_of_this_blender_is_exact_approximated_or_noted():
    known = set(READERS) | set(CLOSURE_NODES) | set(STRUCTURE) | set(NOTED)
    every = {n for n in dir(bpy.types) if n.startswith("ShaderNode")} - NO_NODES
    assert not {n for n in every if bpy.types.Node in getattr(bpy.types, n).__mro__} - known
    assert set(APPROXIMATED) <= set(READERS) | set(CLOSURE_NODES)
    assert not set(NOTED) & (set(READERS) | set(CLOSURE_NODES) | set(STRUCTURE))
    assert set(STRUCTURE) >= INLINED


@pytest.mark.parametrize("kind", sorted(NOTED))
def test_what_is_not_drawn_is_told(scene, kind):  # noqa: F811
    """Where it counts: not where it only ends a tree of Freestyle's."""
    if not hasattr(bpy.types, kind) or kind == "ShaderNodeOutputLineStyle":
        return
    shader = Shader(shader="ShaderNodeEmission")
    node = shader.node(kind)
    if not len(node.outputs):  # a script without text has no sockets yet
        return
    if node.outputs[0].type == "SHADER":
        end = next(n for n in shader.tree.nodes if n.type == "OUTPUT_MATERIAL")
        shader.tree.links.new(node.outputs[0], end.inputs["Surface"])
    else:
        shader.link(node, 0, shader.shader, "Color")
    result, _ = shader.export()
    assert any(node.bl_label in note for note in result.notes), result.notes
