"""Light that surfaces throw onto others: closed forms, one tracer beside the other, extremes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import (
    ALBEDO,
    AT_WALL,
    BACKENDS,
    GROUND,
    HERE,
    VARNISH,
    WALL,
    added,
    ball,
    drawn,
    inside,
    lamp,
    matt,
    mixed,
    quad,
    room,
    wall_over_ground,
)
from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.scene import (
    Camera,
    Geometry,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Scene,
    Strands,
)
from test_openings import scene as window_scene
from test_openings import walls
from test_path_bounces import noise_of
from test_path_tracer import LAMPS


@pytest.mark.parametrize("name", LAMPS)
def test_what_a_ball_throws_back_is_even_wherever_the_lamp_is(name: str) -> None:
    light, power = LAMPS[name]
    truth = ALBEDO**2 * power / (4 * np.pi**2)  # radiance: albedo / π of the albedo of Φ / 4π
    found = added(room(light), samples=1024)
    noise = noise_of(found)
    assert (np.abs(found.mean((0, 1)) - truth) <= 4 * noise + 1e-5 * truth).all()
    assert (noise < 0.01 * truth).all()
    quarters = found.reshape(2, 4, 2, 4, 3).mean((1, 3))
    assert np.abs(quarters / truth - 1).max() < 0.05


def test_a_clear_globe_lets_light_through_and_tints_it() -> None:
    tint = np.array([0.5, 0.8, 0.2])
    globe = Material("globe", (Lobe("TRANSPARENT", (Input(tuple(tint)),)),))
    scene = room(lamp(), more=(ball(0.05),), materials=(globe,))
    ratio = added(scene) / added(room(lamp()))
    assert np.abs(ratio.mean((0, 1)) / tint - 1).max() < 0.02


@pytest.mark.parametrize("light_samples", [1, 2])
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ground_without_end_lights_a_wall_by_half(backend: str, light_samples: int) -> None:
    """A sun straight above grazes the wall. The ground is 10 000 times as wide as the wall. Of the
    points that pixels deal each has its share of those below the horizon, but for a few.
    """
    scene = wall_over_ground(lamp("SUN", strength=2.0))
    samples = {"NATIVE": 128, "NUMPY": 32}[backend]
    found = added(scene, backend, samples=samples, light_samples=light_samples)
    truth = 2.0 / np.pi * ALBEDO / 2
    assert np.abs(found / truth - 1).max() <= 4 / samples + 1e-6
    assert np.abs(found.mean((0, 1)) / truth - 1).max() < 0.01


def down_from_the_wall(count: int) -> np.ndarray:
    """(3, n) of so many directions round its normal, as dense as their cosines, those that go
    down.
    """
    k = np.arange(count) + 0.5
    away, turn = np.sqrt(k / count), k * np.pi * (3 - np.sqrt(5))
    d = np.stack([np.sqrt(1 - away**2), away * np.cos(turn), away * np.sin(turn)])
    return d[:, d[2] < -1e-6]


def seen_of_the_wall(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Of an even sky's light on the ground there the share that the wall hides."""
    across, up = np.meshgrid((np.arange(40) + 0.5) / 20 - 1, 0.5 + (np.arange(40) + 0.5) / 20)
    across, up = across.ravel(), up.ravel()
    square = x[:, None] ** 2 + (across - y[:, None]) ** 2 + up**2
    return (up * x[:, None] / square**2).sum(1) * 0.05**2 / np.pi


def test_so_it_does_under_an_even_sky() -> None:
    """But for what the wall hides of the sky from the ground: summed over directions down."""
    sky = Light("sky", "DOME", HERE, radiance=np.ones((4, 8, 3), np.float32))
    found = added(wall_over_ground(sky), samples=1024)
    d = down_from_the_wall(4000)
    below = 1.5 / -d[2]
    hidden = seen_of_the_wall(below * d[0], below * d[1]).sum() / 4000
    assert 0.01 < hidden < 0.05
    truth = ALBEDO * (0.5 - hidden)
    assert np.abs(found.mean((0, 1)) / truth - 1).max() < 0.01


