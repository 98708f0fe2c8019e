"""Pictures for the page on accuracy: a part of the demo scene at several samples, thresholds
and targets, and the plot of Tune Settings.

    python tests/cycles/accuracy_pictures.py [samples threshold target plot]

Writes docs/manual/pictures/accuracy_*.jpg and prints what the page says of them.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
import glint_tree  # noqa: E402, F401  (makes the package importable as glint)
from gallery import PICTURES, write_jpeg  # noqa: E402

WIDTH, HEIGHT = 640, 360
REGION = (350, 40, 470, 130)
"""Where soft shadows, edges and mirrors meet."""
ENLARGED = 2


def main() -> int:
    import bpy

    import glint
    from glint.engine.settings import OFFERED
    from glint.operators.demo_scene import build_demo_scene
    from glint.operators.scene_copy import read_job

    glint.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    build_demo_scene()
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    job = read_job(scene, bpy.context.view_layer.name)
    base = replace(job.settings, region=REGION, light_samples=OFFERED.light_samples)
    PICTURES.mkdir(parents=True, exist_ok=True)
    truth = draw(job.scene, replace(base, samples=1024, error_threshold=0.0))[0]
    steps = {"samples": by_samples, "threshold": by_threshold, "target": by_target}
    for name in sys.argv[1:] or (*steps, "plot"):
        if name == "plot":
            plot(job.scene, replace(job.settings, samples=64))
        else:
            steps[name](job.scene, base, truth)
    return 0


def draw(scene, settings) -> tuple[np.ndarray, np.ndarray]:
    """(h, w, 3) linear, and how many samples each pixel took, (h, w)."""
    from glint import engine

    film = engine.render(scene, replace(settings, passes=frozenset({"Samples"})))
    return film.combined[..., :3], film.passes["Samples"][..., 0]


def by_samples(scene, base, truth) -> None:
    found = [(n, replace(base, samples=n, error_threshold=0.0)) for n in (1, 4, 16, 64)]
    rows = [(f"Samples {n}", draw(scene, settings)[0]) for n, settings in found]
    save("samples", rows, truth)


def by_threshold(scene, base, truth) -> None:
    rows, shares = [], []
    for threshold in (16.0, 4.0, 1.0, 0.0):
        picture, taken = draw(scene, replace(base, samples=64, error_threshold=threshold))
        rows.append((f"Threshold {threshold:g}: {taken.mean():.0f} samples", picture))
        shares.append(("", np.repeat(taken[..., None] / 64, 3, 2) ** 2.2))
    save("threshold", rows, truth, shares)


def by_target(scene, base, truth) -> None:
    from glint.engine.analysis.target import Target, choose_settings

    rows = []
    for levels in (32.0, 16.0, 8.0):
        chosen = choose_settings(scene, base, Target("LEVELS", levels)).settings
        picture, taken = draw(scene, chosen)
        threshold = chosen.error_threshold
        print(f"target {levels:g} levels: Samples {chosen.samples}, Threshold {threshold:g}")
        rows.append((f"{levels:g} levels: {taken.mean():.0f} samples", picture))
    save("target", rows, truth)


def save(name: str, rows, truth: np.ndarray, below=()) -> None:
    """Pictures side by side, each with its title, and a second row below."""
    from glint.engine.analysis.comparison import draw_strip
    from glint.engine.analysis.flip import displayed
    from glint.engine.analysis.target import error_between

    for title, picture in rows:
        print(f"{name}: {title}: {error_between('LEVELS', picture, truth):.1f} levels")
    size = (ENLARGED * (REGION[2] - REGION[0]), ENLARGED * (REGION[3] - REGION[1]))
    strips = [draw_strip([displayed(enlarged(picture))], (title,), size) for title, picture in rows]
    image = np.concatenate(strips, 1)
    if below:
        second = [draw_strip([displayed(enlarged(p))], (t,), size) for t, p in below]
        image = np.concatenate([image, np.concatenate(second, 1)], 0)
    write_jpeg(PICTURES / f"accuracy_{name}.jpg", image.astype(np.float32))


def enlarged(picture: np.ndarray) -> np.ndarray:
    return np.repeat(np.repeat(picture, ENLARGED, 0), ENLARGED, 1)


def plot(scene, settings) -> None:
    from glint.engine.analysis.trade import measure
    from glint.engine.analysis.trade_plot import draw_trade

    trade = measure(scene, settings, squares=8, side=16, reference_seconds=0.0, repeats=2)
    write_jpeg(PICTURES / "accuracy_plot.jpg", draw_trade(trade, "Demo").astype(np.float32))


if __name__ == "__main__":
    sys.exit(main())
