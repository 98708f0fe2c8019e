"""Reads one material's node tree: sockets to sums of inputs, shader sockets to closures, and notes
for what is not understood.

The nodes themselves are tables, filled by the modules named nodes_*: `CLOSURE_NODES` of shaders;
`COLOR_NODES` and `VECTOR_NODES` of the few nodes that products of an image, an attribute and a
constant can say, which cost less than a program; all others are read by `shader_nodes` into one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....engine.program.graph import Graph, Value
from ..images.images import Images
from ..report import Report
from ..shader_nodes import TreeReader
from ..shader_nodes.displacing import UndisplacedReader
from ..shader_nodes.luminance import luminance_of
from ..shader_nodes.reader import FARTHEST, INFINITE, NOT_FINITE, NUMBER_TYPES, NodeInputs
from ..shader_nodes.settings_of import is_sound
from ..shader_nodes.tangents import radial_tangent
from .clamps import clamped
from .closures import MATT, TURNED, Closure, LobeKey, add_closures, with_normal
from .expressions import Expressions, has_output
from .graph import (
    SHADER_FOR_VALUE,
    Place,
    closes_circle,
    conversions,
    gets_a_shader,
    kind_of,
    socket_named,
    source,
    trail,
)
from .ranges import beyond
from .terms import RGB, ZERO, Sum, Term, add, constant, constant_value, grey, is_constant
from .varying import Ior, Roughness

DEEPEST = 48
"""Nested node evaluations; deeper trees get the socket's default."""
SHINING = frozenset(
    "ShaderNode" + name
    for name in ("Emission", "Background", "MixShader", "AddShader", "BsdfTransparent")
    + ("BsdfPrincipled",)
)
"""Shaders that count, or give nothing as they are meant to, where there is no surface."""
MOST_TERMS = 16
"""Terms of one sum; longer ones become a program's value."""
SMALLEST_IOR, LARGEST_IOR = 1e-3, 1e6
_CIRCLE = "Node links go round in a circle in {}: the socket's default is used; remove the circle"


COLOR_NODES: dict[str, Callable[[NodeView, Any], Sum | None]] = {}
"""bl_idname -> function of the node and its output socket; None where a sum cannot say it."""
VECTOR_NODES: dict[str, Callable[[NodeView, Any], Coordinates | None]] = {}
CLOSURE_NODES: dict[str, Callable[[NodeView], Closure]] = {}


@dataclass(frozen=True)
class Coordinates:
    """A vector that is affine in a UV map: `matrix` (3, 3) rows x, y, z over columns u, v, 1; uv is
    the map's name, "" the active one.
    """

    uv: str
    matrix: tuple[RGB, RGB, RGB] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0))

    @property
    def array(self) -> np.ndarray:
        return np.array(self.matrix, np.float64)

    def with_array(self, array: np.ndarray) -> Coordinates:
        return Coordinates(self.uv, tuple(tuple(float(x) for x in row) for row in array))


