"""Explain Pixel on a real file: the terms of a pixel add up to what F12 writes there."""

import pytest

from blender_process import REGISTER_TREE, Blender

PROGRAM = (
    REGISTER_TREE
    + """
import numpy as np
from glint.operators.explain_pixel import explain_render
from glint.engine import explanation_lines

from types import SimpleNamespace
from glint.operators import explain_pixel

def clicked():
    # One click, event by event, as Blender's window would send it, and the explanation as a text.
    area = SimpleNamespace(type="IMAGE_EDITOR", tag_redraw=lambda: None, as_pointer=lambda: 0, regions=[SimpleNamespace(type="WINDOW",
        x=0, y=0)], spaces=SimpleNamespace(active=SimpleNamespace(show_region_ui=False)))
    quiet = SimpleNamespace(cursor_modal_set=lambda _: None, cursor_modal_restore=lambda: None)
    context = SimpleNamespace(area=area, window=quiet, workspace=SimpleNamespace(status_text_set=lambda _: None), scene=scene,
        window_manager=SimpleNamespace(modal_handler_add=lambda _: None), screen=SimpleNamespace(areas=[area]), region=None,
        view_layer=scene.view_layers[0])
    explain_pixel._point = lambda context, region, x, y: (x, y)
    click = type("Click", (), {name: value for name, value in vars(explain_pixel.GLINT_OT_explain_pixel).items() if name[0] != "_"
        or name == "_leave"})()
    click.report = lambda kind, text: reports.append(text)
    reports, results = [], [click.invoke(context, None)]
    for value in ("RELEASE", "PRESS", "RELEASE"):
        event = SimpleNamespace(type="LEFTMOUSE", value=value, mouse_x=16, mouse_y=12)
        results.append(click.modal(context, event))
        results.append(bool(explain_pixel._explained))
    with bpy.context.temp_override(area=None):
        opened = bpy.ops.glint.explanation_as_text()
    return {
        "results": [sorted(result) if isinstance(result, set) else result for result in results],
        "reports": reports,
        "sidebar": area.spaces.active.show_region_ui,
        "opened": sorted(opened),
        "block": bpy.data.texts["Explain Pixel"].as_string(),
    }

scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 24, 100
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = str(FOLDER / "picture.exr")
scene.glint.final.samples, scene.glint.final.light_samples, scene.glint.final.backend = 1, 2, "NUMPY"
scene.glint.final.soft_light = "DEALT"
bpy.ops.render.render(write_still=True)
image = bpy.data.images.load(scene.render.filepath)
pixels = np.empty(32 * 24 * 4, np.float32)
image.pixels.foreach_get(pixels)
pixels = pixels.reshape(24, 32, 4)
explained = {f"{x} {y}": explain_render(scene, scene.view_layers[0].name, x, y) for x, y in [(16, 12), (15, 9), (2, 2), (18, 14)]}
scene.glint.final.soft_light = "RESOLVED"
resolved = explain_render(scene, scene.view_layers[0].name, 16, 12)
scene.glint.final.soft_light = "DEALT"
answer({
    "resolved": [resolved.color == explained["16 12"].color, explanation_lines(resolved)],
    "pixels": {key: pixels[int(key.split()[1]), int(key.split()[0]), :3].tolist() for key in explained},
    "colors": {key: ray.color for key, ray in explained.items()},
    "things": {key: ray.hit.thing if ray.hit else None for key, ray in explained.items()},
    "text": explanation_lines(explained["16 12"]),
    **clicked(),
})
"""  # noqa: E501 - a script for another Blender
)


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    run = Blender(tmp_path_factory.mktemp("explain")).run(PROGRAM)
    assert run.returncode == 0, run.output
    return run.answer


def test_the_terms_add_up_to_the_render(told):
    for key, color in told["colors"].items():
        assert color == pytest.approx(told["pixels"][key], rel=2**-22), key
    assert told["things"]["16 12"] == "Cube" and told["things"]["2 2"] is None
    assert any("'Light': n·l = " in line for line in told["text"]), told["text"]


def test_what_is_averaged_over_pixels_is_told_of_the_pixel_itself(told):
    is_same, text = told["resolved"]
    assert is_same and sum("averaged over 4 x 4 pixels" in line for line in text) == 1, text
    assert not any("averaged" in line for line in told["text"])


def test_a_click_ends_with_its_release_and_leaves_the_clipboard_alone(told):
    waiting, done = ["RUNNING_MODAL"], ["FINISHED"]
    assert told["results"] == [waiting, waiting, False, waiting, False, done, True]
    assert told["sidebar"]
    assert told["reports"] == told["text"][:1] and told["text"][0].startswith(
        "'Cube' with the material 'Material': lit by Light "
    )
    assert ", World " in told["text"][0]
    assert told["block"].splitlines() == told["text"]
