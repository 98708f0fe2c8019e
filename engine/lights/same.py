"""Keys of what is found once for the same values."""

from __future__ import annotations

from typing import Generic, TypeVar

T = TypeVar("T")


class Same(Generic[T]):
    """A value as a key of `functools.lru_cache`: equal where the things that count, which it keeps
    alive, are the same objects.
    """

    def __init__(self, value: T, *things: object) -> None:
        self.value, self._things = value, things

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and (
            len(self._things) == len(other._things)
            and all(a is b for a, b in zip(self._things, other._things, strict=True))
        )

    def __hash__(self) -> int:
        return hash(tuple(map(id, self._things)))
