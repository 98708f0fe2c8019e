"""Light of lamps that mirrors and glass throw onto what is matt, sharply: closed forms, and one
tracer beside the other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import BACKENDS, GROUND, HERE, ball, drawn, lamp, matt, quad
from glint.engine import PixelExplainer, Settings, explanation_lines, render
from glint.engine.film import light_group_pass
from glint.engine.program.program import compile_program
from glint.engine.scene import (
    Attribute,
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Medium,
    Mesh,
    Scene,
)
from test_light_programs import Sum

ALBEDO = 0.5
TINT = (0.9, 0.6, 0.3)
IOR = 1.45
MIRROR = Material("mirror", (Lobe("MIRROR", (Input(TINT),)),))
GLASS = Material(
    "glass", (Lobe("REFRACTION", fresnel=True, ior=IOR), Lobe("MIRROR", fresnel=True, ior=IOR))
)
PHOTONS, FEW = 1 << 16, 1 << 12


def over_ground(
    thing, material: Material, light: Light, half: float = 1.5, size: int = 31
) -> Scene:
    """A thing that the camera, high above, does not see, and what it throws on a matt ground. Light
    passes this from below.
    """
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 20.0)])
    camera = Camera("ORTHOGRAPHIC", frame, (-half, half, -half, half), (size, size))
    placed = (
        Instances("ground", 0, HERE[None], (0,), visible_shadow=False),
        Instances("thing", 1, HERE[None], (1,), visible_camera=False),
    )
    return Scene(camera, (GROUND, thing), placed, (matt((ALBEDO,) * 3), material), lights=(light,))


CHOSEN = {"samples": 1, "soft_light": "DEALT", "reflective_caustics": "ON"}


def thrown(scene: Scene, photons: int = PHOTONS, **more) -> np.ndarray:
    """What photons add."""
    settings = {**CHOSEN, **more}
    return drawn(scene, 1, photons=photons, **settings) - drawn(scene, 0, **settings)


def bare(scene: Scene, *lights: Light) -> Scene:
    """The ground alone."""
    return replace(
        scene, geometries=scene.geometries[:1], instances=scene.instances[:1], lights=lights
    )


def turned(light: Light, *axis: float) -> Light:
    """Shining along that axis, in the plane of x and z."""
    x, _, z = np.array(axis) / np.linalg.norm(axis)
    light.world_from_light[:, :3] = [[-z, 0, -x], [0, 1, 0], [x, 0, -z]]
    return light


def mirrored(light: Light) -> Light:
    """In the mirror at z = 2."""
    frame = light.world_from_light.copy()
    frame[2] *= -1
    frame[2, 3] += 4.0
    frame[:, 1] *= -1  # right-handed
    return replace(light, world_from_light=frame)


MIRROR_ABOVE = quad((-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2))
UP = {
    "point": lamp("POINT", (0, 0, 1)),
    "ball": lamp("POINT", (0, 0, 1), radius=0.2),
    "spot": turned(lamp("SPOT", (0, 0, 1), spot_size=1.0, spot_blend=0.5), 0.2, 0, 1),
    "sun": turned(lamp("SUN", strength=2.0), 0.1, 0, 1),
    "wide sun": turned(lamp("SUN", strength=2.0, angle=0.1), 0.0, 0, 1),
    "area": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.3), 0.2, 0, 1),
    "disc": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.5, shape="ELLIPSE"), 0, 0, 1),
    "beam": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.5, spread=2.0), 0, 0, 1),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", UP)
def test_a_mirror_throws_the_light_of_a_lamp_behind_it(name: str, backend: str) -> None:
    """As bright as a lamp mirrored in it, point by point but for blotches of a few percent."""
    scene = over_ground(MIRROR_ABOVE, MIRROR, UP[name])
    takes_few = backend == "NUMPY" and UP[name].kind in ("POINT", "SUN")
    found = thrown(scene, PHOTONS >> 2 if takes_few else PHOTONS, backend=backend)
    behind = bare(scene, mirrored(UP[name]))
    expected = drawn(behind, 0, samples=1, light_samples=256, soft_light="SHARED") * TINT
    at = np.abs(np.linspace(-1.5, 1.5, 63)[1::2])
    inner = np.maximum(*np.meshgrid(at, at)) < 0.6
    assert expected[inner].min() > 0
    np.testing.assert_allclose(found[inner].mean(0), expected[inner].mean(0), rtol=0.02)
    off = np.abs(found - expected)[inner].mean() / expected[inner].mean()
    assert off < 0.04


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_mirrors_patch_ends_where_the_mirror_does(backend: str) -> None:
    scene = over_ground(MIRROR_ABOVE, MIRROR, turned(lamp("SUN", strength=2.0), 0, 0, 1))
    found = thrown(scene, PHOTONS >> 2, backend=backend)[15, :, 0]
    at = np.abs(np.linspace(-1.5, 1.5, 63)[1::2])
    assert found[at < 0.95].min() > 0.9 * found[15] > 0
    assert found[at > 1.05].max() == 0


def falling(x: np.ndarray) -> np.ndarray:
    """What passes a unit ball of glass of light that falls x off its axis, with no reflection."""
    cosine = np.sqrt(1 - x**2)
    inner = np.sqrt(IOR**2 - x**2)
    s = ((cosine - inner) / (cosine + inner)) ** 2
    p = ((IOR**2 * cosine - inner) / (IOR**2 * cosine + inner)) ** 2
    return ((1 - s) ** 2 + (1 - p) ** 2) / 2


def landing(x: np.ndarray, height: float) -> np.ndarray:
    """Where on the ground that light goes, its middle so high above."""
    outer, inner = np.arcsin(x), np.arcsin(x / IOR)
    leaves, turn = outer + np.pi - 2 * inner, 2 * (outer - inner)
    return np.sin(leaves) - np.tan(turn) * (height + np.cos(leaves))


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_glass_ball_gathers_the_suns_light(backend: str) -> None:
    """All that passes it once and lands in the picture, most of it in a patch as wide as half the
    ball.
    """
    clear = replace(GLASS, lobes=GLASS.lobes[:1])  # mirrors nothing, also inside
    sun = turned(lamp("SUN", strength=2.0), 0, 0, -1)
    scene = over_ground(ball(1.0, (0.0, 0.0, 2.0)), clear, sun, half=3.0, size=121)
    photons = {"NATIVE": 1 << 17, "NUMPY": 1 << 14}[backend]
    found = thrown(scene, photons, backend=backend)[..., 0]
    x = (np.arange(4000) + 0.5) / 4000
    at = np.linspace(-3.0, 3.0, 243)[1::2]
    far = np.hypot(*np.meshgrid(at, at))
    for radius in (0.5, 1.5, 2.8):
        lands = np.abs(landing(x, 2.0)) < radius
        arrives = ALBEDO * 2.0 / np.pi * np.pi * np.mean(2 * x * falling(x) * lands)
        assert found[far < radius].sum() * (6.0 / 121) ** 2 == pytest.approx(arrives, rel=0.03)


@pytest.mark.parametrize("backend", BACKENDS)
def test_photons_go_where_the_settings_say(backend: str) -> None:
    """No mirrors' without reflective caustics, no glass's without refractive ones."""
    up = over_ground(MIRROR_ABOVE, MIRROR, UP["point"])
    clear = replace(GLASS, lobes=GLASS.lobes[:1])
    down = turned(lamp("SUN", strength=2.0), 0, 0, -1)
    through = over_ground(ball(0.5, (0.0, 0.0, 1.0)), clear, down)
    for scene, goes, stays in (
        (up, "refractive_caustics", "reflective_caustics"),
        (through, "reflective_caustics", "refractive_caustics"),
    ):
        assert thrown(scene, FEW, backend=backend, **{goes: "OFF"}).max() > 0
        assert thrown(scene, FEW, backend=backend, **{stays: "OFF"}).max() == 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_lights_that_do_not_light_the_mirror_throw_nothing(backend: str) -> None:
    scene = over_ground(MIRROR_ABOVE, MIRROR, UP["point"])
    matt_alone = replace(scene, lights=(replace(UP["point"], lights_gloss=False),))
    assert thrown(matt_alone, FEW, backend=backend).max() == 0
    linked = replace(UP["point"], receivers=1)
    placed = tuple(replace(thing, light_set=k) for k, thing in enumerate(scene.instances))
    scene = replace(scene, instances=placed)
    assert thrown(replace(scene, lights=(linked,)), FEW, backend=backend).max() == 0
    linked = replace(linked, receivers=3)
    assert thrown(replace(scene, lights=(linked,)), FEW, backend=backend).max() > 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_parts_and_groups_have_the_light_of_photons(backend: str) -> None:
    lamps = (replace(UP["point"], light_group=0), replace(UP["area"], light_group=1))
    scene = over_ground(MIRROR_ABOVE, MIRROR, lamps[0])
    scene = replace(scene, lights=lamps, light_groups=("a", "b"))
    names = ("Diffuse Direct", "Diffuse Indirect", "Diffuse Color", "Diffuse")
    for soft_light in ("DEALT", "RESOLVED"):
        chosen = {"samples": 4, "diffuse_bounces": 1, "soft_light": soft_light}
        settings = Settings(photons=FEW, passes=frozenset(names), backend=backend, **chosen)
        passes = render(scene, settings).passes
        whole = passes["Combined"][..., :3]
        parts = (passes[names[0]] + passes[names[1]]) * passes[names[2]]
        np.testing.assert_allclose(parts, whole, rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(passes["Diffuse"], whole, rtol=1e-4, atol=1e-6)
        groups = [passes[light_group_pass(name)] for name in scene.light_groups]
        assert min(group.max() for group in groups) > 0
        np.testing.assert_allclose(sum(groups), whole, rtol=1e-4, atol=1e-6)


def test_same_bits_with_any_threads_and_regions() -> None:
    lamps = (UP["point"], UP["area"], UP["wide sun"])
    scene = replace(over_ground(MIRROR_ABOVE, MIRROR, lamps[0]), lights=lamps)
    settings = Settings(samples=2, diffuse_bounces=2, soft_light="RESOLVED", photons=20000)
    whole = render(scene, settings).passes["Combined"]
    for threads in (1, 3):
        again = render(scene, replace(settings, threads=threads)).passes["Combined"]
        np.testing.assert_array_equal(again, whole)
    part = render(scene, replace(settings, region=(5, 7, 20, 16))).passes["Combined"]
    np.testing.assert_array_equal(part, whole[7:16, 5:20])


@pytest.mark.parametrize("backend", BACKENDS)
def test_photons_change_nothing_where_nothing_shines(backend: str) -> None:
    scene = over_ground(MIRROR_ABOVE, matt((0.8,) * 3), UP["point"])
    np.testing.assert_array_equal(
        drawn(scene, 1, backend, photons=PHOTONS, **CHOSEN), drawn(scene, 1, backend, **CHOSEN)
    )


# --- both tracers


def placed(x: float, y: float, z: float, scale: float = 1.0) -> np.ndarray:
    matrix = scale * np.eye(3, 4)
    matrix[:, 3] = x, y, z
    return matrix


def blob(count: int = 10) -> Mesh:
    """A ball of triangles that seems smooth."""
    up, around = np.meshgrid(
        np.linspace(0, np.pi, count), np.linspace(0, 2 * np.pi, 2 * count), indexing="ij"
    )
    points = [np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)]
    vertices = np.stack(points, -1).reshape(-1, 3).astype(np.float32)
    row, column = np.indices((count - 1, 2 * count - 1))
    a = (row * 2 * count + column).ravel()
    b, c, d = a + 1, a + 2 * count, a + 2 * count + 1
    triangles = np.concatenate([np.stack([a, c, d], 1), np.stack([a, d, b], 1)])
    normals = Attribute("normal", "POINT", vertices)
    return Mesh("blob", vertices, triangles.astype(np.uint32), normals=normals)


def varied() -> Material:
    """Matt, of a colour that varies."""
    made = Sum()
    grey, step = made.graph.constant((0.5,) * 3), made.graph.constant(0.1)
    color = made.apply("scaled_sum", made.vector("position"), step, grey)
    program = compile_program(made.graph, [color])
    return Material("varied", (Lobe("DIFFUSE", (Input(output=0),)),), program=program)


def bent() -> Material:
    """Glass that refracts at normals of its own."""
    made = Sum()
    step = made.graph.constant(0.1)
    normal = made.apply("scaled_sum", made.vector("position"), step, made.vector("normal"))
    lobes = (replace(GLASS.lobes[0], normal_output=0), GLASS.lobes[1])
    return Material("bent", lobes, program=compile_program(made.graph, [normal]))


def things(*lights: Light, ground: Material | None = None, **made) -> Scene:
    """Over a ground. made: by name of a thing what it is, its material and where it is placed."""
    scene = over_ground(MIRROR_ABOVE, MIRROR, lights[0], size=9)
    ground = ground or matt((ALBEDO,) * 3)
    instances = [
        Instances(name, 1 + k, np.array(at), (1 + k,), visible_camera=False)
        for k, (name, (_, _, *at)) in enumerate(made.items())
    ]
    return replace(
        scene,
        geometries=(GROUND, *(thing for thing, *_ in made.values())),
        instances=(scene.instances[0], *instances),
        materials=(ground, *(material for _, material, *_ in made.values())),
        lights=lights,
    )


SUN = turned(lamp("SUN", strength=2.0), 0.3, 0, -1)
SPOT = turned(lamp("SPOT", (0.5, 0, 4), radius=0.3, spot_size=1.5, spot_blend=0.5), -0.1, 0, -1)
AREA = turned(lamp("AREA", (1.0, 0, 4), size_x=0.5, size_y=0.3), -0.2, 0, -1)
POINT = lamp("POINT", (0.4, 0.3, 3.5))
BALL = ball(0.5, (0.0, 0.0, 1.0))
DENSE = Material("dense", (Lobe("TRANSPARENT", ior=IOR), *GLASS.lobes))
PANE = Material(
    "pane",
    (
        Lobe("TRANSPARENT", (Input((0.5, 0.6, 0.7)),)),
        Lobe("DIFFUSE", (Input((0.1,) * 3),)),
        Lobe("MIRROR", (Input((0.2,) * 3),)),
    ),
)
THIN = Material(
    "thin",
    (
        Lobe("DIFFUSE", (Input((0.4,) * 3),)),
        Lobe("TRANSLUCENT", (Input((0.3, 0.4, 0.5)),)),
    ),
)
SQUARE = quad((-1, -1, 0.3), (1, -1, 0.3), (1, 1, 0.3), (-1, 1, 0.3))
MANY = [placed(0.2 * i - 1, 0.2 * j - 1, 0.1, 0.15) for i in range(9) for j in range(9)]
LINKED = things(
    replace(POINT, receivers=0b011, blockers=0b111),
    replace(AREA, blockers=0b101),
    ball=(BALL, GLASS, placed(0, 0, 0)),
    blob=(blob(), MIRROR, placed(0.9, 0.3, 0.5, 0.3)),
    shade=(SQUARE, matt((0.3,) * 3), placed(-0.6, 0, 2.5)),
)
LINKED = replace(
    LINKED, instances=tuple(replace(x, light_set=k) for k, x in enumerate(LINKED.instances))
)
BOTH = {
    **{
        f"{name} mirrored": things(light, mirror=(MIRROR_ABOVE, MIRROR, placed(0, 0, 0)))
        for name, light in UP.items()
    },
    "glass in the sun": things(SUN, ball=(BALL, GLASS, placed(0, 0, 0))),
    "smooth glass": things(SPOT, blob=(blob(), GLASS, placed(0, 0, 1, 0.5))),
    "dense glass": things(POINT, ball=(BALL, DENSE, placed(0, 0, 0))),
    "bent normals": things(AREA, ball=(BALL, bent(), placed(0, 0, 0))),
    "many lamps and materials": things(
        AREA,
        UP["area"],
        POINT,
        ground=varied(),
        ball=(BALL, GLASS, placed(0, 0, 0), placed(0.9, 0.3, 0.1)),
        blob=(blob(), MIRROR, placed(0, 0.5, 0.8, 0.3)),
    ),
    "many things": things(
        POINT, balls=(BALL, GLASS, *MANY), blob=(blob(), MIRROR, placed(0, 0.5, 1, 0.3))
    ),
    "both sides": things(
        POINT,
        UP["area"],
        lamp("POINT", (0.2, 0.3, -0.3)),
        ground=THIN,
        ball=(BALL, GLASS, placed(0, 0, 0)),
        mirror=(MIRROR_ABOVE, MIRROR, placed(0, 0, -3)),
    ),
    "leaves": things(
        lamp("POINT", (0.2, 0.3, -0.3)),
        ground=Material("leaf", THIN.lobes[1:]),
        mirror=(MIRROR_ABOVE, MIRROR, placed(0, 0, -3)),
    ),
    "panes": things(
        POINT,
        AREA,
        ball=(BALL, GLASS, placed(0, 0, 0)),
        pane=(SQUARE, PANE, placed(0, 0, 0), placed(0, 0, 2)),
    ),
    "a medium": things(
        POINT,
        blob=(
            blob(),
            replace(GLASS, medium=Medium(absorption=(0.5, 1.0, 2.0))),
            placed(0, 0, 1, 0.5),
        ),
    ),
    "programs": things(
        replace(AREA, program=Sum().program("incoming", "position", "ray_length")),
        replace(SUN, program=Sum().program("incoming")),
        ball=(BALL, GLASS, placed(0, 0, 0)),
    ),
    "linked lights": LINKED,
}


def agree(core: np.ndarray, reference: np.ndarray) -> None:
    assert core.max() > 0
    np.testing.assert_allclose(reference, core, rtol=1e-4, atol=1e-6 * core.max())


@pytest.mark.parametrize("name", BOTH)
def test_both_tracers_follow_the_same_photons(name: str) -> None:
    """To the same places and nodes: to rounding they bring the same to all pixels."""
    core, reference = (thrown(BOTH[name], 3000, backend=backend) for backend in BACKENDS)
    agree(core, reference)


@pytest.mark.parametrize(
    "settings",
    [
        {"soft_light": "SHARED", "reflective_caustics": "OFF"},
        {"soft_light": "DEALT", "diffuse_bounces": 2, "clamp_indirect": 1.0},
        {"soft_light": "RESOLVED", "samples": 4, "visibility_samples": 4},
    ],
    ids=lambda settings: settings["soft_light"],
)
def test_both_tracers_show_the_same_in_mirrors_and_after_bounces(settings: dict) -> None:
    """Also of lamps, which light no mirrors that rays of bounced light meet then."""
    scene = things(
        replace(AREA, light_group=0),
        replace(POINT, light_group=1),
        ball=(BALL, GLASS, placed(0, 0, 0.01)),
        blob=(blob(), MIRROR, placed(-0.6, 0.5, 0.8, 0.3)),
        wall=(quad((-9, 2, -1), (9, 2, -1), (9, 2, 9), (-9, 2, 9)), PANE, placed(0, 0, 0)),
    )
    instances = tuple(replace(thing, visible_camera=True) for thing in scene.instances)
    camera = replace(scene.camera, window=(-1.48, 1.55, -1.09, 1.93))
    scene = replace(scene, camera=camera, instances=instances, light_groups=("a", "b"))
    chosen = {"samples": 1, "diffuse_bounces": 1, "light_samples": 1, "filter_width": 0.0}
    names = "Diffuse", "Diffuse Indirect", "Mirror", "Transmission Indirect"
    chosen |= {"photons": 3000, "passes": frozenset(names), **settings}
    core, reference = (
        render(scene, Settings(backend=backend, **chosen)).passes for backend in BACKENDS
    )
    for name in (*names, "Combined", *map(light_group_pass, scene.light_groups)):
        agree(core[name][..., :3], reference[name][..., :3])


def test_photons_of_each_moment() -> None:
    """A ball of glass and a mirror that slide."""
    scene = things(
        AREA,
        ball=(BALL, GLASS, placed(0, 0, 0)),
        blob=(blob(), MIRROR, placed(0.9, 0.3, 0.5, 0.3)),
    )
    ground, *moving = scene.instances
    ways = [
        np.stack([thing.world_from_object, thing.world_from_object + placed(*way, 0.0)])
        for thing, way in zip(moving, ((0.3, 0.1, 0.0), (0.0, -0.2, 0.2)), strict=True)
    ]
    instances = [replace(thing, motion=way) for thing, way in zip(moving, ways, strict=True)]
    scene = replace(scene, instances=(ground, *instances))
    settings = {"samples": 4, "soft_light": "SHARED", "diffuse_bounces": 1}
    core, reference, none = (
        drawn(scene, 1, photons=photons, backend=backend, **settings)
        for photons, backend in ((3000, "NATIVE"), (3000, "NUMPY"), (0, "NATIVE"))
    )
    agree(core, reference)
    assert (core - none).max() > 0.1 * none.max()


@pytest.mark.parametrize("photons", [0, 3000])
def test_explanations_tell_that_photons_are_not_in_them(photons: int) -> None:
    scene = things(AREA, ball=(BALL, GLASS, placed(0, 0, 0)))
    ray = PixelExplainer(scene, Settings(photons=photons, diffuse_bounces=1)).pixel(2, 4)
    said = sum("what photons bring here" in line for line in explanation_lines(ray))
    assert said == (photons > 0)
