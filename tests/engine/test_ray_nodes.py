"""Operations that ask the scene for rays: closed forms, one tracer beside the other, the same bits
whatever the work, and contexts without a scene.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES, at, box_mesh
from glint.engine import render
from glint.engine import scene as s
from glint.engine import settings as engine_settings
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.scene.problems import scene_problems
from native_tools import (
    assert_instruction_sets_agree,
    constant,
    draw,
    lamp,
    needs_core,
    square,
    view_from_above,
)
from ray_node_scenes import BACKENDS, DISTANCE, FEW, _coloured, cast, floor_of, occlusion, seen
from test_occlusion_pass import SPREAD, WIDE, floor_and, upright, x_and_y


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_near_and_nothing_open(backend: str) -> None:
    assert (seen(floor_of(occlusion()), backend, **FEW) == 1).all()
    around = (box_mesh(), at(linear=5.0))
    assert not seen(floor_of(occlusion(1e4), around), backend, **FEW).any()
    assert (seen(floor_of(occlusion(3.0), around), backend, **FEW) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("height", [0.5, 1.2])
@pytest.mark.parametrize("distance", [2.0, None])
def test_a_ceiling_within_reach(backend: str, height: float, distance: float | None) -> None:
    """Directions of a cosine below h / D get by: the square of that."""
    ceiling = (square(WIDE), at((0, 0, height)))
    found = seen(floor_of(occlusion(distance), ceiling, reach=2.0), backend)
    np.testing.assert_allclose(found, (height / 2) ** 2, atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_low_wall(backend: str) -> None:
    """Of an endless strip half of 1 - cos of its elevation."""
    found = seen(floor_of(occlusion(1e4), (square(1.0), upright(1.5, 1.0))), backend)
    away = 1.5 - x_and_y()[0]
    np.testing.assert_allclose(found, 1 - (1 - away / np.hypot(away, 1.0)) / 2, atol=SPREAD)


@needs_core
@pytest.mark.parametrize("samples", [1, 3, 16, 128])
def test_samples_of_the_node_are_those_of_a_sample_of_the_picture(samples: int) -> None:
    """Directions go on where the sample before ended: only how many there are in all counts."""
    wall = (square(1.0), upright(1.5, 1.0))
    away = 1.5 - x_and_y()[0]
    expected = 1 - (1 - away / np.hypot(away, 1.0)) / 2
    error = np.abs(seen(floor_of(occlusion(1e4, samples=samples), wall)) - expected)
    assert error.max() < 2 * (64 * samples) ** -0.75
    ends = seen(floor_of(occlusion(1e4, samples=128), wall), samples=1)
    np.testing.assert_allclose(seen(floor_of(occlusion(1e4, samples=2), wall)), ends, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_inside_looks_below(backend: str) -> None:
    below = (square(WIDE), at((0, 0, -1.0)))
    found = seen(floor_of(occlusion(inside=1), below), backend)
    np.testing.assert_allclose(found, 0.25, atol=SPREAD)
    assert (seen(floor_of(occlusion(), below), backend, **FEW) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_only_local_knows_the_own_instance_alone(backend: str) -> None:
    """Whether it casts shadows or not; of things at one place too."""
    ceiling = (square(WIDE), at((0, 0, 1.0)))
    local = occlusion(only_local=1)
    assert (seen(floor_of(local, ceiling), backend, **FEW) == 1).all()
    both = s.Mesh(
        "both",
        np.concatenate([square(WIDE).vertices, square(WIDE).vertices + np.float32([0, 0, 1])]),
        np.concatenate([square().triangles, square().triangles + 4]),
    )
    scene = floor_of(local, (square(WIDE), at((0, 0, 1.0))))
    own = replace(scene.instances[0], visible_shadow=False)
    view = view_from_above(8, 1.0, 0.9)
    for order in ((0, 1), (1, 0)):
        blocks = tuple((own, scene.instances[1])[k] for k in order)
        here = replace(scene, camera=view, geometries=(both, scene.geometries[1]), instances=blocks)
        np.testing.assert_allclose(seen(here, backend), 0.25, atol=SPREAD)
    two = s.Instances("two", 0, np.concatenate([at(), at((0, 0, 1.0))]), (0,))
    alone = replace(scene, camera=view, geometries=(square(WIDE),), instances=(two,))
    assert (seen(alone, backend, **FEW) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_only_local_on_solids(backend: str) -> None:
    """A ball under another of the same instance, and between them one of another."""
    centers = np.array([[0, 0, -1.0], [0, 0, 2.0]], np.float32)
    pair = s.Spheres("pair", centers, np.ones(2, np.float32))
    scene = floor_of(occlusion(1e4, only_local=1))
    view = view_from_above(8, 0.05, 0.9)
    own = s.Instances("own", 0, at(), (0,))
    other = s.Instances("other", 1, at((0, 0, 0.5), 0.3), (1,), visible_camera=False)
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    scene = replace(scene, camera=view, geometries=(pair, ball), instances=(other, own))
    np.testing.assert_allclose(seen(scene, backend), 1 - 1 / 2.0**2, atol=SPREAD)
    for local, far in ((0, 0.2), (1, 1.0)):
        scene = replace(scene, materials=(cast(DISTANCE, only_local=local), scene.materials[1]))
        np.testing.assert_allclose(seen(scene, backend, samples=1), far, atol=0.01)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_given_normal_counts(backend: str) -> None:
    """Half of the sky over an upright normal is below the floor; any length will do."""
    for normal in ((1.0, 0.0, 0.0), (1e-9, 0.0, 0.0)):
        found = seen(floor_of(occlusion(1e4, normal=normal)), backend)
        np.testing.assert_allclose(found, 1.0, atol=SPREAD)  # a floor has nothing below
    below = (square(WIDE), at((0, 0, -1.0)))
    found = seen(floor_of(occlusion(1e6, normal=(1.0, 0.0, 0.0)), below), backend)
    np.testing.assert_allclose(found, 0.5, atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_odd_input_finds_nothing_near(backend: str) -> None:
    ceiling = (square(WIDE), at((0, 0, 1.0)))
    for distance in (0.0, -1.0, np.nan):
        assert (seen(floor_of(occlusion(distance), ceiling), backend, **FEW) == 1).all()
    for normal in ((0.0, 0.0, 0.0), (np.nan, np.inf, 0.0)):
        found = seen(floor_of(occlusion(normal=normal), ceiling), backend, **FEW)
        assert (found == 1).all()
    assert not seen(floor_of(occlusion(np.inf), ceiling), backend, **FEW).any()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_tiny_and_huge(backend: str, size: float) -> None:
    base = floor_of(occlusion(2.0 * size), (square(WIDE), at((0, 0, 1.0))))
    blocks = tuple(
        replace(block, world_from_object=block.world_from_object * size) for block in base.instances
    )
    scene = replace(base, camera=view_from_above(8, size, 10 * size), instances=blocks)
    np.testing.assert_allclose(seen(scene, backend), 0.25, atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_clear_hides_and_what_casts_no_shadow_does_not(backend: str) -> None:
    """As in Cycles."""
    veil = s.Material("veil", (s.Lobe("TRANSPARENT", constant(1.0)),))
    scene = floor_of(occlusion(), (square(WIDE), at((0, 0, 1.0))))
    scene = replace(scene, materials=(scene.materials[0], veil))
    np.testing.assert_allclose(seen(scene, backend), 0.25, atol=SPREAD)
    free = replace(scene.instances[1], visible_shadow=False)
    scene = replace(scene, instances=(scene.instances[0], free))
    assert (seen(scene, backend, **FEW) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_shadow_rays_find_nothing_near(backend: str) -> None:
    """A veil as clear as it is open, between two plates: seen it lets a quarter through, to light
    all, as in Cycles; and no program runs for the rays of another.
    """
    veil = occlusion(2.0, "TRANSPARENT")
    scene = floor_and((square(WIDE), at((0, 0, 1.0))), (square(WIDE), at((0, 0, 2.0))), half=0.1)
    blocks = [
        scene.instances[0],
        replace(scene.instances[1], visible_camera=True),
        replace(scene.instances[2], visible_camera=False, materials=(2,)),
    ]
    clear = s.Material("clear", (s.Lobe("TRANSPARENT", constant(1.0)),))
    white = s.Material("white", (s.Lobe("DIFFUSE", constant(1.0)),))
    sun = lamp("SUN", strength=np.pi)
    scene = replace(scene, instances=tuple(blocks), materials=(white, veil, clear), lights=(sun,))
    lit = replace(scene, instances=(blocks[0], replace(blocks[1], visible_camera=False), blocks[2]))
    base = seen(lit, backend, **FEW)
    assert base.min() > 0.1
    np.testing.assert_allclose(seen(scene, backend), 0.25 * base, atol=SPREAD)


@needs_core
@pytest.mark.parametrize("name", sorted(SCENES))
@pytest.mark.parametrize("local", [0, 1])
def test_one_tracer_beside_the_other(name: str, local: int) -> None:
    """Every material shines as open as it is; rays that graze an edge may go either way."""
    base = SCENES[name]()
    asks = occlusion(2.0, only_local=local, samples=8)
    scene = replace(base, materials=(asks,) * len(base.materials))
    assert scene_problems(scene) == []
    passes = ("Cost",)
    native, reference = (
        draw(scene, *passes, backend=b, samples=2, filter_width=0.0, max_bounces=2)
        for b in ("NATIVE", "NUMPY")
    )
    difference = np.abs(native.combined - reference.combined).max(-1)
    assert (difference > 1e-5).mean() < 5e-3
    apart = native.passes["Cost"] != reference.passes["Cost"]
    assert apart.mean() < 5e-3
    assert native.passes["Cost"].max() >= 8
    assert native.stats["shadow rays"] == pytest.approx(reference.stats["shadow rays"], rel=1e-3)


@needs_core
def test_the_same_bits_whatever_the_work() -> None:
    scene = asking_scene()
    settings = {"samples": 4, "filter_width": 1.5, "max_bounces": 2}
    width, height = scene.camera.resolution
    whole = draw(scene, **settings).combined
    np.testing.assert_array_equal(draw(scene, threads=1, **settings).combined, whole)
    region = (width // 4, height // 4, width // 2, height - 3)
    part = whole[region[1] : region[3], region[0] : region[2]]
    np.testing.assert_array_equal(draw(scene, region=region, **settings).combined, part)


def asking_scene() -> s.Scene:
    """The first material reads what its rays meet."""
    base = SCENES["flat_and_smooth"]()
    reads = cast(0, (0.3, -0.2, 1.0), name="raycast_attribute", attribute="told")
    mixed = (occlusion(2.0), occlusion(1.0, only_local=1, inside=1))
    others = tuple(mixed[k % 2] for k in range(1, len(base.materials)))
    things = tuple(_coloured(g, 4) if isinstance(g, s.Mesh) else g for g in base.geometries)
    return replace(base, materials=(reads, *others), geometries=things)


@needs_core
def test_the_same_bits_with_any_instruction_set() -> None:
    assert_instruction_sets_agree(lambda: draw(asking_scene(), samples=2).combined.tobytes())


@needs_core
def test_who_does_not_ask_pays_nothing() -> None:
    scene = SCENES["flat_and_smooth"]()
    assert scene.most_asked == 0 and asking_scene().most_asked == 16
    before = draw(scene, samples=2)
    spare = replace(scene, materials=(*scene.materials, occlusion()))
    after = draw(spare, samples=2)
    np.testing.assert_array_equal(before.combined, after.combined)
    assert before.stats["shadow rays"] == after.stats["shadow rays"]


@needs_core
def test_a_pixel_is_explained_as_it_is_drawn() -> None:
    scene = floor_of(occlusion(), (square(1.0), upright(1.5, 1.0)))
    settings = engine_settings.Settings(samples=1, filter_width=0.0)
    explainer, picture = PixelExplainer(scene, settings), render(scene, settings).combined
    for x, y in ((0, 0), (7, 3)):
        np.testing.assert_allclose(explainer.pixel(x, y).color, picture[y, x, :3], rtol=1e-6)


@needs_core
def test_pixels_that_stop_early_have_looked_round() -> None:
    """One sample of few directions is alike all over a face: pixels take 16 before they stop."""
    scene = floor_of(occlusion(1e4, samples=1), (square(1.0), upright(1.5, 1.0)))
    film = draw(scene, "Samples", samples=64, error_threshold=1.0)
    assert film.passes["Samples"].min() >= 16


@pytest.mark.parametrize("backend", BACKENDS)
def test_things_hide_where_they_are_in_a_moment(backend: str) -> None:
    """A ceiling that rises evenly from 0.5 to 1.5: the mean of a quarter of its height squared."""
    scene = floor_of(occlusion(), (square(WIDE), at((0, 0, 1.0))))
    keys = np.stack([at((0, 0, z)) for z in (0.5, 1.5)])
    moving = replace(
        scene, instances=(scene.instances[0], replace(scene.instances[1], motion=keys))
    )
    found = seen(moving, backend)
    np.testing.assert_allclose(found, (1.5**3 - 0.5**3) / 3 / 4, atol=2 * SPREAD)
