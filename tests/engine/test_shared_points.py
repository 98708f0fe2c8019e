"""Pixels of a block that show one surface take turns with the points of bounced light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import HERE, added, each_asks, matt
from glint.engine import Settings, render
from glint.engine.reference.blocks import Shares, Turns
from glint.engine.reference.shared_lamps import choose
from glint.engine.scene import Instances, Scene
from test_bounced_discs import PIXELS, WIDE, floor_points
from test_gathering import BACKENDS, WALL, quad, wall_with_ends

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


def screened(scene: Scene) -> Scene:
    """With a black screen before the wall, which the camera does not see."""
    at, black = WALL + 0.15, len(scene.materials)
    screen = quad((at, -0.3, 0.1), (at, 0.3, 0.1), (at, 0.3, 0.4), (at, -0.3, 0.4))
    thing = Instances("screen", len(scene.geometries), HERE[None], (black,), visible_camera=False)
    return replace(
        scene,
        geometries=(*scene.geometries, screen),
        instances=(*scene.instances, thing),
        materials=(*scene.materials, matt((0.0,) * 3)),
    )


def by_blocks(light: np.ndarray) -> np.ndarray:
    half = PIXELS // 2
    return light.reshape(half, 2, half, 2, 3).mean((1, 3))


@pytest.mark.parametrize(
    ("backend", "samples", "most"), [("NATIVE", 256, 0.01), ("NUMPY", 32, 0.03)]
)
def test_each_gets_what_it_gives_back_in_the_shadows_that_all_find(
    backend: str, samples: int, most: float
) -> None:
    """The light on a block is that which its pixels find where each traces all rays, whatever
    they give back of it.
    """
    scene = screened(two_floors())
    found, own = (added(some, backend, samples=samples) for some in (scene, each_asks(scene)))
    albedo = np.where(floor_points()[..., :1] < 2 * WIDE / PIXELS, DARK, LIGHT)
    off, light = by_blocks((found - own) / albedo), by_blocks(own / albedo)
    assert 0 < np.abs(off).mean() < most * light.mean()
    edge = slice(PIXELS // 4 - 1, PIXELS // 4 + 2)
    assert np.abs(off[:, edge]).mean() < most * light[:, edge].mean()


def test_a_block_sends_fewer_rays_than_its_pixels_would() -> None:
    for backend in BACKENDS:
        settings = Settings(
            samples=4, light_samples=32, filter_width=0.0, diffuse_bounces=1, backend=backend
        )
        scenes = two_floors(), each_asks(two_floors())
        shared, own = (render(scene, settings).stats["shadow rays"] for scene in scenes)
        assert shared < 0.95 * own  # the points are few, and several rays to one are one


def test_turns() -> None:
    """Pixels 0 to 3 are a group, 4 and 6 one, 5 is alone, 7 and 8 are apart. Of four each has its
    turn in every fourth sample, which lie in one part of the pixel.
    """
    x, normal = np.zeros((2, 3, 9))
    matt = np.array([[0.2, 0.4, 0.2, 0.2, 0.5, 1.0, 0.5, 0.1, 0.1]] * 3)
    matt[2, :4] = 0.0
    members = np.array([[0, 1, 2, 3], [4, 6, -1, -1], [7, 8, -1, -1]])
    is_apart = np.arange(9) >= 7
    shares = Shares(np.array([0, 0, 0, 0, 1, -1, 1, 2, 2]), members, is_apart, x, normal, matt)
    pixel = np.array([1, 0, 2, 3, 8, 4, 5, 6, 7])
    turns = [shares.turns(pixel, sample) for sample in range(16)]
    assert turns[0].count.tolist() == [4, 4, 4, 4, 1, 2, 1, 2, 1]
    assert turns[0].number.tolist() == [1, 0, 2, 3, 0, 0, 0, 1, 0]
    for part in range(4):
        of_one = np.stack([turns[sample].number for sample in range(part, 16, 4)])
        assert (np.sort(of_one[:, :4], axis=0) == np.arange(4)[:, None]).all()
    # what they find together, each by what it gives back; 1 gives back twice as much as 0
    found = turns[0].of_all(np.array([[4.0, 1, 1, 0, 7, 2, 3, 4, 8]] * 3))
    assert found[0] == pytest.approx([8, 4, 4, 4, 7, 6, 3, 6, 8])
    assert found[2] == pytest.approx([4, 1, 1, 0, 7, 6, 3, 6, 8])


def test_marks_are_dealt_out() -> None:
    """Each to one point of a group."""
    given = np.random.default_rng(3).random((12, 4)) ** 4
    given[:, 1:] = given[:, :1]
    all_ = choose(given, 4, 5)
    assert (all_.sum(0) == 4).all()
    for count in (1, 2, 3, 4):
        turns = Turns(np.arange(4) % count, np.full(4, count), np.zeros(4, int), np.ones((3, 4)))
        dealt = choose(given, 4, 5, turns)[:, :count]
        assert (dealt.sum(1) == all_[:, 0]).all()


def test_each_has_its_own_light() -> None:
    """Where nothing hides the wall it is to the bit what it is where all look for shadows."""
    scene = two_floors()
    found, own = (added(some, samples=16) for some in (scene, each_asks(scene)))
    assert found.max() > 0.01
    np.testing.assert_array_equal(found, own)
