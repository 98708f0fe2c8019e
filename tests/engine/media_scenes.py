"""Scenes of things with a medium inside, and of worlds with one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine_scenes import at, ball_mesh, box_mesh, camera, constant, grid_mesh, surface
from glint import engine
from glint.engine import scene as s

DENSE = s.Medium(absorption=(0.3, 0.9, 2.0))
CLEAR = (s.Lobe("TRANSPARENT", constant(1.0)),)
GLASS = (
    s.Lobe("REFRACTION", constant(1.0), ior=1.45, fresnel=True),
    s.Lobe("MIRROR", constant(1.0), ior=1.45, fresnel=True),
)


def filled(name: str, medium: s.Medium | None = DENSE, lobes=CLEAR) -> s.Material:
    """What lets light through, with a medium behind."""
    return s.Material(name, lobes, medium=medium)


def things(*pairs: tuple[s.Geometry, np.ndarray, s.Material], **more) -> s.Scene:
    """A scene of geometries, each at its matrices with its material."""
    materials = tuple({id(material): material for *_, material in pairs}.values())
    places = {id(material): number for number, material in enumerate(materials)}
    return s.Scene(
        more.pop("camera", camera()),
        tuple(geometry for geometry, *_ in pairs),
        tuple(
            s.Instances(f"thing {k}", k, np.asarray(matrix, np.float64), (places[id(material)],))
            for k, (_, matrix, material) in enumerate(pairs)
        ),
        materials,
        **more,
    )


def orthographic(eye=(0.0, 0.0, 9.0), size=(16, 16), half=2.0) -> s.Camera:
    """Rays that all go down."""
    matrix = np.column_stack([np.eye(3), eye])
    return s.Camera("ORTHOGRAPHIC", matrix, (-half, half, -half, half), size)


def rich() -> s.Scene:
    """A bit of all: a glass ball in a box of fog in a hazy world, a lamp and a sun, a mirror."""
    floor = surface("floor", 0.7, 0.4)
    mirror = surface("mirror", 0.1, lobes=(s.Lobe("MIRROR", constant(0.8)),))
    lamp = s.Light(
        "lamp", "POINT", at((1.5, -1.5, 2.5))[0], strength=400.0, radius=0.2, visible_camera=True
    )
    sun = s.Light("sun", "SUN", at((0.0, 0.0, 5.0))[0], strength=2.0)
    return things(
        (grid_mesh(), at((0.0, 0.0, -0.5)), floor),
        (box_mesh(), at((0.0, 0.0, 0.6)), filled("fog", s.Medium((0.1, 0.2, 0.4)))),
        (ball_mesh(8), at((0.2, 0.1, 0.5), 0.6), filled("glass", DENSE, GLASS)),
        (ball_mesh(6), at((-1.8, 0.6, 0.2), 0.5), mirror),
        lights=(lamp, sun),
        world=s.World(
            ambient=(0.2,) * 3, background=(0.4, 0.5, 0.7), medium=s.Medium((0.01, 0.02, 0.03))
        ),
    )


def both(scene: s.Scene, **settings) -> tuple[engine.Film, engine.Film]:
    """The core's picture and the reference's."""
    plan = engine.Settings(**settings)
    return engine.render(scene, plan), engine.render(scene, replace(plan, backend="NUMPY"))
