"""Makes the tables of addon/export/materials/roughness.py, and measures which power is nearest to
Cycles' microfacets.

    python tests/cycles/fit_roughness.py

World: GGX's reflectance of a uniform world, integrated with Schlick's weight or a dielectric's
Fresnel reflectance, by its largest relative error from 6° to 90° for F0 = 0.03 and 0.04. Layer: the
same for what a dielectric layer keeps from what lies below it, by its largest error: A as it is and
B where it scatters until light is out, 1 and B / A where it scatters once, as Cycles has it.

Measured in Cycles: the single lobe that stands for the Blinn-Phong node there, and GGX's albedo.
Set-up: ORTHO camera along -z, one sun of angle 0, a wall of small quads, one per pixel, each turned
to a normal of its own, no shadows. The normals lie on rings round the half vector whose tangents
grow evenly up to GGX's width and then by a constant factor, so that lobes of every width and their
tails are resolved. For each roughness, half angles δ between light and view of 0° to 70° are
rendered with a white Glossy BSDF.

Minimised, over p and s > 0:  Σ_δ w_δ · Σ_n c_n (s (n·h)^p E/π − L)² / Σ_n c_n L²
L: Cycles' radiance, c_n: solid angle of the normal times n·v (what it covers in a picture of a
sphere), w_δ = sin 2δ cos² δ (how often a light from anywhere makes that half angle, and how much of
a sphere it lights that is seen); every δ counts relative to its own lobe, since F and light
strength are unknown.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export.materials.roughness import ROUGHNESS

SIDE = 96
HALF_ANGLES = np.radians([0, 10, 20, 30, 40, 50, 60, 70])
EXTENT = 2.0
STRENGTH = np.pi


@dataclass
class Lobe:
    """Radiance per unit of E/π at n normals. n_h, n_v, n_l: cosines. solid_angle: what each normal
    stands for.
    """

    n_h: np.ndarray
    n_v: np.ndarray
    n_l: np.ndarray
    solid_angle: np.ndarray
    radiance: np.ndarray

    @property
    def weight(self) -> np.ndarray:
        return self.solid_angle * np.maximum(self.n_v, 0)


def hemisphere(cosine) -> np.ndarray:
    """(SIDE², 3) normals round +z: cosine maps the share of a distribution, 0 to 1, to the cosine
    of the polar angle.
    """
    share, azimuth = np.meshgrid(
        (np.arange(SIDE) + 0.5) / SIDE, 2 * np.pi * (np.arange(SIDE) + 0.5) / SIDE, indexing="ij"
    )
    up = cosine(share)
    around = np.sqrt(1 - up**2)
    return np.stack([around * np.cos(azimuth), around * np.sin(azimuth), up], -1).reshape(-1, 3)


def lobe_normals(roughness: float, half_angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(k, 3) normals round the half vector at `half_angle` from +z in the xz plane, (k,) solid
    angles, and the light's direction.

    The rings' tangents grow evenly up to GGX's width α and then by a constant factor, up to 86°
    from the half vector.
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
    """A scene with one quad per pixel, facing `normals` (rows of pixels from the bottom left);
    returns it.
    """
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
    corners = np.stack([middle + 0.3 * pixel * (a * t1 + b * t2) for a, b in signs], 1).reshape(
        -1, 3
    )
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


def glossy_material(roughness: float):
    """A white Glossy BSDF of GGX that scatters once."""
    material = bpy.data.materials.new("Microfacets")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    node = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    node.distribution = "GGX"
    node.inputs["Color"].default_value = (1, 1, 1, 1)
    node.inputs["Roughness"].default_value = roughness
    tree.links.new(node.outputs["BSDF"], output.inputs["Surface"])
    return material


def measure_lobe(roughness: float, half_angle: float) -> Lobe:
    """Cycles' radiance of the lobe, per unit of E/π."""
    normals, solid_angle, light = lobe_normals(roughness, half_angle)
    scene = build_wall(normals)
    scene.objects["Wall"].data.materials.append(glossy_material(roughness))
    add_sun(scene, light)
    radiance = cycles.render_cycles(scene)["Combined"][..., 0].reshape(-1).astype(float)
    half = light + np.array([0, 0, 1])
    radiance *= np.pi / STRENGTH
    lobe = Lobe(
        normals @ half / np.linalg.norm(half), normals[:, 2], normals @ light, solid_angle, radiance
    )
    seen = (lobe.n_v > 0.02) & (lobe.n_l > 0)
    return Lobe(
        *(getattr(lobe, name)[seen] for name in ("n_h", "n_v", "n_l", "solid_angle", "radiance"))
    )


def measure_lobes(roughness: float) -> list[Lobe]:
    """One lobe per half angle."""
    return [measure_lobe(roughness, angle) for angle in HALF_ANGLES]


def half_angle_weights() -> np.ndarray:
    """sin 2δ cos² δ over the half angles, δ = 0 standing for its own ring; sums to 1."""
    weights = np.sin(2 * np.maximum(HALF_ANGLES, np.radians(2.5))) * np.cos(HALF_ANGLES) ** 2
    return weights / weights.sum()


def nearest_exponent(lobes: list[Lobe]) -> float:
    """The exponent of the single power lobe that is nearest, by golden section in its logarithm;
    the scale follows from it.
    """
    low, high = np.log(0.5), np.log(1e6)
    ratio = (np.sqrt(5) - 1) / 2
    while high - low > 1e-4:
        a, b = high - ratio * (high - low), low + ratio * (high - low)
        low, high = (low, b) if _misfit(lobes, np.exp(a)) < _misfit(lobes, np.exp(b)) else (a, high)
    return float(np.exp((low + high) / 2))


