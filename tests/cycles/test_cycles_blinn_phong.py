"""Blinn-Phong with a hard shadow, and seen in a mirror, against the same formula as a Cycles shader
network.

The network computes k_d max(0, n·l) + k_s [n·l > 0] max(0, n·h)^p times I = P/(4π² d²) from
Geometry's Position, Normal and Incoming and the light's position, into Emission; the shadow is the
mask of a Lambert render of the same scene.
"""

from math import pi

import pytest

import cycles_reference as cycles
import small_scenes as build
from glint.engine.scene import Input, Lobe
from glint_picture import BACKENDS, Pair, check_radiance, interior, render_pair, with_lobes

LAMP, POWER = (2.6, -2.4, 4.2), 500.0
SURFACES = {
    "Ground": ((0.5, 0.45, 0.4), (0.3, 0.3, 0.3), 12.0),
    "Red": ((0.6, 0.1, 0.05), (0.5, 0.5, 0.5), 60.0),
    "Blue": ((0.05, 0.1, 0.5), (0.4, 0.4, 0.6), 200.0),
}


class Network:
    """Short-hand for math nodes: every method returns an output socket."""

    def __init__(self, tree):
        self.tree = tree

    def node(self, kind: str, inputs, operation: str | None = None, output=0):
        node = self.tree.nodes.new(kind)
        if operation:
            node.operation = operation
        for socket, value in zip(node.inputs, inputs, strict=False):
            if hasattr(value, "is_linked"):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node.outputs[output]

    def vector(self, operation: str, *inputs):
        return self.node(
            "ShaderNodeVectorMath", inputs, operation, "Value" if operation == "DOT_PRODUCT" else 0
        )

    def math(self, operation: str, *inputs):
        return self.node("ShaderNodeMath", inputs, operation)


def blinn_phong_emission(material, diffuse, specular, exponent) -> None:
    """Replaces the material's nodes by the network."""
    tree = material.node_tree
    tree.nodes.clear()
    net = Network(tree)
    geometry = tree.nodes.new("ShaderNodeNewGeometry").outputs
    to_light = net.vector("SUBTRACT", LAMP, geometry["Position"])
    light = net.vector("NORMALIZE", to_light)
    half = net.vector("NORMALIZE", net.vector("ADD", light, geometry["Incoming"]))
    facing = net.vector("DOT_PRODUCT", geometry["Normal"], light)
    lambert = net.math("MAXIMUM", facing, 0.0)
    shine = net.math(
        "POWER",
        net.math("MAXIMUM", net.vector("DOT_PRODUCT", geometry["Normal"], half), 0.0),
        exponent,
    )
    shine = net.math("MULTIPLY", shine, net.math("GREATER_THAN", facing, 0.0))
    intensity = net.math(
        "DIVIDE", POWER / (4 * pi**2), net.vector("DOT_PRODUCT", to_light, to_light)
    )
    parts = [
        _scaled(net, net.math("MULTIPLY", term, intensity), color)
        for term, color in ((lambert, diffuse), (shine, specular))
    ]
    emission, output = (
        tree.nodes.new("ShaderNodeEmission"),
        tree.nodes.new("ShaderNodeOutputMaterial"),
    )
    tree.links.new(net.vector("ADD", *parts), emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])


def _scaled(net: Network, factor, color):
    """color × factor, three numbers."""
    node = net.tree.nodes.new("ShaderNodeVectorMath")
    node.operation = "SCALE"
    node.inputs[0].default_value = color
    net.tree.links.new(factor, node.inputs["Scale"])
    return node.outputs[0]


def build_scene(with_mirror: bool):
    scene = cycles.empty_scene(112, 112)
    materials = {}
    for name in SURFACES:
        materials[name] = build.lambert((0.8, 0.8, 0.8))
        materials[name].name = name
    build.add(scene, "Floor", build.plane(5.0, materials["Ground"]))
    build.add(
        scene, "Box", build.cube(materials["Red"]), build.moved(-1.2, 0.3, 0.61, 0.7, 0.5, 0.6)
    )
    build.add(
        scene,
        "Ball",
        build.ball(64, 48, True, materials["Blue"]),
        build.moved(0.9, -0.4, 1.01, 1.0, 1.0, 1.0),
    )
    if with_mirror:
        glass = build.add(scene, "Wall", build.plane(2.0, build.mirror((0.9, 0.8, 0.7))))
        glass.matrix_world = build.looking_at((-0.4, 2.6, 1.6), (-0.6, 6.0, 1.2))
    build.add_camera(scene)
    build.add_light(scene, "POINT", LAMP, energy=POWER)
    return scene, materials


def render_both(backend: str, with_mirror: bool) -> Pair:
    scene, materials = build_scene(with_mirror)
    table = {
        n: (Lobe("DIFFUSE", (Input(d),)), Lobe("SPECULAR", (Input(s),), exponent=p))
        for n, (d, s, p) in SURFACES.items()
    }
    bounces = int(with_mirror)
    pair = render_pair(
        scene,
        backend,
        f"blinn-phong-{'mirror' if with_mirror else 'shadow'}",
        bounces=bounces,
        edit=with_lobes(table),
    )
    lit = pair.cycles["Combined"][..., :3] > 0
    for name, values in SURFACES.items():
        blinn_phong_emission(materials[name], *values)
    pair.cycles["Combined"][..., :3] = (
        cycles.render_cycles(scene, bounces=bounces)["Combined"][..., :3] * lit
    )
    return pair


@pytest.mark.parametrize("backend", BACKENDS)
def test_blinn_phong_with_shadow(backend):
    pair = render_both(backend, with_mirror=False)
    check_radiance(pair, interior(pair))


@pytest.mark.parametrize("backend", BACKENDS)
def test_blinn_phong_in_a_mirror(backend):
    pair = render_both(backend, with_mirror=True)
    check_radiance(pair, interior(pair))
