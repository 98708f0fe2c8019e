"""N16: a million samples in every pixel."""

from __future__ import annotations

import numpy as np
import pytest

import extreme_scenes as extreme
import small_scenes as build
from cycles_reference import render_cycles
from glint.engine.sampling import pixel_offsets
from glint_picture import render_glint
from measuring import compare

SAMPLES = 1_000_000
WIDTH = 1.5


def four_pixels():
    """An empty scene of two by two pixels, which is half of the smallest size that Blender
    knows.
    """
    scene = extreme.new_scene(4)
    scene.render.resolution_percentage = 50
    return scene


def sunlit_floor():
    """A floor whose radiance is the same everywhere; and what that is."""
    scene = four_pixels()
    build.add(scene, "Floor", build.plane(100.0, extreme.grey(0.7)))
    sun = build.add_light(scene, "SUN", (0.3, 0.2, 1.0), energy=2.0)
    build.add_camera(scene, (0, 0, 5), (0, 0, 0))
    albedo = np.float32(0.7)
    return scene, float(albedo) * sun.data.energy / np.pi * np.array(sun.matrix_world, float)[2, 2]


@pytest.mark.slow
def test_mean_of_equal_samples(rows):
    scene, radiance = sunlit_floor()
    truth = np.ones((2, 2, 4))
    truth[..., :3] = radiance
    glint = render_glint(scene, "NATIVE", samples=SAMPLES, filter_width=WIDTH).combined
    cycles = render_cycles(scene, samples=SAMPLES)["Combined"]
    row = compare(rows, "N16", "mean of a million equal samples", (cycles, glint), truth)
    assert row.glint == 0
    assert row.glint_error <= 1e-6


@pytest.mark.slow
def test_mean_of_a_million_different_samples():
    """Under a point light every sample has a radiance of its own: a I cos θ / (4 π² d²) at its
    place on the floor, averaged in float64.
    """
    scene = four_pixels()
    build.add(scene, "Floor", build.plane(100.0, extreme.grey(0.7)))
    build.add_light(scene, "POINT", (1.0, -0.5, 2.0), energy=100.0)
    camera = build.add_camera(scene, (0, 0, 5), (0, 0, 0))
    assert np.allclose(np.array(camera.matrix_world)[:3, :3], np.eye(3), atol=0)
    film = render_glint(scene, "NATIVE", samples=SAMPLES, filter_width=WIDTH).combined[..., 0]
    half = 5 * camera.data.sensor_width / 2 / camera.data.lens
    offsets = pixel_offsets(SAMPLES, WIDTH)
    for row, column in np.ndindex(2, 2):
        x, y = half * (np.array([column, row]) + 0.5 + offsets - 1).T
        distance2 = (x - 1) ** 2 + (y + 0.5) ** 2 + 4
        radiance = float(np.float32(0.7)) * 100 * 2 / (4 * np.pi**2 * distance2**1.5)
        assert film[row, column] == pytest.approx(radiance.mean(), rel=1e-6)
