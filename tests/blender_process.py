"""Runs small Python programs in a Blender of their own: the bpy of this environment, or a whole
Blender program.

GLINT_BLENDER="blender" or "chroot DIR blender" in the environment picks a program;
GLINT_BLENDER_ROOT=DIR says where its "/" is.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from glint_tree import BYTECODE, ROOT

# Makes the tree importable as `glint`, as tests/glint_tree.py does. The process then leaves without
# Blender's own clean-up: bpy 4.2 crashes there once a property with an update function was
# registered outside an add-on (it frees panels after Python has gone).
REGISTER_TREE = f"""
import atexit, os, sys, traceback
sys.path.insert(0, {str(ROOT / "tests")!r})
import glint_tree
import glint

exit_code = 0

def fail(*error):
    global exit_code
    exit_code = 1
    traceback.print_exception(*error)

def leave():
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(exit_code)

sys.excepthook = fail
atexit.register(leave)
glint.register()
"""
COMPOSITOR = """
if hasattr(scene, "compositing_node_group"):
    tree = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    output = tree.nodes.new("NodeGroupOutput")
else:
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("CompositorNodeComposite")
"""
"""An empty compositor of `scene` and its output, before Blender 5.0 and since."""
PUT = """
def put(name, data, *place):
    thing = bpy.data.objects.new(name, data)
    thing.location = place
    scene.collection.objects.link(thing)
    return thing
"""
"""`put`: a thing into `scene`."""

PUT_AND_LOOK = (
    PUT
    + """
def box(name, size, *place):
    mesh, (x, y, z) = bpy.data.meshes.new(name), [side / 2 for side in size]
    corners = [(i, j, k) for i in (-x, x) for j in (-y, y) for k in (-z, z)]
    mesh.from_pydata(corners, [], [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    return put(name, mesh, *place)

def look(thing, kind, output="Surface", **values):
    material = bpy.data.materials.new(thing.name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node, end = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
    for name, value in values.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[0], end.inputs[output])
    thing.data.materials.append(material)
    return thing
"""  # noqa: E501 - a script for another Blender
)
"""`put`, `box`: one with a mesh, and `look`: gives it a material of one node."""
ANSWER = "ANSWER "


@dataclass(frozen=True)
class Run:
    """How a program ended."""

    returncode: int
    output: str

    @property
    def answer(self) -> object:
        """What the program gave to `answer()`."""
        lines = [line for line in self.output.splitlines() if line.startswith(ANSWER)]
        assert lines, f"the program gave no answer:\n{self.output}"
        return json.loads(lines[-1].removeprefix(ANSWER))


class Blender:
    """A Blender to start again and again. folder: where its files are kept, as seen from here."""

    def __init__(self, folder: Path | None = None) -> None:
        self.program = shlex.split(os.environ.get("GLINT_BLENDER", ""))
        self.root = Path(os.environ.get("GLINT_BLENDER_ROOT", "/"))
        self.folder = (
            folder
            if folder and self.root == Path("/")
            else Path(tempfile.mkdtemp(prefix="glint-", dir=self.root / "tmp"))
        )

    def inside(self, path: Path) -> str:
        """A path as the Blender sees it."""
        return "/" + str(path.relative_to(self.root))

    def run(self, program: str, *arguments: str, timeout: float = 300.0) -> Run:
        """Run the text of a program. It may call `answer(value)` with anything that JSON knows;
        FOLDER is `self.folder`.
        """
        script = self.folder / f"program_{len(list(self.folder.glob('program_*')))}.py"
        prelude = (
            f"import json, pathlib, bpy\nFOLDER = pathlib.Path({self.inside(self.folder)!r})\n"
        )
        prelude += f"def answer(value):\n    print({ANSWER!r} + json.dumps(value), flush=True)\n"
        script.write_text(prelude + program)
        return self.start([*self._python_command(), self.inside(script), *arguments], timeout)

    def start(self, command: list[str], timeout: float = 300.0) -> Run:
        """Run a command line with this Blender's own folder of settings."""
        return finish(self.launch(command), timeout)

    def launch(self, command: list[str]) -> subprocess.Popen[str]:
        """Start a command line with this Blender's own folder of settings, and do not wait for
        it.
        """
        resources = self.folder / "resources"
        resources.mkdir(exist_ok=True)
        variables = {
            **os.environ,
            "BLENDER_USER_RESOURCES": self.inside(resources),
            **BYTECODE,
        }
        return subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=variables,
            cwd=self.folder,
        )

    def _python_command(self) -> list[str]:
        return (
            [*self.program, "-b", "--python-exit-code", "1", "-P"]
            if self.program
            else [sys.executable]
        )


def finish(process: subprocess.Popen[str], timeout: float) -> Run:
    """Wait for a program's end; one that takes longer than `timeout` seconds is killed, and
    TimeoutExpired holds what it said.
    """
    try:
        output, _ = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired as late:
        process.kill()
        late.output, _ = process.communicate()
        raise
    return Run(process.returncode, output)
