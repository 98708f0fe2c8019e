"""Openings through which rooms see the sky: where they are found, closed forms of their light, one
tracer beside the other, and that they change no mean.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Accelerator, Settings, render
from glint.engine.lights import openings as found_openings
from glint.engine.lights.lit import lit_scene
from glint.engine.lights.openings import opened, openings
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Openings,
    Scene,
    Spheres,
    World,
)
from path_lamps import around

MATT = Material("matt", (Lobe("DIFFUSE", (Input((0.6, 0.6, 0.6)),)),))
GLASS = Material("pane", (Lobe("TRANSPARENT", (Input((0.9, 0.9, 0.9)),)),))
SHINY = Material(
    "shiny",
    (Lobe("DIFFUSE", (Input((0.3,) * 3),)), Lobe("SPECULAR", (Input((0.5,) * 3),), exponent=40.0)),
)
FACES = np.array(
    [
        (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
        (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
    ],
    np.uint32,
)  # fmt: skip
ROOM = (0.0, 5.0), (0.0, 4.0), (0.0, 3.0)
THICK = 0.2
WINDOW = (1.0, 3.0), (0.9, 2.3)
"""Along y and z, in the wall at x = 0."""


def box(x, y, z) -> Mesh:
    corners = [(x[i], y[j], z[k]) for k in (0, 1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return Mesh("box", np.array(corners, np.float32), FACES)


def walls(window=WINDOW) -> list[Mesh]:
    (x0, x1), (y0, y1), (z0, z1) = ROOM
    t = THICK
    around = [
        box((x0 - t, x1 + t), (y0 - t, y1 + t), (z0 - t, z0)),
        box((x0 - t, x1 + t), (y0 - t, y1 + t), (z1, z1 + t)),
        box((x1, x1 + t), (y0 - t, y1 + t), (z0, z1)),
        box((x0 - t, x1), (y0 - t, y0), (z0, z1)),
        box((x0 - t, x1), (y1, y1 + t), (z0, z1)),
    ]
    if window is None:
        return [*around, box((x0 - t, x0), (y0, y1), (z0, z1))]
    (a0, a1), (b0, b1) = window
    return [
        *around,
        box((x0 - t, x0), (y0, a0), (z0, z1)),
        box((x0 - t, x0), (a1, y1), (z0, z1)),
        box((x0 - t, x0), (a0, a1), (z0, b0)),
        box((x0 - t, x0), (a0, a1), (b1, z1)),
    ]


FLOOR = Camera(
    "ORTHOGRAPHIC",
    np.array([[1, 0, 0, 2.5], [0, 1, 0, 2.0], [0, 0, 1, 2.0]]),
    (-2.4, 2.4, -1.9, 1.9),
    (48, 38),
)
"""Looks down on the room's floor from within."""


def sky(radiance=((1.0, 1.0, 1.0),)) -> Light:
    return Light("Sky", "DOME", np.eye(3, 4), radiance=np.array([radiance], np.float32))


def scene(meshes, *, material=MATT, matrix=None, camera=FLOOR, light=None, more=()) -> Scene:
    placed = np.eye(3, 4) if matrix is None else matrix
    things = [*meshes, *(thing for thing, _ in more)]
    numbers = [0] * len(meshes) + [number for _, number in more]
    instances = tuple(
        Instances(f"{k}", k, placed[None], (number,)) for k, number in enumerate(numbers)
    )
    materials = (material, GLASS)
    return Scene(camera, tuple(things), instances, materials, (), (light or sky(),), World())


def turned(angle: float, shift=(0.0, 0.0, 0.0)) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([[c, s, 0], [-s, c, 0], [0, 0, 1], shift])


def check_window(found: Openings, k: int, center, half, normal, slack=0.12) -> None:
    np.testing.assert_allclose(found.normals[k], normal, atol=2e-2)
    off = found.centers[k] - center
    assert abs(off @ np.array(normal)) <= THICK
    sizes = sorted(np.linalg.norm(side[k]) for side in (found.right, found.up))
    np.testing.assert_allclose(sizes, sorted(half), rtol=slack, atol=0.05)
    assert np.linalg.norm(off - off @ np.array(normal) * np.array(normal)) < 0.15


