"""Normals of every kind and instances under odd matrices.

Two habits of Cycles to know. It bakes the matrix of a mesh with a single user into the mesh,
normals included, before it interpolates them, which under a non-uniform scale is not what it gives
for two users; Glint always interpolates in object space. And on a mesh with flat and smooth faces
but no sharp edges it interpolates vertex normals, where Blender's own corner normals, which Glint
takes, split at the flat faces.
"""

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from cycles_reference import bpy
from glint_picture import BACKENDS, check_geometry, check_radiance, interior, render_pair

KEY = (3.0, -3.5, 4.0)


def build_view(use_shadow: bool = False):
    scene = cycles.empty_scene(112, 112)
    build.add_camera(scene)
    build.add_light(scene, "SUN", KEY, energy=2.0, use_shadow=use_shadow)
    return scene


def ball_mixed(with_sharp_edges: bool = True):
    """Smooth, but every third face flat."""
    data = build.ball(24, 14, True, build.lambert((0.6, 0.6, 0.6)))
    flags = np.arange(len(data.polygons)) % 3 != 0
    data.polygons.foreach_set("use_smooth", flags)
    if with_sharp_edges:
        flat = {
            key for polygon in data.polygons if not polygon.use_smooth for key in polygon.edge_keys
        }
        mark_sharp(data, [edge.key in flat for edge in data.edges])
    return data


def mark_sharp(data, flags) -> None:
    data.attributes.new("sharp_edge", "BOOLEAN", "EDGE").data.foreach_set("value", np.array(flags))


def ball_custom():
    """Corner normals of its own: those of a sphere, squeezed and leaning."""
    data = build.ball(24, 14, True, build.lambert((0.6, 0.6, 0.6)))
    points = np.array([data.vertices[loop.vertex_index].co[:] for loop in data.loops])
    normals = points * [1.0, 0.7, 1.3] + [0.15, 0.0, 0.1]
    data.normals_split_custom_set(
        (normals / np.linalg.norm(normals, axis=1, keepdims=True)).tolist()
    )
    return data


def ball_sharp():
    """Smooth with sharp edges along two meridians."""
    data = build.ball(24, 14, True, build.lambert((0.6, 0.6, 0.6)))
    mark_sharp(
        data, [all(abs(data.vertices[v].co.y) < 1e-6 for v in edge.vertices) for edge in data.edges]
    )
    return data


