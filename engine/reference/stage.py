"""Everything that one render needs, built from the scene once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..cryptomatte import id_bits
from ..film import CRYPTOMATTES, LIGHTING, SEEN
from ..lights.bounced_light import bounced_table
from ..lights.dome import dome_table
from ..lights.glowing_media import medium_table
from ..lights.interleaving import interleaving, path_bounces
from ..lights.lamps import shared_rays, shared_samples
from ..lights.mesh_lights import mesh_table
from ..sampling import (
    BOUNCE_PARTS,
    GATHER_BLOCK,
    bounce_parts,
    bounce_points,
    dealt_samples,
    gather_points,
    gloss_points,
    light_points,
    lobe_points,
    places_in_blocks,
    scatter_offsets,
    subsurface_points,
)
from ..scene import EVERYTHING, Light, Scene
from ..settings import Settings
from .attributes import Attributes
from .camera import CameraRays
from .cancellation import Cancellation
from .coefficients import Coefficients
from .emission import Emission
from .geometry import gather
from .gloss import ambient_seen
from .glowing_media import MediumSource
from .lighting import Lighting
from .lights import CENTER, LightPoint, Source
from .materials import Shader
from .media import Media
from .paths import Paths
from .scene_queries import SceneQueries, points_of_nodes, uncounted
from .seen_lights import has_shape
from .shadows import Shadows
from .sky import radiance
from .surface import Surface
from .tabled_lights import (
    FAINT,
    SKY_PARTS,
    BouncedSource,
    Dome,
    MeshSource,
    OpeningPoints,
)
from .textures import Image
from .vectors import unit
from .visibility import Visibility

Array = np.ndarray

GATHERED_SHARE = 4
"""One in so many of the shadow rays of bounced light are asked by what gather rays meet, which a
block of pixels blurs.
"""


def mixes_gloss(scene: Scene) -> bool:
    """Whether something may reflect in blocks of pixels, which media that vary do not know."""
    media = (scene.world.medium, *(material.medium for material in scene.materials))
    is_glossy = any(lobe.is_glossy for material in scene.materials for lobe in material.lobes)
    return is_glossy and all(x is None or x.program is None for x in media)


class Stage:
    """A scene made ready: geometry relative to the camera, materials, lights, viewing rays.

    rays: counts of the rays traced so far, by kind.
    """

    def __init__(self, scene: Scene, settings: Settings, cancellation: Cancellation):
        self.scene, self.settings, self.cancellation = scene, settings, cancellation
        self.interleaving = interleaving(scene, settings)
        self._samples = dealt_samples(settings.samples, self.interleaving)  # of tables
        self.bounces = path_bounces(scene, settings)
        self.eye = np.asarray(scene.camera.world_from_camera, np.float64)[:, 3]
        self.geometry = gather(scene, self.eye)
        cancellation.check()
        self.attributes = Attributes(scene)
        self.shader = Shader(scene, self.attributes, self.geometry)
        self.visibility = Visibility(
            self.geometry, ~self.shader.is_transparent(self.geometry.material), cancellation
        )
        cancellation.check()
        self.rays: Counter[str] = Counter()
        self.sources = tuple(self._source(light) for light in scene.lights)
        self.shared_samples = shared_samples(scene.lights, settings)
        asked, points = settings.bounced_shadows, settings.bounced_samples
        bounced = any(light.kind == "BOUNCED" for light in scene.lights)
        self.shared_bounced = (asked, points) if bounced else (0, 0)
        media = any(light.kind == "MEDIUM" for light in scene.lights)
        of_media = settings.medium_shadows, settings.medium_samples
        self.shared_media = of_media if media else (0, 0)
        self.media = Media(scene, self.attributes, self.visibility)
        shadows = Shadows(self.visibility, self.shader, self.attributes, self.rays, self.media)
        self.shadows = shadows
        self.lighting = Lighting(
            self.sources,
            settings.light_samples,
            self._light_points(),
            shadows,
            cancellation,
            self.per_object("light_set", np.arange(len(self.geometry.placements.block))),
            shared_rays(scene.lights, settings),
            asked,
            medium_marks=settings.medium_shadows,
            light_groups=len(scene.light_groups),
            reflecting=settings.reflecting,
            first_rod=self.geometry.first_rod,
            dealt=self.interleaving > 1,
            by_paths=self.bounces > 0,
        )
        caught = self.per_object("catcher", np.arange(len(self.geometry.placements.block)))
        self.catches = bool(caught.any())
        self.lighting_of_catchers = (
            self.lighting.of_catchers(caught.astype(bool)) if self.catches else self.lighting
        )
        near = [source.reach for source in self.sources if isinstance(source, BouncedSource)]
        self.reach = 0.0 if self.catches or self.bounces or not near else near[0]
        far = replace(self.lighting, reach=self.reach)
        blurred = tuple(self._blurred(source) for source in self.sources)
        self._lighting_of_near = replace(
            self.lighting,
            sources=self.sources if self.bounces else blurred,
            gathered=True,
            each_once=self.bounces > 0,
            bounced_marks=max(settings.bounced_shadows // GATHERED_SHARE, 1),
        )
        self._lighting_of_blurred = replace(self.lighting, sources=blurred, faint=FAINT)
        # of what rays meet before they bounce, and after that
        self._lighting_of_far = (far, replace(far, faint=FAINT))
        self._lighting = (self.lighting, replace(self.lighting, faint=FAINT))
        self._lighting_of_exits = tuple(
            replace(lighting, faint=np.inf) for lighting in (self.lighting, far)
        )
        self._lobe_points = lobe_points(self._samples)
        self._gather_points = gather_points(
            self._samples, settings.gather_samples, self.gather_block
        )
        parts = BOUNCE_PARTS if self.interleaving > 1 else 1
        self._bounce_points = bounce_points(parts * self._samples)
        self._gloss_points = gloss_points(self._samples)
        self.asks_rays = scene.most_asked > 0
        self._node_points = points_of_nodes(self._samples, scene.most_asked)
        self.scatter_offsets = scatter_offsets(self._samples)
        self._subsurface_points = subsurface_points(self._samples, self.gather_block)
        self._goes_below = settings.subsurface == "ON" and scene.has_subsurface
        self.is_lit_by_meshes = any(light.kind == "MESH" for light in scene.lights)
        self._sky_images = [Image(texture) for texture in scene.world.textures]
        self.camera = CameraRays.of(scene.camera, self.geometry)
        self.ambient, self.background = (
            np.array(c, np.float64)[:, None] for c in (scene.world.ambient, scene.world.background)
        )

    def _blurred(self, source: Source) -> Source:
        """A light as rough reflections and gather rays show what it lights."""
        if isinstance(source, BouncedSource):
            return source.widened() if self.reach > 0 else source
        return source.in_parts(SKY_PARTS) if isinstance(source, Dome) else source

    def even_light(self, surface: Surface, coefficients: Coefficients) -> Array:
        """(3, n) what AMBIENT lobes of n points give back of the world's radiance."""
        return ambient_seen(surface, coefficients) * self.ambient

    def background_of(self, origin: Array, along: Array, kind: str) -> Array:
        """(3, n) or (3, 1): what rays of a kind, origin and directions (3, n), see that hit
        nothing.
        """
        program = self.scene.world.program
        if program is None:
            return self.background
        axes = np.asarray(self.scene.world.axes, np.float64)
        camera, along = self.scene.camera, unit(along)
        is_parallel = camera.kind == "ORTHOGRAPHIC" and kind == "camera"
        seen = camera, origin + along if is_parallel else along
        return radiance(program, self._sky_images, axes.T @ along, kind, seen)

    @cached_property
    def glass_differs(self) -> bool:
        """Whether some things or lights are seen in mirrors and not through glass, or the other
        way.
        """
        lights = (s.light for s in self.sources if has_shape(s))
        return self.geometry.glass_differs or any(
            light.visible_mirror != light.visible_transmission for light in lights
        )

    def gathers(self, paths: Paths) -> bool:
        """Whether rays look for surfaces near by that throw light on what the paths meet: but for
        what rough reflections show.
        """
        if self.bounces:
            return paths.bounced < self.bounces
        return self.reach > 0 and not paths.gathers and paths.reflections == 0

    @property
    def gather_block(self) -> int:
        """Side of the squares of pixels that share rays; what is dealt is not shared."""
        return GATHER_BLOCK if self.interleaving == 1 else 1

    @property
    def shares_gathers(self) -> bool:
        """Whether pixels of a block share what gather rays find: media that vary are traced with
        few pixels at once.
        """
        return self.reach > 0 and not self.media.varies and self.interleaving == 1

    def points_apart(self, surface: Surface) -> Array:
        """(n,) bool: which ask the points of bounced light for their shadows themselves: fibres,
        that these light from behind as well, and all where such lights light but some.
        """
        bounced = [source for source in self.sources if isinstance(source, BouncedSource)]
        if any(source.light.receivers != EVERYTHING for source in bounced):
            return np.ones(len(surface), bool)
        soft = [
            any(lobe.kind.startswith("FIBRE") for lobe in material.lobes)
            for material in self.scene.materials
        ]
        is_strand = surface.primitive >= self.geometry.first_rod
        return np.array(soft, bool)[surface.material] | is_strand

    @property
    def mixes_gloss(self) -> bool:
        """Whether pixels of a block share what wide lobes reflect, as `shares_gathers`."""
        off = self.settings.reflecting == "OFF" or self.interleaving > 1
        return not off and mixes_gloss(self.scene)

    def lighting_of(self, paths: Paths) -> Lighting:
        """Of what the paths meet."""
        if paths.comes_out:
            return self._lighting_of_exits[self.gathers(paths)]
        if paths.gathers:
            return self._lighting_of_near
        if self.reach > 0 and self.gathers(paths):
            return self._lighting_of_far[paths.depth > 0]
        return self._lighting_of_blurred if paths.reflections else self._lighting[paths.depth > 0]

    def lobe_point(self, sample: int, reflections: int) -> LightPoint:
        """Where in the lobes of rough surfaces a sample is reflected that was so often before."""
        levels, tabled, _ = self._lobe_points.shape
        return LightPoint(CENTER.square, self._lobe_points[reflections % levels, sample % tabled])

    def gather_points(self, sample: int, places: Array) -> Array:
        """(gather_samples, 2, n) of the unit disc, below which directions a sample looks for
        surfaces that throw light on. places: (n,) of its pixels in their blocks.
        """
        points, each = self._gather_points, self.settings.gather_samples
        first = sample % max(points.shape[1] // each, 1) * each
        return points[:, first : first + each].transpose(1, 2, 0)[:, :, places]

    def bounce_points(self, sample: int, bounced: int, places: Array) -> Array:
        """(3, n) of `bounce_points`, of rays by which paths bounce after so many bounces. places:
        (n,) of their pixels.
        """
        points, run = self._bounce_points, 1 << max(self.settings.samples - 1, 0).bit_length()
        number = np.full(len(places), sample)
        if self.interleaving > 1:
            number = (BOUNCE_PARTS * (sample // run) + places) * run + sample % run
        return points[bounced % len(points), number % points.shape[1]].T

    def places(self, x: tuple[int, int], y: tuple[int, int]) -> Array:
        """(pixels,) of the pixels from x[0] and y[0] to before x[1] and y[1] of the frame, row by
        row: in their blocks of gather rays, or among those that deal bounces.
        """
        if self.bounces and self.interleaving > 1:
            return bounce_parts(x, y, self.interleaving)
        return places_in_blocks(x, y, self.gather_block)

    def gloss_points(self, sample: int) -> Array:
        """(2, 2) where in wide lobes the pixels of pairs reflect their rays."""
        return self._gloss_points[sample % len(self._gloss_points)]

    def scatters_below(self, paths: Paths) -> bool:
        """Whether light comes out of what the paths meet elsewhere: where they are neither blurred
        nor scattered.
        """
        return self._goes_below and not paths.gathers and paths.reflections == 0

    def subsurface_rows(self, sample: int, places: Array) -> Array:
        """(6, n) of `subsurface_points`. places: (n,) of pixels in their blocks."""
        points = self._subsurface_points
        return points[places % len(points), sample % points.shape[1]].T

    def probes(self, sample: int, on_rays: Callable[[Array], None]) -> SceneQueries:
        """How light below surfaces finds where it comes out."""
        return SceneQueries(
            self.visibility, self.attributes, self._node_points, sample, 0.0, on_rays
        )

    def queries(
        self, sample: int, on_rays: Callable[[Array], None] = uncounted
    ) -> SceneQueries | None:
        """How the programs of surfaces ask for rays; None where none does."""
        if not self.asks_rays:
            return None
        reach = self.scene.world.occlusion_distance
        return SceneQueries(
            self.visibility, self.attributes, self._node_points, sample, reach, on_rays
        )

    def _source(self, light: Light) -> Source:
        samples = self._samples
        if light.kind == "MESH":
            table = mesh_table(light, samples, self.settings.mesh_samples)
            return MeshSource(light, self.eye, table)
        if light.kind == "MEDIUM":
            table = medium_table(light, samples, self.settings.medium_samples)
            return MediumSource(light, self.eye, table)
        if light.kind == "BOUNCED":
            pixels = self.interleaving**2
            table = bounced_table(light, samples, self.settings.bounced_samples, pixels)
            return BouncedSource(light, self.eye, table)
        if light.kind != "DOME":
            emission = None
            if light.program is not None:
                emission = Emission([Image(t) for t in light.textures], self.scene.camera)
            return Source(light, self.eye, self.settings.illumination == "PHYSICAL", emission)
        n = self.settings.dome_samples
        seen = OpeningPoints.of(light, self.eye, samples, self.settings.opening_samples, n)
        return Dome(light, self.eye, dome_table(light, samples, n), n, seen)

    def _light_points(self) -> list[LightPoint]:
        lamps = [source for source in self.sources if source.points is None]
        if all(source.sample_count(self.settings.light_samples) == 1 for source in lamps):
            return []
        square, disc = light_points(self._samples * self.settings.light_samples)
        return [LightPoint(*pair) for pair in zip(square, disc, strict=True)]

    def per_object(self, name: str, row: Array) -> Array:
        """A field of `Instances` for each row of the placements."""
        values = np.array([getattr(block, name) for block in self.scene.instances])
        return values[self.geometry.placements.block[row]]

    @property
    def sees(self) -> bool:
        """Whether passes are asked for that are means of what is seen."""
        return not self.settings.passes.isdisjoint(SEEN)

    @property
    def splits(self) -> bool:
        """Whether light is told apart by the surfaces that give it back."""
        return self.resolves or not self.settings.passes.isdisjoint(LIGHTING)

    @property
    def resolves(self) -> bool:
        """Whether light is averaged over pixels."""
        return self.interleaving > 1 and self.settings.soft_light == "RESOLVED"

    def mist(self, distance: Array) -> Array:
        """How much of it lies before what is at these distances from the eye, world units."""
        mist = self.scene.world.mist
        share = np.clip((distance - mist.start) / mist.depth if mist.depth > 0 else 0.0, 0.0, 1.0)
        power = {"QUADRATIC": 2.0, "LINEAR": 1.0, "INVERSE_QUADRATIC": 0.5}[mist.falloff]
        return np.broadcast_to(share**power, distance.shape)

    def crypto_ids(self, surface: Surface) -> dict[str, Array]:
        """The bits of the ids of surfaces, for each Cryptomatte pass."""
        blocks = self.scene.instances
        objects = np.array([id_bits(block.name) for block in blocks], np.uint32)
        assets = np.array([id_bits(block.asset or block.name) for block in blocks], np.uint32)
        block = self.geometry.placements.block[surface.row]
        material = self.shader.crypto_bits(surface.material)
        return dict(zip(CRYPTOMATTES, (objects[block], material, assets[block]), strict=True))

    def stats(self) -> dict[str, float]:
        """Counts for `Film.stats`."""
        g, tree = self.geometry, self.visibility.built_tree
        stored = (g.points, g.triangles, g.number, g.row, g.material)
        return {
            "triangles": g.triangle_count,
            "primitives": g.count,
            "instances": len(g.placements.block),
            "rays": sum(self.rays.values()),
            **{f"{kind} rays": count for kind, count in self.rays.items()},
            **self.media.asked,
            "bytes": sum(a.nbytes for a in stored) + (tree.bytes if tree else 0),
        }
