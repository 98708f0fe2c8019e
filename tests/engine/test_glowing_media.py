"""Media that glow: closed forms of what they light, one tracer beside the other, extremes."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import mixed
from engine_scenes import at, box_mesh
from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.lights.enclosures import joined
from glint.engine.lights.glowing_media import medium_lights, medium_table
from glint.engine.scene import (
    Input,
    Instances,
    Lobe,
    Material,
    Medium,
    Mesh,
    Scene,
    Spheres,
    World,
)
from media_scenes import filled
from native_tools import assert_instruction_sets_agree
from test_mesh_light import BACKENDS, DOWN, FLOOR, WHITE, gloss, side_view
from test_varied_media import Tree

UNIT = Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
GAS = Medium(emission=(1.0, 2.0, 0.5))
RGB = np.array(GAS.emission)


def scene(*things, medium: Medium = GAS, floor=WHITE, **more) -> Scene:
    """A floor, and geometries at their matrices filled with what glows, which the camera does not
    see.
    """
    placed = [Instances("floor", 0, np.eye(3, 4)[None], (0,))]
    placed += [
        Instances(f"gas {k}", k, np.asarray(matrix, np.float64), (1,), visible_camera=False)
        for k, (_, matrix) in enumerate(things, 1)
    ]
    return Scene(
        more.pop("camera", DOWN),
        (FLOOR, *(geometry for geometry, _ in things)),
        tuple(placed),
        (floor, filled("gas", medium)),
        **more,
    )


def drawn(wanted: Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    """(h, w, 3) with 64 samples of 8 points."""
    chosen = {"samples": 64, "light_samples": 2, "filter_width": 0.0, "backend": backend}
    return render(wanted, Settings(**chosen | settings)).passes["Combined"][..., :3]


def below_a_ball(height: float, sigma: float = 0.0, radius: float = 1.0) -> float:
    """Irradiance over π of a level point so far below the middle of a ball that gives 1 a unit and
    dims by sigma, by the chords of the cone that it fills.
    """
    count = 1 << 14
    sine2 = (np.arange(count) + 0.5) / count * (radius / height) ** 2
    chord = 2 * np.sqrt(radius**2 - height**2 * sine2)
    given = -np.expm1(-sigma * chord) / sigma if sigma else chord
    return float(given.mean() * (radius / height) ** 2)


@pytest.mark.parametrize("height", [1.05, 1.5, 3.0, 20.0])
def test_a_ball_of_gas_lights_the_floor_below_it(height):
    wanted = scene((UNIT, at((0, 0, height))))
    if height == 20:
        assert below_a_ball(height) == pytest.approx(4 / 3 / height**2, rel=1e-2)
    np.testing.assert_allclose(
        drawn(wanted) / (RGB * below_a_ball(height)), 1.0, rtol=0.01 if height > 1.2 else 0.06
    )


@pytest.mark.parametrize("sigma", [0.3, 1.0, 3.0])
def test_gas_takes_of_its_own_light(sigma):
    medium = replace(GAS, absorption=(sigma,) * 3)
    value = drawn(scene((UNIT, at((0, 0, 1.5))), medium=medium))
    near = 0.02 if sigma < 3 else 0.07
    np.testing.assert_allclose(value / (RGB * below_a_ball(1.5, sigma)), 1.0, rtol=near)


@pytest.mark.parametrize("backend", BACKENDS)
def test_few_points_are_near(backend):
    value = drawn(scene((UNIT, at((0, 0, 2.0)))), backend, samples=16, light_samples=1)
    np.testing.assert_allclose(value / (RGB * below_a_ball(2.0)), 1.0, rtol=0.03)


@pytest.mark.parametrize(("samples", "near"), [(16, 0.2), (64, 0.12), (1024, 0.02)])
def test_within_gas_light_is_finite_and_right(samples, near):
    """In the middle of a ball of gas half of the directions see a way of its radius."""
    value = drawn(scene((UNIT, at((0, 0, 0)))), samples=samples)
    np.testing.assert_allclose(value / RGB, 1.0, rtol=near)


# --- one tracer beside the other
# --------------------------------------------------------------------------------------------------


def risen(rgb=(4.0, 2.0, 0.5)) -> Medium:
    """It glows as the square of how high a place of its object is."""
    tree = Tree()
    height = tree.place()[2]
    return tree.medium(emission=tree.colored(tree.math("MULTIPLY", height, height), rgb))


def hall(floor=WHITE, **more) -> Scene:
    """Two things that glow, one of them turned, stretched and mirrored, over a floor with a post,
    in haze.
    """
    turned = at((-0.6, 0.4, 0.5), 0.3)
    turned[0, :, :3] = np.diag([-0.5, 0.2, 0.3]) @ [[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]
    things = ((UNIT, at((0.5, 0.6, 0.4), 0.3)), (box_mesh(), turned))
    haze = World(medium=Medium(scattering=(0.05,) * 3))
    medium = Medium((0.2, 0.4, 0.1), (0.3,) * 3, (4.0, 2.0, 0.5))
    return scene(*things, medium=medium, floor=floor, camera=side_view(), world=haze, **more)


PAINT = Material(
    "paint",
    (
        Lobe("DIFFUSE", (Input((0.5, 0.4, 0.3)),)),
        Lobe("SHEEN", (Input((0.2, 0.2, 0.1)),), width=0.6, lean=0.2),
        Lobe("TRANSLUCENT", (Input((0.1, 0.1, 0.2)),)),
        Lobe("SPECULAR", (Input((3.0,) * 3),), 30.0, ior=1.5, fresnel=True, masking=0.3),
    ),
)


@pytest.mark.parametrize("floor", [gloss(300.0), PAINT])
@pytest.mark.parametrize(
    "more", [{"reflections": "OFF"}, {"reflections": "ALL", "diffuse_bounces": 2}]
)
def test_both_tracers_see_the_same(floor, more):
    wanted = hall(floor)
    settings = {"samples": 2, "filter_width": 1.5, "max_bounces": 1, **more}
    core, reference = (drawn(wanted, backend, **settings) for backend in BACKENDS)
    assert reference.max() > 0.3
    wrong = np.abs(core - reference) > 1e-4 * (1 + np.abs(reference))
    assert wrong.any(2).mean() <= 0.002


def test_paint_shows_gas_evenly_where_no_rays_do():
    wanted = scene((UNIT, at((0, 0, 2))), floor=PAINT)
    matt = scene((UNIT, at((0, 0, 2))), floor=replace(PAINT, lobes=PAINT.lobes[:3]))
    shown, plain = (drawn(each, samples=4, reflections="OFF") for each in (wanted, matt))
    assert (shown > 1.02 * plain).all()
    floor, gas = wanted.instances
    hidden = replace(wanted, instances=(floor, replace(gas, visible_mirror=False)))
    np.testing.assert_allclose(drawn(hidden, samples=4, reflections="OFF"), plain, rtol=1e-6)


def test_explain_tells_all_of_a_pixel():
    """Where nothing is in the way, as all that is asked for is looked for."""
    wanted = scene((UNIT, at((0.2, 0.1, 1.4))), floor=PAINT, camera=side_view())
    settings = Settings(samples=1, light_samples=1, filter_width=0.0)
    picture = render(wanted, settings).passes["Combined"]
    explainer, named = PixelExplainer(wanted, settings), set()
    for x, y in ((12, 12), (5, 3), (20, 9)):
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-4, atol=1e-6)
        named |= {term.light for term in (ray.hit.lights if ray.hit else ())}
    assert named == {"Glowing media"}
    assert any("4 of 32 points of glowing media" in line for line in explanation_lines(ray))


# --- what becomes of what glows
# --------------------------------------------------------------------------------------------------


def total(wanted: Scene) -> np.ndarray:
    """(3,) what it gives a world unit, times its volume."""
    lights = medium_lights(wanted)
    return sum((x.rods.volumes @ x.rods.emission for x in lights), np.zeros(3))


def test_volumes_are_those_of_their_things():
    ball, box = 4 / 3 * np.pi, 8.0
    np.testing.assert_allclose(total(scene((UNIT, at((3, 2, 1))))), ball * RGB, rtol=5e-3)
    turned = at((1, 1, 1))
    turned[0, :, :3] = np.diag([-2.0, 0.5, 1.0]) @ [[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]
    np.testing.assert_allclose(total(scene((box_mesh(), turned))), box * RGB, rtol=5e-3)


def test_a_thin_tube_across_its_box_keeps_its_volume():
    long = np.array([[[3.0, -0.02, 0, 0], [3.0, 0.02, 0, 0], [3.0, 0, 0.02, 0]]])
    volume = 8 * abs(np.linalg.det(long[0, :, :3]))
    np.testing.assert_allclose(total(scene((box_mesh(), long))), volume * RGB, rtol=0.05)


def test_points_follow_what_glows_more():
    (light,) = medium_lights(scene((box_mesh(), at((0, 0, 2))), medium=risen()))
    table = medium_table(light, 64, 8)
    given = (table.front * table.spread[:, None]).mean(0)
    np.testing.assert_allclose(given, np.array([4, 2, 0.5]) * 8 / 3, rtol=0.02)
    height = table.point[:, 2] + light.world_from_light[2, 3] - 2
    assert (np.abs(height) > 0.5).mean() == pytest.approx(1 - 0.5**3, abs=0.02)


def test_a_thousand_things_make_one_light():
    grid = np.stack(np.meshgrid(*[np.arange(10) * 3.0] * 3), -1).reshape(-1, 3)
    matrix = np.concatenate([at(place, 0.5) for place in grid])
    wanted = scene((UNIT, matrix))
    assert len(medium_lights(wanted)) == 1
    np.testing.assert_allclose(total(wanted), 1000 * np.pi / 6 * RGB, rtol=0.02)


def test_blocks_that_differ_in_what_fills_them_stay_apart() -> None:
    block = mixed().instances[0]
    others = [replace(block, geometry=1), replace(block, materials=(2,))]
    together = joined([block, *others, replace(block, name="again", object_index=5)])
    assert [len(b.world_from_object) for b in together] == [4, 2, 2]


def test_one_light_for_those_that_light_the_same():
    wanted = scene((UNIT, at((0, 0, 2))), (UNIT, at((3, 0, 2))))
    floor, one, other = wanted.instances
    assert len(medium_lights(wanted)) == 1
    for change in ({"receivers": 1}, {"blockers": 2}, {"visible_diffuse": False}):
        apart = replace(wanted, instances=(floor, one, replace(other, **change)))
        assert len(medium_lights(apart)) == 2


@pytest.mark.parametrize("backend", BACKENDS)
def test_gas_lights_what_it_is_linked_to_in_the_shadows_of_what_it_is_linked_to(backend):
    lid = Mesh("lid", FLOOR.vertices + np.float32([0, 0, 0.5]), FLOOR.triangles)
    wanted = scene((UNIT, at((0, 0, 2))))
    floor, gas = wanted.instances
    roof = Instances("lid", 2, np.eye(3, 4)[None], (0,), light_set=1, visible_camera=False)
    wanted = replace(wanted, geometries=(*wanted.geometries, lid))
    for links, lit in (
        ({}, False),
        ({"blockers": 1}, True),
        ({"blockers": 1, "receivers": 2}, False),
    ):
        things = floor, replace(gas, **links), roof
        found = drawn(replace(wanted, instances=things), backend, samples=2)
        assert found.any() == lit


@pytest.mark.parametrize("around", [0.0, 1.0])
def test_both_tracers_see_the_same_from_within(around):
    """The camera is in gas that scatters its own light, or in a world that does."""
    medium = Medium((0.1,) * 3, (0.3,) * 3, (0.4, 0.2, 0.1))
    world = World(medium=Medium(scattering=(0.1 * around,) * 3)) if around else World()
    wanted = scene((UNIT, at((0, -3, 3), 2.5)), medium=medium, camera=side_view(12), world=world)
    wanted = replace(
        wanted, instances=tuple(replace(x, visible_camera=True) for x in wanted.instances)
    )
    core, reference = (drawn(wanted, backend, samples=2) for backend in BACKENDS)
    np.testing.assert_allclose(core, reference, rtol=1e-4, atol=1e-5)
    unlit = drawn(wanted, samples=2, mesh_light="OFF")
    assert (core > 1.01 * unlit).all()


def test_visibility_keeps_light_off_matt_surfaces():
    wanted = scene((UNIT, at((0, 0, 2))))
    dark = replace(wanted.instances[1], visible_diffuse=False)
    assert not drawn(replace(wanted, instances=(wanted.instances[0], dark)), samples=4).any()


@pytest.mark.parametrize("setting", [{"mesh_light": "OFF"}, {"illumination": "CLASSIC"}])
def test_it_can_be_off(setting):
    assert not drawn(scene((UNIT, at((0, 0, 2)))), samples=4, **setting).any()


def flat(matrix: np.ndarray) -> np.ndarray:
    matrix[:, 2, :3] = 0
    return matrix


OPEN = Mesh("open", box_mesh().vertices, box_mesh().triangles[:-2])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("thing", "matrix", "medium"),
    [
        (UNIT, at((0, 0, 2)), replace(GAS, emission=(0.0, 0.0, 0.0))),
        (UNIT, at((0, 0, 2)), replace(GAS, emission=(1e30, 1e30, 1e30))),
        (UNIT, at((0, 0, 2)), replace(GAS, emission=(-1.0, 2.0, 0.0))),
        (UNIT, at((0, 0, 2)), replace(GAS, absorption=(1e30,) * 3)),
        (UNIT, at((0, 0, 2)), risen((1e38, -1e38, 1.0))),
        (UNIT, at((0, 0, 2), 1e-12), GAS),
        (box_mesh(), flat(at((0, 0, 2))), GAS),
        (OPEN, at((0, 0, 2)), GAS),
        (FLOOR, at((0, 0, 2)), GAS),
    ],
)
def test_extremes_stay_finite(backend, thing, matrix, medium):
    value = drawn(scene((thing, matrix), medium=medium), backend, samples=2)
    assert np.isfinite(value).all()


def test_what_gives_less_than_nothing_darkens():
    medium = replace(GAS, emission=(-1.0, 2.0, 0.0))
    value = drawn(scene((UNIT, at((0, 0, 2.0))), medium=medium)).mean((0, 1))
    np.testing.assert_allclose(value, np.array([-1.0, 2.0, 0.0]) * below_a_ball(2.0), rtol=0.02)


def test_what_gas_lights_throws_its_light_on():
    """A white ceiling's second bounce: what a floor gets from one that it lights itself."""
    wanted = scene((UNIT, at((0, 0, 1.5))))
    ceiling = Mesh("ceiling", FLOOR.vertices + np.float32([0, 0, 4]), FLOOR.triangles[:, ::-1])
    roof = Instances("ceiling", 2, np.eye(3, 4)[None], (0,), visible_camera=False)
    wanted = replace(
        wanted,
        geometries=(*wanted.geometries, ceiling),
        instances=(*wanted.instances, roof),
    )
    once = drawn(wanted, samples=64).mean((0, 1))
    twice = drawn(wanted, samples=64, diffuse_bounces=1).mean((0, 1))
    np.testing.assert_allclose((twice - once) / RGB, _from_the_ceiling(1.5, 4.0), rtol=0.1)


