"""Every setting that Glint's panels offer changes a picture, or is named here with the test that it
has elsewhere.
"""

import pytest

import test_panels
from blender_process import PUT_AND_LOOK, REGISTER_TREE, Blender

PROGRAM = (
    REGISTER_TREE
    + PUT_AND_LOOK
    + """
import math
import numpy as np
from glint.addon.export.geometry.volumes import openvdb
from glint.addon.render import statistics
acts = {}

def fresh():
    global scene, layer, final, world
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "GLINT", 24, 24
    final = scene.glint.final
    final.samples, final.light_samples, final.diffuse_bounces, final.visibility_samples = 2, 2, 1, 1
    scene.camera = put("eye", bpy.data.cameras.new("eye"), 0, -8, 3)
    scene.camera.rotation_euler = (math.radians(71), 0, 0)
    world = scene.world = bpy.data.worlds.new("sky")
    world.use_nodes = True

def ball(name, *place):
    rings, around, mesh = 5, 8, bpy.data.meshes.new(name)
    turns = [(math.pi * (ring + 1) / (rings + 1), math.tau * k / around) for ring in range(rings) for k in range(around)]
    corners = [(math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a)) for a, b in turns]
    faces = [(row + k, row + around + k, row + around + (k + 1) % around, row + (k + 1) % around)
             for row in range(0, around * (rings - 1), around) for k in range(around)]
    mesh.from_pydata(corners, [], [tuple(range(around)), *faces, tuple(reversed(range(around * (rings - 1), around * rings)))])
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    return put(name, mesh, *place)

def lamp(kind, *place, **values):
    light = put("lamp", bpy.data.lights.new("lamp", kind), *place)
    for name, value in values.items():
        setattr(light.data, name, value)
    return light

def picture():
    statistics.forget(scene.name)
    bpy.ops.render.render()
    return [each.stamp["pixels"] for each in statistics.by_layer(scene.name).values()]

def change(owner, called="", **values):
    # each by itself; names that this Blender has not are left out
    for name, value in values.items():
        if not hasattr(owner, name):
            continue
        before, old = picture(), getattr(owner, name)
        old = old[:] if hasattr(old, "__len__") and not isinstance(old, str) else old
        setattr(owner, name, value)
        key = called + name
        acts[key] = acts.get(key, True) and picture() != before
        setattr(owner, name, old)

# lights
fresh()
look(box("floor", (9, 9, 0.1), 0, 0, -1), "ShaderNodeBsdfDiffuse")
look(box("block", (1, 1, 1), 0, 0, 0), "ShaderNodeBsdfDiffuse")
for kind, more in {
    "POINT": {"shadow_soft_size": 0.8, "use_soft_falloff": True},
    "SPOT": {"shadow_soft_size": 0.8, "use_soft_falloff": True, "spot_size": 0.5, "spot_blend": 1.0},
    "SUN": {"angle": 0.5},
    "AREA": {"size": 2.0, "size_y": 2.0, "spread": 0.3},
}.items():
    light = lamp(kind, 1, -1, 0.9 if kind == "POINT" else 2, energy=3 if kind == "SUN" else 200)
    if kind in ("POINT", "SPOT"):
        light.data.shadow_soft_size, light.data.use_soft_falloff = 0.4, False
    if kind == "AREA":
        light.data.shape = "RECTANGLE"
    data = light.data
    change(data, color=(1, 0, 0), energy=20.0, exposure=1.0, use_shadow=False, use_temperature=True, **more)
    if hasattr(data, "use_temperature"):
        data.use_temperature = True
        change(data, temperature=2000.0)
        data.use_temperature = False
    if kind in ("AREA", "SUN"):
        change(data, normalize=False)
    bpy.data.objects.remove(light)

# what objects are to rays, and worlds
fresh()
world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.5, 0.9, 1)
final.max_bounces = 4
look(box("floor", (9, 9, 0.1), 0, 0, -1), "ShaderNodeBsdfDiffuse")
mirror = look(box("mirror", (4, 0.1, 3), 0, 3, 1), "ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=0.0)
mirror.rotation_euler.x = 0.3
look(box("pane", (0.8, 0.1, 3), -0.5, -5, 2.5), "ShaderNodeBsdfGlass", IOR=1.1)
fog = look(box("fog", (1.5, 1.5, 1.5), 1.5, 0, 0.5), "ShaderNodeVolumeScatter", "Volume", Density=1.0)
thing = look(box("thing", (1, 1, 1), -0.5, 0, 0.6), "ShaderNodeEmission", Strength=3.0)
light = lamp("AREA", 0, 0, 4, energy=100)
kinds = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
change(thing, hide_render=True, is_holdout=True, is_shadow_catcher=True, **{f"visible_{kind}": False for kind in kinds})
change(world.cycles_visibility, "world ", **{kind: False for kind in ("camera", "diffuse", "glossy", "transmission", "scatter")})
layer.lightgroups.add(name="one")
change(thing, lightgroup="one")
change(world, "world ", lightgroup="one")
other = bpy.data.worlds.new("other")
other.use_nodes = True
plain = bpy.data.materials.new("plain")
change(layer, material_override=plain, world_override=other, samples=1, use_sky=False, use_solid=False)
change(scene.render, film_transparent=True, filter_size=4.0)
layer.use_pass_cryptomatte_object = True
change(layer, pass_cryptomatte_depth=2)
layer.use_pass_cryptomatte_object = False
if hasattr(layer.cycles, "denoising_store_passes"):
    change(layer.cycles, denoising_store_passes=True)
layer.use_pass_material_index = True
change(thing.data.materials[0], pass_index=3)
layer.use_pass_material_index = False
layer.use_pass_ambient_occlusion = True
change(world.light_settings, distance=0.5)
layer.use_pass_ambient_occlusion = False
world.use_nodes = False
if not world.use_nodes:  # before Blender 5
    change(world, "world ", color=(1, 0, 0))
world.use_nodes = True

# surfaces
fresh()
look(box("floor", (9, 9, 0.1), 0, 0, -1), "ShaderNodeBsdfDiffuse")
lamp("SUN", 0, 0, 4, energy=3).rotation_euler = (0.8, 0.2, 0)
scene.render.resolution_x = scene.render.resolution_y = 48  # some pixels lie where light grazes
round_ = look(ball("round", 0, 0, 0.3), "ShaderNodeBsdfDiffuse")
owner = round_ if hasattr(round_, "shadow_terminator_shading_offset") else round_.cycles
change(owner, shadow_terminator_geometry_offset=1.0, shadow_terminator_shading_offset=0.6, shadow_terminator_offset=0.6)
tree = round_.data.materials[0].node_tree
shader = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfDiffuse")
bump, wave = tree.nodes.new("ShaderNodeBump"), tree.nodes.new("ShaderNodeTexWave")
tree.links.new(wave.outputs["Fac"], bump.inputs["Height"])
tree.links.new(bump.outputs[0], shader.inputs["Normal"])
change(round_.data.materials[0].cycles, use_bump_map_correction=False)
veil = look(box("veil", (1, 1, 0.1), -0.5, -2, 1.5), "ShaderNodeBsdfTransparent", Color=(0.5, 0.5, 0.5, 1))
change(veil.data.materials[0], use_transparent_shadow=False)
cloud = look(box("cloud", (1.5, 1.5, 1.5), 1.5, -1, 0.5), "ShaderNodeVolumeScatter", "Volume")
tree = cloud.data.materials[0].node_tree
scatter = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeVolumeScatter")
noise = tree.nodes.new("ShaderNodeTexNoise")
noise.inputs["Scale"].default_value = 8
tree.links.new(noise.outputs[0], scatter.inputs["Density"])
change(cloud.data.materials[0].cycles, volume_step_rate=8.0)
bpy.data.objects.remove(cloud)
world_tree = world.node_tree
scatter, noise = world_tree.nodes.new("ShaderNodeVolumeScatter"), world_tree.nodes.new("ShaderNodeTexNoise")
noise.inputs["Scale"].default_value = 0.3
thin = world_tree.nodes.new("ShaderNodeMath")
thin.operation, thin.inputs[1].default_value = "MULTIPLY", 0.1
world_tree.links.new(noise.outputs[0], thin.inputs[0])
world_tree.links.new(thin.outputs[0], scatter.inputs["Density"])
world_tree.links.new(scatter.outputs[0], next(node for node in world_tree.nodes if node.bl_idname == "ShaderNodeOutputWorld").inputs["Volume"])
lamp("POINT", 0, -2, 2, energy=300)  # the sun does not come through
change(world.cycles, volume_step_size=30.0)

# volumes of files, from Blender 4.5 on
if openvdb() is not None:
    fresh()
    lamp("POINT", 2, -2, 3, energy=500)
    grid, values = openvdb().FloatGrid(), np.linspace(0, 3, 12**3, dtype=np.float32).reshape(12, 12, 12)
    grid.copyFromArray(values)
    grid.name, grid.transform = "density", openvdb().createLinearTransform(voxelSize=0.15)
    openvdb().write(str(FOLDER / "cloud.vdb"), [grid])
    cloud = look(put("cloud", bpy.data.volumes.new("cloud"), -1, -1, 0), "ShaderNodeVolumePrincipled", "Volume")
    cloud.data.filepath, cloud.scale = str(FOLDER / "cloud.vdb"), (2, 1, 1)
    change(cloud.data.render, space="WORLD", step_size=0.5, clipping=1.5)
else:  # the panel says so
    acts |= {"space": True, "step_size": True, "clipping": True}

# what Simplify takes away
fresh()
lamp("SUN", 0, 0, 4, energy=3).rotation_euler = (0.7, 0.2, 0)
round_ = look(ball("round", 0, 0, 1), "ShaderNodeBsdfDiffuse")
fine = round_.modifiers.new("fine", "SUBSURF")
fine.levels = fine.render_levels = 2
scene.render.use_simplify = True
change(scene.render, simplify_subdivision_render=0)
round_.modifiers.clear()
round_.modifiers.new("hair", "PARTICLE_SYSTEM")
hair = round_.particle_systems[0].settings
hair.type, hair.count, hair.hair_length, hair.child_type, hair.rendered_child_count = "HAIR", 20, 1.0, "SIMPLE", 10
hair.root_radius = 5.0
change(scene.render, simplify_child_particles_render=0.0)
change(layer, use_strand=False)
round_.cycles.use_camera_cull = True
scene.cycles.use_camera_cull, scene.cycles.camera_cull_margin = True, 0.0
round_.location = 0, -14, 2
mirror = look(box("mirror", (12, 0.1, 5), 0, 3, 1), "ShaderNodeBsdfPrincipled", Metallic=1.0, Roughness=0.0)
change(scene.cycles, camera_cull_margin=100.0, use_camera_cull=False)
change(round_.cycles, use_camera_cull=False)
scene.cycles.use_camera_cull, round_.cycles.use_camera_cull = False, False
round_.cycles.use_distance_cull, scene.cycles.use_distance_cull, scene.cycles.distance_cull_margin = True, True, 5.0
round_.location = 0, 0, 0
change(scene.cycles, distance_cull_margin=50.0, use_distance_cull=False)
change(round_.cycles, use_distance_cull=False)

# motion
fresh()
final.samples = 8
turning = look(box("turning", (0.4, 2, 2), 0, 0, 0.5), "ShaderNodeEmission")
for frame, angle in ((0, 0.0), (1, 1.5), (2, 3.0)):
    turning.rotation_euler.y = angle
    turning.keyframe_insert("rotation_euler", frame=frame)
turning.shape_key_add(name="Basis")
key = turning.shape_key_add(name="wide")
key.data[0].co.x = -2
for frame, value in ((0, 0.0), (2, 1.0)):
    key.value = value
    key.keyframe_insert("value", frame=frame)
scene.render.use_motion_blur = True
change(scene.render, motion_blur_shutter=1.5)
change(turning.cycles, use_motion_blur=False, motion_steps=4, use_deform_motion=False)
change(layer, use_motion_blur=False)

# panoramas
fresh()
look(box("floor", (9, 9, 0.1), 0, 0, -1), "ShaderNodeBsdfDiffuse")
look(box("block", (1, 1, 1), 0, -5, 2), "ShaderNodeEmission")
camera = scene.camera.data
camera.type = "PANO"
owner = camera if hasattr(camera, "panorama_type") else camera.cycles
for kind, values in {
    "EQUIRECTANGULAR": {"latitude_min": -0.5, "latitude_max": 0.5, "longitude_min": -1.0, "longitude_max": 1.0},
    "FISHEYE_EQUIDISTANT": {"fisheye_fov": 1.0},
    "FISHEYE_EQUISOLID": {"fisheye_lens": 20.0, "fisheye_fov": 1.0},
    "FISHEYE_LENS_POLYNOMIAL": {"fisheye_fov": 0.5, **{f"fisheye_polynomial_k{k}": -0.03 / 20**k for k in range(5)}},
    "CENTRAL_CYLINDRICAL": {"central_cylindrical_range_v_min": -0.5, "central_cylindrical_range_v_max": 0.5, "central_cylindrical_radius": 2.0,
                            "central_cylindrical_range_u_min": -1.0, "central_cylindrical_range_u_max": 1.0},
}.items():
    if kind in owner.bl_rna.properties["panorama_type"].enum_items:
        owner.panorama_type = kind
        change(owner, **values)
answer(acts)
"""  # noqa: E501 - a script for another Blender
)
ELSEWHERE = {
    "test_greyed.py": "acceleration backend clamp_indirect cutoff diffuse_bounces error_threshold "
    "illumination lamp_shadows light_samples max_bounces photons reflections reflective_caustics "
    "refractive_caustics soft_light target threads use_mesh_light use_reflective_caustics "
    "use_refractive_caustics use_subsurface visibility_samples volume_bounces volume_samples "
    "world_light",
    "test_modes.py": "displacement_method motion_blur_position panorama_type shape type",
    "test_frames.py": "use_persistent_data",
    "the viewport's tests": "preview_pixel_size simplify_child_particles simplify_subdivision "
    "viewport_pass",
    "Blender's own": "hide_select hide_surface_pick hide_viewport show_cone",
}
"""Where other settings have their tests. Switches of passes are tested in test_addon_passes.py."""


@pytest.fixture(scope="module")
def acts(tmp_path_factory):
    run = Blender(tmp_path_factory.mktemp("offered")).run(PROGRAM)
    assert run.returncode == 0, run.output
    return run.answer


def test_what_is_offered_changes_a_picture(acts):
    assert [name for name, acted in acts.items() if not acted] == []


def test_all_that_panels_offer_is_tried(acts, tmp_path):
    run = Blender(tmp_path).run(test_panels.PROGRAM)
    assert run.returncode == 0, run.output
    drawn = {name for name in run.answer["drawn names"] if name.isidentifier() and name.islower()}
    tried = {name.removeprefix("world ") for name in acts}
    tried |= {name for names in ELSEWHERE.values() for name in names.split()}
    assert {name for name in drawn - tried if not name.startswith("use_pass_")} == set()
