"""What a camera that moves through a Cornell box changes on its walls.

    python tests/bench/flicker.py [--frames 60] [--side 256] [--cycles 64]

Places on the walls that stay in the picture, where all of 6 x 6 pixels show their wall, by bilinear
interpolation; told is how many 8-bit levels of an sRGB screen they change from frame to frame:
median, 95 %, 99 %, the largest, and how many change by more than one. Everything is at its default.
With --cycles Cycles does the same with so many samples, a seed a frame. Bench only: a minute and
more.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from stages import NoCoreError, require_core
from targets import HERE

PLACES = 300
MARGIN = 3
WALLS = (  # its axis, where it lies along it
    (2, 0.0),
    (2, 2.0),
    (1, 1.0),
    (0, -1.0),
    (0, 1.0),
)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--side", type=int, default=256)
    parser.add_argument("--cycles", type=int, default=0, help="samples of Cycles; 0: not drawn")
    options = parser.parse_args()
    try:
        require_core()
    except NoCoreError as error:
        print(error)
        return 1
    sys.path[:0] = [str(HERE.parent), str(HERE.parent / "cycles")]
    import glint

    glint.register()
    print("| engine | changes | median | 95 % | 99 % | largest | above a level | s a frame |")
    print("|" + "---|" * 8)
    for engine in ("GLINT", "CYCLES") if options.cycles else ("GLINT",):
        changes, seconds = measure(engine, options)
        low, high, most = np.percentile(changes, [50, 95, 99])
        print(
            f"| {engine} | {len(changes)} | {low:.2f} | {high:.2f} | {most:.2f} |"
            f" {changes.max():.1f} | {100 * (changes > 1).mean():.1f} % | {seconds:.2f} |",
            flush=True,
        )
    return 0


def measure(engine: str, options: argparse.Namespace) -> tuple[np.ndarray, float]:
    """Changes in levels, and processor seconds of a frame."""
    import rooms
    from cycles_reference import render_passes
    from front_scenes import choose_cycles

    scene = rooms.cornell(options.side)
    places, axes = places_on_walls()
    values, seconds = [], 0.0
    for frame in range(options.frames):
        rooms.place(scene, frame * rooms.OF / options.frames)
        if engine == "GLINT":
            scene.render.engine = "GLINT"
        else:
            choose_cycles(scene, options.cycles, False, frame)
        began = time.process_time()
        passes = render_passes(scene)
        seconds += time.process_time() - began
        values.append(seen(scene, passes, places, axes))
    changes = np.abs(np.diff(np.array(values), axis=0)).max(-1)
    return changes[np.isfinite(changes)], seconds / options.frames


def places_on_walls() -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) places, the same on each wall, and (n,) which axis these lie across."""
    places = []
    u = np.random.default_rng(1).uniform(-0.98, 0.98, (PLACES, 2))
    for axis, at in WALLS:
        on = np.insert(u, axis, at, axis=1)
        if axis != 2:
            on[:, 2] += 1
        places.append(on)
    return np.concatenate(places), np.repeat([axis for axis, _ in WALLS], PLACES)


def seen(scene, passes: dict, places: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(n, 3) levels of the places; NaN for those that are not seen with all that is round them."""
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    from glint.engine.analysis import flip

    picture = 255 * flip.displayed(np.asarray(passes["Combined"])[..., :3].astype(np.float64))
    position = np.asarray(passes["Position"])[..., :3]
    side = len(picture)
    found = np.full((len(places), 3), np.nan)
    for k, (place, axis) in enumerate(zip(places, axes, strict=True)):
        in_view = world_to_camera_view(scene, scene.camera, Vector(place))
        x, y = in_view.x * side - 0.5, in_view.y * side - 0.5
        left, low = int(np.floor(x)), int(np.floor(y))
        inside = all(MARGIN <= at < side - MARGIN - 1 for at in (left, low))
        if in_view.z <= 0 or not inside:
            continue
        near = position[low - 2 : low + 4, left - 2 : left + 4].reshape(-1, 3) - place
        if np.abs(near[:, axis]).max() > 1e-4 or np.abs(near).max() > 0.4:
            continue
        u, v = x - left, y - low
        rows = [(1 - u) * row[left] + u * row[left + 1] for row in picture[low : low + 2]]
        found[k] = (1 - v) * rows[0] + v * rows[1]
    return found


if __name__ == "__main__":
    sys.exit(main())
