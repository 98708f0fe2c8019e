"""Which passes reach a multilayer EXR, under Blender's names, in Blender's layers."""

import json
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from blender_process import COMPOSITOR, REGISTER_TREE, Blender

DRAW = (
    REGISTER_TREE
    + """
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 32, 24, 100
scene.glint.final.samples = scene.glint.final.light_samples = 1
scene.glint.final.backend = "NATIVE"
settings = scene.render.image_settings
if hasattr(settings, "media_type"):
    settings.media_type = "MULTI_LAYER_IMAGE"
settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
"""  # noqa: E501 - a script for another Blender
)

BLENDER_SWITCHES = (
    "z",
    "position",
    "normal",
    "uv",
    "object_index",
    "material_index",
    "emit",
    "environment",
    "mist",
    "vector",
    "ambient_occlusion",
)
OUR_SWITCHES = ("diffuse", "specular", "ambient", "shadow", "mirror")


def read_channels(path: Path) -> dict[str, np.ndarray]:
    """Channel name ("ViewLayer.Depth.Z") → (h, w) float32; 4.x writes one part, 5.x one part per
    pass.
    """
    image, channels, part = oiio.ImageInput.open(str(path)), {}, 0
    while image.seek_subimage(part, 0):
        pixels = image.read_image(part, 0, 0, image.spec().nchannels, oiio.FLOAT)
        prefix = image.spec().getattribute("name") or ""
        for index, name in enumerate(image.spec().channelnames):
            channels[name if name.count(".") > 1 or not prefix else f"{prefix}.{name}"] = pixels[
                ..., index
            ]
        part += 1
    return channels


@pytest.fixture(scope="module")
def all_passes(tmp_path_factory) -> tuple[dict[str, np.ndarray], object]:
    """Channels of one render with every pass on, and the Blender's version."""
    blender = Blender(tmp_path_factory.mktemp("passes"))
    run = blender.run(
        DRAW
        + f"""
layer = scene.view_layers[0]
for name in {BLENDER_SWITCHES}:
    setattr(layer, "use_pass_" + name, True)
for name in {OUR_SWITCHES}:
    setattr(layer.glint, "use_pass_" + name, True)
scene.glint.final.visibility_samples = 1  # so that all passes have the edges of one sample
cube = bpy.data.objects["Cube"]
cube.pass_index = 7
turn = scene.camera.matrix_world.to_3x3()
for frame, pixels in ((0, -2), (1, 0), (2, 2)):  # across the view, about so many
    cube.location = turn.col[0] * pixels * 11.3 * 36 / 50 / 32
    cube.keyframe_insert("location", frame=frame)
scene.frame_set(1)
bpy.data.objects["Cube"].active_material.pass_index = 5
scene.render.filepath = str(FOLDER / "all.exr")
bpy.ops.render.render(write_still=True)
answer(list(bpy.app.version))
"""
    )
    assert run.returncode == 0, run.output
    return read_channels(blender.folder / "all.exr"), tuple(run.answer)


def _pass(channels: dict[str, np.ndarray], name: str) -> np.ndarray:
    found = [values for channel, values in channels.items() if f".{name}." in f".{channel}"]
    assert found, f"no pass {name} among {json.dumps(sorted(channels))}"
    return np.stack(found, axis=-1)


def test_every_pass_is_written_under_the_name_that_this_blender_uses(all_passes):
    channels, version = all_passes
    renamed = (
        ("Object Index", "Material Index", "Emission", "Environment", "Ambient Occlusion")
        if version >= (5, 0)
        else ("IndexOB", "IndexMA", "Emit", "Env", "AO")
    )
    counts = {
        "Combined": 4,
        "Depth": 1,
        "Position": 3,
        "Normal": 3,
        "UV": 3,
        "Mist": 1,
        "Vector": 4,
        **dict(zip(renamed, (1, 1, 3, 3, 3), strict=True)),
    }
    counts |= dict.fromkeys(("Diffuse", "Specular", "Ambient", "Shadow", "Mirror"), 3)
    assert {name: _pass(channels, name).shape[-1] for name in counts} == counts


