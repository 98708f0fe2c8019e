"""The scene as plain values: what Blender's export makes and what every tracer takes.

Everything is a frozen dataclass of NumPy arrays and integer handles; handles index the tuples of
`Scene`. World quantities are float64, geometry stays in object space as float32 (Blender's own
precision). `docs/semantics` says which picture a scene stands for; `problems.py`
checks a scene at the API boundary.

Conventions: right-handed, metres as Blender's units, angles in radians, colours scene-linear RGB. A
matrix `target_from_source` is `(3, 4)`: columns 0-2 the linear part, column 3 the translation.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..program.program import Program
from .model_geometry import Geometry, Instances, Strands
from .model_lights import Light
from .model_surfaces import Material, Medium, Texture
from .panorama import Eye, Panorama

Array = np.ndarray


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
    how far it is open at even times, None for all of it. panorama: of that kind alone. eye: of a
    stereoscopic pair that looks in every direction, none of an ORTHOGRAPHIC; None where e is the
    eye.
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
    eye: Eye | None = None


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
    has `incoming`, `light_path` and `ray_depth` alone.  textures: what it refers to.  axes: (3, 3)
    orthonormal columns, the program's axes in the scene. mist: of the pass, not in the picture.
    medium: what is everywhere, inside of things too, its program's textures are the world's; None
    for nothing. occlusion_distance: 0 to 1e30, how far the pass Ambient Occlusion looks, world
    units. light_group: of `Scene.light_groups`, of what is seen, of `ambient` and of the medium; -1
    for none.
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

    @property
    def scatters(self) -> bool:
        """Whether some medium scatters light."""
        media = (self.world.medium, *(material.medium for material in self.materials))
        return any(medium is not None and medium.scatters for medium in media)

    @property
    def has_glowing_media(self) -> bool:
        """Whether something may be filled with a medium that gives light."""
        return any(m.medium is not None and m.medium.emits for m in self.materials)

    @property
    def has_subsurface(self) -> bool:
        """Whether light of some material comes out of the surface elsewhere."""
        return any(lobe.goes_below for material in self.materials for lobe in material.lobes)

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
