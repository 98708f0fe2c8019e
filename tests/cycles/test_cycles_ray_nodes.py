"""Nodes that ask the scene for rays against Cycles at many samples."""

from math import pi

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint.addon.export import export_scene
from glint.engine import Settings, render

bpy = cycles.bpy
CYCLES_SAMPLES = 256


def mesh(kind: str, name: str, matrix, material, **size):
    """An object that an operator of meshes adds."""
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**size)
    item = bpy.context.object
    item.name, item.matrix_world = name, matrix
    item.data.materials.append(material)
    return item


def asking(node: str, output: str, **inputs):
    """(material, tree, node): its output is the emission."""
    material, tree, end = build.new_material(node)
    asked = tree.nodes.new(node)
    for name, value in inputs.items():
        asked.inputs[name].default_value = value
    shines = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(asked.outputs[output], shines.inputs["Color"])
    tree.links.new(shines.outputs[0], end.inputs["Surface"])
    return material, tree, asked


def occlusion(output: str = "AO", inside=False, only_local=False, **inputs):
    material, tree, node = asking("ShaderNodeAmbientOcclusion", output, **inputs)
    node.inside, node.only_local = inside, only_local
    return material, tree, node


def cube_on_plane(node=None, **given):
    """Touching it, with a ball beside; bottom and floor are at one place. node: makes it and what
    feeds it.
    """
    from mathutils import Euler, Matrix

    scene = cycles.empty_scene(32, 32)
    material = (node or occlusion)(**given)[0]
    mesh("plane", "floor", Matrix(), material, size=8)
    turn = Euler((0, 0, 0.4)).to_matrix().to_4x4()
    mesh("cube", "cube", build.moved(0, 0, 1) @ turn, material)
    mesh("uv_sphere", "ball", build.moved(1.6, -1.2, 0.5, 0.5, 0.5, 0.5), material, segments=24)
    build.add_camera(scene, location=(4.5, -5.5, 4.0), target=(0.3, -0.3, 0.6))
    return scene


def plain():
    return cube_on_plane()


def near():
    return cube_on_plane(Distance=0.4)


def coloured():
    return cube_on_plane(output="Color", Color=(0.9, 0.4, 0.1, 1))


def local():
    return cube_on_plane(only_local=True, Distance=3.0)


def inside():
    """How thick things are; the cube's floor is the plane's as well."""
    return cube_on_plane(inside=True, Distance=1.5)


def inside_local():
    return cube_on_plane(inside=True, only_local=True, Distance=1.5)


def world_distance():
    """A Distance of 0 is the world's."""
    scene = cube_on_plane(Distance=0.0)
    scene.world.light_settings.distance = 0.7
    return scene


def by_height():
    """Looks as far as it is high."""
    material, tree, node = occlusion()
    place = tree.nodes.new("ShaderNodeNewGeometry")
    parts = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(place.outputs["Position"], parts.inputs[0])
    tree.links.new(parts.outputs["Z"], node.inputs["Distance"])
    return material, tree, node


def varied_distance():
    return cube_on_plane(by_height)


def over_waves():
    material, tree, node = occlusion(Distance=1.5)
    waves = tree.nodes.new("ShaderNodeTexWave")
    waves.inputs["Scale"].default_value = 0.4
    bump = tree.nodes.new("ShaderNodeBump")
    bump.inputs["Distance"].default_value = 0.6
    if "Filter Width" in bump.inputs:
        bump.inputs["Filter Width"].default_value = 0.1
    place = tree.nodes.new("ShaderNodeNewGeometry")
    tree.links.new(place.outputs["Position"], waves.inputs["Vector"])
    tree.links.new(waves.outputs["Fac"], bump.inputs["Height"])
    tree.links.new(bump.outputs["Normal"], node.inputs["Normal"])
    return material, tree, node


def bumped():
    return cube_on_plane(over_waves)


