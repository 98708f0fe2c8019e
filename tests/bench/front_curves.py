"""Fronts of error over time, the time of one engine to another's error, and the table of fronts.py.
Nothing here draws or measures.

A result is what fronts.py keeps of a scene: {"scene", "size", "default", "glint", "cycles",
"denoised", "truth"}; `default` and each row of `glint`, `cycles` and `denoised`
is a point {"samples", "seconds", "flip", "shown", "first_ray"}, `flip` and `shown` errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median

import numpy as np

MEASURES = ("flip", "shown")
"""FLIP after the sRGB curve over clipped colours, and after the file's own view transform."""
KINDS = {"cycles": "raw", "denoised": "denoised"}
SIGNS = {"": "", "<": "≤ ", ">": "≥ "}

PART_OF_ERROR = 1 / 3
"""Of the error of Glint's defaults, that the truth's halves should differ by at most."""
NOISY = "* more than a third of the FLIP of Glint's defaults: this truth wants more time."

Curve = list[tuple[float, float]]


@dataclass(frozen=True)
class Reached:
    """seconds: to an error.  sign: "<" where the fastest picture of all errs less already, ">"
    where none errs as little.  kind: of KINDS.
    """

    seconds: float
    sign: str
    kind: str

    def text(self, digits: str = ".2f", over: float = 1.0) -> str:
        return f"{SIGNS[self.sign]}{self.seconds / over:{digits}}"


def front(points: list[dict], measure: str = "flip") -> Curve:
    """(seconds, error) that no other point beats, the fastest first."""
    kept, least = [], math.inf
    for seconds, error in sorted((point["seconds"], point[measure]) for point in points):
        if error < least:
            kept.append((seconds, error))
            least = error
    return kept


def time_to(error: float, curve: Curve) -> tuple[float, str]:
    """Seconds to an error and `Reached.sign`, by lines between the points in logarithms; at an end
    of the curve that point's seconds.
    """
    times, errors = zip(*curve, strict=True)
    if error >= errors[0]:
        return times[0], "<" if error > errors[0] else ""
    if error < errors[-1]:
        return times[-1], ">"
    logarithms = np.log(errors[::-1]), np.log(times[::-1])
    return float(np.exp(np.interp(math.log(error), *logarithms))), ""


def best_of_cycles(result: dict, measure: str = "flip") -> Reached:
    """Cycles' least time to the error of Glint's defaults, raw or denoised."""
    error = result["default"][measure]
    found = [Reached(*time_to(error, front(result[kind], measure)), kind) for kind in KINDS]
    return min(found, key=lambda reached: (reached.sign == ">", reached.seconds))


def gain(result: dict, measure: str = "flip") -> float:
    """Cycles' time over that of Glint's defaults."""
    return best_of_cycles(result, measure).seconds / result["default"]["seconds"]


def first_ray(result: dict, kind: str) -> float:
    """Seconds of the wall's clock before the first ray, the least of all pictures of a kind."""
    return min(point["first_ray"] for point in result[kind])


def table(results: list[dict]) -> str:
    """In Markdown: a row a scene, and the medians."""
    heads = (
        "scene",
        "Glint's defaults: s",
        "FLIP",
        "Cycles to that, s",
        "how",
        "Cycles / Glint",
        "view transform: FLIP",
        "Cycles / Glint",
        "before the first ray, s: Glint",
        "Cycles",
        "truth: samples",
        "FLIP between its halves",
    )
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    lines += [*map(row_of, results), median_row(results)]
    return "\n".join([*lines, "", NOISY] if any(map(is_noisy, results)) else lines)


def is_noisy(result: dict) -> bool:
    """Whether the halves of the truth differ by more than they should."""
    return result["truth"]["noise"] > PART_OF_ERROR * result["default"]["flip"]


def row_of(result: dict) -> str:
    """A line of the table."""
    default, truth = result["default"], result["truth"]
    flat, shown = (best_of_cycles(result, measure) for measure in MEASURES)
    cells = (
        f"{result['scene']}, {result['size'][0]} × {result['size'][1]}",
        f"{default['seconds']:.2f}",
        f"{default['flip']:.4f}",
        flat.text(),
        KINDS[flat.kind],
        flat.text(over=default["seconds"]),
        f"{default['shown']:.4f}",
        shown.text(over=default["seconds"]),
        f"{first_ray(result, 'glint'):.2f}",
        f"{first_ray(result, 'cycles'):.2f}",
        f"{truth['samples']}",
        f"{truth['noise']:.4f}" + " *" * is_noisy(result),
    )
    return "| " + " | ".join(cells) + " |"


def median_row(results: list[dict]) -> str:
    """Medians, and the least gains."""

    def middle(value) -> float:
        return median(map(value, results))

    gains = []
    for measure in MEASURES:
        least = min(gain(result, measure) for result in results)
        gains.append(f"{middle(lambda r, m=measure: gain(r, m)):.2f}, least {least:.2f}")
    cells = (
        f"median of {len(results)}",
        f"{middle(lambda r: r['default']['seconds']):.2f}",
        f"{middle(lambda r: r['default']['flip']):.4f}",
        f"{middle(lambda r: best_of_cycles(r).seconds):.2f}",
        "",
        gains[0],
        f"{middle(lambda r: r['default']['shown']):.4f}",
        gains[1],
        f"{middle(lambda r: first_ray(r, 'glint')):.2f}",
        f"{middle(lambda r: first_ray(r, 'cycles')):.2f}",
        "",
        f"{middle(lambda r: r['truth']['noise']):.4f}",
    )
    return "| " + " | ".join(cells) + " |"


def points_table(result: dict) -> str:
    """Every point of a scene, in Markdown."""
    lines = [f"{result['scene']}", "", "| | samples | s | FLIP | view transform: FLIP |"]
    lines.append("|" + "---|" * 5)
    rows = [("Glint", point) for point in result["glint"]] + [("**defaults**", result["default"])]
    rows += [(f"Cycles, {how}", point) for kind, how in KINDS.items() for point in result[kind]]
    lines += [
        f"| {name} | {point['samples']} | {point['seconds']:.2f} | {point['flip']:.4f} "
        f"| {point['shown']:.4f} |"
        for name, point in rows
    ]
    return "\n".join(lines)
