"""Nodes that read the object, against Cycles: what each placement of a thing shows."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import BACKENDS, render_pair, surface_interior
from small_scenes import add, add_camera, cube, moved


class Shown:
    """A material that shines with what its nodes make."""

    def __init__(self) -> None:
        self.material = bpy.data.materials.new("shown")
        cycles.use_nodes(self.material)
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.emission, end = (
            self.tree.nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "OutputMaterial")
        )
        self.tree.links.new(self.emission.outputs[0], end.inputs["Surface"])

    def shine(self, kind: str, output: str, **properties):
        node = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(node, name, value)
        names = (output, {"Fac": "Factor"}.get(output))
        socket = next(s for s in node.outputs if s.name in names)
        self.tree.links.new(socket, self.emission.inputs["Color"])
        self.material.pass_index = 3
        return self.material


def crowd(scene, material) -> None:
    """Single objects, a collection placed twice, and instances of a mesh's faces, each with
    properties of their own.
    """
    mesh = cube(material)
    mesh["of data"] = 0.6
    for k, name in enumerate(("cube", "Würfel", "куб")):
        thing = add(scene, name, mesh, moved(2.2 * k - 2.2, -1.5, 0.0, 0.7, 0.7, 0.7))
        thing.color, thing.pass_index = (0.2 * k, 0.9 - 0.3 * k, 0.5, 0.3 + 0.2 * k), k + 1
        thing["tint"] = (0.1 + 0.2 * k, 0.8, 0.3)
        thing["count"] = k + 2
        if k == 1:
            thing["of data"], thing["tint"] = [0.3, 0.2, 0.1, 0.7], "no colour"
    parts = bpy.data.collections.new("parts")
    for k in range(2):
        part = bpy.data.objects.new(f"part {k}", mesh)
        part.matrix_world = moved(0.0, 0.0, 1.3 * k, 0.5, 0.5, 0.5)
        part.color, part["tint"], part.pass_index = (0.7, 0.2 * k, 0.1, 1), (0.4, 0.1, 0.9 * k), 7
        parts.objects.link(part)
    for k in range(2):
        empty = add(scene, f"placed {k}", None, moved(2.6 * k - 1.3, 1.0, 0.4))
        empty.instance_type, empty.instance_collection = "COLLECTION", parts
        empty["tint"] = (0.9, 0.5 * k, 0.2)
        empty.color = (0.1, 0.1, 0.1 + k, 1)
    add_camera(scene)


def scattered(scene, material) -> None:
    """Faces that carry an object each."""
    plate = bpy.data.meshes.new("plate")
    edges = np.linspace(-2.4, 2.4, 4)
    vertices = [(x, y, 0.0) for y in edges for x in edges]
    corners = [4 * i + j for i in range(3) for j in range(3)]
    plate.from_pydata(vertices, [], [(c, c + 1, c + 5, c + 4) for c in corners])
    for k, corner in enumerate(plate.uv_layers.new(name="map").data):
        corner.uv = (0.04 * k, 0.9 - 0.02 * k)
    base = add(scene, "plate", plate)
    base.instance_type, base["tint"] = "FACES", (0.2, 0.7, 0.1)
    base.show_instancer_for_render = base.show_instancer_for_viewport = False
    carried = add(scene, "carried", cube(material), moved(0, 0, 0, 0.6, 0.6, 0.6))
    carried.parent, carried.color = base, (0.6, 0.4, 0.1, 0.8)
    add_camera(scene)


OUTPUTS = {
    "carrier Generated": ("ShaderNodeTexCoord", "Generated", {"from_instancer": True}),
    "carrier UV": ("ShaderNodeTexCoord", "UV", {"from_instancer": True}),
    "carrier Normal": ("ShaderNodeTexCoord", "Normal", {"from_instancer": True}),
    "carrier map": ("ShaderNodeUVMap", "UV", {"from_instancer": True}),
    **{
        f"info {name}": ("ShaderNodeObjectInfo", name, {})
        for name in ("Random", "Object Index", "Material Index", "Color", "Alpha", "Location")
    },
    **{
        f"{kind} {name} {output}": (
            "ShaderNodeAttribute",
            output,
            {"attribute_type": kind, "attribute_name": name},
        )
        for kind, name, output in (
            ("OBJECT", "tint", "Color"),
            ("OBJECT", "tint", "Fac"),
            ("OBJECT", "tint", "Alpha"),
            ("OBJECT", "count", "Vector"),
            ("OBJECT", "of data", "Color"),
            ("OBJECT", "of data", "Alpha"),
            ("OBJECT", "nothing", "Alpha"),
            ("OBJECT", "location", "Vector"),
            ("OBJECT", "pass_index", "Fac"),
            ("INSTANCER", "tint", "Color"),
            ("INSTANCER", "of data", "Color"),
            ("INSTANCER", "color", "Color"),
            ("VIEW_LAYER", "tint", "Color"),
            ("VIEW_LAYER", "of scene", "Fac"),
            ("VIEW_LAYER", "of scene", "Alpha"),
            ("VIEW_LAYER", "frame_end", "Fac"),
            ("VIEW_LAYER", "of world", "Color"),
        )
    },
}


def check(fill, output: str, backend: str) -> None:
    pair = rendered(fill, output, backend)
    found, wanted = (p["Combined"][..., :3] for p in (pair.glint, pair.cycles))
    inside = surface_interior(pair.cycles)
    assert inside.sum() > 300
    np.testing.assert_allclose(found[inside], wanted[inside], rtol=1e-5, atol=1e-6)


def rendered(fill, output: str, backend: str):
    scene = cycles.empty_scene(64, 64)
    kind, name, properties = OUTPUTS[output]
    scene.world = scene.world or bpy.data.worlds.new("world")
    scene.world["of world"], scene["of scene"] = (0.2, 0.4, 0.6), 0.35
    bpy.context.view_layer["tint"], scene["tint"] = (0.5, 0.4, 0.9), 0.1
    fill(scene, Shown().shine(kind, name, **properties))
    return render_pair(scene, backend, f"object-{output.replace(' ', '-')}")


@pytest.mark.parametrize("output", list(OUTPUTS))
def test_of_single_objects_and_collections(output):
    check(crowd, output, "NATIVE")


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "output",
    [
        "info Random",
        "info Color",
        "INSTANCER tint Color",
        "carrier Generated",
        "carrier UV",
        "carrier map",
    ],
)
def test_of_what_faces_carry(output, backend):
    check(scattered, output, backend)


def cloud(scene, material) -> None:
    """Points of a cloud, turned and scaled, with numbers of their own."""
    mesh = bpy.data.meshes.new("points")
    mesh.from_pydata(
        [(0.9 * x, 0.8 * y, 0.2 * x * y) for x in range(-2, 3) for y in (-1, 1)], [], []
    )
    draw = np.random.default_rng(5).uniform
    for name, kind, key, columns in (
        ("warmth", "FLOAT", "value", 1),
        ("tone", "FLOAT_COLOR", "color", 4),
        ("size", "FLOAT", "value", 1),
    ):
        values = mesh.attributes.new(name, kind, "POINT").data
        values.foreach_set(key, draw(0.2, 0.4, len(values) * columns))
    tree = bpy.data.node_groups.new("cloud", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("MeshToPoints", "InputNamedAttribute", "SetMaterial")
    points, size, dressed = (tree.nodes.new(f"GeometryNode{kind}") for kind in kinds)
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    size.data_type, size.inputs["Name"].default_value = "FLOAT", "size"
    dressed.inputs["Material"].default_value = material
    tree.links.new(start.outputs[0], points.inputs[0])
    tree.links.new(size.outputs[0], points.inputs["Radius"])
    tree.links.new(points.outputs[0], dressed.inputs[0])
    tree.links.new(dressed.outputs[0], end.inputs[0])
    thing = add(scene, "cloud", mesh, moved(0.2, 0.1, 0.3, 1.2, 1.2, 1.2))
    thing.modifiers.new("cloud", "NODES").node_group = tree
    add_camera(scene)


OF_POINTS = {
    **{
        f"point {name} {output}": ("ShaderNodeAttribute", output, {"attribute_name": name})
        for name, output in (
            ("warmth", "Fac"),
            ("tone", "Color"),
            ("tone", "Fac"),
            ("tone", "Alpha"),
            ("position", "Vector"),
        )
    },
    **{
        f"point {name}": ("ShaderNodePointInfo", name, {})
        for name in ("Position", "Radius", "Random")
    },
}
OUTPUTS |= OF_POINTS


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("output", OF_POINTS)
def test_of_the_points_of_a_cloud(output, backend):
    """Where a pixel and those round it show one point, whose value is the same all over."""
    pair = rendered(cloud, output, backend)
    found, wanted = (p["Combined"][..., :3] for p in (pair.glint, pair.cycles))
    around = np.lib.stride_tricks.sliding_window_view(wanted, (3, 3), (0, 1))
    inside = np.zeros(wanted.shape[:2], bool)
    inside[1:-1, 1:-1] = (np.ptp(around, (-2, -1)).max(-1) < 1e-6) & wanted[1:-1, 1:-1].any(-1)
    assert inside.sum() > 150
    np.testing.assert_allclose(found[inside], wanted[inside], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("output", ["Position", "Radius", "Random"])
def test_point_info_of_what_is_no_point(output):
    check(crowd, f"point {output}", "NATIVE")