@pytest.mark.parametrize("angle", [0.0, 0.5])
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (3e5, -2e5, 1e4)])
def test_a_window_is_found_wherever_the_room_stands(angle, shift):
    matrix = turned(angle, shift)
    found = openings(scene(walls(), matrix=matrix))
    assert len(found.shares) == 1
    middle = matrix[:, :3] @ (-THICK / 2, 2.0, 1.6) + matrix[:, 3]
    check_window(found, 0, middle, (1.0, 0.7), matrix[:, :3] @ (-1.0, 0.0, 0.0))


def test_a_window_in_a_thick_wall_is_found(monkeypatch):
    """Most lines to the sky begin in its reveals, and see it wide open."""
    monkeypatch.setitem(globals(), "THICK", 0.3)
    found = openings(scene(walls(((1.2, 2.8), (0.9, 2.2)))))
    assert len(found.shares) == 1
    # the plane lies just outside of the wall, where lines from the reveals have spread
    check_window(found, 0, (-0.15, 2.0, 1.55), (0.8, 0.65), (-1.0, 0.0, 0.0), slack=0.25)


def test_panes_of_glass_are_passed():
    pane = box((-0.11, -0.09), (1.0, 3.0), (0.9, 2.3))
    found = openings(scene(walls(), more=[(pane, 1)]))
    assert len(found.shares) == 1
    check_window(found, 0, (-THICK / 2, 2.0, 1.6), (1.0, 0.7), (-1, 0, 0))
    assert openings(scene(walls(), more=[(pane, 0)])) is None


def test_windows_in_two_walls_are_two():
    (x0, x1), (_, y1), (z0, z1) = ROOM
    first = walls()
    second = [
        mesh
        for mesh in first
        if not (mesh.vertices[:, 1].min() == y1 and mesh.vertices[:, 1].max() > y1)
        or mesh.vertices[:, 2].max() != z1
    ]
    assert len(second) == len(first) - 1
    second += [
        box((x0 - THICK, 2.0), (y1, y1 + THICK), (z0, z1)),
        box((3.0, x1), (y1, y1 + THICK), (z0, z1)),
        box((2.0, 3.0), (y1, y1 + THICK), (2.0, z1)),
    ]
    found = openings(scene(second))
    order = np.argsort(found.normals[:, 0])
    assert len(order) == 2
    check_window(found, order[0], (-THICK / 2, 2.0, 1.6), (1.0, 0.7), (-1, 0, 0))
    check_window(found, order[1], (2.5, y1 + THICK / 2, 1.0), (0.5, 1.0), (0, 1, 0))


def test_where_all_is_open_or_closed_there_are_none():
    ball = Spheres("ball", np.array([[2.0, 2.0, 1.0]], np.float32), np.array([0.5], np.float32))
    ground = box((-50.0, 50.0), (-50.0, 50.0), (-1.0, 0.0))
    assert openings(scene([ground, box((0.0, 1.0), (0.0, 1.0), (0.0, 1.0))], more=[(ball, 0)])) is (
        None
    )
    assert openings(scene(walls(window=None))) is None
    assert openings(replace(scene([]), instances=())) is None
    nothing = Mesh("nothing", np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32))
    assert openings(scene([nothing])) is None


def test_points_in_one_place_have_no_planes_across():
    """As where but one of all is enclosed."""
    up = np.tile([[0.0], [0.0], [1.0]], 8)
    with np.errstate(all="raise"):
        assert not found_openings._rectangles(0 * up, up, up)


def test_openings_stay_the_same_objects_while_the_surfaces_do():
    room, light = scene(walls()), sky()
    assert opened(light, room) is opened(light, replace(room, lights=()))


