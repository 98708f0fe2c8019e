"""Lights whose programs say how bright they are: closed forms, and one tracer beside the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES, checker
from glint import engine
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.graph import Graph, Value
from glint.engine.program.program import Program, compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.scene.problems import scene_problems
from native_tools import (
    color,
    constant,
    lamp,
    material,
    pixel_centers,
    placed,
    square,
    view_from_above,
)
from test_core_against_reference import relative_error

BACKENDS = engine.available_backends()
PLACES = ("position", "object_position", "camera_position", "window")
DIRECTIONS = ("normal", "face_normal", "object_normal", "incoming", "reflection", "object_location")
NUMBERS = ("ray_length", "backfacing", "light_path")
KINDS = ("POINT", "SPOT", "AREA")


class Sum:
    """A graph's vectors, summed up."""

    def __init__(self) -> None:
        self.graph = Graph()

    def apply(self, name: str, *arguments: Value, **settings) -> Value:
        return self.graph.apply(BY_NAME[name], *arguments, **settings)[0]

    def vector(self, name: str) -> Value:
        if name in NUMBERS:
            return self.apply("combine_xyz", *[self.apply(name)] * 3)
        return self.apply(name, **({"shift": 0} if name in PLACES else {}))

    def program(self, *names: str) -> Program:
        """1 plus a little of each."""
        total = self.graph.constant((1.0, 1.0, 1.0))
        for name in names:
            part = self.graph.constant(1e-30 if name == "ray_length" else 0.07)
            total = self.apply("scaled_sum", self.vector(name), part, total)
        return compile_program(self.graph, [total])


def by_length() -> Program:
    made = Sum()
    return compile_program(made.graph, [made.vector("ray_length")])


def by_image() -> Program:
    """A slide, thrown along the light's axes."""
    made = Sum()
    place = made.apply("image", made.vector("object_normal"), texture=0)
    return compile_program(made.graph, [place])


def plane(*lights: s.Light) -> s.Scene:
    white = material(s.Lobe("DIFFUSE", constant(1.0)))
    return s.Scene(view_from_above(), (square(),), (placed(),), (white,), (), lights)


def lit_by(scene: s.Scene, program: Program, **more) -> s.Scene:
    """The scene whose lights all have the program."""
    return replace(
        scene,
        lights=tuple(replace(light, program=program, **more) for light in scene.lights),
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["POINT", "AREA"])
def test_light_falls_off_as_the_program_says(kind: str, backend: str) -> None:
    """Times the distance: with its first power alone."""
    c, strength = np.array([0.3, -0.2, 1.7]), 120.0
    picture = color(
        plane(lamp(kind, c, strength=strength, cast_shadow=False, program=by_length())),
        backend=backend,
    )
    to = c - pixel_centers()
    d = np.sqrt((to**2).sum(-1))
    z = to[..., 2] / d
    truth = strength * z / (4 * np.pi**2 * d) * (4 * z if kind == "AREA" else 1)
    np.testing.assert_allclose(picture, np.repeat(truth[..., None], 3, -1), rtol=1e-6)


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("name", [*PLACES, *DIRECTIONS, *NUMBERS])
def test_both_tracers_read_the_same_of_a_light(name: str, samples: int) -> None:
    scene = lit_by(SCENES["soft_lights"](), Sum().program(name))
    agree(scene, samples)


@pytest.mark.parametrize("name", ["glass", "alpha", "clipped_lamps", "mirrors"])
def test_both_tracers_agree_behind_glass_and_in_highlights(name: str) -> None:
    agree(lit_by(SCENES[name](), Sum().program("normal", "position", "light_path")), 3)


def test_images_are_the_lights_own() -> None:
    """Whatever textures the scene has."""
    scene = SCENES["texture_repeat"]()
    own = replace(checker(size=4), interpolation="LINEAR")
    made = agree(lit_by(scene, by_image(), textures=(own,)), 1)
    assert not np.array_equal(made, engine.render(scene, engine.Settings(samples=1)).combined)


def test_what_a_light_sheds_is_explained() -> None:
    """The terms of pixels add up to the picture."""
    scene = lit_by(SCENES["soft_lights"](), Sum().program("normal", "light_path"))
    settings = engine.Settings(samples=1, light_samples=2, max_bounces=2, backend="NUMPY")
    picture, explainer = engine.render(scene, settings).combined, PixelExplainer(scene, settings)
    height, width = picture.shape[:2]
    for y, x in [(height // 2, width // 2), (height // 4, width // 3), (1, 1), (height - 2, 5)]:
        found = explainer.pixel(x, y).color
        np.testing.assert_allclose(found, picture[y, x, :3], rtol=2**-22, atol=1e-12)


def agree(scene: s.Scene, samples: int) -> np.ndarray:
    settings = engine.Settings(samples=1, light_samples=samples, max_bounces=4)
    core, reference = (
        engine.render(scene, replace(settings, backend=backend)).combined
        for backend in ("NATIVE", "NUMPY")
    )
    error = relative_error(core, reference)
    assert error.max() <= 1e-4, (float(error.max()), int((error > 1e-4).sum()))
    return core


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_not_finite_is_black(backend: str) -> None:
    made = Sum()
    length = made.apply("ray_length")
    far = made.apply("math", *[made.graph.constant(1e300)] * 3, operation=2, clamp=0)
    value = made.apply("math", far, length, length, operation=2, clamp=0)
    program = compile_program(made.graph, [made.apply("combine_xyz", value, length, length)])
    picture = color(plane(lamp("POINT", cast_shadow=False, program=program)), backend=backend)
    assert (
        np.isfinite(picture).all() and (picture[..., 0] == 0).all() and (picture[..., 1:] > 0).all()
    )


def test_what_a_light_cannot_read_is_told() -> None:
    made = Sum()
    reads = compile_program(made.graph, [made.apply("uv", attribute="", shift=0)])
    assert any("attribute" in text for text in scene_problems(plane(lamp("SUN", program=reads))))
    dome = replace(lamp("DOME", program=by_length()), radiance=np.ones((1, 1, 3), np.float32))
    assert any("DOME" in text for text in scene_problems(plane(dome)))
    assert any("texture" in text for text in scene_problems(plane(lamp("SUN", program=by_image()))))
    for name in ("barycentric", "edge_distance", "pixel_step"):
        with_triangle = Sum()
        value = with_triangle.apply(name, **({"axis": 1} if name == "pixel_step" else {"shift": 0}))
        program = compile_program(with_triangle.graph, [value])
        found = scene_problems(plane(lamp("SUN", program=program)))
        assert any("triangle" in text for text in found), name
