"""How to render: everything a picture depends on that is not the scene. A setting is declared here,
once: Blender's property, the check and what goes to the core follow from its declaration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from math import inf
from numbers import Integral, Real
from typing import Any, TypedDict

from .film import CRYPTOMATTES, PASSES

_ILLUMINATIONS = (
    (
        "PHYSICAL",
        "Physical",
        "Watts, inverse square and 1/π as in Cycles: a diffuse surface gets the same value in both",
    ),
    (
        "CLASSIC",
        "Classic",
        "The textbook formula as it stands: the strength is the intensity, and light does not fall "
        "off with distance",
    ),
)
_WORLD_LIGHTS = (
    (
        "OCCLUDED",
        "Occluded",
        "For most pictures: the sky or its image lights from where it is bright, and surfaces hide "
        "it from each other. Takes shadow rays",
    ),
    (
        "CONSTANT",
        "Constant",
        "For quick pictures: the world's mean colour on every surface, from all sides, without "
        "shadows. Costs nothing",
    ),
)
_MESH_LIGHTS = (
    (
        "ON",
        "On",
        "For most pictures: screens, bulbs and fire with emission light what is round them, with "
        "soft shadows. Takes shadow rays where something glows",
    ),
    ("OFF", "Off", "For quick pictures: what glows is seen, and lights nothing. Costs nothing"),
)
_REFLECTIONS = (
    (
        "METALS",
        "Metals",
        "For quick pictures: rough metals reflect what surrounds them, and others of bounced light "
        "an even sheen. Takes about as long again where metals are seen",
    ),
    (
        "ALL",
        "All",
        "For most pictures: every rough surface reflects what surrounds it, paint, wood and stone "
        "too. Takes about half as long again where such things fill the picture",
    ),
    (
        "OFF",
        "Off",
        "For the quickest pictures: rough surfaces reflect lights and the sky, and of bounced "
        "light an even sheen. Costs nothing",
    ),
)
_SUBSURFACE = (
    (
        "ON",
        "On",
        "For most pictures: light goes into skin, wax and milk and comes out beside. Takes two to "
        "three times as long where such things fill the picture",
    ),
    ("OFF", "Off", "For quick pictures: they are drawn as diffuse. Costs nothing"),
)
_REFLECTIVE_CAUSTICS = (
    (
        "ON",
        "On",
        "For most pictures: gloss, metals and mirrors throw light onto what is matt, softly, as if "
        "they were rough. Costs nothing",
    ),
    (
        "OFF",
        "Off",
        "For files whose Cycles picture has none: they show light, and throw none onto what is "
        "matt",
    ),
)
_REFRACTIVE_CAUSTICS = (
    (
        "ON",
        "On",
        "For most pictures: light passes glass to what is matt, straight on, with its colour and "
        "what Fresnel leaves",
    ),
    (
        "OFF",
        "Off",
        "For files whose Cycles picture has none: glass casts whole shadows, and rooms behind "
        "panes are dark",
    ),
)
_BACKENDS = (
    (
        "NATIVE",
        "Native",
        "For every render: the compiled core, on all cores of the CPU. Where it cannot be loaded, "
        "Python takes over with a message",
    ),
    (
        "NUMPY",
        "Python (reference)",
        "To check a picture against double precision: the same to float precision, tens of times "
        "slower",
    ),
)
_SOFT_LIGHTS = (
    (
        "RESOLVED",
        "Resolved",
        "For nearly everything: neighbours look at different points and follow light along paths "
        "of their own, and it is averaged over those that show the same surface, no wider than it "
        "is soft",
    ),
    (
        "DEALT",
        "Unresolved",
        "To see what each pixel found by itself, in a regular pattern",
    ),
    (
        "SHARED",
        "Shared Points",
        "For teaching: all pixels look at the same points, as the formulas have it, also of what "
        "surfaces throw onto each other. Many samples are needed",
    ),
)
_ACCELERATIONS = (
    ("AUTO", "Automatic", "For nearly everything: fast in the viewport, balanced in final renders"),
    (
        "FAST",
        "Fast",
        "For quick looks at large scenes: the first ray comes in half the time, the rays are "
        "somewhat slower",
    ),
    ("BALANCED", "Balanced", "For most renders: the least time for sorting and tracing together"),
    (
        "FINE",
        "Fine",
        "For long renders of rooms with large, long triangles: sorting takes several times as "
        "long, rays are faster. Curved meshes "
        "gain nothing",
    ),
)
ILLUMINATIONS, BACKENDS, ACCELERATIONS = (
    tuple(name for name, _, _ in choices) for choices in (_ILLUMINATIONS, _BACKENDS, _ACCELERATIONS)
)


@dataclass(frozen=True)
class _Shares:
    """Points of lights that have tables, for each sample of another light: the sky is all round,
    glowing meshes are everywhere.
    """

    dome: int
    mesh: int


_SHARED = _Shares(dome=8, mesh=4)
"""Where each pixel sees but the points of its own samples."""
_DEALT = _Shares(dome=2, mesh=2)
"""Where pixels of a block see others: each needs few."""
MEDIUM_SHARE, MEDIUM_SHADOWS = 32, 4
"""The same of a MEDIUM light, in which near points count most, and of the rays that they share."""
MOST_MEDIUM = 256
"""Light samples from which on they are no more."""
BUILDS = ACCELERATIONS[1:]
"""Ways to build the core's trees, in the order of their time."""
MOST_LIGHT_POINTS = 1 << 23
"""Largest samples × light_samples: the table of points on the lights is made before the first ray.
"""


