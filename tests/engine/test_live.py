"""Pictures made behind the caller's back: the bits of `render`, in the order of asking, without
anything left behind.
"""

import gc
import sys
import time
import weakref
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import LiveRender, Scene, Settings, Task, available_backends, render
from glint.engine import live as live_module
from glint.engine.scene import Camera, Instances, Light, Mesh

LONGEST = 60.0
BACKENDS = [
    pytest.param(
        name, marks=pytest.mark.skipif(name not in available_backends(), reason="no core here")
    )
    for name in ("NATIVE", "NUMPY")
]


def scene(x=0.0, kind="PERSPECTIVE", energy=1.0):
    """Triangles all over the place before a camera at (x, 0, 5)."""
    r = np.random.default_rng(1)
    corners = (
        (r.random((400, 1, 3)) * 2 - 1 + r.normal(size=(400, 3, 3)) * 0.1)
        .reshape(-1, 3)
        .astype(np.float32)
    )
    mesh = Mesh("Mesh", corners, np.arange(1200, dtype=np.uint32).reshape(-1, 3))
    window = (-0.5, 0.5, -0.4, 0.4) if kind == "PERSPECTIVE" else (-1, 1, -0.8, 0.8)
    camera = Camera(
        kind, np.array([[1.0, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 5]]), window, (60, 48), 0.1, 100.0
    )
    lights = (
        Light("Sun", "SUN", np.eye(4)[:3], strength=energy),
        Light("Point", "POINT", np.eye(4)[:3] + [[0, 0, 0, 1]] * 3, strength=99.0),
    )
    return Scene(camera, (mesh,), (Instances("Mesh", 0, np.eye(4)[None, :3], ()),), lights=lights)


SETTINGS = Settings(samples=2, threads=1, passes=frozenset({"Depth", "Position"}))


@pytest.fixture
def live():
    made = LiveRender()
    yield made
    made.close()


def wait(live, done=lambda live: not live.busy):
    deadline = time.monotonic() + LONGEST
    while not done(live):
        assert time.monotonic() < deadline, "no picture came"
        time.sleep(0.002)
    assert live.error is None, live.error
    return live.newest


def same(film, other):
    return all(film.passes[name].tobytes() == other.passes[name].tobytes() for name in other.passes)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_last_wave_has_the_bits_of_a_render(live, backend):
    settings = replace(SETTINGS, backend=backend)
    live.start([Task(scene(), settings, "tag")])
    wave = wait(live)
    assert wave.final and wave.film.samples == 2 and wave.task.tag == "tag"
    assert same(wave.film, render(scene(), settings))


def test_who_is_no_longer_busy_has_the_picture(monkeypatch):
    """After each instruction of the thread, as whoever looks takes no lock."""
    live, seen, last, serve = LiveRender(), [], [0], live_module._serve

    def look(frame, event, argument):
        if frame.f_globals["__name__"] == LiveRender.__module__:
            frame.f_trace_opcodes = True
            newest = live.newest
            seen.append(live.busy or (newest is not None and newest.task.tag >= last[0]))
            return look
        return None

    def watched(*arguments):
        sys.settrace(look)
        serve(*arguments)

    monkeypatch.setattr(live_module, "_serve", watched)
    live.start([Task(scene(), replace(SETTINGS, samples=1), 0)])
    wait(live)
    live.start([Task(scene(), replace(SETTINGS, samples=1), 1)])
    last[0] = 1  # only now, as the thread may still be on its way from the first
    wait(live)
    live.close()
    assert len(seen) > 500
    assert all(seen)


@pytest.mark.skipif("NATIVE" not in available_backends(), reason="no core here")
def test_pictures_of_waves_are_handed_over_and_stay_as_they_are():
    passes = frozenset({"Depth", "Diffuse", "Samples", "Error"})
    settings, waves = Settings(samples=16, backend="NATIVE", passes=passes), []

    def keep(film):
        waves.append((film, {name: picture.copy() for name, picture in film.passes.items()}))

    keep(render(scene(), settings, on_wave=keep))
    assert [film.samples for film, _ in waves] == [1, 2, 4, 8, 16, 16]
    for film, copies in waves:
        assert not any(picture.flags.owndata for picture in film.passes.values()), "copied"
        assert all(film.passes[name].tobytes() == copy.tobytes() for name, copy in copies.items())
    assert not any(
        picture.flags.writeable for film, _ in waves[:4] for picture in film.passes.values()
    )
    assert not same(waves[0][0], waves[1][0])
    assert same(waves[-1][0], render(scene(), settings)), (
        "the Error pass looks at the picture of the wave before"
    )


@pytest.mark.skipif("NATIVE" not in available_backends(), reason="no core here")
def test_the_last_picture_is_handed_over_and_outlives_its_maker():
    live, expected = LiveRender(), render(scene(), SETTINGS)
    live.start([Task(scene(), replace(SETTINGS, backend="NATIVE"))])
    film = wait(live).film
    assert not any(picture.flags.owndata for picture in film.passes.values()), "copied"
    live.start([Task(scene(0.5), replace(SETTINGS, backend="NATIVE"))])
    wait(live)
    live.close()
    del live
    gc.collect()
    assert same(film, expected)


