"""Walks the depsgraph's object instances: which geometry stands where, and as what it is seen.

`object_instances.foreach_get` hands out all matrices at once in the order of the iteration, so the
Python loop only has to tell things apart: 100 000 instances of any kind take about 0.15 s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ...engine.scene import EVERYTHING
from .culling import Culled, Culling
from .geometry.hashing import as_random, random_of, word_of
from .light_links import LightLinks, rendered_objects
from .report import Report
from .unsupported import note_object

_OFFSETS = (0.1, 0.0)
_SAME = 1e-6


class Flags(NamedTuple):
    """What an object's settings say of its visibility, with its instancer's. light_set: which
    lights reach it.  receivers: the sets that it lights.  blockers: those that shade it.
    catcher: of shadows.  media: to rays that media scatter.  offsets: its Shadow Terminator's,
    geometry and shading.
    """

    camera: bool
    mirror: bool
    shadow: bool
    holdout: bool
    light_set: int = 0
    receivers: int = EVERYTHING
    blockers: int = EVERYTHING
    catcher: bool = False
    transmission: bool = True
    diffuse: bool = True
    media: bool = True
    offsets: tuple[float, float] = _OFFSETS


@dataclass(eq=False)
class ExportedObject:
    """One object as one instancer places it: what `make` of `walk` gave for it, and where it
    stands. uid, instancer: session uids of the object and of what instances it, else of itself.
    numbers: of its instances in the iteration.
    """

    content: Any
    name: str
    uid: int
    instancer: int
    matrices: np.ndarray
    numbers: np.ndarray


@dataclass
class VisitedObjects:
    """Session uids of the objects that a walk met: those that render, shown or not, and those that
    instance or are instanced.
    """

    rendering: set[int] = field(default_factory=set)
    instancing: set[int] = field(default_factory=set)

    def note(self, instance: Any) -> None:
        self.rendering.add(instance.object.original.session_uid)
        for thing in (instance.parent, instance.instance_object) if instance.is_instance else ():
            if thing is not None:
                self.instancing.add(thing.original.session_uid)


def walk(
    depsgraph: Any,
    make: Callable[[Any, Flags], Any],
    report: Report,
    shown: Callable[[Any], bool] = lambda instancer: True,
    visited: VisitedObjects | None = None,
    make_hair: Callable[[Any, Flags], Any] | None = None,
    culling: Culling | None = None,
    has_flags: bool = True,
) -> list[ExportedObject]:
    """Every distinct (data, object, instancer) that renders, with its places.

    make: given the first instance of each and its flags, while Blender keeps them valid; None
    leaves the thing out.  make_hair: the same of its particle hair.  shown: asked of every object
    that stands or instances in the scene itself whether its things are there. visited: takes in
    every thing, also those that are left out.  culling: what Simplify leaves out.  has_flags: False
    gives None for all flags, which take long where there are many objects.
    """
    links = LightLinks(rendered_objects(depsgraph), report) if has_flags else None
    cut = collections_cut(depsgraph.view_layer.layer_collection)
    things: list[tuple[Any, str, int, int] | None] = []
    numbers: dict[tuple, int] = {}
    rows: list[int] = []
    hair: dict[int, int] = {}  # the number of a thing's hair by its own
    hairy: list[tuple[int, int]] = []  # places in the iteration, and the hair there
    left_out = Culled(culling)
    for instance in depsgraph.object_instances:
        thing = instance.object
        key = (thing.data, instance.instance_object or thing, instance.parent)
        number = numbers.get(key)
        if number is None:
            number = numbers[key] = len(things)
            if visited is not None:
                visited.note(instance)
            instancer = instance.parent if instance.is_instance else thing
            is_there = shown(instancer) and not left_out.meet(number, instance)
            things.append(
                _meet(instance, thing, depsgraph, make, report, links, cut) if is_there else None
            )
            if make_hair is not None and is_there and has_hair(instance):
                hair[number] = left_out.as_well(number, len(things))
                things.append(
                    _meet(instance, thing, depsgraph, make_hair, report, links, cut, visible=True)
                )
        if hair and number in hair:
            hairy.append((len(rows), hair[number]))
        rows.append(number)
    matrices, at = _matrices(depsgraph, len(rows)), np.arange(len(rows))
    if hairy:
        places, found = np.array(hairy, np.int64).T
        matrices, at = np.concatenate([matrices, matrices[places]]), np.append(at, places)
        rows += found.tolist()
    all_rows = np.array(rows, np.int64)
    kept = left_out.kept(all_rows, matrices)
    return _placed(things, all_rows[kept], matrices[kept], at[kept], report)


def has_hair(instance: Any) -> bool:
    """Whether particle systems of an instance's object render as hair."""
    return instance.show_particles and any(
        system.settings.type == "HAIR" and system.settings.render_type == "PATH"
        for system in instance.object.particle_systems
    )


def _matrices(depsgraph: Any, count: int) -> np.ndarray:
    """(count, 3, 4) float64: matrix_world of every instance."""
    columns = np.empty((count, 4, 4), np.float32)
    if count:
        depsgraph.object_instances.foreach_get("matrix_world", columns.reshape(-1))
    return columns.transpose(0, 2, 1)[:, :3].astype(np.float64)


def random_numbers(depsgraph: Any) -> np.ndarray:
    """(count,) float32 from 0 to 1 of every instance, as Cycles makes them; 0 of what is none."""
    ids = np.empty(len(depsgraph.object_instances), np.int32)
    if len(ids):
        depsgraph.object_instances.foreach_get("random_id", ids)
    return as_random(ids.view(np.uint32))


