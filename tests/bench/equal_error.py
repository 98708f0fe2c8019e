"""World and mesh light: how long Glint takes to the error of Cycles' 64 samples, beside Cycles.

    python tests/bench/equal_error.py [NAME …] [--width 240] [--truth 2048] [--out out/equal_error]

Ten scenes of direct light, five lit by what glows and five by a world: a floor with a box, a ball
and a glossy ball, and a room. Error is the relative RMSE against Cycles' truth of another seed,
which is kept in --out and read there by later runs. Glint draws with its defaults but samples and
threshold, 1 to 64 samples with thresholds of 0 to 32 levels; the least time of those that err no
more than Cycles is told, along straight lines between the logarithms of the rows of one threshold.
Times are of the processor and of whole renders, the least of three; in brackets less what each
engine's picture of one sample takes beyond a sample's share (export, trees, tables).
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np

from stages import NoCoreError, require_core

SAMPLES = (1, 4, 8, 16, 32, 64)
THRESHOLDS = (0.0, 4.0, 16.0, 32.0)
CYCLES = 64
MESH = ("panel", "tube", "ring", "screens", "room")
WORLDS = ("gradient", "sun", "studio", "photograph", "two_suns")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=" ".join((*MESH, *WORLDS)))
    parser.add_argument("--width", type=int, default=240)
    parser.add_argument("--truth", type=int, default=2048, help="samples of Cycles' truth")
    parser.add_argument("--out", type=Path, default=Path("out/equal_error"))
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        require_core()
    except NoCoreError as error:
        print(error)
        return 1
    if options.inside:
        print("RESULT", *measure(options.names[0], options))
        return 0
    print("| scene | Cycles' error | Cycles, s | Glint, s | ratio | without what is once |")
    print("|---|---|---|---|---|---|", flush=True)
    rows = [row_of(name, options) for name in options.names or (*MESH, *WORLDS)]
    print("| median, worst | | | | " + " | ".join(
        f"{median(values):.1f}, {min(values):.1f}" for values in list(zip(*rows, strict=True))[3:]
    ) + " |")  # fmt: skip
    return 0


def row_of(name: str, options: argparse.Namespace) -> tuple[float, ...]:
    """What the scene's own process tells."""
    command = [sys.executable, __file__, name, "--inside", "--width", str(options.width)]
    command += ["--truth", str(options.truth), "--out", str(options.out)]
    done = subprocess.run(command, capture_output=True, text=True)
    found = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if not found:
        raise SystemExit(f"{name} failed:\n{done.stdout[-500:]}{done.stderr[-2000:]}")
    row = tuple(float(word) for word in found[-1].split()[1:])
    error, cycles, own, whole, each = row
    print(f"| {name} | {error:.4f} | {cycles:.2f} | {own:.3f} | {whole:.1f} | {each:.1f} |")
    sys.stdout.flush()
    return row


def measure(name: str, options: argparse.Namespace) -> tuple[float, ...]:
    """Cycles' error and seconds, Glint's seconds to it, the ratio of whole renders and that of what
    samples take.
    """
    import glint

    glint.register()
    scene = make_scene(name, options.width)
    truth = truth_of(scene, name, options)
    size = np.sqrt((truth**2).mean())

    def drawn(samples: int, threshold: float | None = None) -> tuple[float, float]:
        """Seconds and error: Glint's, without a threshold Cycles'."""
        found = [draw(scene, samples, threshold) for _ in range(3)]
        picture = found[0][0]
        keep(picture, options.out / f"{name}_{samples}_{threshold}.npy")
        error = np.sqrt(((picture - truth) ** 2).mean()) / size
        return min(seconds for _, seconds in found), float(error)

    cycles, error = drawn(CYCLES)
    once = once_of(cycles, drawn(1)[0])
    draw(scene, 1, 0.0)  # what is loaded once
    tables = [np.array([drawn(n, threshold) for n in SAMPLES]) for threshold in THRESHOLDS]
    start = once_of(tables[0][-1, 0], tables[0][0, 0])
    for threshold, rows in zip(THRESHOLDS, tables, strict=True):
        for samples, (seconds, wrong) in zip(SAMPLES, rows, strict=True):
            print(f"{name} {threshold} {samples}: {seconds:.3f} s, {wrong:.4f}", file=sys.stderr)
    own = min(seconds_to(error, rows) for rows in tables)
    each = min(seconds_to(error, np.maximum(rows - (start, 0), 1e-3)) for rows in tables)
    return error, cycles, own, cycles / own, (cycles - once) / each


def once_of(many: float, one: float) -> float:
    """What a render takes beside its samples. many, one: seconds of 64 and of one."""
    return max(one - (many - one) / (CYCLES - 1), 0.0)


def seconds_to(error: float, rows: np.ndarray) -> float:
    """rows: (k, 2) seconds and error, of ever more samples; infinite where none errs as little."""
    best = np.inf
    for (before, wrong), (after, less) in pairwise(rows):
        if wrong <= error:
            best = min(best, before)
        elif less <= error:
            part = np.log(wrong / error) / np.log(wrong / less)
            best = min(best, np.exp(np.log(before) * (1 - part) + np.log(after) * part))
    return float(best)


def truth_of(scene, name: str, options: argparse.Namespace) -> np.ndarray:
    path = options.out / f"{name}_{options.width}_truth_{options.truth}.npy"
    if not path.exists():
        keep(draw(scene, options.truth, seed=1)[0], path)
    return np.load(path)


def keep(picture: np.ndarray, path: Path) -> None:
    np.save(path, picture.astype(np.float32))


