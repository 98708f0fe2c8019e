"""`make sanitize`: the core's own tests, and a longer run of the fuzzer of the C door, under AddressSanitizer with
UndefinedBehaviorSanitizer, and under ThreadSanitizer."""

from __future__ import annotations

import os
import subprocess

import environment
import tree

KINDS = {"address": "address;undefined", "thread": "thread"}
FUZZ_CASES, FUZZ_SECONDS, FUZZ_SEED = "1000000", "60", "1000000"
"""As many arbitrary inputs as fit into a minute, other ones than those of ctest. A failure names the seed to begin the next run with."""


def main() -> int:
    blender = environment.prepare()
    environment.check_compiler()
    variables = {**os.environ, "PATH": f"{blender.interpreter.parent}{os.pathsep}{os.environ['PATH']}"}
    return max(_run(kind, sanitizers, variables) for kind, sanitizers in KINDS.items())


def _run(kind: str, sanitizers: str, variables: dict[str, str]) -> int:
    folder = tree.BUILD / f"sanitize-{kind}"
    cores = str(os.cpu_count() or 1)
    with tree.step(f"building the core's tests with {sanitizers}"):
        configure = ["cmake", "-S", tree.CORE, "-B", folder, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=RelWithDebInfo", "-DGLINT_BUILD_TESTS=ON"]
        tree.call([*configure, f"-DGLINT_SANITIZE={sanitizers}"], "The compiler must know these sanitizers.", env=variables)
        tree.call(["cmake", "--build", folder, "--parallel", cores], "The core's tests do not build.", env=variables)
    tested = subprocess.run(["ctest", "--test-dir", str(folder), "--output-on-failure"], env=variables).returncode
    print(f"fuzzing with {sanitizers} for {FUZZ_SECONDS} s", flush=True)
    fuzzer = [str(folder / "tests" / "fuzz"), FUZZ_CASES, FUZZ_SECONDS, FUZZ_SEED]
    return max(tested, subprocess.run(fuzzer, env=variables).returncode != 0)


if __name__ == "__main__":
    tree.main(main)
