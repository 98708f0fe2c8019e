"""A scene without a fault, for tests that spoil it."""

from __future__ import annotations

from glint.engine import scene as s
from native_tools import (
    lamp,
    material,
    placed,
    square,
    view_from_above,
)

SOUND = s.Scene(
    view_from_above(), (square(),), (placed(),), (material(s.Lobe("DIFFUSE")),), (), (lamp("SUN"),)
)
MESH = SOUND.geometries[0]
