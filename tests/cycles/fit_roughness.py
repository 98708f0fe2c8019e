"""Measures how well `k_s max(0, n·h)^p` can stand for Cycles' GGX and prints the tables of addon/export/roughness.py.

    python tests/cycles/fit_roughness.py

Set-up: ORTHO camera along -z, one sun of angle 0, a wall of small quads, one per pixel, each turned to a normal of its own, no shadows. The
normals are spread round the half vector by GGX's own quantiles, so that lobes of every width are resolved alike. For each roughness,
half angles δ between light and view of 0° to 70° are rendered with a white Glossy BSDF (F = 1).

Minimised, over p and s:  Σ_δ w_δ · Σ_n c_n (s (n·h)^p E/π − L)² / Σ_n c_n L²
L: Cycles' radiance, c_n: solid angle of the normal times n·v (what it covers in a picture of a sphere), w_δ = sin 2δ (how often a
light from anywhere makes that half angle); every δ counts relative to its own lobe, since F and light strength are unknown.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import cycles_reference as cycles
from cycles_reference import bpy

SIDE = 96
HALF_ANGLES = np.radians([0, 10, 20, 30, 40, 50, 60, 70])
ROUGHNESSES = np.array([0.05, 0.075, *np.arange(0.1, 1.001, 0.05)])
EXTENT = 2.0
STRENGTH = np.pi


@dataclass
class Lobe:
    """Radiance per unit of E/π at n normals. n_h, n_v, n_l: cosines. solid_angle: what each normal stands for."""

    n_h: np.ndarray
    n_v: np.ndarray
    n_l: np.ndarray
    solid_angle: np.ndarray
    radiance: np.ndarray

    @property
    def weight(self) -> np.ndarray:
        return self.solid_angle * np.maximum(self.n_v, 0)


def hemisphere(cosine) -> np.ndarray:
    """(SIDE², 3) normals round +z: cosine maps the share of a distribution, 0 to 1, to the cosine of the polar angle."""
    share, azimuth = np.meshgrid((np.arange(SIDE) + 0.5) / SIDE, 2 * np.pi * (np.arange(SIDE) + 0.5) / SIDE, indexing="ij")
    up = cosine(share)
    around = np.sqrt(1 - up**2)
    return np.stack([around * np.cos(azimuth), around * np.sin(azimuth), up], -1).reshape(-1, 3)


def lobe_normals(roughness: float, half_angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(k, 3) normals round the half vector at `half_angle` from +z in the xz plane, (k,) solid angles, and the light's direction.

    The rings' tangents grow evenly up to GGX's width α and then by a constant factor, up to 86° from the half vector.
    """
    alpha = max(roughness, 1e-3) ** 2
    farthest = np.arcsinh(np.tan(np.radians(86)) / alpha)

    def cosine(share):
        return 1 / np.sqrt(1 + (alpha * np.sinh(farthest * share)) ** 2)

    local = hemisphere(cosine)
    ring = 2 * np.pi / SIDE * -np.diff(cosine(np.arange(SIDE + 1) / SIDE))
    c, s = np.cos(half_angle), np.sin(half_angle)
    normals = local @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    light = np.array([np.sin(2 * half_angle), 0, np.cos(2 * half_angle)])
    return normals, np.repeat(ring, SIDE), light


def build_wall(normals: np.ndarray):
    """A scene with one quad per pixel, facing `normals` (rows of pixels from the bottom left); returns it."""
    scene = cycles.empty_scene(SIDE, SIDE)
    pixel = EXTENT / SIDE
    centre = (np.arange(SIDE) + 0.5) * pixel - EXTENT / 2
    x, y = np.meshgrid(centre, centre)
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
    t1 = np.cross(normals, helper)
    t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
    t2 = np.cross(normals, t1)
    middle = np.stack([x.ravel(), y.ravel(), np.zeros(SIDE**2)], -1)
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = np.stack([middle + 0.3 * pixel * (a * t1 + b * t2) for a, b in signs], 1).reshape(-1, 3)
    mesh = bpy.data.meshes.new("Wall")
    mesh.from_pydata(corners.tolist(), [], np.arange(4 * SIDE**2).reshape(-1, 4).tolist())
    scene.collection.objects.link(bpy.data.objects.new("Wall", mesh))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", EXTENT
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.camera.location = (0, 0, 3)
    scene.collection.objects.link(scene.camera)
    return scene


def add_sun(scene, direction: np.ndarray) -> None:
    """A sun of irradiance STRENGTH from `direction`, without shadows."""
    from mathutils import Vector

    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = STRENGTH, 0.0
    sun.use_shadow = False
    node = bpy.data.objects.new("Sun", sun)
    node.rotation_euler = Vector(direction).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(node)


def glossy_material(roughness: float, distribution: str):
    """A white Glossy BSDF."""
    material = bpy.data.materials.new("Glossy")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    output, glossy = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeBsdfAnisotropic")
    glossy.distribution = distribution
    glossy.inputs["Color"].default_value = (1, 1, 1, 1)
    glossy.inputs["Roughness"].default_value = roughness
    tree.links.new(glossy.outputs["BSDF"], output.inputs["Surface"])
    return material


