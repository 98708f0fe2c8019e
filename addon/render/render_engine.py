"""The class that Blender calls. Every method delegates; none lets an exception out, Ctrl-C
(KeyboardInterrupt) included.

Blender saves a blank picture with exit code 0, or crashes, when an exception leaves `render()`;
`report({"ERROR"})` alone makes it write nothing and fail.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

import bpy

from ... import engine
from .. import viewport
from ..export import ExportError
from . import final, result
from .interrupts import interrupts_held
from .kept import Kept, keeps

log = logging.getLogger(__name__)


class GlintRenderEngine(bpy.types.RenderEngine):
    """Engine "GLINT". There is no `__init__`: Blender calls it twice per instance from 4.5 on."""

    bl_idname = "GLINT"
    bl_label = "Glint"
    bl_use_preview = True
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True
    bl_use_spherical_stereo = True

    _jobs: tuple[final.Job, ...] | BaseException | None = None
    _session: viewport.Session | None = None
    _kept: Kept | None = None

    def update(self, data: bpy.types.BlendData, depsgraph: bpy.types.Depsgraph) -> None:
        """Read everything here: Blender locks its data around `update()` only. An error waits for
        `render()`, which can report it.
        """
        try:
            if not keeps(self, depsgraph):
                self._forget()
            elif self._kept is None:
                self._kept = Kept()
            self._jobs = final.prepare(self, depsgraph, self._kept)
        except BaseException as error:  # noqa: BLE001 (nothing may leave; render() reports it)
            self._jobs = error
            self._forget()

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw one view layer."""
        with interrupts_held() as is_interrupted:
            # nothing but an interrupt keeps update() from leaving something
            jobs, self._jobs = self._jobs or KeyboardInterrupt(), None
            try:
                if isinstance(jobs, BaseException):
                    raise jobs
                final.run(self, jobs, is_interrupted)
                if is_interrupted():
                    raise KeyboardInterrupt
            except KeyboardInterrupt:
                self.report({"ERROR"}, "Glint was interrupted: there is no picture")
            except BaseException as error:
                log.exception("the render failed")
                self.report({"ERROR"}, _message(error))

    def update_render_passes(
        self, scene: bpy.types.Scene, renderlayer: bpy.types.ViewLayer
    ) -> None:
        result.register_passes(self, scene, renderlayer)

    def view_update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Blender's data changed, or a 3D view turned to Rendered shading."""
        self._in_view(lambda session: session.update(context, depsgraph))

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Blender wants the region drawn, and waits a little for a picture that is all but
        there.
        """
        self._in_view(lambda session: session.draw(self, context, depsgraph))

    def _forget(self) -> None:
        """The next frame begins anew."""
        kept, self._kept = self._kept, None
        if kept is not None:
            kept.close()

    def __del__(self) -> None:
        # Blender's own raises ReferenceError once its half of the engine is gone
        session = object.__getattribute__(self, "_session")
        if session is not None:
            session.close()
        kept = object.__getattribute__(self, "_kept")
        if kept is not None:
            kept.close()

    def _in_view(self, action: Callable[[viewport.Session], None]) -> None:
        try:
            self._session = self._session or viewport.Session()
            action(self._session)
        except Exception as error:
            log.exception("the viewport failed")
            self.update_stats("", _message(error))


def _message(error: BaseException) -> str:
    """One line for the user: what is wrong with the scene, or which fault of Glint's it is."""
    text = " ".join(str(error).split())
    if isinstance(error, (engine.SceneError, ExportError)):
        return f"Glint cannot render this scene: {text}"
    if isinstance(error, RuntimeError) and text == "can't start new thread":
        text, error = engine.NO_THREAD, MemoryError()
    if isinstance(error, MemoryError):
        remedy = (
            "" if ": " in text else "; use fewer triangles, smaller images or a smaller picture"
        )
        return f"Glint ran out of memory: {text}{remedy}"
    return f"Glint failed ({type(error).__name__}): {text}. The traceback is in the log"


_register, _unregister = bpy.utils.register_classes_factory((GlintRenderEngine,))


def register() -> None:
    _register()
    viewport.register()


def unregister() -> None:
    viewport.unregister()
    _unregister()
