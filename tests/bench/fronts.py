"""Time to a given error, Glint beside Cycles, on scenes of ../shared/scenes: python
tests/bench/fronts.py NAME[:hard] … [--out out/fronts]

The same light and materials in both: lamps only (a black world), every surface a plain diffuse one,
no bounces, the same pixel filter. Seconds are processor time on one thread, so that what else the
machine does counts little: Glint's of a whole render on trees that are there, Cycles' of what the
second and later samples take, so that neither sync nor trees count. Each engine's error is against
its own picture at four times its most samples, and the gap between these two is told: it is no
error that time buys off. One process per scene; `fronts.png` has all scenes, `fronts.md` the table,
and `--keep-cycles` takes Cycles' points and picture of an earlier run of the same size.
`--only-plot` draws from the numbers that are there.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import stages  # noqa: F401  (makes the package importable as glint)

GRID = [
    (1, 0.0),
    (4, 0.0),
    *((samples, threshold) for samples in (16, 64, 256) for threshold in (16.0, 4.0, 0.0)),
]
"""Samples and error threshold of Glint's renders."""
LIGHT_SAMPLES = 2
TRUTH_SAMPLES = 4 * 256
REPEATS = 2
EQUAL = (4, 16, 64, 256)
"""Samples at which both engines' errors are compared."""
LEVELS = (0.3, 0.1, 0.03, 0.01, 0.003)
"""Errors at which both engines' times are compared."""


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="+", help="folders of ../shared/scenes; NAME:hard makes the lights points"
    )
    parser.add_argument("--out", type=Path, default=Path("out/fronts"))
    parser.add_argument("--side", type=int, default=128, help="pixels of the longer side")
    parser.add_argument(
        "--most", type=int, default=256, help="most samples of Cycles, a power of four from 256 on"
    )
    parser.add_argument(
        "--keep-cycles",
        action="store_true",
        help="measure Glint alone where Cycles was measured before",
    )
    parser.add_argument("--only-plot", action="store_true", help="measure nothing")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.inside:
        return measure_scene(options.names[0], options)
    command = [
        sys.executable,
        __file__,
        "--inside",
        "--out",
        str(options.out),
        "--side",
        str(options.side),
        "--most",
        str(options.most),
    ]
    command += ["--keep-cycles"] * options.keep_cycles
    code = (
        0
        if options.only_plot
        else max(subprocess.run([*command, name]).returncode for name in options.names)
    )
    write_all(
        [json.loads((options.out / f"{name}.json").read_text()) for name in options.names],
        options.out,
    )
    return code


# --- one scene


def measure_scene(name: str, options: argparse.Namespace) -> int:
    scene = matched_scene(name, options.side)
    from glint.engine.analysis import metrics

    cycles, cycles_truth = kept_cycles_points(scene, options.out / f"{name}.cycles.npz", options)
    glint, glint_truth, is_soft = glint_points(scene)
    result = {
        "scene": name,
        "soft": is_soft,
        "glint": glint,
        "cycles": cycles,
        "between_truths": metrics.relative_rmse(glint_truth, cycles_truth),
    }
    (options.out / f"{name}.json").write_text(json.dumps(result, indent=1))
    print(row_of(result), flush=True)
    return 0


def matched_scene(name: str, side: int):
    """Opens the scene with a camera and lamps, black world, diffuse everywhere."""
    import bpy

    import contact_scene
    import glint
    from glint.operators.compare_cycles import limit_size

    name, _, wish = name.partition(":")
    folder = contact_scene.SCENES / name
    source = next(
        path for kind in ("*.blend", "*.glb", "*.gltf") for path in sorted(folder.glob(kind))
    )
    scene = contact_scene.prepare(str(source))
    glint.register()
    if wish == "hard":
        harden(bpy.data.lights)
    scene.world = bpy.data.worlds.new("Black")
    scene.world.color = (0, 0, 0)
    if scene.world.node_tree:
        scene.world.node_tree.nodes.clear()
    plain = bpy.data.materials.new("Plain")
    if bpy.app.version < (5, 0):
        plain.use_nodes = True
    tree = plain.node_tree
    tree.nodes.clear()
    tree.links.new(
        tree.nodes.new("ShaderNodeBsdfDiffuse").outputs[0],
        tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"],
    )
    bpy.context.view_layer.material_override = plain
    limit_size(scene, side)
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    return scene


