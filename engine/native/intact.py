"""Whether the core's library is as it was installed: loading one that is cut off ends the process
with a bus error.
"""

from __future__ import annotations

import base64
import csv
import functools
import hashlib
from pathlib import Path


@functools.cache
def damage(path: Path) -> str:
    """What is wrong with a library, by the hash and size that its wheel's RECORD names (PEP 376);
    "" where nothing is or no RECORD stands beside its package. Raises OSError where it cannot be
    read.
    """
    recorded = _recorded(path)
    if recorded is None:
        return ""
    data, (algorithm, expected), size = path.read_bytes(), recorded[0].split("=", 1), recorded[1]
    if len(data) != int(size):
        return f"{path} has {len(data)} bytes in place of {size}"
    found = base64.urlsafe_b64encode(hashlib.new(algorithm, data).digest()).rstrip(b"=").decode()
    return "" if found == expected else f"{path} holds other bytes than were installed"


def _recorded(path: Path) -> tuple[str, str] | None:
    """Hash and size of an installed file, as RECORD writes them."""
    top, name = path.parent.parent, f"{path.parent.name}/{path.name}"
    for record in top.glob(f"{path.parent.name}-*.dist-info/RECORD"):
        with record.open(encoding="utf-8", newline="") as rows:
            for row in csv.reader(rows):
                if len(row) == 3 and row[0] == name and "=" in row[1]:
                    return row[1], row[2]
    return None
