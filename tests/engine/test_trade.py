"""Time against error: the grid, the front, the errors, and stopping."""

import json
from dataclasses import replace

import numpy as np
import pytest

import engine_scenes as scenes
from glint import engine
from glint.engine import (
    Scene,
    SceneError,
    Settings,
    available_backends,
)
from glint.engine.analysis import (
    metrics,
    trade,
    trade_crops,
    trade_errors,
    trade_plot,
    trade_tunables,
)
from glint.engine.analysis.trade_rows import Row, Trade, advice, with_bounds, with_front
from glint.engine.scene import Lobe, Material, Medium, World
from test_reflections import floor_before_wall

BACKEND = available_backends()[0]
TUNABLES = {"samples": 1, "light_samples": 1, "max_bounces": 0}


def soft_scene(**more) -> Scene:
    """A floor and a box under an area light, 16 × 12 pixels."""
    lamp = scenes.light("AREA", size_x=2.0, size_y=2.0)
    floor, box = scenes.grid_mesh(), scenes.box_mesh()
    placed = (
        scenes.s.Instances("floor", 0, scenes.at(), (0,)),
        scenes.s.Instances("box", 1, scenes.at((0, 0, 0.5), 0.5), (0,)),
    )
    view = scenes.camera(size=(16, 12))
    return Scene(view, (floor, box), placed, (scenes.surface(),), lights=(lamp,), **more)


def row(seconds, error, **more):
    return Row(dict(TUNABLES), seconds, seconds, error, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, **more)


def measured(scene=None, **more):
    options = {
        "values": {"samples": [1, 4, 16], "error_threshold": [0.0], "light_samples": [2]},
        "reference_samples": 64,
        "repeats": 1,
    }
    return trade.measure(
        scene or soft_scene(),
        Settings(samples=4, light_samples=2, backend=BACKEND),
        **{**options, **more},
    )


# --- crops


@pytest.mark.parametrize("samples", [1, 4, 16])
def test_crops_cost_and_show_what_a_render_does_however_often_they_are_drawn(samples):
    """No ray is remembered from before: else the second time of a setting would be told as its
    time.
    """
    scene, settings = soft_scene(), Settings(samples=samples, light_samples=2, backend=BACKEND)
    film = engine.render(scene, settings)
    with trade_crops.CropRenderer(scene, ((0, 0, 16, 12),), lambda: False) as renderer:
        for drawn in (renderer.render(settings) for _ in range(3)):
            assert drawn.rays == film.stats["rays"]
            np.testing.assert_array_equal(drawn.pictures[0], film.combined[..., :3])


def test_a_small_crop_takes_no_more_rays_than_its_share_of_the_frame():
    """Where rough surfaces reflect, too."""
    scene, settings = floor_before_wall((96, 80)), Settings(samples=4, reflections="ALL")
    film = engine.render(scene, settings)
    crops = [(x, y, x + 12, y + 12) for x, y in ((6, 4), (25, 26), (80, 66))]
    with trade_crops.CropRenderer(scene, tuple(crops), lambda: False) as renderer:
        rays = renderer.render(settings).rays
    assert rays < 1.25 * film.stats["rays"] * trade_crops.area(crops) / (96 * 80)


# --- the front


def test_the_front_is_what_nothing_beats():
    rows = with_front(
        [
            row(3, 0.5),
            row(1, 1.0),
            row(2, 0.6),
            row(2, 0.7),
            row(2.5, 0.6),
            row(4, 0.1),
            row(5, 0.1),
        ]
    )
    assert [(r.seconds, r.relative_rmse) for r in rows if r.on_front] == [
        (1, 1.0),
        (2, 0.6),
        (3, 0.5),
        (4, 0.1),
    ]


def test_the_front_is_one_of_the_times_that_are_told():
    """Of whole frames, whatever the squares took together."""
    rows = [replace(row(1.0, 0.5), frame_seconds=3.0), replace(row(2.0, 0.1), frame_seconds=2.0)]
    assert [r.on_front for r in with_front(rows)] == [True, False]
    shown = Trade(with_front(rows), "", (), (1, 1), 1, True).shown
    assert [r.frame_seconds for r in shown] == [2.0]


