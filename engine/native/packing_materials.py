"""Materials, their inputs and their programs to rows of the core's tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..cryptomatte import id_bits
from ..program.operations import Reference
from ..program.program import Instruction, Program, instructions, without_the_rest
from ..program.table import CODES
from ..scene import Input, Material, Medium
from .core_types import BumpShadowing, Channel, Distribution, Fresnel, LobeKind
from .packer import Packer, number


def without_ambient(material: Material) -> Material:
    """The same without AMBIENT lobes, and a program that works out nothing for them alone."""
    lobes = tuple(lobe for lobe in material.lobes if lobe.kind != "AMBIENT")
    if len(lobes) == len(material.lobes) or material.program is None:
        return material
    read = {material.normal_output, material.base_normal_output}
    for lobe in lobes:
        read |= {output for _, output in lobe.parameters}
        read |= {lobe.fibre_output, lobe.normal_output, lobe.stretch_output, lobe.radius_output}
        read |= {factor.output for factor in lobe.factors}
    program = without_the_rest(material.program, read - {-1})
    return replace(material, lobes=lobes, program=program)


def pack_material(packer: Packer, material: Material, aov: int = 0) -> tuple:
    """aov: as GlintMaterial has it."""
    first, program = len(packer.lobes), material.program
    outputs = program.outputs if program else ()
    for lobe in material.lobes:
        kind = number(lobe.kind, LobeKind, "lobe kind")
        fresnel = (
            Fresnel.DIELECTRIC * lobe.fresnel
            | Fresnel.SCHLICK * lobe.schlick
            | Fresnel.EDGE * lobe.edge
            | Fresnel.OUTSIDE * lobe.outside
            | Fresnel.BOTH_SIDES * lobe.both_sides
        )
        packer.lobes.append(
            (
                *(number for number, _ in lobe.parameters),
                lobe.radius,
                len(packer.inputs),
                len(lobe.factors),
                kind,
                fresnel,
                *(_slot(outputs, output) for _, output in lobe.parameters),
                _slot(outputs, lobe.fibre_output),
                _slot(outputs, lobe.normal_output),
                _slot(outputs, lobe.stretch_output),
                _slot(outputs, lobe.radius_output),
                number(lobe.distribution, Distribution, "distribution"),
            )
        )
        packer.inputs.extend([_input(packer, factor, outputs) for factor in lobe.factors])
    return (
        first,
        len(material.lobes),
        material.index,
        1 + _program(packer, program) if program else 0,
        _slot(outputs, material.normal_output),
        id_bits(material.name),
        aov,
        _medium(packer, material.medium) if material.medium is not None else 0,
        number(material.bump_shadowing, BumpShadowing, "bump shadowing"),
        _slot(outputs, material.base_normal_output),
    )


def _medium(packer: Packer, medium: Medium) -> int:
    """One more than its row in the core's table."""
    outputs = medium.program.outputs if medium.program else ()
    packer.media.append(
        (
            medium.absorption,
            medium.scattering,
            medium.emission,
            medium.anisotropy,
            medium.step,
            1 + _program(packer, medium.program) if medium.program else 0,
            _slot(outputs, medium.absorption_output),
            _slot(outputs, medium.scattering_output),
            _slot(outputs, medium.emission_output),
            _slot(outputs, medium.anisotropy_output),
            0,
        )
    )
    return len(packer.media)


def _slot(outputs: tuple[int, ...], output: int) -> int:
    """As the core has it: 0 for none, else one more than the slot."""
    return 1 + outputs[output] if output >= 0 else 0


def _program(packer: Packer, program: Program) -> int:
    """The program's number; equal ones are packed once."""
    # asked once: to hash its tables takes longer than to pack them
    number = packer.packed.setdefault(program, len(packer.packed))
    if number < len(packer.programs):
        return number
    table: list[float] = []
    starts: list[int] = []
    for values in program.tables:
        starts.append(len(table))
        table += [float(len(values)), *values]
    numbers = {
        Reference.ATTRIBUTE: [packer.name(name) if name else -1 for name in program.attributes],
        Reference.TEXTURE: program.textures,
        Reference.TABLE: starts,
    }
    words = [word for step in instructions(program) for word in _words(step, numbers)]
    packer.programs.append(
        (
            len(packer.words),
            len(words),
            len(packer.constants),
            len(program.constants),
            len(packer.tables),
            len(table),
            program.slots,
            0,
        )
    )
    packer.words += words
    packer.constants += program.constants
    packer.tables += table
    return number


def _words(step: Instruction, numbers: Mapping[Reference, Sequence[int]]) -> list[int]:
    """An instruction whose settings refer to what the core has."""
    settings = [
        numbers[choices][setting] if isinstance(choices, Reference) else setting
        for (_, choices), setting in zip(step.operation.settings, step.settings, strict=True)
    ]
    return [CODES[step.operation.name], *step.outputs, *step.arguments, *settings]


def _input(packer: Packer, factor: Input, outputs: tuple[int, ...]) -> tuple:
    return (
        factor.value,
        sum(map(tuple, factor.uv_transform), ()),
        factor.offset,
        factor.low,
        factor.high,
        factor.texture,
        number(factor.channel, Channel, "channel"),
        packer.name(factor.uv) if factor.uv else -1,
        packer.name(factor.attribute) if factor.attribute else -1,
        number(factor.attribute_channel, Channel, "channel"),
        not factor.is_plain,
        factor.complement,
        _slot(outputs, factor.output),
    )
