"""Decoded images, and what is worked out of their texels, from one render to the next: the
frames of an animation show most of them again, and both take longer than all else that is read of a
small scene.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ....engine.analysis.fingerprint import value_fingerprint
from . import pixels
from .pixels import ImageError, Raw, Source

T = TypeVar("T")


class Decoded:
    """What the images of the last export were decoded to, by what they were decoded from, and what
    came of them. Any thread may ask.
    """

    def __init__(self) -> None:
        self._kept: dict[tuple, Any] = {}
        self._used: dict[tuple, Any] = {}

    def decode(self, origin: Source) -> Raw | ImageError | MemoryError:
        """As `pixels.decode`, which is asked only for what is new. The values cannot be
        written to.
        """
        key = _content(origin)
        raw = self._used.get(key) or self._kept.get(key) or pixels.decode(origin)
        if isinstance(raw, Raw) and key is not None:
            raw.rgba.setflags(write=False)
            self._used[key] = raw
        return raw

    def memoized(self, values: np.ndarray, key: Hashable, work: Callable[[], T]) -> T:
        """work(), or what it gave for this very array and key since the export before. Neither
        array is written to any more.

        key: says all that `work` depends on beside the array.
        """
        known = (id(values), key)
        # the array, so that no other gets its id
        found = self._used.get(known) or self._kept.get(known) or (values, work())
        self._used[known] = found
        return found[1]

    def made(self, recipe: Hashable, work: Callable[[], T]) -> T:
        """work(), or what it gave at the export before for this recipe, which says all that it
        depends on. Nothing of it is written to.
        """
        found = self._used.get(recipe) or self._kept.get(recipe) or work()
        self._used[recipe] = found
        return found

    def forget_unused(self) -> None:
        """To be called after an export: what it did not ask for goes."""
        self._kept, self._used = self._used, {}


def _content(origin: Source) -> tuple | None:
    """Equal for sources of the same values: by the packed bytes, or by when the file was written.
    None where there is no such file.
    """
    if origin.packed is not None:
        return (
            value_fingerprint(np.frombuffer(origin.packed, np.uint8)),
            Path(origin.path).suffix,
            origin.alpha_mode,
        )
    try:
        state = Path(origin.path).stat()
    except OSError:
        return None
    return (origin.path, state.st_mtime_ns, state.st_size, origin.alpha_mode)
