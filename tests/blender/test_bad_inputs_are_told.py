"""A matrix of bad inputs: each is told by the name of what has it, or draws what Cycles draws."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

from export_support import Shader, export, link, mesh_object, quad, scene  # noqa: F401
from glint.addon.export.camera import ExportError
from glint.addon.export.materials.ranges import RANGES
from node_walk import Bare

NAN, INF = math.nan, math.inf
LARGEST = 3.4028234663852886e38
"""What Blender keeps of infinity where its own bounds are floats."""
REMEDIES = ("set", "clear", "repair", "choose", "find", "hide", "remove", "add", "look", "use")


def told(name: str, *words: str) -> bool:
    """Whether a note of the export names the thing, says these words and what to do."""
    return any(
        f"'{name}'" in note
        and all(word in note for word in words)
        and any(remedy in note for remedy in REMEDIES)
        for note in export().notes
    )


def lamp(kind: str, **settings):
    light = bpy.data.lights.new("Lamp", kind)
    for name, value in settings.items():
        setattr(light, name, value)
    thing = link(bpy.data.objects.new("Lamp", light))
    thing.location = (0, 0, 3)
    return thing


LAMPS = [
    (kind, name, value)
    for kind, name in [
        *((kind, "energy") for kind in ("POINT", "SUN", "SPOT", "AREA")),
        *((kind, "color") for kind in ("POINT", "SUN", "SPOT", "AREA")),
        ("POINT", "shadow_soft_size"),
        ("SPOT", "shadow_soft_size"),
        ("SPOT", "spot_size"),
        ("SPOT", "spot_blend"),
        ("SUN", "angle"),
        ("AREA", "size"),
        ("AREA", "size_y"),
        ("AREA", "spread"),
    ]
    for value in (NAN, INF)
    if value != value or name not in ("spot_size", "spot_blend", "angle", "spread")
]  # infinite angles are cut to their largest by Blender, as its fields show


@pytest.mark.parametrize(("kind", "name", "value"), LAMPS)
def test_lamps(scene, kind, name, value):  # noqa: F811
    quad()
    shape = {"shape": "RECTANGLE"} if kind == "AREA" else {}
    lamp(kind, **{**shape, name: (value, 1, 1) if name == "color" else value})
    assert told("Lamp")


@pytest.mark.parametrize("kind", ["POINT", "SUN", "SPOT", "AREA"])
def test_lamps_without_power_or_colour(scene, kind):  # noqa: F811
    quad()
    thing = lamp(kind, energy=0.0)
    assert told("Lamp", "without power")
    thing.data.energy, thing.data.color = 1.0, (0, 0, 0)
    assert told("Lamp", "black colour")


@pytest.mark.parametrize("scale", [(NAN, 1, 1), (0, 0, 0)])
def test_places_of_lamps(scene, scale):  # noqa: F811
    quad()
    lamp("AREA").scale = scale
    assert told("Lamp")


SHADERS = [
    *("BsdfPrincipled", "BsdfDiffuse", "BsdfAnisotropic", "BsdfGlass", "BsdfRefraction"),
    *("BsdfTransparent", "BsdfTranslucent", "BsdfSheen", "BsdfToon"),
    *(
        ("BsdfMetallic",) if hasattr(bpy.types, "ShaderNodeBsdfMetallic") else ()
    ),  # from Blender 4.3
    *("SubsurfaceScattering", "Emission", "VolumeScatter", "VolumeAbsorption", "VolumePrincipled"),
]
IDLE = {"Weight", "Normal", "Coat Normal", "Tangent"}
"""Inputs that count only where they are linked."""
NEEDED = {
    "Coat Weight": 0.5,
    "Sheen Weight": 0.5,
    "Transmission Weight": 0.5,
    "Subsurface Weight": 0.5,
    "Emission Strength": 1.0,
    "Anisotropic": 0.5,
    "Blackbody Intensity": 0.5,
}
"""What must be above 0 for other inputs to count."""


def with_first(kept, value):
    """A socket's value with one number put in."""
    return value if isinstance(kept, float) else (value, *kept[1:])


def held(socket):
    """The number or numbers that an input holds; None for what it cannot hold."""
    value = getattr(socket, "default_value", None)
    if isinstance(value, float):
        return value
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else None


