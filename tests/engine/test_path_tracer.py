"""The path tracer: closed forms that it must meet, and both tracers beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import (
    ALBEDO,
    HERE,
    VARNISH,
    ball,
    drawn,
    inside,
    lamp,
    matt,
    mixed,
    room,
)
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Medium,
    Mesh,
    Scene,
    World,
)
from path_tracer import trace_paths

NOISE = 5.0
"""Standard errors that a mean of the seeds here is within."""


def is_mean(found: tuple[np.ndarray, np.ndarray], truth, least: float = 1e-9) -> bool:
    """Whether the picture's mean is the truth, but for noise. found: means and standard errors."""
    mean, error = found
    noise = np.sqrt((error**2).sum((0, 1))) / error[..., 0].size
    return bool((np.abs(mean.mean((0, 1)) - truth) <= NOISE * noise + least).all())


def glowing(radiance: float, albedo: float = 0.0) -> Material:
    lobes = Lobe("EMISSION", (Input((radiance,) * 3),)), Lobe("DIFFUSE", (Input((albedo,) * 3),))
    return Material("glow", lobes)


def box(size: float = 1.0) -> Mesh:
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [part for a, b, c, d in quads for part in ((a, b, c), (a, c, d))]
    return Mesh("box", size * np.array(corners, np.float32), np.array(faces, np.uint32))


def quad(name: str, corners) -> Mesh:
    return Mesh(name, np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))


