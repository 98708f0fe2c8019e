"""`make test`: prepares the environment and the core, then runs pytest in it with the arguments
after `--`; with --parallel in as many processes as there are processors.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import core_wheel
import environment
import tree

PARALLEL = ("-n", "auto", "--dist", "loadfile", "--max-worker-restart", "0")
"""Files of tests in several processes: what a file makes for its tests is made once. A process that
dies ends the run: one put in its place was seen to wait for ever.
"""


def main() -> int:
    cut = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    parser.add_argument("--parallel", action="store_true")
    options = parser.parse_args(sys.argv[1:cut])
    return run(options.bpy, [*(PARALLEL if options.parallel else ()), *sys.argv[cut + 1 :]])


def run(wanted: str, pytest_arguments: list[str]) -> int:
    """Exit code of pytest in the environment of this Blender."""
    blender = environment.prepare(wanted)
    core_wheel.install(blender)
    blender.bare_resources.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.gettempdir())  # add-ons that tests installed
    shutil.rmtree(
        tree.BUILD / "bytecode" / temporary.relative_to(temporary.anchor), ignore_errors=True
    )
    variables = {
        **os.environ,
        "BLENDER_USER_RESOURCES": str(blender.bare_resources),
        **tree.bytecode_variables(),
        # NumPy's threads for matrices of 3 by 3 spin for longer than these take.
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = [blender.interpreter, tree.ROOT / "packaging" / "pytest_main.py", *pytest_arguments]
    return subprocess.run([str(part) for part in command], cwd=tree.ROOT, env=variables).returncode


if __name__ == "__main__":
    tree.main(main)