@pytest.mark.parametrize("varnish", [(), VARNISH], ids=("plain", "varnish"))
def test_both_tracers_draw_the_same(varnish: tuple[Lobe, ...]) -> None:
    native, exact = (drawn(mixed(*varnish), 2, backend, samples=4) for backend in BACKENDS)
    off = np.abs(native - exact).max(2) / np.maximum(exact.max(2), 1e-3)
    assert (off > 1e-4).mean() < 0.01  # edges
    assert np.median(off) < 1e-6
    assert added(mixed(), samples=4).max() > 0.01


def test_the_bits_are_the_same_for_threads_and_regions() -> None:
    whole = drawn(mixed(), 2, samples=8, threads=1)
    assert (drawn(mixed(), 2, samples=8, threads=5) == whole).all()
    part = drawn(mixed(), 2, samples=8, region=(3, 5, 17, 20))
    assert (part == whole[5:20, 3:17]).all()


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_size_does_not_matter(scale: float) -> None:
    truth = drawn(room(lamp()), 2)
    found = drawn(room(lamp(strength=100.0 * scale**2), scale=scale), 2)
    assert np.abs(found / truth - 1).max() < 0.01


def test_nor_does_where_the_scene_is() -> None:
    at = (3e5, -2e5, 1e5)
    found = drawn(room(lamp(at=at), at=at), 2)
    assert np.abs(found / drawn(room(lamp()), 2) - 1).max() < 0.01


@pytest.mark.parametrize(
    "scene",
    [
        replace(room(lamp()), lights=()),
        replace(room(lamp()), instances=()),
        replace(room(lamp()), materials=(matt((0.0, 0.0, 0.0)),)),
        replace(room(lamp()), materials=(Material("mirror", (Lobe("MIRROR"),)),)),
        room(lamp(strength=0.0)),
    ],
    ids=("no light", "no surface", "black", "mirror", "no power"),
)
def test_where_nothing_is_thrown_back_nothing_is_added(scene: Scene) -> None:
    assert (drawn(scene, 3, samples=4) == drawn(scene, 0, samples=4)).all()


def test_classic_illumination_has_none() -> None:
    a, b = (drawn(room(lamp()), n, samples=4, illumination="CLASSIC") for n in (0, 3))
    assert (a == b).all()


@pytest.mark.parametrize("strength", [1e30, 1e300, -50.0, 1e-30])
def test_pictures_stay_finite(strength: float) -> None:
    found = drawn(room(lamp(strength=strength)), 2, samples=4)
    assert np.isfinite(found).all() or strength > 1e38
    if abs(strength) < 1e38:
        truth = strength / 100 * drawn(room(lamp()), 2, samples=4)
        assert np.abs(found / truth - 1).max() < 0.01


def test_what_has_no_extent_and_what_is_not_finite_is_left_out() -> None:
    broken = Mesh(
        "broken",
        np.array([(np.nan, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0)], np.float32),
        np.array([[0, 1, 2], [3, 3, 3], [1, 2, 3]], np.uint32),
    )
    scene = room(lamp(at=(0, 0, 0.5)), more=(broken,), materials=(matt((0.5,) * 3),))
    assert np.isfinite(drawn(scene, 2, samples=4)).all()


