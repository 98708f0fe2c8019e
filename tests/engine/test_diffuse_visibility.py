"""What rays of matt surfaces see: skies and bounced light obey `visible_diffuse`."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.lights.dome import cell_shares, directions
from native_tools import (
    IDENTITY,
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

pytestmark = needs_core

BACKENDS = ("NATIVE", "NUMPY")
FEW = {"NATIVE": {}, "NUMPY": {"samples": 4, "light_samples": 4}}
"""The slow tracer's samples."""
ALBEDO, SHADE = (0.4, 0.5, 0.6), (0.8, 0.3, 0.1)
MATT = material(s.Lobe("DIFFUSE", constant(*ALBEDO)))
LID = material(s.Lobe("DIFFUSE", constant(*SHADE)))
PAINT = material(
    s.Lobe("DIFFUSE", constant(*ALBEDO)), s.Lobe("SPECULAR", constant(0.3), 60.0, masking=0.2)
)
EVEN = s.Light("sky", "DOME", IDENTITY, radiance=np.ones((1, 1, 3), np.float32))
ROWS = np.linspace(0.1, 1.5, 32, dtype=np.float32)[:, None, None]
VARIED = replace(EVEN, radiance=ROWS * np.ones((32, 64, 3), np.float32))
BALL = lamp("POINT", (0.5, 0.2, 2), strength=50.0, radius=0.3)
HIDDEN = {"visible_camera": False, "visible_mirror": False}


def under_a_lid(light: s.Light, paint: s.Material = MATT, **flags: bool) -> s.Scene:
    """A floor under a lid so wide that no more than a thousandth of the sky is beside it."""
    return s.Scene(
        view_from_above(8),
        (square(),),
        (placed(), placed(0, (1,), z=0.2, linear=2.0, **{**HIDDEN, **flags})),
        (paint, material(), MATT),
        (),
        (light,),
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_sky_of_one_colour_is_seen_through_what_diffuse_rays_do_not_see(backend: str) -> None:
    settings = {"samples": 4, "light_samples": 4, "backend": backend}
    dark = color(under_a_lid(EVEN), **settings)
    assert dark.max() < 0.01
    open_ = color(under_a_lid(EVEN, visible_diffuse=False), **settings)
    np.testing.assert_allclose(open_, np.broadcast_to(ALBEDO, open_.shape), rtol=2e-3)
    assert np.array_equal(color(under_a_lid(EVEN, visible_shadow=False), **settings), dark)
    none = {"visible_diffuse": False, "visible_shadow": False}
    assert np.array_equal(color(under_a_lid(EVEN, **none), **settings), open_)


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_to_a_sky_that_varies_are_of_both_kinds(backend: str) -> None:
    """In shares of the squares of the densities of both, that of the lobe in the mean."""
    values = ROWS * np.ones((32, 64, 1))
    share = cell_shares(32, 64) * np.ones_like(values)
    density = (0.9 * values / (values * share).sum() + 0.1) / (4 * np.pi)
    up = np.maximum(directions(32, 64)[2].reshape(32, 64, 1), 0)
    lit = 4 * values * up * share
    of_sky = density**2 / (density**2 + 1 / (2 * np.pi**2))
    samples = {"NATIVE": 64, "NUMPY": 8}[backend]
    settings = {"samples": samples, "light_samples": 16, "backend": backend}
    settings["region"] = (3, 3, 5, 5)
    for flag, kept in (("visible_diffuse", 1 - of_sky), ("visible_shadow", of_sky)):
        found = color(under_a_lid(VARIED, **{flag: False}), **settings)
        expected = (lit * kept).sum() * np.array(ALBEDO)
        np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=0.03)


def test_lamps_cast_shadows_of_what_diffuse_rays_do_not_see() -> None:
    dark = color(under_a_lid(BALL, visible_diffuse=False), samples=2, light_samples=2)
    assert dark.max() == 0
    assert color(under_a_lid(BALL, visible_shadow=False), samples=2, light_samples=2).min() > 0


