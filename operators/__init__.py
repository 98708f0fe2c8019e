"""What a user does with Glint beyond F12."""

from __future__ import annotations


def register() -> None:
    """Make the operators and the command line known to Blender."""
    from . import add_demo_scene, command_line

    add_demo_scene.register()
    command_line.register()


def unregister() -> None:
    """Undo `register`."""
    from . import add_demo_scene, command_line

    command_line.unregister()
    add_demo_scene.unregister()
