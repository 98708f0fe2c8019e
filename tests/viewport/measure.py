"""How soon the viewport shows an event, in a real Blender window on a virtual screen, beside Cycles in a window of its own.

    make bench ARGS=viewport          (GLINT_BLENDER names the program, GLINT_BLENDER_ROOT its folder: see packaging/debian_blender.sh)

A 62 k-triangle scene with a sun and a point light, 960 × 540 pixels. Wall time is what a user waits, and what else the machine does is in
it; processor time is the whole program's, on all cores. Nothing here fails for being slow.
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
    "one of 10 000 instances": (0.050, 0.016),
    "one vertex of 1 M triangles": (1.0, 0.250),
    "light color": (0.050, 0.016),
    "material color": (0.050, 0.016),
}
"""Event → seconds that it may take at most, and that are aimed at."""
LIMIT = 1500.0


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
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors; region {SIZE[0]} × {SIZE[1]}\n")
    told = {engine: measured(blender, engine) for engine in ("GLINT", "CYCLES")}
    print_table(told["GLINT"], told["CYCLES"])
    print_histograms(told["GLINT"]["wall"])
    for fact, value in told["GLINT"]["facts"].items():
        print(f"{fact}: {value}")
    print(f"\nload after: {os.getloadavg()[0]:.1f}")
    print_memory(blender)


def measured(blender: Blender, engine: str) -> dict:
    done = host.run_in_window(blender, "measured.py", engine, timeout=LIMIT, size=SIZE)
    assert "ALL STEPS DONE" in done.run.output, done.run.output
    return done.run.answer


def print_table(glint: dict, cycles: dict) -> None:
    """Milliseconds: medians, with the least and the most."""
    print(
        f"{'event':28} {'shown after':>11} {'least':>7} {'most':>7} {'processor':>9} {'Cycles':>8} {'ratio':>6} {'at least':>9} {'aim':>6}"
    )
    for event, seconds in glint["wall"].items():
        median, other = statistics.median(seconds), cycles["wall"].get(event)
        spent = statistics.median(glint["processor"][event])
        ready = f"{1e3 * statistics.median(glint['traced'][event]):7.1f}" if event in glint["traced"] else f"{'':7}"
        beside = f"{1e3 * statistics.median(other):8.1f} {statistics.median(other) / median:6.1f}" if other else f"{'':15}"
        goals = "".join(f" {1e3 * goal:8.0f}" for goal in TARGETS.get(event, ()))
        print(
            f"{event:28} {ready} {1e3 * median:7.1f} {1e3 * min(seconds):7.1f} {1e3 * max(seconds):7.1f} {1e3 * spent:9.1f} {beside}{goals}"
        )


def print_histograms(wall: dict[str, list[float]]) -> None:
    """How many times each event took up to so many milliseconds."""
    edges = [8 * 2**k for k in range(11)]
    print(f"\n{'up to ms':28}" + "".join(f"{edge:6}" for edge in edges))
    for event, seconds in wall.items():
        counts = [sum(low < 1e3 * value <= edge for value in seconds) for low, edge in zip([0, *edges], edges, strict=False)]
        print(f"{event:28}" + "".join(f"{count or '':>6}" for count in counts))
    print()


def print_memory(blender: Blender) -> None:
    """What a view of a million triangles holds beside a final render; a software rasteriser keeps Blender's own buffers there as well."""
    final, view = (_growth(host.run_in_window(blender, "measured_memory.py", job, timeout=LIMIT, size=SIZE)) for job in ("final", "view"))
    print(f"memory of 1 M triangles beyond the file's own: final render {final:.0f} MB, viewport {view:.0f} MB, {view / final:.2f} of it")


def _growth(done: host.WindowRun) -> float:
    """Megabytes: the most after the job began, less what was held then."""
    start = done.run.answer
    before = [held for at, held in done.memory if at <= start]
    return max(held for at, held in done.memory if at > start) - before[-1]


if __name__ == "__main__":
    main()
