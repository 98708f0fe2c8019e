"""HOLDOUT lobes: holes in the picture where the camera sees them, in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import scene as s
from native_tools import color, constant, draw, lamp, material, placed, square, view_from_above
from surface_scenes import agree

BACKENDS = pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
SKY = s.World(background=(1.0, 0.5, 0.25))
HOLE = s.Lobe("HOLDOUT", constant(0.5, 0.25, 0.0))
"""A quarter of alpha."""


def seen(*placed_ones: s.Instances, materials: tuple, backend: str, world=SKY, **options):
    given = s.Scene(view_from_above(), (square(),), placed_ones, materials, world=world)
    return draw(given, backend=backend, **options).combined


@BACKENDS
@pytest.mark.parametrize("transparent", [False, True])
def test_it_takes_its_share_of_alpha_and_no_colour(transparent: bool, backend: str) -> None:
    lobes = HOLE, s.Lobe("EMISSION", constant(0.125)), s.Lobe("TRANSPARENT", constant(0.25))
    world = replace(SKY, transparent=transparent)
    picture = seen(placed(), materials=(material(*lobes),), backend=backend, world=world)
    left = [0.125] * 3 + [0.5] if transparent else [0.375, 0.25, 0.1875, 0.75]
    agree(picture, np.broadcast_to(left, (16, 16, 4)))


@BACKENDS
def test_sheets_before_it_dim_the_hole(backend: str) -> None:
    veil = s.Material("veil", (s.Lobe("TRANSPARENT", constant(0.5)),))
    things = placed(0, (1,), z=1.0), placed(0, (1,), z=2.0), placed()
    picture = seen(*things, materials=(material(HOLE), veil), backend=backend)
    agree(picture, np.broadcast_to([0, 0, 0, 1 - 0.25 * 0.25], (16, 16, 4)))


@BACKENDS
@pytest.mark.parametrize("kind", ["MIRROR", "REFRACTION"])
def test_other_rays_see_nothing_there(kind: str, backend: str) -> None:
    """Neither light nor a hole, in mirrors and behind glass."""
    first = s.Material("first", (s.Lobe(kind),))
    hole = placed(0, (0,), z=12.0 if kind == "MIRROR" else -2.0)
    things = (hole, placed(0, (1,)))
    picture = seen(*things, materials=(material(HOLE), first), backend=backend, max_bounces=2)
    agree(picture, np.broadcast_to([0, 0, 0, 1], (16, 16, 4)))


@BACKENDS
def test_it_casts_a_shadow(backend: str) -> None:
    floor = s.Material("floor", (s.Lobe("DIFFUSE"),))
    sheet = placed(0, (0,), z=1.0, visible_camera=False)
    given = s.Scene(
        view_from_above(), (square(),), (sheet, placed(0, (1,))), (material(HOLE), floor),
        lights=(lamp("SUN"),),
    )  # fmt: skip
    assert not color(given, backend=backend).any()


@BACKENDS
def test_holdouts_and_catchers_have_no_use_for_it(backend: str) -> None:
    """Of a holdout all is a hole but what goes through; a catcher has what catchers show."""
    hole = material(HOLE, s.Lobe("TRANSPARENT", constant(0.25)))
    picture = seen(placed(holdout=True), materials=(hole,), backend=backend)
    agree(picture, np.broadcast_to([0.25, 0.125, 0.0625, 0.25], (16, 16, 4)))
    caught, plain = (
        seen(placed(catcher=True), materials=(m,), backend=backend)
        for m in (hole, material(*hole.lobes[1:]))
    )
    assert (caught == plain).all()