def test_no_row_of_the_front_is_dominated_and_every_other_is():
    numbers = np.random.default_rng(5).random((40, 2))
    rows = with_front([row(*pair) for pair in numbers])
    for one in rows:
        beaten = any(
            o.seconds <= one.seconds
            and o.relative_rmse <= one.relative_rmse
            and (o.seconds, o.relative_rmse) != (one.seconds, one.relative_rmse)
            for o in rows
        )
        assert beaten != one.on_front


def test_advice_names_the_faster_setting_that_is_as_good():
    slow = replace(row(4, 0.5, current=True), tunables={**TUNABLES, "samples": 64})
    rows = with_front(
        [row(1, 1.0), replace(row(2, 0.5), tunables={**TUNABLES, "samples": 16}), slow]
    )
    assert (
        advice(Trade(rows, "", (), (1, 1), 1, True))
        == "Samples 16 would be as good in 50% of the time"
    )
    flat = Trade(with_front([row(1, 0.0), row(2, 0.0, current=True)]), "", (), (1, 1), 1, True)
    assert "same picture" in advice(flat)
    alone = Trade(with_front([row(1, 1.0, current=True)]), "", (), (1, 1), 1, True)
    assert "lie on the front" in advice(alone)


# --- the grid


def test_the_grid_holds_only_tunables_that_can_matter():
    hard = replace(soft_scene(), lights=(scenes.light("POINT"),))
    mirror = replace(hard, materials=(scenes.surface(lobes=(Lobe("MIRROR"),)),))
    base = Settings(samples=3, light_samples=5, max_bounces=7)
    always = {"samples", "error_threshold"}
    metal = Material("metal", (Lobe("SPECULAR", exponent=9.0, masking=0.3),))
    metal, glow = (
        replace(hard, materials=(material,))
        for material in (metal, scenes.surface(lobes=(Lobe("EMISSION"),)))
    )
    foggy = replace(hard, world=World(medium=Medium(scattering=(0.1, 0.1, 0.1))))
    skin = replace(hard, materials=(Material("s", (Lobe("DIFFUSE", radius=(0.1, 0.1, 0.1)),)),))
    sky = scenes.light("DOME", radiance=np.ones((1, 1, 3), np.float32))
    under_a_sky = replace(hard, lights=(sky,))
    fibre = Material("fibre", (Lobe("FIBRE_TRANSMISSION", exponent=9.0),))
    hair = replace(hard, materials=(fibre,))
    bounced, many = replace(base, diffuse_bounces=2), always | {"light_samples"}
    for scene, settings, varied in (
        (hard, base, always),
        (soft_scene(), base, always | {"light_samples"}),
        (mirror, base, always | {"max_bounces", "cutoff"}),
        (metal, base, always | {"max_bounces", "cutoff", "reflections"}),
        (metal, replace(base, reflections="OFF"), always),
        (glow, base, many | {"mesh_light"}),
        (glow, replace(base, mesh_light="OFF"), always),
        (hard, bounced, many | {"diffuse_bounces"}),
        (hair, bounced, many | {"diffuse_bounces", "max_bounces"}),
        (hair, base, always),
        (hard, replace(bounced, illumination="CLASSIC"), always),
        (foggy, base, always | {"volume_samples"}),
        (skin, base, always | {"subsurface"}),
        (skin, replace(base, subsurface="OFF"), always),
        (under_a_sky, base, many | {"world_light"}),
        (under_a_sky, replace(base, world_light="CONSTANT"), always),
    ):
        grid = trade_tunables.settings_grid(scene, settings, {})
        assert {
            tunable.name
            for tunable in trade_tunables.TUNABLES
            if len({getattr(s, tunable.name) for s in grid}) > 1
        } == varied
        assert settings in grid


def test_bounced_light_is_measured_against_more_of_it():
    hard = replace(soft_scene(), lights=(scenes.light("POINT"),))
    base = Settings(samples=4, light_samples=2, diffuse_bounces=1)
    wanted = trade.reference_settings(hard, base, trade_tunables.settings_grid(hard, base, {}), 64)
    assert wanted.diffuse_bounces == 8
    assert wanted.light_samples > 1
    off = replace(base, diffuse_bounces=0)
    wanted = trade.reference_settings(hard, off, trade_tunables.settings_grid(hard, off, {}), 64)
    assert (wanted.diffuse_bounces, wanted.light_samples) == (0, 1)


