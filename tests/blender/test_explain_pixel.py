"""Explain Pixel on a real file: the terms of a pixel add up to what F12 writes there."""

import pytest

from blender_process import REGISTER_TREE, Blender

PROGRAM = (
    REGISTER_TREE
    + """
import numpy as np
from glint.operators.explain_pixel import explain_render
from glint.engine import explanation_lines

scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 24, 100
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = str(FOLDER / "picture.exr")
scene.glint.final.samples, scene.glint.final.light_samples, scene.glint.final.backend = 1, 2, "NUMPY"
bpy.ops.render.render(write_still=True)
image = bpy.data.images.load(scene.render.filepath)
pixels = np.empty(32 * 24 * 4, np.float32)
image.pixels.foreach_get(pixels)
pixels = pixels.reshape(24, 32, 4)
explained = {f"{x} {y}": explain_render(scene, scene.view_layers[0].name, x, y) for x, y in [(16, 12), (15, 9), (2, 2), (18, 14)]}
answer({
    "pixels": {key: pixels[int(key.split()[1]), int(key.split()[0]), :3].tolist() for key in explained},
    "colors": {key: ray.color for key, ray in explained.items()},
    "things": {key: ray.hit.thing if ray.hit else None for key, ray in explained.items()},
    "text": explanation_lines(explained["16 12"]),
    "operators": [hasattr(bpy.types, name) for name in ("GLINT_OT_explain_pixel", "GLINT_OT_copy_explanation")],
})
"""
)


def test_the_terms_add_up_to_the_render(tmp_path):
    run = Blender(tmp_path).run(PROGRAM)
    assert run.returncode == 0, run.output
    told = run.answer
    for key, color in told["colors"].items():
        assert color == pytest.approx(told["pixels"][key], rel=2**-22), key
    assert told["things"]["16 12"] == "Cube" and told["things"]["2 2"] is None
    assert any("'Light': n·l = " in line for line in told["text"]), told["text"]
    assert told["operators"] == [True, True]
