"""Hair curves and particle hair to strands of segments, by the keys that Cycles takes.

A smooth curve goes through its keys as a Catmull-Rom spline, in Cycles as here; it becomes as many
segments as keep it within `NEAR` of its radius of the spline and turn no more than `TURN` each.
Where two meet they lie a little outside of the bend, so that it has the spline's place in the mean.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from ....engine.scene import FACE, POINT, Attribute, Strands
from ..materials.required import RequiredAttributes
from ..report import Report
from ..shader_nodes.inputs import ACTIVE_COLOR
from ..shader_nodes.reader import ENCLOSED, FIBRE, GENERATED, HAIR
from .enclosure import light_between
from .hashing import random_of
from .meshes import GREY, sound, values_as_color, values_of

DEFAULT_RADIUS = 0.005
"""Cycles' radius of curves without one, object units."""
NEAR = 0.05
"""How far a chord of the spline may be from it, of the radius; segments are at most two thirds as
far, on both sides."""
TURN = 0.25
"""How much a segment may turn from the one before it, radians, about."""
MOST = 16
"""Segments between two keys."""
_ROUNDING = 2.0**-20
"""Of the world's coordinates that Blender tells of particles' hair: some float32 steps.
"""
_BLOCK = 1 << 17
"""Pairs of keys that are made smooth in one go."""


