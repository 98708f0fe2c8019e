"""Programs work out nothing for AMBIENT lobes where the world gives them nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.native.packing import ScenePacker
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from native_tools import constant, lamp
from surface_scenes import balls


def varied() -> s.Scene:
    """A ball whose colour and ambient exponent are two outputs of a program."""
    graph = Graph()
    place = graph.apply(BY_NAME["position"], shift=0)[0]
    square = graph.apply(BY_NAME["product"], place, place)[0]
    program = compile_program(graph, [graph.apply(BY_NAME["separate_xyz"], square)[0], place])
    material = s.Material(
        "varied",
        (
            s.Lobe("AMBIENT", constant(0.5), exponent=3.0, exponent_output=0),
            s.Lobe("DIFFUSE", (s.Input(output=1),)),
        ),
        program=program,
    )
    return replace(balls(s.Lobe("DIFFUSE"), lights=(lamp("SUN"),)), materials=(material,))


def lit(scene: s.Scene, ambient: float) -> s.Scene:
    return replace(scene, world=replace(scene.world, ambient=(ambient,) * 3))


def test_they_are_packed_where_the_world_has_some() -> None:
    """One packer: what was left out comes back with the light, and materials stay what they are."""
    scene, packer = varied(), ScenePacker()
    words = [packer.pack(lit(scene, x)).data.program_word_count for x in (0, 0.5, 0, 0)]
    assert words[0] < words[1] and words[0] == words[2] == words[3]
    dark = [packer.pack(lit(scene, 0)).lent[1] for _ in range(2)]
    assert dark[0] is dark[1]


def test_pictures_are_the_same() -> None:
    scene, settings = varied(), Settings(samples=1)
    dark, nearly = (render(lit(scene, x), settings).passes["Combined"] for x in (0.0, 1e-300))
    np.testing.assert_array_equal(dark, nearly)
    assert dark[..., :3].std() > 0.01
