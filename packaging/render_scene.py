"""`make render`: sets everything up, installs the extension as a user would, and renders a .blend
file, or the demo, with Glint.

Run by any Python 3.11 it prepares the environment and starts itself there; inside (bpy) it renders.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

import environment
import extension_zips
import install_extension
import tree


def main() -> int:
    options = _options()
    if options.inside:
        install_extension.install(Path(options.inside))
        return _render(options)
    blender = environment.prepare(options.bpy)
    zip_path = extension_zips.full_zip(blender)
    arguments = [
        f"--inside={zip_path}",
        f"--out={options.out}",
        f"--scene={options.scene}",
        f"--frame={options.frame}",
    ]
    variables = {**os.environ, "BLENDER_USER_RESOURCES": str(blender.resources)}
    install_extension.make_way(zip_path, blender.resources)
    return subprocess.run([blender.interpreter, __file__, *arguments], env=variables).returncode


def _options() -> argparse.Namespace:
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="", help="which Blender, as in environment.py")
    parser.add_argument("--scene", default="", help=".blend file; the demo when empty")
    parser.add_argument(
        "--frame", default="", help="frame number; the file's current one when empty"
    )
    parser.add_argument("--out", default="out", help="folder for the pictures")
    parser.add_argument(
        "--inside", default="", help="this is bpy or Blender: install this zip and render"
    )
    return parser.parse_args(arguments)


def _render(options: argparse.Namespace) -> int:
    import bpy

    name = _open(options.scene)
    scene = bpy.context.scene
    scene.render.engine = "GLINT"
    if not any(layer.use for layer in scene.view_layers):
        raise tree.SetupError(
            f"SCENE={options.scene}: none of its view layers is rendered: switch on Use for "
            "Rendering in the View Layer properties"
        )
    if options.frame:
        name = f"{name}_{_show_frame(scene, options.frame):04d}"
    out = _folder(options.out)
    seconds = _write_pictures(scene, out / f"{name}.exr", out / f"{name}.png")
    _tell(scene, [out / f"{name}.png", out / f"{name}.exr"], seconds)
    return 0


def _show_frame(scene, text: str) -> int:
    """Go to the frame of this number, which Blender would cut in silence where it is too far."""
    try:
        frame = int(text)
        scene.frame_set(frame)
    except (ValueError, OverflowError):
        frame = None
    if scene.frame_current != frame:
        raise tree.SetupError(f"FRAME={text}: use a whole number of at most 1048574")
    return frame


def _folder(text: str) -> Path:
    """The folder for the pictures, which is made where there is none."""
    out = Path(text).resolve()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise tree.SetupError(f"OUT={text}: there can be no folder: {error.strerror}") from error
    return out


def _open(path: str) -> str:
    """Open the file, or make the demo; returns the stem for the pictures' names."""
    import bpy

    if not path:
        from bl_ext.user_default.glint.operators.demo_scene import build_demo_scene

        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        build_demo_scene()
        return "demo"
    if not Path(path).is_file():
        raise tree.SetupError(f"SCENE={path}: there is no such file.")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(Path(path).resolve()), load_ui=False)
    except RuntimeError as error:
        raise tree.SetupError(f"SCENE={path}: Blender cannot open it: {error}") from error
    return Path(path).stem


def _write_pictures(scene, exr: Path, png: Path) -> float:
    """Render once into a multilayer EXR, then save the same result as PNG; returns the seconds
    altogether.
    """
    import bpy
    from bl_ext.user_default.glint.operators import pictures

    start = time.perf_counter()
    for path in (exr, png):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise tree.SetupError(f"{path} cannot be replaced: {error.strerror}") from error
    _set_format(scene, "OPEN_EXR_MULTILAYER", "32")
    scene.render.filepath = str(exr)
    scene.render.use_file_extension = True
    try:
        bpy.ops.render.render(write_still=True)
    except RuntimeError as error:
        raise tree.SetupError(f"the render failed: {error}") from error
    _set_format(scene, "PNG", "8")
    try:
        pictures.render_result().save_render(str(png), scene=scene)
        for path in (exr, png):
            pictures.check_whole(path)
    except (RuntimeError, OSError) as error:
        raise tree.SetupError(f"the picture was rendered, but not written: {error}") from error
    return time.perf_counter() - start


def _set_format(scene, file_format: str, depth: str) -> None:
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE" if "MULTILAYER" in file_format else "IMAGE"
    image.file_format = file_format
    image.color_mode = "RGBA"
    image.color_depth = depth


def _tell(scene, pictures: list[Path], seconds: float) -> None:
    """Where the pictures are, seconds per stage of all view layers together, what the scene
    required.
    """
    from bl_ext.user_default.glint.addon.render import statistics

    layers = statistics.by_layer(scene.name)
    if not layers:
        raise tree.SetupError(
            "Blender did not ask Glint for a picture: the file's video sequencer or compositor "
            "made one; switch off Post Processing in the Output properties"
        )
    stages = {
        stage: sum(layer.seconds[stage] for layer in layers.values())
        for stage in ("sync", "build", "trace")
    }
    stages["write"] = seconds - sum(stages.values())
    for path in pictures:
        print(f"picture   {path}")
    print("stages    " + ", ".join(f"{stage} {value:.3f} s" for stage, value in stages.items()))
    for name, layer in layers.items():
        print(f"required  {layer.scene_line}" + (f" ({name})" if len(layers) > 1 else ""))


if __name__ == "__main__":
    tree.main(main)
