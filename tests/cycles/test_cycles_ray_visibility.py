"""Objects that some rays do not see, over floors that reflect, beside Cycles' full light."""

from __future__ import annotations

from dataclasses import fields

import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.engine import Settings
from glint.engine.settings import OFFERED
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, cube, lambert, moved, plane

SIDE = 40


def principled(roughness: float, metallic: float, gray: float):
    material = bpy.data.materials.new("Paint")
    cycles.use_nodes(material)
    node = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    node.inputs["Base Color"].default_value = (gray, gray, gray, 1)
    node.inputs["Roughness"].default_value, node.inputs["Metallic"].default_value = (
        roughness,
        metallic,
    )
    return material


def sky() -> None:
    """A world that is brighter above."""
    tree = bpy.context.scene.world.node_tree
    place, parts = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp = tree.nodes.new("ShaderNodeMapRange")
    ramp.inputs["From Min"].default_value, ramp.inputs["To Min"].default_value = -1.0, 0.2
    tree.links.new(place.outputs["Generated"], parts.inputs[0])
    tree.links.new(parts.outputs["Z"], ramp.inputs["Value"])
    background = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground")
    tree.links.new(ramp.outputs[0], background.inputs["Strength"])


def box_on_a_floor(paint: tuple, lit: str, flag: str):
    scene = cycles.empty_scene(SIDE, SIDE)
    add(scene, "floor", plane(4, principled(*paint)))
    box = add(scene, "box", cube(lambert((0.6, 0.3, 0.1))), moved(0, 0.6, 1.1, 1.2, 0.4, 1.0))
    if lit == "lamp":
        add_light(scene, "AREA", (0, 3, 3.2), (0, 0, 0.3), energy=500).data.size = 3.0
    else:
        cycles.set_world(scene, (0.5, 0.6, 0.8))
        if lit == "sky":
            sky()
    setattr(box, flag, False)
    add_camera(scene, (0, -6, 2.5), (0, 0, 0.5), lens=40)
    return scene


def before_the_box(scene) -> tuple[float, float]:
    """Means of what is seen of the floor in front, of both engines as they are at first."""
    names = {field.name for field in fields(Settings)} - {"passes", "region", "backend"}
    offered = {name: getattr(OFFERED, name) for name in names}
    left, low, right, high = SIDE // 5, 3, SIDE * 4 // 5, SIDE * 2 // 5
    border = scene.render
    border.use_border = border.use_crop_to_border = True
    border.border_min_x, border.border_max_x = (left + 0.01) / SIDE, (right + 0.01) / SIDE
    border.border_min_y, border.border_max_y = (low + 0.01) / SIDE, (high + 0.01) / SIDE
    glint = render_glint(scene, "NATIVE", **{**offered, "samples": 32}).combined
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 256, False
    scene.cycles.use_adaptive_sampling = False
    truth = cycles.render_passes(scene)["Combined"]
    assert glint.shape == truth.shape == (high - low, right - left, 4)
    return float(glint[..., :3].mean()), float(truth[..., :3].mean())


METAL, ROUGHER, PLASTIC = (0.15, 1.0, 0.8), (0.4, 1.0, 0.8), (0.2, 0.0, 0.05)
PAINT, MATT = (0.5, 0.0, 0.5), (1.0, 0.0, 0.8)


@pytest.mark.slow
@pytest.mark.parametrize("flag", ["visible_glossy", "visible_shadow"])
@pytest.mark.parametrize("lit", ["world", "sky", "lamp"])
@pytest.mark.parametrize("paint", [METAL, ROUGHER, PLASTIC])
def test_what_some_rays_do_not_see_is_as_bright_in_floors(paint, lit, flag):
    """Lamps less closely: what is drawn from lobes, and how much it weighs, is Cycles' own. Metals
    that show a sky through what casts no shadow but is seen in them likewise: directions drawn from
    the sky and from lobes do not meet the same there.
    """
    glint, truth = before_the_box(box_on_a_floor(paint, lit, flag))
    apart = lit == "lamp" or (lit == "sky" and flag == "visible_shadow" and paint[1] > 0)
    assert glint == pytest.approx(truth, rel=0.12 if apart else 0.06)