SHAPES = {
    "flat": lambda: build.ball(24, 14, False, build.lambert((0.6, 0.6, 0.6))),
    "smooth": lambda: build.ball(24, 14, True, build.lambert((0.6, 0.6, 0.6))),
    "mixed": ball_mixed,
    "custom": ball_custom,
    "sharp": ball_sharp,
    "ngon": lambda: build.prism(9, build.lambert((0.6, 0.6, 0.6))),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("shape", SHAPES)
def test_normals(shape, backend):
    """Without shadows, whose terminator is a matter of its own."""
    scene = build_view()
    build.add(scene, "Floor", build.plane(5.0, build.lambert((0.8, 0.8, 0.8))))
    build.add(scene, "Shape", SHAPES[shape](), build.moved(0, 0, 1.2, 1.2, 1.2, 1.2))
    pair = render_pair(scene, backend, f"normals-{shape}")
    inside = interior(pair)
    check_geometry(pair, inside)
    check_radiance(pair, inside)


@pytest.mark.parametrize("backend", BACKENDS)
def test_mixed_without_sharp_edges(backend):
    """Glint shows Blender's corner normals: the picture is the one with the flat faces' edges
    marked sharp, and Cycles' is not.

    Blender's mesh says what normal each corner has (`Mesh.corner_normals`), split where a smooth
    face meets a flat one; the viewport and every exporter show those. Cycles interpolates vertex
    normals on smooth faces, which lean on the flat neighbours' normals as well, unless an edge is
    marked sharp. A file looks in Glint as it does in Blender's viewport; marking the edges makes
    Cycles agree.
    """
    pictures = []
    for with_sharp_edges in (True, False):
        scene = build_view()
        build.add(scene, "Floor", build.plane(5.0, build.lambert((0.8, 0.8, 0.8))))
        build.add(scene, "Shape", ball_mixed(with_sharp_edges), build.moved(0, 0, 1.2))
        pictures.append(render_pair(scene, backend, "normals-mixed"))
    marked, unmarked = pictures
    assert np.abs(marked.glint["Normal"] - unmarked.glint["Normal"]).max() < 1e-6
    assert (
        np.abs(unmarked.glint["Normal"] - unmarked.cycles["Normal"])[interior(unmarked)].max()
        > 0.05
    )


def sheared():
    from mathutils import Matrix

    shear = Matrix(((1, 0.7, 0.3, 0), (0, 1, -0.4, 0), (0, 0, 1, 0), (0, 0, 0, 1)))
    return shear @ Matrix.Rotation(0.7, 4, "X")


def turned(*scale):
    from mathutils import Matrix

    return (
        Matrix.Rotation(0.5, 4, "X") @ Matrix.Rotation(0.8, 4, "Z") @ Matrix.Diagonal((*scale, 1.0))
    )


MATRICES = {
    "negative": lambda: turned(-1.0, 1.0, 1.0),
    "all_negative": lambda: turned(-1.0, -1.2, -0.8),
    "non_uniform": lambda: turned(0.3, 1.6, 0.9),
    "thin": lambda: turned(1.2, 1.2, 0.001),
    "sheared": sheared,
    "sheared_negative": lambda: sheared() @ turned(1.0, -1.0, 0.6),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("smooth", [False, True], ids=("flat", "smooth"))
@pytest.mark.parametrize("name", MATRICES)
def test_instances(name, smooth, backend):
    """Two objects that share one mesh; the odd matrix goes through the parent's inverse, where no
    decomposition loses the shear.
    """
    scene = build_view(use_shadow=not smooth)
    shared = build.ball(24, 14, smooth, build.lambert((0.6, 0.4, 0.3)))
    build.add(scene, "Floor", build.plane(5.0, build.lambert((0.8, 0.8, 0.8))))
    build.add(scene, "Plain", shared, build.moved(1.3, 0.9, 1.0, 0.7, 0.7, 0.7))
    odd = build.add(scene, "Odd", shared)
    odd.parent = build.add(scene, "Parent", None, build.moved(-0.7, -0.6, 1.6))
    odd.matrix_parent_inverse = MATRICES[name]()
    pair = render_pair(scene, backend, f"instance-{name}-{'smooth' if smooth else 'flat'}")
    inside = interior(pair)
    check_geometry(pair, inside)
    check_radiance(pair, inside)


@pytest.mark.parametrize("backend", BACKENDS)
def test_smooth_shadow(backend):
    """Smooth balls with shadows. Near the terminator both engines move the shadow ray's origin,
    each by its own rule, so pixels where the sun stands lower than 15° over the shading normal are
    left out.
    """
    scene = build_view(use_shadow=True)
    build.smooth_life(scene)
    pair = render_pair(scene, backend, "normals-smooth-shadow")
    direction = np.array(KEY) / np.linalg.norm(KEY)
    height = np.abs(pair.cycles["Normal"] @ direction)
    inside = interior(pair) & (height > np.sin(np.radians(15)))
    check_geometry(pair, inside)
    check_radiance(pair, inside)


@pytest.mark.parametrize("backend", BACKENDS)
def test_collection_instances(backend):
    """A collection placed twice by empties, once mirrored and scaled: nested instances."""
    scene = build_view(use_shadow=True)
    build.add(scene, "Floor", build.plane(5.0, build.lambert((0.8, 0.8, 0.8))))
    collection = bpy.data.collections.new("Pieces")
    for name, data, place in (
        (
            "Box",
            build.cube(build.lambert((0.7, 0.2, 0.1))),
            build.moved(-0.5, 0, 0.5, 0.4, 0.4, 0.5),
        ),
        (
            "Ball",
            build.ball(16, 10, False, build.lambert((0.1, 0.4, 0.7))),
            build.moved(0.6, 0, 0.6, 0.5, 0.5, 0.6),
        ),
    ):
        item = bpy.data.objects.new(name, data)
        item.matrix_world = place
        collection.objects.link(item)
    for place in (build.moved(-0.6, -0.8, 0.05), build.moved(0.5, 1.0, 0.05, -1.4, 0.8, 1.5)):
        empty = build.add(scene, "Empty", None, place)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
    pair = render_pair(scene, backend, "instance-collection")
    inside = interior(pair)
    check_geometry(pair, inside)
    check_radiance(pair, inside)
