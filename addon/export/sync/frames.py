"""The export of one frame after the other, where Blender keeps its data between them."""

from __future__ import annotations

import time
from typing import Any

from ..export import Export, counts, seen_through
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
    looker: Looker | None = None,
) -> Export:
    """As `export_scene` without AOVs, of a depsgraph whose updates are all that changed since the
    last call with the same `live`; only that is read. Its stats tell how much was read anew.
    """
    start = time.perf_counter()
    report = Report()
    region, through, camera = seen_through(depsgraph, looker, report, width, height)
    found = live.update(depsgraph, camera, passes=passes)
    note_placed(found, through.name, report)
    notes = dict.fromkeys((*report.notes(), *live.notes(passes)))
    seconds = time.perf_counter() - start
    read = {f"anew: {name}": float(count) for name, count in live.work.items()}
    stats = {"objects": seconds, "finish": 0.0, "export": seconds, **counts(found), **read}
    return Export(found, tuple(notes), stats, region, delta=live.delta(passes))
