"""What is exported has the same bits on processors of other instruction sets."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import hashlib
import glint_tree
import numpy as np
from glint.engine.tangents import tangents, tangents_by_numpy
from glint.addon.export.materials.roughness import scattered, width

random = np.random.default_rng(1)
vertices, uv = random.normal(size=(500, 3)), random.random((3000, 2))
triangles = random.integers(0, 500, (1000, 3))
normals = random.normal(size=(1000, 3, 3))
normals /= np.sqrt((normals**2).sum(-1, keepdims=True))
corners = np.arange(3000).reshape(-1, 3)
for values in (
    [(width(k / 511), scattered(0.5, k / 511)) for k in range(512)],
    tangents(vertices, triangles, corners, normals, uv).tolist(),
    tangents_by_numpy(vertices, triangles, corners, normals, uv).tolist(),
):
    print(hashlib.sha256(repr(values).encode()).hexdigest())
"""
SLOWER = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR AVX2 FMA3"


@pytest.mark.skipif(sys.platform != "linux", reason="the C library's switch is of glibc")
def test_tables_and_tangents_are_those_of_an_older_processor() -> None:
    """NumPy's and the C library's faster code is off there, where this processor has any."""
    paths = f"import sys\nsys.path.insert(0, {str(Path(__file__).parents[1])!r})\n"
    switches = {
        "NPY_DISABLE_CPU_FEATURES": SLOWER,
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F",
    }
    found = [
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", paths + PROGRAM],
            env=os.environ | more,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for more in ({}, switches)
    ]
    assert len(found[0]) == 3 and found[0] == found[1]
