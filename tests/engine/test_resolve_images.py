"""Light that is resolved where surfaces reflect and let through: rough ones are averaged as matt
ones; what mirrors and clear glass show is averaged over the surfaces there, and stays sharp.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bounced_scenes import matt
from glint import engine
from glint.engine import scene as s
from glint.engine.film import LIGHTING, PARTS
from glint.engine.program.program import compile_program
from native_tools import needs_core
from test_resolve import corner
from test_rough_glass import computed

ROUGH, WHITE = 20.0, (s.Input((0.9,) * 3),)
GLOSS = s.Lobe("SPECULAR", (s.Input((0.8 * (ROUGH + 2) / 8,) * 3),), ROUGH, masking=0.3)
MIRROR = s.Lobe("MIRROR", WHITE)
CLEAR = s.Lobe("REFRACTION", WHITE, ior=1.4)
FROSTED = replace(CLEAR, exponent=ROUGH)
HALF = (s.Input((0.5,) * 3),)
VARNISHED = (replace(MIRROR, factors=HALF), GLOSS)


def tiles(count: int = 24) -> list[s.Mesh]:
    """A floor of white and black squares, each colour a mesh."""
    line = np.linspace(-3, 3, count + 1)
    points = np.array([(x, y, 0) for y in line for x in line], np.float32)
    i, j = np.meshgrid(np.arange(count), np.arange(count))
    first = j * (count + 1) + i
    beside = first + 1, first + count + 2, first + count + 1
    faces = np.stack([first, beside[0], beside[1], first, beside[1], beside[2]], -1)
    return [
        s.Mesh(f"tiles {k}", points, faces[(i + j) % 2 == k].reshape(-1, 3).astype(np.uint32))
        for k in (0, 1)
    ]


def hall(lobes: tuple[s.Lobe, ...], size: int = 64) -> s.Scene:
    """Tiles with a box on them before a wall of these lobes; of glass, a ball of it over them."""
    found = corner(size)
    _, wall, box = found.instances
    white, black = (s.Instances(f"tiles {k}", 2 + k, np.eye(3, 4)[None], (k,)) for k in (0, 1))
    shown = s.Material("shown", lobes)
    materials = (matt((0.8,) * 3), matt((0.1, 0.1, 0.3)), found.materials[2], shown)
    is_glass = lobes[0].kind == "REFRACTION"
    ball = s.Spheres("ball", np.array([(0.3, -0.8, 1.0)], np.float32), np.array([0.9], np.float32))
    return replace(
        found,
        geometries=(*found.geometries, *tiles(), ball),
        materials=materials,
        instances=(
            *(white, black, box),
            replace(wall, materials=(0 if is_glass else 3,)),
            *([s.Instances("ball", 4, np.eye(3, 4)[None], (3,))] if is_glass else ()),
        ),
    )


def settings(kind: str, samples: int, **more) -> engine.Settings:
    passes = frozenset({*PARTS, *LIGHTING})
    chosen = {"light_samples": 2, "diffuse_bounces": 2, "max_bounces": 4, "passes": passes}
    chosen |= {"samples": samples, "soft_light": kind, "reflections": "ALL"}
    return engine.Settings(**{**chosen, **more})


@cache
def film_of(lobes: tuple[s.Lobe, ...], kind: str, samples: int, light_samples: int) -> engine.Film:
    return engine.render(hall(lobes), settings(kind, samples, light_samples=light_samples))


def drawn(lobes: tuple[s.Lobe, ...], kind: str, samples: int, light_samples: int = 2) -> np.ndarray:
    """(h, w, 3) over black where pixels show other things than these lobes."""
    name = "Transmission Color" if lobes[0].kind == "REFRACTION" else "Glossy Color"
    color = film_of(lobes, "SHARED", 256, 8).passes[name]
    picture = film_of(lobes, kind, samples, light_samples).combined[..., :3].astype(float)
    return np.where(color > 0.99 * color.max(), picture, 0.0)


def error(lobes: tuple[s.Lobe, ...], kind: str, samples: int) -> float:
    """Relative RMSE against many samples."""
    truth = drawn(lobes, "SHARED", 256, 8)
    off = drawn(lobes, kind, samples) - truth
    return float(np.sqrt((off**2).mean() / (truth**2).mean()))


def dots(picture: np.ndarray) -> int:
    """How many pixels are brighter by a fifth than all of their neighbours."""
    light = picture.sum(-1)
    height, width = light.shape
    padded = np.pad(light, 1)
    moved = [padded[y:][:height, x:][:, :width] for y in range(3) for x in range(3)]
    return int((light > 1.2 * np.max(moved[:4] + moved[5:], 0)).sum())


def contrast(picture: np.ndarray, truth: np.ndarray) -> float:
    """How much of what pixels of the truth differ from their neighbours by a picture shows."""

    def edges(light: np.ndarray) -> np.ndarray:
        beside = light[:-2, 1:-1] + light[2:, 1:-1] + light[1:-1, :-2] + light[1:-1, 2:]
        return 4 * light[1:-1, 1:-1] - beside

    own, true = edges(picture.sum(-1)), edges(truth.sum(-1))
    return float((own * true).sum() / (true**2).sum())


# --- rough ones


@needs_core
@pytest.mark.parametrize("samples", [4, 16])
@pytest.mark.parametrize("lobe", [GLOSS, FROSTED], ids=["gloss", "frosted"])
def test_what_rough_surfaces_show_is_averaged(lobe, samples):
    dealt, resolved = (error((lobe,), kind, samples) for kind in ("DEALT", "RESOLVED"))
    assert resolved < 0.6 * dealt
    dealt, resolved = (dots(drawn((lobe,), kind, samples)) for kind in ("DEALT", "RESOLVED"))
    assert resolved < 0.3 * dealt


@needs_core
@pytest.mark.parametrize("samples", [4, 16])
def test_gloss_beneath_a_mirror_is_averaged_too(samples):
    dealt, resolved = (error(VARNISHED, kind, samples) for kind in ("DEALT", "RESOLVED"))
    assert resolved < 0.75 * dealt


# --- sharp ones


@needs_core
@pytest.mark.parametrize("samples", [4, 16])
@pytest.mark.parametrize("lobe", [MIRROR, CLEAR], ids=["mirror", "clear"])
def test_images_stay_sharp(lobe, samples):
    """Tiles of few pixels each: most of a mirror's error is at their edges."""
    truth = drawn((lobe,), "SHARED", 256, 8)
    dealt, resolved = (drawn((lobe,), kind, samples) for kind in ("DEALT", "RESOLVED"))
    assert contrast(resolved, truth) > 0.9 * contrast(dealt, truth)
    most = 0.6 if lobe is CLEAR else 0.96
    assert error((lobe,), "RESOLVED", samples) < most * error((lobe,), "DEALT", samples)


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize("lobe", [MIRROR, CLEAR], ids=["mirror", "clear"])
def test_images_of_plain_surfaces_have_no_dots(lobe, backend):
    """A ball of it on a floor: neighbours see that from far apart, so that no pattern of points
    repeats from block to block.
    """
    size = 48 if backend == "NUMPY" else 96
    found = hall((CLEAR,), size)
    near = replace(found.camera, window=(-0.25, 0.0, -0.18, 0.07))
    floor, ball = found.instances[0], found.instances[-1]
    shown = replace(found.materials[3], lobes=(lobe,))
    scene = replace(
        found,
        camera=near,
        materials=(*found.materials[:3], shown),
        instances=(replace(floor, geometry=0), ball),
    )
    name = "Glossy Indirect" if lobe is MIRROR else "Transmission Indirect"
    dealt, resolved, truth = (
        engine.render(scene, settings(kind, samples, light_samples=points, backend=by)).passes[name]
        for kind, samples, points, by in (
            ("DEALT", 8, 2, backend),
            ("RESOLVED", 8, 2, backend),
            ("SHARED", 64, 8, "NATIVE"),
        )
    )
    image = truth.min(-1) > 0
    assert image.sum() > size

    def error(picture: np.ndarray) -> float:
        """Of most pixels, which show no edges."""
        return float(np.median(np.abs(picture - truth)[image]))

    assert error(resolved) < 0.65 * error(dealt)


