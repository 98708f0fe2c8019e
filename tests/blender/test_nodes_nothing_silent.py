"""Every input and setting of every node that computes changes the exported scene or is told."""

from __future__ import annotations

from itertools import combinations

import bpy
import pytest

from export_support import export, quad, scene, use_nodes  # noqa: F401
from glint.addon.export.shader_nodes import READERS
from node_walk import HOMES, MATERIAL, NUMBERS, Bare, Change, Walk, other

CLOSURES = ("ShaderNodeBsdf", "ShaderNodeOutput", "ShaderNodeVolumeA", "ShaderNodeVolumeC")
NO_NODES = {"ShaderNode", "ShaderNodeTree", "ShaderNodeGroup", "ShaderNodeCustomGroup"}
STEPS = {"SIGN", "FLOOR", "CEIL", "TRUNC", "ROUND", "SNAP"}
"""Operations by which different constants become the same, as they do where Math clamps them."""

WITHOUT_EFFECT = {("ShaderNodeNormalMap", "base")}
"""Settings that count with true displacement alone."""
UNTURNED = {frozenset(pair) for pair in (("OBJECT", "WORLD"), ("BLENDER_OBJECT", "BLENDER_WORLD"))}
"""Spaces of normal maps that are the same where no object turns them."""
EVERYWHERE_ALIKE = (
    "approximated",
    "basic",
    "colors",
    "math",
    "noise",
    "patterns",
    "spectra",
    "vectors",
    "voronoi",
)
"""Modules whose nodes only compute from their inputs, wherever they stand."""


ALIKE = {"Cubic", "Smart"}
"""Ways to read images that are one in Cycles too, but for OSL."""


def _computes(name: str) -> bool:
    if not name.startswith("ShaderNode") or name.startswith(CLOSURES) or name in NO_NODES:
        return False
    tree = bpy.data.node_groups.new("G", "ShaderNodeTree")
    computes = any(socket.type in NUMBERS for socket in tree.nodes.new(name).outputs)
    bpy.data.node_groups.remove(tree)
    return computes


KINDS = [name for name in sorted(dir(bpy.types)) if _computes(name)]


def _is_alike_everywhere(kind: str) -> bool:
    if kind not in READERS:  # told by the same words everywhere
        return True
    reader = READERS[kind]
    module = getattr(reader, "func", reader).__module__
    return module.rpartition(".")[2] in EVERYWHERE_ALIKE or kind == "ShaderNodeTexSky"


CASES = [
    (kind, home)
    for kind in KINDS
    for home in HOMES
    if home == MATERIAL or not _is_alike_everywhere(kind)
]
"""A sky is walked in a material, where it is quick, and its sun in a world by itself."""


@pytest.mark.parametrize(("kind", "home"), CASES)
def test_every_input_counts_or_is_told(scene, kind, home):  # noqa: F811
    walk = Walk(kind, home)
    silent = []
    for base in walk.bases():
        fed = walk.hear()
        for socket in walk.sockets():
            if (home, kind, socket.name) == ("SUN", "ShaderNodeLightFalloff", "Smooth"):
                continue  # a sun does not fall off
            walk.starve(socket)
            starved = walk.hear()
            if starved.scene == fed.scene and not fed.tells(walk.node, socket.name):
                silent.append((base, socket.identifier, "linked"))
            value = other(socket.default_value)
            if value is not None and not socket.hide_value and not _is_step(base):
                with Change("", socket, "default_value", value).made():
                    changed = walk.hear()
                if changed == starved and not changed.tells(walk.node, socket.name):
                    silent.append((base, socket.identifier, value))
            walk.feed(socket)
    assert not silent


@pytest.mark.parametrize("kind", KINDS)
def test_every_output_is_made_or_told(scene, kind):  # noqa: F811
    """Nothing of what this Blender has takes a constant in silence."""
    material = bpy.data.materials.new("M")
    quad("Quad", material)
    use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    node, shine, end = (
        tree.nodes.new(name) for name in (kind, "ShaderNodeEmission", "ShaderNodeOutputMaterial")
    )
    tree.links.new(shine.outputs[0], end.inputs["Surface"])
    for output in node.outputs:
        if output.type in NUMBERS and not output.is_unavailable:
            tree.links.new(output, shine.inputs["Color"])
            told = [note for note in export().notes if "take a constant" in note]
            assert not told


def _is_step(base) -> bool:
    return base.get("operation") in STEPS or ("operation" in base and base.get("use_clamp") is True)


@pytest.mark.parametrize(("kind", "home"), CASES)
def test_every_setting_counts_or_is_told(scene, kind, home):  # noqa: F811
    """Of a menu each two entries differ somewhere, of a number two values."""
    walk = Walk(kind, home)
    heard = {}
    still = None
    for base in walk.bases():
        heard[tuple(base.items())] = fed = walk.hear()
        changes = {(c.name, c.attribute): c for c in walk.changes()}
        still = set(changes) if still is None else still
        for key in sorted(still):
            with changes[key].made():
                if walk.hear() != fed or fed.tells(walk.node, key[1]):
                    still.discard(key)
    silent = sorted(still) + [
        (name, *pair)
        for name in dict(next(iter(heard)))
        if (kind, name) not in WITHOUT_EFFECT
        for pair in combinations({dict(base)[name] for base in heard}, 2)
        if set(pair) != ALIKE
        if not _differ(walk, heard, name, *pair)
        and (home == MATERIAL or frozenset(pair) not in UNTURNED)
    ]
    assert not silent


def _differ(walk, heard, name, a, b) -> bool:
    """Whether a setting's values differ, or are told, in one of the bases that have both."""
    for base, said in heard.items():
        there = heard.get(tuple({**dict(base), name: b}.items()))
        is_pair = dict(base)[name] == a and there is not None
        if is_pair and (there != said or said.tells(walk.node, name)):
            return True
    return False


def test_a_ramps_interpolation_counts(scene):  # noqa: F811
    walk = Walk("ShaderNodeValToRGB")
    walk.node.color_ramp.color_mode = "RGB"
    walk.relink()
    said = {}
    for name in ("LINEAR", "EASE", "B_SPLINE", "CARDINAL", "CONSTANT"):
        walk.node.color_ramp.interpolation = name
        said[name] = walk.hear().scene
    assert len(set(said.values())) == len(said)


@pytest.mark.parametrize("name", ["sun_disc", "sun_size", "sun_intensity", "sun_elevation"])
def test_the_sun_of_a_worlds_sky_counts(scene, name):  # noqa: F811
    walk = Walk("ShaderNodeTexSky", "WORLD")
    walk.node.sky_type = next(
        kind for kind in ("SINGLE_SCATTERING", "NISHITA") if _takes(walk.node, "sky_type", kind)
    )
    walk.relink()
    before = walk.hear()
    setattr(walk.node, name, False if name == "sun_disc" else 0.4)
    assert walk.hear().scene != before.scene


def _takes(node, name, value) -> bool:
    return value in {item.identifier for item in node.bl_rna.properties[name].enum_items}


@pytest.mark.parametrize("home", [home for home in HOMES if home != MATERIAL])
def test_coordinates_that_nobody_reads_are_not_told(scene, home):  # noqa: F811
    bare = Bare(home)
    place, shown = bare.node("ShaderNodeTexCoord"), bare.node("ShaderNodeEmission")
    bare.tree.links.new(place.outputs["Generated"], shown.inputs["Color"])
    bare.tree.links.new(shown.outputs[0], bare.output.inputs["Surface"])
    assert export().notes == ()
