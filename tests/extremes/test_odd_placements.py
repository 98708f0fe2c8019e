"""N7 and N13: objects scaled, squashed, mirrored and sheared, and faces that lie in each other."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

import extreme_scenes as extreme
import small_scenes as build
from glint_picture import render_glint
from measuring import measure
from truth import true_picture

ABOVE, BELOW = (3.0, -4.6, 3.4), (2.0, -3.6, -2.8)


def shear():
    from mathutils import Matrix

    return Matrix(((1, 0.7, 0.3, 0), (0, 1, -0.4, 0), (0, 0, 1, 0), (0, 0, 0, 1)))


def diagonal(*scale):
    from mathutils import Matrix

    return Matrix.Diagonal((*scale, 1.0))


PLACEMENTS = {
    "mesh of 1e-6, object scale 1e6": (lambda: diagonal(1e6, 1e6, 1e6), 1e-6),
    "mesh of 1e6, object scale 1e-6": (lambda: diagonal(1e-6, 1e-6, 1e-6), 1e6),
    "axes scaled 1 : 1e3 : 1e6": (lambda: diagonal(1e-3, 1.0, 1e3), (1e3, 1.0, 1e-3)),
    "mirrored": (lambda: diagonal(-1.0, 1.0, 1.0), 1.0),
    "mirrored on all axes": (lambda: diagonal(-1.0, -1.2, -0.8), 1.0),
    "sheared": (shear, 1.0),
    "sheared and mirrored": (lambda: shear() @ diagonal(1.0, -1.0, 0.6), 1.0),
    "one axis 1e-6": (lambda: diagonal(1.0, 1.0, 1e-6), 1.0),
    "one axis 0": (lambda: diagonal(1.0, 1.0, 0.0), 1.0),
}


def placed_ball(scene, name: str, smooth: bool):
    """A ball of radius about 1, askew, whose mesh undoes the scale where that can be undone."""
    from mathutils import Matrix

    matrix, size = PLACEMENTS[name]
    data = build.ball(18, 12, smooth, build.lambert((0.7, 0.4, 0.3)))
    points = np.array([v.co[:] for v in data.vertices]) * size
    data.vertices.foreach_set("co", points.astype(np.float32).ravel())
    data.update()
    place = (
        Matrix.Translation((0.1, 0.2, 1.2))
        @ Matrix.Rotation(radians(20), 4, "X")
        @ Matrix.Rotation(radians(50), 4, "Z")
    )
    # Cycles bakes the matrix of a mesh with one user into the normals before it interpolates them;
    # a second user, out of sight, prevents that.
    extreme.add_parented(scene, "User", data, Matrix.Translation((0, 0, -900)) @ matrix())
    return extreme.add_parented(scene, "Ball", data, place @ matrix())


ODD = [
    pytest.param(name, smooth, below, marks=[] if smooth != below else pytest.mark.slow)
    for name in PLACEMENTS
    for smooth in (False, True)
    for below in (False, True)
]


@pytest.mark.parametrize(("name", "smooth", "below"), ODD)
def test_odd_matrix(name, smooth, below, rows):
    """N7: over a floor that takes the shadow, under a sun; from below the floor is left out."""
    scene = extreme.new_scene()
    placed_ball(scene, name, smooth)
    if not below:
        build.add(scene, "Floor", build.plane(6.0, extreme.grey()))
    build.add_light(scene, "SUN", (0.4, -0.6, -0.5) if below else (0.4, 0.2, 1.0), energy=2.0)
    build.add_camera(scene, BELOW if below else ABOVE, (0, 0, 1.0))
    # A thin convex thing that stands alone is lit on the whole side that faces the sun.
    truth = true_picture(scene, cast_shadow=not (below and name.startswith("one axis")))
    assert (truth[..., :3].sum(-1) > 0).sum() > 500
    side = "from below" if below else "from above"
    assert (
        measure(rows, "N7", f"{name}, {'smooth' if smooth else 'flat'}, {side}", scene, truth).glint
        == 0
    )


def stack(copies: int, as_objects: bool, floor_last: bool = False):
    """A tilted square over a floor, `copies` times in the same place."""
    scene = extreme.new_scene()
    corners = [(-1.5, -1.2, 1.0), (1.4, -1.3, 1.3), (1.6, 1.5, 1.9), (-1.3, 1.6, 1.6)]
    triangles = [(0, 1, 2), (0, 2, 3)]
    material = build.lambert((0.7, 0.4, 0.3))
    if not floor_last:
        build.add(scene, "Floor", build.plane(6.0, extreme.grey()))
    if as_objects:
        for number in range(copies):
            build.add(
                scene,
                f"Square {number:03d}",
                build.mesh("Square", corners, triangles, material=material),
            )
    else:
        points = [corner for _ in range(copies) for corner in corners]
        faces = [
            tuple(4 * number + k for k in triangle)
            for number in range(copies)
            for triangle in triangles
        ]
        build.add(scene, "Square 000", build.mesh("Squares", points, faces, material=material))
    if floor_last:
        build.add(scene, "Floor", build.plane(6.0, extreme.grey()))
    build.add_light(scene, "SUN", (0.4, 0.2, 1.0), energy=2.0)
    build.add_camera(scene, (4.0, -5.0, 5.0), (0, 0, 0.8))
    return scene


@pytest.mark.parametrize("as_objects", [True, False], ids=["objects", "faces of a mesh"])
@pytest.mark.parametrize("copies", [2, 100])
def test_coincident_faces(copies, as_objects, rows):
    """N13: the truth is the picture of one; the order of the objects changes no bit."""
    truth = true_picture(stack(1, True))
    scene = stack(copies, as_objects, floor_last=True)
    other_order = render_glint(scene, "NATIVE").combined
    scene = stack(copies, as_objects)
    what = "objects" if as_objects else "faces of a mesh"
    assert measure(rows, "N13", f"{copies} {what} in the same place", scene, truth).glint == 0
    assert np.array_equal(render_glint(scene, "NATIVE").combined, other_order)
