"""Holdouts beside Cycles: holes for the camera of what their surfaces do not let through, and like
other things to all other rays; and the Holdout shader, mixed with others.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import BACKENDS, render_glint
from small_scenes import (
    add,
    add_camera,
    add_light,
    cube,
    lambert,
    looking_at,
    mirror,
    moved,
    new_material,
    plane,
)
from test_cycles_seen_passes import veil

SAMPLES = 64


def scene_over(paint=lambert, color=(0.5, 0.5, 0.5)):
    scene = cycles.empty_scene(48, 36)
    cycles.set_world(scene, (0.05, 0.05, 0.05))
    add(scene, "floor", plane(4.0, paint(color)))
    add_light(scene, "SUN", (2.0, -3.0, 5.0), energy=3.0)
    add_camera(scene)
    return scene


def held_out(scene, material):
    thing = add(scene, "held out", cube(material), moved(0, 0, 1, 0.6, 0.6, 0.6))
    thing.is_holdout = True


def assert_alike(scene, backend: str, bounces: int = 0) -> None:
    """Means of colours and alpha within what Cycles' 64 samples are off by, and each pixel."""
    settings = {"samples": 16, "max_bounces": bounces, "filter_width": 0.0}
    ours = render_glint(scene, backend, **settings).combined
    cycles.make_exact(scene, SAMPLES, bounces=bounces)
    scene.cycles.transmission_bounces, scene.cycles.transparent_max_bounces = bounces, 8
    scene.cycles.volume_bounces = 0
    theirs = cycles.render_passes(scene)["Combined"]
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=2e-3)
    assert np.sqrt(((ours - theirs) ** 2).mean()) < 0.015 * theirs.mean()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("opacity", [0.0, 0.7, 1.0])
def test_what_is_clear_is_no_hole(opacity: float, backend: str) -> None:
    scene = scene_over()
    held_out(scene, veil(opacity))
    assert_alike(scene, backend)


@pytest.mark.parametrize("backend", BACKENDS)
def test_mirrors_see_it(backend: str) -> None:
    scene = scene_over(mirror, (0.9, 0.9, 0.9))
    held_out(scene, lambert((0.8, 0.2, 0.1)))
    assert_alike(scene, backend, bounces=2)


@pytest.mark.parametrize("backend", BACKENDS)
def test_smoke_alone_is_seen(backend: str) -> None:
    scene = scene_over()
    material, tree, output = new_material("smoke")
    node = tree.nodes.new("ShaderNodeVolumeAbsorption")
    node.inputs["Density"].default_value = 1.0
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    held_out(scene, material)
    assert_alike(scene, backend)


def hole_in(shader: str, share: float | None) -> object:
    """A Holdout mixed with another shader: a share of it, None for a chequer of 0 and 1."""
    material, tree, output = new_material("hole")
    hole, other, mix = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("Holdout", shader, "MixShader")
    )
    tree.links.new(other.outputs[0], mix.inputs[1])
    tree.links.new(hole.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    if share is not None:
        mix.inputs[0].default_value = share
        return material
    pattern, place = (tree.nodes.new(f"ShaderNode{x}") for x in ("TexChecker", "TexCoord"))
    pattern.inputs["Scale"].default_value = 1.0
    tree.links.new(place.outputs["Object"], pattern.inputs["Vector"])
    tree.links.new(pattern.outputs["Fac"], mix.inputs[0])
    return material


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("share", [1.0, 0.3, None])
@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("shader", ["BsdfDiffuse", "BsdfTransparent"])
def test_the_shader_is_a_hole_of_its_share(shader, transparent, share, backend: str) -> None:
    scene = scene_over()
    scene.render.film_transparent = transparent
    add(scene, "hole", cube(hole_in(shader, share)), moved(0, 0, 1, 0.6, 0.6, 0.6))
    assert_alike(scene, backend)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("front", ["veil", "glass"])
def test_the_shader_behind_what_lets_through(front: str, backend: str) -> None:
    """A hole behind a veil, and black in the mirror below; black behind glass."""
    scene = scene_over(mirror, (0.9, 0.9, 0.9)) if front == "veil" else scene_over()
    add(scene, "hole", cube(hole_in("BsdfDiffuse", 0.5)), moved(0, 0, 1, 0.6, 0.6, 0.6))
    pane = veil(0.4)
    if front == "glass":
        pane, tree, output = new_material("glass")
        glass = tree.nodes.new("ShaderNodeBsdfRefraction")
        glass.inputs["Roughness"].default_value, glass.inputs["IOR"].default_value = 0.0, 1.0
        tree.links.new(glass.outputs[0], output.inputs["Surface"])
    thing = add(scene, "pane", plane(0.8, pane), looking_at((1.2, -1.6, 1.6), (4.2, -5.6, 4.4)))
    thing.visible_shadow = thing.visible_diffuse = False  # light passes glass here
    assert_alike(scene, backend, bounces=3)
