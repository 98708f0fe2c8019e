"""What passes from socket to socket, against Cycles: colours and vectors as numbers, and links that
bring nothing. Quads that glow, a pixel or a few each.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import BACKENDS, render_pair
from node_tiles import add as node
from small_scenes import add, mesh, moved, new_material

TILE = 4


def _passes_on(tree, given, made):
    tree.links.new(given.outputs[0], made.inputs[0])


class Glow:
    """A material that glows: an Emission node with values of its own."""

    def __init__(self) -> None:
        self.material, self.tree, end = new_material("glow")
        self.shader = node(self.tree, "ShaderNodeEmission", {"Color": (0.8, 0.2, 0.1, 1.0)})
        self.shader.inputs["Strength"].default_value = 0.7
        self.tree.links.new(self.shader.outputs[0], end.inputs["Surface"])

    def node(self, kind: str, inputs=None, **properties):
        return node(self.tree, kind, inputs or {}, **properties)

    def feed(self, output, name: str = "Strength") -> None:
        self.tree.links.new(output, self.shader.inputs[name])

    def picture(self):
        """The colour of an image that has all."""
        pixels = np.random.default_rng(3).random((2, 2, 4), np.float32)
        image = bpy.data.images.new("four", 2, 2, float_buffer=True)
        image.pixels.foreach_set(pixels.ravel())
        image.update()
        return self.node("ShaderNodeTexImage", image=image, interpolation="Closest").outputs[0]

    def group(self, fill, inputs=(), outputs=("NodeSocketColor",)):
        """fill(tree, group input, group output)."""
        tree = bpy.data.node_groups.new("group", "ShaderNodeTree")
        for direction, kinds in (("INPUT", inputs), ("OUTPUT", outputs)):
            for kind in kinds:
                tree.interface.new_socket("It", in_out=direction, socket_type=kind)
        fill(tree, *(tree.nodes.new(f"NodeGroup{way}") for way in ("Input", "Output")))
        return self.node("ShaderNodeGroup", node_tree=tree)


def quad(material):
    """A square of size 1 with a UV map, a colour and a vector on its points."""
    vertices = [(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0)]
    made = mesh("quad", vertices, [(0, 1, 2, 3)], material=material)
    for corner, place in zip(made.uv_layers.new(name="map").uv, vertices, strict=True):
        corner.vector = place[0] + 0.5, place[1] + 0.5
    values = np.random.default_rng(4).random((4, 4), np.float32)
    paint = made.attributes.new("paint", "FLOAT_COLOR", "POINT")
    paint.data.foreach_set("color", values.ravel())
    wind = made.attributes.new("wind", "FLOAT_VECTOR", "POINT")
    wind.data.foreach_set("vector", values[:, :3].ravel())
    return made


def named(sockets, *names):
    return next(s for s in sockets if s.name in names)


NUMBERS = {}
"""Name -> what feeds a number with a colour or a vector."""


def number(build):
    NUMBERS[build.__name__] = build
    return build


@number
def image(glow: Glow):
    return glow.picture()


@number
def image_times_colour(glow: Glow):
    inputs = {"Fac": 1.0, "Factor": 1.0, "Color1": glow.picture(), "Color2": (0.2, 0.9, 0.5, 1.0)}
    return glow.node("ShaderNodeMixRGB", inputs, blend_type="MULTIPLY").outputs[0]


@number
def inverted_image(glow: Glow):
    return glow.node("ShaderNodeInvert", {"Color": glow.picture()}).outputs[0]


@number
def image_to_grey(glow: Glow):
    return glow.node("ShaderNodeRGBToBW", {"Color": glow.picture()}).outputs[0]


@number
def painted(glow: Glow):
    return glow.node("ShaderNodeVertexColor", layer_name="paint").outputs["Color"]


@number
def image_times_painted(glow: Glow):
    inputs = {"Fac": 1.0, "Factor": 1.0, "Color1": glow.picture(), "Color2": painted(glow)}
    return glow.node("ShaderNodeMixRGB", inputs, blend_type="MULTIPLY").outputs[0]


def attribute(name: str, *outputs: str):
    def build(glow: Glow):
        return named(glow.node("ShaderNodeAttribute", attribute_name=name).outputs, *outputs)

    return build


for name in ("paint", "wind"):
    for outputs in (("Color",), ("Vector",), ("Fac", "Factor"), ("Alpha",)):
        NUMBERS[f"{name} {outputs[-1]}"] = attribute(name, *outputs)


@number
def coordinates(glow: Glow):
    return glow.node("ShaderNodeTexCoord").outputs["UV"]


@number
def constant_vector(glow: Glow):
    return glow.node("ShaderNodeCombineXYZ", {"X": 0.1, "Y": 0.9, "Z": 0.2}).outputs[0]


@number
def moved_place(glow: Glow):
    place = glow.node("ShaderNodeNewGeometry").outputs["Position"]
    inputs = {"Vector": place, "Vector_001": (1.0, 2.0, 0.2)}
    return glow.node("ShaderNodeVectorMath", inputs, operation="ADD").outputs[0]


@number
def inverted_beyond(glow: Glow):
    much = glow.node("ShaderNodeValue").outputs[0]
    much.default_value = 1.1
    inputs = {"Fac": much, "Factor": much, "Color": glow.picture()}
    return glow.node("ShaderNodeInvert", inputs).outputs[0]


@number
def whole_number(glow: Glow):
    """By a group's socket for whole numbers; what varies is none in Cycles of Blender 5."""
    given = glow.node("ShaderNodeValue").outputs[0]
    given.default_value = 2.7
    group = glow.group(_passes_on, ["NodeSocketInt"], ["NodeSocketFloat"])
    glow.tree.links.new(given, group.inputs[0])
    return group.outputs[0]