def harden(lights) -> None:
    """Lights without an extent."""
    for light in lights:
        if light.type == "AREA":
            light.type = "POINT"
        light.shadow_soft_size = 0.0
        if light.type == "SUN":
            light.angle = 0.0


def glint_points(scene) -> tuple[list[dict], np.ndarray, bool]:
    """A point (samples, threshold, seconds, error) for each of the grid, the picture at many
    samples, whether lights are soft.
    """
    import bpy

    from glint.engine import Settings
    from glint.engine.analysis import metrics
    from glint.engine.analysis.trade_crops import CropRenderer
    from glint.engine.analysis.trade_tunables import has_soft_lights
    from glint.operators.scene_copy import read_job

    job = read_job(scene, bpy.context.view_layer.name)
    base = replace(
        Settings(light_samples=LIGHT_SAMPLES, max_bounces=0, threads=1),
        filter_width=job.settings.filter_width,
    )
    points = {}
    with CropRenderer(job.scene, ((0, 0, *job.scene.camera.resolution),), lambda: False) as frame:
        truth = frame.render(
            replace(base, samples=TRUTH_SAMPLES, light_samples=2 * LIGHT_SAMPLES)
        ).pictures[0]
        for samples, threshold in GRID * REPEATS:
            began = time.process_time()
            picture = frame.render(
                replace(base, samples=samples, error_threshold=threshold)
            ).pictures[0]
            seconds = min(
                time.process_time() - began,
                points.get((samples, threshold), {"seconds": math.inf})["seconds"],
            )
            error = metrics.relative_rmse(picture, truth)
            points[samples, threshold] = {
                "samples": samples,
                "threshold": threshold,
                "seconds": seconds,
                "error": error,
            }
    return list(points.values()), truth, has_soft_lights(job.scene, base)


def kept_cycles_points(
    scene, path: Path, options: argparse.Namespace
) -> tuple[list[dict], np.ndarray]:
    """`cycles_points`, kept in a file."""
    if not (options.keep_cycles and path.exists()):
        points, truth = cycles_points(scene, options.most)
        np.savez(path, points=json.dumps(points), truth=truth)
    with np.load(path) as kept:
        return json.loads(str(kept["points"])), kept["truth"]


def cycles_points(scene, most: int) -> tuple[list[dict], np.ndarray]:
    """A point (samples, seconds, error) for each power of four up to `most`, and the picture at
    four times as many.
    """
    import bpy

    from glint.engine.analysis import metrics
    from glint.operators.compare_cycles import match_cycles
    from glint.operators.scene_copy import copied, rendered

    numbers = [4**k for k in range(1 + round(math.log(most, 4)))]
    pictures, seconds = {}, {}
    layer = bpy.context.view_layer
    with tempfile.TemporaryDirectory() as folder:
        for samples, seed in ((1, 0), *((n, 0) for n in numbers), (4 * most, 1)):
            with copied(scene, layer.name, in_focus=True) as copy:
                copy.render.use_persistent_data = False
                match_cycles(copy, samples, 0, seed)
                began = time.process_time()
                picture, _ = rendered(copy, Path(folder) / "picture.exr")
            pictures[samples], seconds[samples] = picture[..., :3], time.process_time() - began
    each = max(seconds[4 * most] - seconds[1], 1e-6) / (4 * most - 1)
    truth = pictures[4 * most]
    return [
        {"samples": n, "seconds": n * each, "error": metrics.relative_rmse(pictures[n], truth)}
        for n in numbers
    ], truth


# --- all scenes