def test_the_passes_hold_their_own_values(all_passes):
    channels, version = all_passes
    depth = _pass(channels, "Depth")[..., 0]
    hit = depth < 1e9
    assert 0.02 < hit.mean() < 0.9
    assert depth[~hit].min() == np.float32(1e10)
    open_share = _pass(channels, "Ambient Occlusion" if version >= (5, 0) else "AO")
    assert (open_share == hit[..., None]).all()  # a cube alone is open all round
    vector = _pass(channels, "Vector")
    assert np.abs(vector - np.where(hit, 2.0, 0.0)[..., None] * [-1, 0, -1, 0]).max() < 0.4
    mist = _pass(channels, "Mist")[..., 0]
    assert (mist[~hit] == 1).all()
    assert 0 < mist[hit].max() < 0.5
    assert set(np.unique(_pass(channels, "Object Index" if version >= (5, 0) else "IndexOB"))) == {
        0.0,
        7.0,
    }
    assert set(
        np.unique(_pass(channels, "Material Index" if version >= (5, 0) else "IndexMA"))
    ) == {0.0, 5.0}
    np.testing.assert_allclose(
        np.linalg.norm(_pass(channels, "Normal")[hit], axis=-1), 1.0, rtol=1e-5
    )


def test_the_parts_sum_to_combined(all_passes):
    channels, version = all_passes
    names = [
        "Diffuse",
        "Specular",
        "Ambient",
        "Shadow",
        "Mirror",
        *(("Emission", "Environment") if version >= (5, 0) else ("Emit", "Env")),
    ]
    parts = [
        {channel: values for channel, values in channels.items() if f".{name}." in f".{channel}"}
        for name in names
    ]
    for letter in "RGB":
        total = sum(
            values.astype(float)
            for part in parts
            for channel, values in part.items()
            if channel.endswith(f".{letter}")
        )
        combined = next(
            values for channel, values in channels.items() if channel.endswith(f"Combined.{letter}")
        )
        np.testing.assert_allclose(total, combined, rtol=1e-5, atol=1e-6)


def test_only_what_is_switched_on_is_written(tmp_path):
    blender = Blender(tmp_path)
    run = blender.run(
        DRAW
        + """
scene.view_layers[0].use_pass_z = False
scene.render.filepath = str(FOLDER / "few.exr")
bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 0, run.output
    channels = [name for name in read_channels(tmp_path / "few.exr") if "Composite" not in name]
    assert {name.split(".")[-2] for name in channels} == {"Combined"}


def test_each_view_layer_gets_its_own_picture(tmp_path):
    """A layer without the cube is empty where the other shows it."""
    blender = Blender(tmp_path)
    run = blender.run(
        DRAW
        + """
scene.render.film_transparent = True
empty = scene.view_layers.new("Empty")
empty.layer_collection.children[0].exclude = True
scene.view_layers[0].name = "Cube"
scene.render.filepath = str(FOLDER / "layers.exr")
bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 0, run.output
    channels = read_channels(tmp_path / "layers.exr")
    alpha = {layer: channels[f"{layer}.Combined.A"] for layer in ("Cube", "Empty")}
    assert alpha["Cube"].max() == 1.0
    assert alpha["Empty"].max() == 0.0


def test_statistics_are_in_the_metadata(tmp_path):
    blender = Blender(tmp_path)
    run = blender.run(
        DRAW + "scene.render.filepath = str(FOLDER / "
        '"stamp.exr")\nbpy.ops.render.render(write_still=True)\n'
    )
    assert run.returncode == 0, run.output
    attributes = {
        attribute.name: attribute.value
        for attribute in oiio.ImageInput.open(str(tmp_path / "stamp.exr")).spec().extra_attribs
    }
    assert "12 triangles" in attributes["glint.ViewLayer.scene"], sorted(attributes)
    assert "trace" in attributes["glint.ViewLayer.seconds"]


STEREO = (
    DRAW
    + """
def kind(file_format, views):
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.views_format = file_format, views
    if file_format == "OPEN_EXR":
        settings.color_depth = "32"

def draw(name):
    scene.render.filepath = str(FOLDER / name)
    bpy.ops.render.render(write_still=True)

eyes = scene.camera.data.stereo
eyes.convergence_mode, eyes.interocular_distance, eyes.pivot = "PARALLEL", 0.8, "CENTER"
kind("OPEN_EXR", "INDIVIDUAL")
"""
)


def read_rgb(path: Path) -> np.ndarray:
    return oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)[..., :3]


