"""Error over time at the defaults, Glint beside Cycles raw and denoised, all light.

    python tests/bench/fronts.py [--scenes NAME …] [--width 320] [--samples 64]
    [--truth-seconds 90] [--only-table] [--out out/fronts]

Eleven scenes: ten of ../shared/scenes and Glint's demo (front_scenes.py says how they are opened);
by name also ten that are made here (made_scenes.py).
Glint draws each with what a user has who changes nothing, and with 1, 4, 16 … samples; Cycles with
1, 2, 4 … up to --samples, raw and through OpenImageDenoise, and with more until it reaches the
error of Glint's defaults or takes SLOWEST times as long. Seconds are processor time of whole
renders, export and denoising included; before the first ray they are of the wall's clock, the least
of all pictures. Error is the mean FLIP of clipped linear colours after the sRGB curve, and once
more after the file's view transform, against Cycles with other seeds, whose two halves of the
samples are compared: they are drawn until they differ by a third of the error of Glint's defaults,
or for --truth-seconds of processor time. Told is the least time in which Cycles, raw or denoised,
reaches the error of Glint's defaults, by lines between its points in logarithms, over the time of
these.

In --out: fronts.md, fronts.png, for each scene NAME.json and three pictures as PNG (Glint's
defaults, Cycles where it first errs no more, the truth), and truths in truth/, which later runs of
the same width use. One process a scene.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

import front_curves
import front_scenes
import front_truth
import made_scenes
import stages

SECONDS_ALLOWED = 3600
SLOWEST = 4.0
"""Of Glint's time, beyond which Cycles draws no more samples than asked for."""
MOST_SAMPLES = 4096


def main() -> int:
    options = parse_arguments()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.worker:
        result = measure_scene(options.worker, options)
        (options.out / f"{options.worker}.json").write_text(json.dumps(result, indent=1))
        print("RESULT " + json.dumps(result))
        return 0
    try:
        stages.require_core()
    except stages.NoCoreError as error:
        print(f"fronts.py: {error}", file=sys.stderr)
        return 1
    failed = [] if options.only_table else measure_all(options)
    paths = [options.out / f"{name}.json" for name in options.scenes]
    write_all([json.loads(path.read_text()) for path in paths if path.exists()], options.out)
    print(*(f"FAILED {line}" for line in failed), sep="\n")
    return int(bool(failed))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names, made = front_scenes.NAMES, tuple(made_scenes.MADE)
    choices = (*names, *made)
    parser.add_argument("--scenes", nargs="+", choices=choices, default=names, metavar="NAME")
    parser.add_argument("--width", type=int, default=320, help="pixels of the longer side")
    parser.add_argument("--samples", type=int, default=64, help="most samples of both ladders")
    parser.add_argument(
        "--truth-seconds", type=float, default=90.0, help="processor time of each truth, at most"
    )
    parser.add_argument("--only-table", action="store_true", help="measure nothing")
    parser.add_argument("--out", type=Path, default=Path("out/fronts"))
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    return parser.parse_args()


def measure_all(options: argparse.Namespace) -> list[str]:
    """Each scene in a process of its own; what went wrong."""
    failed = []
    for name in options.scenes:
        worker = ["--worker", name, "--out", str(options.out), "--width", str(options.width)]
        worker += ["--samples", str(options.samples)]
        worker += ["--truth-seconds", str(options.truth_seconds)]
        try:
            result = stages.run_worker(__file__, *worker, seconds=SECONDS_ALLOWED)
        except RuntimeError as error:
            failed.append(f"{name}: {error}")
            continue
        print(front_curves.row_of(result), flush=True)
    return failed


# --- one scene


class Front:
    """The timed pictures of one scene, and their errors once there is a truth."""

    def __init__(self, name: str, options: argparse.Namespace) -> None:
        self.scene = front_scenes.open_scene(name, options.width)
        self.drawn: dict[str, dict[int, front_scenes.Drawn]] = {}
        self.measures = measures_of(self.scene)

    def draw(self, kind: str, samples: int) -> None:
        """What is not drawn yet. kind: glint, cycles or denoised."""
        if samples in self.drawn.setdefault(kind, {}):
            return
        if kind == "glint":
            picture = front_scenes.draw_glint(self.scene, samples)
        else:
            picture = front_scenes.draw_cycles(self.scene, samples, denoised=kind == "denoised")
        self.drawn[kind][samples] = picture

    def points(self, kind: str, truth: np.ndarray) -> list[dict]:
        return [self.point(n, drawn, truth) for n, drawn in sorted(self.drawn[kind].items())]

    def point(self, samples: int, drawn: front_scenes.Drawn, truth: np.ndarray) -> dict:
        errors = {name: error(drawn.picture, truth) for name, error in self.measures.items()}
        timed = {"seconds": drawn.seconds, "first_ray": drawn.first_ray}
        return {"samples": samples, **timed, **errors}

    def seconds_of_sample(self) -> float:
        """What Cycles takes for each sample after the first."""
        raw = self.drawn["cycles"]
        most = max(raw)
        return (raw[most].seconds - raw[1].seconds) / max(most - 1, 1)


