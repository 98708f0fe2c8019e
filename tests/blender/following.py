"""A LiveExport that follows Blender's updates, and whether two scenes are the same."""

import copy
import dataclasses

import bpy
import numpy as np

from export_support import Shader, link, mesh_object, quad, scene, use_nodes  # noqa: F401
from glint.addon.export import export_scene
from glint.addon.export.sync.incremental import LiveExport
from glint.engine.scene import Camera, SceneDelta

CAMERA = Camera("PERSPECTIVE", np.eye(4)[:3], (-1, 1, -1, 1), (4, 4))


class Follower:
    """A LiveExport that is told every update of the depsgraph, as in a viewport."""

    def __init__(self, passes=frozenset()) -> None:
        self.live, self.passes, self.scene, self.reads = LiveExport(), passes, None, 0
        self.heard: list[tuple] = []

    def __enter__(self):
        bpy.app.handlers.depsgraph_update_post.append(self._update)
        bpy.app.handlers.frame_change_post.append(self._update)
        self._update(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
        return self

    def __exit__(self, *_):
        bpy.app.handlers.depsgraph_update_post.remove(self._update)
        bpy.app.handlers.frame_change_post.remove(self._update)

    def _update(self, _scene, depsgraph):
        self.heard = [(update.id.id_type, update.id.name) for update in depsgraph.updates]
        before = copy.deepcopy(self.scene)
        known = self.scene
        self.scene = self.live.update(depsgraph, CAMERA, passes=self.passes)
        if known is not None:
            delta = self.live.delta(passes=self.passes)
            assert delta == SceneDelta.between(known, self.scene, delta)
            named_alone(delta, before, self.scene)

    def check(self):
        bpy.context.view_layer.update()
        full = export_scene(bpy.context.evaluated_depsgraph_get(), passes=self.passes)
        assert same(self.scene, dataclasses.replace(full.scene, camera=CAMERA), "scene")
        assert set(self.live.notes(passes=self.passes)) == {
            note for note in full.notes if "camera" not in note
        }


def named_alone(delta, before, after):
    """Values that the delta does not name are to the last bit what they were.

    before: a copy, in which nothing follows what is written into the arrays of the scene.
    """
    for name in ("geometries", "instances", "materials", "textures", "lights"):
        named = getattr(delta, name)
        pairs = zip(getattr(before, name), getattr(after, name), strict=named is not None)
        for k, (one, two) in enumerate(pairs if named is not None else ()):
            assert k in named or same(one, two, f"{name}[{k}]")
    assert delta.world or same(before.world, after.world, "world")


def same(one, two, where):
    """Equal to the last bit; says where not."""
    assert type(one) is type(two), f"{where}: {type(one)} and {type(two)}"
    if isinstance(one, np.ndarray):
        assert one.dtype == two.dtype and one.shape == two.shape, where
        assert one.tobytes() == two.tobytes(), where
    elif isinstance(one, tuple):
        assert len(one) == len(two), f"{where}: {len(one)} and {len(two)}"
        assert all(
            same(a, b, f"{where}[{k}]") for k, (a, b) in enumerate(zip(one, two, strict=True))
        )
    elif isinstance(one, dict):
        same(tuple(one), tuple(two), where)
        same(tuple(one.values()), tuple(two.values()), where)
    elif dataclasses.is_dataclass(one):
        for name in (field.name for field in dataclasses.fields(one)):
            same(getattr(one, name), getattr(two, name), f"{where}.{name}")
    else:
        assert one == two or (one != one and two != two), f"{where}: {one!r} and {two!r}"
    return True
