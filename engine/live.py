"""Pictures for a viewport: asked for at any time, traced behind the caller's back, looked at when
convenient.

A `LiveRender` has one thread, which alone talks to a tracer; the core's own threads do the work, so
the thread sleeps. No method waits but `wait`.
"""

from __future__ import annotations

import atexit
import logging
import os
import sys
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .backends import render
from .errors import SceneError
from .film import Film
from .futures import NO_THREAD, Thread
from .native.live import NativeLive
from .scene import Scene, SceneDelta
from .settings import Settings

log = logging.getLogger(__name__)

_LONGEST_FAREWELL = 5.0
"""Seconds that a closing program waits for a thread that is inside the core."""
_NICENESS = 5


@dataclass(frozen=True, eq=False)
class Task:
    """One picture to make.

    tag: whatever tells the caller which picture this is.
    keep_first_wave: newer tasks wait until this one's first wave is complete, so that pictures come
    also while tasks come faster. exact: the picture has the bits that `engine.render` gives. Else
    trees that stand relative to an earlier eye may be used, which differ in the last bits and need
    not be made anew. delta: from a scene before to this one; what was drawn last is compared with
    this scene where it is not from there.
    """

    scene: Scene
    settings: Settings
    tag: object = None
    keep_first_wave: bool = False
    exact: bool = True
    delta: SceneDelta | None = None


@dataclass(frozen=True, eq=False)
class Wave:
    """A complete picture of a task.

    number: counts the waves of one LiveRender, from 1.  final: no better one of this task will
    come. seconds: since the task began.  build_seconds: of them, for trees.  at: when it was
    complete, as time.perf_counter counts.
    """

    task: Task
    film: Film
    number: int
    final: bool
    seconds: float
    build_seconds: float
    at: float


