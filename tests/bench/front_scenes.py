"""The scenes of fronts.py, and timed pictures of them by Glint and by Cycles.

Both engines see what is in the file, with the file's own bounces, clamps, depth of field and view
transform; only the picture's size is another, Cycles' pixel filter is Glint's, its number of
samples is fixed (no adaptive sampling), and the demo has no caustics in Cycles.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import made_scenes
import stages
from targets import sources_of_all

DEMO = "demo"
NAMES = (
    DEMO,
    "living_room",
    "occlusion_room",
    "clevr_rubber",
    "area_rect_interior",
    "ToyCar",
    "FlightHelmet",
    "SheenChair",
    "zdm2_level",
    "appleseed_camera_shift",
    "iso_room_ortho",
)
SHORT = 1.0
"""Seconds of processor time, below which a picture is drawn again."""
REPEATS = 3


@dataclass(frozen=True, eq=False)
class Drawn:
    """picture: (h, w, 3) float32, linear, row 0 on top.  seconds: of processor time, of the whole
    render, the least of its repeats.  first_ray: seconds of wall time before the first ray.
    """

    picture: np.ndarray
    seconds: float
    first_ray: float


def open_scene(name: str, width: int):
    """The scene of that name, `width` pixels on its longer side, with a camera and lights where its
    file has none.
    """
    import bpy

    import glint

    glint.register()
    if name == DEMO:
        open_demo()
    elif name in made_scenes.MADE:
        made_scenes.open_made(name)
    else:
        open_file(sources_of_all()[name], width)
    scene = bpy.context.scene
    limit(scene, width)
    forget_between_renders()
    return scene


def open_demo() -> None:
    """Glint's own, at the defaults in place of the samples that it sets."""
    import bpy

    from glint.operators.demo_scene import build_demo_scene

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    build_demo_scene()
    scene = bpy.context.scene
    for setting in scene.glint.final.bl_rna.properties.keys():  # noqa: SIM118
        scene.glint.final.property_unset(setting)
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
    scene.glint.final.reflective_caustics = scene.glint.final.refractive_caustics = "OFF"


def open_file(source: str, width: int) -> None:
    import bpy

    import contact_scene

    maker = contact_scene.load_maker()
    maker.load(source)
    render, scene = bpy.context.scene.render, bpy.context.scene
    if not source.endswith(".blend") or scene.camera is None:
        render.resolution_x = render.resolution_y = width
        render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    maker.ensure()


def limit(scene, width: int) -> None:
    """One view layer, without what works on pictures afterwards, `width` pixels on the longer
    side.
    """
    import bpy

    render = scene.render
    render.use_border = render.use_compositing = render.use_sequencer = False
    render.use_persistent_data = False
    factor = width / max(render.resolution_x, render.resolution_y)
    render.resolution_x, render.resolution_y = (
        max(1, round(side * factor)) for side in (render.resolution_x, render.resolution_y)
    )
    render.resolution_percentage = 100
    for layer in scene.view_layers:
        layer.use = layer == bpy.context.view_layer


def forget_between_renders() -> None:
    """Has every render decode its images, as where a person works: without a window Glint keeps
    them for the next frame, and Cycles does not.
    """
    from glint.addon.render import final

    final._decoded = None


def draw_glint(scene, samples: int | None = None) -> Drawn:
    """With the scene's settings but so many samples; at its defaults without."""
    scene.render.engine = "GLINT"
    if samples is None:
        scene.glint.final.property_unset("samples")
    else:
        scene.glint.final.samples = samples
    return drawn(scene, "GLINT")


def draw_cycles(scene, samples: int, denoised: bool = False, seed: int = 0) -> Drawn:
    """With so many samples, raw or through OpenImageDenoise."""
    choose_cycles(scene, samples, denoised, seed)
    return drawn(scene, "CYCLES")


def draw_once(scene, samples: int, seed: int) -> np.ndarray:
    """Cycles' raw picture alone."""
    import bpy

    choose_cycles(scene, samples, False, seed)
    bpy.ops.render.render()
    return last_picture(scene)


def choose_cycles(scene, samples: int, denoised: bool, seed: int) -> None:
    import bpy

    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, seed
    cycles.use_animated_seed = cycles.use_adaptive_sampling = False
    cycles.time_limit = 0.0
    cycles.use_denoising = denoised
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", scene.render.filter_size
    layer = bpy.context.view_layer
    layer.samples, layer.cycles.use_denoising = 0, True


def drawn(scene, engine: str) -> Drawn:
    """By the scene's present engine; again where it is so short that the clock's grain counts."""
    seconds, first_rays = [], []
    while not seconds or (min(seconds) < SHORT and len(seconds) < REPEATS):
        began = time.process_time()
        _, wall = stages.timed_render(scene, engine)
        seconds.append(time.process_time() - began)
        first_rays.append(wall["sync"] + wall["build"])
    return Drawn(last_picture(scene), min(seconds), min(first_rays))


def last_picture(scene) -> np.ndarray:
    """(h, w, 3) float32 of the last render's Combined, row 0 on top."""
    from glint.operators import pictures

    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        pictures.render_result().save_render(str(path), scene=scene)
        return np.flipud(pictures.read_picture(path)[..., :3]).copy()
