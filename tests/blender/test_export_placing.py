"""Collapsed placements, and a camera that faces nothing."""

import bpy
import numpy as np
import pytest

from export_support import export, scene  # noqa: F401
from glint.addon.export.placing import note_empty_view, shows_a_point, without_collapsed
from glint.addon.export.report import Report
from glint.engine.scene import Camera, Instances, Mesh, Spheres


def cube(scale=(1, 1, 1), location=(0, 0, 0)):
    mesh = bpy.data.meshes.new("cube")
    mesh.from_pydata(
        [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)],
        [],
        [(0, 1, 3, 2), (4, 6, 7, 5)],
    )
    thing = bpy.data.objects.new("cube", mesh)
    thing.scale, thing.location = scale, location
    bpy.context.scene.collection.objects.link(thing)
    return thing


@pytest.mark.parametrize(
    ("scale", "kept"),
    [
        ((1, 1, 1), 1),
        ((1, 1, 0), 1),
        ((1e-6, 1, 1), 1),
        ((0, 1, 0), 0),
        ((0, 0, 0), 0),
        ((3e38, 1, 1), 0),
    ],
)
def test_only_what_has_an_area_stays(scene, scale, kept):  # noqa: F811
    cube(scale)
    found = export()
    assert len(found.scene.instances) == kept
    assert any("leaves no surface" in note and "'cube'" in note for note in found.notes) == (
        not kept
    )


def test_a_sheared_line_is_found_whatever_its_size():
    line = np.outer([1, 2, 3], [4, 5, 6]) * 1e-20
    plane = np.array([[1, 0, 1], [0, 1, 1], [0, 0, 0]]) * 1e20
    matrices = np.concatenate([np.stack([line, plane, np.eye(3) * 1e-12]), np.zeros((3, 3, 1))], 2)
    report = Report()
    (kept,) = without_collapsed((Instances("many", 0, matrices, ()),), report)
    assert np.array_equal(kept.world_from_object, matrices[1:])
    assert len(report.notes()) == 1


@pytest.mark.parametrize(
    ("location", "said"),
    [((0, 0, -5), False), ((0, 0, 5), True), ((100, 0, -5), True), ((0, 0, -1e4), True)],
)
def test_an_empty_view_is_said(scene, location, said):  # noqa: F811
    """The camera of the support scene is moved to the origin; it looks along -z up to its clip
    end.
    """
    scene.camera.location, scene.camera.rotation_euler = (0, 0, 0), (0, 0, 0)
    cube(location=location)
    assert (
        any(f"camera ('{scene.camera.name}') sees no object" in note for note in export().notes)
        == said
    )


def test_spheres_reach_beyond_their_centres():
    camera = Camera("ORTHOGRAPHIC", np.eye(3, 4), (-1, 1, -1, 1), (4, 4))
    for radius, said in ((0.5, True), (1.5, False)):
        report = Report()
        spheres = Spheres(
            "ball", np.array([[2.0, 0, -3]], np.float32), np.array([radius], np.float32)
        )
        note_empty_view(
            camera, (spheres,), (Instances("ball", 0, np.eye(3, 4)[None], ()),), report, "eye"
        )
        assert bool(report.notes()) == said


POINTS = {
    "PERSPECTIVE": [
        ((0.9, 0, -1), True),
        ((1.1, 0, -1), False),
        ((2.7, -1.8, -3), True),
        ((2.7, -2.2, -3), False),
        ((0, 0, 3), False),
        ((0, 0, -0.4), False),
        ((0, 0, -11), False),
        ((np.nan, 0, -1), False),
    ],
    "ORTHOGRAPHIC": [
        ((0.9, 0.6, -3), True),
        ((1.1, 0, -3), False),
        ((0.9, 0.7, -3), False),
        ((0, 0, 3), False),
    ],
}
"""In a window of 2 by 4/3, clipped to depths of 0.5 to 10."""


@pytest.mark.parametrize(
    ("kind", "point", "inside"),
    [(kind, *entry) for kind, entries in POINTS.items() for entry in entries],
)
def test_single_points_are_found_in_the_frame(kind, point, inside):
    """From a camera that is turned, moved and mirrored, of an object that is turned and moved."""
    x, y = np.array([0.6, 0.8, 0]), np.array([-0.8, 0.6, 0])
    turned = np.stack([x, -y, np.array([0, 0, 1.0]), [3, -2, 1]], 1)
    camera = Camera(kind, turned, (1, -1, -2 / 3, 2 / 3), (6, 4), 0.5, 10.0)
    world = turned[:, :3] @ np.array(point) + turned[:, 3]
    placement = np.stack([y, np.array([0, 0, 1.0]), x, [7, 8, 9]], 1)
    vertices = np.array([np.linalg.solve(placement[:, :3], world - placement[:, 3])], np.float32)
    assert (
        shows_a_point(Mesh("point", vertices, np.zeros((1, 3), np.uint32)), placement, camera)
        == inside
    )
