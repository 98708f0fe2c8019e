"""Images from every source end as the pixels that Blender shows; broken ones are magenta and
named.
"""

import os
from pathlib import Path

import bpy
import numpy as np
import OpenImageIO as oiio
import pytest

from export_support import Shader, image, scene, srgb_to_linear  # noqa: F401
from glint.addon.export.images import colorspace, pixels, tiles
from glint.addon.export.images import images as images_module
from glint.addon.export.images.decoded import Decoded
from glint.addon.export.images.images import Images, mean_color, texels
from glint.addon.export.images.tiles import can_save_copies
from glint.addon.export.materials.graph import Place, images_behind
from glint.addon.export.report import Report
from glint.addon.export.sync.frames import export_frame
from glint.addon.export.sync.incremental import LiveExport
from glint.engine.scene import Input, Texture

GRADIENT = np.stack(
    [
        *np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 3), indexing="xy"),
        np.full((3, 5), 0.25),
        np.ones((3, 5)),
    ],
    -1,
).astype(np.float32)
"""(3, 5, 4): red grows to the right, green upwards (row 0 is the bottom)."""


def _texture(picture, **settings):
    """The texture that a node with this image exports, and the notes."""
    shader = Shader()
    node = shader.node("ShaderNodeTexImage", image=picture, **settings)
    shader.link(node, "Color", shader.shader, "Color")
    shader.link(node, "Alpha", shader.node("ShaderNodeMath"), "Value")
    result, _ = shader.export()
    name = picture.name if picture is not None else "no image"
    (texture,) = (texture for texture in result.scene.textures if texture.name == name)
    return texture, result.notes


def _file(path, values: np.ndarray, kind: str = "uint8") -> str:
    """Writes (h, w, c) values, row 0 at the bottom, as they are."""
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], values.shape[2], kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    output.write_image(np.ascontiguousarray(values[::-1].astype(np.float32)))
    output.close()
    return str(path)


def _bytes(values) -> np.ndarray:
    return np.floor(np.asarray(values) * 255 + 0.5).astype(np.uint8)


def test_a_file_keeps_its_bytes(scene, tmp_path):  # noqa: F811
    picture = bpy.data.images.load(_file(tmp_path / "a.png", GRADIENT))
    texture, notes = _texture(picture)
    assert (texture.encoding, texture.pixels.dtype) == ("SRGB", np.uint8)
    np.testing.assert_array_equal(texture.pixels, _bytes(GRADIENT))
    assert notes == ()


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_fewer_channels_are_spread_out(scene, tmp_path, channels):  # noqa: F811
    values = GRADIENT[:, :, :channels].copy()
    if channels in (2, 4):
        values[:, :, -1] = 0.5
    texture, _ = _texture(bpy.data.images.load(_file(tmp_path / "a.png", values)))
    expected = np.ones((3, 5, 4))
    expected[:, :, :3] = values[:, :, :3] if channels >= 3 else values[:, :, :1]
    expected[:, :, 3] = 0.5 if channels in (2, 4) else 1
    np.testing.assert_array_equal(texture.pixels, _bytes(expected))


def test_non_color_is_linear(scene, tmp_path):  # noqa: F811
    picture = bpy.data.images.load(_file(tmp_path / "a.png", GRADIENT))
    picture.colorspace_settings.name = "Non-Color"
    texture, _ = _texture(picture)
    assert texture.encoding == "LINEAR"
    np.testing.assert_array_equal(texture.pixels, _bytes(GRADIENT))


def test_sixteen_bits_become_linear_floats(scene, tmp_path):  # noqa: F811
    texture, _ = _texture(bpy.data.images.load(_file(tmp_path / "a.png", GRADIENT, "uint16")))
    assert (texture.encoding, texture.pixels.dtype) == ("LINEAR", np.float32)
    np.testing.assert_allclose(
        texture.pixels[:, :, :3], srgb_to_linear(GRADIENT[:, :, :3]), atol=1 / 65535
    )


def test_exr_colours_are_divided_by_alpha(scene, tmp_path):  # noqa: F811
    values = GRADIENT * 4
    values[:, :, 3] = 0.5
    texture, _ = _texture(bpy.data.images.load(_file(tmp_path / "a.exr", values, "float")))
    assert texture.encoding == "LINEAR"
    np.testing.assert_allclose(texture.pixels[:, :, :3], GRADIENT[:, :, :3] * 8, rtol=1e-6)
    np.testing.assert_array_equal(texture.pixels[:, :, 3], 0.5)


