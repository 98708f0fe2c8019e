"""Preview icons of materials, worlds, lights and textures, made by Glint in a Blender with a
window, some of them while a picture is rendered.
"""

import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy
import numpy as np

import in_window

window = in_window.load(*sys.argv[sys.argv.index("--") + 2 :][:1])
folder = pathlib.Path(sys.argv[sys.argv.index("--") + 1])
results, icons = {}, {}


def scenario():
    scene = bpy.context.scene
    scene.render.engine = "GLINT"
    scene.glint.final.samples = 16
    scene.render.resolution_x, scene.render.resolution_y = 320, 240
    yield 0.3
    alone = yield from rendered()
    yield from in_the_statistics()
    for name, thing in things().items():
        yield from icon(name, thing)
    yield from beside_a_render(alone)
    yield from in_the_panel()
    np.savez(folder / "icons.npz", **icons)
    in_window.answer(results)


def things():
    red, glass, noise = (bpy.data.materials.new(name) for name in ("red", "glass", "noise"))
    for material in (red, glass, noise):
        if bpy.app.version < (5, 0):
            material.use_nodes = True
    inputs = {m.name: m.node_tree.nodes["Principled BSDF"].inputs for m in (red, glass, noise)}
    inputs["red"]["Base Color"].default_value = (0.9, 0.05, 0.02, 1)
    inputs["glass"]["Transmission Weight"].default_value = 1.0
    inputs["glass"]["Roughness"].default_value = 0.0
    texture = noise.node_tree.nodes.new("ShaderNodeTexNoise")
    noise.node_tree.links.new(texture.outputs["Color"], inputs["noise"]["Base Color"])
    world = bpy.data.worlds.new("blue")
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.05, 0.2, 0.9, 1)
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.color = (1.0, 0.6, 0.1)
    found = {"red": red, "glass": glass, "noise": noise, "world": world, "lamp": lamp}
    return found | {"texture": bpy.data.textures.new("clouds", "CLOUDS")}


def make(thing):
    with bpy.context.temp_override(id=thing):
        bpy.ops.ed.lib_id_generate_preview()


def pixels(thing):
    preview = thing.preview
    if preview is None or not all(preview.image_size):
        return np.zeros((1, 1, 4))
    return np.array(list(preview.image_pixels_float)).reshape(*tuple(preview.image_size)[::-1], 4)


def icon(name, thing):
    start = time.monotonic()
    make(thing)
    yield lambda: pixels(thing).any()
    seconds = time.monotonic() - start
    yield 0.3
    icons[name] = pixels(thing)
    results[name] = {
        "seconds": seconds,
        "mean": icons[name].mean((0, 1)).tolist(),
        "spread": float(icons[name][..., :3].std()),
    }


def rendered():
    """Yield from this: the pixels of F12, which runs as a job."""
    bpy.ops.render.render("INVOKE_DEFAULT")
    yield 0.2
    yield lambda: not bpy.app.is_job_running("RENDER")
    return saved("f12")


def saved(name):
    path = folder / f"{name}.exr"
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    result = next(i for i in bpy.data.images if i.type == "RENDER_RESULT")
    result.save_render(str(path))
    picture = bpy.data.images.load(str(path))
    return np.array(picture.pixels[:])


def beside_a_render(alone):
    """An icon is made while a picture is traced; that has the same bits."""
    scene = bpy.context.scene
    material = bpy.data.materials["red"].copy()
    bpy.ops.render.render("INVOKE_DEFAULT")
    make(material)
    yield lambda: not bpy.app.is_job_running("RENDER")
    results["render beside an icon"] = bool((saved("beside") == alone).all())
    yield lambda: pixels(material).any()
    results["icon beside a render"] = bool(pixels(material)[..., 3].any())
    results["samples"] = scene.glint.final.samples


def in_the_statistics():
    """The properties editor shows the last frame's numbers as soon as an animation has ended."""
    area = next(
        area
        for area in bpy.context.window_manager.windows[0].screen.areas
        if area.type == "PROPERTIES"
    )
    area.spaces.active.context = "RENDER"
    last = sys.modules[window.package + ".addon.render.statistics"].of_last_render
    shown, name = [], bpy.context.scene.name
    panel = bpy.types.GLINT_RENDER_PT_sampling
    watch = lambda *_: shown.append(last(name))  # noqa: E731
    panel.append(watch)
    yield 0.5
    scene = bpy.context.scene
    scene.render.filepath, scene.frame_start, scene.frame_end = str(folder / "frame"), 1, 2
    bpy.ops.render.render("INVOKE_DEFAULT", animation=True)
    yield 0.2
    yield lambda: not bpy.app.is_job_running("RENDER")
    yield 1.0
    panel.remove(watch)
    results["statistics"] = bool(shown) and shown[-1] is last(name)


def in_the_panel():
    """The properties editor with the material tab draws its preview panel."""
    area = window.area
    thing = bpy.context.scene.objects["Cube"]
    thing.data.materials.clear()
    thing.data.materials.append(bpy.data.materials["noise"])
    bpy.context.view_layer.objects.active = thing
    seen = []
    final = sys.modules[window.package + ".addon.render.final"]
    prepare = final.prepare

    def noted(engine, depsgraph, *more):
        seen.append((engine.is_preview, engine.resolution_x, engine.resolution_y))
        return prepare(engine, depsgraph, *more)

    final.prepare = noted
    panel = bpy.types.MATERIAL_PT_preview
    bpy.utils.unregister_class(panel)
    panel.bl_options = set()  # open
    bpy.utils.register_class(panel)
    try:
        area.type = "PROPERTIES"
        yield 0.5
        area.spaces[0].context = "MATERIAL"
        area.tag_redraw()
        yield lambda: any(is_preview for is_preview, *_ in seen)
        yield 0.5
    finally:
        final.prepare = prepare
        area.type = "VIEW_3D"
    results["panel"] = seen


in_window.play(scenario, window)
