"""The check of a program at the API boundary: what it names and does not have."""

from __future__ import annotations

from ..scene.checks import Found, handle
from .operations import Reference, numbers_of
from .program import Instruction, Program, instructions


def program_problems(program: Program, textures: int) -> Found:
    """Slots, constants and things that are not there."""
    if not isinstance(program, Program):
        yield f"is {program!r}: use engine.program.program.compile_program"
        return
    for texture in program.textures:
        yield from handle("a texture", texture, textures, "textures")
    try:
        steps = list(instructions(program))
    except (ValueError, TypeError) as error:
        yield str(error)
        return
    if not all(_is_sound(step, program) for step in steps) or not all(
        0 <= slot < program.slots for slot in program.outputs
    ):
        yield "names a slot, constant or setting that is not there: compile it anew"


def _is_sound(step: Instruction, program: Program) -> bool:
    ends = [
        slot + kind for slot, (_, kind) in zip(step.outputs, step.operation.outputs, strict=True)
    ]
    sound = all(slot >= -1 for slot in step.outputs) and all(end <= program.slots for end in ends)
    for place, (_, kind) in zip(step.arguments, step.operation.arguments, strict=True):
        room = program.slots if place >= 0 else len(program.constants)
        sound = sound and (place if place >= 0 else ~place) + kind <= room
    for setting, (_, choices) in zip(step.settings, step.operation.settings, strict=True):
        if isinstance(choices, Reference):
            sound = sound and setting in range(len(getattr(program, choices.value)))
        else:
            sound = sound and setting in numbers_of(choices)
    return sound
