"""The Blinn-Phong node: its sockets, its file, its picture elsewhere."""

import numpy as np
import OpenImageIO as oiio

from blender_process import REGISTER_TREE, Blender

MATERIAL = """
def add_node():
    material = bpy.data.materials.new("Phong")
    if not material.node_tree:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new("GlintBlinnPhongNode")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs["BSDF"], output.inputs["Surface"])
    return material, node
"""
SOCKETS = ["Ambient", "Diffuse", "Specular", "Exponent", "Mirror", "Emission", "Alpha"]


def test_the_sockets_and_their_defaults(tmp_path):
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + MATERIAL
        + """
material, node = add_node()
again = add_node()[1]
answer({"inputs": [socket.name for socket in node.inputs], "outputs": [socket.name for socket in node.outputs],
        "exponent": again.inputs["Exponent"].default_value, "alpha": node.inputs["Alpha"].default_value,
        "least": node.node_tree.interface.items_tree["Exponent"].min_value, "shared": node.node_tree == again.node_tree,
        "groups": len(bpy.data.node_groups), "label": node.bl_label})
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer == {
        "inputs": SOCKETS,
        "outputs": ["BSDF"],
        "exponent": 32.0,
        "alpha": 1.0,
        "least": 0.0,
        "shared": True,
        "groups": 1,
        "label": "Blinn-Phong",
    }


def test_a_file_with_the_node_loads_with_the_extension_and_without(tmp_path):
    blender = Blender(tmp_path)
    saved = blender.run(
        REGISTER_TREE
        + MATERIAL
        + """
material, node = add_node()
node.inputs["Exponent"].default_value = 77.0
material.use_fake_user = True
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "node.blend"))
"""
    )
    assert saved.returncode == 0, saved.output
    read = """
bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "node.blend"))
node = next(node for node in bpy.data.materials["Phong"].node_tree.nodes if node.outputs and node.outputs[0].name == "BSDF")
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "node.blend"))
answer([node.bl_idname, node.inputs["Exponent"].default_value, [socket.name for socket in node.inputs]])
"""
    without = blender.run(read)
    assert without.returncode == 0, without.output
    assert without.answer[1] == 77.0
    with_it = blender.run(REGISTER_TREE + read)
    assert with_it.answer == ["GlintBlinnPhongNode", 77.0, SOCKETS], with_it.output


def test_a_file_with_the_node_outlives_the_extension(tmp_path):
    """Blender 4.2 crashed here: the evaluated copy of the material was freed after the node's class."""
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + MATERIAL
        + """
def draw_a_cube_with_the_node():
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    material, node = add_node()
    node.inputs["Emission"].default_value = (0.25, 0.5, 0.75, 1.0)
    bpy.data.objects["Cube"].data.materials[0] = material
    scene = bpy.context.scene
    scene.render.engine = "GLINT"
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.glint.final.samples = scene.glint.final.light_samples = 1
    bpy.ops.render.render()
    return material

names = []
for _ in range(2):
    material = draw_a_cube_with_the_node()
    glint.unregister()
    names.append([socket.name for socket in material.node_tree.nodes[0].inputs])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    glint.register()
draw_a_cube_with_the_node()
answer(names)
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer == [SOCKETS, SOCKETS]


def test_cycles_shows_the_group_inside(tmp_path):
    """Emission and Alpha are exact in any renderer; diffuse light adds to them."""
    blender = Blender(tmp_path)
    run = blender.run(
        REGISTER_TREE
        + MATERIAL
        + """
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
material, node = add_node()
node.inputs["Emission"].default_value = (0.25, 0.5, 0.75, 1.0)
for name in ("Diffuse", "Specular"):
    node.inputs[name].default_value = (0, 0, 0, 1)
bpy.data.objects["Cube"].data.materials[0] = material
scene.render.engine = "CYCLES"
scene.cycles.samples, scene.cycles.use_denoising = 1, False
scene.render.film_transparent = True
scene.render.resolution_x = scene.render.resolution_y = 32
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
def draw(name):
    scene.render.filepath = str(FOLDER / name)
    bpy.ops.render.render(write_still=True)
draw("emission.exr")
node.inputs["Diffuse"].default_value = (0.5, 0.5, 0.5, 1)
draw("diffuse.exr")
node.inputs["Alpha"].default_value = 0.0
draw("clear.exr")
"""
    )
    assert run.returncode == 0, run.output
    emission, diffuse, clear = (
        oiio.ImageBuf(str(tmp_path / f"{name}.exr")).get_pixels(oiio.FLOAT) for name in ("emission", "diffuse", "clear")
    )
    centre = (slice(14, 18), slice(14, 18))
    np.testing.assert_allclose(emission[centre][..., :3], np.broadcast_to([0.25, 0.5, 0.75], (4, 4, 3)), rtol=1e-4)
    assert (diffuse[centre][..., :3].mean(axis=(0, 1)) > [0.26, 0.51, 0.76]).all()
    assert np.abs(clear[centre]).max() == 0.0