def test_hdr(scene, tmp_path):  # noqa: F811
    texture, _ = _texture(
        bpy.data.images.load(_file(tmp_path / "a.hdr", GRADIENT[:, :, :3] * 8, "float"))
    )
    np.testing.assert_allclose(texture.pixels[:, :, :3], GRADIENT[:, :, :3] * 8, atol=8 / 128)


@pytest.mark.parametrize("name", ["Linear Rec.2020", "ACEScg", "Linear Rec.709"])
def test_other_colour_spaces_are_what_blender_makes_of_them(scene, tmp_path, name):  # noqa: F811
    """Blender converts float files when it loads them: `Image.pixels` is the truth, in half
    precision as it stores them.
    """
    picture = bpy.data.images.load(_file(tmp_path / "a.exr", GRADIENT, "float"))
    picture.colorspace_settings.name = name
    texture, notes = _texture(picture)
    truth = np.array(picture.pixels[:], np.float32).reshape(3, 5, 4)
    assert notes == ()
    np.testing.assert_allclose(texture.pixels, truth, atol=2e-5)


def test_packed_images_need_no_file(scene, tmp_path):  # noqa: F811
    path = tmp_path / "a.png"
    picture = bpy.data.images.load(_file(path, GRADIENT))
    picture.pack()
    path.unlink()
    texture, notes = _texture(picture)
    np.testing.assert_array_equal(texture.pixels, _bytes(GRADIENT))
    assert notes == ()


@pytest.mark.parametrize("float_buffer", [False, True])
def test_generated_images(scene, float_buffer):  # noqa: F811
    texture, _ = _texture(
        image(pixels=GRADIENT.reshape(-1, 4), size=(5, 3), float_buffer=float_buffer)
    )
    assert texture.encoding == ("LINEAR" if float_buffer else "SRGB")
    np.testing.assert_array_equal(texture.pixels, GRADIENT if float_buffer else _bytes(GRADIENT))


def test_generated_floats_hold_their_alpha(scene):  # noqa: F811
    """Seen in Cycles: a float image's colours are times alpha already."""
    texture, _ = _texture(image(pixels=((0.5, 0.25, 0.75, 0.5),), float_buffer=True))
    np.testing.assert_array_equal(texture.pixels, [[[1, 0.5, 1.5, 0.5]]])


def test_painted_images_are_read_as_they_are_now(scene, tmp_path):  # noqa: F811
    picture = bpy.data.images.load(_file(tmp_path / "a.png", GRADIENT))
    picture.pixels = (1 - GRADIENT).ravel()
    texture, _ = _texture(picture)
    np.testing.assert_allclose(texture.pixels, _bytes(1 - GRADIENT), atol=1)


@pytest.mark.parametrize("mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE"])
def test_alpha_modes(scene, tmp_path, mode):  # noqa: F811
    """PNG colours are apart from alpha whatever the mode says, as in Cycles."""
    values = GRADIENT.copy()
    values[:, :, 3] = 0.5
    picture = bpy.data.images.load(_file(tmp_path / "a.png", values))
    picture.alpha_mode = mode
    texture, _ = _texture(picture)
    np.testing.assert_array_equal(texture.pixels[:, :, :3], _bytes(values)[:, :, :3])
    assert (texture.pixels[:, :, 3] == (255 if mode == "NONE" else 128)).all()


def _alone(picture):
    """The pixels of the texture that a node exports whose alpha nothing reads."""
    shader = Shader()
    node = shader.node("ShaderNodeTexImage", image=picture)
    shader.link(node, "Color", shader.shader, "Color")
    return shader.export()[0].scene.textures[0].pixels


