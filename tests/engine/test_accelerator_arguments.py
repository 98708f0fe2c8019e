"""Ray queries over arrays: what is refused, what is closed, what does not fit into memory."""

from __future__ import annotations

import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint import engine
from glint.engine import scene as s
from native_tools import needs_core
from ray_scenes import DOWN, HALVES, SQUARE, at, both, random_rays
from ray_tools import icosphere

# --- bad input
# --------------------------------------------------------------------------------------------------


@both
@pytest.mark.parametrize(
    ("origins", "directions", "rest", "words"),
    [
        (
            np.zeros((4, 2)),
            np.ones((4, 3)),
            {},
            r"origins has shape \(4, 2\): use \(n, 3\) or \(3,\)",
        ),
        (np.zeros((4, 3)), np.ones((5, 3)), {}, "directions has 5 rows: the other arrays have 4"),
        (np.zeros((4, 3)), np.ones((4, 3)), {"t_max": np.ones(3)}, "t_max has 3 rows"),
        (
            np.zeros((4, 3)),
            np.ones((4, 3)),
            {"t_min": np.ones((4, 1))},
            r"t_min has shape \(4, 1\): use \(n,\) or one number",
        ),
        (
            np.zeros((4, 3), complex),
            np.ones((4, 3)),
            {},
            "origins has dtype complex128: use float32 or float64",
        ),
        (np.zeros((4, 3), object), np.ones((4, 3)), {}, "origins has dtype object"),
        (np.zeros((4, 3)), "down", {}, "directions has dtype"),
        (np.zeros(12), np.ones((4, 3)), {}, "origins has shape"),
        (np.zeros((4, 3)), np.ones((4, 3)), {"visibility": "light"}, "visibility is 'light'"),
    ],
)
def test_rays_that_do_not_fit(backend: str, origins, directions, rest: dict, words: str) -> None:
    with engine.Accelerator.from_triangles(SQUARE, HALVES, backend=backend) as tree:
        for ask in (tree.closest, tree.occluded):
            with pytest.raises(ValueError, match=words):
                ask(origins, directions, **rest)


@both
@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        (SQUARE, [[0, 1, 4]], r"triangle 0 names vertices \[0, 1, 4\] but there are 4"),
        (SQUARE, [[0, 1, 2], [0, -1, 2]], "triangle 1 names vertices"),
        (SQUARE, [0, 1, 2, 0], r"triangles has shape \(4,\)"),
        (SQUARE, [[0.0, 1.0, 2.0]], "triangles has dtype float64"),
        (SQUARE.ravel(), HALVES, "vertices has shape"),
        (SQUARE, [[2**40, 0, 1]], "triangle 0 names"),
    ],
)
def test_triangles_that_do_not_fit(backend: str, vertices, triangles, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        engine.Accelerator.from_triangles(vertices, triangles, backend=backend)


@both
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"world_from_object": np.full((1, 3, 4), np.nan)},
            "world_from_object has a value that is not finite",
        ),
        ({"world_from_object": np.zeros((1, 4, 4))}, r"world_from_object has shape \(1, 4, 4\)"),
        (
            {"world_from_object": np.zeros((1, 3, 4), np.float32)},
            "world_from_object has dtype float32",
        ),
        ({"geometry": 1}, "geometry is 1 but the scene has 1 geometries"),
    ],
)
def test_instances_that_do_not_fit(backend: str, change: dict, words: str) -> None:
    group = replace(s.Instances("group", 0, at(0, 0, 0), ()), **change)
    with pytest.raises(engine.SceneError, match=words):
        engine.Accelerator((s.Mesh("square", SQUARE, HALVES),), (group,), backend=backend)


def test_options_that_do_not_fit() -> None:
    for options, words in (
        ({"threads": -1}, "threads is -1"),
        ({"threads": 1.5}, "threads is 1.5"),
        ({"backend": "GPU"}, "is 'GPU'"),
    ):
        with pytest.raises(ValueError, match=words):
            engine.Accelerator.from_triangles(SQUARE, HALVES, **options)
    with pytest.raises(engine.SceneError, match="is no block of instances"):
        engine.Accelerator((), ("instances",))
    with pytest.raises(engine.SceneError, match="geometries holds a str"):
        engine.Accelerator(("mesh",), ())
    # as NumPy counts
    with engine.Accelerator.from_triangles(SQUARE, HALVES, threads=np.int64(1)) as tree:
        assert tree.occluded([0.25, 0.5, 3.0], DOWN)[0]


@both
def test_more_rays_than_memory(backend: str) -> None:
    """10^14 of them: an error before anything is touched."""
    many = np.broadcast_to(np.zeros(3), (10**14, 3))
    with (
        engine.Accelerator.from_triangles(SQUARE, HALVES, backend=backend) as tree,
        pytest.raises(MemoryError),
    ):
        tree.closest(many, DOWN)


@needs_core
@pytest.mark.skipif(
    not sys.platform.startswith("linux"),
    reason="limits a process' memory with setrlimit, as Linux has it",
)
def test_more_triangles_than_memory() -> None:
    """A tree that does not fit into what the process may have is a MemoryError."""
    program = """
import resource, numpy as np
import glint_tree
from glint import engine
count = 1 << 20
triangles = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
vertices = np.random.default_rng(0).random((3 * count, 3), np.float32)
engine.Accelerator.from_triangles(vertices[:9], triangles[:3], backend="NATIVE", threads=2)
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 60_000_000,) * 2)
try:
    engine.Accelerator.from_triangles(vertices, triangles, backend="NATIVE", threads=2)
except MemoryError as error:
    print("MemoryError:", error)
"""
    folder = Path(__file__).resolve().parent.parent
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=False
    )
    assert run.stdout == "MemoryError: the core ran out of memory\n", (
        run.stdout + run.stderr[-2000:]
    )


# --- life
# --------------------------------------------------------------------------------------------------


@both
def test_closed(backend: str) -> None:
    tree = engine.Accelerator.from_triangles(SQUARE, HALVES, backend=backend)
    tree.close()
    tree.close()
    for use in (
        lambda: tree.closest(DOWN, DOWN),
        lambda: tree.occluded(DOWN, DOWN),
        lambda: tree.bounds,
        lambda: tree.stats,
    ):
        with pytest.raises(ValueError, match="the accelerator is closed"):
            use()


@needs_core
def test_close_waits_for_queries_under_way() -> None:
    vertices, triangles = icosphere(4)
    o, d = random_rays(np.random.default_rng(12), 200_000)
    with engine.Accelerator.from_triangles(vertices, triangles) as tree:
        truth = tree.closest(o, d)
    tree = engine.Accelerator.from_triangles(vertices, triangles)
    answers: list[engine.Hits] = []
    refusals: list[str] = []
    started = threading.Barrier(4)

    def ask() -> None:
        ready = tree.closest
        started.wait()
        try:
            answers.append(ready(o, d))
        except ValueError as error:
            refusals.append(str(error))

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    started.wait()
    tree.close()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(a.t, truth.t) for a in answers)
    assert len(answers) + len(refusals) == 3 and set(refusals) <= {"the accelerator is closed"}
