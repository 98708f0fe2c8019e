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
    room,
    wall_over_ground,
)
from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.lights import met_surfaces
from glint.engine.lights.bounced_light import MERGED, bounced_light, bounced_table
from glint.engine.reference.lights import above_horizon
from glint.engine.reference.tabled_lights import BouncedSource
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Polygons,
    Scene,
    Strands,
)


@pytest.mark.parametrize(
    ("bounces", "backend"), [(1, "NATIVE"), (2, "NATIVE"), (4, "NATIVE"), (4, "NUMPY")]
)
def test_a_matt_ball_seen_from_inside_is_a_geometric_series(bounces: int, backend: str) -> None:
    scene = room(lamp())
    ratio = drawn(scene, bounces, backend, samples=32) / drawn(scene, 0, backend, samples=32)
    truth = sum(ALBEDO**k for k in range(bounces + 1))
    # discs that lie round a point, a 64th of the ball all together, give it nothing: they are even,
    # and points are not, by as much
    assert np.abs(ratio.mean((0, 1)) / truth - 1).max() < 2 / 64
    assert np.abs(ratio / ratio.mean((0, 1)) - 1).max() < 0.02


PANEL = Mesh(
    "panel",
    np.array([(-0.1, -0.1, 0.2), (0.1, -0.1, 0.2), (0.1, 0.1, 0.2), (-0.1, 0.1, 0.2)], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
)
LAMPS = {
    "point": (lamp(at=(0.3, 0.2, -0.1)), 100.0),
    "spot": (lamp("SPOT", at=(0.3, 0, 0), spot_size=1.6, spot_blend=0.0), 50 * (1 - np.cos(0.8))),
    "area": (lamp("AREA", at=(0, 0.2, 0), size_x=0.2, size_y=0.1), 100.0),
    "slats": (lamp("AREA", at=(0, 0.2, 0), size_x=0.2, size_y=0.1, spread=1.0), 100.0),
    # a disc that faces each point of the wall, and a ball
    "disc": (lamp(radius=0.5, soft_falloff=True), 100 / (1 + 0.5**2)),
    "ball": (lamp(radius=0.5), 100.0),
    "ellipse": (lamp("AREA", size_x=0.2, size_y=0.1, shape="ELLIPSE"), 100.0),
}


@pytest.mark.parametrize("name", LAMPS)
def test_what_a_ball_throws_back_is_even_wherever_the_lamp_is(name: str) -> None:
    light, power = LAMPS[name]
    truth = ALBEDO**2 * power / (4 * np.pi**2)  # radiance: albedo / π of the albedo of Φ / 4π
    found = added(room(light), samples=1024)
    assert np.abs(found.mean((0, 1)) / truth - 1).max() < 2 / 64
    assert np.abs(found / truth - 1).max() < 0.05


def test_so_is_it_where_a_panel_glows() -> None:
    """Both of its sides; its own shadow is small."""
    radiance = 20.0
    scene = room(
        more=(PANEL,), materials=(Material("glow", (Lobe("EMISSION", (Input((radiance,) * 3),)),)),)
    )
    truth = ALBEDO**2 * 2 * np.pi * radiance * 0.04 / (4 * np.pi**2)
    assert np.abs(added(scene).mean((0, 1)) / truth - 1).max() < 0.05


def test_a_clear_globe_lets_light_through_and_tints_it() -> None:
    tint = np.array([0.5, 0.8, 0.2])
    globe = Material("globe", (Lobe("TRANSPARENT", (Input(tuple(tint)),)),))
    scene = room(lamp(), more=(ball(0.05),), materials=(globe,))
    ratio = added(scene) / added(room(lamp()))
    assert np.abs(ratio.mean((0, 1)) / tint - 1).max() < 0.02


@pytest.mark.parametrize("light_samples", [1, 2])
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ground_without_end_lights_a_wall_by_half(backend: str, light_samples: int) -> None:
    """A sun straight above grazes the wall. The ground is 10 000 times as wide as the wall. Discs
    of a radius κ times their distance cover it -ln(1 - κ²)/κ² times: 1.39 for κ = 0.7, as points
    fall. So they grow less.
    """
    scene = wall_over_ground(lamp("SUN", strength=2.0))
    samples = {"NATIVE": 128, "NUMPY": 32}[backend]
    found = added(scene, backend, samples=samples, light_samples=light_samples)
    truth = 2.0 / np.pi * ALBEDO / 2
    assert np.abs(found / truth - 1).max() < 0.05


def test_so_it_does_under_an_even_sky() -> None:
    """The wall, both sides of which are lit, hides the sky from what is near it: a little less."""
    sky = Light("sky", "DOME", HERE, radiance=np.ones((4, 8, 3), np.float32))
    found = added(wall_over_ground(sky), samples=1024).mean((0, 1))
    truth = ALBEDO / 2
    assert (found < 1.05 * truth).all()
    assert (found > 0.95 * truth).all()


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


def test_a_camera_that_moves_sees_the_same_points() -> None:
    scene = mixed()
    moved = replace(scene, camera=replace(scene.camera, resolution=(7, 9)))
    assert bounced_light(scene, 2) is bounced_light(moved, 2)


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
    assert bounced_light(scene, 3) is None
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
    settings = Settings(samples=1, light_samples=2, filter_width=0.0, diffuse_bounces=2)
    picture = render(scene, settings).passes["Combined"]
    explainer, named = PixelExplainer(scene, settings), set()
    for x, y in ((12, 12), (5, 3), (20, 9), (11, 20)):
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-4, atol=1e-6)
        named |= {term.light for term in (ray.hit.lights if ray.hit else ())}
    assert "Bounced light" in named


