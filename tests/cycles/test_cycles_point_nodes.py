"""Nodes that read the shaded point, against Cycles: each output as the light that surfaces give."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import BACKENDS, render_pair, surface_interior
from small_scenes import add, add_camera, ball, mesh, moved

OUTPUTS = [
    ("ShaderNodeTexCoord", name)
    for name in ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")
]
OUTPUTS += [
    ("ShaderNodeNewGeometry", name)
    for name in ("Position", "Normal", "True Normal", "Incoming", "Backfacing")
    + ("Parametric", "Tangent", "Pointiness", "Random Per Island")
]
OUTPUTS += [
    ("ShaderNodeCameraData", name) for name in ("View Vector", "View Z Depth", "View Distance")
]
OUTPUTS += [
    ("ShaderNodeLayerWeight", "Fresnel"),
    ("ShaderNodeLayerWeight", "Facing"),
    ("ShaderNodeFresnel", "Fac"),
    ("ShaderNodeUVMap", "UV"),
    ("ShaderNodeObjectInfo", "Location"),
    ("ShaderNodeLightPath", "Is Camera Ray"),
    ("ShaderNodeVertexColor", "Color"),
    ("ShaderNodeVertexColor", "Alpha"),
]


def shining(node_type: str, output: str):
    """A material that shines with an output of a node."""
    material = bpy.data.materials.new("shown")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(node_type)
    emission = tree.nodes.new("ShaderNodeEmission")
    surface = tree.nodes.new("ShaderNodeOutputMaterial")
    if node_type == "ShaderNodeUVMap":
        node.uv_map = "second"
    if node_type == "ShaderNodeVertexColor":
        node.layer_name = "paint"
    socket = next(s for s in node.outputs if s.name in (output, {"Fac": "Factor"}.get(output)))
    tree.links.new(socket, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], surface.inputs["Surface"])
    return material


def folded(material):
    """Two quads that are seen from in front and from behind, with two UV maps and a colour."""
    vertices = [(-1, -1, 0), (1, -1, 0.2), (1, 1, 0.4), (-1, 1, 0), (-1, -1, 2), (-1, 1, 2.5)]
    made = mesh("folded", vertices, [(0, 1, 2, 3), (0, 4, 5, 3)], material=material)
    random = np.random.default_rng(2)
    for name in ("first", "second"):
        layer = made.uv_layers.new(name=name)
        layer.data.foreach_set("uv", random.uniform(-1, 2, 16).astype(np.float32))
    made.uv_layers["first"].active_render = True
    paint = made.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
    paint.data.foreach_set("color", random.uniform(0, 1, 24).astype(np.float32))
    return made


def fill(scene, material) -> None:
    """The ball is mirrored, not squeezed: Cycles bakes what stands once, and then interpolates
    normals that are unit in the world, not in the object.
    """
    add(scene, "folded", folded(material), moved(-0.8, 0.3, -0.5, 1.3, 0.8, 1.0))
    add(scene, "ball", ball(material=material), moved(1.5, -0.4, 0.3, 0.9, 0.9, -0.9))
    add_camera(scene)


TANGENTS = [
    *(("RADIAL", {"axis": axis}) for axis in "XYZ"),
    *(("UV_MAP", {"uv_map": name}) for name in ("", "map", "none")),
]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("kind", "settings"), TANGENTS)
def test_a_tangent_is_cycles(kind, settings, backend):
    def made():
        material = shining("ShaderNodeTangent", "Tangent")
        node = next(n for n in material.node_tree.nodes if n.type == "TANGENT")
        node.direction_type = kind
        for name, value in settings.items():
            setattr(node, name, value)
        return material

    assert_is_cycles(made, f"tangent-{kind}-{'-'.join(settings.values())}", backend, triangles)


def triangles(scene, material) -> None:
    """Triangles with a map: the tangents of bent quads are means."""
    made = parts(material)
    layer = made.uv_layers.new(name="map")
    random = np.random.default_rng(2).uniform(-1, 2, 2 * len(layer.data)).astype(np.float32)
    layer.data.foreach_set("uv", random)
    add(scene, "parts", made, moved(0, 0, 0.5, 1.1, -1.1, 1.1))
    add_camera(scene)


def parts(material):
    """Parts that share places but no edges, loose edges and vertices, and doubles in one place."""
    random = np.random.default_rng(9)
    vertices, faces = [], []
    for x, y in np.ndindex(4, 4):
        first = len(vertices)
        corners = np.array([(x, y, 0), (x + 1, y, 0), (x + 1, y + 1, 0), (x, y + 1, 0)]) - 2.0
        vertices += [tuple(corner) for corner in corners]
        vertices.append((*(corners.mean(0)[:2]), random.uniform(-2.5, -1.0)))
        faces += [(first + k, first + (k + 1) % 4, first + 4) for k in range(4)]
    made = bpy.data.meshes.new("parts")
    made.from_pydata([*vertices, (3, 3, 3), (4, 4, 4)], [(0, 7), (len(vertices), 3)], faces)
    made.materials.append(material)
    return made


@pytest.mark.parametrize("projection", ["EQUIRECTANGULAR", "MIRROR_BALL"])
@pytest.mark.parametrize("vector", ["none", "normal", "object"])
def test_an_environment_on_a_surface_is_cycles(vector, projection):
    """By the position where nothing comes in."""

    def made():
        material = shining("ShaderNodeTexEnvironment", "Color")
        tree = material.node_tree
        texture = next(node for node in tree.nodes if node.type == "TEX_ENVIRONMENT")
        texture.projection = projection
        texture.image = bpy.data.images.new("picture", 16, 8, float_buffer=True)
        texels = np.random.default_rng(3).uniform(0, 1, (8, 16, 4)).astype(np.float32)
        texels[..., 3] = 1
        texture.image.pixels.foreach_set(texels.reshape(-1))
        texture.image.pack()
        if vector != "none":
            kind, output = IMAGE_VECTORS[vector]
            tree.links.new(tree.nodes.new(kind).outputs[output], texture.inputs["Vector"])
        return material

    assert_is_cycles(made, f"environment-{vector}-{projection}")


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("size", "in_pixels"), [(0.05, False), (0.2, False), (2.0, True), (6.0, True)]
)
def test_a_wireframe_is_cycles(size, in_pixels, backend):
    """But for the pixels on the border of a line."""

    def made():
        material = shining("ShaderNodeWireframe", "Fac")
        node = next(n for n in material.node_tree.nodes if n.type == "WIREFRAME")
        node.inputs["Size"].default_value, node.use_pixel_size = size, in_pixels
        return material

    scene = cycles.empty_scene(64, 64)
    fill(scene, made())
    pair = render_pair(scene, backend, f"wireframe-{size}")
    found, wanted = (p["Combined"][..., 0] for p in (pair.glint, pair.cycles))
    inside = surface_interior(pair.cycles)
    assert 0.05 < wanted[inside].mean() < 0.95
    assert (found != wanted)[inside].mean() <= 0.005


STRANDS = [("ShaderNodeParticleInfo", name) for name in ("Index", "Random", "Size", "Velocity")]
STRANDS += [
    ("ShaderNodeHairInfo", name)
    for name in ("Is Strand", "Intercept", "Length", "Thickness", "Tangent Normal", "Random")
]


@pytest.mark.parametrize(("node", "output"), STRANDS, ids=lambda value: value)
def test_what_is_no_particle_and_no_hair_is_cycles(node, output):
    assert_is_cycles(lambda: shining(node, output), f"{node}-{output}")


@pytest.mark.parametrize("output", ["Pointiness", "Random Per Island"])
def test_shapes_of_many_parts_are_cycles(output):
    scene = cycles.empty_scene(64, 64)
    made = parts(shining("ShaderNodeNewGeometry", output))
    add(scene, "parts", made, moved(0, 0, 1, 0.9, 1.2, 0.8))
    add_camera(scene)
    pair = render_pair(scene, "NATIVE", f"parts-{output}")
    found, wanted = (p["Combined"][..., :3] for p in (pair.glint, pair.cycles))
    inside = surface_interior(pair.cycles)
    assert inside.sum() > 150 and wanted[inside].std() > 0.02
    assert np.abs(found - wanted)[inside].max() <= 1e-4


@pytest.mark.parametrize(("node", "output"), OUTPUTS, ids=lambda value: value)
def test_output_is_cycles(node, output):
    assert_is_cycles(lambda: shining(node, output), f"{node}-{output}")


TRANSFORMS = [
    (kind, before, after)
    for kind in ("POINT", "VECTOR", "NORMAL")
    for before, after in permutations(("WORLD", "OBJECT", "CAMERA"), 2)
] + [("NORMAL", "OBJECT", "OBJECT")]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("kind", "before", "after"), TRANSFORMS)
def test_a_transformed_vector_is_cycles(kind, before, after, backend):
    def made():
        material = shining("ShaderNodeVectorTransform", "Vector")
        tree = material.node_tree
        node = next(n for n in tree.nodes if n.type == "VECT_TRANSFORM")
        node.vector_type, node.convert_from, node.convert_to = kind, before, after
        point = tree.nodes.new("ShaderNodeNewGeometry")
        tree.links.new(point.outputs["Position"], node.inputs["Vector"])
        return material

    def turned(scene, material) -> None:
        made = folded(material)
        add(scene, "folded", made, moved(-0.8, 0.3, -0.5, 1.3, 0.8, 1.0) @ slanted())
        add_camera(scene)

    assert_is_cycles(made, f"transform-{kind}-{before}-{after}", backend, turned)


def slanted():
    from mathutils import Euler

    return Euler((0.2, -0.3, 0.4)).to_matrix().to_4x4()


IMAGE_VECTORS = {
    "generated": ("ShaderNodeTexCoord", "Generated"),
    "object": ("ShaderNodeTexCoord", "Object"),
    "normal": ("ShaderNodeTexCoord", "Normal"),
    "reflection": ("ShaderNodeTexCoord", "Reflection"),
    "position": ("ShaderNodeNewGeometry", "Position"),
    "distorted": ("ShaderNodeTexNoise", "Color"),
}


@pytest.mark.parametrize("vector", IMAGE_VECTORS)
def test_an_image_by_any_vector_is_cycles(vector):
    assert_is_cycles(lambda: shining_image(*IMAGE_VECTORS[vector]), f"image-{vector}")


PROJECTIONS = [("SPHERE", 0.0), ("TUBE", 0.0), *(("BOX", blend) for blend in (0.0, 0.2, 0.7, 1.0))]


@pytest.mark.parametrize("vector", ["generated", "object"])
@pytest.mark.parametrize(("projection", "blend"), PROJECTIONS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_projected_image_is_cycles(projection, blend, vector, backend):
    settings = {"projection": projection, "projection_blend": blend}
    name = f"image-{projection}-{blend}-{vector}"
    assert_is_cycles(lambda: shining_image(*IMAGE_VECTORS[vector], **settings), name, backend)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("interpolation", ["Cubic", "Smart"])
@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
def test_a_cubic_image_is_cycles(extension, interpolation, backend):
    """Beyond all of its edges too."""
    settings = {"extension": extension, "interpolation": interpolation}
    name = f"image-{interpolation}-{extension}"
    assert_is_cycles(lambda: shining_image(*IMAGE_VECTORS["object"], **settings), name, backend)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("projection", ["FLAT", "BOX"])
def test_a_tiled_image_is_cycles(projection, backend, tmp_path):
    """Coordinates reach beyond every side of the tiles, where Cycles shows magenta."""

    def make():
        material = shining("ShaderNodeTexImage", "Color")
        texture = next(node for node in material.node_tree.nodes if node.type == "TEX_IMAGE")
        texture.image, texture.projection = tiled_image(tmp_path), projection
        nodes, links = material.node_tree.nodes, material.node_tree.links
        point, mapping = (nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "Mapping"))
        mapping.inputs["Location"].default_value = (-0.5, -0.5, 0.0)
        mapping.inputs["Scale"].default_value = (3.0, 3.0, 1.0)
        links.new(point.outputs["Generated"], mapping.inputs["Vector"])
        links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
        return material

    assert_is_cycles(make, f"image-tiles-{projection}", backend)


def tiled_image(folder):
    """Three tiles of 8 by 8 texels with a colour each at their corners."""
    random = np.random.default_rng(6)
    for number in (1001, 1002, 1012):
        picture = bpy.data.images.new(str(number), 8, 8)
        texels = np.ones((8, 8, 4), np.float32)
        texels[..., :3] = random.uniform(0, 1, 3)
        texels[2:6, 2:6, :3] = random.uniform(0, 1, 3)
        picture.pixels.foreach_set(texels.reshape(-1))
        picture.file_format, picture.filepath_raw = "PNG", str(folder / f"tile.{number}.png")
        picture.save()
    tiled = bpy.data.images.load(str(folder / "tile.1001.png"))
    tiled.colorspace_settings.name = "Non-Color"
    tiled.source, tiled.filepath = "TILED", str(folder / "tile.<UDIM>.png")
    for number in (1002, 1012):
        if number not in [tile.number for tile in tiled.tiles]:
            tiled.tiles.new(number)
    return tiled


def shining_image(node_type: str, output: str, **settings):
    """A material that shines with an image that is looked up by an output of a node."""
    material = shining("ShaderNodeTexImage", "Color")
    tree = material.node_tree
    texture = next(node for node in tree.nodes if node.type == "TEX_IMAGE")
    picture = bpy.data.images.new("picture", 8, 4, float_buffer=True)
    texels = np.random.default_rng(3).uniform(0, 1, (4, 8, 4)).astype(np.float32)
    texels[..., 3] = 1
    picture.pixels.foreach_set(texels.reshape(-1))
    texture.image = picture
    for name, value in settings.items():
        setattr(texture, name, value)
    node = tree.nodes.new(node_type)
    tree.links.new(node.outputs[output], texture.inputs["Vector"])
    return material


def assert_is_cycles(make_material, name: str, backend: str = "NATIVE", fill=fill) -> None:
    scene = cycles.empty_scene(64, 64)
    fill(scene, make_material())
    pair = render_pair(scene, backend, name)
    found, wanted = pair.glint["Combined"][..., :3], pair.cycles["Combined"][..., :3]
    inside = surface_interior(pair.cycles) & np.isfinite(wanted).all(-1)
    assert inside.sum() > 150
    error = np.abs(found - wanted)[inside].max(-1)
    assert np.percentile(error, 99) <= 1e-3 and error.max() <= 0.02, (
        f"worst {error.max():.2g}; "
        f"{found[inside][error.argmax()]} for {wanted[inside][error.argmax()]}"
    )


@pytest.mark.parametrize("interpolation", ["Linear", "Closest"])
def test_bytes_with_a_curve_are_filtered_as_in_cycles(interpolation):
    """Few texels of very different colours, magnified: what lies between them is the mean of the
    stored codes.
    """

    def made():
        material = shining_image("ShaderNodeTexCoord", "Generated")
        texture = next(node for node in material.node_tree.nodes if node.type == "TEX_IMAGE")
        texture.interpolation = interpolation
        picture = bpy.data.images.new("bytes", 8, 4)
        texels = np.random.default_rng(5).uniform(0, 1, (4, 8, 4)).astype(np.float32)
        texels[..., 3] = 1
        picture.pixels.foreach_set(texels.reshape(-1))
        picture.pack()
        texture.image = picture
        return material

    assert_is_cycles(made, f"bytes-{interpolation}")