def _from_the_ceiling(height: float, above: float) -> float:
    """What a point below the middle gets of a white ceiling that a small ball of that power lights:
    the integral over rings.
    """
    r = (np.arange(200000) + 0.5) * 5e-4
    d, rise = above - height, above
    lit = 4 / 3 * d / (d * d + r * r) ** 1.5  # irradiance over π times π: of a point
    return float(np.sum(2 * r * rise**2 / (rise**2 + r * r) ** 2 * lit * 5e-4))


def test_the_same_bits_however_many_threads_and_wherever_the_border():
    wanted = hall(gloss(4.0))
    whole = drawn(wanted, samples=4, threads=1)
    np.testing.assert_array_equal(whole, drawn(wanted, samples=4, threads=3))
    part = drawn(wanted, samples=4, region=(5, 3, 17, 20))
    np.testing.assert_array_equal(whole[3:20, 5:17], part)


@functools.cache
def hashes() -> str:
    return hashlib.sha256(drawn(hall(PAINT), samples=4, diffuse_bounces=1).tobytes()).hexdigest()


def test_instruction_sets_change_nothing() -> None:
    assert_instruction_sets_agree(hashes)


@pytest.mark.slow
def test_pixels_that_may_stop_take_as_many_samples_in_both_tracers():
    wanted = scene((UNIT, at((0.5, 0.6, 0.2), 0.3)), floor=PAINT, camera=side_view(12))
    settings = {"samples": 64, "error_threshold": 8.0, "light_samples": 1}
    passes = frozenset({"Samples", "Cost"})
    one, other = (
        render(wanted, Settings(**settings, backend=backend, passes=passes)).passes
        for backend in BACKENDS
    )
    assert 8 < one["Samples"].mean() < 60
    for name in passes:
        assert (one[name] != other[name]).mean() < 0.01


def test_catchers_show_the_light_of_gas_and_their_own_glow_lights_nothing():
    wanted = scene((UNIT, at((0, 0, 1.4))), camera=side_view())
    floor, gas = wanted.instances
    caught = replace(wanted, instances=(replace(floor, catcher=True), gas))
    one, other = (drawn(caught, backend, samples=2) for backend in BACKENDS)
    np.testing.assert_allclose(one, other, atol=1e-5)
    dark = replace(wanted, instances=(floor, replace(gas, catcher=True)))
    assert not medium_lights(dark)


def test_a_scene_without_glowing_media_has_no_such_light():
    assert not medium_lights(scene((UNIT, at((0, 0, 2))), medium=Medium((1.0, 1.0, 1.0))))
    assert not medium_lights(scene())
