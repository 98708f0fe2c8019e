"""What features cost a pixel in instructions, where rays meet them and where none does, counted by callgrind against the recorded counts.

    python tests/bench/features.py [--record] [--program build/bench/bench/pipeline_counts]

Runs engine/core/bench/pipeline_counts on its fixed scenes as instructions.py does ray_counts. A scene called "… beside" is the plain one
with something that no ray meets, or with a setting that nothing reads. Those of `FREE` must cost what the plain scene costs: this holds for
any compiler. Exit code 1 when one does not, or when a count is more than 5 % above features.json; --record renews that file.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import shutil
import sys
from pathlib import Path

import core_program
from instructions import count, grown
from ray_tables import table

RECORDED = Path(__file__).with_name("features.json")
FREE = ("mirror beside", "glass beside", "texture beside", "4 light samples beside")
SCENES = (
    "plain", *FREE, "highlights beside", "alpha beside", "sphere beside",
    "highlights", "texture", "alpha", "mirror", "glass", "soft light, 4 samples",
)  # fmt: skip
FREE_WITHIN = 1e-3


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", action="store_true", help="renew features.json")
    parser.add_argument("--program", help="a built pipeline_counts")
    options = parser.parse_args()
    valgrind = shutil.which("valgrind")
    if not valgrind:
        print("features.py: skipped, valgrind is not installed (Debian and Ubuntu: apt-get install valgrind)")
        return 0
    program = options.program or str(core_program.build("pipeline_counts"))
    counted = {scene: count(valgrind, program, scene) for scene in SCENES}
    measured, compiler = {scene: value for scene, (value, _) in counted.items()}, counted["plain"][1]
    recorded = json.loads(RECORDED.read_text()) if RECORDED.exists() else {"compiler": "", "per_item": {}}
    print(features_table(measured, recorded["per_item"]))
    if options.record:
        RECORDED.write_text(json.dumps({"compiler": compiler, "per_item": measured}, indent=1) + "\n")
        print(f"recorded in {RECORDED.name}")
    same = compiler == recorded["compiler"] and not options.record
    worse = [*not_free(measured), *(grown(measured, recorded["per_item"]) if same else [])]
    print("\n".join(worse) or "nothing is paid for what a scene does not have" + ("" if same else "; growth is not judged"))
    return int(bool(worse))


def not_free(measured: dict[str, float]) -> list[str]:
    """A line per feature that costs something where no ray meets it."""
    plain = measured["plain"]
    return [
        f"{scene}: {measured[scene] / plain - 1:+.2%} of the plain scene" for scene in FREE if measured[scene] > (1 + FREE_WITHIN) * plain
    ]


def features_table(measured: dict[str, float], recorded: dict[str, float]) -> str:
    rows = [("instructions a pixel", "now", "over plain", "recorded")]
    for scene, value in measured.items():
        known = recorded.get(scene)
        rows.append((scene, f"{value:.0f}", f"{value / measured['plain'] - 1:+.2%}", f"{known:.0f}" if known else "-"))
    return table(rows)


if __name__ == "__main__":
    sys.exit(main())