@dataclass(frozen=True, eq=False)
class Keys:
    """What curves are given by. positions (k, 3) float32, radii (k,) float32 of all keys in the
    order of the curves; offsets (c + 1,) of the first key of each; slots (c,) uint16.  is_linear:
    curves go straight between keys.  precision: how far positions may be off.
    """

    positions: np.ndarray
    radii: np.ndarray
    offsets: np.ndarray
    slots: np.ndarray
    is_linear: bool = False
    precision: float = 0.0

    @property
    def curve(self) -> np.ndarray:
        """(k,) the number of each key's curve."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    @property
    def lengths(self) -> tuple[np.ndarray, np.ndarray]:
        """(k,) how far along its curve each key is, of its length, 0 to 1; (c,) the lengths."""
        first = self.offsets[:-1][np.diff(self.offsets) > 0]
        steps = np.zeros(len(self.positions))
        with np.errstate(invalid="ignore", over="ignore"):
            steps[1:] = np.sqrt((np.diff(self.positions.astype(np.float64), axis=0) ** 2).sum(1))
        steps[first] = 0
        steps[~np.isfinite(steps)] = 0
        along = np.cumsum(steps)
        curve = self.curve
        along -= along[np.minimum(self.offsets[:-1], len(along) - 1)][curve]
        length = np.bincount(curve, steps, len(self.offsets) - 1)
        return along / np.where(length > 0, length, 1.0)[curve], length


class Cut(NamedTuple):
    """Curves in segments. key, share: (v,) of each vertex the key before it and how far it is
    towards the next one, 1 at the end of a curve.  step: (v,) how far the next vertex is from there
    on this part of the curve.  at: (v, 4) float32 position and radius.
    """

    key: np.ndarray
    share: np.ndarray
    step: np.ndarray
    at: np.ndarray

    def of(self, keys: Keys) -> np.ndarray:
        """(v, 4) float32 of the same vertices when their curves have these keys."""
        b, t = _bezier(keys, self.key), self.share[:, None].astype(np.float64)
        at = _along_splines(b, t, keys.is_linear)
        return (at + self.outward(keys, b)).astype(np.float32)

    def outward(self, keys: Keys, b: list[np.ndarray]) -> np.ndarray:
        """(v, 4) by how much vertices of parts that are cut lie beside the curves, so that chords
        are half outside: a chord of a n-th is off by 2/3 of |p''| / 8 n² in the mean. b: the
        control points at each vertex.
        """
        by = np.zeros((len(self.key), 4))
        if keys.is_linear or (self.step == 1).all():
            return by
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            t = self.share[:, None].astype(np.float64)
            after = 6 * ((1 - t) * (b[0] - 2 * b[1] + b[2]) + t * (b[1] - 2 * b[2] + b[3]))
            tangent = (1 - t) ** 2 * (b[1] - b[0]) + 2 * t * (1 - t) * (b[2] - b[1])
            tangent += t * t * (b[3] - b[2])
            # where the part before ends at a key, its own bend and step
            before, step = after.copy(), self.step[:, None].astype(np.float64)
            new = np.flatnonzero(self.key[1:] != self.key[:-1]) + 1
            before[new] = 6 * (b[1] - 2 * b[2] + b[3])[new - 1]
            last = step.copy()
            last[new] = step[new - 1]
            bend = (before * last * last + after * step * step)[:, :3] / 2
            along = tangent[:, :3] / np.sqrt((tangent[:, :3] ** 2).sum(1))[:, None]
            by[:, :3] = -(bend - (bend * along).sum(1)[:, None] * along) / 12
        # between parts that are one chord each keys stay as they are
        by[self.ends | (np.minimum(last, step)[:, 0] == 1)] = 0.0
        by[~np.isfinite(by).all(1)] = 0.0
        return by

    @property
    def ends(self) -> np.ndarray:
        """(v,) bool: which begin or end a curve."""
        last = self.share == 1
        return last | np.append(True, last[:-1])


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
    places = chain.from_iterable(
        co(thing, particle_no=n, step=step) for n in range(s.first, s.end) for step in steps
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


# --- smooth curves
# --------------------------------------------------------------------------------------------------


def cut(keys: Keys) -> Cut | None:
    """Curves in segments; None without any."""
    pairs = _pairs(keys)
    if not len(pairs):
        return None
    blocks = [pairs[first : first + _BLOCK] for first in range(0, len(pairs), _BLOCK)]
    parts = [_smooth(keys, block) for block in blocks]
    found = Cut(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    for first in range(0, len(found.key), _BLOCK):
        if (found.step[max(first - 1, 0) : first + _BLOCK] == 1).all():
            continue
        found.at[first : first + _BLOCK] += _outward(keys, found, first)
    return found


def _outward(keys: Keys, found: Cut, first: int) -> np.ndarray:
    """`Cut.outward` of a block of vertices."""
    before, end = max(first - 1, 0), first + _BLOCK
    some = Cut(*(column[before:end] for column in found))
    by = some.outward(keys, _bezier(keys, some.key))[first - before :]
    return by.astype(np.float32)


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


def _pairs(keys: Keys) -> np.ndarray:
    """(p,) keys that have a next one on their curve, elsewhere than they are."""
    first = np.ones(max(len(keys.positions) - 1, 0), bool)
    ends = keys.offsets[1:-1]
    first[ends[(ends > 0) & (ends <= len(first))] - 1] = False
    # NaN differs from itself: what is not finite goes on to whoever tells of it
    apart = (keys.positions[1:] != keys.positions[:-1]).any(1)
    return np.flatnonzero(first & apart)


def _smooth(keys: Keys, pairs: np.ndarray) -> Cut:
    """Vertices along the curve between some pairs of keys."""
    b = _bezier(keys, pairs)
    count = np.ones(len(pairs), np.intp) if keys.is_linear else _pieces(b)
    curve = keys.curve[pairs]
    last = np.append(curve[1:] != curve[:-1], True)
    if len(pairs):  # the next block may go on where this one ends
        last[-1] = not _goes_on(keys, pairs[-1])
    total = count + last
    which = np.repeat(np.arange(len(pairs)), total)
    place = np.arange(len(which)) - np.repeat(np.cumsum(total) - total, total)
    t = (place / count[which])[:, None]
    at = _along_splines([points[which] for points in b], t, keys.is_linear)
    # keys as they are: one that is not finite leaves its neighbours in place
    at[place == 0] = b[0]
    at[t[:, 0] == 1] = b[3][last]
    step = (1 / count[which]).astype(np.float32)
    return Cut(pairs[which], t[:, 0].astype(np.float32), step, at.astype(np.float32))


def _along_splines(b: list[np.ndarray], t: np.ndarray, is_linear: bool) -> np.ndarray:
    """(v, 4) at t, (v, 1), between the control points of each."""
    s = 1 - t
    with np.errstate(invalid="ignore", over="ignore"):  # of keys that are not finite
        if is_linear:
            return s * b[0] + t * b[3]
        at = s**3 * b[0] + 3 * s * s * t * b[1]
        at += 3 * s * t * t * b[2] + t**3 * b[3]
        return at


def _goes_on(keys: Keys, pair: int) -> bool:
    """Whether the curve of this key has a pair after it."""
    end = keys.offsets[np.searchsorted(keys.offsets, pair, "right")]
    rest = keys.positions[pair + 1 : end]
    return bool((rest[1:] != rest[:-1]).any())


def _bezier(keys: Keys, pairs: np.ndarray) -> list[np.ndarray]:
    """Four (p, 4) control points, position and radius, of the Catmull-Rom spline from each key to
    the next; at its ends a curve's first and last key count twice.
    """
    curve = np.searchsorted(keys.offsets, pairs, "right") - 1
    rows = (
        np.maximum(pairs - 1, keys.offsets[curve]),
        pairs,
        pairs + 1,
        np.minimum(pairs + 2, keys.offsets[curve + 1] - 1),
    )
    before, a, b, after = (
        np.column_stack([keys.positions[row], keys.radii[row]]).astype(np.float64) for row in rows
    )
    before = np.where(np.isfinite(before).all(1)[:, None], before, a)
    after = np.where(np.isfinite(after).all(1)[:, None], after, b)
    with np.errstate(invalid="ignore", over="ignore"):
        return [a, a + (b - before) / 6, b - (after - a) / 6, b]


def _pieces(b: list[np.ndarray]) -> np.ndarray:
    """(p,) how many segments stand for each part of the spline. A chord of a n-th of it is off by
    at most |p''| / 8 n²; what of p'' lies along the chord bends nothing.
    """
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        chord = b[3] - b[0]
        chord = chord / np.sqrt((chord**2).sum(1))[:, None]
        bend = np.zeros(len(chord))
        for second in (b[0] - 2 * b[1] + b[2], b[1] - 2 * b[2] + b[3]):
            across = second - (second * chord).sum(1)[:, None] * chord
            bend = np.maximum(bend, 6 * np.sqrt((across**2).sum(1)))
        radius = np.maximum(b[0][:, 3], b[3][:, 3])
        length = np.sqrt(((b[3] - b[0])[:, :3] ** 2).sum(1))
        count = np.maximum(np.sqrt(bend / (8 * NEAR * radius)), bend / (TURN * length))
    return np.ceil(np.clip(np.nan_to_num(count, nan=1.0) - 1e-3, 1, MOST)).astype(np.intp)


# --- what materials read
# --------------------------------------------------------------------------------------------------


def read_strand_attributes(
    data: Any,
    thing: Any,
    source: StrandSource,
    required: RequiredAttributes,
    report: Report,
    render: bool,
) -> None:
    """Add what `required` names and `source` lacks. Names that there are not are left out: they
    read as 0. data: of the evaluated object `thing`.
    """
    for name in sorted(required.uv_maps - source.uv_maps.keys()):
        values = _emitter_values(thing, name, render) if source.particles else _curve_uv(data, name)
        if values is not None:
            own, rows = values
            found = _per_curve(source, own, sound(rows, own, thing.name, report))
            source.uv_maps = (
                {**source.uv_maps, name: found} if name else {name: found, **source.uv_maps}
            )
    for name in sorted(required.attributes - source.attributes.keys()):
        attribute = _attribute(data, thing, source, name, report, render)
        if attribute is not None:
            source.attributes[name] = attribute


def _per_curve(source: StrandSource, name: str, rows: np.ndarray) -> Attribute:
    return Attribute(name, FACE, _sound(rows[source.curve_of_segment]))


def _sound(values: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        values = values.astype(np.float32)
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)


def _attribute(
    data: Any, thing: Any, source: StrandSource, name: str, report: Report, render: bool
) -> Attribute | None:
    if name in _TOLD:
        return Attribute(name, POINT, _sound(_TOLD[name](source)))
    if name == GENERATED:
        return _per_curve(source, name, _generated(data, source))
    if name.startswith("("):
        plain = name.removeprefix(GREY)
        if plain == name:
            return None
    plain, grey = name.removeprefix(GREY), name.startswith(GREY)
    if source.particles:
        found = _emitter_colors(thing, plain, render)
        if found is None:
            report.note(
                "Hair reads colours on corners of its emitter alone, by bytes: others count as 0 "
                "in {}",
                thing.name,
            )
            return None
        found = sound(found, plain, thing.name, report)
        return _per_curve(source, name, values_as_color(found, grey))
    attribute = data.attributes.get(plain) if plain != ACTIVE_COLOR else None
    values = values_of(attribute) if attribute is not None else None
    if values is None:
        return None
    values = values_as_color(sound(values, plain, data.name, report), grey)
    if attribute.domain == "CURVE":
        return _per_curve(source, name, values)
    return Attribute(name, POINT, _sound(_along(source, values)))


def _along(source: StrandSource, values: np.ndarray) -> np.ndarray:
    """(v, c) of the keys' (k, c), mixed."""
    share = source.share[:, None]
    return (1 - share) * values[source.key] + share * values[source.key + 1]


