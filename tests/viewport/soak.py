"""Random edits, undo, resizes, mode switches, file reloads and engine switches in one window: no
crash, no stuck thread, no growth.

Step k of a seed does the same whatever came before it, and is said before it is done, so that a
crash names it. `--engine NOTHING` is the control: the same edits with a render engine that only
exists, and without Glint.
"""

import argparse
import gc
import pathlib
import random
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy

import in_window
import soak_edits


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=1e9)
    parser.add_argument("--first", type=int, default=0, help="the step to begin with")
    parser.add_argument("--steps", type=int, default=1_000_000_000, help="the step to end before")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--engine", default="GLINT")
    parser.add_argument("--without", default="", help="names of edits to leave out, with commas")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1 :])


options = arguments()
window = in_window.load() if options.engine == "GLINT" else in_window.Window(None)
hand = soak_edits.Hand(window, options.engine, options.folder / "soak.blend", random.Random())
done, failed = {}, {}


class Nothing(bpy.types.RenderEngine):
    bl_idname = "NOTHING"
    bl_label = "Nothing"

    def view_update(self, context, depsgraph):
        pass

    def view_draw(self, context, depsgraph):
        pass


def scenario():
    bpy.utils.register_class(Nothing)
    set_up(bpy.context.scene)
    yield 1.0
    start, step = time.perf_counter(), options.first
    while time.perf_counter() < start + options.seconds and step < options.steps:
        dice = random.Random(f"{options.seed}/{step}")
        for edit in dice.choices(soak_edits.EDITS, k=dice.randrange(1, 4)):
            once(step, edit, dice)
            if edit in soak_edits.EXCHANGING:
                break
        yield dice.choice([0.0, 0.02, 0.1])
        step += 1
    yield from rest(step)
    in_window.answer(
        {"steps": step, "done": done, "failed": failed, "threads": threads(), **shown()}
    )


def set_up(scene):
    scene.render.engine = options.engine
    if options.engine == "GLINT":
        scene.glint.viewport.samples = scene.glint.final.samples = 2
    cube = bpy.data.objects["Cube"]
    cube.keyframe_insert("location", frame=1)
    cube.location.x = 2
    cube.keyframe_insert("location", frame=20)
    window.space.shading.type = "RENDERED"
    bpy.ops.wm.save_as_mainfile(filepath=str(hand.file))


def once(step, edit, dice):
    """Blender refuses some of this (RuntimeError): such is the user's life."""
    if edit.__name__ in options.without.split(","):
        return
    in_window.say(f"step {step} {edit.__name__} in {bpy.context.mode}")
    done[edit.__name__] = done.get(edit.__name__, 0) + 1
    hand.dice = dice
    try:
        edit(hand)
        if edit in soak_edits.UNTOLD:
            soak_edits.push(hand)
    except RuntimeError as error:
        count, _ = failed.get(edit.__name__, (0, ""))
        failed[edit.__name__] = count + 1, str(error).strip()[:100]


def rest(step):
    """Back to one rendered view of the file, settled."""
    if bpy.context.screen.is_animation_playing:
        soak_edits.play(hand)
    yield 0.2
    once(step, soak_edits.reload, random.Random())
    yield 0.5
    bpy.context.scene.render.engine, window.space.shading.type = options.engine, "RENDERED"
    if options.engine == "GLINT":
        window.session = None
        yield lambda: window.session is not None
        yield from window.settle()
    gc.collect()
    yield 2.0


def threads():
    """Names of the threads that make pictures for views."""
    live = next((m for name, m in sys.modules.items() if name.endswith("glint.engine.live")), None)
    return ["glint live" for thread in (live._threads if live else ()) if thread.is_alive()]


def shown():
    if options.engine != "GLINT":
        return {}
    return {
        "draws": len(window.draws),
        "busy": window.session.busy,
        "converged": window.converged(),
        "error": str(window.session.live.error),
    }


in_window.play(scenario, window)
