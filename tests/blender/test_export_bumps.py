"""Which materials hide light by their bumps, and by which formula."""

from __future__ import annotations

import pytest

from export_support import Shader, bpy, scene  # noqa: F401


def _bump(shader: Shader, target, name: str = "Normal") -> None:
    bump = shader.node("ShaderNodeBump")
    shader.link(shader.node("ShaderNodeTexNoise"), 0, bump, "Height")
    shader.link(bump, 0, target, name)


def _displace(shader: Shader) -> None:
    height = shader.node("ShaderNodeDisplacement")
    shader.link(shader.node("ShaderNodeTexNoise"), 0, height, "Height")
    shader.link(height, 0, shader.output, "Displacement")


def material_of(shader: Shader):
    result, lobes = shader.export()
    assert not result.notes
    return next(m for m in result.scene.materials if m.lobes == lobes)


def newest() -> str:
    return "GGX" if bpy.app.version >= (4, 5, 0) else "CHIANG"


def test_a_bump_node_hides_light_by_the_meshs_normal(scene):  # noqa: F811
    shader = Shader()
    _bump(shader, shader.shader)
    material = material_of(shader)
    assert (material.bump_shadowing, material.base_normal_output) == (newest(), -1)


def test_without_correction_only_sides_count(scene):  # noqa: F811
    shader = Shader()
    _bump(shader, shader.shader)
    shader.material.cycles.use_bump_map_correction = False
    assert material_of(shader).bump_shadowing == "SIDES"


def test_displacement_alone_hides_nothing(scene):  # noqa: F811
    """It is the surface's own normal to Cycles."""
    shader = Shader()
    _displace(shader)
    material = material_of(shader)
    assert material.normal_output >= 0 and material.bump_shadowing == "NONE"


def test_a_bump_on_displacement_is_bent_from_it(scene):  # noqa: F811
    shader = Shader()
    _displace(shader)
    _bump(shader, shader.shader)
    material = material_of(shader)
    assert material.bump_shadowing == newest()
    outputs = material.program.outputs
    assert outputs[material.base_normal_output] != outputs[material.normal_output]


@pytest.mark.parametrize("is_linked", [False, True])
def test_smooth_materials_have_none(scene, is_linked):  # noqa: F811
    shader = Shader()
    if is_linked:  # a bump of a height that is the same all over
        shader.link(shader.node("ShaderNodeBump"), 0, shader.shader, "Normal")
    material = material_of(shader)
    assert (material.normal_output, material.bump_shadowing) == (-1, "NONE")
