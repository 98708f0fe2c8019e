"""Decoded images from one render to the next: the frames of an animation show most of them again, and decoding them takes longer than all
else that is read of a small scene."""

from __future__ import annotations

import hashlib
from pathlib import Path

from . import pixels
from .pixels import ImageError, Raw, Source


class Decoded:
    """What the images of the last export were decoded to, by what they were decoded from. Any thread may ask."""

    def __init__(self) -> None:
        self._kept: dict[tuple, Raw] = {}
        self._used: dict[tuple, Raw] = {}

    def decode(self, origin: Source) -> Raw | ImageError:
        """As `pixels.decode`, which is asked only for what is new. The values cannot be written to."""
        key = _content(origin)
        raw = self._used.get(key) or self._kept.get(key) or pixels.decode(origin)
        if isinstance(raw, Raw) and key is not None:
            raw.rgba.setflags(write=False)
            self._used[key] = raw
        return raw

    def forget_unused(self) -> None:
        """To be called after an export: what it did not ask for goes."""
        self._kept, self._used = self._used, {}


def _content(origin: Source) -> tuple | None:
    """Equal for sources of the same values: by the packed bytes, or by when the file was written. None where there is no such file."""
    if origin.packed is not None:
        return (hashlib.blake2b(origin.packed).digest(), Path(origin.path).suffix, origin.alpha_mode)
    try:
        state = Path(origin.path).stat()
    except OSError:
        return None
    return (origin.path, state.st_mtime_ns, state.st_size, origin.alpha_mode)