def _hair_values(source: StrandSource) -> np.ndarray:
    """(v, 4): how far along, the strand's length, its random number, 1."""
    along, length = source.keys.lengths
    curve = source.keys.curve[source.key]
    number = np.arange(len(length), dtype=np.uint32)
    random = random_of(number, np.zeros_like(number))
    found = np.ones((len(curve), 4), np.float32)
    found[:, 0] = _along(source, along[:, None])[:, 0]
    found[:, 1], found[:, 2] = length[curve], random[curve]
    return found


def fibre_values(strands: Strands) -> np.ndarray:
    """(v, 4) float64: the unit tangent, and the thickness. At a joint the mean direction of
    both.
    """
    first = strands.starts.astype(np.intp)
    x = strands.vertices.astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        d = x[first + 1] - x[first]
        d /= np.sqrt((d * d).sum(1))[:, None]
        d = np.nan_to_num(d)
        tangent = np.zeros_like(x)
        tangent[first] += d
        tangent[first + 1] += d
        tangent /= np.maximum(np.sqrt((tangent * tangent).sum(1)), 1e-30)[:, None]
    return np.column_stack([tangent, 2.0 * strands.radii.astype(np.float64)])


_TOLD: dict[str, Callable[[StrandSource], np.ndarray]] = {
    HAIR: _hair_values,
    FIBRE: lambda source: fibre_values(source.strands),
    ENCLOSED: lambda source: light_between(source.strands),
}


