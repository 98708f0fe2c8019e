"""Scenes of matt things, and what bounced light adds to pictures of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glint.engine import Settings, render
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Polygons,
    Scene,
    Spheres,
    World,
)

BACKENDS = ("NATIVE", "NUMPY")
ALBEDO = np.array([0.6, 0.3, 0.1])
HERE = np.eye(3, 4)


def matt(color, *gloss: Lobe) -> Material:
    return Material("matt", (Lobe("DIFFUSE", (Input(tuple(color)),)), *gloss))


def quad(*corners: tuple[float, float, float]) -> Mesh:
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Mesh("quad", np.array(corners, np.float32), triangles)


def ball(radius: float = 1.0, center=(0.0, 0.0, 0.0)) -> Spheres:
    return Spheres("ball", np.array([center], np.float32), np.array([radius], np.float32))


def inside(eye=(0.0, 0.0, 0.3), size: int = 8) -> Camera:
    frame = np.column_stack([np.eye(3), eye])
    return Camera("PERSPECTIVE", frame, (-1.0, 1.0, -1.0, 1.0), (size, size))


def room(
    *lamps: Light,
    more=(),
    materials=(),
    walls: Material | None = None,
    scale: float = 1.0,
    at=(0.0, 0.0, 0.0),
) -> Scene:
    """A matt ball seen from inside. more: geometries that the camera does not see."""
    matrix = np.column_stack([scale * np.eye(3), at])[None]
    placed = [Instances("room", 0, matrix, (0,))]
    placed += [
        Instances(f"{k}", k, matrix, (k,), visible_camera=False) for k in range(1, len(more) + 1)
    ]
    camera = inside()
    frame = camera.world_from_camera.copy()
    frame[:, 3] = scale * frame[:, 3] + at
    return Scene(
        replace(camera, world_from_camera=frame),
        (ball(), *more),
        tuple(placed),
        (walls or matt(ALBEDO), *materials),
        lights=lamps,
    )


def drawn(scene: Scene, bounces: int, backend: str = "NATIVE", **settings) -> np.ndarray:
    chosen = {"samples": 64 if backend == "NATIVE" else 16, "light_samples": 2, "filter_width": 0.0}
    film = render(
        scene, Settings(**{**chosen, "backend": backend, "diffuse_bounces": bounces, **settings})
    )
    return film.passes["Combined"][..., :3].astype(np.float64)


def added(scene: Scene, backend: str = "NATIVE", bounces: int = 1, **settings) -> np.ndarray:
    """What bounces add, along paths that pixels deal among themselves."""
    chosen = {"soft_light": "DEALT", **settings}
    return drawn(scene, bounces, backend, **chosen) - drawn(scene, 0, backend, **chosen)


def lamp(kind: str = "POINT", at=(0.0, 0.0, 0.0), **more) -> Light:
    frame = HERE.copy()
    frame[:, 3] = at
    return Light("lamp", kind, frame, **{"strength": 100.0, **more})


GROUND = Mesh(
    "ground",
    np.array([(-1e4, -1e4, 0), (1e4, -1e4, 0), (1e4, 1e4, 0), (-1e4, 1e4, 0)], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
)
WALL = Mesh(
    "wall",
    np.array([(0, -1, 0.5), (0, 1, 0.5), (0, 1, 2.5), (0, -1, 2.5)], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
)
AT_WALL = Camera(
    "ORTHOGRAPHIC",
    np.array([[0, 0, 1, 3.0], [1, 0, 0, 0], [0, 1, 0, 1.5]]),
    (-0.3, 0.3, -0.3, 0.3),
    (4, 4),
)


def wall_over_ground(*lights: Light) -> Scene:
    here = HERE[None]
    return Scene(
        AT_WALL,
        (GROUND, WALL),
        (Instances("ground", 0, here, (0,)), Instances("wall", 1, here, (1,))),
        (matt(ALBEDO), matt((1.0, 1.0, 1.0))),
        lights=lights,
    )


VARNISH = tuple(
    Lobe("SPECULAR", (Input((size,) * 3),), exponent=p, masking=0.25, fresnel=True, ior=1.5)
    for size, p in ((0.6, 10.0), (30.0, 400.0))
)


def mixed(*varnish: Lobe) -> Scene:
    """Meshes, a ball, polygons, instances, a lamp of each kind, gloss, a mirror and a pane."""
    box = Mesh(
        "box",
        np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32),
        np.array(
            [
                (0, 1, 3),
                (0, 3, 2),
                (4, 6, 7),
                (4, 7, 5),
                (0, 4, 5),
                (0, 5, 1),
                (2, 3, 7),
                (2, 7, 6),
            ],
            np.uint32,
        ),
    )
    square = Polygons(
        "square",
        np.array([(-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)], np.float32),
        np.array([0, 4], np.uint32),
        np.arange(4, dtype=np.uint32),
    )
    turned = np.array(
        [
            [[0.5, 0, 0, -1], [0, 0.5, 0, 0], [0, 0, 0.7, -1]],
            [[-0.4, 0, 0, 1.5], [0, 0.4, 0, 0.3], [0, 0, 0.4, -1]],
        ]
    )
    gloss = Material(
        "gloss",
        (Lobe("DIFFUSE", (Input((0.4, 0.5, 0.6)),)), Lobe("SPECULAR", exponent=40.0), *varnish),
    )
    mirror = Material("mirror", (Lobe("MIRROR"),))
    pane = Material(
        "pane",
        (Lobe("TRANSPARENT", (Input((0.5, 0.6, 0.7)),)), Lobe("DIFFUSE", (Input((0.2,) * 3),))),
    )
    up = HERE[None]
    shifted = np.array([[[1.0, 0, 0, 0.6], [0, 1, 0, -0.8], [0, 0, 1, -0.5]]])
    return Scene(
        Camera(
            "PERSPECTIVE",
            np.column_stack([np.eye(3), (0, 0, 5.0)]),
            (-0.5, 0.5, -0.5, 0.5),
            (24, 24),
        ),
        (box, square, ball(0.5)),
        (
            Instances("boxes", 0, turned, (1,)),
            Instances("floor", 1, up, (0,)),
            Instances("ball", 2, shifted, (2,)),
            Instances(
                "pane", 0, shifted - [[[0.3, 0, 0, 2.0], [0, 0, 0, -1.4], [0, 0, 0.9, 0]]], (3,)
            ),
        ),
        (matt(ALBEDO, *varnish), gloss, mirror, pane),
        lights=(
            lamp(at=(0, 1, 1), radius=0.1, color=(1.0, 0.5, 0.2)),
            lamp("AREA", at=(-1, 0, 2), size_x=0.5, size_y=0.2),
            lamp("SUN", strength=1.0, angle=0.1),
        ),
        world=World(),
    )
