"""Light that goes straight into something denser comes from a narrower cone there: TRANSPARENT
lobes with an index of refraction.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import scene as s
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from native_tools import (
    assert_instruction_sets_agree,
    color,
    constant,
    draw,
    lamp,
    material,
    placed,
    square,
    view_from_above,
)
from surface_scenes import hash_of

BACKENDS = pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
IOR, CLEAR = 1.5, 0.9
TURNED = np.diag([1.0, -1.0, -1.0])
"""Upside down."""


def surface(ior: float = IOR, **more) -> s.Material:
    """What lets light through and hides nothing from the camera's rays."""
    lobe = s.Lobe("TRANSPARENT", constant(CLEAR), ior=ior, **more)
    return replace(material(lobe), name=f"surface {ior}")


def layers(*upward: bool, lights=None, ior: float = IOR, **more) -> s.Scene:
    """A white floor under faces, from below to above, that face upward or down."""
    faces = tuple(
        placed(0, (1,), 0.5 + 0.25 * k, np.eye(3) if up else TURNED, visible_camera=False)
        for k, up in enumerate(upward)
    )
    lit = lights or (lamp("SUN", strength=np.pi),)
    materials = material(s.Lobe("DIFFUSE", constant(1.0))), surface(ior, **more)
    return s.Scene(view_from_above(), (square(),), (placed(), *faces), materials, lights=lit)


@BACKENDS
@pytest.mark.parametrize(
    ("upward", "share"),
    [
        ((True,), 1 / IOR**2),  # water on the floor
        ((False, True), 1.0),  # a pane
        ((True, False, True), 1 / IOR**2),  # a pane over water
        ((False,), 1.0),  # a lamp in water
        ((True, True), 1 / IOR**4),
    ],
)
def test_of_light_that_stays_inside_there_is_less(
    upward: tuple[bool, ...], share: float, backend: str
) -> None:
    wanted = CLEAR ** len(upward) * share
    np.testing.assert_allclose(color(layers(*upward), backend=backend), wanted, rtol=1e-6)


@BACKENDS
def test_without_an_index_nothing_is_narrower(backend: str) -> None:
    np.testing.assert_allclose(color(layers(True, ior=1.0), backend=backend), CLEAR, rtol=1e-6)


@BACKENDS
def test_lobes_count_by_what_they_let_through(backend: str) -> None:
    scene = layers(True)
    lobes = s.Lobe("TRANSPARENT", constant(0.6), ior=IOR), s.Lobe("TRANSPARENT", constant(0.3))
    scene = replace(scene, materials=(scene.materials[0], material(*lobes)))
    wanted = 0.6 / IOR**2 + 0.3
    np.testing.assert_allclose(color(scene, backend=backend), wanted, rtol=1e-6)


@BACKENDS
def test_spheres_and_many_layers(backend: str) -> None:
    """A floor that a ball reaches into; beside it more layers than rays find at a time."""
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.array([0.7], np.float32))
    scene = layers(*(False, True) * 9)
    found = color(scene, backend=backend)
    np.testing.assert_allclose(found, CLEAR**18, rtol=1e-6)
    inside = replace(
        scene,
        geometries=(square(), ball),
        instances=(placed(), placed(1, (1,), visible_camera=False)),
    )
    found = color(inside, backend=backend)
    r = np.hypot(*np.meshgrid(*[(2 * np.arange(16) - 15) / 16] * 2))
    np.testing.assert_allclose(found[r < 0.65], CLEAR / IOR**2, rtol=1e-6)
    np.testing.assert_allclose(found[r > 0.75], 1.0, rtol=1e-6)


@BACKENDS
@pytest.mark.parametrize("given", [np.nan, np.inf, -2.0, 0.0, 1e-300, 1e300, 1e30, 2.0])
def test_what_is_no_index_leaves_the_lobe_its_own(given: float, backend: str) -> None:
    graph = Graph()
    normal = graph.apply(BY_NAME["normal"])[0]
    value = graph.apply(
        BY_NAME["scaled_sum"], normal, graph.constant(0.0), graph.constant((given,) * 3)
    )[0]
    number = graph.apply(BY_NAME["separate_xyz"], value)[0]
    scene = layers(True, ior_output=0)
    look = replace(scene.materials[1], program=compile_program(graph, [number]))
    scene = replace(scene, materials=(scene.materials[0], look))
    wanted = given if given in (2.0, 1e30) else IOR
    found = color(scene, backend=backend)
    np.testing.assert_allclose(found, CLEAR / wanted**2, rtol=1e-6, atol=1e-30)


def many() -> s.Scene:
    lights = lamp("SUN", angle=0.3, strength=2.0), lamp("POINT", (0.3, -0.2, 1.4), radius=0.2)
    return layers(True, False, True, lights=lights)


OPTIONS = {"samples": 4, "light_samples": 2, "diffuse_bounces": 1}


@functools.cache
def hashes(threads: int = 0) -> str:
    return hash_of(many(), threads=threads, **OPTIONS)


def test_instruction_sets_and_threads_change_nothing() -> None:
    assert assert_instruction_sets_agree(hashes) == hashes(1)


def test_both_tracers_draw_the_same() -> None:
    one, other = (draw(many(), backend=x, **OPTIONS).combined for x in ("NATIVE", "NUMPY"))
    np.testing.assert_allclose(one, other, rtol=2e-5, atol=1e-6)
