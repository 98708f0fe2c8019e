"""The settings that a .blend file keeps, and how they become `engine.Settings`.

`scene.glint.final` and `scene.glint.viewport` are two of one group, so every setting exists once as a definition.
Blender reads the annotations as they are, so this module must not make them strings (`from __future__ import annotations`).
"""

from collections.abc import Iterable
from dataclasses import replace

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from .. import engine
from ..engine.settings import OFFERED

_ILLUMINATION_ITEMS = (
    ("PHYSICAL", "Physical", "Watts, inverse square and 1/π as in Cycles: a diffuse surface gets the same value in both"),
    ("CLASSIC", "Classic", "The textbook formula as it stands: the strength is the intensity, and light does not fall off with distance"),
)
_BACKEND_ITEMS = (
    ("NATIVE", "Native", "The C++ core, on all cores of the CPU. Where it cannot be loaded, NumPy takes over with a message"),
    ("NUMPY", "NumPy", "The float64 reference in Python: the same picture to float precision, tens of times slower"),
)


_ACCELERATION_ITEMS = (
    ("AUTO", "Automatic", "Fast in the viewport, balanced in final renders"),
    (
        "FAST",
        "Fast",
        "Cells of a grid, halved. Measured on meshes of 58 000 to 75 000 triangles beside Balanced: built in 0.41 to 0.48 of the "
        "time, rays at 0.80 to 0.95 of the speed",
    ),
    ("BALANCED", "Balanced", "By the surface area heuristic: what a picture mostly takes the least time with"),
    (
        "FINE",
        "Fine",
        "Also cuts triangles where boxes overlap, for long renders of rooms with large, long triangles. Measured beside Balanced: "
        "built in 6 to 9 times the time, rays at 1.1 to 1.6 times the speed in a game level, about the same on curved meshes",
    ),
)


class GlintRenderSettings(bpy.types.PropertyGroup):
    """How to render; the same group serves the final render and the viewport."""

    samples: IntProperty(
        name="Samples",
        description="Samples per pixel for smooth edges; time grows in proportion. One goes through the pixel's centre. "
        "There is no noise at any number, and powers of two are placed best. Measured on the demo scene, relative error: "
        "4: 2.8 %, 8: 1.7 %, 16: 1.0 %, 32: 0.6 %, 64: 0.4 %. The default, 64 with a threshold of 4, is on the front of 11 scenes",
        default=OFFERED.samples,
        min=1,
        soft_max=256,
        max=1 << 24,  # Blender cuts what is above in silence: this is more than the engine takes, and it says so
    )
    error_threshold: FloatProperty(
        name="Error Threshold",
        description="A pixel takes no more samples once its estimated error is at most this many 8-bit levels; 0 gives all samples "
        "to all pixels. Its neighbours are looked at as well, so edges are not missed, and soft lights through 16 points. Measured on the "
        "demo scene at 64 samples, time and relative error: 0: 1 and 0.37 %, 2: 0.58 and 0.42 %, 4: 0.52 and 0.45 %, 8: 0.49 and 0.52 %",
        default=OFFERED.error_threshold,
        min=0.0,
        soft_max=16.0,
        max=255.0,
        precision=1,
    )
    light_samples: IntProperty(
        name="Light Samples",
        description="Points on each soft light per pixel sample; shadow time grows in proportion. "
        "1 makes hard shadows from the light's centre; the pixel samples take different points, so both numbers multiply. Measured on "
        "the demo scene at 16 samples, time and relative error: 1: 0.8 and 2.7 %, 2: 1 and 0.95 %, 4: 1.2 and 0.92 %, 8: 1.7 and 0.93 %",
        default=OFFERED.light_samples,
        min=1,
        soft_max=64,
        max=4096,
    )
    max_bounces: IntProperty(
        name="Bounces",
        description="Depth of mirror and refraction rays. 0 shows no reflections; costs nothing without mirrors or glass. Measured on the "
        "demo scene at 16 samples, time and relative error: 0: 0.7 and 12.5 %, 1: 1 and 1.9 %, 2 and 4: 1 and 1.4 %",
        default=OFFERED.max_bounces,
        min=0,
        max=64,
    )
    cutoff: FloatProperty(
        name="Cutoff",
        description="Mirror and refraction rays that would add less than this share to the pixel are not traced; 0 traces all. Measured on "
        "clear glass at 0.01, rays and what the picture loses: 4 bounces: 0.88 and 0.08 %, 8: 0.60 and 0.14 %, 16: 0.31 and 0.17 %; "
        "nothing where mirrors alone reflect. The reflection of a very bright lamp may be lost",
        default=OFFERED.cutoff,
        min=0.0,
        soft_max=0.1,
        max=1.0,
        precision=3,
    )
    illumination: EnumProperty(name="Illumination", description="What a light's strength means", items=_ILLUMINATION_ITEMS)
    backend: EnumProperty(name="Tracer", description="Which of the two tracers draws the picture", items=_BACKEND_ITEMS)
    acceleration: EnumProperty(
        name="Acceleration",
        description="How long the core may sort the scene before the first ray. The picture is the same, bit for bit, with any",
        items=_ACCELERATION_ITEMS,
    )
    threads: IntProperty(
        name="Threads",
        description="Threads of the native core; 0 takes Blender's own setting, which is all cores unless fixed. "
        "The picture is the same, bit for bit, with any number",
        default=0,
        min=0,
        max=1024,
    )


