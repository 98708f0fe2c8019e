"""Volume objects of OpenVDB files beside Cycles, and where it has grain beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export import export_scene
from glint.addon.export.geometry.volumes import openvdb
from glint_picture import render_glint
from volume_files import NEEDED, fog_box, two_blobs, write_grids

pytestmark = pytest.mark.skipif(openvdb() is None, reason=NEEDED)
SIZE, WIDTH = 32, 4.0


def seen(path, space="OBJECT", world=1.0, **inputs):
    """A Volume object of Principled Volume before an upright orthographic camera; its scene."""
    scene = cycles.empty_scene(SIZE, SIZE)
    cycles.set_world(scene, (world,) * 3)
    data = bpy.data.volumes.new("Cloud")
    data.filepath, data.render.space = path, space
    thing = bpy.data.objects.new("Cloud", data)
    scene.collection.objects.link(thing)
    material = bpy.data.materials.new("cloud")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new("ShaderNodeVolumePrincipled")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    data.materials.append(material)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", WIDTH, (0, 0, 10)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene, thing, node


def pictures(scene, samples: int = 128, marched: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Cycles' and ours."""
    cycles.make_exact(scene, samples)
    if marched:
        cycles.march_volumes(scene)
    scene.cycles.volume_bounces = 0
    truth = cycles.render_passes(scene)["Combined"][..., :3]
    return truth, render_glint(scene, "NATIVE", samples=16, filter_width=0.0).combined[..., :3]


