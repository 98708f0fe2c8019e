"""Clusters of lamps that far points see as one (semantics/many_lamps.md).

Letters: x shaded point, n its normal, l unit direction to a cluster's middle, d distance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..evaluation.surface import Surface
from ..lights.lamps import cluster_levels
from ..linear.columns import dot, length, pick, unit
from .bumps import bump_shadow
from .closures import Term
from .lights import Source

Array = np.ndarray

FAR2 = 16.0
"""Points see clusters from so many radii² as one."""

Lobes = Callable[[Array, Array], tuple[Array, Array]]
"""What lobes beside the DIFFUSE ones give back, matt ones and highlights apart, (3, m) each, of
light that comes to m points, whose places are told, from the directions (3, m).
"""


@dataclass(frozen=True, eq=False)
class FarLight:
    """What n points get of a lamp as of the cluster that it is in, for a colour of 1: seen (n,)
    where they see that as one, diffuse and specular (3, n).  middle: (n,) n·l / (4π² d²).
    """

    seen: Array
    diffuse: Array
    specular: Array
    middle: Array


@dataclass(frozen=True, eq=False)
class Cluster:
    """middle: (3, 1).  dipole: (3, 3), a row a channel, of light whose sum is 1.  quadrupole:
    (3, 3, 3) the same.  discs: (3,) the mean of radius², of lamps that are discs.  within: two
    clusters, or none, and then the number of the lamp.
    """

    middle: Array
    radius2: float
    dipole: Array
    quadrupole: Array
    discs: Array
    within: tuple[Cluster, ...]
    number: int


class LampClusters:
    """The trees of the lamps among `sources` that may be seen in clusters, one a light group."""

    def __init__(self, sources: Sequence[Source], light_samples: int) -> None:
        self._sources = sources
        self._levels = cluster_levels([source.light for source in sources])
        if any(not source.physical for source in sources):
            self._levels[:] = -1
        self._is_disc = [
            source.light.soft_falloff and source.sample_count(light_samples) > 1
            for source in sources
        ]
        lamps = np.flatnonzero(self._levels >= 0)
        self.holds = frozenset(lamps.tolist())
        groups = np.array([source.light.light_group for source in sources], np.intp)[lamps]
        self._roots = [self._cluster(lamps[groups == group]) for group in np.unique(groups)]

    def _cluster(self, lamps: Array) -> Cluster:
        sources = [self._sources[k] for k in lamps]
        color = np.stack([source.color for source in sources], 1)
        places = np.concatenate([source.position for source in sources], 1)
        radii = np.array([source.light.radius for source in sources])
        discs = np.where([self._is_disc[k] for k in lamps], radii**2, 0.0)
        weight = color.sum(0) / color.sum()
        middle = (places @ weight)[:, None] if len(lamps) > 1 else places
        off = places - middle
        total = color.sum(1, keepdims=True)
        share = np.where(total > 0, color / np.where(total > 0, total, 1.0), weight)
        within: tuple[Cluster, ...] = ()
        if len(lamps) > 1:
            at = 1 + int(np.argmax(self._levels[lamps[1:]]))
            within = self._cluster(lamps[:at]), self._cluster(lamps[at:])
        return Cluster(
            middle,
            float((length(off) + radii).max() ** 2),
            share @ off.T,
            np.einsum("ck,ik,jk->cij", share, off, off),
            share @ discs,
            within,
            int(lamps[0]),
        )

    def lights(
        self,
        surface: Surface,
        terms: list[Term],
        diffuse: Array,
        lit: Array,
        apart: Array,
        lobes: Lobes,
    ) -> Iterator[tuple[Source, FarLight]]:
        """What lit points get of each lamp. terms: highlights.  diffuse: (3, n) k_d.  apart: (n,)
        bool, points that look at each lamp.
        """
        if not self._roots:
            return
        far2 = np.full(len(surface), FAR2)
        for term in terms:
            exponent = np.where(term.k.any(0), term.numbers.get("exponent", 0.0), 0.0)
            far2[term.index] = np.maximum(far2[term.index], exponent)
        none, bumpy = np.zeros((3, len(surface))), surface.unbent.any(0)
        start = FarLight(np.zeros(len(surface), bool), none, none, none[0])

        def walk(
            cluster: Cluster, open_: Array, far: FarLight
        ) -> Iterator[tuple[Source, FarLight]]:
            to = cluster.middle - surface.x
            z = dot(surface.n, to)
            ok, whole = open_ & (dot(to, to) >= cluster.radius2 * far2), z * z > cluster.radius2
            if not cluster.within:
                ok &= whole
            ok &= ~bumpy | (whole & (dot(surface.unbent, to) ** 2 > cluster.radius2))
            if ok.any():
                far = replace(far, seen=far.seen | ok)
                front = np.flatnonzero(ok & ((z > 0) | ~whole))
                middle, matt, highlights = _given(cluster, surface, diffuse, front, lobes)
                far = replace(
                    far,
                    diffuse=_with(far.diffuse, front, matt),
                    specular=_with(far.specular, front, highlights),
                    middle=_with(far.middle, front, middle),
                )
            if not cluster.within:
                yield self._sources[cluster.number], far
            for part in cluster.within:
                yield from walk(part, open_ & ~ok, far)

        for root in self._roots:
            yield from walk(root, lit & ~apart, start)


def _with(values: Array, index: Array, some: Array) -> Array:
    values = values.copy()
    values[..., index] = some
    return values


def _given(
    cluster: Cluster, surface: Surface, diffuse: Array, front: Array, lobes: Lobes
) -> tuple[Array, Array, Array]:
    """Of points that see a cluster as one, for a colour of 1: what its middle gives to a white one
    (m,), diffuse and specular light (3, m).
    """
    to, n = cluster.middle - pick(surface.x, front), pick(surface.n, front)
    d, l = length(to), unit(to)  # noqa: E741
    z, radius = dot(n, to), np.sqrt(cluster.radius2)
    cosine, cut = dot(n, l), ~(z * z > cluster.radius2)
    intensity = 1 / (4 * np.pi**2 * d * d)
    half = np.where(cut, _half_height(cluster, n, d), 0.0)
    cosines = _mean_above(cosine + _beside(cluster, n, l, cosine, d), half)
    share, l = _above_horizon(n, l, half)  # noqa: E741
    matt, highlights = lobes(front, l)
    hidden, lit = bump_shadow(n, pick(surface.unbent, front), surface.bump[front], l)
    matt = np.where(hidden, 0.0, lit * (cosines * pick(diffuse, front) + share * matt))
    highlights = np.where(hidden, 0.0, share * highlights)
    height = _mean_above(z, np.where(cut, radius, 0.0)) / d
    return intensity * height, intensity * matt, intensity * highlights


def _half_height(cluster: Cluster, n: Array, d: Array) -> Array:
    """(m,) how far n·l of the lamps is from that of the middle: they are as if spread evenly so far
    to either side.
    """
    width2 = np.einsum("im,cij,jm->m", n, cluster.quadrupole, n)
    return np.sqrt(np.clip(width2, 0.0, cluster.radius2)) / d


def _mean_above(x: Array, a: Array) -> Array:
    """The mean of max(0, X), X spread evenly from x - a to x + a."""
    over = np.maximum(x + a, 0.0)
    partly = (x < a) & (a > 0)
    return np.where(partly, over * over / (4 * np.where(partly, a, 1.0)), np.maximum(x, 0.0))


def _above_horizon(n: Array, l: Array, half: Array) -> tuple[Array, Array]:  # noqa: E741
    """(m,) the share of lamps above the horizon, whose n·l are spread evenly by `half` to either
    side of that of l, and (3, m) l where it is as high as the mean of these.
    """
    cosine = dot(n, l)
    partly = (cosine < half) & (half > 0)
    over = np.maximum(cosine + half, 0.0)
    share = np.where(partly, over / (2 * np.where(partly, half, 1.0)), 1.0)
    height = np.where(partly, over / 2, cosine)
    aside = np.sqrt(np.where(partly, (1 - height**2) / np.where(partly, 1 - cosine**2, 1.0), 1.0))
    return share, np.where(partly, aside * (l - cosine * n) + height * n, l)


def _beside(cluster: Cluster, n: Array, l: Array, cosine: Array, d: Array) -> Array:  # noqa: E741
    """(3, m) what the places of lamps add to n·l: n·u / |u|³ to second order round u = d l."""
    dipole, quadrupole = cluster.dipole, cluster.quadrupole
    turned = np.einsum("cij,jm->cim", quadrupole, l)
    along_l, along_n = (np.einsum("im,cim->cm", each, turned) for each in (l, n))
    trace = 1.5 * np.einsum("cii->c", quadrupole) + cluster.discs
    first = dipole @ n - 3 * cosine * (dipole @ l)
    second = cosine * (7.5 * along_l - trace[:, None]) - 3 * along_n
    return (first + second / d) / d
