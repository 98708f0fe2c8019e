"""Motion of objects, shapes and lights: closed forms, one tracer beside the other, the same bits
whatever the work.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import PixelExplainer, SceneError, Settings, render
from glint.engine.sampling import motion as moving
from glint.engine.sampling.motion import (
    Moments,
    between_placements,
    camera_frames,
    moment,
    sample_times,
)
from glint.engine.scene import (
    POINT,
    Attribute,
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Scene,
    Spheres,
    Strands,
)
from glint.engine.scene.problems import scene_problems
from native_tools import assert_instruction_sets_agree

BACKENDS = ("NATIVE", "NUMPY")
SIDE = 48
HERE = np.eye(3, 4)


def placed(x: float = 0.0, y: float = 0.0, z: float = 0.0, linear=None) -> np.ndarray:
    matrix = np.eye(3, 4)
    matrix[:, :3] = np.eye(3) if linear is None else linear
    matrix[:, 3] = x, y, z
    return matrix


def about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def about(axis, angle: float) -> np.ndarray:
    """Rodrigues' formula, by itself."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def glowing(*rgb: float) -> Material:
    return Material("glow", (Lobe("EMISSION", (Input(rgb),)),))


def matt(*rgb: float) -> Material:
    return Material("matt", (Lobe("DIFFUSE", (Input(rgb),)),))


def seen(half: float = 2.0, **more) -> Camera:
    """Looks along -z from 5 above, in parallel; `half` to each side."""
    window = (-half, half, -half, half)
    return Camera("ORTHOGRAPHIC", placed(z=5.0), window, (SIDE, SIDE), 0.01, 100.0, **more)


def square(half: float = 0.5, name: str = "square", z: float = 0.0, **more) -> Mesh:
    corners = [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]]
    rows = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Mesh(name, np.array(corners, np.float32), rows, **more)


def block(number: int, *keys: np.ndarray, at: np.ndarray = HERE, **more) -> Instances:
    motion = np.stack(keys)[:, None] if keys else None
    return Instances(f"thing {number}", number, at[None], (number,), motion=motion, **more)


def picture(wanted: Scene, **settings) -> np.ndarray:
    chosen = {"samples": 8, "filter_width": 0.0, "backend": "NATIVE"} | settings
    return render(wanted, Settings(**chosen)).passes["Combined"][..., :3].astype(np.float64)


def columns() -> np.ndarray:
    """x of the pixels' centres."""
    return -2 + 4 * (np.arange(SIDE) + 0.5) / SIDE


