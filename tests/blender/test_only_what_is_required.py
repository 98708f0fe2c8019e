"""Only what the scene requires: things that nothing reads change no byte of the exported scene, and
so neither time nor picture.
"""

import bpy
import numpy as np
import pytest

from export_support import Shader, export, image, link, mesh_object, quad, scene, use_nodes  # noqa: F401
from glint.engine.analysis.fingerprint import value_fingerprint


def textured() -> Shader:
    """A quad whose colour is an image; it has an active UV map and a colour attribute that nothing
    reads.
    """
    shader = Shader()
    shader.link(
        shader.node("ShaderNodeTexImage", image=image("Read")), "Color", shader.shader, "Color"
    )
    return shader


def unused_uv_maps(shader):
    for name in ("Lightmap", "Old"):
        layer = shader.quad.data.uv_layers.new(name=name, do_init=False)
        layer.uv.foreach_set("vector", np.linspace(0, 1, 8, dtype=np.float32))


def unused_color_attributes(shader):
    for kind in ("FLOAT_COLOR", "BYTE_COLOR"):
        for domain in ("POINT", "CORNER"):
            shader.quad.data.color_attributes.new(f"{kind} {domain}", kind, domain)


def other_attributes(shader):
    for number, (kind, domain) in enumerate(
        (("FLOAT", "POINT"), ("INT", "FACE"), ("FLOAT_VECTOR", "CORNER"), ("BOOLEAN", "EDGE"))
    ):
        shader.quad.data.attributes.new(f"extra {number}", kind, domain)
    shader.quad.vertex_groups.new(name="weights").add([0, 1], 0.5, "REPLACE")


def hidden_objects(shader):
    """Hidden from the view layer that is exported; a viewport's one, so by the viewport's
    switch.
    """
    quad("Hidden", glowing()).hide_viewport = True
    quad("Put away", glowing()).hide_set(True)
    lamp = link(bpy.data.objects.new("Hidden lamp", bpy.data.lights.new("Hidden lamp", "POINT")))
    lamp.hide_viewport = True
    bpy.data.collections.new("Not linked").objects.link(
        bpy.data.objects.new("Elsewhere", quad("Q").data)
    )
    bpy.data.objects.remove(bpy.data.objects["Q"])


def glowing():
    material = bpy.data.materials.new("Glow")
    use_nodes(material)
    tree = material.node_tree
    texture, shader, output = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexImage", "Emission", "OutputMaterial")
    )
    texture.image = image("Never seen", size=(8, 8))
    tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def unlinked_nodes(shader):
    texture = shader.node("ShaderNodeTexImage", image=image("Not linked", size=(8, 8)))
    noise = shader.node("ShaderNodeTexNoise")
    shader.link(
        noise, "Fac" if "Fac" in noise.outputs else 0, shader.node("ShaderNodeEmission"), "Strength"
    )
    shader.link(shader.node("ShaderNodeUVMap", uv_map="UVMap"), "UV", texture, "Vector")


def unused_images_and_materials(shader):
    image("Of nobody", size=(8, 8)).use_fake_user = True
    glowing().use_fake_user = True


def materials_in_unused_slots(shader):
    for _ in range(3):
        shader.quad.data.materials.append(glowing())


def an_object_without_faces(shader):
    mesh_object("Wire", [(0, 0, 0), (1, 0, 0)], [], glowing())


def another_scene(shader):
    bpy.data.scenes.new("Other").collection.objects.link(
        bpy.data.objects.new("There", shader.quad.data)
    )


ADDITIONS = (
    unused_uv_maps,
    unused_color_attributes,
    other_attributes,
    hidden_objects,
    unlinked_nodes,
    unused_images_and_materials,
    materials_in_unused_slots,
    an_object_without_faces,
    another_scene,
)


@pytest.mark.parametrize("add", ADDITIONS, ids=lambda function: function.__name__)
def test_what_nothing_reads_changes_no_byte(scene, add):  # noqa: F811
    shader = textured()
    before = export()
    add(shader)
    after = export()
    assert value_fingerprint(after.scene) == value_fingerprint(before.scene)
    assert after.stats["bytes"] == before.stats["bytes"]
    assert after.notes == before.notes


def test_what_is_read_does_change_it(scene):  # noqa: F811
    """The same additions once something reads them."""
    shader = textured()
    known = {value_fingerprint(export().scene)}
    for add in (unused_uv_maps, materials_in_unused_slots, unlinked_nodes):
        add(shader)
    texture = next(node for node in shader.tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    shader.link(shader.node("ShaderNodeUVMap", uv_map="Lightmap"), "UV", texture, "Vector")
    known.add(value_fingerprint(export().scene))
    shader.quad.data.polygons[0].material_index = 1
    known.add(value_fingerprint(export().scene))
    bpy.data.objects["Quad"].hide_viewport = True
    known.add(value_fingerprint(export().scene))
    assert len(known) == 4


def test_slots_between_used_ones_are_not_read(scene):  # noqa: F811
    """Faces of slots 0 and 2: the material of slot 1 is not exported, the others are where the
    faces look for them.
    """
    first, last = (bpy.data.materials.new(name) for name in ("First", "Last"))
    strip = [(x, y, 0.0) for x in (0.0, 1.0, 2.0) for y in (0.0, 1.0)]
    thing = mesh_object("Two", strip, [(0, 2, 3, 1), (2, 4, 5, 3)], first, glowing(), last)
    thing.data.polygons[1].material_index = 2
    exported = export().scene
    assert [material.name for material in exported.materials] == ["First", "Last"]
    group = exported.instances[0]
    assert group.materials[0] == 0 and group.materials[2] == 1
    assert sorted(set(exported.geometries[0].material_slots)) == [0, 2]
