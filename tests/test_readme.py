"""README's code runs as it stands; the commands, files and links of all documents exist."""

import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "engine" / "SEMANTICS.md"])


def test_the_smallest_scene_draws_a_red_ball():
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)
    names: dict[str, object] = {}
    exec(code.replace("samples=16", "samples=1"), names)
    picture = names["picture"]
    assert picture.shape == (480, 640, 4)
    red, green, _ = picture[240, 320, :3]
    assert red > 4 * green > 0
    np.testing.assert_array_equal(picture[0, 0, :3], 0.0)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_command_file_and_link_of_a_page_exists(page):
    text = page.read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"`make ([a-z-]+)", text)) <= targets
    links = [link for link in re.findall(r"\]\(([^)#]+)", text) if "://" not in link]
    assert not [link for link in links if not (page.parent / link).exists()]
    files = re.findall(r"`((?:addon|docs|engine|operators|packaging|tests)/[\w/]+\.\w+)`", text)
    assert not [name for name in files if not (ROOT / name).exists()]


def test_readme_and_architecture_stay_short():
    assert len(README.splitlines()) <= 150
    assert len((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").splitlines()) <= 120


def test_the_manual_is_reached_from_the_readme():
    pages = [page for page in PAGES if "docs" in page.parts and "decisions" not in page.parts]
    assert pages
    assert not [page for page in pages if page.relative_to(ROOT).as_posix() not in README]
