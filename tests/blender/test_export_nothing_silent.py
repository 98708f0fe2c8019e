"""Every setting of a shader node changes the material or is told."""

import bpy
import pytest

from export_support import Shader, export, link, quad, scene  # noqa: F401

IDLE = {"Weight", "Normal", "Coat Normal", "Tangent"}
"""Sockets that users cannot set (Weight), or that count only where they are linked."""
COVERED = ("rendered as diffuse", "is not supported", "The Holdout shader")
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
FAMILIES = {
    "anisotropic": "anisotropy",
    "rotation": "anisotropy",
    "diffuse roughness": "diffuse roughness",
}
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
    family = next(
        (word for start, word in FAMILIES.items() if name.lower().startswith(start)),
        name.split()[0].lower(),
    )
    return any(family in note.lower() or any(text in note for text in COVERED) for note in notes)


@pytest.mark.parametrize("kind", KINDS)
def test_every_input_counts_or_is_told(scene, kind):  # noqa: F811
    shader = Shader(shader=kind)
    for name, value in WITH.get(kind, {}).items():
        if name in shader.shader.inputs:
            shader.shader.inputs[name].default_value = value
    result, before = shader.export()
    silent = []
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
        after, lobes = shader.export()
        socket.default_value = kept
        if lobes == before and after.notes == result.notes and not _told(socket.name, result.notes):
            silent.append(socket.name)
    assert not silent


@pytest.mark.parametrize("distribution", ["BECKMANN", "ASHIKHMIN_SHIRLEY"])
def test_other_microfacets_are_told(scene, distribution):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfAnisotropic")
    shader.shader.distribution = distribution
    assert any("rendered as GGX" in note for note in shader.export()[0].notes)


def test_linking_and_ray_visibility_are_told(scene):  # noqa: F811
    lamp = link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    thing = quad("Thing")
    assert not export().notes
    thing.light_linking.blocker_collection = bpy.data.collections.new("Dark")
    thing.light_linking.receiver_collection = bpy.data.collections.new("Lit")
    lamp.visible_diffuse = False
    thing.visible_transmission = False
    notes = export().notes
    assert any("Shadow linking" in note and "'Thing'" in note for note in notes)
    assert any("Light linking" in note and "'Thing'" in note for note in notes)
    assert any("light matt and glossy surfaces" in note and "'Lamp'" in note for note in notes)
    assert any("Refracted rays" in note and "'Thing'" in note for note in notes)
