"""A node in a small scene, and every way in which a user can change it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy

from export_support import Shader, export, image, link, use_nodes
from glint.engine.analysis.fingerprint import value_fingerprint

MATERIAL = "MATERIAL"
HOMES = (MATERIAL, "WORLD", "POINT", "SPOT", "SUN", "AREA")
"""Whose trees nodes stand in: a material's, a world's, a light's of each kind."""
NUMBERS = ("VALUE", "INT", "BOOLEAN", "VECTOR", "RGBA")
CHOSEN = ("ENUM", "BOOLEAN")
COMMON = {p.identifier for p in bpy.types.ShaderNode.bl_rna.properties}
INSIDE = ("texture_mapping", "color_ramp", "mapping")
"""Data inside a node, whose settings are the node's."""
TANGLED = {"ShaderNodeMix", "ShaderNodeTexWave"}
"""Nodes of which a menu counts for certain entries of another alone."""
MOST_BASES = 40
"""The product of all menus and ticks is walked where it is no larger."""
ODD = (1.31, 0.62, 2.47, 0.83)
IES = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 100\n0 90\n0\n900 300\n"
NAMES = {"uv_map": "Second", "attribute_name": "Other", "layer_name": "Other"}
"""Other values of settings that are names of what the mesh has."""
HELD = {"ShaderNodeValue": "Value", "ShaderNodeRGB": "Color", "ShaderNodeNormal": "Normal"}
"""Outputs that hold the value that a user sets."""
IDLE = {
    # counts where colours are mixed as RGB, and the walk mixes them by their hue
    "color_ramp": {"interpolation"},
    # Cycles reads none of these; Blender shows some of them to other kinds of textures and curves
    "texture_mapping": {"mapping", "min", "max", "use_min", "use_max"},
    # a curve's points stay between these while they are drawn; black, white and tone are for
    # pictures, not for shaders
    "mapping": {
        *("use_clip", "clip_min_x", "clip_min_y", "clip_max_x", "clip_max_y"),
        *("black_level", "white_level", "tone"),
    },
    # Cycles' Mix (Legacy) has no alpha
    "ShaderNodeMixRGB": {"use_alpha"},
    # which of the attributes the panel shows
    "ShaderNodeRaycast": {"active_index"},
    # names of files; the tests of images and lamps read them
    "ShaderNodeTexIES": {"filepath"},
}
"""Settings that change no picture of Cycles either, or not here."""


@dataclass(frozen=True)
class Heard:
    """What an export says: the scene's hash, and the notes."""

    scene: str
    notes: tuple[str, ...]

    def tells(self, node: Any, what: str) -> bool:
        """Whether a note speaks of the whole node or of one thing of it."""
        named = (f"Node '{node.bl_label}'", what.replace("_", " "), *ALSO.get(node.bl_idname, ()))
        return any(name.lower() in note.lower() for name in named for note in self.notes)


ALSO = {"ShaderNodeTexSky": ("Hosek",), "ShaderNodeTexIES": ("IES texture ''",)}
"""Other words of notes that speak of a whole node."""


@dataclass(frozen=True)
class Change:
    """Another value of something; apply gives back what undoes it."""

    name: str
    owner: Any
    attribute: str
    value: Any

    @contextmanager
    def made(self) -> Iterator[None]:
        before = getattr(self.owner, self.attribute)
        if not isinstance(before, str) and hasattr(before, "__len__"):
            before = tuple(before)
        setattr(self.owner, self.attribute, self.value)
        yield
        setattr(self.owner, self.attribute, before)


class Bare:
    """A world, or a light of one kind, under construction: a node tree where there is no mesh."""

    def __init__(self, home: str) -> None:
        if home == "WORLD":
            block = bpy.context.scene.world = bpy.data.worlds.new("World")
        else:
            block = bpy.data.lights.new("Light", home)
            link(bpy.data.objects.new("Light", block)).location = (0.3, 0.2, 2.0)
        use_nodes(block)
        self.tree = block.node_tree
        is_world = home == "WORLD"
        self.output = self.node("ShaderNodeOutputWorld" if is_world else "ShaderNodeOutputLight")

    def node(self, kind: str) -> Any:
        return self.tree.nodes.new(kind)

    def varying(self) -> list[Any]:
        """Vectors that vary: the direction of the view, stretched and moved."""
        view = self.node("ShaderNodeNewGeometry").outputs["Incoming"]
        return [self._moved(view, 1.0 + k / 8, k / 16) for k in range(7)]

    def _moved(self, view: Any, size: float, shift: float) -> Any:
        moved = self.node("ShaderNodeVectorMath")
        moved.operation = "MULTIPLY_ADD"
        self.tree.links.new(view, moved.inputs[0])
        moved.inputs[1].default_value, moved.inputs[2].default_value = (size,) * 3, (shift,) * 3
        return moved.outputs[0]


class Worn(Shader):
    """A material under construction, as `Shader`, with a second map and a second attribute."""

    def __init__(self) -> None:
        super().__init__(shader=None)
        mesh = self.quad.data
        mesh.uv_layers.new(name="Second")
        mesh.uv_layers["Second"].data[0].uv = (0.25, 0.75)
        mesh.color_attributes.new("Other", "FLOAT_COLOR", "CORNER").data[0].color = ODD

    def varying(self) -> list[Any]:
        place = self.node("ShaderNodeTexCoord")
        names = ("Object", "Normal", "Camera", "Window", "Generated", "Reflection", "UV")
        return [place.outputs[name] for name in names]


