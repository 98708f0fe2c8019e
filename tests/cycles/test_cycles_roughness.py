"""The tables of addon/export/materials/roughness.py, and highlights beside Cycles'."""

import numpy as np
import pytest

import cycles_reference as cycles
import fit_roughness
import small_scenes as build
from cycles_reference import bpy
from glint.addon.export.materials import roughness as table
from glint_picture import render_glint, render_pair


def _ball(roughness: float, distribution: str):
    """A glossy ball under a sun of no size, which is no mirror."""
    scene = cycles.empty_scene(64, 64)
    material, tree, output = build.new_material("glossy")
    shader = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    shader.distribution = distribution
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Color"].default_value = (0.8, 0.8, 0.8, 1.0)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    build.add(scene, "ball", build.ball(48, 32, material=material))
    build.add_camera(scene, (0, -3, 0), (0, 0, 0))
    build.add_light(scene, "SUN", (2, -1.5, 1), energy=3.0)
    return scene


@pytest.mark.parametrize("distribution", ["GGX", "MULTI_GGX"])
@pytest.mark.parametrize("roughness", [0.3, 0.4, 0.5, 0.8])
def test_a_glossy_ball_is_as_bright_as_in_cycles(roughness, distribution):
    """On average, under a sun: within 1 %."""
    wanted, found = render_pair(_ball(roughness, distribution), "NATIVE", "glossy").colors()
    assert abs(found.mean() / wanted.mean() - 1) <= 0.01


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize("distribution", ["GGX", "BECKMANN", "ASHIKHMIN_SHIRLEY"])
@pytest.mark.parametrize("roughness", [0.1, 0.25, 0.6, 1.0])
def test_highlights_are_those_of_cycles(roughness, distribution, backend):
    """Of what scatters once, pixel by pixel: within 1 %, or 1e-3 of the brightest."""
    wanted, found = render_pair(_ball(roughness, distribution), backend, "highlight").colors()
    across = (np.arange(64) - 31.5) ** 2
    radius = np.sqrt((across + across[:, None])[wanted[..., 0] > 0].max())
    inside = across + across[:, None] < (radius - 1.5) ** 2
    np.testing.assert_allclose(
        found[inside], wanted[inside], rtol=0.01, atol=1e-3 * wanted[inside].max()
    )


@pytest.mark.parametrize("roughness", [0.25, 0.55, 0.95])
@pytest.mark.parametrize("kind", ["METAL", "DIELECTRIC"])
def test_what_is_reflected_of_a_world(roughness, kind):
    """To 10 % of the integral between the table's rows."""
    weight, f0 = {
        "METAL": (fit_roughness.schlick, 0.03),
        "DIELECTRIC": (fit_roughness.dielectric, 0.04),
    }[kind]
    world = table.world_of(roughness, kind)
    for cosine in (0.15, 0.3, 0.6, 1.0):
        a, b = fit_roughness.reflected(cosine, roughness, weight, 64)
        x = (1 - cosine) ** world.q
        found = f0 * (world.a0 + world.a1 * x) + (1 - f0) * (world.b0 + world.b1 * x)
        assert found == pytest.approx(f0 * a + (1 - f0) * b, rel=0.1)


def _matt_colors(scene) -> tuple[float, float]:
    """The means of Glint's and of Cycles' pass Diffuse Color."""
    film = render_glint(scene, "NUMPY", passes=frozenset({"Diffuse Color"}))
    truth = cycles.render_cycles(scene)
    name = "Diffuse Color" if "Diffuse Color" in truth else "DiffCol"
    return float(film.passes["Diffuse Color"].mean()), float(truth[name].mean())


@pytest.mark.parametrize("roughness", [0.2, 0.4, 0.55, 1.0])
@pytest.mark.parametrize("distribution", ["GGX", "MULTI_GGX"])
def test_what_lies_below_a_layer(distribution, roughness):
    """The matt colour of a plastic, from above down to 6°: to 0.015, Cycles' own table being off by
    up to 0.012.
    """
    scene = _floor(roughness, 0, 1.0, False, distribution)
    bpy.context.view_layer.use_pass_diffuse_color = True
    for elevation in (90, 30, 20, 12, 8, 6):
        _look(scene, elevation, 0)
        found, truth = _matt_colors(scene)
        assert found == pytest.approx(truth, abs=0.015), elevation


def _bend(*inputs: str) -> None:
    """Normals 53° aside for these inputs of the floor's shader."""
    tree = bpy.data.materials["Floor"].node_tree
    node = tree.nodes.new("ShaderNodeNormalMap")
    node.space = "OBJECT"
    node.inputs["Color"].default_value = (0.9, 0.5, 0.8, 1.0)
    shader = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    for name in inputs:
        tree.links.new(node.outputs[0], shader.inputs[name])


