"""Balls and planes seen from above, for tests of surfaces in closed form."""

from __future__ import annotations

import hashlib

import numpy as np

from glint.engine import scene as s
from native_tools import (
    draw,
    lamp,
    material,
    pixel_centers,
    placed,
    square,
    view_from_above,
)

ROUNDING = 2.0**-23
P = pixel_centers()
SUN = lamp("SUN", strength=np.pi)  # lights a white Lambert surface to n.l
EYE = np.array([0.0, 0.0, 10.0])


def balls(
    *lobes: s.Lobe, radius: float = 0.9, lights=(SUN,), world: s.World | None = None, **more
) -> s.Scene:
    sphere = s.Spheres("ball", np.zeros((1, 3), np.float32), np.array([radius], np.float32))
    return s.Scene(
        view_from_above(),
        (sphere,),
        (placed(),),
        (material(*lobes),),
        (),
        lights,
        world or s.World(),
        **more,
    )


def plane(
    *lobes: s.Lobe,
    lights=(SUN,),
    world: s.World | None = None,
    camera: s.Camera | None = None,
    textures=(),
    mesh=None,
) -> s.Scene:
    camera = camera or view_from_above()
    return s.Scene(
        camera,
        (mesh or square(),),
        (placed(),),
        (material(*lobes),),
        textures,
        lights,
        world or s.World(),
    )


def agree(measured: np.ndarray, truth: np.ndarray, rounding: float = ROUNDING) -> None:
    assert np.abs(truth).max() > 0
    assert (np.abs(measured - truth) <= rounding * np.abs(truth) + 1e-30).all()


def on_ball(radius: float) -> tuple[np.ndarray, np.ndarray]:
    """(16, 16, 3) normals of the ball seen from above, zeros beside it, and where it is."""
    r2 = (P[..., :2] ** 2).sum(-1)
    inside = r2 < radius**2
    z = np.sqrt(np.where(inside, radius**2 - r2, 0))
    return np.where(inside[..., None], np.stack([P[..., 0], P[..., 1], z], -1) / radius, 0), inside


def lit_ball(axes: np.ndarray, *materials: s.Material) -> s.Scene:
    """A ball and a floor of two materials in a sun along the last of the axes (3, 3) and a lamp."""
    floor = placed(1, (1,), z=-0.9)
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.array([0.6], np.float32))
    lights = lamp("SUN", axes=axes, angle=0.1), lamp("POINT", (-1.0, 0.5, 1.5), radius=0.2)
    return s.Scene(view_from_above(), (ball, square()), (placed(), floor), materials, lights=lights)


def hash_of(scene: s.Scene, **settings) -> str:
    return hashlib.sha256(draw(scene, **settings).combined.tobytes()).hexdigest()


def assert_borders_change_nothing(scene: s.Scene, **settings) -> None:
    whole, part = (draw(scene, **settings, **x).combined for x in ({}, {"region": (3, 2, 9, 11)}))
    assert np.array_equal(part, whole[2:11, 3:9])


def assert_tracers_agree(scene: s.Scene, *passes: str, rounding: float = 1e-5, **settings) -> None:
    """All values, but for the core's rounding, in shares of the pass's brightest value: no edge
    lies so near a ray that float32 moves it across. Pixels that differ are told with both values.
    """
    films = [draw(scene, *passes, backend=x, **settings) for x in ("NATIVE", "NUMPY")]
    for name in ("Combined", *passes):
        core, reference = (np.asarray(film.passes[name], float) for film in films)
        off = np.abs(core - reference) > rounding * max(np.abs(reference).max(), 1e-3)
        told = [
            f"row {row}, column {column}: {core[row, column]} is {reference[row, column]}"
            for row, column in np.argwhere(off.reshape(*off.shape[:2], -1).any(-1))
        ]
        assert not told, f"{name} differs in {len(told)} pixels: {'; '.join(told[:4])}"
