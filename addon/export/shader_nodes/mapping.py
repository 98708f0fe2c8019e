"""Mappings of vectors: that of the Mapping node, and the one that texture nodes hold themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ....engine.program.graph import Value
from ....engine.program.operations_vector import MappingType, VectorOperation

if TYPE_CHECKING:
    from .reader import NodeInputs

LEAST_SCALE = 1e-5
"""Scales are kept this far from 0 where a texture's own mapping divides by them, as Cycles does."""
_AXES = ("X", "Y", "Z")


def sines_of(view: NodeInputs, angles: Value) -> tuple[Value, Value]:
    """The sines and the cosines of three angles: constants, where the angles are."""
    zero = view.reader.graph.constant(0.0)
    sine, cosine = (
        view.apply("vector_math", angles, angles, angles, zero, operation=operation)[0]
        for operation in (VectorOperation.SINE, VectorOperation.COSINE)
    )
    return sine, cosine


def texture_mapped(view: NodeInputs, vector: Value) -> Value:
    """The vector after the mapping that the texture node itself holds. Its bounds count for nothing
    in Cycles.
    """
    held = getattr(view.node, "texture_mapping", None)
    if held is None or is_plain(held):
        return vector
    axes, location, rotation, scale = _parts(held)
    kind, constant = MappingType[held.vector_type], view.reader.graph.constant
    if kind in (MappingType.TEXTURE, MappingType.NORMAL):
        scale = tuple(map(_kept_from_zero, scale))
    return view.apply(
        "mapping",
        _projected(view, vector, axes),
        constant(location),
        *sines_of(view, constant(rotation)),
        constant(scale),
        mapping_type=kind,
    )[0]


def is_plain(held: Any) -> bool:
    """Whether a texture node's own mapping leaves vectors as they are."""
    return _parts(held) == (_AXES, (0.0,) * 3, (0.0,) * 3, (1.0,) * 3)


def _parts(held: Any) -> tuple[tuple, tuple, tuple, tuple]:
    """Axes, location, rotation and scale of a texture node's own mapping."""
    axes = (held.mapping_x, held.mapping_y, held.mapping_z)
    return (axes, *(tuple(v) for v in (held.translation, held.rotation, held.scale)))


def _projected(view: NodeInputs, vector: Value, axes: tuple[str, ...]) -> Value:
    """The vector of the chosen axes' numbers, 0 for NONE."""
    if axes == _AXES:
        return vector
    parts = dict(zip(_AXES, view.apply("separate_xyz", vector), strict=True))
    zero = view.reader.graph.constant(0.0)
    return view.apply("combine_xyz", *(parts.get(axis, zero) for axis in axes))[0]


def _kept_from_zero(scale: float) -> float:
    if abs(scale) >= LEAST_SCALE:
        return scale
    return -LEAST_SCALE if scale < 0 else LEAST_SCALE
