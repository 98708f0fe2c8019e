"""Camera rays that light does not follow tell how much of a pixel shows what
(semantics/resolve.md).
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import pytest

import test_path_bounces as bounces
from glint import engine
from glint.engine import scene as s
from glint.engine.film import LIGHTING, OCCLUSION, PARTS
from glint.engine.sampling import dealt_offsets, offset_classes, pixel_offsets
from native_tools import assert_instruction_sets_agree, needs_core, view_from_above
from test_path_tracer import SKY, glowing, matt, placed, quad
from test_resolve import corner

pytestmark = needs_core
PLAN = {"samples": 4, "visibility_samples": 3, "soft_light": "RESOLVED", "filter_width": 1.5}
PASSES = frozenset({*PARTS, *LIGHTING, OCCLUSION})


def draw(scene: s.Scene, **more) -> engine.Film:
    return engine.render(scene, engine.Settings(**PLAN | more))


# --- where they go


@pytest.mark.parametrize(("samples", "rays"), [(1, 4), (8, 4), (6, 3), (16, 1)])
def test_each_class_of_pixels_has_all_places_and_samples_of_its_own(samples: int, rays: int):
    found, all_of_them = dealt_offsets(samples, rays, 1.5), pixel_offsets(samples * rays, 1.5)
    assert found.shape == (rays, samples * rays, 2)
    for own in found:
        assert not own[0].any()
        np.testing.assert_array_equal(np.sort(own, 0), np.sort(all_of_them, 0))
    own = [tuple(place) for offsets in found for place in offsets[1:samples]]
    assert len(set(own)) == len(own)


def test_neighbours_are_of_other_classes():
    classes = offset_classes((3, 11), (5, 13), 4).reshape(8, 8)
    assert (classes[1:] != classes[:-1]).all() and (classes[:, 1:] != classes[:, :-1]).all()
    assert (np.bincount(classes.ravel()) == 16).all()


# --- closed forms


def slanted(below: s.Material, above: s.Material) -> s.Scene:
    """Two surfaces of one plane on either side of y = x / 3 under an even sky, from above."""
    ends = [(-9, -3, 0), (9, 3, 0)]
    lower = quad("lower", [*ends, (9, -9, 0), (-9, -9, 0)][::-1])
    upper = quad("upper", [*ends, (9, 9, 0), (-9, 9, 0)])
    return placed(view_from_above(24), (lower, below), (upper, above), lights=(SKY,))


def coverage() -> np.ndarray:
    """(24, 24) of y < x / 3, by very many places in the pixels."""
    places = pixel_offsets(1 << 14, 1.5)
    line = np.arange(24) + 0.5 - 12
    return np.array(
        [[((y + places[:, 1]) * 3 < x + places[:, 0]).mean() for x in line] for y in line]
    )


EDGES = {
    "colours": (matt((0.8, 0.2, 0.1)), matt((0.1, 0.4, 0.8)), (0.8, 0.2, 0.1), (0.1, 0.4, 0.8)),
    "what glows": (glowing(0.9), glowing(0.1), (0.9,) * 3, (0.1,) * 3),
    "what glows and what is lit": (glowing(0.9), matt((0.2,) * 3), (0.9,) * 3, (0.2,) * 3),
}


@pytest.mark.parametrize("backend", bounces.BACKENDS)
@pytest.mark.parametrize("name", EDGES)
def test_edges_are_as_smooth_as_all_rays_make_them(name: str, backend: str) -> None:
    """Both sides are lit evenly, which a fit finds exactly: what is left is the coverage's error,
    that of as many samples of light.
    """
    below, above, *radiance = EDGES[name]
    share, (low, high) = coverage()[..., None], np.array(radiance)
    truth = share * low + (1 - share) * high

    def error(**more) -> float:
        found = draw(slanted(below, above), backend=backend, mesh_light="OFF", **more).combined
        return float(np.sqrt(((found[..., :3] - truth) ** 2).mean()))

    few, finely, many = (
        error(samples=samples, visibility_samples=rays)
        for samples, rays in ((4, 1), (4, 8), (32, 1))
    )
    assert finely < 0.4 * few
    assert finely < 1.02 * many


@pytest.mark.parametrize("backend", bounces.BACKENDS)
def test_outlines_before_nothing_are_alpha(backend: str) -> None:
    """Without surroundings colour and alpha are the same share of the pixel."""
    scene = slanted(matt((0.5,) * 3), matt((0.5,) * 3))
    scene = replace(scene, instances=scene.instances[:1], world=s.World(transparent=True))
    found, many = (
        draw(scene, backend=backend, samples=samples, visibility_samples=rays).combined
        for samples, rays in ((4, 8), (32, 1))
    )
    np.testing.assert_allclose(found[..., 3], many[..., 3], atol=1e-6)
    assert np.abs(found[..., 3] - coverage()).max() < 0.08
    np.testing.assert_allclose(found[..., 0], 0.5 * found[..., 3], atol=0.006)  # the sky's noise


# --- one tracer beside the other


@pytest.mark.parametrize("name", bounces.SCENES)
def test_both_tracers_draw_the_same(name: str) -> None:
    scene = bounces.SCENES[name]()
    core, reference = (
        bounces.film(scene, 1, backend, passes=PASSES, **bounces.PLAN | PLAN).passes
        for backend in bounces.BACKENDS
    )
    for key, values in reference.items():
        near = 1e-4 * (np.abs(values) + np.abs(values).mean() + 1e-6)
        assert (np.abs(core[key] - values) > near).any(-1).mean() <= bounces.EDGES, key


def test_parts_and_light_sum_to_the_picture() -> None:
    film = draw(corner(), passes=PASSES)
    parts = sum(film.passes[name] for name in PARTS)
    np.testing.assert_allclose(parts, film.combined[..., :3], atol=2e-6)
    light = film.passes["Emission"] + film.passes["Environment"]
    for kind in ("Diffuse", "Glossy", "Transmission"):
        both = film.passes[f"{kind} Direct"] + film.passes[f"{kind} Indirect"]
        light = light + both * film.passes[f"{kind} Color"]
    np.testing.assert_allclose(light, film.combined[..., :3], rtol=1e-4, atol=1e-5)


# --- where there are none


def hard() -> s.Scene:
    scene = corner(16)
    return replace(scene, lights=tuple(replace(lamp, radius=0.0) for lamp in scene.lights))


def catching() -> s.Scene:
    scene = corner(16)
    return replace(
        scene, instances=(replace(scene.instances[0], catcher=True), *scene.instances[1:])
    )


NONE = {
    "hard light": (hard, {"diffuse_bounces": 0}),
    "shared points": (lambda: corner(16), {"soft_light": "SHARED"}),
    "unresolved": (lambda: corner(16), {"soft_light": "DEALT"}),
    "catchers": (catching, {}),
    "Cryptomatte": (lambda: corner(16), {"passes": frozenset({"Crypto Object"})}),
    "AOVs": (lambda: replace(corner(16), aovs=("matte",)), {}),
    "a pixel's middle": (lambda: corner(16), {"filter_width": 0.0}),
}


@pytest.mark.parametrize("backend", bounces.BACKENDS)
@pytest.mark.parametrize("name", NONE)
def test_nothing_changes_where_there_are_none(name: str, backend: str) -> None:
    make, more = NONE[name]
    both = [draw(make(), backend=backend, **more | {"visibility_samples": rays}) for rays in (1, 4)]
    np.testing.assert_array_equal(both[0].combined, both[1].combined)


def test_even_surfaces_ask_for_no_more_of_them() -> None:
    without, cost = (
        draw(
            slanted(*EDGES["colours"][:2]), visibility_samples=rays, passes=frozenset({"Cost"})
        ).passes["Cost"][..., 0]
        for rays in (1, 3)
    )
    more, share = cost - without, coverage()
    assert set(np.unique(more)) == {0, 8}
    assert (more[(share > 0.1) & (share < 0.9)] == 8).all()
    assert (more[[0, -1], [-1, 0]] == 0).all()
    assert (more == 8).mean() < 0.35


# --- the same bits


def hashes() -> str:
    whole = draw(corner()).combined
    return hashlib.sha256(np.ascontiguousarray(whole).tobytes()).hexdigest()


def test_threads_regions_and_waves_change_no_bit() -> None:
    whole = draw(corner(), passes=frozenset({"Error"})).combined
    one = draw(corner(), passes=frozenset({"Error"}), threads=1).combined
    np.testing.assert_array_equal(whole, one)
    part = draw(corner(), passes=frozenset({"Error"}), region=(7, 11, 40, 33)).combined
    np.testing.assert_array_equal(part, whole[11:33, 7:40])
    np.testing.assert_array_equal(draw(corner()).combined, whole)


def test_so_do_instruction_sets() -> None:
    assert_instruction_sets_agree(hashes)