def beside_a_wall(paint: s.Material = MATT, light: s.Light = BALL, **flags: bool) -> s.Scene:
    """A floor in the light of a lamp, before a wall that faces it."""
    turned = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    wall = placed(0, (1,), linear=turned @ np.diag([0.3, 0.3, 1.0]), **{**HIDDEN, **flags})
    matrix = wall.world_from_object.copy()
    matrix[0, :, 3] = (-1.3, 0.0, 1.55)
    wall = replace(wall, world_from_object=matrix)
    return s.Scene(
        view_from_above(8), (square(),), (placed(), wall), (paint, LID, MATT), (), (light,)
    )


BOUNCING = {"samples": 16, "light_samples": 8, "diffuse_bounces": 1}


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_diffuse_rays_do_not_see_throws_no_light_on(backend: str) -> None:
    """Nor does it keep light from others, where it casts no shadow either."""
    settings = {**BOUNCING, "backend": backend, **FEW[backend]}
    lit = color(beside_a_wall(), **settings)
    direct = color(beside_a_wall(), **{**settings, "diffuse_bounces": 0})
    dark = color(beside_a_wall(visible_diffuse=False), **settings)
    assert (lit - direct).max() > 0.05 * direct.max()
    assert np.abs(dark - direct).max() < 1e-3 * direct.max()
    gone = color(beside_a_wall(visible_diffuse=False, visible_shadow=False), **settings)
    nothing = replace(beside_a_wall(), instances=beside_a_wall().instances[:1])
    assert np.abs(gone - color(nothing, **settings)).max() < 1e-5 * gone.max()


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_from_near_by_is_looked_for_where_diffuse_rays_see(backend: str) -> None:
    """Not where mirrors do."""
    settings = {**BOUNCING, "backend": backend, **FEW[backend]}
    flags = {"visible_diffuse": False, "visible_shadow": False, "visible_mirror": True}
    nothing = replace(beside_a_wall(), instances=beside_a_wall().instances[:1])
    gone = color(beside_a_wall(**flags), **settings)
    assert np.abs(gone - color(nothing, **settings)).max() < 1e-5 * gone.max()


@pytest.mark.parametrize("backend", BACKENDS)
def test_bounced_light_comes_through_what_diffuse_rays_do_not_see(backend: str) -> None:
    """From a ceiling over a lid that keeps the lamp's light off the floor."""
    settings = {**BOUNCING, "backend": backend, **FEW[backend]}
    found = {}
    for name, flags in (("on", {}), ("off", {"visible_diffuse": False})):
        scene = under_a_lid(replace(BALL, radius=0.0), **flags)
        above = placed(0, (2,), z=3.0, **HIDDEN)
        found[name] = color(replace(scene, instances=(*scene.instances, above)), **settings)
    alone = replace(scene, instances=(scene.instances[0], above))
    bounced = color(alone, **settings) - color(alone, **{**settings, "diffuse_bounces": 0})
    assert found["on"].max() < 0.01 * bounced.max()
    assert found["off"].mean() == pytest.approx(bounced.mean(), rel=0.03)


def over_a_wall(**flags: bool) -> s.Scene:
    """A sheet that light passes, and below it what else stands above the floor."""
    sheet = material(s.Lobe("TRANSLUCENT", constant(*ALBEDO)))
    scene = beside_a_wall(sheet, replace(BALL, world_from_light=flipped(BALL.world_from_light)))
    matrix = scene.instances[1].world_from_object.copy()
    matrix[0, 2, 3] *= -1
    wall = replace(scene.instances[1], world_from_object=matrix, **flags)
    return replace(scene, instances=(scene.instances[0], wall))


def flipped(matrix: np.ndarray) -> np.ndarray:
    """The same place below the floor."""
    return np.asarray(matrix) * np.array([1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1]).reshape(3, 4)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_shines_through_a_sheet_is_looked_for_where_diffuse_rays_see(backend: str) -> None:
    """Whatever mirrors show."""
    settings = {**BOUNCING, "backend": backend, **FEW[backend]}
    seen = color(over_a_wall(), **settings)
    direct = color(over_a_wall(), **{**settings, "diffuse_bounces": 0})
    assert (seen - direct).max() > 0.05 * direct.max()
    mirrored = color(over_a_wall(visible_mirror=True), **settings)
    np.testing.assert_allclose(seen, mirrored, rtol=1e-5)
    flags = {"visible_diffuse": False, "visible_shadow": False, "visible_mirror": True}
    assert np.abs(color(over_a_wall(**flags), **settings) - direct).max() < 1e-5 * direct.max()