def test_gloss_is_measured_against_all_of_it():
    """Also where less of it is wanted; where none is it has no price."""
    painted = scenes.surface(lobes=(Lobe("SPECULAR", exponent=9.0, masking=0.3, fresnel=1.0),))
    scene = replace(soft_scene(), materials=(painted,))
    for wanted, rows, against in (
        ("METALS", ["OFF", "METALS", "ALL"], "ALL"),
        ("ALL", ["OFF", "METALS", "ALL"], "ALL"),
        ("OFF", ["OFF"], "OFF"),
    ):
        base = Settings(reflections=wanted)
        grid = trade_tunables.settings_grid(scene, base, {})
        assert sorted({s.reflections for s in grid}) == sorted(rows)
        assert trade.reference_settings(scene, base, grid, 64).reflections == against


def test_what_light_is_drawn_at_all_has_a_price():
    """Without what the rows tell."""
    sky = scenes.light("DOME", radiance=np.full((1, 1, 3), 0.5, np.float32))
    found = measured(
        replace(soft_scene(), lights=(*soft_scene().lights, sky)),
        values={"samples": [4], "error_threshold": [0.0], "light_samples": [2]},
        reference_seconds=0.0,
    )
    rows = {r.tunables["world_light"]: r for r in found.rows}
    assert rows["OCCLUDED"].current and rows["OCCLUDED"].frame_seconds > 0
    assert rows["CONSTANT"].relative_rmse > 2 * rows["OCCLUDED"].relative_rmse > 0
    assert {trade_plot._name(row, ["world_light"]) for row in found.rows} == {
        "constant",
        "occluded",
    }


def test_each_tunable_goes_from_fast_to_accurate_and_the_threshold_only_where_it_can_stop_a_pixel():
    hard = replace(soft_scene(), lights=(scenes.light("POINT"),))
    grid = trade_tunables.settings_grid(
        hard, Settings(samples=16, error_threshold=4.0), {"samples": [4, 16]}
    )
    assert [(s.samples, s.error_threshold) for s in grid] == [
        (4, 0.0),
        (16, 8.0),
        (16, 4.0),
        (16, 2.0),
        (16, 0.0),
    ]


def test_bounces_are_combined_with_each_other_but_not_with_samples():
    mirror = replace(soft_scene(), materials=(scenes.surface(lobes=(Lobe("MIRROR"),)),))
    base = Settings(samples=16, light_samples=2, max_bounces=4)
    values = {
        "samples": [1, 16],
        "error_threshold": [0.0],
        "light_samples": [2, 4],
        "max_bounces": [0, 2],
        "cutoff": [0.01],
    }
    grid = trade_tunables.settings_grid(mirror, base, values)
    sampling, bounces = (base.max_bounces, base.cutoff), (base.samples, base.light_samples)
    assert [
        (s.samples, s.light_samples) for s in grid if (s.max_bounces, s.cutoff) == sampling
    ] == [(1, 2), (1, 4), (16, 2), (16, 4)]
    others = [
        (s.max_bounces, s.cutoff)
        for s in grid
        if s != base and (s.samples, s.light_samples) == bounces
    ]
    assert others == [(0, 0), (2, 0.01), (2, 0), (4, 0.01)]
    assert len(grid) == 8


def test_an_error_threshold_saves_time_and_loses_little():
    """A picture that is flat but for a box: the threshold stops the floor's pixels."""
    found = measured(
        values={"samples": [64], "error_threshold": [0.0, 20.0]}, reference_seconds=0.0
    )
    rows = {r.tunables["error_threshold"]: r for r in found.rows}
    assert 0 < rows[0.0].relative_rmse < rows[20.0].relative_rmse < 0.05


def test_an_unknown_tunable_is_named():
    with pytest.raises(SceneError, match="no such tunable: colour"):
        trade_tunables.settings_grid(soft_scene(), Settings(), {"colour": [1]})


def speckled(width, height, seed=0):
    """(h, w) errors: little everywhere, much in a few pixels."""
    random = np.random.default_rng(seed)
    return random.random((height, width)) ** 8 + 100 * (random.random((height, width)) > 0.999)


