"""What could not be exported as it is: collected during the export, told once at its end."""

from __future__ import annotations

SHOWN = 4
"""Names that a note spells out before it counts the rest."""


class Note(str):
    """A sentence, and the names of all things that it is about, those that it counts too."""

    names: tuple[str, ...]

    def __new__(cls, sentence: str, names: tuple[str, ...] = ()) -> Note:
        note = super().__new__(cls, sentence)
        note.names = names
        return note


class Report:
    """Collects notes. The same note is kept once; notes of one kind share a sentence that lists the
    things it is about.
    """

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def note(self, sentence: str, name: str = "") -> None:
        """Keep `sentence`; where it holds `{}` the names of all the calls with this sentence will
        stand.
        """
        names = self._names.setdefault(sentence, {})
        if name:
            names[name] = None

    def mentions(self, name: str) -> bool:
        """Whether any note is about a thing of this name."""
        return any(name in names for names in self._names.values())

    def add(self, other: Report) -> None:
        """Take in the notes of another."""
        for sentence, names in other._names.items():
            self._names.setdefault(sentence, {}).update(names)

    def notes(self) -> tuple[Note, ...]:
        """One sentence per kind of note, in the order in which they came up first, each on one line
        whatever the names hold.
        """
        return tuple(
            Note(_on_one_line(sentence.replace("{}", _listed(list(names)))), tuple(names))
            for sentence, names in self._names.items()
        )


def _listed(names: list[str]) -> str:
    """'A', 'B' and 7 more."""
    shown = ", ".join(f"'{name}'" for name in names[:SHOWN])
    rest = len(names) - SHOWN
    return f"{shown} and {rest} more" if rest > 0 else shown


def _on_one_line(text: str) -> str:
    return "".join(letter if letter.isprintable() else " " for letter in text)
