"""Surfaces and media of special kinds on odd things: what a matrix flattens, mirrors or makes a
point of, faces without area, open and single ones, points and strands, small and large scenes, far
away and seen from inside. Pictures are finite and one tracer's are the other's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import grid_mesh
from glint.engine import scene as s
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.scene.problems import scene_problems
from native_tools import IDENTITY, constant, draw, lamp
from test_same_bits import AXES, LOOKS

SHEARED = np.array([[1.0, 0.7, 0.3], [0.0, 1.0, -0.4], [0.0, 0.0, 1.0]])
MATRICES = (
    np.eye(3),
    np.diag([-1.0, 1.0, 1.0]),
    SHEARED,
    np.diag([1.0, 1.0, 0.0]),
    np.diag([1.0, 0.0, 0.0]),
    np.zeros((3, 3)),
)
PLACES = ((0.0, 0.0, 0.0), (1e6, -1e6, 1e6))


def _ball() -> s.Mesh:
    sheet = grid_mesh(8, 1.0)
    u, v = np.pi * sheet.vertices[:, 0], np.pi / 2 * sheet.vertices[:, 1]
    points = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], -1)
    return s.Mesh("ball", points.astype(np.float32), sheet.triangles)


def shapes() -> tuple[s.Geometry, ...]:
    """About a unit large, in pairs of what is closed and what is not."""
    corners = np.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0.3], [0, 0, 0], [0.5, 0.5, 0]])
    lines = np.float32([[-0.8, 0, 0], [0, 0.3, 0.2], [0.8, 0, 0], [0.8, 0, 0]])
    flat = np.array([[3, 3, 3], [0, 1, 2], [3, 4, 4], [0, 0, 1]], np.uint32)
    return (
        _ball(),
        s.Spheres("points", np.float32([[-0.4, 0, 0], [0.4, 0, 0.2]]), np.float32([0.5, 0.0])),
        s.Strands("curve", lines, np.float32([0.2, 0.3, 0.2, 0]), np.arange(3, dtype=np.uint32)),
        s.Mesh("triangle", corners[:3], flat[1:2]),
        s.Mesh("without area", corners, flat),
        grid_mesh(4, 0.9, lambda x, y: 0.3 * np.sin(2 * x) * np.cos(3 * y), smooth=True),
    )


def things(name: str, matrix: np.ndarray, scale: float, place: tuple, inside: bool) -> s.Scene:
    """All shapes side by side over a floor, seen from above or by what stands in the first."""
    middle = np.array(place)
    ways = [np.array([2.2 * (k % 3 - 1), 2.2 * (k // 3) - 1.1, 0.0]) for k in range(6)]
    placed = [
        s.Instances(f"thing {k}", k, _at(scale * matrix, middle + scale * way), (0,))
        for k, way in enumerate(ways)
    ]
    floor = _at(5 * scale * np.eye(3), middle - (0, 0, scale))
    look = _scaled(LOOKS[name], scale)
    matt = s.Material("floor", (s.Lobe("DIFFUSE", constant(0.8)),))
    camera = IDENTITY.copy()  # beside what is even: its rays meet no edges
    camera[:, 3] = middle + scale * (
        ways[0] + (0.1, 0.0, 0.2) if inside else np.array((0.07, 0.03, 10.0))
    )
    lit = np.array((-0.2, 0.1, -0.3) if inside else (1.2, 1.6, 2.5))
    half = 0.7 if inside else 3.3 * scale
    lights = (
        lamp("SUN", axes=AXES, strength=2.0, angle=0.1),
        lamp("POINT", middle + scale * (ways[0] + lit), strength=99.0 * scale**2,
             radius=0.2 * scale),
    )  # fmt: skip
    kind = "PERSPECTIVE" if inside else "ORTHOGRAPHIC"
    return s.Scene(
        s.Camera(kind, camera, (-half, half, -half, half), (12, 12)),
        (*shapes(), s.Mesh("floor", np.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]),
                           np.uint32([[0, 1, 2]]))),
        (*placed, s.Instances("floor", 6, floor, (1,))),
        (look, matt),
        lights=lights,
    )  # fmt: skip


def _at(matrix: np.ndarray, place: np.ndarray) -> np.ndarray:
    return np.column_stack([matrix, place])[None].astype(np.float64)


def _scaled(look: s.Material, scale: float) -> s.Material:
    """As it looks on things so much larger."""
    lobes = tuple(
        replace(lobe, radius=tuple(scale * x for x in (0.3, 0.1, 0.0)))
        if any(lobe.radius)
        else lobe
        for lobe in look.lobes
    )
    medium = look.medium
    if medium is not None:
        parts = ("absorption", "emission")
        medium = replace(medium, **{p: tuple(x / scale for x in getattr(medium, p)) for p in parts})
    return replace(look, lobes=lobes, medium=medium)


CASES = {
    **{f"matrix {k}": (matrix, 1.0, PLACES[0], False) for k, matrix in enumerate(MATRICES)},
    "small": (MATRICES[0], 1e-6, PLACES[0], False),
    "large": (MATRICES[0], 1e6, PLACES[0], False),
    "far": (MATRICES[2], 1.0, PLACES[1], False),
    "inside": (MATRICES[1], 1.0, PLACES[0], True),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", LOOKS)
def test_pictures_are_finite_and_agree(name: str, case: str) -> None:
    scene = things(name, *CASES[case])
    assert scene_problems(scene) == []
    options = {"samples": 1, "light_samples": 2, "max_bounces": 1}
    core, truth = (draw(scene, backend=x, **options).combined for x in ("NATIVE", "NUMPY"))
    assert np.isfinite(core).all() and np.isfinite(truth).all()
    assert truth[..., :3].max() > 0 or (name, case) == ("points", "inside")  # has no such colour
    off = np.abs(core - truth) > 1e-4 * (np.abs(truth) + np.abs(truth).max())
    assert off.any(-1).mean() <= 0.02, np.abs(core - truth).max()


@pytest.mark.parametrize("factor", [1e200, 1e300])
def test_what_passes_more_than_numbers_hold(factor: float) -> None:
    """Behind two such surfaces weights are infinite; rays that meet nothing there are lit by
    nothing, also where lights are linked.
    """
    graph = Graph()
    normal = graph.apply(BY_NAME["normal"])[0]
    more = graph.apply(
        BY_NAME["scaled_sum"], normal, graph.constant(0.0), graph.constant((factor,) * 3)
    )[0]
    lobes = s.Lobe("TRANSPARENT", (s.Input(output=0),)), s.Lobe("DIFFUSE", constant(0.1))
    glass = s.Material("glass", lobes, program=compile_program(graph, [more]))
    scene = things("toon", MATRICES[0], 1.0, PLACES[0], False)
    for receivers in (s.EVERYTHING, 1):
        lights = tuple(replace(light, receivers=receivers) for light in scene.lights)
        wanted = replace(scene, materials=(glass, scene.materials[1]), lights=lights)
        film = draw(wanted, samples=1, light_samples=1, diffuse_bounces=1, max_bounces=2)
        assert np.isfinite(film.combined).all()
