"""The scene as plain values: what Blender's export makes and what every tracer takes.

Everything is a frozen dataclass of NumPy arrays and integer handles; handles index the tuples of
`Scene`. World quantities are float64, geometry stays in object space as float32 (Blender's own
precision). `engine/SEMANTICS.md` says which picture a scene stands for; `problems.py`
checks a scene at the door.

Conventions: right-handed, metres as Blender's units, angles in radians, colours scene-linear RGB. A
matrix `target_from_source` is `(3, 4)`: columns 0-2 the linear part, column 3 the translation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..program.program import Program
from .panorama import Panorama

Array = np.ndarray

MOST_SETS = 64
"""Of instances that the same lights reach."""
EVERYTHING = (1 << MOST_SETS) - 1
POINT, CORNER, FACE = "POINT", "CORNER", "FACE"


@dataclass(frozen=True, eq=False)
class Attribute:
    """Values on a mesh that materials or passes read.

    name: how an `Input` finds it.
    domain: POINT (a row per vertex), CORNER (a row per value of `Mesh.corners`) or FACE (a row per
    triangle). values: (k, c) float32, c = 2 for UV maps, 3 for normals, 4 for colours.
    """

    name: str
    domain: str
    values: Array


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in object space.

    vertices: (v, 3) float32.
    triangles: (n, 3) uint32, rows of `vertices`, counter-clockwise seen from outside.
    corners: (n, 3) uint32, rows of CORNER attributes, or None when there is no such attribute.
    material_slots: (n,) uint16, index into `Instances.materials`, or None when all are 0.
    normals: unit shading normals on POINT or CORNER, or None for flat shading everywhere.
    attributes: UV maps and colours that something reads; the first one with 2 columns is the active
    UV map.
    motion: (k, v, 3) float32, k >= 2, vertices at even times while the shutter is open; None for a
    mesh that keeps its shape.  normal_motion: (k, rows of normals, 3) float32, unit, the same of
    normals; None where they stay.
    """

    name: str
    vertices: Array
    triangles: Array
    corners: Array | None = None
    material_slots: Array | None = None
    normals: Attribute | None = None
    attributes: tuple[Attribute, ...] = ()
    motion: Array | None = None
    normal_motion: Array | None = None


@dataclass(frozen=True, eq=False)
class Spheres:
    """True spheres in object space: centers (k, 3) float32, radii (k,) float32, material_slots as
    in `Mesh`.
    """

    name: str
    centers: Array
    radii: Array
    material_slots: Array | None = None


@dataclass(frozen=True, eq=False)
class Polygons:
    """Planar polygons, each tested by the odd-even rule (notes, section 4.9), flat shaded, object
    space.

    vertices: (v, 3) float32.  offsets: (p + 1,) uint32; polygon k has the corners
    indices[offsets[k]:offsets[k + 1]]. indices: (m,) uint32, rows of `vertices`, in order round the
    polygon; the normal is Newell's.
    """

    name: str
    vertices: Array
    offsets: Array
    indices: Array
    material_slots: Array | None = None


@dataclass(frozen=True, eq=False)
class Strands:
    """Segments of hair and the like in object space: each is the convex hull of a sphere round its
    beginning and one round its end, seen from outside alone.

    vertices: (v, 3) float32.  radii: (v,) float32, of each vertex; a segment both of whose ends
    have none is not there.  starts: (n,) uint32, segment k goes from row starts[k] of `vertices` to
    the next row.  material_slots, attributes: as in `Mesh`, on POINT (a row per vertex, mixed along
    the segment) or FACE (a row per segment).
    """

    name: str
    vertices: Array
    radii: Array
    starts: Array
    material_slots: Array | None = None
    attributes: tuple[Attribute, ...] = ()

    @cached_property
    def ends(self) -> Array:
        """(n, 3) uint32 rows of `vertices`: the beginning, and the end twice; so attributes are
        read as on triangles.
        """
        return self.starts[:, None] + np.array([0, 1, 1], np.uint32)


Geometry = Mesh | Spheres | Polygons | Strands


