"""Lamps that are seen: their shapes, and light where it is close or without bounds."""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine import scene as s
from light_planes import P, agree, plane
from native_tools import (
    color,
    lamp,
    needs_core,
    placed,
    square,
    view_from_above,
)

pytestmark = needs_core

SEEN = {
    "POINT": (
        lamp("POINT", (0, 0, 3), strength=7.0, radius=0.5, visible_camera=True),
        7 / (4 * np.pi**2 * 0.25),
        "disc",
    ),
    "RECTANGLE": (
        lamp(
            "AREA",
            (0, 0, 3),
            np.diag([1.0, -1, -1]),
            strength=7.0,
            size_x=1.0,
            size_y=0.6,
            visible_camera=True,
        ),
        7 / (np.pi * 0.6),
        "rectangle",
    ),
    "ELLIPSE": (
        lamp(
            "AREA",
            (0, 0, 3),
            np.diag([1.0, -1, -1]),
            strength=7.0,
            size_x=1.0,
            size_y=0.6,
            shape="ELLIPSE",
            visible_camera=True,
        ),
        7 / (np.pi * np.pi * 0.15),
        "ellipse",
    ),
}


@pytest.mark.parametrize("illumination", ["PHYSICAL", "CLASSIC"])
@pytest.mark.parametrize("name", SEEN)
def test_visible_shapes(name: str, illumination: str) -> None:
    light, radiance, shape = SEEN[name]
    radiance = 7.0 if illumination == "CLASSIC" else radiance
    x, y = P[..., 0], P[..., 1]
    inside = {
        "disc": x * x + y * y < 0.25,
        "rectangle": (np.abs(x) <= 0.5) & (np.abs(y) <= 0.3),
        "ellipse": (x / 0.5) ** 2 + (y / 0.3) ** 2 <= 1,
    }[shape]
    scene = s.Scene(
        view_from_above(), lights=(light,), world=s.World(background=(0.25, 0.25, 0.25))
    )
    picture = color(scene, illumination=illumination)
    agree(picture[..., 0], 0.25 + np.where(inside, radiance, 0))


def test_visible_lights_stay_behind_surfaces_and_show_their_front_only() -> None:
    light, _, _ = SEEN["POINT"]
    covered = s.Scene(
        view_from_above(), (square(),), (placed(z=4.0),), (s.Material("black", ()),), (), (light,)
    )
    assert color(covered).max() == 0
    back = lamp("AREA", (0, 0, 3), strength=7.0, size_x=1.0, size_y=0.6, visible_camera=True)
    assert color(s.Scene(view_from_above(), lights=(back,))).max() == 0


def test_visible_sun_is_a_disc_in_the_sky() -> None:
    angle = 0.5
    sun = lamp(
        "SUN", (0, 0, 0), np.diag([1.0, -1, -1]), strength=3.0, angle=angle, visible_camera=True
    )
    camera = s.Camera("PERSPECTIVE", np.eye(4)[:3], (-0.5, 0.5, -0.5, 0.5), (33, 33))
    picture = color(s.Scene(camera, lights=(sun,)))[..., 0]
    line = (np.arange(33) + 0.5) / 33 - 0.5
    x, y = np.meshgrid(line, line)
    inside = 1 / np.sqrt(1 + x * x + y * y) >= np.cos(angle / 2)
    agree(picture, np.where(inside, 3 / (np.pi * np.sin(angle / 2) ** 2), 0))


def test_light_at_the_surface_gives_finite_light() -> None:
    """N9: on the surface, 1e-6 above it, below it."""
    for height in (0.0, 1e-6, -1e-6):
        picture = color(
            plane(lamp("POINT", (1 / 16, 1 / 16, height), strength=50.0, radius=0.1)),
            light_samples=4,
        )
        assert np.isfinite(picture).all(), height
    assert color(plane(lamp("POINT", (0.0, 0.0, 0.0), strength=50.0))).max() == 0


def test_light_out_of_all_bounds_saturates() -> None:
    picture = color(plane(lamp("POINT", (0, 0, 1), color=(3e38, 1, 1), strength=3e38)))
    assert np.isfinite(picture).all()
    assert picture[..., 0].min() == np.finfo(np.float32).max