def measure_scene(name: str, options: argparse.Namespace) -> dict:
    """The scene's result (front_curves.py); its pictures are written."""
    front = Front(name, options)
    warm_up(front.scene)
    default = front_scenes.draw_glint(front.scene)
    samples = front.scene.glint.final.samples
    front.drawn["glint"] = {samples: default}
    for number in ladder(options.samples, 4):
        front.draw("glint", number)
    for number in ladder(options.samples, 2):
        for kind in front_curves.KINDS:
            front.draw(kind, number)
    truth = truth_for(name, front, default, options)
    point = front.point(samples, default, truth.picture)
    draw_on(front, point, truth.picture)
    result = {
        "scene": name,
        "size": [default.picture.shape[1], default.picture.shape[0]],
        "default": point,
        **{kind: front.points(kind, truth.picture) for kind in front.drawn},
        "truth": {"samples": truth.samples, "noise": truth.noise(front.measures["flip"])},
    }
    write_pictures(options.out, result, front, default, truth)
    return result


def measures_of(scene) -> dict[str, front_truth.Measure]:
    """`front_curves.MEASURES`, mean FLIP each."""
    from glint.addon.render.quality_target import display_of
    from glint.engine.analysis import flip
    from glint.engine.raster import linear_from_srgb

    display = display_of(scene)

    def shown(picture: np.ndarray) -> np.ndarray:
        return linear_from_srgb(display(picture))

    return {
        "flip": lambda picture, truth: float(flip.flip(picture, truth).mean()),
        "shown": lambda picture, truth: float(flip.flip(shown(picture), shown(truth)).mean()),
    }


def warm_up(scene) -> None:
    """What is loaded once: libraries, kernels, the denoiser's network."""
    front_scenes.draw_glint(scene, 1)
    for denoised in (False, True):
        front_scenes.draw_cycles(scene, 1, denoised)


def ladder(most: int, factor: int) -> list[int]:
    """Powers of `factor` up to `most`."""
    return [factor**k for k in range(most.bit_length()) if factor**k <= most]


def truth_for(
    name: str, front: Front, default: front_scenes.Drawn, options: argparse.Namespace
) -> front_truth.Truth:
    error, part = front.measures["flip"], front_curves.PART_OF_ERROR
    return front_truth.truth_of(
        options.out / "truth",
        f"{name}_{options.width}",
        lambda samples, seed: front_scenes.draw_once(front.scene, samples, seed),
        front_truth.rounds_within(options.truth_seconds, front.seconds_of_sample()),
        lambda truth: truth.noise(error) <= part * error(default.picture, truth.picture),
    )


def draw_on(front: Front, default: dict, truth: np.ndarray) -> None:
    """More samples of Cycles, until one way reaches the error of Glint's defaults."""
    samples, error = max(front.drawn["cycles"]), default["flip"]
    while samples < MOST_SAMPLES:
        points = [point for kind in front_curves.KINDS for point in front.points(kind, truth)]
        last = front.drawn["cycles"][samples].seconds
        if min(p["flip"] for p in points) <= error or last > SLOWEST * default["seconds"] / 2:
            return
        samples *= 2
        for kind in front_curves.KINDS:
            front.draw(kind, samples)


def write_pictures(
    out: Path, result: dict, front: Front, default: front_scenes.Drawn, truth: front_truth.Truth
) -> None:
    """NAME_glint.png, NAME_cycles.png and NAME_truth.png, after the sRGB curve."""
    from glint.engine.analysis import flip, plot

    pictures = {
        "glint": default.picture,
        "cycles": front.drawn[kind := front_curves.best_of_cycles(result).kind][
            reaching_samples(result, kind)
        ].picture,
        "truth": truth.picture,
    }
    for name, picture in pictures.items():
        path = out / f"{result['scene']}_{name}.png"
        path.write_bytes(plot.png_bytes(flip.displayed(picture)))


def reaching_samples(result: dict, kind: str) -> int:
    """The fewest of Cycles' samples that err no more than Glint's defaults, its most where none
    do.
    """
    error = result["default"]["flip"]
    found = [point["samples"] for point in result[kind] if point["flip"] <= error]
    return min(found, default=max(point["samples"] for point in result[kind]))


# --- all scenes


def write_all(results: list[dict], out: Path) -> None:
    """fronts.md and fronts.png."""
    if not results:
        return
    from glint.engine.analysis import plot, trade_plot

    text = front_curves.table(results)
    print("\n" + text)
    points = [front_curves.points_table(result) for result in results]
    (out / "fronts.md").write_text("\n\n".join([text, *points]) + "\n")
    pictures = [
        trade_plot.draw_curves(
            {
                "Glint": front_curves.front(result["glint"]),
                "Cycles": front_curves.front(result["cycles"]),
                "denoised": front_curves.front(result["denoised"]),
                "defaults": [(result["default"]["seconds"], result["default"]["flip"])],
            },
            result["scene"],
            f"between the halves of the truth {result['truth']['noise']:.4f}",
            "FLIP",
        )
        for result in results
    ]
    pictures += [np.zeros_like(pictures[0])] * (len(pictures) % 2)
    rows = [np.concatenate(pictures[k : k + 2], 1) for k in range(0, len(pictures), 2)]
    (out / "fronts.png").write_bytes(plot.png_bytes(np.concatenate(rows)))


if __name__ == "__main__":
    sys.exit(main())
