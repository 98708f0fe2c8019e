"""Ctrl-C during a render.

Python raises KeyboardInterrupt wherever it happens to be, in a clean-up as well, and Blender takes
an exception out of `render()` for a finished black picture.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_held() -> Iterator[Callable[[], bool]]:
    """Within, Ctrl-C raises nothing; the function that is given tells whether it was pressed. Where
    Python does not hear of Ctrl-C (off the main thread, or in a Blender program, which has its own
    handler) nothing is changed.
    """
    pressed = threading.Event()
    before = signal.getsignal(signal.SIGINT)
    if not callable(before) or threading.current_thread() is not threading.main_thread():
        yield pressed.is_set
        return
    signal.signal(signal.SIGINT, lambda *_: pressed.set())
    try:
        yield pressed.is_set
    finally:
        signal.signal(signal.SIGINT, before)
