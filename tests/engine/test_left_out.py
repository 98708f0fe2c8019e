"""What the core leaves out is told with the names of the things, and of no others."""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine import scene as s
from native_tools import draw, needs_core, placed, square, view_from_above

pytestmark = needs_core

# the last one turns inwards
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0.2, 0.1, 0]], np.float32)
NAN = np.float32(np.nan)


def mesh(*triangles: tuple[int, int, int], vertices: np.ndarray = CORNERS) -> s.Mesh:
    return s.Mesh("mesh", vertices, np.array(triangles, np.uint32).reshape(-1, 3))


def polygons(*rows: tuple[int, ...], vertices: np.ndarray = CORNERS) -> s.Polygons:
    offsets = np.cumsum([0, *map(len, rows)]).astype(np.uint32)
    return s.Polygons("polygons", vertices, offsets, np.concatenate(rows).astype(np.uint32))


def balls(*radii: float) -> s.Spheres:
    return s.Spheres("balls", np.zeros((len(radii), 3), np.float32), np.array(radii, np.float32))


def notes(*geometries: s.Geometry, **named: s.Geometry) -> tuple[str, ...]:
    """Of a picture of these, the later ones under their names."""
    everything = (*geometries, *named.values())
    names = [f"sound {k}" for k in range(len(geometries))] + [*named]
    blocks = tuple(
        s.Instances(name, k, placed(k).world_from_object, ()) for k, name in enumerate(names)
    )
    return draw(s.Scene(view_from_above(), everything, blocks)).notes


SOUND = (
    square(),
    square(1e-5),
    mesh((0, 1, 2), (0, 2, 3)),
    # a sliver
    mesh((0, 1, 2), vertices=np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-5, 0]], np.float32)),
    polygons((0, 1, 2, 3), (0, 1, 2), (3, 0, 1)),
    polygons((0, 1, 2), vertices=CORNERS * np.float32(1e-5)),
    balls(1, 1e-5),
)


def test_nothing_is_told_of_a_sound_scene() -> None:
    assert notes(*SOUND) == ()


@pytest.mark.parametrize(
    ("bad", "count"),
    [
        (mesh((0, 1, 2), (1, 1, 2)), 1),
        (
            mesh(
                (0, 1, 2),
                (0, 1, 3),
                vertices=np.array([[0, 0, 0], [1, 1, 1], [0, 1, 0], [0.5, 0.5, 0.5]], np.float32),
            ),
            1,
        ),
        (mesh((0, 1, 2), vertices=np.array([[0, 0, 0], [1, 0, 0], [0, NAN, 0]], np.float32)), 1),
        (mesh((0, 1, 2), vertices=np.array([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], np.float32)), 1),
        (polygons((0, 1, 2), (0, 1, 0, 1), (0, 1, 2, 3)), 1),
        (
            polygons((0, 1, 2), vertices=np.array([[0, 0, 0], [1, 0, 0], [0, NAN, 0]], np.float32)),
            1,
        ),
        (balls(1, 0, 0.5), 1),
        (balls(1, np.inf), 1),
    ],
    ids=[
        "two corners in one",
        "on a line",
        "nan",
        "inf",
        "a polygon there and back",
        "a polygon with a nan",
        "a ball of no radius",
        "a ball of any",
    ],
)
def test_the_one_that_is_bad_is_named(bad: s.Geometry, count: int) -> None:
    (note,) = notes(*SOUND, guilty=bad)
    assert note.startswith(
        f"{count} faces, spheres, strands or polygons of 'guilty' have no extent"
    )
    assert "repair the mesh" in note


def test_three_are_named_and_the_others_counted() -> None:
    bad = mesh((1, 1, 2))
    (note,) = notes(*SOUND, a=bad, b=bad, c=bad, d=bad, e=bad)
    assert note.startswith("5 faces, spheres, strands or polygons of 'a', 'b', 'c' and 2 more have")


def turned(axes: str, **sizes: tuple[float, float, float]) -> tuple[str, ...]:
    """Notes on a square in the plane of two axes, stretched and squeezed along x, y and z under
    these names.
    """
    columns = [axes.index(axis) if axis in axes else 2 for axis in "xyz"]
    flat = square()
    turned = s.Mesh("turned", np.ascontiguousarray(flat.vertices[:, columns]), flat.triangles)
    blocks = (
        s.Instances(name, 0, np.diag((*size, 1.0))[None, :3], ()) for name, size in sizes.items()
    )
    return draw(s.Scene(view_from_above(), (turned,), tuple(blocks))).notes


@pytest.mark.parametrize(
    ("axes", "flat"), [("xy", (1, 1, 0)), ("yz", (0, 1, 1)), ("xz", (1, 0, 1))]
)
def test_instances_squeezed_to_a_line_are_named(
    axes: str, flat: tuple[float, float, float]
) -> None:
    line = tuple(float(k == 0) for k in range(3))
    (note,) = turned(axes, whole=(1, 1, 1), flat=flat, line=line, tiny=(1e-5, 1e-5, 1e-5))
    assert note.startswith("1 instances of 'line' have") and "scale two axes alike" in note


def test_flattened_things_that_stand_on_edge_are_named() -> None:
    (note,) = turned("xy", whole=(1, 1, 1), edge=(0, 1, 1))
    assert note.startswith("2 faces, spheres, strands or polygons of 'edge' have no extent")