def measure_lobe(roughness: float, half_angle: float, distribution: str = "GGX") -> Lobe:
    """Cycles' radiance of the lobe, per unit of E/π."""
    normals, solid_angle, light = lobe_normals(roughness, half_angle)
    scene = build_wall(normals)
    scene.objects["Wall"].data.materials.append(glossy_material(roughness, distribution))
    add_sun(scene, light)
    radiance = cycles.render_cycles(scene)["Combined"][..., 0].reshape(-1).astype(float)
    half = light + np.array([0, 0, 1])
    lobe = Lobe(normals @ half / np.linalg.norm(half), normals[:, 2], normals @ light, solid_angle, radiance * np.pi / STRENGTH)
    seen = (lobe.n_v > 0.02) & (lobe.n_l > 0)
    return Lobe(*(getattr(lobe, name)[seen] for name in ("n_h", "n_v", "n_l", "solid_angle", "radiance")))


def measure_lobes(roughness: float, distribution: str = "GGX") -> list[Lobe]:
    """One lobe per half angle."""
    return [measure_lobe(roughness, angle, distribution) for angle in HALF_ANGLES]


def fit_quality(lobes: list[Lobe], exponent: float) -> tuple[float, float]:
    """The best scale for an exponent, and the relative root-mean-square residual it leaves (0 perfect, 1 as bad as black)."""
    shapes, targets = [], []
    for lobe, weight in zip(lobes, half_angle_weights(), strict=True):
        factor = np.sqrt(weight * lobe.weight / np.sum(lobe.weight * lobe.radiance**2))
        shapes.append(factor * np.maximum(lobe.n_h, 0) ** exponent)
        targets.append(factor * lobe.radiance)
    shape, target = np.concatenate(shapes), np.concatenate(targets)
    scale = shape @ target / (shape @ shape)
    return scale, np.sqrt(np.sum((scale * shape - target) ** 2))


def half_angle_weights() -> np.ndarray:
    """sin 2δ over the half angles, δ = 0 standing for its own ring; sums to 1."""
    weights = np.sin(2 * np.maximum(HALF_ANGLES, np.radians(2.5)))
    return weights / weights.sum()


def residual(lobes: list[Lobe], exponent: float, scale: float) -> float:
    """The relative root-mean-square residual of a given exponent and scale."""
    total = 0.0
    for lobe, weight in zip(lobes, half_angle_weights(), strict=True):
        error = scale * np.maximum(lobe.n_h, 0) ** exponent - lobe.radiance
        total += weight * np.sum(lobe.weight * error**2) / np.sum(lobe.weight * lobe.radiance**2)
    return np.sqrt(total)


def fit_lobes(lobes: list[Lobe], guess: float) -> tuple[float, float, float]:
    """Exponent, scale and residual that fit best: golden section in log p round the guess."""
    low, high = np.log(guess / 8), np.log(guess * 8)
    golden = (np.sqrt(5) - 1) / 2
    for _ in range(60):
        a, b = high - golden * (high - low), low + golden * (high - low)
        if fit_quality(lobes, np.exp(a))[1] < fit_quality(lobes, np.exp(b))[1]:
            high = b
        else:
            low = a
    exponent = np.exp((low + high) / 2)
    return (exponent, *fit_quality(lobes, exponent))


def measure_albedo(roughness: float, distribution: str = "GGX", samples: int = 16) -> float:
    """Share of a uniform white world that the lobe reflects, averaged over the directions of view with the cosine (F = 1)."""
    scene = build_wall(hemisphere(lambda share: np.sqrt(1 - share)))
    wall = scene.objects["Wall"]
    wall.data.materials.append(glossy_material(roughness, distribution))
    wall.visible_diffuse = wall.visible_glossy = wall.visible_shadow = False
    cycles.set_world(scene, (1, 1, 1))
    return float(cycles.render_cycles(scene, samples)["Combined"][..., 0].mean())


def main() -> None:
    print("roughness  exponent  p·α²/2   scale  s·4α²   residual  | multiscatter: exponent scale residual | albedo single, multi")
    for roughness in ROUGHNESSES:
        alpha = roughness**2
        rows = [fit_lobes(measure_lobes(roughness, kind), 2 / alpha**2 + 0.5) for kind in ("GGX", "MULTI_GGX")]
        (p, s, error), (p2, s2, error2) = rows
        albedo = [measure_albedo(roughness, kind, 16) for kind in ("GGX", "MULTI_GGX")]
        print(
            f"{roughness:6.3f} {p:12.4f} {p * alpha**2 / 2:8.4f} {s:12.5f} {s * 4 * alpha**2:8.4f} {error:8.4f}  | "
            f"{p2:12.4f} {s2:12.5f} {error2:8.4f} | {albedo[0]:7.4f} {albedo[1]:7.4f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
