"""What one strand of Huang's Principled Hair does in Cycles, and Cauchy's distributions as lobes:
the tables of addon/export/materials/nodes_hair.py.

    python tests/bench/strand.py [--samples 16]

An upright strand across most of the picture, a sun from each of 11 azimuths and 12 elevations, the
three ways of light apart; of flat strands the mean of five turns. Chiang's model, whose ways add up
to 1, comes first: how far its sum is off is how true the rest is.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import math
import sys

import numpy as np

from targets import HERE

sys.path.append(str(HERE.parent / "cycles"))

import bpy
from mathutils import Vector

import cycles_reference as cycles
from glint.addon.export.materials.fibre_optics import ways

ELEVATIONS = np.radians([0, 1, 3, 5, 8, 12, 17, 23, 30, 40, 55, 75])
AZIMUTHS = np.radians([0, 20, 45, 70, 90, 110, 130, 145, 160, 170, 180])
TURNS = np.radians([0, 36, 72, 108, 144])
FINE = np.linspace(0, np.pi / 2, 400)
WAYS = ("R lobe", "TT lobe", "TRT lobe")
ABSORPTION = (0.0, 0.0, 0.2)  # a clear strand's light that is reflected within never ends there
WIDTH, SUN = 0.6, 3.0  # of the picture that the strand takes; its strength


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, default=16)
    options = parser.parse_args()
    strand = Strand(options.samples)
    print(f"Chiang, all ways: {measured(strand.seen('CHIANG'))[0]:.3f}")
    smooth = ways(1.55, 0.0)
    print("roughness; of R, TT, TRT amounts, mean cosines, standard deviations along the strand")
    usual = {}
    for roughness in (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0):
        rows = [strand.way(number, roughness, 1.0) for number in range(3)]
        if roughness == 0.3:
            usual = rows
        amounts = [row[0] / way.amount for row, way in zip(rows, smooth, strict=True)]
        print_row(roughness, amounts, [row[1] for row in rows], [row[2] for row in rows])
    print("ratio of the axes; of R, TT, TRT amounts and what is added to mean cosines")
    for ratio in (0.2, 0.4, 0.6, 0.85):
        rows = [strand.way(number, 0.3, ratio, TURNS) for number in range(3)]
        told = list(zip(rows, usual, strict=True))
        print_row(ratio, [a[0] / b[0] for a, b in told], [a[1] - b[1] for a, b in told])
    print("half width of Cauchy's distribution; exponents of two lobes, share of the second")
    for width in (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0):
        print_row(width, cauchy(width))


def print_row(first: float, *parts: list[float]) -> None:
    print(f"[{first}, " + ", ".join(f"{x:.3f}" for part in parts for x in part) + "]", flush=True)


class Strand:
    """An upright strand of a radius of 0.3, before a camera that sees one unit."""

    def __init__(self, samples: int) -> None:
        self._samples, self._scene = samples, cycles.empty_scene(16, 16)
        data = bpy.data.hair_curves.new("strand")
        data.add_curves([2])
        data.attributes["position"].data.foreach_set("vector", np.float32([0, 0, -3, 0, 0, 3]))
        data.attributes.new("radius", "FLOAT", "POINT")
        data.attributes["radius"].data.foreach_set("value", np.float32([0.3, 0.3]))
        self._data = data
        camera = bpy.data.cameras.new("camera")
        camera.type, camera.ortho_scale = "ORTHO", 1.0
        lamp = bpy.data.lights.new("sun", "SUN")
        lamp.angle, lamp.energy = 0.02, SUN
        self._camera, self._sun, strand = (
            bpy.data.objects.new(made.name, made) for made in (camera, lamp, data)
        )
        for thing in (self._camera, self._sun, strand):
            self._scene.collection.objects.link(thing)
        self._scene.camera = self._camera
        self._scene.cycles_curves.shape = "THICK"

    def way(
        self, number: int, roughness: float, ratio: float, turns: np.ndarray = TURNS[:1]
    ) -> tuple[float, float, float]:
        """As `measured` has it, of one way alone, of a clear strand."""
        absorbed = ABSORPTION[number]
        inputs = {name: float(k == number) for k, name in enumerate(WAYS)}
        inputs |= {"Roughness": roughness, "Aspect Ratio": ratio}
        inputs["Absorption Coefficient"] = (absorbed,) * 3
        amount, aim, deviation = measured(self.seen("HUANG", turns, **inputs))
        return amount * math.exp(ways(1.55, 0.0)[number].radii * absorbed), aim, deviation

    def seen(self, model: str, turns: np.ndarray = TURNS[:1], **inputs) -> np.ndarray:
        """(12, 11) the mean over the strand's width of what it sends to the camera of a sun's
        light, a steradian, in red.
        """
        self._data.materials.clear()
        material = bpy.data.materials.new(model)
        cycles.use_nodes(material)
        tree = material.node_tree
        tree.nodes.clear()
        node = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
        tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
        node.model, node.parametrization = model, "ABSORPTION"
        clear = {"Absorption Coefficient": (0.0, 0.0, 0.0), "Offset": 0.0}
        for name, value in (clear | inputs).items():
            node.inputs[name].default_value = value
        self._data.materials.append(material)
        found = np.zeros((len(ELEVATIONS), len(AZIMUTHS)))
        for turn in turns:
            self._camera.location = (6 * math.sin(turn), -6 * math.cos(turn), 0)
            self._camera.rotation_euler = (math.pi / 2, 0, turn)
            cycles.make_exact(self._scene, self._samples)
            self._scene.cycles.filter_width = 1.0
            for i, up in enumerate(ELEVATIONS):
                for j, around in enumerate(AZIMUTHS + turn):
                    across = math.cos(up)
                    to = (math.sin(around) * across, -math.cos(around) * across, math.sin(up))
                    self._sun.rotation_euler = Vector(to).to_track_quat("Z", "Y").to_euler()
                    seen = cycles.render_passes(self._scene)["Combined"][..., 0].mean()
                    found[i, j] += seen / (WIDTH * SUN * len(turns))
        return found


def measured(seen: np.ndarray) -> tuple[float, float, float]:
    """How much of the light there is, its mean cosine round the strand, and the deviation of the
    distribution along it (semantics/lobes.md) that is nearest in the cube root.
    """
    rows = np.log(np.maximum(seen, 1e-9))
    fine = np.exp(np.array([np.interp(FINE, ELEVATIONS, column) for column in rows.T]))
    around = 2 * integral(fine * np.cos(FINE), FINE)  # as much from below
    total = integral(around, AZIMUTHS)
    along = integral(fine, AZIMUTHS, axis=0)
    along /= 2 * integral(along * np.cos(FINE), FINE)
    deviations = np.geomspace(0.01, 1.2, 300)
    off = [
        integral((np.cbrt(distribution(s * s)) - np.cbrt(along)) ** 2 * np.cos(FINE), FINE)
        for s in deviations
    ]
    aim = integral(around * np.cos(AZIMUTHS), AZIMUTHS) / total
    return 2 * total, aim, float(deviations[int(np.argmin(off))])


def integral(values: np.ndarray, at: np.ndarray, axis: int = -1) -> np.ndarray:
    """By the trapezoidal rule."""
    values = np.moveaxis(values, axis, -1)
    return ((values[..., 1:] + values[..., :-1]) / 2) @ np.diff(at)


def distribution(variance: float) -> np.ndarray:
    """d'Eon and others' (2011), at FINE, seen from across."""
    x = np.cos(FINE) / variance
    far = 1 / np.sqrt(2 * np.pi * np.maximum(x, 1e-9))
    bessel = np.where(x < 500, np.i0(np.minimum(x, 500)) * np.exp(-np.minimum(x, 500)), far)
    scale = variance * (1 - np.exp(-2 / variance))
    return bessel * np.exp((np.cos(FINE) - 1) / variance) / scale


def cauchy(width: float) -> list[float]:
    """The two exponents and the share whose lobes are nearest to Cauchy's distribution of half
    angles, cut off at a quarter of a circle, over the root of the cosine, in the square root.
    """
    height = width / (width**2 + (FINE / 2) ** 2) / (4 * math.atan(math.pi / 4 / width))
    wanted = np.sqrt(height / np.sqrt(np.maximum(np.cos(FINE), 1e-3)))
    firsts = np.geomspace(0.3, 12, 45) / width**2
    seconds = [(p, distribution(4 / p)) for p in np.geomspace(0.3, 60, 40)]
    best = (math.inf, [])
    for first in firsts:
        one = distribution(4 / first)
        for second, other in seconds:
            for share in np.linspace(0, 1, 21) if second < first else ():
                off = np.sqrt((1 - share) * one + share * other) - wanted
                size = float(integral(off * off * np.cos(FINE), FINE))
                best = min(best, (size, [float(first), float(second), float(share)]))
    return best[1]


if __name__ == "__main__":
    main()
