"""Diffuse bounces beside Cycles' full light at equal time, on every scene of ../shared/scenes.

    python tests/bench/full_light.py [NAME …] [--bounces 0 1 2 4] [--truth 1024]
    [--sets 4x2 4x4] [--side 256] [--out out/full_light]

Truth is Cycles with the bounces that Blender sets (12, 4 of them diffuse), without denoising. Told
is the mean FLIP against it: Glint's default settings with each number of diffuse bounces, and
Cycles with as many samples as take the processor time of Glint with four bounces (at least one
sample), each on 256 pixels' longer side unless --side says another. With --sets Glint takes so many
samples of so many light samples each, with four bounces, and Cycles 64 samples. NAME may be cornell
or corridor (rooms.py). One process per scene; pictures are kept as PNG in --out, Glint's, Cycles'
and the truth beside each other.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from statistics import mean, median

import numpy as np

from stages import NoCoreError, require_core
from targets import HERE, sources_of_all

EQUAL_TO = DEFAULT_BOUNCES = 4
"""Diffuse bounces of the picture whose time Cycles gets, and of both engines' defaults."""
BESIDE_SETS = 64
"""Cycles' samples beside Glint's of --sets."""
SECONDS_ALLOWED = 1200


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="folders of ../shared/scenes; all if left out")
    parser.add_argument("--bounces", nargs="+", type=int, default=[0, 1, 2, EQUAL_TO])
    parser.add_argument("--sets", nargs="*", default=[], help="samples x light samples: 4x2 …")
    parser.add_argument("--side", type=int, default=256, help="pixels of the longer side")
    parser.add_argument("--truth", type=int, default=1024, help="samples of Cycles' truth")
    parser.add_argument("--out", type=Path, default=Path("out/full_light"))
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        require_core()
    except NoCoreError as error:
        print(error)
        return 1
    if options.inside:
        print("RESULT " + json.dumps(measure_scene(options)))
        return 0
    sources, rows = {**sources_of_all(), "cornell": "", "corridor": ""}, []
    numbers = options.sets or [f"{n}" for n in options.bounces]
    print("| scene | " + " | ".join(f"FLIP, {n}" for n in numbers) + " | FLIP, Cycles | "
          + " | ".join(f"s, {n}" for n in numbers) + " | s, Cycles | its samples |")  # fmt: skip
    print("|" + "---|" * (2 * len(numbers) + 4), flush=True)
    for name in options.names or list(sources_of_all()):
        row = row_of(name, sources[name], options)
        if row is None:
            continue
        rows.append(row)
        print(f"| {name} | " + cells(row, numbers), flush=True)
    if rows:
        for title, value in (("mean", mean), ("median", median)):
            flips = {n: value(row["flip"][n] for row in rows) for n in (*numbers, "CYCLES")}
            seconds = {n: value(row["seconds"][n] for row in rows) for n in (*numbers, "CYCLES")}
            count = value(row["samples"] for row in rows)
            row = {"flip": flips, "seconds": seconds, "samples": round(count)}
            print(f"| {title} | " + cells(row, numbers))
    return int(not rows)


def cells(row: dict, numbers: list[str]) -> str:
    flips = [f"{row['flip'][n]:.3f}" for n in (*numbers, "CYCLES")]
    seconds = [f"{row['seconds'][n]:.2f}" for n in (*numbers, "CYCLES")]
    return " | ".join([*flips, *seconds, str(row["samples"])]) + " |"


def row_of(name: str, source: str, options: argparse.Namespace) -> dict | None:
    """What the scene's own process tells; None, said, where it failed."""
    command = [sys.executable, __file__, name, "--inside", source or name]
    command += ["--truth", str(options.truth), "--out", str(options.out)]
    command += ["--side", str(options.side)]
    command += ["--bounces", *map(str, options.bounces), "--sets", *options.sets]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS_ALLOWED)
    except subprocess.TimeoutExpired:
        print(f"FAILED {name}: more than {SECONDS_ALLOWED} s")
        return None
    found = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if not found:
        print(f"FAILED {name}: {(done.stderr or done.stdout).strip()[-300:]}")
        return None
    return json.loads(found[-1][len("RESULT ") :])


