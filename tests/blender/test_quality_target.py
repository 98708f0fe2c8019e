"""A target error instead of samples: chosen, rendered, told in statistics, log and file; the
display as Blender shows it.
"""

import pytest

from blender_process import REGISTER_TREE, Blender

pytestmark = pytest.mark.once

SCENE = (
    REGISTER_TREE
    + """
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 48, 32, 100
scene.glint.final.samples, scene.glint.final.light_samples = 1, 2
"""  # noqa: E501 - a script for another Blender
)


def test_a_render_for_a_target_tells_what_was_predicted_and_reached(tmp_path):
    """The file's stamp holds the settings that were found; a render with these alone gives the same
    bits.
    """
    run = Blender(tmp_path).run(
        SCENE
        + """
import json
from glint.addon.render import statistics
scene.render.image_settings.file_format = "OPEN_EXR"
said = {}
def render():
    bpy.ops.render.render()
    return statistics.of_last_render(scene.name)
scene.glint.target, scene.glint.target_rmse = "RMSE", 10.0
aimed = render()
settings = json.loads(aimed.stamp["settings"])
scene.glint.target = "NONE"
for name in ("samples", "error_threshold", "light_samples"):
    setattr(scene.glint.final, name, settings[name])
plain = render()
same = aimed.stamp["pixels"] == plain.stamp["pixels"]
answer([aimed.target, aimed.sections["Target error"], same, plain.target, settings])
"""
    )
    assert run.returncode == 0, run.output
    line, section, same, nothing, settings = run.answer
    assert line.startswith("asked for 10 % RMSE: ") and "predicted" in line and "reached" in line
    assert f"{settings['samples']} samples" in section and same and nothing == ""
    assert settings["samples"] > 1


def test_the_display_is_blenders_own(tmp_path):
    """A picture that Blender saves as PNG through AgX, exposure and gamma, against the transform
    that errors are measured with.
    """
    run = Blender(tmp_path).run(
        SCENE
        + """
import numpy as np
from glint.addon.render.quality_target import display_of
from glint.operators.pictures import read_picture
scene.view_settings.view_transform, scene.view_settings.exposure, scene.view_settings.gamma = "AgX", 0.5, 1.25
image = bpy.data.images.new("ramp", 16, 16, float_buffer=True)
linear = np.random.default_rng(3).uniform(0, 3, (16, 16, 4)).astype(np.float32)
linear[..., 3] = 1
image.pixels.foreach_set(linear.ravel())
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "PNG", "16"
scene.render.dither_intensity = 0.0
path = FOLDER / "ramp.png"
image.save_render(str(path), scene=scene)
shown = read_picture(path)[..., :3]
ours = display_of(scene)(linear[..., :3])
answer([float(np.abs(shown - ours).max()), float(shown.std())])
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    off, spread = run.answer
    assert spread > 0.05
    assert off <= 2 / 255


def test_the_command_renders_and_tells(tmp_path):
    run = Blender(tmp_path).run(
        SCENE
        + """
from glint.operators import command_line
blend = str(FOLDER / "cube.blend")
bpy.ops.wm.save_as_mainfile(filepath=blend)
good = command_line.run(["target", blend, "--levels", "40", "--out", str(FOLDER / "out.exr")])
unsound = command_line.run(["target", str(FOLDER / "none.blend"), "--rmse", "5", "--out", str(FOLDER / "none.exr")])
answer([good, unsound, (FOLDER / "out.exr").stat().st_size > 0])
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    assert run.answer == [0, 2, True]
    assert "asked for 40 levels" in run.output and "reached" in run.output
