"""Rendered shading in the 3D view: `Session` follows one region of one window."""

from __future__ import annotations

from .session import Session
from .timer import register, unregister

__all__ = ["Session", "register", "unregister"]
