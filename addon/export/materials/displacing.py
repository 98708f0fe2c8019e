"""How materials move vertices, as their Displacement outputs say (`engine.displacement`)."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

from ....engine.displacement import Displacement
from ....engine.program.graph import Graph
from ....engine.program.program import compile_program
from ..images.images import Images
from ..report import Report
from ..shader_nodes.displacing import DisplacementReader
from .graph import end_of, images_behind, read_tree
from .required import RequiredAttributes, read_by


def method_of(material: Any) -> str:
    """Blender's Displacement Method of a material: BUMP, DISPLACEMENT or BOTH."""
    return getattr(material, "displacement_method", "BUMP")


def compile_displacement(material: Any, images: Images, report: Report) -> Displacement | None:
    """How a material moves vertices; None where it does not."""
    if material is None or method_of(material) == "BUMP":
        return None
    read = read_tree(material)
    place = end_of(read.tree, "Displacement")
    if place is None or not place.socket.is_linked:
        return None
    note = functools.partial(_note, report, material.name)
    reader = DisplacementReader(Graph(), images, note, material_index=material.pass_index)
    if not reader.is_fed(place):
        return None
    images.expect(images_behind(place))
    value = reader.displacement_at(place)
    found = Displacement(
        None,
        keeps_normals=method_of(material) == "BOTH",
        is_placed=reader.is_placed,
    )
    if value.constant is not None:
        return replace(found, constant=value.constant) if any(value.constant) else None
    program = compile_program(reader.graph, [value])
    textures = tuple(images.textures[number] for number in program.textures)
    numbers = {number: k for k, number in enumerate(program.textures)}
    return replace(found, program=program.with_textures(numbers), textures=textures)


def wanted_of(displacements: tuple[Displacement | None, ...]) -> RequiredAttributes:
    """What they read of meshes."""
    read = (read_by(d.program) for d in displacements if d is not None)
    return functools.reduce(RequiredAttributes.__or__, read, RequiredAttributes())


def wanted_objects(displacement: Displacement | None) -> RequiredAttributes:
    """What one reads of objects."""
    return replace(RequiredAttributes(), objects=wanted_of((displacement,)).objects)


def _note(report: Report, name: str, sentence: str) -> None:
    report.note(sentence, name)
