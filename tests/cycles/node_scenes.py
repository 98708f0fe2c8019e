"""Materials made of many nodes, and a scene that shows one: both engines render the same.

Every material ends in a Diffuse BSDF of roughness 0, so that differences come from its nodes alone.
Sockets are meant by their identifiers, which are the same in all versions of Blender.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import numpy as np

import cycles_reference as cycles
from small_scenes import add, add_camera, add_light, ball, cube, lambert, moved, plane

COORDINATES = "ShaderNodeTexCoord"
MAPPING = "ShaderNodeMapping"
NOISE = "ShaderNodeTexNoise"
RAMP = "ShaderNodeValToRGB"
MATH = "ShaderNodeMath"
MIX = "ShaderNodeMix"
BUMP = "ShaderNodeBump"


class _Nodes:
    """The node tree of a material, emptied, to which nodes are added with what feeds them."""

    def __init__(self, material: Any) -> None:
        cycles.use_nodes(material)
        self.tree = material.node_tree
        self.tree.nodes.clear()

    def add(self, kind: str, output: str, inputs: dict[str, Any], **properties: Any) -> Any:
        """The output socket of a new node. inputs: values or sockets, by identifier."""
        node = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(node, name, value)
        for name, value in inputs.items():
            self._feed(_of(node.inputs, name), value)
        return _of(node.outputs, output)

    def _feed(self, socket: Any, value: Any) -> None:
        if hasattr(value, "is_output"):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def mapped(self, **inputs: tuple[float, float, float]) -> Any:
        """Object coordinates, mapped."""
        where = self.add(COORDINATES, "Object", {})
        return self.add(MAPPING, "Vector", {"Vector": where, **inputs})

    def math(self, operation: str, *values: Any) -> Any:
        inputs = dict(zip(("Value", "Value_001", "Value_002"), values, strict=False))
        return self.add(MATH, "Value", inputs, operation=operation)

    def mix(self, factor: Any, a: Any, b: Any, blend: str = "MIX") -> Any:
        inputs = {"Factor_Float": factor, "A_Color": _rgba(a), "B_Color": _rgba(b)}
        return self.add(MIX, "Result_Color", inputs, data_type="RGBA", blend_type=blend)

    def ramp(self, factor: Any, *stops: tuple[float, tuple], interpolation="LINEAR") -> Any:
        """Colours (r, g, b) by positions, at least two."""
        color = self.add(RAMP, "Color", {"Fac": factor})
        band = color.node.color_ramp
        band.interpolation = interpolation
        for _ in stops[2:]:
            band.elements.new(0.5)
        for element, (position, _) in zip(band.elements, stops, strict=True):
            element.position = position
        for element, (_, stop) in zip(band.elements, stops, strict=True):
            element.color = (*stop, 1.0)
        return color

    def bump(self, height: Any, strength: float, distance: float) -> Any:
        inputs = {"Height": height, "Strength": strength, "Distance": distance}
        return self.add(BUMP, "Normal", inputs)

    def diffuse(self, color: Any, normal: Any = None) -> None:
        """The material's surface."""
        inputs = {"Color": color, "Roughness": 0.0}
        inputs |= {} if normal is None else {"Normal": normal}
        shader = self.add("ShaderNodeBsdfDiffuse", "BSDF", inputs)
        output = self.tree.nodes.new("ShaderNodeOutputMaterial")
        self.tree.links.new(shader, output.inputs["Surface"])


def _of(sockets: Any, identifier: str) -> Any:
    return next(socket for socket in sockets if socket.identifier == identifier)


def _rgba(color: Any) -> Any:
    return (*color, 1.0) if isinstance(color, tuple) else color


