"""Measures how well power lobes can stand for Cycles' microfacets and prints the tables of addon/export/roughness.py.

    python tests/cycles/fit_roughness.py

Set-up: ORTHO camera along -z, one sun of angle 0, a wall of small quads, one per pixel, each turned to a normal of its own, no shadows.
The normals lie on rings round the half vector whose tangents grow evenly up to GGX's width and then by a constant factor, so that
lobes of every width and their tails are resolved. For each roughness, half angles δ between light and view of 0° to 70° are rendered
with a white Glossy BSDF (GGX, MULTI_GGX: F = 1) or a black Principled BSDF of IOR 1.5 (DIELECTRIC, counted per F0 = 0.04).

Minimised, over exponents p_k and scales s_k > 0:  Σ_δ w_δ · Σ_n c_n (g(Σ_k s_k (n·h)^p_k E/π) − g(L))² / Σ_n c_n g(L)²
L: Cycles' radiance, c_n: solid angle of the normal times n·v (what it covers in a picture of a sphere), w_δ = sin 2δ cos² δ (how
often a light from anywhere makes that half angle, and how much of a sphere it lights that is seen); every δ counts relative to its own
lobe, since F and light strength are unknown. g is the display's curve, x^(1/2.2), for the two lobes that are rendered:
with g(x) = x the peak, which pictures clip, would be all that counts. For the single lobe that stands for the Blinn-Phong node in Cycles
g(x) = x.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import cycles_reference as cycles
from cycles_reference import bpy

SIDE = 96
HALF_ANGLES = np.radians([0, 10, 20, 30, 40, 50, 60, 70])
ROUGHNESSES = np.array([0.1, 0.15, *np.arange(0.2, 1.001, 0.1)])
KINDS = ("GGX", "MULTI_GGX", "DIELECTRIC")
DISPLAY = 1 / 2.2
DIELECTRIC_F0 = 0.04
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


def microfacet_material(roughness: float, kind: str):
    """A white Glossy BSDF, or for DIELECTRIC a black Principled BSDF."""
    material = bpy.data.materials.new("Microfacets")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    dielectric = kind == "DIELECTRIC"
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    node = tree.nodes.new("ShaderNodeBsdfPrincipled" if dielectric else "ShaderNodeBsdfAnisotropic")
    node.distribution = "MULTI_GGX" if dielectric else kind
    node.inputs["Base Color" if dielectric else "Color"].default_value = (0, 0, 0, 1) if dielectric else (1, 1, 1, 1)
    node.inputs["Roughness"].default_value = roughness
    if dielectric:
        node.inputs["IOR"].default_value = 1.5
    tree.links.new(node.outputs["BSDF"], output.inputs["Surface"])
    return material


def measure_lobe(roughness: float, half_angle: float, kind: str = "GGX") -> Lobe:
    """Cycles' radiance of the lobe, per unit of E/π and of F0."""
    normals, solid_angle, light = lobe_normals(roughness, half_angle)
    scene = build_wall(normals)
    scene.objects["Wall"].data.materials.append(microfacet_material(roughness, kind))
    add_sun(scene, light)
    radiance = cycles.render_cycles(scene)["Combined"][..., 0].reshape(-1).astype(float)
    half = light + np.array([0, 0, 1])
    radiance *= np.pi / STRENGTH / (DIELECTRIC_F0 if kind == "DIELECTRIC" else 1)
    lobe = Lobe(normals @ half / np.linalg.norm(half), normals[:, 2], normals @ light, solid_angle, radiance)
    seen = (lobe.n_v > 0.02) & (lobe.n_l > 0)
    return Lobe(*(getattr(lobe, name)[seen] for name in ("n_h", "n_v", "n_l", "solid_angle", "radiance")))


def measure_lobes(roughness: float, kind: str = "GGX") -> list[Lobe]:
    """One lobe per half angle."""
    return [measure_lobe(roughness, angle, kind) for angle in HALF_ANGLES]


def half_angle_weights() -> np.ndarray:
    """sin 2δ cos² δ over the half angles, δ = 0 standing for its own ring; sums to 1."""
    weights = np.sin(2 * np.maximum(HALF_ANGLES, np.radians(2.5))) * np.cos(HALF_ANGLES) ** 2
    return weights / weights.sum()


