"""Everything that Blender calls, shows and stores."""

from __future__ import annotations

_MODULES = (
    "ui.properties",
    "ui.former_node",
    "ui.former_settings",
    "ui.node_menu",
    "render.render_engine",
    "ui.presets",
    "ui.panels",
    "ui.sphere",
)


def register() -> None:
    """Make the engine, its settings, its node and its panels known to Blender."""
    for module in _modules():
        module.register()


def unregister() -> None:
    """Undo `register`, in reverse order."""
    for module in reversed(_modules()):
        module.unregister()


def _modules() -> list:
    from importlib import import_module

    return [import_module(f".{name}", __package__) for name in _MODULES]
