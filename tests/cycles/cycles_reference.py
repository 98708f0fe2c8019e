"""Cycles as the reference: a pixel-exact set-up, rendered to float arrays (row 0 at the bottom, as
in Film).

Rays go through the pixels' centres (a Gaussian filter of 0.01 px: 4e-6 px), one sample, no bounces,
no clamping, no light tree. With one hard light per scene, one sample is then exact; Cycles picks
one light at random, so scenes with two lights need two renders.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

bpy = __import__("pytest").importorskip(
    "bpy", reason="the Cycles checks need Blender as a Python module"
)
oiio = __import__("pytest").importorskip(
    "OpenImageIO", reason="the Cycles checks read EXR through OpenImageIO"
)

if "glint" not in sys.modules:  # a command of this folder, not pytest
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    __import__("glint_tree")
from glint.operators.compare_cycles import direct_light_only  # noqa: E402  (after the skip without Blender)

PASSES = ("Combined", "Depth", "Position", "Normal")


def empty_scene(width: int = 128, height: int = 128):
    """A new factory file without objects and with a black world; returns its scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    set_world(scene, (0.0, 0.0, 0.0))
    return scene


def set_world(scene, color, strength: float = 1.0) -> None:
    """Gives the scene a world of one colour."""
    world = bpy.data.worlds.new("World")
    use_nodes(world)
    background = next(n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength
    scene.world = world


def use_nodes(owner) -> None:
    """Gives a material or world its node tree; from 5.0 on it is born with one and the switch is
    deprecated.
    """
    if bpy.app.version < (5, 0):
        owner.use_nodes = True


def make_exact(scene, samples: int = 1, seed: int = 0, bounces: int = 0) -> None:
    """Sets the engine to Cycles with one ray through every pixel's centre and direct light only,
    after `bounces` glossy bounces.
    """
    scene.render.engine = "CYCLES"
    direct_light_only(scene, samples, seed)
    scene.cycles.max_bounces = scene.cycles.glossy_bounces = bounces
    scene.cycles.pixel_filter_type = "GAUSSIAN"
    scene.cycles.filter_width = 0.01


def march_volumes(scene) -> None:
    """Volumes step by step, as before Blender 5.0: what bounds their densities takes seconds of a
    picture, however small it is.
    """
    if hasattr(scene.cycles, "volume_biased"):
        scene.cycles.volume_biased = True


def render_cycles(
    scene, samples: int = 1, seed: int = 0, bounces: int = 0
) -> dict[str, np.ndarray]:
    """Pixel-exact passes of `scene`: (h, w) Depth; (h, w, 3) Position, Normal; (h, w, 4) Combined;
    float32, linear.
    """
    make_exact(scene, samples, seed, bounces)
    return render_passes(scene)


def render_passes(scene) -> dict[str, np.ndarray]:
    """Renders with the scene's own settings through a temporary multilayer EXR."""
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_position = layer.use_pass_normal = True
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "reference.exr")
        bpy.ops.render.render()
        aspect = scene.render.pixel_aspect_x, scene.render.pixel_aspect_y
        # 5.0 cannot write a multilayer EXR with any other
        scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0
        bpy.data.images["Render Result"].save_render(path, scene=scene)
        scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
        return read_exr(path)


def read_exr(path: str) -> dict[str, np.ndarray]:
    """Passes of the first view layer of a multilayer EXR: one part for all (up to 4.x) or one per
    pass (5.x).
    """
    planes: dict[str, dict[str, np.ndarray]] = {}
    source = oiio.ImageInput.open(path)
    part = 0
    while source.seek_subimage(part, 0):
        spec = source.spec()
        pixels = source.read_image(part, 0, 0, spec.nchannels, oiio.FLOAT)
        for index, name in enumerate(spec.channelnames):
            name, channel = name.rsplit(".", 1)
            planes.setdefault(name.split(".")[-1], {})[channel] = np.flipud(pixels[:, :, index])
        part += 1
    source.close()
    return {name: _stack(channels) for name, channels in planes.items()}


def _stack(channels: dict[str, np.ndarray]) -> np.ndarray:
    """Channels in the order RGBA or XYZW; a single one loses its axis."""
    order = [c for c in "RGBXYZWA" if c in channels] or sorted(channels)
    planes = [channels[c] for c in order]
    return np.ascontiguousarray(planes[0] if len(planes) == 1 else np.stack(planes, -1))
