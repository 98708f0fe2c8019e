"""How soon the viewport shows an event, in a real Blender window on a virtual screen, beside Cycles
in a window of its own.

    make bench ARGS=viewport          (GLINT_BLENDER names the program, GLINT_BLENDER_ROOT its
    folder: see packaging/debian_blender.sh)

A 62 k-triangle scene with a sun and a point light, 960 × 540 pixels. Wall time is what a user
waits, and what else the machine does is in it; processor time is the whole program's, on all cores.
"Blender" is an engine that has every picture ready: what is shown later than there is the tracing's
share. Nothing here fails for being slow.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import os
import statistics
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "packaging"), str(TESTS / "viewport")]

import host  # noqa: E402
from blender_process import Blender  # noqa: E402

SIZE = (960, 540)
TARGETS = {
    "view moved": (1 / 30, 1 / 60),
    "stop to full resolution": (0.150, 0.060),
    "one of 10 000 objects": (0.050, 0.016),
    "one among 10 000 instances": (0.050, 0.016),
    "one vertex of 1 M triangles": (1.0, 0.250),
    "light color": (0.050, 0.016),
    "material color": (0.050, 0.016),
}
"""Event → seconds that it may take at most, and that are aimed at."""
LIMIT = 1500.0
MEMORY_RUNS = 3


def main() -> None:
    if not os.environ.get("GLINT_BLENDER"):
        raise SystemExit("measure: GLINT_BLENDER names no program with a window")
    report(installed())


def installed() -> Blender:
    """A Blender with this tree's zip."""
    import packed

    blender = Blender()
    zip_path = blender.folder / "glint.zip"
    zip_path.write_bytes(packed.pack("full").read_bytes())
    blender.run(packed.INSTALL, "--", blender.inside(zip_path))
    return blender


def report(blender: Blender) -> None:
    print(
        f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors; region {SIZE[0]} × "
        f"{SIZE[1]}\n"
    )
    told = {engine: measured(blender, engine) for engine in ("GLINT", "CYCLES", "CONTROL")}
    print_table(
        told["GLINT"], {"Blender": told["CONTROL"]["wall"], "Cycles": told["CYCLES"]["wall"]}
    )
    print_histograms(told["GLINT"]["wall"])
    for fact, value in told["GLINT"]["facts"].items():
        print(
            f"{fact}: {value}; Cycles {told['CYCLES']['facts'][fact]}; Blender "
            f"{told['CONTROL']['facts'][fact]}"
        )
    print(f"\nload after: {os.getloadavg()[0]:.1f}")
    print_memory(blender)


def measured(blender: Blender, engine: str) -> dict:
    done = host.run_in_window(blender, "measured.py", engine, timeout=LIMIT, size=SIZE)
    assert "ALL STEPS DONE" in done.run.output, done.run.output
    return done.run.answer


def print_table(glint: dict, others: dict[str, dict[str, list[float]]]) -> None:
    """Milliseconds: medians, with the least and the most; of other engines the median, and how many
    times Glint's it is.
    """
    heads = "".join(f" {name:>8} {'ratio':>6}" for name in others)
    print(
        f"{'event':28} {'traced':>7} {'shown':>7} {'least':>7} {'most':>7} {'processor':>9}{heads} "
        f"{'at least':>9} {'aim':>6}"
    )
    for event, seconds in glint["wall"].items():
        median, spent = statistics.median(seconds), statistics.median(glint["processor"][event])
        ready = (
            f"{1e3 * statistics.median(glint['traced'][event]):7.1f}"
            if event in glint["traced"]
            else f"{'':7}"
        )
        beside = "".join(_beside(wall.get(event), median) for wall in others.values())
        goals = "".join(f" {1e3 * goal:8.0f}" for goal in TARGETS.get(event, ()))
        shown = " ".join(f"{1e3 * value:7.1f}" for value in (median, min(seconds), max(seconds)))
        print(f"{event:28} {ready} {shown} {1e3 * spent:9.1f}{beside}{goals}")


def _beside(seconds: list[float] | None, ours: float) -> str:
    """Columns of another engine."""
    if not seconds:
        return f" {'':8} {'':6}"
    median = statistics.median(seconds)
    return f" {1e3 * median:8.1f} {median / ours:6.1f}"


def print_histograms(wall: dict[str, list[float]]) -> None:
    """How many times each event took up to so many milliseconds."""
    edges = [8 * 2**k for k in range(11)]
    print(f"\n{'up to ms':28}" + "".join(f"{edge:6}" for edge in edges))
    for event, seconds in wall.items():
        counts = [
            sum(low < 1e3 * value <= edge for value in seconds)
            for low, edge in zip([0, *edges], edges, strict=False)
        ]
        print(f"{event:28}" + "".join(f"{count or '':>6}" for count in counts))
    print()


def print_memory(blender: Blender) -> None:
    """What a view of a million triangles holds at most, beside a final render, and what Blender
    itself takes for a view: with a software rasteriser, its window's buffers as well. Three runs of
    each, in turn.
    """
    grown = {job: [] for job in ("final", "view", "control")}
    for _ in range(MEMORY_RUNS):
        for job, growths in grown.items():
            growths.append(
                _growth(
                    host.run_in_window(blender, "measured_memory.py", job, timeout=LIMIT, size=SIZE)
                )
            )
    final, view, own = (statistics.median(growths) for growths in grown.values())
    runs = "; ".join(
        f"{job} {', '.join(f'{growth:.0f}' for growth in growths)}"
        for job, growths in grown.items()
    )
    print(
        f"memory of 1 M triangles beyond the file's own: final render {final:.0f} MB, viewport "
        f"{view:.0f} MB, {view / final:.2f} of it"
    )
    print(
        f"Blender's own share of the viewport's: {own:.0f} MB; without it "
        f"{(view - own) / final:.2f} of the final render's (MB: {runs})"
    )


def _growth(done: host.WindowRun) -> float:
    """Megabytes: the most after the job began, less what was held then."""
    start = done.run.answer
    before = [held for at, held in done.memory if at <= start]
    return max(held for at, held in done.memory if at > start) - before[-1]


if __name__ == "__main__":
    main()
