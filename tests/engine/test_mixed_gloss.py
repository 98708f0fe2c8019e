"""What wide lobes reflect, which pixels of a block share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import HERE
from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.reference.blocks import ALONE, WAITS, turns
from glint.engine.sampling import GLOSS_PLACES, gloss_blocks, gloss_points, lobe_points
from glint.engine.scene import Camera, Input, Instances, Light, Lobe, Material, Scene
from test_reflections import metal, square

BACKENDS = ("NATIVE", "NUMPY")
FLOOR = square((-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0))
WALL = square((-4, 1, 0), (-4, 1, 3), (4, 1, 3), (4, 1, 0))
PANE = square((-4, -2, 1.5), (4, -2, 1.5), (4, 1, 1.5), (-4, 1, 1.5))
# the floor shows nothing but what it reflects
LAMP = Light("lamp", "POINT", np.c_[np.eye(3), [0.5, -0.5, 0.8]], strength=4e3, lights_gloss=False)
CLEAR = Material("clear", (Lobe("TRANSPARENT", (Input((1.0, 1.0, 1.0)),)),))


def tinted(color: tuple[float, ...], exponent: float = 40.0) -> Material:
    (lobe,) = metal(exponent).lobes
    return Material("metal", (replace(lobe, factors=(Input(color),)),))


def paint(*color: float) -> Material:
    return Material("paint", (Lobe("DIFFUSE", (Input(color),)),))


def above(size: tuple[int, int], half: float = 0.9) -> Camera:
    """Looks down on the floor before the wall."""
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 2.5)])
    width = half * size[0] / size[1]
    return Camera("ORTHOGRAPHIC", frame, (-width, width, -half, half), size)


def floor_before_wall(size: tuple[int, int] = (24, 20), *more: Lobe) -> Scene:
    """A dull metal floor beside a painted wall, which has a mirror or glass in front of some."""
    front = square((-4, 0.95, 0), (-4, 0.95, 3), (0, 0.95, 3), (0, 0.95, 0))
    things = [Instances(f"{k}", k, HERE[None], (k,)) for k in range(2)]
    materials = [tinted((0.9, 0.7, 0.4)), paint(0.2, 0.5, 0.8)]
    geometries = [FLOOR, WALL]
    if more:
        geometries.append(front)
        things.append(Instances("front", 2, HERE[None], (2,)))
        materials.append(Material("front", more))
    return Scene(above(size), tuple(geometries), tuple(things), tuple(materials), (), (LAMP,))


def seen(scene: Scene, backend: str = "NATIVE", **more) -> np.ndarray:
    plan = {"samples": 16, "filter_width": 0.0, "max_bounces": 4, "reflections": "ALL"}
    film = render(scene, Settings(**plan | more, backend=backend))
    return film.passes["Combined"][..., :3].astype(np.float64)


def test_neighbours_see_as_if_they_had_more_rays() -> None:
    """Behind a clear pane each pixel has its own alone."""
    scene = floor_before_wall((96, 80))
    behind = replace(
        scene,
        geometries=(*scene.geometries, PANE),
        instances=(*scene.instances, Instances("pane", 2, HERE[None], (2,))),
        materials=(*scene.materials, CLEAR),
    )

    def blocks(which: Scene, samples: int) -> np.ndarray:
        return seen(which, samples=samples).reshape(10, 8, 12, 8, 3).mean((1, 3))

    truth = blocks(behind, 1024)
    assert truth.max() > 0.05
    mixed, alone = (np.sqrt(((blocks(s, 8) - truth) ** 2).mean()) for s in (scene, behind))
    assert mixed < 0.2 * alone
    assert np.abs(blocks(scene, 1024) - truth).max() < 0.008 * truth.max()


def test_blocks_leave_no_lines() -> None:
    """Where tiles end pixels get as much as elsewhere: of walls all round, in which all is even."""
    size = (64, 40)
    walls = [
        square((-9, s * 4, -9), (9, s * 4, -9), (9, s * 4, 9), (-9, s * 4, 9)) for s in (-1, 1)
    ]
    scene = floor_before_wall(size)
    glow = Material("glow", (Lobe("EMISSION", (Input((1.0, 1.0, 1.0)),)),))
    scene = replace(
        scene,
        camera=above(size, 0.1),
        geometries=(FLOOR, *walls),
        instances=tuple(Instances(f"{k}", k, HERE[None], (min(k, 1),)) for k in range(3)),
        materials=(tinted((0.8, 0.8, 0.8), 5.0), glow),
        lights=(),
    )
    found = seen(scene, samples=64, mesh_light="OFF")[..., 1]
    columns, rows = found.mean(0), found.mean(1)
    assert found.mean() > 0.05
    assert np.abs(columns / found.mean() - 1).max() < 0.02
    assert np.abs(rows / found.mean() - 1).max() < 0.02


FRONTS = {
    "alone": (),
    "mirror": (Lobe("MIRROR", (Input((0.8, 0.8, 0.8)),)),),
    "glass": (
        Lobe("REFRACTION", (Input((0.6, 0.8, 0.8)),), ior=1.4),
        Lobe("MIRROR", (Input((0.3, 0.3, 0.3)),)),
    ),
    "clear": (
        Lobe("TRANSPARENT", (Input((0.5, 0.6, 0.5)),)),
        Lobe("DIFFUSE", (Input((0.1, 0.1, 0.1)),)),
    ),
}
PASSES = frozenset({"Mirror", "Glossy Direct", "Glossy Indirect", "Diffuse Direct", "Cost"})


@pytest.mark.parametrize("front", FRONTS)
def test_both_tracers_mix_the_same(front: str) -> None:
    """Of an odd frame, whose blocks have few pixels at its ends."""
    scene = floor_before_wall((35, 11), *FRONTS[front])
    named = replace(LAMP, light_group=0)
    scene = replace(scene, lights=(named,), light_groups=("lamps",))
    plan = {"samples": 8, "filter_width": 0.0, "max_bounces": 4, "reflections": "ALL"}
    core, reference = (
        render(scene, Settings(**plan, passes=PASSES, backend=b)).passes for b in BACKENDS
    )
    assert core.keys() == reference.keys()
    assert reference["Glossy Indirect"].any()
    for name in core:
        wrong = np.abs(core[name] - reference[name]) > 1e-4 * (1 + np.abs(reference[name]))
        assert wrong.mean() <= 0.01, name  # rays may turn at an edge
    lit = [name for name in core if "lamps" in name]
    assert lit
    np.testing.assert_allclose(
        core[lit[0]][..., :3], core["Combined"][..., :3], rtol=1e-5, atol=1e-6
    )


def test_the_bits_are_the_same_for_threads_and_regions() -> None:
    scene = floor_before_wall((23, 21), *FRONTS["glass"])
    for more in ({}, {"error_threshold": 4.0, "samples": 32}):
        whole = seen(scene, threads=1, **more)
        np.testing.assert_array_equal(whole, seen(scene, threads=3, **more))
        part = seen(scene, region=(5, 7, 16, 20), **more)
        np.testing.assert_array_equal(part, whole[7:20, 5:16])


@pytest.mark.parametrize("error_threshold", [0.0, 4.0])
def test_a_part_that_stands_apart_takes_what_it_shows(error_threshold: float) -> None:
    """In both tracers the same, and as right as the frame's: that a tool measures parts by."""
    scene, plan = floor_before_wall((40, 36)), {"samples": 32, "max_bounces": 2}
    settings = Settings(**plan, error_threshold=error_threshold)
    parts = [(x, y, min(x + 12, 40), y + 12) for x in range(0, 40, 12) for y in range(0, 36, 12)]
    odd = replace(settings, region=(11, 9, 30, 26), apart=True)
    films = [render(scene, replace(odd, backend=backend)) for backend in BACKENDS]
    pictures = [film.combined[..., :3].astype(np.float64) for film in films]
    wrong = np.abs(pictures[0] - pictures[1]) > 1e-4 * (1 + pictures[1])
    assert wrong.mean() <= 0.01
    assert films[0].stats["rays"] == pytest.approx(films[1].stats["rays"], rel=0.01)

    def errors(plan: Settings) -> tuple[float, float]:
        """And the rays."""
        film = render(scene, plan)
        truth = render(scene, replace(plan, samples=1024, error_threshold=0.0))
        return ((film.combined - truth.combined) ** 2).sum(), film.stats["rays"]

    whole = errors(settings)
    apart = np.sum([errors(replace(settings, region=part, apart=True)) for part in parts], 0)
    assert apart == pytest.approx(whole, rel=0.3)


