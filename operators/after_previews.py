"""Operators that change the engine begin when no preview of a material is drawn."""

from __future__ import annotations

import bpy


def previews_run() -> bool:
    """Whether Blender draws previews at the moment."""
    return bpy.app.is_job_running("RENDER_PREVIEW")


class AfterPreviews:
    """An operator that changes the engine. Blender ends previews of materials then and waits for
    their threads; where these wait for Python, which runs the operator, neither would go on. So
    the operator waits until there are none.
    """

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not previews_run():
            return self.execute(context)
        manager = context.window_manager
        self.timer = manager.event_timer_add(0.05, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if previews_run():
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        return self.execute(context) if self.poll(context) else {"CANCELLED"}
