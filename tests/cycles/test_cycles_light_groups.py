"""Passes of light groups against Cycles: sun, panels that glow, world, a lamp of no group."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint, surface_interior
from small_scenes import (
    add,
    add_camera,
    add_light,
    cube,
    lambert,
    looking_at,
    mirror,
    moved,
    plane,
)
from test_cycles_mesh_lights import glow

NAMES = ("Sun", "Panels", "World", "Carried")


def scene_of_groups():
    """A wall and a mirror in all that light. A carried panel is in a group, what carries it in
    another.
    """
    scene = cycles.empty_scene(40, 30)
    cycles.set_world(scene, (0.2, 0.3, 0.5), 0.6)
    layer = bpy.context.view_layer
    for name in NAMES:
        layer.lightgroups.add(name=name)
    add(scene, "Floor", plane(5.0, lambert((0.7, 0.6, 0.5))))
    add(scene, "Wall", cube(lambert((0.8, 0.2, 0.1))), moved(-1.5, 1.5, 1.0, 0.2, 2.0, 1.0))
    add(scene, "Mirror", cube(mirror((0.9, 0.8, 0.7))), moved(1.1, 0.6, 0.7, 0.6, 0.6, 0.7))
    add_light(scene, "SUN", (3, 1, 4), energy=2.0).lightgroup = "Sun"
    add_light(scene, "POINT", (-0.5, -1.5, 1.5), energy=60.0).lightgroup = "Elsewhere"
    at = looking_at((0.3, -1.0, 2.4), (0, 0, 0))
    add(scene, "panel", plane(0.4, glow((1, 0.7, 0.4), 5.0)), at).lightgroup = "Panels"
    inner = bpy.data.objects.new("inner", plane(0.4, glow((0.4, 0.7, 1.0), 5.0)))
    inner.lightgroup = "Carried"
    part = bpy.data.collections.new("part")
    part.objects.link(inner)
    carrier = add(scene, "carrier", None, looking_at((2.4, 1.6, 2.2), (0.5, 0, 0)))
    carrier.instance_type, carrier.instance_collection = "COLLECTION", part
    carrier.lightgroup = "Panels"
    scene.world.lightgroup = "World"
    add_camera(scene)
    return scene


@pytest.fixture(scope="module")
def both() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    scene = scene_of_groups()
    plan = {"samples": 64, "light_samples": 2, "filter_width": 0.0, "max_bounces": 8}
    passes = frozenset({"Position"})
    lit = {
        "diffuse_bounces": 4,
        "soft_light": "DEALT",
        "mesh_light": "ON",
        "world_light": "OCCLUDED",
        "reflective_caustics": "OFF",
    }
    ours = render_glint(scene, "NATIVE", passes=passes, **plan, **lit).passes
    cycles.make_exact(scene, 2048, bounces=8)
    scene.cycles.diffuse_bounces = 4
    scene.cycles.caustics_reflective = False
    return ours, cycles.render_passes(scene)


@pytest.mark.parametrize("name", NAMES)
def test_they_are_those_of_cycles(name: str, both) -> None:
    ours, truth = both
    inside = surface_interior(truth)
    found = ours[f"Light Group {name}"][inside].astype(float)
    wanted = truth[f"Combined_{name}"][inside]
    error = np.sqrt(((found - wanted) ** 2).mean()) / wanted.mean()
    assert abs(found.mean() / wanted.mean() - 1) < 0.03
    assert error < 0.08


def test_they_are_less_than_all_by_the_light_of_no_group(both) -> None:
    ours, truth = both
    inside = surface_interior(truth)
    rest = truth["Combined"][..., :3] - sum(truth[f"Combined_{name}"] for name in NAMES)
    own = ours["Combined"][..., :3] - sum(ours[f"Light Group {name}"] for name in NAMES)
    assert abs(own[inside].mean() / rest[inside].mean() - 1) < 0.03
    assert own[inside].mean() > 0.05
