"""Where a camera that moves stands at each sample (SEMANTICS.md, "Rays")."""

from __future__ import annotations

import numpy as np

from .lens import BLOCK
from .sampling import shutter_times
from .scene import Camera

Array = np.ndarray

_RIGID = 1e-6
"""How far a turn from one key to the next may be off orthonormal."""


def camera_frames(camera: Camera, samples: int) -> Array:
    """(BLOCK², samples, 3, 4) float64 world_from_camera of each sample by pixel of a block, row by
    row: at times even over the shutter's.
    """
    keys = np.asarray(camera.motion, np.float64)
    times = shutter_times(BLOCK, samples)
    place = times.ravel() * (len(keys) - 1)
    first = np.minimum(place.astype(np.intp), len(keys) - 2)
    frames = np.empty((times.size, 3, 4))
    for k in range(len(keys) - 1):
        chosen = first == k
        frames[chosen] = _between(keys[k], keys[k + 1], place[chosen] - k)
    return frames.reshape(*times.shape, 3, 4)


def _between(a: Array, b: Array, share: Array) -> Array:
    """(n, 3, 4) from a to b, (3, 4) each: places on a line; axes turn evenly about one line, or go
    straight where they do more than turn.
    """
    t = share[:, None, None]
    straight = a + t * (b - a)
    turn = np.linalg.solve(a[:, :3], b[:, :3])
    if np.abs(turn @ turn.T - np.eye(3)).max() > _RIGID or np.trace(turn) < -1 + _RIGID:
        return straight
    across = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = np.linalg.norm(across) / 2
    angle = np.arctan2(sine, (np.trace(turn) - 1) / 2)
    x, y, z = across / (2 * sine) if sine > 0 else np.zeros(3)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned = np.eye(3) + np.sin(t * angle) * skew + (1 - np.cos(t * angle)) * (skew @ skew)
    return np.concatenate([a[:, :3] @ turned, straight[:, :, 3:]], 2)
