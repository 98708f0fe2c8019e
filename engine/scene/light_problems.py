"""What makes lights and worlds unfit to render."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..program.operations_input import OF_TRIANGLES
from ..program.problems import program_problems
from ..program.program import Program, instructions
from .checks import (
    Found,
    array,
    at_least,
    finite,
    finite_array,
    key_values,
    numbers,
    one_of,
    placement,
)
from .model import MISTS, World
from .model_geometry import EVERYTHING, MOST_SETS, Instances
from .model_lights import LIGHT_SHAPES, LIGHTS, Light
from .surface_problems import medium_problems

_ORTHONORMAL = 1e-4
"""How far a light's axes may be from orthonormal: matrices that went through a few float32 products
stay well within.
"""


MOST_DISTANCE = 1e30
"""That occlusion looks: ends of its rays stay finite."""


def dome_problems(lights: tuple[Light, ...]) -> Found:
    names = [light.name for light in lights if light.kind == "DOME"]
    if len(names) > 1:
        yield f"scene: the DOME lights {', '.join(map(repr, names))} are several: keep one"


def links(thing: Light | Instances) -> Found:
    """What lights what, and is shaded by what."""
    for name in ("receivers", "blockers"):
        value = getattr(thing, name)
        if not (isinstance(value, int) and 0 <= value <= EVERYTHING):
            yield f"{name} is {value!r}: use a whole number of {MOST_SETS} bits"


def light_problems(light: Light) -> Found:
    yield from one_of("kind", light.kind, LIGHTS)
    if light.kind == "DOME":
        yield from _radiance(light.radiance)
    if light.kind == "MESH":
        yield "kind 'MESH' is made by the tracers: give surfaces EMISSION"
    if light.kind == "MEDIUM":
        yield "kind 'MEDIUM' is made by the tracers: give media emission"
    if light.program is not None:
        yield from _light_program(light, light.program)
    yield from one_of("shape", light.shape, LIGHT_SHAPES)
    yield from links(light)
    yield from placement("world_from_light", light.world_from_light, _not_orthonormal)
    if light.motion is not None:
        yield from _light_motion(light)
    yield from numbers("color", light.color, 3)
    yield from finite("strength", light.strength)
    for name in ("radius", "size_x", "size_y"):
        yield from at_least(name, getattr(light, name), 0)
    for name in ("angle", "spot_size", "spread"):
        yield from at_least(name, getattr(light, name), 0, 2 * np.pi)
    yield from at_least("spot_blend", light.spot_blend, 0, 1)


def _light_motion(light: Light) -> Found:
    if light.kind == "DOME":
        yield "a DOME has motion: leave it out, the sky stands still"
        return
    found = [*key_values("motion", light.motion, np.float64, (3, 4))]
    yield from found
    for key in () if found or light.motion is None else light.motion:
        yield from _not_orthonormal("motion", key)


def _light_program(light: Light, program: Program) -> Found:
    found = [*program_problems(program, len(light.textures))]
    yield from (f"program: {text}" for text in found)
    if light.kind == "DOME":
        yield "a DOME has a program: bake it into its radiance"
    if not found and not program.outputs:
        yield "program has no output: compile it with one"
    if not found and program.attributes:
        yield "program reads an attribute, which a light has not: use its position or normal"
    if not found and any(step.operation.name in OF_TRIANGLES for step in instructions(program)):
        yield "program reads a triangle, which a light has not: use its position or normal"


def _radiance(values: Any) -> Found:
    found = [*array("radiance", values, np.float32, (None, None, 3))]
    if not found and values.size == 0:
        found = ["radiance is empty: a DOME needs at least one cell"]
    yield from found or finite_array("radiance", values)


def _not_orthonormal(name: str, matrix: np.ndarray) -> Found:
    axes = matrix[:, :3]
    if np.max(np.abs(axes.T @ axes - np.eye(3))) > _ORTHONORMAL:
        yield f"{name} has columns that are not orthonormal: take scale and shear out of it"


def world_problems(world: World) -> Found:
    yield from numbers("ambient", world.ambient, 3)
    yield from numbers("background", world.background, 3)
    if not np.isfinite([world.mist.start, world.mist.depth]).all():
        yield "mist is not finite: use numbers"
    yield from at_least("occlusion_distance", world.occlusion_distance, 0, MOST_DISTANCE)
    if world.mist.falloff not in MISTS:
        yield f"mist falloff {world.mist.falloff!r} is not one of {', '.join(MISTS)}"
    found = [*array("axes", world.axes, np.float64, (3, 3))]
    yield from found or finite_array("axes", world.axes)
    yield from medium_problems(world.medium, len(world.textures), is_world=True)
    if world.program is not None:
        yield from (f"program: {text}" for text in _sky_problems(world, world.program))


def _sky_problems(world: World, program: Program) -> list[str]:
    problems = [*program_problems(program, len(world.textures))]
    if problems:
        return problems
    if any(step.operation.reads_surface for step in instructions(program)):
        problems.append("reads surfaces, which rays that hit nothing do not have")
    if len(program.outputs) != 1:
        problems.append(f"has {len(program.outputs)} outputs: a world's has one")
    return problems
