"""Every type of attribute that a mesh can have, and the names that Cycles gives a meaning of its
own, as an Attribute node reads them: as in Cycles, or told. What the next Blender adds is in the
lists of its own.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export import export_scene
from glint_picture import render_glint
from small_scenes import add, ball, moved

TYPES = [
    item.identifier
    for item in bpy.types.AttributeGroupMesh.bl_rna.functions["new"].parameters["type"].enum_items
]
OUTPUTS = ("Color", "Vector", "Fac", "Alpha")
STANDARD = (
    "N",
    "generated",
    "uv",
    "tangent",
    "tangent_sign",
    "undisplaced_tangent",
    "undisplaced_tangent_sign",
    "vertex_color",
    "pointiness",
    "random_per_island",
    "nowhere",
    "",
)
FIELDS = ("value", "vector", "color")
_PLAIN = {"FLOAT": np.float32, "INT": np.int32, "BOOLEAN": np.bool_}


def scene_of(name: str, output: str):
    """A ball that shines with an attribute, and its mesh."""
    scene = cycles.empty_scene(32, 32)
    material = bpy.data.materials.new("shown")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    node, shine, end = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("Attribute", "Emission", "OutputMaterial")
    )
    node.attribute_name = name
    names = (output, {"Fac": "Factor"}.get(output))
    socket = next(s for s in node.outputs if s.name in names)
    tree.links.new(socket, shine.inputs["Color"])
    tree.links.new(shine.outputs[0], end.inputs["Surface"])
    mesh = ball(segments=8, rings=6, material=material)
    mesh.uv_layers.new(name="map")
    add(scene, "ball", mesh, moved(0.2, 0.1, 0.0, 0.9, 0.9, 0.9))
    camera = add(scene, "Camera", bpy.data.cameras.new("Camera"), moved(0, 0, 5))
    camera.data.type, camera.data.ortho_scale, scene.camera = "ORTHO", 1.2, camera
    return scene, mesh


def fill(mesh, kind: str) -> None:
    """The attribute "own" of the points, with what the type holds."""
    data = mesh.attributes.new("own", kind, "POINT").data
    field = next(name for name in FIELDS if hasattr(data[0], name))
    held = data[0].bl_rna.properties[field]
    if held.type == "STRING":
        return
    values = np.array([1.7, 0.2, 0.4, 0.6]) + 0.01 * np.arange(len(data))[:, None]
    values = np.resize(values, (len(data), max(held.array_length, 1)))
    data.foreach_set(field, values.astype(_PLAIN[held.type]).ravel())


def check(scene) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Both pictures, and what is told."""
    bpy.context.view_layer.update()
    notes = export_scene(bpy.context.evaluated_depsgraph_get()).notes
    glint = render_glint(scene, "NATIVE").passes["Combined"][..., :3]
    return glint, cycles.render_cycles(scene)["Combined"][..., :3], notes


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("kind", TYPES)
def test_types_are_read_as_in_cycles_or_told(kind: str, output: str) -> None:
    scene, mesh = scene_of("own", output)
    fill(mesh, kind)
    glint, truth, notes = check(scene)
    if not notes:
        assert (np.abs(glint - truth).max(-1) > 1e-4).mean() < 0.02
        assert truth.max() > 0
    else:
        (note,) = notes
        assert "'own'" in note and kind.lower() in note


def test_quaternions_are_four_numbers() -> None:
    scene, mesh = scene_of("own", "Color")
    fill(mesh, "QUATERNION")
    assert not check(scene)[2]


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("name", STANDARD)
def test_standard_names_are_what_cycles_makes_of_them(name: str, output: str) -> None:
    scene, mesh = scene_of(name, output)
    lay_out(mesh)
    colors = mesh.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
    values = np.linspace(0.1, 0.9, 4 * len(mesh.vertices), dtype=np.float32)
    colors.data.foreach_set("color", values)
    glint, truth, notes = check(scene)
    assert not notes
    assert (np.abs(glint - truth).max(-1) > 1e-4).mean() < 0.02


def lay_out(mesh) -> None:
    """The map as it is seen from above: where each of a fan's faces has a map of its own, their
    tangents cancel out at its middle, and rounding decides.
    """
    above = np.array([vertex.co[:2] for vertex in mesh.vertices])
    corners = [loop.vertex_index for loop in mesh.loops]
    mesh.uv_layers[0].uv.foreach_set("vector", above[corners].astype(np.float32).ravel())


def hair():
    """Three strands beside each other, each of another length, as Blender's own hair."""
    data = bpy.data.hair_curves.new("hair")
    data.add_curves([3, 3, 3])
    across, along = np.repeat([-0.3, 0.0, 0.3], 3), np.tile([-0.5, 0.0, 0.5], 3)
    places = np.stack([across, along * np.repeat([0.6, 0.8, 1.0], 3), 0 * along], 1)
    data.position_data.foreach_set("vector", places.astype(np.float32).ravel())
    radii = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    radii.data.foreach_set("value", np.full(9, 0.05, np.float32))
    return data


def bare_scene(node: str, **settings):
    """The ball shines with Alpha of a node that reads what is nowhere."""
    scene, mesh = scene_of("nowhere", "Alpha")
    tree = mesh.materials[0].node_tree
    source = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeAttribute")
    other = tree.nodes.new(node)
    for name, value in settings.items():
        setattr(other, name, value)
    tree.links.new(other.outputs["Alpha"], source.outputs["Alpha"].links[0].to_socket)
    return scene


@pytest.mark.parametrize("name", ["nowhere", ""])
@pytest.mark.parametrize("kind", ["GEOMETRY", "OBJECT", "INSTANCER", "VIEW_LAYER"])
def test_alpha_of_what_is_nowhere(kind: str, name: str) -> None:
    scene = bare_scene("ShaderNodeAttribute", attribute_name=name, attribute_type=kind)
    glint, truth, notes = check(scene)
    assert not notes and truth.max() == (kind == "GEOMETRY")
    assert (np.abs(glint - truth).max(-1) > 1e-4).mean() < 0.02


def test_color_attributes_that_are_nowhere_have_no_alpha() -> None:
    glint, truth, notes = check(bare_scene("ShaderNodeVertexColor", layer_name="nowhere"))
    assert not notes and not glint.any() and not truth.any()


@pytest.mark.skipif(bpy.app.version < (4, 5, 0), reason="curves get points by add_curves since")
@pytest.mark.parametrize(
    ("name", "output"),
    [
        ("nowhere", "Alpha"),
        ("generated", "Color"),
        *((f"curve_{n}", o) for n in ("intercept", "length", "random") for o in ("Color", "Fac")),
    ],
)
def test_standard_names_of_strands_are_what_cycles_makes_of_them(name: str, output: str) -> None:
    scene, mesh = scene_of(name, output)
    data = hair()
    data.materials.append(mesh.materials[0])
    bpy.data.objects.remove(scene.objects["ball"])
    scene.collection.objects.link(bpy.data.objects.new("hair", data))
    glint, truth, notes = check(scene)
    strands = (glint.max(-1) > 0) & (truth.max(-1) > 0)  # Cycles' ends are flat
    assert not notes and strands.mean() > 0.05
    assert np.abs(glint - truth)[strands].max() < 0.05


def test_a_standard_name_goes_before_an_attribute_of_the_mesh() -> None:
    scene, mesh = scene_of("generated", "Color")
    mesh.attributes.new("generated", "FLOAT_VECTOR", "POINT")
    glint, truth, _ = check(scene)
    assert (np.abs(glint - truth).max(-1) > 1e-4).mean() < 0.02
    assert truth.max() > 0.4
