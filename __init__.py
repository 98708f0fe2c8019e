"""Glint: a noise-free, repeatable CPU render engine for Blender."""


def register() -> None:
    """Called by Blender when the extension is enabled."""
    from . import addon, operators

    addon.register()
    operators.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    from . import addon, operators

    operators.unregister()
    addon.unregister()