def is_bad(value) -> bool:
    return not (np.abs(np.ravel(value)) < LARGEST).all()


@pytest.mark.parametrize("value", [NAN, INF])
@pytest.mark.parametrize("kind", SHADERS)
def test_shaders(scene, kind, value):  # noqa: F811
    shader = Shader("Clay", f"ShaderNode{kind}")
    if kind.startswith("Volume"):
        shader.link(shader.shader, 0, shader.output, "Volume")
    for name, needed in NEEDED.items():
        if name in shader.shader.inputs:
            shader.shader.inputs[name].default_value = needed
    before, silent = export().scene.materials, []
    for socket in shader.shader.inputs:
        kept = held(socket)
        if kept is None or socket.name in IDLE:
            continue
        socket.default_value = with_first(kept, value)
        if is_bad(held(socket)) and not told("Clay") and export().scene.materials != before:
            silent.append(socket.name)
        socket.default_value = kept
    assert not silent


@pytest.mark.parametrize("home", ["WORLD", "POINT"])
@pytest.mark.parametrize("name", ["Color", "Strength"])
def test_what_shines(scene, home, name):  # noqa: F811
    bare = Bare(home)
    node = bare.node("ShaderNodeEmission")
    bare.tree.links.new(node.outputs[0], bare.output.inputs["Surface"])
    for value in (NAN, INF):
        node.inputs[name].default_value = with_first(held(node.inputs[name]), value)
        assert told("World" if home == "WORLD" else "Light")


def _mapped(node) -> None:
    node.texture_mapping.scale = (1, NAN, 1)


def _sky(name: str, value: float = NAN):
    return "ShaderNodeTexSky", lambda node: setattr(node, name, value)


HELD = {
    "a Brick's offset": ("ShaderNodeTexBrick", lambda node: setattr(node, "offset", NAN)),
    "a Brick's squash": ("ShaderNodeTexBrick", lambda node: setattr(node, "squash", NAN)),
    "a texture's mapping": ("ShaderNodeTexChecker", _mapped),
    "an image's mapping": ("ShaderNodeTexImage", _mapped),
    "a direction": (
        "ShaderNodeNormal",
        lambda node: setattr(node.outputs[0], "default_value", (NAN, 0, 1)),
    ),
    "a ramp's colour": (
        "ShaderNodeValToRGB",
        lambda node: setattr(node.color_ramp.elements[0], "color", (NAN, 0, 0, 1)),
    ),
    "a ramp's place": (
        "ShaderNodeValToRGB",
        lambda node: setattr(node.color_ramp.elements[0], "position", NAN),
    ),
    "a sky's sun": _sky("sun_elevation"),
    "a sky's sun at infinity": _sky("sun_elevation", INF),
    "a sky's side": _sky("sun_rotation"),
    "a sky's height": _sky("altitude"),
    "a sky's air": _sky("air_density"),
    "a sky's disc": _sky("sun_size"),
    "a number": (
        "ShaderNodeValue",
        lambda node: setattr(node.outputs[0], "default_value", NAN),
    ),
}
"""What a node holds beside its inputs."""


@pytest.mark.parametrize("home", ["Clay", "World"])
@pytest.mark.parametrize("what", HELD)
def test_settings_of_nodes(scene, what, home):  # noqa: F811
    kind, spoil = HELD[what]
    made = Shader("Clay", "ShaderNodeEmission") if home == "Clay" else Bare("WORLD")
    node = made.node(kind)
    if home == "Clay":
        shine = made.shader
    else:
        shine = made.node("ShaderNodeBackground")
        made.tree.links.new(shine.outputs[0], made.output.inputs["Surface"])
    made.tree.links.new(node.outputs[0], shine.inputs["Color"])
    if kind != "ShaderNodeTexSky":  # a sky takes a second
        assert not told(home, "not finite")
    spoil(node)
    assert told(home, "not finite")


