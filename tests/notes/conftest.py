"""The tests of the notes draw with every tracer that can run."""

from __future__ import annotations

import numpy as np
import pytest

from glint import engine


class Draw:
    """Renders as the notes do: one ray through each pixel's centre, hard shadows, illumination as
    the formulas stand.
    """

    # A float64 tracer's value rounded to the film's float32 (half an ulp), and the core's float32
    # arithmetic.
    _RELATIVE = {"NUMPY": 2.0**-24 + 1e-12, "NATIVE": 1e-5}
    # Beside the largest value: what is left where terms cancel or a cosine goes to 0.
    _ABSOLUTE = {"NUMPY": 1e-12, "NATIVE": 1e-6}

    def __init__(self, backend: str):
        self.backend = backend

    def __call__(self, scene: engine.Scene, *passes: str, **changes: object) -> engine.Film:
        plain = {"samples": 1, "light_samples": 1, "filter_width": 0.0, "illumination": "CLASSIC"}
        return engine.render(
            scene,
            engine.Settings(**plain | changes, backend=self.backend, passes=frozenset(passes)),
        )

    def colors(self, scene: engine.Scene, **changes: object) -> np.ndarray:
        """(h, w, 3), the RGB of Combined."""
        return self(scene, **changes).combined[..., :3]

    def check(self, found: np.ndarray, expected: np.ndarray) -> None:
        """Equal to the rounding of this tracer, (h, w, c) or any shape that broadcasts."""
        expected = np.broadcast_to(expected, found.shape)
        largest = np.max(np.abs(expected), initial=0.0)
        np.testing.assert_allclose(
            found,
            expected,
            rtol=self._RELATIVE[self.backend],
            atol=self._ABSOLUTE[self.backend] * largest,
        )


@pytest.fixture(params=engine.available_backends())
def draw(request: pytest.FixtureRequest) -> Draw:
    return Draw(request.param)
