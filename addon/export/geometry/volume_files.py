"""Whether an OpenVDB file is whole, before the OpenVDB library reads it.

The library takes lengths of texts from where a file has ended as whatever memory holds, and asks
for gigabytes.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

MAGIC = 0x56444220
FIRST_VERSION = 222
"""Of the layout that is known here, written since OpenVDB 2.1; older files are not checked."""


def check_whole(path: str) -> None:
    """Raises EOFError where the header names more than the file holds, OSError where it cannot be
    read.
    """
    with Path(path).open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        if _number(file, size, 8) != MAGIC or _number(file, size) < FIRST_VERSION:
            return
        _skip(file, size, 8)  # the library's version
        has_offsets = _number(file, size, 1)
        _skip(file, size, 36)  # UUID
        for _ in range(_number(file, size)):  # metadata: name, type, value
            for _ in range(3):
                _skip(file, size, _number(file, size))
        for _ in range(_number(file, size) if has_offsets else 0):
            for _ in range(3):  # name, type, instance's parent
                _skip(file, size, _number(file, size))
            _skip(file, size, 16)  # where the grid and its blocks begin
            end = _number(file, size, 8)
            _skip(file, size, end - file.tell())


def _number(file: BinaryIO, size: int, length: int = 4) -> int:
    _check(length <= size - file.tell())
    return int.from_bytes(file.read(length), "little")


def _skip(file: BinaryIO, size: int, length: int) -> None:
    _check(0 <= length <= size - file.tell())
    file.seek(length, os.SEEK_CUR)


def _check(is_there: bool) -> None:
    if not is_there:
        raise EOFError("the file ends early")
