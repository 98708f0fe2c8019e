"""The truth about a Blender scene: its float32 numbers as read back, in float64, relative to the
camera, through the float64 tracer.

Nothing here goes through the export. Scenes hold meshes with Diffuse materials, one camera with a
square frame, and one hard light that is a point or a sun; materials are flat colours. Subtracting
the camera's place and dividing by a scale are done in float64, so that the truth about a scene far
away, huge or tiny is traced near the origin at the size of about 1.
"""

from __future__ import annotations

import numpy as np

from cycles_reference import bpy
from glint.engine import Settings, render
from glint.engine import scene as s


def true_picture(scene, scale: float = 1.0, cast_shadow: bool = True) -> np.ndarray:
    """(h, w, 4) float64 of rays through the pixels' centres; alpha 0 where nothing is hit.

    scale: by which all lengths are divided.
    """
    film = render(
        true_scene(scene, scale, cast_shadow), Settings(samples=1, light_samples=1, backend="NUMPY")
    )
    return film.combined.astype(np.float64)


def true_scene(scene, scale: float = 1.0, cast_shadow: bool = True) -> s.Scene:
    """The engine's scene made from Blender's numbers alone."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    things = [item.evaluated_get(depsgraph) for item in scene.objects if not item.hide_render]
    eye = np.array(scene.camera.evaluated_get(depsgraph).matrix_world, np.float64)[:3, 3]
    solids = [thing for thing in things if thing.type == "MESH"]
    instances = tuple(
        s.Instances(thing.name, number, _placement(thing, eye, scale)[None], (number,))
        for number, thing in enumerate(solids)
    )
    lights = tuple(
        _light(thing, eye, scale, cast_shadow) for thing in things if thing.type == "LIGHT"
    )
    return s.Scene(
        camera=_camera(scene, depsgraph, scale),
        geometries=tuple(_mesh(thing.data) for thing in solids),
        instances=instances,
        materials=tuple(_material(thing) for thing in solids),
        lights=lights,
        world=s.World(transparent=True),
    )


def _placement(thing, eye: np.ndarray, scale: float) -> np.ndarray:
    matrix = np.array(thing.matrix_world, np.float64)[:3]
    matrix[:, 3] -= eye
    return matrix / scale


def _axes(thing) -> np.ndarray:
    """(3, 3) the directions of an object's axes, unit length."""
    axes = np.array(thing.matrix_world, np.float64)[:3, :3]
    return axes / np.linalg.norm(axes, axis=0)


def _camera(scene, depsgraph, scale: float) -> s.Camera:
    side = scene.render.resolution_x
    thing = scene.camera.evaluated_get(depsgraph)
    data, orthographic = thing.data, thing.data.type == "ORTHO"
    half = data.ortho_scale / 2 / scale if orthographic else data.sensor_width / 2 / data.lens
    x, y = 2 * half * data.shift_x, 2 * half * data.shift_y
    window = (x - half, x + half, y - half, y + half)
    matrix = np.column_stack([_axes(thing), np.zeros(3)])
    kind = "ORTHOGRAPHIC" if orthographic else "PERSPECTIVE"
    return s.Camera(
        kind, matrix, window, (side, side), data.clip_start / scale, data.clip_end / scale
    )


def _light(thing, eye: np.ndarray, scale: float, cast_shadow: bool) -> s.Light:
    """The axis is the object's −z whatever else the matrix holds; the power of a point goes with
    the square of lengths.
    """
    z = _axes(thing)[:, 2]
    x = np.cross(np.eye(3)[np.abs(z).argmin()], z)
    x /= np.linalg.norm(x)
    place = (np.array(thing.matrix_world, np.float64)[:3, 3] - eye) / scale
    strength = thing.data.energy / (scale**2 if thing.data.type == "POINT" else 1.0)
    frame = np.column_stack([x, np.cross(z, x), z, place])
    return s.Light(
        thing.name,
        thing.data.type,
        frame,
        tuple(thing.data.color),
        strength,
        cast_shadow=cast_shadow,
    )


def _mesh(data) -> s.Mesh:
    """Triangles with Blender's corner normals where any face is smooth."""
    vertices = np.empty(3 * len(data.vertices), np.float32)
    data.attributes["position"].data.foreach_get("vector", vertices)
    triangles = np.array([t.vertices[:] for t in data.loop_triangles], np.uint32).reshape(-1, 3)
    if not any(polygon.use_smooth for polygon in data.polygons):
        return s.Mesh(data.name, vertices.reshape(-1, 3), triangles)
    corners = np.array([t.loops[:] for t in data.loop_triangles], np.uint32).reshape(-1, 3)
    normals = np.array([n.vector[:] for n in data.corner_normals], np.float32)
    return s.Mesh(
        data.name,
        vertices.reshape(-1, 3),
        triangles,
        corners,
        normals=s.Attribute("normal", s.CORNER, normals),
    )


def _material(thing) -> s.Material:
    nodes = thing.material_slots[0].material.node_tree.nodes
    color = (
        next(n for n in nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")
        .inputs["Color"]
        .default_value
    )
    return s.Material(thing.name, (s.Lobe("DIFFUSE", (s.Input(tuple(color[:3])),)),))
