"""Cryptomatte through Blender: names, levels and metadata of the file, a reader of the
specification, and Blender's own compositor node.
"""

import json

import numpy as np
import OpenImageIO as oiio
import pytest

from blender_process import COMPOSITOR, Blender
from glint.engine.cryptomatte import id_of, name_hash
from test_addon_passes import DRAW, read_channels

SCENE = (
    DRAW
    + """
scene.glint.final.samples = 8
scene.render.film_transparent = True
layer = scene.view_layers[0]
cube = bpy.data.objects["Cube"]
cube.name = 'the "cube"'
second = cube.copy()
second.name, second.location.x, second.parent = "second", 2.5, cube
scene.collection.objects.link(second)
for kind in ("object", "material", "asset"):
    setattr(layer, "use_pass_cryptomatte_" + kind, True)
layer.pass_cryptomatte_depth = 4
bpy.context.evaluated_depsgraph_get()
"""
)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Channels and metadata of a file with all three, and of a second view layer with one."""
    blender = Blender(tmp_path_factory.mktemp("cryptomatte"))
    run = blender.run(
        SCENE
        + """
other = scene.view_layers.new("Other")
other.use_pass_cryptomatte_object, other.pass_cryptomatte_depth = True, 2
scene.render.filepath = str(FOLDER / "crypto.exr")
bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 0, run.output
    path = blender.folder / "crypto.exr"
    extra = oiio.ImageInput.open(str(path)).spec().extra_attribs
    return read_channels(path), {a.name: a.value for a in extra}


def matte(channels: dict[str, np.ndarray], title: str, name: str) -> np.ndarray:
    """As the specification asks of readers: the coverage of all ranks that have the id."""
    total = np.zeros(next(iter(channels.values())).shape)
    for key in [key for key in channels if key.startswith(title) and key[-1] == "r"]:
        r, g, b, a = (channels[key[:-1] + letter] for letter in "rgba")
        total += np.where(r == np.float32(id_of(name)), g, 0)
        total += np.where(b == np.float32(id_of(name)), a, 0)
    return total


def test_levels_and_layers(written):
    channels, _ = written
    found = {key.rpartition(".")[0] for key in channels if "Crypto" in key}
    kinds = "Object", "Material", "Asset"
    assert found == {f"ViewLayer.Crypto{kind}0{k}" for kind in kinds for k in range(2)} | {
        "Other.CryptoObject00"
    }


def test_lossy_files_keep_the_ids(tmp_path):
    """DWA rounds what is named R, G and B: ids are named r and b, as the specification and Cycles
    have it.
    """
    blender = Blender(tmp_path)
    run = blender.run(
        SCENE
        + """
settings.exr_codec = "DWAA"
scene.render.filepath = str(FOLDER / "lossy.exr")
bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 0, run.output
    assert oiio.ImageInput.open(str(tmp_path / "lossy.exr")).spec()["compression"][:4] == "dwaa"
    channels = read_channels(tmp_path / "lossy.exr")
    alpha = channels["ViewLayer.Combined.A"]
    mattes = [matte(channels, "ViewLayer.CryptoObject", x) for x in ('the "cube"', "second")]
    assert all(m.max() > 0.99 for m in mattes)
    np.testing.assert_allclose(sum(mattes), alpha, atol=1e-6)


def test_metadata_leads_from_names_to_coverage(written):
    """Every title's manifest, found as readers do; things cover what Combined's alpha says."""
    channels, metadata = written
    alpha = channels["ViewLayer.Combined.A"]
    names = {
        "ViewLayer.CryptoObject": {'the "cube"', "second"},
        "ViewLayer.CryptoMaterial": {"Material"},
        "ViewLayer.CryptoAsset": {'the "cube"'},
        "Other.CryptoObject": {'the "cube"', "second"},
    }
    for title, things in names.items():
        key = f"cryptomatte/{name_hash(title):08x}"[:-1]
        assert metadata[f"{key}/name"] == title
        assert metadata[f"{key}/hash"] == "MurmurHash3_32"
        assert metadata[f"{key}/conversion"] == "uint32_to_float32"
        manifest = json.loads(metadata[f"{key}/manifest"])
        assert set(manifest) == things
        assert all(int(value, 16) == name_hash(name) for name, value in manifest.items())
        mattes = [matte(channels, title, name) for name in things]
        assert all(0.01 < m.mean() < 0.9 for m in mattes)
        np.testing.assert_allclose(sum(mattes), alpha, atol=1e-6)


def test_blenders_node_finds_the_same(tmp_path):
    """A matte picked by name in the compositor, beside the file's own coverage."""
    blender = Blender(tmp_path)
    run = blender.run(
        SCENE
        + """
cube.name = "first"
scene.render.filepath = str(FOLDER / "crypto.exr")
bpy.ops.render.render(write_still=True)
"""
        + COMPOSITOR
        + """
node = tree.nodes.new("CompositorNodeCryptomatteV2")
node.source, node.scene = "RENDER", scene
node.layer_name = "ViewLayer.CryptoObject"
node.matte_id = "second"
tree.links.new(node.outputs["Matte"], output.inputs["Image"])
if hasattr(settings, "media_type"):
    settings.media_type = "IMAGE"
settings.file_format, settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = str(FOLDER / "matte.exr")
bpy.ops.render.render(write_still=True)
answer(node.matte_id)
"""
    )
    assert run.returncode == 0, run.output
    found = oiio.ImageBuf(str(tmp_path / "matte.exr")).get_pixels(oiio.FLOAT)[..., 0]
    wanted = matte(read_channels(tmp_path / "crypto.exr"), "ViewLayer.CryptoObject", "second")
    assert wanted.max() > 0.99
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_aovs_reach_the_file_under_their_names(tmp_path):
    """A colour and a number, and one that Blender refuses for its name."""
    blender = Blender(tmp_path)
    run = blender.run(
        SCENE
        + """
tree = cube.active_material.node_tree
for name, kind in (("tint", "COLOR"), ("number", "VALUE"), ("Combined", "COLOR")):
    aov = layer.aovs.add()
    aov.name, aov.type = name, kind
    node = tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name = name
    node.inputs["Color"].default_value = (0.25, 0.5, 2.0, 1)
    node.inputs["Value"].default_value = -3.0
layer.cycles.denoising_store_passes = True
layer.update_render_passes()
scene.render.filepath = str(FOLDER / "aov.exr")
bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 0, run.output
    channels = read_channels(tmp_path / "aov.exr")
    alpha = channels["ViewLayer.Combined.A"]
    for channel, value in {"R": 0.25, "G": 0.5, "B": 2.0, "A": 1.0}.items():
        np.testing.assert_allclose(channels[f"ViewLayer.tint.{channel}"], value * alpha, atol=1e-6)
    np.testing.assert_allclose(channels["ViewLayer.number.X"], -3 * alpha, atol=1e-6)
    inside = alpha == 1
    normals = np.stack([channels[f"ViewLayer.Denoising Normal.{c}"] for c in "XYZ"], -1)
    assert (normals[inside][:, 2] < 0).all(), "towards the camera"
    assert (channels["ViewLayer.Denoising Depth.Z"][inside] > 5).all()
    assert channels["ViewLayer.Denoising Albedo.G"][inside].min() > 0.5
