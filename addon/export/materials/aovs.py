"""AOV Output nodes: what a material gives to the view layer's own passes."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any, NamedTuple

from ....engine.scene import Input, Lobe, Material
from ..images.images import Images
from ..report import Report
from ..shader_nodes import TreeReader
from .evaluator import Evaluator
from .graph import Links, Place, images_behind, is_blinn_phong, node_tree, read_tree, socket_named
from .terms import factors_of


class Aov(NamedTuple):
    """A pass of the view layer's own. is_value: a number, not a colour."""

    name: str
    is_value: bool


def aovs_of(view_layer: Any) -> tuple[Aov, ...]:
    """The AOVs that Blender takes: their names are free."""
    return tuple(Aov(aov.name, aov.type == "VALUE") for aov in view_layer.aovs if aov.is_valid)


def aov_material(
    material: Any, aovs: tuple[Aov, ...], images: Images, report: Report
) -> Material | None:
    """What a material's nodes give to AOVs, as `Material.aovs` has it; None where they give none.
    All nodes of one name add up, as in Cycles.
    """
    read = read_tree(material)
    tree = read.tree
    places = [*_outputs(tree, (), Links())] if tree is not None else []
    reader = functools.partial(TreeReader, material_index=material.pass_index)
    evaluator = Evaluator(material.name, images, report, reader)
    lobes: list[Lobe] = []
    for number, aov in enumerate(aovs):
        for node, path, links in places:
            if node.aov_name != aov.name:
                continue
            socket = socket_named(node.inputs, "Value" if aov.is_value else "Color")
            place = Place(socket, path, links)
            images.expect(images_behind(place))
            terms = evaluator.converted(place)
            factors = [factors_of(term) for term in terms] or [(Input((0.0, 0.0, 0.0)),)]
            lobes += [Lobe("EMISSION", factor, aov=number) for factor in factors]
    if not lobes:
        return None
    return evaluator.expressions.with_program(Material(f"{material.name}: AOVs", tuple(lobes)))


def note_world(world: Any, aovs: tuple[Aov, ...], report: Report) -> None:
    """Say what of a world's AOV Output nodes is left out."""
    tree = node_tree(world) if aovs and world is not None else None
    if tree is not None and any(True for _ in _outputs(tree, (), Links())):
        report.note(
            "AOV Output nodes of worlds are left out: {}; use the Environment pass", world.name
        )


def _outputs(
    tree: Any, path: tuple[Any, ...], links: Links
) -> Iterator[tuple[Any, tuple[Any, ...], Links]]:
    """The AOV Output nodes of a tree and of groups in it, with the way there."""
    for node in tree.nodes:
        if node.mute:
            continue
        inside = getattr(node, "node_tree", None)
        if node.bl_idname == "ShaderNodeOutputAOV":
            yield node, path, links
        elif inside is not None and not is_blinn_phong(inside):
            yield from _outputs(inside, (*path, node), links)
