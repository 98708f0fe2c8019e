"""What rows of the table of operations are made of."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from functools import cache, cached_property


class Kind(IntEnum):
    """What an argument or an output is; its value is how many slots it takes."""

    NUMBER = 1
    VECTOR = 3


class Reference(Enum):
    """Settings that are numbers of other things: of a program's attributes (names), textures
    (indices into `Scene.textures`) and tables (of numbers).
    """

    ATTRIBUTE = "attributes"
    TEXTURE = "textures"
    TABLE = "tables"


Choices = type[IntEnum] | range | Reference


@cache
def numbers_of(choices: type[IntEnum] | range) -> range | frozenset[int]:
    """What a setting may be. To look into a range takes no walk through it, as some have thousands
    of numbers.
    """
    return choices if isinstance(choices, range) else frozenset(map(int, choices))


@dataclass(frozen=True)
class Operation:
    """One operation of programs.

    name: snake_case, also the name of the function in each executor.
    outputs, arguments: (name, kind) of each, in the order in which instructions have them.
    settings: (name, choices) of the integers that are fixed when a program is compiled.
    formula: what is computed, in the names of the arguments, for documents and error texts.
    reads_point: the result depends on the point that is shaded, not on the arguments alone.
    of_ray: of those that read the point: the ray that meets it tells all, as where it hits nothing.
    """

    name: str
    outputs: tuple[tuple[str, Kind], ...]
    arguments: tuple[tuple[str, Kind], ...] = ()
    settings: tuple[tuple[str, Choices], ...] = ()
    formula: str = ""
    reads_point: bool = False
    of_ray: bool = False

    @property
    def reads_surface(self) -> bool:
        """Whether it knows more of the point than the ray that meets it, so that the program of a
        world must not have it.
        """
        return self.reads_point and not self.of_ray

    @cached_property
    def output_widths(self) -> tuple[int, ...]:
        """Slots that each output takes: 1 or 3."""
        return tuple(int(kind) for _, kind in self.outputs)

    @cached_property
    def argument_widths(self) -> tuple[int, ...]:
        return tuple(int(kind) for _, kind in self.arguments)

    @cached_property
    def setting_names(self) -> frozenset[str]:
        return frozenset(name for name, _ in self.settings)

    @cached_property
    def words(self) -> int:
        """Length of an instruction: the code, then a slot for each output, where each argument
        is, and the settings.
        """
        return 1 + len(self.outputs) + len(self.arguments) + len(self.settings)


def sockets(**kinds: str) -> tuple[tuple[str, Kind], ...]:
    """Names and kinds, "number" or "vector", in their order."""
    return tuple((name, Kind[kind.upper()]) for name, kind in kinds.items())
