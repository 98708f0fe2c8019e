"""What changed from one scene to the next: the delta names all of it, and drawing by it gives the
bits of a render.
"""

import copy
import random
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from glint.engine import KeptRender, available_backends, render
from glint.engine.scene import Instances, Mesh, Scene, SceneDelta, World, settled
from test_live_edits import EDITS, SETTINGS, compute, first_scene

TABLES = ("geometries", "instances", "materials", "textures", "lights")
BY_IDENTITY = ("geometries", "textures")
EDITED = st.lists(
    st.tuples(st.sampled_from([*EDITS, compute]), st.integers(0, 1 << 20)), max_size=3
)
made_up = settings(
    max_examples=60,
    deadline=None,
    database=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)


def bits(value):
    """Equal for values that are equal to the last bit."""
    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if isinstance(value, float):
        return np.float64(value).tobytes()
    if isinstance(value, tuple):
        return tuple(map(bits, value))
    if isinstance(value, dict):
        return tuple((name, bits(one)) for name, one in value.items())
    if is_dataclass(value):
        return type(value).__name__, *(bits(getattr(value, f.name)) for f in fields(value))
    return value


def edited(scene, edits):
    for edit, seed in edits:
        scene = edit(scene, random.Random(seed))
    return scene


def assert_names_all(delta, old, new):
    """Each value and field that is another, and no other ones."""
    for name in TABLES:
        before, after, named = getattr(old, name), getattr(new, name), getattr(delta, name)
        if len(before) != len(after):
            assert named is None, name
            continue
        pairs = list(zip(before, after, strict=True))
        if name in BY_IDENTITY:
            truth = [k for k, (a, b) in enumerate(pairs) if a is not b]
        else:
            truth = [k for k, (a, b) in enumerate(pairs) if bits(a) != bits(b)]
        assert named == tuple(truth), name
    how = set()
    for k in delta.instances or ():
        a, b = old.instances[k], new.instances[k]
        how |= {
            f.name
            for f in fields(Instances)
            if bits(getattr(a, f.name)) != bits(getattr(b, f.name))
        }
    assert delta.how == how
    assert delta.camera == (bits(old.camera) != bits(new.camera))
    assert delta.world == (bits(old.world) != bits(new.world))


def made_anew(scene):
    """The same of other values, but for what is known by identity."""
    kept = {name: getattr(scene, name) for name in BY_IDENTITY}
    memo = {id(one): one for values in kept.values() for one in values}
    return replace(copy.deepcopy(scene, memo), **kept)


@made_up
@given(EDITED, st.booleans())
def test_it_names_what_changed_and_nothing_else(edits, anew):
    old = first_scene(random.Random(0))
    new = edited(old, edits)
    assert_names_all(SceneDelta.between(old, made_anew(new) if anew else new), old, new)


@made_up
@given(EDITED, EDITED)
def test_settled_scenes_share_all_that_is_the_same(before, edits):
    old = edited(first_scene(random.Random(0)), before)
    new = made_anew(edited(old, edits))
    found, delta = settled(old, new)
    assert bits(found) == bits(new) and delta == SceneDelta.between(old, new)
    for name in TABLES:
        named, values = getattr(delta, name), getattr(old, name)
        for k, value in enumerate(getattr(found, name) if named is not None else ()):
            assert (value is values[k]) == (k not in named), f"{name} {k}"
    assert (found.world is old.world) == (not delta.world)
    assert delta == SceneDelta.between(old, found, delta)


def test_a_sign_of_zero_and_values_of_instances_count():
    mesh = Mesh("Mesh", np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32))
    color = {"color": np.ones((1, 4), np.float32)}
    group = Instances("Mesh", 0, np.eye(4)[None, :3], (), values=color)
    old = Scene(None, (mesh,), (group,), world=World((0.0, 1.0, 1.0)))
    equal = replace(group, values={"color": np.ones((1, 4), np.float32)})
    assert SceneDelta.between(old, replace(old, instances=(equal,))) == SceneDelta()
    other = replace(group, values={"color": np.zeros((1, 4), np.float32)})
    found = SceneDelta.between(old, replace(old, instances=(other,)))
    assert found == SceneDelta(instances=(0,), how=frozenset({"values"})) and found.keeps_places
    assert SceneDelta.between(old, replace(old, world=World((-0.0, 1.0, 1.0)))).world


def test_places():
    """Other materials, lights and worlds are no other places; other matrices, geometries and
    visibilities are.
    """
    mesh = Mesh("Mesh", np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32))
    group = Instances("Mesh", 0, np.eye(4)[None, :3], ())
    one = Scene(None, (mesh,), (group,))

    def keeps_places(**other):
        return SceneDelta.between(one, replace(one, **other)).keeps_places

    assert keeps_places(world=World((1, 1, 1)), instances=(replace(group, materials=(1,)),))
    others = [{"world_from_object": 2 * group.world_from_object}, {"visible_shadow": False}]
    assert not any(keeps_places(instances=(replace(group, **other),)) for other in others)
    assert not keeps_places(geometries=(replace(mesh),)) and not keeps_places(instances=())


@pytest.mark.skipif("NATIVE" not in available_backends(), reason="no core here")
@settings(made_up, max_examples=25)
@given(st.lists(st.tuples(EDITED, st.booleans()), min_size=2, max_size=4), st.booleans())
def test_drawing_by_the_delta_gives_the_bits_of_a_render(steps, sees_all):
    """Also where the tracer did not see every scene, so that the delta is of another than it drew
    last.
    """
    scene, kept = first_scene(random.Random(0)), KeptRender()
    try:
        kept.render(scene, SETTINGS)
        for edits, is_drawn in steps:
            scene, delta = settled(scene, made_anew(edited(scene, edits)))
            if sees_all or is_drawn:
                film, truth = kept.render(scene, SETTINGS, delta=delta), render(scene, SETTINGS)
                for name in truth.passes:
                    assert film.passes[name].tobytes() == truth.passes[name].tobytes(), name
    finally:
        kept.close()
