"""Where walks of light leave lamps (SEMANTICS.md, BOUNCED)."""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine.lights.bounced_light import bounced_light
from glint.engine.reference.area_lights import around, between
from glint.engine.sampling.patterns import walk_points
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Scene,
    Spheres,
)

HERE = np.eye(3, 4)
UP = np.array([[0.0], [0.0], [1.0]])
WALL = Spheres("wall", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
RADIUS = 0.4


def plate(height: float) -> Mesh:
    """Across the whole of the ball that the wall is."""
    corners = [(-1.0, -1.0, height), (1.0, -1.0, height), (1.0, 1.0, height), (-1.0, 1.0, height)]
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Mesh("plate", np.array(corners, np.float32), triangles)


def share_above(height: float, **more) -> float:
    """Of the power that a lamp in the middle gives the wall of a ball, above a black plate."""
    matt = Material("matt", (Lobe("DIFFUSE", (Input((0.5,) * 3),)),))
    placed = [Instances(f"{k}", k, HERE[None], (k,)) for k in (0, 1)]
    lamp = Light("lamp", "POINT", HERE, strength=100.0, radius=RADIUS, **more)
    camera = Camera("PERSPECTIVE", HERE, (-1.0, 1.0, -1.0, 1.0), (4, 4))
    scene = Scene(
        camera, (WALL, plate(height)), tuple(placed), (matt, Material("black", ())), lights=(lamp,)
    )
    light = bounced_light(scene, 1)
    assert light is not None
    b = light.bounces
    assert b is not None
    power = b.radiance[:, 0] * b.spreads * b.weights
    above = b.points[:, 2] + light.world_from_light[2, 3] > height
    return float(power[above].sum() / power.sum())


@pytest.mark.parametrize("soft", [False, True], ids=("ball", "disc"))
def test_a_plate_beside_the_middle_of_a_lamp_leaves_what_shines_beyond_it(soft: bool) -> None:
    """Of discs of the radius R across all directions the plate at the height h parts off what is
    more than h / sin θ from the middle, a segment, which shines upwards, or onto the plate.
    """
    height = 0.1
    z = (np.arange(2000) + 0.5) / 2000  # cosines of directions upwards; the others meet the plate
    t = np.minimum(height / (RADIUS * np.sqrt(1 - z * z)), 1.0)
    segment = (np.arccos(t) - t * np.sqrt(1 - t * t)) / np.pi
    up, down = segment.mean(), (1 - segment).mean()
    truth = up / (up + down)  # of what meets the wall: 0.28
    assert abs(share_above(height, soft_falloff=soft) - truth) < 0.02


@pytest.mark.parametrize("half", [1.4, 0.5, 0.01])
def test_directions_of_a_light_between_slats(half: float) -> None:
    """Their density is what slats let through times the cosine, over π: shares within cones."""
    u, v = walk_points(4096, 254).T
    found = around(np.repeat(UP, 4096, 1), half, u, v)
    assert np.allclose(np.linalg.norm(found, axis=0), 1)
    angles = (np.arange(100_000) + 0.5) / 100_000 * half
    density = between(half, np.stack([np.sin(angles), 0 * angles, -np.cos(angles)]), UP, True)
    density *= 2 * np.cos(angles) * np.sin(angles) * half / 100_000
    assert density.sum() == pytest.approx(1, rel=1e-6)
    for part in (0.2, 0.5, 0.8):
        within = (np.arctan2(np.hypot(*found[:2]), found[2]) < part * half).mean()
        assert within == pytest.approx(density[angles < part * half].sum(), abs=2e-3)
        assert (np.abs(found[:2].mean(1)) < 2e-3).all()