class LiveRender:
    """Makes pictures one after the other in the background."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._waiting: list[Task] = []
        self._running: Task | None = None
        self._shown: Task | None = None  # the running task, once its first wave is complete
        self._is_outdated = False  # others were asked for after the running task
        self._closed = False
        self._newest: Wave | None = None
        self._number = 0
        self._error: Exception | None = None
        self._thread: Thread | None = None
        weakref.finalize(self, _wake, self._changed)

    def start(self, tasks: Sequence[Task]) -> None:
        """Make these pictures in this order instead of all that was asked for before."""
        with self._changed:
            self._waiting = list(tasks)
            self._is_outdated = True
            self._error = None
            self._wake_thread()

    def go_on(self, tasks: Sequence[Task]) -> None:
        """Make these pictures after all that was asked for before."""
        with self._changed:
            self._waiting += tasks
            self._wake_thread()

    def _wake_thread(self) -> None:
        self._changed.notify_all()
        if self._closed or (self._thread is not None and not self._thread.is_lost):
            return
        reference, changed = weakref.ref(self), self._changed
        try:
            self._thread = Thread(lambda: _serve(reference, changed))
        except RuntimeError as error:
            self._thread, self._waiting, self._error = None, [], error
            return
        _threads.add(self._thread)
        _renders.add(self)

    @property
    def newest(self) -> Wave | None:
        """The last complete picture, of whichever task."""
        return self._newest

    def wait(self, is_wanted: Callable[[Wave], bool], seconds: float) -> bool:
        """Whether the newest picture is wanted: at once if it is or none will come, else as soon as
        one is or the seconds are over.
        """

        def is_there() -> bool:
            return self._newest is not None and is_wanted(self._newest)

        with self._changed:
            self._changed.wait_for(lambda: is_there() or not self.busy, seconds)
            return is_there()

    @property
    def busy(self) -> bool:
        """Whether pictures may still come."""
        if self._running is not None:
            return True
        return bool(self._waiting) and not self._is_lost

    @property
    def _is_lost(self) -> bool:
        """Whether nobody will ever do what waits."""
        return self._thread is not None and self._thread.is_lost

    @property
    def error(self) -> Exception | None:
        """What went wrong since the last `start`: SceneError, MemoryError, RuntimeError where the
        system starts no thread, or a fault of a tracer.
        """
        if self._error is None and self._is_lost:
            return RuntimeError(NO_THREAD)
        return self._error

    def close(self) -> None:
        """Stop soon and give the memory back. The last picture stays."""
        with self._changed:
            self._closed = True
            self._waiting = []
            self._changed.notify_all()

    # --- on the thread
    # ----------------------------------------------------------------------------------------------

    def _should_stop(self) -> bool:
        """Whether the running task is to make room."""
        if self._closed:
            return True
        running = self._running
        return self._is_outdated and self._is_replaceable(running)

    def _is_replaceable(self, task: Task | None) -> bool:
        return task is None or not task.keep_first_wave or self._shown is task

    def _take(self) -> Task | None:
        with self._changed:
            self._running = self._shown = None
            if self._waiting and not self._closed:
                # in this order: `busy` is read without the lock
                self._running, self._is_outdated = self._waiting[0], False
                del self._waiting[0]
            return self._running

    def _publish(self, task: Task, film: Film, final: bool, start: float) -> None:
        with self._changed:
            self._number += 1
            self._shown = task
            now = time.perf_counter()
            self._newest = Wave(
                task, film, self._number, final, now - start, film.stats.get("build", 0.0), now
            )
            # after the picture: who finds this no longer busy, without the lock, looks for it
            self._running = None if final else task
            self._changed.notify_all()

    def _end(self) -> None:
        with self._changed:
            self._running = None
            self._changed.notify_all()

    def _fail(self, error: Exception) -> None:
        if not isinstance(error, SceneError):
            log.error("a viewport picture failed", exc_info=error)
        with self._changed:
            self._error = error


def _serve(reference: weakref.ref[LiveRender], changed: threading.Condition) -> None:
    """The thread: holds its LiveRender only while there is work, so that one nobody wants any more
    ends by itself.
    """
    tracer = _Tracers()
    _step_back()
    try:
        while True:
            live = reference()
            if live is None or live._closed:
                return
            task = live._take()
            if task is not None:
                _trace(live, tracer, task)
            del live, task
            with changed:
                changed.wait_for(lambda: _has_work(reference))
    finally:
        tracer.close()


def _step_back() -> None:
    """Let the interface go first: Linux gives threads a priority of their own, which those that
    they start inherit.
    """
    if sys.platform == "linux":
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)


def _has_work(reference: weakref.ref[LiveRender]) -> bool:
    live = reference()
    return live is None or live._closed or bool(live._waiting)


def _trace(live: LiveRender, tracer: _Tracers, task: Task) -> None:
    start = time.perf_counter()
    try:
        tracer.render(
            task, live._should_stop, lambda film, final: live._publish(task, film, final, start)
        )
    except Exception as error:  # noqa: BLE001 (the thread must live; the caller sees `error`)
        live._fail(error)
    finally:
        live._end()


def _wake(changed: threading.Condition) -> None:
    with changed:
        changed.notify_all()


class _Tracers:
    """The tracer of each task, and what is kept from one task to the next."""

    def __init__(self) -> None:
        self._native: NativeLive | None = None

    def render(
        self, task: Task, should_stop: Callable[[], bool], on_film: Callable[[Film, bool], None]
    ) -> None:
        if task.settings.backend == "NATIVE":
            self._native = self._native or NativeLive()
            self._native.render(
                task.scene, task.settings, task.exact, should_stop, on_film, task.delta
            )
            return
        self.close()
        _render_reference(task, should_stop, on_film)

    def close(self) -> None:
        native, self._native = self._native, None
        if native is not None:
            native.close()


def _render_reference(
    task: Task, should_stop: Callable[[], bool], on_film: Callable[[Film, bool], None]
) -> None:
    film = render(
        task.scene,
        task.settings,
        should_stop=should_stop,
        on_wave=lambda film: on_film(film, False),
    )
    if film.complete:
        on_film(film, True)


_threads: weakref.WeakSet[Thread] = weakref.WeakSet()
_renders: weakref.WeakSet[LiveRender] = weakref.WeakSet()


@atexit.register
def _farewell() -> None:
    """No thread may be inside the core when Python and the core's library go."""
    for live in list(_renders):
        live.close()
    for thread in list(_threads):
        thread.join(_LONGEST_FAREWELL)