@pytest.mark.parametrize(("kind", "name"), [(k, n) for k, names in RANGES.items() for n in names])
def test_what_goes_beyond_its_range(scene, kind, name):  # noqa: F811
    shader = Shader("Clay", kind)
    if "Volume" in kind:
        shader.link(shader.shader, 0, shader.output, "Volume")
    if kind == "ShaderNodeBsdfGlass":
        shader.shader.inputs["Roughness"].default_value = 0.5
    low, high = RANGES[kind][name]
    number = shader.node("ShaderNodeValue")
    if name not in shader.shader.inputs:
        return
    shader.link(number, 0, shader.shader, name)
    for end, sign in ((low, -1), (high, 1)):
        if math.isfinite(end):
            number.outputs[0].default_value = end - sign * 1e-3
            assert not told("Clay", "range", f"'{name}'")
            number.outputs[0].default_value = end + sign * 0.25
            assert told("Clay", "range", f"'{name}'")


CAMERAS = [
    *(("PERSP", name, value) for name in ("lens", "shift_x", "sensor_width") for value in (NAN,)),
    *(("PERSP", name, value) for name in ("angle", "shift_y") for value in (NAN, INF)),
    *(("PERSP", "angle", value) for value in (-1.0, 0.0)),
    *(("ORTHO", "ortho_scale", value) for value in (NAN, 0.0)),
    *(("PANO", name, NAN) for name in ("latitude_min", "longitude_max")),
    *(("PERSP", name, NAN) for name in ("clip_start", "clip_end")),
    *(("PERSP", "clip_start", value) for value in (INF, 1e6)),
    ("PERSP", "clip_end", -1.0),
]


@pytest.mark.parametrize(("kind", "name", "value"), CAMERAS)
def test_cameras(scene, kind, name, value):  # noqa: F811
    scene.camera.data.type = kind
    setattr(scene.camera.data, name, value)
    with pytest.raises(ExportError, match=r"'Camera'.*(set|use)"):
        export()


@pytest.mark.parametrize(
    ("name", "value"),
    [("angle", -1.0), ("focus_distance", NAN), ("focus_distance", 0.0), ("aperture_fstop", NAN)]
    + [("aperture_ratio", NAN), ("aperture_rotation", NAN)],
)
def test_lenses(scene, name, value):  # noqa: F811
    scene.camera.data.dof.use_dof = True
    camera = scene.camera.data
    camera.type = "PANO"
    setattr(camera if name == "angle" else camera.dof, name, value)
    assert told("Camera")


def _spoiled_mesh():
    return mesh_object("Thing", [(NAN, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 1, 2)])


def _with(name: str, value):
    thing = quad("Thing")
    setattr(thing, name, value)
    return thing


def _pictured(image) -> None:
    shader = Shader("Thing")
    node = shader.node("ShaderNodeTexImage")
    node.image = image
    shader.link(node, "Color", shader.shader, "Color")


def _missing_image() -> None:
    image = bpy.data.images.new("Thing", 1, 1)
    image.source, image.filepath = "FILE", "/nowhere/thing.png"
    _pictured(image)


THINGS = {
    "a vertex": _spoiled_mesh,
    "a place": lambda: _with("location", (NAN, 0, 0)),
    "a size": lambda: _with("scale", (1, NAN, 1)),
    "a turn": lambda: _with("rotation_euler", (NAN, 0, 0)),
    "an image that is not there": _missing_image,
    "no image": lambda: _pictured(None),
}


@pytest.mark.parametrize("what", THINGS)
def test_things(scene, what):  # noqa: F811
    THINGS[what]()
    assert told("Thing")


def test_what_is_empty_is_nothing(scene):  # noqa: F811
    """A mesh without faces or without vertices, and a slot without a material, as in Cycles."""
    mesh_object("Nothing", [], [])
    mesh_object("Points", [(0, 0, 0)], [])
    quad("Bare", None)
    result = export()
    assert result.notes == () and [i.name for i in result.scene.instances] == ["Bare"]


@pytest.mark.parametrize("name", ["start", "depth", "distance"])
def test_distances_of_passes(scene, name):  # noqa: F811
    scene.world = bpy.data.worlds.new("World")
    owner = scene.world.light_settings if name == "distance" else scene.world.mist_settings
    setattr(owner, name, NAN)
    assert told("World", "Mist")
    setattr(owner, name, INF)  # as far as numbers go
    assert not told("World")