class Evaluator:
    """Evaluates sockets of the material called `name`. Everything is remembered by place, so shared
    sub-trees are read once.
    """

    def __init__(
        self,
        name: str,
        images: Images,
        report: Report,
        reader: Callable[[Graph, Images, Callable[[str], None]], TreeReader] = TreeReader,
    ) -> None:
        """reader: makes the reader of trees: a SkyReader for worlds, a LampReader for lights, a
        VolumeReader for volumes.
        """
        self.name, self.images, self.report = name, images, report
        self.expressions = Expressions()
        self._trees = reader(self.expressions.graph, images, self.note)
        self._bent: Value | None = None  # the normal of the shader that is read just now
        self._memo: dict[tuple, Any] = {}
        self._open: set[tuple] = set()

    def color(self, place: Place) -> Sum:
        """The colour that a socket gets; its own default where what feeds it is not understood."""
        value, _ = self._read(place)
        return value

    def number(self, place: Place) -> Sum:
        """The same as a number, grey."""
        value, kind = self._read(place)
        if kind in NUMBER_TYPES:
            return value
        found = grey(value) if kind != "VECTOR" else None
        if found is not None:
            return found
        held = self.expressions.value_of(value)
        if kind == "VECTOR":
            return self.expressions.sum_of(self.expressions.apply("vector_average", held))
        return self.expressions.sum_of(luminance_of(self.expressions.graph, held))

    def converted(self, place: Place) -> Sum:
        """What a socket gets, of the socket's own type as Blender converts it."""
        return self.expressions.sum_of(self._trees.value(place))

    def grid(self, name: str, *made: Any) -> Value | None:
        """What the grid of this name is inside of a Volume object; None where there is none.
        made: as `VolumeReader.grid` has it.
        """
        read = getattr(self._trees, "grid", None)
        return read(name, *made) if read is not None else None

    def thinned(self) -> Sum | None:
        """How much thinner a Volume object is for its size; None for what is not."""
        read = getattr(self._trees, "thinned", None)
        found = read() if read is not None else None
        return self.expressions.sum_of(found) if found is not None else None

    def coordinates(self, place: Place) -> Coordinates | None:
        """What feeds a texture's vector; None when it is not affine in a UV map."""
        found = source(place)
        if found is None or not found.socket.is_output:
            return Coordinates("")
        handler = VECTOR_NODES.get(found.node.bl_idname)
        if handler is None or not is_sound(found.node):
            return None
        return self._once(found, lambda: handler(NodeView(self, found), found.socket), None)

    def closure(self, place: Place) -> Closure:
        """The lobes that a shader socket gets; colours and numbers shine as emission, as in
        Cycles.
        """
        found = source(place)
        self._note_circle(found)
        if found is None or not found.socket.is_output:
            return {}
        if found.socket.type != "SHADER":
            return {LobeKey("EMISSION"): self.color(place)}
        return self._once(found, lambda: self._shader(found), {})

    def displace(self, place: Place) -> None:
        """Bump all shading normals by the displacement that a socket gets."""
        if self._trees.is_fed(place):
            self._trees.displacement = self._trees.value(place)

    def displace_vertices(self, place: Place, bumps: bool) -> None:
        """The surface is displaced by it. bumps: normals are bent as by `displace` too, as the
        surface was before.
        """
        self._trees.is_moved = self._trees.is_fed(place)
        if bumps and self._trees.is_moved:
            reader = UndisplacedReader(self.expressions.graph, self.images, self.note)
            reader.material_index = self._trees.material_index
            self._trees.normal_below = reader.bent(reader.value(Place(place.socket, place.path)))

    def bend(self, place: Place | None) -> Value:
        """The same as `normal_at`, which is that of the shader's lobes from here on."""
        self._bent = self.normal_at(place)
        return self._bent

    def normal_at(self, place: Place | None) -> Value:
        """The shading normal that a socket gets, the mesh's where it gets none, or 0."""
        fed = place is not None and self._trees.is_fed(place)
        value = self._trees.value(place) if fed else self._trees.normal()
        if value.constant is None:
            return value
        own, nothing = self.expressions.apply("normal"), self.expressions.constant(0.0)
        if not any(value.constant):
            return own
        return self.expressions.apply("scaled_sum", own, nothing, value)  # outputs are computed

    def tangent_at(self, place: Place | None) -> Value:
        """The tangent that a socket gets, where it gets none that round the object's Z."""
        if place is not None and self._trees.is_fed(place):
            return self._trees.value(place)
        return radial_tangent(NodeInputs(self._trees, place), "Z")

    def normals(self, closure: Closure) -> tuple[Closure, int, int, bool]:
        """The closure with what of it has a normal of its own; the outputs that hold the shading
        normal of a material with these lobes, and what it was bent from, -1 where that is the
        mesh's; and whether one of these normals may be another than the last.
        """
        base, bent = self._trees.normal(), self._normal(closure)
        closure = self._turned(closure, bent)
        output, is_meshs = self.expressions.output, base is self.expressions.apply("normal")
        is_bumped = any(key.normal_output >= 0 for key in closure)
        if bent is None:
            return closure, -1, -1, is_bumped
        normal = output(bent)
        return closure, normal, -1 if is_meshs else output(base), is_bumped or bent is not base

    def _turned(self, closure: Closure, normal: Value | None) -> Closure:
        """The closure, what shines in it with a normal of its own where its shader has another one
        than the material, whose is given.
        """
        own = self.expressions.apply("normal")

        def key_of(key: LobeKey) -> LobeKey:
            wanted = key.normal or own
            if (
                key.kind in TURNED - MATT
                and key.normal_output < 0
                and wanted is not (normal or own)
            ):
                return replace(key, normal_output=self.expressions.output(wanted))
            return key

        return add_closures(*({key_of(key): terms} for key, terms in closure.items()))

    def _normal(self, closure: Closure) -> Value | None:
        """The shading normal of a material with these lobes, the mean of those of what is matt, or
        of all, by how much each of them is; None where it is the mesh's.
        """
        own, shares = self.expressions.apply("normal"), dict[Value, Sum]()
        leads = {key: terms for key, terms in closure.items() if not key.follows}
        kinds = MATT if any(key.kind in MATT for key in leads) else TURNED
        for key, terms in leads.items():
            if key.kind in kinds:
                normal = key.normal or own
                shares[normal] = add(shares.get(normal, ZERO), terms)
        if len(shares) < 2:
            bent = next(iter(shares), own)
            return bent if bent is not own else None
        self.note(
            "Matt shaders of {} have normals of their own: each point has their mean, by how much "
            "of each shader it shows"
        )
        return self._mean_normal(shares)

    def _mean_normal(self, shares: dict[Value, Sum]) -> Value:
        do, value_of = self.expressions.apply, self.expressions.value_of
        total = self.expressions.constant((0.0, 0.0, 0.0))
        for normal, terms in shares.items():
            share = self.expressions.math("MAXIMUM", do("vector_average", value_of(terms)), 0.0)
            total = do("scaled_sum", normal, share, total)
        return total

    def note(self, sentence: str) -> None:
        """Report something about this material; `{}` stands for the materials' names."""
        self.report.note(sentence, self.name)

    def _note_circle(self, found: Place | None) -> None:
        """`found` as `source` gave it: None after too many steps, or an input where Blender cut the
        circle itself.
        """
        if found is None or (not found.socket.is_output and closes_circle(found)):
            self.note(_CIRCLE)
        elif not found.socket.is_output and gets_a_shader(found):
            self.note(SHADER_FOR_VALUE.format(found.node.bl_label, "{}"))

    def settled(self, closure: Closure) -> Closure:
        """The closure with one factor for each lobe whose weight a program computes."""
        return {
            key: self.expressions.sum_of(self.expressions.value_of(terms))
            if has_output(terms) and (len(terms) > 1 or len(terms[0].factors) > 1)
            else terms
            for key, terms in closure.items()
        }

    def limited(self, terms: Sum) -> Sum:
        """A sum short enough to render: a program's value where it has too many terms."""
        if len(terms) <= MOST_TERMS:
            return terms
        return self.expressions.sum_of(self.expressions.value_of(terms))

    def clamped(self, terms: Sum, low: float, high: float) -> Sum:
        """A sum whose channels are kept between low and high."""
        found = None if has_output(terms) else clamped(terms, low, high, self.images)
        if found is not None:
            return found
        value = self.expressions.value_of(terms)
        return self.expressions.sum_of(self.expressions.bounded(value, low, high))

    def mean(self, terms: Sum) -> RGB:
        """The mean of a sum over its textures; attributes and what programs compute count as one
        half.
        """
        return constant_value(add(*((self._mean_term(term),) for term in terms)))

    def _mean_term(self, term: Term) -> Term:
        value = np.array(term.value)
        for factor in term.factors:
            value = value * (self.images.mean(factor) if factor.output < 0 else 0.5)
        return Term(tuple(float(x) for x in value))

    def _read(self, place: Place) -> tuple[Sum, str]:
        passed = trail(place)
        self._note_circle(passed[-1] if passed is not None else None)
        found = passed[-1] if passed is not None else place
        value = self._value(found) if found.socket.is_output else self._default(found.socket)
        if value is None:
            return self._default(place.socket), place.socket.type
        between = conversions(passed, is_constant(value))[:-1] if passed is not None else []
        if any(kind != found.socket.type for kind in between):
            return self.converted(place), place.socket.type
        return self.limited(value), found.socket.type

    def _value(self, found: Place) -> Sum | None:
        """What a node's output is; None where it is not understood."""
        if len(self._open) >= DEEPEST and found.key not in self._memo:
            return self._by_program(found)
        return self._once(found, lambda: self._value_of_node(found), None)

    def _value_of_node(self, found: Place) -> Sum | None:
        """By the algebra of sums where that is exact, else by the program. Where there is no
        surface it has no maps, but numbers.
        """
        known = not self._trees.gives_light_alone and is_sound(found.node)
        handler = COLOR_NODES.get(found.node.bl_idname) if known else None
        value = handler(NodeView(self, found), found.socket) if handler else None
        if value is not None and (self._trees.is_surface or is_constant(value)):
            return value
        return self._by_program(found)

    def _by_program(self, found: Place) -> Sum | None:
        made = self._trees.made_by(found)
        return self.expressions.sum_of(made) if made is not None else None

    def _default(self, socket: Any) -> Sum:
        """What an unlinked socket shows, said where it is no number."""
        value = getattr(socket, "default_value", 0.0)
        values = value if hasattr(value, "__len__") else (value,)
        if not is_finite(values):
            self.note(NOT_FINITE)
        if any(isinstance(x, float) and abs(x) == FARTHEST for x in values):
            self.note(INFINITE)
        return default_value(socket)

    def _shader(self, found: Place) -> Closure:
        kind = kind_of(found.node)
        if self._trees.gives_light_alone and kind not in SHINING:
            self.note(
                f"Node '{found.node.bl_label}' gives no light in {{}}, where there is no surface: "
                "use Background or Emission"
            )
            return {}
        handler = CLOSURE_NODES.get(kind, CLOSURE_NODES["unknown"])
        before, self._bent = self._bent, None
        view = NodeView(self, found)
        closure = handler(view)
        for sentence in beyond(view):
            self.note(sentence)
        if self._bent is not None:
            closure = {with_normal(key, self._bent): terms for key, terms in closure.items()}
        self._bent = before
        if self._trees.gives_light_alone:
            closure = {key: terms for key, terms in closure.items() if key.kind == "EMISSION"}
        return {key: self.limited(terms) for key, terms in closure.items()}

    def _once(self, found: Place, compute: Callable[[], Any], otherwise: Any) -> Any:
        """compute(), once per place; `otherwise` inside a circle or too deep."""
        key = found.key
        if key in self._memo:
            return self._memo[key]
        if key in self._open or len(self._open) >= DEEPEST:
            deep = (
                "Nodes are nested too deeply in {}: the socket's default is used; simplify the tree"
            )
            self.note(_CIRCLE if key in self._open else deep)
            return otherwise
        self._open.add(key)
        try:
            self._memo[key] = compute()
        finally:
            self._open.discard(key)
        return self._memo[key]


