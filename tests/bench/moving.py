"""Depth of field, motion blur and frames in a row: Glint's processor time beside Cycles', in one
run.

    python tests/bench/moving.py [--scenes lens motion frames] [--side 160] [--frames 100]

lens, motion: a still life behind a wide aperture, and one that slides and turns, in a sun; at
several numbers of samples the processor time of a whole render, less that of one with a sample
(which is mostly the start), and the mean FLIP to the same engine's picture of 2048 samples; then
the time of Cycles for Glint's FLIP with 64 samples, along the straight line between the logarithms
of its rows. frames: the camera moves over 60 things, with Persistent Data, 480×270, 16 samples;
processor time a frame.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import sys
import time

import stages

TRUTH = 2048
SAMPLES = {"GLINT": (16, 64), "CYCLES": (16, 64, 256)}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = ("lens", "motion", "frames")
    parser.add_argument("--scenes", nargs="+", choices=names, default=names)
    parser.add_argument("--side", type=int, default=160)
    parser.add_argument("--frames", type=int, default=100)
    options = parser.parse_args()
    try:
        stages.require_core()
    except RuntimeError as error:
        print(f"moving.py: {error}", file=sys.stderr)
        return 1
    for name in options.scenes:
        if name == "frames":
            for engine in SAMPLES:
                print(f"frames {engine:6} {seconds_a_frame(engine, options.frames):7.3f} s a frame")
        else:
            compare(name, options.side)
    return 0


def compare(name: str, side: int) -> None:
    import numpy as np

    from glint.engine.analysis import flip

    found = {}
    for engine, numbers in SAMPLES.items():
        scene = made(name, side)
        start = rendered(scene, engine, 1)[1]
        truth, rows = rendered(scene, engine, TRUTH)[0], []
        for samples in numbers:
            picture, seconds = rendered(scene, engine, samples)
            error = float(flip.flip(picture, truth).mean())
            rows.append((max(seconds - start, 1e-3), error))
            print(
                f"{name:6} {engine:6} {samples:4d} samples {rows[-1][0]:7.2f} s  FLIP {error:.4f}"
            )
            sys.stdout.flush()
        found[engine] = np.log(np.array(rows))
    (own, error), cycles = found["GLINT"][-1], found["CYCLES"]
    equal = float(np.exp(np.interp(-error, -cycles[:, 1], cycles[:, 0])))
    print(f"{name:6} Cycles at that FLIP {equal:7.2f} s, {equal / np.exp(own):.1f} times as long")


def made(name: str, side: int):
    import test_cycles_lens as lens
    import test_cycles_motion as motion

    if name == "lens":
        scene = lens.build_scene("perspective")
    else:
        scene = motion.build_scene("slide-turn", "CENTER")
    scene.render.resolution_x = scene.render.resolution_y = side
    return scene


def rendered(scene, engine: str, samples: int):
    """The picture, and seconds of processors."""
    import cycles_reference as cycles

    choose(scene, engine, samples)
    start = time.process_time()
    picture = cycles.render_passes(scene)["Combined"][..., :3]
    return picture, time.process_time() - start


def choose(scene, engine: str, samples: int) -> None:
    """Through the pixels' centres, without bounces."""
    import glint
    from cycles_reference import bpy, make_exact

    make_exact(scene, samples)
    if engine == "GLINT":
        if not hasattr(bpy.types.Scene, "glint"):
            glint.register()
        scene.render.engine, scene.render.filter_size = "GLINT", 0.01
        stages.choose_samples(scene, engine, samples)


def seconds_a_frame(engine: str, frames: int) -> float:
    """Of the later frames of a move of the camera."""
    import numpy as np

    import cycles_reference as cycles
    import small_scenes as build
    from cycles_reference import bpy

    scene = cycles.empty_scene(480, 270)
    rng = np.random.default_rng(2)
    build.add(scene, "ground", build.plane(8, build.lambert((0.5, 0.5, 0.5))))
    ball = build.ball(32, 20, material=build.lambert((0.8, 0.4, 0.2)))
    for number in range(60):
        x, y = rng.uniform(-5, 5, 2)
        build.add(scene, f"ball {number}", ball.copy(), build.moved(x, y, 0.4, 0.4, 0.4, 0.4))
    build.add_light(scene, "SUN", (3.0, -2.0, 4.5), energy=3.0, angle=0.0)
    camera = build.add_camera(scene, (7.0, -8.0, 5.0))
    choose(scene, engine, 16)
    scene.render.use_persistent_data = True
    place, start = camera.location.copy(), 0.0
    for frame in range(frames + 1):
        if frame == 1:  # the first reads everything
            start = time.process_time()
        camera.location.x = place.x - 0.05 * frame
        bpy.ops.render.render()
    return (time.process_time() - start) / frames


if __name__ == "__main__":
    sys.exit(main())