def measure_scene(options: argparse.Namespace) -> dict:
    sys.path[:0] = [str(HERE.parent), str(HERE.parent / "cycles")]
    import contact_scene
    import glint
    import rooms

    glint.register()
    pictures, seconds = {}, {}
    contact_scene.LONG_SIDE = options.side
    if options.inside in rooms.ROOMS:
        scene = rooms.ROOMS[options.inside](options.side)
    else:
        scene = contact_scene.prepare(options.inside)
    if options.sets:
        pictures["CYCLES"], seconds["CYCLES"] = timed_cycles(scene, BESIDE_SETS)
        for each in options.sets:
            set_glint(scene, DEFAULT_BOUNCES)
            settings = scene.glint.final
            settings.samples, settings.light_samples = map(int, each.split("x"))
            pictures[each], seconds[each] = timed(scene)
        return compared(scene, pictures, seconds, BESIDE_SETS, options)
    few = [timed_cycles(scene, samples)[1] for samples in (1, 9)]
    each = max(few[1] - few[0], 1e-6) / 8.0
    once = max(few[0] - each, 0.0)
    for bounces in options.bounces:
        pictures[str(bounces)], seconds[str(bounces)] = timed_glint(scene, bounces)
    allowed = seconds[str(EQUAL_TO)] if EQUAL_TO in options.bounces else max(seconds.values())
    samples = max(1, round((allowed - once) / each))
    pictures["CYCLES"], seconds["CYCLES"] = timed_cycles(scene, samples)
    return compared(scene, pictures, seconds, samples, options)


def compared(scene, pictures: dict, seconds: dict, samples: int, options) -> dict:
    from glint.engine.analysis import flip

    truth, _ = timed_cycles(scene, options.truth, seed=1)
    write_beside(options.out / f"{options.names[0]}.png", [*pictures.values(), truth])
    flips = {n: float(np.mean(flip.flip(picture, truth))) for n, picture in pictures.items()}
    return {"flip": flips, "seconds": seconds, "samples": samples}


def timed_glint(scene, bounces: int) -> tuple[np.ndarray, float]:
    set_glint(scene, bounces)
    return timed(scene)


def set_glint(scene, bounces: int) -> None:
    scene.render.engine = "GLINT"
    scene.glint.final.diffuse_bounces = bounces


def timed_cycles(scene, samples: int, seed: int = 0) -> tuple[np.ndarray, float]:
    set_cycles(scene, samples, seed)
    return timed(scene)


def set_cycles(scene, samples: int, seed: int) -> None:
    """Cycles with Blender's own numbers of bounces, Glint's pixel filter and no denoising."""
    from glint.operators.compare_cycles import match_cycles

    match_cycles(scene, samples, 4, seed, 4)
    settings = scene.cycles
    for name in ("max_bounces", "transmission_bounces", "transparent_max_bounces"):
        settings.property_unset(name)
    settings.sample_clamp_direct = settings.sample_clamp_indirect = 0.0
    settings.caustics_reflective = settings.caustics_refractive = False


def timed(scene) -> tuple[np.ndarray, float]:
    import cycles_reference

    began = time.process_time()
    picture = cycles_reference.render_passes(scene)["Combined"]
    return np.asarray(picture)[..., :3], time.process_time() - began


def write_beside(path: Path, pictures: list[np.ndarray]) -> None:
    import contact_sheet
    from glint.engine.analysis import flip

    contact_sheet.write_png(path, flip.displayed(np.concatenate(pictures, axis=1)[::-1]))


if __name__ == "__main__":
    sys.exit(main())
