"""The reference as a tracer: regions, samples, waves, stopping, clipping, far scenes, precision of
the API boundary.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import (
    SCENES,
    at,
    ball_mesh,
    box_mesh,
    camera,
    constant,
    grid_mesh,
    light,
    look_at,
    stage,
    surface,
)
from glint import engine
from glint.engine import scene as s
from glint.engine.reference import trace, visibility
from glint.engine.sampling import pixel_offsets
from test_reference_support import PASSES, color, floor, hard, material, values

SETTINGS = engine.Settings(samples=2, light_samples=2, backend="NUMPY", passes=PASSES)
GLOW = s.Lobe("EMISSION", constant(1.0))


@pytest.mark.parametrize("name", SCENES)
def test_parts_sum_to_combined_and_all_is_finite(name: str) -> None:
    scene = SCENES[name]()
    size = tuple(side // 2 for side in scene.camera.resolution)
    scene = replace(scene, camera=replace(scene.camera, resolution=size))
    found = values(scene, samples=2, light_samples=2)
    total = sum(found[part] for part in engine.PARTS)
    assert np.allclose(total, found["Combined"][..., :3], rtol=1e-13, atol=1e-15)
    assert all(np.isfinite(array).all() for array in found.values())


@pytest.mark.parametrize("name", SCENES)
def test_regions_tiles_and_repeats_have_the_same_bits(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = SCENES[name]()
    nx, ny = (side // 4 for side in scene.camera.resolution)
    scene = replace(scene, camera=replace(scene.camera, resolution=(nx, ny)))
    whole = engine.render(scene, SETTINGS)
    monkeypatch.setattr(trace, "TILE", 5 * nx)
    tiled = engine.render(scene, SETTINGS)
    for key, value in whole.passes.items():
        assert np.array_equal(value, tiled.passes[key]), key
    for region in ((0, 0, nx // 3, ny), (nx // 3, ny // 2, nx, ny), (nx // 2, 3, nx // 2 + 1, 4)):
        x0, y0, x1, y1 = region
        part = engine.render(scene, replace(SETTINGS, region=region))
        for key, value in part.passes.items():
            assert np.array_equal(value, whole.passes[key][y0:y1, x0:x1]), (key, region)


def test_passes_do_not_change_the_picture() -> None:
    scene = SCENES["alpha"]()
    assert np.array_equal(
        engine.render(scene, SETTINGS).combined,
        engine.render(scene, replace(SETTINGS, passes=frozenset())).combined,
    )


def test_samples_are_the_filter_s_offsets_at_equal_weight() -> None:
    """Four samples are the mean of pictures whose windows are moved by the four offsets."""
    scene = SCENES["flat_and_smooth"]()
    view = scene.camera
    (left, right, bottom, top), (nx, ny) = view.window, view.resolution
    moved = []
    for dx, dy in pixel_offsets(4, 1.5):
        u, v = dx * (right - left) / nx, dy * (top - bottom) / ny
        window = (left + u, right + u, bottom + v, top + v)
        moved.append(color(replace(scene, camera=replace(view, window=window))))
    found = color(scene, samples=4)
    far_off = np.abs(found - np.mean(moved, 0)).max(-1) > 1e-9
    # a window moved and moved back differs by an ulp, which may cross an edge
    assert far_off.sum() <= 2


def test_waves_and_progress() -> None:
    scene, waves, progress = SCENES["hard_lights"](), [], []
    film = engine.render(
        scene, replace(SETTINGS, samples=5), on_progress=progress.append, on_wave=waves.append
    )
    assert [w.samples for w in waves] == [1, 2, 4]
    assert film.samples == 5
    assert film.complete
    assert progress == sorted(progress)
    assert progress[-1] == 1
    alone = engine.render(scene, replace(SETTINGS, samples=1))
    assert np.array_equal(waves[0].passes["Depth"], alone.passes["Depth"])
    assert set(film.stats) >= {"build", "trace", "triangles", "instances", "rays", "bytes"}


def test_stopping_returns_what_is_there() -> None:
    scene = SCENES["hard_lights"]()
    asked = []

    def stop_late() -> bool:
        asked.append(1)
        return len(asked) > 2

    film = engine.render(scene, replace(SETTINGS, samples=4096), should_stop=stop_late)
    assert not film.complete
    assert 0 <= film.samples < 4096
    assert len(asked) == 3
    at_once = engine.render(scene, replace(SETTINGS, samples=4), should_stop=lambda: True)
    assert not at_once.complete
    assert np.isfinite(at_once.combined).all()


@pytest.mark.slow
def test_should_stop_is_asked_for_every_few_thousand_rays() -> None:
    """A quarter of a million pixels with mirror and soft light; 50 ms is some 30 000 simple rays of
    this tracer on a slow core.
    """
    mirror = surface("m", 0.5, lobes=(s.Lobe("MIRROR", constant(0.5)),))
    scene = stage(
        ball_mesh(100), instances=(s.Instances("b", 1, at((0, 0, 1)), (1,)),), materials=(mirror,),
        lights=(light("POINT", radius=0.3), light("SUN")), camera=camera(size=(512, 480)),
    )  # fmt: skip
    asked = []
    film = engine.render(
        scene,
        engine.Settings(samples=1, backend="NUMPY"),
        should_stop=lambda: bool(asked.append(1)),
    )
    assert film.stats["rays"] / len(asked) < 30_000


def test_clip_range_is_closed() -> None:
    """Hits exactly at clip_start and clip_end count; just outside they do not."""
    sheets = (
        s.Instances(
            "s", 0, np.concatenate([at((0, 0, z)) for z in (0.0, 1.0, 2.0)]), (0,), object_index=1
        ),
    )
    ranges = (
        ((0, np.inf), 2),
        ((2, 9), 2),
        ((2.0001, 9), 3),
        ((3, 3.5), 3),
        ((2.5, 3), 3),
        ((2.1, 2.9), 1e10),
        ((3.5, 4), 4),
    )
    for kind in ("PERSPECTIVE", "ORTHOGRAPHIC"):
        view = s.Camera(
            kind, look_at((0, 0, 4), (0, 0, 0), (0, 1, 0)), (-0.1, 0.1, -0.1, 0.1), (2, 2)
        )
        for clip, depth in ranges:
            clipped = replace(view, clip_start=clip[0], clip_end=clip[1])
            found = values(s.Scene(clipped, (grid_mesh(),), sheets, (material(GLOW),)))
            assert np.allclose(found["Depth"], depth, rtol=1e-15), (kind, clip)


@pytest.mark.parametrize("distance", [1e3, 1e5, 1e7])
def test_far_from_the_origin(distance: float) -> None:
    """Object, camera and light moved together: the same picture to the rounding of the placements,
    1.1e-16 of the distance.
    """
    away = distance * np.array([1.0, -2.0, 0.5])

    def picture(offset: np.ndarray) -> np.ndarray:
        view = camera(np.array([2.1, -4.3, 2.7]) + offset, np.array([0, 0, 0.4]) + offset)
        placed = (
            s.Instances("floor", 0, at(offset), (0,)),
            s.Instances("ball", 1, at(offset + [0, 0, 0.8], 0.8), (0,)),
        )
        lamp = light("POINT", np.array([1.7, -2.2, 4.1]) + offset, offset)
        return color(
            s.Scene(
                view, (grid_mesh(4), ball_mesh()), placed, (surface(specular=0.4),), (), (lamp,)
            )
        )

    here, there = picture(np.zeros(3)), picture(away)
    wrong = (np.abs(here - there) > 1e-3 * here.max()).any(-1)
    assert wrong.sum() <= 1  # a pixel on an outline
    assert np.allclose(here[~wrong], there[~wrong], rtol=distance * 1e-13, atol=distance * 1e-13)


@pytest.mark.parametrize("scale", [1e-6, 1e6, 1e12])
def test_scale_of_the_whole_scene_does_not_matter(scale: float) -> None:
    def picture(k: float) -> np.ndarray:
        view = camera(k * np.array([2.1, -4.3, 2.7]), (0, 0, 0.4 * k))
        placed = (
            s.Instances("floor", 0, at(linear=k), (0,)),
            s.Instances("ball", 1, at((0, 0, 0.8 * k), 0.8 * k), (0,)),
        )
        lamp = light("POINT", k * np.array([1.7, -2.2, 4.1]), strength=400 * k * k, radius=0.2 * k)
        return color(
            s.Scene(view, (grid_mesh(4), ball_mesh()), placed, (surface(),), (), (lamp,)),
            light_samples=3,
        )

    one, scaled = picture(1.0), picture(scale)
    wrong = (np.abs(one - scaled) > 1e-6 * one.max()).any(-1)
    assert wrong.sum() <= 1


@pytest.mark.parametrize("elevation", [30.0, 85.0, 89.5])
def test_no_acne(elevation: float) -> None:
    """A tilted grid and a facetted ball under a grazing sun, near the origin and far: nothing
    convex shadows itself.
    """
    a = np.radians(elevation)
    sun = s.Light("sun", "SUN", look_at((np.sin(a), 0.1, np.cos(a)), (0, 0, 0)))
    for where in (0.0, 1e6):
        offset = np.full(3, where)
        view = camera(offset + [2.1, -4.3, 2.7], offset)
        for mesh in (grid_mesh(9), ball_mesh(8, smooth=False)):
            scene = s.Scene(
                view, (mesh,), (s.Instances("m", 0, at(offset), (0,)),), (surface(),), (), (sun,)
            )
            assert not values(scene)["Shadow"].any()


def test_lights_at_and_under_the_surface() -> None:
    """The shadow segment is open: a light on the plane lights nothing of it, one just above lights,
    one below does not.
    """
    for height, lit in ((0.0, False), (1e-6, True), (-1e-6, False)):
        lamp = s.Light("l", "POINT", at((0.1, 0.2, height))[0])
        found = color(floor(s.Lobe("DIFFUSE", constant(1.0)), lights=(lamp,)))
        assert (found > 0).all() == lit
        assert np.isfinite(found).all()


def test_a_light_at_a_vertex_lights() -> None:
    tent = grid_mesh(2, 1.0, lambda x, y: np.where((x == 0) & (y == 0), 1.0, 0.0))
    lamp = s.Light("l", "POINT", at((0, 0, 1))[0])
    base = floor(s.Lobe("DIFFUSE", constant(1.0)), lights=(lamp,))
    hidden = s.Instances("t", 1, at(), (0,), visible_camera=False)
    under = replace(base, geometries=(*base.geometries, tent), instances=(*base.instances, hidden))
    found = values(under)
    floor_only = values(base)
    beyond = np.abs(floor_only["Position"][..., :2]).max(-1) > 1.01
    assert np.allclose(found["Combined"][beyond], floor_only["Combined"][beyond], rtol=1e-9)


def test_a_light_on_a_tilted_face_lights_what_is_under_it() -> None:
    """Within rounding of the face, wherever on it: the open segment does not end in the face."""
    generator = np.random.default_rng(4)
    tilted = np.array([[0.3, 0.1, 0.2], [0.1, 0.3, -0.1], [0.2, 0.1, 0.3]])
    base = floor(s.Lobe("DIFFUSE", constant(1.0)))
    roof = s.Instances("roof", 1, at((0.1, 0.2, 1.3), tilted), (0,), visible_camera=False)
    scene = replace(
        base, geometries=(*base.geometries, grid_mesh(1, 1.0)), instances=(*base.instances, roof)
    )
    for x, y in generator.uniform(-0.9, 0.9, (20, 2)):
        place = tilted @ [x, y, 0] + [0.1, 0.2, 1.3]
        found = values(replace(scene, lights=(s.Light("l", "POINT", at(place)[0]),)))
        below = (found["Position"] - place) @ np.linalg.inv(tilted)[2] < -0.3
        assert below.any()
        assert not found["Shadow"][below].any()


def test_blockers_behind_the_light_cast_no_shadow() -> None:
    base = floor(s.Lobe("DIFFUSE", constant(1.0)), lights=(hard("POINT"),))
    lid = s.Instances("lid", 0, at((0, 0, 1.9), 0.01), (0,), visible_camera=False)
    assert not values(replace(base, instances=(*base.instances, lid)))["Shadow"].any()
    lower = replace(lid, world_from_object=at((0, 0, 1.0)))
    assert np.allclose(color(replace(base, instances=(*base.instances, lower))), 0)


def test_contact_has_no_light_leaks() -> None:
    """A cube that stands on, or is sunk into, the floor: no lit floor pixel under it through the
    crack, seen from inside.
    """
    inside = s.Camera("PERSPECTIVE", look_at((0, 0, 0.5), (0.9, 0.2, 0)), (-1, 1, -1, 1), (48, 48))
    for sink in (0.0, 1e-3):
        box = s.Instances("box", 1, at((0, 0, 1 - sink)), (0,))
        scene = stage(
            ball_mesh(), camera=inside, lights=(light("SUN"),), world=s.World(), materials=()
        )
        scene = replace(
            scene, geometries=(grid_mesh(4), box_mesh()), instances=(scene.instances[0], box)
        )
        assert color(replace(scene, materials=(surface(ambient=None),))).max() == 0


def test_empty_scenes() -> None:
    nothing = s.Scene(camera(size=(4, 3)))
    film = engine.render(nothing, SETTINGS)
    assert film.combined.shape == (3, 4, 4)
    assert np.array_equal(film.combined, np.broadcast_to(np.float32([0, 0, 0, 1]), (3, 4, 4)))
    assert (film.passes["Depth"] == 1e10).all()


def test_extreme_power_saturates() -> None:
    for strength in (3e38, -3e38):
        scene = floor(
            s.Lobe("DIFFUSE", constant(1.0)),
            lights=(replace(hard("POINT"), strength=strength, color=(1e30, 1, 0)),),
        )
        film = engine.render(scene, SETTINGS)
        assert all(np.isfinite(image).all() for image in film.passes.values())


def test_negative_light_takes_away() -> None:
    lamp = hard("POINT")
    both = (lamp, replace(lamp, strength=-lamp.strength))
    assert np.abs(color(floor(s.Lobe("DIFFUSE", constant(1.0)), lights=both))).max() < 1e-15


def test_rays_of_one_depth_are_followed_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many questions for hits as the scene has layers and bounces, not as it has branches."""
    lobes = (s.Lobe("MIRROR", constant(0.9)), s.Lobe("TRANSPARENT", constant(0.5)), GLOW)
    walls = (s.Instances("w", 0, np.concatenate([at((0, 0, -1)), at((0, 0, 1))]), (0,)),)
    view = s.Camera(
        "PERSPECTIVE",
        look_at((0, 0, 0), (0.1, 0.0, 1.0), (0, 1, 0)),
        (-0.1, 0.1, -0.1, 0.1),
        (2, 2),
    )
    asked, closest = [], visibility.Visibility.closest

    def counted(*args):
        asked.append(1)
        return closest(*args)

    monkeypatch.setattr(visibility.Visibility, "closest", counted)
    values(s.Scene(view, (grid_mesh(1, 50.0),), walls, (material(*lobes),)), max_bounces=10)
    assert 11 <= len(asked) <= 11 * 3
