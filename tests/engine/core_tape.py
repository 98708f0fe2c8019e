"""Calls of the core's C interface on a tape: what this machine's core is asked for while it draws
the reference renders, to be asked again of a core on a machine without Python
(engine/core/tests/player.cpp).

    python tests/engine/core_tape.py TAPE PICTURES [scene ...]

PICTURES gets every picture's values as this machine's core gave them, one after the other, as the
player writes them; a list of (scene, pass, size) beside it says which they are. Fails when these
are not the reference renders.

A tape is a row of uint64: an operation, then what it takes (the enum `Operation`). Structures and
arrays lie in blocks, which are numbered as they come; addresses within them are given by their
place, a block and an offset 0.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import ctypes
import json
import sys
from contextlib import contextmanager
from enum import IntEnum
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import glint_tree  # noqa: F401  (makes the tree importable as `glint`)
import reference_renders as references
from glint.engine.native import binding, core_types, packer
from glint.engine.native.core_types import State

MAGIC = int.from_bytes(b"GLNTTAPE", "little")


class Operation(IntEnum):
    """BLOCK bytes, count, the bytes up to a multiple of 8, count times (offset, block). SCENE slot,
    block. LIKE slot, base slot, block, exact. DROP slot. START slot, block. WAIT, until it ends or
    waits for the next moment. MOVE slot, block. PICTURE pass, size. FINISH. FORGET, all blocks;
    they are numbered from 0 again.
    """

    END = 0
    BLOCK = 1
    SCENE = 2
    LIKE = 3
    DROP = 4
    START = 5
    WAIT = 6
    MOVE = 7
    PICTURE = 8
    FINISH = 9
    FORGET = 10


class Recorder:
    """Stands for the core's library: asks it, and writes down what makes pictures."""

    def __init__(self, core: ctypes.CDLL, tape: BinaryIO, pictures: BinaryIO) -> None:
        self._core, self._tape, self._pictures = core, tape, pictures
        self._arrays: dict[int, np.ndarray] = {}
        self._blocks: dict[int, int] = {}
        self._count = 0
        self._slots: dict[int, int] = {}
        self._next_slot = 0
        self.sizes: list[tuple[int, int]] = []
        self._words(MAGIC, core_types.ABI_VERSION)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._core, name)

    def address(self, array: np.ndarray) -> int:
        """`packer.address`, which remembers what lies there."""
        where = array.__array_interface__["data"][0] if array.size else 0
        if where and self._arrays.get(where) is not array:
            self._arrays[where] = array
            self._blocks.pop(where, None)
        return where

    def forget(self) -> None:
        """Between two pictures: the tape need not keep what came before."""
        self._arrays.clear()
        self._blocks.clear()
        self.sizes.clear()
        self._count = 0
        self._words(Operation.FORGET)

    def end(self) -> None:
        self._words(Operation.END)

    def glint_scene_create(self, data: Any, *text: Any) -> int | None:
        block = self._structure(data)
        handle = self._core.glint_scene_create(data, *text)
        self._words(Operation.SCENE, self._new_slot(handle), block)
        return handle

    def glint_scene_create_like(self, base: int, data: Any, exact: bool, *text: Any) -> int | None:
        block = self._structure(data)
        handle = self._core.glint_scene_create_like(base, data, exact, *text)
        base = self._slots[base]
        self._words(Operation.LIKE, self._new_slot(handle), base, block, int(exact))
        return handle

    def glint_scene_destroy(self, handle: int) -> None:
        self._words(Operation.DROP, self._slots.pop(handle))
        self._core.glint_scene_destroy(handle)

    def glint_render_start(self, scene: int, data: Any, *text: Any) -> int | None:
        self._words(Operation.START, self._slots[scene], self._structure(data))
        return self._core.glint_render_start(scene, data, *text)

    def glint_render_wait(self, render: int, milliseconds: int) -> Any:
        progress = self._core.glint_render_wait(render, milliseconds)
        if progress.state == State.MOVING or progress.state >= State.DONE:
            self._words(Operation.WAIT)
        return progress

    def glint_render_move(self, render: int, scene: int, data: Any, *text: Any) -> int:
        self._words(Operation.MOVE, self._slots[scene], self._structure(data))
        return self._core.glint_render_move(render, scene, data, *text)

    def glint_render_picture(self, render: int, number: int, size: int) -> int | None:
        handle = self._core.glint_render_picture(render, number, size)
        self._words(Operation.PICTURE, int(number), size)
        self.sizes.append((int(number), size))
        where = self._core.glint_picture_values(handle)
        self._pictures.write(ctypes.string_at(where, 4 * size))
        return handle

    def glint_render_destroy(self, render: int) -> None:
        self._words(Operation.FINISH)
        self._core.glint_render_destroy(render)

    def _words(self, *words: int) -> None:
        self._tape.write(np.array(words, "<u8").tobytes())

    def _new_slot(self, handle: int | None) -> int:
        if not handle:
            raise ValueError("the core refuses a scene")
        self._slots[handle] = self._next_slot
        self._next_slot += 1
        return self._slots[handle]

    def _structure(self, reference: Any) -> int:
        """The block of the structure behind a `byref`; always a new one."""
        return self._block(bytes(reference._obj), pointers=True)

    def _block(self, values: bytes, pointers: bool) -> int:
        """A word that is the address of an array counts as one: no number in these structures is as
        large, and no float as small.
        """
        found = []
        if pointers:
            words = np.frombuffer(values, "<u8", len(values) // 8)
            found = [(8 * k, self._array(int(w))) for k, w in enumerate(words) if w in self._arrays]
        self._words(Operation.BLOCK, len(values), len(found))
        self._tape.write(values + bytes(-len(values) % 8))
        self._words(*(number for place in found for number in place))
        self._count += 1
        return self._count - 1

    def _array(self, where: int) -> int:
        if where not in self._blocks:
            array = self._arrays[where]
            self._blocks[where] = self._block(array.tobytes(), array.dtype.names is not None)
        return self._blocks[where]


@contextmanager
def _listening(recorder: Recorder):
    """Everything that packs for the core and asks it does so through the recorder."""
    modules = [m for name, m in sys.modules.items() if name.startswith(binding.__package__)]
    own = packer.address
    places = [(module, "address") for module in modules if vars(module).get("address") is own]
    before = [getattr(*place) for place in places]
    library = binding.library
    try:
        for place in places:
            setattr(*place, recorder.address)
        binding.library = lambda: recorder
        yield
    finally:
        binding.library = library
        for place, value in zip(places, before, strict=True):
            setattr(*place, value)


def record(names: list[str], tape: Path, pictures: Path) -> list[str]:
    """Draw these reference renders onto the tape; says which differ from those that are kept."""
    wrong, index = [], []
    with tape.open("wb") as calls, pictures.open("wb") as values:
        recorder = Recorder(binding.library(), calls, values)
        for name in names:
            with _listening(recorder):
                passes = references.draw(name)
            if references.hashes_of(passes) != references.kept_hashes()[name]:
                wrong.append(name)
            index += [(name, *size) for size in recorder.sizes]
            recorder.forget()
        recorder.end()
    pictures.with_suffix(".json").write_text(json.dumps(index))
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tape", type=Path)
    parser.add_argument("pictures", type=Path)
    parser.add_argument("scenes", nargs="*", default=list(references.SCENES))
    options = parser.parse_args()
    wrong = record(options.scenes, options.tape, options.pictures)
    if wrong:
        print(f"this machine's core does not draw the reference renders {', '.join(wrong)}")
        return 1
    size = options.pictures.stat().st_size
    print(f"{len(options.scenes)} reference renders, {size / 1e6:.1f} MB of pictures")
    return 0


if __name__ == "__main__":
    sys.exit(main())
