"""One million triangles: Glint's stages beside Cycles', in one run.

    python tests/bench/million.py [--rounds 3] [--triangles 1000000]

A displaced grid, 960×540, one sample per pixel, one shadowing point light, zero bounces, engine by engine in processes of their own
(so that peak memory is each one's own), rounds interleaved, the least of each stage taken.

Cycles' stages end at its own status messages (handler `render_stats`): sync at "Initializing", build (its "Updating …": BVH, normals,
device) at "Sample 0", trace at "Finished". Glint's are those of its own clock; `other` is what a whole render takes beyond them, in
Blender's hands; `write` saves the result as EXR. Memory is the peak resident size during the render above that of the process before
its first render (Linux only).
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "cycles")]
SIZE = (960, 540)
STAGES = ("sync", "build", "trace", "other", "write", "total")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--triangles", type=int, default=1_000_000)
    parser.add_argument("--worker", choices=("GLINT", "CYCLES"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        print("RESULT " + json.dumps(measure(options.worker, options.triangles)))
        return
    results = {"GLINT": [], "CYCLES": []}
    for _ in range(options.rounds):
        for engine, rows in results.items():
            rows.append(run_worker(engine, options.triangles))
    print_table({engine: {key: min(row[key] for row in rows) for key in rows[0]} for engine, rows in results.items()})


def run_worker(engine: str, triangles: int) -> dict[str, float]:
    command = [sys.executable, __file__, "--worker", engine, "--triangles", str(triangles)]
    done = subprocess.run(command, capture_output=True, text=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if done.returncode or not lines:
        raise SystemExit(f"{engine} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return json.loads(lines[-1][7:])


def measure(engine: str, triangles: int) -> dict[str, float]:
    """Seconds per stage and megabytes of one engine, in this process."""
    import bpy

    scene = build_scene(triangles)
    choose_engine(scene, engine)
    bpy.context.evaluated_depsgraph_get()
    before = status_megabytes("VmRSS")
    bpy.ops.render.render()  # warms what is loaded once: libraries, kernels
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts again from here
    total, stages = timed_render(scene, engine)
    peak = status_megabytes("VmHWM")
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        bpy.data.images["Render Result"].save_render(str(Path(folder) / "picture.exr"), scene=scene)
        write = time.perf_counter() - start
    other = total - sum(stages.values())
    return {**stages, "other": other, "write": write, "total": total + write, "megabytes": peak - before}


def timed_render(scene, engine: str) -> tuple[float, dict[str, float]]:
    """Seconds of one whole render, and of its stages."""
    import bpy

    messages = []
    start = time.perf_counter()

    def note(text, *_):
        messages.append((time.perf_counter() - start, str(text)))

    bpy.app.handlers.render_stats.append(note)
    bpy.ops.render.render()
    total = time.perf_counter() - start
    bpy.app.handlers.render_stats.remove(note)
    return total, own_stages(scene) if engine == "GLINT" else cycles_stages(messages)


def cycles_stages(messages: list[tuple[float, str]]) -> dict[str, float]:
    """From the first status that mentions the end of each stage."""
    ends = [next(when for when, text in messages if mark in text) for mark in ("Initializing", "Sample 0", "Finished")]
    return dict(zip(STAGES, [ends[0], ends[1] - ends[0], ends[2] - ends[1]], strict=False))


def build_scene(triangles: int):
    """A wavy grid of quads under one point light."""
    import numpy as np

    import small_scenes as build
    from cycles_reference import bpy, empty_scene

    scene = empty_scene(*SIZE)
    side = round((triangles / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.linspace(-4, 4, side), np.linspace(-4, 4, side), indexing="ij")
    points = np.stack([x, y, 0.35 * np.sin(3 * x) * np.cos(2.5 * y) + 0.03 * np.sin(41 * x + 37 * y)], -1).astype(np.float32)
    row, column = np.meshgrid(np.arange(side - 1), np.arange(side - 1), indexing="ij")
    first = (row * side + column).ravel()
    quads = np.stack([first, first + side, first + side + 1, first + 1], -1).astype(np.int32)
    mesh = bpy.data.meshes.new("Waves")
    mesh.vertices.add(side * side)
    mesh.loops.add(quads.size)
    mesh.polygons.add(len(quads))
    mesh.attributes["position"].data.foreach_set("vector", points.ravel())
    mesh.loops.foreach_set("vertex_index", quads.ravel())
    mesh.polygons.foreach_set("loop_start", np.arange(0, quads.size, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.materials.append(build.lambert((0.7, 0.6, 0.5)))
    build.add(scene, "Waves", mesh)
    build.add_camera(scene, (5.5, -7.0, 5.0), (0.0, 0.0, 0.0))
    build.add_light(scene, "POINT", (2.0, -3.0, 5.0), energy=900.0)
    return scene


def choose_engine(scene, engine: str) -> None:
    """One sample per pixel, no bounces."""
    import cycles_reference

    scene.render.image_settings.file_format = "OPEN_EXR"
    if engine == "CYCLES":
        cycles_reference.make_exact(scene)
        return
    import conftest  # noqa: F401  (makes the package importable as glint)
    from glint import addon

    addon.register()
    scene.render.engine = "GLINT"
    final = scene.glint.final
    final.samples, final.light_samples, final.max_bounces = 1, 1, 0


def own_stages(scene) -> dict[str, float]:
    """Glint's own clock of the last render."""
    from glint.addon import statistics

    seconds = statistics.of_last_render(scene.name).seconds
    return {stage: seconds[stage] for stage in STAGES[:3]}


def status_megabytes(field: str) -> float:
    """VmRSS (now) or VmHWM (peak) of this process."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(field))
    return int(line.split()[1]) / 1024


def print_table(best: dict[str, dict[str, float]]) -> None:
    glint, cycles = best["GLINT"], best["CYCLES"]
    print(f"{'stage':12s} {'Glint':>10s} {'Cycles':>10s}   Cycles / Glint")
    for stage in STAGES:
        print(f"{stage:12s} {glint[stage]:8.3f} s {cycles[stage]:8.3f} s {cycles[stage] / glint[stage]:8.2f}")
    mine, theirs = glint["megabytes"], cycles["megabytes"]
    print(f"{'peak memory':12s} {mine:7.0f} MB {theirs:7.0f} MB {theirs / max(mine, 1):8.2f}")


if __name__ == "__main__":
    main()