@pytest.mark.parametrize("resolution", [(1920, 1080), (100, 700), (241, 135)])
def test_squares_lie_inside_and_apart_and_half_of_them_share_none_with_the_rest(resolution):
    squares = trade_crops.pick_squares(speckled(*resolution), 96, 12)
    seen = np.zeros(resolution[::-1], int)
    for x0, y0, x1, y1 in squares.crops:
        assert 0 <= x0 < x1 <= resolution[0] and 0 <= y0 < y1 <= resolution[1]
        seen[y0:y1, x0:x1] += 1
    assert seen.max() == 1 and len(squares.crops) == 96
    one, other = squares.halves()
    assert not set(one.crops) & set(other.crops) and len(one.crops) == len(other.crops) == 48


@pytest.mark.parametrize("seed", range(4))
def test_weighted_squares_sum_up_to_the_frame(seed):
    """Where the errors lie as the first look said, and where they are everywhere alike; the
    border's squares are smaller ones.
    """
    look = speckled(241, 135, seed)
    for half in trade_crops.pick_squares(look, 96, 12).halves():
        for errors, tolerance in ((look, 0.1), (np.ones_like(look), 0.15)):
            found = sum(
                weight * errors[y0:y1, x0:x1].sum()
                for weight, (x0, y0, x1, y1) in zip(half.weights, half.crops, strict=True)
            )
            assert found == pytest.approx(errors.sum(), rel=tolerance)


def test_a_small_frame_is_one_square():
    squares = trade_crops.pick_squares(np.ones((200, 60)), 96, 12)
    assert squares.crops == ((0, 0, 60, 200),) and squares.weights.tolist() == [1.0]


@pytest.mark.parametrize(
    ("size", "shrunk"),
    [((300, 400), (300, 400)), ((641, 481), (321, 241)), ((1920, 1080), (480, 270))],
)
def test_a_first_look_draws_few_pixels_of_a_large_frame(monkeypatch, size, shrunk):
    """What it picks lies in the frame itself, and stands for all of it."""
    drawn = []
    render = trade.CropRenderer.render

    def watched(renderer, *given, **more):
        drawn.append((renderer.scene.camera.resolution, renderer.crops))
        return render(renderer, *given, **more)

    monkeypatch.setattr(trade.CropRenderer, "render", watched)
    scene = replace(soft_scene(), camera=scenes.camera(size=size), lights=())
    with trade.CropRenderer(scene, ((0, 0, *size),), lambda: False) as renderer:
        work = trade._Work(renderer, Settings(backend=BACKEND), [], print, print)
        work.look(96, 12)
        assert (renderer.scene, renderer.crops) == (scene, ((0, 0, *size),))
    assert set(drawn) == {(shrunk, ((0, 0, *shrunk),))}
    boxes = np.array(work._squares.crops + work._others.crops)
    assert (boxes >= 0).all() and (boxes[:, 2:] <= size).all()
    assert len(boxes) == 96 and boxes[:, 2:].max(0).min() > max(shrunk) * (shrunk != size)
    for half in (work._squares, work._others):
        assert half.pixel_weights.sum() == pytest.approx(size[0] * size[1], rel=0.25)


@pytest.mark.parametrize(("looked", "side"), [(2**17, 12), (2**13, 6)])
def test_the_front_tells_the_errors_of_the_whole_frame(monkeypatch, looked, side):
    """A box before a large, even floor: all that samples change lies along a few edges, which
    evenly spread squares miss; also where a first look has a quarter of the frame's pixels.
    """
    monkeypatch.setattr(trade, "_LOOK", looked)
    scene = replace(
        soft_scene(), camera=scenes.camera(size=(160, 120)), lights=(scenes.light("POINT"),)
    )
    base = Settings(samples=4, error_threshold=0.0, backend=BACKEND)
    found = trade.measure(
        scene,
        base,
        values={"samples": [1, 4, 16, 64], "error_threshold": [0.0]},
        reference_samples=64,
        repeats=1,
        reference_seconds=0.0,
        side=side,
    )
    assert len(found.crops) == 96 and found.front[-1].relative_rmse == 0
    truth = engine.render(scene, replace(base, samples=64)).combined[..., :3]
    for row in found.front:
        picture = engine.render(scene, replace(base, **row.tunables)).combined[..., :3]
        true = metrics.relative_rmse(picture, truth)
        assert row.checked
        if row.relative_rmse == 0:
            assert true <= row.bound > 0
        else:
            assert true / 1.25 < row.relative_rmse < 1.25 * true
            assert 0 < row.spread < 0.5


