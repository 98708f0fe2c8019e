"""The pass Vector: closed forms, one tracer beside the other, the same bits whatever the work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES, at, ball_mesh, box_mesh, camera, grid_mesh, look_at, surface
from glint import engine
from glint.engine import scene as s
from glint.engine.scene.panorama import Panorama
from glint.engine.scene.problems import scene_problems
from native_tools import draw, needs_core

BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
SIZE = (32, 24)
HALF = 0.4


def facing(distance: float = 5.0, frame: np.ndarray | None = None, **more) -> s.Camera:
    """Looks along -z from `distance` above the origin; at depth 5 a pixel is 0.125 wide."""
    matrix = np.c_[np.eye(3), [0, 0, distance]] if frame is None else frame
    window = (-HALF, HALF, -0.75 * HALF, 0.75 * HALF)
    return s.Camera("PERSPECTIVE", matrix, window, SIZE, **more)


def about_z(angle: float) -> np.ndarray:
    c, n = np.cos(angle), np.sin(angle)
    return np.array([[c, -n, 0], [n, c, 0], [0, 0, 1.0]])


def about_y(angle: float) -> np.ndarray:
    c, n = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, n], [0, 1, 0], [-n, 0, c]])


def plane(view: s.Camera, mesh: s.Mesh | None = None) -> s.Scene:
    """A square of 40 by 40 in z = 0."""
    geometry = grid_mesh(1, 20.0) if mesh is None else mesh
    return s.Scene(view, (geometry,), (s.Instances("plane", 0, at(), (0,)),), (surface(),))


def moved(
    scene: s.Scene, before: np.ndarray, after: np.ndarray, views: tuple = (None, None)
) -> s.Scene:
    """The last of its instances at (1, 3, 4) matrices in the frames before and after, and other
    cameras.
    """
    others = []
    for matrix, view in ((before, views[0]), (after, views[1])):
        last = replace(scene.instances[-1], world_from_object=matrix)
        view = view or scene.camera
        others.append(replace(scene, instances=(*scene.instances[:-1], last), camera=view))
    return replace(scene, neighbours=tuple(others))


def vectors(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    """(h, w, 4)"""
    assert scene_problems(scene) == []
    return draw(scene, "Vector", backend=backend, filter_width=0.0, **settings).passes["Vector"]


def centres() -> np.ndarray:
    """(h, w, 2) where the plane z = 0 is seen from 5 above it."""
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    return np.stack([x - SIZE[0] / 2, y - SIZE[1] / 2], -1) * 0.125


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_flies_by(backend: str) -> None:
    """Two pixels to the right and one up since the frame before, three right and one down to the
    next.
    """
    scene = moved(plane(facing()), at((-0.25, -0.125, 0)), at((0.375, -0.125, 0)))
    found = vectors(scene, backend)
    np.testing.assert_allclose(found, np.broadcast_to([-2, -1, -3, 1], found.shape), atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_comes_nearer(backend: str) -> None:
    found = vectors(moved(plane(facing()), at((0, 0, -1)), at((0, 0, 1))), backend)
    pixels = centres() / 0.125
    np.testing.assert_allclose(found[..., :2], pixels * (5 / 6 - 1), atol=1e-5)
    np.testing.assert_allclose(found[..., 2:], pixels * (1 - 5 / 4), atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_turns(backend: str) -> None:
    scene = moved(plane(facing()), at(linear=about_z(-0.3)), at(linear=about_z(0.5)))
    found, here = vectors(scene, backend), centres()
    before, after = (here @ about_z(angle)[:2, :2].T for angle in (-0.3, 0.5))
    expected = np.concatenate([before - here, here - after], -1) / 0.125
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_camera_that_pans(backend: str) -> None:
    """By 0.1 to the left since the frame before, and then moves on to the right by a pixel."""
    base = plane(facing())
    before = facing(frame=np.c_[about_y(-0.1), [0, 0, 5.0]])
    after = facing(frame=np.c_[np.eye(3), [0.125, 0, 5.0]])
    found = vectors(moved(base, at(), at(), views=(before, after)), backend)
    slope = centres() / 5
    along = np.concatenate([slope, -np.ones((*slope.shape[:2], 1))], -1) @ about_y(-0.1)
    turned = along[..., :2] / -along[..., 2:] * 5
    np.testing.assert_allclose(found[..., :2], (turned - centres()) / 0.125, atol=1e-5)
    np.testing.assert_allclose(found[..., 2:], np.broadcast_to([1, 0], slope.shape), atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_lens_that_zooms_and_shifts(backend: str) -> None:
    base = plane(facing())
    wide = replace(facing(), window=tuple(2 * edge for edge in facing().window))
    left, right, bottom, top = facing().window
    shifted = replace(facing(), window=(left + 0.05, right + 0.05, bottom, top))
    found = vectors(moved(base, at(), at(), views=(wide, shifted)), backend)
    pixels = centres() / 0.125
    np.testing.assert_allclose(found[..., :2], -pixels / 2, atol=1e-5)
    np.testing.assert_allclose(found[..., 2:], np.broadcast_to([2, 0], pixels.shape), atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_parallel_rays(backend: str) -> None:
    half = 2.0
    view = s.Camera("ORTHOGRAPHIC", np.c_[np.eye(3), [0, 0, 5]], (-half, half, -1.5, 1.5), SIZE)
    after = replace(view, world_from_camera=np.c_[np.eye(3), [0.125, 0.25, 9]])
    found = vectors(moved(plane(view), at((0.125, 0, -3)), at(), (None, after)), backend)
    np.testing.assert_allclose(found, np.broadcast_to([1, 0, 1, 2], found.shape), atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_mesh_that_changes_its_shape(backend: str) -> None:
    mesh = grid_mesh(4, 20.0)
    stretched = replace(mesh, vertices=mesh.vertices * np.float32(1.5))
    bent = replace(mesh, vertices=mesh.vertices + np.array([0.25, 0, 0], np.float32))
    scene = plane(facing(), mesh)
    others = (replace(scene, geometries=(g,)) for g in (stretched, bent))
    found = vectors(replace(scene, neighbours=tuple(others)), backend)
    np.testing.assert_allclose(found[..., :2], centres() / 0.125 / 2, atol=1e-5)
    np.testing.assert_allclose(found[..., 2:], np.broadcast_to([-2, 0], (24, 32, 2)), atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_was_behind_the_camera_and_what_is_not_there(backend: str) -> None:
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    scene = s.Scene(facing(), (ball,), (s.Instances("ball", 0, at(), (0,)),), (surface(),))
    found = vectors(moved(scene, at((0, 0, 20)), at((0, 0.5, 0))), backend)
    assert not found[..., :2].any() and not found[0].any()
    assert found[12, 16, 3] < -1


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_first_surface_that_lets_less_than_half_through(backend: str) -> None:
    """A veil of a quarter flies the other way."""
    for through, expected in ((0.75, -2), (0.25, 4)):
        lobe = s.Lobe("TRANSPARENT", (s.Input((through,) * 3),))
        veil = s.Material("veil", (lobe,))
        floor = s.Instances("floor", 0, at(), (0,))
        instances = (floor, s.Instances("veil", 0, at((0, 0, 1), 2.0), (1,)))
        scene = s.Scene(facing(), (grid_mesh(1, 20.0),), instances, (surface(), veil))
        both = [
            replace(
                scene,
                instances=(
                    replace(floor, world_from_object=at((-0.25, 0, 0))),
                    replace(instances[1], world_from_object=at((0.4, 0, 1), 2.0)),
                ),
            )
        ] * 2
        found = vectors(replace(scene, neighbours=tuple(both)), backend)
        np.testing.assert_allclose(found[..., 0], expected, atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_picture_that_goes_all_round(backend: str) -> None:
    """The camera turns by two pixels where its two sides meet."""
    turn = 2 * np.pi / 32
    all_round = Panorama("EQUIRECTANGULAR")
    frame = look_at((0, 0, 0), (0, 1, 0))
    view = s.Camera("PANORAMA", frame, (0, 1, 0, 1), (32, 16), panorama=all_round)
    room = s.Scene(view, (box_mesh(),), (s.Instances("room", 0, at(), (0,)),), (surface(),))
    views = [replace(view, world_from_camera=about_z(a) @ frame) for a in (2 * turn, -turn)]
    found = vectors(moved(room, at(), at(), tuple(views)), backend)
    np.testing.assert_allclose(found, np.broadcast_to([2, 0, 1, 0], found.shape), atol=1e-4)


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_moves(backend: str) -> None:
    scene = plane(facing())
    assert not vectors(scene, backend).any()
    assert not vectors(replace(scene, neighbours=(scene, scene)), backend).any()


def shaken(scene: s.Scene) -> s.Scene:
    """All of it elsewhere in the frames before and after, its meshes bent."""
    dice = np.random.default_rng(7)

    def other() -> s.Scene:
        def bent(g: s.Geometry) -> s.Geometry:
            if not isinstance(g, s.Mesh):
                return g
            jitter = dice.normal(scale=0.05, size=g.vertices.shape)
            return replace(g, vertices=(g.vertices + jitter).astype(np.float32))

        def elsewhere(block: s.Instances) -> s.Instances:
            jitter = dice.normal(scale=0.05, size=block.world_from_object.shape)
            return replace(block, world_from_object=block.world_from_object + jitter)

        return replace(
            scene,
            geometries=tuple(map(bent, scene.geometries)),
            instances=tuple(map(elsewhere, scene.instances)),
        )

    return replace(scene, neighbours=(other(), other()))


@needs_core
@pytest.mark.parametrize("name", sorted(SCENES))
def test_one_tracer_beside_the_other(name: str) -> None:
    scene = shaken(SCENES[name]())
    native, reference = vectors(scene), vectors(scene, "NUMPY")
    difference = np.abs(native - reference) / np.maximum(1, np.abs(reference))
    assert np.isfinite(native).all()
    assert (difference.max(-1) > 1e-4).mean() < 1e-3


@needs_core
def test_a_narrow_view() -> None:
    """Which the core draws in axes of its own."""
    far = facing(5e5)
    view = replace(far, window=tuple(edge * 1e-5 for edge in far.window))
    found = vectors(moved(plane(view), at((-0.25, -0.125, 0)), at((0.375, -0.125, 0))))
    np.testing.assert_allclose(found, np.broadcast_to([-2, -1, -3, 1], found.shape), atol=1e-4)


@needs_core
def test_the_same_bits_whatever_the_work() -> None:
    scene = shaken(SCENES[sorted(SCENES)[0]]())
    width, height = scene.camera.resolution
    whole = vectors(scene)
    assert whole.any()
    np.testing.assert_array_equal(vectors(scene, threads=1), whole)
    np.testing.assert_array_equal(vectors(scene, samples=16), whole)
    region = (width // 4, height // 4, width // 2, height - 3)
    part = whole[region[1] : region[3], region[0] : region[2]]
    np.testing.assert_array_equal(vectors(scene, region=region), part)


@needs_core
def test_the_picture_stays_as_it_is() -> None:
    scene = SCENES[sorted(SCENES)[0]]()
    alone = draw(scene, "Depth").passes
    beside = draw(shaken(scene), "Depth", "Vector").passes
    for name, values in alone.items():
        np.testing.assert_array_equal(values, beside[name])


def test_neighbours_that_are_other_scenes_are_refused() -> None:
    scene = plane(facing())
    mesh, block = ball_mesh(), scene.instances[0]
    nowhere = replace(block, world_from_object=np.full((1, 3, 4), np.nan))
    for other, words in (
        (replace(scene, instances=()), "neighbour has 0 instances"),
        (replace(scene, geometries=(mesh,)), "vertices"),
        (replace(scene, instances=(nowhere,)), "not finite"),
        (replace(scene, instances=(replace(block, geometry=1),)), "another geometry"),
        (replace(scene, camera=camera(kind="ORTHOGRAPHIC")), "use PERSPECTIVE"),
        (replace(scene, camera=replace(facing(), window=(1, 1, 0, 1))), "no area"),
    ):
        found = scene_problems(replace(scene, neighbours=(scene, other)))
        assert len(found) == 1 and words in found[0], found
    [found] = scene_problems(replace(scene, neighbours=(scene,)))
    assert "two scenes" in found
    with pytest.raises(engine.SceneError):
        engine.render(replace(scene, neighbours=(scene,)), engine.Settings())
