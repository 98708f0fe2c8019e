"""The settings that a .blend file keeps, and how they become `engine.Settings`.

`scene.glint.final` and `scene.glint.viewport` are two of one group, so every setting exists once as
a definition. Blender reads the annotations as they are, so this module must not make them strings
(`from __future__ import annotations`).
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any
from zlib import crc32

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ... import engine
from ...engine.settings import DECLARED, OFFERED

LIGHT_GROUP = "Light Group"
"""The pass in the choice of those that Rendered shading shows."""


def _property(name: str) -> Any:
    """Blender's property of a setting, as `engine.settings` declares it."""
    declared, default = DECLARED[name], getattr(OFFERED, name)
    texts = {"name": declared.label, "description": declared.tooltip}
    if declared.choices:
        return EnumProperty(**texts, items=declared.choices, default=default)
    high = declared.high if declared.typed is None else declared.typed
    numbers = {"default": default, "min": declared.low, "max": high}
    numbers["soft_max"] = high if declared.slider is None else declared.slider
    if declared.is_whole():
        return IntProperty(**texts, **numbers)
    return FloatProperty(**texts, **numbers, precision=declared.digits)


_FALLBACK = (
    "Glint's native core cannot be used here ({}), so the NumPy tracer renders: the same picture, "
    "much slower. "
    "Install the edition of Glint for this platform, or set the tracer to Python (reference) to "
    "silence this"
)
_OWN = tuple(name for name, declared in DECLARED.items() if declared.label)
"""Settings that are properties of Glint's."""


OF_LIGHT = (
    "illumination",
    "world_light",
    "mesh_light",
    "reflections",
    "subsurface",
    "soft_light",
    "diffuse_bounces",
    "volume_bounces",
    "reflective_caustics",
    "refractive_caustics",
    "photons",
    "clamp_indirect",
)
"""What light does; the viewport takes the final render's."""
OF_SAMPLES = (
    "samples",
    "error_threshold",
    "visibility_samples",
    "light_samples",
    "lamp_shadows",
    "volume_samples",
)
OF_RAYS = ("max_bounces", "cutoff")
"""How finely to sample, and how far to follow rays: the viewport's are its own."""


ON_OR_OFF = tuple(
    name for name in _OWN if [choice[0] for choice in DECLARED[name].choices or ()] == ["ON", "OFF"]
)
"""Settings that panels show as the checkbox `use_<name>`."""


def _checkbox(name: str) -> BoolProperty:
    """A choice between On and Off, as Blender shows it; files and scripts keep the choice."""
    return BoolProperty(
        name=DECLARED[name].label,
        description=DECLARED[name].choices[0][2],
        default=getattr(OFFERED, name) == "ON",  # what Reset to Default Value writes
        get=lambda group: getattr(group, name) == "ON",
        set=lambda group, is_on: setattr(group, name, "ON" if is_on else "OFF"),
    )


class GlintRenderSettings(bpy.types.PropertyGroup):
    """How to render; the same group serves the final render and the viewport."""

    __annotations__ = {
        **{name: _property(name) for name in _OWN},
        **{f"use_{name}": _checkbox(name) for name in ON_OR_OFF},
    }


_TARGET_ITEMS = (
    ("NONE", "Off", "Samples, threshold and light samples are those below"),
    (
        "LEVELS",
        "Visible Error",
        "For pictures to look at: the error on the display that all but one of a thousand pixels "
        "stay within",
    ),
    (
        "RMSE",
        "Mean Error",
        "For pictures to calculate with: the root mean square error of linear colour, in percent "
        "of the picture's",
    ),
)


def _number(name: str) -> int:
    """What a file keeps of a choice whose place among the others changes with new ones."""
    return crc32(name.encode()) >> 1


class GlintSceneSettings(bpy.types.PropertyGroup):
    """`scene.glint`. version: `former_settings.VERSION` when the file was saved, 0 before."""

    version: IntProperty(options={"HIDDEN"})
    target: EnumProperty(
        name="Quality Target",
        description="Say how wrong the picture may be instead of how it is sampled: a short look "
        "at parts of the frame finds the samples, "
        "threshold and light samples that reach it with the fewest rays. The look takes a quarter "
        "of the time of small frames, a fiftieth of large ones. The statistics say what was "
        "reached",
        items=_TARGET_ITEMS,
    )
    target_levels: FloatProperty(
        name="Levels",
        description="Largest visible error that is good enough, of the 256 levels of a display. "
        "Choose 1 for what cannot be told apart, 4 "
        "for what hardly can, 16 for a look",
        default=4.0,
        min=0.1,
        soft_max=32.0,
        max=255.0,
        precision=1,
    )
    target_rmse: FloatProperty(
        name="Error",
        description="Root mean square error that is good enough. Choose 1 % for most pictures, 0.1 "
        "% for comparisons",
        default=1.0,
        min=0.001,
        soft_max=10.0,
        max=100.0,
        precision=2,
        subtype="PERCENTAGE",
    )

    final: PointerProperty(name="Final", type=GlintRenderSettings)
    viewport: PointerProperty(name="Viewport", type=GlintRenderSettings)
    viewport_pass: EnumProperty(
        name="Pass",
        description="What Rendered shading shows in the 3D views; renders are not touched",
        items=[
            (name, name, "", _number(name))
            for name in engine.PASSES
            if name not in (*engine.CRYPTOMATTES, "Vector")
        ]
        + [
            (
                LIGHT_GROUP,
                LIGHT_GROUP,
                "The light of one of the view layer's light groups",
                _number(LIGHT_GROUP),
            )
        ],
        default="Combined",
    )
    viewport_light_group: StringProperty(
        name="Light Group",
        description="The one that Rendered shading shows; all light where none has the name",
    )


