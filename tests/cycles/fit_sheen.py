"""Fits the tables of addon/export/materials/sheen.py to Cycles' Sheen BSDF, and prints them.

    python tests/cycles/fit_sheen.py

A white ball under suns of nine directions is seen from far; where n·v lies in a band the lobe's
width, lean and share are those with the least squares (Levenberg and Marquardt). ASHIKHMIN, which
is no such lobe, keeps the widths and leans of n·v = 0.1 below that, and the share is that of the
fit in a uniform world.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export.materials import sheen
from small_scenes import add, add_camera, ball, new_material

SIDE = 96
ANGLES = np.radians(np.arange(0, 180, 20))

Array = np.ndarray


def seen_under_suns(distribution: str, roughness: float) -> Array:
    """(k, 5) n·v, n·l, l along v across n, the square of l across both, radiance over E/π."""
    scene = cycles.empty_scene(SIDE, SIDE)
    material, tree, output = new_material("cloth")
    node = tree.nodes.new("ShaderNodeBsdfSheen")
    node.distribution = distribution
    node.inputs["Color"].default_value = (1, 1, 1, 1)
    node.inputs["Roughness"].default_value = roughness
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    add(scene, "ball", ball(256, 128, material=material))
    add_camera(scene, (0, 0, 20), (0, 0, 0), type="ORTHO", ortho_scale=2.02)
    sun = bpy.data.lights.new("sun", "SUN")
    sun.angle, sun.energy = 0.0, np.pi
    lamp = add(scene, "sun", sun)
    return np.concatenate([_under(scene, lamp, angle) for angle in ANGLES])


def _under(scene, lamp, angle: float) -> Array:
    from mathutils import Matrix

    lamp.matrix_world = Matrix.Rotation(angle, 4, "Y")
    passes = cycles.render_cycles(scene)
    n = passes["Normal"].reshape(-1, 3).astype(float)
    l = np.array([np.sin(angle), 0, np.cos(angle)])  # noqa: E741, the notes' letter
    nv, nl = n[:, 2], n @ l
    along = (l[2] - nl * nv) / np.sqrt(np.maximum(1 - nv * nv, 1e-12))
    across = np.maximum(1 - nl * nl - along * along, 0)
    kept = (passes["Depth"].ravel() < 1e9) & (nl > 0.02)
    return np.stack([nv, nl, along, across, passes["Combined"][..., 0].ravel()], 1)[kept]


def fit(seen: Array, cosine: float) -> tuple[float, float, float]:
    """Width, lean and share near that n·v."""
    near = np.abs(seen[:, 0] - cosine) < max(0.012, 0.04 * cosine)
    _, nl, along, across, radiance = seen[near].T
    top = radiance.max()
    if top < 1e-6:
        return 0.1, 0.0, 0.0

    def shape(p: Array) -> tuple[float, float, float]:
        rise = 1 / (1 + np.exp(-np.clip(p[:2], -50, 50)))
        return 0.02 + 1.2 * rise[0], rise[1], np.exp(p[2])

    def lobe(p: Array) -> Array:
        a, b, share = shape(p)
        square = (a * along - b * nl) ** 2 + a * a * across + nl * nl
        return share * nl * a * a / square**2 / top

    starts = ((-1, -3, -2), (0, -2, -1), (-2.5, -3, -3), (-1, -1, -1))
    found = [least_squares(lobe, np.array(start, float), radiance / top) for start in starts]
    return shape(min(found, key=lambda pair: pair[1])[0])


def least_squares(of: Callable[[Array], Array], x: Array, y: Array) -> tuple[Array, float]:
    """x with the least Σ (of(x) - y)² near a start, and that."""
    damping, off = 1e-3, of(x) - y
    for _ in range(80):
        slope = np.stack([(of(x + h) - of(x)) / 1e-6 for h in 1e-6 * np.eye(len(x))], 1)
        normal = slope.T @ slope
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), -slope.T @ off)
        then = of(x + step) - y
        is_better = (then**2).sum() < (off**2).sum()
        damping *= 1 / 3 if is_better else 4
        x, off = (x + step, then) if is_better else (x, off)
    return x, float((off**2).sum())


def main() -> None:
    for distribution in ("MICROFIBER", "ASHIKHMIN"):
        rows = []
        for roughness in sheen.ROUGHNESS:
            seen = seen_under_suns(distribution, roughness)
            rows.append([fit(seen, cosine) for cosine in sheen._COSINE])
        for name, table in zip(("width", "lean", "share"), np.moveaxis(rows, 2, 0), strict=True):
            print(distribution, name)
            print(np.rint(1000 * np.array(table)).astype(int))


if __name__ == "__main__":
    main()
