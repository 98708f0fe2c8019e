"""What node programs read of the points of a surface (`program.execute.run.Points`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..linear.columns import cross, dot, pick, transform_each, unit
from ..program.execute.rays import Asked, Met
from ..scene import Camera
from .attributes import Attributes
from .geometry import Geometry
from .panorama import picture_points, step_size
from .placements import Placements
from .surface import Surface
from .textures import Image

Array = np.ndarray


class Queries(Protocol):
    """How points ask the scene for rays; the rays are those of the points `index` (m,) of a
    surface.
    """

    def blocked(self, surface: Surface, index: Array, asked: Asked, of: str) -> Array:
        """(m,) bool: whether anything is on the rays.

        of: "shadow" for what shadow rays meet, "any" for what any rays do, "own" for the points'
        own instances, whatever they hide from; here and below.
        """

    def nearest(self, surface: Surface, index: Array, asked: Asked, of: str) -> Met:
        """The first hits of the rays, each of a ray (k,) of these."""

    def crossings(self, surface: Surface, index: Array, asked: Asked) -> Met:
        """All hits of the rays on the points' own instances."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What all points have in common."""

    attributes: Attributes
    images: list[Image]
    geometry: Geometry
    camera: Camera

    @property
    def placements(self) -> Placements:
        return self.geometry.placements

    @property
    def eye(self) -> Array:
        return np.asarray(self.camera.world_from_camera, np.float64)[:, 3:]


def _camera_axes(camera: Camera) -> Array:
    """(3, 3) unit columns: right, up and forward."""
    axes = np.asarray(camera.world_from_camera, np.float64)[:, :3]
    return axes / np.sqrt((axes * axes).sum(0)) * np.array([1.0, 1.0, -1.0])


def clipped(camera: Camera, d: Array, x: Array, far: Array) -> Array:
    """(n,) lengths along unit d (3, n) of what lies before the camera's clip_start. x: (3, n) hits
    relative to the eye, far: (n,) how long rays are to there; an eye of a pair turns d.
    """
    if camera.kind == "PANORAMA":
        return np.full(d.shape[1], float(camera.clip_start))
    if camera.eye is not None and camera.eye.convergence < np.inf:
        aside, c = x - far * d, camera.eye.convergence
        d = unit(np.sqrt(c * c + dot(aside, aside)) * d + aside)
    back = np.asarray(camera.world_from_camera, np.float64)[:, 2:3]
    return -camera.clip_start * dot(back, back) / dot(back, d)


def light_path(kind: str, count: int) -> tuple[Array, ...]:
    """Four times (count,): 1 where the rays are the camera's, shadows', bounced or scattered ones.
    kind: shadows' in the directions of lobes are bounced ("shadow mirror") or scattered ones
    ("shadow diffuse") as well.
    """
    kinds = (
        ("camera",),
        ("shadow", "shadow mirror", "shadow diffuse"),
        ("mirror", "shadow mirror"),
        ("scattered", "shadow diffuse"),
    )
    return tuple(np.full(count, float(kind in some)) for some in kinds)


