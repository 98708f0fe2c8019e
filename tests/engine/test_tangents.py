"""Tangents of UV maps: closed forms, and the core's against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine.tangents import tangents, tangents_by_numpy

EITHER = pytest.mark.parametrize("found", [tangents, tangents_by_numpy])


def a_mesh(seed: int) -> dict[str, np.ndarray]:
    """A wavy grid of quads with seams, corners that share all, mirrored and empty parts of the map,
    zeros of both signs, and triangles without a size.
    """
    random, side = np.random.default_rng(seed), 9
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    vertices = np.stack([x, y, random.normal(0, 0.2, x.shape)], -1).reshape(-1, 3)
    first = (x * side + y)[:-1, :-1].ravel()
    quads = np.stack([first, first + side, first + side + 1, first + 1], 1)
    triangles = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    corners = (4 * np.arange(len(quads))[:, None] + [0, 1, 2, 0, 2, 3]).reshape(-1, 3)
    uv = vertices[quads.ravel(), :2] / 8
    uv[: 4 * 20] *= [-1, 1]
    uv[4 * 25 : 4 * 28] = 0
    uv[4 * 28 : 4 * 40] += random.normal(0, 0.1, (48, 2))
    uv[::7] *= -0.0
    vertices[40] = vertices[41]
    smooth = vertices * [0.1, 0.1, 0] + [0, 0, 1]
    normals = smooth[triangles]
    normals[60:] = [0, 0, 1]
    normals /= np.sqrt((normals * normals).sum(-1, keepdims=True))
    return {
        "vertices": vertices.astype(np.float32),
        "triangles": triangles.astype(np.uint32),
        "corners": corners.astype(np.uint32),
        "normals": normals,
        "uv": uv.astype(np.float32),
    }


@pytest.mark.parametrize("seed", range(20))
def test_the_core_s_are_numpy_s_to_the_bit(seed):
    mesh = a_mesh(seed)
    found = tangents(**mesh)
    np.testing.assert_array_equal(found, tangents_by_numpy(**mesh))
    lengths = np.linalg.norm(found[:, :3].astype(float), axis=1)
    assert 0.5 < np.isclose(lengths, 1.0).mean() < 1.0  # where the map is empty there is none
    assert set(found[:, 3]) == {-1.0, 1.0}


@EITHER
def test_tangents_go_where_u_grows(found):
    """Of a square in a plane, whose map is turned by an angle and mirrored or not."""
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    up = np.tile([0.0, 0.0, 1.0], (2, 3, 1))
    for angle, sign in ((0.3, 1.0), (2.0, -1.0)):
        c, s = np.cos(angle), np.sin(angle)
        uv = square[:, :2] @ np.array([[c, -sign * s], [s, sign * c]])
        values = found(square, triangles, triangles, up, uv)
        np.testing.assert_allclose(values, [(c, s, 0.0, sign)] * 4, atol=1e-6)


@EITHER
def test_a_mesh_without_triangles_has_no_tangents(found):
    none = np.zeros((0, 3), int)
    assert found(none, none, none, np.zeros((0, 3, 3)), np.zeros((0, 2))).shape == (0, 4)


@pytest.mark.parametrize("name", ["triangles", "corners"])
def test_rows_that_are_not_there_are_told(name):
    mesh = a_mesh(1)
    mesh[name] = mesh[name] + np.uint32(10**6)
    with pytest.raises(IndexError):
        tangents(**mesh)
