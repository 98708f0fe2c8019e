"""The native core at work: the same bits however it is cut, waves, progress, cancel, what
it reports.
"""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import ball_mesh, camera, grid_mesh, surface
from glint import engine
from glint.engine import scene as s
from glint.engine.native.render import render_native
from native_tools import (
    IDENTITY,
    constant,
    draw,
    lamp,
    material,
    needs_core,
    placed,
    square,
    view_from_above,
)
from sound_scene import SOUND

pytestmark = needs_core

ALL = frozenset(engine.PASSES) - {"Combined", "Fallbacks"}


def busy_scene() -> s.Scene:
    """Mirrors, glass, a veil and soft lights: rays of every kind, several generations, several
    materials in a tile.
    """
    glass = s.Material(
        "glass",
        (
            s.Lobe("REFRACTION", constant(0.9), ior=1.4, fresnel=True),
            s.Lobe("MIRROR", ior=1.4, fresnel=True),
        ),
    )
    veil = surface(
        "veil",
        0.3,
        specular=0.4,
        lobes=(s.Lobe("TRANSPARENT", constant(0.5, 0.6, 0.7)), s.Lobe("MIRROR", constant(0.2))),
    )
    matrices = np.repeat(IDENTITY[None], 9, 0)
    matrices[:, :, :3] *= 0.4
    matrices[:, 0, 3], matrices[:, 1, 3], matrices[:, 2, 3] = (
        np.tile([-1, 0, 1], 3),
        np.repeat([-1, 0, 1], 3),
        0.4,
    )
    groups = (
        placed(0, (0,)),
        s.Instances("glass", 1, matrices[::2], (1,)),
        s.Instances("veil", 1, matrices[1::2], (2,)),
    )
    lights = (
        lamp("POINT", (1, -1, 3), strength=300.0, radius=0.3),
        lamp("SUN", strength=1.0, angle=0.1),
    )
    return s.Scene(
        camera(size=(75, 53)),
        (grid_mesh(4), ball_mesh(8)),
        groups,
        (surface("floor", 0.6), glass, veil),
        (),
        lights,
        s.World((0.1,) * 3, (0.2, 0.3, 0.5)),
    )


BUSY = engine.Settings(samples=3, light_samples=2, max_bounces=5, passes=ALL, threads=1)


def bits(film: engine.Film) -> dict[str, bytes]:
    return {name: np.ascontiguousarray(values).tobytes() for name, values in film.passes.items()}


def test_same_bits_for_any_number_of_threads_and_twice() -> None:
    scene = busy_scene()
    first = bits(engine.render(scene, BUSY))
    for threads in (1, 2, 5):
        assert bits(engine.render(scene, replace(BUSY, threads=threads))) == first, threads


def test_same_bits_in_four_regions() -> None:
    """Cuts that fall within tiles and shift their grid."""
    scene = busy_scene()
    whole = engine.render(scene, BUSY)
    for x0, x1 in ((0, 29), (29, 75)):
        for y0, y1 in ((0, 17), (17, 53)):
            part = engine.render(scene, replace(BUSY, region=(x0, y0, x1, y1), threads=2))
            for name, values in part.passes.items():
                assert (
                    values.tobytes()
                    == np.ascontiguousarray(whole.passes[name][y0:y1, x0:x1]).tobytes()
                ), name


def test_same_bits_whatever_is_asked_for() -> None:
    """More passes or a watcher change nothing in Combined."""
    scene = busy_scene()
    assert (
        engine.render(scene, replace(BUSY, passes=frozenset())).combined.tobytes()
        == engine.render(scene, BUSY).combined.tobytes()
    )
    watched = engine.render(scene, BUSY, on_wave=lambda film: None)
    assert watched.combined.tobytes() == engine.render(scene, BUSY).combined.tobytes()


@pytest.mark.parametrize("threshold", [0.0, 4.0])
def test_same_bits_however_many_samples_are_traced_at_once(threshold: float) -> None:
    """Under hard lights up to eight, and fewer for a watcher: waves of 1, 1, 2, 4 and 5 samples, or
    of 4 or 13 from the start.
    """
    asked = replace(
        BUSY,
        samples=13,
        light_samples=1,
        error_threshold=threshold,
        passes=ALL - {"Error"},
        threads=2,
    )
    waves = []
    alone, watched = (
        engine.render(busy_scene(), asked),
        engine.render(busy_scene(), asked, on_wave=waves.append),
    )
    assert [film.samples for film in waves] == [1, 2, 4, 8, 13]
    assert bits(alone) == bits(watched)


