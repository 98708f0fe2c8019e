"""Surfaces that glow: closed forms, which points are drawn, one tracer beside the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.evaluation import materials
from glint.engine.evaluation.textures import Image
from glint.engine.lights import mesh_lights as lights
from glint.engine.lights.mesh_lights import mesh_lights, mesh_table
from glint.engine.program.execute.run import run
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program, instructions
from glint.engine.program.table import BY_NAME
from glint.engine.sampling import patterns
from glint.engine.scene import (
    POINT,
    Attribute,
    Camera,
    Input,
    Instances,
    Lobe,
    Material,
    Mesh,
    Scene,
    Spheres,
    Texture,
)

WHITE = Material("white", (Lobe("DIFFUSE"),))
DOWN = Camera(
    "ORTHOGRAPHIC",
    np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 50.0]]),
    (-1e-5, 1e-5, -1e-5, 1e-5),
    (4, 4),
)
"""Looks down on the origin."""
BACKENDS = ("NATIVE", "NUMPY")


def glowing(*rgb: float) -> Material:
    return Material("lamp", (Lobe("EMISSION", (Input(rgb),)),))


def square(name: str, *corners) -> Mesh:
    return Mesh(name, np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))


FLOOR = square("floor", (-99, -99, 0), (99, -99, 0), (99, 99, 0), (-99, 99, 0))


def panel(z: float = 1.0, a: float = 1.0, b: float = 1.0) -> Mesh:
    """Faces down, over the origin."""
    return square("panel", (-a, -b, z), (-a, b, z), (a, b, z), (a, -b, z))


def scene(*lamps, material=None, camera: Camera = DOWN, floor=WHITE, textures=()) -> Scene:
    """A floor, and what glows, which the camera does not see."""
    here = np.eye(3, 4)[None]
    placed = [Instances("floor", 0, here, (0,))]
    placed += [
        Instances(f"lamp {k}", k, here, (1,), visible_camera=False)
        for k in range(1, len(lamps) + 1)
    ]
    return Scene(
        camera,
        (FLOOR, *lamps),
        tuple(placed),
        (floor, material or glowing(1.0, 1.0, 1.0)),
        tuple(textures),
    )


def drawn(wanted: Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    chosen = Settings(
        **{"samples": 1024, "light_samples": 4, "filter_width": 0.0, "backend": backend} | settings
    )
    return render(wanted, chosen).passes["Combined"][..., :3]


def rectangle_form_factor(a: float, b: float, z: float) -> float:
    """Of a level point below the middle of a rectangle of 2a × 2b at the height z."""
    x, y = a / z, b / z
    p, q = np.hypot(1, x), np.hypot(1, y)
    return 4 / (2 * np.pi) * (x / p * np.arctan(y / p) + y / q * np.arctan(x / q))


@pytest.mark.parametrize(("a", "b", "z"), [(1, 1, 1), (0.2, 3, 0.7), (0.1, 0.1, 2), (5, 5, 1)])
def test_a_panel_gives_its_form_factor(a, b, z):
    value = drawn(scene(panel(z, a, b)))
    np.testing.assert_allclose(value, rectangle_form_factor(a, b, z), rtol=2e-3)


@pytest.mark.parametrize(
    ("a", "b", "z"), [(1, 1, 1), (0.2, 3, 0.7), (0.1, 0.1, 2), (1, 0.3, 0.5), (1, 1, 1e-3)]
)
@pytest.mark.parametrize("backend", BACKENDS)
def test_few_samples_of_a_panel_are_near(backend, a, b, z):
    value = drawn(scene(panel(z, a, b)), backend, samples=64)
    np.testing.assert_allclose(value, rectangle_form_factor(a, b, z), rtol=0.04)


@pytest.mark.parametrize(
    ("z", "a"), [(0.1, 1.0), (1e-2, 1.0), (1e-4, 1.0), (1.0, 50.0), (1e-4, 50.0)]
)
def test_a_panel_near_the_floor_gives_its_form_factor(z: float, a: float) -> None:
    """However near: nothing is darker where it is nearly closed off, and no wide panel is lost."""
    found = drawn(scene(panel(z, a, a)), samples=256)
    np.testing.assert_allclose(found, rectangle_form_factor(a, a, z), rtol=0.01)


@pytest.mark.parametrize("x", [0.1, 0.3, 1.0, 3.0])
def test_a_ball_on_the_floor_gives_its_form_factor(x: float) -> None:
    """A sphere of radius r, u from the normal, at the distance d: cos u (r / d)², where none of it
    is below the horizon; here it touches that.
    """
    ball = Spheres("ball", np.array([[x, 0, 1]], np.float32), np.array([1], np.float32))
    wanted = 1 / np.hypot(x, 1) ** 3
    np.testing.assert_allclose(drawn(scene(ball)), wanted, rtol=0.015)


def test_a_disc_gives_its_form_factor():
    angle = np.arange(64) * np.pi / 32
    rim = np.stack([np.cos(angle), np.sin(angle), np.full(64, 2.0)], 1)
    fan = [[0, k, k + 1] for k in range(1, 63)]
    disc = Mesh("disc", rim.astype(np.float32), np.array(fan, np.uint32)[:, ::-1])
    # of the circle of the same area
    r2 = 64 * np.sin(np.pi / 32) / 2 / np.pi
    np.testing.assert_allclose(drawn(scene(disc)), r2 / (r2 + 4), rtol=2e-3)


def test_a_ball_gives_its_form_factor():
    """A sphere of radius r whose centre is a height h above a level point: (r / h)²."""
    ball = Spheres("ball", np.array([[0, 0, 2]], np.float32), np.array([1], np.float32))
    np.testing.assert_allclose(drawn(scene(ball), light_samples=16), 0.25, rtol=5e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_balls_glow_in_colours_of_their_own(backend):
    """A row of an attribute each: they light as two of one colour each do."""
    centers = np.array([[-2, 0, 2], [2, 0, 3]], np.float32)
    rows = np.array([[1, 0, 0.5, 1], [0, 2, 0.5, 1]], np.float32)
    tone = Attribute("tone", "FACE", rows)
    balls = Spheres("balls", centers, np.ones(2, np.float32), attributes=(tone,))
    lamp = Material("lamp", (Lobe("EMISSION", (Input((1.0, 1.0, 1.0), attribute="tone"),)),))
    found = drawn(scene(balls, material=lamp), backend, samples=64, light_samples=16)
    one = [
        drawn(scene(Spheres("ball", c[None], np.ones(1, np.float32))), samples=64, light_samples=16)
        for c in centers
    ]
    wanted = sum(row[:3] * each for row, each in zip(rows, one, strict=True))
    np.testing.assert_allclose(found, wanted, rtol=0.02)


def test_no_ray_goes_to_what_is_dark_on_that_side() -> None:
    """A ball's far side has points as well, which glow outward alone."""
    ball = Spheres("ball", np.array([[0, 0, 1.2]], np.float32), np.array([0.4], np.float32))
    counts = [
        render(scene(ball), Settings(samples=4, passes=frozenset({"Cost"}), backend=backend))
        .passes["Cost"]
        .astype(int)
        for backend in BACKENDS
    ]
    np.testing.assert_array_equal(*counts)
    assert 1 < counts[0].mean() < 1 + 4 * 8


