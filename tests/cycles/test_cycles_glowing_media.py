"""What volumes that glow light, beside Cycles, where rays of lit surfaces and smoke find them."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes
from cycles_reference import bpy
from glint.addon.export.geometry.volumes import openvdb
from glint_picture import render_glint
from small_scenes import add, add_camera, lambert, moved, new_material, plane
from test_cycles_media import box, linked, relative
from volume_files import NEEDED, two_blobs, write_grids

SIZE = 24
SQUARE = 4


def pictures(scene, truth: int = 256, **settings):
    """(h, w, 3) of Glint and of Cycles, direct light and light scattered once."""
    bpy.context.view_layer.update()
    given = {"samples": 64, "light_samples": 2, "max_bounces": 0, "filter_width": 0.0, **settings}
    film = render_glint(scene, "NATIVE", **given)
    cycles.make_exact(scene, truth)
    cycles.march_volumes(scene)
    exact = cycles.render_passes(scene)["Combined"]
    return film.passes["Combined"][..., :3].astype(float), exact[..., :3].astype(float)


def assert_alike(found, truth, mean: float = 0.01, squares: float = 0.05) -> None:
    assert np.isfinite(found).all()
    assert found.mean() == pytest.approx(truth.mean(), rel=mean)
    n = len(found) // SQUARE
    blocks = (p.reshape(n, SQUARE, n, SQUARE, 3).mean((1, 3)) for p in (found, truth))
    assert relative(*blocks) < squares


def floored():
    """A floor, alone: it throws no light on itself."""
    scene = cycles.empty_scene(SIZE, SIZE)
    add(scene, "floor", plane(6, lambert((0.8, 0.7, 0.6))), moved(0, 0, -1.2))
    add_camera(scene, (3.3, -6.0, 4.0), (0, 0, -0.6), angle=0.7)
    return scene


def glow(name: str = "ShaderNodeEmission", **inputs):
    material, _, output = new_material("gas")
    linked(name, output, **inputs)
    return material


def test_a_cube_above_a_plane() -> None:
    scene = floored()
    box(scene, glow(Color=(1, 0.6, 0.3, 1), Strength=1.0), 0.6, (0.2, 0.1, 0.0))
    assert_alike(*pictures(scene))


def test_a_cube_that_absorbs_and_a_post() -> None:
    scene = floored()
    inputs = {"Color": (0, 0, 0, 1), "Emission_Strength": 2.0, "Density": 1.5}
    box(scene, glow("ShaderNodeVolumePrincipled", **inputs), 0.6, (0.2, 0.1, 0.0))
    add(scene, "post", small_scenes.cube(lambert((0, 0, 0))), moved(-1.0, 0.3, -0.7, 0.1, 0.1, 0.5))
    assert_alike(*pictures(scene))


def test_a_neon_tube_in_smoke() -> None:
    """Smoke is lit once, and lights nothing."""
    scene = floored()
    box(scene, glow("ShaderNodeVolumeScatter", Color=(0.9, 0.8, 0.7, 1), Density=0.3), 1.1)
    mesh = small_scenes.cube(glow(Color=(1, 0.3, 0.2, 1), Strength=20.0))
    tube = add(scene, "tube", mesh, moved(0, 0, 0, 0.8, 0.06, 0.06))
    tube.rotation_euler = (0.3, 0.4, 0.5)
    found, truth = pictures(scene, 1024)
    assert_alike(found, truth, mean=0.02, squares=0.08)


@pytest.mark.skipif(openvdb() is None, reason=NEEDED)
def test_a_fire_of_a_file(tmp_path) -> None:
    scene = floored()
    values = two_blobs(24)
    path = write_grids(tmp_path / "fire.vdb", 1 / 12, (-1 + 1 / 24,) * 3, density=values)
    data = bpy.data.volumes.new("Fire")
    data.filepath = path
    material, tree, output = new_material("fire")
    inputs = {"Color": (0.2, 0.2, 0.2, 1), "Density": 1.0, "Emission_Color": (1, 0.4, 0.1, 1)}
    node = linked("ShaderNodeVolumePrincipled", output, **inputs)
    told = tree.nodes.new("ShaderNodeVolumeInfo")
    strength = tree.nodes.new("ShaderNodeMath")
    strength.operation, strength.inputs[1].default_value = "MULTIPLY", 6.0
    tree.links.new(told.outputs["Density"], strength.inputs[0])
    tree.links.new(strength.outputs[0], node.inputs["Emission Strength"])
    data.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("Fire", data))
    assert_alike(*pictures(scene, 512), mean=0.02)
