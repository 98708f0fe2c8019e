"""Lights of the native core on a white plane against the formulas of semantics/lights.md, worked
out here in float64.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import scene as s
from glint.engine.sampling import light_points
from light_planes import TINT, UP, P, agree, plane, unit
from native_tools import (
    color,
    constant,
    lamp,
    material,
    needs_core,
    pixel_centers,
    placed,
    square,
    view_from_above,
)

pytestmark = needs_core


def frame(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Any fixed pair of vectors round n will do for the picture's meaning; this is the pair both
    tracers use (Duff et al. 2017).
    """
    sign = np.copysign(1.0, n[..., 2])
    a = -1 / (sign + n[..., 2])
    b = n[..., 0] * n[..., 1] * a
    first = np.stack([1 + sign * n[..., 0] ** 2 * a, sign * b, -sign * n[..., 0]], -1)
    return first, np.stack([b, sign + n[..., 1] ** 2 * a, -n[..., 1]], -1)


@pytest.mark.parametrize("cast_shadow", [True, False])
def test_point(cast_shadow: bool) -> None:
    c = np.array([0.3, -0.2, 1.7])
    picture = color(
        plane(lamp("POINT", c, color=tuple(TINT), strength=120.0, cast_shadow=cast_shadow))
    )
    to = c - P
    d2 = (to**2).sum(-1)
    agree(picture, (120 * TINT) * (to[..., 2] / np.sqrt(d2) / (4 * np.pi**2 * d2))[..., None])


def test_sun() -> None:
    axes = np.linalg.qr(np.array([[1.0, 0.2, 0.5], [0.1, 1, -0.3], [-0.4, 0.3, 1]]))[0]
    axes *= np.sign(axes[2, 2])
    picture = color(plane(lamp("SUN", (5, 6, 7), axes, color=tuple(TINT), strength=2.5)))
    agree(picture, np.broadcast_to(2.5 * TINT * axes[2, 2] / np.pi, picture.shape))


@pytest.mark.parametrize("exponent", [0.5, 1, 7, 60])
def test_highlights_of_a_ball_lit_from_the_eye(exponent: float) -> None:
    """There h is the direction to the eye, and n.h the height on the unit ball, down to its rim."""
    size = 128
    p = pixel_centers(size)
    inside = (p**2).sum(-1) < 1
    shine = material(s.Lobe("SPECULAR", constant(1.0), exponent))
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    picture = color(
        s.Scene(
            view_from_above(size),
            (ball,),
            (placed(),),
            (shine,),
            (),
            (lamp("SUN", strength=np.pi),),
        )
    )
    height = np.sqrt(1 - np.minimum((p**2).sum(-1), 1))
    agree(picture[inside][:, 0], height[inside] ** exponent, 2.0**-22)


@pytest.mark.parametrize("blend", [0.0, 0.4, 1.0])
def test_spot(blend: float) -> None:
    c, size = np.array([0.1, 0.2, 1.5]), 0.9
    picture = color(plane(lamp("SPOT", c, strength=50.0, spot_size=size, spot_blend=blend)))
    to = c - P
    d = np.linalg.norm(to, axis=-1)
    z, edge = to[..., 2] / d, np.cos(size / 2)
    t = np.clip((z - edge) / ((1 - edge) * blend), 0, 1) if blend else (z > edge).astype(float)
    truth = 50 * t * t * (3 - 2 * t) * z / (4 * np.pi**2 * d * d)
    assert (truth == 0).any()
    assert (truth > 0).any()
    agree(picture[..., 0], truth)


def area_light(
    center: tuple[float, float, float],
    tilt: float,
    size_x: float,
    size_y: float,
    shape: str = "RECTANGLE",
) -> s.Light:
    """Turned round y, shining down."""
    axes = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    return lamp("AREA", center, axes, strength=30.0, shape=shape, size_x=size_x, size_y=size_y)


