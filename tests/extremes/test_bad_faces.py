"""N6: faces that are none, and numbers that are no places."""

from __future__ import annotations

import re

import numpy as np
import pytest

import extreme_scenes as extreme
import small_scenes as build
from cycles_reference import bpy
from glint.addon.export import export_scene
from glint.engine import Settings, render
from measuring import measure
from truth import true_picture

NAN, INF = float("nan"), float("inf")
FACES = {
    "three times the same point": [(1.0, 1.0, 1.1)] * 3,
    "a point and twice another": [(0.0, 0.0, 1.5), (1.0, 1.0, 1.5), (1.0, 1.0, 1.5)],
    "three points of a line": [(0.0, 0.0, 1.5), (1.0, 1.0, 1.5), (2.0, 2.0, 1.5)],
    "a vertex NaN": [(NAN, 0.0, 1.5), (1.0, 0.0, 1.5), (0.0, 1.0, 1.5)],
    "a vertex +Inf": [(INF, 0.0, 1.5), (1.0, 0.0, 1.5), (0.0, 1.0, 1.5)],
    "a vertex -Inf": [(0.0, -INF, 1.5), (1.0, 0.0, 1.5), (0.0, 1.0, 1.5)],
    "a vertex at 3e38": [(3e38, 1.0, 1.5), (0.0, 0.0, 1.5), (0.0, 1.0, 1.5)],
    "three vertices at ±3e38": [(3e38, 3e38, 1.5), (-3e38, 3e38, 1.5), (0.0, -3e38, 1.5)],
    "denormal coordinates": [(1e-40, 0.0, 0.0), (0.0, 1e-40, 0.0), (0.0, 0.0, 2e-40)],
}
SOUND = {
    "a sliver 1e-7 wide": [(-2.0, 0.0, 1.5), (2.0, 1.3, 1.5), (0.0, 0.65 + 1e-7, 1.5)],
    "the same face again": None,
}


def scene_with(faces):
    """The still life whose ball has these triangles more, on vertices of their own; None: one of
    its own faces again.
    """
    scene = extreme.still_life()
    ball = scene.objects["Ball"]
    points, corners = (
        [v.co[:] for v in ball.data.vertices],
        [p.vertices[:] for p in ball.data.polygons],
    )
    for face in faces:
        corners.append(tuple(range(len(points), len(points) + 3)) if face else corners[0])
        points += face or ()
    ball.data = build.mesh("Bad", points, corners, material=ball.data.materials[0])
    return scene


def left_out() -> int:
    """How many faces the export and the tracer say they have left out."""
    export = export_scene(bpy.context.evaluated_depsgraph_get(), width=16, height=16)
    film = render(export.scene, Settings(samples=1))
    notes = [note for note in (*export.notes, *film.notes) if "left out" in note]
    return sum(int(re.search(r"(\d+) (of its triangles|faces)", note).group(1)) for note in notes)


@pytest.mark.parametrize("name", FACES)
def test_faces_that_are_none(name, rows):
    truth = true_picture(extreme.still_life())
    scene = scene_with([FACES[name]])
    assert left_out() == 1
    assert measure(rows, "N6", name, scene, truth).glint == 0


@pytest.mark.parametrize("name", SOUND)
def test_faces_that_hardly_are(name, rows):
    """Whether they are left out or stay (the tracer's rounding may take a sliver's last extent): no
    pixel's centre sees a difference.
    """
    truth = true_picture(extreme.still_life())
    assert measure(rows, "N6", name, scene_with([SOUND[name]]), truth).glint == 0


def test_all_of_them_many_times(rows):
    truth = true_picture(extreme.still_life())
    scene = scene_with([*FACES.values(), *SOUND.values()] * 50)
    slivers = 50
    assert 0 <= left_out() - 50 * len(FACES) <= slivers
    assert measure(rows, "N6", "all of these, 50 times", scene, truth).glint == 0


def test_smooth_neighbours_of_a_bad_vertex(rows):
    """A vertex becomes NaN in a smooth mesh: its faces go, and the others keep finite normals."""
    scene = extreme.still_life()
    data = scene.objects["Ball"].data
    data.polygons.foreach_set("use_smooth", np.ones(len(data.polygons), bool))
    data.vertices[40].co = (NAN, NAN, NAN)
    data.update()
    film = render(
        export_scene(bpy.context.evaluated_depsgraph_get(), width=64, height=64).scene,
        Settings(samples=1),
    )
    assert np.isfinite(film.combined).all()
    assert film.combined[..., 3].mean() > 0.3
