"""Closed forms of rays that go on: mirrors, glass, transparent sheets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import at, constant, grid_mesh, look_at
from floor_views import unit, viewing_rays
from glint.engine import scene as s
from glint.engine.program.execute.inputs import fresnel_dielectric
from glint.engine.reference.bumps import lifted
from glint.engine.reference.optics import reflected, refracted
from test_reference_support import (
    DIFFUSE,
    K_D,
    PI,
    VIEW,
    color,
    floor,
    material,
    values,
)


@pytest.mark.parametrize("bounces", [0, 1, 5, 12])
def test_mirror_corridor_is_a_geometric_series(bounces: int) -> None:
    """Two parallel mirrors of k_m = 0.7 that glow with 1: Σ 0.7^j for j <= bounces."""
    walls = (s.Instances("w", 0, np.concatenate([at((0, 0, -1)), at((0, 0, 1))]), (0,)),)
    lobes = (s.Lobe("EMISSION", constant(1.0)), s.Lobe("MIRROR", constant(0.7)))
    camera = s.Camera(
        "PERSPECTIVE",
        look_at((0, 0, 0), (0.1, 0.0, 1.0), (0, 1, 0)),
        (-0.1, 0.1, -0.1, 0.1),
        (3, 3),
    )
    found = values(
        s.Scene(camera, (grid_mesh(1, 50.0),), walls, (material(*lobes),)), max_bounces=bounces
    )
    assert np.allclose(found["Combined"][..., :3], (1 - 0.7 ** (bounces + 1)) / 0.3, rtol=1e-14)
    assert np.allclose(found["Mirror"], (1 - 0.7 ** (bounces + 1)) / 0.3 - 1, rtol=1e-14)


def test_fresnel_at_normal_incidence_brewster_and_total_reflection() -> None:
    assert fresnel_dielectric(np.array([1.0]), np.array([1.5]))[0] == pytest.approx(0.04, rel=1e-14)
    brewster = np.cos(np.arctan(1.5))  # only one polarisation is left: half of sin²(θ − θ')
    assert fresnel_dielectric(np.array([brewster]), np.array([1.5]))[0] == pytest.approx(
        0.5 * np.cos(2 * np.arctan(1.5)) ** 2, rel=1e-13
    )
    cosine = np.array([0.2, np.cos(np.arcsin(1 / 1.5)) * (1 - 1e-9), 0.9])
    assert np.array_equal(fresnel_dielectric(cosine, np.full(3, 1 / 1.5)) == 1, [True, True, False])


def slab(ior: float, down: bool = True) -> s.Scene:
    """Looking through the one face z = 0 of glass at a glowing floor below, from above or from
    inside.
    """
    glass = material(
        s.Lobe("REFRACTION", constant(1.0), ior=ior, fresnel=True),
        s.Lobe("MIRROR", constant(1.0), ior=ior, fresnel=True),
    )
    glow = s.Material("glow", (s.Lobe("EMISSION", constant(1.0)),))
    flip = 1.0 if down else -1.0
    placed = (
        s.Instances("glass", 0, at((0, 0, 0), np.diag([1, flip, flip])), (0,)),
        s.Instances("floor", 0, at((0, 0, -3)), (1,)),
    )
    return s.Scene(VIEW, (grid_mesh(1, 500.0),), placed, (glass, glow))


@pytest.mark.parametrize("down", [True, False])
def test_refraction_carries_what_fresnel_leaves(down: bool) -> None:
    _, d = viewing_rays(VIEW)
    cosine, index = -unit(d)[..., 2], 1.5 if down else 1 / 1.5
    found = color(slab(1.5, down))
    assert np.allclose(found[..., 0], 1 - fresnel_dielectric(cosine, index), rtol=1e-12, atol=1e-15)
    assert down or (found == 0).any()  # total reflection


def test_reflected_and_refracted_rays_are_both_followed() -> None:
    """F of a ceiling that glows with 2 and 1 − F of a floor that glows with 1."""
    scene = slab(1.5)
    ceiling = s.Instances("ceiling", 0, at((0, 0, 10)), (2,))
    bright = s.Material("bright", (s.Lobe("EMISSION", constant(2.0)),))
    scene = replace(
        scene, instances=(*scene.instances, ceiling), materials=(*scene.materials, bright)
    )
    _, d = viewing_rays(VIEW)
    assert np.allclose(
        color(scene)[..., 0], 1 + fresnel_dielectric(-unit(d)[..., 2], 1.5), rtol=1e-12
    )


def test_refracted_rays_obey_snell() -> None:
    """The floor under glass shows the place that the bent ray reaches: its emission is a texture of
    x and y.
    """
    ramp = np.zeros((2, 2, 4), np.float32)
    ramp[..., 0], ramp[..., 1], ramp[..., 3] = [[0, 1], [0, 1]], [[0, 0], [1, 1]], 1
    texture = s.Texture("ramp", ramp, extension="EXTEND")
    # uv of the grid is (x + 500)/1000; from there to x/40 + 1/2, with texel centres at 1/4 and 3/4
    uv = ((12.5, 0.0, -5.75), (0.0, 12.5, -5.75))
    scene = slab(1.5)
    glow = s.Material("glow", (s.Lobe("EMISSION", (s.Input(texture=0, uv_transform=uv),)),))
    glass = material(s.Lobe("REFRACTION", constant(1.0), ior=1.5))
    found = color(replace(scene, materials=(glass, glow), textures=(texture,)))
    o, d = viewing_rays(VIEW)
    d = unit(d)
    entry = o - d * (o[..., 2:] / d[..., 2:])
    sideways = d[..., :2] / 1.5
    reached = entry[..., :2] + 3 * sideways / np.sqrt(1 - (sideways**2).sum(-1, keepdims=True))
    assert np.allclose(found[..., :2], reached / 40 + 0.5, atol=1e-7)  # the UV map is float32


@pytest.mark.parametrize("steep", [0.1, 1e-4])
def test_shading_normals_are_lifted_until_what_they_mirror_leaves_the_surface(steep: float) -> None:
    """As high as 0.01, or nine tenths of the way that the ray comes from, in the plane of both."""
    g = np.array([[0.0], [0.0], [1.0]])
    d = unit(np.array([1.0, 0.0, -steep]))[:, None]
    towards, away = (unit(np.array([x, 0.0, 1.0]))[:, None] for x in (-0.3, 0.3))
    assert np.array_equal(lifted(towards, g, -d), towards)
    n = lifted(away, g, -d)
    high = reflected(d, n)
    assert np.allclose([np.linalg.norm(n), n[1, 0]], [1, 0])
    assert high[2] == pytest.approx(min(0.01, -0.9 * d[2, 0]), rel=1e-9)
    assert high[0] > 0.9
    bent, passes = refracted(d, n, np.array([1.5]))
    assert passes[0]
    assert bent[2] < -0.5


def test_alpha_compositing() -> None:
    """c = α c_f + (1 − α) c_b (section 3.6b), and alpha 1 − (1 − α)² of two sheets before
    nothing.
    """
    alpha = 0.3
    leaf = material(
        s.Lobe("EMISSION", constant(0.9 * alpha)), s.Lobe("TRANSPARENT", constant(1 - alpha))
    )
    camera = s.Camera(
        "ORTHOGRAPHIC", look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), (-1, 1, -1, 1), (4, 4)
    )
    sheets = (s.Instances("s", 0, np.concatenate([at((0, 0, 1)), at((0, 0, 2))]), (0,)),)
    scene = s.Scene(
        camera, (grid_mesh(),), sheets, (leaf,), world=s.World(background=(0.2, 0.2, 0.2))
    )
    over = alpha * 0.9 + (1 - alpha) * (alpha * 0.9 + (1 - alpha) * 0.2)
    assert np.allclose(color(scene), over, rtol=1e-14)
    clear = values(
        replace(scene, world=s.World(transparent=True, background=(0.2, 0.2, 0.2))), samples=3
    )
    assert np.allclose(clear["Combined"][..., 3], 1 - (1 - alpha) ** 2, rtol=1e-14)


def test_coincident_sheets_are_passed_as_one() -> None:
    """Two sheets cut along different diagonals, whose depths differ by rounding, and rays through
    both diagonals.
    """
    quad = grid_mesh(1, 3.0)
    other = replace(quad, triangles=np.array([[0, 1, 2], [1, 3, 2]], np.uint32))
    camera = s.Camera(
        "PERSPECTIVE", look_at((0.1, -1, 2.3), (0, 0, 0)), (-0.3, 0.3, -0.3, 0.3), (41, 41)
    )
    tilt = at((0, 0, 0), np.array([[1, 0, 0.1], [0.2, 1, 0], [0.3, 0.7, 1]]))
    sheets = (s.Instances("a", 0, tilt, (0,)), s.Instances("b", 1, tilt, (0,)))
    clear = material(s.Lobe("TRANSPARENT", constant(0.5)))
    scene = s.Scene(camera, (quad, other), sheets, (clear,), world=s.World(background=(1.0,) * 3))
    assert (color(scene) == 0.5).all()


def test_transparent_surfaces_end_after_128() -> None:
    sheets = np.concatenate([at((0, 0, -0.01 * k)) for k in range(129)])
    for k, count, expected in ((0.5, 128, 0.5**128), (0.5, 129, 0.0), (1.0, 129, 1.0)):
        camera = s.Camera(
            "ORTHOGRAPHIC", look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), (-1, 1, -1, 1), (2, 2)
        )
        clear, world = material(s.Lobe("TRANSPARENT", constant(k))), s.World(background=(1.0,) * 3)
        scene = s.Scene(
            camera,
            (grid_mesh(),),
            (s.Instances("s", 0, sheets[:count], (0,)),),
            (clear,),
            world=world,
        )
        assert np.allclose(color(scene), expected, rtol=1e-13, atol=0)


def test_coloured_shadows_multiply() -> None:
    """Two foils between the sun and the floor; the Shadow part is what they take away."""
    foil = s.Material("foil", (s.Lobe("TRANSPARENT", constant(0.9, 0.5, 0.1)),))
    sun = s.Light("sun", "SUN", look_at((0, 0, 9), (0, 0, 0), (0, 1, 0)))
    base = floor(DIFFUSE, lights=(sun,))
    foils = s.Instances(
        "foils", 0, np.concatenate([at((0, 0, 4)), at((0, 0, 5))]), (1,), visible_camera=False
    )
    found = values(
        replace(base, instances=(*base.instances, foils), materials=(*base.materials, foil))
    )
    assert np.allclose(
        found["Combined"][..., :3], K_D / PI * np.array([0.81, 0.25, 0.01]), rtol=1e-14
    )
    assert np.allclose(found["Diffuse"], K_D / PI, rtol=1e-14)
    assert np.allclose(found["Shadow"], K_D / PI * (np.array([0.81, 0.25, 0.01]) - 1), rtol=1e-13)