# --- closed forms


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_square_that_slides_leaves_a_ramp(backend):
    """At x a square of half side h that goes evenly from -a to a is there for the share of the time
    in which |x - p| < h.
    """
    keys = [placed(x) for x in (-1.0, 0.0, 1.0)]
    scene = Scene(seen(), (square(),), (block(0, *keys),), (glowing(1.0, 1.0, 1.0),))
    image = picture(scene, samples=64, backend=backend)
    x = columns()
    share = (np.clip(x + 0.5, -1, 1) - np.clip(x - 0.5, -1, 1)) / 2
    # times are even to one of 64 cells: there may be one more or one less at either end
    np.testing.assert_allclose(image[SIDE // 2, :, 0], share, atol=2 / 64)
    assert not image[2].any()


def test_a_bar_that_turns_leaves_rings():
    """A bar of half length l and half width w that turns by a quarter: outside of the ring where it
    is as wide as the angle, a point at distance r is covered while the bar's axis is within
    asin(w / r).
    """
    bar = square()
    bar = replace(bar, vertices=bar.vertices * np.array([3.0, 0.2, 1.0], np.float32))
    keys = [placed(linear=about_z(angle)) for angle in (0.0, np.pi / 4, np.pi / 2)]
    scene = Scene(seen(), (bar,), (block(0, *keys),), (glowing(1.0, 1.0, 1.0),))
    image = picture(scene, samples=256)[..., 0]
    x, y = np.meshgrid(columns(), columns())
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    half = np.arcsin(np.minimum(0.1 / np.maximum(r, 0.1), 1.0))
    inside = (r > 0.3) & (r < 1.4) & (angle > half) & (angle < np.pi / 2 - half)
    assert inside.sum() > 50
    np.testing.assert_allclose(image[inside], (2 * half / (np.pi / 2))[inside], atol=1 / 128)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ball_that_moves_is_there_for_its_share_of_the_time(backend):
    ball = Spheres("ball", np.zeros((1, 3), np.float32), np.array([0.6], np.float32))
    keys = [placed(x) for x in (-1.0, 1.0)]
    scene = Scene(seen(), (ball,), (block(0, *keys),), (glowing(1.0, 1.0, 1.0),))
    image = picture(scene, samples=64, backend=backend)[..., 0]
    x, y = np.meshgrid(columns(), columns())
    reach = np.sqrt(np.maximum(0.36 - y * y, 0.0))
    share = (np.clip(x + reach, -1, 1) - np.clip(x - reach, -1, 1)) / 2
    # times are even to one of 64 cells: there may be one more or one less at either end
    np.testing.assert_allclose(image, share, atol=2 / 64)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_shape_that_widens_goes_straight_from_key_to_key(backend):
    """A square of half side h, linear between keys 0.2, 1 and 0.4: x is covered while h > |x|."""
    still = square(1.0)
    keys = np.stack([still.vertices * h for h in (0.2, 1.0, 0.4)]).astype(np.float32)
    scene = Scene(seen(), (replace(still, motion=keys),), (block(0),), (glowing(1, 1, 1),))
    image = picture(scene, samples=64, backend=backend)[SIDE // 2, :, 0]
    x = np.abs(columns())
    up, down = np.clip((1.0 - x) / 0.8, 0, 1) / 2, np.clip((1.0 - x) / 0.6, 0, 1) / 2
    np.testing.assert_allclose(image, up + down, atol=2 / 64)


def rod(*keys: tuple[float, float], radii=(0.1,), **more) -> Strands:
    """A strand along y, from below the picture to above it, at (x, z) at each key."""
    places = [[[x, y, z] for y in (-3.0, 3.0)] for x, z in keys]
    motion = np.array(places, np.float32)
    thick = np.array([[r, r] for r in radii], np.float32)
    more |= {"motion": motion} if len(keys) > 1 else {}
    more |= {"radius_motion": thick} if len(radii) > 1 else {}
    return Strands("rod", motion[0], thick[0], np.zeros(1, np.uint32), **more)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_strand_that_slides_by_itself_leaves_a_ramp(backend):
    """As the square does, half as wide as its radius."""
    strand = rod((-1.0, 0.0), (0.0, 0.0), (1.0, 0.0), radii=(0.5,))
    scene = Scene(seen(), (strand,), (block(0),), (glowing(1.0, 1.0, 1.0),))
    image = picture(scene, samples=64, backend=backend)
    x = columns()
    share = (np.clip(x + 0.5, -1, 1) - np.clip(x - 0.5, -1, 1)) / 2
    np.testing.assert_allclose(image[SIDE // 2, :, 0], share, atol=2 / 64)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", [Strands, Spheres])
def test_radii_grow_and_shrink(backend, kind):
    """x is covered while r > |x|, r linear between keys 0.2, 1 and 0.4."""
    keys = (0.2, 1.0, 0.4)
    if kind is Strands:
        thing = rod(*[(0.0, 0.0)] * 3, radii=keys)
    else:
        radii, zero = np.array(keys, np.float32)[:, None], np.zeros((3, 1, 3), np.float32)
        thing = Spheres("ball", zero[0], radii[0], motion=zero, radius_motion=radii)
    scene = Scene(seen(), (thing,), (block(0),), (glowing(1, 1, 1),))
    image = picture(scene, samples=64, backend=backend)[SIDE // 2, :, 0]
    x = np.hypot(columns(), 0 if kind is Strands else 2 / SIDE)
    up, down = np.clip((1.0 - x) / 0.8, 0, 1) / 2, np.clip((1.0 - x) / 0.6, 0, 1) / 2
    np.testing.assert_allclose(image, up + down, atol=2 / 64)


@pytest.mark.parametrize("backend", BACKENDS)
def test_points_go_their_own_ways(backend):
    """Two balls of one cloud, one to the right and one to the left."""
    ways = np.array([[[-1, 0.9, 0], [1, -0.9, 0]], [[1, 0.9, 0], [-1, -0.9, 0]]], np.float32)
    cloud = Spheres("cloud", ways[0], np.full(2, 0.6, np.float32), motion=ways)
    scene = Scene(seen(), (cloud,), (block(0),), (glowing(1.0, 1.0, 1.0),))
    image = picture(scene, samples=64, backend=backend)[..., 0]
    x, y = np.meshgrid(columns(), columns())
    reach = np.sqrt(np.maximum(0.36 - (np.abs(y) - 0.9) ** 2, 0.0))
    share = (np.clip(x + reach, -1, 1) - np.clip(x - reach, -1, 1)) / 2
    np.testing.assert_allclose(image, share, atol=2 / 64)


def test_values_of_strands_move_with_them():
    """What a strand glows with goes from red to blue."""
    colors = np.array([[[1, 0, 0, 1]] * 2, [[0, 0, 1, 1]] * 2], np.float32)
    strand = rod((0.0, 0.0), (0.0, 0.0), radii=(0.5,))
    strand = replace(strand, attributes=(Attribute("tint", POINT, colors[0], colors),))
    glow = Material("glow", (Lobe("EMISSION", (Input(attribute="tint"),)),))
    scene = Scene(seen(), (strand,), (block(0),), (glow,))
    for backend in BACKENDS:
        image = picture(scene, samples=64, backend=backend)
        np.testing.assert_allclose(image[SIDE // 2, SIDE // 2], [0.5, 0, 0.5], atol=1 / 64)


def test_shadows_move_with_what_throws_them():
    """A sun from straight above and a card that slides: the floor below is dark for the ramp's
    share of the time.
    """
    card = square(0.5, "card", 1.0)
    keys = [placed(x) for x in (-1.0, 1.0)]
    sun = Light("sun", "SUN", HERE, strength=np.pi)
    floor = square(3.0, "floor")
    moving = block(1, *keys, visible_camera=False)
    materials = (matt(1.0, 1.0, 1.0), matt(0.0, 0.0, 0.0))
    scene = Scene(seen(), (floor, card), (block(0), moving), materials, lights=(sun,))
    image = picture(scene, samples=64)[SIDE // 2, :, 0]
    x = columns()
    share = (np.clip(x + 0.5, -1, 1) - np.clip(x - 0.5, -1, 1)) / 2
    lit = image.max()
    np.testing.assert_allclose(image / lit, 1 - share, atol=2 / 64)


def test_a_camera_that_goes_with_a_thing_sees_it_sharp():
    keys = [placed(x) for x in (-1.0, 0.0, 1.0)]
    views = np.stack([placed(x, z=5.0) for x in (-1.0, 0.0, 1.0)])
    scene = Scene(seen(motion=views), (square(),), (block(0, *keys),), (glowing(1, 1, 1),))
    still = replace(scene, camera=seen(), instances=(block(0),))
    np.testing.assert_array_equal(picture(scene), picture(still))


def test_a_shutter_that_opens_slowly_shows_less_of_the_start():
    """Open in proportion to the time: at time t the share 2t dt of the light comes in."""
    half = square(3.0)  # its right edge goes from -2 to 2
    keys = [placed(x) for x in (-5.0, -1.0)]
    camera = seen(shutter=np.linspace(0.0, 1.0, 257))
    scene = Scene(camera, (half,), (block(0, *keys),), (glowing(1.0, 1.0, 1.0),))
    image = picture(scene, samples=64)[SIDE // 2, :, 0]
    there = (columns() + 2) / 4  # since when
    np.testing.assert_allclose(image, 1 - there**2, atol=2 / 64)


def test_a_camera_that_moves_sees_what_was_not_before_it():
    """A square that the resting camera has beside its picture, in tiles that are empty then."""
    views = np.stack([placed(x, z=5.0) for x in (0.0, 6.0)])
    camera = replace(seen(motion=views), resolution=(256, 256), kind="PERSPECTIVE")
    camera = replace(camera, window=(-0.4, 0.4, -0.4, 0.4))
    still = block(0, at=placed(4.0, 1.2))
    scene = Scene(camera, (square(),), (still,), (glowing(1.0, 1.0, 1.0),))
    native, truth = (picture(scene, samples=4, backend=b) for b in BACKENDS)
    assert truth.any()
    np.testing.assert_allclose(native, truth, atol=1e-6)


# --- the way from one key to the next


@pytest.mark.parametrize("angles", [(0.3, 1.5), (-1.2, -2.2), (3.0, 3.4)])
def test_turns_are_even_and_stretches_straight(angles):
    stretch = np.diag([2.0, 0.5, 1.0]) + 0.1
    turns = [about((1, 2, -0.5), a) for a in angles]
    a, b = (placed(k, -k, 2 * k, turns[k] @ (stretch * (1 + k))) for k in (0, 1))
    for share in (0.0, 0.25, 0.5, 1.0):
        angle = angles[0] + share * (angles[1] - angles[0])
        expected = about((1, 2, -0.5), angle) @ (stretch * (1 + share))
        found = between_placements(a[None], b[None], share)[0]
        np.testing.assert_allclose(found[:, :3], expected, atol=1e-13)
        np.testing.assert_allclose(found[:, 3], share * np.array([1, -1, 2]), atol=1e-15)


@pytest.mark.parametrize("stretch", [(-1.0, 1.0, 1.0), (-1.0, -2.0, -0.5), (1.0, 1.0, 0.0)])
def test_mirrored_and_flat_things_turn_as_bodies(stretch):
    axis = (0.2, 1.0, 0.4)
    a, b = (placed(linear=about(axis, x) @ np.diag(stretch)) for x in (0.0, 1.0))
    found = between_placements(a[None], b[None], 0.5)[0]
    np.testing.assert_allclose(found[:, :3], about(axis, 0.5) @ np.diag(stretch), atol=1e-13)


@pytest.mark.parametrize("dust", [1e-9, -1e-9, 3e-8])
def test_rounding_does_not_turn_flat_things_over(dust):
    axis = (0.2, 1.0, 0.4)
    a, b = (placed(linear=about(axis, x) @ np.diag([1, 2, x * dust - 1e-8])) for x in (0.0, 1.0))
    found = between_placements(a[None], b[None], 0.5)[0]
    np.testing.assert_allclose(found[:, :3], about(axis, 0.5) @ np.diag([1, 2, 0]), atol=1e-7)


def test_what_turns_over_into_its_mirror_image_goes_straight():
    a, b = placed(linear=np.diag([1.0, 1, 1])), placed(linear=np.diag([-1.0, 1, 1]))
    found = between_placements(a[None], b[None], 0.25)[0]
    np.testing.assert_array_equal(found[:, :3], np.diag([0.5, 1, 1]))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_sizes_do_not_matter(scale):
    linear = scale * np.diag([1.0, 1e-3, 1.0])
    a, b = (placed(linear=about((1, 1, 0), x) @ linear) for x in (0.1, 0.9))
    found = between_placements(a[None], b[None], 0.5)[0, :, :3]
    np.testing.assert_allclose(found / scale, about((1, 1, 0), 0.5) @ linear / scale, atol=1e-12)


@pytest.mark.parametrize("nothing", [np.zeros(3), (0, 0, 1e-9), (0, 1.5, 0)])
def test_what_is_nothing_at_a_key_turns_as_at_the_other(nothing):
    """A point or a line, at either end; and both, which go straight."""
    turn = about((1, 2, -0.5), 1.2)
    whole, line = placed(1, 2, 3, turn @ np.diag([2.0, 1, 0.5])), placed(linear=np.diag(nothing))
    for a, b in ((whole, line), (line, whole)):
        found = between_placements(a[None], b[None], 0.25)[0]
        np.testing.assert_allclose(found, a + 0.25 * (b - a), atol=1e-9)
    found = between_placements(line[None], 2 * line[None], 0.5)[0]
    np.testing.assert_allclose(found, 1.5 * line, atol=1e-15)


def test_rows_that_stand_still_keep_their_bits():
    rows = np.stack([placed(0.1, 0.2, 0.3, about((1, 2, 3), 0.7)), placed(linear=about_z(0.2))])
    later = rows.copy()
    later[1, :, :3] = about_z(0.9)
    np.testing.assert_array_equal(between_placements(rows, later, 0.37)[0], rows[0])


# --- one tracer beside the other


def everything(**more) -> Scene:
    """Things that slide, turn, change their shape and are mirrored, a moving lamp, shadows, a
    mirror and glass, seen by a camera that moves too.
    """
    angle = np.linspace(0, 2 * np.pi, 25)[:-1]
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1).astype(np.float32)
    vertices = np.concatenate([[[0, 0, 0.4]], rim * 0.6]).astype(np.float32)
    rows = np.array([[0, k, k % 24 + 1] for k in range(1, 25)], np.uint32)
    normals = vertices + np.array([0, 0, 0.5], np.float32)
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    tall = vertices * np.array([0.7, 0.9, 2.5], np.float32)
    hat = Mesh(
        "hat",
        vertices,
        rows,
        normals=Attribute("normal", POINT, normals),
        motion=np.stack([vertices, tall]),
        normal_motion=np.stack([normals, normals[:, [1, 2, 0]]]),
    )
    ball = Spheres("ball", np.zeros((1, 3), np.float32), np.array([0.5], np.float32))
    bent = np.array([[[x + s * x * z, 0.3 * s, z] for x in (-1.6, 1.6) for z in (0, 0.5, 1)]
                     for s in (-0.2, 0.5)], np.float32)  # fmt: skip
    starts = np.array([0, 1, 3, 4], np.uint32)
    hair = Strands("hair", bent[0], np.full(6, 0.12, np.float32), starts, motion=bent)
    fly = np.array([[[0, -1.2, 0.2], [0.4, -1, 0.4]], [[0.3, -1.1, 0.5], [0, -1, 0.2]]], np.float32)
    cloud = Spheres("cloud", fly[0], np.full(2, 0.2, np.float32), motion=fly)
    geometries = square(3.0, "floor"), hat, ball, square(0.7, "card"), hair, cloud
    tilt = about((1, 0, 0), -1.0)
    instances = (
        block(0),
        block(1, placed(-1, 0, 0.3), placed(-0.8, 0.3, 0.3, about_z(1.0))),
        block(2, *(placed(1.0, x, 0.6, np.diag([1, 1, 1 + x])) for x in (-0.5, 0.0, 0.5))),
        block(3, *(placed(0, 1.2, 0.9, about_z(x) @ tilt @ np.diag([1, -1, 1])) for x in (0, 0.6))),
        replace(block(4), materials=(1,)),
        replace(block(5, placed(), placed(0.2, 0.0, 0.1)), materials=(2,)),
    )
    mirror = Material("mirror", (Lobe("MIRROR", (Input((0.9, 0.8, 0.7)),)),))
    materials = matt(0.7, 0.7, 0.6), matt(0.8, 0.3, 0.2), matt(0.2, 0.5, 0.9), mirror
    frames = [np.concatenate([about((1, 0.2, 0), a), [[x], [0], [4]]], 1) for a, x in
              ((0.2, -1.0), (0.3, 0.0), (0.5, 1.5))]  # fmt: skip
    lamp = Light(
        "lamp", "AREA", frames[0], strength=200.0, size_x=0.8, size_y=0.4, motion=np.stack(frames)
    )
    sun = Light("sun", "SUN", np.concatenate([about((0, 1, 0), 0.6), np.zeros((3, 1))], 1))
    view = placed(0, -3.5, 3.5, about((1, 0, 0), 0.8))
    views = np.stack([view, placed(0.2, -3.4, 3.5, about((1, 0.1, 0), 0.82))])
    camera = Camera(
        "PERSPECTIVE", view, (-0.5, 0.5, -0.5, 0.5), (SIDE, SIDE), 0.01, 100.0, motion=views
    )
    return Scene(camera, geometries, instances, materials, lights=(lamp, replace(sun, **more)))


def agree(scene: Scene, **settings) -> None:
    """Away from edges, of which every sample may have a few pixels."""
    native, truth = (picture(scene, backend=b, **settings) for b in BACKENDS)
    assert truth.std() > 0.01
    off = np.abs(native - truth).max(-1) / max(truth.max(), 1e-9)
    assert np.mean(off > 1e-4) < 0.005
    assert off.mean() < 1e-4


@pytest.mark.parametrize("light_samples", [1, 4])
def test_tracers_agree_on_everything_that_moves(light_samples):
    agree(everything(), samples=6, light_samples=light_samples, max_bounces=2)


def test_tracers_agree_with_glow_and_bounced_light():
    scene = everything()
    glow = Material("glow", (Lobe("EMISSION", (Input((4.0, 3.0, 2.0)),)),))
    scene = replace(scene, materials=(*scene.materials[:2], glow, scene.materials[3]))
    agree(scene, samples=3, light_samples=1, mesh_light="ON", diffuse_bounces=1)


@pytest.mark.parametrize("glows", [True, False])
def test_tracers_agree_on_what_is_nothing_in_the_middle(glows):
    """Of two squares in a block one shrinks to a point and grows again; so does one alone."""
    keys = np.stack([placed(-1, 0, 1, s * about_z(0.3)) for s in (1.0, 0.0, 0.8)])
    rest = np.broadcast_to(placed(1, 0, 1), keys.shape)
    both = np.stack([keys, rest], 1)
    alone = keys + placed(2, 1, 0.5, np.zeros((3, 3)))
    blocks = (
        Instances("two", 0, both[1], (0,), motion=both),
        Instances("one", 0, alone[1][None], (0,), motion=alone[:, None]),
        Instances("floor", 1, placed()[None], (1,)),
    )
    materials = (glowing(3, 2, 1) if glows else matt(0.2, 0.5, 0.8), matt(0.7, 0.7, 0.7))
    sun = Light("sun", "SUN", placed(linear=about((1, 0, 0), 0.4)), strength=2.0)
    scene = Scene(seen(), (square(), square(2.0)), blocks, materials, lights=(sun,))
    settings = Settings(samples=5, diffuse_bounces=1)
    films = [render(scene, replace(settings, backend=name)).combined for name in BACKENDS]
    np.testing.assert_allclose(films[0], films[1], atol=2e-5)
    across = films[0][SIDE // 2, 2 : SIDE // 2, 0]
    assert np.ptp(across) > 0.1


def test_tracers_agree_where_pixels_stop():
    agree(everything(), samples=32, error_threshold=2.0)


def test_data_passes_are_of_the_first_sample():
    passes = frozenset({"Depth", "Normal", "Position", "Object Index"})
    scene = everything()
    scene = replace(
        scene, instances=tuple(replace(b, object_index=k) for k, b in enumerate(scene.instances))
    )
    films = [
        render(scene, Settings(samples=2, filter_width=0.0, passes=passes, backend=b)).passes
        for b in BACKENDS
    ]
    still = moment(scene, sample_times(scene, 2)[0, 0])
    assert sample_times(scene, 2)[0, 0] == 0.5
    for name in passes:
        np.testing.assert_allclose(
            np.median(np.abs(films[0][name] - films[1][name])), 0.0, atol=1e-5
        )
    frame = camera_frames(scene.camera, np.full((4, 1), 0.5))[0, 0]
    seen_then = replace(still, camera=replace(scene.camera, motion=None, world_from_camera=frame))
    index = render(seen_then, Settings(samples=1, passes=passes)).passes["Object Index"]
    np.testing.assert_array_equal(films[0]["Object Index"], index)


# --- the same bits


def test_a_moving_scene_is_the_mean_of_its_moments():
    """Of the tracer that does not know of it, each moment by itself."""
    keys = [placed(x, linear=about_z(x)) for x in (-1.0, 1.0)]
    scene = Scene(seen(), (square(),), (block(0, *keys),), (glowing(1.0, 0.5, 0.25),))
    times = sample_times(scene, 4)[0]
    stills = [picture(moment(scene, t), samples=1) for t in times]
    np.testing.assert_allclose(picture(scene, samples=4), np.mean(stills, 0), atol=1e-6)


@pytest.mark.parametrize("settings", [{"threads": 1}, {"threads": 5}, {"region": (7, 5, 40, 31)}])
def test_threads_and_borders_change_nothing(settings):
    scene, rest = everything(), {"samples": 12, "filter_width": 1.5, "max_bounces": 2}
    whole = render(scene, Settings(**rest)).passes["Combined"]
    x0, y0, x1, y1 = settings.get("region", (0, 0, SIDE, SIDE))
    part = render(scene, Settings(**rest, **settings)).passes["Combined"]
    np.testing.assert_array_equal(part, whole[y0:y1, x0:x1])


def test_looking_on_changes_nothing():
    scene, settings, waves = everything(), Settings(samples=11, max_bounces=1), []
    whole = render(scene, settings).passes["Combined"]
    seen_film = render(scene, settings, on_wave=lambda film: waves.append(film.samples))
    np.testing.assert_array_equal(seen_film.passes["Combined"], whole)
    assert waves == [1, 2, 4, 8, 11]


def test_what_keeps_scenes_draws_the_same():
    """The viewport's tracer, and the one of measurements."""
    from glint.engine.native.live import NativeLive

    scene, settings, films = everything(), Settings(samples=6, max_bounces=1), []
    whole = render(scene, settings).passes["Combined"]
    live = NativeLive()
    np.testing.assert_array_equal(
        live.draw(scene, settings, lambda: False).passes["Combined"], whole
    )
    live.render(scene, settings, True, lambda: False, lambda *found: films.append(found))
    assert [final for _, final in films] == [False, False, False, False, True]
    np.testing.assert_array_equal(films[-1][0].passes["Combined"], whole)


def test_instruction_sets_change_nothing():
    settings = Settings(samples=5, max_bounces=2)
    assert_instruction_sets_agree(
        lambda: render(everything(), settings).passes["Combined"].tobytes()
    )


def test_a_render_can_be_stopped_between_samples():
    asked = []

    def stop() -> bool:
        asked.append(0)
        return len(asked) > 3

    film = render(everything(), Settings(samples=4096), should_stop=stop)
    assert not film.complete


def test_the_feature_is_counted():
    assert render(everything(), Settings()).stats["feature: object motion"] == 1.0
    still = moment(everything(), 0.5)
    assert "feature: object motion" not in render(still, Settings()).stats


def test_what_breaks_on_the_way_is_told_by_name():
    scene = everything()
    hair = scene.geometries[4]
    keys = hair.motion.copy()
    keys[1, 1] = np.nan
    broken = (*scene.geometries[:4], replace(hair, motion=keys), *scene.geometries[5:])
    for backend in BACKENDS:
        film = render(replace(scene, geometries=broken), Settings(backend=backend))
        assert np.isfinite(film.combined).all()
        assert any("thing 4" in note and "left out" in note for note in film.notes), film.notes


def test_a_pixel_is_explained_as_its_first_sample():
    scene = replace(everything(), camera=replace(everything().camera, motion=None))
    times = sample_times(scene, 8)[0]
    told = PixelExplainer(scene, Settings(samples=8)).pixel(24, 24)
    still = PixelExplainer(moment(scene, times[0]), Settings(samples=8)).pixel(24, 24)
    assert told.color == still.color and any(told.color)


# --- at the API boundary


def test_bad_motion_is_refused_by_name():
    mesh = square()
    lamp = Light("lamp", "POINT", HERE, motion=np.stack([HERE, 2 * HERE]))
    bad = {
        "has 1 keys": Scene(seen(), (mesh,), (block(0, HERE),), (matt(1, 1, 1),)),
        "not finite": Scene(seen(), (mesh,), (block(0, HERE, HERE * np.nan),), (matt(1, 1, 1),)),
        "radius_motion is there without": Scene(
            seen(), (rod((0.0, 0.0), radii=(0.1, 0.2)),), (block(0),), (matt(1, 1, 1),)
        ),
        "radius_motion has shape": Scene(
            seen(), (rod((0, 0), (1, 0), radius_motion=np.zeros((2, 3), "f4")),)
        ),
        "motion of attribute 'a' has a value that is not finite": Scene(
            seen(),
            (
                rod(
                    (0.0, 0.0),
                    attributes=(
                        Attribute(
                            "a", POINT, np.zeros((2, 4), "f4"), np.full((2, 2, 4), np.nan, "f4")
                        ),
                    ),
                ),
            ),
        ),
        "has shape (2, 3, 3)": Scene(seen(), (replace(mesh, motion=np.zeros((2, 3, 3), "f4")),)),
        "never open": Scene(seen(shutter=np.zeros(3))),
        "shutter has shape": Scene(seen(shutter=np.ones((2, 2)))),
        "not orthonormal": Scene(seen(), lights=(lamp,)),
        "normal_motion is there without": Scene(
            seen(), (replace(mesh, normal_motion=np.zeros((2, 4, 3), "f4")),)
        ),
    }
    for text, scene in bad.items():
        assert any(text in problem for problem in scene_problems(scene)), (
            text,
            scene_problems(scene),
        )


def test_turns_are_found_once_for_all_times(monkeypatch) -> None:
    """And each time is as if it were the only one."""
    found = []
    turns = moving._turns
    monkeypatch.setattr(moving, "_turns", lambda m: found.append(len(m)) or turns(m))
    stretch = np.diag([1.0, 2.0, 0.5])
    keys = np.stack([placed(k, 2, -k, about_z(1.2 * k) @ (k * stretch)) for k in (1, 2, 3)])
    block = Instances("box", 0, keys[1:2], (), motion=keys[:, None])
    light = Light("lamp", "SUN", keys[1], motion=keys)
    camera = Camera("PERSPECTIVE", placed(z=5), (-1, 1, -1, 1), (4, 4))
    scene = Scene(camera, (), (block,), (), lights=(light,))
    moments = Moments(scene)
    for time in (0.1, 0.4, 0.6, 0.9, 0.2):
        once = len(found)
        one, alone = moments.at(time), moment(scene, time)
        assert len(found) - once == (8 if time in (0.1, 0.6) else 4)
        frames = one.instances[0].world_from_object
        np.testing.assert_array_equal(frames, alone.instances[0].world_from_object)
        np.testing.assert_array_equal(one.lights[0].world_from_light, frames[0])


def test_a_moment_that_begins_to_shine_is_refused(monkeypatch):
    """The film has columns for what glossy things reflect from the start or not at all."""
    slide = block(0, placed(-0.5), placed(0.5))
    scene = Scene(seen(), (square(),), (slide,), (matt(0.5, 0.5, 0.5),))
    gloss = Lobe("SPECULAR", (Input((0.5, 0.5, 0.5)),), exponent=50.0, masking=0.1)
    at, times = Moments.at, []

    def shiny(self: Moments, time: float) -> Scene:
        times.append(time)
        now = at(self, time)
        return replace(now, materials=(Material("shiny", (gloss,)),)) if len(times) > 1 else now

    monkeypatch.setattr(Moments, "at", shiny)
    with pytest.raises(SceneError, match="gloss, AOVs or light groups"):
        render(scene, Settings(samples=4, reflections="ALL", max_bounces=2))
