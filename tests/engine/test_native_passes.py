"""Normals and data passes of the native core against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from engine_scenes import ball_mesh
from glint.engine import scene as s
from native_tools import (
    color,
    constant,
    draw,
    lamp,
    material,
    needs_core,
    placed,
    square,
    view_from_above,
)
from surface_scenes import ROUNDING, SUN, P, agree

pytestmark = needs_core


@pytest.mark.parametrize(
    "linear",
    [
        np.diag([0.9, 0.5, 0.7]),
        np.diag([-0.9, 0.5, 0.7]),
        [[0.8, 0.3, 0], [0, 0.7, 0.2], [0.1, 0, 0.9]],
    ],
)
def test_normals_of_stretched_and_mirrored_balls(linear: np.ndarray) -> None:
    """6.2: the normal of an ellipsoid at x is M⁻ᵀ M⁻¹ x, whatever the sign of det M; smooth
    triangles approach it.
    """
    linear = np.array(linear)
    sphere = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    for geometry, tolerance in ((sphere, 4 * ROUNDING), (ball_mesh(96), 2e-3)):
        scene = s.Scene(view_from_above(), (geometry,), (placed(linear=linear),), (material(),))
        film = draw(scene, "Normal", "Position")
        hit = film.passes["Normal"].any(-1)
        x = film.passes["Position"][hit].astype(float)
        inverse = np.linalg.inv(linear)
        n = x @ inverse.T @ inverse
        n /= np.linalg.norm(n, axis=-1, keepdims=True)
        assert hit.sum() > 50
        assert np.abs(film.passes["Normal"][hit] - n).max() <= tolerance


def test_faces_are_two_sided() -> None:
    for flip in (1.0, -1.0):
        turned = placed(linear=np.diag([1.0, flip, flip]))
        scene = s.Scene(
            view_from_above(), (square(),), (turned,), (material(s.Lobe("DIFFUSE")),), (), (SUN,)
        )
        film = draw(scene, "Normal")
        assert np.array_equal(
            film.passes["Normal"], np.broadcast_to(np.float32([0, 0, 1]), (16, 16, 3))
        )
        agree(film.combined[..., 0], np.ones((16, 16)))


def test_flattened_object_is_lit_on_both_sides() -> None:
    """N7: one axis scaled to 0."""
    for up in (1.0, -1.0):
        light = lamp("SUN", axes=np.diag([1.0, up, up]), strength=np.pi)
        camera = s.Camera(
            "ORTHOGRAPHIC",
            np.column_stack([np.diag([1.0, up, up]), (0, 0, 5 * up)]),
            (-0.5, 0.5, -0.5, 0.5),
            (8, 8),
        )
        flat = placed(linear=np.diag([1.0, 1.0, 0.0]))
        scene = s.Scene(
            camera,
            (ball_mesh(8, smooth=False),),
            (flat,),
            (material(s.Lobe("DIFFUSE")),),
            (),
            (light,),
        )
        agree(color(scene), np.ones((8, 8, 3)))


def test_data_passes() -> None:
    veil = s.Material("veil", (s.Lobe("TRANSPARENT", constant(0.5)),), 4)
    thin = s.Material("thin", (s.Lobe("TRANSPARENT", constant(0.4)),), 5)
    small = square(0.5)
    instances = (placed(0, (0,), z=2.0, object_index=7), placed(1, (1,), z=1.0, object_index=8))
    scene = s.Scene(view_from_above(), (square(), small), instances, (veil, thin))
    film = draw(
        scene, "Depth", "Position", "Normal", "UV", "Object Index", "Material Index", samples=4
    )
    inside = (np.abs(P[..., :2]) < 0.5).all(-1)[..., None]
    expected = {
        "Depth": np.where(inside, 9.0, 1e10),
        "Position": np.where(inside, P + np.array([0, 0, 1]), 0),
        "Normal": np.where(inside, [0, 0, 1], 0),
        "UV": np.where(inside, np.concatenate([P[..., :2] + 0.5, np.ones((16, 16, 1))], -1), 0),
        "Object Index": np.where(inside, 8, 0),
        "Material Index": np.where(inside, 5, 0),
    }
    for name, truth in expected.items():
        assert (
            np.abs(film.passes[name] - truth).max()
            <= ROUNDING * np.where(truth > 1e9, 0, np.abs(truth)).max()
        ), name


def test_depth_is_along_the_view_in_world_units() -> None:
    """A perspective camera scaled by 3 sees depth in world units; a floor at distance 6 has depth 6
    everywhere.
    """
    camera = s.Camera(
        "PERSPECTIVE", np.column_stack([3 * np.eye(3), (0, 0, 6)]), (-0.5, 0.5, -0.4, 0.3), (16, 16)
    )
    film = draw(s.Scene(camera, (square(9.0),), (placed(),), (material(),)), "Depth", "Position")
    assert np.abs(film.passes["Depth"] - 6).max() <= 6 * ROUNDING
    x, y = np.meshgrid((np.arange(16) + 0.5) / 16 - 0.5, -0.4 + 0.7 * (np.arange(16) + 0.5) / 16)
    assert (
        np.abs(film.passes["Position"] - np.stack([6 * x, 6 * y, 0 * x], -1)).max() <= 3 * ROUNDING
    )


CLIPS = [
    (0, np.inf, 2),
    (8.5, np.inf, 1),
    (0, 7.5, 0),
    (8.0, 8.5, 2),
    (7.5, 8.0, 2),
    (9.0, 9.5, 1),
    (9.5, np.inf, 0),
]


@pytest.mark.parametrize(("start", "end", "seen"), CLIPS)
def test_clip_interval_is_closed(start: float, end: float, seen: int) -> None:
    """Sheets that glow by 2 and 1 at depth 8 and 9; a ray through a transparent one stays within
    the interval.
    """
    glow = [s.Material(f"{k}", (s.Lobe("EMISSION", constant(k)),)) for k in (1, 2)]
    instances = (placed(0, (0,), z=1.0), placed(0, (1,), z=2.0))
    scene = s.Scene(
        view_from_above(clip_start=start, clip_end=end), (square(),), instances, tuple(glow)
    )
    assert np.array_equal(color(scene), np.full((16, 16, 3), float(seen)))


def test_visibility_by_kind_of_ray() -> None:
    mirror = material(s.Lobe("MIRROR"))
    glow = s.Material("glow", (s.Lobe("EMISSION"),))
    for camera_sees, mirror_sees in ((True, False), (False, True)):
        sheet = placed(0, (1,), z=12.0, visible_mirror=mirror_sees)
        floor = placed(0, (0,), visible_camera=not camera_sees)
        scene = s.Scene(
            view_from_above(), (square(),), (floor, sheet, placed(0, (1,), z=-1.0)), (mirror, glow)
        )
        assert color(scene).min() == 1


def test_parts_sum_to_combined() -> None:
    lobes = (
        s.Lobe("DIFFUSE", constant(0.7)),
        s.Lobe("SPECULAR", constant(0.3), exponent=20),
        s.Lobe("AMBIENT"),
        s.Lobe("EMISSION", constant(0.1)),
        s.Lobe("MIRROR", constant(0.2)),
        s.Lobe("TRANSPARENT", constant(0.25)),
    )
    world = s.World((0.1, 0.2, 0.3), (0.5, 0.6, 0.7))
    lights = (lamp("POINT", (0.4, 0.3, 1.8), strength=70.0, radius=0.2, visible_camera=True), SUN)
    small = placed(1, (0,), z=1.0)
    scene = s.Scene(
        view_from_above(),
        (square(), square(0.3)),
        (placed(), small),
        (material(*lobes),),
        (),
        lights,
        world,
    )
    parts = ("Diffuse", "Specular", "Ambient", "Shadow", "Mirror", "Emission", "Environment")
    film = draw(scene, *parts, samples=3, light_samples=3)
    total = sum(film.passes[name].astype(float) for name in parts)
    size = sum(np.abs(film.passes[name]).max() for name in parts)
    assert np.abs(total - film.combined[..., :3]).max() <= ROUNDING * size
    assert all(film.passes[name].any() for name in parts)
    assert film.passes["Shadow"].max() <= 0
    assert np.array_equal(film.combined, draw(scene, samples=3, light_samples=3).combined)
