"""README's code runs as it stands, and its commands exist."""

import re
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
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


def test_every_make_target_of_the_readme_exists():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"\bmake ([a-z-]+)", README)) <= targets


def test_every_file_of_the_readme_exists():
    linked = re.findall(r"\]\(([^)]+)\)", README) + re.findall(
        r"`([A-Za-z_/]+\.(?:md|sh|py))`", README
    )
    assert linked
    assert not [name for name in linked if not (ROOT / name).exists()]
