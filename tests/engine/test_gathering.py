"""Bounced light from near by, which gather rays find, beside integrals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import GROUND, HERE, added, drawn, each_asks, lamp, matt, room
from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.lights.bounced_light import bounced_light, bounced_table
from glint.engine.reference.blocks import Shares
from glint.engine.sampling import GATHER_BLOCK, gather_points
from glint.engine.scene import Camera, Input, Instances, Light, Lobe, Material, Mesh, Scene, Strands
from test_bounced_discs import FLOOR, LAMP, PIXELS, UP, WIDE, floor_points, form
from test_openings import scene as window_scene
from test_openings import walls

BACKENDS = ["NATIVE", "NUMPY"]
WALL, END, HIGH = -0.3, 0.5, 0.8
ASIDE = np.array([1.0, 0.0, 0.0])
SUN = 2.0


def quad(*corners: tuple[float, float, float]) -> Mesh:
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Mesh("quad", np.array(corners, np.float32), triangles)


def wall_with_ends() -> Scene:
    """A light wall that stands on a floor, which the camera above does not see."""
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 3.0)])
    wall = quad((WALL, -END, 0), (WALL, END, 0), (WALL, END, HIGH), (WALL, -END, HIGH))
    return Scene(
        Camera("ORTHOGRAPHIC", frame, (-WIDE, WIDE, -WIDE, WIDE), (PIXELS, PIXELS)),
        (GROUND, wall),
        (
            Instances("floor", 0, HERE[None], (0,)),
            Instances("wall", 1, HERE[None], (1,), visible_camera=False),
        ),
        (matt((FLOOR,) * 3), matt((0.9,) * 3)),
        lights=(lamp(at=LAMP),),
    )


def thrown_by_the_wall(points: np.ndarray, strength: float) -> np.ndarray:
    """The floor's radiance by an integral over the wall. strength: of the lamp, irradiance times
    d².
    """
    y, z = np.meshgrid(((np.arange(100) + 0.5) / 50 - 1) * END, (np.arange(80) + 0.5) / 80 * HIGH)
    q = np.stack([np.full(y.size, WALL), y.ravel(), z.ravel()], -1)
    leaving = 0.9 / np.pi * strength * form(q, ASIDE, LAMP)
    to = q - points[:, None]
    both = np.maximum(to[..., 2], 0.0) * np.maximum(-(to @ ASIDE), 0.0) / (to * to).sum(-1) ** 2
    return FLOOR / np.pi * (both * leaving).mean(-1) * 2 * END * HIGH


def off(found: np.ndarray, truth: np.ndarray) -> float:
    """Relative RMSE."""
    return float(np.sqrt(((found - truth) ** 2).mean() / (truth**2).mean()))


def test_a_wall_lights_the_floor_to_its_ends_and_not_beyond() -> None:
    """Discs of its points stick out at its ends, and light the floor there from nowhere: alone
    they are 8 % off, with a relative RMSE of 17 %.
    """
    scene, points = wall_with_ends(), floor_points()
    direct = drawn(scene, 0, samples=16)[..., 0]
    lit = points[..., 0] > 0.6
    strength = np.mean(direct[lit] * np.pi / FLOOR / form(points[lit], UP, LAMP))
    found = added(scene, samples=256)[..., 0]
    before = points[..., 0] > WALL + 0.05
    truth = thrown_by_the_wall(points[before], strength)
    assert abs(found[before].mean() / truth.mean() - 1) < 0.01
    assert off(found[before], truth) < 0.06
    behind = points[..., 0] < WALL - 0.05
    assert found[behind].max() < 0.01 * truth.max()


def shaded_floor() -> Scene:
    """A wall behind a floor that the sun above lights from x = 0 on."""
    frame = np.column_stack([(1, 0, 0), (0, 0, 1), (0, -1, 0), (0.0, -3.0, 0.5)])
    wall = quad((-9, 0, 0), (9, 0, 0), (9, 0, 1), (-9, 0, 1))
    plate = quad((-40, -40, 2), (0, -40, 2), (0, 1, 2), (-40, 1, 2))
    return Scene(
        Camera("ORTHOGRAPHIC", frame, (-0.5, 0.5, -0.5, 0.5), (PIXELS, PIXELS)),
        (GROUND, wall, plate),
        (
            Instances("floor", 0, HERE[None], (0,)),
            Instances("wall", 1, HERE[None], (1,)),
            Instances("plate", 2, HERE[None], (2,), visible_camera=False),
        ),
        (matt((FLOOR,) * 3), matt((0.8,) * 3), matt((0.0,) * 3)),
        lights=(lamp("SUN", strength=SUN),),
    )


def test_a_shadow_on_the_floor_is_sharp_in_what_the_floor_throws_on() -> None:
    """Discs of lit points reach into the shadow: alone they are 21 % off, with a relative RMSE of
    39 %. What of their share is left is 1.5 % too bright, whatever the number of samples.
    """
    found = added(shaded_floor(), samples=256)[..., 0]
    k = np.arange(20_000) + 0.5
    across, turn = np.sqrt(k / len(k)), k * np.pi * (3 - np.sqrt(5))
    x, z = across * np.cos(turn), across * np.sin(turn)  # of directions before the wall
    down = z < 0
    at = (np.arange(PIXELS) + 0.5) / PIXELS
    over = at[:, None] / -z[down]  # how far along x floors are
    lit = (at - 0.5)[:, None, None] + x[down] * over > 0
    truth = 0.8 * FLOOR * SUN / np.pi * (lit.sum(-1) / len(k)).T
    above = at > 0.05
    assert abs(found[above].mean() / truth[above].mean() - 1) < 0.02
    assert off(found[above], truth[above]) < 0.03


def on_small_floor(scene: Scene) -> Scene:
    """Rays start as far off surfaces as the rounding of wide ones asks for."""
    floor = quad((-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0))
    return replace(scene, geometries=(floor, *scene.geometries[1:]))


@pytest.mark.parametrize("scene", [wall_with_ends(), shaded_floor()], ids=("wall", "shadow"))
def test_both_tracers_gather_the_same(scene: Scene) -> None:
    native, exact = (added(on_small_floor(scene), backend, samples=4) for backend in BACKENDS)
    apart = np.abs(native - exact).max(2) / exact.mean()
    assert np.median(apart) < 1e-6
    assert (apart > 1e-4).mean() < 0.01  # edges


def test_what_is_found_is_lit_by_all_of_the_sky() -> None:
    """Each sample asks for half of it."""
    sky = Light("sky", "DOME", HERE, radiance=np.ones((4, 8, 3), np.float32))
    scene = replace(wall_with_ends(), lights=(sky,))
    for some in (on_small_floor(scene), replace(window_scene(walls()), lights=(sky,))):
        native, exact = (drawn(some, 1, backend, samples=2) for backend in BACKENDS)
        apart = np.abs(native - exact).max(2)
        assert np.median(apart) < 5e-7 * exact.mean()
        bounced = exact - drawn(some, 0, "NUMPY", samples=2)
        assert (apart > 1e-4 * bounced.mean()).mean() < 0.02  # edges
    # half of few directions by each of 64 samples, and half of many
    few, many = (added(scene, samples=64, light_samples=n)[..., 0] for n in (2, 16))
    before = floor_points()[..., 0] > WALL + 0.05
    assert abs(few[before].mean() / many[before].mean() - 1) < 0.02
    assert off(few[before], many[before]) < 0.05


def test_what_is_near_is_indirect_light_of_what_is_matt() -> None:
    scene = wall_with_ends()
    for backend in BACKENDS:
        film = render(
            scene,
            Settings(
                samples=16,
                light_samples=2,
                filter_width=0.0,
                diffuse_bounces=1,
                backend=backend,
                passes={"Combined", "Diffuse", "Shadow", "Mirror", "Diffuse Direct",
                        "Diffuse Indirect", "Diffuse Color"},
            ),
        )  # fmt: skip
        p = film.passes
        assert not p["Mirror"].any()
        both = (p["Diffuse Direct"] + p["Diffuse Indirect"]) * p["Diffuse Color"]
        np.testing.assert_allclose(both, p["Combined"][..., :3], rtol=1e-4, atol=1e-6)
        parts = p["Diffuse"] + p["Shadow"]
        np.testing.assert_allclose(parts, p["Combined"][..., :3], rtol=1e-4, atol=1e-6)
        assert film.stats["gather rays"] == 16 * 2 * PIXELS**2


def test_no_rays_gather_where_nothing_bounces_or_catchers_are() -> None:
    scene = wall_with_ends()
    caught = replace(
        scene,
        instances=(scene.instances[0], replace(scene.instances[1], catcher=True)),
    )
    for backend in BACKENDS:
        for some, bounces in ((scene, 0), (caught, 1)):
            settings = Settings(samples=4, diffuse_bounces=bounces, backend=backend)
            assert not render(some, settings).stats.get("gather rays", 0)


def test_each_light_bounces_as_often_as_asked() -> None:
    """Points that end a walk throw nothing on what gather rays find."""
    for bounces in (1, 2, 4):
        light = bounced_light(room(lamp()), bounces)
        table = bounced_table(light, 64, 16)
        if bounces == 1:
            assert table.last.all()
        assert 0 < table.last.mean() <= 1
        assert table.near > 0


def test_panes_dim_what_is_thrown_on_through_them() -> None:
    """A clear pane before the wall changes nothing, one that takes half dims it twice: before the
    wall is lit, and after. Each takes the points of the walks in another order, so that pixels ask
    for themselves, and of few samples other points.
    """

    def with_pane(share: float) -> Scene:
        scene = wall_with_ends()
        pane = quad((-0.28, -9, 0), (-0.28, 9, 0), (-0.28, 9, 9), (-0.28, -9, 9))
        clear = Material("pane", (Lobe("TRANSPARENT", (Input((share,) * 3),)),))
        return replace(
            scene,
            geometries=(*scene.geometries, pane),
            instances=(
                *scene.instances, Instances("pane", 2, HERE[None], (2,), visible_camera=False)
            ),
            materials=(*scene.materials, clear),
        )  # fmt: skip

    before = floor_points()[..., 0] > -0.2
    scenes = tuple(map(each_asks, (wall_with_ends(), with_pane(1.0), with_pane(0.5))))
    plain, clear, half = (added(scene, samples=256)[before].mean() for scene in scenes)
    assert clear == pytest.approx(plain, rel=1e-6)
    assert half == pytest.approx(plain / 4, rel=0.01)
    for scene in scenes:
        small = on_small_floor(scene)
        native, exact = (added(small, backend, samples=2)[before] for backend in BACKENDS)
        assert np.median(np.abs(native - exact)) < 1e-5 * exact.mean()  # but for edges


def test_strands_throw_no_light_on() -> None:
    """Neither as points nor to gather rays."""
    scene = wall_with_ends()
    points = np.array([(WALL, y, z) for y in (-0.4, 0.4) for z in (0.1, 0.7)], np.float32)
    hair = Strands("hair", points, np.full(4, 0.2, np.float32), np.array([0, 2], np.uint32))
    hairy = replace(
        scene,
        geometries=(GROUND, hair),
        lights=(lamp(at=LAMP), lamp(at=(0.0, 0.0, 50.0))),
    )
    for backend in BACKENDS:
        assert np.abs(added(hairy, backend, samples=4)).max() < 1e-6


def test_explain_follows_gather_rays() -> None:
    scene = wall_with_ends()
    settings = Settings(light_samples=2, diffuse_bounces=1)
    ray = PixelExplainer(scene, settings).pixel(18, PIXELS // 2)
    near = [after for after in ray.follow if after.kind == "gather"]
    assert len(near) == 2 * GATHER_BLOCK**2
    assert ray.hit is not None and ray.hit.turns == GATHER_BLOCK**2
    lines = explanation_lines(ray)
    assert any("4 pixels that show one surface take turns" in line for line in lines)
    assert any("thrown on by what is near" in line for line in explanation_lines(ray)) == any(
        max(after.color) > 0 for after in near
    )


def test_neighbours_look_in_directions_of_their_own() -> None:
    """Edges of what is near would fan out over surfaces where all pixels look in the same."""
    points = gather_points(16, 2)
    assert points.shape == (GATHER_BLOCK**2, 32, 2)
    assert (np.hypot(*points.reshape(-1, 2).T) <= 1).all()
    assert len(np.unique(points.reshape(-1, 2), axis=0)) == GATHER_BLOCK**2 * 32
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    edges = np.stack([np.cos(turn), np.sin(turn)])
    beyond = np.arccos(0.3) / np.pi - 0.3 * np.sqrt(1 - 0.3**2) / np.pi
    errors = [((p @ edges > 0.3).mean(0) - beyond).std() for p in points]
    together = ((points.reshape(-1, 2) @ edges > 0.3).mean(0) - beyond).std()
    assert together < 0.5 * np.mean(errors)  # a quarter of the steps, and not by chance


def lit_through_a_slit() -> Scene:
    """A wall behind a dark floor with a thin bright line that runs towards it."""
    scene = shaded_floor()
    plate = quad((0.1, -40, 2), (40, -40, 2), (40, 1, 2), (0.1, 1, 2))
    other = replace(scene.instances[2], name="other", geometry=3)
    return replace(
        scene, geometries=(*scene.geometries, plate), instances=(*scene.instances, other)
    )


@pytest.mark.parametrize(
    ("backend", "samples", "most"), [("NATIVE", 64, 0.06), ("NUMPY", 16, 0.15)]
)
def test_pixels_of_a_block_share_what_their_rays_find(
    backend: str, samples: int, most: float
) -> None:
    """Each by itself looks past the line or at it, in the same directions as the pixel after the
    next: dots of 0.3 of their mean at 64 samples, 0.74 at 16.
    """
    found = added(lit_through_a_slit(), backend, samples=samples)[4:, :, 0]
    dots = found[:, 1:-1] - (found[:, 2:] + found[:, :-2]) / 2
    assert np.abs(dots).mean() < most * found.mean()


def test_shares_are_as_dense_as_rays_of_each_lie_there() -> None:
    """Two neighbours and what is over one of them; a third is on another surface, and alone."""
    x = np.array([[0.0, 1.0, 0.0], [0, 0, 0], [0, 0, 0]])
    normal = np.array([[0.0, 0, 1], [0, 0, 0], [1, 1, 0]])
    members = np.array([[0, 1, -1, -1], [-1, -1, -1, -1]])
    matt = np.array([[0.2, 0.4, 1.0]] * 3)
    shares = Shares(np.array([0, 0, -1]), members, np.zeros(3, bool), x, normal, matt)
    over = np.array([[0.0], [0.0], [2.0]])
    for giver in (0, 1):
        ray, receiver, share = shares.given(np.array([giver]), over, np.array([[0.0], [0], [-1]]))
        # cosines at both ends over d²: 1 / 4 and (2 / √5)² / 5
        dense = np.array([1 / 4, 4 / 25])
        assert ray.tolist() == [0, 0]
        assert receiver.tolist() == [0, 1]
        assert np.allclose(share[0], dense / dense.sum() * [0.2, 0.4], rtol=1e-12)
    _, receiver, share = shares.given(np.array([2]), over, np.array([[0.0], [0], [-1]]))
    assert receiver.tolist() == [2]
    assert share.ravel().tolist() == [1.0] * 3


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_part_of_a_frame_is_as_in_it(backend: str) -> None:
    """Which directions a pixel looks in is up to where it is in the frame."""
    whole = drawn(wall_with_ends(), 1, backend, samples=4)
    part = drawn(wall_with_ends(), 1, backend, samples=4, region=(3, 5, 26, 24))
    assert np.array_equal(part, whole[5:24, 3:26])
