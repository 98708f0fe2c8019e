"""Shadow catchers against Cycles: the picture over a transparent film and over the world, and the
pass.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint, surface_interior
from small_scenes import add, add_camera, add_light, ball, cube, lambert, moved, new_material, plane

SIZE = 40, 30


def glow(strength: float):
    material, tree, output = new_material("Glow")
    node = tree.nodes.new("ShaderNodeEmission")
    node.inputs["Strength"].default_value = strength
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def caught(world=(0.0, 0.0, 0.0)):
    """A coloured floor that catches shadows, a box on it."""
    scene = cycles.empty_scene(*SIZE)
    cycles.set_world(scene, world)
    add(scene, "Floor", plane(6.0, lambert((0.8, 0.4, 0.2)))).is_shadow_catcher = True
    add(scene, "Box", cube(lambert((0.2, 0.3, 0.8))), moved(0, 0, 0.61, 0.6, 0.6, 0.6))
    add_camera(scene)
    return scene


def lamps():
    """A panel and a coloured lamp; a second catcher that the box's shadow falls on."""
    scene = caught()
    add(scene, "Step", cube(lambert((0.5, 0.5, 0.5))), moved(-1.6, 0.8, 0.3, 0.5, 0.8, 0.3))
    bpy.data.objects["Step"].is_shadow_catcher = True
    add_light(scene, "AREA", (2, 1, 3), energy=200.0, size=0.6)
    add_light(scene, "POINT", (-3, -2, 4), energy=300.0, color=(1.0, 0.3, 0.1))
    return scene


def sky():
    return caught((0.3, 0.5, 0.7))


def panel():
    """What glows throws light on the catcher, which has less without it."""
    scene = caught()
    add_light(scene, "SUN", (3, 1, 4), energy=1.0)
    bpy.data.objects["Box"].data.materials[0] = glow(2.0)
    return scene


def sun():
    scene = caught((0.2, 0.3, 0.4))
    add(
        scene, "Ball", ball(material=lambert((0.7, 0.7, 0.7))), moved(1.6, -0.4, 0.5, 0.5, 0.5, 0.5)
    )
    add_light(scene, "SUN", (3, 1, 4), energy=3.0)
    return scene


SCENES = {"lamps": lamps, "sky": sky, "panel": panel, "sun": sun}


def of_cycles(scene, as_pass: bool) -> dict[str, np.ndarray]:
    bpy.context.view_layer.cycles.use_pass_shadow_catcher = as_pass
    cycles.make_exact(scene, 256)
    return cycles.render_passes(scene)


SAMPLES = {"SHARED": 32, "RESOLVED": 64}


@pytest.mark.parametrize("soft_light", SAMPLES)
@pytest.mark.parametrize("name", SCENES)
def test_shadow_catchers_show_what_cycles_shows(name: str, soft_light: str) -> None:
    """At pixels' centres, away from edges of things; what is left is Cycles' noise, and how many
    points lights have.
    """
    scene = SCENES[name]()
    plan = {"samples": SAMPLES[soft_light], "light_samples": 4, "soft_light": soft_light}
    plan |= {"filter_width": 0.0, "mesh_light": "ON"}
    plan["passes"] = frozenset({"Shadow Catcher"})
    film = render_glint(scene, "NATIVE", **plan).passes
    passes = of_cycles(scene, True)
    inside = surface_interior(passes)
    truth = passes["Shadow Catcher"]
    assert (np.abs(truth - 1)[inside] > 0.1).mean() > 0.02, "nothing is caught"
    assert_alike(film["Shadow Catcher"][inside], truth[inside], "Shadow Catcher")
    plan["passes"] = frozenset()
    for transparent in (True, False):
        scene.render.film_transparent = transparent
        ours = render_glint(scene, "NATIVE", **plan).combined
        truth = of_cycles(scene, False)["Combined"]
        assert_alike(ours[inside], truth[inside], f"transparent {transparent}")


def assert_alike(ours: np.ndarray, truth: np.ndarray, what: str) -> None:
    apart = np.abs(ours.astype(float) - truth) / np.maximum(1.0, np.abs(truth))
    assert np.sqrt((apart**2).mean()) < 0.02, what
    assert np.quantile(apart, 0.99) < 0.05, what