def _generated(data: Any, source: StrandSource) -> np.ndarray:
    """(c, 4): where each root is in the emitter's texture space, else in the box round all keys."""
    roots = source.keys.positions[
        np.minimum(source.keys.offsets[:-1], len(source.keys.positions) - 1)
    ]
    if source.particles:
        middle, half = np.array(data.texspace_location), np.array(data.texspace_size)
    else:
        low, high = (f(source.keys.positions, axis=0) for f in (np.nanmin, np.nanmax))
        middle, half = (low + high) / 2, (high - low) / 2
    half = np.where(np.abs(half) > 0, half, 1.0)
    return np.column_stack([(roots - middle) / (2 * half) + 0.5, np.ones(len(roots))])


def _curve_uv(data: Any, name: str) -> tuple[str, np.ndarray] | None:
    """Cycles' UV map of curves: two numbers of each curve, the first such for the active one."""
    for attribute in data.attributes:
        is_map = attribute.data_type == "FLOAT2" and attribute.domain == "CURVE"
        if is_map and name in ("", attribute.name):
            return attribute.name, values_of(attribute)
    return None


def _emitter_values(thing: Any, name: str, render: bool) -> tuple[str, np.ndarray] | None:
    """(c, 2) of a UV map of the emitter where each strand has its root, and the map's name."""
    layers = thing.data.uv_layers
    active = next((k for k, layer in enumerate(layers) if layer.active_render), 0)
    number = layers.find(name) if name else active
    if not 0 <= number < len(layers):
        return None
    found = _on_emitter(thing, render, "uv_on_emitter", "uv_no", number)
    return layers[number].name, np.array(found, np.float32).reshape(-1, 2)


def _emitter_colors(thing: Any, name: str, render: bool) -> np.ndarray | None:
    """(c, 4) linear, of a colour attribute of the emitter."""
    layers = [a for a in thing.data.attributes if a.data_type == "BYTE_COLOR"]
    layers = [a.name for a in layers if a.domain == "CORNER"]
    if name == ACTIVE_COLOR and thing.data.color_attributes:
        index = thing.data.color_attributes.render_color_index
        name = thing.data.color_attributes[index].name if index >= 0 else ""
    if name not in layers:
        return None
    found = _on_emitter(thing, render, "mcol_on_emitter", "vcol_no", layers.index(name))
    stored = np.array(found, np.float64).reshape(-1, 3)
    low, high = stored / 12.92, ((np.maximum(stored, 0) + 0.055) / 1.055) ** 2.4
    linear = np.where(stored <= 0.04045, low, high)
    return np.column_stack([linear, np.ones(len(linear))]).astype(np.float32)


def _on_emitter(thing: Any, render: bool, what: str, number: str, layer: int) -> list:
    found: list = []
    for s in systems_of(thing, render):
        ask, particles = getattr(s.system, what), s.system.particles
        last = len(particles) - 1
        found += [
            tuple(
                ask(s.modifier, particle=particles[min(n, last)], particle_no=n, **{number: layer})
            )
            for n in range(s.first, s.end)
        ]
    return found
