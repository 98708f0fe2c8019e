"""Light from all around: closed forms, what is drawn from a map, one tracer beside the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import LiveRender, SceneError, Settings, Task, render
from glint.engine.lights import dome
from glint.engine.lights.dome import cell_shares, directions, dome_table, radiance_map
from glint.engine.native import packing_settings
from glint.engine.native import render as native_render
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.sampling import patterns
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Scene,
    Spheres,
    Texture,
    World,
    view_axes,
)
from glint.engine.scene.problems import scene_problems

WHITE = Material("white", (Lobe("DIFFUSE"), Lobe("AMBIENT")))
DOWN = Camera(
    "ORTHOGRAPHIC", np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 50.0]]), (-1, 1, -1, 1), (8, 8)
)
"""Looks down on the square from -1 to 1, each pixel a quarter."""


def even(radiance: float = 1.0) -> Light:
    return Light("Sky", "DOME", np.eye(3, 4), radiance=np.full((1, 1, 3), radiance, np.float32))


def square(name: str, *corners) -> Mesh:
    return Mesh(name, np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))


FLOOR = square("floor", (-99, -99, 0), (99, -99, 0), (99, 99, 0), (-99, 99, 0))


def scene(*geometries, light: Light, camera: Camera = DOWN, hidden=(), **world) -> Scene:
    placed = tuple(
        Instances(
            thing.name,
            number,
            np.eye(3, 4)[None],
            (0,),
            visible_camera=thing.name not in hidden,
        )
        for number, thing in enumerate(geometries)
    )
    return Scene(camera, geometries, placed, (WHITE,), (), (light,), World(**world))


def drawn(wanted: Scene, directions_a_pixel: int = 256, **settings) -> np.ndarray:
    """Combined, of one sample through the pixels' middles."""
    chosen = Settings(
        samples=1, light_samples=directions_a_pixel // 8, filter_width=0.0, **settings
    )
    return render(wanted, chosen).passes["Combined"][..., 0]


def test_an_open_floor_gets_all_of_an_even_sky():
    np.testing.assert_allclose(drawn(scene(FLOOR, light=even(0.7))), 0.7, atol=1e-3)


def test_a_floor_at_the_foot_of_an_endless_wall_gets_half():
    wall = square("wall", (1e-4, -9e4, 0), (1e-4, 9e4, 0), (1e-4, 9e4, 9e4), (1e-4, -9e4, 9e4))
    camera = replace(DOWN, window=(-1e-5, 1e-5, -1e-5, 1e-5))
    both = scene(FLOOR, wall, light=even(), camera=camera, hidden=("wall",))
    np.testing.assert_allclose(drawn(both, 4096), 0.5, atol=1e-3)


def test_a_ball_above_the_floor_hides_its_form_factor():
    """A sphere of radius r whose centre stands a height h above a level point hides (r / h)²."""
    ball = Spheres("ball", np.array([[0, 0, 2]], np.float32), np.array([1], np.float32))
    camera = replace(DOWN, window=(-1e-5, 1e-5, -1e-5, 1e-5))
    both = scene(FLOOR, ball, light=even(), camera=camera, hidden=("ball",))
    np.testing.assert_allclose(drawn(both, 4096), 1 - 0.25, atol=1e-3)


def test_what_stands_in_the_open_is_exact_at_once():
    """A ball below a sky of radiance a + b z: its light is a + 2/3 b n_z."""
    z = directions(64, 128).reshape(3, 64, 128)[2]
    values = np.repeat((0.5 + 0.4 * z)[..., None], 3, 2).astype(np.float32)
    ball = Spheres("ball", np.array([[0, 0, 0]], np.float32), np.array([1], np.float32))
    wanted = scene(
        ball,
        light=replace(even(), radiance=values),
        camera=replace(FRONT, window=(-0.18, 0.18, -0.43, -0.07)),
    )
    chosen = Settings(samples=1, light_samples=1, filter_width=0.0, passes=frozenset({"Normal"}))
    film = render(wanted, chosen)
    up = film.passes["Normal"][..., 2]
    seen = film.passes["Combined"][..., 0] > 0
    assert seen.mean() > 0.2 and up[seen].min() < -0.5 and up[seen].max() > 0.5
    np.testing.assert_allclose(
        film.passes["Combined"][..., 0][seen], 0.5 + 0.8 / 3 * up[seen], atol=1e-3
    )


