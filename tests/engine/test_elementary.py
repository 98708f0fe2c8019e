"""Elementary functions that are the same on every processor."""

from __future__ import annotations

import hashlib

import mpmath
import numpy as np
import pytest

from glint.engine.linear import elementary

RANDOM = np.random.default_rng(1)
NEAR = 10 ** RANDOM.uniform(-15, 0, 300)
GIVEN = {
    "exp": [*RANDOM.uniform(-700, 700, 1000), *RANDOM.uniform(-1, 1, 500), 0.0],
    "log": [*10 ** RANDOM.uniform(-300, 300, 1000), *(1 + NEAR), *(1 - NEAR / 2), 1.0],
    "arccos": [*RANDOM.uniform(-1, 1, 1000), *(1 - NEAR), *(NEAR - 1), -1.0, 0.0, 1.0],
}
TRUTH = {"exp": mpmath.exp, "log": mpmath.log, "arccos": mpmath.acos}


@pytest.mark.parametrize(("name", "most"), [("exp", 1), ("log", 2), ("arccos", 5)])
def test_they_are_right_to_the_last_places(name: str, most: int) -> None:
    found = getattr(elementary, name)(np.array(GIVEN[name]))
    for x, value in zip(GIVEN[name], found.tolist(), strict=True):
        truth = TRUTH[name](mpmath.mpf(x))
        assert abs(value - truth) <= most * np.spacing(abs(float(truth)) or 5e-324), x


def test_their_bits_are_those_of_other_processors() -> None:
    """What an AMD64 processor gave with AVX-512 and, NumPy's and the C library's faster code off,
    with SSE2 alone.
    """
    x = np.arange(-999, 1000) / 1000
    bits = b"".join(f(y).tobytes() for f, y in (
        (elementary.exp, 700 * x), (elementary.log, 1 + x), (elementary.arccos, x)
    ))  # fmt: skip
    assert hashlib.sha256(bits).hexdigest()[:16] == "30b57c2bd33450e9"