@pytest.mark.parametrize("backend", BACKENDS)
def test_only_what_was_asked_last_is_made_to_the_end(live, backend):
    many = replace(SETTINGS, backend=backend, samples=4096)
    for number in range(5):
        live.start([Task(scene(), many, number)])
        time.sleep(0.01)
    live.start([Task(scene(), replace(many, samples=1), "last")])
    assert wait(live).task.tag == "last"


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_first_wave_that_is_kept_comes_however_fast_others_are_asked_for(live, backend):
    settings, seen = replace(SETTINGS, backend=backend, samples=4096), set()
    # a wave takes longer than the next task waits
    size = {"NATIVE": (800, 640), "NUMPY": (200, 160)}[backend]
    large = replace(scene(), camera=replace(scene().camera, resolution=size))
    deadline = time.monotonic() + LONGEST
    for number in range(10**6):
        live.start([Task(large, settings, number, keep_first_wave=True)])
        time.sleep(0.001)
        seen.add(live.newest and live.newest.task.tag)
        if len(seen) > 3 or time.monotonic() > deadline:
            break
    assert len(seen) > 3


def test_tasks_of_one_start_follow_each_other(live):
    settings = replace(SETTINGS, backend=available_backends()[0])
    live.start([Task(scene(x), settings, x) for x in (0.0, 0.5, 1.0)])
    wave = wait(live)
    assert wave.task.tag == 1.0 and same(wave.film, render(scene(1.0), settings))
    assert wave.number >= 3, "each of the three was shown"


def test_tasks_that_are_added_end_nothing(live, monkeypatch):
    settings, ends, publish = replace(SETTINGS, backend=available_backends()[0]), [], live._publish

    def published(task, film, final, start):
        ends.extend([task.tag] if final else [])
        publish(task, film, final, start)

    monkeypatch.setattr(live, "_publish", published)
    live.start([Task(scene(), replace(settings, samples=8), "first")])
    live.go_on([Task(scene(0.5), settings, "second"), Task(scene(1.0), settings, "third")])
    wait(live)
    assert ends == ["first", "second", "third"]


@pytest.mark.parametrize("backend", BACKENDS)
def test_who_waits_gets_what_is_wanted_or_hears_that_none_will_come(live, backend):
    settings = replace(SETTINGS, backend=backend)
    assert not live.wait(lambda wave: True, LONGEST), "nothing was asked for"
    live.start([Task(scene(), settings, 1), Task(scene(0.5), settings, 2)])
    assert live.wait(lambda wave: wave.task.tag == 2, LONGEST) and live.newest.task.tag == 2
    assert not live.wait(lambda wave: wave.task.tag == 3, LONGEST) and not live.busy
    live.start([Task(scene(), replace(settings, samples=65536), 3)])
    assert not live.wait(lambda wave: wave.task.tag == 3 and wave.final, 0.0) and live.busy, (
        "the time is over"
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_picture_of_one_sample_comes_once(live, backend):
    live.start([Task(scene(), replace(SETTINGS, samples=1, backend=backend))])
    wave = wait(live)
    assert wave.final and (wave.number == 1 or backend == "NUMPY")


def test_an_error_is_told_and_the_next_task_runs(live):
    settings = replace(SETTINGS, backend=available_backends()[0])
    broken = replace(scene(), camera=replace(scene().camera, resolution=(0, 0)))
    live.start([Task(broken, settings)])
    deadline = time.monotonic() + LONGEST
    while live.error is None:
        assert time.monotonic() < deadline
        time.sleep(0.002)
    live.start([Task(scene(), settings)])
    assert wait(live).final


@pytest.mark.parametrize("end", ["close", "forget"])
def test_nothing_stays_behind(end):
    live = LiveRender()
    live.start(
        [
            Task(
                scene(),
                replace(
                    SETTINGS,
                    samples=65536 if end == "close" else 1,
                    backend=available_backends()[0],
                ),
            )
        ]
    )
    wait(live, lambda live: live.newest is not None)
    thread = live._thread
    if end == "close":
        live.close()
    reference = weakref.ref(live)
    del live
    deadline = time.monotonic() + LONGEST
    while thread.is_alive() or reference() is not None:
        assert time.monotonic() < deadline, "the thread goes on"
        gc.collect()
        time.sleep(0.01)


native = pytest.mark.skipif("NATIVE" not in available_backends(), reason="no core here")


@native
@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
@pytest.mark.parametrize("exact", [True, False])
def test_a_camera_that_moves(live, kind, exact):
    """Exactly: the bits of a render. With the trees of another place: the same hits, to float32's
    rounding of rays that start elsewhere.
    """
    first = scene(0.0, kind)
    live.start([Task(first, SETTINGS)])
    wait(live)
    for x in (0.25, -1.0, 60.0):
        moved = replace(first, camera=scene(x, kind).camera)
        live.start([Task(moved, SETTINGS, exact=exact)])
        wave, truth = wait(live), render(moved, SETTINGS)
        if exact:
            assert same(wave.film, truth)
            continue
        there = (
            np.abs(wave.film.passes["Depth"] - truth.passes["Depth"])
            <= 2**-18 * truth.passes["Depth"]
        )
        assert (~there).sum() <= 2, "a pixel at an edge may see the other side of it"
        assert (wave.film.stats["build"] == 0) == (x != 60.0), (
            "the trees serve near cameras, far ones get their own"
        )


@native
def test_lights_change_without_new_trees(live):
    first = scene()
    live.start([Task(first, SETTINGS)])
    assert wait(live).film.stats["build"] > 0
    brighter = replace(first, lights=scene(energy=7.0).lights)
    live.start([Task(brighter, SETTINGS)])
    wave = wait(live)
    assert wave.film.stats["build"] == 0
    assert same(wave.film, render(brighter, SETTINGS))


@native
def test_moved_objects_get_new_trees(live):
    first = scene()
    live.start([Task(first, SETTINGS)])
    wait(live)
    matrix = np.eye(4)[None, :3] + [[0, 0, 0, 0.5]]
    moved = replace(first, instances=(replace(first.instances[0], world_from_object=matrix),))
    live.start([Task(moved, SETTINGS, exact=False)])
    assert same(wait(live).film, render(moved, SETTINGS))