def cavity():
    """A room seen through its missing side, mirrored, with a cube of another material in it."""
    from mathutils import Matrix

    scene = cycles.empty_scene(32, 32)
    room = mesh("cube", "room", Matrix.Diagonal((-1.5, 1.0, 1.0, 1.0)), occlusion()[0])
    import bmesh

    edited = bmesh.new()
    edited.from_mesh(room.data)
    edited.faces.ensure_lookup_table()
    front = [f for f in edited.faces if f.normal.y < -0.9]
    bmesh.ops.delete(edited, geom=front, context="FACES_ONLY")
    edited.to_mesh(room.data)
    clear = build.new_material("clear")
    node = clear[1].nodes.new("ShaderNodeBsdfTransparent")
    clear[1].links.new(node.outputs[0], clear[2].inputs["Surface"])
    mesh("cube", "clear", build.moved(0.6, 0.2, -0.6, 0.4, 0.4, 0.4), clear[0])
    build.add_camera(scene, location=(0.2, -4.5, 0.4), target=(0, 0, 0))
    return scene


OCCLUSIONS = {
    make.__name__: make
    for make in (
        plain,
        near,
        coloured,
        local,
        inside,
        inside_local,
        world_distance,
        varied_distance,
        bumped,
        cavity,
    )
}


def both(scene, cycles_samples: int = CYCLES_SAMPLES, **settings):
    """Glint's picture and Cycles', RGB, and the export's notes."""
    export = export_scene(bpy.context.evaluated_depsgraph_get())
    chosen = Settings(**{"samples": 64, "filter_width": 0.0, **settings})
    glint = render(export.scene, chosen).combined[..., :3]
    truth = cycles.render_cycles(scene, cycles_samples)["Combined"][..., :3]
    return glint.astype(float), truth.astype(float), export.notes


@pytest.mark.parametrize("name", OCCLUSIONS)
def test_cycles_has_the_same_occlusion(name: str) -> None:
    """Each pixel of Cycles' is off by up to half of 1 / √N for N directions of all samples."""
    glint, truth, notes = both(OCCLUSIONS[name]())
    assert not any("Occlusion" in note for note in notes)
    assert truth.std() > 0.05
    noise = 0.5 / np.sqrt(16 * CYCLES_SAMPLES)
    assert abs((glint - truth).mean()) < 1e-3
    assert np.sqrt(((glint - truth) ** 2).mean()) < noise


@pytest.mark.parametrize("where", ["world", "lamp", "displacement"])
def test_nothing_is_near_where_there_is_no_surface(where: str) -> None:
    """As in Cycles; and it is told."""
    scene = cycles.empty_scene(16, 16)
    material, tree, output = build.new_material("white")
    white = tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(white.outputs[0], output.inputs["Surface"])
    from mathutils import Matrix

    floor = mesh("grid", "floor", Matrix(), material, size=8, x_subdivisions=8, y_subdivisions=8)
    build.add_camera(scene, location=(0, -5, 4), target=(0, 0, 0))
    light = bpy.data.lights.new("sun", "SUN")
    light.angle, light.energy = 0.0, pi
    build.add(scene, "sun", light, build.looking_at((1, -1, 3), (0, 0, 0)))
    if where == "displacement":
        bump = tree.nodes.new("ShaderNodeDisplacement")
        asked = tree.nodes.new("ShaderNodeAmbientOcclusion")
        tree.links.new(asked.outputs["AO"], bump.inputs["Height"])
        tree.links.new(bump.outputs[0], output.inputs["Displacement"])
        material.displacement_method = "DISPLACEMENT"
    else:
        owner = scene.world if where == "world" else light
        if where == "lamp":
            light.use_nodes = True
        nodes = owner.node_tree.nodes
        kind = "ShaderNodeBackground" if where == "world" else "ShaderNodeEmission"
        shines = next(n for n in nodes if n.bl_idname == kind)
        asked = nodes.new("ShaderNodeAmbientOcclusion")
        owner.node_tree.links.new(asked.outputs["AO"], shines.inputs["Color"])
        if where == "world":
            bpy.data.objects.remove(floor)
    glint, truth, notes = both(scene)
    assert any("Ambient Occlusion" in note for note in notes), notes
    assert truth.max() > 0.1
    np.testing.assert_allclose(glint, truth, atol=5e-3)


# --- bevels


def seen_normal(radius=0.25, samples=64, **given):
    """The normal over 2, plus 1/2."""
    material, tree, end = build.new_material("bevel")
    node = tree.nodes.new("ShaderNodeBevel")
    node.samples, node.inputs["Radius"].default_value = samples, radius
    half = tree.nodes.new("ShaderNodeVectorMath")
    half.operation = "MULTIPLY_ADD"
    for k in (1, 2):
        half.inputs[k].default_value = (0.5, 0.5, 0.5)
    shines = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(node.outputs["Normal"], half.inputs[0])
    tree.links.new(half.outputs[0], shines.inputs["Color"])
    tree.links.new(shines.outputs[0], end.inputs["Surface"])
    return material, tree, node


