"""Passes that are means over the samples of what camera rays see: Mist and Cryptomatte."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES
from glint import engine
from glint.engine import scene as s
from glint.engine.cryptomatte import id_bits, id_of, manifest, name_hash
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from native_tools import constant, draw, needs_core, placed, square, view_from_above

DENOISING = ("Denoising Normal", "Denoising Albedo", "Denoising Depth")
BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
CRYPTO = ("Crypto Object", "Crypto Material", "Crypto Asset")


def shares(picture: np.ndarray) -> dict[float, np.ndarray]:
    """id -> (h, w) coverage, of (h, w, 2 ids)."""
    ids, coverage = picture[..., ::2], picture[..., 1::2]
    return {float(i): np.where(ids == i, coverage, 0).sum(-1) for i in np.unique(ids[coverage > 0])}


def test_hashes_are_murmurs() -> None:
    """Of the author's own implementation, seed 0; the last one is of the specification."""
    for name, value in (
        ("", 0),
        ("a", 0x3C2569B2),
        ("hello", 0x248BFA47),
        ("hello, world", 0x149BBB7F),
        ("The quick brown fox jumps over the lazy dog", 0x2E4FF723),
    ):
        assert name_hash(name) == value
    assert id_bits("") == 1 << 23
    assert np.isfinite([id_of(f"name {k}") for k in range(1000)]).all()


def test_manifests_are_json_of_all_names_once() -> None:
    names = ["a", 'with "quotes" \\', "Würfel", "a"]
    read = json.loads(manifest(names))
    assert read == {name: f"{name_hash(name):08x}" for name in names}
    assert manifest(["hello"]) == '{"hello":"248bfa47"}'