def test_a_ball_round_everything_lights_like_a_sky():
    ball = Spheres("ball", np.array([[0, 0, 0]], np.float32), np.array([150], np.float32))
    value = drawn(scene(ball), light_samples=16)
    np.testing.assert_allclose(value, 1.0, rtol=0.01)


def side_view(resolution: int = 24) -> Camera:
    """Looks down at the origin at 45°."""
    s = np.sqrt(0.5)
    matrix = np.array([[1, 0, 0, 0], [0, s, -s, -4], [0, s, s, 4]])
    return Camera("PERSPECTIVE", matrix, (-0.4, 0.4, -0.4, 0.4), (resolution, resolution))


def tilted(material: Material = WHITE, **more) -> Scene:
    """A floor before an upright panel whose two halves glow differently, with a post before it."""
    left = square("left", (-1, 1, 0.01), (-1, 1, 1), (0, 1, 1), (0, 1, 0.01))
    right = square("right", (0, 1, 0.01), (0, 1, 1), (1, 1, 1), (1, 1, 0.01))
    post = square("post", (-0.3, 0.5, 0), (-0.2, 0.5, 0), (-0.2, 0.5, 0.6), (-0.3, 0.5, 0.6))
    whole = scene(left, right, post, camera=side_view(), floor=material, **more)
    red, green = glowing(4.0, 1.0, 0.5), glowing(0.5, 2.0, 1.0)
    lamps = [
        replace(whole.instances[1], materials=(1,), visible_camera=True),
        replace(whole.instances[2], materials=(2,), visible_camera=True),
        replace(whole.instances[3], materials=(0,), visible_camera=True),
    ]
    return replace(whole, instances=(whole.instances[0], *lamps), materials=(material, red, green))


def gloss(exponent: float) -> Material:
    shine = Lobe(
        "SPECULAR", (Input((exponent / 8,) * 3),), exponent=exponent, fresnel=True, ior=1.5
    )
    return Material("gloss", (Lobe("DIFFUSE", (Input((0.5, 0.4, 0.3)),)), shine))