@pytest.mark.parametrize("varnish", [(), VARNISH], ids=("plain", "varnish"))
def test_explain_tells_all_of_a_pixel(varnish: tuple[Lobe, ...]) -> None:
    scene = mixed(*varnish)
    settings = Settings(
        samples=1, light_samples=2, filter_width=0.0, diffuse_bounces=2, soft_light="DEALT"
    )
    picture = render(scene, settings).passes["Combined"]
    explainer, thrown = PixelExplainer(scene, settings), 0.0
    for x, y in [(x, y) for x in range(1, 24, 4) for y in range(2, 24, 5)]:
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-4, atol=1e-6)
        thrown += sum(sum(after.color) for after in ray.follow if after.kind == "bounce")
    assert thrown > 0


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("light_samples", "least"), [(1, 16), (2, 8)])
def test_pixels_that_light_bounces_to_take_16_light_samples(
    light_samples: int, least: int, backend: str
) -> None:
    """The ground alone lights the wall, and the first samples may miss what is near. What sees
    nothing stops as ever.
    """
    scene = replace(
        wall_over_ground(lamp("SUN", strength=2.0)),
        camera=replace(AT_WALL, window=(-0.4, 0.4, -1.6, 0.4), resolution=(4, 8)),
    )
    settings = Settings(
        samples=64,
        light_samples=light_samples,
        diffuse_bounces=1,
        error_threshold=100.0,
        backend=backend,
        passes={"Samples"},
    )
    taken = render(scene, settings).passes["Samples"][..., 0]
    assert (taken[4:] == least).all() and (taken[0] == 4).all(), taken


def floor_and_wall(bottom: float = 0.0) -> Scene:
    """A floor under a sun straight above, and a black-bodied view of the wall that stands on it."""
    floor = replace(GROUND, vertices=np.float32([(0, -4, 0), (8, -4, 0), (8, 4, 0), (0, 4, 0)]))
    wall = replace(
        WALL, vertices=np.float32([(0, -1, bottom), (0, 1, bottom), (0, 1, 2), (0, -1, 2)])
    )
    scene = wall_over_ground(lamp("SUN", strength=2.0))
    camera = replace(AT_WALL, window=(-0.2, 0.2, -1.5, -1.3), resolution=(4, 16))
    return replace(scene, camera=camera, geometries=(floor, wall))


def test_a_wall_is_lit_down_to_its_foot() -> None:
    """At the foot half of what is seen is floor, higher up a little less: it ends 8 away."""
    found = added(floor_and_wall(), samples=256) / (2.0 / np.pi * ALBEDO)
    d, high = down_from_the_wall(20_000), (np.arange(16) + 0.5) / 80
    x, y = high[:, None] * d[0] / -d[2], high[:, None] * d[1] / -d[2]
    truth = ((x < 8) & (np.abs(y) < 4)).sum(1) / 20_000
    assert truth[0] > 0.49 and truth[-1] < 0.485
    assert np.abs(found.mean(1) - truth[:, None]).max() < 0.01


@pytest.mark.parametrize("backend", BACKENDS)
def test_no_light_comes_through_a_leaf(backend: str) -> None:
    """What is lit from below, seen from above, where rounding puts points on either side of it."""
    leaf = replace(GROUND, vertices=np.float32([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]))
    axes = np.linalg.qr(np.array([[3.0, 1, 2], [-1, 4, 1], [2, -2, 5]]))[0]
    axes[:, 0] *= np.linalg.det(axes)
    at = np.array([0.63, -0.34, 5.2])
    behind = np.column_stack([axes[:, 0], -axes[:, 1], -axes[:, 2], np.zeros(3)])
    eye = np.column_stack([axes, at + 2 * axes[:, 2]])
    place = np.column_stack([axes, at])[None]
    scene = Scene(
        replace(inside(), world_from_camera=eye),
        (leaf,),
        (Instances("leaf", 0, place, (0,)),),
        (matt((1.0, 1.0, 1.0)),),
        lights=(Light("sun", "SUN", behind, strength=1e3),),
    )
    lit = replace(scene, camera=replace(scene.camera, world_from_camera=eye * [1, -1, -1, 1]))
    below = lit.camera.world_from_camera
    below[:, 3] = at + 2 * below[:, 2]
    assert drawn(lit, 0, backend, samples=1).max() > 1
    assert (added(scene, backend, samples=16) == 0).all()