def test_what_casts_no_shadow_throws_light_on() -> None:
    """As much as what does, where that shades nothing."""
    seen = draw(beside_a_wall(), "Diffuse Indirect", **BOUNCING)
    through = draw(beside_a_wall(visible_shadow=False), "Diffuse Indirect", **BOUNCING)
    one, other = (film.passes["Diffuse Indirect"].mean() for film in (seen, through))
    assert other == pytest.approx(one, rel=0.03)


def under_a_lit_lid(**flags: bool) -> s.Scene:
    """Between a floor and a ceiling, of which a lamp above it lights what the lid leaves."""
    scene = under_a_lid(replace(BALL, radius=0.0), **flags)
    above = placed(0, (2,), z=3.0, **HIDDEN)
    return replace(scene, instances=(*scene.instances, above), materials=(MATT, LID, MATT))


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_goes_on_behind_what_casts_no_shadow(backend: str) -> None:
    """And is stopped by what does: whether the floor has straight light, and what the ceiling
    throws on, which a lid that bounced rays see hides: it is dark below.
    """
    settings = {**BOUNCING, "backend": backend, **FEW[backend]}
    for flags, lit, thrown in (
        ({"visible_shadow": False}, True, False),
        ({"visible_diffuse": False}, False, True),
        ({}, False, False),
        ({"visible_shadow": False, "visible_diffuse": False}, True, True),
    ):
        scene = under_a_lit_lid(**flags)
        straight = color(scene, **{**settings, "diffuse_bounces": 0})
        added = color(scene, **settings) - straight
        assert (straight.max() > 0.01) == lit, flags
        assert (added.max() > 0.01) == thrown, flags


def scenes() -> list[s.Scene]:
    flags = ({"visible_diffuse": False}, {"visible_shadow": False}, {"visible_mirror": True})
    glass = material(s.Lobe("TRANSPARENT", constant(0.5, 0.8, 1.0)), *LID.lobes)
    found = [under_a_lid(light, PAINT, **f) for light in (EVEN, VARIED) for f in flags]
    found += [beside_a_wall(PAINT, light, **f) for light in (BALL, VARIED) for f in flags]
    return found + [replace(scene, materials=(PAINT, glass)) for scene in found[:2] + found[6:]]


def test_both_tracers_draw_the_same() -> None:
    settings = {**BOUNCING, "samples": 2, "light_samples": 2}
    for scene in scenes():
        one, other = (color(scene, **settings, backend=backend) for backend in BACKENDS)
        assert np.median(np.abs(one - other)) <= 1e-5 * other.max() + 1e-12
        assert (np.abs(one - other).max(2) > 1e-3 * other.max() + 1e-12).mean() < 0.02


@functools.cache
def hashes(threads: int = 0) -> str:
    settings = {**BOUNCING, "samples": 2, "threads": threads}
    pictures = [color(scene, **settings).tobytes() for scene in scenes()[::2]]
    return hashlib.sha256(b"".join(pictures)).hexdigest()


def test_instruction_sets_change_nothing() -> None:
    assert_instruction_sets_agree(hashes)


def test_threads_change_nothing() -> None:
    assert hashes(1) == hashes(3)


def test_regions_change_nothing() -> None:
    settings = {**BOUNCING, "samples": 2}
    for scene in scenes():
        whole = color(scene, **settings)
        part = color(scene, **settings, region=(3, 2, 6, 7))
        assert np.array_equal(part, whole[2:7, 3:6])


def test_a_pixel_that_is_explained_has_what_it_shows() -> None:
    for scene in scenes()[:6]:
        shown = color(scene, samples=1, backend="NUMPY")[4, 4]
        ray = PixelExplainer(scene, Settings(samples=1, light_samples=1)).pixel(4, 4)
        np.testing.assert_allclose(ray.color, shown, rtol=1e-4, atol=1e-6)