@pytest.mark.parametrize("exponent", [4.0, 30.0, 1000.0])
def test_both_tracers_see_the_same(exponent):
    wanted = tilted(gloss(exponent))
    settings = {"samples": 4, "light_samples": 2, "filter_width": 1.5}
    core, reference = (drawn(wanted, backend, **settings) for backend in BACKENDS)
    assert reference.max() > 1
    wrong = np.abs(core - reference) > 1e-4 * (1 + np.abs(reference))
    assert wrong.any(2).mean() <= 0.002  # a pixel at the edge of a shadow may turn


@pytest.mark.parametrize("exponent", [4.0, 1000.0])
def test_explain_tells_all_of_a_pixel(exponent):
    wanted = tilted(gloss(exponent))
    settings = Settings(samples=1, light_samples=2, filter_width=0.0)
    picture = render(wanted, settings).passes["Combined"]
    explainer, named = PixelExplainer(wanted, settings), set()
    for x, y in ((12, 12), (5, 3), (20, 9), (11, 20)):
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-4, atol=1e-6)
        named |= {term.light for term in (ray.hit.lights if ray.hit else ())}
    assert named == {"Glowing surfaces"}


@pytest.mark.parametrize("exponent", [100.0, 3000.0])
def test_drawn_directions_change_no_mean(exponent):
    """Points on the light alone, which are dots, converge to the same."""
    wanted = tilted(gloss(exponent))
    few = drawn(wanted, samples=256, light_samples=4)
    rough = replace(wanted, materials=(gloss(exponent), *wanted.materials[1:]))
    assert few.mean() == pytest.approx(drawn(rough, samples=1024, light_samples=8).mean(), rel=5e-3)


# --- which points
# --------------------------------------------------------------------------------------------------


def test_points_follow_the_power():
    """A panel of three times the radiance gets three times the points, each worth a third."""
    dim, bright = panel(1.0), panel(2.0)
    whole = scene(dim, bright)
    placed = (*whole.instances[:2], replace(whole.instances[2], materials=(2,)))
    (light,) = mesh_lights(
        replace(whole, instances=placed, materials=(*whole.materials, glowing(3.0, 3.0, 3.0)))
    )
    table = mesh_table(light, 64, 8)
    high = table.front[:, 0] == 3.0
    assert high.mean() == pytest.approx(0.75, abs=0.01)
    assert table.spread[high][0] == pytest.approx(table.spread[~high][0] / 3)
    np.testing.assert_allclose(
        (table.front[:, 0] * table.spread).mean(), 1.0 * 4 + 3.0 * 4, rtol=0.01
    )


def test_all_samples_have_the_same_points_however_many_there_are():
    (light,) = mesh_lights(scene(panel()))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(patterns, "MOST_TABLED", 64)
        few = mesh_table(light, 1000, 8)
    assert len(few.point) == 64
    np.testing.assert_array_equal(few.point, mesh_table(light, 8, 8).point)


def test_points_begin_again_in_both_tracers(monkeypatch):
    monkeypatch.setattr(patterns, "MOST_TABLED", 16)
    wanted = tilted()
    core, reference = (drawn(wanted, backend, samples=8, light_samples=1) for backend in BACKENDS)
    np.testing.assert_allclose(core, reference, rtol=1e-4, atol=1e-4)


def test_what_does_not_glow_makes_no_light():
    assert not mesh_lights(scene(panel(), material=WHITE))
    assert not mesh_lights(scene(panel(), material=glowing(0.0, 0.0, 0.0)))
    assert not mesh_lights(scene())


@pytest.mark.parametrize("setting", [{"mesh_light": "OFF"}, {"illumination": "CLASSIC"}])
def test_it_can_be_off(setting):
    assert not drawn(scene(panel()), samples=4, **setting).any()


