"""What the switches of the shading popover make of a scene: without its lights, or in a studio
instead of its world.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...engine.scene import Light, Scene, World
from ..export.images.colorspace import openimageio

_GREY = 0.5
"""Radiance of a studio whose image cannot be read."""


@dataclass(frozen=True)
class Surroundings:
    """use_lights: the scene's lights shine.  studio: stands in for the world of the scene, None
    keeps that.
    """

    use_lights: bool = True
    studio: World | None = None

    def around(self, scene: Scene) -> Scene:
        """`scene` as the popover wants it."""
        return scene if self.use_lights and self.studio is None else _changed(self, scene)

    def shines(self, light: Light) -> bool:
        return self.studio is None if light.kind == "DOME" else self.use_lights


@functools.lru_cache(maxsize=4)
def _changed(surroundings: Surroundings, scene: Scene) -> Scene:
    """The same value for the same scene, so that a view that asks again sees that nothing moved."""
    kept = tuple(light for light in scene.lights if surroundings.shines(light))
    return replace(scene, lights=kept, world=surroundings.studio or scene.world)


@functools.lru_cache(maxsize=16)
def _studio(ambient: tuple[float, ...], background: tuple[float, ...], transparent: bool) -> World:
    """The same value for the same light."""
    return World(ambient, background, transparent)


def read_surroundings(space: Any) -> Surroundings:
    """Of a 3D view in Rendered shading. A studio light surrounds as its mean colour, as every
    environment image does in Glint.
    """
    shading = space.shading
    if shading.use_scene_world_render:
        return Surroundings(shading.use_scene_lights_render)
    light = shading.selected_studio_light
    mean = _mean_of(light.path if light is not None else "")
    ambient = tuple(shading.studiolight_intensity * channel for channel in mean)
    alpha = shading.studiolight_background_alpha
    return Surroundings(
        shading.use_scene_lights_render,
        _studio(ambient, tuple(alpha * channel for channel in ambient), alpha == 0),
    )


@functools.lru_cache(maxsize=64)
def _mean_of(path: str) -> tuple[float, float, float]:
    """The mean colour of an equirectangular image over all directions, scene-linear."""
    oiio = openimageio()
    file = oiio.ImageInput.open(path) if oiio is not None and path else None
    if file is None:
        return (_GREY,) * 3
    try:
        values = np.asarray(file.read_image("float"))
    finally:
        file.close()
    rows = values[:, :, :3].mean(1, dtype=np.float64)
    mean = np.average(
        rows, axis=0, weights=np.sin((np.arange(len(rows)) + 0.5) * np.pi / len(rows))
    )
    return tuple(float(channel) for channel in mean)
