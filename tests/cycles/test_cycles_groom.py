"""A groomed head beside Cycles: Blender's own node groups for hair, one after the other."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import render_glint
from groomed_head import groomed_head, library
from test_cycles_hair import near_edges


@pytest.mark.slow
@pytest.mark.skipif(library() is None, reason="this Blender comes without hair assets")
def test_a_groomed_head_covers_the_same_pixels_and_is_as_bright():
    """At most 0.1 % of the pixels differ in cover, and those clear of edges see the same."""
    scene, _, hair = groomed_head(320, 240)
    evaluated = hair.evaluated_get(cycles.bpy.context.evaluated_depsgraph_get())
    assert len(evaluated.data.curves) > 20_000 and len(evaluated.data.points) > 500_000
    film, truth = render_glint(scene, "NATIVE"), cycles.render_cycles(scene)
    assert not film.notes
    depth, mine = truth["Depth"], film.passes["Depth"][..., 0]
    covered, seen = depth < 1e5, np.isfinite(mine) & (mine < 1e5)
    assert 0.4 < covered.mean() < 0.8
    other = (covered != seen) | (covered & seen & (np.abs(depth - mine) > 0.02))
    edges = near_edges(np.where(covered, depth, 1e5)) | near_edges(np.where(seen, mine, 1e5))
    assert (~edges & covered).mean() > 0.01
    assert (other & ~edges).mean() <= 1e-4
    assert (covered != seen).mean() <= 0.001
    theirs, ours = truth["Combined"][..., :3], film.passes["Combined"][..., :3]
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=0.03)