def test_each_eye_is_a_picture_from_its_own_place(tmp_path):
    run = Blender(tmp_path).run(
        STEREO
        + """
from mathutils import Vector
scene.camera.data.dof.use_dof = scene.render.use_border = scene.render.use_crop_to_border = True
scene.camera.data.dof.focus_distance = 9
scene.render.border_min_x, scene.render.border_max_x = 0.2, 0.9
scene.render.use_multiview = True
draw("eye")
from glint.addon.render import statistics
told = {name: s.stamp["pixels"] for name, s in statistics.by_layer(scene.name).items()}
scene.render.use_multiview = False
axis, place = scene.camera.matrix_world.to_3x3().col[0].normalized(), scene.camera.location.copy()
for name, side in (("L", -0.4), ("R", 0.4)):
    scene.camera.location = place + side * axis
    draw(f"alone_{name}")
answer(told)
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer.keys() == {"ViewLayer.left", "ViewLayer.right"}
    assert len(set(run.answer.values())) == 2
    eyes = {
        name: [read_rgb(tmp_path / f"{kind}_{name}.exr") for kind in ("eye", "alone")]
        for name in "LR"
    }
    for one, other in eyes.values():
        assert one.max() > 0
        assert (np.abs(one - other).max(-1) > 1e-3).mean() <= 0.005
    assert (np.abs(eyes["L"][0] - eyes["R"][0]).max(-1) > 1e-2).mean() > 0.1


def test_files_of_both_eyes_and_of_one(tmp_path):
    """Side by side, and where one view is off: Blender 4.2 names the only one by no eye."""
    run = Blender(tmp_path).run(
        STEREO
        + """
scene.render.use_multiview = True
draw("eye")
kind("PNG", "STEREO_3D")
settings.stereo_3d_format.display_mode = "SIDEBYSIDE"
draw("both")
kind("OPEN_EXR", "INDIVIDUAL")
scene.render.views["left"].use = False
draw("one")
scene.render.views["right"].use = False
draw("none")
"""
    )
    assert run.returncode == 0, run.output
    left, right = (read_rgb(tmp_path / f"eye_{side}.exr") for side in "LR")
    both = read_rgb(tmp_path / "both.png")
    assert both.shape[:2] == (24, 64) and both.max() > 0
    assert (np.abs(both[:, :32] - both[:, 32:]).max(-1) > 1e-2).mean() > 0.1
    (alone,) = tmp_path.glob("one*.exr")
    assert alone.name in ("one_R.exr", "one.exr")
    np.testing.assert_array_equal(read_rgb(alone), right)
    assert left.max() > 0


def test_eyes_of_a_camera_that_moves(tmp_path):
    run = Blender(tmp_path).run(
        STEREO
        + """
camera = scene.camera
for frame, step in ((1, -1.0), (3, 1.0)):
    camera.location.z += step
    camera.keyframe_insert("location", frame=frame)
scene.frame_set(2)
scene.render.use_motion_blur, scene.render.use_multiview = True, True
scene.glint.final.samples = 8
from glint.addon.render import final
with final.reading_only() as jobs:
    bpy.ops.render.render()
answer([(j.view, j.scene.camera.world_from_camera.tolist(), j.scene.camera.motion.tolist())
        for j in jobs])
"""
    )
    assert run.returncode == 0, run.output
    assert [view for view, *_ in run.answer] == ["left", "right"]
    (_, left, left_keys), (_, right, right_keys) = run.answer
    apart = np.array(right_keys)[:, :, 3] - np.array(left_keys)[:, :, 3]
    np.testing.assert_allclose(apart, 0.8 * np.array(left)[:, 0][None].repeat(3, 0), atol=1e-5)
    for still, keys in ((left, left_keys), (right, right_keys)):
        np.testing.assert_allclose(keys[1], still, atol=1e-6)
        assert abs(keys[2][2][3] - keys[0][2][3]) > 0.1


def test_a_layers_own_samples_count(tmp_path):
    """As Cycles takes them: in place of the scene's, as a bound, or not."""
    blender = Blender(tmp_path)
    run = blender.run(
        DRAW
        + """
layer = scene.view_layers[0]
layer.glint.use_pass_samples = True
scene.glint.final.samples, scene.glint.final.error_threshold = 4, 0
for name, how, samples in (
    ("use", "USE", 6), ("more", "BOUNDED", 6), ("less", "BOUNDED", 2), ("not", "IGNORE", 6),
    ("none", "USE", 0),
):
    scene.cycles.use_layer_samples, layer.samples = how, samples
    scene.render.filepath = str(FOLDER / (name + ".exr"))
    bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 0, run.output
    for name, samples in {"use": 6, "more": 4, "less": 2, "not": 4, "none": 4}.items():
        taken = _pass(read_channels(tmp_path / f"{name}.exr"), "Samples")
        assert (taken == samples).all(), name


TAKE_ALL = (
    DRAW
    + COMPOSITOR
    + """
layer = scene.view_layers[0]
scene.cycles.use_denoising = True
for owner in (layer, layer.cycles):
    for switch in owner.bl_rna.properties.keys():
        if switch.startswith(("use_pass_", "pass_debug_", "pass_render_", "denoising_store_")):
            setattr(owner, switch, True)
scene.render.engine = "CYCLES"
layer.update_render_passes()
layers = tree.nodes.new("CompositorNodeRLayers")
layers.scene, layers.layer = scene, layer.name
tree.links.new(layers.outputs["Image"], output.inputs["Image"])
taken = [socket for socket in layers.outputs if not socket.is_unavailable]
for socket in taken:
    tree.links.new(socket, tree.nodes.new("CompositorNodeDenoise").inputs["Image"])
names = [socket.name for socket in taken]
scene.render.engine = "GLINT"
"""
)


def test_what_a_compositor_takes_is_rendered_or_told(tmp_path):
    """Every pass that Cycles has, so that those of the next Blender are told as well."""
    run = Blender(tmp_path).run(
        TAKE_ALL
        + """
from glint.addon.render import final
scene.render.filepath = str(FOLDER / "taken.exr")
bpy.ops.render.render(write_still=True)
with final.reading_only() as jobs:
    bpy.ops.render.render()
told = [note.names for note in jobs[0].notes if "Render Layers" in note]
from glint.operators import switch_engine
scene.render.engine = "CYCLES"
switch_engine.switch_to_glint(scene, layer.name)
rows = [row for row in scene.glint_switch.rows if "Render Layers" in row.text]
changes = [json.loads(row.names) for row in rows]
answer([names, told, changes])
"""
    )
    assert run.returncode == 0, run.output
    taken, told, changes = run.answer
    (told,) = told
    written = {name.split(".")[-2] for name in read_channels(tmp_path / "taken.exr")}
    lacking = {name.removeprefix("Render Layers: ") for name in told}
    assert "Debug Sample Count" in lacking and "Noisy Image" not in lacking
    blenders = {"Image", "Alpha", "Grease Pencil", "GreasePencil"}
    assert set(taken) - blenders == (set(taken) & written) | lacking
    assert not written & lacking
    assert changes == [told]


def test_the_noisy_image_is_the_picture(tmp_path):
    run = Blender(tmp_path).run(
        TAKE_ALL
        + """
scene.render.filepath = str(FOLDER / "noisy.exr")
bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 0, run.output
    channels = read_channels(tmp_path / "noisy.exr")
    np.testing.assert_array_equal(
        _pass(channels, "Noisy Image"), _pass(channels, "ViewLayer.Combined")
    )
