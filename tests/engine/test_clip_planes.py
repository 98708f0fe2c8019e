"""Planes that cut what a camera sees: both tracers against closed forms, and shadows that come from
beyond them.
"""

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Scene, Settings, available_backends, render
from glint.engine.errors import SceneError
from glint.engine.scene import Camera, Instances, Light, Mesh

BACKENDS = available_backends()
SIZE = (40, 30)


def sheets(kind, planes=()):
    """Large squares at depths 2 and 4, the first above y = 0 only; lit from the camera's side."""
    corners = [
        [(-9, 0, -2), (9, 0, -2), (9, 9, -2), (-9, 9, -2)],
        [(-9, -9, -4), (9, -9, -4), (9, 9, -4), (-9, 9, -4)],
    ]
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    meshes = tuple(Mesh(f"{k}", np.array(c, np.float32), triangles) for k, c in enumerate(corners))
    instances = tuple(
        Instances(f"{k}", k, np.eye(4)[None, :3], (), object_index=k + 1) for k in range(2)
    )
    window = (-0.5, 0.5, -0.375, 0.375) if kind == "PERSPECTIVE" else (-2.0, 2.0, -1.5, 1.5)
    camera = Camera(kind, np.eye(4)[:3], window, SIZE, clip_planes=planes)
    return Scene(camera, meshes, instances, lights=(Light("Sun", "SUN", np.eye(4)[:3]),))


def traced(scene, backend):
    return render(
        scene,
        Settings(
            samples=1, backend=backend, threads=1, passes=frozenset({"Depth", "Object Index"})
        ),
    ).passes


def centers(scene):
    left, right, b, t = scene.camera.window
    return np.meshgrid(
        left + (np.arange(SIZE[0]) + 0.5) * (right - left) / SIZE[0],
        b + (np.arange(SIZE[1]) + 0.5) * (t - b) / SIZE[1],
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
def test_a_slanted_plane(kind, backend):
    """Seen where x + 0.5 z >= 1.3: of each sheet the part on that side, in closed form."""
    scene = sheets(kind, ((1.0, 0.0, 0.5, -1.3),))
    u, v = centers(scene)
    scale = (2.0, 4.0) if kind == "PERSPECTIVE" else (1.0, 1.0)
    first, second = ((u * s + 0.5 * z >= 1.3) for s, z in zip(scale, (2.0, 4.0), strict=True))
    expected = np.where((v > 0) & first, 1, np.where(second, 2, 0))
    assert len(np.unique(expected)) == 3
    np.testing.assert_array_equal(traced(scene, backend)["Object Index"][..., 0], expected)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_box_and_a_plane_that_no_ray_crosses(backend):
    between = (
        (0.0, 0.0, 1.0, -3.0),
        (0.0, 0.0, -1.0, 5.0),
        (1.0, 0.0, 0.0, 0.52),
        (-1.0, 0.0, 0.0, 0.52),
    )
    scene = sheets("ORTHOGRAPHIC", between)
    u, _ = centers(scene)
    seen = traced(scene, backend)
    np.testing.assert_array_equal(seen["Object Index"][..., 0], np.where(np.abs(u) <= 0.52, 2, 0))
    assert (seen["Depth"][np.abs(u) <= 0.52] == 4).all()
    nothing = traced(sheets("ORTHOGRAPHIC", ((0.0, 0.0, 0.0, -1.0),)), backend)
    assert not nothing["Object Index"].any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_cut_away_casts_shadows(backend):
    scene = sheets("PERSPECTIVE", ((0.0, 0.0, 1.0, -3.0),))
    _, v = centers(scene)
    behind = traced(scene, backend)["Combined"][..., 0]
    assert (behind[v * 4 < -0.1] > 0.1).all() and (behind[v * 4 > 0.1] < 0.01).all()


def test_planes_that_are_none_are_told():
    camera = sheets("PERSPECTIVE").camera
    for planes, text in (
        (((0.0,) * 4,) * 7, "6 at most"),
        (((0.0, np.nan, 0.0, 1.0),), "clip_planes"),
    ):
        with pytest.raises(SceneError, match=text):
            render(replace(sheets("PERSPECTIVE"), camera=replace(camera, clip_planes=planes)))