def test_openings_told_in_another_frame_are_as_dense():
    found, eye = openings(scene(walls())), np.array([1.0, -2.0, 0.5])
    axes = turned(0.7)[:, :3]
    x = np.tile([[3.0], [2.0], [1.0]], 3)
    d = np.array([[-1.0, 0.0, 0.1], [-0.6, 0.8, 0.0], [1.0, 0.0, 0.0]]).T
    d = d / np.sqrt((d * d).sum(0))
    known = found_openings.density(found, x, d)
    told = found.told(axes, eye)
    told = found_openings.density(told, axes.T @ (x - eye[:, None]), axes.T @ d)
    np.testing.assert_allclose(told, known, rtol=1e-12)
    assert known[0] > 0


def form_factor(x, y) -> np.ndarray:
    """Of the window, as the floor sees it: the part of the opening that its thickness leaves is
    bounded by its inner edge above and by its outer edge below and at the sides; seen from the
    floor the sill hides what is below the line over its inner edge (integrated densely).
    """
    (a0, a1), (b0, b1) = WINDOW
    n = 600
    v = (np.arange(n) + 0.5) / n
    # points of the outer plane, through which and the inner one each ray has to go
    b = b0 + (b1 + 4.0 - b0) * v
    a = a0 - 1.0 + (a1 - a0 + 2.0) * v
    out_a, out_b = np.meshgrid(a, b, indexing="ij")
    total = np.zeros(np.shape(x))
    for index in np.ndindex(np.shape(x)):
        to = np.stack([np.full_like(out_a, -THICK - x[index]), out_a - y[index], out_b])
        inner = x[index] / (x[index] + THICK)
        ia, ib = y[index] + inner * to[1], inner * to[2]
        good = (
            (ia > a0) & (ia < a1) & (ib > b0) & (ib < b1)
            & (out_a > a0) & (out_a < a1) & (out_b > b0) & (out_b < b1)
        )  # fmt: skip
        d2 = (to * to).sum(0)
        total[index] = (good * -to[0] * to[2] / (np.pi * d2 * d2)).sum()
    return total * (a[1] - a[0]) * (b[1] - b[0])


def floor_light(room: Scene, samples: int, **settings) -> np.ndarray:
    chosen = Settings(**{"samples": samples, "light_samples": 2, "filter_width": 0.0, **settings})
    return render(room, chosen).passes["Combined"][..., 0] / 0.6


def test_a_floor_gets_what_the_window_shows_it_of_the_sky():
    room = scene(walls())
    column, row = np.meshgrid(np.arange(3, 48, 6), np.arange(3, 38, 6))
    x = 2.5 + 4.8 * ((column + 0.5) / 48 - 0.5)
    y = 2.0 + 3.8 * ((row + 0.5) / 38 - 0.5)
    true = form_factor(x, y)
    error = floor_light(room, 64)[row, column] - true
    assert np.abs(error).max() < 0.015 * true.max()
    assert abs(error.mean()) < 0.01 * true.mean()


def test_without_openings_the_same_floor_shows_the_windows_outline():
    """What openings are for: rows of pixels bend a seventh as much."""
    room = scene(walls())
    with_them = floor_light(room, 64)
    lights = lit_scene(room, by_world=True, by_meshes=False).lights
    none = replace(lights[0], openings=NOWHERE)
    without = floor_light(replace(room, lights=(none,)), 64)
    rough = [np.abs(np.diff(image, 2, axis=1)).mean() for image in (with_them, without)]
    assert rough[0] < rough[1] / 7


NOWHERE = Openings(
    np.array([[0.0, 0.0, -1e6]]),
    np.array([[1e-3, 0.0, 0.0]]),
    np.array([[0.0, 1e-3, 0.0]]),
    np.array([[0.0, 0.0, 1.0]]),
    np.array([1.0]),
)


