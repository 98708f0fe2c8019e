"""Frames in a row with Persistent Data: the same bits as without, and only what changed is read."""

import pytest

import glint_tree  # noqa: F401  (makes the package importable as glint)
from blender_process import REGISTER_TREE, Blender
from glint.addon.export.geometry.cache import Shape, ShapeCache, ShapeKey

SCENE = (
    REGISTER_TREE
    + """
import random
from glint.addon.render import statistics
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 24, 100
scene.glint.final.samples = scene.glint.final.light_samples = 1
render, cube, camera = scene.render, bpy.data.objects["Cube"], scene.camera
lamp = bpy.data.objects["Light"]
told = []

def colored(name, *color):
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1)
    return material, shader.inputs["Base Color"]

def ball(name, x, y):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=0.7, location=(x, y, 0.5))
    thing = bpy.context.object
    thing.name = name
    return thing

def key(owner, path, *values, index=-1):
    for k, value in enumerate(values):
        if index < 0:
            setattr(owner, path, value)
        else:
            getattr(owner, path)[index] = value
        owner.keyframe_insert(path, frame=1 + 2 * k, index=index)

def tell(*_):
    layers, anew = statistics.by_layer(scene.name).values(), {}
    statistics.forget(scene.name)
    for name, count in (item for layer in layers for item in layer.exported.items()):
        if name.startswith("anew: "):
            anew[name] = anew.get(name, 0) + count
    told.append([scene.frame_current, *(" ".join(layer.stamp[name] for layer in layers)
                                        for name in ("pixels", "geometry")), anew,
                 sorted(note for layer in layers for note in layer.notes),
                 next(reversed(layers)).scene_line])

bpy.app.handlers.render_write.append(tell)

def animate(frames):
    scene.frame_start, scene.frame_end = 1, frames
    render.filepath = str(FOLDER / "frame_")
    bpy.ops.render.render(animation=True)

def draw():
    bpy.ops.render.render()
    tell()
"""  # noqa: E501 - a script for another Blender
)
COMPARE = """
def compare(what):
    "The frames with Persistent Data and without."
    found = []
    for render.use_persistent_data in (True, False):
        told.clear()
        animate(4)
        found.append(list(told))
    results[what] = found

"""
ANIMATED = (
    COMPARE
    + """
results = {}
key(camera, "location", 7.4, 6.0, index=0)
compare("camera")
second, still = ball("second", 2.5, 0), ball("still", -2.5, 1)
paint, color = colored("paint", 0.8, 0.2, 0.1)
second.data.materials.append(paint)
key(second, "location", 2.5, 1.5, index=0)
key(lamp, "location", 4.0, 5.0, index=0)
compare("objects")
scene.glint.final.diffuse_bounces = 0
key(color, "default_value", 0.1, 0.9, index=1)
key(lamp.data, "energy", 1000, 500)
world = scene.world.node_tree.nodes["Background"].inputs["Strength"]
key(world, "default_value", 1.0, 0.2)
compare("materials")
render.use_multiview = True
compare("stereo")
render.use_multiview = False
key(cube, "hide_render", False, True)
compare("vanishing")
second.shape_key_add(name="Basis")
block = second.shape_key_add(name="Key")
block.data[0].co.z += 2
key(block, "value", 0.0, 1.0)
still.modifiers.new("Wave", "WAVE")
compare("meshes")
render.use_motion_blur = True
compare("motion blur")
hear = lambda *_: None
bpy.app.handlers.frame_change_pre.append(hear)
compare("motion blur that scripts hear of")
bpy.app.handlers.frame_change_pre.remove(hear)
output = next(n for n in paint.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
displacement = paint.node_tree.nodes.new("ShaderNodeDisplacement")
displacement.inputs["Midlevel"].default_value = 0.2
paint.node_tree.links.new(displacement.outputs[0], output.inputs["Displacement"])
paint.displacement_method = "DISPLACEMENT"
for axis in (1, 2):
    key(still, "scale", 1.0, 0.0, index=axis)
scene.glint.final.samples = 4
compare("displaced and flat things that blur")
scene.glint.final.samples = 1
still.animation_data_clear()
still.scale = (1, 1, 1)
render.use_motion_blur = False
scene.view_layers[0].aovs.add().name = "shade"
shade = paint.node_tree.nodes.new("ShaderNodeOutputAOV")
shade.aov_name = "shade"
paint.node_tree.links.new(
    paint.node_tree.nodes.new("ShaderNodeTexCoord").outputs["Object"], shade.inputs["Color"]
)
scene.world.node_tree.nodes.new("ShaderNodeOutputAOV").aov_name = "shade"
compare("aovs")
scene.view_layers[0].aovs.remove(scene.view_layers[0].aovs[0])
own = ball("of one layer alone", 0, -2.5)
one, twin = (ball(name, 3, y) for name, y in (("one of two", -2), ("twin", 2)))
twin.data, twin.data.name = one.data, "shared"
for thing, what in ((one, "CAST"), (twin, "WAVE")):
    thing.modifiers.new("Bend", what)
plain, _ = colored("plain", 0.1, 0.2, 0.8)
plain.node_tree.nodes.new("ShaderNodeOutputAOV").aov_name = "shade"
plain.node_tree.nodes["AOV Output"].inputs["Value"].default_value = 0.5
plain.node_tree.nodes["AOV Output"].inputs["Color"].default_value = (0.2, 0.3, 0.4, 1)
still.data.materials.append(plain)
apart = bpy.data.collections.new("apart")
scene.collection.children.link(apart)
for thing in (own, one):
    for collection in thing.users_collection:
        collection.objects.unlink(thing)
    apart.objects.link(thing)
another = scene.view_layers.new("another")
scene.view_layers[0].layer_collection.children["apart"].exclude = True
compare("two layers")
another.aovs.add().name = "shade"
another.use_pass_vector = True
another.material_override = bpy.data.materials.new("override")
compare("two layers of different kinds")
another.material_override = None
render.use_motion_blur = True
scene.view_layers[0].use_motion_blur = False
compare("two layers, of which one blurs")
render.use_motion_blur = False
scene.view_layers.remove(another)
for thing in (own, one, twin):
    bpy.data.objects.remove(thing)
scene.view_layers[0].use_pass_vector = True
compare("vectors")
scene.view_layers[0].use_pass_vector = False
for name, things in (("lamps", [lamp]), ("sky", [scene.world])):
    scene.view_layers[0].lightgroups.add(name=name)
    for thing in things:
        thing.lightgroup = name
compare("light groups")
while scene.view_layers[0].lightgroups:
    scene.view_layers[0].active_lightgroup_index = 0
    bpy.ops.scene.view_layer_remove_lightgroup()
render.use_simplify = scene.cycles.use_camera_cull = True
scene.cycles.camera_cull_margin = 0.0
still.cycles.use_camera_cull = second.cycles.use_camera_cull = True
key(camera, "rotation_euler", 0.8, 1.3, index=2)
compare("culling")
render.use_motion_blur = True
compare("culling and motion blur")
render.use_simplify = render.use_motion_blur = False
scene.view_layers[0].use_pass_vector = True
scene.view_layers[0].aovs.add().name = "shade"
compare("vectors and aovs")
scene.view_layers[0].aovs.remove(scene.view_layers[0].aovs[0])
scene.view_layers[0].aovs.add().name = "shade"
scene.view_layers.new("another").use_pass_vector = True
compare("vectors, aovs and two layers")
render.use_motion_blur = True
compare("all at once")
answer(results)
"""
)
MOVING = (
    COMPARE
    + """
results = {}
scene.glint.final.diffuse_bounces = 0

def thing(name, data=None, **settings):
    made = bpy.data.objects.new(name, data)
    scene.collection.objects.link(made)
    for path, value in settings.items():
        setattr(made, path, value)
    return made

leader = thing("leader", cube.data, location=(2.5, 0, 0), scale=(0.5, 0.5, 0.5))
child = thing("child", cube.data, location=(0, 0, 2.5), parent=leader)
follower = thing("follower", cube.data, scale=(0.4, 0.4, 0.4))
empty = thing("empty", location=(-2.5, 0, 0))
follower.constraints.new("COPY_LOCATION").target = empty
bones = thing("bones", bpy.data.armatures.new("bones"), location=(0, -2.5, 0))
bpy.context.view_layer.objects.active = bones
bpy.ops.object.mode_set(mode="EDIT")
bones.data.edit_bones.new("bone").tail = (0, 0, 1)
bpy.ops.object.mode_set(mode="OBJECT")
carried = thing("carried", cube.data, scale=(0.3, 0.3, 0.3), parent=bones, parent_type="BONE")
carried.parent_bone = "bone"
for moved, path in ((leader, "location"), (empty, "location"), (bones.pose.bones[0], "location")):
    key(moved, path, 0.5, 1.5, index=1)
key(leader, "rotation_euler", 0.0, 1.0, index=2)
compare("followers")
paint, color = colored("paint", 0.8, 0.2, 0.1)
nodes, links = paint.node_tree.nodes, paint.node_tree.links
info, tint, place, sums = (nodes.new(f"ShaderNode{kind}")
                           for kind in ("ObjectInfo", "Attribute", "Attribute", "MixRGB"))
tint.attribute_type = place.attribute_type = "OBJECT"
tint.attribute_name, place.attribute_name = "tint", "location"
links.new(info.outputs["Color"], sums.inputs[1])
links.new(tint.outputs["Color"], sums.inputs[2])
links.new(sums.outputs[0], color)
links.new(place.outputs["Vector"], next(n for n in nodes if n.type == "BSDF_PRINCIPLED").inputs[
    "Emission Color"])
painted = thing("painted", cube.data.copy(), location=(0, 2.5, 0))
painted.data.materials.clear()
painted.data.materials.append(paint)
painted["tint"] = 0.1
for frame, value in ((1, 0.1), (3, 0.9)):
    painted["tint"] = value
    painted.keyframe_insert('["tint"]', frame=frame)
key(painted, "color", 0.2, 1.0, index=1)
key(painted, "location", 2.5, 3.0, index=1)
compare("properties")
inner = bpy.data.collections.new("inner")
inner.objects.link(bpy.data.objects.new("inside", cube.data))
placer = thing("placer", instance_type="COLLECTION", instance_collection=inner, location=(3, 3, 0))
compare("beside instances")
key(placer, "location", 3.0, 2.0, index=0)
compare("instances")
placer.animation_data_clear()
key(child, "pass_index", 0, 0, 1)
key(carried, "visible_shadow", True, False)
scene.view_layers[0].use_pass_object_index = True
compare("switches")
carried.animation_data_clear()
key(child, "hide_render", False, True)
compare("hidden")
child.animation_data_clear()
child.hide_render = False
key(lamp, "hide_render", False, True)
compare("hidden lamp")
still, shade = colored("still", 0.1, 0.2, 0.8)
follower.data = follower.data.copy()
follower.data.materials.clear()
follower.data.materials.append(still)
for moved in (leader, empty, bones, painted, lamp):
    moved.animation_data_clear()
lamp.hide_render = False
key(shade, "default_value", 0.1, 0.9, index=1)
key(follower, "hide_render", False, True)
compare("hidden and another material")
follower.animation_data_clear()
shade.id_data.animation_data_clear()
follower.hide_render = False
key(camera, "location", 7.4, 6.0, index=0)
for kind, frame in (("NONE", 1), ("COLLECTION", 3)):
    placer.instance_type = kind
    placer.keyframe_insert("instance_type", frame=frame)
compare("beginning instances")
answer(results)
"""
)
WORK = ("walks", "meshes", "materials", "worlds")
BENT = [
    "meshes",
    "motion blur",
    "displaced and flat things that blur",
    "aovs",
    "vectors",
    "light groups",
    "culling",
    "culling and motion blur",
    "vectors and aovs",
]
LAYERS = ["two layers", "two layers of different kinds", "two layers, of which one blurs"]
LAYERS += ["vectors, aovs and two layers", "all at once"]
MESHES = dict.fromkeys(BENT, 9) | dict.fromkeys(LAYERS, 99)
EDITS = """
second, paint = ball("second", 2.5, 0), colored("paint", 0.8, 0.2, 0.1)
dice = random.Random(SEED)
scene.glint.final.diffuse_bounces = SEED % 2
made = []
scene.view_layers[0].lightgroups.add(name="group")
shade = paint[0].node_tree.nodes.new("ShaderNodeOutputAOV")
shade.aov_name, shade.inputs["Color"].default_value = "shade", (0.1, 0.2, 0.3, 1)
scene.cycles.use_camera_cull = second.cycles.use_camera_cull = True

def grow():
    made.append(ball(f"made {len(made)}", dice.uniform(-3, 3), dice.uniform(-3, 3)))

def shrink():
    if made:
        bpy.data.objects.remove(made.pop(dice.randrange(len(made))))

def name_aovs():
    aovs = scene.view_layers[0].aovs
    if len(aovs):
        aovs.remove(aovs[0])
    else:
        aovs.add().name = "shade"

def bend():
    vertex = dice.choice(second.data.vertices)
    vertex.co.z += 0.3
    second.data.update()

def wear():
    second.data.materials.clear()
    if dice.random() < 0.7:
        second.data.materials.append(paint[0])

edits = [
    lambda: setattr(camera.location, "x", dice.uniform(5, 8)),
    lambda: setattr(camera.data, "lens", dice.uniform(20, 60)),
    lambda: setattr(second.location, "z", dice.uniform(0, 2)),
    lambda: setattr(cube, "scale", (1, dice.uniform(0.2, 2), 1)),
    lambda: paint[1].default_value.__setitem__(0, dice.random()),
    lambda: setattr(lamp.data, "energy", dice.uniform(200, 3000)),
    lambda: setattr(cube, "hide_render", dice.random() < 0.5),
    lambda: setattr(second, "visible_shadow", dice.random() < 0.5),
    lambda: setattr(scene.render, "film_transparent", dice.random() < 0.5),
    lambda: setattr(scene.glint.final, "samples", dice.choice([1, 2])),
    lambda: setattr(scene.view_layers[0], "use_pass_uv", dice.random() < 0.5),
    lambda: scene.frame_set(dice.randrange(1, 20)),
    lambda: setattr(second, "parent", dice.choice([cube, None])),
    grow, shrink, bend, wear, name_aovs,
    lambda: setattr(scene.view_layers[0], "use_pass_vector", dice.random() < 0.5),
    lambda: setattr(scene.render, "use_motion_blur", dice.random() < 0.5),
    lambda: setattr(scene.render, "use_simplify", dice.random() < 0.5),
    lambda: setattr(dice.choice([lamp, scene.world]), "lightgroup", dice.choice(["", "group"])),
]
for place, group in ((7.4, ""), (7.0, ""), (7.2, "group")):  # no update tells of groups
    camera.location.x, lamp.lightgroup = place, group
    draw()
key(second, "rotation_euler", 0.0, 3.0, index=1)
for _ in range(STEPS):
    for edit in dice.sample(edits, dice.choice([0, 1, 1, 2, 3])):
        edit()
    draw()
answer(told)
"""


