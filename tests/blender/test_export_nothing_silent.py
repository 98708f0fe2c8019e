"""Every setting of a shader node changes the material or is told."""

import bpy
import pytest

from export_support import Shader, export, link, quad, scene  # noqa: F401
from glint.engine.analysis.fingerprint import value_fingerprint
from node_walk import ODD, Bare

IDLE = {"Weight", "Normal", "Coat Normal", "Tangent"}
"""Sockets that users cannot set (Weight), or that count only where they are linked."""
COVERED = ("rendered as diffuse", "is not supported")
"""Notes that speak of a whole node."""
WITH = {
    "ShaderNodeBsdfPrincipled": {
        "Coat "
        "Weight": 0.5, "Sheen "
                       "Weight": 0.5, "Transmission "
                                      "Weight": 0.5, "Metallic": 0.25, "Subsurface Weight": 0.25,
        "Emission "
        "Strength": 1.0, "Anisotropic": 0.5, "Thin Film Thickness": 300.0, "Diffuse Roughness": 0.5,
    },
    "ShaderNodeBsdfAnisotropic": {"Anisotropy": 0.5},
    "ShaderNodeBsdfMetallic": {"Anisotropy": 0.5, "Thin Film Thickness": 300.0},
    "ShaderNodeBsdfGlass": {"Thin Film Thickness": 300.0},
}  # fmt: skip
"""What must not be 0 for other inputs to count."""
KINDS = sorted(name for name in dir(bpy.types) if name.startswith("ShaderNodeBsdf")) + [
    "ShaderNodeEmission",
    "ShaderNodeSubsurfaceScattering",
]


def _other(value):
    """Another value of an input, or None for what has none."""
    if isinstance(value, (bool, str)) or value is None:
        return None
    if isinstance(value, (int, float)):
        return 0.375 if abs(value - 0.375) > 0.05 else 0.75
    return tuple(value[:3] and (0.3, 0.6, 0.45, 0.8)[: len(value)])


def _told(name: str, notes: tuple[str, ...]) -> bool:
    """Whether a note speaks of the node, or of the family of inputs that begins with the same
    word.
    """
    family = name.split()[0].lower()
    return any(family in note.lower() or any(text in note for text in COVERED) for note in notes)


def drawn(result) -> list[tuple]:
    """What surfaces are to the tracers."""
    return [(material.lobes, material.program) for material in result.scene.materials]


@pytest.mark.parametrize("kind", KINDS)
def test_every_input_counts_or_is_told(scene, kind):  # noqa: F811
    shader = Shader(shader=kind)
    for name, value in WITH.get(kind, {}).items():
        if name in shader.shader.inputs:
            shader.shader.inputs[name].default_value = value
    result, _ = shader.export()
    before, silent = drawn(result), []
    for socket in shader.shader.inputs:
        value = _other(getattr(socket, "default_value", None))
        if value is None or socket.name in IDLE or socket.is_unavailable:
            continue
        kept = (
            socket.default_value
            if isinstance(socket.default_value, (int, float))
            else tuple(socket.default_value)
        )
        socket.default_value = value
        after, _ = shader.export()
        socket.default_value = kept
        same = drawn(after) == before and after.notes == result.notes
        if same and not _told(socket.name, result.notes):
            silent.append(socket.name)
    assert not silent


@pytest.mark.parametrize("distribution", ["BECKMANN", "ASHIKHMIN_SHIRLEY"])
def test_other_microfacets_are_their_own(distribution, scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfAnisotropic")
    shader.shader.distribution = distribution
    result, lobes = shader.export()
    (lobe,) = (lobe for lobe in lobes if lobe.kind == "SPECULAR")
    assert lobe.distribution == distribution and not result.notes


def test_grease_pencil_is_blenders(scene):  # noqa: F811
    """Blender draws it over every engine's picture, so nothing is told."""
    quad("Thing")
    before = export()
    is_old = bpy.app.version < (4, 3, 0)
    add = bpy.ops.object.gpencil_add if is_old else bpy.ops.object.grease_pencil_add
    add(type="MONKEY")
    after = export()
    assert after.notes == () and len(after.scene.instances) == len(before.scene.instances)


SHINING = {"ShaderNodeBsdfPrincipled", "ShaderNodeBsdfTransparent", "ShaderNodeEmission"}
"""Shaders that count where there is no surface, or give nothing as they are meant to."""


@pytest.mark.parametrize("home", ["WORLD", "POINT"])
@pytest.mark.parametrize("kind", [*KINDS, "ShaderNodeHoldout", "ShaderNodeVolumeScatter"])
def test_surfaces_in_worlds_and_lights_are_told(scene, kind, home):  # noqa: F811
    bare = Bare(home)
    node = bare.node(kind)
    bare.tree.links.new(node.outputs[0], bare.output.inputs["Surface"])
    told = any(f"Node '{node.bl_label}'" in note for note in export().notes)
    assert told == (kind not in SHINING)


@pytest.mark.parametrize("home", ["WORLD", "POINT"])
@pytest.mark.parametrize("kind", ["ShaderNodeEmission", "ShaderNodeBackground"])
def test_what_shines_in_worlds_and_lights_counts(scene, kind, home):  # noqa: F811
    bare = Bare(home)
    node = bare.node(kind)
    bare.tree.links.new(node.outputs[0], bare.output.inputs["Surface"])
    said = [value_fingerprint(export().scene)]
    for name in ("Color", "Strength"):
        socket = node.inputs[name]
        socket.default_value = 2.5 if name == "Strength" else (0.3, 0.6, 0.45, 1.0)
        said.append(value_fingerprint(export().scene))
    assert len(set(said)) == len(said)


@pytest.mark.parametrize("home", ["WORLD", "POINT"])
def test_trees_without_an_output_are_black_and_told(scene, home):  # noqa: F811
    bare = Bare(home)
    bare.tree.nodes.remove(bare.output)
    result = export()
    assert not any(any(light.color) for light in result.scene.lights)
    assert result.scene.world.background == (0, 0, 0)
    assert any("without an output node" in note for note in result.notes)


def _bent() -> Shader:
    shader = Shader(shader="ShaderNodeBsdfGlossy")
    shader.shader.inputs["Roughness"].default_value = 0.0
    shader.link(shader.node("ShaderNodeNormalMap"), 0, shader.shader, "Normal")
    shader.shader.inputs["Normal"].links[0].from_node.inputs["Color"].default_value = ODD
    shader.material.cycles.use_bump_map_correction = False
    return shader


def _lamp():
    return link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))


