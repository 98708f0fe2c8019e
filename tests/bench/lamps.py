"""Many lamps: Glint's and Cycles' processor time and error with ever more of them.

    python tests/bench/lamps.py [--lamps 20 200 1000] [--size 128] [--shadows 16] [--out out/lamps]

A floor with 60 boxes under a grid of point lamps of one power together, matt, direct light alone.
Each engine's error is the relative RMSE against its own truth (Glint's with a shadow ray to each
lamp); times are of whole renders by processor, the least of three. Pictures are kept as PNG.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from stages import NoCoreError, choose_engine, require_core

COUNTS = {"GLINT": (1, 4, 16, 64), "CYCLES": (1, 4, 16, 64, 256)}
TRUTH = {"GLINT": 256, "CYCLES": 1024}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lamps", nargs="+", type=int, default=[20, 200, 1000])
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--shadows", type=int, default=16)
    parser.add_argument("--out", type=Path, default=Path("out/lamps"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        require_core()
    except NoCoreError as error:
        print(error)
        return 1
    print("| lamps | engine | samples | s | relative RMSE |\n|---|---|---|---|---|", flush=True)
    for lamps in options.lamps:
        for engine, counts in COUNTS.items():
            measure(make_scene(lamps, options.size), lamps, engine, counts, options)
    return 0


def make_scene(lamps: int, size: int):
    """The scene, of the same places in every process."""
    import cycles_reference as cycles
    import small_scenes as small
    from cycles_reference import bpy

    scene, random = cycles.empty_scene(size, size), np.random.default_rng(3)
    matt = small.lambert((0.7, 0.6, 0.5))
    floor = mesh_of(
        bpy, "floor", [(-12, -12, 0), (12, -12, 0), (12, 12, 0), (-12, 12, 0)], [(0, 1, 2, 3)]
    )
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    box = mesh_of(bpy, "box", corners, faces)
    for mesh in (floor, box):
        mesh.materials.append(matt)
    small.add(scene, "floor", floor)
    for k in range(60):
        x, y = random.uniform(-8, 8, 2)
        s = random.uniform(0.15, 0.6)
        small.add(scene, f"box {k}", box, small.moved(x, y, 0.5, s, s, s))
    side = int(np.ceil(np.sqrt(lamps)))
    for k in range(lamps):
        data = bpy.data.lights.new(f"lamp {k}", "POINT")
        data.energy, data.shadow_soft_size = 6000 / lamps, 0.0
        x, y = (
            (i + 0.5) / side * 20 - 10 + random.uniform(-0.3, 0.3) for i in (k % side, k // side)
        )
        small.add(scene, f"lamp {k}", data, small.moved(x, y, random.uniform(2.5, 3.5)))
    camera = bpy.data.cameras.new("camera")
    scene.camera = small.add(scene, "camera", camera, small.looking_at((0, -11, 8.7), (0, 0, 0)))
    return scene


def mesh_of(bpy, name: str, corners: list, faces: list):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    return mesh


def measure(scene, lamps: int, engine: str, counts: tuple[int, ...], options) -> None:
    """Prints a row for each number of samples."""
    choose_engine(scene, engine, 1)
    prepare(scene, engine, TRUTH[engine], 0)
    truth, _ = rendered(scene)
    keep(truth, options.out / f"{engine}_{lamps}_truth.png")
    size = np.sqrt((truth**2).mean())
    for samples in counts:
        prepare(scene, engine, samples, options.shadows)
        pictures = [rendered(scene) for _ in range(3)]
        picture, seconds = pictures[0][0], min(seconds for _, seconds in pictures)
        keep(picture, options.out / f"{engine}_{lamps}_{samples}.png")
        error = np.sqrt(((picture - truth) ** 2).mean()) / size
        print(f"| {lamps} | {engine} | {samples} | {seconds:.3f} | {error:.4f} |", flush=True)


def prepare(scene, engine: str, samples: int, shadows: int) -> None:
    """Direct light, all samples to all pixels."""
    if engine == "GLINT":
        final = scene.glint.final
        final.samples, final.error_threshold, final.lamp_shadows = samples, 0, shadows
        final.diffuse_bounces = 0
        return
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.max_bounces, cycles.use_light_tree = 0, True


def rendered(scene) -> tuple[np.ndarray, float]:
    """(h, w, 3) linear colours, and the processor's seconds."""
    import bpy

    import cycles_reference as cycles

    start = time.process_time()
    bpy.ops.render.render()
    seconds = time.process_time() - start
    image = bpy.data.images["Render Result"]
    scene.render.image_settings.file_format = "OPEN_EXR"
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "picture.exr")
        image.save_render(path, scene=scene)
        source = cycles.oiio.ImageInput.open(path)
        pixels = source.read_image(cycles.oiio.FLOAT)
        source.close()
    return np.asarray(pixels, np.float64)[..., :3], seconds


def keep(picture: np.ndarray, path: Path) -> None:
    """As PNG, through the sRGB curve."""
    import cycles_reference as cycles

    x = np.clip(picture, 0, 1)
    x = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    height, width = x.shape[:2]
    spec = cycles.oiio.ImageSpec(width, height, 3, "uint8")
    output = cycles.oiio.ImageOutput.create(str(path))
    output.open(str(path), spec)
    output.write_image(np.ascontiguousarray((x * 255 + 0.5).astype(np.uint8)))
    output.close()


if __name__ == "__main__":
    sys.exit(main())
