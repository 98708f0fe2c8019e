"""Small scripted scenes for the export's tests, and the export of what they hold."""

from __future__ import annotations

import warnings
from dataclasses import replace

import bpy
import numpy as np
import pytest

from glint.addon.export import Export, export_scene
from glint.addon.export.materials.fresnel import normal_reflectance
from glint.addon.export.materials.roughness import dielectric_world, scattered
from glint.addon.export.materials.terms import luminance
from glint.engine.program.execute.run import run
from glint.engine.scene import Input, Lobe
from glint.engine.scene.problems import scene_problems


@pytest.fixture
def scene():
    """An empty scene with a camera at (0, -6, 0) that looks along +y."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.camera = link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    scene.camera.location, scene.camera.rotation_euler = (0, -6, 0), (np.pi / 2, 0, 0)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = (
        64,
        48,
        100,
    )
    return scene


def link(thing):
    bpy.context.scene.collection.objects.link(thing)
    return thing


def export(**options) -> Export:
    """Exports the current scene; the result must be sound."""
    bpy.context.view_layer.update()
    result = export_scene(bpy.context.evaluated_depsgraph_get(), **options)
    assert scene_problems(result.scene) == []
    return result


def use_nodes(block) -> None:
    """Nodes on, cleared. Blender 5 deprecates the switch."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        block.use_nodes = True
    block.node_tree.nodes.clear()


def mesh_object(name: str, vertices, faces, *materials):
    """A mesh object of the scene."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    for material in materials:
        data.materials.append(material)
    data.update()
    return link(bpy.data.objects.new(name, data))


def quad(name: str = "Quad", *materials):
    return mesh_object(
        name, [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2, 3)], *materials
    )


RED = (0.8, 0.2, 0.1, 1.0)


class Shader:
    """A material under construction, worn by a quad with a UV map and a colour attribute."""

    def __init__(
        self, name: str = "Material", shader: str | None = "ShaderNodeBsdfDiffuse"
    ) -> None:
        self.material = bpy.data.materials.new(name)
        use_nodes(self.material)
        self.tree = self.material.node_tree
        self.output = self.tree.nodes.new("ShaderNodeOutputMaterial")
        self.shader = self.node(shader) if shader else None
        if shader:
            self.link(self.shader, 0, self.output, "Surface")
        self.quad = quad("Quad", self.material)
        self.quad.data.uv_layers.new(name="UVMap")
        self.quad.data.color_attributes.new("Col", "FLOAT_COLOR", "CORNER")

    def node(self, kind: str, **settings):
        """A new node; settings are attributes, or inputs by name where the node has no such
        attribute.
        """
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def link(self, source, output, target, name) -> None:
        outputs = source.outputs
        self.tree.links.new(outputs[output], _input(target, name))

    def export(self) -> tuple[Export, tuple[Lobe, ...]]:
        """The export and the lobes of this material."""
        result = export()
        material = next(m for m in result.scene.materials if m.name == self.material.name)
        return result, material.lobes


def set_inputs(node, **inputs) -> None:
    """Constants of a node's inputs by name, with _ for a space."""
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value


def principled(**inputs) -> Shader:
    """A Principled BSDF of IOR 1.5 in a version's own defaults but for the microfacets."""
    shader = Shader(shader="ShaderNodeBsdfPrincipled")
    shader.shader.distribution = "MULTI_GGX"
    set_inputs(shader.shader, IOR=1.5, **inputs)
    return shader


def layer_share(
    ior: float = 1.5,
    roughness: float = 0.5,
    cosine: float = 1.0,
    tint: float = 1.0,
    kind: str = "LAYER",
) -> float:
    """What a Principled's dielectric layer keeps from what is below where it is seen at an angle of
    that cosine; kind DIELECTRIC: what it reflects of an even world.
    """
    world, f0 = dielectric_world(roughness, ior, kind), tint * normal_reflectance(ior)
    x = (1 - cosine) ** world.q
    once, again = (
        world.a0 + world.a1 * x,
        scattered(normal_reflectance(ior) * 20 / 21 + 1 / 21, roughness),
    )
    return f0 * (once + again * (1 - once)) + (1 - f0) * (world.b0 + world.b1 * x)


def kinds(lobes) -> set[str]:
    return {lobe.kind for lobe in lobes}