# --- both tracers


@needs_core
@pytest.mark.parametrize(
    "lobes",
    [
        VARNISHED,
        (replace(CLEAR, factors=HALF), replace(FROSTED, factors=HALF)),
        (MIRROR,),
        (CLEAR,),
    ],
    ids=["varnished", "glass", "mirror", "clear"],
)
def test_tracers_agree(lobes):
    core, reference = (
        engine.render(hall(lobes, 16), settings("RESOLVED", 6, backend=backend))
        for backend in ("NATIVE", "NUMPY")
    )
    for name in ("Combined", *PARTS, *LIGHTING):
        found, expected = core.passes[name].astype(float), reference.passes[name].astype(float)
        floor = 0.01 * np.abs(expected).mean() + 1e-12
        assert (np.abs(found - expected) <= 3e-4 * (np.abs(expected) + floor)).all(), name


@needs_core
@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_glass_that_a_program_makes_clear_is_clear(backend):
    graph, value = computed(0.0)
    scene = hall((CLEAR,), 16)
    lobes = (replace(FROSTED, exponent_output=0),)
    varied = replace(scene.materials[-1], lobes=lobes, program=compile_program(graph, [value]))
    pictures = [
        engine.render(found, settings("RESOLVED", 4, backend=backend)).combined
        for found in (scene, replace(scene, materials=(*scene.materials[:-1], varied)))
    ]
    assert np.allclose(*pictures, rtol=1e-5, atol=1e-7)