class Lighting(TypedDict):
    """What `lights.lit.lit_scene` is told."""

    by_world: bool
    by_meshes: bool
    through_glass: bool


@dataclass(frozen=True)
class Declared:
    """What is known of a setting.

    default: of `Settings`; its type is the setting's. label, tooltip: as a user reads them; without
    a label it is none of Glint's own properties. low, high: the range that the tracers take, ends
    included. remedy: how a refusal names it. slider, typed: largest values that Blender's slider
    and its field reach, where that is not high. digits: shown behind the point. choices: (name,
    label, tooltip) of each value of a text.
    """

    default: Any
    label: str = ""
    tooltip: str = ""
    low: float = 0
    high: float = inf
    remedy: str = ""
    slider: float | None = None
    typed: float | None = None
    digits: int = 2
    choices: tuple[tuple[str, str, str], ...] = ()

    def is_whole(self) -> bool:
        """Whether its values are whole numbers."""
        return isinstance(self.default, int)

    def shown(self, value: Any) -> str:
        """A value as a user reads it."""
        labels = {choice: label for choice, label, _ in self.choices}
        return labels[value].lower() if self.choices else f"{value:g}"

    def strangeness(self, name: str, value: Any) -> Iterator[str]:
        """What is wrong with the type of a value."""
        if self.is_whole() and not _is_whole(value):
            yield f"{name} is {value!r}: use a whole number"
        if isinstance(self.default, float) and not isinstance(value, Real):
            yield f"{name} is {value!r}: use a number"

    def problems(self, name: str, value: Any) -> Iterator[str]:
        """What is wrong with a value of the right type."""
        names = [choice for choice, _, _ in self.choices]
        if names and value not in names:
            yield f"{name} {value!r} is not one of {', '.join(names)}"
        if not names and not self.low <= value <= self.high:
            yield f"{name} is {value}: use {self.remedy}"


def _setting(default: Any, label: str = "", tooltip: str = "", **more: Any) -> Any:
    return field(default=default, metadata={Declared: Declared(default, label, tooltip, **more)})