@number
def constant_vector_as_colour(glow: Glow):
    off = glow.node("ShaderNodeGamma", {"Color": constant_vector(glow)})
    off.mute = True
    return off.outputs[0]


@number
def colours_beside_their_alpha(glow: Glow):
    """Of two nodes of one image: Cycles takes them for one."""
    image = bpy.data.images.new("clear", 1, 1, alpha=True, float_buffer=True)
    image.pixels.foreach_set((0.4, 0.3, 0.2, 0.25))
    image.update()
    color, alpha = (glow.node("ShaderNodeTexImage", image=image).outputs[k] for k in (0, 1))
    inputs = {"Fac": 0.3, "Factor": 0.3, "Color1": color, "Color2": alpha}
    return glow.node("ShaderNodeMixRGB", inputs).outputs[0]


def constant_vector_as_light(glow: Glow):
    """By a muted Mix Shader."""
    off = glow.node("ShaderNodeMixShader")
    off.mute = True
    glow.tree.links.new(constant_vector(glow), off.inputs[1])
    (end,) = (n for n in glow.tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    glow.tree.links.new(off.outputs[0], end.inputs["Surface"])


NOTHING = {}
"""Name -> a material in which links bring nothing."""


def nothing(build):
    NOTHING[build.__name__] = build
    return build


@nothing
def reroute_to_a_colour(glow: Glow):
    glow.feed(glow.node("NodeReroute").outputs[0], "Color")


@nothing
def reroutes_to_a_number(glow: Glow):
    one, two = (glow.node("NodeReroute") for _ in range(2))
    glow.tree.links.new(one.outputs[0], two.inputs[0])
    glow.feed(two.outputs[0])


@nothing
def reroute_to_a_node(glow: Glow):
    inputs = {"Value": 0.2, "Value_001": 0.3}
    sum_of = glow.node("ShaderNodeMath", inputs, operation="ADD")
    glow.tree.links.new(glow.node("NodeReroute").outputs[0], sum_of.inputs[0])
    glow.feed(sum_of.outputs[0])


@nothing
def reroute_to_a_group(glow: Glow):
    group = glow.group(_passes_on, ["NodeSocketColor"])
    group.inputs[0].default_value = 0.1, 0.2, 0.3, 1.0
    glow.tree.links.new(glow.node("NodeReroute").outputs[0], group.inputs[0])
    glow.feed(group.outputs[0], "Color")


@nothing
def reroute_in_a_group(glow: Glow):
    def fill(tree, given, made):
        tree.links.new(tree.nodes.new("NodeReroute").outputs[0], made.inputs[0])
        made.inputs[0].default_value = 0.3, 0.1, 0.1, 1.0

    glow.feed(glow.group(fill).outputs[0], "Color")


MUTED = {
    "ShaderNodeInvert": ("Color", (0.1, 0.2, 0.3, 1.0), "Color"),
    "ShaderNodeRGBToBW": ("Color", (0.1, 0.2, 0.3, 1.0), "Strength"),
    "ShaderNodeMath": ("Value", 0.3, "Strength"),
    "ShaderNodeTexNoise": ("Scale", 0.3, "Color"),
    "ShaderNodeValToRGB": ("Fac", 0.9, "Color"),
}


def muted(kind: str):
    def build(glow: Glow):
        name, value, fed = MUTED[kind]
        off = glow.node(kind, {name: value})
        off.mute = True
        glow.feed(off.outputs[0], fed)

    return build


NOTHING.update({f"muted {kind}": muted(kind) for kind in MUTED})


@nothing
def muted_group(glow: Glow):
    group = glow.group(_passes_on, ["NodeSocketColor"])
    group.inputs[0].default_value, group.mute = (0.1, 0.2, 0.3, 1.0), True
    glow.feed(group.outputs[0], "Color")


@nothing
def behind_a_muted_node(glow: Glow):
    first = glow.node("ShaderNodeInvert", {"Color": (0.1, 0.2, 0.3, 1.0)})
    inputs = {"Color": (0.3, 0.2, 0.1, 1.0), "Gamma": 2.0}
    second = glow.node("ShaderNodeGamma", inputs)
    first.mute = True
    glow.tree.links.new(first.outputs[0], second.inputs[0])
    glow.feed(second.outputs[0], "Color")


def check(glows: list[Glow], names: list[str], backend: str) -> None:
    """All of them beside each other."""
    scene = cycles.empty_scene(TILE * len(glows), TILE)
    for k, build in enumerate(glows):
        glow = Glow()
        build(glow)
        add(scene, names[k], quad(glow.material), moved(k + 0.5, 0.5, 0.0))
    camera = bpy.data.cameras.new("above")
    camera.type, camera.ortho_scale = "ORTHO", len(glows)
    scene.camera = add(scene, "above", camera, moved(len(glows) / 2, 0.5, 3.0))
    pair = render_pair(scene, backend, "sockets")
    seen, wanted = (
        picture.reshape(TILE, len(glows), TILE, 3).swapaxes(0, 1)
        for picture in (pair.glint["Combined"][..., :3], pair.cycles["Combined"][..., :3])
    )
    assert wanted.max((1, 2, 3)).min() > 0.01
    wrong = np.abs(seen - wanted).max((1, 2, 3)) > 5e-5  # luminance to four digits
    assert not wrong.any(), [name for name, bad in zip(names, wrong, strict=True) if bad]


@pytest.mark.parametrize("backend", BACKENDS)
def test_colours_count_as_their_luminance_and_vectors_as_their_mean(backend):
    def fed(build):
        return lambda glow: glow.feed(build(glow))

    builds = [*(fed(build) for build in NUMBERS.values()), constant_vector_as_light]
    check(builds, [*NUMBERS, "light"], backend)


@pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="they count as 0 in Cycles before 5.0")
@pytest.mark.parametrize("backend", BACKENDS)
def test_links_that_bring_nothing_leave_sockets_their_own_values(backend):
    check(list(NOTHING.values()), list(NOTHING), backend)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_output_may_be_in_a_group(backend):
    """Of a group of groups, whose input its shader gets."""

    def grouped(glow: Glow) -> None:
        (end,) = (n for n in glow.tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
        glow.tree.nodes.remove(end)

        def inner(tree, given, _made):
            shines, shown = (
                tree.nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "OutputMaterial")
            )
            tree.links.new(given.outputs[0], shines.inputs["Color"])
            tree.links.new(shines.outputs[0], shown.inputs["Surface"])

        group = glow.group(inner, ["NodeSocketColor"], ())

        def outer(tree, given, _made):
            inside = tree.nodes.new("ShaderNodeGroup")
            inside.node_tree = group.node_tree
            tree.links.new(given.outputs[0], inside.inputs[0])

        glow.group(outer, ["NodeSocketColor"], ()).inputs[0].default_value = 0.2, 0.3, 0.4, 1.0
        glow.tree.nodes.remove(group)

    check([grouped], ["grouped"], backend)