@pytest.mark.parametrize("threshold", [0.0, 4.0])
@pytest.mark.parametrize("transparent", [False, True])
def test_tiles_that_look_at_nothing_are_as_if_they_were_traced(
    threshold: float, transparent: bool
) -> None:
    """A lamp behind the camera that camera rays could see has every tile traced: it changes no bit
    of any pass.
    """
    scene = busy_scene()
    left, right, bottom, top = scene.camera.window
    wide = replace(
        scene.camera, window=(4 * left, 4 * right, 4 * bottom, 4 * top), resolution=(200, 141)
    )
    behind = lamp(
        "AREA",
        wide.world_from_camera @ (0, 0, 1, 1),
        wide.world_from_camera[:, :3],
        size_x=1.0,
        size_y=1.0,
    )
    scenes = [
        replace(
            scene,
            camera=wide,
            lights=(*scene.lights, replace(behind, visible_camera=seen)),
            world=replace(scene.world, transparent=transparent),
        )
        for seen in (False, True)
    ]
    asked = replace(BUSY, samples=9, max_bounces=1, error_threshold=threshold, threads=2)
    culled, traced = (engine.render(each, asked) for each in scenes)
    assert (
        "feature: visible lights" in traced.stats and "feature: visible lights" not in culled.stats
    )
    assert bits(culled) == bits(traced)
    waves: list[engine.Film] = []  # held, so that later ones are drawn elsewhere
    assert bits(engine.render(scenes[0], asked, on_wave=waves.append)) == bits(culled)
    assert 0 < culled.stats["camera rays"] < 0.5 * traced.stats["camera rays"]
    nothing = scene.world.background if not transparent else (0, 0, 0)
    assert np.mean(np.all(culled.combined[..., :3] == np.float32(nothing), -1)) > 0.7


