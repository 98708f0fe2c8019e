"""Tiles of frames: together they are the frame that is drawn whole, to the bit, in every pass and
every kind of file; and nothing is merged that is not the scene's.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

pytest.importorskip("bpy")
from farm_shot import COMPOSITED, MAKE, Shot
from glint.engine import TILE_SIDE
from glint.engine.film import Film
from glint.operators.pictures import header_texts, read_planes
from glint.operators.tiles import Grid, merge

EVERY_PASS = """
if hasattr(image, "media_type"):
    image.media_type = "MULTI_LAYER_IMAGE"
image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
layer = scene.view_layers[0]
for name in ("z", "mist", "position", "normal", "vector", "uv", "object_index", "material_index",
             "emit", "environment", "ambient_occlusion", "diffuse_direct", "diffuse_indirect",
             "glossy_direct", "cryptomatte_object", "cryptomatte_material", "cryptomatte_asset"):
    setattr(layer, "use_pass_" + name, True)
for name in ("diffuse", "shadow", "error", "samples"):
    setattr(layer.glint, "use_pass_" + name, True)
other = scene.view_layers.new("Other")
other.use_pass_cryptomatte_object, other.pass_cryptomatte_depth = True, 2
second = cube.copy()
second.name, second.location = 'the "second"', (1.5, 1.0, 0.5)
scene.collection.objects.link(second)
aov = layer.aovs.add()
aov.name, aov.type = "tint", "COLOR"
"""
BLURRED = "scene.render.use_motion_blur = True\n"
PNG = """
image.file_format, image.color_depth = "PNG", "8"
scene.render.dither_intensity = 1.0
"""
HALF = 'image.color_depth = "16"\n'
BORDER = """
scene.render.use_border = True
scene.render.border_min_x, scene.render.border_max_x = 0.2, 0.9
scene.render.border_min_y, scene.render.border_max_y = 0.1, 0.7
"""
CROPPED = BORDER + "scene.render.use_crop_to_border = True\n"
STEREO = """
scene.render.use_multiview = True
image.views_format = "STEREO_3D"
"""
REFINED = """
scene.glint.final.samples, scene.glint.final.error_threshold = 16, 1.0
scene.render.resolution_x, scene.render.resolution_y = 400, 280
scene.glint.final.backend = "NATIVE"
"""

BOTH = """
import time
from pathlib import Path
from glint.operators import farm
from glint.operators.tiles import Grid
whole, parts, grid = FOLDER / "whole", FOLDER / "parts", Grid(3, 2)
bpy.data.filepath or bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "shot.blend"))
lines = [*farm.draw_frames(scene, [3], whole)]
for tile in range(1, 7):
    lines += farm.draw_tiles(scene, [3], parts, grid, tile)
for path in sorted(parts.iterdir()):
    (FOLDER / "kept" / path.name).parent.mkdir(exist_ok=True)
    (FOLDER / "kept" / path.name).write_bytes(path.read_bytes())
