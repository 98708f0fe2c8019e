"""The native core at the edges of arithmetic (the acceptance rows of the numerics: translation,
scale, acne, smooth coarse meshes).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import ball_mesh, box_mesh, camera, grid_mesh, look_at, surface
from glint import engine
from glint.engine import scene as s
from glint.engine.native.render import render_native
from native_tools import color, constant, draw, lamp, material, needs_core, placed, square

pytestmark = needs_core

WHITE = material(s.Lobe("DIFFUSE"))


def moved(scene: s.Scene, shift: np.ndarray, scale: float = 1.0) -> s.Scene:
    """The whole world scaled about the origin, then shifted; lights keep the look of the picture
    (energy grows by scale squared).
    """

    def place(matrix: np.ndarray) -> np.ndarray:
        result = np.array(matrix, float)
        result[..., 3] = result[..., 3] * scale + shift
        return result

    def instance(group: s.Instances) -> s.Instances:
        matrix = place(group.world_from_object)
        matrix[..., :3] *= scale
        return replace(group, world_from_object=matrix)

    def light(lit: s.Light) -> s.Light:
        grown = {
            "radius": lit.radius * scale,
            "size_x": lit.size_x * scale,
            "size_y": lit.size_y * scale,
        }
        return replace(
            lit,
            world_from_light=place(lit.world_from_light),
            strength=lit.strength * scale**2,
            **grown,
        )

    view = replace(scene.camera, world_from_camera=place(scene.camera.world_from_camera))
    return replace(
        scene,
        camera=view,
        instances=tuple(map(instance, scene.instances)),
        lights=tuple(map(light, scene.lights)),
    )


def small_world() -> s.Scene:
    """A box and a ball on a floor under a point light and an area light, all sizes about 1."""
    groups = (
        placed(0, (0,)),
        placed(1, (1,), z=0.5, linear=0.5 * np.eye(3)),
        placed(2, (1,), z=1.5, linear=0.5 * np.eye(3)),
    )
    lights = (
        lamp("POINT", (1.5, -1, 3), strength=300.0),
        lamp("AREA", (-1, -1, 3), strength=200.0, size_x=0.5, size_y=0.5),
    )
    materials = (surface("floor", 0.5, ambient=0.4), surface("thing", 0.7, specular=0.5))
    geometries = (grid_mesh(3), box_mesh(), ball_mesh(10))
    return s.Scene(
        camera(size=(48, 36)),
        geometries,
        groups,
        materials,
        (),
        lights,
        s.World((0.1,) * 3, (0.2, 0.3, 0.4)),
    )


def differing(a: np.ndarray, b: np.ndarray) -> int:
    """Pixels that differ by more than 1e-4 relative."""
    return int((np.abs(a - b) > 1e-4 * np.maximum(np.abs(a), np.abs(b))).any(-1).sum())


@pytest.mark.parametrize("exponent", [3, 5, 7])
def test_far_from_the_origin(exponent: int) -> None:
    """N3: doubles hold positions at 1e7 to 2e-9, so the picture is that at the origin."""
    scene = small_world()
    here, there = color(scene), color(moved(scene, 10.0**exponent * np.array([1.0, -0.7, 0.4])))
    assert differing(here, there) == 0


@pytest.mark.parametrize("exponent", [-45, -20, -6, -3, 3, 6, 15, 45])
def test_any_scale(exponent: int) -> None:
    """N5, and well beyond."""
    scene = small_world()
    assert differing(color(scene), color(moved(scene, np.zeros(3), 10.0**exponent))) == 0


def test_scale_by_a_power_of_two_keeps_the_bits() -> None:
    scene = small_world()
    assert np.array_equal(color(scene), color(moved(scene, np.zeros(3), 2.0**20)))


def test_position_and_depth_far_away_are_in_world_units() -> None:
    shift = np.array([4e5, -3e5, 2e5])
    scene = small_world()
    here, there = (draw(v, "Position", "Depth").passes for v in (scene, moved(scene, shift)))
    hit = here["Depth"][..., 0] < 1e9
    assert np.abs(here["Depth"] - there["Depth"])[hit].max() <= 1e-6 * here["Depth"][hit].max()
    assert np.abs((here["Position"] + shift) - there["Position"])[hit].max() <= np.spacing(
        np.float32(4e5)
    )


@pytest.mark.parametrize("shift", [0.0, 1e3, 1e6])
@pytest.mark.parametrize("elevation", [30.0, 60.0, 80.0, 89.5])
@pytest.mark.parametrize("mesh", ["square", "tilted grid", "ball"])
def test_no_acne(mesh: str, elevation: float, shift: float) -> None:
    """N4: what faces the sun is lit, to the last pixel. `elevation` is the angle from the
    zenith.
    """
    geometry = {
        "square": square(3.0),
        "tilted grid": grid_mesh(7, 3.0),
        "ball": ball_mesh(24, smooth=False),
    }[mesh]
    turn = np.eye(3)
    if mesh == "tilted grid":
        turn = np.linalg.qr(np.array([[1.0, 0.1, 0.2], [-0.1, 1, 0.13], [-0.2, -0.1, 1]]))[0]
        turn = turn * np.sign(np.diag(turn))
    angle = np.radians(elevation)
    axes = np.column_stack(
        [(0, 1, 0), (-np.cos(angle), 0, np.sin(angle)), (np.sin(angle), 0, np.cos(angle))]
    )
    sun = lamp("SUN", axes=axes, strength=np.pi)
    scene = s.Scene(
        camera((0.7, -3.1, 2.3), (0, 0, 0), size=(64, 48)),
        (geometry,),
        (placed(linear=turn),),
        (WHITE,),
        (),
        (sun,),
    )
    scene = moved(scene, np.array([shift, -0.3 * shift, 0.2 * shift]))
    film = draw(scene, "Normal", "Depth")
    hit = film.passes["Depth"][..., 0] < 1e9
    cosine = film.passes["Normal"] @ axes[:, 2]
    assert hit.any()
    facing = hit & (cosine > 1e-6)
    assert np.abs(film.combined[..., 0] - cosine)[facing].max() <= 1e-6
    assert film.combined[..., 0][hit & (cosine < -1e-6)].max(initial=0) == 0


@pytest.mark.parametrize("rings", [5, 8, 16])
def test_smooth_coarse_balls_do_not_shadow_themselves(rings: int) -> None:
    """N11: with the shadow start moved to the tangent planes, every point whose shading and true
    normal see the sun is lit.
    """
    sun = lamp("SUN", axes=look_at((3, -2, 1.5), (0, 0, 0))[:, :3], strength=np.pi)
    scene = s.Scene(
        camera((0, -4, 1.0), (0, 0, 0), size=(64, 64)),
        (ball_mesh(rings),),
        (placed(),),
        (WHITE,),
        (),
        (sun,),
    )
    film = draw(scene, "Normal", "Shadow", "Diffuse")
    # a lifted start lies outside of the convex mesh and the tangent plane there is its surface:
    # blocked only where n.l is close to 0.
    lit = film.passes["Diffuse"][..., 0] > 0.25
    assert lit.sum() > 100
    assert film.passes["Shadow"][lit].min() == 0


def test_grazing_sun_keeps_its_cosine() -> None:
    """N8: to 89.9999 degrees."""
    for degrees in (89.0, 89.9, 89.999, 89.9999):
        angle = np.radians(degrees)
        axes = np.column_stack(
            [(0, 1, 0), (-np.cos(angle), 0, np.sin(angle)), (np.sin(angle), 0, np.cos(angle))]
        )
        scene = s.Scene(
            camera(size=(8, 8)),
            (square(100.0),),
            (placed(),),
            (WHITE,),
            (),
            (lamp("SUN", axes=axes, strength=np.pi),),
        )
        assert np.abs(color(scene) / np.cos(angle) - 1).max() <= 1e-6


def test_coincident_faces_are_lit_as_one() -> None:
    """N13: 2 or 100 of them, in any order; a coincident veil is one veil."""
    sun = lamp("SUN", strength=np.pi)
    one = s.Scene(camera(size=(16, 16)), (square(9.0),), (placed(),), (WHITE,), (), (sun,))
    for copies in (2, 100):
        many = s.Instances("many", 0, np.repeat(placed().world_from_object, copies, 0), (0,))
        assert np.array_equal(color(replace(one, instances=(many,))), color(one))
    veil = material(s.Lobe("TRANSPARENT", constant(0.5)))
    over = placed(0, (1,), z=1.0)
    veiled = replace(one, materials=(WHITE, veil), instances=(placed(), over))
    twice = replace(veiled, instances=(over, placed(), over))
    assert np.array_equal(color(veiled), color(twice))


def test_closed_box_keeps_light_out() -> None:
    """N10: a lamp inside a box that stands in the floor lights nothing outside."""
    for sunk in (0.0, 1e-7, 0.3):
        box = placed(1, (0,), z=0.5 - sunk, linear=0.5 * np.eye(3))
        light = lamp("POINT", (0, 0, 0.6), strength=100.0)
        scene = s.Scene(
            camera(size=(48, 36)),
            (square(9.0), box_mesh()),
            (placed(), box),
            (WHITE,),
            (),
            (light,),
        )
        assert color(scene).max() == 0


@pytest.mark.parametrize("field_of_view", [0.01, 1.0, 120.0, 179.9])
def test_field_of_view(field_of_view: float) -> None:
    """N12: a wall that fills the view is where it should be."""
    half = np.tan(np.radians(field_of_view / 2))
    view = s.Camera(
        "PERSPECTIVE", np.column_stack([np.eye(3), (0, 0, 2)]), (-half, half, -half, half), (9, 9)
    )
    film = draw(
        s.Scene(view, (square(2.0 ** np.ceil(np.log2(4 * half + 4))),), (placed(),), (WHITE,)),
        "Position",
        "Depth",
    )
    line = 2 * half * ((2 * np.arange(9) + 1) / 9 - 1)
    x, y = np.meshgrid(line, line)
    assert np.abs(film.passes["Depth"] - 2).max() <= 2 * 2.0**-23
    assert np.abs(film.passes["Position"] - np.stack([x, y, 0 * x], -1)).max() <= 2.0**-23 * max(
        2 * half, 1e-3
    )


def test_mirrored_and_scaled_cameras() -> None:
    scene = small_world()
    plain = color(scene)
    matrix = scene.camera.world_from_camera.copy()
    matrix[:, 0] *= -1
    assert (
        differing(
            color(replace(scene, camera=replace(scene.camera, world_from_camera=matrix)))[:, ::-1],
            plain,
        )
        == 0
    )
    matrix = scene.camera.world_from_camera.copy()
    matrix[:, :3] *= 1e-4
    assert (
        differing(
            color(replace(scene, camera=replace(scene.camera, world_from_camera=matrix))), plain
        )
        == 0
    )


def test_non_finite_colours_never_reach_a_pixel() -> None:
    """Past Python's checks: NaN in an input, an attribute and a float texture read as 0."""
    pixels = np.full((2, 2, 4), np.nan, np.float32)
    base = square(100.0)
    paint = s.Attribute("paint", s.FACE, np.full((2, 4), np.inf, np.float32))
    mesh = s.Mesh("m", base.vertices, base.triangles, attributes=(*base.attributes, paint))
    factors = (s.Input((np.nan, 1.0, 1.0)), s.Input(texture=0), s.Input(attribute="paint"))
    lobes = tuple(s.Lobe("EMISSION", (factor,)) for factor in factors)
    scene = s.Scene(
        camera(size=(8, 8)), (mesh,), (placed(),), (material(*lobes),), (s.Texture("t", pixels),)
    )
    film = render_native(scene, engine.Settings(samples=1))
    assert np.array_equal(film.combined[..., :3], np.broadcast_to(np.float32([0, 1, 1]), (8, 8, 3)))
