"""Work on other threads, whose results come whatever the system refuses.

`threading.Thread.start` and the standard library's executors wait for ever for a thread that dies
before its first line, as it does where memory runs out. Here what no thread has begun is done by
whoever asks for the result.
"""

from __future__ import annotations

import _thread
import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, Generic, TypeVar

T = TypeVar("T")

NO_THREAD = (
    "the system starts no further thread: close programs, or let a user have more of them (ulimit "
    "-u)"
)
_LONGEST_START = 20.0
"""Seconds after which a thread that has not begun never will."""


class Thread:
    """A thread that ends with the program. Raises RuntimeError where the system starts none; one
    that dies before its first line counts as ended after a while.
    """

    def __init__(self, work: Callable[[], None]) -> None:
        self._work = work
        self._has_begun, self._since = False, time.monotonic()
        self._working = _thread.allocate_lock()
        self._working.acquire()
        try:
            _thread.start_new_thread(self._run, ())
        except (RuntimeError, MemoryError) as error:
            raise RuntimeError(NO_THREAD) from error

    def _run(self) -> None:
        self._has_begun = True
        try:
            self._work()
        finally:
            self._working.release()

    @property
    def is_lost(self) -> bool:
        """Whether it died before its first line."""
        return not self._has_begun and time.monotonic() - self._since > _LONGEST_START

    def is_alive(self) -> bool:
        return self._working.locked() and not self.is_lost

    def join(self, seconds: float) -> None:
        """Wait for its end, so long at most."""
        if self.is_alive() and self._working.acquire(timeout=seconds):
            self._working.release()


class Future(Generic[T]):
    """The result of a function that is called once, by a thread or by `result`."""

    def __init__(self, work: Callable[[], T]) -> None:
        self._work = work
        self._value: Any = None
        self._error: BaseException | None = None
        # locks, as releasing one takes no memory
        self._begun, self._working = _thread.allocate_lock(), _thread.allocate_lock()
        self._working.acquire()

    def run(self) -> None:
        """Call the function, unless that was begun or called off before."""
        if not self._begun.acquire(blocking=False):
            return
        try:
            self._value = self._work()
        except BaseException as error:  # noqa: BLE001 (`result` raises it)
            self._error = error
        finally:
            self._working.release()

    def close(self) -> None:
        """Call it off, or wait for its end where it was begun."""
        if self._begun.acquire(blocking=False):
            self._working.release()
        with self._working:
            pass

    def result(self) -> T:
        """What the function gives. Raises what it raises."""
        self.run()
        with self._working:
            pass
        if self._error is not None:
            raise self._error
        return self._value


def started(work: Callable[[], T]) -> Future[T]:
    """A future on a thread of its own, where the system starts one."""
    future = Future(work)
    _start(future.run)
    return future


def parallel_map(work: Callable[[Any], T], values: Sequence[Any]) -> list[T]:
    """The function of each value, in their order, on as many threads as there are processors."""
    futures = [Future(partial(work, value)) for value in values]
    for _ in range(min(len(futures), os.cpu_count() or 1) - 1):
        _start(partial(_run_all, futures))
    try:
        return [future.result() for future in futures]
    finally:
        for future in futures:
            future.close()


def _run_all(futures: Sequence[Future]) -> None:
    for future in futures:
        future.run()


def _start(function: Callable[[], None]) -> None:
    with suppress(RuntimeError, MemoryError):
        _thread.start_new_thread(function, ())
