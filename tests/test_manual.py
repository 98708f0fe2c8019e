"""The manual names what a user sees."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from documents import ROOT

SETTINGS = ("BoolProperty", "EnumProperty", "FloatProperty", "IntProperty", "_part")
MANUAL = " ".join(
    word
    for page in sorted((ROOT / "docs" / "manual").glob("*.md"))
    for word in page.read_text(encoding="utf-8").split()
)


def panel_labels(path: Path) -> Iterator[str]:
    """What stands on a module's panels."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef) and "_PT_" in node.name:
            for line in node.body:
                names = line.targets if isinstance(line, ast.Assign) else ()
                if any(getattr(name, "id", "") == "bl_label" for name in names):
                    yield line.value.value


def setting_names(path: Path) -> Iterator[str]:
    """What a module calls its properties; `_part` takes the name first."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in SETTINGS:
            named = [word.value for word in node.keywords if word.arg == "name"]
            yield from (
                value.value for value in (*node.args[:1], *named) if isinstance(value, ast.Constant)
            )


@pytest.mark.parametrize(
    "module",
    [
        "addon/ui/panels.py",
        "addon/ui/data_panels.py",
        "addon/ui/view_layer_panels.py",
        "addon/ui/sphere.py",
        "operators/measure_scene.py",
        "operators/switch_engine.py",
    ],
)
def test_every_panel_is_in_the_manual(module):
    labels = list(panel_labels(ROOT / module))
    assert labels
    assert not [label for label in labels if label not in MANUAL]


def test_every_setting_is_in_the_manual():
    names = set(setting_names(ROOT / "addon/ui/properties.py"))
    assert {"Samples", "Quality Target", "Grazing"} <= names
    assert not [name for name in names if name not in MANUAL]
