"""Runs inside a Blender with a window: how soon events show in the middle of the 3D view, for
Glint, for Cycles, or for an engine that has every picture ready and so tells what Blender itself
takes. See measure.py.

Every event changes the colour of the pixel in the middle, which is read back from the framebuffer
after each `view_draw` of the engine: the time runs from before Blender's data is changed until that
pixel has its new colour. Processor time is that of the whole program.
"""

import argparse
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy
import gpu
import mathutils

import control_engine
import in_window
import measured_scenes

REPEATS = 8
CONVERGED_SECONDS = 4.0
TURN = 1.0
"""Radians a second."""


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("engine", choices=("GLINT", "CYCLES", "CONTROL"))
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :])


class Eye:
    """Looks at the middle of the region. color: what is there.  at, spent: when it was drawn, and
    the processor time until then.
    """

    def __init__(self, engine_class):
        self.color, self.at, self.spent, self.draws = (0.0, 0.0, 0.0), 0.0, 0.0, 0
        draw = engine_class.view_draw

        def watched(render_engine, context, depsgraph):
            draw(render_engine, context, depsgraph)
            x, y = context.region.width // 2, context.region.height // 2
            pixel = (
                gpu.state.active_framebuffer_get()
                .read_color(x, y, 1, 1, 4, 0, "FLOAT")
                .to_list()[0][0]
            )
            self.color, self.at, self.spent = (
                tuple(pixel[:3]),
                time.perf_counter(),
                time.process_time(),
            )
            self.draws += 1

        engine_class.view_draw = watched


def engine_class(window):
    if options.engine == "GLINT":
        return sys.modules[window.package + ".addon.render.render_engine"].GlintRenderEngine
    if options.engine == "CONTROL":
        control_engine.register()
        return control_engine.ControlEngine
    import cycles

    return cycles.CyclesRender


options = arguments()
window = in_window.load()
eye = Eye(engine_class(window))
wall, processor, traced, facts = {}, {}, {}, {}


def is_red(color):
    return color[0] > 2 * color[1] and color[0] > 0.01


def is_green(color):
    return color[1] > 2 * color[0] and color[1] > 0.01


SHADES = {
    is_red: ((0.8, 0.02, 0.02), (0.7, 0.02, 0.02)),
    is_green: ((0.02, 0.8, 0.02), (0.02, 0.7, 0.02)),
}
"""Two of each, of which the engine with ready pictures shows one that it does not show yet."""


def next_shade(has_come):
    one, other = SHADES.get(has_come, SHADES[is_red])
    return other if control_engine.ControlEngine.color == one else one


def scenario():
    yield from maximize()
    scene = bpy.context.scene
    scene.render.engine = options.engine
    if options.engine == "GLINT":
        scene.glint.viewport.samples = 4
    elif options.engine == "CYCLES":
        scene.cycles.preview_samples, scene.cycles.use_preview_denoising = 1, False
    facts["region"] = [window.region.width, window.region.height]
    measured_scenes.spheres()
    look_at((-1, 0, 0), 4)
    yield 0.5
    yield from switching()
    yield from moving_the_view()
    yield from shading()
    yield from turning()
    if options.engine != "CYCLES":
        yield from stopping()
    yield from converged()
    yield from one_of_many("one of 10 000 objects", carried=False)
    yield from one_of_many("one among 10 000 instances", carried=True)
    yield from one_vertex()
    in_window.answer({"wall": wall, "processor": processor, "traced": traced, "facts": facts})


def maximize():
    """The 3D view alone in the window."""
    window.space.overlay.show_overlays = False
    window.space.show_gizmo = window.space.show_region_header = False
    with window.context():
        bpy.ops.screen.screen_full_area(use_hide_panels=True)
    yield 0.5


def look_at(point, distance):
    view = window.view
    view.view_perspective, view.view_distance = "PERSP", distance
    view.view_location = point
    view.view_rotation = mathutils.Euler((1.0, 0.0, 0.0)).to_quaternion()


def event(name, action, has_come):
    """Yield from this: do something and wait until the middle of the view shows it."""
    in_window.say(name)
    control_engine.show(next_shade(has_come))
    start, spent = time.perf_counter(), time.process_time()
    action()
    yield lambda: eye.at > start and has_come(eye.color)
    wall.setdefault(name, []).append(eye.at - start)
    processor.setdefault(name, []).append(eye.spent - spent)
    if options.engine == "GLINT":
        traced.setdefault(name, []).append(current_session().newest_at - start)
    yield from quiet()


def quiet():
    """Yield from this: nothing has been drawn for a while, so the picture is complete."""
    deadline = time.perf_counter() + in_window.LONGEST
    while time.perf_counter() < deadline:
        before = eye.draws
        yield 0.25
        if eye.draws == before and not is_tracing():
            return
    raise TimeoutError("the view is drawn again and again")


def is_tracing():
    session = current_session() if options.engine == "GLINT" else None
    return session is not None and (session.busy or session.has_news)


def alternating(name, red, green):
    """Yield from this: two actions in turn, after which the middle is red and green."""
    for k in range(REPEATS):
        yield from event(name, *((green, is_green) if k % 2 == 0 else (red, is_red)))


