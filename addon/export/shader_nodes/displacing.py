"""Trees that displace: read for the vertices of a mesh, before anything is seen, and read once more
for a bump of what they displaced.
"""

from __future__ import annotations

from typing import Any

from ....engine.program.graph import Value
from ....engine.program.operations_input import Space, VectorType
from ....engine.program.operations_rays import ASKING
from ....engine.program.operations_vector import VectorMeasure, VectorOperation
from ..materials.graph import Place, kind_of, trail
from .rays import without_rays
from .reader import (
    TANGENT,
    UNDISPLACED,
    UNDISPLACED_NORMAL,
    UNDISPLACED_TANGENT,
    Outputs,
    TreeReader,
)

_DISPLACERS = ("ShaderNodeDisplacement", "ShaderNodeVectorDisplacement")
_IN_WORLD = frozenset(
    ("position", "object_location", "instance_value", "transform_vector")
    + ("normal", "face_normal", "incoming", "reflection", "normal_to_world", "normal_map")
)
"""Operations whose results turn with the object, or are its own."""
_OF_CAMERA = ("camera_position", "window")
ZERO = (0.0, 0.0, 0.0)


class DisplacementReader(TreeReader):
    """Reads what moves vertices, in the world; nobody looks, so nothing is bumped.

    is_placed: whether it depends on where the object stands.
    """

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.is_placed = False
        self._node: Any = None

    def displacement_at(self, wanted: Place) -> Value:
        """The offset that a socket gets."""
        passed = trail(wanted)
        self.is_placed = passed is None or kind_of(passed[-1].node) not in _DISPLACERS
        return self.value(wanted)

    def apply(self, name: str, /, *arguments: Value, **settings: Any) -> tuple[Value, ...]:
        if name in _OF_CAMERA or Space.CAMERA in (
            settings.get("convert_from"),
            settings.get("convert_to"),
        ):
            self.note(
                f"Node '{self.reading}' does not know the camera where {{}} displaces: it gives 0; "
                "use Object coordinates"
            )
            return (self.graph.constant(ZERO),)
        nothing = without_rays(self, name, arguments)
        if nothing is not None:
            self.note(
                f"Node '{self.reading}' finds nothing near where {{}} displaces, as in Cycles: "
                "bake it to an image"
            )
            return nothing
        if name in _IN_WORLD and not self._is_displacer():
            self.is_placed = True
        return super().apply(name, *arguments, **settings)

    def bumped(
        self, height: Value, strength: Value, distance: Value, normal: Value, width: int = 0
    ) -> Value:
        return normal

    def _outputs(self, place: Place) -> Outputs | None:
        self._node = place.node
        if kind_of(place.node) in _DISPLACERS and place.node.space == "WORLD":
            self.is_placed = True
        return super()._outputs(place)

    def _is_displacer(self) -> bool:
        return self._node is not None and kind_of(self._node) in _DISPLACERS


class UndisplacedReader(TreeReader):
    """Reads a tree at the surface as it was before it was displaced."""

    def apply(self, name: str, /, *arguments: Value, **settings: Any) -> tuple[Value, ...]:
        if name in ASKING:
            return without_rays(self, name, arguments)
        if name == "object_position":
            return (self._before(settings["shift"]),)
        if name == "position":
            return (self._placed(self._before(settings["shift"])),)
        if name == "attribute" and settings["attribute"].startswith(TANGENT):
            map_name = settings["attribute"].removeprefix(TANGENT)
            settings = {**settings, "attribute": UNDISPLACED_TANGENT + map_name}
        if name == "object_normal":
            outward = super().apply("vector_normalized", self._outward())[0]
            return (self._turned(outward),)
        if name == "normal":
            return (self._facing(),)
        return super().apply(name, *arguments, **settings)

    def bent(self, displacement: Value) -> Value:
        """The normal of the surface, bumped by a displacement of it (Mikkelsen 2020) along two
        small steps on it.
        """
        own = self._facing()
        heights = [self._dot(self.graph.shifted(displacement, k), own) for k in (0, 1, 2)]
        here = self._placed(self._before(0))
        steps = [self._vector("SUBTRACT", self._placed(self._before(k)), here) for k in (1, 2)]
        rises = [self._math("SUBTRACT", heights[k], heights[0]) for k in (1, 2)]
        across = self._vector("CROSS_PRODUCT", steps[1], own)
        along = self._vector("CROSS_PRODUCT", own, steps[0])
        size = self._dot(steps[0], across)
        zero = self.graph.constant(ZERO)
        gradient = self.apply("scaled_sum", across, rises[0], zero)[0]
        gradient = self.apply("scaled_sum", along, rises[1], gradient)[0]
        outward = self._math("MULTIPLY", self._math("SIGN", size), self._side(-1.0))
        straight = self.apply("scaled_sum", own, self._math("ABSOLUTE", size), zero)[0]
        turned = self.apply("scaled_sum", gradient, outward, straight)[0]
        return self.apply("vector_normalized", turned)[0]

    def _before(self, shift: int) -> Value:
        """The point in the object's space."""
        return super().apply("attribute", attribute=UNDISPLACED, shift=shift)[0]

    def _placed(self, point: Value) -> Value:
        """A point of the object's space in the world."""
        settings = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}
        return super().apply("transform_vector", point, vector_type=VectorType.POINT, **settings)[0]

    def _outward(self) -> Value:
        return super().apply("attribute", attribute=UNDISPLACED_NORMAL, shift=0)[0]

    def _facing(self) -> Value:
        """The unit normal in the world, turned to the viewer."""
        return self._turned(super().apply("normal_to_world", self._outward())[0])

    def _turned(self, outward: Value) -> Value:
        """An outward normal, to the viewer."""
        zero = self.graph.constant(ZERO)
        return super().apply("scaled_sum", outward, self._side(1.0), zero)[0]

    def _side(self, sign: float) -> Value:
        """The sign where the outer side is seen, else the other."""
        inner = super().apply("backfacing")[0]
        return self._math("MULTIPLY_ADD", inner, -2.0 * sign, sign)

    def _dot(self, a: Value, b: Value) -> Value:
        return super().apply("vector_measure", a, b, measure=VectorMeasure.DOT_PRODUCT)[0]

    def _vector(self, name: str, a: Value, b: Value) -> Value:
        zero = self.graph.constant(0.0)
        return super().apply("vector_math", a, b, a, zero, operation=VectorOperation[name])[0]

    @property
    def _math(self) -> Any:
        return self.arithmetic()