class Walk:
    """A node of one kind. Each of its numeric outputs feeds an emission, all of which are added up;
    each input gets another vector that varies.
    """

    def __init__(self, kind: str, home: str = MATERIAL) -> None:
        """home: what the tree is of, one of HOMES."""
        self.shader = Worn() if home == MATERIAL else Bare(home)
        self.most_apart = 2 if home == MATERIAL or kind in TANGLED else 1
        self.node = self.shader.node(kind)
        self.varying = self.shader.varying()
        self.made: list[Any] = []
        self._give_data()

    def _give_data(self) -> None:
        """Data without which a node does nothing, or the same for all of its settings."""
        node = self.node
        for name in NAMES.keys() & {"attribute_name", "layer_name"}:
            if hasattr(node, name):
                setattr(node, name, "Col")
        if hasattr(node, "image"):
            node.image = image(pixels=[ODD, (0.1, 0.9, 0.4, 0.5)], size=(2, 2))
        if hasattr(node, "color_ramp"):
            node.color_ramp.color_mode = "HSV"
            node.color_ramp.elements[0].color = (0.9, 0.2, 0.1, 0.3)
            node.color_ramp.elements[1].color = (0.2, 0.3, 0.8, 0.9)
        if hasattr(node, "texture_mapping"):
            held = node.texture_mapping
            held.translation, held.rotation, held.scale = (1, 2, 3), (0.1, 0.2, 0.3), (2, 3, 4)
        if node.bl_idname == "ShaderNodeTexIES":
            node.ies = bpy.data.texts.new("lamp")
            node.ies.write(IES)

    def hear(self) -> Heard:
        self.shader.tree.update_tag()
        result = export()
        return Heard(value_fingerprint(result.scene), result.notes)

    def relink(self) -> None:
        """Link what the node gives and takes with its settings of now."""
        tree, last = self.shader.tree, None
        for socket in self.node.inputs:
            self.starve(socket)
        for node in self.made:
            tree.nodes.remove(node)
        self.made = []
        for socket in self.outputs():
            shown = self._new("ShaderNodeEmission")
            tree.links.new(socket, shown.inputs["Color"])
            last = shown if last is None else self._sum(last, shown)
        if last is not None:
            tree.links.new(last.outputs[0], self.shader.output.inputs["Surface"])
        for socket in self.sockets():
            self.feed(socket)

    def _new(self, kind: str) -> Any:
        self.made.append(self.shader.node(kind))
        return self.made[-1]

    def _sum(self, *shaders: Any) -> Any:
        add = self._new("ShaderNodeAddShader")
        for socket, shader in zip(add.inputs, shaders, strict=True):
            self.shader.tree.links.new(shader.outputs[0], socket)
        return add

    def feed(self, socket: Any) -> None:
        source = self.varying[list(self.node.inputs).index(socket) % len(self.varying)]
        self.shader.tree.links.new(source, socket)

    def starve(self, socket: Any) -> None:
        for joint in socket.links:
            self.shader.tree.links.remove(joint)

    def outputs(self) -> list[Any]:
        """The outputs that the settings of now show."""
        return [s for s in self.node.outputs if s.enabled and s.type in NUMBERS]

    def sockets(self) -> list[Any]:
        """The inputs that the settings of now show."""
        return [s for s in self.node.inputs if s.enabled and s.type in NUMBERS]

    def bases(self) -> Iterator[dict[str, Any]]:
        """Combinations of the menus and ticks: all, or where they are too many those that differ
        from the first in one or two.
        """
        choices = {p.identifier: values_of(p) for p in self._settings() if p.type in CHOSEN}
        combined = [
            dict(zip(choices, values, strict=True))
            for values in itertools.product(*choices.values())
        ]
        if len(combined) > MOST_BASES or self.most_apart < 2:
            first = combined[0]
            most = self.most_apart
            combined = [b for b in combined if sum(b[name] != first[name] for name in b) <= most]
        for base in combined:
            if self._taken(base):
                self.relink()
                yield base

    def _taken(self, base: dict[str, Any]) -> bool:
        """Whether Blender takes these settings: some hang on others."""
        try:
            for name, value in base.items():
                setattr(self.node, name, value)
        except TypeError:
            return False
        return True

    def _settings(self) -> list[Any]:
        return _settings(self.node, COMMON | IDLE.get(self.node.bl_idname, set()))

    def changes(self) -> list[Change]:
        """Other values of the settings that are no menus, of data inside the node too, and of
        outputs that hold a value.
        """
        found = [
            Change(p.identifier, self.node, p.identifier, _other(p, self.node))
            for p in self._settings()
            if p.type not in CHOSEN
        ]
        for name in INSIDE:
            owner = getattr(self.node, name, None)
            if owner is not None:
                props = _settings(owner, IDLE.get(name, set()))
                found += [Change(name, owner, p.identifier, _other(p, owner)) for p in props]
        held = HELD.get(self.node.bl_idname)
        if held is not None:
            socket = self.node.outputs[held]
            found.append(Change(held, socket, "default_value", other(socket.default_value)))
        return [change for change in found if change.value is not None]


def _settings(owner: Any, without: set[str]) -> list[Any]:
    return [p for p in owner.bl_rna.properties if not p.is_readonly and p.identifier not in without]


def values_of(prop: Any) -> list[Any]:
    return (
        [False, True] if prop.type == "BOOLEAN" else [item.identifier for item in prop.enum_items]
    )


def _other(prop: Any, owner: Any) -> Any:
    """Another value of a setting, None where it has none."""
    if prop.type in CHOSEN:
        return next(v for v in values_of(prop) if v != getattr(owner, prop.identifier))
    return NAMES.get(prop.identifier, other(getattr(owner, prop.identifier)))


def other(value: Any) -> Any:
    """Another number or vector; None of anything else."""
    if isinstance(value, (bool, str)) or value is None:
        return None
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return 0.375 if abs(value - 0.375) > 0.05 else 0.75
    return ODD[: len(value)] if hasattr(value, "__len__") and len(value) else None
