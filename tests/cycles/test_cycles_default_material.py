"""An object without a material: a grey diffuse surface up to Blender 4.5, from 5.0 on a Principled
BSDF with the node's defaults.
"""

import numpy as np

import cycles_reference as cycles
import small_scenes as build
from cycles_reference import bpy
from glint_picture import render_glint


def build_floor(material=None):
    scene = cycles.empty_scene(48, 48)
    build.add(scene, "Floor", build.plane(5.0, material))
    build.add_camera(scene, (0.5, -4.0, 3.0))
    build.add_light(scene, "SUN", (0.5, 4.0, 3.5), energy=2.0)
    return scene


def newborn_principled():
    material, tree, output = build.new_material("Principled")
    tree.links.new(
        tree.nodes.new("ShaderNodeBsdfPrincipled").outputs["BSDF"], output.inputs["Surface"]
    )
    return material


def grey():
    return build.lambert((0.8, 0.8, 0.8))


STAND_IN, OTHER = (
    (newborn_principled, grey) if bpy.app.version >= (5, 0, 0) else (grey, newborn_principled)
)
"""What this version's default surface should be, and what the other versions have."""


def test_cycles_default_is_the_stand_in():
    """Against the sun, where the kinds differ most."""
    without = cycles.render_cycles(build_floor(), 16)["Combined"]
    with_it, other = (
        cycles.render_cycles(_with(make), 16)["Combined"] for make in (STAND_IN, OTHER)
    )
    assert without.max() > 0.1
    np.testing.assert_allclose(without, with_it, rtol=1e-5, atol=1e-6)
    assert np.abs(other - without).max() > 0.05 * without.max()


def test_glint_default_is_the_stand_in():
    without = render_glint(build_floor(), "NUMPY").combined
    with_it = render_glint(_with(STAND_IN), "NUMPY").combined
    assert without.max() > 0.1
    np.testing.assert_allclose(without, with_it, rtol=1e-6)


def _with(make):
    """The floor with a material made in its file."""
    scene = build_floor()
    scene.objects["Floor"].data.materials.append(make())
    return scene
