"""`make bench`: every bench of this folder in its short form, one after the other, each in a
process of its own.

With names, only those: rays, frames, million, hair, export, instructions, features, volumes,
crowded, fronts, targets, farm, viewport.
The last five are run by name only: crowded takes a quarter of an hour of a quiet machine, fronts
half an hour, targets ten minutes, farm as long and Debian's Slurm, and the viewport needs a Blender
with a window, which GLINT_BLENDER names.
"""

import subprocess
import sys
from pathlib import Path

BENCHES = {
    "rays": ["--quick"],
    "frames": ["--quick"],
    "million": [],
    "hair": [],
    "export": [],
    "instructions": [],
    "features": [],
    "volumes": [],
}
"""Script → the options of its short form."""
BY_NAME = {
    "crowded": "crowded.py",
    "fronts": "fronts.py",
    "targets": "targets.py",
    "farm": "farm.py",
    "viewport": "../viewport/measure.py",
}
"""Name → script of what takes long, or what the machine must be fit for."""


def main() -> int:
    wanted = sys.argv[1:] or list(BENCHES)
    unknown = [name for name in wanted if name not in (*BENCHES, *BY_NAME)]
    if unknown:
        raise SystemExit(
            f"no bench is called {', '.join(unknown)}; there are {', '.join((*BENCHES, *BY_NAME))}"
        )
    here = Path(__file__).parent
    commands = [
        [str(here / BY_NAME.get(name, f"{name}.py")), *BENCHES.get(name, [])] for name in wanted
    ]
    return max(subprocess.run([sys.executable, *command]).returncode for command in commands)


if __name__ == "__main__":
    sys.exit(main())
