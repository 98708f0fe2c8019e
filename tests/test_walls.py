"""The walls between the rooms (ARCHITECTURE.md), read off the import statements."""

import ast
import re
import sys
from collections.abc import Callable
from graphlib import TopologicalSorter
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("addon", "operators", "engine")
BLENDER = {
    "bpy",
    "bpy_extras",
    "mathutils",
    "gpu",
    "gpu_extras",
    "bmesh",
    "blf",
    "bl_operators",
    "bl_ui",
    "addon_utils",
    "idprop",
    "imbuf",
    "aud",
    "freestyle",
}
ENGINES_API = {
    "engine",
    "engine.closures",
    "engine.displacement",
    "engine.lights.dome",
    "engine.program.graph",
    "engine.program.operations",
    "engine.program.operations_color",
    "engine.program.operations_input",
    "engine.program.operations_math",
    "engine.program.operations_noise",
    "engine.program.operations_pattern",
    "engine.program.operations_rays",
    "engine.program.operations_vector",
    "engine.program.operations_voronoi",
    "engine.program.program",
    "engine.program.table",
    "engine.scene",
    "engine.scene.panorama",
    "engine.settings",
    "engine.film",
    "engine.futures",
    "engine.analysis.fingerprint",
    "engine.analysis.target",
}
MEASURES = {
    "engine.analysis.comparison",
    "engine.analysis.flip",
    "engine.analysis.metrics",
    "engine.analysis.plot",
    "engine.analysis.trade",
    "engine.analysis.trade_crops",
    "engine.analysis.trade_tunables",
    "engine.analysis.trade_plot",
    "engine.analysis.trade_rows",
}
ADDONS_API = {
    "addon.render.final",
    "addon.render.interrupts",
    "addon.render.result",
    "addon.ui.lines",
    "addon.ui.panel",
    "addon.render.stamp",
    "addon.render.statistics",
    "addon.viewport",
}
"""What operators need of a final render: what it reads, what it stamps, what it took; and what
panels share.
"""

# Room → what it may import from other packages, and a test for what it may import from this one.
STDLIB = set(sys.stdlib_module_names)


def _inside_addon(name: str) -> bool:
    return name.startswith("addon") or name in ENGINES_API


def _inside_operators(name: str) -> bool:
    return (
        name.startswith(("operators", "addon.export"))
        or name in ENGINES_API | MEASURES | ADDONS_API
    )


def _inside_engine(name: str) -> bool:
    return name.startswith("engine")


def _inside_reference(name: str) -> bool:
    shared = "cryptomatte", "scene", "scene.panorama", "scene.ray_batch", "film", "settings"
    values = {f"engine.{name}" for name in shared}
    packages = "reference", "closures", "linear", "program", "sampling", "lights"
    return name in values or name.startswith(tuple(f"engine.{package}" for package in packages))


def _only(*packages: str) -> Callable[[str], bool]:
    """Whether a module of the engine lies in one of these packages of it."""
    return lambda name: name.startswith(tuple(f"engine.{package}" for package in packages))


WALLS = {
    "__init__.py": ({"importlib"}, lambda name: False),
    "addon": (BLENDER | {"numpy", "OpenImageIO", "openvdb"} | STDLIB, _inside_addon),
    "operators": (BLENDER | {"numpy", "OpenImageIO"} | STDLIB, _inside_operators),
    "engine/reference": ({"numpy"} | STDLIB, _inside_reference),
    "engine/linear": ({"numpy"} | STDLIB, _only("linear")),
    "engine/closures": (STDLIB, _only("closures")),
    "engine/sampling": ({"numpy"} | STDLIB, _only("sampling", "scene")),
    "engine/scene": ({"numpy"} | STDLIB, _only("scene", "closures", "program", "linear", "lights")),
    "engine/program": (
        {"numpy"} | STDLIB,
        _only("program", "scene.checks", "reference.program"),
    ),
    "engine/lights": (
        {"numpy"} | STDLIB,
        _only("lights", "scene", "program", "sampling", "reference", "accelerator", "settings"),
    ),
    "engine/native": ({"numpy", "glint_core"} | STDLIB, _inside_engine),
    "engine": ({"numpy"} | STDLIB, _inside_engine),
}


