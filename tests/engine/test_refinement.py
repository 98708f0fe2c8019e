"""Adaptive refinement: what takes more samples, the same bits however it is cut, honest estimates;
the passes that show cost and health.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES
from glint import engine
from glint.engine import scene as s
from glint.engine.sampling import blackman_harris, pixel_offsets
from native_tools import (
    assert_instruction_sets_agree,
    color,
    draw,
    lamp,
    material,
    needs_core,
    placed,
    square,
    view_from_above,
)

pytestmark = needs_core

SIZE = 16
HEALTH = frozenset({"Error", "Samples", "Cost"})
BACKENDS = engine.settings.BACKENDS


def emitter(strength: float = 1.0) -> s.Material:
    return material(s.Lobe("EMISSION", (s.Input((strength,) * 3),)))


def half_plane(edge: float) -> s.Scene:
    """White where x > `edge`, black elsewhere; a pixel is 1 / 8 wide."""
    right = replace(
        placed(),
        world_from_object=np.array([[[1, 0, 0, 5 + edge], [0, 1, 0, 0], [0, 0, 1, 0]]], float),
    )
    return s.Scene(view_from_above(SIZE), (square(5.0),), (right,), (emitter(),))


def coverage(edge: float, width: float) -> np.ndarray:
    """(SIZE,) share of each column's filter that lies right of the edge, in closed form but for the
    sum.
    """
    x = (np.arange(20000) + 0.5) / 20000 - 0.5
    weight = blackman_harris(x)
    centers = (2 * np.arange(SIZE) + 1) / SIZE - 1
    return (
        np.array([(weight * (c + 2 * width * x * 2 / SIZE > edge)).sum() for c in centers])
        / weight.sum()
    )


def srgb_levels(x: np.ndarray) -> np.ndarray:
    """Eight-bit levels of the sRGB standard, above 1 as well."""
    return 255 * np.where(
        x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055
    )


def bigger(name: str, resolution: tuple[int, int]) -> s.Scene:
    scene = SCENES[name]()
    return replace(scene, camera=replace(scene.camera, resolution=resolution))


@functools.cache
def well_sampled(name: str, width: int = 72) -> tuple[s.Scene, engine.Film]:
    """A scene and its picture at eight times the most samples that are held against it."""
    scene = bigger(name, (width, width * 3 // 4))
    return scene, engine.render(scene, engine.Settings(samples=256))


def levels_off(film: engine.Film, truth: engine.Film) -> np.ndarray:
    """(h, w) largest channel's error in levels, alpha's too."""
    a, b = film.combined.astype(float), truth.combined.astype(float)
    color = np.abs(
        srgb_levels(np.maximum(a[..., :3], 0)) - srgb_levels(np.maximum(b[..., :3], 0))
    ).max(-1)
    return np.maximum(color, 255 * np.abs(a[..., 3] - b[..., 3]))


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_constant_picture_takes_four_samples(backend: str) -> None:
    scene = s.Scene(view_from_above(SIZE), (square(9.0),), (placed(),), (emitter(0.7),))
    film = draw(scene, *HEALTH, samples=64, error_threshold=0.01, backend=backend)
    assert (film.passes["Samples"] == 4).all()
    assert (film.passes["Cost"] == 4).all()
    assert film.passes["Error"].max() <= 1e-4  # of 255: rounding
    assert (film.combined[..., :3] == np.float32(0.7)).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("edge", [0.0, 0.031, -0.4])
def test_pixels_that_an_edge_covers_take_all_samples(edge: float, backend: str) -> None:
    """Also those whose first four samples all miss it: their neighbours saw it. Beyond a neighbour
    of the window nothing is spent.
    """
    plan = {"samples": 64, "backend": backend}
    film, full = (
        draw(half_plane(edge), *HEALTH, error_threshold=1.0, **plan),
        draw(half_plane(edge), **plan),
    )
    share, samples = coverage(edge, 1.5), film.passes["Samples"][..., 0]
    # within a pixel of where a first sample may see the edge
    touched = (share > 0.002) & (share < 0.998)
    assert touched.sum() >= 2
    assert (samples[:, touched] == 64).all()
    assert np.array_equal(film.combined[:, touched], full.combined[:, touched])
    flat = (share == 0) | (share == 1)
    beyond = flat & ~np.convolve(~flat, [1, 1, 1], "same").astype(bool)
    assert (samples[:, beyond] == 4).all()
    off = np.abs(srgb_levels(film.combined[..., 0].astype(float)) - srgb_levels(share))
    # 1: the threshold, for a sliver that nobody saw
    assert (off <= np.maximum(2 * film.passes["Error"][..., 0], 1.0)).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("light_samples", "samples"), [(1, 4), (2, 8), (3, 8), (4, 4)])
def test_pixels_in_soft_light_stop_after_16_points_on_it(
    light_samples: int, samples: int, backend: str
) -> None:
    """A far lamp over half a plane: nothing varies, yet a blocker might hide between the points."""
    sun = lamp("SUN", angle=0.01)
    scene = replace(
        half_plane(0.0),
        lights=(sun,),
        materials=(material(s.Lobe("DIFFUSE", (s.Input((0.5,) * 3),))),),
    )
    plan = {
        "samples": 32,
        "light_samples": light_samples,
        "error_threshold": 1.0,
        "backend": backend,
    }
    taken = draw(scene, *HEALTH, **plan).passes["Samples"][..., 0]
    lit, dark = taken[:, -SIZE // 4 :], taken[:, : SIZE // 4]
    assert (lit == samples).all() and (dark == 4).all()
    hard = replace(scene, lights=(replace(sun, angle=0.0),))
    assert draw(hard, *HEALTH, **plan).passes["Samples"][:, -SIZE // 4 :].max() == 4


ALONG = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""Axes of a lamp that shines along -x, its y upwards."""
RISING = {
    "sphere": {"kind": "POINT", "radius": 0.3},
    "square": {"kind": "AREA", "axes": ALONG, "size_x": 0.6, "size_y": 0.6},
    "disc": {"kind": "AREA", "axes": ALONG, "size_x": 0.6, "size_y": 0.6, "shape": "ELLIPSE"},
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("shape", [*RISING, "sun"])
def test_light_on_the_horizon_is_not_cut_to_black(shape: str, backend: str) -> None:
    """A plane under a lamp of which a sliver is above its horizon, and too little for the first
    points on it; a lamp that has set.
    """

    def lit(middle: float) -> s.Scene:
        light = {"position": (8.0, 0.0, middle), "strength": 4000.0, "cast_shadow": False}
        # by angles, as seen from the plane: 0.3 / 8 of a radius, the middle of what there is of it
        if shape == "sun":
            z = np.array([np.cos(middle), 0, np.sin(middle)])
            kind = {
                "kind": "SUN",
                "axes": np.stack([(-z[2], 0, z[0]), (0, -1, 0), z], 1),
                "angle": 0.6,
                "strength": 100.0,
            }
        else:
            kind = RISING[shape]
        white = material(s.Lobe("DIFFUSE", (s.Input((0.8,) * 3),)))
        return s.Scene(
            view_from_above(4, 0.1),
            (square(1.0),),
            (placed(),),
            (white,),
            lights=(lamp(**{**light, **kind}),),
        )

    plan = {"samples": 64, "light_samples": 2, "backend": backend}
    truth = draw(lit(-0.28), **plan)
    film = draw(lit(-0.28), "Samples", error_threshold=4.0, **plan)
    assert truth.combined[..., :3].min() > 0
    assert film.combined[..., :3].min() > 0
    assert levels_off(film, truth).max() <= 4.0
    first = draw(lit(-0.28), **{**plan, "samples": 4})
    assert first.combined[..., :3].max() == 0  # else nothing is tried here
    set_lamp = draw(lit(-0.32), "Samples", error_threshold=4.0, **plan)
    assert (set_lamp.passes["Samples"] == 4).all() and set_lamp.combined[..., :3].max() == 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_black_in_soft_light_looks_at_32_points(backend: str) -> None:
    """A lid over a plane under a sun: what it hides from all points on the sun is looked at longer
    than what is lit.
    """
    white, sun = material(s.Lobe("DIFFUSE", (s.Input((0.5,) * 3),))), lamp("SUN", angle=0.01)
    lid = placed(z=1.0, materials=(0,), visible_camera=False)
    plan = {"samples": 64, "light_samples": 2, "error_threshold": 4.0, "backend": backend}
    for instances, samples in (((placed(), lid), 16), ((placed(),), 8)):
        film = draw(
            s.Scene(view_from_above(4), (square(9.0),), instances, (white,), lights=(sun,)),
            "Samples",
            **plan,
        )
        assert (film.passes["Samples"] == samples).all() and (
            film.combined[..., :3].max() == 0
        ) == (samples == 16)


@pytest.mark.parametrize("backend", BACKENDS)
def test_soft_light_that_a_later_sample_meets_counts_too(backend: str) -> None:
    """Half a plane under a sun, before a background as bright: nothing varies, and some pixels'
    first sample misses the plane.
    """
    edge, samples = -0.05, 32
    scene = replace(
        half_plane(edge),
        lights=(lamp("SUN", angle=0.01),),
        materials=(material(s.Lobe("DIFFUSE", (s.Input((0.5,) * 3),))),),
    )
    scene = replace(scene, world=s.World(background=tuple(color(scene)[0, -1])))
    taken = draw(
        scene, *HEALTH, samples=samples, light_samples=2, error_threshold=4.0, backend=backend
    ).passes["Samples"][..., 0]
    centers = (2 * np.arange(SIZE) + 1) / SIZE - 1
    meets = centers[:, None] + pixel_offsets(samples, 1.5)[:4, 0] * 2 / SIZE > edge
    assert (meets.any(1) & ~meets[:, 0]).any()
    assert (taken == np.where(meets.any(1), 8, 4)).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_soft_light_in_a_mirror_counts_too(backend: str) -> None:
    """Half a plane is a mirror under a ceiling that a sun lights from below."""
    ceiling, sun = (
        placed(materials=(1,), z=20.0),
        lamp("SUN", axes=np.diag([1.0, -1.0, -1.0]), angle=0.01, cast_shadow=False),
    )
    mirror, white = (
        material(s.Lobe(kind, (s.Input((0.5,) * 3),))) for kind in ("MIRROR", "DIFFUSE")
    )
    plane = half_plane(0.0)
    scene = replace(
        plane, instances=(*plane.instances, ceiling), materials=(mirror, white), lights=(sun,)
    )
    plan = {
        "samples": 32,
        "light_samples": 2,
        "max_bounces": 1,
        "error_threshold": 1.0,
        "backend": backend,
    }
    film = draw(scene, *HEALTH, **plan)
    taken, lit = film.passes["Samples"][..., 0], film.combined[..., 0]
    assert (taken[:, -SIZE // 4 :] == 8).all() and lit[:, -SIZE // 4 :].min() > 0.01
    assert (taken[:, : SIZE // 4] == 4).all()


def apart_on_screen(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(h, w) levels between two (h, w, 4) means, as semantics/stopping.md has it, round b."""
    d = np.abs(a - b)
    high = np.maximum(np.abs(b), d)[..., :3]
    return np.maximum((srgb_levels(high) - srgb_levels(high - d[..., :3])).max(-1), 255 * d[..., 3])


def mean_of_neighborhood(image: np.ndarray) -> np.ndarray:
    height, width = image.shape
    boxes = [
        [image[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].mean() for x in range(width)]
        for y in range(height)
    ]
    return np.array(boxes)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("samples", [4, 16, 20])
def test_the_error_pass_is_what_the_waves_tell(samples: int, backend: str) -> None:
    """Recomputed from the pictures after 1, 2, 4, 8 … samples, in which every pixel takes part."""
    waves = []
    plan = engine.Settings(
        samples=samples,
        light_samples=2,
        passes=frozenset({"Error"}),
        backend=backend,
        filter_width=1.5,
    )
    film = engine.render(
        bigger("alpha", (24, 18)),
        plan,
        on_wave=lambda wave: waves.append((wave.samples, wave.combined.astype(float))),
    )
    pictures = dict([*waves, (samples, film.combined.astype(float))])
    numbers, spread, around = sorted(pictures), np.zeros(0), np.zeros(0)
    assert numbers == [n for n in (1, 2, 4, 8, 16, 20) if n <= samples]
    for m, n in itertools.pairwise(numbers):
        new = apart_on_screen(pictures[m], pictures[n]) ** 2 * m * n / (n - m)
        spread = new if m == 1 else (spread + new) / 2
        if n == 4:
            around = mean_of_neighborhood(spread) / 4
    expected = np.sqrt(spread / samples + around * (4 / samples) ** 1.5)
    # levels: the pictures are float32
    assert np.abs(film.passes["Error"][..., 0] - np.minimum(expected, 256)).max() <= 0.02
    assert expected.max() > 10
    assert (draw(half_plane(0.0), "Error", samples=2, backend=backend).passes["Error"] == 256).all()


ALL = frozenset(engine.PASSES) - {"Combined", "Fallbacks"}
BITS = engine.Settings(samples=20, light_samples=2, error_threshold=2.0, passes=ALL, threads=1)


@pytest.mark.parametrize("name", ["soft_lights", "alpha", "glass"])
def test_same_bits_however_it_is_cut(name: str) -> None:
    scene = bigger(name, (75, 53))
    whole = engine.render(scene, BITS)
    assert 4 < whole.passes["Samples"].mean() < 20
    for threads in (2, 5):
        again = engine.render(scene, replace(BITS, threads=threads), on_wave=lambda film: None)
        assert {k: v.tobytes() for k, v in again.passes.items()} == {
            k: v.tobytes() for k, v in whole.passes.items()
        }
    for x0, x1 in ((0, 29), (29, 30), (30, 75)):
        for y0, y1 in ((0, 17), (17, 53)):
            part = engine.render(scene, replace(BITS, region=(x0, y0, x1, y1)))
            for key, values in part.passes.items():
                assert (
                    values.tobytes()
                    == np.ascontiguousarray(whole.passes[key][y0:y1, x0:x1]).tobytes()
                ), key


def test_same_bits_from_every_instruction_set() -> None:
    def passes() -> dict[str, bytes]:
        film = engine.render(bigger("soft_lights", (40, 30)), BITS)
        return {name: values.tobytes() for name, values in film.passes.items()}

    assert_instruction_sets_agree(passes)


@pytest.mark.parametrize(
    ("name", "width"),
    [
        ("flat_and_smooth", 72),
        ("mirrors", 72),
        ("glass", 72),
        ("alpha", 72),
        ("texture_repeat", 160),
        ("round_and_plane", 72),
    ],
)
def test_fewer_samples_for_the_same_error(name: str, width: int) -> None:
    """Against full sampling: at most two thirds of the samples, and an error that is larger by at
    most a twentieth.
    """
    scene, truth = well_sampled(name, width)
    full = engine.render(scene, engine.Settings(samples=16))
    film = engine.render(scene, engine.Settings(samples=16, error_threshold=4.0, passes=HEALTH))
    rms = [float(np.sqrt((levels_off(picture, truth) ** 2).mean())) for picture in (film, full)]
    assert film.passes["Samples"].mean() <= 16 * 2 / 3
    assert rms[0] <= 1.05 * rms[1] + 0.1


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("flat_and_smooth", 0.02),
        ("hard_lights", 0.02),
        ("mirrors", 0.02),
        ("glass", 0.02),
        ("alpha", 0.02),
        ("soft_lights", 0.02),
    ],
)
@pytest.mark.parametrize(("samples", "threshold"), [(16, 0.0), (32, 4.0)])
def test_the_error_pass_is_about_twice_the_error(
    name: str, share: float, samples: int, threshold: float
) -> None:
    """Two standard deviations: the root mean square over the picture is half of it, few pixels are
    off by more and hardly one by twice as much; one level is not seen.
    """
    scene, truth = well_sampled(name)
    film = engine.render(
        scene, engine.Settings(samples=samples, error_threshold=threshold, passes=HEALTH)
    )
    true, told = levels_off(film, truth), film.passes["Error"][..., 0].astype(float)
    assert 0.25 <= np.sqrt((true**2).mean() / (told**2).mean()) <= 1.0
    assert (true > told + 1).mean() <= share
    assert (true > 2 * told + 1).mean() <= share / 2


@pytest.mark.parametrize("name", ["hard_lights", "alpha", "odd_matrices"])
def test_core_and_reference_stop_the_same_pixels(name: str) -> None:
    """But for bounds that rounding takes across the threshold: there the two have different
    samples, each as good as the threshold asks.
    """
    plan = engine.Settings(samples=16, error_threshold=2.0, passes=HEALTH)
    scene = SCENES[name]()
    core, reference = (
        engine.render(scene, plan),
        engine.render(scene, replace(plan, backend="NUMPY")),
    )
    same = core.passes["Samples"] == reference.passes["Samples"]
    assert same.mean() >= 0.99
    apart = np.abs(core.combined.astype(float) - reference.combined)
    differ = apart > 1e-4 * np.maximum(np.abs(reference.combined), 0.01)
    full = [
        engine.render(scene, engine.Settings(samples=16, backend=backend)).combined.astype(float)
        for backend in BACKENDS
    ]
    # a sample on the border of a shadow, in single precision
    border = np.abs(full[0] - full[1]) > 1e-4 * np.maximum(np.abs(full[1]), 0.01)
    assert border.any(-1).mean() <= 0.001
    assert not (differ & ~border)[same[..., 0]].any()
    told_apart = np.abs(core.passes["Error"] - reference.passes["Error"])
    # of 255: 1e-4 of a dark colour, times its slope; and the border's neighbours
    assert (told_apart > 0.05)[same].mean() <= 0.002
    assert (levels_off(core, reference)[..., None] <= 2 * plan.error_threshold)[~same].all()


def test_off_means_off() -> None:
    """No threshold and no pass: all samples, and Combined has the bits that it has with the
    passes.
    """
    scene = bigger("hard_lights", (40, 30))
    plain = engine.render(scene, engine.Settings(samples=8))
    told = engine.render(scene, engine.Settings(samples=8, passes=HEALTH))
    assert plain.combined.tobytes() == told.combined.tobytes()
    assert (told.passes["Samples"] == 8).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", ["soft_lights", "glass", "alpha"])
def test_cost_is_all_rays(name: str, backend: str) -> None:
    film = engine.render(
        SCENES[name](),
        engine.Settings(samples=2, light_samples=2, passes=frozenset({"Cost"}), backend=backend),
    )
    assert film.passes["Cost"].sum(dtype=float) == film.stats["rays"]


@pytest.mark.parametrize("backend", BACKENDS)
def test_gap_and_grazing_of_two_planes(backend: str) -> None:
    """A tilted pane half a unit above a floor, seen from above: |n·d| is the tilt's cosine, the gap
    the height of the pane there.
    """
    tilt = 0.3
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    scene = s.Scene(
        view_from_above(SIZE), (square(9.0),), (placed(), placed(z=0.5, linear=turn)), (emitter(),)
    )
    film = draw(scene, "Gap", "Grazing", backend=backend)
    x = (2 * np.arange(SIZE) + 1) / SIZE - 1
    pane = 0.5 - x * np.tan(tilt)
    assert (pane > 0).all()
    # float32 corners of a square 18 wide
    assert np.abs(film.passes["Gap"][..., 0] - pane).max() <= 2e-6
    assert np.abs(film.passes["Grazing"] - np.cos(tilt)).max() <= 1e-6
    sky = draw(replace(scene, instances=()), "Gap", "Grazing", backend=backend)
    assert (sky.passes["Gap"] == np.float32(1e10)).all()
    assert (sky.passes["Grazing"] == 0).all()
    alone = draw(replace(scene, instances=scene.instances[:1]), "Gap", backend=backend)
    assert (alone.passes["Gap"] == np.float32(1e10)).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_fallbacks_where_two_faces_lie_in_one_place(backend: str) -> None:
    """Float32 is sure of a lone face, but not which of two in one place is nearer; the float64
    tracer has nothing to fall back from.
    """
    alone, twice = (
        draw(
            s.Scene(view_from_above(SIZE), (square(0.4),), (placed(),) * count, (emitter(),)),
            "Fallbacks",
            "Depth",
            backend=backend,
        )
        for count in (1, 2)
    )
    hit = twice.passes["Depth"] < 1e9
    middle = np.zeros_like(hit)
    middle[SIZE // 2 - 2, SIZE // 2 + 1] = True  # off the square's diagonal
    assert hit[middle].all() and not hit.all()
    assert (twice.passes["Fallbacks"][~hit] == 0).all()
    assert (alone.passes["Fallbacks"][middle] == 0).all()
    assert (twice.passes["Fallbacks"][middle] == (backend == "NATIVE")).all()


def test_thresholds_that_mean_nothing_are_refused() -> None:
    for threshold in (-1.0, 256.0, float("nan")):
        with pytest.raises(engine.SceneError, match="error_threshold"):
            engine.render(
                s.Scene(view_from_above(1), lights=(lamp("SUN"),)),
                engine.Settings(error_threshold=threshold),
            )
