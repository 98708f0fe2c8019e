"""Everything that one render needs, built from the scene once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..cryptomatte import id_bits
from ..evaluation.attributes import Attributes
from ..evaluation.geometry import gather
from ..evaluation.sky import radiance
from ..evaluation.surface import Surface
from ..evaluation.textures import Image
from ..film import CRYPTOMATTES, LIGHTING, SEEN
from ..lights.dome import dome_table
from ..lights.glowing_media import medium_table
from ..lights.interleaving import interleaving
from ..lights.lamps import shared_rays, shared_samples
from ..lights.mesh_lights import mesh_table
from ..linear.columns import unit
from ..sampling import (
    BOUNCE_LEVELS,
    BOUNCE_PARTS,
    bounce_parts,
    bounce_points,
    dealt_samples,
    light_points,
    lobe_points,
    scatter_offsets,
    subsurface_points,
)
from ..scene import Light, Scene
from ..settings import Settings
from .camera import CameraRays
from .cancellation import Cancellation
from .coefficients import Coefficients
from .emission import Emission
from .gloss import ambient_seen
from .glowing_media import MediumSource
from .lighting import DirectLight, Lighting
from .lights import CENTER, LightPoint, Source
from .materials import Shader
from .media import Media
from .paths import Interaction, Paths
from .photon_tracer import trace_photons
from .raster import Strips
from .rays import IncoherentRays
from .scene_queries import SceneQueries, points_of_nodes, uncounted
from .seen_lights import has_shape
from .shadows import Shadows
from .tabled_lights import (
    FAINT,
    SKY_PARTS,
    Dome,
    MeshSource,
    OpeningPoints,
)
from .visibility import Hits, Visibility

Array = np.ndarray


class Stage:
    """A scene made ready: geometry relative to the camera, materials, lights, viewing rays.

    rays: counts of the rays traced so far, by kind.
    """

    def __init__(self, scene: Scene, settings: Settings, cancellation: Cancellation):
        self.scene, self.settings, self.cancellation = scene, settings, cancellation
        self.interleaving = interleaving(scene, settings)
        self.samples = dealt_samples(settings.samples, self.interleaving)  # of tables
        self.bounces = settings.bounces if scene.lights else 0
        most = min(settings.max_bounces, BOUNCE_LEVELS) if self.bounces else 0
        self.fibre_bounces = max(self.bounces, most)
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
        media = any(light.kind == "MEDIUM" for light in scene.lights)
        of_media = settings.medium_shadows, settings.medium_samples
        self.shared_media = of_media if media else (0, 0)
        self.media = Media(scene, self.attributes, self.visibility)
        self._lobe_points = lobe_points(self.samples)
        shadows = Shadows(self.visibility, self.shader, self.attributes, self.rays, self.media)
        self.shadows = shadows
        self.lighting = Lighting(
            self.sources,
            settings.light_samples,
            self._light_points(),
            shadows,
            cancellation,
            self.per_object("light_set", np.arange(len(self.geometry.placements.block))),
            self._lobe_points[0],
            shared_rays(scene.lights, settings),
            medium_marks=settings.medium_shadows,
            light_groups=len(scene.light_groups),
            reflecting=settings.reflecting,
            first_rod=self.geometry.first_rod,
            dealt=self.interleaving > 1,
            draws_matt=not any(
                lobe.kind.startswith("FIBRE") for m in scene.materials for lobe in m.lobes
            ),
        )
        caught = self.per_object("catcher", np.arange(len(self.geometry.placements.block)))
        self.catches = bool(caught.any())
        blurred = tuple(
            source.in_parts(SKY_PARTS) if isinstance(source, Dome) else source
            for source in self.sources
        )
        self.asks_rays = scene.most_asked > 0
        self._node_points = points_of_nodes(self.samples, scene.most_asked)
        self.photon_map = trace_photons(self)
        has_photons = self.photon_map is not None
        self._lighting_of_near = replace(self.lighting, each_once=True, has_photons=has_photons)
        self.lighting_of_catchers = self._near_of_catchers = self.lighting
        if self.catches:
            self.caught = caught.astype(bool)
            self.lighting_of_catchers = self.lighting.of_catchers(self.caught)
            self._near_of_catchers = self._lighting_of_near.of_catchers(self.caught)
        lighting = replace(self.lighting, sources=blurred, faint=FAINT)
        self._lighting_of_blurred = [replace(lighting, lobe_points=p) for p in self._lobe_points]
        # of what rays meet before they bounce, and after that
        self._lighting = (self.lighting, replace(self.lighting, faint=FAINT))
        self._lighting_of_exits = replace(self.lighting, faint=np.inf)
        self._lighting_unshadowed = replace(self.lighting, hides=False)
        parts = BOUNCE_PARTS if self.interleaving > 1 else 1
        self._bounce_points = bounce_points(parts * self.samples)
        self.scatter_offsets = scatter_offsets(self.samples)
        self._subsurface_points = subsurface_points(self.samples)
        self._goes_below = settings.subsurface == "ON" and scene.has_subsurface
        self.is_lit_by_meshes = any(light.kind == "MESH" for light in scene.lights)
        self._sky_images = [Image(texture) for texture in scene.world.textures]
        self.camera = CameraRays.of(scene.camera, self.geometry)
        self.ambient, self.background = (
            np.array(c, np.float64)[:, None] for c in (scene.world.ambient, scene.world.background)
        )

    def even_light(self, surface: Surface, coefficients: Coefficients) -> Array:
        """(3, n) what AMBIENT lobes of n points give back of the world's radiance."""
        return ambient_seen(surface, coefficients) * self.ambient

    def unshadowed(self, at: Interaction, sample: int) -> DirectLight:
        """What lights would give to what camera rays meet if nothing hid them, in that sample."""
        told = at.surface, at.coefficients, at.weight, sample
        return self._lighting_unshadowed.direct(*told, lambda *_: None, lambda _: None)

    def background_of(self, paths: Paths, missed: Array) -> Array:
        """(3, n) or (3, 1): what the rays `missed` (n,) of paths see, which hit nothing."""
        program = self.scene.world.program
        if program is None:
            return self.background
        axes = np.asarray(self.scene.world.axes, np.float64)
        origin, along = paths.rays.lines(missed)
        camera, along = self.scene.camera, unit(along)
        is_parallel = camera.kind == "ORTHOGRAPHIC" and paths.kind == "camera"
        seen = camera, origin + along if is_parallel else along
        past = paths.past(missed)
        return radiance(program, self._sky_images, axes.T @ along, paths.kind, seen, past)

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
        """Whether light bounces on at what is matt, which the paths meet."""
        return paths.bounced < self.bounces

    def are_strands(self, surface: Surface) -> Array:
        """(m,) bool."""
        return surface.primitive >= self.geometry.first_rod

    def closest(self, paths: Paths, strips: Strips | None = None) -> Hits:
        """What the paths meet first. strips: as `Visibility.closest`."""
        if paths.caught != "alone":
            return self.visibility.closest(paths.rays, paths.visibility, strips)
        assert isinstance(paths.rays, IncoherentRays)
        seen = self.geometry.visible[paths.visibility]
        mine = self.caught[self.geometry.row]
        return self.visibility.closest_of(paths.rays, mine if seen is None else mine & seen)

    def lighting_of(self, paths: Paths) -> Lighting:
        """Of what the paths meet."""
        if paths.comes_out:
            return self._lighting_of_exits
        if paths.gathers:
            return self._near_of_catchers if paths.caught == "alone" else self._lighting_of_near
        if paths.reflections:
            return self._lighting_of_blurred[paths.reflections % len(self._lobe_points)]
        return self._lighting[paths.depth > 0]

    def lobe_point(self, sample: int, reflections: int) -> LightPoint:
        """Where in the lobes of rough surfaces a sample is reflected that was so often before."""
        levels, tabled, _ = self._lobe_points.shape
        return LightPoint(CENTER.square, self._lobe_points[reflections % levels, sample % tabled])

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
        row, among those that deal bounces.
        """
        if self.interleaving > 1:
            return bounce_parts(x, y, self.interleaving)
        return np.zeros((x[1] - x[0]) * (y[1] - y[0]), np.intp)

    def scatters_below(self, paths: Paths) -> bool:
        """Whether light comes out of what the paths meet elsewhere: where they are neither blurred
        nor scattered.
        """
        return self._goes_below and not paths.gathers and paths.reflections == 0

    def subsurface_row(self, sample: int) -> Array:
        """(6,) of `subsurface_points`."""
        points = self._subsurface_points
        return points[sample % len(points)]

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
        samples = self.samples
        if light.kind == "MESH":
            table = mesh_table(light, samples, self.settings.mesh_samples)
            return MeshSource(light, self.eye, table)
        if light.kind == "MEDIUM":
            table = medium_table(light, samples, self.settings.medium_samples)
            return MediumSource(light, self.eye, table)
        if light.kind != "DOME":
            emission = None
            if light.program is not None:
                emission = Emission([Image(t) for t in light.textures], self.scene.camera)
            return Source(light, self.eye, self.settings.illumination == "PHYSICAL", emission)
        n = self.settings.dome_samples
        seen = OpeningPoints.of(light, self.eye, samples, self.settings.opening_samples, n)
        every = n // self.settings.light_samples
        return Dome(light, self.eye, dome_table(light, samples, n), n, every, seen)

    def _light_points(self) -> list[LightPoint]:
        lamps = [source for source in self.sources if source.points is None]
        if all(source.sample_count(self.settings.light_samples) == 1 for source in lamps):
            return []
        square, disc = light_points(self.samples * self.settings.light_samples)
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
