"""Everything that Blender calls, shows and stores."""

from __future__ import annotations

MODULES = (
    "ui.properties",
    "ui.former_node",
    "ui.former_settings",
    "ui.node_menu",
    "render.last_picture",
    "render.statistics",
    "render.render_engine",
    "ui.presets",
    "ui.panels",
    "ui.sphere",
)
"""The engine, its settings, its node and its panels, in the order in which they are registered."""
