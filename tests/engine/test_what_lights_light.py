"""Lights that light matt lobes alone, or gloss, or no media: `Light.lights_matt`, `lights_gloss`
and `lights_media`, and what glows by the visibility of its instances.
"""

from __future__ import annotations

import functools
import hashlib
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.lights.lit import lit_scene
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
MATT = (
    s.Lobe("DIFFUSE", constant(0.4, 0.5, 0.6)),
    s.Lobe("SHEEN", constant(0.3, 0.2, 0.1), width=0.6, lean=0.2),
)
GLOSS = (
    s.Lobe("SPECULAR", constant(0.4, 0.3, 0.2), 40.0, masking=0.2),
    s.Lobe("SPECULAR", constant(0.1, 0.2, 0.3), 5.0),
)
GLOW = material(s.Lobe("EMISSION", constant(5.0, 4.0, 3.0)))
SKY = np.linspace(0.2, 1.0, 4 * 8 * 3, dtype=np.float32).reshape(4, 8, 3)
LAMPS = {
    "point": (lamp("POINT", (0.5, 0.2, 2), strength=50.0),),
    "ball": (lamp("POINT", (0.5, 0.2, 2), strength=50.0, radius=0.4),),
    "sun": (lamp("SUN", strength=2.0, angle=0.2),),
    "spot": (lamp("SPOT", (0.5, 0.2, 2), strength=50.0, spot_size=2.0, spot_blend=0.3),),
    "area": (lamp("AREA", (0.5, 0.2, 2), strength=50.0, size_x=1.0, size_y=0.6),),
    "sky": (s.Light("sky", "DOME", IDENTITY, radiance=SKY),),
    "many": tuple(
        lamp("AREA", (0.1 * k, 0.2, 2), strength=5.0, size_x=0.3, size_y=0.3) for k in range(6)
    ),
    "crowd": tuple(
        lamp("POINT", (1.0 + 0.002 * k, 0.01 * (k % 7), 4), strength=5.0) for k in range(80)
    ),
}
LIT = {"by_world": False, "by_meshes": True}
SETTINGS = {"samples": 2, "light_samples": 2, "lamp_shadows": 2}


def floor(lobes: tuple[s.Lobe, ...], lights: tuple[s.Light, ...] = ()) -> s.Scene:
    """A floor and a small shade over it; what glows is beside it, unless there are lights."""
    panel = placed(0, (2,), z=2.0, linear=np.diag([0.1, 0.05, 1.0]), visible_camera=False)
    return s.Scene(
        view_from_above(8),
        (square(),),
        (
            placed(0, (0,)),
            placed(0, (1,), z=0.7, linear=0.04, visible_camera=False),
            *(() if lights else (panel,)),
        ),
        (material(*lobes), material(), GLOW),
        (),
        lights,
    )


def without(scene: s.Scene, matt: bool, gloss: bool, media: bool = True) -> s.Scene:
    """The same where lights, and what glows, light but some lobes."""
    flags = {"visible_diffuse": matt, "visible_mirror": gloss, "visible_media": media}
    stands, panels = scene.instances[:2], scene.instances[2:]
    panels = tuple(replace(panel, **flags) for panel in panels)
    flags = {"lights_matt": matt, "lights_gloss": gloss, "lights_media": media}
    lights = tuple(replace(light, **flags) for light in scene.lights)
    return replace(scene, instances=stands + panels, lights=lights)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("light", [*LAMPS, "glow"])
def test_each_kind_of_lobe_is_as_if_it_were_alone(light: str, backend: str) -> None:
    lights = LAMPS.get(light, ())
    both = floor(MATT + GLOSS, lights)
    settings = {**SETTINGS, "backend": backend}
    if light in ("many", "crowd"):  # shares of shadows follow what lobes give: no shade
        both = replace(both, instances=both.instances[:1])
    for matt, gloss, left in ((True, False, MATT), (False, True, GLOSS)):
        alone = replace(both, materials=(material(*left), *both.materials[1:]))
        found = color(without(both, matt, gloss), **settings)
        expected = color(alone, **settings)
        assert expected.max() > 1e-3
        tolerance = 1e-3 if light == "crowd" else 1e-5  # of clusters
        np.testing.assert_allclose(found, expected, rtol=tolerance, atol=tolerance * expected.max())
    assert (color(without(both, False, False), **settings) == 0).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_strands_have_both_kinds(backend: str) -> None:
    hair = s.Strands(
        "hair",
        np.array([(-2, 0, 0), (2, 0, 0)], np.float32),
        np.full(2, 0.8, np.float32),
        np.zeros(1, np.uint32),
    )
    kinds = (
        s.Lobe("DIFFUSE", constant(0.3, 0.2, 0.1)),
        s.Lobe("SPECULAR", constant(0.3, 0.4, 0.5), 30.0),
    )
    scene = replace(floor(MATT, LAMPS["ball"]), geometries=(hair,), instances=(placed(0, (0,)),))
    scene = replace(scene, materials=(material(*kinds),))
    for k, flags in enumerate(((True, False), (False, True))):
        found = color(without_all(scene, *flags), **SETTINGS, backend=backend)
        alone = replace(scene, materials=(material(kinds[k]),))
        np.testing.assert_allclose(found, color(alone, **SETTINGS, backend=backend), atol=1e-6)
        assert found.max() > 1e-3


