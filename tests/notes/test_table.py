"""The table of docs/lecture_notes.md, "section of the notes → where it lives → its test" names only
what exists, and leaves no section out.

In a cell, a code span with a slash is a path from the root; the spans after it are names in that
file, with * for any characters.
"""

import ast
import re
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "lecture_notes.md"
LAST = {2: 7, 3: 6, 4: 17, 5: 3, 6: 6, 7: 5}
"""Section of the notes -> its last item."""


def table_of(text: str) -> list[list[str]]:
    """The rows between the markers, as lists of cells."""
    _, marker, rest = text.partition("<!-- notes-table -->")
    inside, end, _ = rest.partition("<!-- /notes-table -->")
    assert marker, "the page has no <!-- notes-table -->"
    assert end, "the page has no <!-- /notes-table -->"
    lines = [line.strip() for line in inside.strip().splitlines()]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def names_in(path: Path) -> set[str]:
    """Definitions and assignments at the top of a Python file; all words of another file."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        return set(re.findall(r"\w+", text))
    body = ast.parse(text).body
    defined = {node.name for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    return defined | {
        target.id
        for node in body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }


def missing_in(cell: str) -> Iterator[str]:
    """The paths and names of a cell that are not there."""
    path = None
    for span in re.findall(r"`([^`]+)`", cell):
        if "/" in span:
            path = ROOT / span
            if not path.exists():
                yield span
        elif (
            path is None
            or not path.is_file()
            or not any(fnmatchcase(name, span) for name in names_in(path))
        ):
            yield f"{span} in {path.name if path else 'no file'}"


def missing(rows: list[list[str]]) -> list[str]:
    return [text for row in rows for cell in row[1:] for text in missing_in(cell)]


def test_all_that_the_table_names_exists():
    rows = table_of(PAGE.read_text(encoding="utf-8"))
    assert rows
    assert missing(rows) == []
    assert all("`engine/" in row[1] and "`tests/" in row[2] for row in rows)


def test_the_table_has_every_section_of_the_notes():
    rows = table_of(PAGE.read_text(encoding="utf-8"))
    listed = [
        tuple(map(int, found)) for row in rows for found in re.findall(r"\b(\d)\.(\d+)\b", row[0])
    ]
    assert listed == [
        (section, item) for section, last in LAST.items() for item in range(1, last + 1)
    ]


def test_the_table_leads_to_every_test_of_the_notes():
    rows = table_of(PAGE.read_text(encoding="utf-8"))
    patterns = [span for row in rows for span in re.findall(r"`(test_[^`/]+)`", row[2])]
    tests = {
        name
        for path in Path(__file__).parent.glob("test_section_*.py")
        for name in names_in(path)
        if name.startswith("test_")
    }
    assert tests
    assert {
        name for name in tests if not any(fnmatchcase(name, pattern) for pattern in patterns)
    } == set()


@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        ("`engine/linear/vectors.py` `dot`, `cross`", []),
        ("`engine/linear/vectors.py` `d*t`", []),
        ("`engine/closures/table.py` `KINDS`; `docs/semantics/lobes.md` `Fresnel`", []),
        ("`engine/gone.py`", ["engine/gone.py"]),
        ("`engine/linear/vectors.py` `dott`", ["dott in vectors.py"]),
        ("`engine/linear/vectors.py` `z*`", ["z* in vectors.py"]),
        ("`dot`", ["dot in no file"]),
    ],
)
def test_the_check_itself(cell, expected):
    assert missing([["", cell]]) == expected


def test_a_readme_without_the_table_is_no_table():
    with pytest.raises(AssertionError, match="no <!-- notes-table -->"):
        table_of("# Glint")
