"""The settings that trade time for accuracy, and which of their values are worth measuring on a
scene.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..errors import SceneError
from ..film import FIRST_ESTIMATE
from ..lights.interleaving import visibility_samples
from ..lights.lamps import is_soft, shared_samples
from ..scene import Scene
from ..settings import Settings


@dataclass(frozen=True)
class Tunable:
    """A setting that trades time for accuracy.

    name: a field of Settings.  values: from fast to accurate; of one with choices, all of them.
    matters: whether it can change a picture of this scene with the base's settings. falling:
    smaller values are the more accurate ones.  group: tunables of one group are combined with each
    other.
    """

    name: str
    values: tuple[Any, ...]
    matters: Callable[[Scene, Settings], bool]
    falling: bool = False
    group: str = "sampling"

    @property
    def kind(self) -> type:
        """int, float or, of choices, str."""
        return type(self.values[0])

    def ladder(self, *values: Any) -> list[Any]:
        """Different values from fast to accurate."""
        if self.kind is str:
            place = {value: number for number, value in enumerate(self.values)}
            return sorted(set(values), key=lambda value: place.get(value, -1))
        return sorted(set(values), reverse=self.falling)


def has_soft_lights(scene: Scene, settings: Settings) -> bool:
    """Whether something lights from more than a point, as the settings want the scene lit: a lamp
    of an extent, the sky, what glows, what is lit.
    """
    return (
        glow_lights(scene, settings)
        or sky_is_hidden(scene, settings)
        or scatters(scene, settings)
        or any(is_soft(light) for light in scene.lights)
    )


def glow_lights(scene: Scene, settings: Settings) -> bool:
    """Whether something glows and is to light others."""
    glows = scene.has_glowing_media or any(
        lobe.kind == "EMISSION" for m in scene.materials for lobe in m.lobes
    )
    return bool(glows and settings.lighting["by_meshes"])


def sky_is_hidden(scene: Scene, settings: Settings) -> bool:
    """Whether surfaces are to hide a sky from each other."""
    sky = any(light.kind == "DOME" for light in scene.lights)
    return bool(sky and settings.lighting["by_world"] and scene.instances)


def reflects_roughly(scene: Scene, settings: Settings) -> bool:
    """Whether a rough material may reflect others, and some are to."""
    rough = any(lobe.is_glossy for material in scene.materials for lobe in material.lobes)
    return rough and settings.reflecting != "OFF"


def glows_below(scene: Scene, settings: Settings) -> bool:
    """Whether light is to come out of surfaces beside where it went in."""
    return scene.has_subsurface and settings.subsurface == "ON"


def sees_more(scene: Scene, settings: Settings) -> bool:
    """Whether pixels may have camera rays that light does not follow."""
    return visibility_samples(scene, replace(settings, visibility_samples=2)) > 1


def has_bounces(scene: Scene, settings: Settings) -> bool:
    """Whether a material reflects or refracts rays, as rough ones do where they may."""
    which = settings.reflections
    return any(
        lobe.kind in ("MIRROR", "REFRACTION")
        or (lobe.is_metallic and which != "OFF")
        or (lobe.is_glossy and which == "ALL")
        for material in scene.materials
        for lobe in material.lobes
    )


def goes_far(scene: Scene, settings: Settings) -> bool:
    """Whether there are rays that Bounces ends: those, and of light that strands send on."""
    kinds = {lobe.kind for material in scene.materials for lobe in material.lobes}
    strands = not kinds.isdisjoint({"FIBRE_SPECULAR", "FIBRE_TRANSMISSION"})
    return has_bounces(scene, settings) or (strands and scatters(scene, settings))


def scatters(scene: Scene, settings: Settings) -> bool:
    """Whether surfaces throw light onto others: it is measured where it is wanted at all."""
    return settings.bounces > 0 and bool(scene.instances)


def has_many_lamps(scene: Scene, settings: Settings) -> bool:
    """Whether lamps share shadow rays at some of the numbers that are measured."""
    return shared_samples(scene.lights, replace(settings, lamp_shadows=8)) > 0


def has_fog(scene: Scene, settings: Settings) -> bool:
    """Whether media scatter light."""
    return scene.scatters and (bool(scene.lights) or scene.has_glowing_media)


TUNABLES = (
    Tunable("samples", (1, 2, 4, 8, 16, 32, 64), lambda scene, settings: True),
    Tunable("error_threshold", (8.0, 2.0, 0.0), lambda scene, settings: True, falling=True),
    Tunable("visibility_samples", (1, 4), sees_more, group="visibility"),
    Tunable("light_samples", (1, 2, 4, 8, 16), has_soft_lights),
    Tunable("lamp_shadows", (8, 16, 32, 64), has_many_lamps, group="lamps"),
    Tunable("max_bounces", (0, 1, 4, 12), goes_far, group="bounces"),
    Tunable("cutoff", (0.01, 0.001, 0.0), has_bounces, falling=True, group="bounces"),
    Tunable("diffuse_bounces", (0, 1, 2, 4), scatters, group="diffuse"),
    Tunable("volume_samples", (1, 2, 4, 8, 16), has_fog, group="volumes"),
    # What light is drawn at all: measured where it is wanted, to tell what it takes.
    Tunable("world_light", ("CONSTANT", "OCCLUDED"), sky_is_hidden, group="world"),
    Tunable("mesh_light", ("OFF", "ON"), glow_lights, group="glow"),
    Tunable("reflections", ("OFF", "METALS", "ALL"), reflects_roughly, group="reflections"),
    Tunable("subsurface", ("OFF", "ON"), glows_below, group="subsurface"),
)
"""Every tunable that is measured. A new one needs a row here and nothing else."""


def settings_grid(
    scene: Scene, base: Settings, values: Mapping[str, Sequence[Any]]
) -> list[Settings]:
    """Every combination of each group's tunables that can change a picture of this scene, the
    base's own values always among them; the other groups' tunables are as the base has them: what
    rays leave out and how many there are hardly depend on each other, and a grid over all tunables
    takes seven times as long.
    """
    unknown = sorted(set(values) - {tunable.name for tunable in TUNABLES})
    if unknown:
        raise SceneError(
            f"no such tunable: {', '.join(unknown)}; there are "
            f"{', '.join(tunable.name for tunable in TUNABLES)}"
        )
    tunables = [tunable for tunable in TUNABLES if tunable.matters(scene, base)]
    groups = [
        [tunable for tunable in tunables if tunable.group == group]
        for group in dict.fromkeys(tunable.group for tunable in tunables)
    ]
    grid = dict.fromkeys(
        settings for group in groups for settings in _combinations(group, base, values)
    )
    return [settings for settings in grid if settings == base or not _is_idle(settings)]


def _combinations(
    tunables: Sequence[Tunable], base: Settings, values: Mapping[str, Sequence[Any]]
) -> Iterator[Settings]:
    """All of some tunables."""
    for steps in itertools.product(*(_ladder(tunable, base, values) for tunable in tunables)):
        yield replace(
            base, **{tunable.name: step for tunable, step in zip(tunables, steps, strict=True)}
        )


def _ladder(tunable: Tunable, base: Settings, values: Mapping[str, Sequence[Any]]) -> list[Any]:
    return tunable.ladder(*values.get(tunable.name, tunable.values), getattr(base, tunable.name))


def _is_idle(settings: Settings) -> bool:
    """Whether a tunable is turned that can do nothing: no pixel stops before the samples that the
    first estimate takes, and at most one bounce is hardly worth cutting off.
    """
    stops_none = settings.error_threshold > 0 and settings.samples <= FIRST_ESTIMATE
    return stops_none or (settings.cutoff > 0 and settings.max_bounces <= 1)
