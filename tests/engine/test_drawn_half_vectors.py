"""Directions are drawn from lobes as densely as is said, also where they are seen aslant, stretched
or from behind.
"""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine import scene as s
from glint.engine.linear.columns import dot
from glint.engine.reference.closures import Term
from glint.engine.reference.closures.microfacet import density, drawn_size, sample
from glint.engine.reference.lights import LightPoint

UP = np.array([[0.0], [0.0], [1.0]])
SIDE = 64


def half_vectors() -> tuple[np.ndarray, np.ndarray]:
    """(3, m) all over the sphere, denser near its pole, and the solid angle of each."""
    place = (np.arange(400) + 0.5) / 400
    sine2 = np.sin(np.pi / 2 * place) ** 2  # of half the angle
    weight = np.pi * np.sin(np.pi / 2 * place) * np.cos(np.pi / 2 * place) / 400 * 2
    z, turn = np.meshgrid(1 - 2 * sine2, 2 * np.pi * (np.arange(300) + 0.5) / 300)
    across = np.sqrt(1 - z * z)
    solid = np.broadcast_to(weight, z.shape) * 2 * np.pi / 300
    return np.stack([across * np.cos(turn), across * np.sin(turn), z]).reshape(3, -1), solid.ravel()


def drawn(view: np.ndarray, p: float, stretch: np.ndarray, distribution: str) -> np.ndarray:
    """(3, SIDE²) half vectors at places that are even in the unit disc."""
    found = []
    for i in range(SIDE * SIDE):
        share, turn = (i + 0.5) / SIDE**2, 2 * np.pi * ((i * 0.6180339887) % 1)
        r = np.sqrt(share)
        point = LightPoint((0.0, 0.0), (r * np.cos(turn), r * np.sin(turn)))
        found.append(sample(UP, view, point, share, p, stretch, distribution))
    return np.concatenate(found, 1)


@pytest.mark.parametrize("distribution", s.DISTRIBUTIONS)
@pytest.mark.parametrize("size", [0.0, 0.6, 2.0])
@pytest.mark.parametrize("degrees", [0, 50, 80, 100])
def test_directions_fall_as_densely_as_is_said(
    degrees: float, size: float, distribution: str
) -> None:
    """The integral over directions of light is the share of facets that are seen; second moments
    are those of what is drawn.
    """
    tilt, alpha = np.radians(degrees), 0.4
    p = 2 / alpha**2 - 2
    view = np.array([[np.sin(tilt)], [0.0], [np.cos(tilt)]])
    stretch = np.array([[0.8 * size], [0.6 * size], [0.0]])
    h, solid = half_vectors()
    vh = dot(np.broadcast_to(view, h.shape), h)
    seen = vh > 0
    h, solid, vh = h[:, seen], solid[seen], vh[seen]
    v = np.broadcast_to(view, h.shape)
    light = 2 * vh * h - v
    count = h.shape[1]
    lobe = s.Lobe("SPECULAR", masking=alpha, distribution=distribution)
    term = Term(
        np.arange(count),
        np.ones((3, count)),
        lobe,
        {"exponent": p, "masking": alpha, "ior": 1.0},
        stretch=np.broadcast_to(stretch, h.shape) if size else None,
    )
    n = np.broadcast_to(UP, h.shape)
    # a steradian of half vectors is 4 v·h of light, whose v + l is 2 v·h long
    given = density(term, n, v, light) * drawn_size(term) / (4 * np.pi * 2 * vh) * 4 * vh * solid
    places = drawn(view, p, stretch, distribution)
    good = dot(np.broadcast_to(view, places.shape), places) > 0
    assert given.sum() == pytest.approx(good.mean(), abs=0.01)
    moments = (h**2 * given).sum(1) / given.sum()
    np.testing.assert_allclose((places[:, good] ** 2).mean(1), moments, atol=0.02)
