"""Picture files that are cut off, as on a full disk, are told from whole ones; whatever Blender
says.
"""

from blender_process import REGISTER_TREE, Blender

DRAW = (
    REGISTER_TREE
    + """
import resource, signal, sys
from glint.operators import command_line
from glint.operators.pictures import check_whole
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 40, 37, 100
scene.glint.final.samples = scene.glint.final.light_samples = 1
image = scene.render.image_settings

def full_disk():
    sys.dont_write_bytecode = True  # it would be cut off
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1500, resource.RLIM_INFINITY))

def is_whole(path):
    try:
        check_whole(path)
    except OSError:
        return False
    return True
"""  # noqa: E501 - a script for another Blender
)


def test_every_cut_of_every_kind_of_file_is_seen(tmp_path):
    run = Blender(tmp_path).run(
        DRAW
        + """
codecs = ("NONE", "ZIP", "ZIPS", "PIZ", "PXR24", "DWAA", "DWAB", "RLE")
kinds = {"PNG": ("",), "OPEN_EXR": codecs, "OPEN_EXR_MULTILAYER": ("ZIP", "PIZ")}
scene.view_layers.new("Second")
scene.view_layers[0].use_pass_normal = True
bpy.ops.render.render()
result = next(image for image in bpy.data.images if image.type == "RENDER_RESULT")
told = {}
for kind, codecs in kinds.items():
    for codec in codecs:
        if hasattr(image, "media_type"):
            image.media_type = "MULTI_LAYER_IMAGE" if "MULTI" in kind else "IMAGE"
        image.file_format = kind
        if codec:
            image.exr_codec = codec
        path = FOLDER / f"{kind}_{codec}.picture"
        result.save_render(str(path), scene=scene)
        told[path.name] = [is_whole(path)]
        data = path.read_bytes()
        for size in (*range(0, len(data), max(1, len(data) // 50)), len(data) - 1):
            path.write_bytes(data[:size])
            told[path.name].append(is_whole(path))
full_disk()
bpy.ops.render.render()
told["full disk"] = [not (FOLDER / "full.exr").exists()]
result.save_render(str(FOLDER / "full.exr"), scene=scene)
told["full disk"].append(is_whole(FOLDER / "full.exr"))
answer(told)
"""
    )
    assert run.returncode == 0, run.output
    assert len(run.answer) == 12
    for name, (whole, *cut) in run.answer.items():
        assert whole and not any(cut), f"{name}: {whole} {cut}"


def test_a_full_disk_is_no_success(tmp_path):
    run = Blender(tmp_path).run(
        DRAW
        + """
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "a.blend"))
full_disk()
answer(command_line.run(["target", str(FOLDER / "a.blend"), "--levels", "100", "--out", str(FOLDER / "a.exr")]))
"""  # noqa: E501 - a script for another Blender
    )
    assert run.answer == 2, run.output
    assert "a.exr is not whole" in run.output and "make room on its disk" in run.output


def test_a_render_to_a_full_disk_is_told(tmp_path):
    """Blender says FINISHED, of a still picture and of an animation; whole files get no word."""
    run = Blender(tmp_path).run(
        DRAW
        + """
from glint.addon.render import statistics

def notes(name, animation):
    scene.render.filepath, scene.frame_end = str(FOLDER / name), 1
    bpy.ops.render.render(write_still=True, animation=animation)
    return [note for note in statistics.of_last_render(scene.name).notes if "not whole" in note]

kinds = [("PNG", False), ("PNG", True), ("OPEN_EXR", False), ("OPEN_EXR", True)]
told = []
for room in ("enough", "none"):
    for kind, animation in kinds:
        image.file_format = kind
        told.append(notes(f"{room}_{kind}_{animation}_", animation))
    full_disk()
answer(told)
"""
    )
    assert run.returncode == 0, run.output
    assert [len(notes) for notes in run.answer] == [0] * 4 + [1] * 4, run.answer
    assert all("make room on its disk" in note for [note] in run.answer[4:])
    assert run.output.count("not whole") >= 4, "the log has it, too"


def test_a_cut_picture_is_not_verified(tmp_path):
    run = Blender(tmp_path).run(
        DRAW
        + """
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "a.blend"))
image.file_format = "OPEN_EXR"
scene.render.filepath = str(FOLDER / "a.exr")
bpy.ops.render.render(write_still=True)
path = FOLDER / "a.exr"
path.write_bytes(path.read_bytes()[:-100])
answer(command_line.run(["verify", str(path)]))
"""
    )
    assert run.answer == 2, run.output
    assert "a.exr is not whole" in run.output
