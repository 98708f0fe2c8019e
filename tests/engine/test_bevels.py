"""Nodes that ask for rays: Bevel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import at
from glint.engine import scene as s
from glint.engine.program.graph import Graph
from glint.engine.program.table import BY_NAME
from native_tools import needs_core, square, view_from_above
from ray_node_scenes import BACKENDS, FEW, bevelled, normals_of, shown
from test_occlusion_pass import upright, x_and_y


def edge(up: bool = True) -> s.Mesh:
    """A half plane z = 0, x < 0, and one that falls, or rises, from its end: an endless edge."""
    w, z = 50.0, -50.0 if up else 50.0
    points = [[-w, -w, 0], [0, -w, 0], [0, w, 0], [-w, w, 0], [0, -w, z], [0, w, z]]
    triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    return s.Mesh("edge", np.array(points, np.float32), np.array(triangles, np.uint32))


def bevel_at(away: np.ndarray, radius: float, up: bool = True) -> np.ndarray:
    """(k, 3) normals on the half plane so far from the edge, by a fine grid over both planes."""
    line = (np.arange(400) + 0.5) / 200 - 1
    x, y = radius * np.array(np.meshgrid(line, line))
    top = np.clip(radius - np.hypot(x, y), 0, None) ** 3
    found = []
    for d in away:
        z = np.abs(x)  # each depth twice
        side = np.clip(radius - np.sqrt(d * d + y * y + z * z), 0, None) ** 3
        found.append([side.sum() / 2 * (1 if up else -1), 0, (top * (x < d)).sum()])
    return np.array(found) / np.linalg.norm(found, axis=1, keepdims=True)


def edge_scene(material: s.Material, up: bool = True, **instance) -> s.Scene:
    view = view_from_above(8, 0.25, 1.0)
    view.world_from_camera[0, 3] = -0.25
    block = s.Instances("edge", 0, at(), (0,), **instance)
    return s.Scene(view, (edge(up),), (block,), (material,), world=s.World())


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("up", [True, False])
def test_an_edge_is_round(backend: str, up: bool) -> None:
    """Both ways; pixels are means of unit normals, a little short."""
    found = normals_of(edge_scene(bevelled(0.4, 64), up), backend, samples=16)
    away = 0.25 - x_and_y(0.25)[0][0]
    np.testing.assert_allclose(
        found, np.broadcast_to(bevel_at(away, 0.4, up), found.shape), atol=0.02
    )


@needs_core
def test_more_rays_are_nearer() -> None:
    away = 0.25 - x_and_y(0.25)[0][0]
    truth = bevel_at(away, 0.4)
    errors = [
        np.sqrt(((normals_of(edge_scene(bevelled(0.4, n))) - truth) ** 2).mean())
        for n in (4, 16, 128)
    ]
    assert errors[0] < 0.06 and errors[1] < errors[0] / 2 and errors[2] < errors[1] / 2


@pytest.mark.parametrize("backend", BACKENDS)
def test_where_nothing_is_near_bevels_keep_the_normal(backend: str) -> None:
    for radius in (0.01, 0.0, -1.0, np.nan, np.inf):
        found = normals_of(edge_scene(bevelled(radius)), backend, **FEW)
        np.testing.assert_allclose(
            found[:, :-1], np.broadcast_to([0, 0, 1.0], (8, 7, 3)), atol=1e-6
        )


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ball_stays_one(backend: str) -> None:
    """Its mean normal is its own, from without and within; and so on a mesh's smooth normals."""
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    for height in (4.0, 0.5):
        scene = s.Scene(
            view_from_above(8, 0.4, height),
            (ball,),
            (s.Instances("ball", 0, at(), (0,)),),
            (bevelled(0.3, 128),),
            world=s.World(),
        )
        plain = replace(scene, materials=(shown_normal(),))
        few = {"samples": {"NATIVE": 16, "NUMPY": 2}[backend]}  # of 128 rays each
        apart = normals_of(scene, backend, **few) - normals_of(plain, backend, **few)
        assert np.abs(apart).max() < 0.01


def shown_normal() -> s.Material:
    graph = Graph()
    return shown(graph, graph.apply(BY_NAME["normal"])[0])


@pytest.mark.parametrize("backend", BACKENDS)
def test_others_make_no_edge(backend: str) -> None:
    """Nor do they hide it, wherever they are; what is unseen by other rays has one as well."""
    alone = normals_of(edge_scene(bevelled()), backend, **FEW)
    scene = edge_scene(bevelled(), visible_shadow=False, visible_mirror=False)
    wall = s.Instances("wall", 1, upright(-0.2, 1.0), (0,), visible_camera=False)
    copy = s.Instances("copy", 0, at(), (0,), visible_camera=False)
    for order in (lambda own: (wall, copy, own), lambda own: (own, copy, wall)):
        mixed = replace(
            scene, geometries=(edge(), square(1.0)), instances=order(scene.instances[0])
        )
        np.testing.assert_allclose(normals_of(mixed, backend, **FEW), alone, atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("linear", [np.diag([1, -1, 1.0]), 1e-5, 1e5])
def test_bevels_of_mirrored_tiny_and_huge_things(backend: str, linear) -> None:
    size = linear if np.isscalar(linear) else 1.0
    scene = edge_scene(bevelled(0.4 * size))
    view = view_from_above(8, 0.25 * size, size)
    view.world_from_camera[0, 3] = -0.25 * size
    block = replace(scene.instances[0], world_from_object=at(linear=linear))
    found = normals_of(replace(scene, camera=view, instances=(block,)), backend, **FEW)
    np.testing.assert_allclose(found, normals_of(edge_scene(bevelled()), backend, **FEW), atol=1e-4)
