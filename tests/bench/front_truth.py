"""The pictures that fronts.py measures errors against: Cycles' with many samples, in two halves of
seeds of their own, kept in files and drawn on by later runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

Measure = Callable[[np.ndarray, np.ndarray], float]
"""(picture, truth) → error."""

STEPS = 4
"""Rounds in which the time allowed is spent; after each the halves are compared."""
LEAST = 8
"""Samples of a half in a round."""
SLACK = 1.1
"""How much longer than allowed a truth may take, so that a second run does not add a round for what
its clock says otherwise.
"""


@dataclass(frozen=True, eq=False)
class Truth:
    """halves: (2, h, w, 3) float32 means of as many samples each; samples: of both together."""

    halves: np.ndarray
    samples: int

    @property
    def picture(self) -> np.ndarray:
        """(h, w, 3) float64."""
        return self.halves.mean(0, dtype=np.float64)

    def noise(self, error: Measure) -> float:
        """The halves' difference: twice the noise of their mean, where errors add."""
        return error(*self.halves)


def truth_of(
    folder: Path,
    name: str,
    draw: Callable[[int, int], np.ndarray],
    rounds: int,
    is_enough: Callable[[Truth], bool],
) -> Truth:
    """The kept truth of that name, drawn on until it is enough or has all `STEPS` rounds of so many
    samples a half.

    draw: (samples, seed) → (h, w, 3).
    """
    truth, most = kept(folder, name), 2 * STEPS * rounds * SLACK
    while truth is None or (truth.samples + 2 * rounds <= most and not is_enough(truth)):
        truth = with_more(truth, draw, rounds)
        keep(folder, name, truth)
    return truth


def with_more(truth: Truth | None, draw: Callable[[int, int], np.ndarray], samples: int) -> Truth:
    """So many samples more in each half, of seeds that no other round has."""
    before = truth.samples if truth else 0
    found = np.stack([draw(samples, before + 1 + half) for half in (0, 1)]).astype(np.float32)
    share = 2 * samples / (before + 2 * samples)
    halves = share * found + (1 - share) * truth.halves if truth else found
    return Truth(halves.astype(np.float32), before + 2 * samples)


def rounds_within(seconds: float, of_a_sample: float) -> int:
    """Samples of a half in each round, for so many seconds altogether."""
    return max(LEAST, int(seconds / max(of_a_sample, 1e-6) / (2 * STEPS)))


def kept(folder: Path, name: str) -> Truth | None:
    """The one of the most samples."""
    found = {samples_of(path): path for path in folder.glob(f"{name}_*.npy")}
    return Truth(np.load(found[max(found)]), max(found)) if found else None


def keep(folder: Path, name: str, truth: Truth) -> None:
    """Keeps it in place of those of fewer samples."""
    folder.mkdir(parents=True, exist_ok=True)
    former = list(folder.glob(f"{name}_*.npy"))
    np.save(folder / f"{name}_{truth.samples}.npy", truth.halves)
    for path in former:
        path.unlink()


def samples_of(path: Path) -> int:
    return int(path.stem.rpartition("_")[2])
