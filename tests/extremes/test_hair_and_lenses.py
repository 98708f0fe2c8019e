"""Hair of odd sizes, shapes and numbers, and lenses wide open: finite pixels, the picture of a
usual size, and a note where something is left out.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cycles"))

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export import export_scene
from glint.engine import Settings, render
from glint.engine.scene.problems import scene_problems

SIZE = (48, 36)


def hairy(size: float = 1.0, shader: str = "ShaderNodeBsdfHairPrincipled", **object_settings):
    """A tuft before a camera, both so many times as large, in suns from behind and from before."""
    scene = cycles.empty_scene(*SIZE)
    rng = np.random.default_rng(4)
    root = np.column_stack([rng.uniform(-1, 1, (60, 2)), np.zeros(60)])
    tip = root + rng.normal(0, 0.3, (60, 3)) + (0, 0, 1)
    t = np.linspace(0, 1, 4)[:, None]
    points = root[:, None] * (1 - t) + tip[:, None] * t
    data = bpy.data.hair_curves.new("Tuft")
    data.add_curves([4] * 60)
    data.attributes["position"].data.foreach_set("vector", points.astype(np.float32).ravel())
    data.attributes.new("radius", "FLOAT", "POINT")
    data.attributes["radius"].data.foreach_set("value", np.full(240, 0.03, np.float32))
    material = bpy.data.materials.new("Hair")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(tree.nodes.new(shader).outputs[0], out.inputs[0])
    data.materials.append(material)
    tuft = bpy.data.objects.new("Tuft", data)
    scene.collection.objects.link(tuft)
    tuft.scale = (size,) * 3
    for name, value in object_settings.items():
        setattr(tuft, name, value)
    for turn in (1.2, -1.2):
        lamp = bpy.data.lights.new("Sun", "SUN")
        lamp.energy = 3.0
        sun = bpy.data.objects.new("Sun", lamp)
        sun.rotation_euler = (turn, 0, 0)
        scene.collection.objects.link(sun)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -4 * size, 0.5 * size), (np.pi / 2, 0, 0)
    camera.data.clip_start, camera.data.clip_end = 0.01 * size, 100 * size
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene, tuft


def drawn(backend: str = "NATIVE", samples: int = 2):
    """The picture, and the export's notes."""
    exported = export_scene(bpy.context.evaluated_depsgraph_get())
    assert not scene_problems(exported.scene)
    film = render(exported.scene, Settings(samples=samples, light_samples=2, backend=backend))
    picture = film.combined
    assert np.isfinite(picture).all()
    return picture, exported.notes + tuple(film.notes)


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1e3, 1e6])
def test_hair_of_any_size_is_the_same_picture(size):
    hairy()
    usual, _ = drawn()
    assert usual[..., :3].max() > 0.01
    hairy(size)
    picture, _ = drawn()
    off = np.abs(picture - usual)[..., :3]
    assert np.percentile(off, 98) <= 1e-3 * usual[..., :3].max()


NUMBERS = {"zero": 0.0, "nan": np.nan, "infinite": np.inf, "huge": 3e38, "tiny": 1e-38}


@pytest.mark.parametrize("value", NUMBERS)
@pytest.mark.parametrize("what", ["radius", "position"])
def test_odd_numbers_of_some_curves_leave_the_others(what, value):
    """Half of the curves have them, and are gone or tiny at worst."""
    _, tuft = hairy()
    name, width = ("value", 1) if what == "radius" else ("vector", 3)
    values = np.empty(240 * width, np.float32)
    tuft.data.attributes[what].data.foreach_get(name, values)
    values[: 120 * width] = NUMBERS[value]
    tuft.data.attributes[what].data.foreach_set(name, values)
    for backend in ("NATIVE", "NUMPY"):
        picture, _ = drawn(backend)
        if not (what == "radius" and value in ("infinite", "huge")):
            assert picture[..., :3].max() > 0.01


@pytest.mark.parametrize("away", [1e6, 1e10])
def test_strands_that_end_far_away_keep_their_shadows(away):
    """Their float32 steps are wider there than they are."""
    _, tuft = hairy(shader="ShaderNodeBsdfDiffuse")
    places = np.empty((60, 4, 3), np.float32)
    tuft.data.attributes["position"].data.foreach_get("vector", places.reshape(-1))
    places[:, 3] = away
    tuft.data.attributes["position"].data.foreach_set("vector", places.ravel())
    pictures = [drawn(backend, samples=1)[0] for backend in ("NATIVE", "NUMPY")]
    assert pictures[1][..., :3].max() > 0.1
    alike = np.isclose(*pictures, rtol=1e-3, atol=1e-4).all(-1)
    assert alike.mean() > 0.99


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -2, 0.5), (1, 1, 0), (0, 0, 0), (1e-20, 1, 1)])
def test_mirrored_and_flattened_hair(scale):
    hairy(scale=scale)
    pictures = []
    for backend in ("NATIVE", "NUMPY"):
        picture, notes = drawn(backend)
        pictures.append(picture)
        if 0 in scale:
            assert not picture[..., :3].any() and any("Tuft" in note for note in notes), notes
        elif min(map(abs, scale)) > 1e-8:
            assert picture[..., :3].max() > 0.01
    # but where rays graze the joint of a strand that light passes
    alike = np.isclose(*pictures, rtol=1e-3, atol=1e-4)
    assert alike.mean() > 0.997


@pytest.mark.parametrize("fstop", [1e-3, 0.0, 1e6])
def test_lenses_wide_open_and_closed(fstop):
    scene, _ = hairy()
    lens = scene.camera.data.dof
    lens.use_dof, lens.focus_distance, lens.aperture_fstop = True, 4.0, fstop
    picture, _ = drawn(samples=8)
    native = picture[..., :3].mean()
    picture, _ = drawn("NUMPY", samples=8)
    assert native > 0
    np.testing.assert_allclose(native, picture[..., :3].mean(), rtol=0.01)
