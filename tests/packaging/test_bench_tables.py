"""The benches' arithmetic: ratios, verdicts, tables and the judgement of instruction counts; and
that those of the core compile. Nothing is timed.
"""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

BENCH = Path(__file__).resolve().parents[1] / "bench"
CORE = BENCH.parents[1] / "engine" / "core"
COMPILER = shlex.split(os.environ.get("CXX", "c++"))
sys.path.insert(0, str(BENCH))

import bench  # noqa: E402
import front_curves  # noqa: E402
import front_truth  # noqa: E402
import instructions  # noqa: E402
import ray_tables  # noqa: E402
import stages  # noqa: E402

pytestmark = pytest.mark.once


def row(
    tracer: str, mrays: float, robust: bool = True, threads: int = 1, rays: str = "primary"
) -> dict:
    return {
        "tracer": tracer,
        "mrays": mrays,
        "robust": robust,
        "threads": threads,
        "rays": rays,
        "mode": f"{tracer} {mrays}",
    }


def build_row(tracer: str, cpu: float, size: float, threads: int = 1) -> dict:
    return {
        "tracer": tracer,
        "quality": "balanced" if tracer == "glint" else "medium",
        "robust": True,
        "compact": False,
        "threads": threads,
        "cpu_seconds": cpu,
        "wall_seconds": cpu,
        "bytes_per_triangle": size,
    }


@pytest.fixture
def report() -> dict:
    traversal = [row("glint", 30), row("glint", 20), row("glint", 57, threads=2)]
    traversal += [
        row("embree", 10),
        row("embree", 12),
        row("embree", 40, robust=False),
        row("embree", 99, threads=2),
    ]
    answers = [
        {
            "rays": "primary",
            "hit_or_miss_per_million": 2.0,
            "distance_per_million": 0.5,
            "primitive_per_million": 9.0,
        }
    ]
    builds = [
        build_row("glint", 0.5, 30),
        build_row("embree", 1.0, 60),
        build_row("glint", 0.25, 30, threads=2),
    ]
    return {
        "head": {"triangles": 2_000_000},
        "traversal": traversal,
        "answers": answers,
        "builds": builds,
    }


def test_ratios_take_the_best_mode_of_each_class(report):
    assert ray_tables.ratio(report, "primary", 1, robust=True) == 30 / 12
    assert ray_tables.ratio(report, "primary", 1, robust=False) == 30 / 40
    assert ray_tables.ratio(report, "mirror", 1, robust=True) is None
    assert ray_tables.scaling({"a": report}, "primary") == [57 / 30]


def test_camera_rays_are_beside_primary_ones(report):
    report["traversal"].append(row("glint", 36, rays="camera"))
    assert ray_tables.ratio(report, "camera", 1, robust=True) == 36 / 12
    assert ray_tables.ratio(report, "primary", 1, robust=True) == 30 / 12
    line = next(
        line
        for line in ray_tables.rates_table({"a": report}, 1).splitlines()
        if line.startswith("a, camera")
    )
    assert "36.0" in line and "3.00" in line


def test_meshes_without_a_ratio_are_left_out(report):
    assert ray_tables.ratios({"a": report, "b": {}}, "primary", 1, True) == {"a": 2.5}


def test_summary_compares_medians_with_targets_and_names_the_worst(report):
    slow = {**report, "traversal": [row("glint", 6), row("embree", 12)]}
    text = ray_tables.summary_table({"fast": report, "slow": slow})
    line = next(line for line in text.splitlines() if line.startswith("primary, Embree robust"))
    assert line.split()[3:] == ["1.50", "2.5", "missed", "0.50", "slow", "0.95", "missed"]


def test_summary_compares_builds_of_like_quality(report):
    lines = ray_tables.summary_table({"a": report}).splitlines()
    speed = next(line for line in lines if line.startswith("build speed"))
    assert speed.split()[5:] == ["2.00", "1.0", "met", "2.00", "a", "1.0", "met"]
    assert "bytes saved, Embree medium robust" in lines[-1]


def test_verdicts():
    assert ray_tables.verdict(2.5, 2.5) == "met"
    assert ray_tables.verdict(2.49, 2.5) == ray_tables.verdict(float("nan"), 2.5) == "missed"


def test_builds_table_has_speed_per_core_and_both_ratios(report):
    lines = ray_tables.builds_table({"a": report}).splitlines()
    embree = next(line for line in lines if "embree" in line).split()
    assert embree[4:] == ["2.00", "1000.0", "-", "60.0", "2.00", "0.50"]
    glint = next(line for line in lines if "glint" in line).split()
    assert glint[3:] == ["4.00", "500.0", "250.0", "30.0", "1.00", "1.00"]


def test_answers_that_differ_leave_ties_out(report):
    assert ray_tables.differing(report, "primary") == 2.5


def test_table_aligns_columns():
    assert ray_tables.table([("a", "b"), ("long", "1")]) == "a     b\n-------\nlong  1"


