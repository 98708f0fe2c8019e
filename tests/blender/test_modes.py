"""Every mode that this Blender offers of what a scene has draws a picture of its own or is told:
where the next Blender has a new one, this fails, and no picture.
"""

import pytest

from blender_process import PUT, REGISTER_TREE, Blender

PROGRAM = (
    REGISTER_TREE
    + PUT
    + """
import math
from glint.addon.render import statistics
told = {}

def fresh():
    global scene, layer, camera
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "GLINT", 24, 16
    final = scene.glint.final
    final.samples, final.light_samples, final.diffuse_bounces, final.visibility_samples = 2, 2, 0, 1
    camera = scene.camera = put("camera", bpy.data.cameras.new("camera"), 0, -6, 2.5)
    camera.rotation_euler = (math.radians(68), 0, 0)
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True

def grid(name, cells, size, *place):
    side = [size * (k / cells - 0.5) for k in range(cells + 1)]
    corners = [(x, y, 0) for y in side for x in side]
    quads = [(k, k + 1, k + cells + 2, k + cells + 1)
             for row in range(cells) for k in range(row * (cells + 1), row * (cells + 1) + cells)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], quads)
    layer = mesh.uv_layers.new()
    for corner, vertex in enumerate(mesh.loops):
        x, y, _ = corners[vertex.vertex_index]
        layer.data[corner].uv = (x / size + 0.5, y / size + 0.5)
    return put(name, mesh, *place)

def look(thing, kind="ShaderNodeEmission"):
    material = bpy.data.materials.new(thing.name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader, output = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    thing.data.materials.append(material)
    return material, tree, shader, output

def lamp(kind="AREA"):
    light = put("lamp", bpy.data.lights.new("lamp", kind), 0.5, 0, 2)
    light.data.energy = 300
    return light

def seen():
    bpy.ops.render.render()
    layers = statistics.by_layer(scene.name).values()
    return [[each.stamp["pixels"] for each in layers], [note for each in layers for note in each.notes]]

def walk(called, owner, name, states=(None,), state=lambda value: None):
    # mode -> what is seen in each state; a mode that Blender refuses is none
    found, before = {}, getattr(owner, name)
    for mode in owner.bl_rna.properties[name].enum_items.keys():
        try:
            setattr(owner, name, mode)
        except TypeError:
            continue
        found[mode] = []
        for value in states:
            state(value)
            found[mode].append(seen())
        setattr(owner, name, before)
    told[called] = found

# cameras
fresh()
floor = look(grid("floor", 1, 6, 0, 0, 0), "ShaderNodeBsdfDiffuse")
lamp()
tower = grid("tower", 2, 2, 0.7, 0, 1)
tower.rotation_euler = (0.9, 0.4, 0)
look(tower, "ShaderNodeBsdfDiffuse")
camera.data.sensor_width, camera.data.sensor_height = 36, 20
walk("Camera.type", camera.data, "type")
walk("Camera.sensor_fit", camera.data, "sensor_fit")
camera.data.type = "PANO"
owner = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
walk("Camera.panorama_type", owner, "panorama_type")
camera.data.type = "PERSP"
scene.render.use_multiview = True
camera.data.stereo.interocular_distance = 0.5
walk("CameraStereoData.convergence_mode", camera.data.stereo, "convergence_mode")
walk("CameraStereoData.pivot", camera.data.stereo, "pivot")
scene.render.use_multiview = False
layer.use_pass_mist = True
walk("WorldMistSettings.falloff", scene.world.mist_settings, "falloff")
layer.use_pass_mist = False

def own_samples(count):
    layer.samples = count

walk("CyclesRenderSettings.use_layer_samples", scene.cycles, "use_layer_samples", (1, 3), own_samples)

# motion
fresh()
flying = grid("flying", 1, 1, -1, 0, 0)
look(flying)
for frame in (0, 1, 2):
    flying.location.x = frame - 1
    flying.keyframe_insert("location", frame=frame)
scene.render.use_motion_blur, scene.glint.final.samples = True, 8
walk("RenderSettings.motion_blur_position", scene.render, "motion_blur_position")
walk("CyclesRenderSettings.rolling_shutter_type", scene.cycles, "rolling_shutter_type")

# lights
fresh()
floor = grid("floor", 1, 6, 0, 0, 0)
look(floor, "ShaderNodeBsdfDiffuse")
light = lamp()
light.data.size, light.data.size_y = 2, 0.3
walk("AreaLight.shape", light.data, "shape")
walk("Light.type", light.data, "type")
light = bpy.data.objects["lamp"]
lit = bpy.data.collections.new("lit")
lit.objects.link(floor)
light.light_linking.receiver_collection = lit
walk("CollectionLightLinking.link_state", lit.collection_objects[0].light_linking, "link_state")

# surfaces
fresh()
scene.glint.final.max_bounces = 2
rough = grid("rough", 12, 4, 0, 0, 0)
material, tree, shader, output = look(rough, "ShaderNodeBsdfDiffuse")
wave, bent = tree.nodes.new("ShaderNodeTexWave"), tree.nodes.new("ShaderNodeDisplacement")
wave.inputs["Scale"].default_value = 0.7
tree.links.new(wave.outputs["Fac"], bent.inputs["Height"])
tree.links.new(bent.outputs[0], output.inputs["Displacement"])
lamp("SUN").rotation_euler = (0.8, 0.3, 0)
walk("Material.displacement_method", material, "displacement_method")

# images, mappings, curves and ramps
fresh()
material, tree, shader, output = look(grid("picture", 1, 4, 0, 0, 0))
made = bpy.data.images.new("generated", 64, 64)
texture = tree.nodes.new("ShaderNodeTexImage")
texture.image = made
tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
walk("Image.generated_type", made, "generated_type")
kept = bpy.data.images.new("kept", 2, 2, alpha=True, float_buffer=True)
kept.pixels = [0.8, 0.4, 0.2, 0.5] * 4
kept.file_format, kept.filepath_raw = "OPEN_EXR", str(FOLDER / "kept.exr")
kept.save()
texture.image = bpy.data.images.load(str(FOLDER / "kept.exr"))
both = tree.nodes.new("ShaderNodeMix")
both.data_type, both.inputs["Factor"].default_value = "RGBA", 0.5
tree.links.new(texture.outputs["Color"], both.inputs[6])
tree.links.new(texture.outputs["Alpha"], both.inputs[7])
tree.links.new(both.outputs[2], shader.inputs["Color"])
walk("Image.alpha_mode", texture.image, "alpha_mode")
gradient = tree.nodes.new("ShaderNodeTexGradient")
gradient.gradient_type = "SPHERICAL"
mapping = gradient.texture_mapping
mapping.translation, mapping.rotation, mapping.scale = (0.1, 0.2, 0.3), (0, 0, 0.5), (0.5, 0.8, 1.2)
tree.links.new(gradient.outputs["Color"], shader.inputs["Color"])
walk("TexMapping.vector_type", mapping, "vector_type")
for axis in "xyz":
    walk(f"TexMapping.mapping_{axis}", mapping, f"mapping_{axis}")
curve, number = tree.nodes.new("ShaderNodeFloatCurve"), tree.nodes.new("ShaderNodeMath")
number.inputs[1].default_value = 1.0  # ends are where no constant is
tree.links.new(gradient.outputs["Fac"], number.inputs[0])
tree.links.new(number.outputs[0], curve.inputs["Value"])
tree.links.new(curve.outputs[0], shader.inputs["Strength"])
walk("CurveMapping.extend", curve.mapping, "extend")
ramp = tree.nodes.new("ShaderNodeValToRGB")
ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.9, 0.1, 0.2, 1), (0.2, 0.7, 0.6, 1)
tree.links.new(gradient.outputs["Fac"], ramp.inputs["Fac"])
tree.links.new(ramp.outputs["Color"], shader.inputs["Color"])
walk("ColorRamp.interpolation", ramp.color_ramp, "interpolation")
walk("ColorRamp.color_mode", ramp.color_ramp, "color_mode")
ramp.color_ramp.color_mode = "HSV"
walk("ColorRamp.hue_interpolation", ramp.color_ramp, "hue_interpolation")

# instances
fresh()
parent, child = grid("parent", 2, 3, 0, 0, 0), grid("child", 1, 0.4, 0, 0, 0.3)
look(child)
child.parent = parent
walk("Object.instance_type", parent, "instance_type")
child.parent = None
others = bpy.data.collections.new("others")
others.objects.link(grid("other", 1, 0.8, 1, 0, 1))
look(bpy.data.objects["other"])
empty = put("empty", None, 0, 0, 0.5)
empty.instance_collection = others
walk("Object.instance_type of an empty", empty, "instance_type")
parent.modifiers.new("particles", "PARTICLE_SYSTEM")
particles = parent.particle_systems[0].settings
particles.count, particles.frame_start, particles.frame_end, particles.particle_size = 5, 1, 1, 1.0
particles.instance_object, particles.instance_collection = child, others
walk("ParticleSettings.render_type", particles, "render_type")
answer(told)
"""  # noqa: E501 - a script for another Blender
)
ALIKE = {
    "Camera.sensor_fit": [{"AUTO", "HORIZONTAL"}],
    "ColorRamp.hue_interpolation": [{"NEAR", "CW"}, {"FAR", "CCW"}],
    "Image.alpha_mode": [{"STRAIGHT", "PREMUL"}],
    "ParticleSettings.render_type": [{"NONE", "HALO", "LINE", "PATH"}],
}
"""Modes of one picture, as in Cycles: the wide picture's, the ramp's, of an OpenEXR file and of
particles that are no hair.
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    run = Blender(tmp_path_factory.mktemp("modes")).run(PROGRAM)
    assert run.returncode == 0, run.output
    return run.answer


def test_every_mode_has_its_picture_or_is_told(told):
    alike = {}
    for called, modes in told.items():
        groups: dict[str, set[str]] = {}
        for mode, seen in modes.items():
            groups.setdefault(str(seen), set()).add(mode)
        assert len(modes) > 1, f"{called}: {modes}"
        same = [group for group in groups.values() if len(group) > 1]
        if same:
            alike[called] = same
    assert alike == ALIKE
