"""Node trees of lights: how bright they are by distance, direction and place, as in Cycles."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint_picture import BACKENDS, check_radiance, interior, render_pair, verdict

KEY = (3.0, -2.0, 4.5)


class LightTree:
    """A light's nodes, behind its Emission node."""

    def __init__(self, light) -> None:
        light.use_nodes = True
        self.tree = light.node_tree
        self.emission = next(n for n in self.tree.nodes if n.type == "EMISSION")

    def add(self, kind: str, **properties):
        node = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(node, name, value)
        return node

    def link(self, start, end) -> None:
        self.tree.links.new(start, end)

    def color(self, socket) -> None:
        self.link(socket, self.emission.inputs["Color"])

    def strength(self, socket) -> None:
        self.link(socket, self.emission.inputs["Strength"])


def falloff(name: str, smooth: float = 0.0):
    def make(tree: LightTree) -> None:
        node = tree.add("ShaderNodeLightFalloff")
        node.inputs["Strength"].default_value = 0.7
        node.inputs["Smooth"].default_value = smooth
        tree.strength(node.outputs[name])

    return make


def by(kind: str, name: str):
    """A colour by a coordinate, away from the jumps at 0."""

    def make(tree: LightTree) -> None:
        node = tree.add("ShaderNodeVectorMath", operation="MULTIPLY_ADD")
        tree.link(tree.add(kind).outputs[name], node.inputs[0])
        node.inputs[1].default_value = (0.3, 0.2, 0.1)
        node.inputs[2].default_value = (0.9, 0.8, 0.7)
        tree.color(node.outputs[0])

    return make


def noise(tree: LightTree) -> None:
    """A pattern by direction, as gobos are made."""
    texture = tree.add("ShaderNodeTexNoise")
    texture.inputs["Scale"].default_value = 4.0
    tree.link(tree.add("ShaderNodeTexCoord").outputs["Normal"], texture.inputs["Vector"])
    tree.color(texture.outputs["Color"])


def ray_length(tree: LightTree) -> None:
    math = tree.add("ShaderNodeMath", operation="MULTIPLY")
    math.inputs[1].default_value = 0.2
    tree.link(tree.add("ShaderNodeLightPath").outputs["Ray Length"], math.inputs[0])
    tree.strength(math.outputs[0])


def blackbody(tree: LightTree) -> None:
    """Hotter with the distance, of a wavelength besides."""
    math = tree.add("ShaderNodeMath", operation="MULTIPLY_ADD")
    math.inputs[1].default_value, math.inputs[2].default_value = 900.0, -2000.0
    tree.link(tree.add("ShaderNodeLightPath").outputs["Ray Length"], math.inputs[0])
    warm, bright = tree.add("ShaderNodeBlackbody"), tree.add("ShaderNodeWavelength")
    bright.inputs[0].default_value = 550.0
    tree.link(math.outputs[0], warm.inputs[0])
    tree.color(warm.outputs[0])
    tree.strength(bright.outputs[0])


TREES = {
    "blackbody": blackbody,
    "quadratic": falloff("Quadratic"),
    "linear": falloff("Linear"),
    "constant": falloff("Constant"),
    "smooth": falloff("Linear", 3.0),
    "ray_length": ray_length,
    "noise": noise,
    "position": by("ShaderNodeNewGeometry", "Position"),
    "normal": by("ShaderNodeNewGeometry", "Normal"),
    "incoming": by("ShaderNodeNewGeometry", "Incoming"),
    "generated": by("ShaderNodeTexCoord", "Generated"),
    "own_normal": by("ShaderNodeTexCoord", "Normal"),
    "object": by("ShaderNodeTexCoord", "Object"),
    "reflection": by("ShaderNodeTexCoord", "Reflection"),
}


def web(azimuths: tuple, polar: tuple, seed: int = 3) -> str:
    """A luminaire's file, of random intensities."""
    candelas = np.random.default_rng(seed).uniform(300, 2000, (len(azimuths), len(polar)))
    if azimuths[-1] == 360:
        candelas[-1] = candelas[0]
    candelas[:, 0] = 1500
    rows = [" ".join(f"{x:.1f}" for x in row) for row in (polar, azimuths, *candelas)]
    head = f"1 1000 1.5 {len(polar)} {len(azimuths)} 1 2 0 0 0\n1.0 0.9 100"
    return "\n".join(("IESNA:LM-63-2002", "[TEST] none", "TILT=NONE", head, *rows, ""))


def ies(text: str, turned: bool = False):
    def make(tree: LightTree) -> None:
        node = tree.add("ShaderNodeTexIES", mode="INTERNAL")
        node.ies = cycles.bpy.data.texts.new("luminaire")
        node.ies.write(text)
        node.inputs["Strength"].default_value = 0.02
        if turned:
            tree.link(tree.add("ShaderNodeNewGeometry").outputs["Normal"], node.inputs["Vector"])
        tree.strength(node.outputs[0])

    return make


DOWN = tuple(range(0, 91, 10))
WEBS = {
    "round": ies(web((0,), (0, 20, 45, 60, 90, 120, 180))),
    "quarter": ies(web((0, 30, 90), DOWN)),
    "half": ies(web((0, 45, 90, 135, 180), DOWN)),
    "whole": ies(web(tuple(range(0, 361, 30)), DOWN)),
    "unclosed": ies(web(tuple(range(0, 360, 30)), (0, 30, 60, 90))),
    "sideways": ies(web((90, 135, 180, 270), (0, 30, 80))),
    "cut": ies(web((0, 120, 240), (15, 25, 35, 40))),
    "turned": ies(web((0, 60, 120, 180, 360), (0, 40, 90, 180)), turned=True),
    "broken": ies("IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 3"),
}


