"""Mist and Cryptomatte against Cycles."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy, oiio
from glint import engine
from glint.addon.export import aovs_of, export_scene
from glint.engine.cryptomatte import id_of
from glint_picture import BACKENDS, render_glint, same_around
from small_scenes import add, add_camera, ball, cube, lambert, looking_at, moved, plane

KINDS = {"Crypto Object": "object", "Crypto Material": "material", "Crypto Asset": "asset"}


def veil(opacity: float):
    """Lets some of the light straight through."""
    material = lambert((0.3, 0.5, 0.7))
    material.name = "veil"
    tree = material.node_tree
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    surface = output.inputs["Surface"].links[0].from_socket
    through, mix = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfTransparent", "MixShader")
    )
    mix.inputs[0].default_value = opacity
    tree.links.new(through.outputs[0], mix.inputs[1])
    tree.links.new(surface, mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return material


def scene_of_things(parallel: bool = False):
    """Families, names with quotes and umlauts, instances, two materials, a veil, a holdout
    and a thing without a material.
    """
    scene = cycles.empty_scene(64, 48)
    red, blue = lambert((0.8, 0.1, 0.1)), lambert((0.1, 0.1, 0.8))
    red.name, blue.name = 'the "red" one', "blau ü"
    parent = bpy.data.objects.new("Haus", None)
    scene.collection.objects.link(parent)
    add(scene, "floor", plane(8.0, red), moved(0, 0, -0.5))
    for k, name in enumerate(("Tür", 'a "quoted" thing', "back\\slash")):
        thing = add(scene, name, cube(blue), moved(1.6 * k - 1.6, 0.0, 0.4, 0.5, 0.5, 0.5))
        thing.parent = parent if k else None
    add(scene, "bare", ball(), moved(-1.2, -1.4, 0.3, 0.4, 0.4, 0.4))
    child = add(scene, "sheet", plane(1.6, veil(0.7)), moved(0.6, -1.6, 0.6))
    child.matrix_world = looking_at((0.9, -1.2, 0.9), (4.2, -5.6, 4.4))
    child.parent = parent
    hole = add(scene, "hole", cube(red), moved(1.7, -1.0, 0.0, 0.3, 0.3, 0.3))
    hole.is_holdout = True
    parts = bpy.data.collections.new("parts")
    part = bpy.data.objects.new("part", cube(red))
    part.scale = 0.3, 0.3, 0.3
    parts.objects.link(part)
    for k in range(2):
        empty = add(scene, f"placed {k}", None, moved(1.6 * k - 0.8, 1.8, 0.6))
        empty.instance_type, empty.instance_collection = "COLLECTION", parts
    add_camera(scene)
    if parallel:
        scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 6.0
    return scene


def render_file(scene, name: str) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Channels of a multilayer file that Blender writes, row 0 at the bottom, and its metadata."""
    path = Path(tempfile.mkdtemp()) / f"{name}.exr"
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    file, channels, part = oiio.ImageInput.open(str(path)), {}, 0
    metadata = {a.name: a.value for a in file.spec().extra_attribs}
    while file.seek_subimage(part, 0):
        pixels, prefix = file.read_image("float"), file.spec().getattribute("name") or ""
        for k, channel in enumerate(file.spec().channelnames):
            full = channel if channel.count(".") > 1 or not prefix else f"{prefix}.{channel}"
            channels[full.split(".", 1)[1]] = pixels[::-1, :, k]
        part += 1
    return channels, metadata


def coverage(channels: dict[str, np.ndarray], title: str, name: str) -> np.ndarray:
    """As any reader of the specification finds it: the sum over the ranks that have the id."""
    total = np.zeros(next(iter(channels.values())).shape)
    for key, ids in channels.items():
        if key.startswith(title) and key[-2:].upper() in (".R", ".B"):
            other = {"R": "G", "B": "A", "r": "g", "b": "a"}[key[-1]]
            total += np.where(ids == np.float32(id_of(name)), channels[key[:-1] + other], 0)
    return total


def manifests_of(metadata: dict[str, str]) -> dict[str, dict[str, str]]:
    names = {
        k.split("/")[1]: v
        for k, v in metadata.items()
        if k.startswith("cryptomatte/") and k.endswith("/name")
    }
    return {
        v: {f: metadata[f"cryptomatte/{k}/{f}"] for f in ("hash", "conversion", "manifest")}
        for k, v in names.items()
    }


