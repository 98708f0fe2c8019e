"""What surfaces, and the media inside of them, are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..closures import CLOSURES
from ..program.program import Program

Array = np.ndarray


ENCODINGS = ("LINEAR", "SRGB")


EXTENSIONS = ("REPEAT", "EXTEND", "CLIP", "MIRROR")


INTERPOLATIONS = ("LINEAR", "CLOSEST", "CUBIC")


@dataclass(frozen=True, eq=False)
class Texture:
    """An image. pixels (h, w, 4) uint8 or float32, row 0 at v = 0 (the bottom), straight alpha.

    encoding: LINEAR, or SRGB for uint8 whose colours (not alpha) carry the sRGB curve, undone
    after filtering. extension: REPEAT, EXTEND, CLIP (transparent black outside) or MIRROR.
    interpolation: LINEAR, CLOSEST or CUBIC (a uniform B-spline).
    """

    name: str
    pixels: Array
    encoding: str = "LINEAR"
    extension: str = "REPEAT"
    interpolation: str = "LINEAR"


CHANNELS = ("COLOR", "ALPHA", "LUMINANCE")


@dataclass(frozen=True)
class Input:
    """A colour that may vary over the surface: value × texture(uv) × attribute × output + offset,
    kept between low and high, or one minus that.

    value: RGB.  texture: index into `Scene.textures`, -1 for none.  channel: COLOR, or ALPHA (the
    texture's alpha on all three), or LUMINANCE (Rec. 709's, as grey).  uv: name of the UV
    attribute, "" for the active one. uv_transform: ((a, b, c), (d, e, f)) with u' = a u + b v + c
    and v' = d u + e v + f. attribute: name of a colour attribute, "" for none; a name the mesh
    lacks reads as 0. attribute_channel: as channel.  output: which output of the material's
    program, a vector; -1 for none.  offset: RGB.  low, high: bounds of each channel.  complement:
    the result is 1 - all that.
    """

    value: tuple[float, float, float] = (1.0, 1.0, 1.0)
    texture: int = -1
    channel: str = "COLOR"
    uv: str = ""
    uv_transform: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (1.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
    )
    attribute: str = ""
    attribute_channel: str = "COLOR"
    output: int = -1
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    low: float = -np.inf
    high: float = np.inf
    complement: bool = False

    @property
    def is_plain(self) -> bool:
        """A product without offset and bounds, or one minus that."""
        return self.low == -np.inf and self.high == np.inf and not any(self.offset)


DISTRIBUTIONS = ("BLINN_PHONG", "GGX", "BECKMANN", "ASHIKHMIN_SHIRLEY")
"""Of half vectors: max(0, n·h)^p (Blinn 1977), or GGX (Trowbridge, Reitz 1975; Walter, Marschner,
Li, Torrance 2007), or Beckmann's (Beckmann, Spizzichino 1963), or of SPECULAR lobes alone a power
with a width (Ashikhmin, Shirley 2000).
"""


@dataclass(frozen=True)
class Lobe:
    """One term of a surface: `kind` times the product of `factors` (the notes' coefficient k).

    The parameters, which kinds have which and from where to where they are is said in
    `engine.closures`, what they do in semantics/lobes.md. distribution: one of `DISTRIBUTIONS`, of
    the half vectors of SPECULAR and REFRACTION lobes. exponent: Phong's of a SPECULAR lobe;
    AMBIENT, DIFFUSE and OREN_NAYAR ones are times (1 - n·v) to that power. masking: the α of
    Smith's shadowing and masking, as GGX has them, 0 for none; by others than BLINN_PHONG the width
    of a SPECULAR lobe, whose exponent is not read. ior: on REFRACTION the index inside the surface,
    on TRANSPARENT that for light to lit points alone, which is less where it comes from a narrower
    cone inside (semantics/shadows.md). width, lean: of a SHEEN lobe. size, smooth: of a TOON lobe
    and its smooth edge, shares of a right angle. fan: how far the light of a FIBRE lobe fans out
    round the tangent, 0 for as far as normals do; tilt: the tangent of half of how far it leans
    along the fibre, against the tangent. aov: the number of the AOV that an EMISSION lobe of
    `Material.aovs` is for.
    …_output: which output of the material's program, a number, gives the parameter instead, kept
    from 0 to what stands here (an ior stands where the output is not from 1e-30 to 1e30); -1 for
    none.

    `fresnel` multiplies a MIRROR lobe by the dielectric Fresnel reflectance of `ior`, a REFRACTION
    lobe by one minus it, and a SPECULAR lobe by what it is between v and h.
    both_sides: a MIRROR lobe with that has `ior` from both sides, as SPECULAR ones have.
    schlick: multiplies a SPECULAR lobe by (1 - v·h)⁵, a MIRROR lobe by (1 - n·v)⁵ (Schlick 1994):
    what a metal's reflectance gains towards grazing angles. edge: a SPECULAR lobe by 7⁷/6⁶ v·h
    (1 - v·h)⁶ (Kutz, Hašan, Edmondson 2021): what it may lack some 8 degrees off the surface, where
    that is 1. outside: a SPECULAR lobe gives nothing on the inner side, where rough glass itself
    mirrors.
    fibre_output: of FIBRE lobes, the output with the fibre's tangent in the world, as
    long as the fibre is thick there, 0 of what is no fibre; -1: all 0. normal_output: of SPECULAR,
    MIRROR and REFRACTION lobes, the output with a shading normal of their own in the world; where
    it is zero or not finite, or -1, they have the point's. stretch_output: of SPECULAR lobes, the
    output with a direction in the world along the surface: slopes of half vectors along it are
    times its length, those across it over that (semantics/lobes.md); -1, zero or not finite: none.
    radius: of DIFFUSE lobes, RGB, at least 0, world units: how far below the surface their light
    goes before it comes out again, the d of Christensen and Burley's profile
    (semantics/subsurface.md); 0: it comes out where it goes in. radius_output: the output that
    takes its place, -1 for none.
    """

    kind: str
    factors: tuple[Input, ...] = (Input(),)
    exponent: float = 0.0
    ior: float = 1.0
    fresnel: bool = False
    schlick: bool = False
    edge: bool = False
    outside: bool = False
    both_sides: bool = False
    masking: float = 0.0
    distribution: str = "BLINN_PHONG"
    exponent_output: int = -1
    masking_output: int = -1
    ior_output: int = -1
    fibre_output: int = -1
    normal_output: int = -1
    stretch_output: int = -1
    radius: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius_output: int = -1
    width: float = 0.0
    width_output: int = -1
    lean: float = 0.0
    lean_output: int = -1
    size: float = 0.0
    size_output: int = -1
    smooth: float = 0.0
    smooth_output: int = -1
    fan: float = 0.0
    fan_output: int = -1
    tilt: float = 0.0
    aov: int = 0

    @property
    def parameters(self) -> tuple[tuple[float, int], ...]:
        """The core's three numbers, and the outputs that take their places; 0, 0 and 1 with none
        where a lobe of the kind has no parameter.
        """
        numbers = [(0.0, -1), (0.0, -1), (1.0, -1)]
        for p in CLOSURES[self.kind].parameters:
            output = getattr(self, f"{p.name}_output") if p.varies else -1
            numbers[p.place] = getattr(self, p.name), output
        return tuple(numbers)

    @property
    def goes_below(self) -> bool:
        """Whether light that it gives back may come out of the surface elsewhere."""
        return self.kind == "DIFFUSE" and (self.radius_output >= 0 or any(self.radius))

    @property
    def passes_light(self) -> bool:
        """Whether it lets light pass a REFRACTION lobe on its way to lit points."""
        return self.kind == "TRANSPARENT" and (self.ior != 1 or self.ior_output >= 0)

    @property
    def is_glossy(self) -> bool:
        """Whether it is a highlight of GGX's masking, which may reflect other surfaces."""
        return self.kind == "SPECULAR" and (self.masking > 0 or self.distribution != "BLINN_PHONG")

    @property
    def is_rough_glass(self) -> bool:
        """Whether what is seen through it is blurred."""
        return self.kind == "REFRACTION" and self.exponent > 0

    @property
    def is_metallic(self) -> bool:
        """Whether it is one of a metal."""
        return self.is_glossy and not self.fresnel


@dataclass(frozen=True)
class Medium:
    """What light passes through: inside of closed surfaces, or all there is.

    absorption, scattering: RGB, at least 0, how much of the light that goes straight on is taken
    away, or sent elsewhere, a world unit.  emission: RGB radiance that it gives a world unit.
    anisotropy: -1 to 1, the mean cosine of Henyey and Greenstein between the ways of light before
    and after it is scattered.

    program: computes what varies from place to place, None where nothing does; of what reads points
    it has no attributes, UV maps and places on triangles, and in a world no placement either.
    …_output: the output that takes the place of the number, -1 for none; what is not finite or, of
    what dims, below 0 counts as 0, and anisotropy is kept within 0.999 of 0. step: above 0, how far
    apart rays ask the program: a share of the mean side of the box round a thing, world units in a
    world.
    """

    absorption: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scattering: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    anisotropy: float = 0.0
    program: Program | None = None
    absorption_output: int = -1
    scattering_output: int = -1
    emission_output: int = -1
    anisotropy_output: int = -1
    step: float = 1 / 32

    def with_textures(self, numbers: dict[int, int]) -> Medium:
        """The same with other indices of textures."""
        program = self.program.with_textures(numbers) if self.program else None
        return replace(self, program=program)

    @property
    def scatters(self) -> bool:
        """Whether it may scatter light."""
        return any(self.scattering) or self.scattering_output >= 0

    @property
    def emits(self) -> bool:
        """Whether it may give light."""
        return any(self.emission) or self.emission_output >= 0

    @property
    def extinction(self) -> tuple[float, float, float]:
        """RGB, how much light that goes straight on loses a world unit."""
        (a, b, c), (x, y, z) = self.absorption, self.scattering
        return a + x, b + y, c + z


BUMP_SHADOWING = ("NONE", "SIDES", "CHIANG", "GGX")
"""How light that a bent normal faces is hidden by what it was bent from (semantics/shadows.md)."""


@dataclass(frozen=True)
class Material:
    """A surface is the sum of its lobes.

    index: Blender's material pass index.  program: computes what inputs, lobes and the normal name
    as outputs.  normal_output: the output, a vector, that takes the place of the shading normal
    (world space; where it is zero or not finite the mesh's own stays); -1 for none. aovs: what the
    surface gives to `Scene.aovs`, a material that nothing wears: the sum of its EMISSION lobes
    for each.  medium: what fills the inside of what wears it, the
    first one of its materials that have any, its program's textures are the scene's; None for
    nothing.  bump_shadowing: one of `BUMP_SHADOWING`, with another normal than the mesh's; the
    output base_normal_output is what that was bent from, the mesh's normal where it is -1, zero or
    not finite.
    """

    name: str
    lobes: tuple[Lobe, ...]
    index: int = 0
    program: Program | None = None
    normal_output: int = -1
    aovs: Material | None = None
    medium: Medium | None = None
    bump_shadowing: str = "NONE"
    base_normal_output: int = -1

    def without_passed_light(self) -> Material:
        """The same, but what it refracts passes no light to lit points."""
        kept = tuple(lobe for lobe in self.lobes if not lobe.passes_light)
        return self if len(kept) == len(self.lobes) else replace(self, lobes=kept)
