"""Light told apart by the groups of what makes it (semantics/passes.md)."""

from __future__ import annotations

import numpy as np

from ..linear.columns import add_at

Array = np.ndarray


def add_to_groups(groups: Array, group: Array | int, at: Array, values: Array) -> None:
    """Adds values (3, m) at the places `at` (m,), no place twice, of the rows of each group, three
    a group of `groups` (3 g, n). group: (m,), (1,) or one number, -1 for none.
    """
    if not len(groups):
        return
    own = np.broadcast_to(group, (len(at),))
    for number in np.unique(own[own >= 0]):
        some = np.flatnonzero(own == number)
        add_at(groups[3 * number : 3 * number + 3], at[some], values[:, some])


class SharedGroups:
    """What the groups of lights that share shadow rays give to n points, and what of those samples
    got through that were asked; those of no group are one more.
    """

    def __init__(self, count: int, n: int) -> None:
        self._given, self._asked, self._passed = np.zeros((3, count + 1 if count else 0, 3, n))

    def _of(self, group: Array | int) -> int:
        number = int(np.ravel(group)[0])
        return number if number >= 0 else len(self._given) - 1

    def give(self, group: Array | int, at: Array, light: Array) -> None:
        """Light (3, m) of one sample before shadows, at the places (m,)."""
        if len(self._given):
            add_at(self._given[self._of(group)], at, light)

    def ask(self, group: Array | int, at: Array, asked: Array, passed: Array) -> None:
        """What was asked for (3, m) of one sample, and what of it arrives."""
        if len(self._given):
            add_at(self._asked[self._of(group)], at, asked)
            add_at(self._passed[self._of(group)], at, passed)

    def shared_out(self, all_: Array, open_: Array) -> Array:
        """(3 g, n) what each group gives: by what of it got through, and of what is left between
        the sum of that and all (3, n) as large a share. open_: (3, n) what of all arrives.
        """
        if not len(self._given):
            return np.zeros((0, all_.shape[1]))
        pairs = zip(self._asked, self._passed, strict=True)
        own = np.stack([share_open(*pair, open_) for pair in pairs]) * self._given
        size = np.abs(own).sum(0)
        left = all_ - own.sum(0)
        own += left * (np.abs(own) / np.where(size > 0, size, 1.0))
        return own[:-1].reshape(-1, all_.shape[1])


def share_open(asked: Array, passed: Array, otherwise: Array | float = 1.0) -> Array:
    """(3, n) the share of light that arrives, in each channel; where those samples that were asked
    have nothing in it, in all together, and where none were, what is told.
    """
    all_ = asked.sum(0)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.where(all_ > 0, passed.sum(0) / all_, otherwise)
        return np.clip(np.where(asked > 0, passed / asked, mean), 0.0, 1.0)
