"""What rough metals show of their surroundings beside many of Cycles' samples."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import render_glint, surface_interior
from small_scenes import (
    add,
    add_camera,
    add_light,
    ball,
    cube,
    lambert,
    looking_at,
    metal,
    moved,
    plane,
)


def alley(roughness: float):
    """A metal ball between painted walls under a sun."""
    scene = cycles.empty_scene(48, 40)
    add(scene, "floor", plane(6, lambert((0.7, 0.7, 0.7))))
    add(scene, "left", plane(3, lambert((0.8, 0.1, 0.1))), looking_at((-2.5, 0, 1), (9, 0, 1)))
    add(scene, "right", plane(3, lambert((0.1, 0.2, 0.8))), looking_at((2.5, 0, 1), (-9, 0, 1)))
    add(scene, "back", plane(4, lambert((0.2, 0.6, 0.2))), looking_at((0, 3, 1), (0, -9, 1)))
    add(scene, "cube", cube(lambert((0.9, 0.8, 0.1))), moved(-1.3, -0.8, 0.4, 0.4, 0.4, 0.4))
    add(scene, "ball", ball(96, 48, True, metal(roughness)), moved(0.3, 0.3, 1))
    add_light(scene, "SUN", (0, -3, 9), energy=4.0)
    add_camera(scene, location=(0.0, -6.0, 2.0), target=(0.2, 0, 0.9))
    return scene


@pytest.mark.parametrize("roughness", [0.1, 0.25, 0.5])
def test_metal_shows_its_surroundings_as_cycles_does(roughness):
    scene = alley(roughness)
    settings = {"samples": 256, "light_samples": 2, "filter_width": 0}
    reflected, alone = (
        render_glint(scene, "NATIVE", max_bounces=bounces, **settings).passes["Combined"][..., :3]
        for bounces in (2, 0)
    )
    passes = cycles.render_cycles(scene, 1024, bounces=2)
    wanted = passes["Combined"][..., :3]
    metal_alone = (np.abs(reflected - alone).max(2) > 1e-3) & surface_interior(passes)
    assert metal_alone.mean() > 0.04
    error = (reflected - wanted)[metal_alone]
    assert np.abs(error.mean(0)).max() <= 0.05 * wanted[metal_alone].mean()
    assert np.sqrt(np.mean(error**2)) <= 0.15 * wanted[metal_alone].mean()
