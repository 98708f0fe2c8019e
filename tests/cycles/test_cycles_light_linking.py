"""Light and shadow linking, beside Cycles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, cube, lambert, looking_at, moved, plane
from test_cycles_mesh_lights import glow


def collection(scene, name: str, *objects):
    made = bpy.data.collections.new(name)
    for thing in objects:
        made.objects.link(thing)
    return made


def blocks(scene):
    add(scene, "floor", plane(4, lambert((0.8, 0.8, 0.8))))
    return [
        add(
            scene,
            f"block {k}",
            cube(lambert((0.7, 0.6, 0.5))),
            moved(2 * k - 2, 0, 0.5, 0.5, 0.5, 0.5),
        )
        for k in range(3)
    ]


def included(scene, lamp, things):
    lamp.light_linking.receiver_collection = collection(scene, "lit", things[0], things[2])


def excluded(scene, lamp, things):
    made = lamp.light_linking.receiver_collection = collection(scene, "dark", things[1])
    made.collection_objects[0].light_linking.link_state = "EXCLUDE"


def nested(scene, lamp, things):
    """A collection inside the linked one, without one of its objects."""
    inner = collection(scene, "inner", *things)
    outer = collection(scene, "outer", things[0])
    outer.children.link(inner)
    outer.collection_objects[0].light_linking.link_state = "EXCLUDE"
    lamp.light_linking.receiver_collection = outer


def empty(scene, lamp, things):
    lamp.light_linking.receiver_collection = collection(scene, "none")


def shaded(scene, lamp, things):
    """Only one of the objects casts shadows."""
    lamp.light_linking.blocker_collection = collection(scene, "blockers", things[0])


def not_shaded(scene, lamp, things):
    made = lamp.light_linking.blocker_collection = collection(scene, "clear", things[0])
    made.collection_objects[0].light_linking.link_state = "EXCLUDE"


def both(scene, lamp, things):
    included(scene, lamp, things)
    not_shaded(scene, lamp, things)


@pytest.mark.parametrize("link", [included, excluded, nested, empty, shaded, not_shaded, both])
def test_a_lamp_lights_what_it_lights_in_cycles(link: Callable) -> None:
    scene = cycles.empty_scene(48, 32)
    things = blocks(scene)
    add_camera(scene)
    lamp = add_light(scene, "POINT", (1, -3, 3), energy=400)
    link(scene, lamp, things)
    bpy.context.view_layer.update()
    glint = render_glint(scene, "NATIVE").passes["Combined"][..., :3]
    reference = cycles.render_cycles(scene)["Combined"][..., :3]
    off = np.abs(glint - reference).max(2)
    assert (off > 1e-4 * reference.max()).mean() < 0.01
    assert reference.max() > 0


@pytest.mark.parametrize("link", [included, excluded, shaded, both])
@pytest.mark.parametrize("whose", ["things", "lamp"])
def test_objects_of_a_background_set_are_linked_as_in_cycles(link: Callable, whose: str) -> None:
    scene = cycles.empty_scene(48, 32)
    things = blocks(scene)
    add_camera(scene)
    lamp = add_light(scene, "POINT", (1, -3, 3), energy=400)
    link(scene, lamp, things)
    nearer = scene.background_set = bpy.data.scenes.new("nearer")
    nearer.background_set = bpy.data.scenes.new("farther")
    for thing in things[1:] if whose == "things" else [lamp]:
        nearer.background_set.collection.objects.link(thing)
        scene.collection.objects.unlink(thing)
    bpy.context.view_layer.update()
    glint = render_glint(scene, "NATIVE").passes["Combined"][..., :3]
    reference = cycles.render_cycles(scene)["Combined"][..., :3]
    assert (np.abs(glint - reference).max(2) > 1e-4 * reference.max()).mean() < 0.01
    assert reference.max() > 0


def test_instances_are_linked_as_what_places_them() -> None:
    scene = cycles.empty_scene(48, 32)
    add(scene, "floor", plane(4, lambert((0.8, 0.8, 0.8))))
    source = bpy.data.collections.new("source")
    part = bpy.data.objects.new("part", cube(lambert((0.7, 0.6, 0.5))))
    source.objects.link(part)
    placer = add(scene, "placer", None, moved(0, 0, 1))
    placer.instance_type, placer.instance_collection = "COLLECTION", source
    add_camera(scene)
    lamp = add_light(scene, "POINT", (1, -3, 4), energy=400)
    lamp.light_linking.receiver_collection = collection(scene, "lit", placer)
    bpy.context.view_layer.update()
    glint = render_glint(scene, "NATIVE").passes["Combined"][..., :3]
    reference = cycles.render_cycles(scene)["Combined"][..., :3]
    assert (np.abs(glint - reference).max(2) > 1e-4 * reference.max()).mean() < 0.01
    assert reference.max() > 0


@pytest.mark.parametrize("link", [included, shaded, both])
def test_a_panel_lights_what_it_lights_in_cycles(link: Callable) -> None:
    scene = cycles.empty_scene(48, 32)
    things = blocks(scene)
    add_camera(scene)
    panel = add(scene, "panel", plane(0.5, glow(strength=30.0)), looking_at((1, -3, 3), (0, 0, 0)))
    panel.visible_camera = False
    link(scene, panel, things)
    bpy.context.view_layer.update()
    plan = {"samples": 64, "light_samples": 2, "filter_width": 0.0, "mesh_light": "ON"}
    glint = render_glint(scene, "NATIVE", **plan).passes["Combined"][..., :3]
    cycles.make_exact(scene, 512)
    reference = cycles.render_passes(scene)["Combined"][..., :3]
    off = np.abs(glint - reference).max(2) / reference.max()
    assert np.median(off) < 0.005
    assert (off > 0.05).mean() < 0.02
    assert abs(glint.mean() / reference.mean() - 1) < 0.01
