"""Blender's world to ambient light and background: one colour each, the mean where an image
surrounds the scene.
"""

from __future__ import annotations

from typing import Any

from ...engine.scene import World
from .evaluator import COLOR_NODES, Evaluator, LobeKey, NodeView
from .graph import Place, node_tree, socket_named
from .images import Images
from .report import Report
from .terms import RGB, Sum, constant


def export_world(world: Any, transparent: bool, images: Images, report: Report) -> World:
    """The evaluated world (or None: black)."""
    color = _color(world, images, report) if world is not None else (0.0, 0.0, 0.0)
    return World(color, color, transparent)


def _color(world: Any, images: Images, report: Report) -> RGB:
    tree = node_tree(world)
    if tree is None:
        return tuple(float(x) for x in world.color)
    output = tree.get_output_node("ALL") or tree.get_output_node("CYCLES")
    if output is None:
        return (0.0, 0.0, 0.0)
    if socket_named(output.inputs, "Volume").is_linked:
        report.note("Volumes are not rendered: {}", world.name)
    evaluator = Evaluator(world.name, images, report, has_program=False)
    closure = evaluator.closure(Place(socket_named(output.inputs, "Surface")))
    return evaluator.mean(closure.get(LobeKey("EMISSION"), ()))


def _environment(view: NodeView, output: Any) -> Sum:
    """The mean colour of the image over the sphere, where rows near the poles count less."""
    node = view.node
    view.note(
        "Environment images light and surround as their mean colour in {}: the image itself is not "
        "seen"
    )
    index = view.evaluator.images.texture(node.image, node.image_user, "EXTEND", node.interpolation)
    return constant(tuple(float(x) for x in view.evaluator.images.sphere_mean(index)))


COLOR_NODES["ShaderNodeTexEnvironment"] = _environment
