"""True displacement against Cycles: where surfaces are, and their normals."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import Pair, render_glint, render_pair
from small_scenes import add, add_camera, mesh, moved
from test_cycles_normals import Tree, wrapped


class Moving(Tree):
    """A material whose Displacement or Vector Displacement node moves vertices."""

    def __init__(self, method: str, space: str, kind: str = "Displacement", scale=0.4) -> None:
        super().__init__()
        self.material.displacement_method = method
        self.displacer = self.node(f"ShaderNode{kind}", Scale=scale, Midlevel=0.3)
        self.displacer.space = space
        self.link(self.displacer.outputs[0], self.output.inputs["Displacement"])


def noise(method: str, space: str, node: str, output: str):
    """Noise over an output of a node of coordinates."""
    tree = Moving(method, space)
    texture, place = tree.node("ShaderNodeTexNoise", Scale=3.0), tree.node(node)
    tree.link(place.outputs[output], texture.inputs["Vector"])
    tree.link(texture.outputs[0], tree.displacer.inputs["Height"])
    return tree.material


def image(method: str):
    tree = Moving(method, "OBJECT", scale=0.3)
    tree.link(tree.image.outputs["Color"], tree.displacer.inputs["Height"])
    return tree.material


def vector(method: str, space: str):
    tree = Moving(method, space, "VectorDisplacement", 0.3)
    tree.link(tree.image.outputs["Color"], tree.displacer.inputs["Vector"])
    return tree.material


COORDINATES, GEOMETRY = "ShaderNodeTexCoord", "ShaderNodeNewGeometry"
MOVED = {
    "object": lambda: noise("DISPLACEMENT", "OBJECT", COORDINATES, "Object"),
    "world": lambda: noise("DISPLACEMENT", "WORLD", COORDINATES, "Normal"),
    "position": lambda: noise("DISPLACEMENT", "OBJECT", GEOMETRY, "Position"),
    "pointiness": lambda: noise("DISPLACEMENT", "OBJECT", GEOMETRY, "Pointiness"),
    "face": lambda: noise("DISPLACEMENT", "OBJECT", GEOMETRY, "True Normal"),
    "image": lambda: image("DISPLACEMENT"),
    **{
        f"vector-{space}": lambda space=space: vector("DISPLACEMENT", space)
        for space in ("TANGENT", "OBJECT", "WORLD")
    },
}
BOTH = {
    "generated": lambda: noise("BOTH", "OBJECT", COORDINATES, "Generated"),
    "image": lambda: image("BOTH"),
    "vector-OBJECT": lambda: vector("BOTH", "OBJECT"),
}


def same_places(pair: Pair) -> np.ndarray:
    """(k,) differences of normals where both pictures show a surface, all of which must be in the
    same places.
    """
    there = [np.abs(seen["Normal"]).max(-1) > 0 for seen in (pair.glint, pair.cycles)]
    assert np.array_equal(*there) and there[0].sum() > 500
    found, wanted = (seen["Depth"][there[0]] for seen in (pair.glint, pair.cycles))
    assert np.abs(found / wanted - 1).max() <= 1e-4
    return np.linalg.norm(pair.glint["Normal"] - pair.cycles["Normal"], axis=-1)[there[0]]


@pytest.mark.parametrize(
    ("case", "smooth"), [*((case, True) for case in MOVED), ("object", False), ("face", False)]
)
def test_surfaces_are_where_cycles_has_them(case, smooth):
    """On balls of which one is turned and squeezed, and one mirrored, with a mesh of its own each:
    Cycles displaces a mesh for its first object alone.
    """
    scene, material = cycles.empty_scene(96, 96), MOVED[case]()
    for name, place in (
        ("one", moved(-0.6, -0.9, 0.4, 1.1, 0.7, 1.1)),
        ("two", moved(0.9, 1.0, 0.3, 1.2, 0.8, -0.9)),
    ):
        data = wrapped(material)
        data.polygons.foreach_set("use_smooth", np.full(len(data.polygons), smooth))
        add(scene, name, data, place)
    add_camera(scene)
    assert same_places(render_pair(scene, "NATIVE", f"displaced-{case}")).max() <= 1e-3


@pytest.mark.parametrize("case", BOTH)
def test_both_bends_normals_as_in_cycles(case):
    """On a ball that is as large as its mesh."""
    scene = cycles.empty_scene(96, 96)
    add(scene, "one", wrapped(BOTH[case]()))
    add_camera(scene)
    differences = same_places(render_pair(scene, "NATIVE", f"both-{case}"))
    assert np.median(differences) <= 1e-3 and np.percentile(differences, 95) <= 1e-2


@pytest.mark.parametrize("method", ["DISPLACEMENT", "BOTH"])
@pytest.mark.parametrize("strength", [1.0, 0.4])
def test_normal_maps_lie_on_the_surface_as_it_was(method, strength):
    """And are mixed with its normal as it is; which stays where the mesh has no such map."""
    scene = cycles.empty_scene(96, 96)
    for name, x in (("map", -1.0), ("none", 1.2)):
        tree = Moving(method, "OBJECT")
        texture, place = tree.node("ShaderNodeTexNoise", Scale=3.0), tree.node(COORDINATES)
        tree.link(place.outputs["Generated"], texture.inputs["Vector"])
        tree.link(texture.outputs[0], tree.displacer.inputs["Height"])
        mapped = tree.node("ShaderNodeNormalMap", Strength=strength)
        mapped.uv_map = name
        tree.link(tree.image.outputs["Color"], mapped.inputs["Color"])
        tree.link(mapped.outputs[0], tree.shader.inputs["Normal"])
        add(scene, name, wrapped(tree.material), moved(x, 0.0, 0.4))
    add_camera(scene)
    differences = same_places(render_pair(scene, "NATIVE", f"mapped-{method}-{strength}"))
    assert np.median(differences) <= 1e-3 and np.percentile(differences, 95) <= 1e-2


def wavy(smooth: bool, node: str, output: str, size: float):
    """A square from -1 to 1 of 8 by 8 cells whose z is sin(3 x) / 2, by coordinates that are size
    times those of the object. They are read where it is flat: z counts as much as x.
    """
    tree = Moving("BOTH", "OBJECT", scale=0.5)
    tree.displacer.inputs["Midlevel"].default_value = 0.0
    place, along, sine = (tree.node(kind) for kind in (node, *2 * ["ShaderNodeVectorMath"]))
    along.operation, sine.operation = "DOT_PRODUCT", "SINE"
    along.inputs[1].default_value = (3.0 / size, 0.0, 3.0 / size)
    tree.link(place.outputs[output], along.inputs[0])
    tree.link(along.outputs["Value"], sine.inputs[0])
    tree.link(sine.outputs[0], tree.displacer.inputs["Height"])
    across = np.linspace(-1, 1, 9)
    x, y = np.meshgrid(across, across)
    at = np.arange(x.size).reshape(x.shape)
    faces = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], -1).reshape(-1, 4)
    vertices = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    return mesh("wavy", vertices, faces.tolist(), smooth, tree.material)


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize("height", [4.4, -4.4])
@pytest.mark.parametrize(
    ("smooth", "node", "output", "size"),
    [
        (True, COORDINATES, "Object", 1.0),
        (False, COORDINATES, "Object", 1.0),
        (True, GEOMETRY, "Position", 2.0),
    ],
)
def test_both_shows_the_slopes_that_vertices_leave_out(smooth, node, output, size, height, backend):
    """Those of the wave itself, from above and below, whatever the object's size and the mesh's:
    here an eighth of it; Cycles' are as much too steep as the object is large. Heights are compared
    a tenth of a pixel apart, here at most 0.006, over which a slope changes by 9 / 2 of that.
    """
    scene = cycles.empty_scene(64, 64)
    data = wavy(smooth, node, output, size)
    add(scene, "wavy", data, moved(0, 0, 0, 2, 2, 2))
    add_camera(scene, (4.2, -5.6, height))
    seen = {name: np.squeeze(v) for name, v in render_glint(scene, backend).passes.items()}
    there = np.abs(seen["Normal"]).max(-1) > 0
    x = seen["Position"][there][:, 0] / 2
    slope = np.stack([-1.5 * np.cos(3 * x), 0 * x, np.ones_like(x)], -1)
    slope *= np.sign(height) / np.linalg.norm(slope, axis=1)[:, None]
    facing = np.abs(seen["Normal"][there] - slope).max(1)
    below = np.abs(seen["Normal"][there] + slope).max(1)  # faces turned away by the wave
    assert there.sum() > 500 and (facing < below).mean() > 0.8
    assert np.minimum(facing, below).max() <= 0.006 * 4.5 / 2
