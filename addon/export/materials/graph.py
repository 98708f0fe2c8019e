"""Finding what feeds a shader socket: through reroutes, muted nodes and any depth of node groups,
without recursion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

Key = tuple[int, ...]

LONGEST = 4096
"""Steps after which links are taken to go round in a circle."""

BLINN_PHONG = "BLINN_PHONG"
MARK = "glint_shader"
"""A custom property of a node group. Where it is BLINN_PHONG the node means something itself; what
is inside is for other engines.
"""
FORMER_NODE = "GlintBlinnPhongNode"
"""What the Blinn-Phong node was before it was a marked group, a class of its own: in linked and
appended materials it still is.
"""


def is_blinn_phong(tree: Any) -> bool:
    return tree.get(MARK) == BLINN_PHONG


def kind_of(node: Any) -> str:
    """What a node is to the tables of `evaluator`: BLINN_PHONG, or Blender's name of its type."""
    name = node.bl_idname
    if name == FORMER_NODE or (
        name == "ShaderNodeGroup" and node.node_tree is not None and is_blinn_phong(node.node_tree)
    ):
        return BLINN_PHONG
    return name


def node_tree(block: Any) -> Any:
    """The node tree that a material, world or light uses, or None. From 5.0 on having one is using
    it, and asking gives a warning.
    """
    import bpy

    return block.node_tree if bpy.app.version >= (5, 0, 0) or block.use_nodes else None


def output_of(tree: Any) -> Any:
    """The output node that a tree shows, or None: as Cycles has it, one of its own before one for
    all engines, else Eevee's.
    """
    return tree.get_output_node("CYCLES") or tree.get_output_node("EEVEE")


INLINED = frozenset(
    {
        "GeometryNodeMenuSwitch",
        "GeometryNodeRepeatInput",
        "GeometryNodeRepeatOutput",
        "NodeClosureInput",
        "NodeClosureOutput",
        "NodeCombineBundle",
        "NodeEvaluateClosure",
        "NodeJoinBundle",
        "NodeSeparateBundle",
        "FunctionNodeInputBool",
        "FunctionNodeInputInt",
        "FunctionNodeInputMenu",
        "FunctionNodeInputVector",
    }
)
"""Nodes that Blender (5.0 and later) takes out of trees before an engine reads them: zones that
repeat, closures, bundles, switches by menus and inputs of other than shaders' types.
"""


SHADER_FOR_VALUE = (
    "A shader is linked to a value of node '{}' in {}: the socket's default is used; unlink it"
)


@dataclass(frozen=True, eq=False)
class ReadTree:
    """A node tree as an engine reads it. owner: keeps what Blender made for it."""

    tree: Any
    owner: Any = None


def read_tree(block: Any) -> ReadTree:
    """The node tree that a material, world or light uses, or none, without nodes of `INLINED`."""
    import bpy

    tree = node_tree(block)
    if tree is None or not any(node.bl_idname in INLINED for node in all_nodes(tree)):
        return ReadTree(tree)
    inline = getattr(bpy.types, "InlineShaderNodes", None)
    if inline is None:
        return ReadTree(tree)
    kinds = {"Material": inline.from_material, "World": inline.from_world}
    made = kinds.get(block.bl_rna.identifier, inline.from_light)(block)
    return ReadTree(made.node_tree, made)


def all_nodes(tree: Any) -> Iterator[Any]:
    """The nodes of a tree and of the groups in it, those of each group once."""
    inner = lambda here: filter(None, (getattr(n, "node_tree", None) for n in here.nodes))  # noqa: E731
    for here in reached(tree, inner):
        yield from here.nodes


def reached(start: Any, next_to: Callable[[Any], Iterable[Any]]) -> Iterator[Any]:
    """A thing of Blender's and all that lies next to it, and next to that, each once."""
    waiting, seen = [start], set()
    while waiting:
        here = waiting.pop()
        if here.as_pointer() not in seen:
            seen.add(here.as_pointer())
            yield here
            waiting += next_to(here)