class SurfacePoints:
    """The points `index` (m,) of a surface."""

    def __init__(
        self,
        around: Surroundings,
        surface: Surface,
        index: Array,
        kind: str,
        queries: Queries | None = None,
    ):
        """kind: of the rays that meet it, as `light_path` has it. queries: how the scene is asked
        for rays; None where it is not.
        """
        self._around, self._surface, self._index, self._kind = around, surface, index, kind
        self.queries = queries

    def attribute(self, name: str, shift: int) -> Array:
        """(4, m): see `program.Points`. shift: `operations_input.Shift`, here and below."""
        return self._around.attributes.color(name).at(*self._place(shift))

    def uv(self, name: str, shift: int) -> Array:
        """(2, m)."""
        return self._around.attributes.uv(name).at(*self._place(shift))

    def image(self, texture: int, u: Array, v: Array) -> Array:
        """(4, m) RGBA."""
        return self._around.images[texture].read(u, v)

    def position(self, shift: int) -> Array:
        """(3, m) in the world."""
        return self._x(shift) + self._around.eye

    def normal(self) -> Array:
        """(3, m) unit shading normal, turned to the viewer."""
        return self._of("mesh_n")

    def face_normal(self) -> Array:
        """(3, m) unit geometric normal, turned to the viewer."""
        return self._of("g")

    def incoming(self) -> Array:
        """(3, m) unit, to the viewer."""
        return self._of("v")

    def backfacing(self) -> Array:
        """(m,) 1 where the inner side is seen, else 0."""
        return 1.0 - self._surface.outside[self._index]

    def object_position(self, shift: int) -> Array:
        """(3, m) in the object's space; zeros where its matrix has no inverse."""
        matrices = self._around.placements.world_from_object[self._row()]
        return self._into(matrices[:, :, :3], self._x(shift) - matrices[:, :, 3].T)

    def object_normal(self) -> Array:
        """(3, m) unit shading normal, turned to the viewer, in the object's space."""
        matrices = self._around.placements.world_from_object[self._row()][:, :, :3]
        return unit(transform_each(np.swapaxes(matrices, 1, 2), self._of("mesh_n")))

    def normal_to_world(self, normal: Array) -> Array:
        """(3, m) unit normals of the object's space, outward, in the world."""
        placements, row = self._around.placements, self._row()
        return unit(transform_each(placements.normals[row], normal)) * placements.mirror[row]

    def normal_to_object(self, normal: Array) -> Array:
        """(3, m) unit normals of the world, in the object's space."""
        return unit(transform_each(np.swapaxes(self._matrices()[:, :, :3], 1, 2), normal))

    def from_object(self, vector: Array, is_point: bool) -> Array:
        """(3, m) in the world."""
        matrices = self._matrices()
        found = transform_each(matrices[:, :, :3], vector)
        return found + matrices[:, :, 3].T + self._around.eye if is_point else found

    def to_object(self, vector: Array, is_point: bool) -> Array:
        """(3, m) in the object's space; zeros where its matrix has no inverse."""
        matrices = self._matrices()
        start = matrices[:, :, 3].T + self._around.eye if is_point else 0.0
        return self._into(matrices[:, :, :3], vector - start)

    def from_camera(self, vector: Array, is_point: bool) -> Array:
        """(3, m) in the world, of what is along the camera's axes."""
        found = _camera_axes(self._around.camera) @ vector
        return found + self._around.eye if is_point else found

    def to_camera(self, vector: Array, is_point: bool) -> Array:
        """(3, m) along right, up and forward of the camera."""
        start = self._around.eye if is_point else 0.0
        return np.linalg.solve(_camera_axes(self._around.camera), vector - start)

    def _matrices(self) -> Array:
        return self._around.placements.world_from_object[self._row()]

    def barycentric(self, shift: int) -> Array:
        """(3, m) weights of the triangles' corners; zeros off triangles."""
        is_flat = self._surface.primitive[self._index] < self._around.geometry.triangle_count
        return np.where(is_flat, self._place(shift)[2], 0.0)

    def edge_distance(self, shift: int) -> Array:
        """(m,) to the nearest side of the triangle; the largest float32 off triangles."""
        g, primitive = self._around.geometry, self._surface.primitive[self._index]
        flat = np.flatnonzero(primitive < g.triangle_count)
        a, b, c = (pick(g.points, corner[primitive[flat]]) for corner in g.triangles)
        e, f = b - a, c - a
        area = np.sqrt((cross(e, f) ** 2).sum(0))
        weights = self._place(shift, sided=False)[2][:, flat]
        sides = [np.sqrt((side * side).sum(0)) for side in (f - e, f, e)]
        found = np.full(len(self._index), float(np.finfo(np.float32).max))
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = [np.abs(w) * area / side for w, side in zip(weights, sides, strict=True)]
        found[flat] = np.fmin(np.fmin(*apart[:2]), apart[2])
        return found

    def shift(self, number: int) -> Array:
        """(3, m) the step to where a shifted read happens; zeros for 0."""
        axis, width = number & 3, number >> 2
        if axis == 0:
            return np.zeros((3, len(self._index)))
        size = self._step_size() * (width / 100 if width else 1.0)
        return size * _axes_in_face(self._of("g"))[min(axis, 2) - 1]

    def pixel_step(self, axis: int) -> Array:
        """(3, m): `shift` of Shift.FIRST or SECOND."""
        return self.shift(axis)

    def object_location(self) -> Array:
        """(3, m) of the object's origin in the world."""
        return self._around.placements.world_from_object[self._row()][:, :, 3].T + self._around.eye

    def instance_value(self, name: str) -> Array:
        """(4, m) of the placements."""
        return self._around.placements.value(name)[:, self._row()]

    def camera_position(self, shift: int) -> Array:
        """(3, m): along right and up of the camera, and the depth; world units."""
        return camera_position(self._around.camera, self._x(shift))

    def window(self, shift: int) -> Array:
        """(2, m) of the picture, from 0 at the left and bottom to 1."""
        return window(self._around.camera, self._x(shift))

    def reflection(self) -> Array:
        """(3, m) unit: the direction of view mirrored at the shading normal."""
        n, v = self._of("mesh_n"), self._of("v")
        return 2 * dot(n, v) * n - v

    def light_path(self) -> tuple[Array, ...]:
        """Four times (m,): see `light_path`."""
        return light_path(self._kind, len(self._index))

    def ray_length(self) -> Array:
        """(m,) of the ray that meets the point."""
        far = self._surface.far[self._index]
        if self._kind != "camera":
            return far
        return far - clipped(self._around.camera, -self._of("v"), self._of("x"), far)

    def ray_depth(self) -> tuple[Array, ...]:
        """Four times (m,): bounces, surfaces that dim passed since, refractions among the bounces,
        1 where the last was one.
        """
        return tuple(pick(self._surface.past, self._index))

    def blocked(self, asked: Asked, of: str) -> Array:
        """(m,) bool: see `Queries.blocked`."""
        assert self.queries is not None
        return self.queries.blocked(self._surface, self._index, asked, of)

    def nearest(self, asked: Asked, of: str) -> Met:
        """See `Queries.nearest`."""
        assert self.queries is not None
        return self.queries.nearest(self._surface, self._index, asked, of)

    def crossings(self, asked: Asked) -> Met:
        """See `Queries.crossings`."""
        assert self.queries is not None
        return self.queries.crossings(self._surface, self._index, asked)

    def attribute_on(self, surface: Surface, name: str) -> Array:
        """(4, k) as `attribute`, of other surfaces."""
        pool = self._around.attributes.color(name)
        return pool.at(surface.geometry, surface.local, surface.weights)

    def is_own(self, ray: Array, surface: Surface) -> Array:
        """(k,) bool: whether what rays `ray` (k,) met is of their points' own instances."""
        return self._row()[ray] == surface.row

    def relative(self, position: Array) -> Array:
        """(3, m) of the world, relative to the eye."""
        return position - self._around.eye

    def in_world(self, position: Array) -> Array:
        """(3, m) of points relative to the eye."""
        return position + self._around.eye

    def beside(self, direction: Array) -> Array:
        """(3, m) the points, relative to the eye, clear of their surface, on the side to which
        directions (3, m) leave.
        """
        g, offset = self._of("g"), self._surface.offset[self._index]
        return self._of("x") + np.where(dot(g, direction) < 0, -offset, offset) * g

    def _of(self, name: str) -> Array:
        return pick(getattr(self._surface, name), self._index)

    def _row(self) -> Array:
        return self._surface.row[self._index]

    def _x(self, shift: int) -> Array:
        return self._of("x") + self.shift(shift)

    def _step_size(self) -> Array:
        """(m,) a tenth of what a pixel spans there."""
        camera = self._around.camera
        if camera.kind == "PANORAMA":
            return step_size(camera) * np.sqrt((self._of("x") ** 2).sum(0))
        left, right = camera.window[:2]
        axis = np.sqrt((np.asarray(camera.world_from_camera, np.float64)[:, 0] ** 2).sum())
        pixel = 0.1 * axis * (right - left) / camera.resolution[0]
        if camera.kind == "ORTHOGRAPHIC":
            return np.full(len(self._index), pixel)
        x, y, z = camera_position(camera, self._of("x"))
        far = np.sqrt(x * x + y * y + z * z)
        z = np.maximum(z, far / 4)
        wide = 0.5 * (np.sqrt(z * z + x * x) + np.sqrt(z * z + y * y))
        return pixel * wide * z / np.where(far > 0, far, 1.0)

    def _place(self, shift: int, sided: bool = True) -> tuple[Array, Array, Array]:
        s, index = self._surface, self._index
        weights = pick(s.weights, index)
        if shift:
            side = 1 - 2 * self.backfacing() if sided else 1.0
            weights = weights + self._weights_of(side * self.shift(shift))
        return s.geometry[index], s.local[index], weights

    def _weights_of(self, step: Array) -> Array:
        """(3, m) what barycentric weights gain by a step in the plane of the triangle; zeros off
        triangles.
        """
        g, change = self._around.geometry, np.zeros((3, len(self._index)))
        primitive = self._surface.primitive[self._index]
        flat = np.flatnonzero(primitive < g.triangle_count)
        a, b, c = (pick(g.points, corner[primitive[flat]]) for corner in g.triangles)
        e, f, d = b - a, c - a, pick(step, flat)
        ee, ef, ff, ed, fd = dot(e, e), dot(e, f), dot(f, f), dot(e, d), dot(f, d)
        size = ee * ff - ef * ef
        safe = np.where(size > 0, size, 1.0)
        u = np.where(size > 0, (ff * ed - ef * fd) / safe, 0.0)
        v = np.where(size > 0, (ee * fd - ef * ed) / safe, 0.0)
        change[:, flat] = np.stack([-u - v, u, v])
        return change

    @staticmethod
    def _into(matrices: Array, points: Array) -> Array:
        """Points (3, m) by the inverses of matrices (m, 3, 3)."""
        a, b, c = (matrices[:, :, k] for k in range(3))
        rows = [np.cross(b, c), np.cross(c, a), np.cross(a, b)]
        size = np.einsum("mk,mk->m", a, rows[0])
        found = np.stack([np.einsum("mk,km->m", row, points) for row in rows])
        return np.where(size != 0, found / np.where(size != 0, size, 1.0), 0.0)