def draw(
    scene, samples: int, threshold: float | None = None, seed: int = 0
) -> tuple[np.ndarray, float]:
    """(h, w, 3) linear colours of Glint, without a threshold of Cycles, and the processor's
    seconds.
    """
    from glint.operators.compare_cycles import match_cycles
    from lamps import rendered

    if threshold is None:
        match_cycles(scene, samples, 0, seed)
    else:
        scene.render.engine, final = "GLINT", scene.glint.final
        final.samples, final.error_threshold = samples, threshold
        final.max_bounces = final.diffuse_bounces = 0
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    return rendered(scene)


def make_scene(name: str, width: int):
    import cycles_reference as cycles
    from small_scenes import add, add_camera, ball, cube, lambert, moved, plane

    scene = cycles.empty_scene(width, width * 2 // 3)
    add(scene, "floor", plane(6, lambert((0.6, 0.6, 0.6))))
    place, size = moved(-0.8, 0, 0.6, 0.6, 0.6, 0.6), [0.45] * 3
    add(scene, "ball", ball(48, 24, True, lambert((0.7, 0.3, 0.2))), place)
    add(scene, "box", cube(lambert((0.2, 0.4, 0.7))), moved(0.8, 0.4, 0.45, *size))
    place = moved(0.2, -1, 0.35, 0.35, 0.35, 0.35)
    add(scene, "gloss", ball(48, 24, True, paint((0.3, 0.6, 0.3), 0.3)), place)
    add_camera(scene, (0, -6, 3.5), (0, 0, 0.05), lens=40)
    (shine_upon if name in WORLDS else light)(scene, name)
    return scene


def paint(color, roughness: float):
    """A Principled BSDF."""
    from small_scenes import new_material

    material, tree, output = new_material("paint")
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.inputs["Base Color"].default_value = (*color, 1.0)
    node.inputs["Roughness"].default_value = roughness
    tree.links.new(node.outputs[0], output.inputs[0])
    return material


def light(scene, name: str) -> None:
    """By what glows."""
    from small_scenes import add, ball, cube, lambert, moved, plane
    from test_cycles_mesh_lights import glow, looking_at, screen

    if name == "panel":
        add(scene, "panel", plane(0.75, glow((1, 0.9, 0.8), 10)), moved(0, 0, 3))
    elif name == "tube":
        add(scene, "tube", tube(glow((0.8, 0.9, 1), 40)), moved(0, 0.5, 2.2))
    elif name == "ring":
        add(scene, "ring", ring(glow((1, 0.7, 0.9), 30)), moved(0, 0, 2.2))
    elif name == "screens":
        for i, color in enumerate(((1, 0.2, 0.2), (0.2, 1, 0.2), (0.2, 0.3, 1))):
            x = 2.2 * i - 2.2
            upright = looking_at((x, 2, 1), (x, 9, 1))
            add(scene, f"screen {i}", plane(0.5, glow(color, 10)), upright)
    else:
        walls = cube(lambert((0.7, 0.7, 0.65)))
        add(scene, "room", walls, moved(0, -2.2, 2.3, 3.2, 5, 2.305))
        for i, x in enumerate((-1.2, 1.2)):
            bulb = ball(24, 12, True, glow((1, 0.8, 0.6), 60))
            add(scene, f"bulb {i}", bulb, moved(x, 0.5, 2.4, 0.12, 0.12, 0.12))
        television = looking_at((0, 2.5, 1.4), (0, 9, 1.4))
        add(scene, "television", plane(0.6, screen(4)), television)


def tube(material):
    """Three long, along x."""
    from small_scenes import mesh

    around = np.arange(32) * (2 * np.pi / 32)
    points = [(x, 0.05 * np.cos(a), 0.05 * np.sin(a)) for x in (-1.5, 1.5) for a in around]
    faces = [(k, 32 + k, 32 + (k + 1) % 32, (k + 1) % 32) for k in range(32)]
    faces += [tuple(range(32)), tuple(range(63, 31, -1))]
    return mesh("tube", points, faces, False, material)


def ring(material):
    """A flat-lying torus."""
    from small_scenes import mesh

    points = [
        ((0.9 + 0.05 * np.cos(b)) * np.cos(a), (0.9 + 0.05 * np.cos(b)) * np.sin(a),
         0.05 * np.sin(b))
        for a in np.arange(48) * (2 * np.pi / 48)
        for b in np.arange(12) * (2 * np.pi / 12)
    ]  # fmt: skip
    faces = [
        (12 * i + j, 12 * ((i + 1) % 48) + j, 12 * ((i + 1) % 48) + (j + 1) % 12,
         12 * i + (j + 1) % 12)
        for i in range(48)
        for j in range(12)
    ]  # fmt: skip
    return mesh("ring", points, faces, False, material)


def shine_upon(scene, name: str) -> None:
    """By a world's image."""
    import test_cycles_world as worlds

    makers = {"sun": worlds.sun_and_sky, "photograph": worlds.spots, "two_suns": two_suns}
    world = worlds.WorldTree(scene)
    values = makers.get(name) or getattr(worlds, name)
    world.shine(world.environment(values()).outputs[0])


def two_suns() -> np.ndarray:
    """A dark sky with a low red and a high white sun."""
    import test_cycles_world as worlds

    along = worlds.sky_directions()
    values = np.full(along.shape, 0.05)
    for towards, color in (((-0.8, -0.5, 0.35), (90, 40, 20)), ((0.5, 0.3, 0.9), (60, 60, 70))):
        towards = np.array(towards) / np.linalg.norm(towards)
        values[along @ towards > 0.997] = color
    return values


if __name__ == "__main__":
    sys.exit(main())
