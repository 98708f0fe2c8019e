"""The product draws without the oracle: a native render, in a process of its own, of a scene with
all that the Python side works out before the core is asked.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from engine_scenes import at, ball_mesh, box_mesh, camera, constant, grid_mesh, surface
from glint import engine
from glint.engine import scene as s
from glint.engine.displacement import Displacement, Place, displaced
from glint.engine.lights.dome import radiance_map
from glint.engine.program.graph import Graph, Value
from glint.engine.program.operations_math import MathOperation
from glint.engine.program.program import Program, compile_program
from glint.engine.program.table import BY_NAME
from media_scenes import CLEAR, things
from native_tools import needs_core

GRAIN = s.Texture("grain", np.arange(64, dtype=np.uint8).reshape(4, 4, 4), "SRGB")


def image_of(name: str, **settings: int) -> Program:
    """The texture, looked up by what the operation of that name gives."""
    graph = Graph()
    (place,) = graph.apply(BY_NAME[name], **settings)
    return compile_program(graph, [graph.apply(BY_NAME["image"], place, texture=0)[0]])


def rising(*factors: tuple[float, float, float]) -> Program:
    """Each factor times the height in the object, and a constant that is folded."""
    graph = Graph()
    (place,) = graph.apply(BY_NAME["object_position"], shift=0)
    z = graph.apply(BY_NAME["separate_xyz"], place)[2]
    two = math(graph, "MULTIPLY", graph.constant(4.0), graph.constant(0.5))
    height = math(graph, "MAXIMUM", math(graph, "MULTIPLY", z, two), graph.constant(0.1))
    zero = graph.constant((0.0, 0.0, 0.0))
    given = (
        graph.apply(BY_NAME["scaled_sum"], graph.constant(factor), height, zero)[0]
        for factor in factors
    )
    return compile_program(graph, list(given))


def math(graph: Graph, name: str, *numbers: Value) -> Value:
    given = (*numbers, graph.constant(0.0))
    return graph.apply(BY_NAME["math"], *given, operation=MathOperation[name], clamp=0)[0]


def everything() -> s.Scene:
    """A displaced floor; a mesh and a sphere that glow; smoke and gas that glow, in a haze; a sky
    that is an image.
    """
    net = grid_mesh(8, smooth=True)
    move = Displacement(rising((0.0, 0.0, 0.2)), (GRAIN,))
    floor = displaced(net, (move,), net.normals.values, None, Place(at()[0])).mesh
    lamp = s.Lobe("EMISSION", (s.Input((1.0, 1.0, 1.0), output=0),))
    lit = s.Material("lit", (lamp,), program=image_of("uv", attribute="", shift=0))
    smoke = s.Medium(program=rising((0.2, 0.1, 0.1), (2.0, 1.0, 0.5)), step=1 / 16)
    smoke = replace(smoke, scattering_output=0, emission_output=1)
    gas = s.Medium((0.1, 0.2, 0.3), emission=(0.5, 1.0, 2.0))
    unit = s.Spheres("unit", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    sky = image_of("incoming")
    light = s.Light("sky", "DOME", np.eye(3, 4), radiance=radiance_map(sky, (GRAIN,)))
    return things(
        (floor, at(), surface("floor", 0.7, specular=0.2)),
        (grid_mesh(2, 0.5, name="panel"), at((0.0, 1.0, 1.5)), lit),
        (unit, at((-1.5, 0.0, 0.7), 0.3), s.Material("bulb", (s.Lobe("EMISSION", constant(4.0)),))),
        (box_mesh(), at((1.2, 0.0, 0.8), 0.5), s.Material("smoke", CLEAR, medium=smoke)),
        (ball_mesh(6), at((0.0, -1.0, 0.6), 0.4), s.Material("gas", CLEAR, medium=gas)),
        camera=camera(size=(32, 24)),
        textures=(GRAIN,),
        lights=(light,),
        world=s.World(
            program=sky, textures=(GRAIN,), medium=s.Medium(scattering=(0.01, 0.01, 0.02))
        ),
    )


def draw() -> np.ndarray:
    settings = engine.Settings(
        samples=4, illumination="PHYSICAL", max_bounces=3, diffuse_bounces=2, volume_bounces=1
    )
    return engine.render(everything(), settings).combined


def report() -> None:
    """For the process of its own: the picture's hash, then what of the oracle it loaded."""
    picture = hashlib.sha256(draw().tobytes()).hexdigest()
    loaded = (name for name in sys.modules if name.startswith("glint.engine.reference"))
    sys.stdout.write("\n".join((picture, *loaded)))


@needs_core
def test_a_native_render_loads_nothing_of_the_reference():
    program = "import glint_tree, test_native_alone; test_native_alone.report()"
    here = Path(__file__).parent
    path = f"import sys; sys.path[:0] = {[str(here), str(here.parent)]!r}\n"
    run = subprocess.run(
        [sys.executable, "-c", path + program], capture_output=True, text=True, check=False
    )
    picture, *loaded = run.stdout.split()
    assert loaded == [], run.stderr
    assert picture == hashlib.sha256(draw().tobytes()).hexdigest()
