"""Light that media scatter once (semantics/media.md): closed forms and integrals worked out
densely, and the core against the reference.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import at, ball_mesh, box_mesh, constant, grid_mesh, light, surface
from glint import engine
from glint.engine import sampling
from glint.engine import scene as s
from media_scenes import GLASS, both, filled, orthographic, rich, things

BACKENDS = ("NATIVE", "NUMPY")
FOG = s.Medium((0.1, 0.05, 0.0), (0.2, 0.3, 0.1), anisotropy=0.4)
SCATTERING, SIGMA = np.array(FOG.scattering), np.array(FOG.extinction)
MANY = {"samples": 32, "light_samples": 1, "volume_samples": 8, "filter_width": 0.0}


def phase(cosine: np.ndarray | float, g: float = FOG.anisotropy) -> np.ndarray | float:
    """Henyey and Greenstein's, of the cosine between the ways of light before and after."""
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)


def middle(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    """(3,) float64 of the pixel beside the middle."""
    film = engine.render(scene, engine.Settings(**{**MANY, "backend": backend, **settings}))
    return film.combined[2, 2, :3].astype(float)


def foggy_box(*lights: s.Light, medium: s.Medium = FOG, size: float = 1.0, **more) -> s.Scene:
    """A box of fog that a ray goes through downward, x = y = 0.025."""
    fog = filled("fog", medium)
    camera = orthographic((0.025 - 0.5 / 5, 0.025 - 0.5 / 5, 9.0 * size), (5, 5), half=0.5)
    camera = replace(camera, window=(-0.4, 0.6, -0.4, 0.6))
    return things((box_mesh(), at(linear=size), fog), camera=camera, lights=lights, **more)


def lamp_at(kind: str, place, **more) -> s.Light:
    """It shines down."""
    return s.Light(kind, kind, np.column_stack([np.eye(3), place]), **more)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_slab_in_the_sun(backend: str) -> None:
    """Light goes down and comes back up: σs p(-1) E (1 - e^(-2σd)) / 2σ."""
    seen = middle(foggy_box(lamp_at("SUN", (0, 0, 5), strength=2.0)), backend)
    expected = SCATTERING * phase(-1.0) * 2.0 * (1 - np.exp(-2 * SIGMA * 2)) / (2 * SIGMA)
    np.testing.assert_allclose(seen, expected, rtol=1e-3)


@pytest.mark.parametrize("medium", [FOG, s.Medium((0, 0, 0), (30.0, 3.0, 0.3))])
@pytest.mark.parametrize("place", [(1.5, 0.4, 0.3), (0.3, 0.0, 0.2), (0.025, 0.02, 4.0)])
def test_a_lamp_in_and_beside_fog(place, medium: s.Medium) -> None:
    """Against an integral over the ray, in a box that the lamp may be in."""
    seen = middle(foggy_box(lamp_at("POINT", place, strength=100.0), medium=medium))
    t = np.linspace(0, 2, 400001)
    t = (t[1:] + t[:-1]) / 2
    ray = np.zeros((len(t), 3))
    ray[:, :2], ray[:, 2] = 0.025, 1 - t
    to = np.array(place) - ray
    d = np.sqrt((to * to).sum(1))
    inside = np.array([_way_in_box(np.array(place), x, 1.0) for x in ray[:: len(t) // 2000]])
    way = np.interp(t, t[:: len(t) // 2000], inside)
    cosine = -to[:, 2] / d
    sigma, scattering = np.array(medium.extinction), np.array(medium.scattering)
    light = 100 / (4 * np.pi**2 * d * d) * np.pi * phase(cosine, medium.anisotropy)
    expected = (light[:, None] * np.exp(-(t + way)[:, None] * sigma)).mean(0) * 2 * scattering
    np.testing.assert_allclose(seen, expected, rtol=1e-3)


def _way_in_box(a: np.ndarray, b: np.ndarray, half: float) -> float:
    """How much of the segment from a to b is in the cube."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort(np.stack([(-half - a) / (b - a), (half - a) / (b - a)]), 0)
    first, last = np.nanmax(ends[0]), np.nanmin(ends[1])
    return max(min(last, 1) - max(first, 0), 0) * float(np.linalg.norm(b - a))


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_glow_in_closed_form(backend: str) -> None:
    """j (1 - e^(-σd)) / σ, and j d where nothing dims."""
    medium = s.Medium((0.5, 0.0, 2.0), emission=(1.0, 0.7, 0.5))
    seen = middle(foggy_box(medium=medium), backend, samples=1)
    sigma = np.array([0.5, 1.0, 2.0])
    expected = np.array(medium.emission) * (1 - np.exp(-2 * sigma)) / sigma
    expected[1] = 0.7 * 2
    np.testing.assert_allclose(seen, expected, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_foggy_world(backend: str) -> None:
    """A lamp in endless fog; the sun does not get there, and what glows endlessly is left out."""
    haze = s.Medium(scattering=(0.05, 0.1, 0.2), emission=(0.0, 0.0, 0.0))
    lamp, sun = lamp_at("POINT", (2.0, 0.0, 0.0), strength=500.0), lamp_at("SUN", (0, 0, 1))
    scene = replace(foggy_box(lamp), instances=(), world=s.World(medium=haze))
    seen = middle(scene, backend)
    t = np.linspace(0, 1, 200001)
    t = 200 * ((t[1:] + t[:-1]) / 2) ** 3
    step = np.gradient(t)
    d = np.sqrt((2.0 - 0.025) ** 2 + 0.025**2 + (9 - t) ** 2)
    sigma = np.array(haze.extinction)
    light = 500 / (4 * np.pi**2 * d * d) * np.pi / (4 * np.pi)
    expected = sigma * (light * step * np.exp(-(t + d) * sigma[:, None])).sum(1)
    np.testing.assert_allclose(seen, expected, rtol=1e-3)
    assert not middle(replace(scene, lights=(sun,)), backend, samples=2).any()
    endless = replace(scene, world=s.World(medium=s.Medium(emission=(1.0, 1.0, 1.0))), lights=())
    assert not middle(endless, backend, samples=2).any()


def test_many_shares_fill_the_ray_evenly() -> None:
    for samples, count in ((16, 4), (64, 6), (5, 3)):
        offsets = sampling.scatter_offsets(samples)
        shares = np.sort(
            [
                sampling.scatter_share(offsets, sample, k, count)
                for sample in range(samples)
                for k in range(count)
            ]
        )
        assert shares[0] > 0 and shares[-1] < 1
        if samples & (samples - 1) == 0:
            cells = np.floor(shares * samples * count).astype(int)
            np.testing.assert_array_equal(cells, np.arange(samples * count))


LAMPS = {
    "ball": light("POINT", radius=0.3),
    "disc": light("POINT", radius=0.3, soft_falloff=True),
    "spot": light("SPOT", spot_size=0.8, spot_blend=0.3),
    "wide spot": light("SPOT", spot_size=3.3, radius=0.2),
    "panel": light("AREA", size_x=1.0, size_y=0.5),
    "oval": light("AREA", size_x=1.0, size_y=0.5, shape="ELLIPSE"),
    "sun": light("SUN", strength=3.0, angle=0.2),
    "without shadow": light("POINT", cast_shadow=False),
}


@pytest.mark.parametrize("lamp", LAMPS)
def test_the_core_against_the_reference(lamp: str) -> None:
    scene = things(
        (box_mesh(), at(), filled("fog", FOG)),
        (grid_mesh(), at((0, 0, -1.2)), surface()),
        (ball_mesh(8), at((0.2, 0.1, 0.5), 0.4), filled("glass", s.Medium((1.0, 0.2, 0.1)), GLASS)),
        lights=(LAMPS[lamp],),
    )
    hazy = s.World(medium=s.Medium(scattering=(0.02, 0.03, 0.01)))
    for world in (s.World(), hazy):
        native, reference = both(
            replace(scene, world=world),
            samples=2,
            light_samples=2,
            region=(24, 16, 40, 32),
            passes=frozenset({"Cost"}),
        )
        np.testing.assert_allclose(native.combined, reference.combined, rtol=1e-4, atol=1e-5)
        np.testing.assert_array_equal(native.passes["Cost"], reference.passes["Cost"])


def test_all_that_lights_fog_and_its_passes() -> None:
    """A sky, a glowing ball, what a floor throws back; parts add up, and the camera is inside."""
    glow = s.Material("glow", (s.Lobe("EMISSION", constant(5.0)),))
    sky = s.Light("sky", "DOME", np.eye(3, 4), radiance=np.full((1, 1, 3), 0.2, np.float32))
    scene = things(
        (box_mesh(), at(linear=3.0), filled("fog", replace(FOG, emission=(0.01, 0.0, 0.02)))),
        (grid_mesh(), at((0, 0, -1.0)), surface()),
        (ball_mesh(4), at((1.2, 0.0, 1.0), 0.3), glow),
        lights=(sky,),
        world=s.World(background=(0.2, 0.2, 0.2)),
    )
    parts = ("Diffuse", "Specular", "Ambient", "Shadow", "Mirror", "Emission", "Environment")
    split = ("Diffuse Direct", "Diffuse Indirect", "Volume Direct", "Volume Indirect")
    films = both(
        scene,
        samples=2,
        light_samples=1,
        diffuse_bounces=1,
        passes=frozenset((*parts, *split)),
        region=(16, 12, 48, 36),
    )
    for name in ("Combined", *parts, *split):
        first, second = (film.passes[name] for film in films)
        np.testing.assert_allclose(first, second, rtol=1e-4, atol=1e-5, err_msg=name)
    total = sum(films[0].passes[name].astype(float) for name in parts)
    np.testing.assert_allclose(films[0].combined[..., :3], total, rtol=1e-5, atol=1e-6)


def scattering_scene() -> s.Scene:
    scene = rich()
    haze = s.Medium((0.02, 0.02, 0.02), (0.05, 0.1, 0.03), (0.01, 0.0, 0.02), 0.3)
    return replace(scene, world=replace(scene.world, medium=haze))


def test_the_same_bits_in_regions_with_any_threads_and_with_fewer_pixels_at_once() -> None:
    settings = engine.Settings(samples=8, light_samples=2, error_threshold=1.0)
    whole = engine.render(scattering_scene(), replace(settings, threads=2)).combined
    alone = engine.render(scattering_scene(), replace(settings, threads=1)).combined
    np.testing.assert_array_equal(whole, alone)
    region = replace(settings, region=(9, 5, 50, 40))
    np.testing.assert_array_equal(
        engine.render(scattering_scene(), region).combined, whole[5:40, 9:50]
    )


def test_a_light_for_others_is_not_scattered() -> None:
    lamp = lamp_at("POINT", (1.5, 0.4, 0.3), strength=100.0)
    scene = foggy_box(lamp)
    lit = middle(scene, samples=1)
    for backend in BACKENDS:
        none = replace(scene, lights=(replace(lamp, receivers=s.EVERYTHING & ~1),))
        assert not middle(none, backend, samples=1).any()
        own = replace(scene.instances[0], light_set=1)
        kept = replace(none, instances=(own,))
        np.testing.assert_allclose(middle(kept, backend, samples=1), lit, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "medium",
    [
        s.Medium(scattering=(1e30, 1e30, 1e30)),
        s.Medium(scattering=(1e-30, 0.0, 1.0), anisotropy=0.999),
        s.Medium((1e30, 0, 0), (0, 1e-6, 0), (1e30, -1.0, 0), -1.0),
        s.Medium(scattering=(1.0, 1.0, 1.0), anisotropy=1.0),
    ],
)
def test_extremes(backend: str, medium: s.Medium) -> None:
    """A lamp on the ray itself, and dense, thin and one-sided media: finite everywhere."""
    lights = (
        lamp_at("POINT", (0.025, 0.025, 0.0), strength=10.0),
        lamp_at("SPOT", (0.025, 0.025, 3.0), strength=10.0, spot_size=0.5, radius=0.1),
        lamp_at("AREA", (0.0, 0.0, 1.0), strength=10.0, size_x=1.0),
        lamp_at("SUN", (0.0, 0.0, 1.0), strength=1.0),
    )
    for size in (1e-6, 1.0, 1e6):
        scene = foggy_box(*lights, medium=medium, size=size)
        for world in (s.World(), s.World(medium=medium)):
            film = engine.render(
                replace(scene, world=world),
                engine.Settings(samples=2, light_samples=2, backend=backend),
            )
            assert np.isfinite(film.combined).all()
