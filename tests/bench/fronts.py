"""Time to a given error, Glint beside Cycles, on scenes of ../shared/scenes: python tests/bench/fronts.py NAME … [--out out/fronts]

The same light and materials in both: lamps only (a black world), every surface a plain diffuse one, no bounces, the same pixel filter.
Glint's time is that of its rays, Cycles' that of its samples (what the second and later samples take, so that neither sync nor trees
count). Each engine's error is against its own picture at many more samples, and the gap between these two is told: it is no error that
time buys off. One process per scene.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "cycles")]
CYCLES_SAMPLES = (1, 4, 16, 64, 256)
TRUTH_SAMPLES = 1024
GRID = {"samples": [1, 2, 4, 8, 16, 32, 64], "light_samples": [1, 2, 4, 8], "max_bounces": [0]}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="+", help="folders of ../shared/scenes")
    parser.add_argument("--out", type=Path, default=Path("out/fronts"))
    parser.add_argument("--side", type=int, default=128, help="pixels of the longer side")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.inside:
        return measure_scene(options.names[0], options)
    command = [sys.executable, __file__, "--inside", "--out", str(options.out), "--side", str(options.side)]
    return max(subprocess.run([*command, name]).returncode for name in options.names)


def measure_scene(name: str, options: argparse.Namespace) -> int:
    scene = matched_scene(name, options.side)
    from glint.engine import metrics, plot, trade_plot

    glint, glint_truth, reference = glint_front(scene)
    cycles, cycles_truth = cycles_curve(scene)
    gap = metrics.relative_rmse(glint_truth, cycles_truth)
    ratios = [(error, ratio) for seconds, error in glint if (ratio := time_at(cycles, error) / seconds) > 0]
    picture = trade_plot.draw_curves({"Glint": glint, "Cycles": cycles}, name, f"Glint's truth: {reference}; between the truths: {gap:.1%}")
    (options.out / f"{name}.png").write_bytes(plot.png_bytes(picture))
    result = {"scene": name, "glint": glint, "cycles": cycles, "ratios": ratios, "between_truths": gap, "reference": reference}
    (options.out / f"{name}.json").write_text(json.dumps(result, indent=1))
    told = ", ".join(f"{ratio:.0f} at {error:.1e}" for error, ratio in ratios)
    print(f"{name:28s} Cycles takes times as long: {told}; between the truths {gap:.1%}", flush=True)
    return 0


def matched_scene(name: str, side: int):
    """Opens the scene with a camera and lamps, black world, diffuse everywhere."""
    import bpy

    import conftest  # noqa: F401  (makes the package importable as glint)
    import contact_scene
    from glint import addon
    from glint.operators.compare_cycles import limit_size

    folder = contact_scene.SCENES / name
    source = next(path for kind in ("*.blend", "*.glb", "*.gltf") for path in sorted(folder.glob(kind)))
    scene = contact_scene.prepare(str(source))
    addon.register()
    scene.world = bpy.data.worlds.new("Black")
    scene.world.color = (0, 0, 0)
    if scene.world.node_tree:
        scene.world.node_tree.nodes.clear()
    plain = bpy.data.materials.new("Plain")
    if bpy.app.version < (5, 0):
        plain.use_nodes = True
    tree = plain.node_tree
    tree.nodes.clear()
    tree.links.new(tree.nodes.new("ShaderNodeBsdfDiffuse").outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    bpy.context.view_layer.material_override = plain
    limit_size(scene, side)
    return scene


def glint_front(scene) -> tuple[list[tuple[float, float]], np.ndarray, str]:
    """(seconds, error) of Glint's front, its picture at many samples, and what that is."""
    import bpy

    from glint.engine import Settings, render, trade
    from glint.operators.scene_copy import read_job

    job = read_job(scene, bpy.context.view_layer.name)
    width, height = job.scene.camera.resolution
    base = Settings(samples=16, light_samples=4, max_bounces=0, filter_width=job.settings.filter_width, backend=job.settings.backend)
    found = trade.measure(
        job.scene, base, values=GRID, crops=[(0, 0, width, height)], reference_samples=TRUTH_SAMPLES, reference_seconds=0.0, repeats=5
    )
    truth = render(
        job.scene, Settings(samples=TRUTH_SAMPLES, light_samples=4, max_bounces=0, filter_width=base.filter_width, backend=base.backend)
    )
    return [(row.seconds, row.relative_rmse) for row in found.front if row.relative_rmse > 0], truth.combined[..., :3], found.reference


def cycles_curve(scene) -> tuple[list[tuple[float, float]], np.ndarray]:
    """(seconds, error) of Cycles over its samples, and its picture at many."""
    import bpy

    from glint.engine import metrics
    from glint.operators.compare_cycles import match_cycles
    from glint.operators.scene_copy import copied, rendered

    pictures, seconds = {}, {}
    layer = bpy.context.view_layer
    with tempfile.TemporaryDirectory() as folder:
        for samples, seed in (*((n, 0) for n in (*CYCLES_SAMPLES, *CYCLES_SAMPLES)), (TRUTH_SAMPLES, 1)):
            with copied(scene, layer.name, in_focus=True) as copy:
                copy.render.use_persistent_data = False
                match_cycles(copy, samples, 0, seed)
                picture, took = rendered(copy, Path(folder) / "picture.exr")
            pictures[samples] = picture[..., :3]
            seconds[samples] = min(took, seconds.get(samples, math.inf))
    most = max(CYCLES_SAMPLES)
    each = max(seconds[most] - seconds[1], 1e-6) / (most - 1)
    truth = pictures[TRUTH_SAMPLES]
    return [(n * each, metrics.relative_rmse(pictures[n], truth)) for n in CYCLES_SAMPLES], truth


def time_at(curve: list[tuple[float, float]], error: float) -> float:
    """Seconds to an error, by lines between the points in logarithms; not a number beyond the curve's ends."""
    times, errors = (np.log([point[k] for point in curve]) for k in (0, 1))
    if not errors.min() <= math.log(error) <= errors.max():
        return math.nan
    order = np.argsort(errors)
    return float(np.exp(np.interp(math.log(error), errors[order], times[order])))


if __name__ == "__main__":
    sys.exit(main())
