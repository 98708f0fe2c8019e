"""Scenes in which nothing shines."""

from __future__ import annotations

from ... import engine


def darkness(scene: engine.Scene) -> tuple[str, ...]:
    """A note when nothing in the scene sheds or shows light."""
    glows = any(lobe.kind == "EMISSION" for material in scene.materials for lobe in material.lobes)
    if scene.world.medium is not None and scene.world.medium.emits:
        return ()
    glows = glows or scene.has_glowing_media
    if scene.lights or glows or any(scene.world.ambient) or any(scene.world.background):
        return ()
    return (
        "The scene has no light and a black world: the picture is black; add a light or give the "
        "world a colour",
    )
