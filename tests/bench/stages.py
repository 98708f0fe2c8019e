"""Whole renders by stage, Glint's beside Cycles': what million.py and frames.py share.

Cycles' stages end at its own status messages (handler `render_stats`): sync at "Initializing",
build (its "Updating …": BVH, normals, device) at "Sample 0", trace at "Finished". Glint's are those
of its own clock, cut at the same places: build is all between the export and the first ray (checks,
packing, trees), trace goes on until the picture is with Blender, shading within; `other` is the
rest of a whole render; `write` saves the result as EXR. Memory is the peak resident size during the
render above that of the process before its first render (Linux only). READY is an engine whose
picture is there before its render begins: what it takes, all of it `other` and `write`, is
Blender's own share, the least that any engine can take.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "cycles")]

import glint_tree  # noqa: E402, F401  (makes the package importable as glint)

STAGES = ("sync", "build", "trace", "other", "write", "total")


class NoCoreError(RuntimeError):
    """The native core does not load."""


def require_core() -> None:
    """Raise NoCoreError with the reason unless the native core is there: without it the NumPy
    tracer would be timed.
    """
    from glint import engine

    if "NATIVE" not in engine.available_backends():
        raise NoCoreError(
            f"the benchmark times the native core, and that does not load: {engine.native_error()}"
        )


def run_worker(script: str, *arguments: str, seconds: float | None = None) -> dict:
    """The object that `script` prints after "RESULT "; RuntimeError with the end of its output when
    there is none.
    """
    try:
        done = subprocess.run(
            [sys.executable, script, *arguments], capture_output=True, text=True, timeout=seconds
        )
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"{' '.join(arguments)}: more than {seconds:g} s") from None
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if done.returncode or not lines:
        raise RuntimeError(
            f"{' '.join(arguments)} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
        )
    return json.loads(lines[-1][7:])


def measure(scene, engine: str) -> dict[str, float]:
    """Seconds per stage and megabytes of the scene's render by its present engine, GLINT or
    CYCLES.
    """
    import bpy

    if engine == "GLINT":
        require_core()
    bpy.context.evaluated_depsgraph_get()
    before = status_megabytes("VmRSS")
    bpy.ops.render.render()  # warms what is loaded once: libraries, kernels
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts again from here
    seconds = timed_frame(scene, engine)
    return {**seconds, "megabytes": status_megabytes("VmHWM") - before}


def timed_frame(scene, engine: str) -> dict[str, float]:
    """Seconds per stage of one render, and of saving it."""
    import bpy

    total, stages = timed_render(scene, engine)
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        bpy.data.images["Render Result"].save_render(str(Path(folder) / "picture.exr"), scene=scene)
        write = time.perf_counter() - start
    other = total - sum(stages.values())
    return {**stages, "other": other, "write": write, "total": total + write}


def timed_render(scene, engine: str) -> tuple[float, dict[str, float]]:
    """Seconds of one whole render, and of its stages."""
    import bpy

    messages = []
    start = time.perf_counter()

    def note(text, *_):
        messages.append((time.perf_counter() - start, str(text)))

    bpy.app.handlers.render_stats.append(note)
    bpy.ops.render.render()
    total = time.perf_counter() - start
    bpy.app.handlers.render_stats.remove(note)
    return total, stages_of(scene, engine, messages)


def stages_of(scene, engine: str, messages: list[tuple[float, str]]) -> dict[str, float]:
    """Seconds of the stages that the engine tells of itself."""
    if engine == "READY":
        return dict.fromkeys(("sync", "build", "trace"), 0.0)
    return own_stages(scene) if engine == "GLINT" else cycles_stages(messages)


def cycles_stages(messages: list[tuple[float, str]]) -> dict[str, float]:
    """From the first status that mentions the end of each stage; RuntimeError when one never
    came.
    """
    ends = []
    for mark in ("Initializing", "Sample 0", "Finished"):
        when = next((when for when, text in messages if mark in text), None)
        if when is None:
            raise RuntimeError(f'Cycles never said "{mark}": {[text for _, text in messages]}')
        ends.append(when)
    return dict(zip(STAGES, [ends[0], ends[1] - ends[0], ends[2] - ends[1]], strict=False))


def own_stages(scene) -> dict[str, float]:
    """Glint's own clock of the last render; NoCoreError when the core did not draw it."""
    from glint.addon.render import statistics

    last = statistics.of_last_render(scene.name)
    if last is None or last.backend != "NATIVE":
        raise NoCoreError(
            "the picture was not drawn by the native core but by "
            f"{last.backend if last else 'nobody'}"
        )
    seconds = last.seconds
    return {
        "sync": seconds["sync"],
        "build": seconds["engine"] - seconds["trace"],
        "trace": seconds["trace"] + seconds["write"],
    }


def status_megabytes(field: str) -> float:
    """VmRSS (now) or VmHWM (peak) of this process."""
    line = next(
        line
        for line in Path("/proc/self/status").read_text().splitlines()
        if line.startswith(field)
    )
    return int(line.split()[1]) / 1024


def choose_engine(scene, engine: str, samples: int = 1) -> None:
    """`samples` per pixel and light, no bounces of any kind."""
    scene.render.image_settings.file_format = "OPEN_EXR"
    if engine != "CYCLES":
        import glint

        glint.register()
        scene.render.engine = "GLINT"
    choose_samples(scene, engine, samples)


def choose_samples(scene, engine: str, samples: int) -> None:
    """After `choose_engine`; READY holds Glint's picture of so many samples ready."""
    import cycles_reference

    if engine == "CYCLES":
        cycles_reference.make_exact(scene, samples)
        return
    final = scene.glint.final
    final.samples, final.light_samples, final.error_threshold = samples, 1, 0.0
    final.max_bounces = final.diffuse_bounces = 0
    if engine == "READY":
        import ready_engine

        ready_engine.hold_glints_picture(scene)


def least(rows: list[dict[str, float]]) -> dict[str, float]:
    """The least of each number over the rounds."""
    return {key: min(row[key] for row in rows) for key in rows[0]}
