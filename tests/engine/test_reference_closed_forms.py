"""The reference's picture against formulas that hold for it, in float64: lights and
highlights.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import at, ball_mesh, box_mesh, constant, grid_mesh, look_at
from floor_views import floor_points, unit, viewing_rays
from glint import engine
from glint.engine import scene as s
from glint.engine.reference.closures.microfacet import blinn_phong
from glint.engine.sampling import light_points
from test_reference_support import (
    DIFFUSE,
    EYE,
    K_D,
    PI,
    POINT,
    ROUNDING,
    VIEW,
    color,
    floor,
    hard,
    material,
    values,
)

MANY = 512
LAW = np.log(MANY) / MANY
"""Light samples, and how far the mean over as many points of the Sobol sequence may be off: its
discrepancy falls like log n / n.
"""


def test_depth_and_position_are_those_of_the_viewing_rays() -> None:
    found = values(floor(DIFFUSE))
    assert np.allclose(found["Position"], floor_points(), rtol=0, atol=ROUNDING)
    depth = (floor_points() - EYE) @ -VIEW.world_from_camera[:, 2]
    assert np.allclose(found["Depth"][..., 0], depth, rtol=ROUNDING)
    assert np.array_equal(found["Normal"], np.broadcast_to([0.0, 0.0, 1.0], (6, 9, 3)))


def expected_intensity(
    light: s.Light, x: np.ndarray, illumination: str
) -> tuple[np.ndarray, np.ndarray]:
    """l (h, w, 3) and I without the light's colour, by the table of semantics/lights.md."""
    axis, physical = -light.world_from_light[:, 2], illumination == "PHYSICAL"
    to = POINT - x
    d, direction = np.linalg.norm(to, axis=-1), unit(to)
    if light.kind == "SUN":
        return np.broadcast_to(-axis, x.shape), np.full(x.shape[:2], 1 / PI if physical else 1.0)
    intensity = 1 / (4 * PI**2 * d**2) if physical else np.ones_like(d)
    z = -direction @ axis
    if light.kind == "SPOT":
        c = np.cos(light.spot_size / 2)
        t = np.clip((z - c) / ((1 - c) * light.spot_blend), 0, 1)
        intensity = intensity * t * t * (3 - 2 * t)
    if light.kind == "AREA":
        intensity = 4 * intensity * np.maximum(0, z) if physical else intensity * (z > 0)
    if light.kind == "AREA" and light.spread < PI:
        h = light.spread / 2
        through = np.maximum(np.tan(h) - np.tan(np.arccos(z)), 0)
        intensity = intensity * through / (np.tan(h) - h if physical else np.tan(h))
    return direction, intensity


HARD_LIGHTS = [
    hard("POINT"),
    hard("SUN"),
    hard("SPOT", spot_size=1.1, spot_blend=0.7),
    hard("AREA"),
    hard("AREA", spread=2.0),
    hard("POINT", radius=0.2),
]


@pytest.mark.parametrize("illumination", engine.settings.ILLUMINATIONS)
@pytest.mark.parametrize("light", HARD_LIGHTS, ids=lambda light: light.kind)
def test_the_formula_of_section_4_15(light: s.Light, illumination: str) -> None:
    """L = k_a I_a + k_d I max(0, n·l) + k_s I max(0, n·h)^p, every light one sample."""
    x = floor_points()
    direction, intensity = expected_intensity(light, x, illumination)
    n = np.array([0.0, 0, 1])
    half = unit(unit(EYE - x) + direction)
    i = intensity[..., None] * 7.0 * np.array([1.0, 0.6, 0.3])
    expected = (
        np.array([0.1, 0.2, 0.3]) * 0.5
        + K_D * i * np.maximum(0, direction @ n)[..., None]
        + 0.6 * i * (np.maximum(0, half @ n) ** 31.0)[..., None]
    )
    lobes = (
        DIFFUSE,
        s.Lobe("SPECULAR", constant(0.6), exponent=31.0),
        s.Lobe("AMBIENT", constant(0.5)),
    )
    found = color(
        floor(*lobes, lights=(light,), world=s.World(ambient=(0.1, 0.2, 0.3))),
        illumination=illumination,
    )
    assert np.allclose(found, expected, rtol=ROUNDING, atol=0)


