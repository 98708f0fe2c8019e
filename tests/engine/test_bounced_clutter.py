"""Bounced light among many small things, where small discs stand for much light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bounced_scenes import BACKENDS, GROUND, HERE, added, lamp, matt
from engine_scenes import box_mesh
from glint.engine.lights.bounced_light import MERGED, bounced_light, bounced_table
from glint.engine.lights.mesh_lights import merged
from glint.engine.scene import Camera, Instances, Scene

PIXELS = 48
BOXES = 60


def clutter() -> Scene:
    """Boxes strewn over a floor, seen from above."""
    random = np.random.default_rng(5)
    places = np.zeros((BOXES, 3, 4))
    for at, place in zip(random.uniform(-2, 2, (BOXES, 2)), places, strict=True):
        place[:, :3] = 0.12 * np.diag(random.uniform(0.3, 1, 3))
        place[:2, 3] = at
        place[2, 3] = place[2, 2] / 2
    floor = replace(GROUND, vertices=GROUND.vertices / 1000)
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 3.0)])
    return Scene(
        Camera("ORTHOGRAPHIC", frame, (-1.0, 1.0, -1.0, 1.0), (PIXELS, PIXELS)),
        (floor, box_mesh()),
        (Instances("floor", 0, HERE[None], (0,)), Instances("boxes", 1, places, (1,))),
        (matt((0.7,) * 3), matt((0.9,) * 3)),
        lights=(lamp(at=(2.0, 1.5, 2.5)),),
    )


def test_small_things_make_no_spots() -> None:
    """Discs among them are narrow; where these light what gather rays meet, spots are 6 times as
    bright as all bounced light is in the mean, and the relative RMSE is 0.46.
    """
    few, many = (added(clutter(), bounces=4, samples=n) for n in (64, 1024))
    off = (few - many)[..., 0] / many.mean()
    assert np.sqrt((off**2).mean()) < 0.2
    assert np.abs(off).max() < 2
    assert abs(off.mean()) < 0.02


def test_both_tracers_draw_the_same() -> None:
    native, exact = (added(clutter(), backend, 2, samples=4) for backend in BACKENDS)
    off = np.abs(native - exact).max(2) / np.maximum(exact.max(2), 0.1 * exact.mean())
    assert (off > 1e-4).mean() < 0.01  # edges


def test_wide_discs_are_as_wide_as_points_are_dense_but_for_the_largest() -> None:
    light = bounced_light(clutter(), 2)
    assert light is not None
    assert light.bounces is not None
    table = bounced_table(light, 64, 32)
    assert table.wide is not None
    grown = table.wide / table.spread
    assert grown.min() == 1
    assert 1 < np.median(grown) < grown.max() <= 16  # of their area discs keep a 16th at least
    radii = np.sqrt(merged(table.wide, 32, MERGED))
    assert (radii[grown > 1] <= table.near * (1 + 1e-12)).all()
