"""The ctypes side of the core's C interface against the header: text, layout, values, names."""

import ctypes
import shutil
import subprocess
import sys
from enum import IntEnum
from pathlib import Path

import pytest

from glint.engine import film, scene, settings
from glint.engine.closures import KINDS
from glint.engine.native import binding, core_types
from glint.engine.scene.panorama import PROJECTIONS
from native_tools import needs_core

ROOT = Path(__file__).parents[2]
HEADER = ROOT / "engine/core/include/glint.h"


@pytest.fixture(scope="module")
def generator():
    sys.path.insert(0, str(ROOT / "packaging"))
    try:
        import core_types as module
    finally:
        sys.path.pop(0)
    return module


def test_the_module_is_what_the_header_makes(generator) -> None:
    made = generator.core_types(HEADER.read_text())
    assert generator.TARGET.read_text() == made, "run python packaging/core_types.py"


def c_names(structure: type) -> list[str]:
    """A structure's names in C: two where one stands for both precisions."""
    name, header = structure.__name__.removesuffix("Data"), HEADER.read_text()
    names = [f"Glint{name}{end}" for end in ("", "Data", "F32", "F64")]
    return [name for name in names if f"}} {name};" in header]


def layout(structure: type) -> list[str]:
    """What a compiler must agree to: sizes and offsets."""
    told = []
    for name in c_names(structure):
        told.append(f"sizeof({name}) == {ctypes.sizeof(structure)}")
        for field, _ in structure._fields_:
            place = getattr(structure, field)
            told.append(f"offsetof({name}, {field}) == {place.offset}")
            told.append(f"sizeof((({name}*)0)->{field}) == {place.size}")
    return told


def test_a_compiler_lays_the_structures_out_alike(tmp_path: Path) -> None:
    values = vars(core_types).values()
    structures = [
        value for value in values if isinstance(value, type) and issubclass(value, ctypes.Structure)
    ]
    told = [line for structure in structures for line in layout(structure)]
    assert len(told) > 300
    assert compiles(told, tmp_path)
    assert not compiles([*told, "sizeof(GlintCamera) == 8"], tmp_path)


def compiles(told: list[str], folder: Path) -> bool:
    source = folder / "layout.c"
    asserts = "\n".join(f'_Static_assert({line}, "");' for line in told)
    source.write_text(f"#include <glint.h>\n{asserts}\n")
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    command = [compiler, "-std=c11", "-fsyntax-only", f"-I{HEADER.parent}", source]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_constants_have_the_headers_values(tmp_path: Path) -> None:
    """Every constant is found in C by its name, with or without the word of its enum."""
    header, told = HEADER.read_text(), []
    for enum in vars(core_types).values():
        if not (isinstance(enum, type) and issubclass(enum, IntEnum)) or enum is IntEnum:
            continue
        body = header[header.index(f"enum Glint{enum.__name__} {{") :].split("{")[1].split("}")[0]
        body = "".join(part.split("*/")[-1] for part in body.split("/*"))
        constants = [item.split("=")[0].strip() for item in body.split(",")]
        constants = [name for name in constants if name and name != "GLINT_PASS_COUNT"]
        for name, member in zip(constants, enum, strict=True):
            assert member.name in name
            told.append(f"(int){name} == {member.value}")
    assert compiles(told, tmp_path)


@pytest.mark.parametrize(
    ("names", "enum"),
    [
        ((scene.POINT, scene.CORNER, scene.FACE), core_types.Domain),
        (scene.ENCODINGS, core_types.Encoding),
        (scene.EXTENSIONS, core_types.Extension),
        (scene.INTERPOLATIONS, core_types.Interpolation),
        (scene.CHANNELS, core_types.Channel),
        (KINDS, core_types.LobeKind),
        (scene.LIGHTS, core_types.LightKind),
        (scene.CAMERAS, core_types.CameraKind),
        (PROJECTIONS, core_types.Projection),
        (settings.ILLUMINATIONS, core_types.Illumination),
        (settings.BUILDS, core_types.Build),
        (
            [
                *(name.upper().replace(" ", "_") for name in film.PASSES),
                film.AOV.strip(),
                "LIGHT_GROUPS",
            ],
            core_types.Pass,
        ),
    ],
)
def test_the_core_knows_every_name_of_the_values(names, enum: type[IntEnum]) -> None:
    assert set(names) == set(enum.__members__)


@needs_core
def test_a_core_of_another_version_is_refused_with_the_remedy(monkeypatch) -> None:
    """A Blender that goes on after an update has the old one loaded."""
    import glint_core

    path = str(glint_core.library_path())
    found = core_types.ABI_VERSION
    monkeypatch.setattr(core_types, "ABI_VERSION", found + 1)
    said = f"speaks version {found} .* this is version {found + 1}: .* restart Blender"
    with pytest.raises(ImportError, match=said):
        binding._load.__wrapped__(path)