def pair_of(kind: str, make, backend: str, scale=(1.0, 1.0, 1.0), size: int = 64):
    scene = cycles.empty_scene(size, size)
    build.still_life(scene)
    build.add_camera(scene)
    light = build.add_light(scene, kind, KEY, energy=2.5 if kind == "SUN" else 400.0)
    light.scale = scale
    if kind == "SPOT":
        light.data.spot_size = radians(80)
    make(LightTree(light.data))
    return render_pair(scene, backend, f"light-nodes-{kind.lower()}")


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["POINT", "SPOT", "SUN"])
@pytest.mark.parametrize("tree", TREES)
def test_by_place_and_direction(tree, kind, backend):
    pair = pair_of(kind, TREES[tree], backend)
    check_radiance(pair, interior(pair))


def normal_map(space: str):
    """A colour by a normal that is bent by another, away from the jumps at 0."""

    def make(tree: LightTree) -> None:
        bent = tree.add("ShaderNodeNormalMap", space=space)
        bent.inputs["Strength"].default_value = 0.6
        by("ShaderNodeNewGeometry", "Incoming")(tree)
        node = tree.emission.inputs["Color"].links[0].from_node
        tree.link(node.outputs[0], bent.inputs["Color"])
        last = tree.add("ShaderNodeVectorMath", operation="MULTIPLY_ADD")
        tree.link(bent.outputs[0], last.inputs[0])
        last.inputs[1].default_value = (0.3, 0.2, 0.1)
        last.inputs[2].default_value = (0.9, 0.8, 0.7)
        tree.color(last.outputs[0])

    return make


@pytest.mark.parametrize("space", ["OBJECT", "BLENDER_WORLD"])
@pytest.mark.parametrize("kind", ["POINT", "SUN"])
def test_normal_maps_bend_a_lights_normal(kind, space):
    pair = pair_of(kind, normal_map(space), "NATIVE")
    check_radiance(pair, interior(pair))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["POINT", "SPOT"])
def test_uv_round_a_point_and_in_a_cone(kind, backend):
    pair = pair_of(kind, by("ShaderNodeTexCoord", "UV"), backend)
    check_radiance(pair, interior(pair))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("tree", ["object", "own_normal", "generated"])
def test_of_a_scaled_light(tree, backend):
    pair = pair_of("POINT", TREES[tree], backend, (1.5, 0.5, -2.0))
    check_radiance(pair, interior(pair))


SEEN = {
    "ball": ("POINT", {"shadow_soft_size": 0.8, "use_soft_falloff": False}),
    "disc": ("POINT", {"shadow_soft_size": 0.8, "use_soft_falloff": True}),
    "rectangle": ("AREA", {"shape": "RECTANGLE", "size": 1.6, "size_y": 0.9}),
    "ellipse": ("AREA", {"shape": "ELLIPSE", "size": 1.6, "size_y": 0.9}),
}
SURFACES = {
    name: by(kind, name)
    for kind, names in {
        "ShaderNodeNewGeometry": ("Position", "Normal", "Incoming"),
        "ShaderNodeTexCoord": ("UV", "Object", "Generated"),
    }.items()
    for name in names
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("tree", SURFACES)
@pytest.mark.parametrize("lamp", SEEN)
def test_seen_in_a_mirror(lamp, tree, backend):
    check_seen(lamp, SURFACES[tree], backend)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("lamp", ["rectangle", "ellipse"])
def test_places_on_areas_seen_in_a_mirror(lamp, backend):
    check_seen(lamp, by("ShaderNodeNewGeometry", "Parametric"), backend)


def check_seen(lamp: str, make, backend: str) -> None:
    kind, properties = SEEN[lamp]
    scene = cycles.empty_scene(96, 96)
    build.add(scene, "Mirror", build.plane(4.0, build.mirror((0.9, 0.8, 0.7))))
    build.add_camera(scene)
    light = build.add_light(scene, kind, (-1.5, 2.0, 3.0), energy=100.0, **properties)
    make(LightTree(light.data))
    pair = render_pair(scene, backend, f"light-nodes-seen-{lamp}", bounces=1)
    truth, picture = (color.astype(float) for color in pair.colors())
    seen = (truth.sum(-1) > 0) & (picture.sum(-1) > 0)
    assert seen.sum() > 40
    verdict(pair, "radiance", np.abs(picture - truth).max(-1) / truth.max() * seen, 1e-4)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", WEBS)
def test_photometric_webs(name, backend):
    """In tables of a third and a sixth of a degree, where Cycles looks each direction up: within
    what that shows of splines of random numbers 30 and 10 degrees apart.
    """
    pair = pair_of("POINT", WEBS[name], backend)
    check_radiance(pair, interior(pair), 1e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_photometric_webs_of_areas_are_by_the_direction_of_the_light(backend):
    """In the space of the object, which is turned and scaled."""
    pair = pair_of("AREA", WEBS["half"], backend, (0.02, 0.03, 1.0))
    check_radiance(pair, interior(pair), 5e-3)
