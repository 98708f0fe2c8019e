"""Evaluated Blender meshes to `engine.scene.Mesh`, by the attribute arrays that Blender hands out
without converting.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ....engine.scene import CORNER, FACE, POINT, Attribute, Mesh
from ....engine.tangents import tangents
from ..materials.required import RequiredAttributes
from ..materials.terms import GREY
from ..report import Report
from ..shader_nodes.inputs import ACTIVE_COLOR
from ..shader_nodes.reader import (
    GENERATED,
    ISLAND,
    LACKS,
    POINTINESS,
    TANGENT,
    UNDISPLACED,
    UNDISPLACED_NORMAL,
    UNDISPLACED_TANGENT,
)
from .islands import as_four, edges_of, islands, pointiness

_DOMAINS = {"POINT": POINT, "EDGE": POINT, "CORNER": CORNER, "FACE": FACE}
_COLUMNS = {
    "FLOAT": ("value", 1),
    "INT": ("value", 1),
    "INT8": ("value", 1),
    "BOOLEAN": ("value", 1),
    "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3),
    "BYTE_COLOR": ("color", 4),
    "FLOAT_COLOR": ("color", 4),
    "QUATERNION": ("value", 4),
}
_DTYPES = {"INT": np.int32, "INT8": np.int8, "BOOLEAN": np.bool_}
_GATHERED = 1 << 18
"""Corners whose vertices are looked up at once: NumPy widens indices to 64 bits, and so many stay
in the cache.
"""
_LARGEST = float(np.finfo(np.float32).max)
_FARTHEST = 1e19
"""Coordinates beyond it count as not finite: single precision cannot hold their squares, so that
Blender has no normals for such faces.
"""


@dataclass
class MeshSource:
    """A mesh while its instances are being collected: arrays taken when it was first met,
    attributes as materials ask for them.

    kept: (n,) bool, the triangles of Blender's that are left, None for all.  faces, corners: of the
    kept ones, once something reads them. used_slots: the material slots that some triangle names,
    ascending. rest, displaced: the mesh before its materials displaced it, and how they did; None
    where they do not.
    """

    mesh: Mesh
    kept: np.ndarray | None
    faces: np.ndarray | None = None
    corners: np.ndarray | None = None
    used_slots: tuple[int, ...] = (0,)
    uv_maps: dict[str, Attribute] = field(default_factory=dict)
    attributes: dict[str, Attribute] = field(default_factory=dict)
    rest: Mesh | None = None
    displaced: Any = None

    def finished(self) -> Mesh:
        """The mesh with the attributes it was asked for, each once, the active UV map first."""
        by_name = {
            attribute.name: attribute
            for attribute in (*self.attributes.values(), *self.uv_maps.values())
        }
        maps = {attribute.name: attribute for attribute in self.uv_maps.values()}
        attributes = tuple({**maps, **by_name}.values())
        return replace(self.mesh, corners=self.corners, attributes=attributes)


def mesh_key(mesh: Any) -> tuple:
    """Tells evaluated meshes apart: by address, size and where the vertices lie, so that a
    temporary mesh at the address of an earlier one is not taken for it.
    """
    if mesh.is_editmode or len(mesh.vertices) == 0:
        return (mesh.as_pointer(), mesh.name)
    return (
        mesh.as_pointer(),
        mesh.name,
        mesh.vertices[0].as_pointer(),
        len(mesh.vertices),
        len(mesh.loops),
    )


@contextmanager
def readable(mesh: Any, owner: Any) -> Iterator[Any]:
    """The mesh with its arrays in place: in edit mode they live in the editor, and its object makes
    a copy, as for Cycles.
    """
    if not mesh.is_editmode:
        yield mesh
        return
    try:
        yield owner.to_mesh()
    finally:
        owner.to_mesh_clear()


def read_mesh(mesh: Any, report: Report) -> MeshSource | None:
    """Triangles, slots and normals of an evaluated mesh; None without faces. Its name goes into
    notes.
    """
    if len(mesh.polygons) == 0 or len(mesh.vertices) == 0:
        return None
    vertices = vertices_of(mesh)
    triangles = _triangles(mesh)
    kept = _finite_triangles(mesh.name, vertices, triangles, report)
    triangles = triangles if kept is None else triangles[kept]
    if len(triangles) == 0:
        return None
    if kept is not None:  # what no triangle has left counts for nothing, the mesh's extent too
        vertices[~_is_near(vertices)] = vertices[triangles[0, 0]]
    source = MeshSource(Mesh(mesh.name, vertices, triangles), kept)
    slots = _material_slots(mesh, source)
    source.mesh = replace(source.mesh, material_slots=slots, normals=_normals(mesh, source))
    if slots is not None:
        source.used_slots = _used(slots)
    return source


def read_attributes(
    mesh: Any, source: MeshSource, required: RequiredAttributes, report: Report
) -> None:
    """Add what `required` names and `source` lacks. Names that the mesh lacks are left out: they
    read as 0.
    """
    for name in sorted(required.uv_maps - source.uv_maps.keys()):
        _read_uv_map(mesh, source, name, report)
    for name in sorted(required.attributes - source.attributes.keys()):
        attribute = _color_attribute(mesh, source, name, report)
        if attribute is not None:
            source.attributes[name] = attribute


def vertices_of(mesh: Any) -> np.ndarray:
    """(n, 3) float32, object space."""
    return _array(mesh.attributes["position"].data, "vector", len(mesh.vertices), 3)


def _array(data: Any, what: str, count: int, columns: int, dtype: Any = np.float32) -> np.ndarray:
    """(count, columns) values of an attribute; the dtype must be Blender's own or it converts one
    by one.
    """
    values = np.empty((count, columns), dtype)
    data.foreach_get(what, values.reshape(-1))
    return values


def _triangles(mesh: Any) -> np.ndarray:
    """(n, 3) uint32: the vertices of Blender's triangulation."""
    corner_vertices = _array(
        mesh.attributes[".corner_vert"].data, "value", len(mesh.loops), 1, np.int32
    ).view(np.uint32)[:, 0]
    if _is_triangulated(mesh):
        return corner_vertices.reshape(-1, 3)
    return _looked_up(corner_vertices, _triangle_corners(mesh))


