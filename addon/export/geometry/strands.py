"""Hair curves and particle hair to strands of segments, by the keys that Cycles takes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from ....engine.scene import Attribute, Strands
from .splines import Keys, cut

DEFAULT_RADIUS = 0.005
"""Cycles' radius of curves without one, object units."""
_ROUNDING = 2.0**-20
"""Of the world's coordinates that Blender tells of particles' hair: some float32 steps.
"""


@dataclass(eq=False)
class StrandSource:
    """Strands with what they were made from. key, share: as of `Cut`.  particles: they are hair of
    particle systems.
    """

    strands: Strands
    keys: Keys
    key: np.ndarray
    share: np.ndarray
    particles: bool = False
    used_slots: tuple[int, ...] = (0,)
    uv_maps: dict[str, Attribute] = field(default_factory=dict)
    attributes: dict[str, Attribute] = field(default_factory=dict)

    def finished(self) -> Strands:
        """The strands with the attributes they were asked for, the active UV map first."""
        maps = {a.name: a for a in self.uv_maps.values()}
        named = {a.name: a for a in self.attributes.values()}
        return replace(self.strands, attributes=tuple({**maps, **named}.values()))

    @property
    def curve_of_segment(self) -> np.ndarray:
        """(n,)"""
        return self.keys.curve[self.key[self.strands.starts]]


def _source(name: str, keys: Keys) -> StrandSource | None:
    found = cut(keys)
    if found is None:
        return None
    key, share, _, at = found
    # A vertex that ends its curve begins no segment.
    begins = np.ones(len(key), bool)
    begins[share == 1] = False
    starts = np.flatnonzero(begins).astype(np.uint32)
    slots = keys.slots[keys.curve[key[starts]]] if keys.slots.any() else None
    used = tuple(np.unique(keys.slots).tolist())
    strands = Strands(name, at[:, :3], np.maximum(at[:, 3], 0), starts, slots)
    return StrandSource(strands, keys, key, share, used_slots=used)


def read_curves(data: Any, scene: Any) -> StrandSource | None:
    """An evaluated Curves data-block; None without a segment."""
    keys = curve_keys(data, scene)
    return None if keys is None else _source(data.name, keys)


def curve_keys(data: Any, scene: Any) -> Keys | None:
    """Those of an evaluated Curves data-block; None without any."""
    count, curves = len(data.points), len(data.curves)
    if count == 0 or curves == 0:
        return None
    positions = np.empty((count, 3), np.float32)
    data.attributes["position"].data.foreach_get("vector", positions.reshape(-1))
    radii = np.full(count, DEFAULT_RADIUS, np.float32)
    radius = data.attributes.get("radius")
    if radius is not None and radius.domain == "POINT" and radius.data_type == "FLOAT":
        radius.data.foreach_get("value", radii)
    offsets = np.empty(curves + 1, np.int32)
    data.curve_offset_data.foreach_get("value", offsets)
    slots = np.zeros(curves, np.uint16)  # Cycles gives all curves the first material
    offsets = offsets.astype(np.intp)
    return Keys(positions, np.maximum(radii, 0), offsets, slots, _is_linear(scene))


def _is_linear(scene: Any) -> bool:
    """How Cycles' settings say that curves go between keys."""
    return getattr(getattr(scene, "cycles_curves", None), "shape", "") == "THICK_LINEAR"


class _System(NamedTuple):
    """A particle system as it is rendered: which of its particles, counted on into children."""

    system: Any
    modifier: Any
    first: int
    end: int
    steps: int


def systems_of(thing: Any, render: bool) -> Iterator[_System]:
    """Those of an evaluated object that render as hair, as Cycles counts their strands: children
    alone where there are some.
    """
    for modifier in thing.modifiers:
        shown = modifier.show_render if render else modifier.show_viewport
        if modifier.type != "PARTICLE_SYSTEM" or not shown:
            continue
        system = modifier.particle_system
        settings = system.settings
        if settings.type != "HAIR" or settings.render_type != "PATH":
            continue
        parents, children = len(system.particles), len(system.child_particles)
        if not render:
            children = int(children * settings.display_percentage / 100)
        first = parents if children and settings.child_type != "NONE" else 0
        steps = (1 << (settings.render_step if render else settings.display_step)) + 1
        if settings.kink == "SPIRAL":
            steps += settings.kink_extra_steps
        if parents + children > first:
            yield _System(system, modifier, first, parents + children, steps)


def read_hair(thing: Any, scene: Any, render: bool) -> StrandSource | None:
    """The particle hair of an evaluated object, in its space; None without any."""
    keys = hair_keys(thing, scene, render)
    found = None if keys is None else _source(f"hair of {thing.name}", keys)
    return None if found is None else replace(found, particles=True)


def hair_keys(thing: Any, scene: Any, render: bool) -> Keys | None:
    """Those of the particle hair of an evaluated object, in its space; None without any."""
    systems = list(systems_of(thing, render))
    if not systems:
        return None
    matrix = np.array(thing.matrix_world, np.float64)
    inverse = np.array(thing.matrix_world.inverted_safe(), np.float64)
    parts = [_hair_of(thing, system, inverse) for system in systems]
    sizes = [np.full(s.end - s.first, s.steps) for s in systems]
    slots = [
        np.full(s.end - s.first, max(s.system.settings.material - 1, 0), np.uint16) for s in systems
    ]
    positions = np.concatenate([positions for positions, _ in parts])
    size = np.abs(positions).max(initial=0.0, where=np.isfinite(positions))
    far = np.abs(matrix[:3]).sum(1).max() * max(size, 1.0)
    return Keys(
        positions,
        np.concatenate([radii for _, radii in parts]),
        np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.intp),
        np.concatenate(slots),
        _is_linear(scene),
        # they come as float32 of the world
        float(_ROUNDING * far * np.abs(inverse[:3, :3]).sum(1).max()),
    )


def _hair_of(thing: Any, s: _System, inverse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (k, 3) and radii (k,) of the keys of one system."""
    co, steps = s.system.co_hair, range(s.steps)
    # a slice is a tuple, which is read faster than the Vector
    places = chain.from_iterable(
        co(thing, particle_no=n, step=step)[:] for n in range(s.first, s.end) for step in steps
    )
    count = s.end - s.first
    world = np.fromiter(places, np.float64, count * s.steps * 3).reshape(count, s.steps, 3)
    # Beyond the end of a strand that was cut Blender gives the origin: it goes no further there.
    for step in range(1, s.steps):
        gone = ~world[:, step].any(1)
        world[gone, step] = world[gone, step - 1]
    positions = (world.reshape(-1, 3) @ inverse[:3, :3].T + inverse[:3, 3]).astype(np.float32)
    offsets = s.steps * np.arange(count + 1)
    along, _ = Keys(positions, positions[:, 0], offsets, np.zeros(count, np.uint16)).lengths
    settings = s.system.settings
    shape, tip = settings.shape, settings.tip_radius
    left = np.maximum(1 - along, 0) ** (1 + shape if shape < 0 else 1 / max(1 - shape, 1e-6))
    radii = 0.5 * settings.radius_scale * (left * (settings.root_radius - tip) + tip)
    if settings.use_close_tip:
        radii[offsets[1:] - 1] = 0
    return positions, np.maximum(radii, 0).astype(np.float32)
