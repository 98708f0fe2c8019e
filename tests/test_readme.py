"""README's code runs as it stands; the commands, files and links of all documents exist."""

import re

import numpy as np
import pytest

from documents import PAGES, ROOT, make_targets, missing_names, missing_paths, relative_links

README = (ROOT / "README.md").read_text(encoding="utf-8")


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
    assert make_targets(text) <= targets
    assert not [link for link in relative_links(text) if not (page.parent / link).exists()]
    assert not missing_paths(text)
    assert not missing_names(text)


@pytest.mark.parametrize(
    ("text", "missing"),
    [
        ("`engine/film.py`, `engine/flim.py`", ["engine/flim.py"]),
        ("`src/bvh/bvh.h` and `src/bvh/tree.h`", ["src/bvh/tree.h"]),
        ("`addon/ui/` and `addon/gui/`", ["addon/gui/"]),
        ("`engine/core` and `engine/kernel`", ["engine/kernel"]),
        ("`engine/settings.py film.py flim.py`", ["flim.py"]),
        ("`engine/linear/ raster.py film.h`", ["film.h"]),
        ("`addon/export/materials*`, `addon/export/matter*`", ["addon/export/matter*"]),
        ("`film.py` and `flim.py`", ["flim.py"]),
        ("`make test ARGS=tests/engine ARGS=tests/engines`", ["tests/engines"]),
        ("`tests/test_readme.py::test_none`, `tests/none.py::test`", ["tests/none.py"]),
        ("`1/π`, `file.blend`, `out/picture.png`\n```\nflim.py\n```", []),
    ],
)
def test_a_file_or_folder_that_is_not_there_is_named(text, missing):
    assert missing_paths(text) == missing


def test_a_name_that_is_not_there_is_named():
    text = "`engine.render(scene)`, `engine.analysis.trade`, `addon.export`, `engine.scene.Film`"
    assert missing_names(text) == ["engine.scene.Film"]
    assert missing_names("`engine.trade.measure(scene)`") == ["engine.trade.measure"]


def test_readme_and_architecture_stay_short():
    assert len(README.splitlines()) <= 150
    assert len((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").splitlines()) <= 120


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_lines_outside_of_tables_have_at_most_100_columns(page):
    lines = page.read_text(encoding="utf-8").splitlines()
    assert not [line for line in lines if len(line) > 100 and not line.lstrip().startswith("|")]


def test_the_pages_of_semantics_that_code_names_exist():
    names = {
        name
        for folder in ("addon", "engine", "operators", "packaging", "tests")
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".py", ".h", ".cpp", ".inc")
        for name in re.findall(r"semantics/(\w+\.md)", path.read_text(encoding="utf-8"))
    }
    assert names
    assert not {name for name in names if not (ROOT / "docs" / "semantics" / name).exists()}


def test_headings_of_semantics_have_at_most_600_words():
    parts = [
        part.split()
        for page in (ROOT / "docs" / "semantics").glob("*.md")
        for part in re.split(r"^(?=#)", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    ]
    assert not [part[:8] for part in parts if len(part) > 600]


def test_every_page_is_reached_from_the_readme_by_links():
    reached, waiting = set(), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page not in reached and page.suffix == ".md":
            reached.add(page)
            links = relative_links(page.read_text(encoding="utf-8"))
            waiting += [(page.parent / link).resolve() for link in links]
    assert not set(PAGES) - reached


def test_the_readme_installs_before_it_shows_code():
    assert 0 < README.index("## Install") < README.index("```python")
