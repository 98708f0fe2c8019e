"""Walks node trees and gives the expression that a socket gets, node by node through `READERS`.

Nothing recurses: nodes are read after all that feeds them, from a list of what is still to do. So
neither thousands of nodes in a row nor hundreds of nested groups are too deep.

Sockets are converted wherever a value passes from one type to another, at links and at the edges
of groups, as Cycles does: a number fills a vector or a colour; a colour becomes a number by its
luminance, a vector by its mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import bpy

from ....engine.program.graph import Graph, Value
from ....engine.program.operations_input import Shift, Space, VectorType
from ....engine.program.operations_math import MathOperation
from ....engine.program.table import BY_NAME
from ..materials.graph import (
    SHADER_FOR_VALUE,
    Key,
    Place,
    closes_circle,
    conversions,
    gets_a_shader,
    kind_of,
    socket_named,
    trail,
)
from .luminance import luminance_of
from .mapping import texture_mapped
from .settings_of import LARGEST, UNSOUND, is_sound

Outputs = dict[str, Value]
"""A node's values by the name or identifier of its outputs."""
READERS: dict[str, Callable[[NodeInputs], Outputs | None]] = {}
"""bl_idname -> a node's outputs, or None where its settings are not understood."""

GENERATED = "(generated)"
"""Attribute name that stands for a mesh's coordinates in its texture space."""

TANGENT = "(tangent) "
"""Prefix of attribute names that stand for the tangents of a UV map, "" the active one."""

HAIR, FIBRE = "(hair)", "(fibre)"
"""Attribute names that stand for what strands tell: how far along (0 to 1), the length, a random
number and 1; the tangent and the thickness.
"""

POINT_PLACE, POINT_SHAPE = "(point)", "(radius)"
"""Attribute names that stand for the centre of a cloud's point and 1, and for its radius, a random
number, 0 and 1, in the object.
"""
LACKS = "(lacks) "
"""Prefix of attribute names that stand for 1 where no attribute has the rest of the name."""

ISLAND, POINTINESS = "(island)", "(pointiness)"
"""Attribute names that stand for what Blender's meshes tell of their shape."""

UNDISPLACED, UNDISPLACED_NORMAL = "(undisplaced)", "(undisplaced normal)"
UNDISPLACED_TANGENT = "(undisplaced tangent) "
"""Attribute names that stand for where a mesh's vertices were, and their shading normals, before
its materials displaced them; as `TANGENT`, of that mesh.
"""

DISPLACED_WIDTH = 0 if bpy.app.version >= (4, 4, 0) else 1000
"""How far apart bumps compare heights where no node says so, as `Shift.by` takes it: a tenth of a
pixel, in Cycles before Blender 4.4 a whole one.
"""

FARTHEST = LARGEST
"""What has no distance is so far."""

NOT_FINITE = "Colours and numbers that are not finite count as 0 in {}: set them anew"
INFINITE = (
    "Colours and numbers that are infinite count as 3.4e38, the largest there is, in {}: set them "
    "anew"
)
"""Of what Blender keeps for an infinite number where it can keep none."""
NUMBER_TYPES = ("VALUE", "INT", "BOOLEAN")
VECTOR_TYPES = ("VECTOR", "RGBA")
CIRCLE = "Node links go round in a circle in {}: the socket's default is used; remove the circle"


class Arithmetic:
    """Operations of the Math node on values and Python's own numbers.

    apply: makes the outputs of an operation, as `TreeReader.apply`.
    """

    def __init__(self, graph: Graph, apply: Callable[..., tuple[Value, ...]]) -> None:
        self._graph, self._apply = graph, apply

    def __call__(self, name: str, *numbers: Value | float, clamp: int = 0) -> Value:
        given = [self.number(x) for x in (*numbers, 0.0, 0.0)[:3]]
        return self._apply("math", *given, operation=MathOperation[name], clamp=clamp)[0]

    def number(self, x: Value | float) -> Value:
        return self._graph.constant(x) if isinstance(x, (int, float)) else x

    def plane(self, u: Value | float, v: Value | float) -> Value:
        """(u, v, 0)."""
        return self._apply("combine_xyz", *map(self.number, (u, v, 0.0)))[0]