@dataclass(frozen=True, eq=False)
class Instances:
    """One geometry placed k times. Instances are numbered in the order of `Scene.instances`, then
    by row.

    geometry: index into `Scene.geometries`.
    world_from_object: (k, 3, 4) float64; mirrored, sheared and flattened matrices are welcome.
    materials: for each material slot an index into `Scene.materials`; a slot beyond the end uses
    the last one. object_index: Blender's pass index. visible_camera, visible_mirror,
    visible_shadow: seen by camera rays (and what passes straight through them), by mirror and
    refraction rays, by shadow rays. holdout: cuts a hole of alpha 0 into the picture. catcher:
    camera rays see what other things change of its light, over what is behind it.
    values: by name, what programs read of each placement, (k, 4) float32.  light_set: 0 to 63,
    which lights reach it.  motion: (keys, k, 3, 4) float64, keys >= 2, world_from_object at even
    times while the shutter is open; None for what stands still.  asset: what it is part of, "" for
    itself alone; this and the name are what Cryptomatte passes tell.  light_group: of
    `Scene.light_groups`, of what it gives by itself; -1 for none.  receivers, blockers: as of
    `Light`, of what it gives as a light.
    """

    name: str
    geometry: int
    world_from_object: Array
    materials: tuple[int, ...]
    object_index: int = 0
    visible_camera: bool = True
    visible_mirror: bool = True
    visible_shadow: bool = True
    holdout: bool = False
    values: Mapping[str, Array] = field(default_factory=dict)
    light_set: int = 0
    motion: Array | None = None
    asset: str = ""
    catcher: bool = False
    light_group: int = -1
    receivers: int = EVERYTHING
    blockers: int = EVERYTHING


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
    texture's alpha on all three), or LUMINANCE (the mean of the three as grey).  uv: name of the UV
    attribute, "" for the active one. uv_transform: ((a, b, c), (d, e, f)) with u' = a u + b v + c
    and v' = d u + e v + f. attribute: name of a colour attribute, "" for none; a name the mesh
    lacks reads as 0. attribute_channel: COLOR or ALPHA.  output: which output of the material's
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


LOBES = (
    "AMBIENT",
    "DIFFUSE",
    "SPECULAR",
    "MIRROR",
    "REFRACTION",
    "TRANSPARENT",
    "EMISSION",
    "SHEEN",
    "FIBRE_DIFFUSE",
    "FIBRE_SPECULAR",
    "FIBRE_TRANSMISSION",
)


@dataclass(frozen=True)
class Lobe:
    """One term of a surface: `kind` times the product of `factors` (the notes' coefficient k).

    exponent: >= 0, Phong's of a SPECULAR lobe; an AMBIENT or DIFFUSE one is times (1 - n·v) to that
    power. ior: > 0. On REFRACTION the index inside the surface. `fresnel` multiplies a MIRROR lobe
    by the dielectric Fresnel reflectance of `ior`, a REFRACTION lobe by one minus it, and a
    SPECULAR lobe by what it is between v and h. schlick: multiplies a SPECULAR lobe by (1 - v·h)⁵
    (Schlick 1994): what a metal's reflectance gains towards grazing angles. masking: 0 to 1, of a
    SPECULAR lobe: the α of Smith's shadowing and masking, as GGX has them, which it is times; 0 for
    none. exponent_output, masking_output: which output of the material's program, a number, gives
    the exponent or masking instead, kept from 0 to what stands here; -1 for none.  ior_output: the
    same of ior, which stands where the output is not finite or not above 0.  A SHEEN lobe has its
    width as exponent and its lean as masking (SEMANTICS.md), FIBRE lobes as masking how far light
    fans out round the tangent, 0 for as far as normals do.  fibre_output: of FIBRE lobes, the
    output with the fibre's tangent in the world, as long as the fibre is thick there, 0 of what is
    no fibre; -1: all 0.  normal_output: of SPECULAR, MIRROR and REFRACTION lobes, the output with a
    shading normal of their own in the world; where it is zero or not finite, or -1, they have the
    point's.  stretch_output: of SPECULAR lobes, the output with a direction in the world along the
    surface: slopes of half vectors along it are times its length, those across it over that
    (SEMANTICS.md); -1, zero or not finite: none.  between_fibres: what it shows or lets through is
    light that other fibres scattered: `Scene.as_lit` drops it where light does not bounce.
    """

    kind: str
    factors: tuple[Input, ...] = (Input(),)
    exponent: float = 0.0
    ior: float = 1.0
    fresnel: bool = False
    schlick: bool = False
    masking: float = 0.0
    exponent_output: int = -1
    masking_output: int = -1
    ior_output: int = -1
    fibre_output: int = -1
    normal_output: int = -1
    stretch_output: int = -1
    between_fibres: bool = False

    @property
    def is_glossy(self) -> bool:
        """Whether it is a highlight of GGX's masking, which may reflect other surfaces."""
        return self.kind == "SPECULAR" and self.masking > 0

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
"""How light that a bent normal faces is hidden by what it was bent from (SEMANTICS.md, Light)."""


