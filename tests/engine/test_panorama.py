"""Panoramas: closed forms of every projection, one tracer beside the other, the same bits whatever
the work.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from math import asin, cos, pi, sin, tan

import numpy as np
import pytest

from glint import engine
from glint.engine import Settings, film, render
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.program.table import BY_NAME
from glint.engine.scene import Camera, Instances, Lens, Medium, Scene, Spheres
from glint.engine.scene.panorama import Eye, Panorama
from glint.engine.scene.problems import scene_problems
from media_scenes import rich
from native_tools import assert_instruction_sets_agree
from test_lens import BACKENDS, depths, glowing, moving, turned
from test_program_render import new_graph, shown

K = (-1e-5, -0.02, -3e-6, 3e-6, -2.6e-8)
PANORAMAS = {
    "equirectangular": Panorama("EQUIRECTANGULAR"),
    "part of a sphere": Panorama("EQUIRECTANGULAR", longitude=(-1.0, 2.0), latitude=(-0.5, 1.2)),
    "equidistant": Panorama("FISHEYE_EQUIDISTANT", fov=4.0),
    "equisolid": Panorama("FISHEYE_EQUISOLID", sensor=(36.0, 30.0), fov=3.0),
    "polynomial": Panorama("FISHEYE_LENS_POLYNOMIAL", sensor=(36.0, 30.0), fov=0.6, polynomial=K),
    "mirror ball": Panorama("MIRROR_BALL"),
    "cubemap face": Panorama("EQUIANGULAR_CUBEMAP_FACE"),
    "cylinder": Panorama("CENTRAL_CYLINDRICAL", longitude=(-2.0, 1.5), heights=(-0.8, 1.4)),
}
EYES = {
    "parallel": Eye(0.3),
    "converging": Eye(-0.4, 2.0),
    "merging": Eye(0.3, 3.0, (0.4, 0.9)),
}
SIZE = (40, 32)
WIDE = (0.0, 1.0, 0.0, 1.0)


def seen(panorama: Panorama, size=SIZE, frame=None, window=WIDE, **more) -> Camera:
    frame = np.eye(3, 4) if frame is None else frame
    return Camera("PANORAMA", frame, window, size, 0.01, 100.0, panorama=panorama, **more)


def direction(p: Panorama, u: float, v: float) -> tuple[float, float, float] | None:
    """Of one point, right, up and backward, by the formulas of semantics/camera.md, number by
    number; None where nothing is seen.
    """
    longitude = p.longitude[0] + u * (p.longitude[1] - p.longitude[0])
    if p.projection == "EQUIRECTANGULAR":
        latitude = p.latitude[0] + v * (p.latitude[1] - p.latitude[0])
        return (
            cos(latitude) * sin(longitude),
            sin(latitude),
            -cos(latitude) * cos(longitude),
        )
    if p.projection == "CENTRAL_CYLINDRICAL":
        height = p.heights[0] + v * (p.heights[1] - p.heights[0])
        size = (1 + height**2) ** 0.5
        return sin(longitude) / size, height / size, -cos(longitude) / size
    if p.projection == "EQUIANGULAR_CUBEMAP_FACE":
        x, y = tan((u - 0.5) * pi / 2), tan((v - 0.5) * pi / 2)
        size = (x * x + y * y + 1) ** 0.5
        return x / size, y / size, -1 / size
    if p.projection == "MIRROR_BALL":
        n = np.array([2 * u - 1, 2 * v - 1, 0.0])
        if n @ n > 1:
            return None
        n[2] = -((1 - n @ n) ** 0.5)
        return tuple(np.array([0.0, 0.0, 1.0]) - 2 * n[2] * n)  # backward, mirrored
    width, height = (2.0, 2.0) if p.projection == "FISHEYE_EQUIDISTANT" else p.sensor
    x, y = (u - 0.5) * width, (v - 0.5) * height
    r = (x * x + y * y) ** 0.5
    if p.projection == "FISHEYE_EQUIDISTANT":
        angle = r * p.fov / 2
    elif p.projection == "FISHEYE_EQUISOLID":
        angle = 2 * asin(min(1.0, r / (2 * p.lens)))
    else:
        angle = -sum(k * r**power for power, k in enumerate(p.polynomial))
    if abs(angle) > p.fov / 2:
        return None
    return sin(angle) * x / r, sin(angle) * y / r, -cos(angle)


def directions(p: Panorama, size=SIZE, window=WIDE) -> np.ndarray:
    """(h, w, 3) of the pixels' centres, NaN where nothing is seen."""
    left, right, bottom, top = window
    rows = [
        [
            direction(
                p,
                left + (x + 0.5) / size[0] * (right - left),
                bottom + (y + 0.5) / size[1] * (top - bottom),
            )
            or (np.nan,) * 3
            for x in range(size[0])
        ]
        for y in range(size[1])
    ]
    return np.array(rows)