@pytest.mark.parametrize(
    ("shape", "samples", "height"),
    [("RECTANGLE", 1, 1.4), ("ELLIPSE", 1, 1.4), ("ELLIPSE", 3, 1.4), ("RECTANGLE", 3, 2.4)],
)
def test_area(shape: str, samples: int, height: float) -> None:
    """Even over the area: discs, and rectangles farther away than four half diagonals."""
    light = area_light((0.3, 0.1, height), 0.5, 0.8, 0.5, shape)
    picture = color(plane(light), light_samples=samples)
    points = (
        light_points(samples)[0 if shape == "RECTANGLE" else 1] if samples > 1 else np.zeros((1, 2))
    )
    axes, q0 = light.world_from_light[:, :3], light.world_from_light[:, 3]
    truth = np.zeros(P.shape[:2])
    for a, b in points:
        to = q0 + a * 0.4 * axes[:, 0] + b * 0.25 * axes[:, 1] - P
        d = np.linalg.norm(to, axis=-1)
        truth += (
            30
            * np.maximum(0, (to @ axes[:, 2]) / d)
            * (to[..., 2] / d)
            / (np.pi**2 * d * d * samples)
        )
    agree(picture[..., 0], truth)


def spherical_rectangle_point(light: s.Light, u: float, v: float) -> tuple[np.ndarray, np.ndarray]:
    """From each P the point of the light (h, w, 3), less P, and the solid angle (h, w), by the
    formulas of Ureña, Fajardo, King 2013.
    """
    axes, center = light.world_from_light[:, :3], light.world_from_light[:, 3]
    x, y, z = np.moveaxis((center - P) @ axes, -1, 0)
    x0, x1, y0, y1, z0 = (
        x - light.size_x / 2,
        x + light.size_x / 2,
        y - light.size_y / 2,
        y + light.size_y / 2,
        -np.abs(z),
    )
    normals = (
        -y0 / np.hypot(z0, y0),
        x1 / np.hypot(z0, x1),
        y1 / np.hypot(z0, y1),
        -x0 / np.hypot(z0, x0),
    )
    g = [
        np.arccos(-first * second)
        for first, second in zip(normals, normals[1:] + normals[:1], strict=True)
    ]
    solid_angle = sum(g) - 2 * np.pi
    angle = u * solid_angle + 2 * np.pi - g[2] - g[3]
    f = (np.cos(angle) * normals[0] - normals[2]) / np.sin(angle)
    c = np.sign(f) / np.hypot(f, normals[0])
    across = np.clip(-c * z0 / np.sqrt(1 - c * c), x0, x1)
    far = np.hypot(across, z0)
    low, high = y0 / np.hypot(far, y0), y1 / np.hypot(far, y1)
    h = low + v * (high - low)
    local = np.stack([across, np.where(h * h < 1, h * far / np.sqrt(1 - h * h), y1), np.abs(z)], -1)
    return local @ axes.T, solid_angle


NEAR = [
    area_light((0.3, 0.1, 0.7), 0.5, 0.8, 0.5),
    area_light((0.2, 0.1, 0.8), 0.0, 7.0, 7.0),
    area_light((0.2, 0.1, 0.1), 0.0, 1.0, 2.0),
    area_light((2.2, 0.1, 2.0), 1.5, 3.5, 4.0),
    area_light((0.3, 0.1, 1.0), 0.4, 3.0, 0.01),
]


@pytest.mark.parametrize("light", NEAR)
def test_rectangles_seen_large_are_even_over_the_solid_angle(light: s.Light) -> None:
    n = 3
    truth = np.zeros(P.shape[:2])
    for a, b in light_points(n)[0]:
        to, solid_angle = spherical_rectangle_point(light, (a + 1) / 2, (b + 1) / 2)
        truth += (
            30
            * solid_angle
            / (np.pi**2 * light.size_x * light.size_y * n)
            * np.maximum(0, unit(to)[..., 2])
        )
    # the formulas of the paper lose some digits at grazing angles
    agree(color(plane(light), light_samples=n)[..., 0], truth, 1e-6)


def irradiance_of_polygon(corners: np.ndarray) -> np.ndarray:
    """Irradiance (h, w) at P from a polygon wholly above z = 0 that shines with radiance 1 (Lambert
    1760).
    """
    to = unit(corners[:, None, None] - P)
    following = np.roll(to, -1, 0)
    normal = np.cross(to, following)
    size = np.linalg.norm(normal, axis=-1)
    return np.abs((np.arctan2(size, (to * following).sum(-1)) * normal[..., 2] / size).sum(0)) / 2


