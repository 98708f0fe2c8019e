"""The export of one frame after the other, where Blender keeps its data between them."""

from __future__ import annotations

import time
from typing import Any

import bpy

from ..culling import Culling
from ..export import Export, counts, seen_through, world_of
from ..light_groups import LightGroups
from ..materials.aovs import Aov
from ..panorama import Looker
from ..placing import note_placed
from ..report import Report
from .incremental import LiveExport


def export_frame(
    live: LiveExport,
    depsgraph: Any,
    *,
    width: int,
    height: int,
    passes: frozenset[str] = frozenset(),
    aovs: tuple[Aov, ...] = (),
    looker: Looker | None = None,
    keeps_collapsed: bool = False,
) -> Export:
    """As `export_scene` with light groups, of a depsgraph whose updates are all that changed since
    the last call with the same `live`; only that is read. Its stats tell how much was read anew.
    """
    start = time.perf_counter()
    scene, report = depsgraph.scene_eval, Report()
    region, through, camera = seen_through(depsgraph, looker, report, width, height)
    world, known = world_of(depsgraph, scene), LightGroups.of(depsgraph.view_layer, report)
    groups = known.members(world and world.original, bpy.data.objects if known.names else ())
    asked = {"passes": passes, "groups": groups, "culling": Culling.of(scene, camera)}
    asked |= {"aovs": aovs, "keeps_collapsed": keeps_collapsed}
    live.apply_updates(depsgraph)
    found = live.scene(depsgraph, camera, **asked)
    note_placed(found, through.name, report)
    notes = dict.fromkeys((*report.notes(), *live.notes(**asked)))
    seconds = time.perf_counter() - start
    read = {f"anew: {name}": float(count) for name, count in live.work.items()}
    stats = {"objects": seconds, "finish": 0.0, "export": seconds, **counts(found), **read}
    return Export(found, tuple(notes), stats, region, live.displaced(**asked), live.delta(**asked))
