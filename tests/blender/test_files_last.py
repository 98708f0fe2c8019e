"""Files outlive versions of Glint, and its absence: nothing that Glint keeps in a file is lost
where a Blender without it saves the file anew, choices keep their numbers, and what a version
offers is what its scenes get in the next.
"""

from blender_process import REGISTER_TREE, Blender

EVERYTHING = """
def value(owner, name):
    found = getattr(owner, name)
    if hasattr(found, "bl_rna") and hasattr(found, "keys"):
        return everything(found)
    if hasattr(found, "foreach_get"):
        return [everything(one) for one in found]
    return found

def everything(group):
    return {name: value(group, name) for name in group.bl_rna.properties.keys() if name not in ("rna_type", "name")}

def kept():
    scene = bpy.data.scenes["Scene"]
    node = bpy.data.materials["Phong"].node_tree.nodes["Shiny"]
    return [scene.render.engine, everything(scene.glint), everything(scene.glint_switch),
            everything(scene.view_layers[0].glint), bpy.data.meshes["Sphere"].glint_sphere,
            [[socket.name, list(socket.default_value) if hasattr(socket.default_value, "__len__") else socket.default_value]
             for socket in node.inputs if hasattr(socket, "default_value")]]
"""  # noqa: E501 - a script for another Blender
SAVE = (
    REGISTER_TREE
    + EVERYTHING
    + """
from glint.addon.ui import nodes

bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
if hasattr(scene, "cycles"):
    scene.render.engine = "CYCLES"
    bpy.ops.glint.switch_to_glint()
scene.render.engine = "GLINT"

def change(group):
    for name, known in group.bl_rna.properties.items():
        if known.type == "POINTER" and name != "rna_type":
            change(getattr(group, name))
        elif known.type == "ENUM":
            setattr(group, name, known.enum_items[-1].identifier)
        elif known.type == "BOOLEAN":
            setattr(group, name, not known.default)
        elif known.type in ("INT", "FLOAT"):
            setattr(group, name, type(known.default)(max(known.hard_min, 1) + 1 if known.type == "INT" else known.hard_min + 0.5))
        elif known.type == "STRING" and name != "name":
            setattr(group, name, "some words")

change(scene.glint)
change(scene.view_layers[0].glint)
bpy.ops.mesh.glint_add_sphere()
material = bpy.data.materials.new("Phong")
material.use_nodes = True
bpy.data.objects["Cube"].data.materials[0] = material
node = nodes.add_blinn_phong(material.node_tree)
node.name = "Shiny"
node.inputs["Exponent"].default_value = 77
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "first.blend"))
answer(kept())
"""  # noqa: E501 - a script for another Blender
)
WITHOUT = """
bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "first.blend"))
assert not hasattr(bpy.types.Scene, "glint")
bpy.data.objects["Cube"].location.x += 1
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "second.blend"))
answer(bpy.data.objects["Cube"].location.x)
"""
AGAIN = (
    REGISTER_TREE
    + EVERYTHING
    + """
bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "second.blend"))
answer([kept(), bpy.data.objects["Cube"].location.x])
"""
)


def test_nothing_is_lost_where_a_blender_without_glint_saves(tmp_path):
    blender = Blender(tmp_path)
    saved, without, again = (blender.run(program) for program in (SAVE, WITHOUT, AGAIN))
    for run in (saved, without, again):
        assert run.returncode == 0, run.output
    kept, moved = again.answer
    assert kept[0] == "GLINT" and kept == saved.answer and moved == without.answer
    assert kept[1]["final"]["samples"] == 2 and kept[4] is True


