"""What changed from one scene to the next.

Scenes share what they have in common: a value that is the very same has not changed, which takes 20
ns to see. Who makes values anew that may be equal to those before settles them once
(`settled`) and passes the delta on with the scene; nobody after that looks into any.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from itertools import compress, count
from operator import attrgetter, is_, is_not
from typing import Any

import numpy as np

from .model import Scene
from .model_geometry import Instances

Numbers = tuple[int, ...] | None

_ARRAYS = ("world_from_object", "values", "motion")
_OTHERS = tuple(f.name for f in fields(Instances) if f.name not in _ARRAYS)
_others_of = attrgetter(*_OTHERS)
_PLACES = frozenset(
    {
        "geometry",
        "world_from_object",
        "motion",
        "visible_camera",
        "visible_mirror",
        "visible_shadow",
        "visible_transmission",
        "visible_diffuse",
        "geometry_offset",
    }
)
"""Fields of instances by which rays meet other things, or elsewhere."""


@dataclass(frozen=True)
class SceneDelta:
    """How a scene differs from another.

    geometries, instances, materials, textures, lights: numbers of those that are others, ascending;
    None where there are more or fewer than before, so that any may be.  Geometries and textures
    that were made anew count as others.  how: names of the fields in which those instances differ,
    taken together.  camera, world: whether it is another. rest: whether names of AOVs or light
    groups are, or the neighbours.
    """

    geometries: Numbers = ()
    instances: Numbers = ()
    materials: Numbers = ()
    textures: Numbers = ()
    lights: Numbers = ()
    how: frozenset[str] = frozenset()
    camera: bool = False
    world: bool = False
    rest: bool = False
    _ends: tuple = field(default=(None, None), compare=False, repr=False)

    @classmethod
    def between(cls, old: Scene, new: Scene, known: SceneDelta | None = None) -> SceneDelta:
        """All that `new` has otherwise than `old`, each value compared to the last bit unless it is
        the very same.

        known: a delta that stands for what lies between the very tables that it is of; of other
        scenes it says nothing. Only instances are so many that it counts.
        """
        ends = old.instances, new.instances
        if known is not None and all(map(is_, known._ends, ends)):
            instances, how = known.instances, known.how
        else:
            instances, how = _other_instances(*ends)
        return cls(
            differing(old.geometries, new.geometries),
            instances,
            differing(old.materials, new.materials, same),
            differing(old.textures, new.textures),
            differing(old.lights, new.lights, same),
            how,
            not same(old.camera, new.camera),
            not same(old.world, new.world),
            old.neighbours is not new.neighbours
            or (old.aovs, old.light_groups) != (new.aovs, new.light_groups),
            ends,
        )

    @property
    def keeps_content(self) -> bool:
        """Whether nothing but the camera is another."""
        return replace(self, camera=False) == SceneDelta()

    @property
    def keeps_places(self) -> bool:
        """Whether rays of the same camera meet the same geometries at the same places."""
        return self.geometries == () and self.instances is not None and self.how.isdisjoint(_PLACES)


def settled(old: Scene, new: Scene) -> tuple[Scene, SceneDelta]:
    """`new` with the very values of `old` where they are the same, and how it differs."""
    delta = SceneDelta.between(old, new)
    tables: dict[str, Any] = {
        name: _settled(getattr(old, name), getattr(new, name), getattr(delta, name))
        for name in ("geometries", "instances", "materials", "textures", "lights")
    }
    world = new.world if delta.world else old.world
    scene = replace(new, **tables, world=world)
    return scene, replace(delta, _ends=(old.instances, scene.instances))


def differing(old: tuple, new: tuple, are_same: Callable[[Any, Any], bool] = is_) -> Numbers:
    """Numbers of the values of `new` that are others than those in their places; None where the
    tables are not of one length. are_same: of two values that are not the very same.
    """
    if old is new:
        return ()
    if len(old) != len(new):
        return None
    made_anew = compress(count(), map(is_not, old, new))
    return tuple(k for k in made_anew if not are_same(old[k], new[k]))


def same(a: Any, b: Any) -> bool:
    """Whether two values, of whatever they are made, are equal to the last bit."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, float):
        return struct.pack("d", a) == struct.pack("d", b)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, Mapping):
        return same(tuple(a.items()), tuple(b.items()))
    if is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    return bool(a == b)


def _other_instances(
    old: tuple[Instances, ...], new: tuple[Instances, ...]
) -> tuple[Numbers, frozenset[str]]:
    """As `SceneDelta` has them."""
    how: set[str] = set()

    def are_same(a: Instances, b: Instances) -> bool:
        plain = () if _others_of(a) == _others_of(b) else _OTHERS
        differing = [n for n in (*_ARRAYS, *plain) if not same(getattr(a, n), getattr(b, n))]
        how.update(differing)
        return not differing

    return differing(old, new, are_same), frozenset(how)


def _settled(old: tuple, new: tuple, changed: Numbers) -> tuple:
    if changed is None:
        return new
    if not changed:
        return old
    values = list(old)
    for k in changed:
        values[k] = new[k]
    return tuple(values)