def inside_of_a_ball(camera: Camera, radius: float, centre=(0.0, 0.0, 0.0)) -> Scene:
    ball = Spheres("ball", np.array([centre], np.float32), np.array([radius], np.float32))
    blocks = (Instances("ball", 0, np.eye(3, 4)[None], (0,)),)
    return Scene(camera, (ball,), blocks, (glowing(0.2, 0.4, 0.6),))


def passes_of(scene: Scene, backend: str = "NATIVE", **settings) -> dict[str, np.ndarray]:
    assert not scene_problems(scene)
    chosen = {"samples": 1, "passes": frozenset({"Depth", "Position"})} | settings
    return render(scene, Settings(backend=backend, **chosen)).passes


# --- closed forms


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", PANORAMAS)
def test_pixels_look_where_the_formulas_say(name, backend):
    """From inside of a ball, along turned axes."""
    frame = turned(0.7, 1.0, 2.0, 3.0)
    window = (0.05, 0.95, -0.1, 1.1)
    camera = seen(PANORAMAS[name], frame=frame, window=window)
    found = passes_of(inside_of_a_ball(camera, 2.0, (1.0, 2.0, 3.0)), backend)
    expected = directions(PANORAMAS[name], window=window)
    lit = np.isfinite(expected[..., 0])
    assert lit.any()
    looked = (found["Position"][lit] - frame[:, 3]) @ frame[:, :3] / 2
    np.testing.assert_allclose(looked, expected[lit], atol=1e-6)
    np.testing.assert_allclose(found["Depth"][lit][:, 0], 2.0, rtol=1e-6)
    np.testing.assert_allclose(found["Combined"][lit], [(0.2, 0.4, 0.6, 1.0)] * lit.sum(), 1e-6)
    for pass_name, nothing in (("Combined", (0, 0, 0, 1)), ("Depth", 1e10), ("Position", 0.0)):
        assert (found[pass_name][~lit] == np.float32(nothing)).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_clip_distances_count_along_the_rays(backend):
    """A wall ahead: the ball of the clip end cuts a disc out of it, that of the start a hole."""
    scene = depths(seen(Panorama("FISHEYE_EQUIDISTANT", fov=2.0)))
    camera = replace(scene.camera, clip_start=2.04, clip_end=4.2)
    depth = passes_of(replace(scene, camera=camera), backend)["Depth"][..., 0]
    whole = passes_of(scene, backend)["Depth"][..., 0]
    kept = (whole > 2.04) & (whole < 4.2)
    np.testing.assert_array_equal(depth[kept], whole[kept])
    assert kept.any() and (whole < 2.04).any() and (whole[whole < 1e9] > 4.2).any()
    assert (depth[whole < 2.04] > 2.04).all() and (depth[whole > 4.2] == np.float32(1e10)).all()


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("backend", BACKENDS)
def test_eyes_stand_aside_of_every_direction(eye, backend):
    """The ray of a pixel passes through the eye's place and, at the distance of convergence from
    the camera's, the point that both eyes see.
    """
    chosen, p = EYES[eye], PANORAMAS["equirectangular"]
    found = passes_of(inside_of_a_ball(seen(p, eye=chosen), 4.0), backend)
    d = directions(p).reshape(-1, 3)
    side = np.cross(d, [0.0, 1.0, 0.0])
    offset = np.full(len(d), chosen.offset)
    if chosen.pole_merge:
        low, high = chosen.pole_merge
        share = np.clip((np.abs(np.arcsin(d[:, 1])) - low) / (high - low), 0, 1)
        offset *= np.cos(share * pi / 2)
        assert (share == 0).any() and (share == 1).any() and np.count_nonzero(share % 1)
    place = offset[:, None] * side / np.linalg.norm(side, axis=1, keepdims=True)
    aim = d if np.isinf(chosen.convergence) else chosen.convergence * d - place
    aim = aim / np.linalg.norm(aim, axis=1, keepdims=True)
    along = found["Position"].reshape(-1, 3) - place
    np.testing.assert_allclose(np.cross(along, aim), 0, atol=4e-6)
    assert (along * aim).sum(1).min() > 0
    np.testing.assert_allclose(found["Depth"], 4.0, rtol=1e-6)  # from the camera's place


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", PANORAMAS)
def test_programs_know_the_point_of_the_picture(name, backend):
    """The Window coordinate of what a pixel sees is where the pixel is."""
    graph, window = new_graph(), (0.1, 0.95, 0.05, 0.9)
    material = shown(graph, graph.apply(BY_NAME["window"], shift=0)[0])
    camera = seen(PANORAMAS[name], window=window)
    scene = replace(inside_of_a_ball(camera, 2.0), materials=(material,))
    lit = np.isfinite(directions(PANORAMAS[name], window=window)[..., 0])
    color = passes_of(scene, backend)["Combined"]
    x, y = np.meshgrid((np.arange(SIZE[0]) + 0.5) / SIZE[0], (np.arange(SIZE[1]) + 0.5) / SIZE[1])
    np.testing.assert_allclose(color[..., 0][lit], x[lit], atol=2e-5)
    np.testing.assert_allclose(color[..., 1][lit], y[lit], atol=2e-5)