def frames(folder, program: str, persistent: bool, **values) -> list:
    folder.mkdir(exist_ok=True)
    given = "".join(f"{name} = {value!r}\n" for name, value in values.items())
    switch = f"render.use_persistent_data = {persistent}\n"
    run = Blender(folder).run(SCENE + switch + given + program)
    assert run.returncode == 0, run.output
    return run.answer


def alike(kept: list, fresh: list) -> list[dict[str, float]]:
    """What was read anew for each frame, of pictures that are those of fresh starts."""
    assert len(kept) == len(fresh) > 3
    for number, (one, other) in enumerate(zip(kept, fresh, strict=True)):
        assert one[:3] == other[:3], f"frame {number}: {one} and {other}"
        assert one[4] == other[4] and not other[3]
    assert len({pixels for _, pixels, *_ in fresh}) > 2
    return [read for *_, read, _, _ in kept]


@pytest.fixture(scope="module")
def animated(tmp_path_factory) -> dict[str, list]:
    """Of each thing that moves, beside those before it, both ways."""
    return frames(tmp_path_factory.mktemp("animated"), ANIMATED, False)


@pytest.fixture(scope="module")
def moving(tmp_path_factory) -> dict[str, list]:
    """The same of what moves and follows."""
    return frames(tmp_path_factory.mktemp("moving"), MOVING, False)