class NodeView:
    """A node at a place in the tree, with its inputs evaluated on demand."""

    def __init__(self, evaluator: Evaluator, place: Place) -> None:
        self.evaluator, self.place, self.node = evaluator, place, place.node

    def input(self, name: str) -> Place | None:
        """The input with this identifier or name, or None where this Blender has none."""
        socket = socket_named(self.node.inputs, name)
        return self.place.beside(socket) if socket is not None else None

    def color(self, name: str, otherwise: float | RGB = 0.0) -> Sum:
        place = self.input(name)
        return self.evaluator.color(place) if place else constant(otherwise)

    def number(self, name: str, otherwise: float = 0.0) -> Sum:
        place = self.input(name)
        return self.evaluator.number(place) if place else constant(otherwise)

    def constant(self, name: str, otherwise: float = 0.0) -> float:
        """A number that must not vary over the surface: the mean of one that does, with a note."""
        terms = self.number(name, otherwise)
        if is_constant(terms):
            return constant_value(terms)[0]
        self.evaluator.note(f"'{name}' varies over the surface in {{}}: its mean is used")
        return self.evaluator.mean(terms)[0]

    def fixed(self, *names: str) -> list[float] | None:
        """Numbers of inputs; None where one of them varies over the surface."""
        sums = [self.number(name) for name in names]
        if not all(is_constant(terms) for terms in sums):
            return None
        return [constant_value(terms)[0] for terms in sums]

    def roughness(self, name: str = "Roughness", otherwise: float = 0.5) -> Roughness:
        """A roughness, which may vary over the surface."""
        terms = self.number(name, otherwise)
        if is_constant(terms):
            return Roughness(constant_value(terms)[0])
        expressions = self.evaluator.expressions
        value = expressions.parts(expressions.value_of(terms))[0]
        return Roughness(value, expressions)

    def ior(self, name: str = "IOR", otherwise: float = 1.5, least: float = SMALLEST_IOR) -> Ior:
        """An index of refraction, kept within bounds, which may vary over the surface."""
        terms = self.number(name, otherwise)
        if is_constant(terms):
            number = min(max(constant_value(terms)[0], least), LARGEST_IOR)
            return Ior(number, self.evaluator.expressions)
        expressions = self.evaluator.expressions
        value = expressions.parts(expressions.value_of(terms))[0]
        above = expressions.math("MAXIMUM", value, least)
        return Ior(expressions.math("MINIMUM", above, LARGEST_IOR), expressions)

    def factor(self, name: str, otherwise: float = 0.0) -> Sum:
        """A number kept between 0 and 1."""
        return self.evaluator.clamped(self.number(name, otherwise), 0.0, 1.0)

    def reflectance(self, name: str, otherwise: float | RGB = 0.0) -> Sum:
        """A colour kept at 0 or above, as Cycles does with what surfaces reflect."""
        return self.evaluator.clamped(self.color(name, otherwise), 0.0, math.inf)

    def amount(self, name: str, otherwise: float = 0.0) -> Sum:
        """A number kept at 0 or above."""
        return self.evaluator.clamped(self.number(name, otherwise), 0.0, math.inf)

    def vector(self, name: str) -> tuple[float, float, float] | None:
        """A constant vector, or None when it varies."""
        terms = self.color(name)
        return constant_value(terms) if is_constant(terms) else None

    def closure(self, name: str) -> Closure:
        place = self.input(name)
        return self.evaluator.closure(place) if place else {}

    def is_linked(self, name: str) -> bool:
        place = self.input(name)
        found = source(place) if place else None
        return found is not None and found.socket.is_output

    def note(self, sentence: str) -> None:
        self.evaluator.note(sentence)


def default_value(socket: Any) -> Sum:
    """The value that an unlinked socket shows; black for sockets without one (shaders, strings)."""
    value = getattr(socket, "default_value", 0.0)
    if isinstance(value, (bool, int, float)):
        return constant(float(value))
    if isinstance(value, str) or not hasattr(value, "__len__"):
        return ZERO
    return constant(tuple(float(x) for x in value)[:3])


def is_finite(values: Iterable[Any]) -> bool:
    """Whether all numbers among the values are; other things count as finite."""
    return all(math.isfinite(x) for x in values if isinstance(x, float))