SET = {
    "media": (lambda: setattr(quad(), "visible_volume_scatter", False), "Volume Scatter"),
    "caustics": (lambda: setattr(_lamp().data.cycles, "is_caustics_light", True), "caustics"),
    "bounces of a lamp": (lambda: setattr(_lamp().data.cycles, "max_bounces", 1), "Max Bounces"),
    "bump correction": (_bent, "Bump Map Correction"),
    "exposure": (lambda: _cycles(film_exposure=2.0), "Film Exposure"),
    "clear glass": (lambda: _cycles(film_transparent_glass=True), "Transparent Glass"),
}
"""What of Cycles' settings has no counterpart, and a word of the note."""


def _cycles(**settings) -> None:
    bpy.context.scene.render.film_transparent = bpy.context.scene.render.use_simplify = True
    for name, value in settings.items():
        setattr(bpy.context.scene.cycles, name, value)


@pytest.mark.parametrize("what", SET)
def test_settings_of_cycles_are_told(scene, what):  # noqa: F811
    quad("Plain")
    assert not export().notes
    make, word = SET[what]
    make()
    assert any(word in note for note in export().notes)


@pytest.mark.parametrize(
    ("setting", "value", "word"),
    [("max_bounces", 0, "Max Bounces"), ("is_caustics_light", True, "caustics")],
)
def test_settings_of_worlds_are_told(scene, setting, value, word):  # noqa: F811
    scene.world = bpy.data.worlds.new("World")
    setattr(scene.world.cycles, setting, value)
    assert any(word in note for note in export().notes)


def test_terminator_offsets_are_read(scene):  # noqa: F811
    thing = quad()
    (instances,) = export().scene.instances
    assert (instances.geometry_offset, instances.shading_offset) == (0.1, 0.0)
    for kind, value in (("shading", 0.25), ("geometry", 0.75)):
        name = f"shadow_terminator_{kind}_offset"
        if hasattr(thing, name):
            setattr(thing, name, value)
        else:  # Blender 4.2
            setattr(thing.cycles, name.replace("shading_", ""), value)
    found = export()
    (instances,) = found.scene.instances
    assert (instances.geometry_offset, instances.shading_offset) == (0.75, 0.25)
    assert not any("Terminator" in note for note in found.notes)


def test_a_layer_without_surfaces_has_none(scene):  # noqa: F811
    quad()
    assert export().scene.instances
    bpy.context.view_layer.use_solid = False
    assert not export().scene.instances


def test_a_note_is_one_line_whatever_names_hold(scene):  # noqa: F811
    light = link(bpy.data.objects.new("a\nb\tc 立", bpy.data.lights.new("Lamp", "POINT")))
    light.data.energy = 0
    (note,) = export().notes
    assert "'a b c 立'" in note and note.isprintable()


def test_missing_linked_data_are_named(scene, tmp_path):  # noqa: F811
    """A mesh and a node group of a library that is gone."""
    library, user = tmp_path / "library.blend", tmp_path / "user.blend"
    shader = Shader("Linked")
    shader.quad.data.name = "Shape"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.meshes, wanted.materials = ["Shape"], ["Linked"]
    camera = link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    bpy.context.scene.camera = camera
    link(bpy.data.objects.new("Hull", bpy.data.meshes["Shape"]))
    own = quad("Own", bpy.data.materials["Linked"])
    assert own.data.materials[0].library is not None
    assert not any("could not find" in note for note in export().notes)
    bpy.ops.wm.save_as_mainfile(filepath=str(user))
    library.unlink()
    bpy.ops.wm.open_mainfile(filepath=str(user))
    (told,) = [note for note in export().notes if "could not find" in note]
    assert "'Shape'" in told and "'Linked'" in told
    assert told.endswith("relocate their library in the Outliner (Blender File)")