def _is_triangulated(mesh: Any) -> bool:
    """Whether every polygon is a triangle: then the triangles' corners are the mesh's, in order."""
    return len(mesh.loops) == 3 * len(mesh.polygons) and len(mesh.loop_triangles) == len(
        mesh.polygons
    )


def _triangle_corners(mesh: Any) -> np.ndarray:
    """(n, 3) uint32 corners of Blender's triangulation. Into uint32, for which Blender copies
    without converting.
    """
    if _is_triangulated(mesh):
        return np.arange(len(mesh.loops), dtype=np.uint32).reshape(-1, 3)
    return _array(mesh.loop_triangles, "loops", len(mesh.loop_triangles), 3, np.uint32)


def _looked_up(table: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """table[indices] in the memory of `indices`, both uint32; takes half the time of that
    expression.
    """
    flat = indices.reshape(-1)
    wide = np.empty(min(_GATHERED, len(flat)), np.intp)
    for start in range(0, len(flat), _GATHERED):
        part = flat[start : start + _GATHERED]
        wide[: len(part)] = part
        # Blender's corners are in range; only with "clip" does NumPy write without a buffer in
        # between.
        np.take(table, wide[: len(part)], out=part, mode="clip")
    return indices


def _read_corners(mesh: Any, source: MeshSource) -> None:
    """Give `source` its corners: something on the corners of the mesh is about to be read."""
    if source.corners is None:
        corners = _triangle_corners(mesh)
        source.corners = corners if source.kept is None else corners[source.kept]


def _triangle_faces(mesh: Any, source: MeshSource) -> np.ndarray:
    """(n,) int32: the polygon of each kept triangle."""
    if source.faces is None:
        faces = _array(
            mesh.loop_triangle_polygons, "value", len(mesh.loop_triangle_polygons), 1, np.int32
        )[:, 0]
        source.faces = faces if source.kept is None else faces[source.kept]
    return source.faces


def _finite_triangles(
    name: str, vertices: np.ndarray, triangles: np.ndarray, report: Report
) -> np.ndarray | None:
    """(n,) bool: the triangles whose vertices are finite, or None when all are."""
    if _all_finite(vertices, _FARTHEST):
        return None
    kept = _is_near(vertices)[triangles].all(1)
    lost = int(len(kept) - kept.sum())
    if lost:
        report.note(
            f"Mesh '{name}' has vertices that are not finite or beyond 1e19: {lost} of its "
            "triangles are left out; repair them"
        )
    return kept


def _is_near(vertices: np.ndarray) -> np.ndarray:
    """(v,) bool: those that triangles may have."""
    with np.errstate(invalid="ignore"):
        return (np.abs(vertices) <= _FARTHEST).all(1)


def _material_slots(mesh: Any, source: MeshSource) -> np.ndarray | None:
    attribute = mesh.attributes.get("material_index")
    if attribute is None or attribute.domain != "FACE":
        return None
    slots = _array(attribute.data, "value", len(mesh.polygons), 1, np.int32)[:, 0]
    if not slots.any():
        return None
    return np.clip(slots, 0, 65535).astype(np.uint16)[_triangle_faces(mesh, source)]


def _used(slots: np.ndarray) -> tuple[int, ...]:
    seen = np.zeros(1 << 16, bool)
    seen[slots] = True
    return tuple(np.flatnonzero(seen).tolist())


def _normals(mesh: Any, source: MeshSource) -> Attribute | None:
    """Shading normals on the coarsest domain that holds them; None for flat meshes."""
    found = normals_of(mesh)
    if found is None:
        return None
    if found[0] == CORNER:
        _read_corners(mesh, source)
    return Attribute("normal", *found)


def normals_of(mesh: Any) -> tuple[str, np.ndarray] | None:
    """The domain that they are on and (n, 3) float32; None for flat meshes."""
    if mesh.normals_domain == "FACE":
        return None
    normals, domain, count = (
        (mesh.vertex_normals, POINT, len(mesh.vertices))
        if mesh.normals_domain == "POINT"
        else (mesh.corner_normals, CORNER, len(mesh.loops))
    )
    return domain, _finite(_array(normals, "vector", count, 3))


def vertex_normals_of(mesh: Any) -> np.ndarray:
    """(v, 3) float32."""
    return _finite(_array(mesh.vertex_normals, "vector", len(mesh.vertices), 3))


def flat_polygons(mesh: Any, source: MeshSource) -> np.ndarray | None:
    """(n,) the polygon of each kept triangle that is shaded flat, -1 of others; None where none
    is.
    """
    mark = mesh.attributes.get("sharp_face")
    if mark is None or (mark.data_type, mark.domain) != ("BOOLEAN", "FACE"):
        return None
    is_flat = _array(mark.data, "value", len(mesh.polygons), 1, np.bool_)[:, 0]
    faces = _triangle_faces(mesh, source)
    return np.where(is_flat[faces], faces, -1)


def _all_finite(values: np.ndarray, farthest: float = _LARGEST) -> bool:
    """By the extremes, which carry any NaN or infinity: a fifth of the time of a sum, and no copy
    as for isfinite.
    """
    with np.errstate(all="ignore"):
        return values.size == 0 or bool(-farthest <= values.min() and values.max() <= farthest)


def _finite(values: np.ndarray) -> np.ndarray:
    """NaN and Inf as 0, in place where there are any."""
    return (
        values
        if _all_finite(values)
        else np.nan_to_num(values, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
    )


def sound(values: np.ndarray, name: str, home: str, report: Report) -> np.ndarray:
    """An attribute's values, NaN and Inf as 0 and told. home: the name of what holds it."""
    if not _all_finite(values):
        report.note(
            "Attributes have values that are not finite, which count as 0 ({}): repair or remove "
            "them",
            f"{name} of {home}",
        )
    return _finite(values)


def _read_uv_map(mesh: Any, source: MeshSource, name: str, report: Report) -> None:
    """A UV map, or any attribute, by name; "" is the map that is active for rendering and goes
    first.

    What has not two columns goes as the colour that it is, whose red and green are u and v: one
    name stands for both.
    """
    active = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    attribute = mesh.attributes.get(name or active)
    if attribute is None or attribute.data_type not in _COLUMNS or attribute.domain not in _DOMAINS:
        return
    values = _values(mesh, source, attribute)
    values = values if values.shape[1] == 2 else values_as_color(values, grey=False)
    values = sound(values, attribute.name, mesh.name, report)
    found = Attribute(attribute.name, _DOMAINS[attribute.domain], values)
    source.uv_maps = (
        {name: found, **source.uv_maps} if not name else {**source.uv_maps, name: found}
    )


def _color_attribute(mesh: Any, source: MeshSource, name: str, report: Report) -> Attribute | None:
    """(k, 4) values of a geometry attribute: numbers as grey, vectors as colours, the mean channel
    where the name asks for grey.
    """
    if name == GENERATED:
        return Attribute(name, POINT, _generated(mesh))
    if name.startswith((TANGENT, UNDISPLACED_TANGENT)):
        return _tangents(mesh, source, name, report)
    if name == ISLAND:
        return Attribute(name, FACE, as_four(islands(mesh, source.mesh.triangles)))
    if name == POINTINESS:
        return Attribute(name, POINT, as_four(pointiness(mesh)))
    if name in (UNDISPLACED, UNDISPLACED_NORMAL):
        return _undisplaced(mesh, source, name)
    if name.startswith(LACKS):
        lacks = _readable(mesh, name.removeprefix(LACKS), report) is None
        rows = len(source.mesh.triangles)
        return Attribute(name, FACE, np.ones((rows, 4), np.float32)) if lacks else None
    attribute = _readable(mesh, name.removeprefix(GREY), report)
    if attribute is None:
        return None
    values = sound(_values(mesh, source, attribute), attribute.name, mesh.name, report)
    return Attribute(
        name,
        _DOMAINS[attribute.domain],
        _finite(values_as_color(values, name.startswith(GREY))),
    )


def _readable(mesh: Any, name: str, report: Report) -> Any:
    """An attribute of Blender's; None where there is none, or none of a kind that is read."""
    if name == ACTIVE_COLOR:
        index = mesh.color_attributes.render_color_index
        name = mesh.color_attributes[index].name if 0 <= index < len(mesh.color_attributes) else ""
    attribute = mesh.attributes.get(name) if name else None
    if attribute is None:
        return None
    if attribute.data_type in _COLUMNS and attribute.domain in _DOMAINS:
        return attribute
    report.note(
        f"Attribute '{name}' ({attribute.data_type.lower()} on {attribute.domain.lower()}s) "
        "is not read: it counts as 0"
    )
    return None


def _undisplaced(mesh: Any, source: MeshSource, name: str) -> Attribute:
    """Vertices of the mesh before it was displaced, or normals: of hard edges as they are at
    corners, else of the vertices, of flat meshes too, as in Cycles.
    """
    rest = source.rest or source.mesh
    if name == UNDISPLACED:
        return Attribute(name, POINT, values_as_color(rest.vertices, grey=False))
    if rest.normals is not None:
        return Attribute(name, rest.normals.domain, values_as_color(rest.normals.values, False))
    return Attribute(name, POINT, values_as_color(vertex_normals_of(mesh), grey=False))


def _generated(mesh: Any) -> np.ndarray:
    """(v, 4) undeformed coordinates of the vertices from 0 to 1 in the mesh's texture space."""
    vertices = _array(mesh.vertices, "undeformed_co", len(mesh.vertices), 3)
    size = np.array(mesh.texspace_size, np.float32)
    half = np.where(np.abs(size) > 0, size, 1.0)
    found = np.ones((len(vertices), 4), np.float32)
    found[:, :3] = (vertices - np.array(mesh.texspace_location, np.float32)) / (2 * half) + 0.5
    return _finite(found)


def _tangents(mesh: Any, source: MeshSource, name: str, report: Report) -> Attribute | None:
    """(k, 4) tangents of a UV map on the corners; None without the map."""
    plain = name.removeprefix(TANGENT).removeprefix(UNDISPLACED_TANGENT)
    if plain not in source.uv_maps:
        _read_uv_map(mesh, source, plain, report)
    uv = source.uv_maps.get(plain)
    if uv is None or uv.domain != CORNER or uv.values.shape[1] != 2:
        return None
    is_before = source.rest is not None and name.startswith(UNDISPLACED_TANGENT)
    shape = source.rest if is_before else source.mesh
    normals = _corner_normals(shape, source.corners)
    values = tangents(shape.vertices, shape.triangles, source.corners, normals, uv.values)
    return Attribute(name, CORNER, values)


def _corner_normals(mesh: Mesh, corners: np.ndarray) -> np.ndarray:
    """(n, 3, 3) float64 unit normals of each triangle's corners."""
    if mesh.normals is None:
        a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
        found = np.repeat(np.cross(b - a, c - a)[:, None], 3, 1)
    else:
        rows = mesh.triangles if mesh.normals.domain == POINT else corners
        found = mesh.normals.values.astype(np.float64)[rows]
    length = np.sqrt((found * found).sum(-1, keepdims=True))
    return found / np.where(length > 0, length, 1.0)


def values_of(attribute: Any) -> np.ndarray | None:
    """(k, c) float32 of an attribute where it is; None of a kind that is not read."""
    if attribute.data_type not in _COLUMNS:
        return None
    what, columns = _COLUMNS[attribute.data_type]
    dtype = _DTYPES.get(attribute.data_type, np.float32)
    values = _array(attribute.data, what, len(attribute.data), columns, dtype)
    return values.astype(np.float32, copy=False)


def values_as_color(values: np.ndarray, grey: bool) -> np.ndarray:
    """(k, 4) float32 of 1 to 4 columns. grey: by the mean of three, of two by the first, as in
    Cycles.
    """
    if values.shape[1] == 4 and not grey:
        return values
    color = np.ones((len(values), 4), np.float32)
    if values.shape[1] <= 2 and (grey or values.shape[1] == 1):
        color[:, :3] = values[:, :1]
    elif grey:
        color[:, :3] = values[:, :3].mean(1, keepdims=True)
    else:
        color[:, :3] = np.pad(values, ((0, 0), (0, 3 - values.shape[1])))
    if values.shape[1] == 4:
        color[:, 3] = values[:, 3]
    return color


def _values(mesh: Any, source: MeshSource, attribute: Any) -> np.ndarray:
    """(k, c) of an attribute; values on faces are handed to the triangles, those on edges to the
    vertices, each of which takes the mean of its edges', as in Cycles.
    """
    values = values_of(attribute)
    if attribute.domain == "FACE":
        values = values[_triangle_faces(mesh, source)]
    elif attribute.domain == "EDGE":
        ends = edges_of(mesh).T.reshape(-1)
        both, count = np.concatenate([values, values]), len(mesh.vertices)
        sums = [np.bincount(ends, column, count) for column in both.T]
        edges = np.maximum(np.bincount(ends, minlength=count), 1)
        values = (np.column_stack(sums) / edges[:, None]).astype(np.float32)
    elif attribute.domain == "CORNER":
        _read_corners(mesh, source)
    return values
