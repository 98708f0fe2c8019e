"""The export must not be what a person waits for. Processor time, fastest of several runs: other work on the machine counts little."""

import time

import bpy
import numpy as np
import pytest

from export_support import scene  # noqa: F401
from glint.addon.export import export_scene
from test_export_instances import scatter


def _seconds(**options) -> tuple[float, dict]:
    before = time.process_time()
    stats = export_scene(bpy.context.evaluated_depsgraph_get(), **options).stats
    return time.process_time() - before, stats


@pytest.mark.slow
def test_a_million_triangles_export_in_150_ms(scene):  # noqa: F811
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=708, y_subdivisions=708, size=2)
    grid = bpy.context.object
    grid.data.polygons.foreach_set("use_smooth", np.ones(len(grid.data.polygons), bool))
    seconds = []
    for k in range(4):
        grid.data.vertices[0].co.x = k  # Blender works its normals and triangles out anew
        grid.data.update()
        bpy.context.view_layer.update()
        spent, stats = _seconds(passes=frozenset({"UV"}))
        assert stats["triangles"] > 1_000_000
        seconds.append(spent)
    assert min(seconds) < 0.15


@pytest.mark.slow
def test_a_hundred_thousand_instances_export_in_200_ms(scene):  # noqa: F811
    scatter(100_000)
    runs = [_seconds() for _ in range(5)]
    assert runs[0][1]["instances"] > 99_000
    assert min(spent for spent, _ in runs) < 0.2
