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
scene.glint.final.light_samples, render.filter_size = 1, 0.01
scene.glint.final.visibility_samples = 1
render.use_multiview = True

def kind(multilayer):
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "OPEN_EXR"
    image.color_depth = "32"

def draw(name, engine, samples=1):
    render.engine, scene.glint.final.samples = engine, samples
    if engine == "CYCLES":
        direct_light_only(scene, 1 if samples == 1 else 4 * samples, 0)
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    render.filepath = str(FOLDER / f"{name}_{engine}")
    bpy.ops.render.render(write_still=True)

def spherical(data, kind="PANO"):
    data.type = kind
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
    "perspective": "spherical(camera.data, 'PERSP'); stereo.convergence_mode = 'PARALLEL'",
    "perspective, converging": "spherical(camera.data, 'PERSP')",
    "perspective, toe-in": "spherical(camera.data, 'PERSP'); stereo.convergence_mode = 'TOE'",
    "perspective, merging": (
        "spherical(camera.data, 'PERSP'); camera.data.lens = 15\n"
        "stereo.use_pole_merge, stereo.pole_merge_angle_from, stereo.pole_merge_angle_to = "
        "True, 0.3, 0.8"
    ),
    "perspective, rolled and clipped": (
        "spherical(camera.data, 'PERSP'); camera.rotation_euler.rotate_axis('Z', 0.7)\n"
        "camera.data.clip_start, camera.data.clip_end = 4.0, 6.0"
    ),
    "parallel rays": "spherical(camera.data, 'ORTHO'); camera.data.ortho_scale = 5.0",
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
        key: np.stack([channels[c] for c in "RGBXYZAVW" if c in channels], -1)
        for key, channels in planes.items()
    }


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Path:
    """Every camera by either engine, in one process."""
    folder = tmp_path_factory.mktemp("stereo")
    loop = "\n".join(
        f"camera.data = before.copy(); stereo = camera.data.stereo\n"
        f"camera.rotation_euler = upright\n{change}\n"
        f"draw({number!r}, 'CYCLES'); draw({number!r}, 'GLINT')"
        for number, change in ((f"pair{k}", text) for k, text in enumerate(CAMERAS.values()))
    )
    run = Blender(folder).run(
        PAIR + "kind(True); image.views_format = 'MULTIVIEW'\nbefore = camera.data\n"
        "upright = camera.rotation_euler.copy()\n" + loop
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


SEEN = {
    "sharp": (1, ""),
    "vector": (1, "render.use_motion_blur = False; layer.use_pass_vector = True"),
    "ray length": (1, "layer.material_override = shown"),
    "blurred by the lens": (
        256,
        "camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 3.0\n"
        "camera.data.dof.aperture_fstop = 0.08",
    ),
    "blurred by motion": (256, "render.use_motion_blur, render.motion_blur_shutter = True, 1.0"),
}
EYE = """
spherical(camera.data, "PERSP"); camera.data.clip_start = 1.0
def glowing(name, build):
    made = bpy.data.materials.new(name); made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    emission, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    links.new(build(nodes, links), emission.inputs["Color"])
    links.new(emission.outputs[0], out.inputs["Surface"])
    return made

def squares(nodes, links):
    point, made = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeTexChecker")
    links.new(point.outputs["Position"], made.inputs["Vector"])
    made.inputs["Scale"].default_value = 1.37
    return made.outputs["Fac"]

def length(nodes, links):
    return nodes.new("ShaderNodeLightPath").outputs["Ray Length"]

shown = glowing("length", length)
checked = glowing("squares", squares)
for frame, step in ((1, 0.0), (3, 0.4)):
    camera.location.x += step; camera.rotation_euler.x += step / 10; camera.rotation_euler.y += step
    camera.keyframe_insert("location", frame=frame)
    camera.keyframe_insert("rotation_euler", frame=frame)
scene.frame_set(2)
layer.use_pass_position = layer.use_pass_z = False
kind(True); image.views_format = "MULTIVIEW"
"""


@pytest.fixture(scope="module")
def seen(tmp_path_factory) -> Path:
    """One eye of a perspective in several ways, by either engine, in one process."""
    folder = tmp_path_factory.mktemp("eyes")
    loop = "\n".join(
        "render.use_motion_blur = layer.use_pass_vector = camera.data.dof.use_dof = False\n"
        f"layer.material_override = checked\n{change}\n"
        f"draw({f'eye{k}'!r}, 'CYCLES', {samples}); draw({f'eye{k}'!r}, 'GLINT', {samples})"
        for k, (samples, change) in enumerate(SEEN.values())
    )
    run = Blender(folder).run(PAIR + EYE + loop)
    assert run.returncode == 0, run.output
    assert "pherical" not in run.output
    return folder


def pair_of(folder: Path, name: str, layer: str) -> tuple[np.ndarray, np.ndarray]:
    """Both views of a pass, by Cycles and by Glint, (2, h, w, c)."""
    number = list(SEEN).index(name)
    both = (read_views(folder / f"eye{number}_{e}.exr") for e in ("CYCLES", "GLINT"))
    one, other = (np.stack([p[f"{layer}.{view}"] for view in ("left", "right")]) for p in both)
    return one, other


@pytest.mark.slow
def test_an_eye_has_cycles_vectors(seen):
    cycles, glint = pair_of(seen, "vector", "Vector")
    same = np.abs(cycles - glint).max(-1) < 2e-3
    assert np.abs(cycles).max() > 1 and same.mean() > 0.99


def test_rays_of_an_eye_are_as_long_as_in_cycles(seen):
    cycles, glint = (p[..., 0] for p in pair_of(seen, "ray length", "Combined"))
    met = (cycles > 1) & (glint > 1)
    close = np.abs(cycles - glint)[met] <= 2e-5 * cycles[met]
    assert met.mean() > 0.3 and close.mean() > 0.99


@pytest.mark.parametrize("name", ["blurred by the lens", "blurred by motion"])
def test_an_eye_is_blurred_as_in_cycles(seen, name):
    cycles, glint = pair_of(seen, name, "Combined")
    sharp, _ = pair_of(seen, "sharp", "Combined")
    wrong, blur = (np.sqrt(((p - cycles) ** 2).mean()) / cycles.mean() for p in (glint, sharp))
    assert wrong <= 0.02 < 0.1 * blur, (wrong, blur)