def wood(material: Any) -> None:
    """Rings around a tilted axis, disturbed by noise, with fibres along it."""
    nodes = _Nodes(material)
    where = nodes.mapped(Location=(0.3, 0.1, 0.0), Rotation=(0.2, 1.3, 0.4), Scale=(1.0, 1.0, 0.3))
    rings = nodes.add(
        "ShaderNodeTexWave",
        "Fac",
        {"Vector": where, "Scale": 0.9, "Distortion": 2.5, "Detail": 3.0, "Detail Scale": 1.2},
        wave_type="RINGS",
        rings_direction="Z",
        wave_profile="SAW",
    )
    stretched = nodes.add(MAPPING, "Vector", {"Vector": where, "Scale": (24.0, 24.0, 1.5)})
    fibres = nodes.add(
        NOISE, "Fac", {"Vector": stretched, "Scale": 1.0, "Detail": 4.0, "Roughness": 0.6}
    )
    light, dark = (0.52, 0.28, 0.11), (0.20, 0.075, 0.024)
    ringed = nodes.ramp(rings, (0.0, light), (0.7, (0.40, 0.18, 0.06)), (0.93, dark), (1.0, light))
    grain = nodes.ramp(fibres, (0.35, (0.45, 0.42, 0.40)), (0.65, (1.0, 1.0, 1.0)))
    height = nodes.math("MULTIPLY_ADD", rings, 0.4, fibres)
    nodes.diffuse(nodes.mix(0.8, ringed, grain, "MULTIPLY"), nodes.bump(height, 0.3, 0.02))


def marble(material: Any) -> None:
    """Veins: waves along a coordinate that noise has moved, sharpened, over a cloudy ground."""
    nodes = _Nodes(material)
    where = nodes.mapped(Rotation=(0.5, 0.2, 0.9), Scale=(1.3, 1.3, 1.3))
    clouds = nodes.add(
        NOISE, "Color", {"Vector": where, "Scale": 1.6, "Detail": 5.0, "Distortion": 0.4}
    )
    centred = nodes.add(
        "ShaderNodeVectorMath",
        "Vector",
        {"Vector": clouds, "Vector_001": (0.5, 0.5, 0.5)},
        operation="SUBTRACT",
    )
    moved_by = nodes.add(
        "ShaderNodeVectorMath", "Vector", {"Vector": centred, "Scale": 1.8}, operation="SCALE"
    )
    aside = nodes.add(
        "ShaderNodeVectorMath",
        "Vector",
        {"Vector": where, "Vector_001": moved_by},
        operation="ADD",
    )
    waves = nodes.add(
        "ShaderNodeTexWave",
        "Fac",
        {"Vector": aside, "Scale": 0.35, "Distortion": 0.0},
        bands_direction="DIAGONAL",
        wave_profile="TRI",
    )
    veins = nodes.math("POWER", nodes.math("SUBTRACT", 1.0, waves), 6.0)
    ground = nodes.ramp(
        nodes.add(NOISE, "Fac", {"Vector": where, "Scale": 3.0, "Detail": 3.0}),
        (0.2, (0.75, 0.73, 0.70)),
        (0.8, (0.93, 0.92, 0.90)),
        interpolation="EASE",
    )
    nodes.diffuse(nodes.mix(veins, ground, (0.12, 0.13, 0.16)))


def brick(material: Any) -> None:
    """A wall: bricks of two colours with stains, and mortar that lies deeper."""
    nodes = _Nodes(material)
    where = nodes.mapped(Rotation=(pi / 2, 0.0, 0.0), Scale=(1.0, 1.0, 1.0))
    stains = nodes.add(
        NOISE, "Fac", {"Vector": where, "Scale": 4.0, "Detail": 4.0, "Roughness": 0.7}
    )
    inputs = {
        "Vector": where,
        "Color1": (0.45, 0.12, 0.06, 1.0),
        "Color2": (0.30, 0.06, 0.035, 1.0),
        "Mortar": (0.55, 0.53, 0.50, 1.0),
        "Scale": 2.5,
        "Mortar Size": 0.03,
        "Mortar Smooth": 0.4,
        "Bias": -0.1,
    }
    settings = {"offset": 0.5, "offset_frequency": 2, "squash": 0.7, "squash_frequency": 3}
    wall = nodes.add("ShaderNodeTexBrick", "Color", inputs, **settings)
    mortar = _of(wall.node.outputs, "Fac")
    lightness = nodes.add(
        "ShaderNodeMapRange",
        "Result",
        {"Value": stains, "From Min": 0.3, "From Max": 0.7, "To Min": 0.6, "To Max": 1.25},
    )
    varied = nodes.add(
        "ShaderNodeHueSaturation", "Color", {"Color": wall, "Saturation": 1.1, "Value": lightness}
    )
    rough = nodes.math("MULTIPLY", stains, 0.3)
    nodes.diffuse(varied, nodes.bump(nodes.math("SUBTRACT", rough, mortar), 0.6, 0.03))


