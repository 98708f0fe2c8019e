"""Stereoscopy: each view of a pair sees what Cycles' sees, and files come out as with Cycles."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from blender_process import REGISTER_TREE, Blender

PAIR = (
    REGISTER_TREE
    + """
import bpy
from pathlib import Path
from mathutils import Vector
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
render, image = scene.render, scene.render.image_settings
render.resolution_x, render.resolution_y, render.resolution_percentage = 64, 48, 100
bpy.ops.mesh.primitive_plane_add(size=30, location=(0, 0, -1))
camera = scene.camera
camera.location = (3.0, -4.0, 2.0)
camera.rotation_euler = (Vector((0, 0, 0)) - camera.location).to_track_quat("-Z", "Y").to_euler()
camera.data.shift_x, camera.data.lens = 0.1, 30
layer = scene.view_layers[0]
layer.use_pass_z = layer.use_pass_position = True
from glint.operators.compare_cycles import direct_light_only
scene.glint.final.samples = scene.glint.final.light_samples = 1
render.use_multiview = True

def kind(multilayer):
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "OPEN_EXR"
    image.color_depth = "32"

def draw(name, engine):
    render.engine = engine
    if engine == "CYCLES":
        direct_light_only(scene, 1, 0)
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    render.filepath = str(FOLDER / f"{name}_{engine}")
    bpy.ops.render.render(write_still=True)

def spherical(data):
    data.type = "PANO"
    here = data if hasattr(data, "panorama_type") else data.cycles
    here.panorama_type = "EQUIRECTANGULAR"
    data.stereo.use_spherical_stereo = True

stereo = camera.data.stereo
stereo.interocular_distance, stereo.convergence_distance = 0.4, 3.0
"""
)
CAMERAS = {
    "off-axis": "stereo.convergence_mode = 'OFFAXIS'",
    "parallel": "stereo.convergence_mode, stereo.pivot = 'PARALLEL', 'CENTER'",
    "toe-in": "stereo.convergence_mode, stereo.pivot = 'TOE', 'RIGHT'",
    "spherical": "spherical(camera.data); stereo.convergence_mode = 'PARALLEL'",
    "spherical, converging": "spherical(camera.data); stereo.convergence_mode = 'OFFAXIS'",
    "spherical, merging": (
        "spherical(camera.data); stereo.convergence_mode = 'PARALLEL'\n"
        "stereo.use_pole_merge, stereo.pole_merge_angle_from, stereo.pole_merge_angle_to = "
        "True, 0.3, 0.8"
    ),
    "panorama": "spherical(camera.data); stereo.use_spherical_stereo = False",
}


def read_views(path: Path) -> dict[str, np.ndarray]:
    """ "Position.left" and so on → (h, w, c) of a multilayer file of several views: a part each,
    from 5.0 on, or channels named by layer, pass, view and letter.
    """
    planes: dict[str, dict[str, np.ndarray]] = {}
    source, part = oiio.ImageInput.open(str(path)), 0
    while source.seek_subimage(part, 0):
        spec = source.spec()
        pixels = source.read_image(part, 0, 0, spec.nchannels, oiio.FLOAT)
        for index, name in enumerate(spec.channelnames):
            _, what, *view, letter = name.split(".")
            key = f"{what}.{view[0] if view else spec.getattribute('view')}"
            planes.setdefault(key, {})[letter] = pixels[..., index]
        part += 1
    return {
        key: np.stack([channels[c] for c in "RGBXYZAV" if c in channels], -1)
        for key, channels in planes.items()
    }


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Path:
    """Every camera by either engine, in one process."""
    folder = tmp_path_factory.mktemp("stereo")
    loop = "\n".join(
        f"camera.data = before.copy(); stereo = camera.data.stereo\n{change}\n"
        f"draw({number!r}, 'CYCLES'); draw({number!r}, 'GLINT')"
        for number, change in ((f"pair{k}", text) for k, text in enumerate(CAMERAS.values()))
    )
    run = Blender(folder).run(
        PAIR + "kind(True); image.views_format = 'MULTIVIEW'\nbefore = camera.data\n" + loop
    )
    assert run.returncode == 0, run.output
    return folder


@pytest.mark.parametrize("name", CAMERAS)
def test_each_eye_sees_what_cycles_sees(drawn, name):
    number = f"pair{list(CAMERAS).index(name)}"
    cycles, glint = (read_views(drawn / f"{number}_{engine}.exr") for engine in ("CYCLES", "GLINT"))
    assert cycles.keys() == glint.keys() and len(cycles) == 6, (cycles.keys(), glint.keys())
    for view in ("left", "right"):
        depths = [p[f"Depth.{view}"][..., 0] for p in (cycles, glint)]
        seen = (depths[0] < 1e9) & (depths[1] < 1e9)
        assert seen.mean() > 0.3 and ((depths[0] < 1e9) == (depths[1] < 1e9)).mean() > 0.998
        wrong = np.abs(cycles[f"Position.{view}"] - glint[f"Position.{view}"]).max(-1)
        assert (wrong / depths[0])[seen].max() <= 1e-4
        assert (np.abs(depths[0] - depths[1]) / depths[0])[seen].max() <= 1e-4
    apart = np.abs(glint["Position.left"] - glint["Position.right"]).max()
    assert apart > 0.01
