"""Nodes that ask for rays: Raycast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES, at
from glint.engine import scene as s
from glint.engine.accelerator import KINDS
from native_tools import draw, needs_core, square
from ray_node_scenes import (
    BACKENDS,
    DISTANCE,
    HIT,
    NORMAL,
    OWN,
    POSITION,
    _coloured,
    bevelled,
    cast,
    floor_of,
    normals_of,
)
from test_occlusion_pass import WIDE, x_and_y

CEILING = (square(WIDE), at((0, 0, 1.5)))


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_a_ray_tells(backend: str) -> None:
    def found(output: int, **more) -> np.ndarray:
        return normals_of(floor_of(cast(output, **more), CEILING), backend, samples=1)

    x, y = x_and_y()
    for more, there in (({}, True), ({"length": 1.0}, False), ({"only_local": 1}, False)):
        np.testing.assert_allclose(found(HIT, **more), there)
        assert not found(OWN, **more).any()
        far = 1.5 if there else more.get("length", 5.0)
        np.testing.assert_allclose(found(DISTANCE, **more), far, rtol=1e-5)
        place = np.stack([x, y, 1.5 + 0 * x], -1) * there
        np.testing.assert_allclose(found(POSITION, **more), place, atol=1e-5)
        np.testing.assert_allclose(
            found(NORMAL, **more), np.broadcast_to([0, 0, -1.0 * there], place.shape)
        )
    np.testing.assert_allclose(found(DISTANCE, direction=(0.0, 0.0, 3.0)), 0.5, rtol=1e-5)
    np.testing.assert_allclose(found(HIT, direction=(0.0, 0.0, 0.25)), 0)
    assert not found(HIT, direction=(0.0, 0.0, -1.0)).any()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("channels", [2, 3, 4])
def test_what_a_ray_reads_where_it_ends(backend: str, channels: int) -> None:
    """Of what it meets alone: nothing of a mesh without the attribute, of a sphere, or where it
    meets nothing. A strand that is wider than the view is read along its axis.
    """
    x, y = x_and_y()
    ask = {"name": "raycast_attribute", "attribute": "told"}

    def found(output: int, geometry=None, **more) -> np.ndarray:
        scene = floor_of(cast(output, **ask, **more), (geometry or ceiling, CEILING[1]))
        return normals_of(scene, backend, samples=1)

    ceiling = _coloured(square(WIDE), channels)
    wanted = np.stack([x, y, 2 + 0 * x], -1)
    wanted[..., channels:] = 0
    np.testing.assert_allclose(found(0), wanted, atol=1e-5)
    np.testing.assert_allclose(found(1), 0.25 if channels == 4 else 1.0, atol=1e-6)
    ends = np.float32([[-WIDE, 0, 6], [WIDE, 0, 6]])
    rod = s.Strands("rod", ends, np.full(2, 4, np.float32), np.zeros(1, np.uint32))
    along = np.stack([x, 0 * x, 2 + 0 * x], -1)
    along[..., channels:] = 0
    np.testing.assert_allclose(found(0, _coloured(rod, channels)), along, atol=1e-4)
    ball = s.Spheres("ball", np.array([[0, 0, 0]], np.float32), np.array([WIDE], np.float32))
    for output in (0, 1):
        assert not found(output, square(WIDE)).any()
        assert not found(output, ball).any()
        assert not found(output, length=1.0).any()
        assert not found(output, only_local=1).any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_from_elsewhere(backend: str) -> None:
    """Down from above the ceiling, and on from below it."""
    for start, far, own in ((2.0, 0.5, 0), (1.0, 1.0, 1)):
        more = {"position": (0.0, 0.0, start), "direction": (0.0, 0.0, -1.0)}
        for output, expected in ((DISTANCE, far), (OWN, own), (HIT, 1)):
            scene = floor_of(cast(output, **more), CEILING)
            found = normals_of(scene, backend, samples=1)
            np.testing.assert_allclose(found, expected, rtol=1e-5)
    local = cast(DISTANCE, position=(0.0, 0.0, 2.0), direction=(0.0, 0.0, -1.0), only_local=1)
    found = normals_of(floor_of(local, CEILING), backend, samples=1)
    np.testing.assert_allclose(found, 2.0, rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_unseen_by_some_rays_stops_these(backend: str) -> None:
    """Not what no rays see."""
    scene = floor_of(cast(HIT), CEILING)
    unseen = dict.fromkeys([f"visible_{kind}" for kind in KINDS], False)
    for seen_by in ("visible_mirror", "visible_shadow", "visible_transmission", None):
        there = seen_by is not None
        more = {**unseen, **({seen_by: True} if there else {})}
        block = replace(scene.instances[1], **more)
        some = replace(scene, instances=(scene.instances[0], block))
        np.testing.assert_allclose(normals_of(some, backend, samples=1), there)


@pytest.mark.parametrize("backend", BACKENDS)
def test_odd_rays_meet_nothing(backend: str) -> None:
    for more in (
        {"direction": (0.0, 0.0, 0.0)},
        {"direction": (np.nan, np.inf, 0.0)},
        {"length": 0.0},
        {"length": -1.0},
        {"length": np.nan},
        {"position": (np.inf, np.nan, 0.0), "direction": (0.0, 0.0, -1.0)},
        {"position": (1e300, 0.0, 0.0)},
    ):
        picture = normals_of(floor_of(cast(HIT, **more), CEILING), backend, samples=1)
        assert not picture.any(), more
    for more in ({"length": np.inf}, {"direction": (0.0, 0.0, 1e-200)}, {"length": 1e300}):
        found = normals_of(floor_of(cast(NORMAL, **more), CEILING), backend, samples=1)
        assert np.isin(found, (0.0, -1.0)).all()


@needs_core
@pytest.mark.parametrize("name", sorted(SCENES))
@pytest.mark.parametrize("kind", ["bevel", "cast", "cast-local"])
def test_both_tracers_bevel_and_cast(name: str, kind: str) -> None:
    base = SCENES[name]()
    local = int(kind == "cast-local")
    direction = (0.3, -0.2, -1.0) if local else (0.3, -0.2, 1.0)
    material = bevelled(0.3) if kind == "bevel" else cast(NORMAL, direction, only_local=local)
    scene = replace(base, materials=(material,) * len(base.materials))
    native, reference = (
        draw(scene, "Cost", backend=b, samples=2, filter_width=0.0, max_bounces=2)
        for b in ("NATIVE", "NUMPY")
    )
    difference = np.abs(native.combined - reference.combined).max(-1)
    assert (difference > 1e-3).mean() < 5e-3
    assert (native.passes["Cost"] != reference.passes["Cost"]).mean() < 5e-3
