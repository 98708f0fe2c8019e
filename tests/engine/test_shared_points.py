"""Pixels of a block that show one surface take turns with the points of bounced light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import HERE, added, each_asks, matt
from glint.engine import Settings, render
from glint.engine.reference.blocks import Shares, asking
from glint.engine.scene import Instances, Scene
from test_bounced_discs import PIXELS, WIDE, floor_points
from test_gathering import BACKENDS, quad, wall_with_ends

DARK, LIGHT = (0.05, 0.4, 0.1), (0.8, 0.2, 0.3)


def two_floors() -> Scene:
    """A dark floor and a light one, side by side, that meet within blocks of pixels."""
    scene, edge = wall_with_ends(), 2 * WIDE / PIXELS
    dark = quad((-40, -40, 0), (edge, -40, 0), (edge, 40, 0), (-40, 40, 0))
    light = quad((edge, -40, 0), (40, -40, 0), (40, 40, 0), (edge, 40, 0))
    return replace(
        scene,
        geometries=(dark, scene.geometries[1], light),
        instances=(*scene.instances, Instances("light floor", 2, HERE[None], (2,))),
        materials=(matt(DARK), scene.materials[1], matt(LIGHT)),
    )


def by_blocks(light: np.ndarray) -> np.ndarray:
    half = PIXELS // 2
    return light.reshape(half, 2, half, 2, 3).mean((1, 3))


@pytest.mark.parametrize(
    ("backend", "samples", "most"), [("NATIVE", 256, 0.01), ("NUMPY", 32, 0.03)]
)
def test_each_gets_what_it_gives_back_of_what_one_finds(
    backend: str, samples: int, most: float
) -> None:
    """The light on a block is that which its pixels find where all ask for themselves, whatever
    they give back of it.
    """
    scene = two_floors()
    found, own = (added(some, backend, samples=samples) for some in (scene, each_asks(scene)))
    albedo = np.where(floor_points()[..., :1] < 2 * WIDE / PIXELS, DARK, LIGHT)
    off, light = by_blocks((found - own) / albedo), by_blocks(own / albedo)
    assert 0 < np.abs(off).mean() < most * light.mean()
    edge = slice(PIXELS // 4 - 1, PIXELS // 4 + 2)
    assert np.abs(off[:, edge]).mean() < most * light[:, edge].mean()


def test_one_of_four_asks() -> None:
    for backend in BACKENDS:
        settings = Settings(
            samples=4, light_samples=4, filter_width=0.0, diffuse_bounces=1, backend=backend
        )
        scenes = two_floors(), each_asks(two_floors())
        shared, own = (render(scene, settings).stats["shadow rays"] for scene in scenes)
        assert 0.5 * own < shared < 0.7 * own  # the others are the lamp's


def test_turns() -> None:
    """Each of four has its turn in every fourth sample, which lie in one part of the pixel."""
    members = np.array([[0, 1, 2, 3], [4, 6, -1, -1], [5, -1, -1, -1]])
    asks = [np.flatnonzero(asking(members, sample, 8)).tolist() for sample in range(16)]
    assert asks[:4] == [[0, 4, 5], [1, 5, 6], [2, 4, 5], [3, 5, 6]]
    for part in range(4):
        assert sorted(asks[sample][0] for sample in range(part, 16, 4)) == [0, 1, 2, 3]


def test_what_points_get_of_those_that_ask() -> None:
    """Pixels 0 and 1 are a group, of which 1 asks, 2 is alone, 3 and 4 are apart."""
    x, normal = np.zeros((2, 3, 5))
    matt = np.array([[0.2, 0.4, 1.0, 0.5, 0.5]] * 2 + [[0.0, 0.0, 1.0, 0.5, 0.5]])
    members = np.array([[0, 1, -1, -1], [3, 4, -1, -1]])
    asks, is_apart = np.array([0, 1, 0, 1, 0], bool), np.array([0, 0, 0, 1, 1], bool)
    shares = Shares(np.array([0, 0, -1, 1, 1]), members, asks, is_apart, x, normal, matt)
    pixel = np.array([4, 1, 0, 2, 3])
    points = shares.of_points(pixel)
    assert points.asks.tolist() == [True, True, False, True, True]
    light = np.where(points.asks, np.arange(1.0, 6.0), 0.0) * np.ones((3, 1))
    spread = points.spread(light)
    assert spread[0] == pytest.approx([1, 2, 1, 4, 5])  # 0 gives back half of what 1 does
    assert spread[2] == pytest.approx([1, 0, 0, 4, 5])