def stack(**world) -> s.Scene:
    """From above: a veil that passes 0.25 over the left half at depth 2, a floor at depth 6 for
    |y| < 0.5, a hole through all on the right of it.
    """
    veil = s.Material("veil", (s.Lobe("TRANSPARENT", constant(0.25)),))
    floor = s.Material("floor", (s.Lobe("DIFFUSE", constant(0.5)),))
    left = np.zeros((1, 3, 4))
    left[0] = np.column_stack([np.diag([0.5, 1, 1]), (-0.5, 0, 8)])
    stripe = np.zeros((1, 3, 4))
    stripe[0] = np.column_stack([np.diag([1, 0.5, 1]), (0, 0, 4)])
    hole = np.zeros((1, 3, 4))
    hole[0] = np.column_stack([np.diag([0.25, 1, 1]), (0.75, 0, 9)])
    instances = (
        s.Instances("curtain", 0, left, (0,), asset="house"),
        s.Instances("ground", 0, stripe, (1,), asset="house"),
        s.Instances("cut", 0, hole, (1,), holdout=True),
    )
    return s.Scene(
        view_from_above(), (square(1.0),), instances, (veil, floor), world=s.World(**world)
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("falloff", s.MISTS)
def test_mist_of_a_veil_and_what_is_behind(backend: str, falloff: str) -> None:
    scene = stack(mist=s.Mist(1.0, 10.0, falloff))
    mist = draw(scene, "Mist", backend=backend, filter_width=0.0).passes["Mist"][..., 0]
    power = {"QUADRATIC": 2, "LINEAR": 1, "INVERSE_QUADRATIC": 0.5}[falloff]
    near, far = 0.1**power, 0.5**power
    left, middle = np.zeros((16, 16), bool), np.zeros((16, 16), bool)
    left[:, :8], middle[4:12] = True, True
    hole = np.zeros((16, 16), bool)
    hole[:, 12:] = True
    expected = np.where(left, 0.75 * near + 0.25 * np.where(middle, far, 1.0), 1.0)
    expected = np.where(~left & middle & ~hole, far, expected)
    np.testing.assert_allclose(mist, expected, atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("clear", [0.25, 1.0])
def test_gaps_are_behind_the_first_surface_though_it_dims_nothing(
    backend: str, clear: float
) -> None:
    veil = s.Material("veil", (s.Lobe("TRANSPARENT", constant(clear)),))
    sheets = np.zeros((3, 3, 4))
    sheets[:] = [np.column_stack([np.eye(3), (0, 0, z)]) for z in (8.0, 6.0, 3.0)]
    scene = s.Scene(
        view_from_above(), (square(1.0),), (s.Instances("sheets", 0, sheets, (0,)),), (veil,)
    )
    np.testing.assert_allclose(draw(scene, "Gap", backend=backend).passes["Gap"], 2.0, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_no_depth_is_no_mist(backend: str) -> None:
    """As in Cycles: what is seen has none, the background all."""
    film = draw(stack(mist=s.Mist(1.0, 0.0)), "Mist", backend=backend, filter_width=0.0)
    assert set(np.unique(film.passes["Mist"])) == {0.0, 0.25, 1.0}


@pytest.mark.parametrize("backend", BACKENDS)
def test_coverage_of_a_veil_and_what_is_behind(backend: str) -> None:
    film = draw(stack(), *CRYPTO, backend=backend, filter_width=0.0)
    left, middle, hole = np.zeros((3, 16, 16))
    left[:, :8], middle[4:12], hole[:, 12:] = 1, 1, 1
    curtain, ground = 0.75 * left, middle * (1 - hole) * np.where(left, 0.25, 1)
    wanted = {
        "Crypto Object": {"curtain": curtain, "ground": ground},
        "Crypto Material": {"veil": curtain, "floor": ground},
        "Crypto Asset": {"house": curtain + ground},
    }
    for name, things in wanted.items():
        found = shares(film.passes[name])
        assert set(found) == {id_of(thing) for thing in things}, name
        for thing, coverage in things.items():
            np.testing.assert_allclose(found[id_of(thing)], coverage, atol=1e-7)
        ranks = film.passes[name][..., 1::2]
        assert (np.diff(ranks, axis=-1) <= 0).all(), "the largest coverage comes first"


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_the_ids_leave_out_is_the_least(backend: str) -> None:
    """Five sheets, of which each passes half of the light: the two nearest are told."""
    half = s.Material("half", (s.Lobe("TRANSPARENT", constant(0.5)),))
    sheets = tuple(replace(placed(0, (0,), z=float(k)), name=f"sheet {k}") for k in range(5))
    scene = s.Scene(view_from_above(4), (square(),), sheets, (half,))
    film = draw(scene, "Crypto Object", backend=backend, crypto_ids=2)
    row = np.array([id_of("sheet 4"), 0.5, id_of("sheet 3"), 0.25], np.float32)
    assert (film.passes["Crypto Object"] == row).all()


@needs_core
@pytest.mark.parametrize("name", SCENES)
def test_the_tracers_agree(name: str) -> None:
    """Where they see the same: edges may fall to either side of a sample."""
    films = [
        draw(SCENES[name](), "Mist", *CRYPTO, *DENOISING, samples=5, backend=backend)
        for backend in ("NATIVE", "NUMPY")
    ]
    ours, truth = (film.passes for film in films)
    for key in ("Mist", *DENOISING):
        apart = np.abs(ours[key] - truth[key]).max(-1)
        assert (apart > 1e-5 * max(1, np.abs(truth[key]).max())).mean() < 0.01, key
    for crypto in CRYPTO:
        found, wanted = shares(ours[crypto]), shares(truth[crypto])
        assert set(found) == set(wanted)
        for thing, coverage in wanted.items():
            assert (np.abs(found[thing] - coverage) > 1e-5).mean() < 0.01, crypto


@needs_core
def test_the_picture_has_the_same_bits_without_them() -> None:
    for make in SCENES.values():
        scene = make()
        plain = draw(scene, samples=6).combined
        assert (draw(scene, "Mist", *CRYPTO, samples=6).combined == plain).all()


@needs_core
def test_same_bits_over_threads_waves_and_regions() -> None:
    """Where pixels stop early too."""
    for name, make in SCENES.items():
        scene = make()
        plan = engine.Settings(
            samples=16,
            light_samples=1,
            passes=frozenset({"Mist", *CRYPTO}),
            threads=1,
            error_threshold=2.0,
        )
        whole = engine.render(scene, plan).passes
        seen = engine.render(scene, replace(plan, threads=3), on_wave=lambda film: None).passes
        w, h = scene.camera.resolution
        part = engine.render(scene, replace(plan, region=(3, 2, w - 1, h - 2))).passes
        for key in ("Mist", *CRYPTO):
            assert (whole[key] == seen[key]).all(), (name, key)
            assert (whole[key][2 : h - 2, 3 : w - 1] == part[key]).all(), (name, key)


def aov_scene() -> s.Scene:
    """The stack with a veil of 0.7 in place of that of 0.25, and AOVs: a constant of the veil, the
    floor's map by a program, and one that nothing gives.
    """
    graph = Graph()
    uv = graph.apply(BY_NAME["uv"], attribute="map", shift=0)[0]
    doubled = graph.apply(BY_NAME["scaled_sum"], uv, graph.constant(2.0), uv)[0]
    of_floor = s.Material(
        "floor's",
        (s.Lobe("EMISSION", (s.Input(output=0),), aov=1),),
        program=compile_program(graph, [doubled]),
    )
    of_veil = s.Material(
        "veil's",
        (
            s.Lobe("EMISSION", constant(0.5, 2.0, -1.0)),
            s.Lobe("EMISSION", constant(0.25, 0.0, 0.0)),
        ),
    )
    scene = stack()
    thin = s.Material("veil", (s.Lobe("TRANSPARENT", constant(0.7)),), aovs=of_veil)
    floor = replace(scene.materials[1], aovs=of_floor)
    return replace(scene, materials=(thin, floor), aovs=("tint", "place", "none"))


@pytest.mark.parametrize("backend", BACKENDS)
def test_aovs_of_a_veil_and_what_is_behind(backend: str) -> None:
    """Each counts for what of the ray reaches it."""
    film = draw(aov_scene(), backend=backend, filter_width=0.0)
    left, middle, hole = np.zeros((3, 16, 16))
    left[:, :8], middle[4:12], hole[:, 12:] = 1, 1, 1
    reached = middle * (1 - hole) * np.where(left, 0.7, 1)
    line = (np.arange(16) + 0.5) / 16
    u, v = np.meshgrid(line, 2 * line - 0.5)
    tint = left[..., None] * [0.75, 2.0, -1.0, 1.0]
    place = reached[..., None] * np.stack([3 * u, 3 * v, 0 * u, 1 + 0 * u], -1)
    np.testing.assert_allclose(film.passes["AOV tint"], tint, atol=1e-6)
    np.testing.assert_allclose(film.passes["AOV place"], place, atol=1e-6)
    assert not film.passes["AOV none"].any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_lets_less_than_half_through_ends_aovs(backend: str) -> None:
    scene = aov_scene()
    thick = replace(scene.materials[0], lobes=(s.Lobe("TRANSPARENT", constant(0.45)),))
    scene = replace(scene, materials=(thick, scene.materials[1]))
    film = draw(scene, backend=backend, filter_width=0.0)
    assert not film.passes["AOV place"][:, :8].any()
    assert film.passes["AOV tint"][..., 3].sum() == 128


@needs_core
def test_aovs_change_no_bit_of_the_picture() -> None:
    scene = aov_scene()
    plain = replace(scene, aovs=())
    assert (draw(scene, samples=16).combined == draw(plain, samples=16).combined).all()
    assert set(draw(plain).passes) == {"Combined"}
    waves = draw(scene, samples=16, threads=3, region=(2, 3, 15, 14)).passes["AOV place"]
    assert (draw(scene, samples=16).passes["AOV place"][3:14, 2:15] == waves).all()


def test_aovs_that_are_not_the_scenes_are_refused() -> None:
    with pytest.raises(engine.SceneError, match=r"floor.*aovs.*1 of 1"):
        draw(replace(aov_scene(), aovs=("tint",)), backend="NUMPY")


@pytest.mark.parametrize("backend", BACKENDS)
def test_aovs_read_the_meshs_normals(backend: str) -> None:
    """Where the material bends its own."""
    graph = Graph()
    normal = graph.apply(BY_NAME["normal"])[0]
    up = graph.apply(BY_NAME["scaled_sum"], normal, graph.constant(2.0), normal)[0]
    shown = compile_program(graph, [up])
    graph = Graph()
    uv = graph.apply(BY_NAME["uv"], attribute="map", shift=0)[0]
    aside = graph.apply(
        BY_NAME["scaled_sum"], uv, graph.constant(0.0), graph.constant((1.0, 0.0, 0.0))
    )[0]
    given = s.Material("given", (s.Lobe("EMISSION", (s.Input(output=0),)),), program=shown)
    bent = s.Material(
        "bent",
        (s.Lobe("DIFFUSE"),),
        program=compile_program(graph, [aside]),
        normal_output=0,
        aovs=given,
    )
    scene = s.Scene(view_from_above(), (square(),), (placed(),), (bent,), aovs=("n",))
    film = draw(scene, "Normal", backend=backend)
    np.testing.assert_allclose(film.passes["Normal"], np.broadcast_to([1.0, 0, 0], (16, 16, 3)))
    np.testing.assert_allclose(
        film.passes["AOV n"], np.broadcast_to([0.0, 0, 3, 1], (16, 16, 4)), atol=1e-7
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_denoisers_are_told_of_a_veil_and_what_is_behind(backend: str) -> None:
    """Normals look at the camera, depths begin at the near end, highlights count by their area."""
    scene = stack()
    floor = s.Material(
        "floor",
        (
            s.Lobe("DIFFUSE", constant(0.5, 0.25, 0.0)),
            s.Lobe("SPECULAR", constant(3.0), exponent=38.0),
            s.Lobe("MIRROR", constant(0.125)),
        ),
    )
    camera = replace(scene.camera, clip_start=0.5)
    scene = replace(scene, camera=camera, materials=(scene.materials[0], floor))
    film = draw(scene, *DENOISING, backend=backend, filter_width=0.0, max_bounces=0)
    left, middle, hole = np.zeros((3, 16, 16))
    left[:, :8], middle[4:12], hole[:, 12:] = 1, 1, 1
    curtain, ground = 0.75 * left, middle * (1 - hole) * np.where(left, 0.25, 1)
    for name, wanted in (
        ("Normal", (curtain + ground)[..., None] * [0.0, 0.0, -1.0]),
        ("Albedo", ground[..., None] * [1.225, 0.975, 0.725]),
        ("Depth", (1.5 * curtain + 5.5 * ground)[..., None]),
    ):
        np.testing.assert_allclose(film.passes[f"Denoising {name}"], wanted, atol=1e-6)