@pytest.mark.parametrize(("size", "bounces"), [(32, 8), (3, 13)])
def test_rays_beyond_one_batch_change_nothing(size: int, bounces: int) -> None:
    """Six panes that mirror and refract double their rays at each bounce. Batches are cut, between
    pixels and within one (2^13 rays); a lone pixel gets the same bits all the same.
    """
    pane = material(
        s.Lobe("MIRROR", constant(0.45, 0.4, 0.35)),
        s.Lobe("REFRACTION", constant(0.55, 0.6, 0.65), ior=1.02),
    )
    panes = np.repeat(IDENTITY[None], 6, 0)
    panes[:, 2, 3], panes[:, 0, 2] = np.arange(6), 0.1 * np.arange(6)
    view = s.Camera(
        "PERSPECTIVE", np.column_stack([np.eye(3), (0, 0, 9)]), (-0.2, 0.2, -0.2, 0.2), (size, size)
    )
    tilted = s.Instances("panes", 0, panes, (0,))
    scene = s.Scene(
        view, (square(30.0),), (tilted,), (pane,), (), (), s.World(background=(0.3, 0.5, 0.7))
    )
    deep = engine.Settings(samples=1, max_bounces=bounces)
    whole = engine.render(scene, deep)
    assert whole.stats["mirror rays"] + whole.stats["refraction rays"] > size**2 * 40
    for x, y in ((0, 0), (size // 2, size // 3), (size - 1, 1)):
        alone = engine.render(scene, replace(deep, region=(x, y, x + 1, y + 1)))
        assert alone.combined.tobytes() == whole.combined[y, x].tobytes()


def test_two_renders_at_once() -> None:
    scene, films = busy_scene(), []
    threads = [
        threading.Thread(target=lambda: films.append(bits(engine.render(scene, BUSY))))
        for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert films == [bits(engine.render(scene, BUSY))] * 2


def test_waves_are_complete_pictures() -> None:
    scene, waves = busy_scene(), []
    final = engine.render(scene, replace(BUSY, samples=6), on_wave=waves.append)
    assert [wave.samples for wave in waves] == [1, 2, 4, 6]
    assert bits(waves[-1]) == bits(final)
    # A wave is the mean of its samples: wave 1 alone is the picture of one sample whose light
    # points are those of six.
    assert np.isfinite(waves[0].combined).all()
    assert np.array_equal(waves[0].passes["Depth"], final.passes["Depth"])
    assert all(wave.complete for wave in waves)


def test_no_wave_is_lost_when_waves_are_quick() -> None:
    waves: list[int] = []
    scene = s.Scene(view_from_above(1), world=s.World(background=(1, 1, 1)))
    engine.render(
        scene, engine.Settings(samples=1024), on_wave=lambda film: waves.append(film.samples)
    )
    assert waves == [2**k for k in range(11)]


def test_progress_rises_to_one() -> None:
    fractions: list[float] = []
    engine.render(busy_scene(), BUSY, on_progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1
    assert min(fractions) >= 0


@pytest.mark.parametrize("upper", [False, True])
def test_any_part_of_a_wave_tells_what_the_rest_costs(upper: bool) -> None:
    """Half of the picture takes nearly all of the time, and half of the samples half of it."""
    half = np.array([[-9, 0, 0], [9, 0, 0], [9, 9, 0], [-9, 9, 0]], np.float32)
    half = half if upper else half * np.array([1, -1, 1], np.float32)
    sheet = s.Mesh("sheet", half, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    above = np.column_stack([np.eye(3), (0.0, 0.0, 2.0)])
    scene = s.Scene(
        s.Camera("PERSPECTIVE", above, (-1.0, 1.0, -1.0, 1.0), (256, 256)),
        (sheet,),
        (s.Instances("sheet", 0, np.eye(3, 4)[None], (0,)),),
        (s.Material("matt", (s.Lobe("DIFFUSE", (s.Input((0.8, 0.8, 0.8)),)),)),),
        lights=(s.Light("lamp", "POINT", above, strength=9.0, radius=0.5),),
    )
    settings = engine.Settings(samples=16, light_samples=64, threads=1, soft_light="SHARED")
    told: list[tuple[float, float]] = []
    start = time.process_time()
    engine.render(
        scene, settings, on_progress=lambda fraction: told.append((time.process_time(), fraction))
    )
    middle = min(at for at, fraction in told if fraction >= 0.5)
    assert 0.3 < (middle - start) / (told[-1][0] - start) < 0.7


def sheets(places: np.ndarray) -> s.Scene:
    """A square of 18 at each place, above each other, seen from above over -2 to 2."""
    corners = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], np.float32)
    above = np.column_stack([np.eye(3), (0.0, 0.0, 2.0)])
    return s.Scene(
        s.Camera("PERSPECTIVE", above, (-1.0, 1.0, -1.0, 1.0), (256, 256)),
        (s.Mesh("sheet", corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)),),
        (s.Instances("sheet", 0, places, (0,)),),
        (s.Material("matt", (s.Lobe("DIFFUSE", (s.Input((0.8, 0.8, 0.8)),)),)),),
        lights=(s.Light("lamp", "POINT", above, strength=9.0, radius=0.5),),
    )


def stripes(first: float, end: float) -> np.ndarray:
    """Places of narrow sheets from side to side, between two heights of the picture."""
    places = np.stack([np.eye(3, 4) for _ in range(256)])
    places[:, 0, 0] = 0.0005
    places[:, 1, 1] = (end - first) / 18
    places[:, 0, 3] = np.linspace(-2, 2, 256)
    places[:, 1, 3] = (first + end) / 2
    return places


SEEN_FINELY = engine.Settings(samples=8, visibility_samples=16, soft_light="RESOLVED", threads=1)


def test_progress_tells_what_visibility_samples_will_take() -> None:
    """A wave's end tells how many samples they are worth, from what differs from its neighbours:
    nothing of an even sheet, all of stripes.
    """
    found = {}
    for name, places in (("even", np.eye(3, 4)[None]), ("striped", stripes(-2, 2))):
        told: list[float] = []
        worth: list[float] = []
        engine.render(
            sheets(places),
            SEEN_FINELY,
            on_progress=told.append,
            on_wave=lambda film, told=told, worth=worth: worth.append(
                film.samples / told[-1] - SEEN_FINELY.samples
            ),
        )
        assert told[-1] == 1
        found[name] = worth[:-1]
    assert max(found["even"]) < 0.5
    assert min(found["striped"]) > 1


@pytest.mark.parametrize("first", [-2, 0])
def test_any_part_of_the_last_picture_tells_what_its_rest_costs(first: int) -> None:
    """Half of the picture takes nearly all of the time, and half of its tiles half of it."""
    told: list[tuple[float, float]] = []
    waves: list[float] = []
    engine.render(
        sheets(stripes(first, first + 2)),
        SEEN_FINELY,
        on_progress=lambda fraction: told.append((time.process_time(), fraction)),
        on_wave=lambda film: waves.append(told[-1][1] / film.samples),
    )
    sampled = SEEN_FINELY.samples * waves[-2]
    start = max(at for at, fraction in told if fraction <= sampled)
    middle = next(at for at, fraction in told if at > start and fraction > (1 + sampled) / 2)
    assert 0.3 < (middle - start) / (told[-1][0] - start) < 0.7


def test_cancel_is_prompt_and_keeps_the_last_wave() -> None:
    """Minutes of work: only a cancel ends it soon."""
    scene, settings = (
        busy_scene(),
        replace(BUSY, samples=1 << 16, light_samples=1, passes=frozenset(("Depth",)), threads=2),
    )
    fractions = [0.0]

    def should_stop() -> bool:
        return fractions[-1] > 2.5 / settings.samples  # in the midst of the third wave

    film = engine.render(
        scene,
        settings,
        should_stop=should_stop,
        on_progress=fractions.append,
        on_wave=lambda film: None,
    )
    # The core looks at the flag before each batch of rays; the slack, a 64th of the work, is for a
    # machine that does other things as well.
    assert film.samples <= settings.samples >> 6
    assert not film.complete
    assert film.samples in [2**k for k in range(1, 16)]
    assert film.combined[..., 3].min() > 0


def test_cancel_before_the_first_wave() -> None:
    film = engine.render(
        busy_scene(), replace(BUSY, samples=1 << 12, light_samples=16), should_stop=lambda: True
    )
    assert not film.complete
    if film.samples == 0:
        assert film.passes["Depth"].min() == np.float32(1e10)
        assert film.combined.max() == 0


def test_exceptions_of_callbacks_end_the_render() -> None:
    def broken(*_: object) -> None:
        raise KeyError("mine")

    for name in ("on_progress", "on_wave", "should_stop"):
        with pytest.raises(KeyError, match="mine"):
            engine.render(
                busy_scene(), replace(BUSY, samples=1 << 14, light_samples=1), **{name: broken}
            )


def test_the_gil_is_free_while_the_core_works() -> None:
    count, done = [0], threading.Event()

    def work() -> None:
        while not done.is_set():
            count[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=work)
    thread.start()
    engine.render(busy_scene(), replace(BUSY, samples=32))
    done.set()
    thread.join()
    assert count[0] > 20


@pytest.mark.slow
def test_mean_of_a_million_samples_is_exact() -> None:
    """N16: 1e6 samples of 0.1 + 0.3 average to their value to 1e-6 (here: to the last bit of
    float32).
    """
    scene = s.Scene(
        view_from_above(1),
        (square(),),
        (placed(),),
        (material(s.Lobe("EMISSION", constant(0.1, 0.3, 1e-3))),),
    )
    film = draw(scene, samples=1_000_000, filter_width=0.0)
    assert np.abs(film.combined[0, 0, :3] - np.float32([0.1, 0.3, 1e-3])).max() <= 1e-9


def test_scene_without_anything() -> None:
    film = draw(s.Scene(view_from_above(), world=s.World(background=(0.5, 0.25, 0.125))), *ALL)
    assert np.array_equal(
        film.combined, np.broadcast_to(np.float32([0.5, 0.25, 0.125, 1]), (16, 16, 4))
    )
    assert film.passes["Depth"].min() == np.float32(1e10)
    empty = s.Mesh("empty", np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    draw(
        s.Scene(
            view_from_above(),
            (empty, square()),
            (placed(0, ()), replace(placed(1, ()), world_from_object=np.zeros((0, 3, 4)))),
        )
    )


def test_an_instruction_set_that_is_not_to_be_had_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = busy_scene()
    settings = replace(BUSY, samples=1)
    monkeypatch.setenv("GLINT_ISA", "avx9")
    (note,) = render_native(scene, settings).notes
    assert "GLINT_ISA is 'avx9'" in note and "unset it" in note
    monkeypatch.setenv("GLINT_ISA", note.split(": ")[1].split()[0])
    assert render_native(scene, settings).notes == ()


def test_statistics_say_what_was_done() -> None:
    film = engine.render(busy_scene(), BUSY)
    assert film.stats["camera rays"] == 75 * 53 * 3
    assert film.stats["instances"] == 10
    assert film.stats["triangles"] == 32 + 9 * 224
    for name in (
        "build",
        "trace",
        "bytes",
        "shadow rays",
        "mirror rays",
        "refraction rays",
        "transparent rays",
    ):
        assert film.stats[name] > 0, name
    active = {name.removeprefix("feature: ") for name in film.stats if name.startswith("feature: ")}
    assert active == {"mirror", "refraction", "transparent", "soft lights", "smooth normals"}
    plain = draw(SOUND)
    assert plain.stats["shadow rays"] == 256
    assert not [name for name in plain.stats if name.startswith("feature")]
