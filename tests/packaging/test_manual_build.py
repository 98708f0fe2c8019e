"""MkDocs builds the manual, and refuses what leads nowhere."""

import shutil
import sys

import pytest

from blender_process import ROOT
from packed import manual

pytestmark = pytest.mark.once


@pytest.fixture
def copy(tmp_path):
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    shutil.copy(ROOT / "mkdocs.yml", tmp_path)
    return tmp_path


def test_the_manual_is_built_with_its_pictures(copy):
    assert manual.build(sys.executable, copy) == (0, "")
    pages = copy / "out" / "manual"
    assert (pages / "index.html").is_file() and (pages / "manual" / "gallery.html").is_file()
    assert "pictures/ToyCar.jpg" in (pages / "manual" / "gallery.html").read_text("utf-8")
    assert (pages / "manual" / "pictures" / "ToyCar.jpg").is_file()


@pytest.mark.parametrize("link", ["nowhere.md", "lights.md#no-such-heading", "pictures/none.jpg"])
def test_a_dead_link_is_refused(copy, link):
    page = copy / "docs" / "manual" / "install.md"
    page.write_text(page.read_text("utf-8") + f"\n[dead]({link})\n", "utf-8")
    code, told = manual.build(sys.executable, copy)
    assert code != 0 and link in told
