"""Whole frames, Glint beside Cycles: every scene of ../shared/scenes, 960×540, one light, no bounces, by stage.

    python tests/bench/frames.py [--quick] [--scenes NAME …] [--samples 1 16] [--rounds 3] [--fresh] [--out out/frames]

One process per scene, engine, number of samples and round; rounds interleaved, the least of each stage taken (stages.py says what the
stages are). Both engines get the same file, camera, samples and one light: the first that renders, as a hard point light when it is not
a sun (a studio light of the shared tools where the file has none). A finished scene is kept in --out and not measured again unless --fresh.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import csv
import json
import sys
from pathlib import Path
from statistics import median

from ray_tables import table, verdict
from stages import STAGES, choose_engine, least, measure, require_core, run_worker

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"
SIZE = (960, 540)
ENGINES = ("GLINT", "CYCLES")
TARGETS = {1: 8.0, 16: 20.0}
"""Samples → the least that the median of Cycles / Glint should be; on no scene below 1."""
QUICK = ("living_room", "godot_ball", "clevr_rubber", "SimpleInstancing", "gn_grass")
SECONDS_ALLOWED = 900


def main() -> int:
    options = parse_arguments()
    if options.worker:
        source, engine, samples = options.worker
        print("RESULT " + json.dumps(measure_scene(source, engine, int(samples))))
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
        for samples in options.samples:
            result = saved_or_measured(name, path, samples, out, options)
            if "error" in result:
                failed.append(f"{name}, {samples} samples: {result['error']}")
            else:
                results[name, samples] = result
    if results:
        text = "\n\n".join([frames_table(results), summary_table(results)])
        print("\n" + text)
        (out / "frames.txt").write_text(text + "\n")
    for line in failed:
        print(f"FAILED {line}")
    return int(bool(failed) or not results)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="five scenes, one round")
    parser.add_argument("--scenes", nargs="+", default=[], metavar="NAME", help="folders of ../shared/scenes")
    parser.add_argument("--samples", nargs="+", type=int, default=[1, 16])
    parser.add_argument("--rounds", type=int)
    parser.add_argument("--fresh", action="store_true", help="measure again what an earlier run has saved")
    parser.add_argument("--out", default="out/frames")
    parser.add_argument("--worker", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.rounds = options.rounds or (1 if options.quick else 3)
    if options.quick and not options.scenes:
        options.scenes = list(QUICK)
    return options


def choose_scenes(options) -> dict[str, Path]:
    """Name → file, from the manifest."""
    if not SCENES.is_dir():
        raise RuntimeError(f"{SCENES} is not there: the bench needs the shared scenes beside this repository")
    with (SCENES / "MANIFEST.csv").open(newline="") as manifest:
        files = {row["file"].split("/")[0]: SCENES / row["file"] for row in csv.DictReader(manifest)}
    unknown = [name for name in options.scenes if name not in files]
    if unknown:
        raise RuntimeError(f"no scene is called {', '.join(unknown)}")
    return {name: files[name] for name in options.scenes} if options.scenes else files


def saved_or_measured(name: str, path: Path, samples: int, out: Path, options) -> dict:
    """{"GLINT": stages, "CYCLES": stages}, or {"error": reason}; only complete results are saved."""
    saved = out / f"{name}_{samples}.json"
    if saved.exists() and not options.fresh:
        return json.loads(saved.read_text())
    rows = {engine: [] for engine in ENGINES}
    try:
        for _ in range(options.rounds):
            for engine in ENGINES:
                rows[engine].append(run_worker(__file__, "--worker", str(path), engine, str(samples), seconds=SECONDS_ALLOWED))
    except RuntimeError as error:
        return {"error": str(error)}
    result = {engine: least(rows[engine]) for engine in ENGINES}
    saved.write_text(json.dumps(result, indent=1))
    print(f"{name}, {samples} samples: Cycles / Glint {gain(result):.1f}", flush=True)
    return result


def measure_scene(source: str, engine: str, samples: int) -> dict[str, float]:
    """In this process: opens the file, leaves one light, renders."""
    import contact_scene

    scene = contact_scene.prepare(source)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.pixel_aspect_x = scene.render.pixel_aspect_y = 1.0
    keep_one_light(scene)
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    choose_engine(scene, engine, samples)
    return measure(scene, engine)


def keep_one_light(scene) -> None:
    """Takes every lamp but one out of the scene, and makes that one hard; the world stays as black as one light asks."""
    import bpy

    import cycles_reference

    lamps = [o for o in scene.objects if o.type == "LIGHT" and not o.hide_render and o.visible_get()]
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


def gain(result: dict) -> float:
    return result["CYCLES"]["total"] / result["GLINT"]["total"]


def frames_table(results: dict) -> str:
    """Seconds by stage, Glint and Cycles, a row per scene and number of samples."""
    rows = [("scene, samples", *(f"{stage} {engine[0]}" for stage in STAGES for engine in ENGINES), "Cycles / Glint")]
    for (name, samples), result in results.items():
        seconds = (f"{result[engine][stage]:.3f}" for stage in STAGES for engine in ENGINES)
        rows.append((f"{name}, {samples}", *seconds, f"{gain(result):.1f}"))
    return table(rows)


def summary_table(results: dict) -> str:
    """Median and worst gain per number of samples, beside the issue's targets."""
    rows = [("samples", "median", "target", "", "worst", "scene", "floor", "")]
    for samples in sorted({samples for _, samples in results}):
        gains = {name: gain(result) for (name, s), result in results.items() if s == samples}
        middle, worst, target = median(gains.values()), min(gains, key=gains.get), TARGETS.get(samples)
        goal = (f"{target}", verdict(middle, target)) if target else ("-", "-")
        rows.append((f"{samples}", f"{middle:.1f}", *goal, f"{gains[worst]:.2f}", worst, "1", verdict(gains[worst], 1.0)))
    return table(rows)


if __name__ == "__main__":
    sys.exit(main())