class TreeReader:
    """Reads sockets of one material into a graph.

    images: the scene's `Images`. note: takes sentences about what is not read exactly; `{}` in them
    stands for the materials' names. operations: rows of the table by name.
    """

    is_surface = True
    """Whether meshes are read, of whose maps sums of products may say the same."""
    gives_light_alone = False
    """Whether of shaders those that shine count alone."""

    def __init__(
        self,
        graph: Graph,
        images: Any,
        note: Callable[[str], None],
        operations: Mapping = BY_NAME,
        material_index: int = 0,
    ) -> None:
        """material_index: Blender's pass index of the material."""
        self.material_index = material_index
        self.graph, self.images, self.operations, self.note = graph, images, operations, note
        self.displacement: Value | None = None
        self.normal_below: Value | None = None  # the normal of a surface that is displaced as well
        self.is_moved = False  # whether the vertices of the surface are displaced
        self.reading = ""  # the label of the node that is read just now
        self.tables: dict[int, tuple[float, ...]] = {}  # of ramps and curves, by their node
        self._read: dict[Key, Outputs | None] = {}
        self._trails: dict[Key, list[Place] | None] = {}

    def value(self, wanted: Place) -> Value:
        """What a socket gets, of the socket's own type: its default where nothing comes in."""
        self._read_behind(wanted)
        return self.passed_on(wanted)

    def made_by(self, found: Place) -> Value | None:
        """The value of a node's output; None where it is not understood, which is noted."""
        self._read_behind(found)
        return self._made(found)

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        """Outputs of the table's operation of this name."""
        return self.graph.apply(self.operations[name], *arguments, **settings)

    def arithmetic(self) -> Arithmetic:
        """Operations of the Math node on this tree's values."""
        return Arithmetic(self.graph, self.apply)

    def generated(self) -> Value:
        """Coordinates from 0 to 1 in the mesh's texture space."""
        return self.apply("attribute", attribute=GENERATED, shift=0)[0]

    def object_incoming(self) -> Value:
        """The direction to where the point is seen from, in the object's space, unit or not."""
        spaces = {"convert_from": Space.WORLD, "convert_to": Space.OBJECT}
        way = self.apply("incoming")[0]
        return self.apply("transform_vector", way, vector_type=VectorType.NORMAL, **spaces)[0]

    def normal(self) -> Value:
        """The shading normal where no node gives one: the mesh's, bumped by the displacement."""
        if self.normal_below is not None:
            return self.normal_below
        own = self.apply("normal")[0]
        if self.displacement is None:
            return own
        # the mean of a product's three parts is a third of the dot product
        height = self.apply("vector_average", self.apply("product", self.displacement, own)[0])[0]
        return self.bumped(height, self.graph.constant(1.0), self.graph.constant(3.0), own)

    def ray_length(self) -> Value | None:
        """The distance from which the point is seen; None where that is not known."""
        return self.apply("ray_length")[0]

    def ray_depth(self) -> tuple[Value, ...] | None:
        """The outputs of the operation; None where they are not known."""
        return self.apply("ray_depth")

    def bumped(
        self,
        height: Value,
        strength: Value,
        distance: Value,
        normal: Value,
        width: int = DISPLACED_WIDTH,
    ) -> Value:
        """A normal after a bump by a height that varies; width: as of `Shift.by`. Heights beside
        the point are along its own tangent, as in Cycles.
        """
        beside = (
            self.graph.shifted(height, axis.by(width), lambda name: name.startswith(TANGENT))
            for axis in (Shift.FIRST, Shift.SECOND)
        )
        return self.apply("bump", height, *beside, strength, distance, normal, width=width)[0]

    def negative(self, number: Value) -> Value:
        vector = self.apply("combine_xyz", number, number, number)[0]
        minus = self.graph.constant((-1.0, -1.0, -1.0))
        return self.apply("separate_xyz", self.apply("product", vector, minus)[0])[0]

    def _read_behind(self, wanted: Place) -> None:
        """Read all nodes that the socket depends on, each after what feeds it."""
        waiting = [(place, False) for place in self._feeding([wanted])]
        entered: set[Key] = set()
        while waiting:
            place, is_ready = waiting.pop()
            key = place.node_key
            if is_ready:
                self._read[key] = self._outputs(place)
                entered.discard(key)
            elif key in entered:
                self.note(CIRCLE)
            elif key not in self._read:
                entered.add(key)
                waiting.append((place, True))
                waiting += self._unread(place)

    def _unread(self, place: Place) -> list[tuple[Place, bool]]:
        inputs = [place.beside(socket) for socket in place.node.inputs if socket.is_linked]
        found = {source.node_key: source for source in self._feeding(inputs)}
        return [(source, False) for key, source in found.items() if key not in self._read]

    def _feeding(self, inputs: list[Place]) -> list[Place]:
        """Outputs of nodes that make the values of these inputs."""
        trails = [self._trail(place) for place in inputs]
        ends = [passed[-1] for passed in trails if passed is not None]
        return [end for end in ends if end.socket.is_output]

    def _trail(self, place: Place) -> list[Place] | None:
        if place.key not in self._trails:
            passed = self._trails[place.key] = trail(place)
            end = passed[-1] if passed is not None else None
            if end is None or (not end.socket.is_output and closes_circle(end)):
                self.note(CIRCLE)
            elif not end.socket.is_output and gets_a_shader(end):
                self.note(SHADER_FOR_VALUE.format(end.node.bl_label, "{}"))
        return self._trails[place.key]

    def _outputs(self, place: Place) -> Outputs | None:
        node = place.node
        self.reading = node.bl_label
        if not is_sound(node):
            self.note(UNSOUND.format(node.bl_label, "{}"))
            return None
        reader = READERS.get(kind_of(node))
        outputs = reader(NodeInputs(self, place)) if reader is not None else None
        if outputs is None:
            self.note(
                f"Node '{node.bl_label}' is not supported here: the socket's default takes its "
                "place in {}; bake it to an image"
            )
        return outputs

    def is_fed(self, wanted: Place) -> bool:
        """Whether a node makes the value of this input."""
        passed = self._trail(wanted)
        return passed is not None and passed[-1].socket.is_output

    def is_folded(self, wanted: Place) -> bool:
        """Whether Cycles works out the constant value of this input before it renders: all that
        feeds it are nodes that it folds.
        """
        waiting, seen = [wanted], set()
        while waiting:
            for end in self._feeding([waiting.pop()]):
                if end.node_key in seen:
                    continue
                if end.node.bl_idname in _NOT_FOLDED:
                    return False
                seen.add(end.node_key)
                waiting += [end.beside(x) for x in end.node.inputs if x.is_linked]
        return True

    def passed_on(self, wanted: Place) -> Value:
        """The value at the end of a socket's trail, converted on its way."""
        passed = self._trail(wanted)
        made = self._made(passed[-1]) if passed is not None else None
        if made is None:
            return self.default(wanted.socket)
        kind = passed[-1].socket.type
        for wanted_kind in conversions(passed, made.constant is not None):
            made, kind = self._converted(made, kind, wanted_kind), wanted_kind
        return made

    def _made(self, end: Place) -> Value | None:
        socket = end.socket
        if socket.type not in NUMBER_TYPES + VECTOR_TYPES:
            return None
        if not socket.is_output:
            return self.default(socket)
        outputs = self._read.get(end.node_key)
        if outputs is None:  # which was told
            return None
        made = outputs.get(socket.identifier, outputs.get(socket.name))
        if made is None:
            self.tell_constant(end.node, socket.name)
        return made

    def tell_constant(self, node: Any, output: str) -> None:
        """An output that something reads is not computed here."""
        self.note(f"'{output}' of {node.bl_label} is not supported: {{}} take a constant")

    def default(self, socket: Any) -> Value:
        """What an unlinked socket shows; 0 where that is no number, or not a finite one."""
        shown = getattr(socket, "default_value", 0.0)
        if isinstance(shown, str) or not hasattr(shown, "__len__"):
            shown = [shown] if isinstance(shown, (int, float)) else []
        numbers = [float(x) for x in shown][: _width(socket.type)]
        if not all(map(math.isfinite, numbers)):
            self.note(NOT_FINITE)
            numbers = [x if math.isfinite(x) else 0.0 for x in numbers]
        if any(abs(x) == FARTHEST for x in numbers):
            self.note(INFINITE)
        return self.graph.constant(numbers + [0.0] * (_width(socket.type) - len(numbers)))

    def _as_number(self, value: Value, kind: str) -> Value:
        """Of a colour its luminance, of a vector its mean."""
        if kind == "RGBA":
            return luminance_of(self.graph, value)
        return self.apply("vector_average", value)[0]

    def _converted(self, value: Value, kind: str, wanted: str) -> Value:
        if _width(wanted) == 3:
            return value if _width(kind) == 3 else self.apply("combine_xyz", value, value, value)[0]
        if _width(kind) == 3:
            value = self._as_number(value, kind)
        if wanted == kind or wanted == "VALUE" or kind == "BOOLEAN":
            return value
        if wanted == "INT":
            return self.arithmetic()("TRUNC", value)
        return self.arithmetic()("GREATER_THAN", value, 0.0)