CHOICES = {
    "illumination": ["PHYSICAL", "CLASSIC"],
    "world_light": ["OCCLUDED", "CONSTANT"],
    "mesh_light": ["ON", "OFF"],
    "reflections": ["METALS", "ALL", "OFF"],
    "subsurface": ["ON", "OFF"],
    "reflective_caustics": ["ON", "OFF"],
    "refractive_caustics": ["ON", "OFF"],
    "soft_light": ["RESOLVED", "DEALT", "SHARED"],
    "backend": ["NATIVE", "NUMPY"],
    "acceleration": ["AUTO", "FAST", "BALANCED", "FINE"],
    "target": ["NONE", "LEVELS", "RMSE"],
}
"""A file keeps the place in these lists: what is new goes to their ends, and nothing goes away."""
NAMES = (
    "samples error_threshold light_samples lamp_shadows volume_samples max_bounces cutoff "
    "illumination world_light mesh_light reflections subsurface soft_light diffuse_bounces "
    "backend acceleration threads"
)
PASSES = {"Combined": 1597128033, "Normal": 320124649, "Light Group": 1782683623}
"""Of passes any may be new, so that their numbers are of their names."""


def test_choices_keep_their_numbers_and_settings_their_names(tmp_path):
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
scene = bpy.context.scene
def numbers(group):
    return {name: {item.identifier: item.value for item in known.enum_items}
            for name, known in group.bl_rna.properties.items() if known.type == "ENUM"}
answer([numbers(scene.glint.final) | numbers(scene.glint), sorted(scene.glint.final.bl_rna.properties.keys())])
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    found, names = run.answer
    passes = found.pop("viewport_pass")
    assert found == {
        name: {item: place for place, item in enumerate(items)} for name, items in CHOICES.items()
    }
    assert set(NAMES.split()) <= set(names)
    assert PASSES.items() <= passes.items()
    assert len(set(passes.values())) == len(passes)


def test_what_an_older_version_offered_stays(tmp_path):
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
from glint.addon.ui import former_settings

bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.glint.final.cutoff = 0.25
bpy.data.scenes.new("Cycles'")
former_settings.VERSION = 1
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "old.blend"))
former_settings.VERSION = 3
former_settings._OFFERED_UNTIL = {1: {"samples": 16, "cutoff": 0.01}, 2: {"samples": 32, "light_samples": 8}}
bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "old.blend"))
def settings(name):
    scene = bpy.data.scenes[name]
    return [scene.glint.version] + [[group.samples, round(group.cutoff, 3), group.light_samples]
                                    for group in (scene.glint.final, scene.glint.viewport)]
answer([settings("Scene"), settings("Cycles'")])
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    ours, other = run.answer
    assert ours == [3, [16, 0.25, 8], [16, 0.01, 8]]
    assert other == [0, [8, 0.001, 2], [8, 0.001, 2]]


def test_a_file_of_the_first_version_keeps_its_samples_and_shared_points(tmp_path):
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
from glint.addon.ui import former_settings

def saved(version):
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = "GLINT"
    scene.glint.final.samples = 32
    before, former_settings.VERSION = former_settings.VERSION, version
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "saved.blend"))
    former_settings.VERSION = before
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "saved.blend"))
    glint = bpy.context.scene.glint
    return [[group.samples, group.error_threshold, group.soft_light] for group in (glint.final, glint.viewport)]
answer([saved(1), saved(former_settings.VERSION)])
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    assert run.answer == [
        [[32, 4.0, "SHARED"], [64, 4.0, "SHARED"]],
        [[32, 0.0, "RESOLVED"], [8, 0.0, "RESOLVED"]],
    ]


def test_a_choice_that_is_not_there_is_the_first(tmp_path):
    """Of a pass that another version knows."""
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
from glint.addon.ui.properties import viewport_settings_from

scene = bpy.context.scene
scene.glint.viewport_pass = "Normal"
hidden = getattr(scene, "bl_system_properties_get", None)
(hidden() if hidden else scene)["glint"]["viewport_pass"] = 3
settings, shown = viewport_settings_from(scene)
answer([shown, sorted(settings.passes), scene.glint.viewport_pass])
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer == ["Combined", [], ""]