def test_a_light_seldom_met_gets_more_walks() -> None:
    """A lamp far outside of the ball that it lights."""
    far = replace(
        room(lamp(at=(0, 0, 5.0), strength=1e4)),
        camera=Camera(
            "PERSPECTIVE", np.column_stack([np.eye(3), (0, 0, 5.0)]), (-1, 1, -1, 1), (4, 4)
        ),
    )
    ground = Instances("ground", 1, np.column_stack([np.eye(3), (0, 0, -1.0)])[None], (0,))
    far = replace(far, geometries=(*far.geometries, GROUND), instances=far.instances[:1])
    assert len(bounced_light(far, 1).bounces.points) > 4000
    wide = replace(far, instances=(*far.instances, ground))
    assert len(bounced_light(wide, 1).bounces.points) > 4000


def test_hair_throws_no_light() -> None:
    """It hides what is behind it: the points that are made stand on other things."""
    ends = np.array([(-0.5, 0, 0.6), (0.5, 0, 0.6)], np.float32)
    hair = Strands("hair", ends, np.array([0.2, 0.2], np.float32), np.array([0], np.uint32))
    scene = room(lamp(), more=(hair,), materials=(matt((1.0, 1.0, 1.0)),))
    found = bounced_light(scene, 2)
    points = found.bounces.points + found.world_from_light[:, 3]
    assert len(points) > 100
    assert np.abs(np.linalg.norm(points, axis=1) - 1).max() < 1e-3


