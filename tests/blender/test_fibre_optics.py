"""What a round fibre does to light across it, beside Chiang's distributions, by integrals."""

from __future__ import annotations

import numpy as np
import pytest

from glint.addon.export.materials.fibre_optics import slanted, ways
from glint.addon.export.materials.fresnel import fresnel

pytestmark = pytest.mark.once

TURNS = (np.arange(1440) + 0.5) / 1440 * 2 * np.pi - np.pi
HEIGHTS = 1 - (1 - (np.arange(1000) + 0.5) / 1000) ** 3  # of half of a fibre, dense at its rim
WIDTHS = 3 * (1 - (np.arange(1000) + 0.5) / 1000) ** 2 / 1000


def spread(ior: float, roughness: float, number: int) -> np.ndarray:
    """(1440,) how much of the light leaves at each of TURNS off where it comes from, a radian, of a
    clear fibre: Chiang et al., equations 7 to 12.
    """
    scale = 0.265 * roughness + 1.194 * roughness**2 + 5.372 * roughness**22
    scale *= np.sqrt(np.pi / 8)
    heights, widths = np.append(-HEIGHTS, HEIGHTS), np.append(WIDTHS, WIDTHS) / 2
    out, within = np.arcsin(heights), np.arcsin(heights / ior)
    edge = np.array([fresnel(float(np.cos(x)), ior) for x in out])
    amount = [edge, (1 - edge) ** 2, (1 - edge) ** 2 * edge][number]
    leaves = 2 * number * within - 2 * out + number * np.pi
    off = (TURNS[:, None] - leaves + np.pi) % (2 * np.pi) - np.pi
    falls = np.exp(-np.abs(off) / scale)
    logistic = falls / (scale * (1 + falls) ** 2) / np.tanh(np.pi / (2 * scale))
    return (amount * logistic) @ widths


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("ior", [1.33, 1.55, 2.0])
def test_means_are_those_of_the_distributions(ior: float, roughness: float) -> None:
    turn = 2 * np.pi / len(TURNS)
    for number, way in enumerate(ways(ior, roughness)):
        found = spread(ior, roughness, number)
        total = found.sum() * turn
        if number < 2:
            assert way.amount == pytest.approx(total, rel=1e-3)
        assert way.aim == pytest.approx((found * np.cos(TURNS)).sum() * turn / total, abs=1e-3)
        shares = way.shares()
        assert sum(share for _, share, _ in shares) == pytest.approx(1.0)
        # of lobes as semantics/lobes.md has them: (1 +- cos)^q / 2^q, where q is 1 without a fan
        aimed = 0.0
        for behind, share, fan in shares:
            q = 1 / fan if fan > 0 else 1.0
            lobe = (0.5 + 0.5 * np.cos(TURNS)) ** q
            aim = (lobe * np.cos(TURNS)).sum() / lobe.sum()
            aimed += share * (-aim if behind else aim)
        assert aimed == pytest.approx(way.aim, abs=1e-6)


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.55, 2.0, 1000.0])
def test_a_clear_fibre_loses_nothing(ior: float) -> None:
    told = ways(ior, 0.3)
    assert sum(way.amount for way in told) == pytest.approx(1.0, abs=1e-9)
    for sine in (0.0, 0.5, 0.9, 1.0):
        aside = slanted(ior, sine)
        total = sum(way.amount * share for way, share in zip(told, aside, strict=True))
        assert total == pytest.approx(1.0, abs=1e-9)
    assert slanted(ior, 0.0) == pytest.approx((1.0, 1.0, 1.0))
    if 1 < ior < 3:
        reflected = [slanted(ior, sine)[0] for sine in (0.0, 0.5, 0.9, 0.99)]
        assert reflected == sorted(reflected) and reflected[-1] > 3 * reflected[0]
