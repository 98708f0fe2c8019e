"""Volumes that nodes drive: Glint's processor time and error beside Cycles' at several numbers of
samples, in one run.

    python tests/bench/volumes.py [--width 160] [--scenes smoke cloud]

Errors are relative root mean squares over the pixels, against Glint's picture with 64 samples in
steps an eighth as long, which has no grain and the means that Cycles' nears. Cycles renders without
adaptive sampling and without bounces in volumes.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace

import stages  # noqa: F401  (makes the tests' modules and the package importable)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--scenes", nargs="+", choices=("smoke", "cloud"))
    options = parser.parse_args()
    makers = {"smoke": smoke, "cloud": cloud}
    for name in options.scenes or makers:
        scene = makers[name]((options.width, options.width * 9 // 16))
        for engine, samples, seconds, error in compared(scene):
            print(f"{name:6} {engine:7} {samples:4d} samples  {seconds:7.2f} s  {error:7.2%}")
            sys.stdout.flush()
    return 0


def compared(scene):
    """Engine, samples, seconds of processors and error of each picture."""
    import numpy as np

    import cycles_reference as cycles
    import glint_tree  # noqa: F401
    from cycles_reference import bpy
    from glint.addon.export import export_scene
    from glint.engine import Settings, render

    given = export_scene(bpy.context.evaluated_depsgraph_get()).scene
    settings = Settings(samples=64, light_samples=1, filter_width=0.0)
    truth = render(finer(given, 8), settings).combined[..., :3]

    def error(picture) -> float:
        return float(np.sqrt(((picture - truth) ** 2).mean()) / truth.mean())

    for samples in (1, 4, 16):
        start = time.process_time()
        film = render(given, replace(settings, samples=samples))
        yield "Glint", samples, time.process_time() - start, error(film.combined[..., :3])
    for samples in (16, 64, 256):
        start = time.process_time()
        found = cycles.render_cycles(scene, samples)["Combined"]
        yield "Cycles", samples, time.process_time() - start, error(found[..., :3])


def finer(scene, times: int):
    """In steps so many times shorter."""

    def own(thing):
        medium = thing.medium
        return replace(thing, medium=medium and replace(medium, step=medium.step / times))

    return replace(scene, materials=tuple(map(own, scene.materials)), world=own(scene.world))


def smoke(size, density: float = 10.0):
    """Of noise in a box over a floor, in the sun."""
    import test_cycles_varied_media as nodes
    from small_scenes import add, add_camera, add_light, moved, new_material, plane

    scene = nodes.cycles.empty_scene(*size)
    material, tree, output = new_material("smoke")
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 1.5
    tree.links.new(nodes.place(tree), noise.inputs["Vector"])
    holes = nodes.math(tree, "SUBTRACT", noise.outputs[0], 0.4, clamp=True)
    value, inputs = nodes.math(tree, "MULTIPLY", holes, density), {"Anisotropy": 0.3}
    nodes.fed("ShaderNodeVolumePrincipled", output, value, Color=(0.8, 0.7, 0.6, 1), **inputs)
    nodes.box(scene, material)
    add(scene, "floor", plane(6, _floor()), moved(0, 0, -1.2))
    add_light(scene, "SUN", (-1.0, -1.0, 2.0), energy=3.0, angle=0.0)
    add_camera(scene, (3.3, -5.0, 2.5), (0, 0, -0.2), angle=0.6)
    return scene


def cloud(size):
    """So dense that next to nothing gets through."""
    return smoke(size, 200.0)


def _floor():
    from small_scenes import new_material
    from test_cycles_media import linked

    material, _, output = new_material("floor")
    linked("ShaderNodeBsdfDiffuse", output, "Surface", Color=(0.6, 0.6, 0.6, 1))
    return material


if __name__ == "__main__":
    sys.exit(main())