def squares(picture: np.ndarray) -> np.ndarray:
    return picture.reshape(SIZE // 4, 4, SIZE // 4, 4, 3).mean((1, 3))


def through(values: np.ndarray, voxel: float, start: float) -> np.ndarray:
    """(SIZE, SIZE) the integral along z of what is straight between the middles of voxels, through
    the middles of pixels.
    """
    at = (-WIDTH / 2 + (np.arange(SIZE) + 0.5) * WIDTH / SIZE - start) / voxel
    k = np.arange(values.shape[0])
    weights = np.maximum(1 - np.abs(at[:, None] - k), 0)
    return voxel * np.einsum("ax,by,xyz->ba", weights, weights, values)


BLACK = {"Color": (0, 0, 0, 1)}


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_a_cloud_dims_what_is_behind_it_in_closed_form(tmp_path, backend):
    """Between voxels straight, in layers that tiles of the texture share; within 2e-3 in 16
    samples, of which each looks at half as many places as there are voxels.
    """
    values = two_blobs(24)
    path = write_grids(tmp_path / "cloud.vdb", 1 / 12, (-1 + 1 / 24,) * 3, density=values)
    scene, _, _ = seen(path, Density=2.0, **BLACK)
    expected = np.exp(-2 * through(values, 1 / 12, -1 + 1 / 24))
    assert expected.min() < 0.5
    film = render_glint(scene, backend, samples=16 if backend == "NATIVE" else 4, filter_width=0.0)
    np.testing.assert_allclose(
        film.combined[..., 0], expected, atol=2e-3 if backend == "NATIVE" else 8e-3
    )


def test_both_tracers_draw_the_same(tmp_path):
    values = two_blobs(24)
    color = np.stack([values > 0] * 3, -1) * np.array([1.0, 0.5, 0.2])
    grids = {"density": values, "tint": color, "heat": values}
    path = write_grids(tmp_path / "cloud.vdb", 1 / 12, (-1,) * 3, **grids)
    scene, _, _ = seen(
        path, Density=2.0, Color_Attribute="tint", Temperature_Attribute="heat",
        Temperature=1500.0, Blackbody_Intensity=0.1,
    )  # fmt: skip
    films = [render_glint(scene, backend, samples=1) for backend in ("NATIVE", "NUMPY")]
    found, expected = (film.combined for film in films)
    assert np.ptp(expected[..., 0]) > 0.1
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_glow_that_a_grid_drives_in_closed_form(tmp_path):
    """j / σ is even, so (1 - e^-τ) j / σ is seen."""
    values = two_blobs(24)
    path = write_grids(tmp_path / "fire.vdb", 1 / 12, (-1 + 1 / 24,) * 3, density=values)
    scene, _, node = seen(path, world=0.0, Density=2.0, **BLACK)
    tree = node.id_data
    told = tree.nodes.new("ShaderNodeVolumeInfo")
    tree.links.new(told.outputs["Density"], node.inputs["Emission Strength"])
    expected = (1 - np.exp(-2 * through(values, 1 / 12, -1 + 1 / 24))) / 2
    truth, mine = pictures(scene, 64)
    np.testing.assert_allclose(mine[..., 0], expected, atol=2e-3)
    assert mine.mean() == pytest.approx(truth.mean(), rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("count", [12, 24])
def test_black_bodies_of_a_grid_are_mixed_as_in_cycles(tmp_path, count):
    """What voxels glow is straight between them, not their temperature, which goes by its fourth
    power: that would be a third darker where voxels are coarse.
    """
    values = two_blobs(count)
    path = write_grids(
        tmp_path / "fire.vdb", 2 / count, (-1 + 1 / count,) * 3, density=values, temperature=values
    )
    inputs = {"Density": 2.0, "Temperature": 1500.0, "Blackbody_Intensity": 1.0}
    scene, _, _ = seen(path, world=0.0, **inputs, **BLACK)
    truth, mine = pictures(scene, 64, marched=count > 12)
    assert truth.mean() > 1e-4
    assert mine[..., :2].mean() == pytest.approx(truth[..., :2].mean(), rel=0.06)


def test_odd_temperatures_give_numbers(tmp_path):
    values = two_blobs(8)
    values[2, 2, 2], values[5, 5, 5], values[3, 3, 3] = 1e30, -1e30, 1e-30
    path = write_grids(tmp_path / "odd.vdb", 0.25, (-1,) * 3, density=values, temperature=values)
    inputs = {"Temperature": 1500.0, "Blackbody_Intensity": 1.0}
    scene, _, node = seen(path, world=0.0, **inputs)
    assert np.isfinite(render_glint(scene, "NATIVE").combined).all()
    node.inputs["Blackbody Intensity"].default_value = 0.0
    assert not render_glint(scene, "NATIVE").combined[..., :3].any()


@pytest.mark.parametrize(
    ("space", "scale", "length"),
    [
        ("OBJECT", (2, 2, 2), 1.0),
        ("WORLD", (2, 2, 2), 2.0),
        ("OBJECT", (1, 1, 3), 3 / np.sqrt(11 / 3)),
    ],
)
def test_size_thins_volumes_as_in_cycles(tmp_path, space, scale, length):
    path = write_grids(tmp_path / "fog.vdb", 0.05, (-0.525,) * 3, density=fog_box())
    scene, thing, _ = seen(path, space, Density=0.5, **BLACK)
    thing.scale = scale
    truth, mine = pictures(scene)
    assert mine[16, 16, 0] == pytest.approx(np.exp(-0.5 * length), abs=2e-3)
    assert mine.mean() == pytest.approx(truth.mean(), rel=2e-3)


def test_even_glow_fills_the_box_that_cycles_fills(tmp_path):
    """Whatever the density there: the voxels that hold something, and one more on each side."""
    path = write_grids(tmp_path / "fog.vdb", 1 / 16, (-1 + 1 / 32,) * 3, density=two_blobs())
    scene, _, _ = seen(path, world=0.0, Density=1e-3, Emission_Strength=1.0, **BLACK)
    truth, mine = pictures(scene, marched=False)
    assert mine.mean() == pytest.approx(truth.mean(), rel=0.02)


@pytest.mark.parametrize("lamp", ["sky", "SUN"])
def test_a_cloud_in_light(tmp_path, lamp):
    """Turned and stretched: means within 0.5 %, squares of 4 × 4 pixels as near as grain lets."""
    path = write_grids(tmp_path / "cloud.vdb", 1 / 16, (-1 + 1 / 32,) * 3, density=two_blobs())
    scene, thing, _ = seen(path, world=0.0, Color=(0.9, 0.7, 0.5, 1), Density=3.0)
    thing.rotation_euler, thing.scale = (0.3, 0.2, 0.5), (1.2, 0.9, 1.0)
    if lamp == "sky":
        cycles.set_world(scene, (0.2, 0.5, 1.0))
    else:
        light = bpy.data.lights.new("Lamp", lamp)
        light.energy, light.angle = 5.0, 0.02
        sun = bpy.data.objects.new("Lamp", light)
        sun.rotation_euler = (0.8, 0.4, 0)
        scene.collection.objects.link(sun)
    truth, mine = pictures(scene, 256, marched=lamp == "sky")
    assert mine.mean() == pytest.approx(truth.mean(), rel=5e-3)
    off = squares(mine) - squares(truth)
    assert np.sqrt((off**2).mean()) < 0.08 * squares(truth).mean()


def test_colour_grids(tmp_path):
    values = two_blobs()
    color = np.zeros((*values.shape, 3), np.float32)
    color[..., 0] = np.linspace(0.2, 1, 32)[:, None, None]
    color[..., 1], color[..., 2] = 0.5, np.linspace(0.2, 1, 32)
    path = write_grids(
        tmp_path / "cloud.vdb", 1 / 16, (-1 + 1 / 32,) * 3, density=values, tint=color
    )
    scene, _, _ = seen(path, Color=(1, 1, 1, 1), Density=2.0, Color_Attribute="tint")
    truth, mine = pictures(scene, 64)
    np.testing.assert_allclose(mine.mean((0, 1)), truth.mean((0, 1)), rtol=2e-3)
    off = squares(mine) - squares(truth)
    assert np.sqrt((off**2).mean()) < 0.01


def test_without_a_material_it_is_what_cycles_makes_it(tmp_path):
    path = write_grids(tmp_path / "cloud.vdb", 1 / 16, (-1 + 1 / 32,) * 3, density=two_blobs())
    scene, thing, _ = seen(path)
    thing.data.materials.clear()
    truth, mine = pictures(scene)
    assert mine.min() < 0.8
    assert mine.mean() == pytest.approx(truth.mean(), rel=2e-3)


def test_blocks_that_are_empty_are_passed(tmp_path):
    """Two far clouds: no more is asked than of one, and the picture is that of both."""
    far = np.zeros((96, 16, 16), np.float32)
    far[2:10, 4:12, 4:12] = far[84:92, 4:12, 4:12] = 1.0
    path = write_grids(tmp_path / "far.vdb", 1 / 32, (-1.5, -0.25, -0.25), density=far)
    scene, _, _ = seen(path, Density=4.0, **BLACK)
    export = export_scene(bpy.context.evaluated_depsgraph_get())
    (mesh,) = export.scene.geometries
    x = mesh.vertices[:, 0]
    assert not ((x > -1.0) & (x < 1.0)).any()
    expected = np.exp(-4 * through_x(far))
    found = render_glint(scene, "NATIVE", samples=16, filter_width=0.0).combined[..., 0]
    np.testing.assert_allclose(found[15:17], expected, atol=5e-3)


def through_x(values: np.ndarray) -> np.ndarray:
    """(2, SIZE) as `through`, of the grid above."""
    middles = -WIDTH / 2 + (np.arange(SIZE) + 0.5) * WIDTH / SIZE
    x, y = ((at - start) * 32 for at, start in ((middles, -1.5), (middles[15:17], -0.25)))
    weights = [np.maximum(1 - np.abs(at[:, None] - np.arange(n)), 0)
               for at, n in ((x, 96), (y, 16))]  # fmt: skip
    return np.einsum("ax,by,xyz->ba", *weights, values) / 32