def switching():
    for k in range(4):
        yield from event(
            "first picture" if k == 0 else "first picture again",
            lambda: set_shading("RENDERED"),
            is_red,
        )
        set_shading("SOLID")
        eye.color = (0.0, 0.0, 0.0)
        yield 0.5
    set_shading("RENDERED")
    yield from quiet()


def set_shading(kind):
    window.space.shading.type = kind


def moving_the_view():
    def to(x):
        window.view.view_location = (x, 0, 0)
        window.region.tag_redraw()

    yield from alternating("view moved", lambda: to(-1), lambda: to(1))
    to(-1)
    yield from quiet()


def shading():
    material, lamp = bpy.data.materials["red"], bpy.data.lights["Point"]
    sun = bpy.data.lights["Sun"]
    yield from alternating(
        "material color",
        lambda: paint(material, measured_scenes.RED),
        lambda: paint(material, measured_scenes.GREEN),
    )
    paint(material, (0.8, 0.8, 0.8, 1))
    sun.energy, lamp.color = 0, (1, 0.1, 0.1)
    yield from quiet()
    yield from alternating(
        "light color", lambda: tint(lamp, (1, 0.1, 0.1)), lambda: tint(lamp, (0.1, 1, 0.1))
    )
    paint(material, measured_scenes.RED)
    sun.energy, lamp.color = 2, (1, 1, 1)
    yield from quiet()


def paint(material, color):
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color


def tint(lamp, color):
    lamp.color = color


def turning():
    """New pictures, and redraws, a second while the view turns all the time."""
    session, answered = current_session() if options.engine == "GLINT" else None, set()
    draws, last = eye.draws, time.perf_counter()
    start = last
    while last < start + 4:
        last = turn(last, time.perf_counter())
        answered.add(session.answered if session else eye.draws)
        yield 0.004
    seconds = time.perf_counter() - start
    facts["pictures a second while the view turns"] = (len(answered) - 1) / seconds
    facts["redraws a second while the view turns"] = (eye.draws - draws) / seconds
    yield from quiet()


def turn(last, now):
    """Turn the view by what a hand does from one time to another: it waits for no redraw."""
    window.view.view_rotation = (
        mathutils.Quaternion((0, 0, 1), TURN * (now - last)) @ window.view.view_rotation
    )
    window.region.tag_redraw()
    return now


def stopping():
    """From the last turn that Blender handles, and from the hand's stop, at any time of a redraw,
    until every pixel of the region has been traced for it; two redraws where every picture is
    ready.
    """
    session = current_session() if options.engine == "GLINT" else None
    for k in range(2 * REPEATS):
        last = time.perf_counter()
        stop = last + 0.4 + 0.017 * k
        while last < stop:
            start, spent, asked = (
                time.perf_counter(),
                time.process_time(),
                session.requests if session else eye.draws,
            )
            last = turn(last, min(start, stop))
            yield 0.004 if last < stop else lambda asked=asked: has_come_to_rest(session, asked)
        wall.setdefault("stop to full resolution", []).append(eye.at - start)
        wall.setdefault("the same from the hand's stop", []).append(eye.at - stop)
        for name in ("stop to full resolution", "the same from the hand's stop"):
            processor.setdefault(name, []).append(eye.spent - spent)
        yield from quiet()


def has_come_to_rest(session, before):
    if session is None:
        if eye.draws == before + 1:
            window.region.tag_redraw()
        return eye.draws > before + 1
    return session.answered > before and window.films["all"].combined.shape[:2] == (
        window.region.height,
        window.region.width,
    )


def current_session():
    timer = sys.modules[window.package + ".addon.viewport.timer"]
    return timer.session_of(window.region.as_pointer())


def converged():
    """Processor time that a second of a converged view costs, of a second."""
    yield from quiet()
    draws, spent, start = eye.draws, time.process_time(), time.perf_counter()
    yield CONVERGED_SECONDS
    facts["processor share when converged"] = (time.process_time() - spent) / (
        time.perf_counter() - start
    )
    facts["draws when converged"] = eye.draws - draws


def one_of_many(name, carried):
    set_shading("SOLID")
    one = measured_scenes.instances(10_000, carried)
    look_at((0, 0, 0), 12)
    set_shading("RENDERED")
    yield from quiet()
    yield from alternating(name, lambda: place(one, 0), lambda: place(one, 3))


def place(thing, x):
    thing.location.x = x


def one_vertex():
    set_shading("SOLID")
    mesh = measured_scenes.grid(708)
    look_at((0, 0, 0), 0.1)
    middle = mesh.vertices[709 * 709 // 2]
    set_shading("RENDERED")
    yield from quiet()

    def lift(height):
        middle.co.z = height
        mesh.update()

    for k in range(REPEATS // 2):
        before = eye.color
        yield from event(
            "one vertex of 1 M triangles",
            lambda k=k: lift(0.01 * (1 - k % 2)),
            lambda color, before=before: differ(color, before),
        )


def differ(a, b):
    return max(abs(x - y) for x, y in zip(a, b, strict=True)) > 0.05 * max(*a, *b)


in_window.play(scenario, window)