def test_a_pilot_that_meets_nothing_sends_more() -> None:
    """A lamp far above a small square, which one walk in some 11 000 meets."""
    square = Polygons(
        "square",
        np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32),
        np.array([0, 4], np.uint32),
        np.arange(4, dtype=np.uint32),
    )
    scene = room(lamp(at=(0, 0, 60)))
    scene = replace(scene, geometries=(square,))
    found = bounced_light(scene, 1)
    assert found is not None
    assert 1 <= len(found.bounces.points) < 100


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("light_samples", "least"), [(1, 64), (2, 32)])
def test_pixels_that_bounced_light_reaches_from_near_by_take_64_light_samples(
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


def test_many_objects_are_one_block_whose_parts_are_any(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same points, bit for bit, whether objects are blocks of their own or one, and however
    few are looked at together.
    """
    scene = mixed()
    block = scene.instances[0]
    each = tuple(replace(block, world_from_object=m[None]) for m in block.world_from_object)
    parted = replace(scene, instances=(*each, *scene.instances[1:]))
    found = [bounced_light(s, 2).bounces.points for s in (scene, parted)]
    monkeypatch.setattr(met_surfaces, "TOGETHER", 1)
    again = replace(scene, materials=(*scene.materials, matt(ALBEDO)))  # not the one that is kept
    found.append(bounced_light(again, 2).bounces.points)
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])


def test_blocks_that_differ_in_what_is_drawn_stay_apart() -> None:
    block = mixed().instances[0]
    others = [
        replace(block, **change)
        for change in (
            {"geometry": 1},
            {"materials": (2,)},
            {"visible_shadow": False},
            {"light_set": 3},
            {"catcher": True},
        )
    ]
    together = met_surfaces.joined([block, *others, replace(block, name="again", object_index=5)])
    assert [len(b.world_from_object) for b in together] == [4, *[2] * 5]


def test_a_ball_of_which_the_horizon_cuts_a_part() -> None:
    """Beside sums over directions: the share of light from within the cone, by its cosine."""
    u, v = np.meshgrid((np.arange(400) + 0.5) / 400, (np.arange(400) + 0.5) / 400)
    for sine2 in (0.01, 0.25, 0.5, 0.75, 0.9, 1.0):
        high = np.sqrt(1 - u * sine2)  # even by solid angle times the cosine to the middle
        aside = np.sqrt(u * sine2) * np.cos(2 * np.pi * v)
        for middle in np.linspace(-1, 1, 21):
            cosine = high * middle + aside * np.sqrt(1 - middle * middle)
            truth = np.maximum(cosine / high, 0).mean()  # over cosines to the middle
            found = above_horizon(np.array([middle]), np.array([sine2]))[0]
            limit = 0.006 * np.sqrt(sine2) if sine2 < 0.1 else 0.03
            assert abs(found - truth) < limit, (sine2, middle)


def test_the_form_factor_of_a_disc() -> None:
    """Its length and direction beside sums over its area, near and far."""
    light = bounced_light(room(lamp()), 1)
    table = bounced_table(light, 1, 4)
    source = BouncedSource(light, np.zeros(3), table)
    normal = table.normal[0]
    up, side = normal, np.cross(normal, (0.3, 0.5, 0.8))
    side = side / np.linalg.norm(side)
    radius = np.sqrt(table.spread[0] / (MERGED * np.pi * 4))
    place, turn = np.meshgrid((np.arange(600) + 0.5) / 600, (np.arange(600) + 0.5) / 600)
    across = np.cross(up, side)
    disc = (
        np.sqrt(place)[..., None]
        * radius
        * (
            np.cos(2 * np.pi * turn)[..., None] * side
            + np.sin(2 * np.pi * turn)[..., None] * across
        )
    )
    q = table.point[0] + light.world_from_light[:, 3]
    for height, aside in ((0.3, 0.0), (0.2, 0.8), (0.5, 1.5), (3.0, 2.0), (40.0, 60.0)):
        x = q + radius * (height * up + aside * side)
        to = q + disc - x
        d2 = (to**2).sum(-1)
        weight = -(to @ up) / d2**2 / np.pi
        truth = (to * weight[..., None]).mean((0, 1)) * np.pi * radius**2
        seen = source.seen_disc(x[:, None], -up[:, None], 0)
        found = seen.direction[:, 0] * seen.round[0]
        assert np.abs(found - truth).max() < 2e-3 * np.abs(truth).max()


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
    """At the foot half of what is seen is floor. Points from no nearer than their distance would
    leave it dark, and discs cut by the wall's plane half as bright.
    """
    found = added(floor_and_wall(), samples=256) / (2.0 / np.pi * ALBEDO)
    assert (
        found.shape[0] == 16
        and (found > 0.36).all()
        and (found[8:] > 0.44).all()
        and (found < 0.55).all()
    ), found[:, 0, 0]


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
    assert bounced_light(scene, 1) is not None
    assert (added(scene, backend, samples=16) == 0).all()


def test_a_sample_asks_for_few_shadows() -> None:
    """Four for each light sample, where there are sixteen points, and one where a gather ray meets
    something.
    """
    settings = Settings(
        samples=4, light_samples=3, filter_width=0.0, diffuse_bounces=1, illumination="PHYSICAL"
    )
    direct, both = (
        render(room(lamp()), replace(settings, diffuse_bounces=n)).stats for n in (0, 1)
    )
    more = both["shadow rays"] - direct["shadow rays"]
    assert 0 < both["gather rays"] <= 2 * 4 * 64
    assert 0 < more <= 4 * 3 * 4 * 64 + both["gather rays"]
    assert bounced_table(bounced_light(room(lamp()), 1), 4, settings.bounced_samples).each == 48


def test_many_light_samples_take_no_more_points_than_there_are_walks_for() -> None:
    few, many = Settings(light_samples=256), Settings(light_samples=1 << 16)
    assert (many.bounced_samples, many.bounced_shadows) == (4096, 1024)
    assert (few.bounced_samples, few.bounced_shadows) == (4096, 1024)


def test_explain_tells_how_many_shadows_are_asked_for() -> None:
    settings = Settings(light_samples=2, diffuse_bounces=1)
    lines = explanation_lines(PixelExplainer(room(lamp()), settings).pixel(3, 3))
    assert "8 of 32 points of bounced light" in lines[0]
    none = explanation_lines(PixelExplainer(room(lamp()), Settings()).pixel(3, 3))
    assert "bounced light" not in none[0]
