"""What Measure tells of a scene beside its whole frame: python tests/bench/trades.py [NAME …]
[--side 256] [--samples 256] [--coarse]

Every scene of ../shared/scenes, as for targets.py, and Blender's default cube: each point of the
measured front is rendered as a whole and compared with a whole picture of the reference's settings.
Told is the point whose measured relative RMSE is furthest from that, as measured / true; errors
below 1e-4 count as that, and where no square met an error its bound must hold. One process per
scene; `trades.md` has the table.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from stages import NoCoreError, require_core
from targets import HERE, sources_of_all

CUBE = "default cube"
NOTHING = 1e-4
FACTOR = 1.5


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", help="folders of ../shared/scenes, or 'default cube'; all if left out"
    )
    parser.add_argument("--out", type=Path, default=Path("out/trades"))
    parser.add_argument("--side", type=int, default=256, help="pixels of the longer side")
    parser.add_argument("--samples", type=int, default=256, help="of the reference")
    parser.add_argument(
        "--coarse",
        action="store_true",
        help="every other value of each tunable: the default cube takes 50 s at side 256; with all "
        "values it takes 67 s at side 168",
    )
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.inside:
        return measure_scene(options)
    try:
        require_core()
    except NoCoreError as error:
        print(error)
        return 1
    sources = {CUBE: CUBE, **sources_of_all()}
    lines = [
        "| scene | points | settings of the worst | measured | true | measured / true | told "
        "spread | seconds |",
        "|" + "---|" * 8,
    ]
    print("\n".join(lines), flush=True)
    worst = []
    for name in options.names or list(sources):
        command = [
            sys.executable,
            __file__,
            "--inside",
            sources[name],
            "--out",
            str(options.out),
            "--side",
            str(options.side),
            *(["--coarse"] if options.coarse else []),
        ]
        if subprocess.run(
            [*command, "--samples", str(options.samples), name], stdout=subprocess.DEVNULL
        ).returncode:
            print(f"{name}: not measured")
            worst.append(math.inf)
            continue
        rows = json.loads((options.out / f"{name}.json").read_text())
        lines.append(line_of(name, rows))
        worst.append(max(map(factor, rows)))
        print(lines[-1], flush=True)
    good = sum(value <= FACTOR for value in worst)
    lines += [
        "",
        f"Every point of the front is within a factor of {FACTOR:g} in {good} of {len(worst)} "
        "scenes.",
    ]
    print(lines[-1])
    (options.out / "trades.md").write_text("\n".join(lines) + "\n")
    return int(good < len(worst))


def factor(row: dict) -> float:
    if row["bound"]:
        return max(row["true"] / row["bound"], 1.0)
    ratio = max(row["measured"], NOTHING) / max(row["true"], NOTHING)
    return max(ratio, 1 / ratio)


def line_of(name: str, rows: list[dict]) -> str:
    row = max(rows, key=factor)
    tunables = " / ".join(
        value if isinstance(value, str) else f"{value:g}" for value in row["tunables"].values()
    )
    ratio = max(row["measured"], NOTHING) / max(row["true"], NOTHING)
    measured = f"< {row['bound']:.2e}" if row["bound"] else f"{row['measured']:.2e}"
    errors = f"{measured} | {row['true']:.2e} | {ratio:.2f} | {row['spread']:.2f}"
    return f"| {name} | {len(rows)} | {tunables} | {errors} | {row['took']:.0f} |"


def measure_scene(options: argparse.Namespace) -> int:
    sys.path[:0] = [str(HERE.parent), str(HERE.parent / "cycles")]
    import time

    import bpy
    import numpy as np

    import contact_scene
    import glint
    from glint import engine
    from glint.engine.analysis import metrics, trade
    from glint.operators.compare_cycles import limit_size
    from glint.operators.scene_copy import read_job

    if options.inside == CUBE:
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        glint.register()
        scene = bpy.context.scene
    else:
        scene = contact_scene.prepare(options.inside)
        glint.register()
    scene.render.engine = "GLINT"
    limit_size(scene, options.side)
    job = read_job(scene, bpy.context.view_layer.name)
    values = (
        {tunable.name: tunable.values[::2] for tunable in trade.TUNABLES} if options.coarse else {}
    )
    began = time.perf_counter()
    found = trade.measure(
        job.scene,
        job.settings,
        values=values,
        reference_samples=options.samples,
        reference_seconds=0.0,
        repeats=1,
    )
    took = time.perf_counter() - began
    plain = replace(job.settings, passes=frozenset())
    grid = trade.settings_grid(job.scene, plain, values)
    reference = trade.reference_settings(job.scene, plain, grid, options.samples)
    truth = engine.render(job.scene, reference).combined[..., :3]
    rows = []
    for row in found.front:
        picture = engine.render(job.scene, replace(plain, **row.tunables)).combined[..., :3]
        true = metrics.relative_rmse(picture, truth)
        rows.append(
            {
                "tunables": row.tunables,
                "measured": row.relative_rmse,
                "true": true,
                "spread": row.spread,
                "bound": row.bound,
                "took": took,
            }
        )
    (options.out / f"{options.names[0]}.json").write_text(
        json.dumps(rows, indent=1, default=lambda value: np.asarray(value).tolist())
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