def test_a_closed_room_is_black():
    walls = [
        square(name, *(np.array(corner) for corner in corners))
        for name, corners in {
            "ceiling": ((-9, -9, 2), (-9, 9, 2), (9, 9, 2), (9, -9, 2)),
            "left": ((-9, -9, -1), (-9, 9, -1), (-9, 9, 3), (-9, -9, 3)),
            "right": ((9, -9, -1), (9, 9, -1), (9, 9, 3), (9, -9, 3)),
            "front": ((-9, -9, -1), (9, -9, -1), (9, -9, 3), (-9, -9, 3)),
            "back": ((-9, 9, -1), (9, 9, -1), (9, 9, 3), (-9, 9, 3)),
        }.items()
    ]
    room = scene(FLOOR, *walls, light=even(5.0), hidden=("ceiling",))
    chosen = Settings(samples=16, light_samples=1)
    assert not render(room, chosen).passes["Combined"][..., :3].any()


def test_constant_light_is_ambient_and_classic_takes_no_other():
    lit = scene(FLOOR, light=even(0.7), ambient=(0.3, 0.3, 0.3))
    np.testing.assert_allclose(drawn(lit, world_light="CONSTANT"), 0.3, rtol=1e-6)
    np.testing.assert_allclose(drawn(lit, illumination="CLASSIC"), 0.3, rtol=1e-6)


def test_intensities_sum_to_the_maps_irradiance():
    """What is drawn, times n·l, is what the cells of the map give to a level floor over π."""
    numbers = np.random.default_rng(0)
    values = numbers.uniform(0, 1, (32, 64, 3)) ** 8 * 50
    light = replace(even(), radiance=values.astype(np.float32))
    table = dome_table(light, 1, 1 << 18)
    found = (np.maximum(table.along[:, 2], 0)[:, None] * table.light[:, :3]).mean(0)
    cells = directions(32, 64).reshape(3, 32, 64)
    cosine = np.maximum(cells[2], 0)[..., None]
    expected = 4 * (cosine * values * cell_shares(32, 64)).sum((0, 1))
    np.testing.assert_allclose(found, expected, rtol=3e-3)


@pytest.mark.parametrize("shape", [(16, 32), (20, 37), (64, 128)])
def test_the_table_of_irradiance_has_the_sums_over_the_map(shape):
    """At each of its normals, which it has azimuth by azimuth."""
    values = np.random.default_rng(1).uniform(0, 1, (*shape, 3)) ** 8 * 50
    light = replace(even(), radiance=values.astype(np.float32))
    table = dome_table(light, 1, 8).irradiance
    rows, columns = (size - 1 for size in table.shape[:2])
    elevation = np.pi * (np.arange(rows + 1) / rows - 0.5)[:, None]
    azimuth = 2 * np.pi * (0.5 - np.arange(columns + 1) / columns)
    flat, up = np.cos(elevation), np.sin(elevation) * np.ones_like(azimuth)
    normals = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up], -1)
    given = (4 * values * cell_shares(*shape)).reshape(-1, 3)
    expected = np.maximum(normals @ directions(*shape), 0) @ given
    np.testing.assert_allclose(table, expected, atol=1e-6 * expected.max())


def test_directions_follow_the_radiance():
    """Nine in ten go where all the light is, the others everywhere; each lies in the cell that it
    takes its radiance from.
    """
    values = np.zeros((16, 32, 3), np.float32)
    values[11, 5] = 100.0
    table = dome_table(replace(even(), radiance=values), 1, 1 << 12)
    along, intensity = table.along, table.light[:, :3]
    radiance, spread = table.seen(along.T)
    np.testing.assert_allclose((radiance * spread).T, intensity)
    np.testing.assert_allclose(spread, table.light[:, 3])
    elevation = np.floor((np.arcsin(along[:, 2]) / np.pi + 0.5) * 16)
    azimuth = np.floor((0.5 - np.arctan2(along[:, 1], along[:, 0]) / (2 * np.pi)) * 32)
    here = (elevation == 11) & (azimuth == 5)
    assert 0.89 < here.mean() < 0.91
    assert (intensity[here] > 0).all() and (intensity[~here] == 0).all()