@dataclass(frozen=True)
class Material:
    """A surface is the sum of its lobes.

    index: Blender's material pass index.  program: computes what inputs, lobes and the normal name
    as outputs.  normal_output: the output, a vector, that takes the place of the shading normal
    (world space; where it is zero or not finite the mesh's own stays); -1 for none. aovs: what the
    surface gives to `Scene.aovs`, a material that nothing wears: the sum of its EMISSION lobes
    whose exponent is the number of the AOV.  medium: what fills the inside of what wears it, the
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

    def of_single_fibres(self) -> Material:
        """Without what light between fibres shows; itself where there is nothing of it."""
        lobes = tuple(lobe for lobe in self.lobes if not lobe.between_fibres)
        return self if len(lobes) == len(self.lobes) else replace(self, lobes=lobes)


@dataclass(frozen=True, eq=False)
class Emitters:
    """m triangles, each of one radiance on a side.

    corners: (m, 3, 3) float64, in the light's axes, counter-clockwise seen from outside.
    front, back: (m, 3) radiance of the outer side and the inner one.  weight: (m,) how densely, by
    area, points lie on them, but for a factor.  light_group: (m,) int, as of `Instances`.
    """

    corners: Array
    front: Array
    back: Array
    weight: Array
    light_group: Array

    @cached_property
    def areas(self) -> Array:
        """(m,)"""
        return np.linalg.norm(self._across, axis=1) / 2

    @cached_property
    def normals(self) -> Array:
        """(m, 3) unit, outward; 0 where a triangle has no area."""
        size = np.linalg.norm(self._across, axis=1)[:, None]
        return self._across / np.where(size > 0, size, 1.0)

    @cached_property
    def _across(self) -> Array:
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def reaches(self) -> Array:
        """(m,) lengths of the longest sides."""
        sides = np.diff(self.corners, axis=1, append=self.corners[:, :1])
        return np.linalg.norm(sides, axis=2).max(1)

    @cached_property
    def spreads(self) -> Array:
        """(m,) one over the density, by area, of the points on each."""
        return np.vdot(self.weight, self.areas) / self.weight

    def take(self, index: Array) -> Emitters:
        """Those at these places."""
        columns = self.corners, self.front, self.back, self.weight, self.light_group
        return Emitters(*(column[index] for column in columns))


@dataclass(frozen=True, eq=False)
class Bounces:
    """m points from which light goes on that surfaces scatter.

    points, normals: (m, 3) float64, in the light's axes, unit normals to the side that scatters.
    radiance: (m, 3) of the surface there.  spreads: (m,) one over how densely, by area, points are
    taken there. weights: (m,) how likely each is taken, but for a factor.  reaches: (m,) how far
    the ends of shadow rays stay off it.  numbers: (m,) from 0 to 1, of its own, evenly spread.
    caught: (m,) bool, on a shadow catcher.  light_group: (m,) int, of the light that they pass on.
    bends: (m,) one over the radius in which the surface bends away from there, 0 where it does not.
    last: (m,) bool, light that has bounced as often as asked for once it arrives.
    """

    points: Array
    normals: Array
    radiance: Array
    spreads: Array
    weights: Array
    reaches: Array
    numbers: Array
    caught: Array
    light_group: Array
    bends: Array
    last: Array


@dataclass(frozen=True, eq=False)
class Openings:
    """k rectangles through which rooms see the sky.

    centers: (k, 3) float64, world. right, up: (k, 3) half of their sides, across each other.
    normals: (k, 3) unit, to the side of the sky.  shares: (k,) of the points on them, sum 1.
    """

    centers: Array
    right: Array
    up: Array
    normals: Array
    shares: Array


LIGHTS = ("POINT", "SUN", "SPOT", "AREA", "DOME", "MESH", "BOUNCED")
LIGHT_SHAPES = ("RECTANGLE", "ELLIPSE")


@dataclass(frozen=True, eq=False)
class Light:
    """A light. kind: POINT, SUN, SPOT, AREA, DOME, which shines from all around, or MESH, which
    `Scene.as_lit` makes of surfaces that glow, or BOUNCED, which it makes of those that are lit.

    world_from_light: (3, 4) float64, orthonormal columns; the light shines along -z. color: RGB;
    strength: Blender's number (watts; W/m² for SUN) with exposure applied, may be negative. radius:
    of POINT and SPOT, world units; soft_falloff: the radius is a disc that faces the shaded point
    instead of a sphere. angle: full angle of the SUN. spot_size: full cone angle, spot_blend: 0-1.
    shape: RECTANGLE or ELLIPSE, size_x, size_y: full extents of an AREA light along its x and y,
    world units. cast_shadow: False lights through everything. visible_*: the light's own shape is
    seen by those rays. program: its first output, a vector, is what the colour is times at each
    point of the light that is seen from a lit one, None for 1; it reads no attributes, and a DOME
    has none. textures: what it refers to. radiance: of a DOME, times color and strength: (h, w, 3)
    float32 in the light's axes, equirectangular as `engine.lights.dome` says. emitters: of a MESH,
    whose bounds are size_x, size_y and twice the radius along the light's axes, round its origin.
    bounces: of a BOUNCED one, the same. openings: of a DOME, points on which are samples of it too;
    `Scene.as_lit` finds them. receivers: a bit for each light_set of the instances that it lights,
    blockers: of those that cast shadows in it. motion: (k, 3, 4) float64, k >= 2, world_from_light
    at even times while the shutter is open; None for one that stands still, and of a DOME, MESH or
    BOUNCED one. light_group: of `Scene.light_groups`, -1 for none; emitters and bounces have their
    own.
    """

    name: str
    kind: str
    world_from_light: Array
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    strength: float = 1.0
    radius: float = 0.0
    soft_falloff: bool = False
    angle: float = 0.0
    spot_size: float = np.pi / 4
    spot_blend: float = 0.0
    shape: str = "RECTANGLE"
    size_x: float = 0.0
    size_y: float = 0.0
    cast_shadow: bool = True
    visible_camera: bool = False
    visible_mirror: bool = False
    program: Program | None = None
    textures: tuple[Texture, ...] = ()
    radiance: Array | None = None
    emitters: Emitters | None = None
    bounces: Bounces | None = None
    openings: Openings | None = None
    receivers: int = EVERYTHING
    blockers: int = EVERYTHING
    motion: Array | None = None
    light_group: int = -1


CAMERAS = ("PERSPECTIVE", "ORTHOGRAPHIC", "PANORAMA")


@dataclass(frozen=True)
class Lens:
    """A thin lens at the camera's eye: what lies beside its plane of focus is blurred.

    radius: along the camera's v; along u it is radius / ratio, camera units. focus: depth of the
    plane where everything is sharp, camera units, above 0. blades: corners of a regular polygon
    inside that ellipse, 0 for all of it. rotation: of the polygon, radians from u towards v.
    """

    radius: float
    focus: float
    blades: int = 0
    rotation: float = 0.0
    ratio: float = 1.0


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera with a pinhole or a lens, a parallel one (notes, sections 4.4-4.6), or a panorama.

    kind: PERSPECTIVE, ORTHOGRAPHIC or PANORAMA.
    world_from_camera: (3, 4) float64; columns u (right), v (up), w (backward), e (eye). u, v, w may
    be mirrored or scaled. window: (l, r, b, t) on the plane at distance 1 in front of the eye
    (PERSPECTIVE) or through it (ORTHOGRAPHIC), camera units. An asymmetric window is lens shift: an
    oblique projection. Of a PANORAMA: what is seen of its unit square, which may be passed.
    clip_start, clip_end: bounds of the depth along -w, of a PANORAMA of the distance, camera units.
    clip_planes: at most six rows (a, b, c, d) that bound what camera rays see to a x + b y + c z +
    d >= 0, where x and y count along u and v and z is the depth, camera units; none of a PANORAMA.
    What light and
    mirrors meet is not cut. resolution: (nx, ny) of the full frame. lens: None for a pinhole.
    motion: (k, 3, 4) float64, k >= 2, world_from_camera at even times while the shutter is open;
    None for a camera that stands still. shutter: (k,) float64, k >= 2, at least 0 and not all 0:
    how far it is open at even times, None for all of it. panorama: of that kind alone.
    """

    kind: str
    world_from_camera: Array
    window: tuple[float, float, float, float]
    resolution: tuple[int, int]
    clip_start: float = 0.0
    clip_end: float = np.inf
    clip_planes: tuple[tuple[float, float, float, float], ...] = ()
    lens: Lens | None = None
    motion: Array | None = None
    shutter: Array | None = None
    panorama: Panorama | None = None