@pytest.fixture(scope="module")
def both():
    """Cycles' file, and the films of both tracers, of one scene with 64 samples."""
    scene = scene_of_things()
    layer = bpy.context.view_layer
    cycles.make_exact(scene, 256, bounces=0)
    scene.cycles.transparent_max_bounces = 8
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 1.5
    layer.use_pass_cryptomatte_object = layer.use_pass_cryptomatte_material = True
    layer.use_pass_cryptomatte_asset, layer.pass_cryptomatte_depth = True, 8
    channels, metadata = render_file(scene, "cycles")
    settings = {"samples": 64, "crypto_ids": 8, "filter_width": 1.5, "passes": frozenset(KINDS)}
    films = {b: render_glint(scene, b, **settings) for b in BACKENDS}
    exported = export_scene(bpy.context.evaluated_depsgraph_get(), width=64, height=48).scene
    return channels, metadata, films, exported


def test_ids_are_those_of_cycles(both):
    channels, _metadata, films, _ = both
    for kind in KINDS:
        title = kind.replace(" ", "")
        wanted = {
            np.float32(i).tobytes()
            for key, ids in channels.items()
            if key.startswith(title) and key[-1] in "RBrb"
            for i in np.unique(ids)
        }
        for film in films.values():
            ids = np.unique(film.passes[kind][..., ::2])
            assert {np.float32(i).tobytes() for i in ids} == wanted, kind


def test_manifests_are_those_of_cycles(both):
    """Of what is there to be seen; Cycles names lamps, the world and its own materials too. It does
    not escape quotes, of which JSON asks that.
    """
    _, metadata, _, exported = both
    found = manifests_of(metadata)
    ours = engine.manifests(exported)
    for kind in KINDS:
        theirs = found[f"ViewLayer.{kind.replace(' ', '')}"]
        assert (theirs["hash"], theirs["conversion"]) == ("MurmurHash3_32", "uint32_to_float32")
        for name, value in json.loads(ours[kind]).items():
            assert f'"{name}":"{value}"' in theirs["manifest"], kind


@pytest.mark.parametrize("backend", BACKENDS)
def test_coverage_is_that_of_cycles(both, backend):
    """Within the noise of Cycles' 256 samples, 4 sigma of a coverage of a half."""
    channels, _metadata, films, exported = both
    for kind in KINDS:
        title = kind.replace(" ", "")
        picture = films[backend].passes[kind]
        for name in json.loads(engine.manifests(exported)[kind]):
            ids = picture[..., ::2] == np.float32(id_of(name))
            found = np.where(ids, picture[..., 1::2], 0).sum(-1)
            wanted = coverage(channels, title, name)
            assert np.abs(found - wanted).max() < 0.125, (kind, name)
            assert np.abs(found - wanted).mean() < 0.004, (kind, name)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("falloff", ["QUADRATIC", "LINEAR", "INVERSE_QUADRATIC"])
@pytest.mark.parametrize("parallel", [False, True])
def test_mist_is_that_of_cycles(backend, falloff, parallel):
    scene = scene_of_things(parallel)
    bpy.data.objects.remove(bpy.data.objects["sheet"])
    mist = scene.world.mist_settings
    mist.start, mist.depth, mist.falloff = 6.5, 4.5, falloff
    film = render_glint(scene, backend, passes=frozenset({"Mist", "Depth"}), filter_width=0.0)
    cycles.make_exact(scene)
    bpy.context.view_layer.use_pass_mist = True
    channels, _ = render_file(scene, "mist")
    wanted = next(v for k, v in channels.items() if k.startswith("Mist."))
    found = film.passes["Mist"][..., 0]
    inside = same_around(film.passes["Depth"][..., 0] < 1e9)
    assert wanted[inside].std() > 0.1
    apart = np.abs(found - wanted)
    assert (apart[inside] > 1e-4).mean() < 0.01, "edges between things"
    assert np.median(apart[inside]) < 2e-6


def give(material, name: str, kind: str, socket: str, tree=None, **properties):
    """An AOV Output node fed by a node's first output, in a tree of the material's."""
    tree = tree or material.node_tree
    node = tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name = name
    source = tree.nodes.new(kind)
    for key, value in properties.items():
        setattr(source, key, value)
    tree.links.new(source.outputs[0], node.inputs[socket])
    return node