@dataclass(frozen=True)
class Settings:
    """Render settings.

    error_threshold: in 8-bit levels of an sRGB screen; a pixel may stop after a wave of 4, 8, 16 …
    samples (semantics/stopping.md). light_samples: 1 is the notes' hard shadow. cutoff: compared
    with the largest channel of what a ray carries to the pixel. acceleration, threads: never change
    a bit of the picture; threads 0 are one per core. filter_width: Blender's pixel filter size in
    pixels (the Blackman-Harris window spans twice that); 0 samples the centre only. crypto_ids:
    how many things Cryptomatte passes tell of a pixel. passes: names from `film.PASSES` beyond
    Combined. region: (x0, y0, x1, y1) half-open pixel rectangle of the full frame, origin bottom
    left; None for all of it.
    """

    samples: int = _setting(
        16,
        "Samples",
        "Most samples of a pixel; more make edges and soft shadows smoother and take longer in "
        "proportion. Choose 1 to 4 for a look, 16 for most pictures, 64 to 256 for fine textures "
        "and large soft shadows. There is no noise at any number; powers of two are placed best",
        low=1,
        slider=256,
        # Blender cuts what is above in silence: this is more than the engine takes, and it says so
        typed=1 << 24,
        remedy="at least 1",
    )
    visibility_samples: int = _setting(
        1,
        "Visibility Samples",
        "Camera rays of a pixel for each of its samples, where soft light is resolved and nothing "
        "moves: light follows the first alone, the rest smooth outlines, edges and textures at a "
        "fraction of the time of more samples. Choose 4 for most pictures, 1 for none of these",
        low=1,
        high=16,
        remedy="1 (no more than samples) to 16",
    )
    error_threshold: float = _setting(
        0.0,
        "Threshold",
        "A pixel takes no more samples once its estimated error is at most this many of the 256 "
        "levels of a display. Choose 0 to give all samples to all pixels, 4 with 64 samples or "
        "more, 1 to 2 where dark gradients will be brightened later",
        high=255.0,
        slider=16.0,
        digits=1,
        remedy="0 (off) or up to 255 levels",
    )
    light_samples: int = _setting(
        4,
        "Light Samples",
        "Points on each soft light per pixel sample; shadow time grows in proportion. Both numbers "
        "multiply, so choose 2 for most pictures, 4 to 8 with few samples and large lights. 1 "
        "makes hard shadows from the light's centre",
        low=1,
        slider=64,
        typed=1 << 24,  # as of samples
        remedy="at least 1",
    )
    lamp_shadows: int = _setting(
        16,
        "Lamp Shadows",
        "Shadow rays of a point and sample, times Light Samples, where lamps are more than twice "
        "as many: they go to those that give most there, and to the others in turn. Shadow time "
        "grows in proportion. Choose 16 for most pictures, 64 with few samples, 0 for a ray to "
        "each lamp, however many",
        high=1024,
        slider=64,
        remedy="0 (one to each) to 1024",
    )
    volume_samples: int = _setting(
        4,
        "Volume Samples",
        "Points along each ray, for each light and pixel sample, from which volumes scatter light: "
        "takes time in proportion, and none without volumes. Choose 4 for most pictures, 8 to 16 "
        "where beams of light in fog have steps",
        low=1,
        high=4096,
        slider=64,
        remedy="1 to 4096",
    )
    max_bounces: int = _setting(
        4,
        "Bounces",
        "Depth of mirror and refraction rays, and of light that goes from strand to strand of "
        "hair; costs nothing without these. Choose 12 for glass and hair, 4 where mirrors face "
        "each other and time is short, 0 for no reflections",
        high=64,
        remedy="0 to 64",
    )
    cutoff: float = _setting(
        0.0,
        "Ray Cutoff",
        "Mirror and refraction rays that would add less than this share to the pixel are not "
        "traced. Choose 0.001 for most pictures, 0.01 to save time: the faint reflection of a very "
        "bright lamp may be lost; 0 for all rays",
        high=1.0,
        slider=0.1,
        digits=3,
        remedy="0 (off) to 1",
    )
    illumination: str = _setting(
        "PHYSICAL", "Illumination", "What a light's strength means", choices=_ILLUMINATIONS
    )
    world_light: str = _setting(
        "OCCLUDED",
        "World Light",
        "How the world lights surfaces. With Classic illumination it is constant",
        choices=_WORLD_LIGHTS,
    )
    mesh_light: str = _setting(
        "ON",
        "Mesh Lights",
        "Whether surfaces and volumes that glow light others. With Classic illumination they do "
        "not",
        choices=_MESH_LIGHTS,
    )
    reflections: str = _setting(
        "METALS",
        "Rough Reflections",
        "Which rough surfaces reflect others, up to the number of bounces; mirrors always do. With "
        "Classic illumination none do",
        choices=_REFLECTIONS,
    )
    subsurface: str = _setting(
        "ON",
        "Subsurface",
        "Whether light comes out of the surfaces of materials with subsurface scattering beside "
        "where it went in",
        choices=_SUBSURFACE,
    )
    soft_light: str = _setting(
        "SHARED",
        "Soft Light",
        "How the light of what has an extent is sampled: soft lamps, the sky, what glows, bounced "
        "light and rough reflections",
        choices=_SOFT_LIGHTS,
    )
    diffuse_bounces: int = _setting(
        0,
        "Diffuse Bounces",
        "How often surfaces throw light onto others. Choose 4 for most pictures, 1 or 2 for quick "
        "ones, 0 for lights alone. Each bounce takes a ray and its shadows, later ones fewer, the "
        "darker surfaces are. With Classic illumination there are none",
        high=8,
        remedy="0 to 8",
    )
    volume_bounces: int = _setting(
        0,
        "Volume Bounces",
        "Whether light that surfaces throw onto others lights volumes that scatter, too. Choose 0 "
        "for lights alone, as Cycles has it to begin with, 1 for fog in rooms and between bright "
        "walls, which takes a ray more for each sample",
        high=1,
        remedy="0 or 1",
    )
    reflective_caustics: str = _setting(
        "ON",
        "Reflective Caustics",
        "Whether surfaces that shine throw light onto what is matt",
        choices=_REFLECTIVE_CAUSTICS,
    )
    refractive_caustics: str = _setting(
        "ON",
        "Refractive Caustics",
        "Whether light passes glass on its way to what is matt",
        choices=_REFRACTIVE_CAUSTICS,
    )
    photons: int = _setting(
        0,
        "Photons",
        "How many photons lamps send by way of sharp mirrors and clear glass to what is matt: the "
        "patch of light that a mirror throws, the bright spot behind a ball of glass. 0: none of "
        "these; 65536 for most pictures, which takes up to a second before the first sample; more "
        "for finer lines",
        slider=1 << 18,
        typed=1 << 22,
        high=1 << 22,
        remedy="0 (none) to 4194304",
    )
    clamp_indirect: float = _setting(
        0.0,
        "Clamp Indirect",
        "The most that a ray adds to a pixel's sample after a bounce, a mirror or glass, the mean "
        "of the channels: what is found rarely and very bright makes no dots. Choose 10 for most "
        "pictures, as Cycles has it, 0 for all light",
        high=1e8,
        slider=100.0,
        digits=2,
        remedy="0 (off) or more",
    )
    backend: str = _setting(
        "NATIVE", "Tracer", "Which of the two tracers draws the picture", choices=_BACKENDS
    )
    acceleration: str = _setting(
        "AUTO",
        "Acceleration",
        "How long the core may sort the scene before the first ray. The picture is the same, bit "
        "for bit, with any",
        choices=_ACCELERATIONS,
    )
    threads: int = _setting(
        0,
        "Threads",
        "Threads of the native core; 0 takes Blender's own setting, which is all cores unless "
        "fixed. The picture is the same, bit for bit, with any number",
        typed=1024,
        remedy="0 (all cores) or more",
    )
    filter_width: float = _setting(1.5, high=100, remedy="0 to 100 pixels")
    crypto_ids: int = _setting(6, low=1, high=64, remedy="1 to 64")
    passes: frozenset[str] = frozenset()
    region: tuple[int, int, int, int] | None = None

    def __post_init__(self) -> None:
        """NumPy's whole numbers become Python's, and names of passes a set."""
        for name, declared in DECLARED.items():
            if declared.is_whole() and _is_whole(value := getattr(self, name)):
                object.__setattr__(self, name, int(value))
        if isinstance(self.passes, (set, list, tuple)):
            object.__setattr__(self, "passes", frozenset(self.passes))

    @property
    def lighting(self) -> Lighting:
        """What `lights.lit.lit_scene` is told: whether surfaces hide the world's light, whether
        what glows lights, and whether light passes glass.
        """
        physical = self.illumination == "PHYSICAL"
        return {
            "by_world": physical and self.world_light == "OCCLUDED",
            "by_meshes": physical and self.mesh_light == "ON",
            "through_glass": self.refractive_caustics == "ON",
        }

    @property
    def has_mattes(self) -> bool:
        """Whether Cryptomatte's passes are asked for."""
        return not self.passes.isdisjoint(CRYPTOMATTES)

    @property
    def bounces(self) -> int:
        """How often light bounces."""
        return self.diffuse_bounces if self.illumination == "PHYSICAL" else 0

    @property
    def reflecting(self) -> str:
        """`reflections`, or OFF where none can be."""
        possible = self.illumination == "PHYSICAL" and self.max_bounces > 0
        return self.reflections if possible else "OFF"

    @property
    def _shares(self) -> _Shares:
        return _SHARED if self.soft_light == "SHARED" else _DEALT

    @property
    def camera_rays(self) -> int:
        """At most, of a pixel."""
        return self.samples * self.visibility_samples

    @property
    def occlusion_samples(self) -> int:
        """Directions of the Ambient Occlusion pass for each sample of a pixel."""
        return _SHARED.dome * self.light_samples

    @property
    def dome_samples(self) -> int:
        """Directions of a DOME light for each sample of a pixel."""
        return self._shares.dome * self.light_samples

    @property
    def opening_samples(self) -> int:
        """Points on a DOME light's openings for each sample of a pixel."""
        return self.dome_samples

    @property
    def mesh_samples(self) -> int:
        """Points of a MESH light for each sample of a pixel."""
        return self._shares.mesh * self.light_samples

    @property
    def medium_samples(self) -> int:
        """Points of a MEDIUM light for each sample of a pixel."""
        return MEDIUM_SHARE * min(self.light_samples, MOST_MEDIUM)

    @property
    def medium_shadows(self) -> int:
        """Shadow rays that these share for each sample of a pixel."""
        return MEDIUM_SHADOWS * min(self.light_samples, MOST_MEDIUM)

    def problems(self) -> list[str]:
        """What is wrong with these settings, one sentence each."""
        strange = [*self._of_each(Declared.strangeness)]
        if not isinstance(self.passes, frozenset):
            strange.append(f"passes is {self.passes!r}: use a set of names")
        return strange or [*self._of_each(Declared.problems), *self._of_several()]

    def _of_each(self, ask: Callable[[Declared, str, Any], Iterator[str]]) -> Iterator[str]:
        for name, declared in DECLARED.items():
            yield from ask(declared, name, getattr(self, name))

    def _of_several(self) -> Iterator[str]:
        """What no range says."""
        points = self.samples * self.light_samples
        if points > MOST_LIGHT_POINTS:
            yield f"samples × light_samples is {points}: use at most {MOST_LIGHT_POINTS}"
        elif (rays := self.camera_rays) > MOST_LIGHT_POINTS:
            yield f"samples × visibility_samples is {rays}: use at most {MOST_LIGHT_POINTS}"
        if unknown := sorted(str(name) for name in self.passes if name not in PASSES):
            yield f"no such pass: {', '.join(unknown)}"
        if self.region is not None and not _is_region(self.region):
            yield f"region is {self.region!r}: use whole numbers 0 <= x0 < x1 and 0 <= y0 < y1"


DECLARED = {
    known.name: known.metadata[Declared] for known in fields(Settings) if Declared in known.metadata
}
"""Name of a setting -> what is declared of it, in the order of `Settings`."""


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _is_region(region: Any) -> bool:
    if not isinstance(region, (tuple, list)) or len(region) != 4 or not all(map(_is_whole, region)):
        return False
    x0, y0, x1, y1 = region
    return 0 <= x0 < x1 and 0 <= y0 < y1


OFFERED = Settings(
    samples=8,
    visibility_samples=4,
    light_samples=2,
    soft_light="RESOLVED",
    max_bounces=12,
    cutoff=0.001,
    diffuse_bounces=4,
    clamp_indirect=10.0,
    reflections="ALL",
)
"""What a user gets who chooses nothing: on the front of time against error of the scenes that were
measured (docs/decisions/0063-resolve.md), Blender's own number of bounces
(docs/decisions/0024-bounced-light.md), and reflections in all that is rough
(docs/decisions/0022-rough-reflections.md). With `Settings()` itself all pixels look at the same
points, as the notes' formulas have it, and there is direct light alone.
"""
