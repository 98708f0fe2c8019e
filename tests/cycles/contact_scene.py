"""Worker of contact_sheet.py: renders one file with Glint and with Cycles, each in linear float32,
and writes EXRs.

    python contact_scene.py SOURCE OUT_STEM {GLINT|CYCLES} BOUNCES

Both see direct light only (after BOUNCES mirror reflections and refractions), the same pixel
filter, no depth of field, no motion blur, no compositor; 256 pixels on the longer side.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
SCENES = HERE.parents[2] / "shared" / "scenes"
LONG_SIDE = 256
CYCLES_SAMPLES = 64
sys.path[:0] = [str(HERE), str(HERE.parent)]


def load_maker():
    """The module that opens any file and adds a camera and lights where missing."""
    spec = importlib.util.spec_from_file_location("make_blend", SCENES / "make_blend.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def prepare(source: str):
    """Opens the file and sets everything that both engines share; returns the scene."""
    import bpy

    maker = load_maker()
    maker.load(source)
    scene = bpy.context.scene
    render = scene.render
    if not source.endswith(".blend") or scene.camera is None:
        render.resolution_x = render.resolution_y = LONG_SIDE
        render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    maker.ensure()
    factor = LONG_SIDE / max(render.resolution_x, render.resolution_y)
    render.resolution_x, render.resolution_y = (
        max(1, round(side * factor)) for side in (render.resolution_x, render.resolution_y)
    )
    render.resolution_percentage = 100
    render.use_border = render.use_compositing = render.use_sequencer = render.use_motion_blur = (
        render.use_freestyle
    ) = False
    scene.camera.data.dof.use_dof = False
    for layer in scene.view_layers:
        layer.use = layer == bpy.context.view_layer
    return scene


def set_cycles(scene, bounces: int) -> None:
    from glint.operators.compare_cycles import match_cycles

    match_cycles(scene, CYCLES_SAMPLES, bounces)


def set_glint(scene, bounces: int) -> None:
    import glint

    glint.register()
    scene.render.engine = "GLINT"
    settings = scene.glint.final
    settings.samples, settings.light_samples, settings.error_threshold = 16, 4, 0.0
    settings.max_bounces, settings.diffuse_bounces = bounces, 0


def main() -> None:
    import glint_tree  # noqa: F401  (makes the package importable as glint)

    source, stem, engine, bounces = sys.argv[1:]
    scene = prepare(source)
    {"GLINT": set_glint, "CYCLES": set_cycles}[engine](scene, int(bounces))
    import cycles_reference

    start = time.perf_counter()
    picture = cycles_reference.render_passes(scene)["Combined"]
    seconds = time.perf_counter() - start
    np.save(f"{stem}_{engine.lower()}.npy", picture)
    Path(f"{stem}_{engine.lower()}.json").write_text(
        json.dumps({"seconds": round(seconds, 2), "finite": bool(np.isfinite(picture).all())})
    )


if __name__ == "__main__":
    main()
