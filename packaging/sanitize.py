"""`make sanitize`: the core's own tests, and a longer run of the fuzzer of the C API, under
AddressSanitizer with UndefinedBehaviorSanitizer, and under ThreadSanitizer. What failed is named
once more at the end.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import environment
import tree

KINDS = {"address": "address;undefined", "thread": "thread"}
THREADED = "accel_build|accel_same_bits|accel_reuse|core_functions|fuzz"
"""The tests that start threads: ThreadSanitizer finds nothing in others."""
PROGRAMS = ("accel_tests", "core_tests", "fuzz")
STAGES = {
    "avx512": {"avx512f", "avx512vl", "avx512dq", "avx512bw", "avx2", "bmi1", "bmi2", "fma"},
    "avx2": {"avx2", "bmi1", "bmi2", "fma"},
}
"""Instruction sets, the best first, and the processor's flags that the core asks for
(simd/isa.h).
"""
FUZZ_CASES, FUZZ_SECONDS, FUZZ_SEED = {"address": "10000", "thread": "2000"}, "600", "1000000"
"""Other inputs than those of ctest: their number ends a run, so that every machine tries the same
ones; the time is for machines that are far too slow. Threads start in the same way whatever the
input. A failure names the seed to begin the next run with.
"""


def main() -> int:
    blender = environment.prepare()
    environment.check_compiler()
    variables = {
        **os.environ,
        "PATH": f"{blender.interpreter.parent}{os.pathsep}{os.environ['PATH']}",
    }
    failed = [
        name
        for kind, sanitizers in KINDS.items()
        for name in _failures(kind, sanitizers, variables)
    ]
    for name in failed:
        print(f"glint: failed: {name}", flush=True)
    return int(bool(failed))


def _instruction_set(kind: str) -> str:
    """The one to compile stages and traversal for, each of which takes over a minute of compiling:
    the core takes it on this machine. The narrower of them start the same threads, and compile
    sooner. All where the machine is not known.
    """
    processor = Path("/proc/cpuinfo")
    lines = processor.read_text().splitlines() if processor.exists() else []
    flags = next((set(line.split()) for line in lines if line.startswith("flags")), set())
    here = [isa for isa, needed in STAGES.items() if needed <= flags]
    if not here:
        return "sse42;avx2;avx512"
    return here[-1 if kind == "thread" else 0]


def _failures(kind: str, sanitizers: str, variables: dict[str, str]) -> list[str]:
    folder = tree.BUILD / f"sanitize-{kind}"
    cores = str(os.cpu_count() or 1)
    with tree.step(f"building the core's tests with {sanitizers}"):
        configure = [
            "cmake",
            "-S",
            tree.CORE,
            "-B",
            folder,
            "-G",
            "Ninja",
            "-DCMAKE_BUILD_TYPE=RelWithDebInfo",
            "-DGLINT_BUILD_TESTS=ON",
        ]
        isa = _instruction_set(kind)
        configure += [f"-DGLINT_STAGES={isa}", f"-DGLINT_KERNELS={isa}"]
        tree.call(
            [*configure, f"-DGLINT_SANITIZE={sanitizers}"],
            "The compiler must know these sanitizers.",
            env=variables,
        )
        tree.call(
            ["cmake", "--build", folder, "--parallel", cores, "--target", *PROGRAMS],
            "The core's tests do not build.",
            env=variables,
        )
    fuzzer = [str(folder / "tests" / "fuzz"), FUZZ_CASES[kind], FUZZ_SECONDS, FUZZ_SEED]
    tests = ["ctest", "--test-dir", str(folder), "--output-on-failure", "--parallel", cores]
    if kind == "thread":
        tests += ["--tests-regex", THREADED]
    failed = []
    for command in (tests, fuzzer):
        print(f"glint: {sanitizers}: {' '.join(command)}", flush=True)
        if subprocess.run(command, env=variables).returncode:
            failed.append(f"{' '.join(command)} ({sanitizers})")
    return failed


if __name__ == "__main__":
    tree.main(main)