class NodeInputs:
    """A node with the values of its inputs."""

    def __init__(self, reader: TreeReader, place: Place) -> None:
        self.reader, self.place, self.node = reader, place, place.node
        self._sockets: dict[str, Any] | None = None

    def value(self, name: str) -> Value:
        """The value of the input with this identifier or name, of the socket's own type."""
        socket = self._socket(name)
        if not socket.is_linked:
            return self.reader.default(socket)
        return self.reader.passed_on(self.place.beside(socket))

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        return self.reader.apply(name, *arguments, **settings)

    def table(self, make: Callable[[], tuple[float, ...]]) -> tuple[float, ...]:
        """The node's ramp or curves, made once for all places at which its group stands."""
        known, key = self.reader.tables, self.node.as_pointer()
        if key not in known:
            known[key] = make()
        return known[key]

    @property
    def math(self) -> Arithmetic:
        return Arithmetic(self.reader.graph, self.apply)

    def is_linked(self, name: str) -> bool:
        """Whether a value comes in at the input with this identifier or name."""
        socket = self._socket(name)
        return socket is not None and self.reader.is_fed(self.place.beside(socket))

    def is_folded(self, name: str) -> bool:
        """Of the input with this identifier or name, as `TreeReader` has it."""
        return self.reader.is_folded(self.place.beside(self._socket(name)))

    def _socket(self, name: str) -> Any:
        """The input with this identifier or name, or None."""
        if self._sockets is None:
            self._sockets = {socket.identifier: socket for socket in self.node.inputs}
        return self._sockets.get(name) or socket_named(self.node.inputs, name)

    def used(self, makers: Mapping[str, Callable[[], Value]]) -> Outputs:
        """Of the outputs that something reads what makes their values says."""
        return {name: make() for name, make in makers.items() if self.is_used(name)}

    def is_used(self, output: str) -> bool:
        """Whether the output with this identifier or name, where this Blender has it, is linked."""
        socket = socket_named(self.node.outputs, output)
        return socket is not None and socket.is_linked

    def vector_of(self, number: Value) -> Value:
        """A vector that a number fills."""
        return self.apply("combine_xyz", number, number, number)[0]

    def left_out(self, output: str, instead: float | tuple[float, float, float]) -> Value:
        """A constant in the place of an output that is not computed here; told where it is used."""
        if self.is_used(output):
            self.reader.tell_constant(self.node, output)
        return self.reader.graph.constant(instead)


def texture_vector(view: NodeInputs) -> Value:
    """Where a texture node looks: what comes in as Vector, or Generated coordinates, through the
    node's own mapping.
    """
    given = view.value("Vector") if view.is_linked("Vector") else view.reader.generated()
    return texture_mapped(view, given)


_NOT_FOLDED = {f"ShaderNode{name}" for name in ("RGB", "RGBToBW", "CombineColor", "SeparateColor")}
"""Nodes whose constants Cycles works out at each point."""


def _width(kind: str) -> int:
    return 3 if kind in VECTOR_TYPES else 1
