"""Blender's evaluated depsgraph to `engine.Scene`. `export_scene` is the one door; nothing of
Blender outlives the call.
"""

from __future__ import annotations

from .camera import ExportError
from .export import Export, export_scene
from .images.decoded import Decoded
from .materials.aovs import aovs_of

__all__ = ["Decoded", "Export", "ExportError", "aovs_of", "export_scene"]
