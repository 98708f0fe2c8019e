"""What the tests of the native core share: small views, and the mark that skips them where there is
no core.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import pytest

from glint import engine
from glint.engine import scene as s
from glint.engine.native import binding

needs_core = pytest.mark.skipif(
    binding.load_error() is not None,
    reason=f"the core's library is not built: {binding.load_error()}",
)

Drawn = TypeVar("Drawn")
INSTRUCTION_SETS = ("sse42", "avx2", "avx512")
IDENTITY = np.eye(4)[:3]
NO_WORLD = s.World()


def view_from_above(size: int = 16, half: float = 1.0, height: float = 10.0, **more) -> s.Camera:
    """A parallel camera over the origin; pixel (i, j) sees x, y = half * ((2 i + 1) / size - 1)."""
    matrix = IDENTITY.copy()
    matrix[2, 3] = height
    return s.Camera("ORTHOGRAPHIC", matrix, (-half, half, -half, half), (size, size), **more)


def pixel_centers(size: int = 16, half: float = 1.0) -> np.ndarray:
    """(size, size, 3) points of the plane z = 0 that the pixels of `view_from_above` see at their
    centres.
    """
    line = half * ((2 * np.arange(size) + 1) / size - 1)
    x, y = np.meshgrid(line, line)
    return np.stack([x, y, 0 * x], -1)


def square(extent: float = 5.0, name: str = "square") -> s.Mesh:
    """Two triangles in z = 0 that face +z, with the UV map "map" over the unit square."""
    e = extent
    vertices = np.array([[-e, -e, 0], [e, -e, 0], [e, e, 0], [-e, e, 0]], np.float32)
    uv = s.Attribute("map", s.POINT, np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32))
    return s.Mesh(name, vertices, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), attributes=(uv,))


def placed(
    geometry: int = 0,
    materials: tuple[int, ...] = (0,),
    z: float = 0.0,
    linear: np.ndarray | float = 1.0,
    **more,
) -> s.Instances:
    matrix = np.zeros((1, 3, 4))
    matrix[0, :, :3] = linear * np.eye(3) if np.isscalar(linear) else linear
    matrix[0, 2, 3] = z
    return s.Instances(f"placed {geometry}", geometry, matrix, materials, **more)


def constant(*rgb: float) -> tuple[s.Input, ...]:
    return (s.Input(rgb if len(rgb) == 3 else rgb * 3),)


def material(*lobes: s.Lobe, index: int = 0) -> s.Material:
    return s.Material("material", lobes, index)


def lamp(kind: str, position=(0.0, 0.0, 2.0), axes: np.ndarray | None = None, **more) -> s.Light:
    """A light at `position`, shining down unless `axes` (its x, y, z as columns) says otherwise."""
    matrix = np.column_stack([np.eye(3) if axes is None else axes, position])
    return s.Light(kind.lower(), kind, matrix, **more)


def draw(scene: s.Scene, *passes: str, **settings) -> engine.Film:
    """The core's picture; one sample unless the settings say otherwise."""
    plan = {"samples": 1, "light_samples": 1, **settings}
    return engine.render(scene, engine.Settings(passes=frozenset(passes), **plan))


def color(scene: s.Scene, **settings) -> np.ndarray:
    """(h, w, 3) float64 of `draw`."""
    return draw(scene, **settings).combined[..., :3].astype(float)


def assert_instruction_sets_agree(drawn: Callable[[], Drawn]) -> Drawn:
    """What `drawn` gives is the same by all instruction sets that the core has and this machine
    runs; returns it. The core asks for the set wherever it builds a tree and starts a render, so
    that they need no processes of their own.
    """
    found: dict[str, Drawn] = {}
    with pytest.MonkeyPatch.context() as patch:
        for isa in INSTRUCTION_SETS:
            patch.setenv(binding.ISA_VARIABLE, isa)
            taken = binding.library().glint_isa().decode()
            if taken == isa or not found:  # a machine that lacks one takes the next lesser
                found[taken] = drawn()
    first, *others = found
    assert [isa for isa in others if found[isa] != found[first]] == [], f"not the bits of {first}"
    return found[first]