def test_a_map_of_an_image_is_the_image():
    """An equirectangular image read through the program of an Environment Texture node."""
    numbers = np.random.default_rng(1).uniform(0, 1, (128, 256, 4)).astype(np.float32)
    texture = Texture("sky", numbers, extension="REPEAT", interpolation="CLOSEST")
    found = radiance_map(_environment(), (texture,))
    np.testing.assert_allclose(found, numbers[..., :3], atol=1e-6)


@pytest.mark.parametrize("rows", [1, 8])
def test_a_map_of_a_small_image_is_no_coarser_than_others(rows):
    """As a pattern may be mixed with it."""
    numbers = np.random.default_rng(1).uniform(0, 1, (rows, 2 * rows, 4)).astype(np.float32)
    texture = Texture("sky", numbers, extension="REPEAT", interpolation="CLOSEST")
    found = radiance_map(_environment(), (texture,))
    by = 128 // rows
    np.testing.assert_allclose(found, numbers[..., :3].repeat(by, 0).repeat(by, 1), atol=1e-6)


@pytest.mark.parametrize("encoding", ["LINEAR", "SRGB"])
def test_large_images_are_averaged(encoding, monkeypatch):
    """Linear values, band by band."""
    monkeypatch.setattr(dome, "BAND", 1 << 14)
    numbers = np.random.default_rng(1).integers(0, 256, (1024, 2048, 4), np.uint8)
    texture = Texture("sky", numbers, encoding, "REPEAT", "CLOSEST")
    found = radiance_map(_environment(), (texture,))
    linear = numbers[..., :3] / 255.0
    if encoding == "SRGB":
        curve = ((linear + 0.055) / 1.055) ** 2.4
        linear = np.where(linear <= 0.04045, linear / 12.92, curve)
    expected = linear.reshape(512, 2, 1024, 2, 3).mean((1, 3))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def _environment():
    """The program that looks an equirectangular image up along the ray."""
    graph = Graph()

    def apply(name, *arguments, **settings):
        return graph.apply(BY_NAME[name], *arguments, **settings)

    def number(value):
        return graph.constant(value)

    x, y, z = apply("separate_xyz", apply("product", apply("incoming")[0], number((-1.0,) * 3))[0])
    math = {"clamp": 0}
    zero = number(0.0)
    across = apply(
        "math", apply("math", x, x, zero, operation=2, **math)[0], zero, zero, operation=0, **math
    )[0]
    squares = apply("math", y, y, across, operation=36, **math)[0]
    across = apply("math", squares, zero, zero, operation=23, **math)[0]
    around = apply("math", y, x, zero, operation=19, **math)[0]
    up = apply("math", z, across, zero, operation=19, **math)[0]
    u = apply("math", around, number(-0.5 / np.pi), number(0.5), operation=36, **math)[0]
    v = apply("math", up, number(1 / np.pi), number(0.5), operation=36, **math)[0]
    where = apply("combine_xyz", u, v, zero)[0]
    return compile_program(graph, [apply("image", where, texture=0)[0]])


def _painted() -> World:
    numbers = np.random.default_rng(2).uniform(0, 2, (16, 32, 4)).astype(np.float32)
    return World(program=_environment(), textures=(Texture("sky", numbers, extension="REPEAT"),))


def _around(camera: Camera) -> Scene:
    """A mirror, a mat and a glossy ball on a floor below an image."""
    world = _painted()
    light = replace(even(), radiance=radiance_map(world.program, world.textures))
    balls = [
        Spheres(name, np.array([[x, 0, 1]], np.float32), np.array([0.9], np.float32))
        for name, x in (("mirror", -2.0), ("mat", 0.0), ("glossy", 2.0))
    ]
    materials = (
        WHITE,
        Material("mirror", (Lobe("MIRROR"),)),
        Material(
            "glossy", (Lobe("SPECULAR", exponent=12.0), Lobe("DIFFUSE", (Input((0.2,) * 3),)))
        ),
    )
    slots = (0, 1, 0, 2)
    placed = tuple(
        Instances(thing.name, k, np.eye(3, 4)[None], (slots[k],))
        for k, thing in enumerate((FLOOR, *balls))
    )
    return Scene(camera, (FLOOR, *balls), placed, materials, (), (light,), world)