def test_what_no_square_met_is_bounded():
    """A frame of which as many squares are wrong as are missed once in 20 has just the error that
    the bound tells; what has no error is told with the bound of the least that has one.
    """
    frame, picked, side, wrong = 1000, 100, 4, 0.25
    squares = trade_crops.Squares(
        tuple((side * k, 0, side * k + side, side) for k in range(picked)),
        np.full(picked, frame / picked),
    )
    apart = np.zeros((picked, side * side, 3))
    apart[7] = wrong
    apart[8, 0] = wrong / 2
    pixels = apart.reshape(-1, 3)
    error = metrics.root_mean_square(pixels, squares.pixel_weights)
    found = trade_errors.uncertainty(pixels, squares, error)
    missed = 3 * frame / picked
    assert (1 - picked / frame) ** missed == pytest.approx(0.05, abs=0.01)
    assert found["unseen"] == pytest.approx(wrong * np.sqrt(missed / frame))

    rows = [row(3, 0.0), row(2, 0.01, unseen=0.03), row(1, 0.02, unseen=0.05)]
    assert [r.bound for r in with_bounds(rows)] == [0.03, 0.0, 0.0]
    assert [r.bound for r in with_bounds(rows[:1])] == [0.0]


def test_something_is_told_early_and_the_last_of_it_is_the_result(monkeypatch):
    monkeypatch.setattr(trade, "_PAUSE", 0.0)
    told = []
    result = measured(on_trade=told.append)
    assert len(told) >= len(result.rows) and len(told[0].rows) == 1 and told[0].rows[0].current


def test_the_first_answer_takes_few_samples_and_makes_way_for_the_rest():
    told, fractions = [], []
    samples = trade._GLANCE * trade._GLANCE_MARGIN
    ladder = {"samples": [1, 4, 16], "error_threshold": [2.0, 0.0], "light_samples": [1, 2]}
    result = measured(
        on_trade=told.append,
        on_progress=fractions.append,
        reference_samples=samples,
        values=ladder,
    )
    assert fractions == sorted(fractions) and fractions[3] < 0.5, "of the first answer"
    first = told[0]
    assert (
        first.reference.startswith("a first look") and f"{trade._GLANCE} samples" in first.reference
    )
    tunables = {
        (row.tunables["error_threshold"], row.tunables["light_samples"]) for row in first.rows
    }
    assert tunables == {(0.0, 2)} and [r.tunables["samples"] for r in first.rows if r.current] == [
        4
    ]
    assert len(first.rows) == 3 and all(len(t.rows) >= 3 for t in told)
    assert len(result.rows) > 3 and f"{samples} samples" in result.reference


def test_at_most_six_different_points_and_the_current_settings_are_shown():
    rows = with_front(
        [row(2.0**k, 0.5**k) for k in range(20)] + [row(2.0**19.5, 0.5, current=True)]
    )
    shown = Trade(rows, "", (), (1, 1), 1, True).shown
    assert len(shown) == 7 and shown[-1].current
    assert (shown[0].seconds, shown[5].seconds) == (1.0, 2.0**19)
    gaps = np.diff(np.log2([r.seconds for r in shown[:6]]))
    assert gaps.min() >= 2


@pytest.mark.parametrize("place", [0, 1, 7, 18, 19])
def test_the_current_settings_are_shown_on_the_front_too(place):
    """Beside the ends, however near one of them it lies."""
    rows = with_front([row(2.0**k, 0.5**k, current=k == place) for k in range(20)])
    shown = Trade(rows, "", (), (1, 1), 1, True).shown
    assert len(shown) == 6 and [r.current for r in shown].count(True) == 1
    assert (shown[0].seconds, shown[5].seconds) == (1.0, 2.0**19)


# --- measuring


