"""What a round dielectric fibre does to light across it: how much is reflected (R), passes (TT) and
is reflected within (TRT), and where to (Marschner et al. 2003).
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from .fresnel import fresnel

_HEIGHTS = 128


class Way(NamedTuple):
    """One of the ways that light takes, as means over the width of a fibre seen from the side.

    amount: of the light that meets a clear fibre.  radii: how far it goes within, where little is
    absorbed.  aim: the mean cosine, round the fibre, between where it leaves to and where it comes
    from.
    """

    amount: float
    radii: float
    aim: float

    def shares(self) -> tuple[tuple[bool, float, float], ...]:
        """Of each of the FIBRE lobes that together aim so: whether it is behind, its share of the
        amount, and its `Lobe.fan`.

        A lobe without masking has the mean cosine 1/2, before or behind; one with the masking 1 / q
        has q / (q + 1).
        """
        size = abs(self.aim)
        if size > 0.5:
            return ((self.aim < 0, 1.0, 1 / size - 1),)
        return (False, 0.5 + self.aim, 0.0), (True, 0.5 - self.aim, 0.0)


@functools.lru_cache(maxsize=64)
def ways(ior: float, roughness: float) -> tuple[Way, Way, Way]:
    """R, TT and TRT of Chiang et al. (A practical and controllable hair and fur model, 2016).

    What is reflected within more often is in TRT.  ior: at least 1.  roughness: theirs round the
    fibre, 0 to 1.
    """
    out = _angles(_HEIGHTS)
    within, width = np.arcsin(np.sin(out) / ior), np.cos(out)
    width /= width.sum()
    edge = np.array([fresnel(math.cos(each), ior) for each in out])
    passes, chord, spread = (1 - edge) ** 2, 2 * np.cos(within), _mean_cosine(roughness)

    def way(number: int, amount: np.ndarray, more: np.ndarray) -> Way:
        whole = max(float(amount @ width), 1e-300)
        radii = number * float((amount * chord) @ width) / whole
        leaves = 2 * number * within - 2 * out + number * math.pi
        aim = spread * float((amount * np.cos(leaves)) @ width) / whole
        return Way(float(more @ width), radii, aim)

    again = passes * edge
    return way(0, edge, edge), way(1, passes, passes), way(2, again, again / (1 - edge))


def _angles(count: int) -> np.ndarray:
    """Off the normal, at which a fibre is met over its width; each stands for as much of that as
    its cosine.
    """
    return ((np.arange(count) + 0.5) / count - 0.5) * math.pi


@functools.lru_cache(maxsize=1024)
def slanted(ior: float, sine: float) -> tuple[float, float, float]:
    """How much there is of R, TT and TRT in a slanted view, over what there is from the side.

    More is reflected. sine: of the angle by which the view leaves the plane across the fibre.
    """

    def shares(across: float) -> tuple[float, float, float]:
        width = np.cos(_angles(_HEIGHTS))
        edge = np.array([fresnel(across * each, ior) for each in width])
        return tuple(float(kind @ width) for kind in (edge, (1 - edge) ** 2, (1 - edge) * edge))

    aside = shares(math.sqrt(max(1 - sine * sine, 1e-6)))
    return tuple(a / b if b > 0 else 1.0 for a, b in zip(aside, shares(1.0), strict=True))


def _mean_cosine(roughness: float) -> float:
    """Of the logistic distribution that spreads what leaves (Chiang et al., equations 8 and 12)."""
    beta = min(max(roughness, 0.0), 1.0)
    scale = (0.265 * beta + 1.194 * beta**2 + 5.372 * beta**22) * math.sqrt(math.pi / 8)
    turn = math.pi * max(scale, 1e-6)
    return turn / math.sinh(turn)