def test_a_mirrored_flattened_instance_gives_the_same():
    """Of a panel twice as high, brought down, seen from its other side."""
    flat = np.array([[-1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0.5, 0]])[None]
    both = []
    for backend in BACKENDS:
        whole = scene(panel(2.0))
        moved = replace(whole.instances[1], world_from_object=flat)
        wanted = replace(whole, instances=(whole.instances[0], moved))
        both.append(drawn(wanted, backend, samples=64))
    np.testing.assert_allclose(both[0], both[1], rtol=1e-5)
    np.testing.assert_allclose(both[0], rectangle_form_factor(1, 1, 1), rtol=0.01)


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_side_may_glow_otherwise(backend):
    """By the program of its material: the back alone, which the floor does not see."""
    graph = Graph()
    inner = graph.apply(BY_NAME["backfacing"])[0]
    shown = compile_program(graph, graph.apply(BY_NAME["combine_xyz"], inner, inner, inner))
    material = Material("lid", (Lobe("EMISSION", (Input(output=0),)),), program=shown)
    assert not drawn(scene(panel(), material=material), backend, samples=4).any()
    facing_up = replace(panel(), triangles=panel().triangles[:, ::-1])
    assert drawn(scene(facing_up, material=material), backend, samples=64).mean() == pytest.approx(
        rectangle_form_factor(1, 1, 1), rel=0.01
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_image_lights_from_where_it_is_bright(backend):
    """The lit half of a panel is a panel of half the size."""
    pixels = np.zeros((1, 2, 4), np.float32)
    pixels[0, :, 3], pixels[0, 0, :3] = 1, 1
    texture = Texture("half", pixels, extension="EXTEND", interpolation="CLOSEST")
    uv = Attribute("uv", POINT, np.array([[0, 0], [0, 1], [1, 1], [1, 0]], np.float32))
    lamp = replace(panel(), attributes=(uv,))
    material = Material("screen", (Lobe("EMISSION", (Input(texture=0),)),))
    samples = {"NATIVE": 256, "NUMPY": 64}[backend]
    value = drawn(scene(lamp, material=material, textures=(texture,)), backend, samples=samples)
    np.testing.assert_allclose(value, rectangle_form_factor(1, 1, 1) / 2, rtol=0.02)


@pytest.mark.parametrize(("axis", "reads"), [(None, 1), (0, 2), (1, 2)])
def test_sides_that_read_an_image_alike_read_it_once(monkeypatch, axis, reads):
    """axis: along which the inner side reads beside the outer one."""
    graph = Graph()
    inner = graph.apply(BY_NAME["backfacing"])[0]
    steps = [inner if k == axis else graph.constant(0.0) for k in range(3)]
    aside = graph.apply(BY_NAME["combine_xyz"], *steps)[0]
    place = graph.apply(BY_NAME["position"], shift=0)[0]
    seen = graph.apply(BY_NAME["scaled_sum"], aside, graph.constant(0.25), place)[0]
    color = graph.apply(BY_NAME["image"], seen, texture=0)[0]
    material = Material(
        "screen", (Lobe("EMISSION", (Input(output=0),)),), program=compile_program(graph, [color])
    )
    pixels = np.random.default_rng(1).random((5, 7, 4), np.float32)
    shown = scene(panel(), material=material, textures=(Texture("noise", pixels),))
    done, decoded = [], Image._decoded
    monkeypatch.setattr(Image, "_decoded", lambda *given: done.append(1) or decoded(*given))
    found = mesh_lights(shown)[0].emitters
    assert len(done) == reads
    monkeypatch.setattr(lights, "_is_alike", lambda glow: False)
    wanted = mesh_lights(replace(shown, geometries=(FLOOR, panel())))[0].emitters
    for name in ("front", "back"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))


def test_programs_run_for_what_glows_alone(monkeypatch):
    """Instructions that other lobes need do not, and no bit differs."""
    graph = Graph()
    x = graph.apply(BY_NAME["position"], shift=0)[0]
    wave, bright = (graph.apply(BY_NAME[k], x)[0] for k in ("rgb_to_bw", "vector_normalized"))
    program = compile_program(graph, [wave, bright])
    emission = Lobe("EMISSION", (Input(output=1),))
    both = Material("screen", (Lobe("DIFFUSE", (Input(output=0),)), emission), program=program)
    alone = Material(
        "screen", (replace(emission, factors=(Input(output=0),)),),
        program=compile_program(graph, [bright]),
    )  # fmt: skip
    ran = []
    monkeypatch.setattr(
        materials, "run", lambda program, *more: ran.append(program) or run(program, *more)
    )
    found, wanted = (
        mesh_lights(scene(panel(), material=material))[0].emitters for material in (both, alone)
    )
    for name in ("corners", "front", "back", "weight"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    assert len({len(list(instructions(each))) for each in ran}) == 1


@pytest.mark.parametrize(
    "corner", [np.nan, np.inf, 3e38, 1e-30], ids=["nan", "infinite", "largest", "tiny"]
)
def test_extreme_corners_leave_the_rest_lit(corner):
    strange = square("strange", (0, 0, 5), (0, corner, 5), (corner, corner, 5), (corner, 0, 5))
    with np.errstate(all="ignore"):
        value = drawn(scene(panel(), strange), samples=64)
    assert np.isfinite(value).all()
    if corner != 3e38:
        np.testing.assert_allclose(value, rectangle_form_factor(1, 1, 1), rtol=0.02)


@pytest.mark.parametrize("strength", [1e-30, 1e30, -1.0])
def test_extreme_strengths_are_finite(strength):
    value = drawn(scene(panel(), material=glowing(*[strength] * 3)), samples=16)
    assert np.isfinite(value).all()
    np.testing.assert_allclose(value, strength * rectangle_form_factor(1, 1, 1), rtol=0.05)
