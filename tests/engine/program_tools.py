"""What tests of program operations share: every operation in both executors."""

from __future__ import annotations

from itertools import accumulate, product
from typing import Any

import numpy as np

from glint.engine.native import binding
from glint.engine.program.execute.operations import apply
from glint.engine.program.operations import Operation, Reference
from glint.engine.program.table import CODES

SPECIAL = np.array([0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -3.0, 1e-30, 1e9, -1e9, 255.0])
"""Numbers at which functions like to go wrong."""
_ROWS = tuple(float(x) for x in np.random.default_rng(4).uniform(0, 1, 256 * 4))
TABLES = {
    "ramp": _ROWS,
    "lookup": _ROWS[:768],
    "curves": (-0.3, 1.4, *_ROWS[: 256 * 3]),
    "piecewise": tuple(
        x for k, start in enumerate((-4.0, -1.0, 0.5, 2.0)) for x in (start, *_ROWS[k * 15 :][:15])
    ),
}
"""Tables as the operations of these names have them."""
HELD = {
    ("magic_texture", "distortion"): 1.5,
    ("wave_texture", "distortion"): 10.0,
    ("gabor_texture", "frequency"): 10.0,
    **{
        ("voronoi_texture", name): most
        for name, most in (
            ("vector", 300.0),
            ("w", 300.0),
            ("scale", 10.0),
            ("detail", 3.0),
            ("lacunarity", 3.0),
        )
    },
    **{
        ("noise_texture", name): most
        for name, most in (
            ("vector", 300.0),
            ("w", 300.0),
            ("scale", 10.0),
            ("roughness", 2.0),
            ("lacunarity", 3.0),
            ("offset", 2.0),
            ("gain", 2.0),
            ("distortion", 3.0),
        )
    },
}
"""The largest number for some arguments: errors of the last bit grow by them."""


def arguments_of(operation: Operation, random: np.random.Generator, count: int) -> list[np.ndarray]:
    """Random arguments, (n,) for numbers and (3, n) for vectors, a third of them special."""

    def column() -> np.ndarray:
        values = random.normal(0, 2, count)
        special = random.random(count) < 1 / 3
        return np.where(special, random.choice(SPECIAL, count), values)

    def vector() -> np.ndarray:
        values = np.stack([column() for _ in range(3)])
        # in a lattice that is not scattered cells tie where two coordinates are equal: rounding of
        # powers, which processors' libraries differ in, decides
        same = (operation.name == "voronoi_texture") & (values[0] == values[2])
        values[2] += np.where(same & np.isfinite(values[2]), 0.3, 0.0)
        return values

    most = [HELD.get((operation.name, name), np.inf) for name, _ in operation.arguments]
    return [
        np.clip(column() if kind == 1 else vector(), -limit, limit)
        for limit, (_, kind) in zip(most, operation.arguments, strict=True)
    ]


def untied(operation: Operation, arguments: list, settings: dict[str, Any]) -> list[np.ndarray]:
    """The arguments, but none that bring a Voronoi Texture to the origin of four dimensions where
    Jenkins' hashes scatter it: cells whose coordinates are the same numbers in another order are
    mirror images there, and tie.
    """
    if not settings.get("cell_hash") or settings["dimensions"] < 4:
        return arguments
    return [
        np.where(np.abs(x) < 1e-9, 0.7, x) if name in ("scale", "lacunarity") else x
        for (name, _), x in zip(operation.arguments, arguments, strict=True)
    ]


def settings_of(operation: Operation) -> list[dict[str, Any]]:
    """Every combination of an operation's settings; of long ranges the first four and the last."""
    choices = [
        [TABLES[operation.name]] if isinstance(c, Reference) else _some(c)
        for _, c in operation.settings
    ]
    names = [name for name, _ in operation.settings]
    return [dict(zip(names, chosen, strict=True)) for chosen in product(*choices)]


def _some(choices: Any) -> list:
    return [*choices[:4], *choices[4:][-1:]] if isinstance(choices, range) else list(choices)


def by_reference(operation: Operation, arguments: list, settings: dict) -> list[np.ndarray]:
    """Outputs of the NumPy executor."""
    return [np.asarray(v, float) for v in apply(operation, arguments, settings)]


def by_core(operation: Operation, arguments: list, settings: dict) -> list[np.ndarray]:
    """Outputs of the core."""
    count = arguments[0].shape[-1]
    widths = [int(kind) for _, kind in (*operation.arguments, *operation.outputs)]
    starts = [0, *accumulate(widths)]
    ins, outs = len(operation.arguments), len(operation.outputs)
    table: list[float] = []
    numbers = []
    for name, choices in operation.settings:
        value = settings[name]
        if isinstance(choices, Reference):
            numbers.append(len(table))
            table += [float(len(value)), *value]
        else:
            numbers.append(int(value))
    code = [CODES[operation.name], *starts[ins : ins + outs], *starts[:ins], *numbers]
    columns = np.zeros((starts[-1], count))
    for start, width, argument in zip(starts, widths, arguments, strict=False):
        columns[start : start + width] = argument
    words, tables = np.array(code, np.int32), np.array(table or [0.0])
    failed = binding.library().glint_program_run(
        words.ctypes.data, len(words), 0, 0, tables.ctypes.data, len(columns),
        columns.ctypes.data, count,
    )  # fmt: skip
    assert not failed
    return [
        columns[start] if width == 1 else columns[start : start + 3]
        for start, width in zip(starts[ins:], widths[ins:], strict=False)
    ]
