"""The check at the API boundary: what makes a scene unfit to render, one sentence each, with
the thing's name and the remedy.

Tracers rely on it: after an empty list every array has the dtype and shape that `scene.py` says,
every index is in range, and every number is finite except vertices, centres and radii, whose
primitives the tracers drop. Flattened placements and negative light are sound.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from .camera_problems import camera_problems
from .checks import Found, array, finite_array, holds, whole
from .geometry_problems import geometry_problems, instance_problems, worth_asking
from .light_problems import dome_problems, light_problems, world_problems
from .model import Camera, Scene, World
from .model_geometry import Instances, Mesh, Polygons, Spheres, Strands
from .model_lights import Light
from .model_surfaces import Material, Texture
from .surface_problems import material_problems, texture_problems

MOST_AOVS = 256
MOST_LIGHT_GROUPS = 64


def scene_problems(scene: Scene) -> list[str]:
    """Every problem of `scene`, in the order of its fields; empty when it is sound. Reads each
    array at most twice and copies no mesh.

    Things of other classes than those of `scene.py` are told before anybody looks into them.
    """
    strangers = [*_strangers(scene)]
    if strangers:
        return strangers
    checks: tuple[tuple[Iterable[Any], Callable[[Any], Found]], ...] = (
        ((scene.camera,), camera_problems),
        (scene.geometries, geometry_problems),
        (worth_asking(scene.instances), partial(instance_problems, scene)),
        (scene.materials, partial(material_problems, len(scene.textures))),
        (scene.textures, texture_problems),
        (scene.lights, light_problems),
        ((scene.world,), world_problems),
        (scene.world.textures, texture_problems),
        *((light.textures, texture_problems) for light in scene.lights),
    )
    found = [
        f"{_label(thing)}: {text}"
        for things, check in checks
        for thing in things
        for text in check(thing)
    ]
    return [
        *found,
        *_aovs(scene),
        *_light_groups(scene),
        *dome_problems(scene.lights),
        *_neighbours(scene),
    ]


def _light_groups(scene: Scene) -> Found:
    """Groups that the scene does not have, and too many of them."""
    count = len(scene.light_groups)
    if count > MOST_LIGHT_GROUPS:
        yield f"scene has {count} light groups: use at most {MOST_LIGHT_GROUPS}"
    things: tuple[Any, ...] = (*scene.lights, *scene.instances, scene.world)
    for thing in things:
        group = thing.light_group
        if type(group) is int and -1 <= group < count:
            continue
        wrong = [*whole("light_group", group)]
        if not wrong and not -1 <= group < count:
            wrong = [f"light_group is {group}: use one of the {count}, or -1 for none"]
        yield from (f"{_label(thing)}: {text}" for text in wrong)


def _aovs(scene: Scene) -> Found:
    """Numbers of AOVs that the scene does not have, and too many of them."""
    count = len(scene.aovs)
    if count > MOST_AOVS:
        yield f"scene has {count} AOVs: use at most {MOST_AOVS}"
    for material in scene.materials if count else ():
        for lobe in material.aovs.lobes if material.aovs else ():
            if not 0 <= lobe.aov < count:
                yield f"{_label(material)}: aovs names number {lobe.aov} of {count}"


def _neighbours(scene: Scene) -> Found:
    """What is not the same thing in the frames before and after."""
    if scene.neighbours is None:
        return
    if [type(some) for some in scene.neighbours] != [Scene, Scene]:
        yield "scene: neighbours are not two scenes: give the one before and the one after, or None"
        return
    for other in scene.neighbours:
        yield from (
            f"neighbour's {_label(other.camera)}: {text}" for text in camera_problems(other.camera)
        )
        if other.camera.kind != scene.camera.kind:
            yield f"neighbour's camera is {other.camera.kind}: use {scene.camera.kind}"
        for name in ("geometries", "instances"):
            here, there = getattr(scene, name), getattr(other, name)
            if len(here) != len(there):
                yield f"neighbour has {len(there)} {name}: use {len(here)}, as the scene has"
                continue
            same = _same_shape if name == "geometries" else _same_rows
            for own, moved in zip(here, there, strict=True):
                if moved is not own:
                    yield from (f"neighbour's {_label(moved)}: {t}" for t in same(own, moved))


def _same_shape(geometry: Any, moved: Any) -> Found:
    if type(geometry) is not type(moved):
        yield f"is another kind than the scene's: use {type(geometry).__name__}"
    elif isinstance(geometry, Mesh | Strands):
        yield from array("vertices", moved.vertices, np.float32, np.shape(geometry.vertices))
    elif isinstance(geometry, Spheres):
        yield from array("centers", moved.centers, np.float32, np.shape(geometry.centers))


def _same_rows(instances: Instances, moved: Any) -> Found:
    if not isinstance(moved, Instances) or moved.geometry != instances.geometry:
        yield "has another geometry than the scene's: use the same"
        return
    shape = np.shape(instances.world_from_object)
    found = [*array("world_from_object", moved.world_from_object, np.float64, shape)]
    yield from found or finite_array("world_from_object", moved.world_from_object)


_HELD = {
    "geometries": (Mesh, Spheres, Polygons, Strands),
    "instances": (Instances,),
    "materials": (Material,),
    "textures": (Texture,),
    "lights": (Light,),
}


def _strangers(scene: Scene) -> Found:
    """Tuples without their comma, and what else is not of the classes that are looked into."""
    for name, kind in (("camera", Camera), ("world", World)):
        if not isinstance(getattr(scene, name), kind):
            yield f"scene: {name} is a {type(getattr(scene, name)).__name__}: use {kind.__name__}"
    for light in scene.lights if isinstance(scene.lights, tuple) else ():
        if isinstance(light, Light):
            yield from (
                f"{_label(light)}: {text}" for text in holds("textures", light.textures, (Texture,))
            )
    for name, kinds in _HELD.items():
        yield from (f"scene: {text}" for text in holds(name, getattr(scene, name), kinds))


def _label(thing: Any) -> str:
    kind = type(thing).__name__.lower()
    return f"{kind} {thing.name!r}" if hasattr(thing, "name") else kind
