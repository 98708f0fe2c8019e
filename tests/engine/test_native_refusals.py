"""The core's boundary: what it refuses with a sentence, what it leaves out and counts, and how
arrays get there.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint import engine
from glint.engine import scene as s
from glint.engine.native import binding, core_types, packing
from glint.engine.native.render import render_native
from glint.engine.settings import DECLARED
from native_tools import IDENTITY, draw, lamp, material, needs_core, placed
from sound_scene import MESH, SOUND

pytestmark = needs_core


def refusal(scene: s.Scene, **settings) -> str:
    """The text with which the core itself, past Python's checks, refuses a scene."""
    with pytest.raises(engine.SceneError) as error:
        render_native(scene, engine.Settings(samples=1, **settings))
    return str(error.value)


def mesh_with(**changes: object) -> s.Scene:
    return replace(SOUND, geometries=(replace(MESH, **changes),))


def polygons(offsets: list[int], indices: list[int]) -> s.Scene:
    return replace(
        SOUND, geometries=(s.Polygons("p", MESH.vertices, np.uint32(offsets), np.uint32(indices)),)
    )


def lobe_with(**changes: object) -> s.Scene:
    return replace(SOUND, materials=(material(replace(s.Lobe("DIFFUSE"), **changes)),))


BAD = {
    "a triangle names vertex 9 of 4": mesh_with(triangles=np.array([[0, 1, 9]], np.uint32)),
    "vertices has the shape (4, 2)": mesh_with(vertices=np.zeros((4, 2), np.float32)),
    "material_slots has the shape (7,)": mesh_with(material_slots=np.zeros(7, np.uint16)),
    "normals has 2 rows but 4 are read": mesh_with(
        normals=s.Attribute("n", s.POINT, np.zeros((2, 3), np.float32))
    ),
    "normals on corners but no corners": mesh_with(
        normals=s.Attribute("n", s.CORNER, np.zeros((6, 3), np.float32))
    ),
    "an attribute has 1 rows but 2 are read": mesh_with(
        attributes=(s.Attribute("a", s.FACE, np.zeros((1, 4), np.float32)),)
    ),
    "with domain 0 and 9 channels": mesh_with(
        attributes=(s.Attribute("a", s.POINT, np.zeros((4, 9), np.float32)),)
    ),
    "instances 0: geometry 3 of 1": replace(SOUND, instances=(placed(3),)),
    "instances name material 5 of 1": replace(SOUND, instances=(placed(0, (5,)),)),
    "world_from_object has the shape (1, 4, 4)": replace(
        SOUND, instances=(replace(placed(), world_from_object=np.zeros((1, 4, 4))),)
    ),
    "input 0: texture 0 of 0": lobe_with(factors=(s.Input(texture=0),)),
    "its ior -1 is not between 1e-30 and 1e+30": lobe_with(kind="MIRROR", ior=-1.0),
    "exponent nan is not between": lobe_with(exponent=np.nan),
    "lobe kind 'SHINY' is not one of": lobe_with(kind="SHINY"),
    "texture 0: no pixels": replace(
        SOUND, textures=(s.Texture("empty", np.zeros((0, 3, 4), np.float32)),)
    ),
    "camera: a number is not finite": replace(
        SOUND, camera=replace(SOUND.camera, window=(0.0, np.inf, 0.0, 1.0))
    ),
    "camera: clip from 2 to 1": replace(
        SOUND, camera=replace(SOUND.camera, clip_start=2.0, clip_end=1.0)
    ),
    "camera: resolution 0 by 9": replace(SOUND, camera=replace(SOUND.camera, resolution=(0, 9))),
    "light kind 'LASER' is not one of": replace(
        SOUND, lights=(replace(SOUND.lights[0], kind="LASER"),)
    ),
    "offsets do not rise": polygons([0, 9], [0, 1, 2, 3]),
    "a polygon names vertex 8 of 4": polygons([0, 3], [0, 1, 8]),
    "spheres have a row of attributes each": replace(
        SOUND,
        geometries=(
            s.Spheres(
                "s",
                np.zeros((1, 3), np.float32),
                np.ones(1, np.float32),
                attributes=(s.Attribute("a", "POINT", np.ones((1, 4), np.float32)),),
            ),
        ),
    ),
    "radii has the shape (2,)": replace(
        SOUND, geometries=(s.Spheres("s", np.zeros((1, 3), np.float32), np.ones(2, np.float32)),)
    ),
}


@pytest.mark.parametrize("text", BAD)
def test_bad_scenes_are_refused_with_a_sentence(text: str) -> None:
    assert text in refusal(BAD[text])


def test_bad_settings_are_refused_with_a_sentence() -> None:
    assert "beyond the frame" in refusal(SOUND, region=(0, 0, 17, 16))
    assert "is empty" in refusal(SOUND, region=(3, 0, 3, 16))
    assert "cutoff is not between 0 and 1" in refusal(SOUND, cutoff=float("nan"))
    assert "more than 64 bounces" in refusal(SOUND, max_bounces=65)
    assert "no such pass: Heat" in refusal(SOUND, passes=frozenset({"Heat"}))


@pytest.mark.parametrize("name", ["error_threshold", "lamp_shadows", "max_bounces", "cutoff"])
def test_the_core_takes_the_declared_range_and_no_more(name: str) -> None:
    """Its check stands by itself: other hosts do not ask `Settings.problems`."""
    declared = DECLARED[name]
    for end in (declared.low, declared.high):
        render_native(SOUND, engine.Settings(samples=1, **{name: type(declared.default)(end)}))
    assert "settings: " in refusal(SOUND, **{name: declared.high + 1})


