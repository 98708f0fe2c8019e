"""Viewing transformations: world -> camera -> canonical view volume -> pixels (notes, section 7).
`engine.scene.viewing` chains them for a `Camera`.

Pixel coordinates are the notes': the centre of pixel (i, j) is the point (i, j), the frame is
[-0.5, nx - 0.5] × [-0.5, ny - 0.5], y up.
"""

from __future__ import annotations

import numpy as np

from .frames import basis_from_vectors, canonical_from_frame, rigid_inverse
from .transforms import window
from .vectors import Array


def viewport(nx: int, ny: int) -> Array:
    """(4, 4) M_vp: [-1, 1]² to [-0.5, nx - 0.5] × [-0.5, ny - 0.5], z unchanged (section 7.3)."""
    return window((-1, -1, -1), (1, 1, 1), (-0.5, -0.5, -1), (nx - 0.5, ny - 0.5, 1))


def orthographic(l: float, r: float, b: float, t: float, n: float, f: float) -> Array:  # noqa: E741
    """(4, 4) M_orth: the view volume [l, r] × [b, t] × [f, n] to [-1, 1]³ (section 7.4); n > f are
    z coordinates in front, so negative.
    """
    return window((l, b, f), (r, t, n), (-1, -1, -1), (1, 1, 1))


def perspective(n: float, f: float) -> Array:
    """(4, 4) P: keeps the plane z = n, and z = f as a set, and moves points along lines through the
    eye onto parallels of the z axis; homogeneous, to be divided. M_orth P is the perspective
    projection that section 7.2b asks for; 0 > n > f.
    """
    return np.array([[n, 0, 0, 0], [0, n, 0, 0], [0, 0, n + f, -f * n], [0, 0, 1, 0]], np.float64)


def camera_basis(gaze: Array, up: Array) -> Array:
    """(3,), (3,) -> (3, 3): columns u right, v up, w backward with w = -g/|g|, u = t × w/|t × w|, v
    = w × u (sections 4.5, 7.5).

    Raises ValueError when the gaze is zero or parallel to up.
    """
    return basis_from_vectors(-np.asarray(gaze, np.float64), up)


def camera_from_world(eye: Array, gaze: Array, up: Array) -> Array:
    """(4, 4) M_cam of eye position e, gaze direction g and view-up vector t (section 7.5): the
    rigid inverse of the camera's frame.
    """
    return rigid_inverse(canonical_from_frame(eye, camera_basis(gaze, up)))
