"""Shaders whose inputs are no numbers, or the smallest and largest, by hand and by nodes: what is
exported can be drawn, and the picture is finite.
"""

import bpy
import numpy as np
import pytest

from export_support import Shader, scene, set_inputs  # noqa: F401
from glint.engine import Settings, render

LARGE = 3e38
BY_HAND = (np.nan, np.inf, -np.inf, -1.0, 0.0, 1e-30, 1e30, LARGE)
SOME = {"Thin Film Thickness": 300.0, "Subsurface Weight": 0.5, "Coat Weight": 0.5}
SOME |= {"Diffuse Roughness": 0.5, "Metallic": 0.3, "Transmission Weight": 0.3}
KINDS = {
    "toon": ("BsdfToon", {"component": "DIFFUSE"}),
    "glossy toon": ("BsdfToon", {"component": "GLOSSY"}),
    "subsurface": ("SubsurfaceScattering", {"falloff": "BURLEY"}),
    "walk": ("SubsurfaceScattering", {"falloff": "RANDOM_WALK"}),
    "skin": ("SubsurfaceScattering", {"falloff": "RANDOM_WALK_SKIN"}),
    "diffuse": ("BsdfDiffuse", {}),
    "metal": ("BsdfMetallic", {"fresnel_type": "F82"}),
    "conductor": ("BsdfMetallic", {"fresnel_type": "PHYSICAL_CONDUCTOR"}),
    "glass": ("BsdfGlass", {}),
    "refraction": ("BsdfRefraction", {}),
    "holdout": ("Holdout", {}),
    "principled": ("BsdfPrincipled", {}),
}
PLAN = Settings(samples=1, light_samples=1)


def _shader(name: str) -> Shader:
    kind, settings = KINDS[name]
    if not hasattr(bpy.types, f"ShaderNode{kind}"):
        pytest.skip("the node is of Blender 4.3")
    shader = Shader(shader=f"ShaderNode{kind}")
    for key, value in settings.items():
        setattr(shader.shader, key, value)
    given = {key: value for key, value in SOME.items() if key in shader.shader.inputs}
    for key, value in given.items():
        shader.shader.inputs[key].default_value = value
    shader.quad.rotation_euler = (np.pi / 2, 0, 0)
    return shader


def _numeric(shader: Shader) -> list:
    """Its inputs that are numbers, vectors and colours."""
    return [x for x in shader.shader.inputs if x.type in ("VALUE", "RGBA", "VECTOR") and x.enabled]


def _assert_drawn(shader: Shader) -> None:
    shader.quad.data.update()
    drawn = shader.export()[0].scene
    assert np.isfinite(render(drawn, PLAN).combined).all()


@pytest.mark.parametrize("value", BY_HAND)
@pytest.mark.parametrize("name", KINDS)
def test_by_hand(scene, name, value):  # noqa: F811
    """All inputs at once."""
    scene.render.resolution_percentage = 6
    shader = _shader(name)
    for socket in _numeric(shader):
        many = socket.type != "VALUE"
        socket.default_value = (value,) * len(socket.default_value) if many else value
    _assert_drawn(shader)


def _driver(shader: Shader, size: float, difference: bool):
    """A number that varies over the surface: e^size, or the difference of two such."""
    place = shader.node("ShaderNodeNewGeometry")
    apart = shader.node("ShaderNodeSeparateXYZ")
    shader.link(place, "Position", apart, 0)
    powers = []
    for axis in (0, 2):
        near = shader.node("ShaderNodeMath", operation="MULTIPLY_ADD")
        shader.link(apart, axis, near, 0)
        near.inputs[1].default_value, near.inputs[2].default_value = 0.01, size
        power = shader.node("ShaderNodeMath", operation="EXPONENT")
        shader.link(near, 0, power, 0)
        powers.append(power)
    if not difference:
        return powers[0]
    last = shader.node("ShaderNodeMath", operation="SUBTRACT")
    for k, power in enumerate(powers):
        shader.link(power, 0, last, k)
    return last


@pytest.mark.parametrize(
    ("size", "difference"), [(1000.0, True), (1000.0, False), (69.0, False), (69.0, True)],
    ids=["no number", "infinite", "1e30", "1e28 to both sides"],
)  # fmt: skip
@pytest.mark.parametrize("name", [name for name in KINDS if name != "holdout"])
def test_by_nodes(scene, name, size, difference):  # noqa: F811
    """All inputs at once."""
    scene.render.resolution_percentage = 6
    shader = _shader(name)
    driver = _driver(shader, size, difference)
    for socket in _numeric(shader):
        if socket.name != "Weight":
            shader.tree.links.new(driver.outputs[0], socket)
    _assert_drawn(shader)


@pytest.mark.parametrize("name", ["glass", "refraction", "principled"])
def test_indices_of_refraction_have_a_largest(scene, name):  # noqa: F811
    shader = _shader(name)
    set_inputs(shader.shader, IOR=1e30)
    assert max(lobe.ior for lobe in shader.export()[1]) == 1e6
