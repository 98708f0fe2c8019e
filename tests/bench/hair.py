"""One million segments of hair: Glint's stages beside Cycles', in one run.

    python tests/bench/hair.py [--rounds 3] [--segments 1000000] [--samples 16]

Straight strands of two segments, 960×540, one shadowing sun of no size, zero bounces; engine by
engine in processes of their own, rounds interleaved, the least of each stage taken. Glint traces as
many samples as Cycles. What the stages are: stages.py.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import sys

from million import print_table
from stages import choose_engine, least, measure, require_core, run_worker

SIZE = (960, 540)
KEYS = 3


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--segments", type=int, default=1_000_000)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--worker", choices=("GLINT", "CYCLES"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    size = ["--segments", str(options.segments), "--samples", str(options.samples)]
    if options.worker:
        scene = build_scene(options.segments)
        choose_engine(scene, options.worker)
        if options.worker == "GLINT":
            scene.glint.final.samples = options.samples
        else:
            scene.cycles.samples = options.samples
            scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 1.5
        print("RESULT " + json.dumps(measure(scene, options.worker)))
        return 0
    results = {"GLINT": [], "CYCLES": []}
    try:
        require_core()
        for _ in range(options.rounds):
            for engine, rows in results.items():
                rows.append(run_worker(__file__, "--worker", engine, *size))
    except RuntimeError as error:
        print(f"hair.py: {error}", file=sys.stderr)
        return 1
    print_table({engine: least(rows) for engine, rows in results.items()})
    return 0


def build_scene(segments: int):
    """A meadow in the sun."""
    import numpy as np

    import small_scenes as build
    from cycles_reference import bpy, empty_scene

    scene = empty_scene(*SIZE)
    count, rng = segments // (KEYS - 1), np.random.default_rng(1)
    root = np.column_stack([rng.uniform(-4, 4, (count, 2)), np.zeros(count)])
    tip = root + rng.normal(0, 0.06, (count, 3)) + (0, 0, 0.3)
    t = np.linspace(0, 1, KEYS)[:, None]
    points = root[:, None] * (1 - t) + tip[:, None] * t
    data = bpy.data.hair_curves.new("Meadow")
    data.add_curves([KEYS] * count)
    data.attributes["position"].data.foreach_set("vector", points.astype(np.float32).ravel())
    data.attributes.new("radius", "FLOAT", "POINT")
    radii = np.tile(np.float32([0.004, 0.003, 0.001]), count)
    data.attributes["radius"].data.foreach_set("value", radii)
    data.materials.append(build.lambert((0.3, 0.6, 0.2)))
    build.add(scene, "Meadow", data)
    build.add_camera(scene, (5.5, -7.0, 4.0), (0.0, 0.0, 0.0))
    build.add_light(scene, "SUN", (2.0, -3.0, 5.0), energy=3.0)
    return scene


if __name__ == "__main__":
    sys.exit(main())
