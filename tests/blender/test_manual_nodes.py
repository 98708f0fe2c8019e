"""The manual's list of nodes is that of the code, and every shader node of this Blender is told of.

`GLINT_WRITE_MANUAL=1` writes the list anew.
"""

from __future__ import annotations

import os
from pathlib import Path

import bpy

from glint.addon.export.materials.evaluator import CLOSURE_NODES
from glint.addon.export.shader_nodes import READERS

PAGE = Path(__file__).parents[2] / "docs/manual/materials.md"
START = "<!-- nodes: kept by tests/blender/test_manual_nodes.py -->\n"
END = "<!-- end of nodes -->"
FAMILIES = (
    ("Input", "basic", "inputs", "objects", "strands", "tangents"),
    ("Texture", "atmosphere", "ies", "noise", "patterns", "sky", "voronoi"),
    ("Color and Converter", "colors", "math", "spectra"),
    ("Vector", "normals", "vectors"),
)
OTHERS = {"ShaderNodeTexImage": "Texture", "ShaderNodeLightFalloff": "Color and Converter"}


def label(identifier: str) -> str:
    """A node's name in the Add menu; without Blender's class the end of its identifier."""
    kind = getattr(bpy.types, identifier, None)
    return kind.bl_rna.name if kind else identifier.removeprefix("ShaderNode")


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
    return "\n".join(lines) + "\n"


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
