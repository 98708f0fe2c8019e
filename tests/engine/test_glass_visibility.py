"""What refracted rays see: instances with `visible_transmission`, whatever mirrors show."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.graph import Graph
from glint.engine.program.table import BY_NAME
from native_tools import (
    assert_instruction_sets_agree,
    color,
    constant,
    draw,
    lamp,
    material,
    needs_core,
    placed,
    square,
    view_from_above,
)
from ray_node_scenes import shown

pytestmark = needs_core

BACKENDS = ("NATIVE", "NUMPY")
SKY, GLOW, TINT, VEIL = (0.5, 0.6, 0.8), (5.0, 4.0, 3.0), (0.9, 0.7, 0.5), (0.5, 0.8, 1.0)
PANE = material(s.Lobe("REFRACTION", constant(*TINT), ior=1.0))
ROUGH = material(s.Lobe("REFRACTION", constant(*TINT), 200.0, ior=1.4))
GLASS = material(
    s.Lobe("MIRROR", constant(*TINT), ior=1.5, fresnel=True),
    s.Lobe("REFRACTION", constant(*TINT), ior=1.5, fresnel=True),
)
LIT = material(s.Lobe("EMISSION", constant(*GLOW)))
CLEAR = material(s.Lobe("TRANSPARENT", constant(*VEIL)))
MIRROR = material(s.Lobe("MIRROR", constant(*TINT)))
HIDDEN = {
    "glass": {"visible_transmission": False},
    "mirrors": {"visible_mirror": False},
    "both": {"visible_transmission": False, "visible_mirror": False},
}


def before_a_sheet(pane: s.Material, *between: s.Material, **flags: bool) -> s.Scene:
    """A pane over a sheet that glows, under a sky of one colour; between: on the way, in order."""
    materials = (pane, *between, LIT)
    sheets = [placed(0, (k,), z=float(-k)) for k in range(len(materials) - 1)]
    return s.Scene(
        view_from_above(8),
        (square(),),
        (*sheets, placed(0, (len(materials) - 1,), z=-20.0, **flags)),
        materials,
        (),
        (),
        s.World(background=SKY),
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("hidden", [None, *HIDDEN])
def test_what_a_ray_meets_behind_a_pane(hidden: str | None, backend: str) -> None:
    """Straight on it is as it was; of several surfaces the last that bent it counts."""
    tint, veil = np.array(TINT), np.array(VEIL)
    flags = HIDDEN.get(hidden or "", {})
    through = np.array(SKY if hidden in ("glass", "both") else GLOW)
    size = {"samples": 2, "max_bounces": 8, "backend": backend}
    for panes, share, seen in (
        ((PANE,), tint, through),
        ((PANE, PANE), tint * tint, through),
        ((PANE, CLEAR), tint * veil, through),
        ((CLEAR, PANE), tint * veil, through),
        ((CLEAR,), veil, np.array(GLOW)),
    ):
        found = color(before_a_sheet(*panes, **flags), **size)
        np.testing.assert_allclose(found, np.broadcast_to(share * seen, found.shape), rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_mirrors_in_glass_obey_their_own_flag(backend: str) -> None:
    """A pane, below it what glows, below that a mirror."""
    tint = np.array(TINT)
    for flags, expected in (
        (HIDDEN["mirrors"], tint * GLOW),
        (HIDDEN["glass"], tint**2 * GLOW),
        (HIDDEN["both"], tint**3 * SKY),
    ):
        scene = replace(
            before_a_sheet(PANE),
            instances=(placed(), placed(0, (1,), z=-1.0), placed(0, (2,), z=-0.5, **flags)),
            materials=(PANE, MIRROR, LIT),
        )
        found = color(scene, samples=1, max_bounces=8, backend=backend)
        np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-5)


LAMP_FLAGS = [(mirror, glass) for mirror in (False, True) for glass in (False, True)]


def before_a_lamp(pane: s.Material, mirror: bool, glass: bool) -> s.Scene:
    """A pane over a large lamp that shines up, from which no other light comes."""
    upward = np.diag([1.0, -1.0, -1.0])
    area = lamp("AREA", (0.0, 0.0, -20.0), upward, strength=400.0, size_x=60.0, size_y=60.0)
    area = replace(area, visible_mirror=mirror, visible_transmission=glass)
    return replace(before_a_sheet(pane), instances=(placed(),), lights=(area,))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("mirror", "glass"), LAMP_FLAGS)
def test_lamps_are_seen_through_a_pane_as_their_flags_say(mirror, glass, backend) -> None:
    """On top of the sky; a mirror above it shows it as the other flag says."""
    shape = 400.0 / (np.pi * 60.0 * 60.0)
    found = color(before_a_lamp(PANE, mirror, glass), samples=1, max_bounces=4, backend=backend)
    expected = np.array(TINT) * (np.array(SKY) + shape * glass)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-5)
    mirrored = before_a_lamp(MIRROR, mirror, glass)
    turned = replace(mirrored.lights[0], world_from_light=lamp("AREA").world_from_light)
    found = color(replace(mirrored, lights=(turned,)), samples=1, max_bounces=4, backend=backend)
    expected = np.array(TINT) * (np.array(SKY) + shape * mirror)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-5)


def scenes() -> list[s.Scene]:
    """Panes of all kinds; a mist that glass alone shows, or does not show."""
    plain = [
        before_a_sheet(pane, *between, **flags)
        for pane in (PANE, ROUGH, GLASS)
        for between in ((), (CLEAR, GLASS))
        for flags in HIDDEN.values()
    ]
    mist = replace(LIT, lobes=CLEAR.lobes, medium=s.Medium((0.02, 0.05, 0.1), (0.1, 0.2, 0.3)))
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    misty = [
        replace(
            scene,
            geometries=(square(), ball),
            instances=(*scene.instances, placed(1, (len(scene.materials),), z=-10.0, **flags)),
            materials=(*scene.materials, mist),
        )
        for scene in (before_a_sheet(PANE), before_a_sheet(GLASS))
        for flags in HIDDEN.values()
    ]
    lamps = [before_a_lamp(pane, *f) for pane in (PANE, ROUGH, GLASS) for f in LAMP_FLAGS[1:3]]
    return plain + misty + lamps


def test_both_tracers_draw_the_same() -> None:
    for scene in scenes():
        films = [
            draw(
                scene, "Mirror", "Transmission Indirect", samples=2, max_bounces=6, backend=backend
            )
            for backend in BACKENDS
        ]
        for passed in ("Combined", "Mirror"):
            one, other = (np.asarray(film.passes[passed], float) for film in films)
            assert np.abs(one - other).max() <= 2e-5 * max(np.abs(other).max(), 1e-3)


@functools.cache
def hashes(threads: int = 0) -> str:
    pictures = [color(x, samples=4, max_bounces=6, threads=threads).tobytes() for x in scenes()]
    return hashlib.sha256(b"".join(pictures)).hexdigest()


def test_instruction_sets_and_threads_change_nothing() -> None:
    assert assert_instruction_sets_agree(hashes) == hashes(1)


def test_regions_change_nothing() -> None:
    for scene in scenes():
        whole = color(scene, samples=4, max_bounces=6)
        part = color(scene, samples=4, max_bounces=6, region=(3, 2, 6, 7))
        assert np.array_equal(part, whole[2:7, 3:6])


def test_a_pixel_that_is_explained_sees_what_it_shows() -> None:
    for scene in scenes()[:18] + scenes()[-6:]:  # those alike in all pixels
        settings = Settings(samples=1, max_bounces=6)
        shown = color(scene, samples=1, max_bounces=6, backend="NUMPY")[4, 4]
        ray = PixelExplainer(scene, settings).pixel(4, 4)
        np.testing.assert_allclose(ray.color, shown, rtol=1e-4, atol=1e-6)


def test_what_a_program_reads_of_a_path_stays_where_many_rays_are_parted() -> None:
    """Six panes send every ray on in many ways: more of a tile than are traced at once."""
    graph = Graph()
    refracted = graph.apply(BY_NAME["ray_depth"])[3]
    scene = before_a_sheet(GLASS, *[GLASS] * 5)
    told = replace(
        scene,
        camera=view_from_above(32),
        materials=(*scene.materials[:-1], shown(graph, refracted)),
    )
    whole = color(told, samples=1, max_bounces=8, cutoff=0.0)
    assert whole.max() > 0.1
    part = color(told, samples=1, max_bounces=8, cutoff=0.0, region=(8, 8, 11, 11))
    assert np.array_equal(part, whole[8:11, 8:11])
