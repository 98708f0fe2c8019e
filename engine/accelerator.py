"""Ray queries over arrays, without a picture: what rays meet first, and whether they meet anything.

For visibility, baking, ambient occlusion, picking. Everything is in world space and in the caller's
units. Answers come from the native core or, where it does not load, from the float64 NumPy
reference: the same to the precision of the arrays, hundreds of times slower.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from types import TracebackType
from typing import Any, Protocol

import numpy as np

from .errors import SceneError
from .native.binding import load_error
from .native.queries import NativeQueries
from .scene import Camera, Geometry, Instances, Mesh, Scene
from .scene.problems import scene_problems
from .scene.ray_batch import RayBatch
from .settings import BACKENDS

Array = np.ndarray

KINDS = ("camera", "mirror", "shadow", "transmission", "diffuse")
"""What `visibility` may name: only instances whose visible_<kind> is set are there."""


@dataclass(frozen=True, eq=False)
class Hits:
    """What n rays meet first; all arrays (n,).

    t: distance in lengths of the ray's direction, float32 or float64 as the rays; infinity for a
    miss. instance: int32 number of the placement (in the order of the instances given, then by
    row); -1 for a miss. primitive: int32 triangle, sphere or polygon of the geometry; -1 for a
    miss. u, v: float32 barycentric weights of a triangle's second and third vertex (the first one
    has 1 - u - v); 0 elsewhere.
    """

    t: Array
    instance: Array
    primitive: Array
    u: Array
    v: Array

    def __len__(self) -> int:
        return len(self.t)


class Tracer(Protocol):
    """What a backend offers: `engine.native.queries` and `engine.reference.queries`."""

    bounds: Array
    stats: dict[str, float]

    def closest(self, rays: RayBatch) -> tuple[Array, Array, Array, Array, Array]:
        """t, instance, primitive, u, v of `Hits`."""

    def occluded(self, rays: RayBatch) -> Array:
        """(size,) bool."""


class Accelerator:
    """Geometry made ready for rays. A context manager; `close` gives the memory back, and so does
    letting go of the object.

    Arrays are not copied where their dtype and layout fit the core: leave them unchanged while the
    accelerator lives. Primitives without extent or with a vertex that is not finite are left out
    and counted in `stats`. May be used from several threads at once; each call releases the GIL and
    works on `threads` threads of its own.
    """

    def __init__(
        self,
        geometries: Sequence[Geometry],
        instances: Sequence[Instances],
        *,
        threads: int = 0,
        backend: str | None = None,
        quick: bool = False,
    ) -> None:
        """geometries, instances: values of `engine.scene`; materials, normals and attributes are
        not looked at. threads: 0 for one per core; changes no bit of an answer. backend: "NATIVE",
        "NUMPY", or None for the native core where it loads, else NumPy. quick: made ready in half
        the time, for few rays.

        Raises SceneError (a ValueError) that lists what is wrong with the arrays: shapes, dtypes,
        indices out of range, matrices that are not finite; ValueError for the other arguments;
        MemoryError; ImportError and OSError when the native core is asked for and cannot be loaded.
        """
        _check_options(threads, backend)
        scene = Scene(_NO_CAMERA, tuple(geometries), tuple(_bare(group) for group in instances))
        problems = scene_problems(scene)
        if problems:
            raise SceneError("\n".join(problems))
        self._tracer: Tracer | None = _tracer(scene, int(threads), backend, quick)

    @classmethod
    def from_triangles(
        cls, vertices: Any, triangles: Any, *, threads: int = 0, backend: str | None = None
    ) -> Accelerator:
        """One mesh where it stands.

        vertices: (v, 3) numbers. float32 is kept; anything else is taken as float64 and stored as
        float32 relative to its middle, so that a mesh far from the origin keeps its shape.
        triangles: (n, 3) integers, rows of `vertices`. Raises as the constructor does.
        """
        points, shift = _split(_numbers("vertices", vertices, 3))
        mesh = Mesh("triangles", points, _indices(triangles, len(points)))
        matrix = np.concatenate([np.eye(3), shift[:, None]], 1)[None]
        return cls(
            (mesh,), (Instances("triangles", 0, matrix, ()),), threads=threads, backend=backend
        )

    def closest(
        self,
        origins: Any,
        directions: Any,
        t_min: Any = 0.0,
        t_max: Any = np.inf,
        *,
        visibility: str | None = None,
    ) -> Hits:
        """The first thing that each ray o + t d meets with t_min < t < t_max.

        origins, directions: (n, 3), or (3,) for one that all rays share. Directions need not be
        unit; t counts in their lengths. t_min, t_max: (n,) or a number; t_min below 0 counts as 0.
        When origins and directions are both float32 everything is float32, else float64.
        visibility: "camera", "mirror", "shadow", "transmission" or "diffuse" leaves out instances
        that are hidden from such rays; None shows what any of them sees. Of things met at one
        distance (faces that coincide, neighbours where rounding leaves the ray in both) the lowest
        (instance, primitive) is given.
        No ray slips through between neighbouring triangles. One that begins on a surface may find
        it again, as far away as rounding goes: give t_min.

        Misses by definition: rays with a number that is not finite (t_max may be infinite),
        directions of length 0 or outside 1e-150 to 1e150. Raises ValueError for shapes and dtypes
        that do not fit and on a closed accelerator, MemoryError.
        """
        tracer = self._open()
        return Hits(*tracer.closest(_batch(origins, directions, t_min, t_max, visibility)))

    def occluded(
        self,
        origins: Any,
        directions: Any,
        t_min: Any = 0.0,
        t_max: Any = np.inf,
        *,
        visibility: str | None = None,
    ) -> Array:
        """(n,) bool: whether each ray meets anything with t_min < t < t_max. Arguments and errors
        as `closest`; faster.
        """
        tracer = self._open()
        return tracer.occluded(_batch(origins, directions, t_min, t_max, visibility))

    @property
    def bounds(self) -> Array:
        """(2, 3) float64 lower and upper corner of a box round all finite vertices and spheres;
        +inf and -inf when there are none.
        """
        return self._open().bounds.copy()

    @property
    def stats(self) -> dict[str, float]:
        """Counts: instances, primitives, dropped; bytes and nodes of the trees; build in
        seconds.
        """
        return dict(self._open().stats)

    def close(self) -> None:
        """Gives the memory back once queries under way on other threads have ended. May be called
        twice.
        """
        self._tracer = None

    def __enter__(self) -> Accelerator:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _open(self) -> Tracer:
        tracer = self._tracer
        if tracer is None:
            raise ValueError("the accelerator is closed")
        return tracer


_NO_CAMERA = Camera("PERSPECTIVE", np.eye(4)[:3], (-1.0, 1.0, -1.0, 1.0), (1, 1))


def _bare(group: Instances) -> Instances:
    """Without materials: the scene here has none."""
    if not isinstance(group, Instances):
        raise SceneError(
            f"{type(group).__name__} is no block of instances: use engine.scene.Instances"
        )
    return Instances(
        group.name,
        group.geometry,
        group.world_from_object,
        (),
        visible_camera=bool(group.visible_camera),
        visible_mirror=bool(group.visible_mirror),
        visible_shadow=bool(group.visible_shadow),
        visible_transmission=bool(group.visible_transmission),
        visible_diffuse=bool(group.visible_diffuse),
    )


def _check_options(threads: Any, backend: Any) -> None:
    if isinstance(threads, bool) or not isinstance(threads, Integral) or threads < 0:
        raise ValueError(f"threads is {threads!r}: use 0 (one per core) or more")
    if backend is not None and backend not in BACKENDS:
        raise ValueError(f"backend is {backend!r}: use {', '.join(BACKENDS)} or None")


def _tracer(scene: Scene, threads: int, backend: str | None, quick: bool) -> Tracer:
    if backend == "NATIVE" or (backend is None and load_error() is None):
        return NativeQueries(scene, threads, quick)
    from .reference.queries import ReferenceQueries

    return ReferenceQueries(scene)


# --- arrays
# --------------------------------------------------------------------------------------------------


def _numbers(name: str, values: Any, columns: int | None) -> Array:
    """A float32 or float64 array of (n, columns), or (n,) for None; single rows and numbers get a
    first axis of 1.
    """
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} has dtype {array.dtype}: use float32 or float64")
    if array.dtype.type is not np.float32 or not array.dtype.isnative:
        array = array.astype(np.float64)
    shape = (columns,) if columns else ()
    if array.shape == shape:
        return array[None]
    if array.ndim != len(shape) + 1 or array.shape[1:] != shape:
        wanted = f"(n, {columns}) or ({columns},)" if columns else "(n,) or one number"
        raise ValueError(f"{name} has shape {array.shape}: use {wanted}")
    return array


def _batch(
    origins: Any, directions: Any, t_min: Any, t_max: Any, visibility: str | None
) -> RayBatch:
    if visibility is not None and visibility not in KINDS:
        raise ValueError(f"visibility is {visibility!r}: use one of {', '.join(KINDS)}, or None")
    single = {
        "origins": _numbers("origins", origins, 3),
        "directions": _numbers("directions", directions, 3),
    }
    dtype = np.result_type(*single.values())
    given = {
        **single,
        "t_min": _numbers("t_min", t_min, None),
        "t_max": _numbers("t_max", t_max, None),
    }
    count = _common_count(given)
    with np.errstate(over="ignore"):  # float64 bounds beyond float32 read as infinite
        ready = {name: np.ascontiguousarray(array, dtype) for name, array in given.items()}
    return RayBatch(**ready, size=count, visibility=visibility)


def _common_count(arrays: dict[str, Array]) -> int:
    """The rows that the arrays agree on; those of one row go with any number."""
    count = next((len(array) for array in arrays.values() if len(array) != 1), 1)
    for name, array in arrays.items():
        if len(array) not in (1, count):
            raise ValueError(f"{name} has {len(array)} rows: the other arrays have {count}")
    return count


def _split(vertices: Array) -> tuple[Array, Array]:
    """(v, 3) float32 about a middle (3,) float64, which is 0 for vertices that are float32
    already.
    """
    if vertices.dtype == np.float32:
        return np.ascontiguousarray(vertices), np.zeros(3)
    finite = vertices[np.isfinite(vertices).all(1)]
    middle = finite.min(0) / 2 + finite.max(0) / 2 if len(finite) else np.zeros(3)
    # what is too large is left out, as what is not finite
    with np.errstate(over="ignore", invalid="ignore"):
        return (vertices - middle).astype(np.float32), middle


def _indices(triangles: Any, count: int) -> Array:
    array = np.asarray(triangles)
    if array.size == 0 and array.dtype.kind == "f":  # an empty list
        array = array.astype(np.uint32)
    if array.dtype.kind not in "iu":
        raise SceneError(f"triangles has dtype {array.dtype}: use integers")
    if array.ndim != 2 or array.shape[1] != 3:
        if array.size:
            raise SceneError(f"triangles has shape {array.shape}: use (n, 3)")
        array = array.reshape(0, 3)
    wrong = (array < 0) | (array >= count)
    if wrong.any():
        row = int(wrong.any(1).argmax())
        raise SceneError(
            f"triangle {row} names vertices {array[row].tolist()} but there are {count}: use 0 to "
            f"{count - 1}"
        )
    return np.ascontiguousarray(array, np.uint32)
