"""Blender's evaluated depsgraph to `engine.Scene`. `export_scene` is the one way in; nothing of
Blender outlives the call.
"""

from __future__ import annotations

from .camera import ExportError
from .export import Export, export_scene, seen_by
from .images.decoded import Decoded
from .materials.aovs import aovs_of
from .panorama import Looker

__all__ = ["Decoded", "Export", "ExportError", "Looker", "aovs_of", "export_scene", "seen_by"]
