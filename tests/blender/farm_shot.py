"""A small scene in a folder of its own, and a program that stands for Blender and draws its
frames.
"""

from __future__ import annotations

import sys
from pathlib import Path

from blender_process import COMPOSITOR, REGISTER_TREE, Blender, Run

# What stands for the program `blender`: the bpy of this environment with the tree as its add-on.
PROGRAM = (
    f"#!{sys.executable}\nimport bpy\n"
    + REGISTER_TREE
    + """
from glint.operators import command_line
assert sys.argv[1:4] == ["-b", "--command", "glint"], sys.argv
exit_code = command_line.run(sys.argv[4:])
sys.exit(exit_code)
"""
)

MAKE = (
    REGISTER_TREE
    + """
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 24, 16, 100
scene.glint.final.samples = scene.glint.final.light_samples = 1
scene.glint.final.backend = "NATIVE"
image = scene.render.image_settings
if hasattr(image, "media_type"):
    image.media_type = "IMAGE"
image.file_format = "OPEN_EXR"
cube = bpy.data.objects["Cube"]
cube.keyframe_insert("location", frame=1)
cube.location.x = 1.0
cube.keyframe_insert("location", frame=5)
"""  # noqa: E501 - a script for another Blender
)
SAVE = 'bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "shot.blend"))\n'


class Shot:
    """A scene in a folder, and the program that draws it."""

    def __init__(self, folder: Path) -> None:
        self.blender, self.folder, self.out = Blender(folder), folder, folder / "frames"
        self.program = folder / "blender"
        self.program.write_text(PROGRAM)
        self.program.chmod(0o755)

    def make(self, more: str = "") -> None:
        run = self.blender.run(MAKE + more + SAVE)
        assert run.returncode == 0, run.output

    def command(self, *words: str) -> list[str]:
        return [str(self.program), "-b", "--command", "glint", *words]

    def glint(self, *words: str, **options: object) -> Run:
        return self.blender.start(self.command(*words), **options)

    def frames(self, numbers: str, *more: str) -> Run:
        blend = str(self.folder / "shot.blend")
        return self.glint("frames", blend, numbers, "--out", str(self.out), *more)

    @property
    def names(self) -> list[str]:
        """Of all files that are there, hidden ones too."""
        return sorted(path.name for path in self.out.iterdir()) if self.out.exists() else []


# The picture is blurred, and written to files of its own too.
COMPOSITED = (
    COMPOSITOR
    + """
layers = tree.nodes.new("CompositorNodeRLayers")
blur = tree.nodes.new("CompositorNodeBlur")
if "Size" in blur.inputs and blur.inputs["Size"].type == "VECTOR":
    blur.inputs["Size"].default_value = (3.0, 3.0)
else:
    blur.size_x = blur.size_y = 3
tree.links.new(layers.outputs["Image"], blur.inputs["Image"])
tree.links.new(blur.outputs["Image"], output.inputs["Image"])
files = tree.nodes.new("CompositorNodeOutputFile")
if hasattr(files, "directory"):
    files.directory, files.file_name = str(FOLDER / "composited"), "soft"
    files.file_output_items.new("RGBA", "Image")
else:
    files.base_path = str(FOLDER / "composited")
tree.links.new(blur.outputs["Image"], files.inputs[0])
"""
)