FRONT = Camera(
    "PERSPECTIVE",
    np.array([[1, 0, 0, 0], [0, 0, -1, -6.0], [0, 1, 0, 1.5]], float),
    (-0.6, 0.6, -0.45, 0.45),
    (32, 24),
)
FAR = replace(
    FRONT,
    world_from_camera=np.array([[1, 0, 0, 0], [0, 0, -1, -6e3], [0, 1, 0, 1.5]], float),
    window=(-6e-4, 6e-4, -4.5e-4, 4.5e-4),
)
"""So narrow that the scene is told in the camera's axes."""


PARTS = frozenset({"Environment", "Mirror", "Diffuse", "Shadow"})


@pytest.mark.parametrize("is_narrow", [False, True])
def test_both_tracers_draw_the_same(is_narrow, monkeypatch):
    """Directions that highlights draw lie round a frame of the axes that the scene is told in:
    where these are the camera's, nothing is glossy.
    """
    wanted, settings = _around(FRONT), Settings(samples=2, light_samples=2, passes=PARTS)
    if is_narrow:
        monkeypatch.setattr(view_axes, "NARROW", 1.0)
        wanted = replace(wanted, materials=(*wanted.materials[:2], WHITE))
    assert (view_axes.narrow_view_axes(FRONT) is not None) == is_narrow
    native, numpy = (
        render(wanted, replace(settings, backend=backend)).passes for backend in ("NATIVE", "NUMPY")
    )
    for name in ("Combined", *PARTS):
        assert native[name].std() > 0.01
        np.testing.assert_allclose(native[name], numpy[name], atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("exponent", [8.0, 100.0, 3e4])
def test_highlights_of_the_sky_are_as_bright_at_any_exponent(exponent):
    """Of an even sky, seen straight: the integral of (n·h)^p over the directions l above the
    surface, of which each steradian of h has 4 n·h.
    """
    glossy = Material("glossy", (Lobe("SPECULAR", exponent=exponent),))
    wanted = replace(scene(FLOOR, light=even()), materials=(glossy,))
    cosine = np.cos(np.pi / 4)  # where l meets the horizon
    expected = 8 * (1 - cosine ** (exponent + 2)) / (exponent + 2)
    np.testing.assert_allclose(drawn(wanted, 4096), expected, rtol=5e-3)


VEIL = Material("veil", (Lobe("TRANSPARENT", (Input((0.5, 0.7, 0.9)),)),))


def _behind_glass() -> Scene:
    """The same with a clear pane beside the balls and a dim one above them, which shadow rays
    pass.
    """
    wanted = _around(FRONT)
    panes = (
        square("dim", (-3, -1, 2.2), (0, -1, 2.2), (0, 1, 2.2), (-3, 1, 2.2)),
        square("beside", (1, -3, 0), (1, 3, 0), (1, 3, 2), (1, -3, 2)),
    )
    placed = tuple(
        Instances(
            pane.name, len(wanted.geometries) + k, np.eye(3, 4)[None], (len(wanted.materials),)
        )
        for k, pane in enumerate(panes)
    )
    return replace(
        wanted,
        geometries=(*wanted.geometries, *panes),
        instances=(*wanted.instances, *placed),
        materials=(*wanted.materials, VEIL),
    )


def test_both_tracers_draw_the_same_behind_glass():
    settings = Settings(samples=4, light_samples=1, max_bounces=1)
    native, numpy = (
        render(_behind_glass(), replace(settings, backend=backend)).combined
        for backend in ("NATIVE", "NUMPY")
    )
    np.testing.assert_allclose(native, numpy, atol=1e-4, rtol=1e-4)


def test_threads_and_regions_change_no_bit_behind_glass():
    settings = Settings(samples=4, light_samples=1, max_bounces=1)
    whole = render(_behind_glass(), settings).combined
    for threads in (1, 2, 3):
        np.testing.assert_array_equal(
            render(_behind_glass(), replace(settings, threads=threads)).combined, whole
        )
    part = render(_behind_glass(), replace(settings, region=(7, 5, 29, 20))).combined
    np.testing.assert_array_equal(part, whole[5:20, 7:29])


def test_a_view_comes_to_the_bits_of_a_render_behind_glass():
    """A view remembers the shadows of its first sample, and looks for those of the next anew."""
    settings = Settings(samples=4, light_samples=1, max_bounces=1)
    live = LiveRender()
    try:
        live.start([Task(_behind_glass(), settings)])
        assert live.wait(lambda wave: wave.final, 60)
        shown = live.newest.film.combined
    finally:
        live.close()
    np.testing.assert_array_equal(shown, render(_behind_glass(), settings).combined)


def test_a_narrow_view_is_lit_as_a_wide_one():
    """The same ball from the same side, in the scene's axes and in the camera's: what is drawn
    differs by the perspective alone.
    """
    near = replace(
        FRONT,
        world_from_camera=FAR.world_from_camera,
        kind="ORTHOGRAPHIC",
        window=(-3.6, 3.6, -2.7, 2.7),
    )
    settings = Settings(samples=1, light_samples=8, max_bounces=0)
    wide, narrow = (render(_around(c), settings).passes["Combined"] for c in (near, FAR))
    inside = np.s_[8:14, 14:18]
    np.testing.assert_allclose(wide[inside], narrow[inside], atol=0.02)


def test_a_transparent_film_is_lit_but_shows_no_sky():
    wanted = _around(FRONT)
    wanted = replace(wanted, world=replace(wanted.world, transparent=True))
    film = render(wanted, Settings(samples=1, light_samples=1, passes=frozenset({"Environment"})))
    assert not film.passes["Environment"].any()
    assert film.passes["Combined"][2, 16, 0] > 0.1 and film.passes["Combined"][-1, 16, 3] == 0


@pytest.mark.parametrize(
    ("world", "told"),
    [
        (World(program=_environment()), "a texture"),
        (World(axes=np.full((3, 3), np.nan)), "axes"),
    ],
)
def test_what_is_not_sound_is_told(world, told):
    problems = scene_problems(replace(_around(FRONT), world=world))
    assert len(problems) == 1 and told in problems[0]


def test_a_program_that_reads_surfaces_is_refused():
    graph = Graph()
    program = compile_program(graph, [graph.apply(BY_NAME["position"], shift=0)[0]])
    problems = scene_problems(replace(_around(FRONT), world=World(program=program)))
    assert len(problems) == 1 and "reads surfaces" in problems[0]


@pytest.mark.parametrize(
    "radiance", [None, np.zeros((0, 0, 3), np.float32), np.full((1, 1, 3), np.inf, np.float32)]
)
def test_a_map_that_is_not_sound_is_told(radiance):
    problems = scene_problems(scene(FLOOR, light=replace(even(), radiance=radiance)))
    assert len(problems) == 1 and "radiance" in problems[0]


def test_several_skies_are_told():
    wanted = scene(FLOOR, light=even())
    problems = scene_problems(replace(wanted, lights=(even(), even())))
    assert len(problems) == 1 and "'Sky', 'Sky'" in problems[0]


def test_directions_begin_again_after_so_many(monkeypatch):
    """In both tracers: twice the samples of two of a table of two, through the same pixel's middle,
    are those two.
    """
    monkeypatch.setattr(patterns, "MOST_TABLED", 32)
    wanted, few = _around(FRONT), Settings(samples=2, light_samples=2, filter_width=0.0)
    for backend in ("NATIVE", "NUMPY"):
        two, four = (
            render(wanted, replace(few, samples=n, backend=backend)).combined for n in (2, 4)
        )
        np.testing.assert_allclose(two, four, rtol=1e-5, atol=1e-6)


def test_a_sky_that_is_dealt_wants_points_of_lobes(monkeypatch):
    def pack(*arguments, **more):
        found = packing_settings.pack_settings(*arguments, **more)
        found.data.lobe_points = found.data.reflections = 0
        return found

    monkeypatch.setattr(native_render, "pack_settings", pack)
    dealt = Settings(samples=2, soft_light="DEALT", backend="NATIVE")
    with pytest.raises(SceneError, match="settings: no points of lobes for a dome"):
        render(_around(FRONT), dealt)