_TARGET_ITEMS = (
    ("NONE", "Off", "Samples, threshold and light samples are those below"),
    ("LEVELS", "Visible Error", "The error on the display that 999 of 1000 pixels stay within, in 8-bit levels, after the view transform"),
    ("RMSE", "Mean Error", "The root mean square error of linear colour, in percent of the picture's root mean square"),
)


class GlintSceneSettings(bpy.types.PropertyGroup):
    """`scene.glint`."""

    target: EnumProperty(
        name="Target",
        description="Say how wrong the picture may be, and a pilot on small squares of the frame finds the samples, threshold and light "
        "samples that reach it with the fewest rays. Predicted and reached error stand in the statistics, the log and the file",
        items=_TARGET_ITEMS,
    )
    target_levels: FloatProperty(
        name="Levels",
        description="Largest visible error that is good enough, for all but one of a thousand pixels: 1 cannot be told apart on an 8-bit "
        "display, 4 hardly",
        default=4.0,
        min=0.1,
        soft_max=32.0,
        max=255.0,
        precision=1,
    )
    target_rmse: FloatProperty(
        name="Error",
        description="Root mean square error that is good enough",
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
        items=[(name, name, "") for name in engine.PASSES],
        default="Combined",
    )


def _update_passes(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """The compositor's Render Layers node shows the sockets of the passes that are on."""
    context.view_layer.update_render_passes()


def _part(name: str, description: str) -> BoolProperty:
    return BoolProperty(name=name, description=description, default=False, update=_update_passes)


class GlintViewLayerSettings(bpy.types.PropertyGroup):
    """`view_layer.glint`: the parts of the picture, which with Emission and Environment sum to Combined."""

    use_pass_diffuse: _part("Diffuse", "Lambert reflection of the lights, before shadows")
    use_pass_specular: _part("Specular", "Highlights of the lights, before shadows")
    use_pass_ambient: _part("Ambient", "Reflection of the world's ambient light")
    use_pass_shadow: _part("Shadow", "What shadows take away: zero or negative")
    use_pass_mirror: _part("Mirror", "All that mirror reflection and refraction bring")
    use_pass_error: _part(
        "Error",
        "Estimated error in 8-bit levels, about two standard deviations. Of pixels with something to see, 9 of 10 are off by less, half of "
        "them by less than a third of it, and 1 of 100 by more than twice as much (35 scenes)",
    )
    use_pass_samples: _part("Samples", "Samples that the pixel took, fewer where the error threshold stopped it")
    use_pass_cost: _part("Cost", "Rays traced for the pixel, of all kinds")
    use_pass_grazing: _part("Grazing", "Cosine between the view and the surface: small where it is seen edge on")
    use_pass_gap: _part("Gap", "Distance from the first surface to the next behind it: tiny where surfaces lie in one place")
    use_pass_fallbacks: _part(
        "Fallbacks", "How often single precision could not decide about a triangle and double precision did: many at edges and far away"
    )


def settings_from(
    group: GlintRenderSettings,
    scene: bpy.types.Scene,
    passes: Iterable[str] = (),
    region: tuple[int, int, int, int] | None = None,
) -> engine.Settings:
    """The engine's settings; pixel filter and fixed thread count are Blender's own.

    passes: names from `engine.PASSES`.  region: (x0, y0, x1, y1) in pixels of the full frame, or None for all of it.
    """
    fixed_threads = scene.render.threads if scene.render.threads_mode == "FIXED" else 0
    return engine.Settings(
        samples=group.samples,
        error_threshold=group.error_threshold,
        light_samples=group.light_samples,
        max_bounces=group.max_bounces,
        cutoff=group.cutoff,
        illumination=group.illumination,
        backend=group.backend,
        acceleration=group.acceleration,
        threads=group.threads or fixed_threads,
        filter_width=scene.render.filter_size,
        passes=frozenset(passes) - {"Combined"},
        region=region,
    )


def viewport_settings_from(scene: bpy.types.Scene) -> tuple[engine.Settings, str]:
    """The settings of Rendered shading with a tracer that can run here, and the pass that it shows.

    How finely to sample is the viewport's own; what a picture means and who draws it is the final render's.
    """
    settings = settings_from(scene.glint.viewport, scene, (scene.glint.viewport_pass,))
    final = settings_from(scene.glint.final, scene)
    backend = final.backend if final.backend in engine.available_backends() else "NUMPY"
    shared = {name: getattr(final, name) for name in ("illumination", "threads", "filter_width")}
    acceleration = "FAST" if final.acceleration == "AUTO" else final.acceleration
    return replace(settings, backend=backend, acceleration=acceleration, **shared), scene.glint.viewport_pass


_CLASSES = (GlintRenderSettings, GlintSceneSettings, GlintViewLayerSettings)


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.glint = PointerProperty(name="Glint", type=GlintSceneSettings)
    bpy.types.ViewLayer.glint = PointerProperty(name="Glint", type=GlintViewLayerSettings)


def unregister() -> None:
    del bpy.types.ViewLayer.glint
    del bpy.types.Scene.glint
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
