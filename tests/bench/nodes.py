"""Materials of many nodes (tests/cycles/node_scenes.py), Glint beside Cycles: processor time of a
sample.

    python tests/bench/nodes.py [--materials NAME …] [--rounds 2] [--few 4] [--many 36]

Both engines render the same file at 960×540 with one hard sun and no bounces, in turn, a process
each. What a sample costs is the difference between renders of many and of few samples, so that
neither export, compiling of kernels nor saving counts; the least of each over the rounds. The time
is that of all processors together, so that what else the machine does counts less.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import sys
import time
from statistics import median
from typing import Any

from stages import choose_engine, choose_samples, least, require_core, run_worker, timed_render

ENGINES = ("GLINT", "CYCLES")
SIZE = (960, 540)
TARGET = 5.0
"""Cycles' seconds of a sample over Glint's, the least of any material."""


def main() -> int:
    options = parse_arguments()
    if options.worker:
        print("RESULT " + json.dumps(measure(*options.worker, options.few, options.many)))
        return 0
    gains = []
    print(f"{'material':<16}{'Glint ms':>10}{'Cycles ms':>11}{'ratio':>7}")
    for name in options.materials or names():
        times = {engine: seconds(name, engine, options) for engine in ENGINES}
        gains.append(times["CYCLES"] / times["GLINT"])
        row = f"{name:<16}{1e3 * times['GLINT']:>10.1f}{1e3 * times['CYCLES']:>11.1f}"
        print(f"{row}{gains[-1]:>7.1f}", flush=True)
    print(f"least {min(gains):.1f} (target {TARGET:g}), median {median(gains):.1f}")
    return 0


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--materials", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--few", type=int, default=4)
    parser.add_argument("--many", type=int, default=36)
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    return parser.parse_args()


def names() -> list[str]:
    import glint_tree  # noqa: F401  (makes the package importable as glint)
    import node_scenes

    return [build.__name__ for build in (*node_scenes.MATERIALS, *node_scenes.GRAINY)]


def seconds(name: str, engine: str, options: argparse.Namespace) -> float:
    """Of processors, of one sample of the whole frame."""
    counts = ("--few", str(options.few), "--many", str(options.many))
    rows = [run_worker(__file__, *counts, "--worker", name, engine) for _ in range(options.rounds)]
    best = least(rows)
    return (best["many"] - best["few"]) / (options.many - options.few)


def measure(name: str, engine: str, few: int, many: int) -> dict[str, float]:
    """In this process: processor time of a render of few and of many samples."""
    import glint_tree  # noqa: F401  (makes the package importable as glint)
    import node_scenes

    if engine == "GLINT":
        require_core()
    scene = node_scenes.show(getattr(node_scenes, name), *SIZE)
    choose_engine(scene, engine)
    timed_render(scene, engine)  # warms what is loaded once
    times = {}
    for key, samples in (("few", few), ("many", many)):
        choose_samples(scene, engine, samples)
        times[key] = min(processor_time(scene, engine) for _ in range(2))
    return times


def processor_time(scene: Any, engine: str) -> float:
    start = time.process_time()
    timed_render(scene, engine)
    return time.process_time() - start


if __name__ == "__main__":
    sys.exit(main())
