"""What shader nodes read of objects: their colour and index, and properties by name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from .instances import random_number
from .shader_nodes.objects import (
    COLOR,
    INDEX,
    INSTANCER,
    OF_EACH,
    RANDOM,
    SPACE_SCALE,
    SPACE_START,
    VIEW_LAYER,
)

Value = tuple[float, float, float, float]
NOTHING: Value = (0.0, 0.0, 0.0, 0.0)
_LARGEST = float(np.finfo(np.float32).max)


def value_of(name: str, instance: Any, view_layer: Any, scene: Any) -> Value:
    """What goes by a name of `shader_nodes.objects` at an instance of the depsgraph, finite or
    not.
    """
    if name == COLOR:
        # The iteration lends what is instanced its instancer's colour, but Python may be handed the
        # object that stands behind the copy.
        return tuple((instance.parent if instance.is_instance else instance.object).color)
    if name == RANDOM:
        return (random_number(instance.object.name),) * 4
    if name in OF_EACH:
        return NOTHING
    if name == INDEX:
        return (float(instance.object.pass_index),) * 4
    if name in (SPACE_SCALE, SPACE_START):
        return _of_texture_space(instance.object.data)[name == SPACE_START]
    kind, _, plain = name.partition(":")
    if kind + ":" == VIEW_LAYER:
        return _found((view_layer, scene, scene.world), plain)
    return _found(_owners(instance, kind + ":" == INSTANCER), plain)


def _of_texture_space(data: Any) -> tuple[Value, Value]:
    """Scale and start of the generated coordinates; those of a cube of 2 where there are none."""
    middle = getattr(data, "texspace_location", (0.0, 0.0, 0.0))
    half = [x if abs(x) > 0 else 1.0 for x in getattr(data, "texspace_size", (1.0, 1.0, 1.0))]
    scale = tuple(0.5 / x for x in half)
    return (*scale, 0.0), (*(0.5 - x * k for x, k in zip(middle, scale, strict=True)), 0.0)


def _owners(instance: Any, of_instancer: bool) -> Iterator[Any]:
    """What may have a property, in the order in which Blender looks."""
    if of_instancer and instance.is_instance:
        if instance.particle_system is not None:
            yield instance.particle_system.settings
        yield instance.parent
    yield from (instance.object, instance.object.data)


def _found(owners: Iterable[Any], name: str) -> Value:
    """The first number or colour of that name; zeros where none has it."""
    for owner in owners:
        value = _as_value(_read(owner, name)) if owner is not None else None
        if value is not None:
            return value
    return NOTHING


def _read(owner: Any, name: str) -> Any:
    """A custom property, or one of Blender's own by its path; None where there is neither."""
    if name in owner:
        return owner[name]
    try:
        return owner.path_resolve(name)
    except ValueError:
        return None


def _as_value(found: Any) -> Value | None:
    """A number as a grey, up to four as a colour; None for anything else."""
    if isinstance(found, (bool, int, float)):
        return (float(found),) * 3 + (1.0,)
    try:
        numbers = [float(x) for x in found] if not isinstance(found, str) else []
    except (TypeError, ValueError):
        return None
    if not 0 < len(numbers) <= len(NOTHING):
        return None
    return tuple(numbers + [0.0, 0.0, 0.0, 1.0][len(numbers) :])


def sound(numbers: Iterable[float]) -> Value:
    """With 0 for what single precision does not hold."""
    return tuple(x if abs(x) <= _LARGEST else 0.0 for x in numbers)
