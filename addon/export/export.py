"""The export's order of work."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...engine.scene import Camera, Geometry, Scene, SceneDelta, Strands
from .cache import ExportCache
from .camera import Region, border, export_camera, resolution
from .collector import Collector, evaluated
from .culling import Culling
from .geometry.displacing import Displaced
from .images.decoded import Decoded
from .images.images import Images
from .instances import walk
from .light_groups import LightGroups
from .materials.aovs import Aov, note_world
from .materials.required import RequiredAttributes
from .missing import note_missing
from .panorama import Looker
from .placing import note_placed
from .report import Report
from .unsupported import note_scene
from .world import export_world, with_light_group, with_pass_settings


@dataclass(frozen=True, eq=False)
class Export:
    """What one export gives.

    scene: plain values, nothing of Blender's.
    notes: what could not be rendered as it is, each said once.
    stats: seconds per stage ("objects", "finish", "export") and counts ("meshes", "instances",
    "triangles", "lights", "materials", "textures", "bytes"). region: the render border as (x0, y0,
    x1, y1) pixels of the full frame, origin bottom left, or None. displaced: how meshes were, by
    their numbers among the scene's geometries. delta: from the scene before, None where none is
    known.
    """

    scene: Scene
    notes: tuple[str, ...] = ()
    stats: dict[str, float] = field(default_factory=dict)
    region: tuple[int, int, int, int] | None = None
    displaced: Mapping[int, Displaced] = field(default_factory=dict)
    delta: SceneDelta | None = None


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without Python's search for circles of garbage: an export makes ten values for each object
    and throws none away, and the searches take a quarter of the time of many objects.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@_uncollected()
def export_scene(
    depsgraph: Any,
    *,
    width: int | None = None,
    height: int | None = None,
    passes: frozenset[str] = frozenset(),
    decoded: Decoded | None = None,
    aovs: tuple[Aov, ...] = (),
    has_light_groups: bool = False,
    looker: Looker | None = None,
    keeps_collapsed: bool = False,
) -> Export:
    """The scene that an evaluated depsgraph shows, for its own view layer and frame.

    width, height: pixels of the full frame instead of the scene's. passes: names from
    `film.PASSES`; "UV" makes all meshes bring their active map. decoded: images of the export
    before; this one's take their place. aovs: passes of the view layer's own that are required.
    has_light_groups: whether those of its light groups are.
    looker: where to look from, None for the scene's camera. keeps_collapsed: with placements that
    leave no surface, which `render.motion.with_motion` sorts out.
    Only on Blender's thread. Raises ExportError where there is no usable camera or border.
    """
    start = time.perf_counter()
    scene, report = depsgraph.scene_eval, Report()
    region, through, camera = seen_through(depsgraph, looker, report, width, height)
    groups = LightGroups.of(depsgraph.view_layer, report) if has_light_groups else LightGroups()
    required = RequiredAttributes(frozenset({""}) if "UV" in passes else frozenset())
    cache = ExportCache()
    cache.images.frame = scene.frame_current
    culling = Culling.of(scene, camera)
    collector, things = _walked(depsgraph, culling, required, report, cache, groups, decoded, aovs)
    report.add(collector.materials.report)
    met = time.perf_counter()
    world = world_of(depsgraph, scene)
    images = Images(report, decoded, cache.images)
    sky = export_world(world, scene.render.film_transparent, images, report)
    sky = with_light_group(with_pass_settings(sky, scene.world, report), groups.number(world))
    note_scene(scene, report)
    note_missing(depsgraph, report)
    note_world(world, aovs, report)
    exported = collector.scene(camera, things, sky, keeps_collapsed=keeps_collapsed)
    note_placed(exported, through.name, report)
    if decoded is not None:
        decoded.forget_unused()
    end = time.perf_counter()
    stats = {
        "objects": met - start,
        "finish": end - met,
        "export": end - start,
        **counts(exported),
    }
    return Export(exported, report.notes(), stats, region, collector.displaced)


def seen_through(
    depsgraph: Any,
    looker: Looker | None,
    report: Report,
    width: int | None = None,
    height: int | None = None,
) -> tuple[Region | None, Any, Camera]:
    """The region of the frame that is drawn; and its camera, Blender's object and as exported."""
    render = depsgraph.scene_eval.render
    size = resolution(render, width, height)
    scene_camera = depsgraph.scene_eval.camera
    through = evaluated(scene_camera, depsgraph) if looker is None else looker.camera
    camera = export_camera(through, render, size, report, looker)
    return border(render, size), through, camera


def _walked(
    depsgraph: Any,
    culling: Culling | None,
    required: RequiredAttributes,
    report: Report,
    cache: ExportCache,
    *given: Any,
) -> tuple[Collector, Any]:
    """What is met, with what materials read of it; and the things. Twice where rays of materials
    read what they meet, which is known only afterwards.
    """
    collector = Collector(depsgraph, required, report, cache, *given)
    hair = collector.meet_hair
    things = walk(depsgraph, collector.meet, report, make_hair=hair, culling=culling)
    everywhere = required | collector.materials.sampled
    if everywhere == required:
        return collector, things
    cache.shapes.keep((), collector.met)
    return _walked(depsgraph, culling, everywhere, report, cache, *given)


def seen_by(
    scene: Scene, looker: Looker, depsgraph: Any, width: int, height: int
) -> tuple[Scene, tuple[str, ...]]:
    """The scene with the camera of another view, and notes of it. Raises ExportError as
    `export_scene`.
    """
    render, report = depsgraph.scene_eval.render, Report()
    size = resolution(render, width, height)
    camera = export_camera(looker.camera, render, size, report, looker)
    return replace(scene, camera=camera), report.notes()


def world_of(depsgraph: Any, scene: Any) -> Any:
    """The world that surrounds this view layer; None where the layer leaves the sky out."""
    if not depsgraph.view_layer.use_sky:
        return None
    override = getattr(depsgraph.view_layer, "world_override", None)
    return evaluated(override, depsgraph) if override is not None else scene.world


def counts(scene: Scene) -> dict[str, float]:
    """How much there is, and the bytes of its arrays."""
    per_geometry = [len(getattr(g, "triangles", ())) for g in scene.geometries]
    arrays = [a for g in scene.geometries for a in _arrays(g)]
    textures = [*scene.textures, *scene.world.textures]
    textures += [texture for light in scene.lights for texture in light.textures]
    arrays += [i.world_from_object for i in scene.instances] + [t.pixels for t in textures]
    arrays += [light.radiance for light in scene.lights if light.radiance is not None]
    return {
        "meshes": len(scene.geometries),
        "instances": sum(len(i.world_from_object) for i in scene.instances),
        "triangles": sum(per_geometry),
        "segments": sum(len(g.starts) for g in scene.geometries if isinstance(g, Strands)),
        "placed_triangles": sum(
            len(i.world_from_object) * per_geometry[i.geometry] for i in scene.instances
        ),
        "lights": len(scene.lights),
        "materials": len(scene.materials),
        "textures": len({id(texture.pixels) for texture in textures}),
        "bytes": sum({id(a): a.nbytes for a in arrays}.values()),
    }


def _arrays(geometry: Geometry) -> list[np.ndarray]:
    values = list(vars(geometry).values())
    values += [
        a.values
        for a in (
            *getattr(geometry, "attributes", ()),
            *filter(None, [getattr(geometry, "normals", None)]),
        )
    ]
    return [value for value in values if isinstance(value, np.ndarray)]