# --- one tracer beside the other


@pytest.mark.parametrize("lens", [None, Lens(0.2, 4.0, 5, 0.3, 1.5)])
@pytest.mark.parametrize("name", [*PANORAMAS, *EYES])
def test_both_tracers_see_the_same(name, lens):
    panorama = PANORAMAS[name if name in PANORAMAS else "part of a sphere"]
    camera = seen(panorama, frame=turned(0.2, 0.1, 0.0, 0.3), lens=lens, eye=EYES.get(name))
    if name in ("cylinder", "merging"):
        camera = moving(camera, turned(0.1, 0.0, 0.1, 0.2), turned(0.3, 0.2, 0.0, 0.4))
    passes = frozenset(film.PASSES) - {"Cost", "Fallbacks"}
    settings = {"samples": 2, "filter_width": 1.5, "passes": passes, "max_bounces": 2}
    core, reference = (passes_of(depths(camera), b, **settings) for b in BACKENDS)
    for pass_name in ("Combined", "Depth", "Position", "Mist", "Denoising Depth", "Normal"):
        wrong = np.abs(core[pass_name] - reference[pass_name])
        assert (wrong / (1 + np.abs(reference[pass_name]))).max() <= 2e-7, pass_name


@pytest.mark.parametrize("name", ["equirectangular", "equisolid"])
def test_bumps_are_as_wide_in_both_tracers(name):
    """Shifted reads: how far the point itself moves."""
    graph = new_graph()
    here, there = (graph.apply(BY_NAME["position"], shift=shift)[0] for shift in (0, 1))
    step = graph.apply(BY_NAME["scaled_sum"], here, graph.constant(-1.0), there)[0]
    material = shown(graph, graph.apply(BY_NAME["scaled_sum"], step, graph.constant(1e3),
                                        graph.constant((0.5,) * 3))[0])  # fmt: skip
    scene = inside_of_a_ball(seen(PANORAMAS[name], window=(0.2, 0.8, 0.3, 0.8)), 3.0)
    core, reference = (
        passes_of(replace(scene, materials=(material,)), backend)["Combined"]
        for backend in BACKENDS
    )
    np.testing.assert_allclose(core, reference, rtol=1e-6, atol=1e-6)
    spread = core[..., :3][core[..., :3].any(-1)] - 0.5
    across = np.linalg.norm(
        np.subtract(*(direction(PANORAMAS[name], 0.5 + k * 0.6 / SIZE[0], 0.55) for k in (0, 1)))
    )
    np.testing.assert_allclose(np.linalg.norm(spread, axis=1), 300 * across, rtol=1e-3)


