"""What media leave of the light that surfaces throw onto each other (SEMANTICS.md, Media), against
closed forms.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import at, box_mesh, grid_mesh, surface
from glint import engine
from glint.engine import scene as s
from glint.engine.lights.bounced_light import bounced_light
from glint.engine.lights.walk_media import walk_media
from media_scenes import DENSE, filled, things
from test_varied_media import COLORS, absorbing

THIN = s.Medium(absorption=(0.1, 0.2, 0.4))
SIGMA, THIN_SIGMA = np.array(DENSE.absorption), np.array(THIN.absorption)
DOWN = np.array([[0.0, 0.0], [0.0, 0.0], [-1.0, -1.0]])


def left(scene: s.Scene, origin=(0.0, 0.0, 0.0), way=np.inf, points=((0.3, 0.2, -3.0),) * 2):
    """(3,) of light that comes down onto a point from so far."""
    origin = np.array(origin)
    x = np.array(points, np.float64).T - origin[:, None]
    passed = walk_media(scene, origin).passed(x, DOWN, np.full(2, way))
    assert np.array_equal(passed[:, 0], passed[:, 1])
    return passed[:, 0]


def test_without_media_walks_look_for_none() -> None:
    assert walk_media(things((grid_mesh(), at(), surface("floor", 0.7))), np.zeros(3)) is None


def test_boxes_that_touch_overlap_and_hold_another_one() -> None:
    """A box of side 2 and one that lies in it and ends where it does."""
    big, small = (box_mesh(), at()), (box_mesh(), at((0.0, 0.0, 0.5), 0.5))
    assert np.allclose(left(things((*big, filled("a")))), np.exp(-2 * SIGMA), rtol=1e-9)
    both = things((*big, filled("a")), (*small, filled("b", THIN)))
    assert np.allclose(left(both), np.exp(-2 * SIGMA - THIN_SIGMA), rtol=1e-9)
    above = things((*big, filled("a")), (box_mesh(), at((0.0, 0.0, 2.0)), filled("b", THIN)))
    assert np.allclose(left(above, (5.0, 1.0, 2.0)), np.exp(-2 * SIGMA - 2 * THIN_SIGMA), rtol=1e-9)


def test_only_the_way_of_the_light_counts() -> None:
    scene = things((box_mesh(), at(), filled("a")))
    assert np.allclose(left(scene, way=2.5), np.exp(-0.5 * SIGMA), rtol=1e-9)
    inside = left(scene, way=0.25, points=((0.3, 0.2, 0.0),) * 2)
    assert np.allclose(inside, np.exp(-0.25 * SIGMA), rtol=1e-9)


def test_a_density_that_rises() -> None:
    """x + 1 upward from the box's floor is straight, for which Gauss' places are exact."""
    medium = absorbing(lambda tree, x, y, z: tree.math("ADD", z, 1.0))
    scene = things((box_mesh(), at(), filled("a", medium)))
    assert np.allclose(left(scene), np.exp(-2 * COLORS), rtol=1e-6)


@pytest.mark.parametrize("kind", ["SUN", "SPOT"])
def test_bounced_light_of_a_floor_in_fog(kind: str) -> None:
    """What a floor throws on is dimmed by the fog above it; a world's lets no light of a sun in."""
    floor = (grid_mesh(), at((0.0, 0.0, -1.0)), surface("floor", 0.7))
    lamp = s.Light("lamp", kind, at((0.0, 0.0, 6.0))[0], strength=100.0, spot_size=0.02)
    clear = things(floor, lights=(lamp,))
    fog = things(
        floor,
        (box_mesh(), at((0.0, 0.0, 0.5), np.diag([4.0, 4.0, 1.0])), filled("fog")),
        lights=(lamp,),
    )

    def given(scene: s.Scene) -> np.ndarray:
        b = bounced_light(scene, 1).bounces
        near = np.abs(b.points - b.points.mean(0)).max(1) < 1.0
        return np.median(b.radiance[near] * b.spreads[near, None] * b.weights[near, None], 0)

    assert np.allclose(
        given(fog) / given(fog).sum() / (given(clear) / given(clear).sum()),
        np.exp(-2 * SIGMA) / np.exp(-2 * SIGMA).mean(),
        rtol=0.02,
    )
    hazy = replace(clear, world=s.World(medium=THIN))
    if kind == "SUN":
        assert bounced_light(hazy, 1) is None
    else:
        assert bounced_light(hazy, 1) is not None


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_a_wall_beside_a_floor_in_the_fog_of_a_world(backend: str) -> None:
    """A spot that lights a small part of a floor, which lights a wall: each way dims by itself."""
    sigma = 0.3
    floor = (grid_mesh(), at((0.0, 0.0, 0.0), 8.0), surface("floor", 0.7))
    lamp = s.Light("lamp", "SPOT", at((0.0, 0.0, 4.0))[0], strength=4e4, spot_size=0.02)
    matrix = np.column_stack([np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), (0.0, -4.0, 1.0)])
    wall = np.column_stack([np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), (0.0, 2.0, 1.0)])
    plane = replace(grid_mesh(), name="wall")
    scene = things(
        floor,
        (plane, wall[None], surface("wall", 0.7)),
        lights=(lamp,),
        camera=s.Camera("ORTHOGRAPHIC", matrix, (-0.05, 0.05, -0.05, 0.05), (2, 2)),
    )
    plan = engine.Settings(samples=16, diffuse_bounces=1, backend=backend, filter_width=0.0)
    fog = replace(scene, world=s.World(medium=s.Medium(absorption=(sigma,) * 3)))
    clear, dim = (engine.render(k, plan).combined[..., 0].mean() for k in (scene, fog))
    # down, to the wall, and to the camera
    assert dim / clear == pytest.approx(np.exp(-sigma * (4 + np.hypot(2, 1) + 6)), rel=0.02)