def front(points: list[dict]) -> list[tuple[float, float]]:
    """(seconds, error) that no other point beats, the fastest first."""
    kept, least = [], math.inf
    for seconds, error in sorted((point["seconds"], point["error"]) for point in points):
        if error < least:
            kept.append((seconds, error))
            least = error
    return kept


def time_at(curve: list[tuple[float, float]], error: float) -> float:
    """Seconds to an error, by lines between the points in logarithms; not a number beyond the
    curve's ends.
    """
    times, errors = (np.log([point[k] for point in curve]) for k in (0, 1))
    if not errors.min() <= math.log(error) <= errors.max():
        return math.nan
    order = np.argsort(errors)
    return float(np.exp(np.interp(math.log(error), errors[order], times[order])))


def gains(result: dict) -> list[float]:
    """How many times as long Cycles takes for the error of each point of Glint's front that its
    curve reaches.
    """
    cycles = front(result["cycles"])
    ratios = [
        time_at(cycles, error) / seconds for seconds, error in front(result["glint"]) if error > 0
    ]
    return [ratio for ratio in ratios if ratio > 0]


def gains_at_levels(result: dict) -> list[float]:
    """How many times as long Cycles takes to each of LEVELS, by lines between the points of both;
    not a number beyond a curve's ends.
    """
    glint, cycles = front(result["glint"]), front(result["cycles"])
    return [time_at(cycles, error) / time_at(glint, error) for error in LEVELS]


def ratios_at_equal_samples(result: dict) -> dict[int, float]:
    """Samples → Glint's error over Cycles'."""
    glint = {
        point["samples"]: point["error"] for point in result["glint"] if point["threshold"] == 0
    }
    cycles = {point["samples"]: point["error"] for point in result["cycles"]}
    return {n: glint[n] / cycles[n] for n in EQUAL}


def row_of(result: dict) -> str:
    """A line of the table."""
    found = gains(result) or [math.nan]
    equal = " / ".join(f"{ratio:.2f}" for ratio in ratios_at_equal_samples(result).values())
    levels = " / ".join(
        "–" if math.isnan(gain) else f"{gain:.3g}" for gain in gains_at_levels(result)
    )
    kind = "soft" if result["soft"] else "hard"
    middle = statistics.median(found)
    least_most = f"{middle:.1f} | {min(found):.1f} | {max(found):.1f}"
    return (
        f"| {result['scene']} | {kind} | {least_most} | {levels} | {equal} | "
        f"{result['between_truths']:.1%} |"
    )


def write_all(results: list[dict], out: Path) -> None:
    """fronts.md and fronts.png."""
    from glint.engine.analysis import plot, trade_plot

    at = ", ".join(f"{error:.1%}".replace(".0%", "%") for error in LEVELS)
    heads = [
        "scene",
        "lights",
        "gain: median",
        "least",
        "most",
        f"gain at errors of {at}",
        "error at equal samples over Cycles'",
        "between the truths",
    ]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads), *map(row_of, results)]
    good = sum(max(ratios_at_equal_samples(result).values()) <= 1 for result in results)
    lines += [
        "",
        f"At equal samples ({', '.join(map(str, EQUAL))}) Glint's error is at most Cycles' in "
        f"{good} of {len(results)} scenes.",
    ]
    (out / "fronts.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    pictures = [
        trade_plot.draw_curves(
            {"Glint": front(result["glint"]), "Cycles": front(result["cycles"])},
            result["scene"],
            f"{'soft' if result['soft'] else 'hard'} lights; seconds of processor time; between "
            f"the truths {result['between_truths']:.1%}",
        )
        for result in results
    ]
    pictures += [np.zeros_like(pictures[0])] * (len(pictures) % 2)
    rows = [np.concatenate(pictures[k : k + 2], 1) for k in range(0, len(pictures), 2)]
    (out / "fronts.png").write_bytes(plot.png_bytes(np.concatenate(rows)))


if __name__ == "__main__":
    sys.exit(main())