def test_points_in_the_open_get_the_same_mean():
    """Openings that are no edge of anything, in a sky of two colours over a ground with a block."""
    ground = box((-50.0, 50.0), (-50.0, 50.0), (-1.0, 0.0))
    block = box((1.0, 2.0), (1.0, 2.0), (0.0, 2.0))
    colors = ((0.2, 0.4, 1.0), (3.0, 0.5, 0.1), (0.3, 0.3, 0.3), (1.0, 2.0, 0.5))
    light = sky(colors)
    camera = replace(FLOOR, resolution=(24, 19))
    plain = scene([ground, block], material=SHINY, light=light, camera=camera)
    somewhere = Openings(
        np.array([[3.0, 2.0, 3.0], [-2.0, 1.0, 2.0]]),
        np.array([[1.0, 0.0, 0.0], [0.0, 0.7, 0.0]]),
        np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.2]]),
        np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]),
        np.array([0.3, 0.7]),
    )
    through = replace(plain, lights=(replace(light, openings=somewhere),))
    chosen = Settings(samples=1024, light_samples=2, filter_width=0.0)
    a, b = (render(room, chosen).combined[..., :3] for room in (plain, through))
    np.testing.assert_allclose(a.mean((0, 1)), b.mean((0, 1)), rtol=4e-3)
    assert np.abs(a - b).max() < 0.05 * a.max()


@pytest.mark.parametrize("material", [MATT, SHINY])
def test_both_tracers_draw_the_same(material):
    colors = ((0.2, 0.4, 1.0), (3.0, 0.5, 0.1), (0.3, 0.3, 0.3), (1.0, 2.0, 0.5))
    camera = replace(FLOOR, resolution=(24, 19))
    room = scene(walls(), material=material, light=sky(colors), camera=camera)
    chosen = Settings(samples=4, light_samples=2)
    native, exact = (
        render(room, replace(chosen, backend=backend)).combined[..., :3]
        for backend in ("NATIVE", "NUMPY")
    )
    off = np.abs(native - exact).max(-1) / np.maximum(exact.max(-1), 1e-2)
    # a ray that just meets the window's edge is another shadow
    assert np.quantile(off, 0.97) < 1e-4
    assert native.max() > 0.02


def test_regions_and_threads_change_no_bit():
    room = scene(walls(), material=SHINY)
    chosen = Settings(samples=8, light_samples=2, diffuse_bounces=1)
    whole = render(room, replace(chosen, threads=1)).combined
    part = render(room, replace(chosen, threads=3, region=(5, 7, 40, 30))).combined
    np.testing.assert_array_equal(whole[7:30, 5:40], part)


def floor_light_of_paths(room: Scene, bounces: int, count: int) -> tuple[float, float]:
    """The mean of the floor's light over π by paths drawn at random, and its standard error."""
    numbers = np.random.default_rng(3)
    corners = np.concatenate([g.vertices[g.triangles] for g in room.geometries]).astype(float)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    first = np.cumsum([0, *(len(g.triangles) for g in room.geometries)])

    def light(x, n, left) -> np.ndarray:
        u, v = numbers.random((2, len(x)))
        d = around(n.T, np.sqrt(u), v).T
        hits = surfaces.closest(x + 1e-5 * n, d)
        result = np.where(hits.instance < 0, 1.0, 0.0)
        met = np.flatnonzero(hits.instance >= 0)
        if left:
            face = faces[first[hits.instance[met]] + hits.primitive[met]]
            at = x[met] + d[met] * hits.t[met][:, None]
            result[met] = 0.6 * light(at + 1e-5 * face, face, left - 1)
        return result

    u = numbers.random((count, 2))
    x = np.column_stack([0.1 + 4.8 * u[:, 0], 0.1 + 3.8 * u[:, 1], np.zeros(count)])
    up = np.tile([0.0, 0.0, 1.0], (count, 1))
    with Accelerator(room.geometries, room.instances) as surfaces:
        found = light(x, up, bounces)
    return float(found.mean()), float(found.std() / np.sqrt(count))


