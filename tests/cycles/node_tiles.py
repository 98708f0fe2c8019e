"""Many node trees against Cycles in one render: tilted quads, a tile each, seen by an orthographic
camera, and an AOV pass that shows what the tree makes of the position, negative values and all.

The reader makes programs of the same trees, which the reference runs at the same float32 positions
from the Position pass: both see the same coordinates to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export.materials.graph import Place
from glint.addon.export.shader_nodes import TreeReader
from glint.engine.program.execute.operations import apply
from glint.engine.program.execute.run import run
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program

TILE = 8
EXTENT = 6.0
"""Units that the grid of tiles is wide: positions are within half of it."""

Build = Callable[[Any, Any], Any]
"""build(node tree, Geometry's Position) gives the socket that is compared."""


class Positions:
    """Shaded points of which the position (3, n) alone is known."""

    def __init__(self, positions: np.ndarray) -> None:
        self._positions = positions

    def position(self, shift: int) -> np.ndarray:
        assert shift == 0, "Bump nodes are not known here"
        return self._positions


def compared(builds: Sequence[Build]) -> tuple[np.ndarray, np.ndarray]:
    """What Cycles shows and what the programs give, (trees, pixels, 3) each."""
    ends = []
    seen, positions = _render(builds, ends)
    expected = [_computed(end, at) for end, at in zip(ends, positions, strict=True)]
    return seen, np.stack(expected)


def compared_with_rounding(
    builds: Sequence[Build], tries: int = 8
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `compared`, and how far what the programs give moves, (trees, pixels), where positions
    move by about what single precision rounds of them within a tree: a 24th of a millionth.
    """
    ends: list[Any] = []
    seen, positions = _render(builds, ends)
    random, moved = np.random.default_rng(5), np.zeros(seen.shape[:2])
    expected = np.stack([_computed(end, at) for end, at in zip(ends, positions, strict=True)])
    for k, (end, at) in enumerate(zip(ends, positions, strict=True)):
        for _ in range(tries):
            off = random.choice((-1.0, 1.0), at.shape) * EXTENT * 2.0**-24
            found = np.abs(_computed(end, at + off) - expected[k]).max(-1)
            moved[k] = np.fmax(moved[k], found)
    return seen, expected, moved


def greatest_difference(seen: np.ndarray, expected: np.ndarray) -> float:
    """Where the expected value is finite, which it must be somewhere; relative to it above 1."""
    finite = np.isfinite(expected)
    assert finite.any()
    scale = np.maximum(np.abs(expected[finite]), 1.0)
    return float((np.abs(seen[finite] - expected[finite]) / scale).max())


def add(tree: Any, kind: str, inputs: dict[str, Any], **properties: Any) -> Any:
    """A node; inputs by identifier: sockets are linked, numbers set."""
    node = tree.nodes.new(kind)
    for name, value in properties.items():
        setattr(node, name, value)
    for socket in node.inputs:
        given = inputs.get(socket.identifier)
        if isinstance(given, bpy.types.NodeSocket):
            tree.links.new(given, socket)
        elif given is not None:
            socket.default_value = given
    return node


def _computed(end: Any, positions: np.ndarray) -> np.ndarray:
    """Colours (pixels, 3) of an AOV node at positions (pixels, 3) by reader and reference."""
    graph, notes = Graph(apply), []
    value = TreeReader(graph, None, notes.append).value(Place(end.inputs["Color"]))
    assert not notes, notes
    if value.constant is not None:
        return np.broadcast_to(value.constant, positions.shape)
    program = compile_program(graph, [value])
    return run(program, Positions(positions.T), len(positions))[0].T


def _render(builds: Sequence[Build], ends: list) -> tuple[np.ndarray, np.ndarray]:
    side = int(np.ceil(np.sqrt(len(builds))))
    scene = cycles.empty_scene(side * TILE, side * TILE)
    edges = np.linspace(-EXTENT / 2, EXTENT / 2, side + 1)
    vertices = [(x, y, 0.37 * x - 0.61 * y + 0.1) for y in edges for x in edges]
    corners = [i * (side + 1) + j for i in range(side) for j in range(side)]
    mesh = bpy.data.meshes.new("Tiles")
    mesh.from_pydata(vertices, [], [(c, c + 1, c + side + 2, c + side + 1) for c in corners])
    for index, build in enumerate(builds):
        material, end = _material(build)
        ends.append(end)
        mesh.materials.append(material)
        mesh.polygons[index].material_index = index
    scene.collection.objects.link(bpy.data.objects.new("Tiles", mesh))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", EXTENT
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.camera.location = (0.0, 0.0, 20.0)
    scene.collection.objects.link(scene.camera)
    bpy.context.view_layer.aovs.add().name = "Shown"
    passes = cycles.render_cycles(scene)

    def tiles(picture: np.ndarray) -> np.ndarray:
        split = picture[:, :, :3].reshape(side, TILE, side, TILE, 3).swapaxes(1, 2)
        return split.reshape(side * side, TILE * TILE, 3)[: len(builds)].astype(np.float64)

    return tiles(passes["Shown"]), tiles(passes["Position"])


def _material(build: Build) -> tuple[Any, Any]:
    """A new material, and its node that writes the pass."""
    made = bpy.data.materials.new("Tile")
    cycles.use_nodes(made)
    tree = made.node_tree
    tree.nodes.clear()
    geometry, emission, surface, end = (
        tree.nodes.new(f"ShaderNode{kind}")
        for kind in ("NewGeometry", "Emission", "OutputMaterial", "OutputAOV")
    )
    end.aov_name = "Shown"
    tree.links.new(emission.outputs[0], surface.inputs["Surface"])
    tree.links.new(build(tree, geometry.outputs["Position"]), end.inputs["Color"])
    return made, end