def _input(node, name):
    by_identifier = [socket for socket in node.inputs if socket.identifier == name]
    return by_identifier[0] if by_identifier else node.inputs[name]


def of_kind(lobes, kind: str) -> list[Lobe]:
    return [lobe for lobe in lobes if lobe.kind == kind]


def weight(lobe: Lobe, textures=(), colors=None) -> np.ndarray:
    """(3,) the product of a lobe's factors where textures give their first texel and attributes
    give `colors[name]`.
    """
    product = np.ones(3)
    for factor in lobe.factors:
        product = product * _factor(factor, textures, colors or {})
    return product


def first_texel(texture) -> tuple[np.ndarray, float]:
    """Linear colour (3,) and alpha."""
    texel = texture.pixels[0, 0].astype(float)
    texel = texel / 255 if texture.pixels.dtype == np.uint8 else texel
    rgb = srgb_to_linear(texel[:3]) if texture.encoding == "SRGB" else texel[:3]
    return rgb, float(texel[3])


def _factor(factor: Input, textures, colors) -> np.ndarray:
    value = np.array(factor.value)
    if factor.texture >= 0:
        rgb, alpha = first_texel(textures[factor.texture])
        value = value * {"COLOR": rgb, "ALPHA": alpha, "LUMINANCE": luminance(rgb)}[factor.channel]
    if factor.attribute:
        shown = colors[factor.attribute]
        is_grey = factor.attribute_channel == "LUMINANCE"
        value = value * (luminance(shown) if is_grey else np.array(shown))
    value = np.clip(value + np.array(factor.offset), factor.low, factor.high)
    return 1 - value if factor.complement else value


class FirstTexels:
    """One point, that sees the first texel of each image and is seen at a slant."""

    def __init__(self, textures) -> None:
        self._textures = textures

    def uv(self, name: str, shift: int) -> np.ndarray:
        return np.zeros((2, 1))

    def image(self, number: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        rgb, alpha = first_texel(self._textures[number])
        return np.array([*rgb, alpha])[:, None]

    def incoming(self) -> np.ndarray:
        return np.array([[0.0], [0.6], [0.8]])

    def normal(self) -> np.ndarray:
        return np.array([[0.0], [0.0], [1.0]])


def outputs_of(material, textures) -> list[np.ndarray]:
    """(3,) of each output of a material's program where textures give their first texel."""
    return [value[:, 0] for value in run(material.program, FirstTexels(textures), 1)]


def resolved(result: Export, name: str = "Material") -> tuple[Lobe, ...]:
    """A material's lobes with what its program gives in the place of outputs."""
    material = next(m for m in result.scene.materials if m.name == name)
    if material.program is None:
        return material.lobes
    outputs = outputs_of(material, result.scene.textures)

    def settled(factor: Input) -> Input:
        if factor.output < 0:
            return factor
        return replace(factor, value=tuple(factor.value * outputs[factor.output]), output=-1)

    return tuple(
        replace(lobe, factors=tuple(map(settled, lobe.factors))) for lobe in material.lobes
    )


VIEWED = ("AMBIENT", "DIFFUSE", "OREN_NAYAR", "OREN_NAYAR_MULTIPLE")


def total(lobes, kind: str, textures=(), colors=None, cosine: float = 1.0) -> np.ndarray:
    """(3,) the summed weight of all lobes of a kind; of those that depend on it, where n·v is
    `cosine`.
    """
    shares = (
        (1 - cosine) ** lobe.exponent if kind in VIEWED else 1.0 for lobe in of_kind(lobes, kind)
    )
    return sum(
        (
            share * weight(lobe, textures, colors)
            for share, lobe in zip(shares, of_kind(lobes, kind), strict=True)
        ),
        np.zeros(3),
    )


def srgb_to_linear(value):
    value = np.asarray(value, np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def image(
    name: str = "Image",
    pixels=((0.5, 0.25, 0.75, 1.0),),
    size=(1, 1),
    float_buffer: bool = False,
    space: str = "",
):
    """A generated image whose pixels are repeated from `pixels`, in a colour space (which would
    clear them if set later).
    """
    picture = bpy.data.images.new(name, *size, alpha=True, float_buffer=float_buffer)
    if space:
        picture.colorspace_settings.name = space
    count = size[0] * size[1]
    picture.pixels = np.resize(np.array(pixels, np.float32), (count, 4)).ravel()
    picture.update()
    return picture
