"""The version of the core's wheel: the extension's, and what the core is made of.

Blender keeps an installed wheel for as long as the next one has the same version, so a core that
changed needs another one. scikit-build-core asks for it (pyproject.toml).
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ("engine/core/CMakeLists.txt", "engine/core/include", "engine/core/src")
DIGITS = 10


def dynamic_metadata(field: str, settings: Mapping[str, Any]) -> str:
    """Such as 0.1.0+3f9a0c12de."""
    del field, settings
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    return f"{manifest['version']}+{_digest()[:DIGITS]}"


def _digest() -> str:
    digest = hashlib.sha256()
    for source in SOURCES:
        top = ROOT / source
        for path in sorted([top] if top.is_file() else top.rglob("*")):
            if path.is_file():
                digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0")
                digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()