@pytest.mark.slow
def test_a_frame_in_which_but_the_camera_moves_reads_nothing(animated):
    first, *others = alike(*animated["camera"])
    assert all(first.values()) and first.keys() == others[0].keys()
    assert [read for read in others if any(read.values())] == []
    lines = [line for *_, line in animated["camera"][0]]
    assert "read anew: 1 mesh + 1 material + 1 world + 1 walk" in lines[0]
    assert all("read anew: nothing" in line for line in lines[1:3])


@pytest.mark.parametrize(
    ("what", "read"),
    [
        ("objects", set()),
        ("materials", {"anew: walks", "anew: materials", "anew: worlds"}),
        ("stereo", {"anew: walks", "anew: materials", "anew: worlds"}),
        ("vanishing", {"anew: walks", "anew: materials", "anew: worlds"}),
        *((name, {f"anew: {kind}" for kind in WORK}) for name in (*BENT, *LAYERS)),
    ],
)
def test_only_what_changes_is_read(animated, what, read):
    _, *others = alike(*animated[what])
    assert {name for frame in others for name, count in frame.items() if count} <= read
    assert sum(frame["anew: meshes"] for frame in others) <= MESHES.get(what, 0)


@pytest.mark.parametrize("what", ["followers", "properties", "beside instances"])
def test_what_moves_alone_is_read(moving, what):
    _, *others = alike(*moving[what])
    assert not any(count for frame in others for count in frame.values())


