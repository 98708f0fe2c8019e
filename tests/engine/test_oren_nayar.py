"""OREN_NAYAR lobes: rough matt surfaces in closed form, what they give back of even light, and what
they throw on.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from glint.engine import Settings
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.reference.closures.oren_nayar import NEVER_LOST, lost_once, oren_nayar
from native_tools import (
    assert_instruction_sets_agree,
    color,
    constant,
    draw,
    lamp,
    material,
    pixel_centers,
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
TILT = 1.1
AXES = np.array(
    [[np.cos(TILT), 0, np.sin(TILT)], [0, 1, 0], [-np.sin(TILT), 0, np.cos(TILT)]]
)  # fmt: skip
SUN = AXES[:, 2]
RADIUS = float(np.float32(0.9))
ROUGHNESSES = (0.0, 0.3, 1.0)
ALBEDO = np.array([0.9, 0.5, 0.1])


def shares(roughness: float, albedo: np.ndarray) -> tuple[float, float, np.ndarray]:
    """A and B of the model, and what of the light that is lost at once comes back after all."""
    a = 1 / (1 + roughness * (0.5 - 2 / (3 * np.pi)))
    b = roughness * a
    given = a + b * (2 / 3 - 28 / (15 * np.pi))
    again = albedo**2 * given / (1 - albedo * (1 - given))
    return a, b, again / max(1 - given, 1e-300)


def rough(roughness: float, albedo: np.ndarray = ALBEDO, **more) -> tuple[s.Lobe, ...]:
    """The three lobes of a rough surface."""
    a, b, again = shares(roughness, albedo)
    return (
        s.Lobe("DIFFUSE", constant(*(a * albedo)), **more),
        s.Lobe("OREN_NAYAR", constant(*(b * albedo)), **more),
        s.Lobe("OREN_NAYAR_MULTIPLE", constant(*(b * b * again * albedo)), **more),
    )


def given_at_once(cosine: np.ndarray, roughness: float) -> np.ndarray:
    """Directional albedo of single scattering, its integral done by hand (Fujii)."""
    a, b, _ = shares(roughness, ALBEDO)
    sine, angle = np.sqrt(1 - cosine**2), np.arccos(cosine)
    tangent = np.divide(sine, cosine, out=np.zeros_like(sine), where=cosine > 0)
    g = sine * (angle - sine * cosine - 2 / 3) + 2 / 3 * tangent * (1 - sine**3)
    return a + b * g / np.pi


def truth(n: np.ndarray, l: np.ndarray, v: np.ndarray, roughness: float) -> np.ndarray:  # noqa: E741
    """(..., 3) of a light that lights a white Lambert surface to n·l."""
    nl, nv = n @ l, n @ v
    lit = (nl > 0) & (nv > 0)
    nl, nv = np.where(lit, nl, 1.0), np.where(lit, nv, 1.0)
    a, b, again = shares(roughness, ALBEDO)
    t = l @ v - nl * nv
    t = np.where(t > 0, t / np.maximum(nl, nv), t)
    lost = (1 - given_at_once(nl, roughness)) * (1 - given_at_once(nv, roughness))
    level = (a + b * t)[..., None] + lost[..., None] * again
    return np.where(lit, nl, 0.0)[..., None] * ALBEDO * level


@BACKENDS
@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_a_ball_under_a_sun(roughness: float, backend: str) -> None:
    scene = balls(*rough(roughness), lights=(lamp("SUN", axes=AXES, strength=np.pi),))
    n, inside = on_ball(RADIUS)
    level = np.where(inside[..., None], truth(n, SUN, np.array([0.0, 0, 1]), roughness), 0.0)
    found = color(scene, backend=backend)
    assert level.max() > 0.2
    np.testing.assert_allclose(found, level, atol=2e-6 * level.max())


@BACKENDS
def test_without_roughness_it_is_lambert(backend: str) -> None:
    lights = (lamp("SUN", axes=AXES, strength=np.pi),)
    smooth, plain = (
        color(balls(*lobes, lights=lights), backend=backend)
        for lobes in (rough(0.0), (s.Lobe("DIFFUSE", constant(*ALBEDO)),))
    )
    assert np.array_equal(smooth, plain)


@BACKENDS
@pytest.mark.parametrize("exponent", [1.5, 0.0])
def test_they_may_depend_on_the_view(exponent: float, backend: str) -> None:
    """As DIFFUSE lobes do: under a varnish."""
    scene = balls(*rough(0.7, exponent=exponent), lights=(lamp("SUN", axes=AXES, strength=np.pi),))
    n, inside = on_ball(RADIUS)
    level = truth(n, SUN, np.array([0.0, 0, 1]), 0.7) * (1 - n[..., 2:]) ** exponent
    level = np.where(inside[..., None], level, 0.0)
    np.testing.assert_allclose(color(scene, backend=backend), level, atol=2e-6 * level.max())


def hemisphere(count: int) -> tuple[np.ndarray, np.ndarray]:
    """(3, m) directions above z = 0, and the solid angle of each."""
    z, angle = np.meshgrid(
        (np.arange(count) + 0.5) / count, (np.arange(2 * count) + 0.5) / count * np.pi
    )
    r = np.sqrt(1 - z * z)
    directions = np.stack([r * np.cos(angle), r * np.sin(angle), z]).reshape(3, -1)
    return directions, np.full(directions.shape[1], 2 * np.pi / directions.shape[1])


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.3, 0.02])
def test_albedos(cosine: float) -> None:
    """By integration over all directions: what is given back at once, and all of it of white."""
    l, weight = hemisphere(1000)  # noqa: E741
    n = np.zeros_like(l)
    n[2] = 1
    v = np.array([np.sqrt(1 - cosine * cosine), 0, cosine])[:, None] * np.ones(l.shape[1])
    turned = (oren_nayar(n, v, l) * weight).sum() / np.pi
    assert turned == pytest.approx(NEVER_LOST - lost_once(np.array(cosine)), abs=2e-5)
    a, b, again = shares(0.8, np.ones(1))
    mean = (l[2] * lost_once(l[2]) * weight).sum() / np.pi
    back = a + b * turned + b * b * again * lost_once(np.array(cosine)) * mean
    assert back == pytest.approx(1, abs=2e-5)


@BACKENDS
def test_a_white_surface_gives_back_all_of_a_uniform_sky(backend: str) -> None:
    sky = s.Light("sky", "DOME", np.eye(3, 4), radiance=np.ones((64, 128, 3), np.float32))
    lobes = rough(1.0, np.ones(3))
    scene = s.Scene(view_from_above(), (square(),), (placed(),), (material(*lobes),), lights=(sky,))
    samples = {"NATIVE": 64, "NUMPY": 16}[backend]
    assert abs(color(scene, backend=backend, samples=samples, light_samples=8).mean() - 1) < 1e-3


def corner(*lobes: s.Lobe, turn: float = 0.0) -> s.Scene:
    """A white floor seen straight from above and a wall of these lobes, which the sun alone
    lights.
    """
    wall = s.Instances(
        "wall", 0, np.array([[[0, 0, 0.9, 0.9], [0, 0.9, 0, 0], [-0.9, 0, 0, 0.9]]]), (1,),
        visible_camera=False,
    )  # fmt: skip
    axes = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
    c, t = np.cos(turn), np.sin(turn)
    axes = np.array([[c, -t, 0], [t, c, 0], [0, 0, 1]]) @ axes
    lights = (lamp("SUN", axes=axes, strength=3.0),)
    lobes = material(s.Lobe("DIFFUSE", constant(0.8))), material(*lobes)
    return s.Scene(view_from_above(), (square(),), (placed(), wall), lobes, lights=lights)


@BACKENDS
@pytest.mark.parametrize("turn", [0.0, 1.2])
def test_it_throws_light_on_to_all_sides(turn: float, backend: str) -> None:
    """The floor's light by an integral over the wall, as bright towards each place as the model
    says.
    """
    x, y, _ = pixel_centers()[4:12, 4:12].reshape(-1, 3).T
    u, v = np.meshgrid((np.arange(180) + 0.5) / 90 - 1, (np.arange(108) + 0.5) / 108)
    q = np.stack([np.full(u.size, 0.9), 4.5 * u.ravel(), 5.4 * v.ravel()], -1)  # above the floor
    n, sun = np.array([-1.0, 0, 0]), np.array([-np.cos(turn), -np.sin(turn), 0])
    wanted = np.zeros(3)
    for place in np.stack([x, y, 0 * x], -1):
        to = place - q
        far = np.linalg.norm(to, axis=-1)
        form = np.maximum(to @ n, 0) * np.maximum(-to[:, 2], 0) / far**4
        wanted += (form[:, None] * truth(n, sun, (to / far[:, None]).T, 1.0)).sum(0) * 0.05**2
    wanted *= 0.8 / np.pi * 3.0 / np.pi / len(x)
    samples = {"NATIVE": 256, "NUMPY": 16}[backend]
    options = {"backend": backend, "soft_light": "DEALT", "samples": samples}
    found = color(corner(*rough(1.0), turn=turn), diffuse_bounces=1, **options)
    assert wanted.min() > 0.001
    np.testing.assert_allclose(found[4:12, 4:12].mean((0, 1)), wanted, rtol=0.02)


def many() -> s.Scene:
    """Rough lobes beside others, on a ball and its floor, in sun, lamps and bounced light."""
    lobes = (
        *rough(0.6),
        *rough(0.9, ALBEDO[::-1] / 4, exponent=2.0),
        s.Lobe("SHEEN", constant(0.1), width=0.5, lean=0.2),
        s.Lobe("SPECULAR", constant(0.2), exponent=50.0, masking=0.2, fresnel=True, ior=1.5),
    )
    return lit_ball(AXES, material(*lobes), material(*rough(1.0)))


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
    names = "Diffuse", "Specular", "Diffuse Color", "Diffuse Direct", "Diffuse Indirect"
    assert_tracers_agree(many(), *names, reflections=reflections, **OPTIONS)


@BACKENDS
@pytest.mark.parametrize("roughness", [0.4, 1.0])
def test_its_colour_is_that_of_a_smooth_surface(roughness: float, backend: str) -> None:
    scene = balls(*rough(roughness), lights=(lamp("SUN", axes=AXES),))
    found = draw(scene, "Diffuse Color", backend=backend).passes["Diffuse Color"]
    inside = on_ball(RADIUS)[1]
    np.testing.assert_allclose(found[inside], np.tile(ALBEDO, (inside.sum(), 1)), rtol=1e-6)


def test_explained_pixels_have_the_colours_of_the_picture() -> None:
    picture = draw(many(), samples=1).combined
    explainer = PixelExplainer(many(), Settings(samples=1, light_samples=1))
    for x, y in ((8, 8), (5, 9), (1, 1)):
        np.testing.assert_allclose(explainer.pixel(x, y).color, picture[y, x, :3], rtol=1e-3)
