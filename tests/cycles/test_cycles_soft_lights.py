"""Soft lights against Cycles at many samples, within Cycles' own noise.

Two Cycles renders a, b of different seeds give the mean m and its noise: E (a − b)²/4 is the
variance of m, pooled over 5×5 pixels. Glint's own discretisation is its change from half as many
light samples. z = (glint − m) / √(both): its root mean square is 1 where Glint is right (√(1 +
2/25) with a variance from 25 pixels), and the mean over the picture bares a bias far below a single
pixel's noise.
"""

from dataclasses import replace
from functools import lru_cache
from math import radians

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint.engine import Film
from glint_picture import BACKENDS, Pair, interior, render_glint, spread, verdict

SIDE = 40
CYCLES_SAMPLES = 384
KEY = (1.6, -1.2, 3.2)
SPOT = {"energy": 400.0, "shadow_soft_size": 0.3, "spot_size": radians(60), "spot_blend": 0.4}
SOFT_LIGHTS = {
    "point_sphere": (
        "POINT",
        {"energy": 150.0, "shadow_soft_size": 0.5, "use_soft_falloff": False},
    ),
    "point_falloff": (
        "POINT",
        {"energy": 150.0, "shadow_soft_size": 0.5, "use_soft_falloff": True},
    ),
    "spot_sphere": ("SPOT", SPOT | {"use_soft_falloff": False}),
    "spot_falloff": ("SPOT", SPOT | {"use_soft_falloff": True}),
    "point_around": (
        "POINT",
        {"energy": 150.0, "shadow_soft_size": 9.0, "use_soft_falloff": False},
    ),
    "sun": ("SUN", {"energy": 2.0, "angle": radians(12)}),
    "sun_wide": ("SUN", {"energy": 2.0, "angle": radians(35)}),
    "area_square": ("AREA", {"energy": 80.0, "shape": "SQUARE", "size": 1.2}),
    "area_rectangle": ("AREA", {"energy": 80.0, "shape": "RECTANGLE", "size": 2.0, "size_y": 0.5}),
    "area_disk": ("AREA", {"energy": 80.0, "shape": "DISK", "size": 1.4}),
    "area_spread": ("AREA", {"energy": 80.0, "size": 1.2, "spread": radians(100)}),
    "disk_spread": ("AREA", {"energy": 9.0, "shape": "DISK", "size": 1.8, "spread": radians(40)}),
    "area_beam": ("AREA", {"energy": 1.0, "size": 1.2, "spread": radians(2)}),
    "area_ellipse": ("AREA", {"energy": 80.0, "shape": "ELLIPSE", "size": 2.0, "size_y": 0.8}),
}


def build_scene(light: str):
    kind, properties = SOFT_LIGHTS[light]
    scene = cycles.empty_scene(SIDE, SIDE)
    build.add(scene, "Floor", build.plane(5.0, build.lambert((0.8, 0.8, 0.8))))
    build.add(
        scene,
        "Plate",
        build.cube(build.lambert((0.6, 0.6, 0.6))),
        build.moved(-0.2, 0.3, 1.3, 0.6, 0.6, 0.05),
    )
    build.add_camera(scene)
    build.add_light(scene, kind, KEY, (-0.2, 0.3, 0.2), **properties)
    return scene


@lru_cache
def reference(light: str) -> tuple[dict, np.ndarray, np.ndarray]:
    """Cycles' passes, the mean of two seeds, and the variance of that mean."""
    scene = build_scene(light)
    passes = cycles.render_cycles(scene, CYCLES_SAMPLES, 1)
    first, second = (
        p["Combined"][..., 0].astype(float)
        for p in (passes, cycles.render_cycles(scene, CYCLES_SAMPLES, 2))
    )
    return passes, (first + second) / 2, box_mean((first - second) ** 2 / 4)


def box_mean(values: np.ndarray, half: int = 2) -> np.ndarray:
    """Mean over a square of 2·half + 1 pixels; edge pixels repeat."""
    padded = np.pad(values, half, mode="edge")
    size = 2 * half + 1
    return (
        sum(
            padded[i : i + values.shape[0], j : j + values.shape[1]]
            for i in range(size)
            for j in range(size)
        )
        / size**2
    )


def pair_of(name: str, passes: dict[str, np.ndarray], film: Film) -> Pair:
    """Cycles' passes beside those of Glint's film."""
    return Pair(name, passes, {k: np.squeeze(v) for k, v in film.passes.items()})


