"""Over blocks of how many pixels the points of lights, lobes and gather rays are dealt."""

from __future__ import annotations

from ..sampling import MOST_TABLED, dealt_samples
from ..sampling.motion import is_moving
from ..scene import Scene
from ..settings import Settings
from .lamps import is_soft

SIDE = 4
"""Of a block, pixels."""


def interleaving(scene: Scene, settings: Settings) -> int:
    """The side of these blocks, a power of 2; 1 where all pixels share the same points: where none
    of them has an extent, and where each pixel has so many that nothing is gained.
    """
    few = dealt_samples(settings.samples, SIDE) <= MOST_TABLED
    return SIDE if settings.soft_light != "SHARED" and few and _is_soft(scene, settings) else 1


def visibility_samples(scene: Scene, settings: Settings) -> int:
    """Camera rays for each sample of a pixel: 1 where light is not resolved, which tells what
    others see, where all go through the middle of the pixel, where things move, where there are
    catchers of shadows or holdouts, and with AOVs and Cryptomatte, whose edges must be those of the
    picture.
    """
    resolves = settings.soft_light == "RESOLVED" and interleaving(scene, settings) > 1
    caught = any(block.catcher or block.holdout for block in scene.instances)
    beside = bool(scene.aovs) or settings.has_mattes
    if not resolves or not settings.filter_width or caught or beside or is_moving(scene):
        return 1
    return settings.visibility_samples


def _is_soft(scene: Scene, settings: Settings) -> bool:
    """Whether anything in the scene is seen by points or directions of which there are many."""
    if settings.illumination != "PHYSICAL":
        return False
    tabled = any(light.kind in ("DOME", "MESH", "MEDIUM") for light in scene.lights)
    lamps = settings.light_samples > 1 and any(is_soft(light) for light in scene.lights)
    lobes = [lobe for material in scene.materials for lobe in material.lobes]
    glossy = settings.reflecting != "OFF" and any(lobe.is_glossy for lobe in lobes)
    below = settings.subsurface == "ON" and scene.has_subsurface
    rough = any(lobe.is_rough_glass for lobe in lobes)
    bounces = settings.bounces > 0 and bool(scene.lights)
    return (
        tabled
        or bounces
        or lamps
        or glossy
        or rough
        or below
        or scene.scatters
        or scene.most_asked > 0
    )
