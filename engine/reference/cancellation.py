"""Asking, between pieces of work, whether to stop."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

_INTERVAL = 0.02  # seconds between two questions; the promise is 50 ms


class Stopped(Exception):  # noqa: N818, it is no error
    """The user ended the render."""


class Cancellation:
    """Asks `should_stop` now and then. Callers check between blocks of work of at most some 20
    ms.
    """

    def __init__(self, should_stop: Callable[[], bool]):
        self._should_stop = should_stop
        self._asked = perf_counter()

    def check(self) -> None:
        """Raises Stopped when the user wants to stop."""
        now = perf_counter()
        if now - self._asked < _INTERVAL:
            return
        if self._should_stop():
            raise Stopped
        self._asked = perf_counter()
