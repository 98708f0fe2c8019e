"""The core for `engine.live`: scenes that outlive a render, so that their trees need not be made anew."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from . import core_types, native
from .core_types import DONE, FAILED
from .film import Film
from .packing import Packed, pack_camera, pack_scene, pack_settings
from .scene import Instances, Scene
from .settings import Settings
from .view_axes import ViewAxes, narrow_view_axes

_POLL_MILLISECONDS = 4
"""How soon a task makes room for the next."""


@dataclass(eq=False)
class _Held:
    """A scene in the core.

    packed: the arrays that it borrows.  eye: (3,) where the camera stood relative to which its trees are made, world.
    """

    scene: Scene
    axes: ViewAxes | None
    packed: Packed
    handle: int
    eye: np.ndarray


class NativeLive:
    """One scene in the core, and renders of it. For one thread."""

    def __init__(self) -> None:
        self._core = native.library()
        self._held: _Held | None = None

    def render(
        self, scene: Scene, settings: Settings, exact: bool, should_stop: Callable[[], bool], on_film: Callable[[Film, bool], None]
    ) -> None:
        """Draw `scene`; `on_film` gets every wave that there is time to read, and True with the last. Raises as `native.render_native`.

        exact: the bits of `native.render_native`. Else trees may be those of another place of the camera.
        """
        held = self._hold(scene, exact)
        plan = pack_settings(scene, settings, hold_waves=False)
        with native._render(self._core, held.handle, plan.data) as job:
            self._run(job, native._Render(self._core, job, scene, settings, held.axes), should_stop, on_film)

    def close(self) -> None:
        """Give the scene back."""
        held, self._held = self._held, None
        if held is not None:
            self._core.glint_scene_destroy(held.handle)

    # --- scenes -------------------------------------------------------------------------------------------------------------------

    def _hold(self, scene: Scene, exact: bool) -> _Held:
        """The scene in the core: the one that is there, one like it, or a new one in its place."""
        before = self._held
        if before is not None and before.scene is scene and (not exact or _stands_at(scene, before.eye)):
            return before
        alike = self._alike(scene, exact)
        if alike is None:
            self.close()
            alike = self._new(scene)
        else:
            self.close()
        self._held = alike
        return alike

    def _new(self, scene: Scene) -> _Held:
        axes = narrow_view_axes(scene.camera)
        packed = pack_scene(axes.scene(scene) if axes else scene)
        return _Held(scene, axes, packed, self._create("glint_scene_create", packed), _eye(scene))

    def _alike(self, scene: Scene, exact: bool) -> _Held | None:
        """A scene with the trees of the one that is there; None where that does not serve."""
        before = self._held
        if before is None or before.axes is not None or (exact and not _stands_at(scene, before.eye)):
            return None
        if narrow_view_axes(scene.camera) is not None or not same_placements(scene, before.scene):
            return None
        packed = _with_camera(before.packed, scene) if _differ_in_camera(scene, before.scene) else pack_scene(scene)
        error = ctypes.create_string_buffer(native.ERROR_BYTES)
        handle = self._core.glint_scene_create_like(before.handle, ctypes.byref(packed.data), error, native.ERROR_BYTES)
        # Refused, for example for a camera that went far away: a scene of its own will tell if anything else is wrong.
        return _Held(scene, None, packed, handle, before.eye) if handle else None

    def _create(self, name: str, packed: Packed) -> int:
        error = ctypes.create_string_buffer(native.ERROR_BYTES)
        handle = getattr(self._core, name)(ctypes.byref(packed.data), error, native.ERROR_BYTES)
        if not handle:
            raise native._refusal(error.value.decode(errors="replace"), packed.data)
        return handle

    # --- renders ------------------------------------------------------------------------------------------------------------------

    def _run(self, job: int, render: native._Render, should_stop: Callable[[], bool], on_film: Callable[[Film, bool], None]) -> None:
        film, cancelled = None, False
        while True:
            progress = self._core.glint_render_wait(job, _POLL_MILLISECONDS)
            if progress.samples > (film.samples if film else 0):
                film = render._film(progress.samples, complete=True)
                on_film(film, progress.state == DONE)
            elif progress.state == DONE:
                on_film(film, True)
            if progress.state == FAILED:
                render._result(progress)
            if progress.state >= DONE:
                return
            if not cancelled and should_stop():
                self._core.glint_render_cancel(job)
                cancelled = True


def same_placements(a: Scene, b: Scene) -> bool:
    """Whether two scenes need the same trees: the very same geometries at the same places, seen by the same rays."""
    if len(a.geometries) != len(b.geometries) or any(x is not y for x, y in zip(a.geometries, b.geometries, strict=True)):
        return False
    if a.instances is b.instances:
        return True
    return len(a.instances) == len(b.instances) and all(map(_same_block, a.instances, b.instances))


def _same_block(a: Instances, b: Instances) -> bool:
    if a is b:
        return True
    flags = ("geometry", "visible_camera", "visible_mirror", "visible_shadow")
    same = all(getattr(a, name) == getattr(b, name) for name in flags)
    return same and np.array_equal(a.world_from_object, b.world_from_object)


def _differ_in_camera(a: Scene, b: Scene) -> bool:
    """Whether nothing but the camera may differ."""
    return all(getattr(a, field.name) is getattr(b, field.name) for field in fields(Scene) if field.name != "camera")


def _with_camera(packed: Packed, scene: Scene) -> Packed:
    data = core_types.SceneData.from_buffer_copy(packed.data)
    data.camera = pack_camera(scene.camera)
    return Packed(data, packed.lent)


def _eye(scene: Scene) -> np.ndarray:
    return np.array(scene.camera.world_from_camera, np.float64)[:, 3]


def _stands_at(scene: Scene, eye: np.ndarray) -> bool:
    return bool((_eye(scene) == eye).all())