def test_a_sample_sends_a_ray_a_bounce() -> None:
    """And looks from what that meets at each lamp once, however many samples of it there are."""
    settings = Settings(samples=4, light_samples=3, filter_width=0.0, soft_light="DEALT")
    for backend in BACKENDS:
        direct, once, twice = (
            render(
                room(lamp(radius=0.1)), replace(settings, diffuse_bounces=n, backend=backend)
            ).stats
            for n in (0, 1, 2)
        )
        assert not direct.get("gather rays", 0)
        assert once["gather rays"] == 4 * 64
        assert 4 * 64 < twice["gather rays"] < 2 * 4 * 64  # by the roulette
        for bounced in (once, twice):
            more = bounced["shadow rays"] - direct["shadow rays"]
            assert 0 < more <= bounced["gather rays"]


# --- beside integrals over what throws light on


WIDE, PIXELS = 0.8, 48
LAMP = np.array([2.0, 1.0, 0.3])
FLOOR, BALL, RADIUS = 0.5, 0.9, 0.5
WALL_AT, END, HIGH = -0.3, 0.5, 0.8
UP, ASIDE = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
SUN = 2.0
SMALL = quad((-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0))
STANDING = quad((WALL_AT, -END, 0), (WALL_AT, END, 0), (WALL_AT, END, HIGH), (WALL_AT, -END, HIGH))


def on_a_floor(thing: Geometry, *lights: Light, pixels: int = PIXELS) -> Scene:
    """Something bright that the camera above does not see, lit from the side."""
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 3.0)])
    return Scene(
        Camera("ORTHOGRAPHIC", frame, (-WIDE, WIDE, -WIDE, WIDE), (pixels, pixels)),
        (SMALL, thing),
        (
            Instances("floor", 0, HERE[None], (0,)),
            Instances("thing", 1, HERE[None], (1,), visible_camera=False),
        ),
        (matt((FLOOR,) * 3), matt((BALL,) * 3)),
        lights=lights or (lamp(at=LAMP),),
    )


def floor_points(pixels: int = PIXELS) -> np.ndarray:
    """(pixels, pixels, 3): the middles of pixels."""
    across = ((np.arange(pixels) + 0.5) / pixels * 2 - 1) * WIDE
    x, y = np.meshgrid(across, across)
    return np.stack([x, y, 0 * x], -1)


def form(x: np.ndarray, normal: np.ndarray, end: np.ndarray) -> np.ndarray:
    """cos / d² of points (…, 3) with their normals towards an end, 0 from behind."""
    to = end - x
    return np.maximum((to * normal).sum(-1), 0.0) / (to * to).sum(-1) ** 1.5


def thrown(points: np.ndarray, q: np.ndarray, n: np.ndarray, area: float) -> np.ndarray:
    """The floor's radiance by an integral over points of what is lit by the lamp."""
    leaving = BALL / np.pi * 100.0 / (4 * np.pi) * form(q, n, LAMP)
    to = q - points[:, None]
    both = np.maximum(to[..., 2], 0.0) * np.maximum(-(to * n).sum(-1), 0.0)
    return FLOOR / np.pi * (both / (to * to).sum(-1) ** 2 * leaving).mean(-1) * area


def by_the_ball(points: np.ndarray) -> np.ndarray:
    k = np.arange(8_000) + 0.5
    z, turn = 1 - 2 * k / len(k), k * np.pi * (3 - np.sqrt(5))
    n = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], -1)
    return thrown(points, RADIUS * (n + UP), n, 4 * np.pi * RADIUS**2)


def by_the_wall(points: np.ndarray) -> np.ndarray:
    y, z = np.meshgrid(((np.arange(100) + 0.5) / 50 - 1) * END, (np.arange(80) + 0.5) / 80 * HIGH)
    q = np.stack([np.full(y.size, WALL_AT), y.ravel(), z.ravel()], -1)
    return thrown(points, q, ASIDE, 2 * END * HIGH)