def two_metals(left: tuple[float, ...], right: tuple[float, ...]) -> Scene:
    """In one plane: 7 columns of pixels of the one, 5 of the other, so that blocks have both."""
    scene, edge = floor_before_wall((12, 12)), 0.015
    floors = (
        square((-4, -4, 0), (edge, -4, 0), (edge, 4, 0), (-4, 4, 0)),
        square((edge, -4, 0), (4, -4, 0), (4, 4, 0), (edge, 4, 0)),
    )
    return replace(
        scene,
        camera=above((12, 12), 0.09),
        geometries=(floors[0], WALL, floors[1]),
        instances=(*scene.instances, Instances("right", 2, HERE[None], (2,))),
        materials=(tinted(left), scene.materials[1], tinted(right)),
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_pixel_gives_back_in_its_own_color(backend: str) -> None:
    """Where neighbours of another color look as well: as much as if all were like it."""
    left, right = (0.9, 0.6, 0.1), (0.1, 0.3, 0.8)
    found = seen(two_metals(left, right), backend)
    for color, columns in ((left, slice(0, 7)), (right, slice(7, 12))):
        alone = seen(two_metals(color, color), backend)
        np.testing.assert_allclose(found[:, columns], alone[:, columns], rtol=2e-5, atol=1e-7)


def test_what_gives_back_none_of_a_channel_has_nothing_to_share_of_it() -> None:
    left, right, glow = (0.9, 0.0, 0.0), (0.0, 0.0, 0.8), 100.0

    def bright(*colors: tuple[float, ...], backend: str = "NATIVE", samples: int = 512):
        """So bright that all is shown of what few rays find."""
        scene = two_metals(*colors)
        first, wall, second = scene.materials
        floors = [
            Material("floor", (*dull.lobes, Lobe("EMISSION", (Input(glow * np.array(color)),))))
            for dull, color in ((first, colors[0]), (second, colors[1]))
        ]
        scene = replace(scene, materials=(floors[0], wall, floors[1]))
        return seen(scene, backend, samples=samples, mesh_light="OFF")

    found = bright(left, right)
    for color, channel, columns, beside in (
        (left, 0, slice(0, 7), 6),
        (right, 2, slice(7, 12), 7),
    ):
        others = [c for c in range(3) if c != channel]
        assert not found[:, columns, others].any()
        alone = bright(color, color)
        both = (p[:8, beside, channel].mean() - glow * color[channel] for p in (found, alone))
        assert abs(next(both) / next(both) - 1) < 0.02  # fewer rays
    few, exact = (bright(left, right, backend=backend, samples=16) for backend in BACKENDS)
    np.testing.assert_allclose(few, exact, rtol=1e-6)  # of rays at edges
    np.testing.assert_array_equal(few == 0, exact == 0)


@pytest.mark.parametrize("front", FRONTS)
def test_explain_adds_up_what_neighbours_bring(front: str) -> None:
    """Under a roof: the first sample's first place is where the normal mirrors."""
    scene = floor_before_wall((13, 11), *FRONTS[front])
    roof = square((-4, -4, 3), (4, -4, 3), (4, 4, 3), (-4, 4, 3))
    number = len(scene.geometries)
    scene = replace(
        scene,
        geometries=(*scene.geometries, roof),
        instances=(*scene.instances, Instances("roof", number, HERE[None], (1,))),
    )
    plan = Settings(samples=1, filter_width=0.0, max_bounces=4, reflections="ALL")
    picture = render(scene, plan).passes["Combined"]
    explainer = PixelExplainer(scene, plan)
    lit = 0
    for x in range(0, 13, 2):
        for y in (0, 7, 8, 9, 10):
            ray = explainer.pixel(x, y)
            np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-4, atol=1e-6)
            lit += any(after.kind == "reflection" and any(after.color) for after in ray.follow)
    assert lit >= 5