def power_lobes(parameters: np.ndarray, n_h: np.ndarray) -> np.ndarray:
    """Σ s (n·h)^p for parameters (log p, log s, log p, log s, …)."""
    logarithm = np.log(np.maximum(n_h, 1e-9))
    return sum(np.exp(log_s + np.exp(log_p) * logarithm) for log_p, log_s in parameters.reshape(-1, 2))


def differences(lobes: list[Lobe], parameters: np.ndarray, power: float) -> np.ndarray:
    """The terms whose squares are summed, g(x) = x^power: their norm is the relative residual, 0 perfect and 1 as bad as black."""
    terms = []
    for lobe, weight in zip(lobes, half_angle_weights(), strict=True):
        target = np.maximum(lobe.radiance, 0) ** power
        factor = np.sqrt(weight * lobe.weight / np.sum(lobe.weight * target**2))
        terms.append(factor * (power_lobes(parameters, lobe.n_h) ** power - target))
    return np.concatenate(terms)


def residual(lobes: list[Lobe], highlights, power: float = DISPLAY) -> float:
    """The relative root-mean-square residual of given (exponent, scale) pairs."""
    return float(np.linalg.norm(differences(lobes, np.log(np.ravel(highlights)), power)))


def fit_lobes(lobes: list[Lobe], guess, power: float = DISPLAY, largest: float = np.inf) -> np.ndarray:
    """(k, 2) exponents and scales that fit best from a guess of that shape, by Levenberg and Marquardt's method.

    largest: a bound of the first exponent, so that tables fall with roughness where the fit does not care.
    """
    parameters = np.log(np.ravel(guess)).astype(float)
    free = np.ones(len(parameters), bool)
    found = _descend(lobes, parameters, free, power)
    if found[0] > np.log(largest):
        free[0], found[0] = False, np.log(largest)
        found = _descend(lobes, found, free, power)
    return np.exp(found).reshape(-1, 2)


def _descend(lobes: list[Lobe], parameters: np.ndarray, free: np.ndarray, power: float) -> np.ndarray:
    steps, damping = 1e-5 * np.eye(len(parameters))[free], 1e-3
    now = differences(lobes, parameters, power)
    for _ in range(200):
        slopes = np.stack([(differences(lobes, parameters + step, power) - now) / 1e-5 for step in steps], 1)
        normal = slopes.T @ slopes
        move = np.zeros(len(parameters))
        move[free] = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), slopes.T @ now)
        then = differences(lobes, parameters + move, power)
        if then @ then >= now @ now:
            damping *= 4
            if damping > 1e8:
                break
            continue
        parameters, now, damping = parameters + move, then, max(damping / 3, 1e-9)
        if np.abs(move).max() < 1e-6:
            break
    return parameters


def measure_albedo(roughness: float, kind: str = "GGX", samples: int = 16) -> float:
    """Share of a uniform white world that the lobe reflects, averaged over the directions of view with the cosine."""
    scene = build_wall(hemisphere(lambda share: np.sqrt(1 - share)))
    wall = scene.objects["Wall"]
    wall.data.materials.append(microfacet_material(roughness, kind))
    wall.visible_diffuse = wall.visible_glossy = wall.visible_shadow = False
    cycles.set_world(scene, (1, 1, 1))
    return float(cycles.render_cycles(scene, samples)["Combined"][..., 0].mean())


def main() -> None:
    print("kind roughness | narrow p·α², s·α², wide p·α², s·α², residual | one lobe: p·α², s·α², residual (linear) | albedo")
    for kind in KINDS:
        narrow, relative = np.inf, np.array([[1.6, 0.23], [0.11, 0.0035]])
        for roughness in ROUGHNESSES:
            alpha2 = roughness**4
            lobes = measure_lobes(roughness, kind)
            two = fit_lobes(lobes, relative / alpha2, largest=narrow)
            one = fit_lobes(lobes, np.array([[2.2, 0.28]]) / alpha2, 1.0)
            numbers = [*(two * alpha2).ravel(), residual(lobes, two), *(one * alpha2).ravel(), residual(lobes, one, 1.0)]
            print(f"{kind:10s} {roughness:.2f} ", *(f"{x:8.5f}" for x in numbers), f"{measure_albedo(roughness, kind):8.4f}", flush=True)
            narrow, relative = 0.95 * two[0, 0], two * alpha2


if __name__ == "__main__":
    main()