def level(name: str, half: float, z: float) -> Mesh:
    return quad(name, [(x * half, y * half, z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def placed(camera: Camera, *things: tuple, lights=(), **more) -> Scene:
    """things: geometries with their materials."""
    return Scene(
        camera,
        tuple(geometry for geometry, _ in things),
        tuple(Instances(f"{k}", k, HERE[None], (k,)) for k in range(len(things))),
        tuple(material for _, material in things),
        lights=lights,
        **more,
    )


SKY = Light("sky", "DOME", HERE, radiance=np.ones((4, 8, 3), np.float32))
FURNACE = {"lights": (SKY,), "world": World(background=(1.0, 1.0, 1.0))}
GLASS = Material(
    "glass",
    (
        Lobe("MIRROR", ior=1.5, fresnel=True),
        Lobe("REFRACTION", ior=1.5, fresnel=True),
    ),
)
WHITE = {
    "matt": matt((1.0, 1.0, 1.0)),
    "mirror": Material("mirror", (Lobe("MIRROR"),)),
    "clear": Material("clear", (Lobe("TRANSPARENT"),)),
    "glass": GLASS,
    "half": Material("half", tuple(Lobe(k, (Input((0.5,) * 3),)) for k in ("MIRROR", "DIFFUSE"))),
}


@pytest.mark.parametrize("name", WHITE)
def test_white_things_in_a_white_furnace_are_not_seen(name: str) -> None:
    at = inside((0.0, 0.0, 2.5))
    bowl = quad("bowl", [(-1, -1, -1.2), (1, -1, -1.2), (1, 1, -1.2), (-1, 1, -1.2)])
    found = trace_paths(placed(at, (ball(), WHITE[name]), (bowl, WHITE["matt"]), **FURNACE), 32)
    assert is_mean(found, 1.0)
    assert np.abs(found[0] - 1).max() < 0.1


@pytest.mark.parametrize("p", [0.0, 8.0, 200.0])
def test_a_highlight_in_a_furnace_gives_back_its_albedo(p: float) -> None:
    """Seen from straight above: half vectors lean by half of what directions to light do."""
    gloss = Material("gloss", (Lobe("SPECULAR", (Input((0.3,) * 3),), exponent=p),))
    camera = Camera(
        "ORTHOGRAPHIC", np.column_stack([np.eye(3), (0, 0, 1.0)]), (-0.1, 0.1) * 2, (8, 8)
    )
    albedo = 0.3 * 8 / (p + 2) * (1 - 2 ** (-(p + 2) / 2))
    found = trace_paths(placed(camera, (level("floor", 1, 0), gloss), **FURNACE), 64)
    assert is_mean(found, albedo, 1e-6)


@pytest.mark.parametrize("albedo", [0.0, 0.5, 0.9])
def test_a_closed_box_that_glows_is_a_geometric_series(albedo: float) -> None:
    found = trace_paths(placed(inside(), (box(), glowing(2.0, albedo))), 64)
    assert is_mean(found, 2.0 / (1 - albedo))


def test_so_it_is_for_a_few_bounces() -> None:
    found = trace_paths(placed(inside(), (box(), glowing(2.0, 0.5))), 4, bounces=2)
    assert is_mean(found, 2.0 * (1 + 0.5 + 0.25))


def test_two_planes_without_end_light_each_other() -> None:
    planes = (level("floor", 1e5, 0), matt((0.5,) * 3)), (level("roof", 1e5, 1), glowing(1.0, 0.6))
    down = inside((0.0, 0.0, 0.5))
    assert is_mean(trace_paths(placed(down, *planes), 64), 0.5 / (1 - 0.5 * 0.6), 1e-3)


def test_a_square_lights_what_is_below_its_corner() -> None:
    """The form factor of a unit square from an element that faces it a unit below a corner."""
    roof = quad("roof", [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
    down = replace(inside((0.0, 0.0, 0.5)), window=(-1e-3, 1e-3, -1e-3, 1e-3))
    factor = np.sqrt(0.5) * np.arctan(np.sqrt(0.5)) / np.pi
    things = (level("floor", 5, 0), matt((0.5,) * 3)), (roof, glowing(3.0))
    assert is_mean(trace_paths(placed(down, *things), 256), 3 * 0.5 * factor, 1e-3)


LAMPS = {
    "point": (lamp(at=(0.3, 0.2, -0.1)), 100.0),
    "spot": (lamp("SPOT", at=(0.3, 0, 0), spot_size=1.6, spot_blend=0.0), 50 * (1 - np.cos(0.8))),
    "area": (lamp("AREA", at=(0, 0.2, 0), size_x=0.2, size_y=0.1), 100.0),
    "slats": (lamp("AREA", at=(0, 0.2, 0), size_x=0.2, size_y=0.1, spread=1.0), 100.0),
    "disc": (lamp(radius=0.5, soft_falloff=True), 100 / (1 + 0.5**2)),
    "ball": (lamp(radius=0.5), 100.0),
    "ellipse": (lamp("AREA", size_x=0.2, size_y=0.1, shape="ELLIPSE"), 100.0),
}


@pytest.mark.parametrize("name", LAMPS)
def test_a_matt_ball_throws_back_all_that_a_lamp_gives(name: str) -> None:
    light, power = LAMPS[name]
    direct, error = trace_paths(room(light), 64, seed=1, bounces=0)
    found, noise = trace_paths(room(light), 64, bounces=1)
    truth = ALBEDO**2 * power / (4 * np.pi**2)
    assert is_mean((found - direct, np.hypot(error, noise)), truth)


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_a_sun_lights_a_floor_as_if_it_were_in_its_middle(angle: float) -> None:
    down = inside((0.0, 0.0, 0.5))
    sun = lamp("SUN", strength=3.0, angle=angle)
    found = trace_paths(placed(down, (level("floor", 5, 0), matt(ALBEDO)), lights=(sun,)), 16)
    assert is_mean(found, ALBEDO * 3.0 / np.pi)


def test_the_shape_of_a_lamp_is_as_bright_as_its_light_says() -> None:
    """A mirror shows it, and the camera does; as bright as what it gives matt things there."""
    up = replace(inside((0.0, 0.0, 0.0)), window=(-1e-3, 1e-3) * 2)
    panel = {"strength": 5.0, "size_x": 0.5, "size_y": 0.5}
    facing = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, -1]])
    seen = Light("panel", "AREA", facing, visible_camera=True, **panel)
    assert is_mean(trace_paths(placed(up, lights=(seen,)), 1), 5 / (np.pi * 0.25))
    above = Light("panel", "AREA", HERE, visible_mirror=True, **panel)
    mirror = level("floor", 5, -1), WHITE["mirror"]
    assert is_mean(trace_paths(placed(up, mirror, lights=(above,)), 1), 5 / (np.pi * 0.25))


def test_noise_is_as_large_as_it_is_told() -> None:
    scene = room(lamp(radius=0.1))
    means, errors = zip(*(trace_paths(scene, 16, seed=k) for k in range(8)), strict=True)
    spread = np.std(means, axis=0, ddof=1)
    told = np.sqrt(np.mean(np.square(errors), 0))
    assert 0.8 < np.sqrt((spread**2).mean() / (told**2).mean()) < 1.25
    assert (trace_paths(scene, 2, seed=3)[0] == trace_paths(scene, 2, seed=3)[0]).all()


@pytest.mark.parametrize(
    ("scene", "named"),
    [
        (replace(room(), world=World(medium=Medium())), "media"),
        (room(replace(lamp(), receivers=1)), "linked lights"),
        (room(replace(lamp(), lights_gloss=False)), "linked lights"),
        (room(more=(ball(),), materials=(Material("hair", (Lobe("FIBRE_DIFFUSE"),)),)), "FIBRE"),
        (
            room(more=(ball(),), materials=(Material("m", (Lobe("REFRACTION", exponent=9.0),)),)),
            "g",
        ),
    ],
)
def test_what_is_not_followed_is_named(scene: Scene, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        trace_paths(scene, 1)


# --- both tracers beside it


def cornell(size: int = 16) -> Scene:
    """A box of 2 units, open to the camera, with a lamp below its roof and two things in it."""
    white, red, green = (matt(c) for c in ((0.73,) * 3, (0.65, 0.05, 0.05), (0.12, 0.45, 0.15)))
    walls = [
        (quad("floor", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]), white),
        (quad("roof", [(-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2)]), white),
        (quad("back", [(-1, 1, 0), (1, 1, 0), (1, 1, 2), (-1, 1, 2)]), white),
        (quad("left", [(-1, -1, 0), (-1, 1, 0), (-1, 1, 2), (-1, -1, 2)]), red),
        (quad("right", [(1, -1, 0), (1, -1, 2), (1, 1, 2), (1, 1, 0)]), green),
    ]
    at = np.array([[1.0, 0, 0, 0.01], [0, 0, -1, -3.6], [0, 1, 0, 1.02]])
    camera = Camera("PERSPECTIVE", at, (-0.36, 0.36, -0.36, 0.36), (size, size))
    panel = lamp("AREA", at=(0, 0, 1.99), size_x=0.5, size_y=0.5, strength=20.0)
    things = (ball(0.35, (0.4, -0.2, 0.35)), white), (ball(0.3, (-0.4, 0.3, 0.8)), white)
    return placed(camera, *walls, *things, lights=(panel,))


def off(scene: Scene, backend: str, bounces: int, paths: int, **settings) -> tuple[float, float]:
    """By how much a tracer's picture is off: in its mean, and in the root mean square beyond noise,
    as shares of the truth's mean. Both look through the middles of pixels.
    """
    truth, noise = trace_paths(scene, paths, bounces=bounces, filter_width=0.0)
    picture = drawn(scene, bounces, backend, **settings)
    mean, square = truth.mean(), ((picture - truth) ** 2).mean() - (noise**2).mean()
    return abs(picture.mean() / mean - 1), float(np.sqrt(max(square, 0.0)) / mean)


@pytest.mark.parametrize(("backend", "samples"), [("NATIVE", 64), ("NUMPY", 16)])
def test_direct_light_is_that_of_the_tracers(backend: str, samples: int) -> None:
    mean, rms = off(mixed(*VARNISH), backend, 0, 64, samples=samples)
    assert mean < 0.005
    assert rms < 0.01


def test_bounced_light_is_that_of_the_core() -> None:
    """The mean but for four standard errors of this truth, of 0.25 %."""
    mean, rms = off(cornell(), "NATIVE", 4, 256, samples=1024, soft_light="DEALT")
    assert mean < 0.01
    assert rms < 0.04


def two_rooms(size: int = 8) -> Scene:
    """A lamp in one, the camera in the other, where all but what is seen through the door is lit by
    light that has bounced.
    """
    grey = matt((0.7,) * 3)
    hall = replace(box(), vertices=box().vertices * np.float32((2, 1, 1)) + np.float32((0, 0, 1)))
    wall = [
        quad("left", [(0, -1, 0), (0, 0.2, 0), (0, 0.2, 2), (0, -1, 2)]),
        quad("right", [(0, 0.8, 0), (0, 1, 0), (0, 1, 2), (0, 0.8, 2)]),
        quad("above", [(0, 0.2, 1.6), (0, 0.8, 1.6), (0, 0.8, 2), (0, 0.2, 2)]),
    ]
    at = np.array([[0, 0, -1.0, -1.9], [-1, 0, 0, 0.01], [0, 1, 0, 1.02]])
    camera = Camera("PERSPECTIVE", at, (-0.8, 0.8, -0.8, 0.8), (size, size))
    panel = lamp("AREA", at=(1.2, -0.5, 1.99), size_x=0.5, size_y=0.5, strength=20.0)
    return placed(camera, *((part, grey) for part in (hall, *wall)), lights=(panel,))


def test_so_it_is_through_a_door() -> None:
    """The same of 0.7 %."""
    mean, rms = off(two_rooms(), "NATIVE", 4, 1024, samples=1024, soft_light="DEALT")
    assert mean < 0.028
    assert rms < 0.1
