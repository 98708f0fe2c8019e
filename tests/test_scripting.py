"""The manual's page for scripts: its examples run one after the other, say what the page says, and
are typed.
"""

import re
import subprocess
import sys

import numpy as np
import pytest

from documents import ROOT

PAGE = (ROOT / "docs" / "manual" / "scripting.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture(scope="module")
def names():
    """What the examples leave behind, and in `said` what each printed."""
    found: dict[str, object] = {"said": []}
    for example in EXAMPLES:
        lines: list[str] = []
        found["print"] = lambda *words, into=lines: into.append(" ".join(map(str, words)))
        exec(compile(example, "scripting.md", "exec"), found)
        found["said"].append("\n".join(lines))
    return found


def test_the_first_picture_is_a_ball_over_a_floor(names):
    shape, depth, rays = re.fullmatch(r"(\(.*\)) (\S+) (\S+)", names["said"][0]).groups()
    assert shape == "(120, 160, 4)" and float(rays) > 160 * 120
    # through the pixel beside the centre: t with (6 - t)² + 2 (0.0025 t)² = 1
    slope = 1 + 2 * 0.0025**2
    assert float(depth) == pytest.approx((6 - np.sqrt(36 - 35 * slope)) / slope, rel=1e-6)
    red, green, _ = names["film"].combined[60, 80, :3]
    assert red > 4 * green > 0


def test_a_target_is_met(names):
    assert names["forecast"].met
    reached = float(names["said"][1].rpartition(" ")[2])
    assert 0 < reached < 4.0
    assert names["said"][1].startswith("asked for 4 levels")


def test_more_samples_take_longer_and_are_better(names):
    rows = {row.tunables["samples"]: row for row in names["trade"].rows if row.levels}
    assert rows[64].levels < rows[4].levels
    assert names["said"][2].count(" levels") >= len(names["trade"].front)


def test_the_pixel_is_the_ball(names):
    assert names["ray"].hit.thing == "ball"
    assert "'ball' with the material 'red'" in names["said"][3].splitlines()[0]


def test_the_floor_is_dark_below_the_ball_and_open_far_from_it(names):
    openness = names["openness"]
    assert openness.shape == (200, 200)
    assert openness[100, 100] < 0.2 < 0.85 < openness[0, 0]
    assert names["picked"].t[0] == pytest.approx(4.0, abs=0.02)
    # a ball that stands on the floor hides cos θ sin² α of an even sky: 1 / D³, D to its centre
    d2 = names["x"] ** 2 + names["y"] ** 2
    exact = 1 - (d2 + 1) ** -1.5
    assert np.mean(openness - exact) == pytest.approx(0.0, abs=0.002)  # facets, 64 rays a point
    assert np.abs(openness - exact).mean() < 0.04


def test_the_examples_are_typed(tmp_path):
    """As an editor would check them: `glint` is the package of this tree."""
    text = "\n".join(EXAMPLES).replace("from glint import engine", "import engine")
    text = text.replace("from glint.engine", "from engine")
    right, wrong = tmp_path / "examples.py", tmp_path / "wrong.py"
    right.write_text(text, encoding="utf-8")
    wrong.write_text(text.replace("samples=16)", 'samples="many")', 1), encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml"]
    done = subprocess.run([*command, right, wrong], cwd=ROOT, capture_output=True, text=True)
    told = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert done.returncode == 1 and len(told) == 1, done.stdout + done.stderr
    assert wrong.name in told[0] and 'expected "int"' in told[0], told