def test_more_samples_are_nearer_to_the_reference():
    rows = {r.tunables["samples"]: r for r in measured().rows}
    assert rows.keys() == {1, 4, 16}
    assert rows[1].relative_rmse > 2 * rows[4].relative_rmse > 2 * rows[16].relative_rmse > 0
    assert (
        rows[1].flip_mean > rows[16].flip_mean
        and rows[1].psnr < rows[16].psnr
        and rows[1].wrong >= rows[16].wrong
    )
    assert [r.current for r in rows.values()] == [k == 4 for k in rows]


def exact(**more):
    """A hard light, where a row and the reference have the same samples and the same tracer: the
    same picture.
    """
    scene = replace(soft_scene(), lights=(scenes.light("POINT"),))
    return measured(
        scene,
        values={"samples": [64], "error_threshold": [0.0]},
        reference_seconds=1e9 if BACKEND == "NUMPY" else 0.0,
        **more,
    )


def test_the_reference_itself_has_no_error():
    last = next(r for r in exact().rows if r.tunables["samples"] == 64)
    assert (last.relative_rmse, last.max_error, last.levels, last.flip_mean, last.wrong) == (
        0,
        0,
        0,
        0,
        0,
    )


def test_the_reference_says_who_made_it():
    assert measured(reference_seconds=1e9).reference.startswith("the float64 tracer")
    if BACKEND == "NATIVE":
        assert measured(reference_seconds=0.0).reference.startswith("the core itself")


def test_stopping_keeps_what_was_measured():
    calls = []

    def stop_late():
        calls.append(None)
        return len(calls) > 12

    assert not measured(should_stop=lambda: True).rows
    result = measured(should_stop=stop_late)
    assert not result.complete
    assert result.repeats == 0
    assert measured().complete


def test_progress_goes_up_to_one():
    told = []
    measured(on_progress=told.append)
    assert told == sorted(told) and told[-1] == 1.0


def test_json_holds_no_infinity():
    result = exact()
    assert any(r.psnr == float("inf") for r in result.rows)
    text = json.dumps(result.as_json(), allow_nan=False)
    assert len(json.loads(text)["rows"]) == len(result.rows)


def test_settings_that_are_not_sound_are_refused():
    with pytest.raises(SceneError, match="samples is 0"):
        measured(values={"samples": [0]})


# --- the plot


def _ink(image, color):
    return np.abs(image - color).max(-1) < 0.02


def test_the_plot_rises_to_the_left_and_marks_the_current_settings():
    rows = with_front([row(0.1, 0.1), row(1.0, 0.01), row(10.0, 0.001, current=True)])
    image = trade_plot.draw_trade(Trade(rows, "truth", (), (1, 1), 1, True), "test")
    y, x = np.nonzero(_ink(image, trade_plot._CURRENT)[110:])
    _, all_x = np.nonzero(_ink(image, trade_plot._FRONT)[110:])
    assert x.mean() > 0.9 * all_x.max()
    assert y.mean() > 0.8 * (image.shape[0] - 110 - 64)


def test_errors_are_in_percent():
    labels = [label for _, label in trade_plot._ticks((-3.0, -1.0), in_percent=True)]
    assert labels == ["0.1 %", "0.2 %", "0.5 %", "1 %", "2 %", "5 %", "10 %"]


def test_curves_keep_their_order():
    """The slower curve with the larger error lies to the upper right of the other."""
    image = trade_plot.draw_curves(
        {"fast": [(0.1, 0.1), (1.0, 0.01)], "slow": [(1.0, 0.1), (10.0, 0.01)]}, "two"
    )
    places = [np.argwhere(_ink(image, color)[110:]).mean(0) for color in trade_plot._CURVES[:2]]
    assert places[0][1] < places[1][1] - 50 and abs(places[0][0] - places[1][0]) < 10


@pytest.mark.parametrize(
    "rows", [[], [row(0.0, 0.0)], [row(1.0, float("inf"))], [row(1.0, 0.0), row(2.0, 1e-300)]]
)
def test_odd_numbers_make_a_plot_too(rows):
    image = trade_plot.draw_trade(Trade(with_front(rows), "truth", (), (1, 1), 1, True))
    assert image.shape == (trade_plot.HEIGHT, trade_plot.WIDTH, 3) and np.isfinite(image).all()
