"""The settings that a .blend file keeps, and how they become `engine.Settings`.

`scene.glint.final` and `scene.glint.viewport` are two of one group, so every setting exists once as
a definition. Blender reads the annotations as they are, so this module must not make them strings
(`from __future__ import annotations`).
"""

from collections.abc import Iterable
from dataclasses import replace

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from ... import engine
from ...engine.settings import OFFERED

_ILLUMINATION_ITEMS = (
    (
        "PHYSICAL",
        "Physical",
        "Watts, inverse square and 1/π as in Cycles: a diffuse surface gets the same value in both",
    ),
    (
        "CLASSIC",
        "Classic",
        "The textbook formula as it stands: the strength is the intensity, and light does not fall "
        "off with distance",
    ),
)
_WORLD_LIGHT_ITEMS = (
    (
        "OCCLUDED",
        "Occluded",
        "For most pictures: the sky or its image lights from where it is bright, and surfaces hide "
        "it from each other. Takes shadow rays",
    ),
    (
        "CONSTANT",
        "Constant",
        "For quick pictures: the world's mean colour on every surface, from all sides, without "
        "shadows. Costs nothing",
    ),
)
_BACKEND_ITEMS = (
    (
        "NATIVE",
        "Native",
        "For every render: the compiled core, on all cores of the CPU. Where it cannot be loaded, "
        "Python takes over with a message",
    ),
    (
        "NUMPY",
        "Python (reference)",
        "To check a picture against double precision: the same to float precision, tens of times "
        "slower",
    ),
)


_ACCELERATION_ITEMS = (
    ("AUTO", "Automatic", "For nearly everything: fast in the viewport, balanced in final renders"),
    (
        "FAST",
        "Fast",
        "For quick looks at large scenes: the first ray comes in half the time, the rays are "
        "somewhat slower",
    ),
    ("BALANCED", "Balanced", "For most renders: the least time for sorting and tracing together"),
    (
        "FINE",
        "Fine",
        "For long renders of rooms with large, long triangles: sorting takes several times as "
        "long, rays are faster. Curved meshes "
        "gain nothing",
    ),
)


class GlintRenderSettings(bpy.types.PropertyGroup):
    """How to render; the same group serves the final render and the viewport."""

    samples: IntProperty(
        name="Samples",
        description="Most samples of a pixel; more make edges and soft shadows smoother and take "
        "longer in proportion. Choose 4 to 16 for "
        "a look, 64 for most pictures, 256 for fine textures and large soft shadows. There is no "
        "noise at any number; powers of two "
        "are placed best",
        default=OFFERED.samples,
        min=1,
        soft_max=256,
        # Blender cuts what is above in silence: this is more than the engine takes, and it says so
        max=1 << 24,
    )
    error_threshold: FloatProperty(
        name="Threshold",
        description="A pixel takes no more samples once its estimated error is at most this many "
        "of the 256 levels of a display. Choose 4 "
        "for most pictures, 1 to 2 where dark gradients will be brightened later, 0 to give all "
        "samples to all pixels",
        default=OFFERED.error_threshold,
        min=0.0,
        soft_max=16.0,
        max=255.0,
        precision=1,
    )
    light_samples: IntProperty(
        name="Light Samples",
        description="Points on each soft light per pixel sample; shadow time grows in proportion. "
        "Both numbers multiply, so choose 2 for "
        "most pictures, 4 to 8 with few samples and large lights. 1 makes hard shadows from the "
        "light's centre",
        default=OFFERED.light_samples,
        min=1,
        soft_max=64,
        max=4096,
    )
    max_bounces: IntProperty(
        name="Bounces",
        description="Depth of mirror and refraction rays; costs nothing without mirrors or glass. "
        "Choose 4 for mirrors, 8 and more where "
        "glass stands behind glass, 0 for no reflections",
        default=OFFERED.max_bounces,
        min=0,
        max=64,
    )
    cutoff: FloatProperty(
        name="Ray Cutoff",
        description="Mirror and refraction rays that would add less than this share to the pixel "
        "are not traced. Choose 0 for all of them, "
        "0.01 to save time in glass with many bounces: the faint reflection of a very bright lamp "
        "may be lost",
        default=OFFERED.cutoff,
        min=0.0,
        soft_max=0.1,
        max=1.0,
        precision=3,
    )
    illumination: EnumProperty(
        name="Illumination", description="What a light's strength means", items=_ILLUMINATION_ITEMS
    )
    world_light: EnumProperty(
        name="World Light",
        description="How the world lights surfaces. With Classic illumination it is constant",
        items=_WORLD_LIGHT_ITEMS,
    )
    backend: EnumProperty(
        name="Tracer",
        description="Which of the two tracers draws the picture",
        items=_BACKEND_ITEMS,
    )
    acceleration: EnumProperty(
        name="Acceleration",
        description="How long the core may sort the scene before the first ray. The picture is the "
        "same, bit for bit, with any",
        items=_ACCELERATION_ITEMS,
    )
    threads: IntProperty(
        name="Threads",
        description="Threads of the native core; 0 takes Blender's own setting, which is all cores "
        "unless fixed. "
        "The picture is the same, bit for bit, with any number",
        default=0,
        min=0,
        max=1024,
    )


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


class GlintSceneSettings(bpy.types.PropertyGroup):
    """`scene.glint`."""

    target: EnumProperty(
        name="Quality Target",
        description="Say how wrong the picture may be instead of how it is sampled: a short look "
        "at parts of the frame finds the samples, "
        "threshold and light samples that reach it with the fewest rays. The statistics say what "
        "was reached",
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
        items=[(name, name, "") for name in engine.PASSES],
        default="Combined",
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
    return engine.Settings(
        samples=group.samples,
        error_threshold=group.error_threshold,
        light_samples=group.light_samples,
        max_bounces=group.max_bounces,
        cutoff=group.cutoff,
        illumination=group.illumination,
        world_light=group.world_light,
        backend=group.backend,
        acceleration=group.acceleration,
        threads=group.threads or fixed_threads,
        filter_width=scene.render.filter_size,
        passes=frozenset(passes) - {"Combined"},
        region=region,
    )


def viewport_settings_from(scene: bpy.types.Scene) -> tuple[engine.Settings, str]:
    """The settings of Rendered shading with a tracer that can run here, and the pass that it shows.

    How finely to sample is the viewport's own; what a picture means and who draws it is the final
    render's.
    """
    settings = settings_from(scene.glint.viewport, scene, (scene.glint.viewport_pass,))
    final = settings_from(scene.glint.final, scene)
    backend = final.backend if final.backend in engine.available_backends() else "NUMPY"
    names = ("illumination", "world_light", "threads", "filter_width")
    shared = {name: getattr(final, name) for name in names}
    acceleration = "FAST" if final.acceleration == "AUTO" else final.acceleration
    return replace(
        settings, backend=backend, acceleration=acceleration, **shared
    ), scene.glint.viewport_pass


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
