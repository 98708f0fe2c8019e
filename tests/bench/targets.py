"""Predicted beside true error on the scenes of ../shared/scenes: python tests/bench/targets.py
[NAME …] [--side 128] [--out out/targets]

Every scene with its own materials and, where it has none, a camera and three lights, is rendered
for two targets: a largest visible error on its own display, and a relative RMSE. Told are the
settings that were found, the error that was predicted before, the one that the check afterwards
found, and the true one: the whole picture against the core at 1024 samples, or four times the
picture's where that is more (the core equals the float64 tracer to 1e-4:
tests/engine/test_core_against_reference.py). An error below what a display or a float shows counts
as that. One process per scene, 15 minutes of processor time at most; `targets.md` has the table,
`NAME.json` the numbers.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import csv
import json
import resource
import statistics
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from stages import NoCoreError, require_core

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "cycles")]
SCENES = HERE.parents[2] / "shared" / "scenes"
TARGETS = {"LEVELS": 8.0, "RMSE": 0.03}
NOTHING = {"LEVELS": 0.1, "RMSE": 1e-4}
"""Errors below these are none."""
TRUTH_SAMPLES, TRUTH_MARGIN = 1024, 4
FACTOR = 2.0
SECONDS_ALLOWED = 900


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="folders of ../shared/scenes; all if left out")
    parser.add_argument("--out", type=Path, default=Path("out/targets"))
    parser.add_argument("--side", type=int, default=128, help="pixels of the longer side")
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.inside:
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS_ALLOWED, SECONDS_ALLOWED))
        return measure_scene(options.names[0], options)
    try:
        require_core()
    except NoCoreError as error:
        print(error)
        return 1
    sources = sources_of_all()
    lines = [
        "| scene | target | samples, threshold | predicted | checked | true | predicted / true |",
        "|" + "---|" * 7,
    ]
    print("\n".join(lines), flush=True)
    rows, failed = [], []
    for name in options.names or list(sources):
        if not measured(name, sources[name], options):
            failed.append(name)
            continue
        rows += json.loads((options.out / f"{name}.json").read_text())
        lines += [row_of(row) for row in rows[-len(TARGETS) :]]
        print("\n".join(lines[-len(TARGETS) :]), flush=True)
    lines += ["", *summary(rows)]
    print("\n".join(lines[-len(TARGETS) :]))
    (options.out / "targets.md").write_text("\n".join(lines) + "\n")
    print(*(f"{name}: not measured" for name in failed), sep="\n")
    return int(bool(failed))


def measured(name: str, source: str, options: argparse.Namespace) -> bool:
    """Whether a process of its own could measure the scene in the time allowed; what went wrong is
    on stderr.
    """
    command = [
        sys.executable,
        __file__,
        "--inside",
        source,
        "--out",
        str(options.out),
        "--side",
        str(options.side),
        name,
    ]
    return subprocess.run(command, stdout=subprocess.DEVNULL).returncode == 0


def sources_of_all() -> dict[str, str]:
    """Folder → file, from the manifest."""
    with (SCENES / "MANIFEST.csv").open(newline="") as file:
        return {
            Path(row["file"]).parts[0]: str(SCENES / row["file"]) for row in csv.DictReader(file)
        }


# --- one scene


def measure_scene(name: str, options: argparse.Namespace) -> int:
    import bpy

    import contact_scene
    import glint
    from glint.addon.render.quality_target import display_of
    from glint.operators.compare_cycles import limit_size
    from glint.operators.scene_copy import read_job

    scene = contact_scene.prepare(options.inside)
    glint.register()
    limit_size(scene, options.side)
    job = read_job(scene, bpy.context.view_layer.name)
    settings = replace(job.settings, passes=frozenset())
    rows = [{"scene": name, **row} for row in found_for(job.scene, settings, display_of(scene))]
    (options.out / f"{name}.json").write_text(json.dumps(rows, indent=1))
    return 0


def found_for(scene, settings, display) -> list[dict]:
    """What came of each target: numbers by name."""
    from glint import engine
    from glint.engine.analysis import target

    forecasts = [
        target.choose_settings(scene, settings, target.Target(*wish), display)
        for wish in TARGETS.items()
    ]
    samples = max(
        TRUTH_SAMPLES, *(TRUTH_MARGIN * forecast.settings.samples for forecast in forecasts)
    )
    truth = engine.render(
        scene, replace(forecasts[0].settings, samples=samples, error_threshold=0.0)
    ).combined[..., :3]
    return [row_for(scene, forecast, truth, display) for forecast in forecasts]


def row_for(scene, forecast, truth: np.ndarray, display) -> dict:
    """What came of one target."""
    from glint import engine
    from glint.engine.analysis import target

    film, measure = engine.render(scene, forecast.settings), forecast.target.measure
    chosen = {
        key: asdict(forecast.settings)[key]
        for key in ("samples", "error_threshold", "light_samples")
    }
    return {
        "measure": measure,
        **chosen,
        "predicted": forecast.error,
        "pilot_seconds": forecast.pilot_seconds,
        "reached": target.reached_error(scene, forecast, film),
        "true": target.error_between(measure, film.combined[..., :3], truth, display),
    }


# --- all scenes


def ratio_of(row: dict) -> float:
    """Predicted over true."""
    least = NOTHING[row["measure"]]
    return max(row["predicted"], least) / max(row["true"], least)


def row_of(row: dict) -> str:
    """A line of the table."""
    scale, unit = (1, "levels") if row["measure"] == "LEVELS" else (100, "%")
    numbers = " | ".join(
        f"{scale * row[key]:.2f} {unit}" for key in ("predicted", "reached", "true")
    )
    asked = f"{scale * TARGETS[row['measure']]:g} {unit}"
    return (
        f"| {row['scene']} | {asked} | {row['samples']}, {row['error_threshold']:g} | "
        f"{numbers} "
        f"| {ratio_of(row):.2f} |"
    )


def summary(rows: list[dict]) -> list[str]:
    """A sentence for each measure."""
    sentences = []
    for measure in TARGETS:
        ratios = [ratio_of(row) for row in rows if row["measure"] == measure]
        if not ratios:
            continue
        good = sum(1 / FACTOR <= ratio <= FACTOR for ratio in ratios)
        sentences.append(
            f"{measure}: predicted within a factor of {FACTOR:g} of the true error in {good} of "
            f"{len(ratios)} scenes; "
            f"predicted / true {min(ratios):.2f} to {max(ratios):.2f}, median "
            f"{statistics.median(ratios):.2f}."
        )
    return sentences


if __name__ == "__main__":
    sys.exit(main())
