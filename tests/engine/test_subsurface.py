"""Light that goes below a surface and comes out of it elsewhere: closed forms, and both tracers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import grid_mesh
from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.reference.subsurface import REACH, Profile, within
from glint.engine.sampling import subsurface_points
from native_tools import lamp, needs_core, pixel_centers, placed, square, view_from_above
from surface_scenes import SUN, plane

BACKENDS = ["NATIVE", "NUMPY"]
K = (0.8, 0.5, 0.3)
RADIUS = (0.05, 0.02, 0.01)


def skin(radius=RADIUS, k=K) -> s.Lobe:
    return s.Lobe("DIFFUSE", (s.Input(k),), radius=radius)


def picture(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    plan = {"samples": 16, "filter_width": 0.0, **settings}
    return render(scene, Settings(backend=backend, **plan)).combined[..., :3]


def slab(lobe: s.Lobe, *lights: s.Light, size: float = 20.0, **more) -> s.Scene:
    look = s.Material("slab", (lobe,))
    return s.Scene(
        view_from_above(), (square(size),), (placed(),), (look,), (), lights, s.World(), **more
    )


@pytest.mark.parametrize("radius", [(1.0, 1.0, 1.0), (1.0, 0.3, 0.02)])
def test_the_profile_is_whole_and_its_rings_are_shares_of_it(radius: tuple) -> None:
    def of(count: int) -> Profile:
        d = np.repeat(np.array(radius)[:, None], count, 1)
        return Profile(d, d > 0)

    r = np.linspace(0, REACH, 200001)
    middle = (r[1:] + r[:-1]) / 2
    dense = (np.exp(-middle) + np.exp(-middle / 3)) / (8 * np.pi * middle)
    total = (dense * 2 * np.pi * middle).sum() * (r[1] - r[0])
    assert abs(total - within(np.array(REACH), np.array(1.0))) < 1e-6 and total > 0.996
    shares = np.array([0.1, 0.5, 0.9])
    np.testing.assert_allclose(of(3).mean(of(3).radius(shares)), shares, atol=1e-12)
    bounds = of(9).radius(np.linspace(0, 1, 9))
    rings = of(8).ring(bounds[:-1], bounds[1:])
    np.testing.assert_allclose(rings.mean(1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(rings.mean(0), 1.0, rtol=1e-9)


@pytest.mark.parametrize("samples", [1, 6, 16, 64])
def test_samples_divide_the_light_among_them(samples: int) -> None:
    points = subsurface_points(samples)
    assert points.shape == (4, samples, 6)
    edges = np.sort(points[0, :, 0])
    np.testing.assert_allclose(edges, np.arange(samples) / samples)
    np.testing.assert_allclose(points[..., 2] - points[..., 0], 1 / samples)
    assert (points[..., 0] < points[..., 1]).all() and (points[..., 1] < points[..., 2]).all()
    np.testing.assert_allclose(np.hypot(points[..., 3], points[..., 4]), 1)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("samples", [16, 64])
@pytest.mark.parametrize("radius", [RADIUS, (0.3, 0.0, 0.1), (1e-6, 1e-6, 1e-6)])
def test_an_evenly_lit_slab_is_as_diffuse(radius: tuple, samples: int, backend: str) -> None:
    found = picture(slab(skin(radius), SUN), backend, samples=samples)
    matt = picture(slab(replace(skin(), radius=(0.0, 0.0, 0.0)), SUN), backend, samples=1)
    np.testing.assert_allclose(found, matt, rtol=1e-3)
    assert matt.min() > 0.1


@pytest.mark.parametrize("backend", BACKENDS)
def test_without_the_setting_it_is_diffuse(backend: str) -> None:
    scene, matt = (slab(skin(radius), SUN) for radius in (RADIUS, (0.0, 0.0, 0.0)))
    found = picture(scene, backend, subsurface="OFF")
    np.testing.assert_array_equal(found, picture(matt, backend))


def half_lit(lobe: s.Lobe) -> s.Scene:
    """The sun comes past the edge of a sheet at x = 0 that no camera sees."""
    scene = slab(lobe, SUN)
    sheet = replace(placed(z=1.0), visible_camera=False)
    sheet.world_from_object[0, 0, 3] = 20.0
    return replace(scene, instances=(*scene.instances, sheet))


def spread(x: np.ndarray, d: float) -> np.ndarray:
    """The share of the light at x that was given to the half plane below 0."""
    r = np.linspace(0, 40 * d, 40001)
    middle = ((r[1:] + r[:-1]) / 2)[:, None]
    ring = (np.exp(-middle / d) + np.exp(-middle / (3 * d))) / (4 * d) * (r[1] - r[0])
    inside = np.arccos(np.clip(x / middle, -1, 1)) / np.pi
    return (ring * inside).sum(0)


@needs_core
def test_the_edge_of_light_is_as_wide_as_the_profile() -> None:
    """The integral of the profile over the lit half plane."""
    radius = (0.10, 0.05, 0.02)
    scene = half_lit(skin(radius, (1.0, 1.0, 1.0)))
    found = picture(scene, samples=256).mean(0)
    full = picture(slab(skin(radius, (1.0, 1.0, 1.0)), SUN), samples=4).mean((0, 1))
    x = pixel_centers()[0, :, 0]
    for c, d in enumerate(radius):
        expected = spread(x, d)
        assert np.abs(found[:, c] / full[c] - expected).max() < 0.015, (c, found[:, c], expected)
        assert expected.max() > 0.9 and expected.min() < 0.1


def hills(lobe: s.Lobe, *lights: s.Light, **more) -> s.Scene:
    """A smooth hilly sheet with a small plate over it."""
    sheet = grid_mesh(12, 2.0, lambda x, y: 0.3 * np.sin(2 * x) * np.cos(3 * y), smooth=True)
    plate = s.Material("plate", (s.Lobe("DIFFUSE", (s.Input((0.5,) * 3),)),))
    look = s.Material("sheet", (lobe, s.Lobe("SPECULAR", (s.Input((0.2,) * 3),), 20.0)))
    instances = (placed(), replace(placed(1, (1,), z=1.0), visible_camera=False))
    view = view_from_above()
    return s.Scene(
        view, (sheet, square(0.5)), instances, (look, plate), (), lights, s.World(), **more
    )


def sky() -> np.ndarray:
    rows = np.linspace(0.1, 2.0, 16)[:, None, None]
    return np.broadcast_to(rows, (16, 32, 3)).astype(np.float32).copy()


LIGHTS = {
    "sun": lamp("SUN", (0, 0, 0), np.eye(3), strength=3.0, angle=0.2),
    "area": lamp("AREA", (0.3, 0.2, 3), np.eye(3), strength=300.0, size_x=2.0, size_y=1.0),
    "point": lamp("POINT", (0.3, 0.2, 3), np.eye(3), strength=300.0, radius=0.0),
    "sky": s.Light("sky", "DOME", np.eye(4)[:3], radiance=sky()),
}


@needs_core
@pytest.mark.parametrize("more", [{}, {"diffuse_bounces": 2}], ids=["direct", "bounced"])
@pytest.mark.parametrize("name", LIGHTS)
def test_both_tracers_agree(name: str, more: dict) -> None:
    scene = hills(skin((0.2, 0.1, 0.05)), LIGHTS[name])
    found, expected = (
        picture(scene, backend, samples=4, light_samples=2, **more) for backend in BACKENDS
    )
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * expected.max())
    assert np.abs(expected - picture(scene, samples=4, subsurface="OFF", **more)).max() > 0.01