def test_media_dim_what_is_seen_and_nothing_beyond_the_lens():
    """From inside of a world's."""
    scene = rich()
    world = replace(scene.world, medium=Medium((0.05, 0.1, 0.02)), background=(0.5, 0.6, 0.7))
    camera = seen(PANORAMAS["equidistant"], frame=scene.camera.world_from_camera)
    scene = replace(scene, camera=camera, world=world)
    core, reference = (passes_of(scene, b, max_bounces=2)["Combined"] for b in BACKENDS)
    np.testing.assert_allclose(core, reference, rtol=1e-4, atol=1e-5)
    lit = np.isfinite(directions(PANORAMAS["equidistant"])[..., 0])
    assert (core[~lit] == (0, 0, 0, 1)).all() and (core[lit][:, 3] == 1).all()


def test_both_tracers_stop_pixels_alike():
    scene = depths(seen(PANORAMAS["equidistant"]))
    settings = {"samples": 64, "error_threshold": 4.0, "passes": frozenset({"Samples"})}
    core, reference = (passes_of(scene, backend, **settings) for backend in BACKENDS)
    assert (core["Samples"] != reference["Samples"]).mean() <= 0.002
    assert core["Samples"].min() < 64


def test_a_pixel_is_explained():
    wanted = depths(seen(PANORAMAS["equidistant"]))
    explainer = PixelExplainer(wanted, Settings(samples=1))
    film_of = passes_of(wanted, "NUMPY")
    for x, y in [(20, 16), (16, 20), (25, 12)]:
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, film_of["Combined"][y, x, :3], rtol=2**-20, atol=1e-9)
        if ray.hit is not None:
            assert ray.hit.depth == pytest.approx(film_of["Depth"][y, x, 0])
    lines = explanation_lines(explainer.pixel(0, 0))
    assert any("beyond the picture of the lens" in line for line in lines)


# --- the same bits


def all_at_once(name: str = "equidistant") -> Scene:
    eye = EYES["converging"]
    camera = seen(PANORAMAS[name], size=(64, 56), lens=Lens(0.1, 4.0, 5), eye=eye)
    return depths(moving(camera, turned(-0.05, -0.2, 0, 0), turned(0.03, 0.2, 0.1, 0)))


def picture(scene: Scene, **settings) -> np.ndarray:
    return passes_of(scene, **{"samples": 8, "filter_width": 1.5} | settings)["Combined"]


@pytest.mark.parametrize("name", ["equidistant", "equirectangular"])
def test_threads_and_borders_do_not_change_a_bit(name):
    wanted = all_at_once(name)
    whole = picture(wanted, threads=1)
    np.testing.assert_array_equal(whole, picture(wanted, threads=3))
    np.testing.assert_array_equal(whole[11:50, 5:60], picture(wanted, region=(5, 11, 60, 50)))
    plain = replace(wanted, camera=replace(wanted.camera, lens=None, motion=None, eye=None))
    whole = picture(plain, error_threshold=2.0, samples=32)
    part = picture(plain, error_threshold=2.0, samples=32, region=(5, 11, 60, 50))
    np.testing.assert_array_equal(whole[11:50, 5:60], part)