def test_lights_add_up() -> None:
    one_by_one = sum(color(floor(DIFFUSE, lights=(light,))) for light in HARD_LIGHTS)
    assert np.allclose(color(floor(DIFFUSE, lights=tuple(HARD_LIGHTS))), one_by_one, rtol=ROUNDING)


def test_lambert_sphere_under_a_sun() -> None:
    """k_d E/π cos θ on a true sphere, black on the far side."""
    ball = s.Spheres("b", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    camera = s.Camera(
        "ORTHOGRAPHIC", look_at((0, -5, 0), (0, 0, 0)), (-1.1, 1.1, -1.1, 1.1), (40, 40)
    )
    sun = s.Light("sun", "SUN", look_at((2, -1, 3), (0, 0, 0)), strength=3.0)
    scene = s.Scene(
        camera, (ball,), (s.Instances("b", 0, at(), (0,)),), (material(DIFFUSE),), (), (sun,)
    )
    o, _ = viewing_rays(camera)
    inside = 1 - o[..., 0] ** 2 - o[..., 2] ** 2
    normal = np.stack([o[..., 0], -np.sqrt(np.maximum(inside, 0)), o[..., 2]], -1)
    lit = np.where(inside > 0, np.maximum(0, normal @ unit(np.array([2.0, -1, 3]))), 0)
    assert np.allclose(color(scene), K_D * 3 / PI * lit[..., None], rtol=1e-9, atol=1e-12)


def form_factor(light: s.Light, x: np.ndarray) -> np.ndarray:
    """Irradiance over π at points of z = 0 from a small-enough area light, by midpoints on a fine
    grid, c = 1.
    """
    k = (np.arange(400) + 0.5) / 200 - 1
    a, b = np.meshgrid(k, k)
    keep = np.ones_like(a, bool) if light.shape == "RECTANGLE" else a * a + b * b <= 1
    frame = light.world_from_light
    q = (
        frame[:, 3]
        + (
            a[keep][:, None] * frame[:, 0] * light.size_x
            + b[keep][:, None] * frame[:, 1] * light.size_y
        )
        / 2
    )
    to = q - x
    d = np.linalg.norm(to, axis=-1)
    return (
        np.maximum(0, to[:, 2] / d) * np.maximum(0, to @ frame[:, 2] / d) / (PI**2 * d**2)
    ).mean()


@pytest.mark.parametrize("shape", ["RECTANGLE", "ELLIPSE"])
def test_area_light_converges_to_the_integral(shape: str) -> None:
    light = s.Light(
        "a", "AREA", look_at((0.5, 0.3, 1.0), (0, 0, 0)), shape=shape, size_x=1.2, size_y=0.7
    )
    found = color(floor(s.Lobe("DIFFUSE", constant(1.0)), lights=(light,)), light_samples=MANY)[
        3, 4, 0
    ]
    assert found == pytest.approx(form_factor(light, floor_points()[3, 4]), rel=LAW)


@pytest.mark.parametrize("radius", [0.01, 0.5, 0.99])
def test_sphere_light_above_a_plane_is_a_point_light(radius: float) -> None:
    """The irradiance of a uniform sphere wholly above the horizon is Φ cos θ / (4π d²), whatever
    its radius.
    """
    frame = look_at((0.2, 0.1, 1.0), (0, 0, 0))
    one = s.Lobe("DIFFUSE", constant(1.0))
    soft = color(
        floor(one, lights=(s.Light("l", "POINT", frame, radius=radius),)), light_samples=MANY
    )
    point = color(floor(one, lights=(s.Light("l", "POINT", frame),)))
    x = floor_points()
    above = np.linalg.norm(np.array([0.2, 0.1, 1.0]) - x, axis=-1) > radius
    assert np.allclose(soft[above], point[above], rtol=LAW)


def test_soft_sun_above_a_plane_is_a_hard_one() -> None:
    """Irradiance E cos θ of a disc in the sky: the mean cosine over the cone, cos θ (1 + cos α)/2,
    is made good by 2/(1 + cos α).
    """
    frame = look_at((0.5, -0.3, 1.0), (0, 0, 0))
    suns = [s.Light("s", "SUN", frame, angle=angle, strength=2.0) for angle in (0.0, 0.8)]
    hard_sun, soft_sun = (color(floor(DIFFUSE, lights=(sun,)), light_samples=MANY) for sun in suns)
    assert np.allclose(hard_sun, soft_sun, rtol=LAW)


def test_soft_shadows_end_on_the_sphere() -> None:
    """A ball within the light takes nothing away, one round it everything."""
    light = s.Light("l", "POINT", look_at((0, 0, 1.5), (0, 0, 0), (0, 1, 0)), radius=0.4)
    base = floor(DIFFUSE, lights=(light,))
    for radius, share in ((0.39, 0.0), (0.41, -1.0)):
        ball = s.Spheres(
            "ball", np.array([[0, 0, 1.5]], np.float32), np.array([radius], np.float32)
        )
        inside = s.Instances("ball", 1, at(), (0,), visible_camera=False)
        scene = replace(
            base, geometries=(*base.geometries, ball), instances=(*base.instances, inside)
        )
        found = values(scene, light_samples=16)
        assert np.allclose(found["Shadow"], share * found["Diffuse"], rtol=ROUNDING)
        assert found["Diffuse"].min() > 0


def test_facing_disc_light() -> None:
    """soft_falloff at the point below: Σ cos θ cos θ_Q / (4π² d² n) over the disc, straight from
    the sample points.
    """
    light = s.Light(
        "l",
        "POINT",
        look_at((0, 0, 1.5), (0, 0, 0), (0, 1, 0)),
        strength=5.0,
        radius=0.4,
        soft_falloff=True,
    )
    down = s.Camera(
        "PERSPECTIVE", look_at((0, 0, 4), (0, 0, 0), (0, 1, 0)), (-0.1, 0.1, -0.1, 0.1), (1, 1)
    )
    found = color(
        floor(s.Lobe("DIFFUSE", constant(1.0)), lights=(light,), camera=down), light_samples=16
    )[0, 0, 0]
    _, disc = light_points(16)
    d2 = 1.5**2 + 0.16 * (disc**2).sum(1)
    assert found == pytest.approx((5.0 * (1.5**2 / d2) / (4 * PI**2 * d2)).mean(), rel=ROUNDING)


@pytest.mark.parametrize("illumination", engine.settings.ILLUMINATIONS)
def test_white_furnace_of_the_ambient_term(illumination: str) -> None:
    """A closed world of k_a in ambient light shows k_a · I_a everywhere, exactly."""
    camera = s.Camera(
        "PERSPECTIVE", look_at((0.1, 0.2, -0.1), (1, 0.4, 0.3)), (-1.0, 1.0, -1.0, 1.0), (32, 32)
    )
    inside = s.Scene(
        camera,
        (ball_mesh(),),
        (s.Instances("b", 0, at(), (0,)),),
        (material(s.Lobe("AMBIENT", constant(0.75))),),
        world=s.World(ambient=(0.5, 1.0, 3.0), background=(9.0, 9.0, 9.0)),
    )
    found = values(inside, illumination=illumination)
    assert np.array_equal(found["Combined"], np.broadcast_to([0.375, 0.75, 2.25, 1.0], (32, 32, 4)))


def test_no_light_leaks_into_closed_meshes() -> None:
    for mesh in (ball_mesh(9), box_mesh(), ball_mesh(20, smooth=False)):
        camera = s.Camera(
            "PERSPECTIVE", look_at((0, 0, 0), (1, 0, 0)), (-1.0, 1.0, -1.0, 1.0), (64, 64)
        )
        scene = s.Scene(
            camera,
            (mesh,),
            (s.Instances("b", 0, at(), (0,)),),
            (material(),),
            world=s.World(background=(1.0, 1.0, 1.0)),
        )
        assert color(scene, samples=4).max() == 0


@pytest.mark.parametrize("exponent", [0.0, 1.0, 1e2, 1e4, 1e6, 1e9])
def test_highlight_value(exponent: float) -> None:
    """cos^p at an angle a = 1/√p: exp(p log cos a) with log cos a = −a²/2 − a⁴/12 − … in long
    double.
    """
    angle = np.longdouble(1) / np.sqrt(np.longdouble(max(exponent, 1)))
    cosine = np.cos(angle)
    exact = (
        np.exp(np.longdouble(exponent) * np.log1p(-(np.sin(angle) ** 2)) / 2) if exponent else 1.0
    )
    a = float(angle)
    n = np.array([[0.0], [0.0], [1.0]])
    h = np.array([[np.sin(a)], [0.0], [float(cosine)]])
    v = np.array([[np.sin(a + 0.3)], [0.0], [np.cos(a + 0.3)]])
    light = 2 * (h * v).sum(0) * h - v
    assert blinn_phong(n, v, light, exponent)[0] == pytest.approx(float(exact), rel=1e-11)


def test_highlights_need_light_above_the_surface() -> None:
    """A light below the horizon gives none (errata of sections 4.13-15), nor does an opposite v + l
    = 0.
    """
    below = s.Light("l", "SUN", look_at((0, 3, -0.1), (0, 0, 0)), cast_shadow=False)
    assert color(floor(s.Lobe("SPECULAR", constant(1.0), exponent=0.0), lights=(below,))).max() == 0
    n = np.array([[0.0], [0.0], [1.0]])
    v = np.array([[1.0], [0.0], [0.0]])
    assert blinn_phong(n, v, -v, 5.0)[0] == 0
    assert blinn_phong(n, v, -v, 0.0)[0] == 1


@pytest.mark.parametrize("copies", [2, 100])
def test_coincident_faces_are_lit_as_one(copies: int) -> None:
    base = floor(DIFFUSE, lights=(HARD_LIGHTS[0],))
    many = replace(base, instances=(s.Instances("f", 0, np.repeat(at(), copies, 0), (0,)),))
    assert np.array_equal(color(base), color(many))


def test_visible_lights_show_their_radiance() -> None:
    """Sphere c/(4π² R²), rectangle c/(π A) on its front, sun c/(π sin² α); each counted once,
    before what lies behind.
    """
    camera = s.Camera("PERSPECTIVE", look_at((0, 0, 0), (0, 1, 0)), (-0.1, 0.1, -0.1, 0.1), (1, 1))
    frame, away = look_at((0, 5, 0), (0, 0, 0)), look_at((0, 5, 0), (0, 9, 0))
    shapes = [
        (
            s.Light("l", "POINT", frame, radius=0.5, strength=6.0, visible_camera=True),
            6 / (4 * PI**2 * 0.25),
        ),
        (
            s.Light("l", "AREA", frame, size_x=1.0, size_y=2.0, strength=6.0, visible_camera=True),
            6 / (PI * 2),
        ),
        (
            s.Light(
                "l",
                "AREA",
                frame,
                shape="ELLIPSE",
                size_x=1.0,
                size_y=2.0,
                strength=6.0,
                visible_camera=True,
            ),
            6 / (PI**2 / 2),
        ),
        (
            s.Light("l", "AREA", away, size_x=1.0, size_y=2.0, strength=6.0, visible_camera=True),
            0.0,
        ),
        (
            s.Light("l", "SUN", frame, angle=0.1, strength=6.0, visible_camera=True),
            6 / (PI * np.sin(0.05) ** 2),
        ),
        (s.Light("l", "SUN", frame, angle=0.1, strength=6.0), 0.0),
    ]
    for light, expected in shapes:
        scene = s.Scene(camera, lights=(light,), world=s.World(background=(0.25,) * 3))
        assert np.allclose(color(scene), 0.25 + expected, rtol=1e-14), light
        assert np.allclose(values(scene)["Emission"], expected, rtol=1e-14)
        classic = 6.0 if expected else 0.0
        assert np.allclose(color(scene, illumination="CLASSIC"), 0.25 + classic)


def test_a_light_behind_a_surface_is_not_seen_and_one_between_sheets_is_seen_once() -> None:
    light = s.Light(
        "l",
        "POINT",
        look_at((0, 0, 2), (0, 0, 0), (0, 1, 0)),
        radius=0.5,
        strength=1.0,
        visible_camera=True,
    )
    camera = s.Camera(
        "PERSPECTIVE", look_at((0, 0, 9), (0, 0, 0), (0, 1, 0)), (-0.01, 0.01, -0.01, 0.01), (1, 1)
    )
    clear = material(s.Lobe("TRANSPARENT", constant(0.5)))
    for height, expected in ((8.0, 0.5), (2.0, 1.0), (1.0, 1.0)):
        scene = s.Scene(
            camera,
            (grid_mesh(),),
            (s.Instances("f", 0, at((0, 0, height)), (0,)),),
            (clear,),
            (),
            (light,),
        )
        assert np.allclose(color(scene), expected / PI**2, rtol=1e-14)
    opaque = s.Scene(
        camera,
        (grid_mesh(),),
        (s.Instances("f", 0, at((0, 0, 8)), (0,)),),
        (material(),),
        (),
        (light,),
    )
    assert color(opaque).max() == 0
