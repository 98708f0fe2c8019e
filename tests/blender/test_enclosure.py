"""How much of what is round strands others hide: in closed form, at odd scales, of odd strands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.addon.export.geometry.enclosure import CELLS, enclosure, light_between
from glint.engine import scene as s

pytestmark = pytest.mark.once

RADIUS, LENGTH = 0.002, 0.1


def strands(a: np.ndarray, b: np.ndarray, radius: float = RADIUS) -> s.Strands:
    """One segment from each of the points (n, 3) a to that of b."""
    ends = np.stack([a, b], 1).reshape(-1, 3).astype(np.float32)
    starts = np.arange(0, len(ends), 2, dtype=np.uint32)
    return s.Strands("hair", ends, np.full(len(ends), radius, np.float32), starts)


def cloud(depth: float, seed: int = 1) -> s.Strands:
    """A ball of radius 1 filled evenly with strands of all directions, `depth` deep along a radius
    on average.
    """
    rng = np.random.default_rng(seed)
    volume, mean_sine = 4 / 3 * np.pi, np.pi / 4
    count = int(depth * volume / (2 * RADIUS * LENGTH * mean_sine))
    middle, along = rng.normal(size=(2, count, 3))
    middle *= (rng.uniform(size=count) ** (1 / 3) / np.linalg.norm(middle, axis=1))[:, None]
    along *= (LENGTH / 2 / np.linalg.norm(along, axis=1))[:, None]
    return strands(middle - along, middle + along)


@pytest.mark.parametrize("depth", [0.1, 0.5, 2.0])
def test_even_balls_are_as_dense_as_beer_and_lambert_say(depth):
    """In the middle 1 - e^-depth; at the rim half of the directions meet nothing, others chords."""
    made = cloud(depth)
    found, away = enclosure(made), np.linalg.norm(made.vertices, axis=1)
    middle = found[away < 0.3].mean()
    own = RADIUS * CELLS / 2  # what each strand is taken to add where it is itself
    assert abs(middle - (1 - np.exp(-depth))) < own
    tau = 2 * depth
    rim = 0.5 * (1 - (1 - np.exp(-tau)) / tau)
    assert abs(found[np.abs(away - 1) < 0.03].mean() - rim) < 0.06


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0, 1), (1, 2, 3), (1, -1, 0)])
def test_a_lone_strand_encloses_nothing(direction):
    """Nor itself, whatever it is cut to, thick as it is."""
    t = np.linspace(0, 1, 21)[:, None] * np.array(direction, float)
    assert enclosure(strands(t[:-1], t[1:], 0.02)).max() < 0.08


def test_parallel_strands_hide_little_along_themselves():
    """An upright field encloses less than as many strands of all directions, and than 0.26, which
    it would if strands hid as much of what comes along them.
    """
    rng = np.random.default_rng(2)
    root = np.column_stack([rng.uniform(-1, 1, (4000, 2)), np.full(4000, -1.0)])
    upright = enclosure(strands(root, root + (0, 0, 2.0)))
    across = rng.uniform(-1, 1, (8000, 3))
    turned = rng.normal(size=(8000, 3))
    turned *= (0.5 / np.linalg.norm(turned, axis=1))[:, None]
    mixed = enclosure(strands(across - turned, across + turned))
    assert 0.1 < upright.mean() < min(0.24, mixed.mean())


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_it_has_no_scale(scale):
    made = cloud(0.5)
    large = replace(
        made, vertices=made.vertices * np.float32(scale), radii=made.radii * np.float32(scale)
    )
    np.testing.assert_allclose(enclosure(large), enclosure(made), atol=1e-3)


def test_odd_strands_have_numbers():
    """What is not finite or has no size hides nothing, and the rest is as without it."""
    made = cloud(0.5)
    bad = np.array([[np.nan, 0, 0], [np.inf, 0, 0], [0, 0, 0], [3e38, 0, 0]], np.float32)
    vertices = np.concatenate([made.vertices, bad])
    radii = np.concatenate([made.radii, np.full(4, RADIUS, np.float32)])
    starts = np.concatenate([made.starts, len(made.vertices) + np.arange(3, dtype=np.uint32)])
    found = enclosure(s.Strands("odd", vertices, radii, starts))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[: len(made.vertices)], enclosure(made), atol=1e-12)
    for each in (replace(made, radii=np.zeros_like(made.radii)), strands(*np.zeros((2, 3, 3)))):
        assert (enclosure(each) == 0).all()
    columns = light_between(made)
    assert columns.shape == (len(made.vertices), 4) and (columns[:, 0] <= columns[:, 1]).all()
