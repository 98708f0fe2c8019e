"""Geometries, in object space, and where they stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

Array = np.ndarray


MOST_SETS = 64
"""Of instances that the same lights reach."""


EVERYTHING = (1 << MOST_SETS) - 1


POINT, CORNER, FACE = "POINT", "CORNER", "FACE"


@dataclass(frozen=True, eq=False)
class Attribute:
    """Values on a mesh, on strands or spheres that materials or passes read.

    name: how an `Input` finds it.
    domain: POINT (a row per vertex), CORNER (a row per value of `Mesh.corners`) or FACE (a row per
    triangle). values: (k, c) float32, c = 2 for UV maps, 3 for normals, 4 for colours.
    motion: (keys, k, c) float32, keys >= 2, values of strands at even times while the shutter is
    open; None for those that stay.
    """

    name: str
    domain: str
    values: Array
    motion: Array | None = None


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in object space.

    vertices: (v, 3) float32.
    triangles: (n, 3) uint32, rows of `vertices`, counter-clockwise seen from outside.
    corners: (n, 3) uint32, rows of CORNER attributes, or None when there is no such attribute.
    material_slots: (n,) uint16, index into `Instances.materials`, or None when all are 0.
    normals: unit shading normals on POINT or CORNER, or None for flat shading everywhere.
    attributes: UV maps and colours that something reads; the first one with 2 columns is the active
    UV map.
    motion: (k, v, 3) float32, k >= 2, vertices at even times while the shutter is open; None for a
    mesh that keeps its shape.  normal_motion: (k, rows of normals, 3) float32, unit, the same of
    normals; None where they stay.
    """

    name: str
    vertices: Array
    triangles: Array
    corners: Array | None = None
    material_slots: Array | None = None
    normals: Attribute | None = None
    attributes: tuple[Attribute, ...] = ()
    motion: Array | None = None
    normal_motion: Array | None = None


@dataclass(frozen=True, eq=False)
class Spheres:
    """True spheres in object space: centers (k, 3) float32, radii (k,) float32, material_slots as
    in `Mesh`.  attributes: on FACE, a row a sphere.

    motion: (keys, k, 3) float32, keys >= 2, centers at even times while the shutter is open; None
    where they stay.  radius_motion: (keys, k) float32, the same of radii; None where they stay.
    """

    name: str
    centers: Array
    radii: Array
    material_slots: Array | None = None
    motion: Array | None = None
    radius_motion: Array | None = None
    attributes: tuple[Attribute, ...] = ()


@dataclass(frozen=True, eq=False)
class Polygons:
    """Planar polygons, each tested by the odd-even rule (notes, section 4.9), flat shaded, object
    space.

    vertices: (v, 3) float32.  offsets: (p + 1,) uint32; polygon k has the corners
    indices[offsets[k]:offsets[k + 1]]. indices: (m,) uint32, rows of `vertices`, in order round the
    polygon; the normal is Newell's.
    """

    name: str
    vertices: Array
    offsets: Array
    indices: Array
    material_slots: Array | None = None


@dataclass(frozen=True, eq=False)
class Strands:
    """Segments of hair and the like in object space: each is the convex hull of a sphere round its
    beginning and one round its end, seen from outside alone.

    vertices: (v, 3) float32.  radii: (v,) float32, of each vertex; a segment both of whose ends
    have none is not there.  starts: (n,) uint32, segment k goes from row starts[k] of `vertices` to
    the next row.  material_slots, attributes: as in `Mesh`, on POINT (a row per vertex, mixed along
    the segment) or FACE (a row per segment).  motion: (keys, v, 3) float32, keys >= 2, vertices at
    even times while the shutter is open; None where they stay.  radius_motion: (keys, v) float32,
    the same of radii; None where they stay.
    """

    name: str
    vertices: Array
    radii: Array
    starts: Array
    material_slots: Array | None = None
    attributes: tuple[Attribute, ...] = ()
    motion: Array | None = None
    radius_motion: Array | None = None

    @cached_property
    def ends(self) -> Array:
        """(n, 3) uint32 rows of `vertices`: the beginning, and the end twice; so attributes are
        read as on triangles.
        """
        return self.starts[:, None] + np.array([0, 1, 1], np.uint32)


Geometry = Mesh | Spheres | Polygons | Strands


@dataclass(frozen=True, eq=False)
class Instances:
    """One geometry placed k times. Instances are numbered in the order of `Scene.instances`, then
    by row.

    geometry: index into `Scene.geometries`.
    world_from_object: (k, 3, 4) float64; mirrored, sheared and flattened matrices are welcome.
    materials: for each material slot an index into `Scene.materials`; a slot beyond the end uses
    the last one. object_index: Blender's pass index. visible_camera, visible_mirror,
    visible_shadow, visible_transmission: seen by camera rays (and what passes straight through
    them), by mirror rays, by shadow rays, by refraction rays. visible_diffuse, visible_media: what
    glows lights matt lobes, and media; with visible_mirror the other lobes. holdout: to camera rays
    what its surface does not let through is a hole of alpha 0. catcher: camera rays see what other
    things change of its light, over what is behind it.
    values: by name, what programs read of each placement, (k, 4) float32.  light_set: 0 to 63,
    which lights reach it.  motion: (keys, k, 3, 4) float64, keys >= 2, world_from_object at even
    times while the shutter is open; None for what stands still.  asset: what it is part of, "" for
    itself alone; this and the name are what Cryptomatte passes tell.  light_group: of
    `Scene.light_groups`, of what it gives by itself; -1 for none.  receivers, blockers: as of
    `Light`, of what it gives as a light.  geometry_offset: >= 0, the cosine below which light
    grazes its smooth surfaces, so that shadow rays start off their faces; 0: it never does.
    shading_offset: 0 to 1, by how much lower than it stands its surfaces see light.
    """

    name: str
    geometry: int
    world_from_object: Array
    materials: tuple[int, ...]
    object_index: int = 0
    visible_camera: bool = True
    visible_mirror: bool = True
    visible_shadow: bool = True
    holdout: bool = False
    values: Mapping[str, Array] = field(default_factory=dict)
    light_set: int = 0
    motion: Array | None = None
    asset: str = ""
    catcher: bool = False
    light_group: int = -1
    receivers: int = EVERYTHING
    blockers: int = EVERYTHING
    visible_transmission: bool = True
    visible_diffuse: bool = True
    visible_media: bool = True
    geometry_offset: float = 0.1
    shading_offset: float = 0.0