@pytest.mark.parametrize("azimuth", [0, 60, 180])
def test_what_lies_below_a_layer_with_bent_normals(azimuth):
    """From the side too to which they do not face: as the layer has them, lifted; to 0.015."""
    scene = _floor(0.2, 0, 1.0, False)
    _bend("Normal")
    bpy.context.view_layer.use_pass_diffuse_color = True
    for elevation in (90, 40, 20):
        _look(scene, elevation, azimuth)
        found, truth = _matt_colors(scene)
        assert found == pytest.approx(truth, abs=0.015), elevation


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("roughness", [0.03, 0.3, 0.6])
def test_what_lies_below_a_coat(roughness, bent):
    """From above down to 10°, where it is bent from the side that it does not face: to 0.015."""
    scene = _floor(0.5, 0, 1.0, False)
    if bent:
        _bend("Normal", "Coat Normal")
    tree = bpy.data.materials["Floor"].node_tree
    shader = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    for name, value in (("IOR Level", 0.0), ("Weight", 1.0), ("Roughness", roughness)):
        layer = "Specular" if name == "IOR Level" else "Coat"
        shader.inputs[f"{layer} {name}"].default_value = value
    bpy.context.view_layer.use_pass_diffuse_color = True
    for elevation in (90, 45, 25, 10):
        _look(scene, elevation, 180)
        found, truth = _matt_colors(scene)
        assert found == pytest.approx(truth, abs=0.015), elevation


@pytest.mark.parametrize("roughness", [0.25, 0.9])
def test_the_blinn_phong_nodes_likeness_has_the_roughness_of_its_exponent(roughness):
    """To the 5 % that addon/ui/nodes.py speaks of: its α² = 2.25/(p + 1.9) for the exponent of the
    single lobe nearest to GGX.
    """
    exponent = fit_roughness.nearest_exponent(fit_roughness.measure_lobes(roughness))
    assert (2.25 / (exponent + 1.9)) ** 0.25 == pytest.approx(roughness, rel=0.05)


@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_albedo(roughness):
    """To 0.003: a sample count of a few per normal, 9216 normals."""
    assert (
        abs(fit_roughness.measure_albedo(roughness, 8) - table.specular_albedo(roughness)) < 0.003
    )


VIEWS = ((90, 0), (10, 90), (15, 180))
"""Elevation and azimuth in degrees; at 180 the sun is mirrored."""


def _floor(
    roughness: float, metal: float, base: float, world: bool, distribution: str = "MULTI_GGX"
):
    scene = cycles.empty_scene(8, 8)
    material, tree, output = build.new_material("Floor")
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.distribution = distribution
    for name, value in (
        ("Roughness", roughness),
        ("Metallic", metal),
        ("IOR", 1.5),
        ("Base Color", (base, base, base, 1)),
    ):
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    build.add(scene, "Floor", build.plane(20.0, material))
    if world:
        cycles.set_world(scene, (1, 1, 1))
    else:
        sun = bpy.data.lights.new("Sun", "SUN")
        sun.energy, sun.angle = 3.0, 0.0
        lamp = bpy.data.objects.new("Sun", sun)
        lamp.rotation_euler = (0, np.radians(45), 0)
        scene.collection.objects.link(lamp)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 1.0
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.collection.objects.link(scene.camera)
    return scene


def _look(scene, elevation: float, azimuth: float) -> None:
    """Has the camera look at the floor's middle from so many degrees."""
    e, a = np.radians(elevation), np.radians(azimuth)
    scene.camera.location = 5 * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    scene.camera.rotation_euler = (np.pi / 2 - e, 0, a + np.pi / 2)


@pytest.mark.parametrize("world", ["", "CONSTANT", "OCCLUDED"])
@pytest.mark.parametrize("roughness", [0.3, 1.0])
@pytest.mark.parametrize(("metal", "base"), [(1, 0.8), (1, 0.03), (0, 0.0)])
def test_grazing_angles_are_those_of_cycles(metal, base, roughness, world):
    """A sun at 45° or a white world, seen from 90° down to 10°: within 15 %. Where the world lights
    by directions, highlights seen at 15° and less lose what lies below the horizon: 24 % at most.
    """
    scene = _floor(roughness, metal, base, bool(world))
    lit = (
        {"world_light": world, "samples": 16}
        if world == "OCCLUDED"
        else {"world_light": "CONSTANT"}
    )
    for elevation, azimuth in VIEWS:
        _look(scene, elevation, azimuth)
        truth = cycles.render_cycles(scene, 32)["Combined"][..., :3].mean()
        found = render_glint(scene, "NUMPY", **lit).combined[..., :3].mean()
        most = 0.24 if world == "OCCLUDED" and elevation <= 15 else 0.15
        assert found == pytest.approx(truth, rel=most), (elevation, azimuth)