def imports(path: PurePosixPath, source: str) -> tuple[set[str], set[str]]:
    """(top-level packages from outside, dotted modules of this tree) that a file imports anywhere.
    Names imported from a package of this tree count as its modules when there is such a module.
    """
    outside, inside = set(), set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            outside |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            outside.add(node.module.split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            package = path.parent if node.level == 1 else path.parents[node.level - 1]
            base = [*package.parts, *(node.module.split(".") if node.module else [])]
            inside |= {".".join(_module(base, alias.name)) for alias in node.names}
    return outside - {"__future__"}, inside - {""}


def _module(base: list[str], name: str) -> list[str]:
    candidate = ROOT.joinpath(*base, name)
    return [*base, name] if candidate.is_dir() or candidate.with_suffix(".py").is_file() else base


def breaches(path: PurePosixPath, source: str) -> list[str]:
    """What this file imports through a wall."""
    room = next(room for room in WALLS if path.is_relative_to(room))
    allowed_outside, allowed_inside = WALLS[room]
    outside, inside = imports(path, source)
    if room == "__init__.py":
        inside -= {"addon", "operators"}
    return sorted(
        f"{path} imports {name}"
        for name in (outside - allowed_outside)
        | {name for name in inside if not allowed_inside(name)}
    )


def _at_import(source: str) -> str:
    """The import statements that run when a module is imported."""
    body = ast.parse(source).body
    return "\n".join(
        ast.unparse(node) for node in body if isinstance(node, (ast.Import, ast.ImportFrom))
    )


def python_files() -> list[PurePosixPath]:
    paths = [
        ROOT / "__init__.py",
        *(path for room in ROOMS for path in (ROOT / room).rglob("*.py")),
    ]
    found = [PurePosixPath(path.relative_to(ROOT).as_posix()) for path in paths]
    return sorted(path for path in found if not path.is_relative_to("engine/core"))


def test_no_file_imports_through_a_wall():
    assert len(python_files()) > 20
    assert [
        breach for path in python_files() for breach in breaches(path, (ROOT / path).read_text())
    ] == []


def test_no_module_imports_itself_by_way_of_others():
    """TopologicalSorter raises CycleError, which names the circle."""
    modules = {
        ".".join(path.with_suffix("").parts).removesuffix(".__init__"): path
        for path in python_files()
    }
    graph = {
        name: imports(path, _at_import((ROOT / path).read_text()))[1] & modules.keys() - {name}
        for name, path in modules.items()
    }
    assert sum(map(len, graph.values())) > 1000
    TopologicalSorter(graph).prepare()


def test_nothing_reads_the_data_of_an_original_object():
    """After an undo it may point at memory that Blender has freed."""
    room = sorted((ROOT / "addon").rglob("*.py"))
    assert [
        str(path)
        for path in room
        if re.search(r"original\.data|original,\s*.data", path.read_text().replace('"', ""))
    ] == []


def test_the_root_imports_lazily():
    """Nothing at module level: Blender reads this file even when the extension is disabled, and
    pytest imports it too.
    """
    body = ast.parse((ROOT / "__init__.py").read_text()).body
    assert not [node for node in body if isinstance(node, (ast.Import, ast.ImportFrom))]


@pytest.mark.parametrize(
    "path", sorted((ROOT / "engine" / "core" / "src").rglob("*.[ch]*")), ids=lambda path: path.name
)
def test_the_core_includes_the_standard_library_and_itself_alone(path):
    core = ROOT / "engine" / "core"
    own = {header.name for kind in ("*.h", "*.inc") for header in core.rglob(kind)}
    included = re.findall(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', path.read_text(), re.MULTILINE)
    assert not [name for kind, name in included if kind == '"' and Path(name).name not in own]
    system = [name for kind, name in included if kind == "<"]
    assert not [
        name
        for name in system
        if re.search(r"Python|numpy|pybind|blender|embree|tbb", name, re.IGNORECASE)
    ]


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("engine/scene/model.py", "import bpy"),
        ("engine/linear/frames.py", "from mathutils import Vector"),
        ("engine/reference/trace.py", "from .. import native"),
        ("engine/reference/trace.py", "from ..problems import scene_problems"),
        ("engine/film.py", "import glint_core"),
        ("engine/lights/dome.py", "from .. import native"),
        ("engine/lights/lamps.py", "from ..film import PASSES"),
        ("engine/program/graph.py", "from ..scene.model import Scene"),
        ("addon/render/final.py", "from ...engine.native import render_native"),
        ("addon/render/final.py", "from ...engine import native"),
        ("addon/ui/panels.py", "def f():\n    from ... import operators"),
        ("addon/export/lights.py", "from ...engine.reference import render_reference"),
        ("operators/add_demo_scene.py", "from ..addon.panels import ENGINE"),
        ("addon/ui/panels.py", "from ...engine.analysis import trade"),
        ("operators/measure_scene.py", "from ..engine.native import render_native"),
        ("addon/render/result.py", "import scipy"),
        ("__init__.py", "import numpy"),
    ],
)
def test_a_hole_in_a_wall_is_seen(path, source):
    assert breaches(PurePosixPath(path), source)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("addon/render/final.py", "from ... import engine\nfrom ..export import export_scene"),
        (
            "addon/export/lights.py",
            "from ...engine.scene import Light\nimport numpy as np\nimport bpy",
        ),
        ("engine/reference/trace.py", "from ..scene import Scene\nfrom ..linear import frames"),
        ("engine/native/__init__.py", "import ctypes\nimport glint_core"),
        ("operators/add_demo_scene.py", "from .demo_scene import build_demo_scene"),
        (
            "operators/measure_scene.py",
            "from ..engine.analysis.trade import measure\nfrom ..addon.render import final",
        ),
    ],
)
def test_a_door_is_open(path, source):
    assert breaches(PurePosixPath(path), source) == []
