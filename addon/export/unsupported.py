"""Settings by which Cycles draws something else and Glint does not: told by name, with what to do
instead. What decides only noise or time is not told.
"""

from __future__ import annotations

from typing import Any

from .report import Report

LEAST_BOUNCES = 4
"""Light that may bounce less than this is told: it is the default of Diffuse Bounces."""

ROLLING_SHUTTER = (
    "Rolling Shutter is not rendered: all rows of the picture are taken at once; set it to None"
)
_CAUSTICS = "Shadow caustics are not rendered: {} cast none; light passes thin glass straight on"


def note_light(name: str, data: Any, report: Report) -> None:
    """A light's own settings. data: evaluated."""
    if getattr(data.cycles, "max_bounces", LEAST_BOUNCES) < LEAST_BOUNCES:
        report.note(
            "Max Bounces of lights is not rendered: {} bounce as often as all light; set Diffuse "
            "Bounces of the scene",
            name,
        )
    if getattr(data.cycles, "is_caustics_light", False):
        report.note(
            _CAUSTICS,
            name,
        )


def note_world(world: Any, report: Report) -> None:
    """An evaluated world's own settings."""
    own = getattr(world, "cycles", None)
    if getattr(own, "is_caustics_light", False):
        report.note(_CAUSTICS, world.name)
    if getattr(own, "max_bounces", LEAST_BOUNCES) < LEAST_BOUNCES:
        report.note(
            "Max Bounces of the world {} is not rendered: its light bounces as often as all light; "
            "set Diffuse Bounces of the scene",
            world.name,
        )


def note_object(name: str, owner: Any, report: Report) -> None:
    """What has a surface. owner: the object or its instancer."""
    if not owner.visible_volume_scatter:
        report.note(
            "Media see {} whatever its ray visibility says of Volume Scatter: turn that on, and "
            "Shadow off to keep its shadow out of them",
            name,
        )


def note_subdivision(name: str, thing: Any, report: Report) -> None:
    """Of an object, evaluated: meshes are as their modifiers leave them. A setting of the modifier
    from 5.0 on, before of the object.
    """
    own = getattr(thing, "cycles", None)
    if getattr(own, "use_adaptive_subdivision", False) or any(
        getattr(modifier, "use_adaptive_subdivision", False) for modifier in thing.modifiers
    ):
        report.note(
            "Adaptive subdivision is not rendered: {} have the levels of their modifier; raise "
            "its Levels Render",
            name,
        )


def is_corrected(material: Any) -> bool:
    """Whether Bump Map Correction is on."""
    return getattr(getattr(material, "cycles", None), "use_bump_map_correction", True)


def note_material(material: Any, kinds: set[str], is_bent: bool, report: Report) -> None:
    """kinds: of its lobes. is_bent: nodes bend its normal."""
    if is_bent and "MIRROR" in kinds and not is_corrected(material):
        report.note(
            "Bump Map Correction is not switched off for mirrors of {}: bent normals are kept from "
            "showing what is behind the surface",
            material.name,
        )


def note_scene(scene: Any, report: Report) -> None:
    """Cycles' settings of an evaluated scene."""
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return
    if cycles.film_exposure != 1.0:
        report.note("Cycles' Film Exposure is not rendered: set it in Color Management")
    if scene.render.film_transparent and cycles.film_transparent_glass:
        report.note(
            "Transparent Glass is not rendered: glass hides what is transparent behind it; use a "
            "Transparent BSDF"
        )


def rolls(scene: Any) -> bool:
    """Whether Cycles takes one row of the picture after the other."""
    cycles = getattr(scene, "cycles", None)
    return getattr(cycles, "rolling_shutter_type", "NONE") != "NONE"


def note_blur(depsgraph: Any, report: Report) -> None:
    """What blurs in Cycles where motion blur is on."""
    if rolls(depsgraph.scene_eval):
        report.note(ROLLING_SHUTTER)
    for block in depsgraph.ids:
        if block.id_type == "VOLUME" and _has_velocity(block):
            report.note(
                "Velocity grids of volumes are not read: {} do not blur; hide them in a view layer "
                "of their own, and blur that in the compositor",
                block.name,
            )


def _has_velocity(volume: Any) -> bool:
    volume.grids.load()
    named = (volume.velocity_grid, volume.velocity_x_grid)
    return any(grid.name in named for grid in volume.grids)
