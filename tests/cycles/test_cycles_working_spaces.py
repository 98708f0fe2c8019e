"""Files whose working space is not Rec. 709 (Blender 5.0 and later): whatever makes colours of
spectra and numbers of colours, as in Cycles.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export.images import colorspace
from glint_picture import BACKENDS, render_glint
from small_scenes import add, add_light, lambert, moved, plane

HAS_SPACES = hasattr(bpy.data, "colorspace")


def offered() -> list[str]:
    """Working spaces that this Blender has beside Rec. 709."""
    if not HAS_SPACES:
        return []
    asked = bpy.data.colorspace.bl_rna.properties["working_space"]
    names = (item.identifier for item in asked.enum_items)
    return [name for name in names if name != colorspace.REC709]


SPACES = offered()

pytestmark = pytest.mark.skipif(not HAS_SPACES, reason="Blender 5.0 brought working spaces")


@pytest.fixture(autouse=True)
def back_to_rec709():
    yield
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert colorspace.is_rec709()


def glowing(kind: str, output: str, to: str = "Color", **inputs):
    """A plane before the camera that shines with what a node gives."""
    material = bpy.data.materials.new("shown")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    node, shine, end = (
        tree.nodes.new(f"ShaderNode{name}") for name in (kind, "Emission", "OutputMaterial")
    )
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[output], shine.inputs[to])
    tree.links.new(shine.outputs[0], end.inputs["Surface"])
    return tree, node, material


def blackbody(scene):
    return glowing("Blackbody", "Color", Temperature=3000.0)[2]


def varying_blackbody(scene):
    tree, node, material = glowing("Blackbody", "Color")
    x = tree.nodes.new("ShaderNodeTexCoord")
    scale = tree.nodes.new("ShaderNodeMath")
    scale.operation, scale.inputs[1].default_value = "MULTIPLY", 6000.0
    tree.links.new(x.outputs["Generated"], scale.inputs[0])
    tree.links.new(scale.outputs[0], node.inputs[0])
    return material


def wavelength(scene):
    return glowing("Wavelength", "Color", Wavelength=530.0)[2]


def sky(scene):
    _, node, material = glowing("TexSky", "Color")
    node.sky_type, node.sun_direction = "PREETHAM", (0.3, 0.4, 0.8)
    return material


def grey_of_a_colour(scene):
    return glowing("RGBToBW", "Val", Color=(0.9, 0.2, 0.1, 1.0))[2]


def grey_of_what_varies(scene):
    tree, node, material = glowing("RGBToBW", "Val")
    x = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(x.outputs["Generated"], node.inputs[0])
    return material


def number_of_an_image(scene):
    """Linked to Strength."""
    picture = bpy.data.images.new("painted", 4, 4, float_buffer=True)
    picture.colorspace_settings.name = "Non-Color"
    picture.pixels = np.resize(np.array([0.9, 0.2, 0.1, 1.0], np.float32), 64)
    picture.update()
    picture.pack()
    _, node, material = glowing("TexImage", "Color", to="Strength")
    node.image = picture
    return material


def lamp(scene):
    light = add_light(scene, "POINT", (0.5, 0.3, 2.0), energy=200.0)
    light.data.use_nodes = True
    tree = light.data.node_tree
    shine = next(n for n in tree.nodes if n.type == "EMISSION")
    node = tree.nodes.new("ShaderNodeBlackbody")
    node.inputs[0].default_value = 2500.0
    tree.links.new(node.outputs[0], shine.inputs["Color"])
    return lambert((0.8, 0.8, 0.8))


def thin_film(scene):
    cycles.set_world(scene, (1.0, 1.0, 1.0))
    material = lambert((0.0, 0.0, 0.0))
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    for name, value in {
        "Base Color": (0, 0, 0, 1), "Metallic": 0.0, "Roughness": 0.0, "IOR": 1.6,
        "Thin Film Thickness": 400.0, "Thin Film IOR": 1.33,
    }.items():  # fmt: skip
        node.inputs[name].default_value = value
    end = next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL")
    tree.links.new(node.outputs[0], end.inputs["Surface"])
    return material


MAKERS = (
    thin_film,
    blackbody,
    varying_blackbody,
    wavelength,
    sky,
    grey_of_a_colour,
    grey_of_what_varies,
    number_of_an_image,
    lamp,
)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("space", SPACES)
def test_colours_are_those_of_the_working_space(space: str, make, backend: str) -> None:
    scene = cycles.empty_scene(16, 16)
    bpy.ops.wm.set_working_color_space(working_space=space)
    data = plane(4.0, make(scene))
    data.uv_layers.new(name="map")
    add(scene, "plane", data)
    camera = add(scene, "Camera", bpy.data.cameras.new("Camera"), moved(0, 0, 5))
    camera.data.type, camera.data.ortho_scale, scene.camera = "ORTHO", 2.0, camera
    bpy.context.view_layer.update()
    glint = render_glint(scene, backend, max_bounces=2).passes["Combined"][..., :3]
    truth = cycles.render_cycles(scene, bounces=2)["Combined"][..., :3]
    assert truth.max() > 0.01
    np.testing.assert_allclose(glint, truth, rtol=0.005, atol=0.002 * truth.max())


def test_the_working_spaces_luminance_is_that_of_its_name() -> None:
    found = {}
    for space in ("ACEScg", "Linear Rec.2020"):
        bpy.ops.wm.set_working_color_space(working_space=space)
        found[space] = colorspace.luma()
    np.testing.assert_allclose(found["ACEScg"], (0.2722, 0.6741, 0.0537), atol=0.01)
    np.testing.assert_allclose(found["Linear Rec.2020"], (0.2627, 0.6780, 0.0593), atol=1e-3)
    bpy.ops.wm.set_working_color_space(working_space=colorspace.REC709)
    assert colorspace.luma() is colorspace.LUMA
