"""Scenes of a few shapes, and the notes' formulas evaluated by hand for them: nothing here uses a
tracer.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from glint.engine import linear
from glint.engine.scene import (
    Camera,
    Geometry,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Scene,
    Spheres,
    World,
)

Array = np.ndarray
IDENTITY = np.eye(4)[:3]


def view(
    kind: str = "PERSPECTIVE",
    eye: Sequence[float] = (0.0, 0.0, 0.0),
    gaze: Sequence[float] = (0.0, 0.0, -1.0),
    up: Sequence[float] = (0.0, 1.0, 0.0),
    window: tuple[float, float, float, float] = (-1.0, 1.0, -1.0, 1.0),
    resolution: tuple[int, int] = (8, 8),
) -> Camera:
    return Camera(kind, np.column_stack([linear.camera_basis(gaze, up), eye]), window, resolution)


def viewing_rays(camera: Camera) -> tuple[Array, Array]:
    """Section 4.6: origins and directions (not unit) (ny, nx, 3) of the rays through the pixels'
    centres.
    """
    (left, right, bottom, top), (nx, ny) = camera.window, camera.resolution
    i, j = np.meshgrid(np.arange(nx), np.arange(ny))
    u, v = left + (i + 0.5) * (right - left) / nx, bottom + (j + 0.5) * (top - bottom) / ny
    u_axis, v_axis, w_axis, eye = camera.world_from_camera.T
    offset = u[..., None] * u_axis + v[..., None] * v_axis
    if camera.kind == "PERSPECTIVE":
        return np.broadcast_to(eye, offset.shape), offset - w_axis
    return eye + offset, np.broadcast_to(-w_axis, offset.shape)


def on_plane(
    origins: Array, directions: Array, point: Sequence[float], normal: Sequence[float]
) -> tuple[Array, Array]:
    """t (...) and hit points (..., 3) with the plane; section 4.9's t = (p₁ - e)·n / d·n."""
    t = (np.asarray(point) - origins) @ np.asarray(normal) / (directions @ np.asarray(normal))
    return t, origins + t[..., None] * directions


def mesh(vertices: Iterable[Sequence[float]], *triangles: tuple[int, int, int]) -> Mesh:
    return Mesh(
        "mesh", np.array(vertices, np.float32), np.array(triangles, np.uint32).reshape(-1, 3)
    )


def quad(center: Sequence[float], half_u: Sequence[float], half_v: Sequence[float]) -> Mesh:
    """Two triangles that share the diagonal along half_u + half_v; the normal is half_u ×
    half_v.
    """
    c, u, v = (np.asarray(x, np.float64) for x in (center, half_u, half_v))
    return mesh([c - u - v, c + u - v, c + u + v, c - u + v], (0, 1, 2), (0, 2, 3))


def wall(z: float, half: float = 100.0, center: tuple[float, float] = (0.0, 0.0)) -> Mesh:
    """A square at right angles to the z axis."""
    return quad((*center, z), (half, 0, 0), (0, half, 0))


def ball(center: Sequence[float], radius: float) -> Spheres:
    return Spheres("ball", np.array([center], np.float32), np.array([radius], np.float32))


def paint(exponent: float = 0.0, **lobes: float | Sequence[float]) -> Material:
    """A material from lobes by their lower-case names and coefficients, grey or RGB:
    paint(diffuse=0.5, mirror=(1, 0, 0)). exponent: of the highlight.
    """
    colors = {kind: tuple(float(x) for x in np.broadcast_to(k, 3)) for kind, k in lobes.items()}
    exponents = {"specular": exponent}
    return Material(
        "paint",
        tuple(
            Lobe(kind.upper(), (Input(value=k),), exponents.get(kind, 0.0))
            for kind, k in colors.items()
        ),
    )


def lamp(
    position: Sequence[float], color: Sequence[float] = (1.0, 1.0, 1.0), strength: float = 1.0
) -> Light:
    return Light("lamp", "POINT", np.column_stack([np.eye(3), position]), color, strength)


def scene(
    camera: Camera,
    *things: tuple[Geometry, Material],
    lights: Sequence[Light] = (),
    world: World | None = None,
) -> Scene:
    """Each thing once, where its vertices are."""
    return Scene(
        camera,
        tuple(geometry for geometry, _ in things),
        tuple(Instances(f"thing {k}", k, IDENTITY[None], (k,)) for k in range(len(things))),
        tuple(material for _, material in things),
        (),
        tuple(lights),
        world or World(),
    )


def lambert_blinn_phong(
    points: Array,
    normals: Array,
    eyes: Array,
    lights: Sequence[Light],
    diffuse=0.0,
    specular=0.0,
    exponent=0.0,
) -> Array:
    """Sections 4.12, 4.13 and 4.15 for point lights, with the erratum: Σ I (k_d max(0, n·l) + k_s
    max(0, n·h)^p where n·l > 0).
    """
    total = np.zeros(points.shape)
    n, v = linear.unit(normals), linear.unit(eyes - points)
    for light in lights:
        l = linear.unit(light.world_from_light[:, 3] - points)  # noqa: E741
        h = linear.unit(v + l)
        cosine = linear.dot(n, l)[..., None]
        shine = np.maximum(0.0, linear.dot(n, h))[..., None] ** exponent
        intensity = light.strength * np.array(light.color)
        total += intensity * (
            np.array(diffuse) * np.maximum(0.0, cosine)
            + np.array(specular) * np.where(cosine > 0, shine, 0.0)
        )
    return total