def layered_noise(material: Any) -> None:
    """Three noises of different types and sizes, one the mask of the others."""
    nodes = _Nodes(material)
    where = nodes.mapped(Location=(1.7, -0.4, 0.6), Scale=(1.0, 1.0, 1.5))
    coarse = nodes.add(
        NOISE, "Fac", {"Vector": where, "Scale": 1.3, "Detail": 2.0, "Distortion": 0.6}
    )
    ridges = nodes.add(
        NOISE,
        "Fac",
        {"Vector": where, "Scale": 2.2, "Detail": 4.0, "Offset": 0.9, "Gain": 1.5},
        noise_type="RIDGED_MULTIFRACTAL",
    )
    fine = nodes.add(
        NOISE,
        "Color",
        {"Vector": where, "W": 3.5, "Scale": 7.0, "Detail": 3.0, "Lacunarity": 2.3},
        noise_dimensions="4D",
    )
    cracks = nodes.ramp(ridges, (0.2, (0.03, 0.05, 0.10)), (0.9, (0.75, 0.45, 0.15)))
    sand = nodes.mix(0.6, (0.55, 0.48, 0.36), fine, "OVERLAY")
    mask = nodes.add(
        "ShaderNodeMapRange",
        "Result",
        {"Value": coarse, "From Min": 0.42, "From Max": 0.58},
        interpolation_type="SMOOTHSTEP",
    )
    gamma = nodes.add("ShaderNodeGamma", "Color", {"Color": sand, "Gamma": 1.4})
    nodes.diffuse(nodes.mix(mask, cracks, gamma), nodes.bump(mask, 0.4, 0.05))


def camouflage(material: Any) -> None:
    """Spots with soft edges of four colours, one noise over the other."""
    nodes = _Nodes(material)
    color: Any = (0.19, 0.20, 0.10)
    spots = (
        ((0.0, 0.0, 0.0), 1.6, 0.50, (0.075, 0.095, 0.035)),
        ((7.3, 2.1, -4.0), 2.0, 0.54, (0.22, 0.13, 0.06)),
        ((-3.2, 9.4, 5.5), 2.4, 0.58, (0.02, 0.021, 0.017)),
    )
    for location, scale, threshold, spot in spots:
        where = nodes.mapped(Location=location)
        noise = nodes.add(
            NOISE,
            "Fac",
            {"Vector": where, "Scale": scale, "Detail": 1.5, "Distortion": 0.8},
        )
        mask = nodes.ramp(
            noise, (threshold - 0.01, (0.0, 0.0, 0.0)), (threshold + 0.01, (1.0, 1.0, 1.0))
        )
        color = nodes.mix(mask, color, spot)
    weave = nodes.add(
        "ShaderNodeTexChecker",
        "Fac",
        {"Vector": nodes.mapped(), "Scale": 40.0},
    )
    shade = nodes.math("MULTIPLY_ADD", weave, 0.15, 0.85)
    nodes.diffuse(nodes.mix(1.0, color, shade, "MULTIPLY"))