lines += farm.merge_frames(scene, [3], parts, grid)
lines += [line for _, line in farm.check_frames(scene, [3], parts)]
from glint.operators.scene_copy import read_job
from glint.operators.tiles import whole_region
region = whole_region(read_job(scene, scene.view_layers[0].name))
answer([lines, sorted(path.name for path in parts.iterdir()), region])
"""

OF_THE_RENDER = ("seconds", "RenderTime", "Date", "DateTime")
"""Texts that tell when a picture was made and how long it took; the others tell what it is."""
RAYS = re.compile(r"\b[\d ]+ rays")
"""In the text that tells what was rendered: tiles trace some pixels along their borders twice, to
see where to refine."""


@pytest.mark.parametrize(("width", "height", "columns", "rows"), [(24, 16, 5, 3), (7, 9, 7, 1)])
def test_every_pixel_is_in_one_tile(width, height, columns, rows):
    grid, times = Grid(columns, rows), np.zeros((height, width), int)
    for tile in range(1, grid.count + 1):
        x0, y0, x1, y1 = grid.region(tile, (0, 0, width, height))
        times[y0:y1, x0:x1] += 1
    assert (times == 1).all()


def test_large_tiles_end_where_those_of_the_tracer_do():
    """Of which all is traced. Small ones are as large as each other."""
    whole, small = (10, 0, 1930, 1080), (0, 0, 180, 90)
    regions = [Grid(3, 2).region(tile, whole) for tile in range(1, 7)]
    cuts = {x for r in regions for x in (r[0], r[2])}, {y for r in regions for y in (r[1], r[3])}
    assert cuts == ({10, 640, 1280, 1930}, {0, 544, 1080})
    assert [Grid(3, 2).region(tile, small)[2] for tile in (1, 2, 3)] == [60, 120, 180]


def test_what_is_no_grid():
    assert Grid.parse("3x2") == Grid(3, 2) and str(Grid(3, 2)) == "3x2"
    for text in ("", "2", "0x1", "2x-1", "2×2", "1x1x1", "99999x1"):
        with pytest.raises(ValueError, match="2x2"):
            Grid.parse(text)
    with pytest.raises(ValueError, match="there are tiles 1 to 4"):
        Grid(2, 2).region(5, (0, 0, 8, 8))
    with pytest.raises(ValueError, match="8 by 1 pixels only"):
        Grid(2, 2).region(1, (0, 0, 8, 1))


def test_the_work_of_tiles_adds_up():
    """Rays and seconds do; what the scene is made of is the same in each."""
    regions, films = [(2, 5, 4, 8), (4, 5, 7, 8)], []
    for k, (x0, _, x1, _) in enumerate(regions):
        stats = {
            "rays": 10.0 + k,
            "shadow rays": 3.0,
            "trace": 0.5,
            "triangles": 12.0,
            "bytes": 9.0,
        }
        pixels = np.full((3, x1 - x0, 4), k, np.float32)
        films.append(Film({"Combined": pixels}, 8, True, stats, ("both", f"note {k}")))
    film = merge((2, 5, 7, 8), list(zip(regions, films, strict=True)))
    assert film.stats == {
        "rays": 21.0,
        "shadow rays": 6.0,
        "trace": 1.0,
        "triangles": 12.0,
        "bytes": 9.0,
    }
    assert film.notes == ("both", "note 0", "note 1") and film.samples == 8 and film.complete
    assert film.combined[..., 0].tolist() == [[0, 0, 1, 1, 1]] * 3


@pytest.mark.slow
@pytest.mark.parametrize(
    "more",
    [
        pytest.param(EVERY_PASS, id="passes"),
        pytest.param(EVERY_PASS.replace('"vector", ', "") + BLURRED + REFINED, id="blurred"),
        pytest.param(PNG + REFINED, id="png"),
        pytest.param(HALF + BORDER, id="border"),
        pytest.param(HALF + CROPPED, id="cropped"),
        pytest.param(STEREO, id="stereo"),
        pytest.param(COMPOSITED, id="composited"),
    ],
)
def test_tiles_are_the_whole_frame(tmp_path, more):
    shot = Shot(tmp_path)
    run = shot.blender.run(MAKE + more + BOTH)
    assert run.returncode == 0, run.output
    lines, names, region = run.answer
    assert lines[1:] == [
        *(f"frame 3, tile {tile} of 3x2: drawn (was missing)" for tile in range(1, 7)),
        "frame 3: merged (was missing)",
        "     3  verified",
    ]
    assert len(names) == 1, "the tiles are taken away"
    whole, merged = tmp_path / "whole" / names[0], tmp_path / "parts" / names[0]
    wanted, planes = read_planes(whole), read_planes(merged)
    assert {name: plane.tobytes() for name, plane in planes.items()} == {
        name: plane.tobytes() for name, plane in wanted.items()
    }
    assert _texts(merged) == _texts(whole)
    assert any(name.endswith(".pixels") for name in _texts(whole))
    assert any(name.endswith(".scene") for name in _texts(whole))
    traced = sum(_traced(Grid(3, 2).region(tile, region)) for tile in range(1, 7))
    assert _rays(whole) <= _rays(merged) < 1.5 * _rays(whole) * traced / _traced(region)
    if "cryptomatte" in more:
        assert sum("manifest" in name for name in _texts(whole)) == 4


def _texts(path: Path) -> dict[str, str]:
    return {
        name: RAYS.sub("rays", text) if name.endswith(".scene") else text
        for name, text in header_texts(path).items()
        if name.rpartition(".")[2] not in OF_THE_RENDER
    }


def _traced(region: tuple[int, int, int, int]) -> int:
    """Pixels of the squares of which the tracer takes all, where some pixel is the region's."""
    x0, y0, x1, y1 = region
    columns, rows = -(-x1 // TILE_SIDE) - x0 // TILE_SIDE, -(-y1 // TILE_SIDE) - y0 // TILE_SIDE
    return columns * rows * TILE_SIDE**2


def _rays(path: Path) -> int:
    """Of all layers and views."""
    texts = [text for name, text in header_texts(path).items() if name.endswith(".scene")]
    counts = [RAYS.search(text)[0].removesuffix("rays").replace(" ", "") for text in texts]
    return sum(map(int, counts))


@pytest.mark.slow
def test_other_programs_can_merge_tiles(tmp_path):
    """They lie at their places in the frame, under Blender's names of channels: OpenImageIO's paste
    (`oiiotool … --paste:all=1:mergeroi=1 +0+0`) makes the frame.
    """
    shot = Shot(tmp_path)
    run = shot.blender.run(MAKE + EVERY_PASS + BOTH)
    assert run.returncode == 0, run.output
    tiles, found = sorted((tmp_path / "kept").iterdir()), {}
    assert len(tiles) == 6
    for part in range(2):
        count = oiio.ImageBuf(str(tiles[0]), part, 0).nchannels
        canvas = oiio.ImageBuf(oiio.ImageSpec(24, 16, count, oiio.FLOAT))
        for tile in tiles:
            piece = oiio.ImageBuf(str(tile), part, 0)
            spec = piece.spec()
            assert (spec.full_width, spec.full_height) == (24, 16)
            assert oiio.ImageBufAlgo.paste(canvas, 0, 0, 0, 0, piece)
        pixels = canvas.get_pixels(oiio.FLOAT)
        found |= {name: pixels[..., k] for k, name in enumerate(spec.channelnames)}
    whole = read_planes(tmp_path / "whole" / "shot_0003.exr")
    shared = {name for name in whole if name in found}
    assert {"ViewLayer.Combined.R", "ViewLayer.Depth.Z", "Other.CryptoObject00.a"} <= shared
    assert len(shared) > 80
    for name in shared:
        assert np.flipud(found[name]).tobytes() == whole[name].tobytes(), name


@pytest.mark.slow
def test_only_tiles_of_the_scene_are_merged(tmp_path):
    """Missing, of another scene, with another pixel: each ends with a sentence and no frame."""
    shot = Shot(tmp_path)
    shot.make()
    blend, where = str(tmp_path / "shot.blend"), ["--out", str(shot.out), "--tiles", "2x1"]
    first = shot.frames("1-2", "--tiles", "2x1", "--tile", "1")
    assert first.returncode == 0 and "frame 2, tile 1 of 2x1: drawn" in first.output
    lacks = shot.glint("merge", blend, "1", *where)
    assert lacks.returncode == 2 and "tile 2 of 2x1 is missing" in lacks.output, lacks.output
    assert shot.names == ["shot_0001.2x1-1.exr", "shot_0002.2x1-1.exr"]
    shot.make("cube.location.z = 0.25\ncube.keyframe_insert('location', frame=5)\n")
    assert shot.frames("1-2", "--tiles", "2x1", "--tile", "2").returncode == 0
    other = shot.glint("merge", blend, "1-2", *where)
    assert other.returncode == 2 and "frame 1: merged" in other.output, "nothing moved there"
    assert "frame 2: tile 1 of 2x1 is of another geometry" in other.output
    again = shot.frames("1-2", "--tiles", "2x1", "--tile", "1")
    assert "frame 1, tile 1 of 2x1: there" in again.output
    assert "frame 2, tile 1 of 2x1: drawn (was of another geometry)" in again.output
    _change_a_pixel(shot.out / "shot_0002.2x1-1.exr")
    changed = shot.glint("merge", blend, "2", *where)
    assert changed.returncode == 2 and "has other pixels than were written" in changed.output
    assert "shot_0002.exr" not in shot.names


def _change_a_pixel(path: Path) -> None:
    picture = oiio.ImageBuf(str(path))
    x, y = picture.spec().x, picture.spec().y
    picture.setpixel(x, y, 0, np.asarray(picture.getpixel(x, y)) + 1)
    assert picture.write(str(path))


@pytest.mark.slow
def test_a_full_disk_leaves_no_tile(tmp_path):
    from farm_shot import PROGRAM

    shot = Shot(tmp_path)
    shot.make()
    full = (
        "import resource, signal, sys\nsys.dont_write_bytecode = True\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (900, resource.RLIM_INFINITY))\n"
    )
    shot.program.write_text(PROGRAM.replace("exit_code = command", full + "exit_code = command"))
    run = shot.frames("1", "--tiles", "2x1", "--tile", "1")
    assert run.returncode == 2 and "glint frames: " in run.output, run.output
    assert shot.names == []


@pytest.mark.slow
def test_a_job_of_tiles_runs_and_is_the_serial_render(tmp_path):
    """Run by the farm's own tool: two frames of four tiles, merged, then looked at."""
    shot = Shot(tmp_path)
    shot.make()
    blend = str(tmp_path / "shot.blend")
    options = ["--engine", "openjd", "--frames", "1-2", "--tiles", "2x2", "--out", str(shot.out)]
    made = shot.glint("job", blend, *options)
    assert made.returncode == 0, made.output
    template = tmp_path / "shot.openjd.json"
    assert [step["name"] for step in json.loads(template.read_text())["steps"]] == [
        "Tiles",
        "Frames",
        "Check",
    ]
    command = [sys.executable, "-m", "openjd", "run", str(template), "--step", "Check"]
    command += ["--run-dependencies", "-p", f"Blender={shot.program}"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.count("drawn (was missing)") == 8
    assert run.stdout.count("merged (was missing)") == 2
    assert "2 of 2 frames verified" in run.stdout
    assert shot.names == ["shot_0001.exr", "shot_0002.exr"]
    serial = tmp_path / "serial"
    assert shot.glint("frames", blend, "1-2", "--out", str(serial)).returncode == 0
    for name in shot.names:
        assert _texts(shot.out / name) == _texts(serial / name)