class Links:
    """The links of node trees by the input they lead to. Blender's own `NodeSocket.links` looks
    through all links of the tree.
    """

    def __init__(self) -> None:
        self._of_trees: dict[int, dict[int, list[Any]]] = {}
        self.trails: dict[Key, list[Place] | None] = {}  # what `trail` found, by place

    def into(self, socket: Any) -> list[Any]:
        """The links that end at an input."""
        if not socket.is_linked:
            return []
        tree = socket.id_data
        key = tree.as_pointer()
        if key not in self._of_trees:
            self._of_trees[key] = by_input = {}
            for link in tree.links:
                by_input.setdefault(link.to_socket.as_pointer(), []).append(link)
        return self._of_trees[key].get(socket.as_pointer(), [])


class Place:
    """A socket and the chain of group nodes, outermost first, that leads to the tree in which it
    lives; never changed. links: of all trees on the way.

    key: the same for the same socket reached by the same way; `node_key`: for the same node.
    """

    __slots__ = ("_way", "key", "links", "node", "path", "socket")

    def __init__(
        self,
        socket: Any,
        path: tuple[Any, ...] = (),
        links: Links | None = None,
        way: Key | None = None,
    ) -> None:
        """way: the addresses of the path, where they are known."""
        self.socket, self.path, self.node = socket, path, socket.node
        self.links = Links() if links is None else links
        self._way = tuple(node.as_pointer() for node in path) if way is None else way
        self.key: Key = (socket.as_pointer(), *self._way)

    @property
    def node_key(self) -> Key:
        return (self.node.as_pointer(), *self._way)

    def beside(self, socket: Any) -> Place:
        """Another socket of the same tree."""
        return Place(socket, self.path, self.links, self._way)

    def inside(self, socket: Any) -> Place:
        """A socket of the tree in this group node."""
        way = (*self._way, self.node.as_pointer())
        return Place(socket, (*self.path, self.node), self.links, way)

    def outside(self, socket: Any) -> Place:
        """A socket of the group node in whose tree this is."""
        return Place(socket, self.path[:-1], self.links, self._way[:-1])


def source(place: Place) -> Place | None:
    """Where the value of an input comes from: an output of a node that computes it, or an unlinked
    input whose default holds.

    None for links that go round in a circle.
    """
    passed = trail(place)
    return passed[-1] if passed is not None else None


def is_fed(place: Place) -> bool:
    """Whether something comes in at an input."""
    found = source(place)
    return found is not None and found.socket.is_output


def trail(place: Place) -> list[Place] | None:
    """All sockets that a value passes, from where it is wanted back to its `source`.

    None for links that go round in a circle.
    """
    known = place.links.trails
    if place.key not in known:
        known[place.key] = _trail(place)
    return known[place.key]


def conversions(passed: list[Place], is_constant: bool) -> list[str]:
    """Types of sockets to which the value at the end of a trail is converted one after the other,
    the last that of where it is wanted.

    Blender 5.0 and later convert constants alone on the way, of which it says RGB nodes are none.
    """
    import bpy

    kinds = [place.socket.type for place in reversed(passed[:-1])]
    kinds = [kind for kind in kinds if kind != "SHADER"]  # which takes colours as they are
    if bpy.app.version >= (5, 0, 0):
        is_constant = is_constant and passed[-1].node.bl_idname != "ShaderNodeRGB"
        return kinds if is_constant else kinds[-1:]
    return kinds


def _trail(place: Place) -> list[Place] | None:
    passed = [place]
    for _ in range(LONGEST):
        if not place.socket.is_output:
            link = _link(place)
            if link is None:
                return _cut_back(passed)
            place = place.beside(link.from_socket)
            passed.append(place)
        step = _through(place)
        if step is None:
            return _cut_back(passed) if place.node.mute else passed
        place = step
        passed.append(place)
    return None


def end_of(tree: Any, name: str) -> Place | None:
    """The input of this name of the output node that a tree shows, or, where it has none, that one
    of its groups shows, as in Cycles; None without one. tree: None for none.
    """
    waiting = [(tree, ())] if tree is not None else []
    for here, path in waiting:
        output = output_of(here)
        if output is not None:
            return Place(socket_named(output.inputs, name), path)
        waiting += [
            (node.node_tree, (*path, node))
            for node in here.nodes
            if node.type == "GROUP" and node.node_tree is not None and not node.mute
        ]
    return None


