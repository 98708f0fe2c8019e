"""Statements that a comma operator joins: `make lint` asks for one statement a line. The headers of
`for` loops may have them.

Usage: python packaging/commas.py FILE...
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

_TOKEN = re.compile(
    r"""//[^\n]*|/\*.*?\*/|^[ \t]*\#(?:[^\n\\]|\\.)*|"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)+'"""
    r"""|[A-Za-z_]\w*|\.?\d(?:[\w.']|(?<=[eEpP])[+-])*|->|::|<<|[-+*/%&|^=!<>]=|&&|\S""",
    re.S | re.M,
)
_DECLARATION = re.compile(
    r"(?!return |throw |delete )(?:\w+ )*(?:\w+ :: )*\w+ (?:[&*] |&& |const )*\w+ "
)
_HEAD = re.compile(r"(?:if|if constexpr|for|while|switch) \( \) $|\[ \[ \] \] $")


@dataclass
class Joined:
    """A statement, as places in the text. commas: those that join it. end: of its semicolon.
    controlled: it is the body of an `if`, `else` or loop without braces.
    """

    start: int
    end: int
    commas: list[int]
    controlled: bool


@dataclass
class _Level:
    """What is between a pair of brackets. outline: the current statement without what is in inner
    brackets. ends: whether a statement ended here.
    """

    bracket: str
    start: int = -1
    outline: str = ""
    commas: list[int] = field(default_factory=list)
    ends: bool = False
    controlled: bool = False

    def reset(self, controlled: bool = False) -> None:
        self.start, self.outline, self.commas, self.controlled = -1, "", [], controlled

    def see(self, token: str, place: int) -> None:
        self.start = place if self.start < 0 else self.start
        self.outline += f"{token} "
        if token in ("else", "do"):
            self.reset(controlled=True)

    def joined(self, end: int) -> Iterator[Joined]:
        """The statement that ends here, when commas join it."""
        outline = self.outline.replace("< > ", "").replace("alignas ( ) ", "")
        if self.commas and outline[0] != "," and not _DECLARATION.match(outline):
            yield Joined(self.start, end, self.commas, self.controlled)


def joined_statements(text: str) -> Iterator[Joined]:
    """Those of C++ text as clang-format leaves it: only templates have `<` behind a name."""
    levels = [_Level("{")]
    for match in _TOKEN.finditer(text):
        token, place, level = match.group(), match.start(), levels[-1]
        if token.lstrip()[0] == "#" or token.startswith(("//", "/*")):
            continue
        if token in "([{" or (token == "<" and text[place - 1].isalnum()):
            levels.append(_Level(token))
            level.see(token, place)
        elif token in ")]}" or (token == ">" and level.bracket == "<"):
            _close(levels, token)
        elif token == ";":
            yield from level.joined(match.end()) if level.bracket == "{" else ()
            level.reset()
            level.ends = True
        else:
            _see(level, token, place)


def _see(level: _Level, token: str, place: int) -> None:
    if token == ",":
        level.commas.append(place)
    level.see(token, place)
    if token == ":" and re.match(r"case |default |public |private |protected ", level.outline):
        level.reset()


def _close(levels: list[_Level], token: str) -> None:
    """Back to the level outside, where a body ends the statement before it and a head begins
    another.
    """
    inner, level = levels.pop(), levels[-1]
    level.outline += f"{token} "
    if _HEAD.match(level.outline):
        level.reset(controlled=inner.bracket == "(")
    elif inner.bracket == "{" and (inner.ends or level.outline.endswith((") { } ", "} { } "))):
        level.reset()


def problems(paths: Iterable[Path]) -> list[str]:
    """A line for each, with file and line."""
    told = []
    for path in paths:
        text = path.read_text()
        for joined in joined_statements(text):
            line = text.count("\n", 0, joined.start) + 1
            told.append(f"{path}:{line}: commas join statements: one statement a line")
    return told


if __name__ == "__main__":
    found = problems(map(Path, sys.argv[1:]))
    print(*found, sep="\n")
    sys.exit(bool(found))
