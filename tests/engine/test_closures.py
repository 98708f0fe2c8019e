"""The table of closures: lobes, the core and the documents say what it does."""

import sys
from dataclasses import fields
from pathlib import Path

import pytest

from glint.engine.closures import CLOSURES, KINDS
from glint.engine.scene import Lobe

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def table(monkeypatch):
    """The script that writes the table elsewhere."""
    monkeypatch.syspath_prepend(str(ROOT / "packaging"))
    import closures_table as module

    yield module
    sys.modules.pop("closures_table")


def test_the_core_and_the_document_have_the_table(table) -> None:
    again = "run python packaging/closures_table.py"
    assert table.HEADER.read_text() == table.header(CLOSURES.values()), again
    text = table.DOCUMENT.read_text()
    assert text == table.documented(text, CLOSURES.values()), again
    assert table.document(CLOSURES.values()) in text


def test_every_kind_is_described() -> None:
    text = (ROOT / "docs/semantics/lobes.md").read_text()
    assert [kind for kind in KINDS if text.count(f"\n| {kind} |") != 2] == []


def test_lobes_have_the_parameters() -> None:
    names = {field.name for field in fields(Lobe)}
    for row in CLOSURES.values():
        places = [p.place for p in row.parameters]
        assert len(set(places)) == len(places) and set(places) <= {0, 1, 2}
        for p in row.parameters:
            assert {p.name, f"{p.name}_output"} - {"tilt_output", "aov_output"} <= names
            assert p.varies == (f"{p.name}_output" in names)


def test_numbers_go_to_their_places() -> None:
    lobe = Lobe("SHEEN", width=0.5, lean=0.2, lean_output=3, exponent=7.0, ior=2.0)
    assert lobe.parameters == ((0.5, -1), (0.2, 3), (1.0, -1))
    lobe = Lobe("FIBRE_SPECULAR", exponent=9.0, fan=0.3, tilt=-0.1)
    assert lobe.parameters == ((9.0, -1), (0.3, -1), (-0.1, -1))