def _cut_back(passed: list[Place]) -> list[Place]:
    """A trail that ends where nothing comes in, up to the last input of a node with a value of its
    own.
    """
    while len(passed) > 1 and (passed[-1].socket.is_output or not _has_values(passed[-1].node)):
        passed.pop()
    return passed


def _has_values(node: Any) -> bool:
    """Whether unlinked inputs of a node count: those of muted nodes do not, nor, from Blender 5.0
    on, those of reroutes, which are 0 before.
    """
    import bpy

    return not node.mute and (node.type != "REROUTE" or bpy.app.version < (5, 0, 0))


_GEOMETRIC = ("Coat Normal", "Tangent")
"""Inputs that change no surface here."""


def images_behind(shader: Place) -> list[tuple[Any, Any]]:
    """Image and ImageUser of the Image Texture nodes that may change what a shader socket gets,
    each node once.
    """
    found, seen, waiting = [], set(), [shader]
    while waiting:
        place = source(waiting.pop())
        if place is None or not place.socket.is_output:
            continue
        if place.node_key in seen:
            continue
        seen.add(place.node_key)
        if place.node.bl_idname == "ShaderNodeTexImage":
            found.append((place.node.image, place.node.image_user))
        else:
            waiting += [
                place.beside(entry)
                for entry in place.node.inputs
                if entry.is_linked and entry.name not in _GEOMETRIC
            ]
    return found


def closes_circle(place: Place) -> bool:
    """Whether a link comes in that Blender marked as invalid because it closes a circle, and which
    `source` therefore does not follow.

    Links between a shader and a value are invalid as well, and no circle; so are those to a socket
    that the node's settings hide.
    """
    return _has_invalid_link(place, False)


def gets_a_shader(place: Place) -> bool:
    """Whether a shader is linked to an input that wants a value; such links count for nothing."""
    return place.socket.type != "SHADER" and _has_invalid_link(place, True)


def _has_invalid_link(place: Place, of_another_kind: bool) -> bool:
    wants_shader = place.socket.type == "SHADER"
    return place.socket.enabled and any(
        not link.is_valid
        and ((link.from_socket.type == "SHADER") != wants_shader) == of_another_kind
        for link in place.links.into(place.socket)
    )


def _link(place: Place) -> Any:
    return next(
        (link for link in place.links.into(place.socket) if link.is_valid and not link.is_muted),
        None,
    )


def _through(place: Place) -> Place | None:
    """The socket that stands behind an output of a node which only passes values on; None where a
    value is made.
    """
    node = place.node
    if node.mute:
        return _behind_muted(place)
    if node.type == "REROUTE":
        return place.beside(node.inputs[0])
    if getattr(node, "node_tree", None) is not None and kind_of(node) != BLINN_PHONG:
        return _into_group(place)
    if node.type == "GROUP_INPUT" and place.path:
        outside = _by_identifier(place.path[-1].inputs, place.socket.identifier, place.socket.name)
        return place.outside(outside) if outside is not None else None
    return None


def _behind_muted(place: Place) -> Place | None:
    for link in place.node.internal_links:
        if link.to_socket == place.socket:
            return place.beside(link.from_socket)
        if link.from_socket == place.socket:
            return place.beside(link.to_socket)
    return None


def _into_group(place: Place) -> Place | None:
    outputs = [node for node in place.node.node_tree.nodes if node.type == "GROUP_OUTPUT"]
    active = [node for node in outputs if node.is_active_output] or outputs
    inside = (
        _by_identifier(active[0].inputs, place.socket.identifier, place.socket.name)
        if active
        else None
    )
    return place.inside(inside) if inside is not None else None


def _by_identifier(sockets: Any, identifier: str, name: str) -> Any:
    """name: what the socket is probably called; by that Blender finds it sooner than a loop
    here.
    """
    found = sockets.get(name)
    if found is not None and found.identifier == identifier:
        return found
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def socket_named(sockets: Any, name: str) -> Any:
    """The socket with this identifier, or else the enabled one with this name, or None. Never
    looked up by position.
    """
    by_identifier = _by_identifier(sockets, name, name)
    if by_identifier is not None:
        return by_identifier
    named = [socket for socket in sockets if socket.name == name]
    return next((socket for socket in named if socket.enabled), named[0] if named else None)
