"""The discs that points of bounced light stand for, where surfaces bend."""

from __future__ import annotations

import numpy as np
import pytest

from bounced_scenes import GROUND, HERE, added, ball, drawn, lamp, matt, room
from glint.engine import Settings, render
from glint.engine.lights.bounced_light import bounced_light
from glint.engine.scene import Camera, Instances, Scene

RADIUS, WIDE, PIXELS = 0.5, 0.8, 48
LAMP = np.array([2.0, 1.0, 0.3])
FLOOR, BALL = 0.5, 0.9
UP = np.array([0.0, 0.0, 1.0])


def ball_on_floor() -> Scene:
    """A light ball, which the camera above does not see, lit from the side."""
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 3.0)])
    return Scene(
        Camera("ORTHOGRAPHIC", frame, (-WIDE, WIDE, -WIDE, WIDE), (PIXELS, PIXELS)),
        (GROUND, ball(RADIUS, (0.0, 0.0, RADIUS))),
        (
            Instances("floor", 0, HERE[None], (0,)),
            Instances("ball", 1, HERE[None], (1,), visible_camera=False),
        ),
        (matt((FLOOR,) * 3), matt((BALL,) * 3)),
        lights=(lamp(at=LAMP),),
    )


def form(x: np.ndarray, normal: np.ndarray, end: np.ndarray) -> np.ndarray:
    """cos / d² of points (…, 3) with their normals towards an end, 0 from behind."""
    to = end - x
    square = (to * to).sum(-1)
    return np.maximum((to * normal).sum(-1), 0.0) / square**1.5


def floor_points() -> np.ndarray:
    """(PIXELS, PIXELS, 3): the middles of pixels."""
    across = ((np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1) * WIDE
    x, y = np.meshgrid(across, across)
    return np.stack([x, y, 0 * x], -1)


def thrown_by_the_ball(points: np.ndarray, strength: float) -> np.ndarray:
    """The floor's radiance by an integral over the ball. strength: of the lamp, irradiance times
    d².
    """
    k = np.arange(8_000) + 0.5
    z, turn = 1 - 2 * k / len(k), k * np.pi * (3 - np.sqrt(5))
    n = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], -1)
    q = RADIUS * (n + UP)
    leaving = BALL / np.pi * strength * form(q, n, LAMP)
    q, n, leaving = (column[leaving > 0] for column in (q, n, leaving))
    to = q - points[:, None]
    square = (to * to).sum(-1)
    both = np.maximum(to[..., 2], 0.0) * np.maximum(-(to * n).sum(-1), 0.0) / square**2
    return FLOOR / np.pi * (both * leaving).sum(-1) * 4 * np.pi * RADIUS**2 / len(k)


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_a_ball_lights_the_floor_that_it_stands_on(backend: str) -> None:
    """Discs as wide as the ball cut the floor with their planes, in hard edges: 8.6 % too much
    light, and a relative RMSE of 23 %.
    """
    scene, points = ball_on_floor(), floor_points()
    direct = drawn(scene, 0, samples=16)[..., 0]
    lit = points[..., 0] > 0.6
    strength = np.mean(direct[lit] * np.pi / FLOOR / form(points[lit], UP, LAMP))
    beside = np.hypot(points[..., 0], points[..., 1]) > 0.2
    samples = {"NATIVE": 64, "NUMPY": 16}[backend]
    found = added(scene, backend, samples=samples)[..., 0][beside]
    truth = thrown_by_the_ball(points[beside], strength)
    assert abs(found.mean() / truth.mean() - 1) < 0.02
    assert np.sqrt(((found - truth) ** 2).mean() / (truth**2).mean()) < 0.18


def test_balls_bend_away_outside_and_not_inside() -> None:
    outside = bounced_light(ball_on_floor(), 1)
    points = outside.bounces.points + outside.world_from_light[:, 3]
    on_ball = np.abs(np.linalg.norm(points - RADIUS * UP, axis=1) - RADIUS) < 1e-4
    assert on_ball.sum() > 100
    assert abs(np.median(outside.bounces.bends[on_ball]) * RADIUS - 1) < 0.01
    floor = (np.abs(points[:, 2]) < 1e-4) & (np.linalg.norm(points[:, :2], axis=1) > 2 * RADIUS)
    assert floor.sum() > 100
    assert np.quantile(outside.bounces.bends[floor], 0.9) < 0.01
    assert not bounced_light(room(lamp()), 1).bounces.bends.any()


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_what_is_matt_takes_32_light_samples_whether_or_not_the_first_met_any(backend: str) -> None:
    """Few points lie on a small thing on a wide floor: where the first samples had none of them
    the floor beside a cube stayed dark.
    """
    taken = render(
        ball_on_floor(),
        Settings(
            samples=64,
            light_samples=2,
            diffuse_bounces=1,
            error_threshold=100.0,
            backend=backend,
            passes={"Samples"},
        ),
    ).passes["Samples"]
    assert taken.min() >= 16
