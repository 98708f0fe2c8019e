"""`make bench`: every bench of this folder, one after the other, each in a process of its own; options go to all of them."""

import subprocess
import sys
from pathlib import Path


def main() -> int:
    benches = sorted(path for path in Path(__file__).parent.glob("*.py") if path.name != "bench.py")
    return max(subprocess.run([sys.executable, str(path), *sys.argv[1:]]).returncode for path in benches)


if __name__ == "__main__":
    sys.exit(main())