def test_plot_is_xml_with_a_bar_per_mesh_and_kind(report):
    root = ElementTree.fromstring(ray_tables.plot({"a": report, "b": report}))
    titles = [node.text for node in root.iter("{http://www.w3.org/2000/svg}title")]
    assert len(titles) == 2 * len(ray_tables.KINDS) and titles.count("a: 2.50") == 1


def test_instruction_counts_may_grow_by_five_per_cent():
    assert instructions.grown({"primary": 105.0}, {"primary": 100.0}) == []
    assert len(instructions.grown({"primary": 105.1}, {"primary": 100.0})) == 1
    assert instructions.grown({"primary": 1.0}, {}) == ["primary: not recorded (--record does)"]


def test_cycles_stages_end_at_its_messages():
    messages = [
        (1.0, "Initializing"),
        (1.5, "Updating"),
        (3.0, "Sample 0/1"),
        (3.5, "Sample 1/1"),
        (7.0, "Finished"),
    ]
    assert stages.cycles_stages(messages) == {"sync": 1.0, "build": 2.0, "trace": 4.0}
    with pytest.raises(RuntimeError, match="Sample 0"):
        stages.cycles_stages([(1.0, "Initializing")])


def test_least_takes_each_number_apart():
    assert stages.least([{"a": 1.0, "b": 4.0}, {"a": 2.0, "b": 3.0}]) == {"a": 1.0, "b": 3.0}


def test_every_bench_of_the_list_exists():
    assert all((BENCH / f"{name}.py").is_file() for name in bench.BENCHES)


def points(*rows: tuple[float, float]) -> list[dict]:
    return [
        {"samples": k, "seconds": s, "flip": error, "shown": error, "first_ray": 0.1}
        for k, (s, error) in enumerate(rows)
    ]


def front_of(default: tuple[float, float]) -> dict:
    return {
        "scene": "a",
        "size": [4, 3],
        "default": points(default)[0],
        "glint": points(default),
        "cycles": points((1, 0.4), (2, 0.2), (3, 0.3), (8, 0.05)),
        "denoised": points((1.5, 0.1), (2.5, 0.08)),
        "truth": {"samples": 8, "noise": 0.01},
    }


def test_a_front_has_what_no_other_point_beats():
    assert front_curves.front(points((3, 0.3), (1, 0.4), (2, 0.2))) == [(1, 0.4), (2, 0.2)]


@pytest.mark.parametrize(
    ("error", "seconds", "sign", "kind"),
    [
        (0.3, 2**0.415, "", "raw"),  # the same share of the way in logarithms
        (0.5, 1, "<", "raw"),
        (0.1, 1.5, "", "denoised"),
        (0.05, 8, "", "raw"),
        (0.01, 2.5, ">", "denoised"),
    ],
)
def test_the_sooner_of_raw_and_denoised_counts(error, seconds, sign, kind):
    result = front_of((4, error))
    found = front_curves.best_of_cycles(result)
    assert (round(found.seconds, 3), found.sign) == (round(seconds, 3), sign)
    assert front_curves.KINDS[found.kind] == kind
    assert front_curves.gain(result) == pytest.approx(seconds / 4, rel=1e-3)
    text = front_curves.table([result])
    assert front_curves.row_of(result) in text
    assert (front_curves.NOISY in text) == (error / 3 < 0.01)


def test_a_truth_is_drawn_on_until_it_is_enough(tmp_path):
    seeds = []

    def draw(samples: int, seed: int) -> np.ndarray:
        seeds.append(seed)
        return np.full((2, 2, 3), seed)

    def truth(enough: bool) -> front_truth.Truth:
        return front_truth.truth_of(tmp_path, "a_4", draw, 8, lambda _: enough)

    first = truth(enough=True)
    assert (first.samples, seeds) == (16, [1, 2])
    assert truth(enough=True).samples == 16
    assert len(seeds) == 2
    whole = truth(enough=False)
    assert whole.samples == 2 * 8 * front_truth.STEPS
    assert len(set(seeds)) == len(seeds) == 2 * front_truth.STEPS
    assert whole.picture[0, 0, 0] == pytest.approx(np.mean(seeds))
    assert truth(enough=False).samples == whole.samples
    assert len(list(tmp_path.iterdir())) == 1


def test_what_runs_by_name_exists():
    assert all((BENCH / name).is_file() for name in bench.BY_NAME.values())


@pytest.mark.skipif(not shutil.which(COMPILER[0]), reason="needs a C++ compiler: set CXX")
@pytest.mark.parametrize("name", ["accel_bench", "pipeline_bench", "pipeline_counts", "ray_counts"])
def test_benches_of_the_core_compile(name):
    """Without Embree, which that of its rays needs."""
    places = [f"-I{CORE / folder}" for folder in ("include", "src", "tests")]
    source = str(CORE / "bench" / f"{name}.cpp")
    done = subprocess.run(
        [*COMPILER, "-std=c++20", "-fsyntax-only", *places, source], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
