"""What materials read of strands: attributes of curves, and of particle hair its emitter's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ....engine.scene import FACE, POINT, Attribute, Strands
from ..materials.required import RequiredAttributes
from ..report import Report
from ..shader_nodes.inputs import ACTIVE_COLOR
from ..shader_nodes.reader import FIBRE, GENERATED, HAIR, LACKS
from .hashing import random_of
from .meshes import GREY, sound, values_as_color, values_of
from .strands import StrandSource, systems_of


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
        values = values.astype(np.float32, order="C")
    return np.nan_to_num(values, copy=False, nan=0.0, posinf=0.0, neginf=0.0)


def _attribute(
    data: Any, thing: Any, source: StrandSource, name: str, report: Report, render: bool
) -> Attribute | None:
    if name in _TOLD:
        return Attribute(name, POINT, _sound(_TOLD[name](source)))
    if name == GENERATED:
        return _generated(data, source)
    if name.startswith(LACKS):
        plain = name.removeprefix(LACKS)
        lacks = _attribute(data, thing, source, plain, report, render) is None
        ones = np.ones((len(source.curve_of_segment), 4), np.float32)
        return Attribute(name, FACE, ones) if lacks else None
    if name.startswith("(") and not name.startswith(GREY):
        return None
    return _named(data, thing, source, name, report, render)


def _named(
    data: Any, thing: Any, source: StrandSource, name: str, report: Report, render: bool
) -> Attribute | None:
    """Of Blender's own attributes."""
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
    both. Column by column, as splines are.
    """
    first = strands.starts.astype(np.intp)
    x = np.ascontiguousarray(strands.vertices.T, np.float64)
    found = np.zeros((4, x.shape[1]))
    tangent, found[3] = found[:3], 2.0 * strands.radii.astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        d = x.take(first + 1, 1) - x.take(first, 1)
        d /= np.sqrt((d * d).sum(0))
        np.nan_to_num(d, copy=False)
        for column, along in zip(tangent, d, strict=True):
            column[first] += along
            column[first + 1] += along
        tangent /= np.maximum(np.sqrt((tangent * tangent).sum(0)), 1e-30)
    return found.T


_TOLD: dict[str, Callable[[StrandSource], np.ndarray]] = {
    HAIR: _hair_values,
    FIBRE: lambda source: fibre_values(source.strands),
}


def _generated(data: Any, source: StrandSource) -> Attribute:
    """Where each root is in the emitter's texture space; of a Curves object places in it, as in
    Cycles.
    """
    places, starts = source.keys.positions, source.keys.offsets[:-1]
    if not source.particles:
        return Attribute(GENERATED, POINT, _sound(_along(source, values_as_color(places, False))))
    roots = places[np.minimum(starts, len(places) - 1)]
    middle, half = np.array(data.texspace_location), np.array(data.texspace_size)
    half = np.where(np.abs(half) > 0, half, 1.0)
    found = np.column_stack([(roots - middle) / (2 * half) + 0.5, np.ones(len(roots))])
    return _per_curve(source, GENERATED, found)


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