MISTS = ("QUADRATIC", "LINEAR", "INVERSE_QUADRATIC")


@dataclass(frozen=True)
class Mist:
    """What the Mist pass shows: none up to `start`, all from `depth` beyond it on, world units;
    falloff: how it grows between them.
    """

    start: float = 5.0
    depth: float = 25.0
    falloff: str = "QUADRATIC"


@dataclass(frozen=True, eq=False)
class World:
    """Surroundings: `ambient` is the notes' I_a, `background` what rays that miss see (radiance).

    transparent: camera rays that miss leave alpha 0 instead of the background.  program: its first
    output, a vector, is seen instead of `background` where there is one; of what reads points it
    has `incoming` and `light_path` alone.  textures: what it refers to.  axes: (3, 3) orthonormal
    columns, the program's axes in the scene. mist: of the pass, not in the picture.  medium: what
    is everywhere, inside of things too, its program's textures are the world's; None for nothing.
    occlusion_distance: 0 to 1e30, how far the pass Ambient Occlusion looks, world units.
    light_group: of `Scene.light_groups`, of what is seen, of `ambient` and of the medium; -1 for
    none.
    """

    ambient: tuple[float, float, float] = (0.0, 0.0, 0.0)
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    transparent: bool = False
    program: Program | None = None
    textures: tuple[Texture, ...] = ()
    axes: Array = field(default_factory=lambda: np.eye(3))
    mist: Mist = Mist()
    medium: Medium | None = None
    occlusion_distance: float = 10.0
    light_group: int = -1


