"""Which of the points of bounced light are taken, and what these give for the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import ALBEDO, BACKENDS, HERE, added, lamp, matt, room
from engine_scenes import box_mesh
from glint.engine import Settings, render
from glint.engine.lights.bounced_light import bounced_light, bounced_table
from glint.engine.scene import Bounces, Camera, Instances, Light, Scene
from test_gathering import quad

EACH = 16


def corner() -> Scene:
    """A red wall, a green one and a white floor, lit by two lamps of light groups of their own."""
    floor = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    left = quad((-1, -1, 0), (-1, 1, 0), (-1, 1, 1), (-1, -1, 1))
    right = quad((1, -1, 0), (1, -1, 1), (1, 1, 1), (1, 1, 0))
    walls = (floor, left, right)
    materials = (matt((0.8,) * 3), matt((0.8, 0.05, 0.05)), matt((0.05, 0.8, 0.05)))
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 3.0)])
    return Scene(
        Camera("ORTHOGRAPHIC", frame, (-0.9, 0.9, -0.9, 0.9), (16, 16)),
        walls,
        tuple(Instances(f"{k}", k, HERE[None], (k,)) for k in range(3)),
        materials,
        lights=(
            replace(lamp(at=(-0.6, 0.2, 0.8)), light_group=0),
            replace(lamp(at=(0.5, -0.3, 0.4)), light_group=1),
        ),
        light_groups=("near left", "near right"),
    )


def points_of(light: Light | None) -> Bounces:
    assert light is not None
    assert light.bounces is not None
    return light.bounces


def power(b: Bounces) -> np.ndarray:
    """(m, 3) of each point: its radiance times the area that it stands for."""
    return b.radiance * (b.spreads * b.weights / b.weights.sum())[:, None]


@pytest.mark.parametrize("samples", [2, 8, 64, 600])
def test_few_points_give_what_all_do(samples: int) -> None:
    """To the last digits, of each side, of either lamp, and of what ends a walk."""
    light = bounced_light(corner(), 3)
    b = points_of(light)
    table = bounced_table(light, samples, EACH)
    given = table.front * (table.spread / len(table.point))[:, None]
    assert len(b.weights) > 7000
    for axis, sign in ((0, 1), (0, -1), (2, 1)):
        for group in (0, 1):
            of_all = (b.normals[:, axis] * sign > 0.9) & (b.light_group == group)
            taken = (table.normal[:, axis] * sign > 0.9) & (table.light_group == group)
            assert taken.any()
            np.testing.assert_allclose(given[taken].sum(0), power(b)[of_all].sum(0), rtol=1e-9)
    if samples >= 64:  # else some sides have none that end a walk
        np.testing.assert_allclose(given[table.last].sum(0), power(b)[b.last].sum(0), rtol=1e-9)


def test_points_that_are_all_taken_keep_what_is_theirs() -> None:
    light = bounced_light(corner(), 2)
    b = points_of(light)
    table = bounced_table(light, 1024, 128)  # so many that the weakest are among them
    own = {tuple(p): given for p, given in zip(b.points, power(b), strict=True)}
    found = dict.fromkeys(own, 0.0)
    for p, front, spread in zip(table.point, table.front, table.spread, strict=True):
        found[tuple(p)] = found[tuple(p)] + front * spread / len(table.point)
    assert all(np.any(given) for given in found.values())
    for p, given in own.items():
        np.testing.assert_allclose(found[p], given, rtol=1e-9)


def test_light_stays_on_its_side_of_a_wall() -> None:
    """A box with walls a thousandth thick, a hundred times as bright outside as inside."""
    placed = [s * np.eye(3, 4)[None] for s in (1.0, 0.998)]
    scene = Scene(
        Camera("ORTHOGRAPHIC", np.eye(3, 4), (-1.0, 1.0, -1.0, 1.0), (4, 4)),
        (box_mesh(),),
        tuple(Instances(f"{k}", 0, m, (0,)) for k, m in enumerate(placed)),
        (matt(ALBEDO),),
        lights=(lamp(at=(0.0, 0.0, 5.0)), lamp(at=(0.1, 0.2, 0.3), strength=1.0)),
    )
    light = bounced_light(scene, 2)
    b = points_of(light)
    assert light is not None
    middle = light.world_from_light[:, 3]
    inside = ((b.points + middle) * b.normals).sum(1) < 0  # it faces the middle
    assert 100 < inside.sum() < len(inside) - 100
    table = bounced_table(light, 16, EACH)
    given = table.front * (table.spread / len(table.point))[:, None]
    taken = ((table.point + middle) * table.normal).sum(1) < 0
    assert taken.any()
    np.testing.assert_allclose(given[taken].sum(0), power(b)[inside].sum(0), rtol=1e-9)


def test_the_first_samples_look_at_all_sides() -> None:
    """Pixels that stop early have seen each wall as often as its share of the table says."""
    table = bounced_table(bounced_light(corner(), 3), 64, EACH)
    first = table.normal[: 4 * EACH]
    for axis, sign in ((0, 1), (0, -1), (2, 1)):
        of_all, of_first = ((n[:, axis] * sign > 0.9).mean() for n in (table.normal, first))
        assert abs(of_first - of_all) < 2.5 / (4 * EACH)


def test_few_samples_are_as_bright_as_many() -> None:
    """Where each point gives what its chance says, 8 samples lack 12.6 % of the red."""
    few, many = (added(corner(), bounces=3, samples=n).mean((0, 1)) for n in (8, 1024))
    assert np.abs(few / many - 1).max() < 0.04


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_gather_rays_meet_asks_for_a_quarter_of_the_shadows(backend: str) -> None:
    """One where a pixel asks for four, and none of light that has bounced as often as asked."""
    settings = Settings(samples=4, light_samples=1, filter_width=0.0, backend=backend)
    once, twice = (render(room(lamp()), replace(settings, diffuse_bounces=n)).stats for n in (1, 2))
    assert twice["gather rays"] == once["gather rays"] > 0
    added = twice["shadow rays"] - once["shadow rays"]
    assert 0 < added < twice["gather rays"]
