"""Rendered shading in the 3D view: `Session` follows one region of one window."""

from __future__ import annotations

from .picking import Picked, pixel_at
from .session import Session
from .timer import register, unregister

__all__ = ["Picked", "Session", "pixel_at", "register", "unregister"]
