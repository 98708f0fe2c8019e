"""Numbers on the command line that mean nothing are refused before a scene is opened."""

from __future__ import annotations

import pytest

pytest.importorskip("bpy")
from glint.operators import command_line

REFUSED = {
    "--repeats: 0: use a whole number, 1 or more": ["measure", "a.blend", "--repeats", "0"],
    "--side: 0: use a whole number, 1 or more": ["measure", "a.blend", "--side", "0"],
    "--squares: -1: use a whole number, 1 or more": ["measure", "a.blend", "--squares", "-1"],
    "--reference-samples: 0: use a whole number, 1 or more": [
        "measure",
        "a.blend",
        "--reference-samples",
        "0",
    ],
    "--levels: -1: use a number above 0": ["target", "a.blend", "--levels", "-1", "--out", "a.exr"],
    "--rmse: low: use a number above 0": ["target", "a.blend", "--rmse", "low", "--out", "a.exr"],
    "--rmse: nan: use a number above 0": ["target", "a.blend", "--rmse", "nan", "--out", "a.exr"],
    "--samples: 0: use a whole number, 1 or more": [
        "compare",
        "a.blend",
        "--out",
        "a",
        "--samples",
        "0",
    ],
    "--side: many: use a whole number, 1 or more": [
        "compare",
        "a.blend",
        "--out",
        "a",
        "--side",
        "many",
    ],
}


@pytest.mark.parametrize("text", REFUSED)
def test_a_number_that_means_nothing(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        command_line.run(REFUSED[text])
    assert caught.value.code == 2
    assert text in capsys.readouterr().err