def hashes() -> str:
    pictures = (picture(all_at_once(name)) for name in PANORAMAS)
    return " ".join(hashlib.sha256(image.tobytes()).hexdigest() for image in pictures)


def test_same_bits_from_every_instruction_set():
    found = assert_instruction_sets_agree(hashes)
    assert len(set(found.split())) == len(PANORAMAS)


def test_nothing_is_taken_for_empty_that_is_not():
    """A ball behind the camera, in tiles whose corners look away from it."""
    camera = seen(PANORAMAS["equirectangular"], size=(64, 32))
    scene = inside_of_a_ball(camera, 0.5, (0.0, 0.0, 3.0))
    core, reference = (passes_of(scene, backend)["Depth"] for backend in BACKENDS)
    np.testing.assert_array_equal(core < 1e9, reference < 1e9)
    assert (core < 1e9).any()


# --- what cannot be looked through


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "panorama",
    [
        Panorama("EQUIRECTANGULAR", longitude=(0.0, 1e300), latitude=(-1e300, 1e300)),
        Panorama("FISHEYE_EQUIDISTANT", fov=1e-300),
        Panorama("FISHEYE_EQUIDISTANT", fov=1e300),
        Panorama("FISHEYE_EQUISOLID", lens=1e-300, sensor=(1e300, 1e-300)),
        Panorama("FISHEYE_EQUISOLID", fov=9.0),
        Panorama("FISHEYE_LENS_POLYNOMIAL", polynomial=(0.0,) * 5),
        Panorama("FISHEYE_LENS_POLYNOMIAL", polynomial=(1e300,) * 5, fov=1e308),
        Panorama("CENTRAL_CYLINDRICAL", heights=(-1e300, 1e300)),
    ],
)
def test_extremes_are_finite(panorama, backend):
    graph = new_graph()
    window = shown(graph, graph.apply(BY_NAME["window"], shift=0)[0])
    scene = replace(inside_of_a_ball(seen(panorama, (8, 8)), 2.0), materials=(window,))
    for some in (scene, depths(seen(panorama, (8, 8), lens=Lens(0.1, 2.0)))):
        assert np.isfinite(passes_of(some, backend)["Combined"]).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"projection": "PEEL"}, "projection is 'PEEL'"),
        ({"longitude": (1.0, 1.0)}, "longitude (1.0, 1.0) spans nothing"),
        ({"latitude": (0.0, np.nan)}, "latitude"),
        ({"heights": (0.0,)}, "heights"),
        ({"fov": 0.0}, "fov is 0.0"),
        ({"lens": np.nan}, "lens is nan"),
        ({"sensor": (0.0, 1.0)}, "sensor is (0.0, 1.0)"),
        ({"polynomial": (0.0, np.inf, 0.0, 0.0, 0.0)}, "polynomial"),
    ],
)
def test_problems_name_the_number(changes, words):
    camera = seen(replace(PANORAMAS["equirectangular"], **changes))
    [problem] = scene_problems(inside_of_a_ball(camera, 1.0))
    assert words in problem


def test_what_else_a_panorama_refuses():
    scene = inside_of_a_ball(seen(PANORAMAS["mirror ball"]), 1.0)
    for changes, words in (
        ({"panorama": None}, "panorama is a NoneType"),
        ({"clip_start": -1.0}, "clip_start is -1.0"),
        ({"clip_planes": ((0.0, 0.0, 1.0, 0.0),)}, "clip_planes cut panoramas nowhere"),
    ):
        [problem] = scene_problems(replace(scene, camera=replace(scene.camera, **changes)))
        assert words in problem
    with pytest.raises(engine.SceneError, match="fov"):
        render(replace(scene, camera=seen(Panorama("FISHEYE_EQUIDISTANT", fov=np.nan))), Settings())