@pytest.mark.parametrize(
    ("backend", "samples", "room"), [("NATIVE", 512, 0.005), ("NUMPY", 128, 0.025)]
)
@pytest.mark.parametrize(
    "light",
    [
        *NEAR,
        area_light((0.3, 0.1, 2.4), 0.5, 0.8, 0.5),
        area_light((0.2, 0.1, 1e-4), 0.0, 1.0, 2.0),
    ],
)
def test_rectangles_converge_to_the_irradiance_of_a_polygon(
    light: s.Light, backend: str, samples: int, room: float
) -> None:
    """Near, far and nearly touching, in the light's plane and beside it. room: the points'
    discrepancy.
    """
    frame = light.world_from_light
    corners = np.array(
        [
            frame @ [a * light.size_x / 2, b * light.size_y / 2, 0, 1]
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
    )
    truth = 30 / (np.pi**2 * light.size_x * light.size_y) * irradiance_of_polygon(corners)
    found = color(plane(light), light_samples=samples, backend=backend)[..., 0]
    assert np.abs(found - truth).max() <= room * truth.max()


def irradiance_between_slats(light: s.Light) -> np.ndarray:
    """Irradiance (h, w) at P of a light of radiance 1 over what slats let through, by a sum over
    the part of its plane that is seen.
    """
    frame, t, h = light.world_from_light, np.tan(light.spread / 2), light.spread / 2
    found = np.zeros(P.shape[:2])
    for at in np.ndindex(*found.shape):
        local = (P[at] - frame[:, 3]) @ frame[:, :3]  # the light shines along -z
        half, depth, n = np.array([light.size_x, light.size_y]) / 2, -local[2], 240
        low = np.maximum(-half, local[:2] - t * depth)
        top = np.minimum(half, local[:2] + t * depth)
        if not (depth > 0 and (low < top).all()):
            continue
        x, y = (a + (b - a) * (np.arange(n) + 0.5) / n for a, b in zip(low, top, strict=True))
        to = np.stack([*np.meshgrid(x, y), np.zeros((n, n))], -1) - local
        d2 = (to**2).sum(-1)
        share = np.maximum(t - np.hypot(to[..., 0], to[..., 1]) / depth, 0) / (t - h)
        if light.shape == "ELLIPSE":
            share *= ((to + local)[..., :2] ** 2 / half**2).sum(-1) <= 1
        facing = np.maximum(to @ frame[2, :3], 0) * depth / d2**2
        found[at] = (share * facing).sum() * (top - low).prod() / n**2
    return found


SLATS = (
    area_light((0.3, 0.1, 0.7), 0.5, 0.8, 0.5),
    area_light((0.1, 0.1, 6.0), 0.1, 0.8, 0.5),
    area_light((0.2, 0.1, 0.8), 0.0, 7.0, 7.0),
)


@pytest.mark.parametrize(
    ("light", "spread", "shape"),
    [
        (light, spread, s.LIGHT_SHAPES[(i + j) % 2])
        for i, light in enumerate(SLATS)
        for j, spread in enumerate((2.5, 1.2, 0.2))
    ],
)
def test_slats_let_through_what_a_sum_says(light: s.Light, spread: float, shape: str) -> None:
    light = replace(light, spread=spread, shape=shape)
    area = light.size_x * light.size_y * (np.pi / 4 if shape == "ELLIPSE" else 1)
    truth = 30 / (np.pi**2 * area) * irradiance_between_slats(light)
    drawn = [("NATIVE", 512, 0.01), ("NUMPY", 128, 0.03)]
    for backend, samples, room in drawn if spread == 1.2 else drawn[:1]:
        found = color(plane(light), light_samples=samples, backend=backend)[..., 0]
        assert np.abs(found - truth).max() <= room * truth.max(), backend


@pytest.mark.parametrize("spread", [0.0, 1e-6, 3e-4])
def test_the_narrowest_spread_is_a_beam(spread: float) -> None:
    """Its floor is as bright as the light is per area, and black beside it."""
    light = replace(area_light((0.25, 0.25, 3.0), 0.0, 0.5, 0.5), spread=spread)
    found = color(plane(light), light_samples=64)[..., 0]
    inside = (np.abs(P[..., :2] - 0.25) < 0.25 - 1e-3).all(-1)
    beside = (np.abs(P[..., :2] - 0.25) > 0.25 + 1e-3).any(-1)
    assert inside.any()
    assert np.abs(found[inside] / (30 / (np.pi * 0.25)) - 1).max() < 0.01
    assert found[beside].max() == 0


@pytest.mark.parametrize("height", [0.0, -1e-9, 1e-300])
def test_a_rectangle_on_the_surface_gives_finite_light(height: float) -> None:
    for backend in ("NATIVE", "NUMPY"):
        picture = color(
            plane(area_light((0.2, 0.1, height), 0.0, 1.0, 2.0)), light_samples=3, backend=backend
        )
        assert np.isfinite(picture).all()
        assert picture.max() == 0


def test_area_does_not_shine_backwards() -> None:
    light = lamp("AREA", (0, 0, 1), np.diag([1.0, -1, -1]), strength=30.0, size_x=0.8, size_y=0.5)
    assert color(plane(light), light_samples=4).max() == 0


def test_soft_point_sphere() -> None:
    c, radius, n = np.array([0.3, -0.2, 1.2]), 0.4, 5
    picture = color(plane(lamp("POINT", c, strength=80.0, radius=radius)), light_samples=n)
    to = c - P
    d2 = (to**2).sum(-1)
    cos_alpha, axis = np.sqrt(1 - radius**2 / d2), unit(to)
    first, second = frame(axis)
    truth = 0
    for x, y in light_points(n)[1]:
        r2 = x * x + y * y
        cosine = 1 - r2 * (1 - cos_alpha)
        by_radius = np.sqrt((1 - cosine**2) / r2) if r2 else 0 * cosine
        z = cosine * axis[..., 2] + by_radius * (x * first[..., 2] + y * second[..., 2])
        truth = truth + 80 / (4 * np.pi**2 * d2 * n) * 2 / (1 + cos_alpha) * np.maximum(0, z)
    agree(picture[..., 0], truth)


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize("height", [0.5, 0.0, -1.0])
@pytest.mark.parametrize("spot", [False, True])
def test_the_inside_of_a_ball_of_light_is_even(backend: str, height: float, spot: bool) -> None:
    """Half of the view at the ball's radiance, wherever in it the surface is, and whatever way a
    spotlight shines.
    """
    kind, shape = ("SPOT", {"spot_size": 1.0, "spot_blend": 0.5}) if spot else ("POINT", {})
    light = lamp(kind, (0, 0, height), strength=80.0, radius=50.0, **shape)
    few = {"light_samples": {"NATIVE": 1024, "NUMPY": 512}[backend], "region": (5, 5, 11, 11)}
    picture = color(plane(light), backend=backend, **few)[..., 0]
    truth = 80 / (4 * np.pi**2 * 50**2)
    assert np.abs(picture / truth - 1).max() < 0.01


def test_soft_point_disc() -> None:
    c, radius, n = np.array([0.3, -0.2, 1.2]), 0.4, 5
    picture = color(
        plane(lamp("POINT", c, strength=80.0, radius=radius, soft_falloff=True)), light_samples=n
    )
    axis = unit(c - P)
    first, second = frame(axis)
    truth = 0
    for x, y in light_points(n)[1]:
        to = c + radius * (x * first + y * second) - P
        d = np.linalg.norm(to, axis=-1)
        truth = truth + 80 * ((to * axis).sum(-1) / d) * (to[..., 2] / d) / (
            4 * np.pi**2 * d * d * n
        )
    agree(picture[..., 0], truth)


def test_soft_sun() -> None:
    n, angle = 7, 0.6
    picture = color(plane(lamp("SUN", strength=2.0, angle=angle)), light_samples=n)
    versine = 1 - np.cos(angle / 2)
    disc = light_points(n)[1]
    cosines = 1 - (disc**2).sum(-1) * versine
    agree(
        picture[..., 0],
        np.full(P.shape[:2], 2 / np.pi * 2 / (1 + np.cos(angle / 2)) * cosines.mean()),
    )


def test_one_light_sample_is_the_hard_light() -> None:
    for kind, more in (
        ("POINT", {"radius": 0.5}),
        ("SUN", {"angle": 0.5}),
        ("SPOT", {"radius": 0.3, "spot_size": 2.0}),
    ):
        hard = {name: 0.0 for name in more if name in ("radius", "angle")}
        soft, sharp = (
            color(plane(lamp(kind, strength=9.0, **v)), samples=4) for v in (more, {**more, **hard})
        )
        assert np.array_equal(soft, sharp), kind


def test_one_more_sample_of_many_lights_is_the_mean_over_them() -> None:
    """Pixel sample s takes the points s * n + j: 2 pixel samples of 3 light samples each use the
    first 6 points.
    """
    light = lamp("AREA", (0.3, 0.1, 1.4), strength=30.0, size_x=0.8, size_y=0.5)
    twice = color(plane(light), samples=2, light_samples=3, filter_width=0.0)
    agree(twice[..., 0], color(plane(light), samples=1, light_samples=6)[..., 0])


CLASSIC = {
    "POINT": lamp("POINT", (0.3, 0.2, 1.5), strength=0.7, radius=0.3),
    "DISC": lamp("POINT", (0.3, 0.2, 1.5), strength=0.7, radius=0.3, soft_falloff=True),
    "SUN": lamp("SUN", strength=0.7, angle=0.3),
    "SPOT": lamp("SPOT", (0.3, 0.2, 1.5), strength=0.7, spot_size=3.0),
    "AREA": lamp("AREA", (0.3, 0.2, 1.5), strength=0.7, size_x=0.01, size_y=0.01),
}


@pytest.mark.parametrize("name", CLASSIC)
def test_classic_has_no_fall_off(name: str) -> None:
    """The notes' k_d I max(0, n·l), 4.12."""
    light = CLASSIC[name]
    picture = color(plane(light), illumination="CLASSIC")
    to = unit(np.array([0.3, 0.2, 1.5]) - P) if name != "SUN" else np.broadcast_to(UP, P.shape)
    agree(picture[..., 0], 0.7 * to[..., 2])


def test_classic_soft_lights_keep_their_sum() -> None:
    soft = color(plane(CLASSIC["SUN"]), illumination="CLASSIC", light_samples=16)
    cosines = 1 - (light_points(16)[1] ** 2).sum(-1) * (1 - np.cos(0.15))
    agree(soft[..., 0], np.full(P.shape[:2], 0.7 * cosines.mean()))


def test_superposition_and_negative_light() -> None:
    """4.15: lights add; a light of negative strength takes away."""
    a, b = lamp("POINT", (0.5, 0, 1.2), strength=50.0), lamp("SUN", strength=1.5)
    total = color(plane(a, b))
    agree(total[..., 0], color(plane(a))[..., 0] + color(plane(b))[..., 0])
    minus = lamp("POINT", (0.5, 0, 1.2), strength=-50.0)
    assert np.abs(color(plane(a, minus))).max() == 0
    assert color(plane(minus)).min() < 0


def test_hard_shadow_is_where_the_blocker_stands() -> None:
    """A square of half width 0.2 at half the lamp's height throws one of half width 0.4."""
    blocker = placed(1, z=1.0, visible_camera=False)
    light = lamp("POINT", (0, 0, 2), strength=50.0)
    shaded, open_ = (
        color(plane(light, extra=e, geometries=(square(0.2),)))[..., 0] for e in ((blocker,), ())
    )
    dark = (np.abs(P[..., :2]) < 0.4).all(-1)
    assert np.array_equal(shaded == 0, dark)
    assert np.array_equal(shaded[~dark], open_[~dark])


@pytest.mark.parametrize("height", [2.5, 2.0, -0.5])
def test_blockers_behind_the_light_or_the_surface_cast_no_shadow(height: float) -> None:
    """The segment is open: even a blocker through the light's own point lets it shine."""
    blocker = placed(1, z=height, visible_camera=False)
    light = lamp("POINT", (0, 0, 2), strength=50.0)
    shaded, open_ = (
        color(plane(light, extra=e, geometries=(square(0.2),))) for e in ((blocker,), ())
    )
    assert np.array_equal(shaded, open_)


def test_segments_to_a_soft_sphere_end_on_it() -> None:
    """A blocker within the lamp's sphere blocks the ray to its centre only."""
    light = lamp("POINT", (0, 0, 2), strength=50.0, radius=0.5)
    within = placed(1, z=1.7, visible_camera=False)
    shaded, open_ = (
        color(plane(light, extra=e, geometries=(square(0.2),)), light_samples=5)
        for e in ((within,), ())
    )
    assert np.array_equal(shaded, open_)
    assert color(plane(light, extra=(within,), geometries=(square(0.2),))).min() == 0


def test_light_without_shadow_shines_through() -> None:
    blocker = placed(1, z=1.0, visible_camera=False)
    light = lamp("POINT", (0, 0, 2), strength=50.0, cast_shadow=False)
    assert color(plane(light, extra=(blocker,), geometries=(square(0.2),))).min() > 0
