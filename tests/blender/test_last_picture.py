"""A render that is stopped before it shows anything leaves the picture before in its slot."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

import glint
from glint.addon.render import final, last_picture
from glint.engine import render
from glint.operators import pictures

pytestmark = pytest.mark.once
SIZE = 24, 16


@pytest.fixture(scope="module", autouse=True)
def registered():
    glint.register()
    yield
    glint.unregister()


@pytest.fixture
def scene():
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = "GLINT"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    if hasattr(scene, "sequence_editor_create"):
        scene.sequence_editor_create()  # as a new file of a program with windows has it
    scene.glint.final.samples = 1
    yield scene
    last_picture.forget()


@pytest.fixture
def in_a_slot(monkeypatch):
    """As where a person works; its result is the number of the slot."""
    number = [0]
    monkeypatch.setattr(
        last_picture, "slot_of", lambda depsgraph, views, size: (number[0], views, size)
    )
    return number


def length(editor) -> dict:
    """Of a strip of ten frames, as Blender 5.0 and those before take it."""
    new = (editor.strips if hasattr(editor, "strips") else editor.sequences).bl_rna
    parameters = new.functions["new_effect"].parameters
    return {"length": 10} if "length" in parameters else {"frame_end": 10}


def drawn(scene, folder) -> np.ndarray:
    bpy.ops.render.render()
    return result(scene, folder)


def stopped(scene, folder) -> np.ndarray:
    """By Esc before the first wave."""

    def nothing(job):
        film = render(job.scene, job.settings)
        return replace(
            film,
            samples=0,
            complete=False,
            passes={name: np.zeros_like(values) for name, values in film.passes.items()},
        )

    with final.films_from(nothing):
        return drawn(scene, folder)


def result(scene, folder) -> np.ndarray:
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    path = folder / "picture.exr"
    pictures.render_result().save_render(str(path), scene=scene)
    return pictures.read_picture(path).copy()


def test_the_picture_before_stays(scene, in_a_slot, tmp_path):
    before = drawn(scene, tmp_path)
    assert before[..., :3].max() > 0
    np.testing.assert_array_equal(stopped(scene, tmp_path), before)
    np.testing.assert_array_equal(stopped(scene, tmp_path), before)


def test_not_in_another_slot_nor_at_another_size(scene, in_a_slot, tmp_path):
    drawn(scene, tmp_path)
    in_a_slot[0] = 1
    with pytest.raises(RuntimeError, match="could not be saved"):  # nothing is there
        stopped(scene, tmp_path)
    in_a_slot[0] = 0
    scene.render.resolution_x += 1
    with pytest.raises(RuntimeError, match="could not be saved"):
        stopped(scene, tmp_path)


def test_not_after_another_file(scene, in_a_slot, tmp_path):
    drawn(scene, tmp_path)
    assert last_picture._last is not None
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    assert last_picture._last is None


def test_one_at_most_is_kept_and_only_where_people_see_it(scene, tmp_path, monkeypatch):
    drawn(scene, tmp_path)
    assert last_picture._last is None, "a program without windows keeps nothing"
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert last_picture.slot_of(depsgraph, ("",), SIZE) is None

    class InWindow:
        app = type("app", (), {"background": False, "handlers": bpy.app.handlers})
        data = bpy.data

    monkeypatch.setattr(last_picture, "bpy", InWindow)
    slot = last_picture.slot_of(depsgraph, ("",), SIZE)
    assert slot is not None
    editor = scene.sequence_editor
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strip = strips.new_effect("colour", "COLOR", 1, 1, **length(editor))
    assert last_picture.slot_of(depsgraph, ("",), SIZE) is None, "people see the strip"
    strip.mute = True
    assert last_picture.slot_of(depsgraph, ("",), SIZE) is not None
    assert last_picture.slot_of(depsgraph, ("left", "right"), SIZE) is None
    scene.view_layers.new("Second")
    assert last_picture.slot_of(bpy.context.evaluated_depsgraph_get(), ("",), SIZE) is None
    last_picture.keep(slot, np.zeros(1))
    last_picture.keep(("other",), np.ones(1))
    assert last_picture.kept(slot) is None and last_picture.kept(("other",)) == 1
    last_picture.keep(None, np.ones(1))
    assert last_picture.kept(None) is last_picture.kept(("other",)) is None


def test_not_after_another_engine(scene, in_a_slot, tmp_path):
    drawn(scene, tmp_path)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    bpy.ops.render.render()
    assert last_picture._last is None