def scene_of_aovs():
    """Colours by patterns and in a group, numbers, one on a glass-clear sheet, and things that give
    none.
    """
    scene = cycles.empty_scene(64, 48)
    floor, box, clear = (lambert((0.5, 0.5, 0.5)) for _ in range(3))
    give(floor, "pattern", "ShaderNodeTexChecker", "Color")
    give(floor, "height", "ShaderNodeNewGeometry", "Value")
    group = bpy.data.node_groups.new("inside", "ShaderNodeTree")
    give(box, "pattern", "ShaderNodeTexNoise", "Color", tree=group)
    box.node_tree.nodes.new("ShaderNodeGroup").node_tree = group
    number = give(box, "height", "ShaderNodeNewGeometry", "Value")
    box.node_tree.links.remove(number.inputs["Value"].links[0])
    number.inputs["Value"].default_value = 2.5
    clear = veil(0.0)
    give(clear, "height", "ShaderNodeNewGeometry", "Value")
    add(scene, "floor", plane(8.0, floor), moved(0, 0, -0.5))
    add(scene, "box", cube(box), moved(-0.8, 0, 0.2, 0.6, 0.6, 0.6))
    add(scene, "plain", ball(material=lambert((0.3, 0.3, 0.3))), moved(1.2, 0, 0.3, 0.6, 0.6, 0.6))
    sheet = add(scene, "sheet", plane(1.2, clear))
    sheet.matrix_world = looking_at((1.2, -1.6, 1.2), (4.2, -5.6, 4.4))
    add_camera(scene)
    for name, kind in (("pattern", "COLOR"), ("height", "VALUE")):
        aov = bpy.context.view_layer.aovs.add()
        aov.name, aov.type = name, kind
    return scene


@pytest.mark.parametrize("backend", BACKENDS)
def test_aovs_are_those_of_cycles(backend):
    scene = scene_of_aovs()
    layer = bpy.context.view_layer
    assert [tuple(aov) for aov in aovs_of(layer)] == [("pattern", False), ("height", True)]
    cycles.make_exact(scene)
    scene.cycles.transparent_max_bounces = 8
    channels, _ = render_file(scene, "aov")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    export = export_scene(depsgraph, width=64, height=48, aovs=aovs_of(layer))
    settings = engine.Settings(
        samples=1, light_samples=1, backend=backend, filter_width=0.0, passes=frozenset({"Depth"})
    )
    film = engine.render(export.scene, settings)
    inside = same_around(film.passes["Depth"][..., 0] < 1e9)
    pattern = np.stack([channels[f"pattern.{c}"] for c in "RGBA"], -1)
    for found, wanted in (
        (film.passes["AOV pattern"], pattern),
        (film.passes["AOV height"][..., :1], channels["height.X"][..., None]),
    ):
        apart = np.abs(found - wanted).max(-1)
        assert wanted.std() > 0.1
        assert np.median(apart[inside]) < 1e-6
        assert (apart[inside] > 1e-4).mean() < 0.02, "edges of things and squares"


@pytest.mark.parametrize("backend", BACKENDS)
def test_denoising_data_are_those_of_cycles(backend):
    """On matt things, which have the same albedo in both."""
    scene = scene_of_things()
    for name in ("sheet", "bare"):
        bpy.data.objects.remove(bpy.data.objects[name])
    cycles.make_exact(scene)
    bpy.context.view_layer.cycles.denoising_store_passes = True
    channels, _ = render_file(scene, "denoising")
    film = render_glint(
        scene, backend, passes=frozenset({"Depth", *engine.DENOISING}), filter_width=0.0
    )
    inside = same_around(film.passes["Depth"][..., 0] < 1e9)
    for name, letters in zip(engine.DENOISING, ("XYZ", "RGB", "Z"), strict=True):
        wanted = np.stack([channels[f"{name}.{letter}"] for letter in letters], -1)
        apart = np.abs(film.passes[name] - wanted).max(-1)
        assert wanted[inside].std() > 0.1
        assert np.median(apart[inside]) < 1e-5, name
        assert (apart[inside] > 1e-4).mean() < 0.02, name
