"""Narrow views are traced in the camera's axes and come back in the world's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine_scenes import ball_mesh, camera, grid_mesh, surface
from glint import engine
from glint.engine import scene as s
from glint.engine.scene.view_axes import NARROW, narrow_view_axes, pixel_angle
from native_tools import draw, lamp, needs_core, placed

PASSES = ("Normal", "Position", "Depth", "Object Index")


def view(half: float, kind: str = "PERSPECTIVE", side: int = 32) -> s.Scene:
    """A ball on a floor, 0.8 across and turned from the axes, seen from 5 away through a window of
    ±half.
    """
    groups = (
        placed(0, (0,)),
        replace(placed(1, (1,), z=0.4, linear=0.4 * np.eye(3)), object_index=3),
    )
    look = replace(
        camera((3.1, -3.3, 2.2), (0.1, 0.0, 0.5)),
        kind=kind,
        window=(-half, half, -half, half),
        resolution=(side, side),
    )
    lights = (lamp("POINT", (1.5, -1, 3), strength=300.0), lamp("SUN", strength=2.0))
    return s.Scene(
        look,
        (grid_mesh(3), ball_mesh(12, smooth=True)),
        groups,
        (surface("floor", 0.5), surface("ball", 0.7)),
        (),
        lights,
    )


def test_usual_views_are_left_alone() -> None:
    assert narrow_view_axes(view(0.36, side=3840).camera) is None
    assert narrow_view_axes(view(1e-4, "ORTHOGRAPHIC").camera) is None


def test_pixel_angle() -> None:
    """The angle between the rays of neighbouring pixels is never less, and at the end of the middle
    row not more than about twice that.
    """
    for half in (1e-4, 0.3, 12.0):
        scene = view(half, side=64)
        line = half * ((2 * np.arange(64) + 1) / 64 - 1)
        ray = np.array([np.stack([line, np.full(64, line[32]), -np.ones(64)], -1)])[0]
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        angle = np.linalg.norm(np.diff(ray, axis=0), axis=1)
        assert pixel_angle(scene.camera) <= angle.min() < 2.2 * pixel_angle(scene.camera)


def test_the_frame_is_a_rotation_even_of_a_mirrored_and_sheared_camera() -> None:
    scene = view(1e-4)
    matrix = scene.camera.world_from_camera.copy()
    matrix[:, 0] *= -3.0
    matrix[:, 1] += 0.2 * matrix[:, 0]
    axes = narrow_view_axes(replace(scene.camera, world_from_camera=matrix)).axes
    assert np.abs(axes.T @ axes - np.eye(3)).max() < 1e-15
    assert np.linalg.det(axes) > 0
    assert np.abs(axes[:, 2] @ matrix[:, 2] - 1) < 1e-15


@needs_core
def test_passes_are_those_of_the_world() -> None:
    """Against the float64 tracer, which knows nothing of such frames. Position: float32 of
    coordinates up to 4; Depth is near 5.
    """
    scene = view(2e-4)
    assert pixel_angle(scene.camera) < NARROW
    ours = draw(scene, *PASSES)
    truth = engine.render(
        scene,
        engine.Settings(samples=1, light_samples=1, backend="NUMPY", passes=frozenset(PASSES)),
    )
    assert np.abs(ours.passes["Position"] - truth.passes["Position"]).max() <= 2 * np.spacing(
        np.float32(4)
    )
    assert np.abs(ours.passes["Depth"] - truth.passes["Depth"]).max() <= 2 * np.spacing(
        np.float32(5)
    )
    assert np.abs(ours.passes["Normal"] - truth.passes["Normal"]).max() <= 1e-6
    assert np.array_equal(ours.passes["Object Index"], truth.passes["Object Index"])
    assert np.abs(ours.combined - truth.combined).max() <= 1e-6 * truth.combined.max()


@needs_core
def test_no_hit_is_no_place() -> None:
    """Where nothing is, Position stays 0 and does not become the eye."""
    scene = view(2e-4)
    sky = replace(
        scene, instances=scene.instances[1:], camera=camera((3.1, -3.3, 2.2), (9.0, 9.0, 9.0))
    )
    sky = replace(sky, camera=replace(sky.camera, window=scene.camera.window))
    assert narrow_view_axes(sky.camera) is not None
    assert not draw(sky, *PASSES).passes["Position"].any()