def without_all(scene: s.Scene, matt: bool, gloss: bool) -> s.Scene:
    flags = {"lights_matt": matt, "lights_gloss": gloss}
    return replace(scene, lights=tuple(replace(light, **flags) for light in scene.lights))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("light", ["ball", "glow"])
def test_media_get_no_light_that_is_not_for_them(light: str, backend: str) -> None:
    scene = floor((), LAMPS.get(light, ()))
    fog = s.Medium((0.02, 0.05, 0.1), (0.1, 0.2, 0.3))
    scene = replace(scene, world=s.World(medium=fog))
    settings = {"samples": 1, "light_samples": 2, "volume_samples": 4, "backend": backend}
    lit = color(scene, **settings)
    assert lit.min() > 1e-5
    assert np.array_equal(color(without(scene, False, False), **settings), lit)
    assert (color(without(scene, True, True, media=False), **settings) == 0).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_matt_surfaces_do_not_get_does_not_bounce(backend: str) -> None:
    """Between a floor and a ceiling that no ray but a bounced one sees."""
    samples = {"NATIVE": 16, "NUMPY": 2}[backend]
    settings = {**SETTINGS, "samples": samples, "soft_light": "DEALT", "backend": backend}

    def thrown(scene: s.Scene) -> np.ndarray:
        hidden = {f"visible_{kind}": False for kind in ("camera", "mirror", "shadow")}
        both = (*scene.instances, placed(0, (0,), z=3.0, **hidden))
        scene = replace(scene, instances=both)
        return color(scene, diffuse_bounces=1, **settings) - color(scene, **settings)

    for lights in (LAMPS["ball"], ()):
        scene = floor(MATT, lights)
        assert thrown(scene).max() > 1e-3
        assert not thrown(without(scene, False, True)).any()


def test_what_glows_for_some_and_for_all_is_two_lights() -> None:
    scene = without(floor(MATT + GLOSS), False, True)
    panel = scene.instances[-1]
    other = replace(panel, visible_diffuse=True)
    both = replace(scene, instances=(*scene.instances, other))
    lights = lit_scene(both, **LIT).lights
    assert [(x.kind, x.lights_matt) for x in lights] == [("MESH", False), ("MESH", True)]


def test_skies_and_glow_that_light_nothing_are_left_out() -> None:
    fog = s.World(medium=s.Medium((0.02, 0.05, 0.1), (0.1, 0.2, 0.3)))
    for lights in (LAMPS["sky"], ()):
        scene = without(floor(MATT + GLOSS, lights), False, False)
        lit = {**LIT, "by_world": True}
        assert lit_scene(scene, **lit).lights == ()
        assert len(lit_scene(replace(scene, world=fog), **lit).lights) == 1
        assert (
            lit_scene(without(replace(scene, world=fog), False, False, False), **lit).lights == ()
        )


def scenes() -> list[s.Scene]:
    return [
        without(floor(MATT + GLOSS, lights), *flags)
        for lights in (*LAMPS.values(), ())
        for flags in ((True, False), (False, True))
    ]


def test_both_tracers_draw_the_same() -> None:
    settings = {**SETTINGS, "diffuse_bounces": 1}
    for scene in scenes():
        one, other = (color(scene, **settings, backend=backend) for backend in BACKENDS)
        assert np.abs(one - other).max() <= 1e-4 * other.max()


@functools.cache
def hashes(threads: int = 0) -> str:
    pictures = [color(x, **SETTINGS, threads=threads).tobytes() for x in scenes()]
    return hashlib.sha256(b"".join(pictures)).hexdigest()


def test_instruction_sets_and_threads_change_nothing() -> None:
    assert assert_instruction_sets_agree(hashes) == hashes(1)


def test_passes_split_what_is_left() -> None:
    """Where light of both kinds is told apart one of them is black."""
    scene = floor(MATT + GLOSS, LAMPS["area"])
    for flags, dark, lit in (
        ((True, False), "Glossy Direct", "Diffuse Direct"),
        ((False, True), "Diffuse Direct", "Glossy Direct"),
    ):
        for backend in BACKENDS:
            film = draw(without(scene, *flags), dark, lit, **SETTINGS, backend=backend)
            assert not film.passes[dark].any()
            assert film.passes[lit].any()


def test_a_pixel_that_is_explained_has_what_it_shows() -> None:
    for scene in scenes()[:6]:
        shown = color(scene, samples=1, backend="NUMPY")[4, 4]
        ray = PixelExplainer(scene, Settings(samples=1, light_samples=1)).pixel(4, 4)
        np.testing.assert_allclose(ray.color, shown, rtol=1e-4, atol=1e-6)