@dataclass(frozen=True, eq=False)
class Scene:
    """All that a picture depends on, besides `Settings`. aovs: names; of each the film has the pass
    `film.aov_pass`.  neighbours: the frame before and the one after, for the pass Vector alone:
    the same geometries and instances, which may stand elsewhere, and meshes have other vertices,
    seen by a camera of the same kind; None where nothing moves.  light_groups: names; of each the
    film has the pass `film.light_group_pass`.
    """

    camera: Camera
    geometries: tuple[Geometry, ...] = ()
    instances: tuple[Instances, ...] = ()
    materials: tuple[Material, ...] = ()
    textures: tuple[Texture, ...] = ()
    lights: tuple[Light, ...] = ()
    world: World = field(default_factory=World)
    aovs: tuple[str, ...] = ()
    neighbours: tuple[Scene, Scene] | None = None
    light_groups: tuple[str, ...] = ()

    def as_lit(
        self,
        *,
        by_world: bool,
        by_meshes: bool,
        bounces: int,
        finding: bool = True,
        between_fibres: bool | None = None,
    ) -> Scene:
        """The scene with the lights that the settings want. by_world: its DOME light lights it and
        surfaces hide that; else `World.ambient` is the same everywhere.  by_meshes: what glows
        lights it too.  bounces: how often surfaces scatter light onto others.  finding: the
        openings of rooms to the sky, else its light keeps those that it has.  between_fibres:
        lobes of light between fibres stay; None: where light bounces. A scene with nothing of all
        that stays.
        """
        from ..lights.bounced_light import bounced_light
        from ..lights.lamps import in_order
        from ..lights.mesh_lights import mesh_lights
        from ..lights.openings import opened

        lights = in_order(self.lights)
        scene = self if lights is self.lights else replace(self, lights=lights)
        lamps = tuple(light for light in lights if light.kind != "DOME")
        if len(lamps) < len(lights):
            if by_world:
                lit = tuple(opened(x, self) if finding and x.kind == "DOME" else x for x in lights)
                world = replace(self.world, ambient=(0.0, 0.0, 0.0))
                scene = replace(scene, lights=lit, world=world)
            else:
                scene = replace(scene, lights=lamps)
        glow = mesh_lights(self) if by_meshes else ()
        scene = replace(scene, lights=(*scene.lights, *glow)) if glow else scene
        if not (bounces > 0 if between_fibres is None else between_fibres):
            materials = tuple(material.of_single_fibres() for material in scene.materials)
            if any(a is not b for a, b in zip(materials, scene.materials, strict=True)):
                scene = replace(scene, materials=materials)
        bounced = bounced_light(scene, bounces)
        return scene if bounced is None else replace(scene, lights=(*scene.lights, bounced))

    @property
    def scatters(self) -> bool:
        """Whether some medium scatters light."""
        media = (self.world.medium, *(material.medium for material in self.materials))
        return any(medium is not None and medium.scatters for medium in media)

    @property
    def most_asked(self) -> int:
        """How many rays an operation of a program asks for, at most (`Program.most_asked`)."""
        aovs = (material.aovs for material in self.materials if material.aovs)
        programs = [thing.program for thing in (*self.materials, *aovs)]
        programs += [light.program for light in self.lights]
        return max((program.most_asked for program in programs if program), default=0)

    def medium_of(self, instances: Instances) -> Medium | None:
        """What is inside of things that wear these materials; strands have no inside."""
        if isinstance(self.geometries[instances.geometry], Strands):
            return None
        media = (self.materials[index].medium for index in instances.materials)
        return next((medium for medium in media if medium is not None), None)

    def problems(self) -> list[str]:
        """What makes this scene unfit to render, one sentence each; empty when it is sound."""
        from .problems import scene_problems

        return scene_problems(self)
