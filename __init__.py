"""Glint: a noise-free, repeatable CPU render engine for Blender."""


def register() -> None:
    """Called by Blender when the extension is enabled."""
    for module in _modules():
        module.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    for module in reversed(_modules()):
        module.unregister()


def _modules() -> list:
    """All that have something to make known to Blender."""
    from importlib import import_module

    from . import addon, operators

    return [
        import_module(f"{package.__name__}.{name}")
        for package in (addon, operators)
        for name in package.MODULES
    ]
