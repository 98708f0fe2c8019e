"""The walls between the rooms (ARCHITECTURE.md), read off the import statements."""

import ast
import re
import sys
from collections.abc import Callable, Iterable
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
    "engine.linear.elementary",
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
    "engine.tangents",
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

OF_REFERENCE = {
    "engine/accelerator.py": "engine.reference.queries",
    "engine/analysis/explain.py": "engine.reference.explain",
    "engine/backends.py": "engine.reference.trace",
}
"""What asks for the float64 reference by name, when it is wanted: the backend NUMPY, and Explain
Pixel, whose numbers are the oracle's.
"""
IN_FUNCTIONS = {
    ("__init__.py", "addon"): "Blender reads the file of extensions that are not enabled, too",
    ("__init__.py", "operators"): "the same",
    **dict.fromkeys(OF_REFERENCE.items(), "the oracle, two fifths of the engine"),
}
"""Imports of this tree that wait for a function to be called, and why. All others stand at the top
of their modules, where circles show.
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
    return name.startswith("engine") and not name.startswith("engine.reference")


def _inside_reference(name: str) -> bool:
    shared = "cryptomatte", "explained", "film", "scene", "scene.panorama", "scene.ray_batch"
    shared = *shared, "settings"
    values = {f"engine.{name}" for name in shared}
    packages = "reference", "closures", "evaluation", "linear", "program", "sampling", "lights"
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
    "engine/scene": ({"numpy"} | STDLIB, _only("scene", "closures", "program", "linear")),
    "engine/program": (
        {"numpy"} | STDLIB,
        _only("program", "scene.checks", "linear"),
    ),
    "engine/lights": (
        {"numpy"} | STDLIB,
        _only(
            "lights",
            "scene",
            "evaluation",
            "linear",
            "program",
            "sampling",
            "accelerator",
            "settings",
        ),
    ),
    "engine/evaluation": ({"numpy"} | STDLIB, _only("evaluation", "scene", "linear", "program")),
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
    inside -= {OF_REFERENCE.get(str(path), "")}
    return sorted(
        f"{path} imports {name}"
        for name in (outside - allowed_outside)
        | {name for name in inside if not allowed_inside(name)}
    )


def _that_run(source: str) -> str:
    """The import statements of a module at any depth but those that type checkers alone read."""
    tree = ast.parse(source)
    checked = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    return _statements(node for node in ast.walk(tree) if node not in checked)


def _in_functions(source: str) -> str:
    """The import statements that run when a function is called."""
    functions = (
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
    )
    return _statements(inner for node in functions for inner in ast.walk(node))


def _run_by(imported: str, importer: str) -> set[str]:
    """What runs when a module is imported: itself, and the packages that it lies in and the
    importer does not.
    """
    parts = imported.split(".")
    packages = {".".join(parts[:k]) for k in range(1, len(parts))}
    return {imported} | {name for name in packages if not importer.startswith(f"{name}.")}


def _statements(nodes: Iterable[ast.AST]) -> str:
    return "\n".join(
        ast.unparse(node) for node in nodes if isinstance(node, (ast.Import, ast.ImportFrom))
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


def test_imports_in_functions_are_those_that_are_listed():
    found = {
        (str(path), name)
        for path in python_files()
        for name in imports(path, _in_functions((ROOT / path).read_text()))[1]
    }
    assert found == IN_FUNCTIONS.keys()


def test_no_module_imports_itself_by_way_of_others():
    """At any depth: a circle that a function closes is one. TopologicalSorter raises CycleError,
    which names the circle.
    """
    modules = {
        ".".join(path.with_suffix("").parts).removesuffix(".__init__"): path
        for path in python_files()
    }
    graph = {
        name: {
            run
            for imported in imports(path, _that_run((ROOT / path).read_text()))[1]
            for run in _run_by(imported, name)
        }
        & modules.keys() - {name}
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


_SOURCES = {".py", ".h", ".cpp", ".inc"}
_REC709 = re.compile(r"0\.2126|0\.7152|0\.0722|3\.240[49]|0\.412[34]")
_TABLES = {
    "addon/export/images/colorspace.py",
    "engine/analysis/explain.py",
    "engine/core/src/program/op_color.h",
    "engine/core/src/shading/stage_inputs.h",
    "engine/program/execute/colors.py",
}
"""The export's table, the operation of that name in both executors, the channel that the export
asks for in that space alone, and the words of Explain Pixel.
"""


def test_numbers_of_rec_709_stand_nowhere_else():
    """Where the working space is another, what reads them elsewhere is wrong."""
    sources = [p for room in ROOMS for p in (ROOT / room).rglob("*") if p.suffix in _SOURCES]
    found = {
        path.relative_to(ROOT).as_posix()
        for path in sources
        if "core/tests" not in path.as_posix() and _REC709.search(path.read_text("utf-8"))
    }
    assert found == _TABLES


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


MAY_INCLUDE = {
    "math": set(),
    "simd": set(),
    "system": set(),
    "bvh": {"math", "simd", "system"},
    "program": {"simd"},
    "shading": {"bvh", "math", "program", "simd"},
    "scene": {"bvh", "math", "program", "shading"},
    "film": {"math", "shading", "system"},
    "integrator": {"bvh", "film", "math", "scene", "shading", "system"},
    "session": {"film", "integrator", "math", "scene", "system"},
    "api": {"bvh", "film", "math", "program", "scene", "session", "shading", "system"},
}
"""Folder of the core → folders whose headers it may include."""
THE_OTHER_WAY = {
    ("program/machine.h", "shading/stage_inputs.h"),
    ("program/op_input.h", "shading/panorama.h"),
    ("program/op_input.h", "shading/stage_math.h"),
    ("program/program.cpp", "shading/stages.h"),
}
"""Programs read the columns of the stages that run them."""


def test_the_cores_folders_include_one_another_one_way():
    source = ROOT / "engine" / "core" / "src"
    assert {path.name for path in source.iterdir()} == MAY_INCLUDE.keys()
    TopologicalSorter(MAY_INCLUDE).prepare()
    against = set()
    for path in (path for path in source.rglob("*") if path.is_file()):
        own = path.relative_to(source).as_posix()
        for name in re.findall(r'^\s*#\s*include\s*"([^"]+)"', path.read_text(), re.MULTILINE):
            folder, to = own.split("/")[0], name.split("/")[0]
            if to in MAY_INCLUDE and to not in MAY_INCLUDE[folder] | {folder}:
                against.add((own, name))
    assert against == THE_OTHER_WAY


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
        ("engine/lights/dome.py", "def f():\n    from ..reference.trace import render_reference"),
        ("engine/displacement.py", "from .reference.trace import render_reference"),
        ("engine/native/render.py", "from ..reference.trace import render_reference"),
        ("engine/backends.py", "from .reference.queries import ReferenceQueries"),
        ("engine/evaluation/sky.py", "from ..lights.dome import radiance_map"),
        ("engine/program/execute/rays.py", "from ...evaluation.points import SurfacePoints"),
        ("engine/program/graph.py", "from ..scene.model import Scene"),
        ("addon/render/final.py", "from ...engine.native.render import render_native"),
        ("addon/render/final.py", "from ...engine import native"),
        ("addon/ui/panels.py", "def f():\n    from ... import operators"),
        ("addon/export/lights.py", "from ...engine.reference.trace import render_reference"),
        ("operators/add_demo_scene.py", "from ..addon.panels import ENGINE"),
        ("addon/ui/panels.py", "from ...engine.analysis import trade"),
        ("operators/measure_scene.py", "from ..engine.native.render import render_native"),
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
        ("engine/native/binding.py", "import ctypes\nimport glint_core"),
        ("engine/backends.py", "def f():\n    from .reference.trace import render_reference"),
        ("operators/add_demo_scene.py", "from .demo_scene import build_demo_scene"),
        (
            "operators/measure_scene.py",
            "from ..engine.analysis.trade import measure\nfrom ..addon.render import final",
        ),
    ],
)
def test_a_door_is_open(path, source):
    assert breaches(PurePosixPath(path), source) == []
