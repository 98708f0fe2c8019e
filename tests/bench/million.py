"""One million triangles: Glint's stages beside Cycles', in one run.

    python tests/bench/million.py [--rounds 3] [--triangles 1000000]

A displaced grid, 960×540, one sample per pixel, one shadowing point light, zero bounces, engine by
engine in processes of their own (so that peak memory is each one's own), rounds interleaved, the
least of each stage taken. What the stages are: stages.py.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import sys

from stages import STAGES, choose_engine, least, measure, require_core, run_worker

SIZE = (960, 540)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--triangles", type=int, default=1_000_000)
    parser.add_argument("--worker", choices=("GLINT", "CYCLES"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        scene = build_scene(options.triangles)
        choose_engine(scene, options.worker)
        print("RESULT " + json.dumps(measure(scene, options.worker)))
        return 0
    results = {"GLINT": [], "CYCLES": []}
    try:
        require_core()
        for _ in range(options.rounds):
            for engine, rows in results.items():
                rows.append(
                    run_worker(__file__, "--worker", engine, "--triangles", str(options.triangles))
                )
    except RuntimeError as error:
        print(f"million.py: {error}", file=sys.stderr)
        return 1
    print_table({engine: least(rows) for engine, rows in results.items()})
    return 0


def build_scene(triangles: int):
    """A wavy grid of quads under one point light."""
    import numpy as np

    import small_scenes as build
    from cycles_reference import bpy, empty_scene

    scene = empty_scene(*SIZE)
    side = round((triangles / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.linspace(-4, 4, side), np.linspace(-4, 4, side), indexing="ij")
    points = np.stack(
        [x, y, 0.35 * np.sin(3 * x) * np.cos(2.5 * y) + 0.03 * np.sin(41 * x + 37 * y)], -1
    ).astype(np.float32)
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


def print_table(best: dict[str, dict[str, float]]) -> None:
    glint, cycles = best["GLINT"], best["CYCLES"]
    print(f"{'stage':12s} {'Glint':>10s} {'Cycles':>10s}   Cycles / Glint")
    for stage in STAGES:
        print(
            f"{stage:12s} {glint[stage]:8.3f} s {cycles[stage]:8.3f} s "
            f"{cycles[stage] / glint[stage]:8.2f}"
        )
    mine, theirs = glint["megabytes"], cycles["megabytes"]
    print(f"{'peak memory':12s} {mine:7.0f} MB {theirs:7.0f} MB {theirs / max(mine, 1):8.2f}")


if __name__ == "__main__":
    sys.exit(main())
