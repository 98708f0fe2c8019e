"""The Sky Texture beside Cycles: what is seen of it, on surfaces, and the light that it gives."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import BACKENDS, render_glint, render_pair
from small_scenes import add, add_camera, ball, cube, lambert, moved, plane
from test_cycles_world import WorldTree

KINDS = ("PREETHAM", "SINGLE_SCATTERING", "MULTIPLE_SCATTERING")
SKIES = {
    "plain": {},
    "no_disc": {"sun_disc": False},
    "low": {"sun_elevation": 0.03, "sun_rotation": 0.1, "altitude": 3000.0},
    "below": {"sun_elevation": -0.05},
    "beyond": {"sun_elevation": 2.8, "sun_rotation": 3.4, "ozone_density": 3.0},
    "thick": {"air_density": 2.0, "aerosol_density": 4.0, "sun_intensity": 0.3},
}
QUICK = ("plain", "below", "beyond")
"""Of the kind whose tables take seconds."""
PHYSICAL = [
    pytest.param(
        kind,
        name,
        marks=pytest.mark.slow if kind == KINDS[2] and name not in QUICK else (),
    )
    for kind in KINDS[1:]
    for name in SKIES
]


def set_up(node, kind: str, **properties):
    usual = {"sun_elevation": 0.3, "sun_rotation": 0.2, "sun_size": 0.15}
    usual |= {"sun_direction": (0.2, 0.5, 0.4), "turbidity": 3.0, "sky_type": kind}
    for name, value in {**usual, **properties}.items():
        setattr(node, name, value)
    return node


def assert_alike(pair, where) -> None:
    """Relative to the brightest channel, but for the texels round the sun's limb."""
    found, wanted = (p["Combined"][..., :3][where] for p in (pair.glint, pair.cycles))
    error = np.abs(found - wanted).max(-1) / np.maximum(wanted.max(-1), 0.01)
    assert wanted.std() > 1e-3
    assert np.percentile(error, 99) <= 1e-3, np.sort(error)[-20:]


@pytest.mark.parametrize(
    ("kind", "name"), [("PREETHAM", "plain"), *PHYSICAL], ids=lambda value: value
)
def test_what_is_seen_is_cycles(kind, name):
    """From below the horizon to above the sun."""
    scene = cycles.empty_scene(64, 48)
    add_camera(scene, location=(0, 0, 0), target=(0.3, 1, 0.2))
    world = WorldTree(scene)
    world.shine(set_up(world.add("ShaderNodeTexSky"), kind, **SKIES[name]).outputs[0])
    scene.world.cycles.sampling_method = "NONE"  # it lights nothing
    pair = render_pair(scene, "NATIVE", f"sky-{kind}-{name}", world_light="CONSTANT")
    assert_alike(pair, np.s_[:])


@pytest.mark.parametrize(
    ("turbidity", "elevation", "albedo"), [(2.2, 0.15, 0.3), (2.2, 0.9, 0.3), (5.0, 0.4, 0.8)]
)
def test_the_sky_of_hosek_and_wilkie_is_as_bright(turbidity, elevation, albedo):
    """All of it above the horizon; Preetham's own would be 4 to 11 times as bright."""
    scene = cycles.empty_scene(64, 32)
    add_camera(scene, location=(0, 0, 0), target=(0, 1, 0), type="PANO")
    lens = scene.camera.data if bpy.app.version >= (5, 0, 0) else scene.camera.data.cycles
    lens.panorama_type, lens.latitude_min = "EQUIRECTANGULAR", 0.0
    world = WorldTree(scene)
    sun = (0.0, np.cos(elevation), np.sin(elevation))
    sky = world.add("ShaderNodeTexSky")
    set_up(sky, "HOSEK_WILKIE", turbidity=turbidity, sun_direction=sun, ground_albedo=albedo)
    world.shine(sky.outputs[0])
    pair = render_pair(scene, "NATIVE", "sky-hosek", world_light="CONSTANT")
    share = np.cos((np.arange(32) + 0.5) / 32 * np.pi / 2)[:, None, None]
    found, wanted = (
        (p["Combined"][..., :3] * share).mean((0, 1)) for p in (pair.glint, pair.cycles)
    )
    np.testing.assert_allclose(found, wanted, rtol=0.06)


@pytest.mark.parametrize(
    ("kind", "backend"),
    [
        (kind, backend)
        for kind in KINDS
        for backend in BACKENDS
        # both tracers read its tables alike
        if (kind, backend) != ("MULTIPLE_SCATTERING", "NUMPY")
    ],
)
def test_on_a_surface_is_cycles(kind, backend):
    """By the normal, which may be of any length."""
    scene = cycles.empty_scene(48, 48)
    material = bpy.data.materials.new("sky")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    where, sky, shine, end = (
        tree.nodes.new(f"ShaderNode{name}")
        for name in ("NewGeometry", "TexSky", "Emission", "OutputMaterial")
    )
    set_up(sky, kind, sun_disc=False)
    tree.links.new(where.outputs["Normal"], sky.inputs[0])
    tree.links.new(sky.outputs[0], shine.inputs["Color"])
    tree.links.new(shine.outputs[0], end.inputs["Surface"])
    add(scene, "ball", ball(64, 32, True, material), moved(0, 0, 0, 1.5, 1.5, 1.5))
    add_camera(scene)
    pair = render_pair(scene, backend, f"sky-surface-{kind}")
    assert_alike(pair, pair.cycles["Combined"][..., 3] == 1)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0095, 0.1])
@pytest.mark.parametrize("kind", KINDS[1:])
def test_the_light_of_the_sky_and_its_sun_is_cycles(kind, size):
    scene = cycles.empty_scene(32, 21)
    add(scene, "floor", plane(8, lambert((0.6, 0.6, 0.6))))
    add(scene, "ball", ball(64, 32, True, lambert((0.7, 0.3, 0.2))), moved(1.2, 0, 1))
    add(scene, "cube", cube(lambert((0.3, 0.5, 0.7))), moved(-1.2, 0.3, 0.8, 0.8, 0.8, 0.8))
    add_camera(scene, location=(0.5, -6, 3.0), target=(0, 0, 0.8))
    world = WorldTree(scene)
    sky = set_up(world.add("ShaderNodeTexSky"), kind, sun_size=size, sun_elevation=0.6)
    world.shine(sky.outputs[0])
    film = render_glint(scene, "NATIVE", max_bounces=0, samples=64, light_samples=2, filter_width=0)
    wanted = cycles.render_cycles(scene, 64)["Combined"][..., :3]
    ground = wanted.max(-1) < 1e3
    error = (film.passes["Combined"][..., :3] - wanted)[ground]
    assert np.sqrt(np.mean(error**2)) <= 0.05 * wanted[ground].mean()
    assert abs(error.mean()) <= 0.02 * wanted[ground].mean()
