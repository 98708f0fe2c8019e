"""`make bench`: every bench of this folder in its short form, one after the other, each in a process of its own.

With names, only those: rays, frames, million, export, instructions, features.
"""

import subprocess
import sys
from pathlib import Path

BENCHES = {
    "rays": ["--quick"],
    "frames": ["--quick"],
    "million": [],
    "export": [],
    "instructions": [],
    "features": [],
}
"""Script → the options of its short form."""


def main() -> int:
    wanted = sys.argv[1:] or list(BENCHES)
    unknown = [name for name in wanted if name not in BENCHES]
    if unknown:
        raise SystemExit(f"no bench is called {', '.join(unknown)}; there are {', '.join(BENCHES)}")
    here = Path(__file__).parent
    return max(subprocess.run([sys.executable, str(here / f"{name}.py"), *BENCHES[name]]).returncode for name in wanted)


if __name__ == "__main__":
    sys.exit(main())
