"""Media that glow as lights: lines through them, cut to rods, and points on these by importance,
the same for all pixels of a sample.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from ..evaluation.attributes import Attributes
from ..evaluation.geometry import gather
from ..evaluation.media import Lines, MediaSpans
from ..program.program import without_the_rest
from ..sampling import chosen, concentric_disc, dome_points, tabled
from ..scene import Instances, Light, Material, Medium, Rods, Scene, World
from .dome import LARGEST
from .enclosures import Surfaces, joined
from .mesh_lights import MeshTable, along_a_curve, box_light, camera_at, linked_as, linked_blocks
from .same import Same

Array = np.ndarray

LINES, MOST_LINES = 1 << 12, 1 << 16
"""Through the placements of a thing together: to begin with, and where few meet anything."""
FEWEST, MOST = 4, 1 << 10
"""Through a placement, to begin with."""
MET = 1 << 10
"""Lines that meet what glows, if that can be."""
LONGEST = 1 / 16
"""Of a rod, over the longest side of the box round its placement."""
LEAST = 1e-12
"""Of the power of the strongest rod: weaker ones have no points."""
FINEST = 1 / 64
"""Steps in media that vary, as of `Medium.step`."""
SHIFTS = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])
"""Powers of a number like the golden ratio: multiples of them are even in three dimensions."""
MERGED = 4
"""Samples of a pixel, among whose points each stands for a ball, within which light is evened out:
there it is finite, and right where the medium glows evenly.
"""
WIDER = 8.0
"""Volume of such a ball at most, over the mean of all."""


def medium_lights(scene: Scene) -> tuple[Light, ...]:
    """The MEDIUM lights of all things of a scene that are filled with what glows, one for those
    that light the same things, in the shadows of the same.
    """
    if not scene.has_glowing_media:
        return ()
    blocks = [block for block in scene.instances if _glows(scene, block)]
    return _lights(_what_glows(scene, blocks)) if blocks else ()


def _glows(scene: Scene, block: Instances) -> bool:
    medium = None if block.catcher else scene.medium_of(block)
    return medium is not None and medium.emits


def _what_glows(scene: Scene, blocks: list[Instances]) -> Same[Scene]:
    """The blocks alone, as a key of those things on which their lights depend."""
    used = [scene.materials[k] for block in blocks for k in block.materials]
    varies = any(material.medium and material.medium.program for material in used)
    return Same(
        replace(scene, instances=tuple(blocks), lights=(), world=World()),
        *blocks,
        *(scene.geometries[block.geometry] for block in blocks),
        *used,
        *(scene.textures if varies else ()),
    )


@functools.lru_cache(maxsize=2)
def _lights(same: Same[Scene]) -> tuple[Light, ...]:
    lights = (_light(same.value, some) for some in linked_blocks(same.value.instances))
    return tuple(light for light in lights if light is not None)


def _light(scene: Scene, blocks: list[Instances]) -> Light | None:
    """Of all that glows of the blocks; None where nothing does."""
    # near what glows: sums of large and small coordinates lose the small ones' last digits
    first = np.array(blocks[0].world_from_object[0, :, 3], np.float64)
    grouped: dict[int, list[Instances]] = {}
    for block in blocks:
        grouped.setdefault(block.light_group, []).append(_shown(block))
    parts = [_rods(scene, block, first) for some in grouped.values() for block in joined(some)]
    rods = Rods.together(parts)
    with np.errstate(over="ignore", invalid="ignore"):
        given = rods.weight * rods.volumes
    given = np.where(np.isfinite(given), given, 0.0)
    good = np.flatnonzero(given > LEAST * given.max(initial=0.0))
    if not len(good):
        return None
    order = good[along_a_curve(rods.ends[good].mean(1))]
    rods, block = rods.take(order), blocks[0]
    light, shift = box_light("Glowing media", "MEDIUM", rods.ends.reshape(-1, 3), first)
    return replace(linked_as(light, block), rods=replace(rods, ends=rods.ends - shift))


def _shown(block: Instances) -> Instances:
    """Seen by all rays: what of it glows depends on none."""
    return replace(block, visible_mirror=True, visible_shadow=True)


def _glow_of(medium: Medium) -> Medium:
    """What it gives, and takes nothing away."""
    program, output = medium.program, medium.emission_output
    alone = Medium(emission=medium.emission)
    if program is None or output < 0:
        return alone
    return replace(
        alone,
        program=without_the_rest(program, {output}),
        emission_output=output,
        step=max(medium.step, FINEST),
    )


def _rods(scene: Scene, block: Instances, origin: Array) -> Rods:
    """What lines through the placements of a block meet of its medium, counted from the origin."""
    medium = scene.medium_of(block)
    assert medium is not None
    filled = Material("glow", (), medium=_glow_of(medium))
    alone = replace(
        scene,
        camera=camera_at(origin),
        geometries=(scene.geometries[block.geometry],),
        instances=(replace(block, geometry=0, materials=(0,), motion=None),),
        materials=(filled,),
    )
    geometry = gather(alone, origin)
    surfaces = Surfaces(alone.geometries, alone.instances, geometry, origin)
    media = MediaSpans(alone, Attributes(alone), geometry, surfaces.crossings)
    lines = _LightLines(media, block.light_group, _step(filled.medium))
    count = int(np.clip(LINES // max(len(block.world_from_object), 1), FEWEST, MOST))
    rods, met = lines.rods(count)
    if 0 < 2 * met < MET and len(block.world_from_object) * count < MOST_LINES:
        most = max(MOST_LINES // len(block.world_from_object), count)
        rods, _ = lines.rods(min(count * -(-MET // met), most))
    return rods


def _step(medium: Medium | None) -> float:
    return medium.step if medium is not None and medium.program is not None else 0.0


class _LightLines:
    """Lines along the longest side of the box round each placement."""

    def __init__(self, media: MediaSpans, light_group: int, step: float) -> None:
        self._media, self._group, self._step = media, light_group, step

    def rods(self, count: int) -> tuple[Rods, int]:
        """Of `count` lines through each placement, and how many lines meet the medium."""
        boxes = self._media.boxes
        rows = np.flatnonzero(np.isfinite(boxes).all((1, 2)) & (boxes[:, 1] > boxes[:, 0]).all(1))
        size = boxes[rows, 1] - boxes[rows, 0]
        axes = (size.argmax(1)[:, None] + np.arange(3)) % 3
        sides = np.take_along_axis(size, axes, 1)
        # elsewhere in each placement, and steps begin elsewhere on each line
        u = (dome_points(count) + np.arange(len(rows))[:, None, None] * SHIFTS[:2]) % 1.0
        later = (np.arange(count) * SHIFTS[2]) % 1.0
        before = 2 * self._step * size.mean(1)
        at = np.stack(
            [
                -0.01 * sides[:, :1] - before[:, None] * later,
                u[..., 0] * sides[:, 1:2],
                u[..., 1] * sides[:, 2:3],
            ],
            2,
        )
        d = np.zeros((len(rows), count, 3))
        np.put_along_axis(d, np.broadcast_to(axes[:, None, :1], (*d.shape[:2], 1)), 1.0, 2)
        offset = np.zeros_like(d)
        np.put_along_axis(offset, np.broadcast_to(axes[:, None], d.shape), at, 2)
        o = (boxes[rows, 0][:, None] + offset).reshape(-1, 3).T
        d = d.reshape(-1, 3).T
        far = (1.02 * sides[:, :1] - at[:, :, 0]).reshape(-1)
        spans = self._media.spans(Lines(o, d, np.zeros(o.shape[1])), "mirror", far)
        row = np.repeat(rows, count)
        start, end = np.maximum(spans.start, 0.0), np.minimum(spans.end, far[spans.ray])
        own = np.flatnonzero((spans.row == row[spans.ray]) & (end > start))
        ray, start, end = spans.ray[own], start[own], end[own]
        emission = np.clip(spans.matter.emission[:, own], -LARGEST, LARGEST).T
        section = np.repeat(sides[:, 1] * sides[:, 2] / count, count)[ray]
        longest = np.repeat(sides[:, 0], count)[ray] * LONGEST
        parts = np.ceil((end - start) / longest).astype(np.intp).clip(1)
        ends = [(o[:, ray] + t * d[:, ray]).T for t in (start, end)]
        rods = Rods(
            np.stack(ends, 1),
            emission,
            section,
            np.abs(emission).mean(1),
            np.full(len(own), self._group),
        )
        return rods.cut(parts), len(np.unique(ray[emission.any(1)]))


def medium_table(light: Light, samples: int, each: int) -> MeshTable:
    """What tracers know of a MEDIUM light, as `mesh_lights.mesh_table`: `front` is what the medium
    gives a world unit, `spread` one over the points' density by volume, `reach` the radius of the
    ball that each stands for.
    """
    rods = light.rods
    assert rods is not None
    count = tabled(samples, each)
    u = dome_points(count)
    index, _ = chosen(rods.weight * rods.volumes, u[:, 0])
    first, last = rods.ends[index, 0], rods.ends[index, 1]
    spread = rods.spreads[index]
    ball = np.minimum(spread, WIDER * rods.volumes.sum()) / (MERGED * each)
    nothing = np.zeros((count, 3))
    return MeshTable(
        first + u[:, 1:] * (last - first),
        nothing,
        rods.emission[index],
        nothing,
        spread,
        np.cbrt(3 / (4 * np.pi) * ball),
        concentric_disc(2 * u - 1),
        each,
        rods.light_group[index],
    )