def test_memory_that_cannot_be_had_is_named() -> None:
    huge = replace(SOUND, camera=replace(SOUND.camera, resolution=(1 << 20, 1 << 20)))
    with pytest.raises(
        MemoryError, match=r"1048576 by 1048576 pixels with 4 channels needs 52776\.6 GB"
    ):
        render_native(huge, engine.Settings(samples=1))


def test_many_problems_are_all_told() -> None:
    lobes = tuple(s.Lobe("MIRROR", ior=-1.0) for _ in range(30))
    text = refusal(replace(SOUND, materials=(material(*lobes),)))
    assert len(text.splitlines()) == 21
    assert text.endswith("and 10 more")


def test_bad_faces_are_left_out_and_counted() -> None:
    """N6: the picture without them, and a note."""
    vertices = np.concatenate(
        [MESH.vertices, np.float32([[np.nan, 0, 1], [0, np.inf, 1], [0.5, 0.5, 1], [0, 0, 1]])]
    )
    triangles = np.concatenate([MESH.triangles, np.uint32([[0, 1, 4], [5, 6, 7], [6, 6, 7]])])
    bad = mesh_with(vertices=vertices, triangles=triangles, attributes=())
    film = draw(bad)
    assert np.array_equal(film.combined, draw(SOUND).combined)
    assert film.stats["dropped primitives"] == 3
    (note,) = film.notes
    assert note.startswith("3 faces") and "'placed 0'" in note and "repair the mesh" in note


def test_bad_instances_and_lights_are_left_out_and_counted() -> None:
    """Past Python's checks, which names them: NaN, and a matrix of rank 1."""
    matrices = np.repeat(IDENTITY[None], 3, 0)
    matrices[1, 0, 0], matrices[2, :, :3] = np.nan, np.diag([1, 0, 0])
    lights = (SOUND.lights[0], lamp("POINT", strength=np.nan))
    many = replace(SOUND, instances=(replace(placed(), world_from_object=matrices),), lights=lights)
    film = render_native(many, engine.Settings(samples=1, light_samples=1))
    assert np.array_equal(film.combined, draw(SOUND).combined)
    assert (film.stats["dropped instances"], film.stats["dropped lights"]) == (2, 1)
    assert [note.split(" have ")[0] for note in film.notes] == [
        "2 instances of 'placed 0'",
        "1 lights of 'point'",
    ]


# --- the binding
# --------------------------------------------------------------------------------------------------


def test_arrays_that_fit_are_lent_not_copied() -> None:
    """Addresses that the core gets are those of the scene's arrays."""
    packed = packing.pack_scene(SOUND)
    first = core_types.GeometryData.from_address(packed.data.geometries)
    assert first.vertices == MESH.vertices.ctypes.data
    assert first.triangles == MESH.triangles.ctypes.data
    assert packed.data.world_from_object == SOUND.instances[0].world_from_object.ctypes.data


def test_arrays_of_other_layouts_are_converted() -> None:
    wide = replace(
        MESH,
        vertices=np.asfortranarray(MESH.vertices.astype(float)),
        triangles=MESH.triangles.astype(np.int64)[:, ::1],
    )
    film = render_native(
        replace(SOUND, geometries=(wide,)), engine.Settings(samples=1, light_samples=1)
    )
    assert np.array_equal(film.combined, draw(SOUND).combined)


def test_a_hundred_thousand_instances_are_packed_as_rows() -> None:
    matrices = np.repeat(IDENTITY[None], 100_000, 0)
    scene = replace(SOUND, instances=(placed(), s.Instances("many", 0, matrices, (0,))))
    packed = packing.pack_scene(scene)
    assert packed.data.row_count == 100_001


def test_missing_library_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(binding.LIBRARY_VARIABLE, str(tmp_path / "nowhere.so"))
    assert "nowhere.so" in binding.load_error()
    assert engine.available_backends() == ("NUMPY",)


@needs_core
@pytest.mark.parametrize("damage", ["cut", "zeros", "none"])
def test_a_damaged_library_is_not_loaded(tmp_path: Path, damage: str) -> None:
    """It would end the process with a bus error or a crash; the NumPy tracer draws instead."""
    import glint_core

    package = Path(glint_core.__file__).parent
    for folder in (package, *package.parent.glob("glint_core-*.dist-info")):
        shutil.copytree(folder, tmp_path / folder.name)
    library = tmp_path / package.name / glint_core.library_path().name
    data = library.read_bytes()
    half = len(data) // 2
    kept = {"cut": data[:half], "zeros": data[:half] + bytes(len(data) - half), "none": data}
    library.write_bytes(kept[damage])
    tests = Path(__file__).resolve().parent.parent
    program = f"""
import sys
sys.path[:0] = [{str(tmp_path)!r}, {str(tests)!r}]
import glint_tree
from glint import engine
print(engine.native_error())
print(engine.available_backends())
"""
    installed = {
        name: text for name, text in os.environ.items() if name != binding.LIBRARY_VARIABLE
    }
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=installed
    )
    assert done.returncode == 0, done.stderr
    error, backends = done.stdout.splitlines()
    if damage == "none":
        assert error == "None" and "NATIVE" in backends
    else:
        assert str(library) in error and error.endswith(": install Glint again")
        assert backends == "('NUMPY',)"
