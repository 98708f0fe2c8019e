"""Whole frames, Glint beside Cycles and beside Blender itself: every scene of ../shared/scenes,
960×540, one light, no bounces, by stage.

    python tests/bench/frames.py [--quick] [--scenes NAME …] [--samples 1 16] [--rounds 2] [--fresh]
    [--out out/frames]

READY is an engine that hands Glint's finished picture over and does nothing else: no engine can be
faster. One process per scene, engine and round, the engines in turn. In each, every number of
samples is rendered again and again for two seconds, once to five times; the least of each stage
counts (stages.py says what the stages are). A scene whose first round took more than a minute gets
no other. All get the same file, camera, samples and one light: the first that renders, as a hard
point light when it is not a sun (a studio light of the shared tools where the file has none). A
finished scene is kept in --out and not measured again unless --fresh.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import csv
import json
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

from ray_tables import table, verdict
from stages import (
    STAGES,
    choose_engine,
    choose_samples,
    least,
    require_core,
    run_worker,
    timed_frame,
)

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"
SIZE = (960, 540)
TRACERS = ("GLINT", "CYCLES")
ENGINES = (*TRACERS, "READY")
TARGETS = {1: 8.0, 16: 20.0}
"""Samples → the least that the median of Cycles / Glint should be; on no scene below 1."""
QUICK = ("living_room", "godot_ball", "clevr_rubber", "SimpleInstancing", "gn_grass")
SECONDS_ALLOWED = 300
SLOW = 60.0
"""Seconds of a round, beyond which there is no other."""
REPEATS = (1, 5)
SECONDS_REPEATED = 2.0


def main() -> int:
    options = parse_arguments()
    if options.worker:
        print("RESULT " + json.dumps(measure_scene(*options.worker, options.samples)))
        return 0
    try:
        require_core()
        scenes = choose_scenes(options)
    except RuntimeError as error:
        print(f"frames.py: {error}", file=sys.stderr)
        return 1
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    results, failed = {}, []
    for name, path in scenes.items():
        try:
            results[name] = saved_or_measured(name, path, out, options)
        except RuntimeError as error:
            failed.append(f"{name}: {error}")
    if results:
        text = "\n\n".join([frames_table(results), medians_table(results), summary_table(results)])
        print("\n" + text)
        (out / "frames.txt").write_text(text + "\n")
    for line in failed:
        print(f"FAILED {line}")
    return int(bool(failed) or not results)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="five scenes, one round")
    parser.add_argument(
        "--scenes", nargs="+", default=[], metavar="NAME", help="folders of ../shared/scenes"
    )
    parser.add_argument("--samples", nargs="+", type=int, default=[1, 16])
    parser.add_argument("--rounds", type=int)
    parser.add_argument(
        "--fresh", action="store_true", help="measure again what an earlier run has saved"
    )
    parser.add_argument("--out", default="out/frames")
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.rounds = options.rounds or (1 if options.quick else 2)
    if options.quick and not options.scenes:
        options.scenes = list(QUICK)
    return options


def choose_scenes(options) -> dict[str, Path]:
    """Name → file, from the manifest."""
    if not SCENES.is_dir():
        raise RuntimeError(
            f"{SCENES} is not there: the bench needs the shared scenes beside this repository"
        )
    with (SCENES / "MANIFEST.csv").open(newline="") as manifest:
        files = {
            row["file"].split("/")[0]: SCENES / row["file"] for row in csv.DictReader(manifest)
        }
    unknown = [name for name in options.scenes if name not in files]
    if unknown:
        raise RuntimeError(f"no scene is called {', '.join(unknown)}")
    return {name: files[name] for name in options.scenes} if options.scenes else files


def saved_or_measured(name: str, path: Path, out: Path, options) -> dict:
    """Samples as text → engine → seconds per stage; RuntimeError with the reason when a process
    failed or took too long.
    """
    saved = out / f"{name}.json"
    wanted = [str(samples) for samples in options.samples]
    known = json.loads(saved.read_text()) if saved.exists() and not options.fresh else {}
    if all(set(ENGINES) <= known.get(samples, {}).keys() for samples in wanted):
        return {samples: known[samples] for samples in wanted}
    rows = {engine: [] for engine in ENGINES}
    start = perf_counter()
    for _ in range(options.rounds):
        for engine in ENGINES:
            worker = ("--samples", *wanted, "--worker", str(path), engine)
            rows[engine].append(run_worker(__file__, *worker, seconds=SECONDS_ALLOWED))
        if perf_counter() - start > SLOW:
            break
    result = {
        samples: {engine: least([row[samples] for row in rows[engine]]) for engine in ENGINES}
        for samples in wanted
    }
    saved.write_text(json.dumps(known | result, indent=1))
    print(
        f"{name}: Cycles / Glint "
        + ", ".join(f"{gain(result[samples]):.1f} at {samples}" for samples in wanted),
        flush=True,
    )
    return result


def measure_scene(source: str, engine: str, samples: list[int]) -> dict[str, dict[str, float]]:
    """In this process: opens the file, leaves one light, renders. Samples as text → seconds per
    stage.
    """
    import bpy

    import contact_scene

    scene = contact_scene.prepare(source)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0
    keep_one_light(scene)
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    choose_engine(scene, engine)
    bpy.context.evaluated_depsgraph_get()
    bpy.ops.render.render()  # warms what is loaded once: libraries, kernels
    return {str(n): least(repeated(scene, engine, n)) for n in samples}


def repeated(scene, engine: str, samples: int) -> list[dict[str, float]]:
    """Seconds per stage, a row a render."""
    choose_samples(scene, engine, samples)
    start, rows = perf_counter(), []
    while len(rows) < REPEATS[0] or (
        len(rows) < REPEATS[1] and perf_counter() - start < SECONDS_REPEATED
    ):
        rows.append(timed_frame(scene, engine))
    return rows


def keep_one_light(scene) -> None:
    """Takes every lamp but one out of the scene, and makes that one hard; the world stays as black
    as one light asks.
    """
    import bpy

    import cycles_reference

    lamps = [
        o for o in scene.objects if o.type == "LIGHT" and not o.hide_render and o.visible_get()
    ]
    if not lamps:
        lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
        scene.collection.objects.link(lamp)
        lamp.location = scene.camera.matrix_world.translation
        lamp.data.energy = 1000.0
        lamps = [lamp]
    for lamp in scene.objects:
        if lamp.type == "LIGHT" and lamp != lamps[0]:
            lamp.hide_render = True
    if lamps[0].data.type != "SUN":
        lamps[0].data.type = "POINT"
        lamps[0].data.shadow_soft_size = 0.0
    else:
        lamps[0].data.angle = 0.0
    cycles_reference.set_world(scene, (0.0, 0.0, 0.0))


def gain(result: dict, without: str | None = None, engine: str = "GLINT") -> float:
    """Seconds of Cycles over those of an engine, with or without a stage."""
    cycles, other = (
        result[name]["total"] - (result[name][without] if without else 0)
        for name in ("CYCLES", engine)
    )
    return cycles / other


def frames_table(results: dict) -> str:
    """Seconds by stage, Glint and Cycles, and those of a ready picture, a row per scene and number
    of samples.
    """
    stages = [f"{stage} {engine[0]}" for stage in STAGES for engine in TRACERS]
    rows = [
        ("scene, samples", *stages, "total R", "Cycles / Glint", "without write", "Cycles / ready")
    ]
    for name, of_samples in results.items():
        for samples, result in of_samples.items():
            seconds = [f"{result[engine][stage]:.3f}" for stage in STAGES for engine in TRACERS] + [
                f"{result['READY']['total']:.3f}"
            ]
            gains = (gain(result), gain(result, "write"), gain(result, engine="READY"))
            rows.append((f"{name}, {samples}", *seconds, *(f"{value:.1f}" for value in gains)))
    return table(rows)


def medians_table(results: dict) -> str:
    """Medians of the seconds of each stage over the scenes, a row per engine and number of
    samples.
    """
    rows = [(f"medians of {len(results)} scenes, samples", *STAGES)]
    for samples in next(iter(results.values())):
        for engine in ENGINES:
            seconds = (
                median(result[samples][engine][stage] for result in results.values())
                for stage in STAGES
            )
            rows.append((f"{engine}, {samples}", *(f"{value:.3f}" for value in seconds)))
    return table(rows)


def summary_table(results: dict) -> str:
    """Median and worst gain per number of samples, beside the targets and what a ready picture
    would reach.
    """
    headings = ("samples", "median", "target", "", "worst", "scene", "floor", "")
    rows = [
        (*headings, "median without write", "ready: median", "without write", "scenes below target")
    ]
    for samples in next(iter(results.values())):
        gains = {name: gain(result[samples]) for name, result in results.items()}
        middle, worst, target = (
            median(gains.values()),
            min(gains, key=gains.get),
            TARGETS.get(int(samples)),
        )
        goal = (f"{target}", verdict(middle, target)) if target else ("-", "-")
        floor = (f"{gains[worst]:.2f}", worst, "1", verdict(gains[worst], 1.0))
        ready = [gain(result[samples], engine="READY") for result in results.values()]
        below = str(sum(value < target for value in ready)) if target else "-"
        unwritten = [
            median(gain(r[samples], "write", engine) for r in results.values())
            for engine in ("GLINT", "READY")
        ]
        rows.append(
            (
                samples,
                f"{middle:.1f}",
                *goal,
                *floor,
                f"{unwritten[0]:.1f}",
                f"{median(ready):.1f}",
                f"{unwritten[1]:.1f}",
                below,
            )
        )
    return table(rows)


if __name__ == "__main__":
    sys.exit(main())
