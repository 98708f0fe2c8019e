"""Presets of Sampling: what they set, that nothing of before is left, and that their pictures are
in the order of their names.
"""

from pathlib import Path

import pytest

from blender_process import REGISTER_TREE, Blender

SETTINGS = (Path(__file__).parents[2] / "docs/manual/settings.md").read_text()

PROGRAM = (
    REGISTER_TREE
    + """
import numpy as np
from glint import engine
from glint.addon.ui import presets
from glint.addon.ui.properties import settings_from
from glint.engine.settings import DECLARED, OFFERED
from glint.operators.scene_copy import copied, rendered

bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x = scene.render.resolution_y = 32
scene.render.resolution_percentage = 100
bpy.data.objects["Light"].data.shadow_soft_size = 1.5
bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -1))
final = scene.glint.final
MACHINE = {"backend", "acceleration", "threads"}
NAMES = [name for name, d in DECLARED.items() if d.label and name not in MACHINE]

def picture():
    with copied(scene, bpy.context.view_layer.name) as copy:
        return rendered(copy, FOLDER / "a.exr")[0][..., :3]

told, pictures = {}, {}
untouched = [getattr(scene.glint.viewport, name) for name in NAMES]
for name in presets.PRESETS:
    final.samples, final.illumination, final.reflections, final.threads = 999, "CLASSIC", "OFF", 3
    scene.glint.target = "RMSE"
    ended = bpy.ops.glint.preset(preset=name)
    told[name] = {
        "ended": list(ended), "target": scene.glint.target, "threads": final.threads,
        "problems": settings_from(final, scene).problems(),
        "settings": {key: getattr(final, key) for key in NAMES}}
    pictures[name] = picture()
offered = {key: getattr(OFFERED, key) for key in NAMES}
bpy.ops.glint.preset(preset="EXACT")
final.samples, final.light_samples, final.reflections = 1024, 8, "ALL"
truth = picture()
errors = {name: float(np.sqrt(np.mean((p - truth) ** 2))) for name, p in pictures.items()}
bpy.ops.glint.preset(preset="FINAL")
bpy.ops.ed.undo_push(message="before")
bpy.ops.glint.preset(preset="TEXTBOOK")
bpy.ops.ed.undo_push(message="after")
bpy.ops.ed.undo()
undone = bpy.context.scene.glint.final.illumination
scene = bpy.context.scene
answer({"names": [sorted(presets.NAMES), sorted(NAMES)], "told": told,
        "offered": offered, "errors": errors, "undone": undone,
        "viewport": untouched == [getattr(scene.glint.viewport, n) for n in NAMES]})
"""
)


@pytest.fixture(scope="module")
def got(tmp_path_factory):
    run = Blender(tmp_path_factory.mktemp("presets")).run(PROGRAM)
    assert run.returncode == 0, run.output
    return run.answer


@pytest.mark.slow
def test_a_preset_leaves_nothing_of_before(got):
    for name, told in got["told"].items():
        assert told["ended"] == ["FINISHED"] and told["problems"] == [], name
        assert told["target"] == "NONE" and told["threads"] == 3
        assert told["settings"]["samples"] != 999
        assert told["settings"]["illumination"] == ("CLASSIC" if name == "TEXTBOOK" else "PHYSICAL")
    assert got["told"]["FINAL"]["settings"] == pytest.approx(got["offered"])
    assert got["viewport"] and got["undone"] == "PHYSICAL"
    set_ones, all_but_the_machines = got["names"]
    assert set_ones == all_but_the_machines


def test_exact_is_as_fine_as_the_manual_says(got):
    """Its error is bounded by its samples alone: it shares the points of Final."""
    exact, final = (got["told"][name]["settings"] for name in ("EXACT", "FINAL"))
    assert exact["samples"] >= 4 * final["samples"]
    row = next(line for line in SETTINGS.splitlines() if line.startswith("| Exact |"))
    for words in (
        "{samples} samples",
        "Light Samples {light_samples},",
        "{diffuse_bounces} Diffuse",
    ):
        assert words.format(**exact) in row
    assert f"{exact['max_bounces']} Bounces" in row


def test_their_pictures_are_in_the_order_of_their_names(got):
    errors = got["errors"]
    assert errors["PREVIEW"] > errors["FINAL"] > 2 * errors["EXACT"] > 0


def test_the_textbook_has_a_ray_a_pixel_and_hard_shadows(got):
    settings = got["told"]["TEXTBOOK"]["settings"]
    assert (settings["samples"], settings["light_samples"], settings["max_bounces"]) == (1, 1, 1)


def test_a_preset_of_ones_own_is_kept_and_removed(tmp_path):
    """With + and the −, as those of Blender's engines."""
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.glint.final.samples, scene.glint.final.reflections, scene.glint.target = 7, "OFF", "RMSE"
folder = pathlib.Path(bpy.utils.user_resource("SCRIPTS", path="presets/glint/sampling"))
bpy.ops.glint.preset_add(name="My own")
kept = [path.name for path in folder.iterdir()]
own = bpy.types.GLINT_OT_preset_add
target = own.preset_values[-3]
alone = not getattr(own, "preset_defines", ()) and eval(target, {"bpy": bpy})
bpy.ops.glint.preset(preset="FINAL")
between = [scene.glint.final.samples, scene.glint.target]
panel = bpy.types.GLINT_PT_presets
bpy.ops.script.execute_preset(filepath=str(folder / kept[0]), menu_idname=panel.__name__)
again = [scene.glint.final.samples, scene.glint.final.reflections, scene.glint.target]
bpy.ops.glint.preset_add(name="My own", remove_name=True)
answer([kept, between, again, list(folder.iterdir()), alone])
"""
    )
    *found, alone = run.answer
    assert found == [["My_own.py"], [8, "NONE"], [7, "OFF", "RMSE"], []], run.output
    assert alone == "RMSE", "Blender 4.3 with Python 3.13 has no names of defines"
