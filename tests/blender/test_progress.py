"""The header and the bar during a render: they move from the first second on, and say samples,
error and what remains.
"""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from glint import engine
from glint.addon.render.progress import Progress

pytestmark = pytest.mark.once

SETTINGS = engine.Settings(samples=64, error_threshold=4.0)


class Render:
    """A render engine's half, and a clock that is set by hand."""

    def __init__(self, tells=True, start=0.0):
        self.now, self.bar, self.texts = start, [], []
        self.progress = Progress(self, "Scene, ViewLayer", tells, clock=lambda: self.now)

    def update_progress(self, fraction):
        self.bar.append(fraction)

    def update_stats(self, about, text):
        assert about == "Scene, ViewLayer"
        self.texts.append(text)

    def at(self, seconds):
        self.now = seconds
        return self.progress


def film(samples, level):
    return SimpleNamespace(samples=samples, passes={"Error": np.full((2, 2, 1), level, np.float32)})


def test_the_bar_moves_in_stages_of_unknown_length_and_never_back():
    render = Render()
    ask = render.progress.watching("Looking for settings", lambda: False)
    for k in range(1, 41):
        render.at(k / 10)
        assert ask() is False
    for k in range(41, 61):
        render.at(k / 10).trace(0.0, SETTINGS)
    render.at(6.1).trace(0.001, SETTINGS)
    render.at(7.0).trace(0.5, SETTINGS)
    assert (
        render.bar[0] > 0
        and render.bar == sorted(render.bar)
        and 0.01 < render.bar[-3] < 0.05
        and render.bar[-1] == 0.5
    )
    assert (
        render.texts[0] == "Looking for settings (0 s)"
        and "Sorting the scene (5 s)" in render.texts
    )
    assert (
        all(b >= a for a, b in zip(render.bar, render.bar[1:], strict=False))
        and len(set(render.bar[:40])) == 40
    )


def test_the_text_tells_samples_error_and_what_remains():
    render = Render()
    render.at(1).trace(0.0, SETTINGS)  # the tree took a second, which says nothing of what comes
    render.at(2).trace(0.1, SETTINGS)
    assert render.texts[-1] == "Sample 6/64", "nobody knows yet what the threshold saves"
    render.at(2).trace(0.125, SETTINGS)
    render.at(2).end_wave(film(8, 12.0))
    render.at(3).trace(0.15625, SETTINGS)
    assert render.texts[-1] == "Sample 10/64 | Error 12/255 | Remaining 00:27"
    render.at(3.05).trace(0.2, SETTINGS)
    assert render.texts[-1].startswith("Sample 10/64"), "no more than two texts a second"


def test_the_slow_tracer_is_named():
    render = Render()
    render.at(1).trace(0.1, engine.Settings(samples=64, error_threshold=4.0, backend="NUMPY"))
    assert render.texts == ["Sample 6/64 | Python tracer"]


def test_a_program_without_windows_is_told_no_texts():
    render = Render(tells=False)
    render.at(1).trace(0.5, SETTINGS)
    assert render.bar == [0.5] and render.texts == []


@pytest.mark.parametrize("beyond", [0, 3])
@pytest.mark.parametrize("pause", [0.0, 2.0])
def test_remaining_time_is_true_from_a_tenth_on(pause, beyond):
    """Within 20 % and half of the second that the text rounds to; pause: seconds between a wave's
    last sample and its picture, which averages what the wave brought. beyond: work of so many
    samples by other rays, along with which the last picture is made; the first wave's end tells of
    it.
    """
    samples, each = 8, 5.0
    settings = engine.Settings(samples=samples, visibility_samples=4 if beyond else 1)
    steps = samples
    render, done, told = Render(), 0, []

    def go_on(seconds, work):
        render.at(render.now + seconds).trace(work / steps, settings)
        told.append((render.now, done, render.texts[-1]))

    for last in (1, 2, 4, 8):
        for k in range(40 * (last - done)):
            go_on(each / 40, done + (k + 1) / 40)
        if last == samples and beyond:
            for k in range(40 * beyond):  # with the picture
                go_on(each / 40 + pause / (40 * beyond), samples + (k + 1) / 40)
        else:
            for _ in range(8):
                go_on(pause / 8, last)
        steps = samples + beyond
        go_on(0, steps if last == samples else last)
        render.progress.end_wave(film(last, 1.0))
        done = last
    total = render.now
    for at, taken, text in told:
        match = re.match(r"Sample (\d+)/8 .* Remaining (\d+):(\d+)", text)
        sample, minutes, seconds = map(int, match.groups())
        remaining = 60 * minutes + seconds
        assert sample >= taken - 1  # the text is up to half a second old
        if at > 0.1 * total:
            assert abs(remaining + 0.5 - (total - at)) < 0.2 * (total - at) + 1, (at, text)


def test_pictures_of_waves_take_as_long_as_the_one_before():
    """Where there are many, and little between them."""
    settings, render, each, pause = engine.Settings(samples=64), Render(), 0.1, 2.0
    waves = [2**k for k in range(7)]
    total = each * 64 + pause * len(waves)
    done = 0
    for last in waves:
        for k in range(done + 1, last + 1):
            render.at(render.now + each).trace(k / 64, settings)
        for _ in range(4):
            render.at(render.now + pause / 4).trace(last / 64, settings)
            minutes, seconds = map(int, re.search(r"(\d+):(\d+)$", render.texts[-1]).groups())
            left = total - render.now
            if last > 1:
                assert abs(60 * minutes + seconds + 0.5 - left) < 0.2 * left + 1
        render.progress.end_wave(film(last, 1.0))
        done = last


def test_a_scene_that_is_sorted_before_anybody_asks_has_a_remaining_time():
    """The clock did not start with the program."""
    render = Render(start=5000.0)
    render.at(5001.0).trace(0.125, engine.Settings(samples=8))
    [text] = render.texts
    assert re.fullmatch(r"Sample 1/8 \| Remaining 00:0[789]", text), "seven, and pictures"


def test_a_last_picture_that_takes_longer_than_was_known_tells_it_by_itself():
    """Work of three samples, which takes three times as long as those."""
    settings, render = engine.Settings(samples=2, visibility_samples=4), Render()
    render.at(0).trace(0.0, settings)
    for samples in (1, 2):
        for k in range(1, 11):
            render.at(render.now + 1).trace(
                (samples - 1 + k / 10) / (2 if samples == 1 else 5), settings
            )
        if samples == 1:
            render.progress.trace(1 / 5, settings)
            render.progress.end_wave(film(1, 1.0))
    for k in range(1, 13):
        render.at(20 + 7.5 * k).trace((2 + k / 4) / 5, settings)
        minutes, seconds = map(int, re.search(r"(\d+):(\d+)$", render.texts[-1]).groups())
        left = 90 - 7.5 * k
        if k > 3:
            assert abs(60 * minutes + seconds + 0.5 - left) < 0.2 * left + 1