COMING = ["instances", "switches", "hidden", "hidden lamp", "hidden and another material"]


@pytest.mark.parametrize("what", [*COMING, "beginning instances"])
def test_what_comes_and_goes_is_walked_over(moving, what):
    _, *others = alike(*moving[what])
    assert any(frame["anew: walks"] for frame in others)


def test_shapes_of_what_another_layer_alone_has_are_forgotten():
    """A mesh that is evaluated there next may lie at the address of one that was freed."""
    cache = ShapeCache()
    cache.keep((), {ShapeKey("mesh", (k,)): Shape(None, about={7, k}) for k in (1, 2)})
    cache.keep_about({7, 2})
    found = [cache.shape(ShapeKey("mesh", (k,))) for k in (1, 2)]
    assert found[0] is None and found[1].about == {7, 2}


def test_what_scripts_may_have_changed_is_read_anew(animated):
    assert not any(alike(*animated["motion blur that scripts hear of"]))


@pytest.mark.parametrize("seed", [2, pytest.param(1, marks=pytest.mark.slow)])
def test_any_edits_between_frames(tmp_path, seed):
    kept, fresh = (
        frames(tmp_path / name, EDITS, name == "kept", SEED=seed, STEPS=14)
        for name in ("kept", "fresh")
    )
    alike(kept, fresh)