def bumped_bevel():
    material, tree, node = seen_normal()
    waves, bump = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexWave", "Bump"))
    waves.inputs["Scale"].default_value, bump.inputs["Distance"].default_value = 0.4, 0.3
    if "Filter Width" in bump.inputs:
        bump.inputs["Filter Width"].default_value = 0.1
    place = tree.nodes.new("ShaderNodeNewGeometry")
    tree.links.new(place.outputs["Position"], waves.inputs["Vector"])
    tree.links.new(waves.outputs["Fac"], bump.inputs["Height"])
    tree.links.new(bump.outputs["Normal"], node.inputs["Normal"])
    return material, tree, node


def lit_bevel(samples=64):
    """White, under a sun; what Cycles adds to bent normals is off."""
    material, tree, end = build.new_material("lit")
    material.cycles.use_bump_map_correction = False
    node = tree.nodes.new("ShaderNodeBevel")
    node.samples, node.inputs["Radius"].default_value = samples, 0.25
    white = tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(node.outputs["Normal"], white.inputs["Normal"])
    tree.links.new(white.outputs[0], end.inputs["Surface"])
    return material, tree, node


def turned_cube(make, mirrored=False, **given):
    from mathutils import Euler, Matrix

    scene = cycles.empty_scene(32, 32)
    material = make(**given)[0]
    turn = Euler((0.3, 0.2, 0.4)).to_matrix().to_4x4()
    stretch = Matrix.Diagonal((-1.2, 0.9, 1, 1)) if mirrored else Matrix()
    mesh("cube", "cube", turn @ stretch, material)
    mesh("cube", "wall", build.moved(2.2, 0, 0, 1, 3, 3), material)
    build.add_camera(scene, location=(-3.4, -4.4, 3.4), target=(0, 0, 0))
    light = bpy.data.lights.new("sun", "SUN")
    light.angle, light.energy = 0.0, pi
    build.add(scene, "sun", light, build.looking_at((-1, -2.5, 3), (0, 0, 0)))
    return scene


BEVELS = {
    "plain": {"make": seen_normal},
    "mirrored": {"make": seen_normal, "mirrored": True},
    "bumped": {"make": bumped_bevel},
    "lit": {"make": lit_bevel},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BEVELS)
def test_cycles_has_the_same_bevel(name: str) -> None:
    """With many samples a point. Samples of a pixel whose centre is on a silhouette show the one
    side in Glint and both in Cycles, whose places differ by 4e-6 pixels.
    """
    glint, truth, notes = both(turned_cube(**BEVELS[name]))
    assert not any("Bevel" in note for note in notes)
    assert truth.std() > 0.05
    apart = np.abs(glint - truth)
    same = apart.max(-1) < 0.02
    assert same.mean() > 0.996
    assert np.sqrt((apart[same] ** 2).mean()) < 1e-3


# --- rays


def cast(output, direction=None, lifted=0.0, only_local=False, length=3.0):
    """Shows an output without its signs."""
    material, tree, end = build.new_material("cast")
    node = tree.nodes.new("ShaderNodeRaycast")
    node.only_local, node.inputs["Length"].default_value = only_local, length
    if direction is not None:
        along = tree.nodes.new("ShaderNodeCombineXYZ")
        for socket, value in zip(along.inputs, direction, strict=True):
            socket.default_value = value
        tree.links.new(along.outputs[0], node.inputs["Direction"])
    if lifted:
        place, more = (
            tree.nodes.new(f"ShaderNode{name}") for name in ("NewGeometry", "VectorMath")
        )
        more.inputs[1].default_value = (0.0, 0.0, lifted)
        tree.links.new(place.outputs["Position"], more.inputs[0])
        tree.links.new(more.outputs[0], node.inputs["Position"])
    half = tree.nodes.new("ShaderNodeVectorMath")
    half.operation = "ABSOLUTE"
    shines = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(node.outputs[output], half.inputs[0])
    tree.links.new(half.outputs[0], shines.inputs["Color"])
    tree.links.new(shines.outputs[0], end.inputs["Surface"])
    return material, tree, node


