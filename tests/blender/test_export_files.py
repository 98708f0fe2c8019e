"""The export of real files by other people: sound scenes, notes that make sense, and every triangle
that Blender has.
"""

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"
FILES = (
    [row["file"] for row in csv.DictReader((SCENES / "MANIFEST.csv").open())]
    if SCENES.is_dir()
    else []
)
PROGRAM = """
import json, sys
import bpy
sys.path[:0] = [sys.argv[1], sys.argv[2]]
import glint_tree, make_blend
from glint.addon.export import export_scene
from glint.engine.scene.problems import scene_problems

make_blend.load(sys.argv[3])
make_blend.ensure()
depsgraph = bpy.context.evaluated_depsgraph_get()
export = export_scene(depsgraph, width=64, height=64, passes=frozenset({"UV"}))

triangles = 0
for instance in depsgraph.object_instances:
    thing = instance.object
    if thing.type != "MESH" or not instance.show_self:
        continue
    owner = instance.instance_object or thing
    mesh = owner.to_mesh() if thing.data.is_editmode else thing.data
    mesh.calc_loop_triangles()
    triangles += len(mesh.loop_triangles)
    owner.to_mesh_clear()
print("RESULT " + json.dumps({
    "problems": scene_problems(export.scene), "notes": export.notes, "placed": export.stats["placed_triangles"], "triangles": triangles,
    "lights": len(export.scene.lights), "camera": export.scene.camera.kind,
}), flush=True)
import os
os._exit(0)
"""  # noqa: E501 - a script for another Blender
NEWER = {
    "khronos_pointcloud/38_pointcloud_object.blend": (5, 0),
    "khronos_node_groups/22_node_groups.blend": (5, 0),
}
"""Files whose format is newer than these Blenders."""


@pytest.mark.slow
@pytest.mark.skipif(not FILES, reason="the scenes of ../shared/scenes are not here")
@pytest.mark.parametrize("file", FILES)
def test_a_real_file_exports_soundly(file):
    import bpy

    if bpy.app.version[:2] < NEWER.get(file, (0, 0)):
        pytest.skip("saved by a newer Blender")
    arguments = [
        sys.executable,
        "-c",
        PROGRAM,
        str(Path(__file__).parents[1]),
        str(SCENES),
        str(SCENES / file),
    ]
    run = subprocess.run(arguments, capture_output=True, text=True, timeout=300, check=False)
    lines = [line for line in run.stdout.splitlines() if line.startswith("RESULT ")]
    assert lines, run.stdout + run.stderr
    result = json.loads(lines[-1].removeprefix("RESULT "))
    assert result["problems"] == []
    assert result["placed"] == result["triangles"]
    assert len(result["notes"]) == len(set(result["notes"])) <= 8
    assert all("{}" not in note and "magenta" not in note for note in result["notes"])
