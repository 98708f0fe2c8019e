"""What a user does with Glint beyond F12."""

from __future__ import annotations

from types import ModuleType


def register() -> None:
    """Make the operators and the command line known to Blender."""
    for module in _modules():
        module.register()


def unregister() -> None:
    """Undo `register`."""
    for module in reversed(_modules()):
        module.unregister()


def _modules() -> list[ModuleType]:
    from . import (
        add_demo_scene,
        command_line,
        compare_cycles,
        explain_pixel,
        measure_scene,
        switch_engine,
    )

    return [
        add_demo_scene,
        switch_engine,
        measure_scene,
        compare_cycles,
        explain_pixel,
        command_line,
    ]