CASTS = {
    "hit": {"output": "Is Hit", "direction": (0.5, -0.4, 0.3)},
    "distance": {"output": "Hit Distance", "direction": (1.0, -0.8, 0.6)},
    "distance-along-normals": {"output": "Hit Distance"},
    "place": {"output": "Hit Position", "direction": (0.5, -0.4, 0.3)},
    "normal": {"output": "Hit Normal", "direction": (0.5, -0.4, 0.3)},
    "own": {"output": "Self Hit", "direction": (0.2, 0.1, -1.0), "lifted": 2.5},
    "lifted": {"output": "Hit Distance", "direction": (0.2, 0.1, -1.0), "lifted": 2.5},
    "through": {"output": "Hit Distance", "direction": (0.2, 0.3, -1.0), "only_local": True},
}


@pytest.mark.skipif(bpy.app.version < (5, 2), reason="the node is new in Blender 5.2")
@pytest.mark.parametrize("name", CASTS)
def test_cycles_casts_the_same_rays(name: str) -> None:
    glint, truth, notes = both(cube_on_plane(cast, **CASTS[name]), 1, samples=1)
    assert not any("Raycast" in note for note in notes)
    assert truth.std() > 0.04
    np.testing.assert_allclose(glint, truth, atol=1e-4)


SAMPLED = {
    "colour": ("RGBA", "FLOAT_COLOR", "CORNER", ""),
    "alpha": ("RGBA", "FLOAT_COLOR", "POINT", " Alpha"),
    "alpha-of-a-vector": ("RGBA", "FLOAT_VECTOR", "POINT", " Alpha"),
    "vector": ("VECTOR", "FLOAT_VECTOR", "POINT", ""),
    "vector-of-a-colour": ("VECTOR", "FLOAT_COLOR", "POINT", ""),
    "number": ("FLOAT", "FLOAT", "FACE", ""),
    "number-of-a-colour": ("FLOAT", "FLOAT_COLOR", "POINT", ""),
}


def sampled(kind: str, ending: str, name: str = "Col"):
    material, tree, node = cast("Is Hit", direction=(0.5, -0.4, 0.3))
    node.sample_attribute_items.new(kind, "Sampled")
    next(s for s in node.inputs if s.name == "Sampled").default_value = name
    shines = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    tree.links.new(node.outputs[f"Sampled{ending}"], shines.inputs["Color"])
    return material, tree, node


def give(thing, kind: str, domain: str) -> None:
    """Numbers without a pattern, so that interpolation shows."""
    rows = thing.data.attributes.new("Col", kind, domain).data
    name, width = {"FLOAT": ("value", 1), "FLOAT_VECTOR": ("vector", 3)}.get(kind, ("color", 4))
    numbers = np.random.default_rng(3).uniform(0.1, 1.0, width * len(rows))
    rows.foreach_set(name, numbers.astype(np.float32))


@pytest.mark.skipif(bpy.app.version < (5, 2), reason="the node is new in Blender 5.2")
@pytest.mark.parametrize("name", SAMPLED)
def test_attributes_where_a_ray_ends_are_those_of_cycles(name: str) -> None:
    """The ball and the cube are of a material that reads none."""
    kind, data, domain, ending = SAMPLED[name]
    scene = cube_on_plane(sampled, kind=kind, ending=ending)
    other, tree, end = build.new_material("other")
    tree.links.new(tree.nodes.new("ShaderNodeEmission").outputs[0], end.inputs["Surface"])
    for thing in scene.objects:
        if thing.type == "MESH" and not thing.name.startswith("floor"):
            give(thing, data, domain)
            thing.data.materials[0] = other
    glint, truth, notes = both(scene, 1, samples=1)
    assert not any("Raycast" in note for note in notes)
    assert truth.std() > 0.04
    np.testing.assert_allclose(glint, truth, atol=1e-4)


@pytest.mark.skipif(bpy.app.version < (5, 2), reason="the node is new in Blender 5.2")
def test_an_attribute_without_a_name_is_nothing() -> None:
    scene = cube_on_plane(sampled, kind="RGBA", ending="", name="")
    for thing in scene.objects:
        if thing.type == "MESH":
            give(thing, "FLOAT_COLOR", "POINT")
    glint, truth, _ = both(scene, 1, samples=1)
    assert not glint.any() and not truth.any()
