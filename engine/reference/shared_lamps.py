"""Many lamps: all of them light a point, and some are asked for their shadows, which stand for
those of all (semantics/many_lamps.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ..lights.lamps import first_mark
from ..linear.columns import add_at, pick
from .lamp_clusters import FarLight
from .light_groups import SharedGroups, share_open
from .lights import Source

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Given:
    """What one sample of a lamp gives to points. seen: (m,) those that it reaches, then those that
    a cluster does which it is in.  diffuse, specular: (3, m) before shadows.  open: of places in
    `seen`, (k,), the share (3, k) of the light that arrives.  asked: (m,) what its light is times
    among that of the samples asked, 0 where it has no ray.
    group: as `LightSample.group_of`.
    """

    seen: Array
    diffuse: Array
    specular: Array
    open: Callable[[Array], Array]
    asked: Array
    group: Array | int


@dataclass(frozen=True, eq=False)
class Sharing:
    """Lights that share so many shadow rays of a point and sample. sources: gives them, the same
    each time, with what n points get of those that they see in clusters.  matt, glossy: (3, n), the
    sums to which what such lobes throw back is added.
    """

    sources: Callable[[], Iterable[tuple[Source, FarLight | None]]]
    marks: int
    matt: Array
    glossy: Array


def choose(given: Array, marks: int, sample: int) -> Array:
    """(s, n) how many of the marks of a pixel's sample lie in each of s samples of lamps, which
    give (s, n) to n points, all channels together.
    """
    sums = np.cumsum(given, 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        along = sums * np.where(sums[-1] > 0, marks / sums[-1], 0.0) - first_mark(sample)
    upto = np.clip(np.nan_to_num(np.ceil(along)), 0, marks)
    return np.diff(np.maximum.accumulate(upto, 0), axis=0, prepend=0.0)


def share_shadows(
    samples: Callable[[], Iterable[Given]],
    weight: Array,
    marks: int,
    sample: int,
    on_ask: Callable[[Array], None],
    light_groups: int = 0,
) -> tuple[Array, Array, Array, Array]:
    """(3, n) each: diffuse and specular light of all the samples at n points before shadows, and
    the share of it that arrives; and (3 light_groups, n) what of it is of each. samples: gives
    them, the same each time.  weight: (3, n) T of the rays that see the points.  on_ask: told the
    points that ask a sample.
    """
    diffuse, specular, asked, passed = (np.zeros_like(weight) for _ in range(4))
    groups = SharedGroups(light_groups, weight.shape[1])
    rows = []
    for each in samples():
        add_at(diffuse, each.seen, each.diffuse)
        add_at(specular, each.seen, each.specular)
        groups.give(each.group, each.seen, each.diffuse + each.specular)
        row = np.zeros(weight.shape[1])
        row[each.seen] = np.abs(pick(weight, each.seen) * (each.diffuse + each.specular)).sum(0)
        rows.append(row)
    if not rows:
        return diffuse, specular, np.ones_like(weight), np.zeros((3 * light_groups, len(weight.T)))
    given = np.stack(rows)
    times = choose(given, marks, sample)
    for each, row, count in zip(samples(), given, times, strict=True):
        asking = np.flatnonzero((count[each.seen] > 0) & (each.asked > 0))
        if not len(asking):
            continue
        point = each.seen[asking]
        on_ask(point)
        light = pick(weight, point) * pick(each.diffuse + each.specular, asking)
        light = light * (each.asked[asking] * count[point] / row[point])
        add_at(asked, point, light)
        arrived = light * each.open(asking)
        add_at(passed, point, arrived)
        groups.ask(each.group, point, light, arrived)
    open_ = share_open(asked, passed)
    return diffuse, specular, open_, groups.shared_out(open_ * (diffuse + specular), open_)