def test_places_are_even_sets() -> None:
    """Those of each sample, their halves and quarters lie on different sides of the disc, all in
    all parts of it.
    """
    places = gloss_points(64)
    assert places.shape == (64, GLOSS_PLACES, 2)
    every = places.reshape(-1, 2)
    assert len(np.unique(every, axis=0)) == 512
    for points in (every, lobe_points(512)[0]):
        radius2 = (points**2).sum(1)
        angle = np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
        cells = np.histogram2d(radius2, angle, (4, 8), ((0, 1), (0, 2 * np.pi)))[0]
        assert np.abs(cells - 16).max() <= 3
    pairs = places.reshape(-1, 2, 2)
    assert ((pairs[:, 0] * pairs[:, 1]).sum(1) < 0).mean() > 0.5
    for count in (2, 4, 8):
        middles = places.reshape(-1, count, 2).mean(1)
        assert np.sqrt((middles**2).sum(1).mean()) < 0.75 / count


def test_groups_deal_places_in_turn() -> None:
    """A power of two send rays, all of a group as often, to each place as often, to whole sets."""
    for count in range(1, 26):
        members = np.arange(count)[None]
        sent, dealt = np.zeros(count, int), np.zeros(GLOSS_PLACES, int)
        for sample in range(8 * 4 * count):
            turn = turns(members, sample, count)
            if count == 1:
                assert turn[0] == ALONE
                continue
            places = np.sort(turn[turn != WAITS])
            assert len(places) == min(8, 2 ** int(np.ceil(np.log2(count))) // 2)
            first = places[0]
            assert first % len(places) == 0
            np.testing.assert_array_equal(places, first + np.arange(len(places)))
            sent += turn != WAITS
            dealt[places] += 1
        assert count == 1 or ((sent == sent[0]).all() and (dealt == dealt[0]).all())


def test_blocks_are_everywhere_in_nine_samples() -> None:
    """And in tiles, three to five pixels on a side; a part of the frame has the whole's."""
    width, height = 75, 40
    each = [gloss_blocks((0, width), (0, height), s)[0].reshape(height, width) for s in range(9)]
    assert len({tuple(found.ravel()) for found in each}) == 9
    for sample, found in enumerate(each):
        _, counts = np.unique(found[:32, :64], return_counts=True)
        assert len(counts) == 128 and counts.min() >= 9 and counts.max() <= 25
        assert not set(found[:, 31]) & set(found[:, 32]) and not set(found[31]) & set(found[32])
        part = gloss_blocks((32, width), (0, 32), sample)[0].reshape(32, -1)
        whole = found[:32, 32:]
        assert len(set(zip(part.ravel(), whole.ravel(), strict=True))) == len(np.unique(part))
    joined = sum((found[:, :-1] == found[:, 1:]).astype(int) for found in each)
    assert joined[:, 40:60].min() == 6 and joined[:, 40:60].max() == 9