@lru_cache
def core(light: str) -> tuple[Film, np.ndarray]:
    """Its picture, and the square of what half as many light samples change."""
    scene = build_scene(light)
    coarse, fine = (render_glint(scene, "NATIVE", light_samples=n) for n in (256, 512))
    return fine, (fine.combined[..., 0].astype(float) - coarse.combined[..., 0]) ** 2


@pytest.mark.parametrize(
    ("light", "backend"),
    [
        pytest.param(
            light,
            backend,
            marks=pytest.mark.slow if backend == "NUMPY" and number % 3 else (),
        )
        for number, light in enumerate(SOFT_LIGHTS)
        for backend in BACKENDS
    ],
)
def test_soft_light(light, backend):
    passes, mean, variance = reference(light)
    fine, own = core(light)
    part = np.s_[:, :]
    if backend == "NUMPY":  # where the plate's shadow is
        part, region = np.s_[12:30, 10:30], (10, 12, 30, 30)
        fine = render_glint(build_scene(light), backend, light_samples=512, region=region)
    passes = {name: values[part] for name, values in passes.items()}
    mean, variance, own = mean[part], variance[part], own[part]
    pair = pair_of(f"soft-{light}-{backend.lower()}", passes, fine)
    inside = interior(pair)
    picture = fine.combined[..., 0].astype(float)
    rounding = (1e-4 * mean.max()) ** 2
    z = (picture - mean) / np.sqrt(variance + box_mean(own) + rounding)
    bias = abs((picture - mean)[inside].sum()) / mean[inside].sum()
    noise = np.sqrt(variance[inside].sum()) / mean[inside].sum()
    verdict(
        pair, f"z of {np.sqrt((z[inside] ** 2).mean()):.2f} on average", np.abs(z) * inside, 6.0
    )
    assert np.sqrt((z[inside] ** 2).mean()) < 1.3
    assert bias < 4 * noise + 1e-4 + np.sqrt(own[inside].mean()) / mean[inside].mean()


def larger(scene, factor: float):
    """An engine scene with lights `factor` times their size, of the same power."""
    names = ("radius", "angle", "size_x", "size_y")
    return replace(
        scene,
        lights=tuple(
            replace(light, **{n: factor * getattr(light, n) for n in names})
            for light in scene.lights
        ),
    )


@pytest.mark.slow
@pytest.mark.parametrize("light", SOFT_LIGHTS)
def test_size_of_the_light(light):
    """The size that Cycles' penumbra shows, by least squares along Glint's derivative with respect
    to it, is the one exported.

    Away from edges: one pixel's centre lies on the plate's silhouette, and Cycles' samples, 4e-6 px
    apart, meet both sides of it. σ: of Cycles' noise. Glint's discretisation falls faster than with
    the root of the samples, but unevenly: the larger of what a quarter and a half of the light
    samples change is more than what is left. With σ it is below 1 %: no light can be 1.1 % too
    large.
    """
    passes, mean, variance = reference(light)
    scene, step = build_scene(light), 0.05
    films = [
        render_glint(scene, "NATIVE", light_samples=n, edit=lambda s, f=f: larger(s, f))
        for n, f in ((1024, 1.0), (2048, 1.0), (4096, 1.0), (4096, 1 - step), (4096, 1 + step))
    ]
    quarter, half, fine, smaller, bigger = (film.combined[..., 0].astype(float) for film in films)
    inside = interior(pair_of(f"size-{light}", passes, films[2]))
    slope, weight = (bigger - smaller) / (2 * step), inside / (variance + (1e-4 * mean.max()) ** 2)
    sigma = np.sum(weight * slope**2) ** -0.5
    size, *changes = (
        np.sum(weight * slope * difference) * sigma**2
        for difference in (mean - fine, fine - quarter, fine - half)
    )
    own = max(map(abs, changes))
    assert 4 * sigma + own < 0.01
    assert abs(size) < 4 * sigma + own, (
        f"Cycles' {light} is {size:.2%} larger, σ {sigma:.2%}, discretisation {own:.2%}"
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_light_sample_is_the_hard_shadow(backend):
    """With light_samples = 1 a soft point light gives the picture of a hard one."""
    pictures = []
    for radius in (0.0, 0.5):
        scene = build_scene("point_falloff")
        scene.objects["Light"].data.shadow_soft_size = radius
        pictures.append(render_glint(scene, backend).combined)
    assert np.abs(pictures[0] - pictures[1]).max() <= 1e-6 * pictures[0].max()


def test_the_noise_is_small():
    """The check above has teeth: Cycles' own noise is below 2 % of the picture's mean, also in the
    penumbra.
    """
    for light in ("point_falloff", "area_rectangle"):
        _, mean, variance = reference(light)
        assert np.sqrt(spread(variance, True).max()) < 0.02 * mean.mean()
