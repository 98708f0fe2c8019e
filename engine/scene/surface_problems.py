"""What makes materials, media and textures unfit to render."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..closures import CLOSURES, KINDS
from ..program.operations import Reference
from ..program.operations_input import OF_TRIANGLES
from ..program.problems import program_problems
from ..program.program import Program, instructions
from .checks import (
    Found,
    array,
    at_least,
    finite_array,
    handle,
    holds,
    is_real,
    numbers,
    one_of,
    whole,
)
from .model_surfaces import (
    BUMP_SHADOWING,
    CHANNELS,
    DISTRIBUTIONS,
    ENCODINGS,
    EXTENSIONS,
    INTERPOLATIONS,
    Input,
    Lobe,
    Material,
    Medium,
    Texture,
)


def material_problems(textures: int, material: Material) -> Found:
    yield from whole("index", material.index)
    if material.program is not None:
        yield from (f"program: {text}" for text in program_problems(material.program, textures))
    outputs = len(material.program.outputs) if material.program is not None else 0
    if material.aovs is not None:
        given = material.aovs
        if any(lobe.kind != "EMISSION" for lobe in given.lobes):
            yield "aovs has other lobes than EMISSION: use these alone"
        if given.aovs is not None:
            yield "aovs has AOVs of its own: use none"
        yield from (
            f"aovs: {text}" for text in material_problems(textures, replace(given, aovs=None))
        )
    for name in ("normal_output", "base_normal_output"):
        yield from handle(name, getattr(material, name), outputs, "outputs", none=True)
    yield from one_of("bump_shadowing", material.bump_shadowing, BUMP_SHADOWING)
    yield from medium_problems(material.medium, textures)
    strangers = [*holds("lobes", material.lobes, (Lobe,))]
    yield from strangers
    for number, lobe in enumerate(() if strangers else material.lobes):
        yield from (f"lobe {number}: {text}" for text in _lobe(lobe, textures, outputs))


def medium_problems(medium: Medium | None, textures: int, is_world: bool = False) -> Found:
    if medium is None:
        return
    if not isinstance(medium, Medium):
        yield f"medium is a {type(medium).__name__}: use Medium or None"
        return
    for name in ("absorption", "scattering", "emission"):
        value = getattr(medium, name)
        problems = [*numbers(f"medium {name}", value, 3)]
        yield from problems
        if not problems and name != "emission" and min(value) < 0:
            yield f"medium {name} is {value}: use numbers of at least 0"
    yield from at_least("medium anisotropy", medium.anisotropy, -1, 1)
    if not (is_real(medium.step) and np.isfinite(medium.step) and medium.step > 0):
        yield f"medium step is {medium.step!r}: use a finite number above 0"
    outputs = 0
    if medium.program is not None:
        found = [*program_problems(medium.program, textures)]
        found += _out_of_place(medium.program, is_world) if not found else []
        yield from (f"medium program: {text}" for text in found)
        outputs = len(medium.program.outputs)
    for name in ("absorption", "scattering", "emission", "anisotropy"):
        name = f"{name}_output"
        yield from handle(f"medium {name}", getattr(medium, name), outputs, "outputs", none=True)


def _out_of_place(program: Program, is_world: bool) -> Found:
    """What is read that points inside of media have not."""
    for step in instructions(program):
        of_placement = step.operation.name == "instance_value"
        named = any(choices is Reference.ATTRIBUTE for _, choices in step.operation.settings)
        if (named and not of_placement) or step.operation.name in OF_TRIANGLES:
            yield f"reads {step.operation.name}, which a medium has not: use its position"
        elif of_placement and is_world:
            yield "reads a placement, which a world has not: use its position"


def _lobe(lobe: Lobe, textures: int, outputs: int) -> Found:
    yield from one_of("kind", lobe.kind, KINDS)
    yield from one_of("distribution", lobe.distribution, DISTRIBUTIONS)
    for parameter in CLOSURES[lobe.kind].parameters if lobe.kind in CLOSURES else ():
        name = parameter.name
        yield from at_least(name, getattr(lobe, name), parameter.low, parameter.high)
        if parameter.varies:
            output = getattr(lobe, f"{name}_output")
            yield from handle(f"{name}_output", output, outputs, "outputs", none=True)
    if lobe.kind == "SPECULAR" and lobe.fresnel + lobe.schlick + lobe.edge > 1:
        yield "is times two of fresnel, schlick and edge: use one of them"
    if lobe.kind == "REFRACTION" and lobe.distribution == "ASHIKHMIN_SHIRLEY":
        yield "refracts by ASHIKHMIN_SHIRLEY, which only mirrors: use GGX or BECKMANN"
    if lobe.kind == "MIRROR" and lobe.fresnel and lobe.schlick:
        yield "is times fresnel and schlick: use one of them"
    yield from (strange := [*numbers("radius", lobe.radius, 3)])
    if not strange and min(lobe.radius) < 0:
        yield f"radius is {lobe.radius!r}: use numbers of at least 0"
    strangers = [*holds("factors", lobe.factors, (Input,))]
    yield from strangers
    for factor in () if strangers else lobe.factors:
        yield from _input(factor, textures, outputs)
    for name in ("fibre", "normal", "stretch", "radius"):
        output = getattr(lobe, f"{name}_output")
        yield from handle(f"{name}_output", output, outputs, "outputs", none=True)


def _input(factor: Input, textures: int, outputs: int) -> Found:
    yield from handle("output", factor.output, outputs, "outputs", none=True)
    yield from numbers("value", factor.value, 3)
    yield from handle("texture", factor.texture, textures, "textures", none=True)
    yield from one_of("channel", factor.channel, CHANNELS)
    yield from one_of("attribute_channel", factor.attribute_channel, CHANNELS)
    yield from numbers("offset", factor.offset, 3)
    if not (is_real(factor.low) and is_real(factor.high) and factor.low <= factor.high):
        yield f"low is {factor.low!r} and high {factor.high!r}: use numbers, low at most high"
    for row in factor.uv_transform:
        yield from numbers("a row of uv_transform", row, 3)
    if len(factor.uv_transform) != 2:
        yield f"uv_transform has {len(factor.uv_transform)} rows: use 2"


def texture_problems(texture: Texture) -> Found:
    yield from one_of("encoding", texture.encoding, ENCODINGS)
    yield from one_of("extension", texture.extension, EXTENSIONS)
    yield from one_of("interpolation", texture.interpolation, INTERPOLATIONS)
    shapes = [*array("pixels", texture.pixels, (np.uint8, np.float32), (None, None, 4))]
    yield from shapes
    if shapes:
        return
    if texture.pixels.size == 0:
        yield f"pixels has shape {texture.pixels.shape}: use at least one pixel"
    if texture.pixels.dtype == np.float32:
        yield from finite_array("pixels", texture.pixels)
        if texture.encoding == "SRGB":
            yield "encoding SRGB is for uint8: decode float32 pixels to LINEAR"
