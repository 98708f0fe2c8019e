"""Runs inside a Blender with a window: steps between Blender's events, and what the 3D view showed
after each.

A scenario is a generator. It yields seconds to wait, or a function to wait for. Its end, or an
error, ends Blender.
"""

import faulthandler
import json
import sys
import time
import traceback

import bpy
import gpu
import numpy as np

LONGEST = 60.0
"""Seconds that a scenario waits for one thing."""

STILL = 60.0
"""Seconds that one step may take. Then Blender hangs: it says every thread's stack and ends."""


class Window:
    """The 3D view of the first window, its Glint session, and when pictures were drawn. package: of
    Glint, None without it.

    draws: (time, which request was answered, stage of the newest picture, seconds that view_draw
    took) of every view_draw. films: what is on the screen: "all" of the region, "frame" of the
    render in it; held for as long as it is shown, if `keeps_films`.
    """

    def __init__(self, package):
        self.package = package
        self.draws = []
        self.updates = []
        self.framebuffer = None
        self.session = None
        self.films, self.keeps_films = {}, True
        self._wants_framebuffer = False
        if package is not None:
            self._watch(sys.modules[package + ".addon.viewport.session"].Session)

    @property
    def area(self):
        return next(
            area
            for area in bpy.context.window_manager.windows[0].screen.areas
            if area.type == "VIEW_3D"
        )

    @property
    def space(self):
        return self.area.spaces[0]

    @property
    def region(self):
        return next(region for region in self.area.regions if region.type == "WINDOW")

    @property
    def view(self):
        return self.space.region_3d

    def context(self):
        """For operators that need a 3D view."""
        window = bpy.context.window_manager.windows[0]
        return bpy.context.temp_override(window=window, area=self.area, region=self.region)

    def converged(self):
        """Whether the newest picture of what is shown now is complete and on the screen."""
        session = self.session
        if session is None or session.busy or session.has_news or session.live.newest is None:
            return False
        return session.live.newest.final and bool(self.draws)

    def settle(self):
        """Yield from this to wait for a converged picture of what is there now."""
        self.region.tag_redraw()
        before = len(self.draws)
        yield lambda: len(self.draws) > before
        yield self.converged
        yield 0.05
        yield self.converged

    def read(self):
        """Yield from this: the framebuffer (h, w, 4), scene-linear, is in `framebuffer` then."""
        self.framebuffer, self._wants_framebuffer = None, True
        self.region.tag_redraw()
        yield lambda: self.framebuffer is not None

    def frames(self, action):
        """Yield from this: do something and wait until a picture of what it made is on the screen.

        The seconds go to `times`, those until it was traced to `ready`.
        """
        before = self.session.requests
        start = time.perf_counter()
        action()
        yield lambda: self.session.answered > before
        self.times.append(next(t for t, answered, *_ in self.draws if answered > before) - start)
        self.ready.append(self.session.newest_at - start)

    def state(self):
        """What to know when something does not come."""
        session, scene = self.session, bpy.context.scene
        about = {
            "engine": scene.render.engine,
            "shading": self.space.shading.type,
            "draws": len(self.draws),
            "mode": bpy.context.mode,
        }
        if session is not None:
            newest = session.live.newest
            about |= {
                "busy": session.busy,
                "news": session.has_news,
                "told": session._told(),
                "region": session.region == self.region.as_pointer(),
            }
            about |= {
                "newest": newest and (newest.number, newest.final, newest.task.tag.stage),
                "drawn": session._drawn,
            }
        return about

    times = ready = ()

    def _watch(self, session_class):
        draw, update = session_class.draw, session_class.update

        def watched_draw(session, render_engine, context, depsgraph):
            start = time.perf_counter()
            draw(session, render_engine, context, depsgraph)
            # waits until the pixels are there
            gpu.state.active_framebuffer_get().read_color(0, 0, 1, 1, 4, 0, "FLOAT")
            end = time.perf_counter()
            if context.region.as_pointer() != self.region.as_pointer():
                return
            self.session = session
            newest = session.live.newest
            if self.keeps_films and newest is not None and newest.number == session._drawn:
                self._keep(newest)
            self.draws.append(
                (end, session.answered, newest.task.tag.stage if newest else "", end - start)
            )
            if self._wants_framebuffer:
                self._wants_framebuffer = False
                self.framebuffer = _framebuffer(context.region.width, context.region.height)

        def watched_update(session, context, depsgraph):
            start = time.perf_counter()
            update(session, context, depsgraph)
            self.updates.append(time.perf_counter() - start)

        session_class.draw, session_class.update = watched_draw, watched_update

    def _keep(self, wave):
        if wave.task.tag.stage != "FRAME":
            self.films = {"all": wave.film}
        elif wave.final:
            self.films["frame"] = wave.film


def _framebuffer(width, height):
    buffer = gpu.state.active_framebuffer_get().read_color(0, 0, width, height, 4, 0, "FLOAT")
    buffer.dimensions = width * height * 4
    return np.array(buffer, np.float32).reshape(height, width, 4)


def shown_error(shown, film):
    """How far a picture (h, w, 4) on the screen is from what was traced, in the largest error that
    drawing may add; -1 where their sizes differ.

    A half float rounds by 2^-11 when the picture becomes a texture and again when it is drawn, each
    perhaps towards zero. A texture coordinate is a float: half its step is 2^-14 of a texel in
    pictures of up to 1024 pixels, and as much of a pixel's neighbours is drawn.
    """
    if shown.shape != film.shape:
        return -1.0
    padded = np.pad(film, ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), (0, 1))
    contrast = np.abs(around - film[..., None, None]).max((-2, -1))
    allowed = 2.0**-9 * np.maximum(np.abs(film), 2.0**-14) + 2.0**-14 * contrast
    return float((np.abs(shown - film) / allowed).max())


def say(line):
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def answer(value):
    say("ANSWER " + json.dumps(value))


def play(scenario, window):
    """Run a generator function step by step, then end Blender. An error is printed."""
    bpy.context.preferences.view.show_splash = False
    bpy.app.timers.register(_Player(scenario(), window).tick, first_interval=0.5, persistent=True)


class _Player:
    def __init__(self, steps, window):
        self._steps, self._window = steps, window
        self._waits_for, self._deadline = None, 0.0

    def tick(self):
        faulthandler.dump_traceback_later(STILL, exit=True, file=2)
        try:
            return self._next()
        except StopIteration:
            say("ALL STEPS DONE")
        except BaseException:  # noqa: BLE001 (Blender must end)
            traceback.print_exc()
        self._window.session = None
        bpy.ops.wm.quit_blender()
        return None

    def _next(self):
        if self._waits_for is not None and not self._waits_for():
            if time.perf_counter() > self._deadline:
                raise TimeoutError(f"waited too long: {self._window.state()}")
            return 0.004
        self._waits_for = None
        step = next(self._steps)
        if isinstance(step, (int, float)):
            return step
        self._waits_for, self._deadline = step, time.perf_counter() + LONGEST
        return 0.0


def load(package="bl_ext.user_default.glint"):
    """Enable the extension; returns a Window that watches it."""
    bpy.ops.preferences.addon_enable(module=package)
    return Window(package)


def render(path):
    """F12 without its window: (h, w, 4) float32, the saved file's bits, row 0 at the bottom."""
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR", "32", "ZIP"
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return read_file(path)


def read_file(path):
    """(h, w, 4) float32 of a file of a picture, row 0 at the bottom."""
    image = bpy.data.images.load(str(path))
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    size = tuple(image.size)
    bpy.data.images.remove(image)
    return pixels.reshape(size[1], size[0], 4)
