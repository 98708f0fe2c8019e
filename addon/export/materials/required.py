"""What materials and passes read of meshes and objects."""

from __future__ import annotations

from dataclasses import dataclass

from ....engine.program.operations import Reference
from ....engine.program.program import Program, instructions


@dataclass(frozen=True)
class RequiredAttributes:
    """Names of the UV maps ("" the active one) and colour attributes that something reads.
    objects: what is read of objects and not of their meshes; it does not count for `bool`.
    everywhere: attributes that rays of the material read of whatever mesh they meet.
    """

    uv_maps: frozenset[str] = frozenset()
    attributes: frozenset[str] = frozenset()
    objects: frozenset[str] = frozenset()
    everywhere: frozenset[str] = frozenset()

    def __or__(self, other: RequiredAttributes) -> RequiredAttributes:
        return RequiredAttributes(
            self.uv_maps | other.uv_maps,
            self.attributes | other.attributes,
            self.objects | other.objects,
            self.everywhere | other.everywhere,
        )

    def __bool__(self) -> bool:
        return bool(self.uv_maps or self.attributes)


def read_by(program: Program | None) -> RequiredAttributes:
    """What a program names."""
    uv_maps, attributes, objects, everywhere = (set[str]() for _ in range(4))
    named = {"uv": uv_maps, "instance_value": objects, "raycast_attribute": everywhere}
    for step in instructions(program) if program else ():
        for (_, choices), setting in zip(step.operation.settings, step.settings, strict=True):
            if choices is Reference.ATTRIBUTE:
                names = named.get(step.operation.name, attributes)
                names.add(program.attributes[setting])
    return RequiredAttributes(*map(frozenset, (uv_maps, attributes - {""}, objects, everywhere)))
