"""The contact sheet: every scene of ../shared/scenes as Glint | Cycles, 64 samples, direct light
only | difference × 4.

    python tests/cycles/contact_sheet.py [--core12] [--only NAME …] [--bounces 0] [--reuse-cycles]
    [--out out]

Writes out/contact_sheet.png, out/contact/<scene>.png, out/contact.json and out/contact.csv, and
ends with exit code 1 if a scene fails or holds a non-finite pixel. One process per scene and
engine. RMSE and "% off" are those of the displayed values: sRGB of clipped linear colour, 0 to 1.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import glint_tree  # noqa: E402, F401  (makes the package importable as glint)
from glint.engine.analysis import comparison, metrics, plot  # noqa: E402
from glint.engine.analysis.flip import displayed  # noqa: E402

SCENES = HERE.parents[2] / "shared" / "scenes"
CELL, COLUMNS = 256, 2
SECONDS_ALLOWED = 600


@dataclass
class Row:
    """One scene's outcome. rmse, off_percent: displayed values; linear_rmse: relative to Cycles'
    mean; flip: the mean of LDR-FLIP. error: "" when all went well.
    """

    scene: str
    rmse: float = float("nan")
    off_percent: float = float("nan")
    linear_rmse: float = float("nan")
    flip: float = float("nan")
    glint_mean: float = float("nan")
    cycles_mean: float = float("nan")
    glint_seconds: float = float("nan")
    cycles_seconds: float = float("nan")
    notes: str = ""
    error: str = ""


def main() -> int:
    options = parse_arguments()
    scenes = choose_scenes(options)
    folder = Path(options.out) / "contact"
    folder.mkdir(parents=True, exist_ok=True)
    rows, strips = [], []
    for number, (name, path) in enumerate(scenes, 1):
        row, strip = render_scene(name, path, folder, options)
        rows.append(row)
        strips.append(strip)
        print(
            f"{number:2d}/{len(scenes)} {name:28s} RMSE {row.rmse:.4f}  off {row.off_percent:5.1f} "
            f"%  {row.error}",
            flush=True,
        )
    write_png(Path(options.out) / "contact_sheet.png", arrange(strips))
    write_numbers(Path(options.out), rows)
    return summarise(rows, Path(options.out))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--core12", action="store_true", help="the quick dozen")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="folders of ../shared/scenes"
    )
    parser.add_argument(
        "--bounces",
        type=int,
        default=0,
        help="mirror reflections and refractions before the direct light, in both",
    )
    parser.add_argument(
        "--reuse-cycles", action="store_true", help="keep the Cycles pictures of an earlier run"
    )
    parser.add_argument("--out", default="out")
    return parser.parse_args()


def choose_scenes(options) -> list[tuple[str, Path]]:
    """(name, path) from the manifest."""
    if not SCENES.is_dir():
        raise SystemExit(
            f"{SCENES} is not there: the contact sheet needs the shared scenes beside this "
            "repository"
        )
    with (SCENES / "MANIFEST.csv").open(newline="") as table:
        entries = list(csv.DictReader(table))
    chosen = [e["file"] for e in entries if not options.core12 or e["core12"] == "yes"]
    if options.only:
        chosen = [f for f in chosen if f.split("/")[0] in options.only]
    if not chosen:
        raise SystemExit(f"no scene is called {', '.join(options.only)}")
    return [(file.split("/")[0], SCENES / file) for file in chosen]


def render_scene(name: str, path: Path, folder: Path, options) -> tuple[Row, np.ndarray]:
    """Both renders, the numbers, and the strip of three pictures."""
    row, stem, pictures = Row(name), folder / name, {}
    for engine in ("GLINT", "CYCLES"):
        saved = folder / f"{name}_{engine.lower()}.npy"
        if not (engine == "CYCLES" and options.reuse_cycles and saved.exists()):
            saved.unlink(missing_ok=True)
            run_worker(row, path, stem, engine, options.bounces)
        if saved.exists():
            pictures[engine] = np.load(saved)
            report = json.loads(saved.with_suffix(".json").read_text())
            setattr(row, f"{engine.lower()}_seconds", report["seconds"])
            row.error += "" if report["finite"] else f"{engine}: non-finite pixels; "
    if len(pictures) == 2:
        measure(row, pictures["GLINT"], pictures["CYCLES"])
    strip = draw_strip(row, pictures.get("GLINT"), pictures.get("CYCLES"))
    write_png(folder / f"{name}.png", strip)
    return row, strip


def run_worker(row: Row, path: Path, stem: Path, engine: str, bounces: int) -> None:
    """Renders in a process of its own; its log goes beside the picture, its failure into the
    row.
    """
    command = [
        sys.executable,
        str(HERE / "contact_scene.py"),
        str(path),
        str(stem),
        engine,
        str(bounces),
    ]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS_ALLOWED)
    except subprocess.TimeoutExpired:
        row.error += f"{engine}: more than {SECONDS_ALLOWED} s; "
        return
    log = done.stdout + done.stderr
    Path(f"{stem}_{engine.lower()}.log").write_text(log)
    if engine == "GLINT":
        row.notes = " / ".join(
            dict.fromkeys(
                line.split("Warning: ", 1)[1] for line in log.splitlines() if "Warning: " in line
            )
        )
    if done.returncode:
        lines = [line for line in log.splitlines() if line.strip()] or ["no message"]
        row.error += f"{engine}: exit code {done.returncode}: {lines[-1][:200]}; "


def measure(row: Row, glint: np.ndarray, cycles: np.ndarray) -> None:
    if glint.shape != cycles.shape:
        row.error += f"sizes differ: {glint.shape} and {cycles.shape}; "
        return
    numbers = comparison.compare(glint, cycles)
    row.rmse, row.off_percent, row.flip = numbers.rmse, 100 * numbers.off, numbers.flip_mean
    row.glint_mean, row.cycles_mean = numbers.mean, numbers.reference_mean
    row.linear_rmse = metrics.rmse(glint[..., :3], cycles[..., :3]) / max(row.cycles_mean, 1e-9)


def draw_strip(row: Row, glint: np.ndarray | None, cycles: np.ndarray | None) -> np.ndarray:
    """Three cells and a line of text, (h, w, 3), row 0 on top."""
    both = glint is not None and cycles is not None and glint.shape == cycles.shape
    pictures = [displayed(p) if p is not None else None for p in (glint, cycles)]
    pictures.append(comparison.difference_picture(glint, cycles) if both else None)
    numbers = f"RMSE {row.rmse:.4f}   off > 1 %: {row.off_percent:.1f} %   FLIP {row.flip:.3f}"
    numbers += f"   mean {row.glint_mean:.3f} | {row.cycles_mean:.3f}"
    color = (1.0, 0.4, 0.3) if row.error else (0.9, 0.9, 0.9)
    return comparison.draw_strip(pictures, (row.scene, row.error or numbers), (CELL, CELL), color)


def arrange(strips: list[np.ndarray]) -> np.ndarray:
    """The strips in COLUMNS columns."""
    blank = np.full_like(strips[0], 0.08)
    columns = min(COLUMNS, len(strips))
    strips = strips + [blank] * (-len(strips) % columns)
    return np.concatenate(
        [np.concatenate(strips[k : k + columns], 1) for k in range(0, len(strips), columns)], 0
    )


def write_png(path: Path, image: np.ndarray) -> None:
    path.write_bytes(plot.png_bytes(image))


def write_numbers(out: Path, rows: list[Row]) -> None:
    records = [asdict(row) for row in rows]
    (out / "contact.json").write_text(json.dumps(records, indent=1))
    with (out / "contact.csv").open("w", newline="") as table:
        writer = csv.DictWriter(table, list(records[0]))
        writer.writeheader()
        writer.writerows(records)


def summarise(rows: list[Row], out: Path) -> int:
    """Tells the outcome; 1 if anything failed."""
    failed = [row for row in rows if row.error]
    good = [row for row in rows if not row.error]
    if good:
        rmse, off = np.median([(row.rmse, row.off_percent) for row in good], axis=0)
        print(f"{len(good)} scenes: median RMSE {rmse:.4f}, median off {off:.1f} %")
    for row in failed:
        print(f"FAILED {row.scene}: {row.error}")
    print(f"see {out / 'contact_sheet.png'} and {out / 'contact.csv'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
