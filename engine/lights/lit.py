"""Scenes with the lights that settings want."""

from __future__ import annotations

from dataclasses import replace

from ..scene import Light, Scene
from .glowing_media import medium_lights
from .lamps import in_order
from .mesh_lights import mesh_lights
from .openings import opened


def lit_scene(
    scene: Scene,
    *,
    by_world: bool,
    by_meshes: bool,
    through_glass: bool = True,
    finding: bool = True,
) -> Scene:
    """The scene with the lights that the settings want (`Settings.lighting`). by_world: its DOME
    light lights it and surfaces hide that; else `World.ambient` is the same everywhere. by_meshes:
    what glows lights it too. through_glass: light passes what refracts. finding: the openings of
    rooms to the sky, else its light keeps those that it has. A scene with nothing of all that
    stays.
    """
    if not through_glass:
        solid = tuple(material.without_passed_light() for material in scene.materials)
        scene = replace(scene, materials=solid)
    lights = in_order(scene.lights)
    lit = scene if lights is scene.lights else replace(scene, lights=lights)
    lamps = tuple(light for light in lights if light.kind != "DOME")
    if len(lamps) < len(lights):
        if by_world:
            skies = (opened(x, scene) if finding and x.kind == "DOME" else x for x in lights)
            world = replace(scene.world, ambient=(0.0, 0.0, 0.0))
            lit = replace(lit, lights=tuple(skies), world=world)
        else:
            lit = replace(lit, lights=lamps)
    glow = (*mesh_lights(scene), *medium_lights(scene)) if by_meshes else ()
    lit = replace(lit, lights=(*lit.lights, *glow)) if glow else lit
    shining = tuple(light for light in lit.lights if _shines(light, lit))
    return replace(lit, lights=shining) if len(shining) < len(lit.lights) else lit


def _shines(light: Light, scene: Scene) -> bool:
    """False for a sky, and for what glows, where nothing gets their light."""
    if light.kind not in ("DOME", "MESH", "MEDIUM") or light.lights_matt or light.lights_gloss:
        return True
    return light.lights_media and scene.scatters