def places_on_instancers(depsgraph: Any) -> tuple[np.ndarray, np.ndarray]:
    """(count, 3) float32 each of every instance, where it is on what carries it: generated and UV
    coordinates as Cycles has them.
    """
    count = len(depsgraph.object_instances)
    generated, uv = np.zeros((count, 3), np.float32), np.zeros((count, 2), np.float32)
    if count:
        depsgraph.object_instances.foreach_get("orco", generated.reshape(-1))
        depsgraph.object_instances.foreach_get("uv", uv.reshape(-1))
    return 0.5 * generated - 0.5, np.pad(uv, ((0, 0), (0, 1)))


def random_number(name: str) -> float:
    """The same of an object that stands by itself."""
    return float(random_of(word_of(name), np.zeros(1, np.uint32))[0])


def _placed(
    things: list, rows: np.ndarray, matrices: np.ndarray, at: np.ndarray, report: Report
) -> list[ExportedObject]:
    """Things with their rows of the matrices, in the order in which they were met; places that are
    not finite are dropped. at: where in the iteration each row is.
    """
    sound = np.isfinite(matrices).all((1, 2))
    for number in dict.fromkeys(rows[~sound].tolist()):
        if things[number] is not None:
            report.note(
                "Objects whose transform is not finite are left out: {}; clear their transforms",
                things[number][1],
            )
    rows, matrices = rows[sound], matrices[sound]
    order = np.argsort(rows, kind="stable")
    matrices, numbers = matrices[order], at[sound][order]
    bounds = np.searchsorted(rows[order], np.arange(len(things) + 1)).tolist()
    spans = zip(things, bounds, bounds[1:], strict=False)
    return [
        ExportedObject(*met, matrices[first:end], numbers[first:end])
        for met, first, end in spans
        if met is not None and first < end
    ]


def _meet(
    instance: Any,
    thing: Any,
    depsgraph: Any,
    make: Callable,
    report: Report,
    links: LightLinks | None,
    cut: bool,
    visible: bool = False,
) -> tuple[Any, str, int, int] | None:
    """What a new thing is, or None where nothing of it is rendered. links: None for no flags.  cut:
    as of `flags_of`. visible: whether or not it shows itself.
    """
    instancer = instance.parent if instance.is_instance else thing
    name = thing.name
    if not (visible or instance.show_self) or thing.data is None:
        return None
    layer = depsgraph.view_layer
    flags = flags_of(thing, instancer, layer, report, links, cut) if links is not None else None
    content = make(instance, flags)
    uids = thing.original.session_uid, instancer.original.session_uid
    return (content, name, *uids) if content is not None else None


def _note_light_settings(thing: Any, owner: Any, report: Report) -> None:
    """Settings of who is lit by what, and by which rays, that have no counterpart here. owner: the
    thing or its instancer.
    """
    if thing.type != "LIGHT":
        note_object(thing.name, owner, report)


def offsets_of(thing: Any) -> tuple[float, float]:
    """Its Shadow Terminator's offsets, geometry and shading. Blender 4.2 has them in Cycles'
    settings, which an evaluated copy has late.
    """
    if thing.type == "LIGHT":
        return _OFFSETS
    if hasattr(thing, "shadow_terminator_shading_offset"):
        shading = thing.shadow_terminator_shading_offset
        geometry = thing.shadow_terminator_geometry_offset
    else:
        own = getattr(thing.original, "cycles", None)
        shading = getattr(own, "shadow_terminator_offset", _OFFSETS[1])
        geometry = getattr(own, "shadow_terminator_geometry_offset", _OFFSETS[0])
    is_default = abs(geometry - _OFFSETS[0]) < _SAME  # Blender holds it as float32
    return _OFFSETS[0] if is_default else geometry, shading


def collections_cut(layer_collection: Any) -> bool:
    """Whether one in the tree of collections makes its objects holdouts or indirect only. To ask
    each object takes long where there are many.
    """
    return (
        layer_collection.holdout
        or layer_collection.indirect_only
        or any(map(collections_cut, layer_collection.children))
    )


def flags_of(
    thing: Any,
    instancer: Any,
    view_layer: Any,
    report: Report,
    links: LightLinks | None = None,
    cut: bool = True,
) -> Flags:
    """Visible to a kind of ray only if thing and instancer both are; holdout by the instancer, as
    in Cycles. Without links all lights reach all things. cut: `collections_cut` of the view
    layer.
    """
    owner = instancer.original
    holdout, indirect_only = owner.is_holdout, False
    if cut:
        holdout = owner.holdout_get(view_layer=view_layer)
        indirect_only = not holdout and owner.indirect_only_get(view_layer=view_layer)
    if indirect_only:
        report.note(
            "Indirect only hides {} from the camera; light is not carried on from there", thing.name
        )
    _note_light_settings(thing, thing, report)
    camera, mirror, shadow = thing.visible_camera, thing.visible_glossy, thing.visible_shadow
    catcher, transmission = thing.is_shadow_catcher, thing.visible_transmission
    diffuse, media = thing.visible_diffuse, thing.visible_volume_scatter
    if instancer is not thing:
        _note_light_settings(thing, instancer, report)
        camera, mirror = camera and instancer.visible_camera, mirror and instancer.visible_glossy
        shadow = shadow and instancer.visible_shadow
        catcher = catcher or instancer.is_shadow_catcher
        transmission = transmission and instancer.visible_transmission
        diffuse = diffuse and instancer.visible_diffuse
        media = media and instancer.visible_volume_scatter
    camera = camera and not indirect_only
    others = catcher, transmission, diffuse, media, offsets_of(thing)
    if links is None:
        return Flags(camera, mirror, shadow, holdout, 0, EVERYTHING, EVERYTHING, *others)
    lit, shaded = links.lit_by(owner), links.shaded_by(owner)
    linked = links.set_of(owner), lit, shaded
    return Flags(camera, mirror, shadow, holdout, *linked, *others)