def twelve_images(material: Any) -> None:
    """Four layers of paint: each a colour, a mask and a height from images of its own."""
    nodes = _Nodes(material)
    color: Any = (0.4, 0.38, 0.35)
    height: Any = 0.0
    for layer in range(4):
        where = nodes.add(COORDINATES, "UV", {})
        placed = nodes.add(
            MAPPING,
            "Vector",
            {
                "Vector": where,
                "Location": (0.13 * layer, 0.31 * layer, 0.0),
                "Rotation": (0.0, 0.0, 0.4 * layer),
                "Scale": (2.0 + layer, 2.0 + layer, 1.0),
            },
        )
        paint, mask, relief = (
            nodes.add("ShaderNodeTexImage", "Color", {"Vector": placed}, image=_clouds(seed))
            for seed in range(3 * layer, 3 * layer + 3)
        )
        share = nodes.ramp(mask, (0.4, (0.0, 0.0, 0.0)), (0.6, (1.0, 1.0, 1.0)))
        color = nodes.mix(share, color, paint)
        height = nodes.math("ADD", height, nodes.math("MULTIPLY", share, relief))
    nodes.diffuse(color, nodes.bump(height, 0.2, 0.02))


def dirty_corners(material: Any) -> None:
    """Paint with dirt where little light gets: Ambient Occlusion of 8 samples, broken by noise."""
    nodes = _Nodes(material)
    occlusion = {"Distance": 0.6}
    open_share = nodes.add("ShaderNodeAmbientOcclusion", "AO", occlusion, samples=8)
    spots = nodes.add(NOISE, "Fac", {"Vector": nodes.mapped(), "Scale": 5.0, "Detail": 3.0})
    dirt = nodes.ramp(
        nodes.math("MULTIPLY", open_share, spots),
        (0.2, (0.05, 0.04, 0.03)),
        (0.45, (0.55, 0.12, 0.05)),
    )
    nodes.diffuse(dirt)


def _clouds(seed: int, size: int = 256) -> Any:
    """An image of soft spots, the same for each seed, that can be tiled."""
    numbers = np.random.default_rng(seed)
    rows = 2 * pi * np.arange(size) / size
    values = np.zeros((size, size, 3))
    for _ in range(12):
        u, v = numbers.integers(-4, 5, 2)
        wave = np.cos(u * rows[None, :] + v * rows[:, None] + numbers.uniform(0, 2 * pi))
        values += wave[:, :, None] * numbers.uniform(-0.2, 0.2, 3)
    rgba = np.ones((size, size, 4), np.float32)
    rgba[..., :3] = np.clip(0.5 + values, 0, 1)
    picture = cycles.bpy.data.images.new(f"clouds {seed}", size, size)
    picture.pixels.foreach_set(rgba.reshape(-1))
    picture.pack()
    return picture


def _unwrapped(mesh: Any) -> Any:
    """The mesh with a UV map that has no seams: a slanted projection."""
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    slanted = points.reshape(-1, 3) @ np.float32([[0.2, 0.0], [0.0, 0.2], [0.08, 0.13]])
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", slanted[corners].reshape(-1))
    return mesh


MATERIALS: tuple[Callable[[Any], None], ...] = (
    wood,
    marble,
    brick,
    layered_noise,
    camouflage,
    twelve_images,
)
GRAINY: tuple[Callable[[Any], None], ...] = (dirty_corners,)
"""Of which Cycles has no exact picture at few samples."""


def show(build: Callable[[Any], None], width: int = 96, height: int = 96) -> Any:
    """A new file's scene: a ball and a box of the material that `build` makes, on a grey floor in
    the light of one hard sun.
    """
    scene = cycles.empty_scene(width, height)
    material = cycles.bpy.data.materials.new(build.__name__)
    build(material)
    add(scene, "Floor", plane(6.0, lambert((0.5, 0.5, 0.5))))
    add(scene, "Ball", _unwrapped(ball(48, 32, True, material)), moved(0.9, -0.7, 1.0))
    add(scene, "Box", _unwrapped(cube(material)), moved(-1.1, 0.7, 1.01, 0.9, 0.9, 1.0))
    add_camera(scene, location=(2.9, -3.9, 3.3), target=(0.0, 0.0, 0.9))
    add_light(scene, "SUN", (2.0, -5.0, 4.0), energy=3.0)
    return scene