# --- what the film holds


def matt_alone() -> s.Scene:
    found = hall((s.Lobe("DIFFUSE", WHITE),))
    return replace(found, materials=(*found.materials[:2], matt((0.5,) * 3), found.materials[3]))


def misty() -> s.Scene:
    found = corner(32)
    haze = s.Medium(absorption=(0.02,) * 3, scattering=(0.08,) * 3)
    return replace(found, world=replace(found.world, medium=haze))


@needs_core
@pytest.mark.parametrize(
    "scene",
    [
        matt_alone,
        misty,
        *(lambda lobe=lobe: hall((lobe,), 32) for lobe in (GLOSS, MIRROR, FROSTED)),
    ],
    ids=["matt", "misty", "gloss", "mirror", "frosted"],
)
def test_light_that_is_not_there_is_not_missed(scene):
    """All passes of light are kept where one is asked for, else those alone that may be lit."""
    asked = settings("RESOLVED", 4)
    whole, least = (
        engine.render(scene(), replace(asked, passes=passes)).combined
        for passes in (frozenset({"Diffuse Color"}), frozenset())
    )
    assert np.array_equal(whole, least)


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_what_gives_light_has_no_halo_in_mirrors(backend: str) -> None:
    """A small and very bright card in a mirror ball, of which hardly any pixels are alike."""
    scene = hall((CLEAR,), 32)
    card = s.Mesh(
        "card",
        np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )
    glow = s.Material("glow", (s.Lobe("EMISSION", (s.Input((500.0,) * 3),)),))
    stands = np.column_stack([np.eye(3), (0.2, -1.2, 3.5)])[None]
    above = s.Instances("card", len(scene.geometries), stands, (4,), visible_camera=False)
    scene = replace(
        scene,
        geometries=(*scene.geometries, card),
        materials=(*scene.materials[:3], s.Material("shown", (MIRROR,)), glow),
        instances=(*scene.instances, above),
    )
    found, own = (
        engine.render(scene, settings(kind, 4, backend=backend)).passes
        for kind in ("RESOLVED", "DEALT")
    )
    image = (own["Glossy Color"].min(-1) > 0.1) & (own["Diffuse Color"].max(-1) == 0)
    direct = own["Glossy Direct"][image]
    assert (direct.max(-1) > 100).sum() > 1 < (direct.max(-1) == 0).sum()
    np.testing.assert_allclose(found["Glossy Direct"][image], direct, rtol=1e-5, atol=1e-5)
