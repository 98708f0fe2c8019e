"""Volume objects become a surface round the voxels that hold something, filled with a medium that
reads their grids; what cannot be read is told by name.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from export_support import export, link, scene, use_nodes  # noqa: F401
from following import Follower
from glint.addon.export.geometry import volumes
from glint.addon.export.geometry.volume_files import check_whole
from glint.engine import Settings, render
from volume_files import NEEDED, fog_box, two_blobs, write_grids

needs_module = pytest.mark.skipif(volumes.openvdb() is None, reason=NEEDED)


def volume(path: str, material=None):
    data = bpy.data.volumes.new("Cloud")
    data.filepath = path
    if material is not None:
        data.materials.append(material)
    return link(bpy.data.objects.new("Cloud", data))


def principled(**inputs):
    material = bpy.data.materials.new("smoke")
    use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new("ShaderNodeVolumePrincipled")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    return material


def found_notes(word: str, result=None) -> list[str]:
    return [note for note in (result or export()).notes if word in note]


def media(result) -> list:
    return [m.medium for m in result.scene.materials if m.medium is not None]


@needs_module
def test_a_surface_round_what_is_there(scene, tmp_path):  # noqa: F811
    path = write_grids(tmp_path / "fog.vdb", 0.5, (1, 2, 3), density=fog_box(4))
    before = len(export().scene.geometries)
    volume(path, principled())
    result = export()
    assert not found_notes("olume", result)
    mesh = result.scene.geometries[-1]
    assert len(result.scene.geometries) == before + 1
    # the first voxel is empty: those beside what is there count, as corners of voxels
    np.testing.assert_allclose(mesh.vertices.min(0), (1, 2, 3), atol=1e-6)
    np.testing.assert_allclose(mesh.vertices.max(0), np.array([1, 2, 3]) + 6 * 0.5, atol=1e-6)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(float) for k in range(3))
    middle = mesh.vertices.mean(0)
    inside = (np.cross(b - a, c - a) * (a - middle)).sum() / 6  # of a closed one that faces out
    assert inside == pytest.approx(3.0**3, rel=1e-6)
    (medium,) = media(result)
    assert medium.program is not None and medium.step == pytest.approx(0.5 / 3.0)
    assert result.stats["textures"] == 1


@needs_module
def test_what_cannot_be_read_is_told(scene, tmp_path, monkeypatch):  # noqa: F811
    thing = volume(str(tmp_path / "missing.vdb"), principled())
    (note,) = found_notes("file cannot be read")
    assert "Cloud" in note
    thing.data.filepath = ""
    assert "Cloud" in found_notes("without a file")[0]
    (tmp_path / "broken.vdb").write_bytes(b"no grids at all")
    thing.data.filepath = str(tmp_path / "broken.vdb")
    assert found_notes("file cannot be read")
    thing.data.filepath = write_grids(tmp_path / "fog.vdb", 0.5, (0, 0, 0), density=fog_box(4))
    assert not found_notes("olume")
    thing.modifiers.new("Shake", "VOLUME_DISPLACE")
    assert "Cloud" in found_notes("Modifiers of volumes")[0]
    thing.modifiers.clear()
    monkeypatch.setattr(volumes, "openvdb", lambda: None)
    (note,) = found_notes("need the OpenVDB module")
    assert "Cloud" in note


@needs_module
def test_a_sequence_shows_nothing_where_it_has_no_file(scene, tmp_path):  # noqa: F811
    """Outside its frames by its mode, and where a file is missing, which is told."""
    for number in (1, 2, 4):
        write_grids(tmp_path / f"fog_{number}.vdb", 0.5, (0, 0, 0), density=fog_box(number))
    data = volume(str(tmp_path / "fog_1.vdb"), principled()).data
    data.is_sequence, data.frame_start, data.frame_duration = True, 10, 4

    def width(frame: int) -> float:
        scene.frame_set(frame)
        return sum(np.ptp(g.vertices[:, 0]) for g in export().scene.geometries)

    assert [width(frame) for frame in (5, 10, 11, 13, 20)] == [0, 1.5, 2, 3, 0]
    assert not found_notes("olume")
    assert width(12) == 0
    (note,) = found_notes("file cannot be read")
    assert "Cloud (fog_3.vdb not found)" in note
    ends = {"CLIP": [0, 0], "EXTEND": [1.5, 3], "REPEAT": [3, 0], "PING_PONG": [2, 0]}
    modes = data.bl_rna.properties["sequence_mode"].enum_items.keys()
    assert ends.keys() == set(modes)
    for mode in modes:
        data.sequence_mode = mode
        assert [width(frame) for frame in (9, 20)] == ends[mode], mode


@needs_module
def test_files_that_end_early_are_told(scene, tmp_path):  # noqa: F811
    """Wherever they do: all of them give a note and no picture of what is not there."""
    values = np.random.default_rng(3).random((24, 24, 24))
    whole = tmp_path / "whole.vdb"
    write_grids(whole, 0.5, (0, 0, 0), density=values)
    data = whole.read_bytes()
    for length in (len(data) // 2, len(data) - 1):  # further down Blender takes gigabytes
        path = tmp_path / f"{length}.vdb"
        path.write_bytes(data[:length])
        volume(str(path), principled())
        result = export()
        (note,) = found_notes("cannot be read", result)
        assert "ends early" in note and not media(result)
        bpy.data.volumes.remove(bpy.data.volumes["Cloud"])


@needs_module
def test_headers_that_end_early_are_told(tmp_path):
    """Without Blender, which itself takes gigabytes where some of them end."""
    whole = tmp_path / "whole.vdb"
    write_grids(whole, 0.5, (0, 0, 0), density=fog_box(4), heat=fog_box(4))
    data, broken = whole.read_bytes(), tmp_path / "broken.vdb"
    check_whole(str(whole))
    for length in (*range(130), len(data) // 2, len(data) - 1):
        broken.write_bytes(data[:length])
        with pytest.raises(EOFError):
            check_whole(str(broken))
    for where in (57, 61, 65, 76, 96, 116):  # counts, lengths of texts, where a grid ends
        broken.write_bytes(data[:where] + b"\xff\xff\xff\xfe" + data[where + 4 :])
        with pytest.raises(EOFError):
            check_whole(str(broken))


@needs_module
def test_grids_of_other_names_are_told(scene, tmp_path):  # noqa: F811
    volume(write_grids(tmp_path / "fog.vdb", 0.5, (0, 0, 0), soot=fog_box(4)), principled())
    result = export()
    assert "Cloud" in found_notes("show nothing", result)[0] and not media(result)
    node = bpy.data.materials["smoke"].node_tree.nodes["Principled Volume"]
    node.inputs["Density Attribute"].default_value = "soot"
    assert not found_notes("olume") and media(export())


@needs_module
def test_grids_that_are_odd(scene, tmp_path):  # noqa: F811
    """Not finite, empty, of another type, in a frustum, too large: finite pixels and notes."""
    vdb = volumes.openvdb()
    values = fog_box(4)
    values[2, 2, 2], values[3, 3, 3], values[2, 3, 2] = np.nan, np.inf, -1e30
    thing = volume(write_grids(tmp_path / "odd.vdb", 0.5, (0, 0, 0), density=values), principled())
    result = export()
    assert "density of Cloud" in found_notes("not finite", result)[0]
    film = render(result.scene, Settings(samples=1))
    assert np.isfinite(film.combined).all()

    def of(grid, name="density"):
        grid.name = name
        path = str(tmp_path / f"{type(grid).__name__}{id(grid)}.vdb")
        vdb.write(path, [grid])
        thing.data.filepath = path
        return export()

    count = len(result.scene.geometries)
    assert len(of(vdb.FloatGrid()).scene.geometries) == count - 1
    truth = vdb.BoolGrid()
    truth.fill((0, 0, 0), (4, 4, 4), True)
    assert found_notes("no numbers or colours", of(truth))
    huge = vdb.FloatGrid()
    huge.fill((0, 0, 0), (0, 0, 0), 1.0)
    huge.fill((1000000, 1000000, 1000000), (1000000, 1000000, 1000000), 1.0)
    assert found_notes("268 million", of(huge))
    frustum = vdb.FloatGrid()
    frustum.fill((0, 0, 0), (4, 4, 4), 1.0)
    frustum.transform = vdb.createFrustumTransform((0, 0, 0), (8, 8, 8), 0.5, 10.0)
    assert found_notes("frustum", of(frustum))
    whole = vdb.Int32Grid()
    whole.fill((0, 0, 0), (4, 4, 4), 2)
    assert not found_notes("olume", of(whole)) and media(export())


@needs_module
def test_grids_that_stand_apart_share_a_box(scene, tmp_path):  # noqa: F811
    vdb = volumes.openvdb()
    grids = []
    for name, voxel in (("density", 0.5), ("temperature", 0.25)):
        grid = vdb.FloatGrid()
        grid.fill((0, 0, 0), (3, 3, 3), 1.0)
        grid.name, grid.transform = name, vdb.createLinearTransform(voxelSize=voxel)
        grids.append(grid)
    path = str(tmp_path / "two.vdb")
    vdb.write(path, grids)
    volume(path, principled(**{"Blackbody Intensity": 1.0}))
    result = export()
    mesh, (medium,) = result.scene.geometries[-1], media(result)
    np.testing.assert_allclose(mesh.vertices.min(0), -0.5)
    np.testing.assert_allclose(mesh.vertices.max(0), 2.0)
    assert medium.step == pytest.approx(0.25 / 2.5)


@needs_module
def test_packed_files(scene, tmp_path):  # noqa: F811
    """They are read although the file is gone."""
    path = write_grids(tmp_path / "fog.vdb", 0.5, (0, 0, 0), density=fog_box(4, 3.0))
    thing = volume(path, principled())
    bpy.ops.file.pack_all()
    assert thing.data.packed_file
    (tmp_path / "fog.vdb").unlink()
    result = export()
    assert not found_notes("olume", result)
    assert result.scene.textures[0].pixels.max() == 3.0


@needs_module
def test_a_material_that_several_wear(scene, tmp_path):  # noqa: F811
    """It reads the grids of each."""
    material = principled()
    paths = [
        write_grids(tmp_path / f"{k}.vdb", 0.5, (0, 0, 0), density=fog_box(4, k + 1.0))
        for k in range(2)
    ]
    _, other = (volume(path, material) for path in paths)
    assert len(media(export())) == 2
    first = export().scene.textures
    assert [t.pixels.max() for t in first] == [1.0, 2.0]
    other.data.filepath = paths[0]
    assert len(media(export())) == 1


@needs_module
def test_a_view_follows_volumes(scene, tmp_path):  # noqa: F811
    """What is kept between exports is what a fresh one has."""
    paths = [
        write_grids(tmp_path / f"{k}.vdb", 0.25, (0, 0, 0), density=values)
        for k, values in enumerate((fog_box(4), two_blobs(16)))
    ]
    material = principled()
    thing = volume(paths[0], material)
    with Follower() as follower:
        follower.check()
        thing.location = (0, 0, 1)
        follower.check()
        thing.data.filepath = paths[1]
        follower.check()
        node = next(n for n in material.node_tree.nodes if n.type == "PRINCIPLED_VOLUME")
        node.inputs["Density"].default_value = 3.0
        follower.check()
        node.inputs["Emission Strength"].default_value = 1.0
        follower.check()
        thing.data.render.space = "WORLD"
        follower.check()
        thing.data.materials.clear()
        follower.check()
        thing.hide_viewport = True
        follower.check()