def _misfit(lobes: list[Lobe], exponent: float) -> float:
    dots = np.zeros(3)  # of power and power, power and target, target and target
    for lobe, weight in zip(lobes, half_angle_weights(), strict=True):
        power, target, c = np.maximum(lobe.n_h, 0) ** exponent, lobe.radiance, lobe.weight
        dots += (
            weight
            / np.sum(c * target**2)
            * np.array([np.sum(c * x) for x in (power * power, power * target, target * target)])
        )
    return dots[2] - dots[1] ** 2 / dots[0]


def measure_albedo(roughness: float, samples: int = 16) -> float:
    """Share of a uniform white world that the lobe reflects, averaged over the directions of view
    with the cosine.
    """
    scene = build_wall(hemisphere(lambda share: np.sqrt(1 - share)))
    wall = scene.objects["Wall"]
    wall.data.materials.append(glossy_material(roughness))
    wall.visible_diffuse = wall.visible_glossy = wall.visible_shadow = False
    cycles.set_world(scene, (1, 1, 1))
    return float(cycles.render_cycles(scene, samples)["Combined"][..., 0].mean())


def reflected(cosine: float, roughness: float, weight, count: int = 256) -> tuple[float, float]:
    """What GGX reflects of a uniform world seen at that cosine for F = 1 (A), and for F =
    weight(v·h) (B), by the midpoint rule over D.
    """
    a2 = roughness**4
    share, turn = np.meshgrid(*2 * ((np.arange(count) + 0.5) / count,))
    n_h = 1 / np.sqrt(1 + a2 * share / (1 - share))
    v_h = np.sqrt(1 - cosine**2) * np.sqrt(1 - n_h**2) * np.cos(2 * np.pi * turn) + cosine * n_h
    n_l = 2 * v_h * n_h - cosine
    lit = (v_h > 0) & (n_l > 0)
    n_l, v_h = np.where(lit, n_l, 1), np.clip(v_h, 0, 1)
    masking = (
        2
        * n_l
        / (n_l * np.sqrt(a2 + (1 - a2) * cosine**2) + cosine * np.sqrt(a2 + (1 - a2) * n_l**2))
    )
    value = np.where(lit, masking * v_h / n_h, 0)
    return float(value.mean()), float((value * weight(v_h)).mean())


def schlick(cosine: np.ndarray) -> np.ndarray:
    return (1 - cosine) ** 5


def dielectric(cosine: np.ndarray) -> np.ndarray:
    """(F - F0) / (1 - F0) of IOR 1.5."""
    g = np.sqrt(1.25 + cosine**2)
    reflectance = (
        0.5
        * ((g - cosine) / (g + cosine)) ** 2
        * (1 + ((cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)) ** 2)
    )
    return (reflectance - 0.04) / 0.96


COSINES = np.sin(np.radians([6, 8, 10, 12, 15, 20, 25, 30, 37, 45, 53, 60, 70, 80, 90]))


def fit_world(roughness: float, weight, f0: float) -> tuple[float, float, np.ndarray]:
    """The largest relative error, q, and (a0, a1, b0, b1)."""
    a, b = np.array([reflected(c, roughness, weight) for c in COSINES]).T
    return _fit(((a, 1 / a), (b, (1 - f0) / (f0 * a + (1 - f0) * b))))


def kept(cosine: float, roughness: float, once: bool) -> tuple[float, float]:
    """A and B of what a dielectric layer of IOR 1.5 keeps; once: of one that scatters once."""
    a, b = reflected(cosine, roughness, dielectric)
    return (1.0, b / a) if once else (a, b)


def fit_layer(roughness: float, once: bool) -> tuple[float, float, np.ndarray]:
    """The largest error, q, and (a0, a1, b0, b1)."""
    a, b = np.array([kept(c, roughness, once) for c in COSINES]).T
    return _fit(((a, np.full_like(a, 0.04)), (b, np.full_like(b, 0.96))))


def _fit(kinds) -> tuple[float, float, np.ndarray]:
    """The same of (values at `COSINES`, weights of their errors), which share q."""
    fits = []
    for q in np.arange(1.0, 6.01, 0.1):
        basis = np.stack([np.ones_like(COSINES), (1 - COSINES) ** q], 1)
        found = [_least_worst(basis, value, scale) for value, scale in kinds]
        fits.append(
            (max(worst for worst, _ in found), float(q), np.concatenate([c for _, c in found]))
        )
    return min(fits, key=lambda fit: fit[0])


def _least_worst(
    basis: np.ndarray, value: np.ndarray, scale: np.ndarray
) -> tuple[float, np.ndarray]:
    weights = scale.copy()
    for _ in range(40):
        found = np.linalg.lstsq(basis * weights[:, None], value * weights, rcond=None)[0]
        error = np.abs((basis @ found - value) * scale)
        weights = weights * (0.5 + error / max(error.max(), 1e-9))
    return float(error.max()), found


def main() -> None:
    for kind, weight, f0 in (("METAL", schlick, 0.03), ("DIELECTRIC", dielectric, 0.04)):
        for roughness in ROUGHNESS:
            worst, q, found = fit_world(roughness, weight, f0)
            print(
                f"{kind} {roughness:.2f}: off by {worst:.3f}; q {q:.1f};",
                *(f"{x:.4f}" for x in found),
                flush=True,
            )
    for kind, once in (("LAYER", False), ("LAYER_ONCE", True)):
        for roughness in ROUGHNESS:
            worst, q, found = fit_layer(roughness, once)
            print(
                f"{kind} {roughness:.2f}: off by {worst:.4f}; q {q:.1f};",
                *(f"{x:.4f}" for x in found),
                flush=True,
            )


if __name__ == "__main__":
    main()