@pytest.mark.parametrize("flag", ["visible_diffuse", "visible_shadow"])
@pytest.mark.parametrize("lit", ["world", "sky", "lamp"])
def test_matt_floors_before_what_some_rays_do_not_see(lit, flag) -> None:
    glint, truth = before_the_box(box_on_a_floor(MATT, lit, flag))
    assert glint == pytest.approx(truth, rel=0.035)


@pytest.mark.parametrize("flag", ["diffuse", "glossy"])
@pytest.mark.parametrize("lit", ["world", "sky"])
def test_worlds_light_what_they_are_visible_to(lit, flag) -> None:
    scene = box_on_a_floor(PLASTIC, lit, "is_holdout")
    setattr(scene.world.cycles_visibility, flag, False)
    glint, truth = before_the_box(scene)
    assert glint == pytest.approx(truth, rel=0.06)


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize("kind", ["ShaderNodeBsdfGlass", "ShaderNodeBsdfAnisotropic"])
@pytest.mark.parametrize("flag", ["camera", "glossy", "transmission"])
def test_mirrors_and_glass_see_the_world_that_they_are_to(flag, kind, backend) -> None:
    """A plate with the sky behind and before it."""
    scene = cycles.empty_scene(SIDE, SIDE)
    cycles.set_world(scene, (0.3, 0.5, 0.9))
    setattr(scene.world.cycles_visibility, flag, False)
    material = bpy.data.materials.new("Clear")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    shader, output = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
    shader.inputs["Roughness"].default_value = 0.0
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    add(scene, "plate", cube(material), moved(0, 0.6, 0.0, 1.2, 0.1, 1.2))
    add_camera(scene, (0, -6, 0.5), (0, 0, 0.5), lens=40)
    glint = render_glint(scene, backend, samples=8, max_bounces=8).combined
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    truth = cycles.render_passes(scene)["Combined"]
    assert glint[..., 2].mean() == pytest.approx(truth[..., 2].mean(), abs=0.01)


def lit_floor(paint: tuple, kind: str, flag: str, fog: float):
    """A floor before a lamp, or before a box that glows, without one of the flags."""
    scene = cycles.empty_scene(SIDE, SIDE)
    cycles.set_world(scene, (0.05, 0.05, 0.05))
    add(scene, "floor", plane(4, principled(*paint)))
    if kind == "MESH":
        shader = principled(0.5, 0.0, 0.0)
        node = next(n for n in shader.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        node.inputs["Emission Color"].default_value = (1.0, 0.6, 0.3, 1)
        node.inputs["Emission Strength"].default_value = 3.0
        thing = add(scene, "box", cube(shader), moved(0, 0.6, 1.1, 1.2, 0.4, 1.0))
    else:
        thing = add_light(scene, kind, (0, 3, 3.2), (0, 0, 0.3), energy=200)
        if kind == "AREA":
            thing.data.size = 3.0
    if fog:
        tree = scene.world.node_tree
        scatter = tree.nodes.new("ShaderNodeVolumeScatter")
        scatter.inputs["Density"].default_value = fog
        output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputWorld")
        tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    setattr(thing, flag, False)
    add_camera(scene, (0, -6, 2.5), (0, 0, 0.5), lens=40)
    return scene


@pytest.mark.parametrize(
    ("paint", "kind", "flag", "fog"),
    [
        (PAINT, "MESH", "visible_diffuse", 0.0),
        (PAINT, "MESH", "visible_glossy", 0.0),
        (METAL, "MESH", "visible_glossy", 0.0),
        (PAINT, "AREA", "visible_diffuse", 0.0),
        (PAINT, "AREA", "visible_glossy", 0.0),
        (PLASTIC, "POINT", "visible_glossy", 0.0),
        (MATT, "MESH", "visible_volume_scatter", 0.03),
        (MATT, "POINT", "visible_volume_scatter", 0.03),
    ],
)
def test_lights_light_what_they_are_visible_to(paint, kind, flag, fog) -> None:
    glint, truth = before_the_box(lit_floor(paint, kind, flag, fog))
    assert glint == pytest.approx(truth, rel=0.07)
