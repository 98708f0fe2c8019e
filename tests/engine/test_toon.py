"""TOON lobes: even within an angle and nothing beyond its smooth edge, in closed form, and what
they throw on.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from glint.engine import scene as s
from native_tools import (
    assert_instruction_sets_agree,
    color,
    constant,
    lamp,
    material,
    placed,
    square,
    view_from_above,
)
from surface_scenes import (
    assert_borders_change_nothing,
    assert_tracers_agree,
    balls,
    hash_of,
    lit_ball,
    on_ball,
)

BACKENDS = pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
TILT = 0.7
AXES = np.array(
    [[np.cos(TILT), 0, np.sin(TILT)], [0, 1, 0], [-np.sin(TILT), 0, np.cos(TILT)]]
)  # fmt: skip
SHAPES = pytest.mark.parametrize(
    ("size", "smooth"), [(0.5, 0.0), (0.3, 0.4), (0.9, 0.5), (0.02, 0.1), (1.0, 0.0)]
)
RADIUS = float(np.float32(0.9))


def share(angle: np.ndarray, size: float, smooth: float) -> np.ndarray:
    """Of Cycles: over the solid angle of all that it reaches, times pi."""
    whole, edge = size * np.pi / 2, smooth * np.pi / 2
    end = min(whole + edge, np.pi / 2)
    beside = 1 - (angle - whole) / edge if edge else np.zeros_like(angle)
    level = np.where(angle < whole, 1.0, beside)
    return np.where(angle < end, level / (2 * (1 - np.cos(end))), 0.0)


def assert_close(measured: np.ndarray, truth: np.ndarray) -> None:
    """But for a pixel or two whose angle is that of an edge, to rounding."""
    assert truth.max() > 0
    off = np.abs(measured - truth) > 1e-5 * truth.max()
    assert off.sum() <= 0.005 * truth.size, np.abs(measured - truth).max()


@BACKENDS
@SHAPES
def test_bands_of_the_diffuse_one(size: float, smooth: float, backend: str) -> None:
    lobe = s.Lobe("TOON_DIFFUSE", constant(0.8, 0.6, 0.4), size=size, smooth=smooth)
    scene = balls(lobe, lights=(lamp("SUN", axes=AXES, strength=np.pi),))
    n, inside = on_ball(RADIUS)
    cosine = n @ AXES[:, 2]
    level = np.where(
        inside & (cosine > 0), share(np.arccos(np.clip(cosine, 0, 1)), size, smooth), 0
    )
    assert_close(color(scene, backend=backend), level[..., None] * [0.8, 0.6, 0.4])


@BACKENDS
@SHAPES
def test_bands_of_the_glossy_one(size: float, smooth: float, backend: str) -> None:
    """Round the mirrored ray, where the surface faces light and viewer."""
    lobe = s.Lobe("TOON_SPECULAR", constant(0.5), size=size, smooth=smooth)
    scene = balls(lobe, lights=(lamp("SUN", axes=AXES, strength=np.pi),))
    n, inside = on_ball(RADIUS)
    mirrored = 2 * n[..., 2:] * n - [0, 0, 1]
    angle = np.arccos(np.clip(mirrored @ AXES[:, 2], 0, 1))
    lit = inside & (n @ AXES[:, 2] > 0)
    truth = np.where(lit, 0.5 * share(angle, size, smooth), 0)
    assert_close(color(scene, backend=backend), np.repeat(truth[..., None], 3, -1))


@BACKENDS
@pytest.mark.parametrize(("size", "smooth"), [(0.5, 0.0), (0.4, 0.4), (0.8, 0.6)])
def test_a_uniform_sky(size: float, smooth: float, backend: str) -> None:
    """Gives back the mean of its level over the solid angle that it reaches."""
    lobe = s.Lobe("TOON_DIFFUSE", constant(0.5), size=size, smooth=smooth)
    sky = s.Light("sky", "DOME", np.eye(3, 4), radiance=np.ones((8, 16, 3), np.float32))
    scene = s.Scene(view_from_above(), (square(),), (placed(),), (material(lobe),), lights=(sky,))
    angle = (np.arange(4000) + 0.5) / 4000 * np.pi / 2
    mean = (share(angle, size, smooth) * np.sin(angle)).mean() * np.pi
    samples = {"NATIVE": 64, "NUMPY": 16}[backend]
    found = color(scene, backend=backend, samples=samples, light_samples=8).mean()
    assert abs(found / (0.5 * mean) - 1) < 0.01


def corner(lobe: s.Lobe) -> s.Scene:
    """A white floor beside a wall, of which the sun lights the wall alone."""
    wall = s.Instances(
        "wall", 0, np.array([[[0, 0, 0.9, 0.9], [0, 0.9, 0, 0], [-0.9, 0, 0, 0.9]]]), (1,),
        visible_camera=False,
    )  # fmt: skip
    sun = lamp("SUN", axes=np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), strength=3.0)
    lobes = material(s.Lobe("DIFFUSE", constant(0.8))), material(lobe)
    return s.Scene(view_from_above(), (square(),), (placed(), wall), lobes, lights=(sun,))


@BACKENDS
@pytest.mark.parametrize(("size", "smooth"), [(1.0, 0.0), (0.4, 0.0), (0.5, 0.4)])
def test_it_throws_light_on_as_what_is_diffuse(size: float, smooth: float, backend: str) -> None:
    """As what is as bright as its band where light falls straight on it, seen from any side."""
    albedo = share(np.zeros(1), size, smooth)[0]
    toon = s.Lobe("TOON_DIFFUSE", constant(0.5), size=size, smooth=smooth)
    options = {"backend": backend, "diffuse_bounces": 1, "samples": 4}
    lit, truth = (
        color(corner(lobe), **options) for lobe in (toon, s.Lobe("DIFFUSE", constant(0.5 * albedo)))
    )
    assert truth.max() > 0.01
    np.testing.assert_allclose(lit, truth, rtol=1e-5, atol=1e-7)


def many() -> s.Scene:
    """Lobes of both kinds, a metal's edge and a hole, in sun, lamps and bounced light."""
    lobes = (
        s.Lobe("TOON_DIFFUSE", constant(0.5, 0.3, 0.2), size=0.4, smooth=0.2),
        s.Lobe("TOON_SPECULAR", constant(0.2), size=0.2, smooth=0.05),
        s.Lobe("SPECULAR", constant(0.2), exponent=50.0, masking=0.2, fresnel=True, ior=1.5),
        s.Lobe("SPECULAR", constant(-0.1), exponent=50.0, masking=0.2, edge=True),
        s.Lobe("HOLDOUT", constant(0.1)),
    )
    return lit_ball(AXES, material(*lobes), material(s.Lobe("DIFFUSE")))


OPTIONS = {"samples": 4, "light_samples": 2, "diffuse_bounces": 1, "max_bounces": 2}


@functools.cache
def hashes(threads: int = 0) -> str:
    return hash_of(many(), threads=threads, **OPTIONS)


def test_instruction_sets_and_threads_change_nothing() -> None:
    assert assert_instruction_sets_agree(hashes) == hashes(1)


def test_borders_change_nothing() -> None:
    assert_borders_change_nothing(many(), **OPTIONS)


@pytest.mark.parametrize("reflections", ["ALL", "OFF"])
def test_both_tracers_draw_the_same(reflections: str) -> None:
    """Parts, colours and light by the surface that gives it back."""
    names = "Diffuse", "Specular", "Diffuse Color", "Glossy Color", "Diffuse Indirect"
    assert_tracers_agree(many(), *names, reflections=reflections, **OPTIONS)
