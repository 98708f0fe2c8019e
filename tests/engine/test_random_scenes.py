"""Scenes that nobody thought of: the core against the float64 reference, pixel by pixel and ray by
ray.
"""

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import look_at
from glint import engine
from glint.engine import scene as s
from test_core_against_reference import conditioned, relative_error

pytestmark = pytest.mark.skipif(
    "NATIVE" not in engine.available_backends(), reason="the core's library is not built"
)

PASSES = frozenset(("Diffuse", "Specular", "Shadow", "Mirror", "Depth", "Normal", "Gap"))
EDGES = 0.01
"""Share of the pixels that may see something else: where a ray all but touches an edge, or a bounce
doubles what rounding made.
"""


def _lobe(dice: np.random.Generator) -> s.Lobe:
    kind = dice.choice(
        ["AMBIENT", "DIFFUSE", "SPECULAR", "MIRROR", "REFRACTION", "TRANSPARENT", "EMISSION"]
    )
    share = 0.6 if kind in ("MIRROR", "REFRACTION", "TRANSPARENT") else 1.0
    value = tuple(float(x) for x in share * dice.random(3))
    return s.Lobe(
        str(kind),
        (s.Input(value),),
        exponent=float(10 ** dice.uniform(0, 3)),
        ior=float(dice.uniform(1.1, 1.8)),
    )


def _geometry(dice: np.random.Generator) -> s.Geometry:
    points = dice.normal(0, 0.7, (int(dice.integers(4, 30)), 3)).astype(np.float32)
    if dice.random() < 0.3:
        return s.Spheres(
            "balls", points[:6], (0.1 + 0.5 * dice.random(6)).astype(np.float32)[: len(points[:6])]
        )
    triangles = np.array(
        [dice.choice(len(points), 3, replace=False) for _ in range(len(points))], np.uint32
    )
    return s.Mesh("mesh", points, triangles)


def _light(dice: np.random.Generator) -> s.Light:
    kind = str(dice.choice(["POINT", "SUN", "SPOT", "AREA"]))
    frame = look_at(dice.normal(0, 1, 3) + (0, 0, 5), dice.normal(0, 0.5, 3))
    return s.Light(
        "lamp",
        kind,
        frame,
        tuple(dice.random(3)),
        3.0 if kind == "SUN" else 300.0,
        radius=0.2,
        angle=0.05,
        spot_size=1.0,
        spot_blend=0.3,
        size_x=0.8,
        size_y=0.5,
    )


def _scene(seed: int) -> s.Scene:
    dice = np.random.default_rng(seed)
    geometries = tuple(_geometry(dice) for _ in range(3))
    materials = tuple(
        s.Material(f"m{k}", tuple(_lobe(dice) for _ in range(dice.integers(1, 4))))
        for k in range(3)
    )
    instances = []
    for number in range(len(geometries)):
        rows = np.concatenate(
            [np.eye(3) + dice.normal(0, 0.3, (2, 3, 3)), dice.normal(0, 1.2, (2, 3, 1))], 2
        )
        instances.append(s.Instances(f"i{number}", number, rows, (int(dice.integers(3)),)))
    camera = s.Camera(
        "PERSPECTIVE", look_at((0.5, -6, 2), (0, 0, 0)), (-0.4, 0.4, -0.3, 0.3), (16, 12)
    )
    world = s.World(tuple(dice.random(3)), tuple(dice.random(3)))
    return s.Scene(
        camera,
        geometries,
        tuple(instances),
        materials,
        (),
        tuple(_light(dice) for _ in range(3)),
        world,
    )


@pytest.mark.parametrize("seed", range(5))
def test_same_picture(seed: int) -> None:
    scene, settings = (
        _scene(seed),
        engine.Settings(samples=1, light_samples=2, max_bounces=2, passes=PASSES),
    )
    core, reference = (
        engine.render(scene, replace(settings, backend=backend)) for backend in ("NATIVE", "NUMPY")
    )
    for key in reference.passes:
        errors = relative_error(*(conditioned(key, film.passes[key]) for film in (core, reference)))
        assert (errors > 1e-4).mean() <= EDGES, (
            f"{key}: {(errors > 1e-4).sum()} pixels differ, by up to {errors.max()}"
        )


@pytest.mark.parametrize("seed", range(100, 103))
def test_same_hits(seed: int) -> None:
    scene, dice = _scene(seed), np.random.default_rng(seed)
    origins, directions = 4 * dice.normal(0, 1, (200, 3)), dice.normal(0, 1, (200, 3))
    near, far = (
        np.where(dice.random(200) < 0.5, 0.0, 2.0),
        np.where(dice.random(200) < 0.5, np.inf, 5.0),
    )
    rays, answers = (origins - 2 * directions, directions, near, far), []
    for backend in ("NATIVE", "NUMPY"):
        with engine.Accelerator(scene.geometries, scene.instances, backend=backend) as tree:
            answers.append((tree.closest(*rays), tree.occluded(*rays)))
    (core, core_blocked), (reference, blocked) = answers
    assert (core.instance >= 0).sum() > 5
    np.testing.assert_array_equal(core.instance, reference.instance)
    np.testing.assert_array_equal(core.primitive, reference.primitive)
    np.testing.assert_allclose(core.t, reference.t, rtol=1e-9)
    np.testing.assert_array_equal(core_blocked, blocked)