@pytest.mark.parametrize("space", ["sRGB", "Non-Color"])
def test_alpha_does_not_darken_data(scene, tmp_path, space):  # noqa: F811
    """As in Cycles: a normal map with something else in its alpha is left as it is."""
    values = GRADIENT.copy()
    values[:, :, 3] = 0.5
    picture = bpy.data.images.load(_file(tmp_path / "a.png", values))
    picture.colorspace_settings.name = space
    wanted = _bytes(values)[:, :, :3]
    if space == "sRGB":
        wanted = (wanted.astype(int) * 128 // 255).astype(np.uint8)
    np.testing.assert_array_equal(_alone(picture)[:, :, :3], wanted)


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_sixteen_bits_are_multiplied_by_alpha_under_their_curve(scene, tmp_path, name):  # noqa: F811
    """As bytes are, and as in Cycles."""
    values = GRADIENT.copy()
    values[:, :, 3] = [0, 0.25, 0.5, 0.75, 1]
    picture = bpy.data.images.load(_file(tmp_path / name, values, "uint16"))
    wanted = srgb_to_linear(values[:, :, :3] * values[:, :, 3:])
    np.testing.assert_allclose(_alone(picture)[:, :, :3], wanted, atol=3e-5)
    assert (_alone(picture)[:, :, 3] == 1).all()


@pytest.mark.parametrize("kind", ["uint8", "uint16"])
def test_alpha_does_not_darken_grey(scene, tmp_path, kind):  # noqa: F811
    """As in Cycles, of a file of two channels."""
    values = np.stack([GRADIENT[:, :, 0], np.full((3, 5), 0.5, np.float32)], -1)
    picture = bpy.data.images.load(_file(tmp_path / "a.png", values, kind))
    found = _alone(picture)[:, :, 0]
    wanted = _bytes(values[:, :, 0]) if kind == "uint8" else srgb_to_linear(values[:, :, 0])
    np.testing.assert_allclose(found, wanted, atol=1e-4)
    assert _texture(picture)[0].pixels[0, 0, 3] == pytest.approx(
        128 if kind == "uint8" else 0.5, abs=1e-4
    )


@pytest.mark.parametrize("mode", ["STRAIGHT", "PREMUL", "CHANNEL_PACKED"])
def test_colours_without_alpha_glow(scene, tmp_path, mode):  # noqa: F811
    """EXR files hold colours times alpha whatever the mode says, as in Cycles: fire that covers
    nothing.
    """
    values = GRADIENT * 4
    values[:, :, 3] = [0, 0.25, 0.5, 0.75, 1]
    picture = bpy.data.images.load(_file(tmp_path / "a.exr", values, "float"))
    picture.alpha_mode = mode
    np.testing.assert_allclose(_alone(picture)[:, :, :3], values[:, :, :3], rtol=1e-6)


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize("interpolation", ["Linear", "Closest", "Cubic", "Smart"])
def test_extension_and_interpolation(scene, extension, interpolation):  # noqa: F811
    texture, notes = _texture(image(), extension=extension, interpolation=interpolation)
    ways = {"Linear": "LINEAR", "Closest": "CLOSEST", "Cubic": "CUBIC", "Smart": "CUBIC"}
    assert (texture.extension, texture.interpolation) == (extension, ways[interpolation])
    assert not notes


def _corrupt(tmp_path):
    path = tmp_path / "corrupt.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"\0" * 40)
    return path


def _empty(tmp_path):
    path = tmp_path / "empty.png"
    path.write_bytes(b"")
    return path


@pytest.mark.parametrize(("width", "height"), [(1, 1), (4, 16384), (16384, 1)])
def test_files_of_odd_sizes_are_read_as_they_are(scene, tmp_path, width, height):  # noqa: F811
    values = np.ones((height, width, 4), np.float32)
    values[..., 0] = np.linspace(0, 1, height)[:, None]
    texture, notes = _texture(bpy.data.images.load(_file(tmp_path / "odd.png", values)))
    np.testing.assert_array_equal(texture.pixels, _bytes(values))
    assert not notes


@pytest.mark.parametrize("make", [_corrupt, _empty, lambda folder: folder / "missing.png"])
def test_what_cannot_be_read_is_magenta_and_named(scene, tmp_path, make):  # noqa: F811
    path = make(tmp_path)
    picture = bpy.data.images.new("Broken", 1, 1)
    picture.source, picture.filepath = "FILE", str(path)
    texture, notes = _texture(picture)
    np.testing.assert_array_equal(texture.pixels, [[[255, 0, 255, 255]]])
    (note,) = notes
    assert "'Broken'" in note
    assert path.name in note


def test_no_image_is_magenta(scene):  # noqa: F811
    texture, notes = _texture(None)
    np.testing.assert_array_equal(texture.pixels, [[[255, 0, 255, 255]]])
    (note,) = notes
    assert "magenta in 'Material'" in note


def test_sequences_show_the_frame_of_the_scene(scene, tmp_path):  # noqa: F811
    for frame in (1, 2, 3):
        _file(tmp_path / f"frame_{frame:04}.png", np.full((2, 2, 3), frame / 4))
    picture = bpy.data.images.load(str(tmp_path / "frame_0001.png"))
    picture.source = "SEQUENCE"
    shader = Shader()
    node = shader.node("ShaderNodeTexImage", image=picture)
    node.image_user.frame_duration, node.image_user.use_auto_refresh = 3, True
    shader.link(node, "Color", shader.shader, "Color")
    for frame in (1, 3, 2):
        scene.frame_set(frame)
        (texture,) = shader.export()[0].scene.textures
        assert texture.pixels[0, 0, 0] == _bytes(frame / 4)


@pytest.mark.parametrize("refreshes", [True, False])
@pytest.mark.parametrize(
    ("settings", "shown"),
    [
        ({}, (1, 3, 2)),
        ({"frame_offset": 1, "frame_duration": 2}, (2, 3, 3)),
        ({"frame_start": 2, "frame_offset": 1}, (1, 3, 2)),
        ({"frame_duration": 2, "use_cyclic": True}, (1, 1, 2)),
        ({"frame_start": 3, "frame_duration": 2, "use_cyclic": True}, (1, 1, 2)),
    ],
)
@pytest.mark.parametrize("kind", ["SEQUENCE", "MOVIE"])
def test_what_moves_shows_the_frame(scene, tmp_path, kind, settings, shown, refreshes):  # noqa: F811
    """As in Cycles, Auto Refresh or not: what Blender counts for itself stays where that is off."""
    for frame in (1, 2, 3):
        _file(tmp_path / f"7_{frame:04}.png", np.full((16, 16, 3), frame / 4))
    if kind == "SEQUENCE":
        picture = bpy.data.images.load(str(tmp_path / "7_0001.png"))
        picture.source = "SEQUENCE"
    else:
        picture = bpy.data.images.load(_movie(tmp_path))
    shader = Shader()
    node = shader.node("ShaderNodeTexImage", image=picture)
    for name, value in ({"frame_duration": 3} | settings).items():
        setattr(node.image_user, name, value)
    node.image_user.use_auto_refresh = refreshes
    shader.link(node, "Color", shader.shader, "Color")
    for frame, number in zip((1, 3, 2), shown, strict=True):
        scene.frame_set(frame)
        result = shader.export()[0]
        (texture,) = result.scene.textures
        assert int(texture.pixels[0, 0, 0]) == pytest.approx(_bytes(number / 4), abs=2)
        assert texture.encoding == "SRGB" and not result.notes
    assert len(bpy.data.textures) == 0 and list(bpy.data.images) == [picture]


def test_persistent_data_keeps_one_picture_of_a_sequence(scene, tmp_path):  # noqa: F811
    for frame in (1, 2, 3):
        _file(tmp_path / f"7_{frame:04}.png", np.full((16, 16, 3), frame / 4))
    picture = bpy.data.images.load(str(tmp_path / "7_0001.png"))
    picture.source = "SEQUENCE"
    shader = Shader()
    node = shader.node("ShaderNodeTexImage", image=picture)
    node.image_user.frame_duration = 3
    shader.link(node, "Color", shader.shader, "Color")
    live = LiveExport()
    for frame in (1, 3, 2):
        scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        (texture,) = export_frame(live, depsgraph, width=8, height=8).scene.textures
        assert int(texture.pixels[0, 0, 0]) == _bytes(frame / 4)
        assert len(live._cache.images.pixels) == 1


def _movie(tmp_path) -> str:
    """Of the pictures 7_0001.png to 7_0003.png."""
    made = bpy.data.scenes.new("movie")
    editor = made.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    images = strips.new_image("pictures", str(tmp_path / "7_0001.png"), 1, 1)
    for number in (2, 3):
        images.elements.append(f"7_{number:04}.png")
    render, path = made.render, str(tmp_path / "movie.mp4")
    made.frame_start, made.frame_end, render.filepath = 1, 3, path
    render.resolution_x = render.resolution_y = 16
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format = "FFMPEG"
    render.ffmpeg.format, render.ffmpeg.constant_rate_factor = "MPEG4", "LOSSLESS"
    made.view_settings.view_transform = "Standard"
    bpy.ops.render.render(animation=True, scene=made.name)
    bpy.data.scenes.remove(made)
    for loaded in list(bpy.data.images):
        bpy.data.images.remove(loaded)
    return path


def test_a_movie_that_is_gone_is_magenta_and_named(scene, tmp_path):  # noqa: F811
    picture = bpy.data.images.new("gone", 2, 2)
    picture.source, picture.filepath = "MOVIE", str(tmp_path / "gone.mp4")
    texture, notes = _texture(picture)
    np.testing.assert_array_equal(texture.pixels, [[[255, 0, 255, 255]]])
    assert "'gone' has no file" in notes[0]
    (tmp_path / "gone.mp4").write_bytes(b"no movie")
    assert "'gone' cannot be read" in _texture(picture)[1][0]


def _tiled(folder, suffix: str = "png", kind: str = "uint8"):
    """Of two tiles, 1001 and 1012."""
    _file(folder / f"tile.1001.{suffix}", GRADIENT, kind)
    _file(folder / f"tile.1012.{suffix}", GRADIENT[::-1], kind)
    picture = bpy.data.images.load(str(folder / f"tile.1001.{suffix}"))
    picture.source = "TILED"
    picture.filepath = str(folder / f"tile.<UDIM>.{suffix}")
    picture.tiles.new(1012)
    return picture


saves_copies = pytest.mark.skipif(not can_save_copies(), reason="of Blender 4.5 and later")


def test_painted_tiles_that_blender_does_not_give_are_told(scene, tmp_path, monkeypatch):  # noqa: F811
    """As in Blender 4.2."""
    monkeypatch.setattr(tiles, "can_save_copies", lambda: False)
    picture = _tiled(tmp_path)
    picture.pixels = GRADIENT.ravel()
    picture.update()
    found, notes = _tiles(picture)
    assert all((pixels == (255, 0, 255, 255)).all() for pixels in found)
    assert "has tiles that are not saved" in notes[0]


def _tiles(picture):
    """The pixels of each tile, and the notes."""
    shader = Shader()
    node = shader.node("ShaderNodeTexImage", image=picture)
    shader.link(node, "Color", shader.shader, "Color")
    result = shader.export()[0]
    return [texture.pixels for texture in result.scene.textures], result.notes


def test_tiled_images_have_a_texture_for_each_tile(scene, tmp_path):  # noqa: F811
    (first, second), notes = _tiles(_tiled(tmp_path))
    np.testing.assert_array_equal(first, _bytes(GRADIENT))
    np.testing.assert_array_equal(second, _bytes(GRADIENT[::-1]))
    assert not notes


@saves_copies
@pytest.mark.parametrize(("suffix", "kind"), [("png", "uint8"), ("exr", "float")])
def test_painted_tiles_are_as_they_are_painted(scene, tmp_path, suffix, kind):  # noqa: F811
    """The first is; Blender's Python reaches no other."""
    picture, painted = _tiled(tmp_path, suffix, kind), GRADIENT.copy()
    painted[0, 0] = (1.0, 0.5, 0.0, 1.0)
    picture.pixels = painted.ravel()
    picture.update()
    assert picture.is_dirty
    stored = (picture.file_format, picture.filepath)
    (first, second), notes = _tiles(picture)
    for found, values in ((first, painted), (second, GRADIENT[::-1])):
        wanted = values if kind == "float" else _bytes(values)
        np.testing.assert_allclose(found, wanted, atol=1e-6)
    assert picture.is_dirty and (picture.file_format, picture.filepath) == stored
    assert not notes


@saves_copies
def test_packed_tiles_are_found_under_another_name(scene, tmp_path):  # noqa: F811
    picture = _tiled(tmp_path)
    picture.pack()
    picture.filepath = "//elsewhere.<UDIM>.png"
    (first, second), notes = _tiles(picture)
    np.testing.assert_array_equal(first, _bytes(GRADIENT))
    np.testing.assert_array_equal(second, _bytes(GRADIENT[::-1]))
    assert not notes


@saves_copies
def test_new_tiles_are_as_they_are_generated(scene):  # noqa: F811
    picture = bpy.data.images.new("new", 4, 4, tiled=True)
    picture.tiles[0].generated_color = (0.2, 0.4, 0.6, 1.0)
    with bpy.context.temp_override(edit_image=picture):
        bpy.ops.image.tile_add(number=1002, width=2, height=2, color=(0.8, 0.0, 0.4, 1.0))
    (first, second), notes = _tiles(picture)
    assert second.shape == (2, 2, 4) and (second == (204, 0, 102, 255)).all()
    assert first.shape == (4, 4, 4) and not notes


def test_tiles_that_are_nowhere_are_magenta_and_told(scene, tmp_path):  # noqa: F811
    picture = _tiled(tmp_path)
    (tmp_path / "tile.1012.png").unlink()
    (first, second), notes = _tiles(picture)
    np.testing.assert_array_equal(first, _bytes(GRADIENT))
    np.testing.assert_array_equal(second, [[[255, 0, 255, 255]]])
    assert "has no file" in notes[0]
    (tmp_path / "tile.1012.png").write_bytes(b"no picture")
    (_, second), notes = _tiles(picture)
    np.testing.assert_array_equal(second, [[[255, 0, 255, 255]]])
    assert "cannot be read" in notes[0]


def test_an_image_is_read_once(scene, tmp_path):  # noqa: F811
    """Two nodes with the same settings share the texture, other settings share its pixels."""
    picture = bpy.data.images.load(_file(tmp_path / "a.png", GRADIENT))
    shader = Shader(shader="ShaderNodeAddShader")
    for name, settings in (("Shader", {}), ("Shader_001", {}), ("Shader", {"extension": "CLIP"})):
        diffuse, node = (
            shader.node("ShaderNodeBsdfDiffuse"),
            shader.node("ShaderNodeTexImage", image=picture, **settings),
        )
        shader.link(node, "Color", diffuse, "Color")
        shader.link(diffuse, 0, shader.shader, name)
    textures = shader.export()[0].scene.textures
    assert [texture.extension for texture in textures] == ["CLIP", "REPEAT"] or len(textures) == 2
    assert textures[0].pixels is textures[1].pixels


def test_without_openimageio_blender_gives_the_same(scene, tmp_path, monkeypatch):  # noqa: F811
    values = GRADIENT.copy()
    values[:, :, 3] = 0.5
    files = {"a.png": values, "b.exr": GRADIENT}
    pictures = [
        bpy.data.images.load(_file(tmp_path / name, v, "float" if "exr" in name else "uint8"))
        for name, v in files.items()
    ]
    for picture in pictures:
        with monkeypatch.context() as patch:
            with_it = _texture(picture)[0]
            bpy.data.objects.remove(bpy.data.objects["Quad"])
            patch.setattr(pixels, "openimageio", lambda: None)
            without = _texture(picture)[0]
            bpy.data.objects.remove(bpy.data.objects["Quad"])
        assert without.encoding == with_it.encoding
        np.testing.assert_allclose(without.pixels, with_it.pixels, rtol=1e-3, atol=1e-6)


def test_values_that_are_not_finite_are_zero_and_told(scene, tmp_path):  # noqa: F811
    values = GRADIENT.copy()
    values[0, 0, 0], values[1, 1, 1] = np.nan, np.inf
    texture, notes = _texture(bpy.data.images.load(_file(tmp_path / "a.exr", values, "float")))
    assert np.isfinite(texture.pixels).all()
    assert notes == (
        "Images have pixels that are not finite, which count as 0 ('a.exr'): repair them",
    )


def test_the_srgb_curve():
    values = np.arange(256) / 255
    np.testing.assert_allclose(
        colorspace.srgb_to_linear(values), srgb_to_linear(values), rtol=1e-12
    )


def test_images_decoded_side_by_side_are_the_same(scene, tmp_path):  # noqa: F811
    pictures = [
        bpy.data.images.load(_file(tmp_path / f"{k}.png", np.roll(GRADIENT, k, 1)))
        for k in range(5)
    ]
    wanted = [(picture, None) for picture in pictures]
    together, alone = Images(Report()), Images(Report())
    together.expect([*wanted, (None, None), wanted[0]])
    for picture, user in wanted:
        np.testing.assert_array_equal(
            together.pixels(picture, user).pixels, alone.pixels(picture, user).pixels
        )


def test_what_the_last_export_decoded_is_not_decoded_again(scene, tmp_path, monkeypatch):  # noqa: F811
    asked, decode = [], pixels.decode
    monkeypatch.setattr(pixels, "decode", lambda origin: asked.append(origin) or decode(origin))
    # all of one size
    files = [_file(tmp_path / f"{k}.tga", np.roll(GRADIENT, k, 1)) for k in range(3)]
    pictures = [bpy.data.images.load(file) for file in files]
    pictures[2].pack()
    decoded = Decoded()

    def exported(*numbers):
        """How many were decoded for an export of these, which has their pixels as they are now."""
        del asked[:]
        images = Images(Report(), decoded)
        for k in numbers:
            np.testing.assert_array_equal(
                images.pixels(pictures[k], None).pixels,
                Images(Report()).pixels(pictures[k], None).pixels,
            )
        decoded.forget_unused()
        return len(asked) - len(numbers)  # without those that they are compared with

    assert [exported(0, 1, 2), exported(0, 1, 2), exported(0, 2), exported(0, 1, 2)] == [3, 0, 0, 1]
    _file(files[0], GRADIENT[::-1])
    os.utime(files[0], ns=(1, 1))  # clocks of file systems are coarse
    pictures[2].pack(data=Path(files[1]).read_bytes(), data_len=Path(files[1]).stat().st_size)
    assert [exported(0, 1, 2), exported(0, 1, 2)] == [2, 0]
    pictures[0].alpha_mode = "NONE"
    assert exported(0, 1, 2) == 1


def test_what_the_last_export_worked_out_is_not_worked_out_again(scene, tmp_path, monkeypatch):  # noqa: F811
    file = _file(tmp_path / "colors.png", GRADIENT)
    picture, decoded, asked = bpy.data.images.load(file), Decoded(), []
    monkeypatch.setattr(
        images_module,
        "mean_color",
        lambda texture, channel: asked.append(channel) or mean_color(texture, channel),
    )

    def exported(channel: str = "COLOR") -> np.ndarray:
        images = Images(Report(), decoded)
        source = Input((1.0, 1.0, 1.0), images.texture(picture, None, "REPEAT", "Linear"), channel)
        result = images.mean(source)
        decoded.forget_unused()
        return result

    first = exported()
    np.testing.assert_array_equal(exported(), first)
    assert asked == ["COLOR"]
    exported("ALPHA")
    exported()  # forgotten by the export before
    picture.colorspace_settings.name = "Non-Color"
    assert (exported() != first).any()
    picture.colorspace_settings.name = "sRGB"
    _file(tmp_path / "colors.png", GRADIENT / 2)
    os.utime(file, ns=(1, 1))
    assert (exported() < first).all()
    assert asked == ["COLOR", "ALPHA", *["COLOR"] * 3]


def test_generated_images_are_not_read_again(scene):  # noqa: F811
    """Until something that their pixels follow from has changed, or somebody has painted on
    them.
    """
    picture, decoded = bpy.data.images.new("Drawn", 8, 4), Decoded()
    picture.generated_type = "COLOR_GRID"

    def export() -> np.ndarray:
        images = Images(Report(), decoded)
        found = images.pixels(picture, None).pixels
        decoded.forget_unused()
        np.testing.assert_array_equal(found, Images(Report()).pixels(picture, None).pixels)
        return found

    first = export()
    assert export() is first

    def paint() -> None:
        picture.pixels.foreach_set(np.full(len(picture.pixels), 0.25, np.float32))

    def enlarge() -> None:
        picture.generated_width = 16

    def clear() -> None:
        picture.generated_type = "BLANK"

    def color() -> None:
        picture.generated_color = (0.25, 0.5, 1.0, 0.5)

    def tell_floats() -> None:
        picture.use_generated_float = True

    def tell_data() -> None:
        picture.colorspace_settings.name = "Non-Color"

    for change in (enlarge, clear, color, tell_floats, tell_data, paint):
        before = export()
        change()
        after = export()
        assert after is not before and (after.shape, after.tobytes()) != (
            before.shape,
            before.tobytes(),
        ), change.__name__
    assert export() is not export()  # painted: nobody knows what has changed


def test_what_cannot_be_decoded_ahead_is_told_once(scene, tmp_path):  # noqa: F811
    broken = [bpy.data.images.new(name, 1, 1) for name in ("Corrupt", "Gone")]
    for picture, path in zip(broken, (_corrupt(tmp_path), tmp_path / "gone.png"), strict=True):
        picture.source, picture.filepath = "FILE", str(path)
    sound = bpy.data.images.load(_file(tmp_path / "sound.png", GRADIENT))
    report = Report()
    images = Images(report)
    images.expect([(picture, None) for picture in (*broken, sound)])
    assert all(
        images.pixels(picture, None).pixels.tolist() == pixels.MAGENTA.tolist()
        for picture in broken
    )
    np.testing.assert_array_equal(images.pixels(sound, None).pixels, _bytes(GRADIENT))
    assert [
        sum(f"'{picture.name}'" in note for note in report.notes()) for picture in (*broken, sound)
    ] == [1, 1, 0]


def test_images_that_colour_or_bend_the_surface_are_expected(scene):  # noqa: F811
    shader = Shader()
    names = ("Color", "Bump", "Unlinked", "Roughness")
    color, bump, _, rough = (
        shader.node("ShaderNodeTexImage", image=image(name, size=(2, 2))) for name in names
    )
    normal = shader.node("ShaderNodeNormalMap")
    principled = shader.node("ShaderNodeBsdfPrincipled")
    shader.link(color, "Color", principled, "Base Color")
    shader.link(rough, "Color", principled, "Roughness")
    shader.link(bump, "Color", normal, "Color")
    shader.link(normal, "Normal", principled, "Normal")
    shader.link(principled, "BSDF", shader.output, "Surface")
    found = images_behind(Place(shader.output.inputs["Surface"]))
    assert sorted(picture.name for picture, _ in found) == ["Bump", "Color", "Roughness"]


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize(("kind", "suffix"), [("uint8", "png"), ("float", "exr"), ("float", "tif")])
def test_images_of_many_rows_are_read_in_bands(scene, tmp_path, kind, suffix, channels):  # noqa: F811
    values = np.random.default_rng(1).integers(0, 256, (2 * pixels._BAND + 3, 5, channels)) / 255
    path = _file(tmp_path / f"a.{suffix}", values, kind)
    raw = pixels.decode(pixels.Source(path, None, "CHANNEL_PACKED"))
    wanted = _bytes(values) if kind == "uint8" else values.astype(np.float32)
    colors = wanted[:, :, [0, 0, 0] if channels < 3 else [0, 1, 2]]
    np.testing.assert_array_equal(raw.rgba[:, :, :3], colors)
    opaque = np.full(values.shape[:2], 255 if kind == "uint8" else 1)
    np.testing.assert_array_equal(
        raw.rgba[:, :, 3], wanted[:, :, -1] if channels in (2, 4) else opaque
    )
    assert raw.opaque == (channels in (1, 3)) and raw.is_grey == (channels < 3)


@pytest.mark.parametrize("channels", [[0, 1, 2], [4, 2, 0]])
@pytest.mark.parametrize("rows", [1, 4])
def test_three_bytes_of_each_pixel_are_spread_into_four(rows, channels):
    values = np.random.default_rng(1).integers(0, 256, (rows, 3, 5), np.uint8)[:, :, channels]
    rgba = np.zeros((rows, 3, 4), np.uint8)
    for some in (values, np.ascontiguousarray(values)):
        pixels._spread(some, "STRAIGHT", rgba[::-1])
        np.testing.assert_array_equal(rgba[::-1, :, :3], values)
        assert (rgba[:, :, 3] == 255).all()


def test_a_packed_jpeg_needs_no_suffix(scene, tmp_path):  # noqa: F811
    flat = np.full((8, 8, 3), 0.5, np.float32)
    data = Path(_file(tmp_path / "a.jpg", flat)).read_bytes()
    raw = pixels.decode(pixels.Source("", data, "STRAIGHT"))
    assert raw.opaque and pixels._suffix(data, "") == ".jpg"
    np.testing.assert_allclose(raw.rgba[:, :, :3] / 255, 0.5, atol=0.01)


@pytest.mark.parametrize("suffix", ["." + 400 * "a", ".t:ga", ".", ".tga"])
def test_a_packed_image_is_read_whatever_its_name_ends_with(scene, tmp_path, suffix):  # noqa: F811
    data = Path(_file(tmp_path / "a.tga", np.full((4, 4, 3), 1.0, np.float32))).read_bytes()
    raw = pixels.decode(pixels.Source(f"a{suffix}", data, "STRAIGHT"))
    assert raw.rgba.shape == (4, 4, 4) and (raw.rgba == 255).all()


@pytest.mark.parametrize("encoding", ["LINEAR", "SRGB"])
@pytest.mark.parametrize("channel", ["COLOR", "ALPHA", "LUMINANCE"])
def test_the_mean_of_bytes_is_that_of_their_colours(encoding, channel):
    values = np.random.default_rng(1).integers(0, 256, (7, 300, 4), np.uint8)
    texture = Texture("t", values, encoding)
    np.testing.assert_allclose(
        mean_color(texture, channel), texels(texture, channel).mean(0, dtype=np.float64), rtol=1e-6
    )


def test_an_image_that_does_not_fit_is_named(scene, tmp_path, monkeypatch):  # noqa: F811
    def short(*arguments):
        raise MemoryError

    loaded = bpy.data.images.load(_file(tmp_path / "a.png", GRADIENT))
    monkeypatch.setattr(pixels, "_from_file", short)
    with pytest.raises(
        MemoryError, match=f"image '{loaded.name}' does not fit into it: use a smaller one"
    ):
        Images(Report()).texture(loaded, None, "REPEAT", "Linear")