def test_bounced_light_below_a_window_is_that_of_paths() -> None:
    """Drawn at random."""
    room = scene(walls(), camera=replace(FLOOR, resolution=(24, 19)))
    truth, error = floor_light_of_paths(room, 2, 1 << 19)
    assert error < 0.006 * truth
    many = {"samples": 64, "diffuse_bounces": 2, "soft_light": "DEALT"}
    found, straight = (
        floor_light(room, **many | more).mean() for more in ({}, {"diffuse_bounces": 0})
    )
    assert abs(found - truth) < 4 * error
    assert straight < 0.8 * found


def sunlit(d: np.ndarray) -> Scene:
    """A room under a sun in the direction d and next to no sky, beside wide bright ground."""
    right = np.cross([0.0, 0.0, 1.0], d) / np.linalg.norm(d[:2])
    sun = Light("Sun", "SUN", np.column_stack([right, np.cross(-d, right), -d, np.zeros(3)]))
    up = np.array([[1.0, 0, 0, 2.5], [0, -1, 0, 2.0], [0, 0, -1, 2.0]])
    ground = box((6.0, 80.0), (-40.0, 40.0), (-1.0, -THICK))  # the window does not see it
    room = scene(
        [*walls(), ground],
        camera=Camera("ORTHOGRAPHIC", up, (-2.4, 2.4, -1.9, 1.9), (24, 18)),
        light=sky(((1e-6, 1e-6, 1e-6),)),
    )
    return replace(room, lights=(*room.lights, replace(sun, strength=3.0)))


def off_below_a_ceiling(d: np.ndarray) -> np.ndarray:
    """How far its light is off from a sum over what the sun lights, relative."""
    d = d / np.linalg.norm(d)
    room = sunlit(d)
    chosen = Settings(samples=256, light_samples=2, diffuse_bounces=1, soft_light="DEALT")
    found = render(room, chosen).combined[::-1, :, 0].reshape(9, 2, 12, 2).mean((1, 3))

    # what comes in by the window, as points that throw it on from where it falls
    (y0, y1), (z0, z1) = WINDOW
    u, v = np.stack(np.meshgrid(*[(np.arange(64) + 0.5) / 64] * 2)).reshape(2, -1)
    entry = np.column_stack([np.full(len(u), -THICK), y0 + (y1 - y0) * u, z0 + (z1 - z0) * v])
    flux = 3.0 * d[0] * (y1 - y0) * (z1 - z0) / len(u)
    x, y = np.meshgrid(0.1 + 0.4 * (np.arange(12) + 0.5), 0.1 + 3.8 / 9 * (np.arange(9) + 0.5))
    with Accelerator(room.geometries, room.instances) as surfaces:
        hits = surfaces.closest(entry, np.tile(d, (len(u), 1)))
        start = entry + (hits.t * (1 - 1e-6))[:, None] * d
        corners = [g.vertices[g.triangles].astype(float) for g in room.geometries]
        met = zip(hits.instance.tolist(), hits.primitive.tolist(), strict=True)
        a, b, c = np.array([corners[i][k] for i, k in met]).swapaxes(0, 1)
        n = np.cross(b - a, c - a)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        to = np.stack([x, y, np.full_like(x, 3.0 - 1e-6)], -1)[..., None, :] - start
        far = np.linalg.norm(to, axis=-1)
        rays = np.broadcast_to(start, to.shape).reshape(-1, 3)
        free = surfaces.closest(rays, (to / far[..., None]).reshape(-1, 3)).t.reshape(far.shape)
    given = 0.6 * flux / np.pi * np.maximum((to * n).sum(-1), 0) * to[..., 2] / far**4
    truth = 0.6 / np.pi * (given * (free > 0.9999 * far)).sum(-1)
    return found / truth - 1


def test_a_ceiling_gets_what_a_patch_of_sun_throws_up() -> None:
    """Beside wide bright ground that it does not see."""
    suns = [np.array([1.0, y, -z]) for z in (0.6, 0.7, 0.8) for y in (-0.2, 0.3)]
    off = np.array([off_below_a_ceiling(d) for d in suns])
    assert np.sqrt((off**2).mean()) < 0.1
