"""Media that vary from place to place (semantics/media.md): closed forms, the core against the
reference, and what their programs may not do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import at, ball_mesh, box_mesh, constant, grid_mesh, surface
from glint import engine
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.program.graph import Graph, Value
from glint.engine.program.operations_math import MathOperation
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.scene.problems import scene_problems
from media_scenes import GLASS, both, filled, orthographic, rich, things
from native_tools import assert_instruction_sets_agree

BACKENDS = ("NATIVE", "NUMPY")
COLORS = np.array([0.5, 1.0, 2.0])


class Tree:
    """A graph with the operations that these media are made of."""

    def __init__(self) -> None:
        self.graph = Graph()

    def apply(self, name: str, *arguments: Value, **settings: int) -> Value:
        return self.graph.apply(BY_NAME[name], *arguments, **settings)[0]

    def math(self, name: str, *numbers: Value | float) -> Value:
        given = [self.graph.constant(x) if isinstance(x, float) else x for x in numbers]
        given += [self.graph.constant(0.0)] * (3 - len(given))
        return self.apply("math", *given, operation=MathOperation[name], clamp=0)

    def place(self, name: str = "object_position") -> tuple[Value, ...]:
        return self.graph.apply(BY_NAME["separate_xyz"], self.apply(name, shift=0))

    def colored(self, number: Value, color=COLORS) -> Value:
        zero = self.graph.constant((0.0, 0.0, 0.0))
        return self.apply("scaled_sum", self.graph.constant(tuple(map(float, color))), number, zero)

    def noise(self, name: str = "object_position") -> Value:
        """Smoke with holes."""
        numbers = map(self.graph.constant, (0.0, 3.0, 2.0, 0.5, 2.0, 0.0, 1.0, 0.0))
        found = self.apply(
            "noise_texture", self.apply(name, shift=0), *numbers, dimensions=3, noise_type=1,
            normalize=1,
        )  # fmt: skip
        return self.math(
            "MULTIPLY", self.math("MAXIMUM", self.math("SUBTRACT", found, 0.4), 0.0), 8.0
        )

    def medium(self, step: float = 1 / 32, **outputs: Value) -> s.Medium:
        """Of values by the names of what they are."""
        numbers = {f"{name}_output": k for k, name in enumerate(outputs)}
        program = compile_program(self.graph, list(outputs.values()))
        return s.Medium(program=program, step=step, **numbers)


def absorbing(make, name: str = "object_position", **more) -> s.Medium:
    """make: the density of a tree at x, y, z."""
    tree = Tree()
    return tree.medium(absorption=tree.colored(make(tree, *tree.place(name))), **more)


DENSITIES = {
    "linear": (
        lambda t, x, y, z: t.math("ADD", z, 1.0),
        lambda x, y: 2.0 + 0 * x,
    ),
    "exponential": (
        lambda t, x, y, z: t.math("EXPONENT", t.math("MULTIPLY", z, -2.0)),
        lambda x, y: np.sinh(2.0) + 0 * x,
    ),
    "across": (
        lambda t, x, y, z: t.math("MAXIMUM", x, 0.0),
        lambda x, y: 2 * np.maximum(x, 0),
    ),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("density", DENSITIES)
def test_a_box_in_closed_form(density: str, backend: str) -> None:
    """e^(-∫ density), in a box that is as high as 2; within what steps of a 32nd leave of it."""
    make, depth = DENSITIES[density]
    scene = things(
        (box_mesh(), at(), filled("fog", absorbing(make))),
        camera=orthographic(half=1.2),
        world=s.World(background=(1.0, 1.0, 1.0)),
    )
    settings = engine.Settings(samples=4, filter_width=0.0, backend=backend)
    found = engine.render(scene, settings).combined[..., :3]
    x = (np.arange(16) + 0.5) / 16 * 2.4 - 1.2
    x, y = np.meshgrid(x, x)
    inside = (np.abs(x) < 1) & (np.abs(y) < 1)
    exact = np.exp(-COLORS * np.where(inside, depth(x, y), 0.0)[..., None])
    np.testing.assert_allclose(found, exact, rtol=2e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ball_whose_density_falls_to_its_edge(backend: str) -> None:
    """1 - r² along a chord of half length h: 4 h³ / 3, with h² = 1 - x² - y²; from perspective, in
    a ball of radius 0.5 that stands elsewhere and is turned, so that lengths and places count.
    """
    tree = Tree()
    place = tree.apply("object_position", shift=0)
    third = tree.apply("vector_average", tree.apply("product", place, place))
    density = tree.math("MAXIMUM", tree.math("MULTIPLY_ADD", third, -3.0, 1.0), 0.0)
    scene = things(
        (
            s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32)),
            at((0.3, 0.2, 0.1), 0.5),
            filled("fog", tree.medium(absorption=tree.colored(density))),
        ),
        world=s.World(background=(1.0, 1.0, 1.0)),
    )
    settings = engine.Settings(samples=8, filter_width=0.0, backend=backend)
    found = engine.render(scene, settings).combined[..., :3]
    camera = scene.camera
    axes, eye = camera.world_from_camera[:, :3], camera.world_from_camera[:, 3]
    left, right, bottom, top = camera.window
    width, height = camera.resolution
    u, v = np.meshgrid(
        left + (np.arange(width) + 0.5) / width * (right - left),
        bottom + (np.arange(height) + 0.5) / height * (top - bottom),
    )
    d = np.stack([u, v, -np.ones_like(u)], -1) @ axes.T
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    to = np.array([0.3, 0.2, 0.1]) - eye
    off2 = (to * to).sum() - (d @ to) ** 2
    half = np.sqrt(np.maximum(1 - off2 / 0.25, 0.0))
    exact = np.exp(-0.5 * 4 / 3 * COLORS * half[..., None] ** 3)
    np.testing.assert_allclose(found, exact, atol=1e-3)
    assert (found < 0.9).any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_world_of_ground_fog_in_closed_form(backend: str) -> None:
    """Density e^(-z) from height 9 down to a floor at 0: 1 - e^-9; beside it without end."""
    medium = absorbing(
        lambda t, x, y, z: t.math("EXPONENT", t.math("MULTIPLY", z, -1.0)), "position", step=1.0
    )
    floor = s.Material("floor", (s.Lobe("EMISSION", constant(1.0)),))
    scene = things(
        (grid_mesh(), at(), floor),
        camera=orthographic(half=0.5),
        world=s.World(background=(1.0, 1.0, 1.0), medium=medium),
    )
    settings = engine.Settings(samples=64, filter_width=0.0, backend=backend)
    found = engine.render(scene, replace(settings, region=(7, 7, 9, 9))).combined[..., :3]
    np.testing.assert_allclose(
        -np.log(found), np.broadcast_to(COLORS * (1 - np.exp(-9)), found.shape), rtol=2e-3
    )
    up = replace(
        scene.camera,
        world_from_camera=np.column_stack([np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 0.5)]),
    )
    above = engine.render(replace(scene, camera=up), replace(settings, region=(8, 8, 9, 9)))
    found = above.combined[0, 0, :3]
    np.testing.assert_allclose(found, np.exp(-COLORS * np.exp(-0.5)), rtol=2e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_slab_in_the_sun(backend: str) -> None:
    """Light goes down and comes back up through density z + 1: with the depth τ from above it is
    ∫ σs/σ p E e^(-2τ) dτ, whatever the density; here σ = σs and g = 0.
    """
    tree = Tree()
    density = tree.math("ADD", tree.place()[2], 1.0)
    scene = things(
        (box_mesh(), at(), filled("fog", tree.medium(scattering=tree.colored(density)))),
        camera=orthographic(size=(5, 5), half=0.5),
        lights=(s.Light("sun", "SUN", at((0, 0, 5.0))[0], strength=2.0),),
    )
    settings = engine.Settings(samples=32, volume_samples=4, filter_width=0.0, backend=backend)
    found = engine.render(scene, settings).combined[2, 2, :3]
    exact = 2.0 / (4 * np.pi) * (1 - np.exp(-2 * COLORS * 2)) / 2
    np.testing.assert_allclose(found, exact, rtol=2e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_fire_in_closed_form(backend: str) -> None:
    """j = z + 1 in what absorbs evenly: ∫ (2 - t) e^(-σt) dt over 0 to 2."""
    tree = Tree()
    glow = tree.colored(tree.math("ADD", tree.place()[2], 1.0), (1.0, 1.0, 1.0))
    medium = replace(tree.medium(emission=glow), absorption=tuple(COLORS))
    scene = things((box_mesh(), at(), filled("fire", medium)), camera=orthographic(half=0.5))
    settings = engine.Settings(samples=8, filter_width=0.0, backend=backend)
    found = engine.render(scene, settings).combined[8, 8, :3]
    exact = (2 * COLORS - 1 + np.exp(-2 * COLORS)) / COLORS**2
    np.testing.assert_allclose(found, exact, rtol=1e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_the_same_everywhere_is_as_without_a_program(backend: str) -> None:
    """A program whose value does not vary: the homogeneous medium."""
    tree = Tree()
    same = tree.math("MULTIPLY_ADD", tree.place()[0], 0.0, 1.0)
    varied = tree.medium(
        absorption=tree.colored(same, (0.1, 0.2, 0.3)),
        scattering=tree.colored(same, (0.4, 0.3, 0.2)),
        emission=tree.colored(same, (0.0, 0.1, 0.2)),
        anisotropy=tree.math("MULTIPLY", same, 0.5),
    )
    plain = s.Medium((0.1, 0.2, 0.3), (0.4, 0.3, 0.2), (0.0, 0.1, 0.2), 0.5)
    lamp = s.Light("lamp", "POINT", at((1.5, -1.5, 2.5))[0], strength=400.0, radius=0.2)
    films = []
    for medium in (varied, plain):
        scene = things((box_mesh(), at(), filled("fog", medium)), lights=(lamp,))
        # what glows lights others from points along its cells
        settings = engine.Settings(samples=32, light_samples=1, backend=backend, mesh_light="OFF")
        if backend == "NUMPY":
            settings = replace(settings, region=(30, 22, 34, 26))
        films.append(engine.render(scene, settings).combined)
    np.testing.assert_allclose(films[0], films[1], rtol=2e-3, atol=1e-5)


def smoky(size: tuple[int, int] | None = None) -> s.Scene:
    """Smoke in a box, a glass ball of what varies in it, a mirror, in a world whose haze thins out;
    the camera is in the world's alone.
    """
    tree, ball, haze = Tree(), Tree(), Tree()
    noise = tree.noise()
    smoke = tree.medium(
        scattering=tree.colored(noise, (0.8, 0.7, 0.6)),
        emission=tree.colored(tree.math("MAXIMUM", tree.place()[2], 0.0), (0.2, 0.1, 0.0)),
        anisotropy=tree.math("MULTIPLY", tree.place()[0], 0.5),
        step=1 / 12,
    )
    inside = ball.medium(absorption=ball.colored(ball.math("ABSOLUTE", ball.place("position")[0])))
    height = haze.math("EXPONENT", haze.math("MULTIPLY", haze.place()[2], -1.0))
    hazy = haze.medium(scattering=haze.colored(height, (0.02, 0.03, 0.05)), step=16.0)
    scene = rich()
    camera = replace(scene.camera, resolution=size or scene.camera.resolution)
    materials = list(scene.materials)
    for k, medium in ((1, smoke), (2, inside)):
        materials[k] = replace(materials[k], medium=medium)
    assert materials[2].lobes == GLASS
    world = replace(scene.world, medium=hazy)
    return replace(scene, camera=camera, materials=tuple(materials), world=world)


def test_the_core_against_the_reference() -> None:
    parts = ("Diffuse", "Shadow", "Emission", "Volume Direct", "Ambient Occlusion")
    films = both(
        smoky(),
        samples=2,
        light_samples=1,
        volume_samples=1,
        max_bounces=4,
        passes=frozenset(parts),
        region=(30, 20, 34, 26),
    )
    for name in ("Combined", *parts):
        first, second = (film.passes[name] for film in films)
        np.testing.assert_allclose(first, second, rtol=1e-4, atol=1e-5, err_msg=name)
    assert films[0].stats["media points"] > 0
    # the core does not look where it is dark, nor from points in shadow
    points = [film.stats["media points"] for film in films]
    assert 0.5 * points[1] < points[0] < points[1]
    assert films[0].stats["feature: varied media"]


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_end_in_the_dark(backend: str) -> None:
    """Beyond an optical depth of 12 nothing gets through, not e^-13 of a light of 1e6 either, while
    e^-11 does; less is asked there.
    """
    tree = Tree()
    one = tree.math("ADD", tree.math("MULTIPLY", tree.place()[0], 0.0), 1.0)
    found, asked = [], []
    for depth in (11.0, 13.5, 400.0):
        dense = tree.colored(one, np.full(3, depth / 2))
        program = compile_program(tree.graph, [dense])
        medium = s.Medium(program=program, absorption_output=0, step=1 / 64)
        world = s.World(background=(1e6, 1e6, 1e6))
        scene = s.Scene(
            orthographic(size=(4, 4), half=0.5),
            (box_mesh(),),
            (s.Instances("box", 0, at(), (0,)),),
            (s.Material("fog", (s.Lobe("TRANSPARENT"),), medium=medium),),
            world=world,
        )
        film = engine.render(scene, engine.Settings(samples=1, backend=backend))
        found.append(film.combined[..., 0])
        asked.append(film.stats["media points"])
    np.testing.assert_allclose(found[0], 1e6 * np.exp(-11.0), rtol=1e-3)
    assert not found[1].any() and not found[2].any()
    if backend == "NATIVE":
        assert asked[2] <= 0.6 * asked[0]


def test_the_same_bits_in_regions_with_any_threads_and_with_fewer_pixels_at_once() -> None:
    settings = engine.Settings(samples=4, light_samples=2, error_threshold=1.0, max_bounces=4)
    scene = smoky((32, 24))
    whole = engine.render(scene, replace(settings, threads=2)).combined
    alone = engine.render(scene, replace(settings, threads=1)).combined
    np.testing.assert_array_equal(whole, alone)
    part = engine.render(scene, replace(settings, region=(5, 3, 25, 20))).combined
    np.testing.assert_array_equal(part, whole[3:20, 5:25])


def test_the_same_bits_on_any_instruction_set() -> None:
    settings = engine.Settings(samples=1, light_samples=2)
    assert_instruction_sets_agree(
        lambda: engine.render(smoky((32, 24)), settings).combined.tobytes()
    )


def test_pixels_are_explained() -> None:
    """What the terms of a pixel of smoke add up to is the picture, where no shadows are shared."""
    settings = engine.Settings(
        samples=1, light_samples=2, max_bounces=4, backend="NUMPY", mesh_light="OFF"
    )
    scene = smoky()
    explainer = PixelExplainer(scene, settings)
    for x, y in ((30, 22), (33, 26)):
        alone = (x, y, x + 1, y + 1)
        picture = engine.render(scene, replace(settings, region=alone)).combined
        ray = explainer.pixel(x, y)
        assert ray.cells > 0
        assert any("media that vary are looked at" in line for line in explanation_lines(ray))
        found = ray.color
        np.testing.assert_allclose(found, picture[0, 0, :3], rtol=1e-5, atol=1e-9)


def endless(tree: Tree, number: Value) -> Value:
    """Infinite on one side, next to nothing on the other."""
    return tree.math("EXPONENT", tree.math("MULTIPLY", number, 1e6))


BAD = {
    "nan": lambda t, x, y, z: t.math("SUBTRACT", endless(t, x), endless(t, y)),
    "infinite": lambda t, x, y, z: t.math("EXPONENT", t.math("MULTIPLY", x, 1e4)),
    "negative": lambda t, x, y, z: t.math("SUBTRACT", x, 5.0),
    "huge": lambda t, x, y, z: t.math("MULTIPLY", t.math("ADD", x, 2.0), 1e30),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_numbers(kind: str) -> None:
    """Finite pixels; what dims less than nothing does not dim."""
    tree = Tree()
    value = BAD[kind](tree, *tree.place())
    lamp = s.Light("lamp", "POINT", at((0.0, 0.0, 0.0))[0], strength=10.0)
    plans = [
        engine.Settings(samples=2, region=(28, 20, 36, 28)),
        engine.Settings(samples=1, backend="NUMPY", region=(30, 22, 33, 25), mesh_light="OFF"),
    ]
    for outputs in (("absorption", "scattering", "anisotropy"), ("emission",)):
        given = {name: value if name == "anisotropy" else tree.colored(value) for name in outputs}
        medium = tree.medium(step=0.1, **given)
        # what is no number is none at any size, and takes the longest
        for size in (1.0,) if kind == "nan" else (1e-6, 1.0, 1e6):
            scene = things(
                (box_mesh(), at(linear=size), filled("fog", medium)),
                lights=(lamp,),
                world=s.World(background=(1.0, 1.0, 1.0)),
            )
            for settings in plans:
                film = engine.render(scene, settings)
                assert np.isfinite(film.combined).all()
                if kind == "negative" and "absorption" in outputs:
                    np.testing.assert_allclose(film.combined[..., :3], 1.0, rtol=1e-6)
        full = replace(scene, instances=(), world=s.World(medium=medium))
        for settings in plans:
            assert np.isfinite(engine.render(full, settings).combined).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_dims_less_than_nothing_takes_nothing_from_others(backend: str) -> None:
    """In a box of what glows and dims evenly: (1 - e^-2)."""
    tree = Tree()
    value = tree.colored(BAD["negative"](tree, *tree.place()))
    less = tree.medium(absorption=value, scattering=value)
    even = s.Medium((1.0, 1.0, 1.0), emission=(1.0, 1.0, 1.0))
    scene = things(
        (box_mesh(), at(), filled("even", even)),
        (box_mesh(), at(linear=1.5), filled("less", less)),
        camera=orthographic(half=0.5),
    )
    settings = engine.Settings(samples=1, filter_width=0.0, backend=backend)
    found = engine.render(scene, settings).combined[8, 8, :3]
    np.testing.assert_allclose(found, 1 - np.exp(-2), rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_glows_without_end_is_finite(backend: str) -> None:
    """A sky of a glow that hardly dims: no more of it than its cells reach, 16384 steps."""
    tree = Tree()
    same = tree.math("MULTIPLY_ADD", tree.place()[0], 0.0, 1.0)
    medium = tree.medium(
        step=1.0,
        emission=tree.colored(same, (1.0, 1.0, 1.0)),
        absorption=tree.colored(tree.math("MULTIPLY", same, 1e-12)),
    )
    scene = things(camera=orthographic(), world=s.World(medium=medium))
    settings = engine.Settings(samples=1, filter_width=0.0, backend=backend)
    found = engine.render(scene, settings).combined[8, 8, :3]
    np.testing.assert_allclose(found, 16384.0, rtol=0.07)


def test_many_cells_are_bounded() -> None:
    """A step that is next to nothing, of a flat box and of a large one."""
    medium = absorbing(DENSITIES["linear"][0], step=1e-12)
    for size in ((1.0, 1.0, 1.0), (1e4, 1.0, 1.0), (1.0, 1.0, 0.0)):
        scene = things((box_mesh(), at(linear=np.diag(size)), filled("fog", medium)))
        film = engine.render(scene, engine.Settings(samples=1, region=(30, 22, 34, 26)))
        assert film.stats.get("media points", 0.0) <= 16 * 2 * 2048


def test_what_a_medium_cannot_read_is_told() -> None:
    def problems(name: str, is_world: bool = False, **more) -> str:
        tree = Tree()
        medium = tree.medium(absorption=tree.apply(name, **more))
        scene = things((box_mesh(), at(), filled("fog", s.Medium() if is_world else medium)))
        world = s.World(medium=medium if is_world else None)
        return " ".join(scene_problems(replace(scene, world=world)))

    assert "reads uv" in problems("uv", attribute="", shift=0)
    assert "reads attribute" in problems("attribute", attribute="density", shift=0)
    assert "reads barycentric" in problems("barycentric", shift=0)
    assert not problems("instance_value", attribute="x")
    assert "placement" in problems("instance_value", True, attribute="x")
    assert not problems("object_position", True, shift=0)
    medium = absorbing(DENSITIES["linear"][0])
    for wrong, told in (({"step": 0.0}, "step"), ({"scattering_output": 1}, "outputs")):
        scene = things((box_mesh(), at(), filled("fog", replace(medium, **wrong))))
        assert told in " ".join(scene_problems(scene))


def test_a_shadow_through_smoke() -> None:
    """A floor under a box whose density grows along x: the light comes from above."""
    medium = absorbing(DENSITIES["across"][0])
    floor = surface("floor", 1.0, 0.0)
    sun = s.Light("sun", "SUN", at((0, 0, 5.0))[0], strength=1.0)
    pictures = [
        engine.render(
            things(
                (box_mesh(), at((0, 0, 2.0)), filled("fog", inside)),
                (grid_mesh(), at(), floor),
                camera=orthographic((0.0, 0.0, 0.9), half=1.0),
                lights=(sun,),
            ),
            engine.Settings(samples=1, filter_width=0.0),
        ).combined[..., :3]
        for inside in (medium, None)
    ]
    x = (np.arange(16) + 0.5) / 8 - 1
    exact = np.exp(-2 * COLORS * np.maximum(x, 0)[:, None])
    found = pictures[0] / pictures[1]
    np.testing.assert_allclose(found, np.broadcast_to(exact, found.shape), rtol=1e-5)


def test_the_world_and_a_ball_seen_in_glass() -> None:
    """Rays that were refracted and mirrored march too: the two tracers agree."""
    tree = Tree()
    fog = tree.medium(scattering=tree.colored(tree.noise("position")), step=1 / 8)
    scene = things(
        (box_mesh(), at((0.0, 0.0, -1.5)), filled("fog", fog)),
        (ball_mesh(8), at((0.0, 0.0, 0.6), 0.7), s.Material("glass", GLASS)),
        lights=(s.Light("lamp", "POINT", at((1.5, -1.5, 2.5))[0], strength=400.0),),
    )
    films = both(scene, samples=1, max_bounces=4, region=(22, 14, 42, 34))
    np.testing.assert_allclose(films[0].combined, films[1].combined, rtol=1e-4, atol=1e-5)