def in_blocks(values: np.ndarray) -> np.ndarray:
    """(h, w): means of 8 × 8 pixels, which deal all points of a bounce."""
    rows, columns = (side // 8 for side in values.shape[:2])
    return values.reshape(rows, 8, columns, 8, -1).mean((1, 3, 4))


def off(found: np.ndarray, truth: np.ndarray) -> float:
    """Relative RMSE."""
    return float(np.sqrt(((found - truth) ** 2).mean() / (truth**2).mean()))


SAMPLES, NOISE = 64, 0.03
"""The noise of blocks: at most that of as many rays drawn at random, a third of which bring light.
"""
STANDING_BALL = ball(RADIUS, (0.0, 0.0, RADIUS))


def test_a_ball_lights_the_floor_that_it_stands_on() -> None:
    points = floor_points()
    found = added(on_a_floor(STANDING_BALL), samples=SAMPLES)
    truth = by_the_ball(points.reshape(-1, 3)).reshape(PIXELS, PIXELS)
    assert abs(found.mean() / truth.mean() - 1) < 0.02
    assert off(in_blocks(found), in_blocks(truth)) < NOISE


def test_a_wall_lights_the_floor_to_its_ends_and_not_beyond() -> None:
    points = floor_points()
    found = added(on_a_floor(STANDING), samples=SAMPLES)
    truth = by_the_wall(points.reshape(-1, 3)).reshape(PIXELS, PIXELS)
    assert abs(found.mean() / truth.mean() - 1) < 0.02
    assert off(in_blocks(found), in_blocks(truth)) < NOISE
    assert truth.mean() > 0.01
    assert not found[points[..., 0] < WALL_AT].any()


@pytest.mark.parametrize("thing", [STANDING_BALL, STANDING], ids=("ball", "wall"))
def test_both_tracers_light_the_floor_alike(thing: Geometry) -> None:
    """All pixels, along the same paths."""
    native, exact = (
        drawn(on_a_floor(thing, pixels=16), 1, backend, samples=2, soft_light="DEALT")
        for backend in BACKENDS
    )
    assert added(on_a_floor(thing, pixels=16), samples=2).max() > 1e-3
    np.testing.assert_allclose(native, exact, rtol=1e-5)


def shaded_floor() -> Scene:
    """A wall behind a floor that the sun above lights from x = 0 on."""
    frame = np.column_stack([(1, 0, 0), (0, 0, 1), (0, -1, 0), (0.0, -3.0, 0.5)])
    wall = quad((-9, 0, 0), (9, 0, 0), (9, 0, 1), (-9, 0, 1))
    plate = quad((-8e3, -8e3, 2), (0, -8e3, 2), (0, 1, 2), (-8e3, 1, 2))
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
    found = added(shaded_floor(), samples=256)[..., 0]
    k = np.arange(20_000) + 0.5
    across, turn = np.sqrt(k / len(k)), k * np.pi * (3 - np.sqrt(5))
    x, z = across * np.cos(turn), across * np.sin(turn)  # of directions before the wall
    down = z < 0
    at = (np.arange(PIXELS) + 0.5) / PIXELS
    over = at[:, None] / -z[down]  # how far along x floors are
    lit = (at - 0.5)[:, None, None] + x[down] * over > 0
    truth = 0.8 * FLOOR * SUN / np.pi * (lit.sum(-1) / len(k)).T
    assert abs(found.mean() / truth.mean() - 1) < 0.005
    assert off(in_blocks(found), in_blocks(truth)) < 0.01
    assert off(found, truth) < 0.05


def test_what_is_met_is_lit_by_all_of_the_sky() -> None:
    """Of whose directions each ray asks for one."""
    sky = Light("sky", "DOME", HERE, radiance=np.ones((4, 8, 3), np.float32))
    scene = on_a_floor(STANDING, sky)
    for some in (scene, replace(window_scene(walls()), lights=(sky,))):
        native, exact = (drawn(some, 1, backend, samples=2) for backend in BACKENDS)
        apart = np.abs(native - exact).max(2)
        assert np.median(apart) < 5e-7 * exact.mean()
        bounced = exact - drawn(some, 0, "NUMPY", samples=2)
        assert (apart > 1e-4 * bounced.mean()).mean() < 0.02  # edges
    few, many = (in_blocks(added(scene, samples=256, light_samples=n)) for n in (2, 16))
    before = in_blocks(floor_points()[..., :1]) > WALL_AT + 0.15
    assert abs(few[before].mean() / many[before].mean() - 1) < 0.02
    assert off(few[before], many[before]) < 0.05


@pytest.mark.parametrize("backend", BACKENDS)
def test_panes_dim_what_is_thrown_on_through_them(backend: str) -> None:
    """A clear pane before the wall changes nothing, one that takes half dims it twice: before the
    wall is lit, and after.
    """

    def with_pane(share: float) -> Scene:
        scene = on_a_floor(STANDING, pixels=16)
        pane = quad((-0.28, -9, 0), (-0.28, 9, 0), (-0.28, 9, 9), (-0.28, -9, 9))
        clear = Material("pane", (Lobe("TRANSPARENT", (Input((share,) * 3),)),))
        thing = Instances("pane", 2, HERE[None], (2,), visible_camera=False)
        return replace(
            scene,
            geometries=(*scene.geometries, pane),
            instances=(*scene.instances, thing),
            materials=(*scene.materials, clear),
        )

    before = floor_points(16)[..., 0] > -0.2
    scenes = (on_a_floor(STANDING, pixels=16), with_pane(1.0), with_pane(0.5))
    samples = {"NATIVE": 8, "NUMPY": 2}[backend]
    plain, clear, half = (added(scene, backend, samples=samples)[before] for scene in scenes)
    assert plain.mean() > 0.01
    np.testing.assert_allclose(clear, plain, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(half, plain / 4, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("backend", BACKENDS)
def test_strands_throw_light_on_and_hide_what_is_behind_them(backend: str) -> None:
    points = np.array([(WALL_AT, y, z) for y in (-0.4, 0.4) for z in (0.1, 0.7)], np.float32)
    hair = Strands("hair", points, np.full(4, 0.2, np.float32), np.array([0, 2], np.uint32))
    lights = lamp(at=LAMP), lamp(at=(0.0, 0.0, 50.0))
    assert added(on_a_floor(hair, *lights, pixels=16), backend, samples=4).mean() > 1e-3
    wall = on_a_floor(STANDING, *lights, pixels=16)
    before = replace(hair, vertices=hair.vertices + np.float32([0.25, 0, 0]))
    fringe = Instances("hair", 2, HERE[None], (2,), visible_camera=False, visible_shadow=False)
    assert len(wall.materials) == 2
    hidden = replace(
        wall,
        geometries=(*wall.geometries, before),
        instances=(*wall.instances, fringe),
        materials=(*wall.materials, matt((0.0, 0.0, 0.0))),
    )
    open_, dark = (added(scene, backend, samples=4).mean() for scene in (wall, hidden))
    assert 0 < dark < 0.9 * open_


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_stays_on_its_side_of_a_thin_wall(backend: str) -> None:
    """Of a room with walls a thousandth thick, however bright they are outside."""
    room_ = room(lamp(at=(0.1, 0.2, 0.3), strength=1.0), more=(ball(1.001),))
    shell = replace(room_.instances[1], materials=(0,))
    room_ = replace(room_, instances=(room_.instances[0], shell))
    bright = replace(room_, lights=(*room_.lights, lamp(at=(0.0, 0.0, 5.0), strength=1e6)))
    samples = {"NATIVE": 4, "NUMPY": 1}[backend]
    inner, both = (added(scene, backend, 2, samples=samples) for scene in (room_, bright))
    assert inner.min() > 0
    np.testing.assert_allclose(both, inner, rtol=1e-5)