def _update_passes(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """The compositor's Render Layers node shows the sockets of the passes that are on."""
    context.view_layer.update_render_passes()


def _part(name: str, description: str) -> BoolProperty:
    return BoolProperty(name=name, description=description, default=False, update=_update_passes)


class GlintViewLayerSettings(bpy.types.PropertyGroup):
    """`view_layer.glint`: the parts of the picture, which with Emission and Environment sum to
    Combined.
    """

    use_pass_diffuse: _part("Diffuse", "Lambert reflection of the lights, before shadows")
    use_pass_specular: _part("Specular", "Highlights of the lights, before shadows")
    use_pass_ambient: _part("Ambient", "Reflection of the world's ambient light")
    use_pass_shadow: _part("Shadow", "What shadows take away: zero or negative")
    use_pass_mirror: _part("Mirror", "All that mirror reflection and refraction bring")
    use_pass_error: _part(
        "Error",
        "Estimated error in 8-bit levels, to see where more samples would help: most pixels are "
        "off by less, few by more than twice as "
        "much",
    )
    use_pass_samples: _part(
        "Samples", "Samples that the pixel took, fewer where the error threshold stopped it"
    )
    use_pass_cost: _part("Cost", "Rays traced for the pixel, of all kinds")
    use_pass_grazing: _part(
        "Grazing", "Cosine between the view and the surface: small where it is seen edge on"
    )
    use_pass_gap: _part(
        "Gap",
        "Distance from the first surface to the next behind it: tiny where surfaces lie in one "
        "place",
    )
    use_pass_fallbacks: _part(
        "Fallbacks",
        "How often single precision could not decide about a triangle and double precision did: "
        "many at edges and far away",
    )


def settings_from(
    group: GlintRenderSettings,
    scene: bpy.types.Scene,
    passes: Iterable[str] = (),
    region: tuple[int, int, int, int] | None = None,
) -> engine.Settings:
    """The engine's settings; pixel filter and fixed thread count are Blender's own.

    passes: names from `engine.PASSES`.  region: (x0, y0, x1, y1) in pixels of the full frame, or
    None for all of it.
    """
    fixed_threads = scene.render.threads if scene.render.threads_mode == "FIXED" else 0
    chosen = {name: getattr(group, name) for name in _OWN}
    chosen["threads"] = group.threads or fixed_threads
    return engine.Settings(
        **chosen,
        filter_width=scene.render.filter_size,
        passes=frozenset(passes) - {"Combined"},
        region=region,
    )


def tracer_notes(backend: str) -> tuple[str, ...]:
    """What there is to say where a tracer cannot run here and the other one takes over."""
    if backend in engine.available_backends():
        return ()
    return (_FALLBACK.format(engine.native_error()),)


def viewport_settings_from(scene: bpy.types.Scene) -> tuple[engine.Settings, str]:
    """The settings of Rendered shading with a tracer that can run here, and the pass that it shows.

    How finely to sample is the viewport's own; what a picture means and who draws it is the final
    render's.
    """
    shown = scene.glint.viewport_pass or "Combined"  # "" is a number that no choice has
    passes = (shown,) if shown in engine.PASSES else ()
    settings = settings_from(scene.glint.viewport, scene, passes)
    final = settings_from(scene.glint.final, scene)
    backend = "NUMPY" if tracer_notes(final.backend) else final.backend
    shared = {name: getattr(final, name) for name in (*OF_LIGHT, "threads", "filter_width")}
    acceleration = "FAST" if final.acceleration == "AUTO" else final.acceleration
    return replace(
        settings, backend=backend, acceleration=acceleration, **shared
    ), shown if shown != LIGHT_GROUP else engine.LIGHT_GROUP + scene.glint.viewport_light_group


_CLASSES = (GlintRenderSettings, GlintSceneSettings, GlintViewLayerSettings)


_register, _unregister = bpy.utils.register_classes_factory(_CLASSES)


def register() -> None:
    _register()
    bpy.types.Scene.glint = PointerProperty(name="Glint", type=GlintSceneSettings)
    bpy.types.ViewLayer.glint = PointerProperty(name="Glint", type=GlintViewLayerSettings)


def unregister() -> None:
    del bpy.types.ViewLayer.glint
    del bpy.types.Scene.glint
    _unregister()