def camera_position(camera: Camera, x: Array) -> Array:
    """(3, m): points x (3, m), relative to the eye, along right and up of the camera, and the
    depth; world units.
    """
    axes = np.asarray(camera.world_from_camera, np.float64)[:, :3]
    sizes = np.sqrt((axes * axes).sum(0))
    return np.linalg.solve(axes / sizes, x) * np.array([[1.0], [1.0], [-1.0]])


def window(camera: Camera, x: Array) -> Array:
    """(2, m): points x (3, m), relative to the eye, in the picture, from 0 at the left and bottom
    to 1.
    """
    axes = np.asarray(camera.world_from_camera, np.float64)[:, :3]
    x, y, z = np.linalg.solve(axes, x)
    left, right, bottom, top = camera.window
    if camera.panorama is not None:
        u, v = picture_points(camera.panorama, unit(np.stack([x, y, z])))
        return np.stack([(u - left) / (right - left), (v - bottom) / (top - bottom)])
    if camera.kind == "PERSPECTIVE":
        depth = np.where(z != 0, -z, 1.0)
        x, y = x / depth, y / depth
    return np.stack([(x - left) / (right - left), (y - bottom) / (top - bottom)])


def _axes_in_face(g: Array) -> tuple[Array, Array]:
    """Two unit vectors (3, m) across unit normals (3, m) and each other, as Cycles has them: bumps
    at the edges of patterns show which way they point. The first is across (1, 1, 1), or
    (-1, 1, 1) where g is along that but for rounding.
    """
    x, y, z = g
    along = np.abs(x - y) + np.abs(x - z) < 1e-6
    first = unit(np.where(along, [z - y, x + z, -x - y], [z - y, x - z, y - x]))
    return first, cross(g, first)
