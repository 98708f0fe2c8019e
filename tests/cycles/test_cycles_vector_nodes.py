"""Vector Math, Mapping, Vector Rotate and Normal against Cycles: all operations and types, random,
whole and special inputs.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from node_tiles import add, compared, greatest_difference

TOLERANCE = 1e-4
NUMBERS = (0.0, 0.0, 1.0, -1.0, 0.5, 2.0, -2.5)
RANDOM = np.random.default_rng(5)
VECTOR_OPERATIONS = [
    item.identifier
    for item in bpy.types.ShaderNodeVectorMath.bl_rna.properties["operation"].enum_items
]
MAPPING_TYPES = ("POINT", "TEXTURE", "VECTOR", "NORMAL")
ROTATION_TYPES = ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ")


def turned(tree, position, shift: int):
    """The position's coordinates in another order, with another sign."""
    parts = add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs
    named = {axis: parts[(k + shift) % 3] for k, axis in enumerate("XYZ")}
    vector = add(tree, "ShaderNodeCombineXYZ", named).outputs[0]
    factor = {"Vector": vector, "Scale": (1.0, -0.75, 0.5)[shift]}
    return add(tree, "ShaderNodeVectorMath", factor, operation="SCALE").outputs[0]


def floored(tree, vector):
    return add(tree, "ShaderNodeVectorMath", {"Vector": vector}, operation="FLOOR").outputs[0]


def special() -> tuple[float, ...]:
    return tuple(map(float, RANDOM.choice(NUMBERS, 3)))


def vectors(tree, position, kind: str) -> list:
    """Three vectors: all varying, all varying and whole, or one varying beside special ones."""
    varying = [turned(tree, position, shift) for shift in range(3)]
    if kind == "varying":
        return varying
    if kind == "whole":
        return [floored(tree, vector) for vector in varying]
    place = int(RANDOM.integers(2))
    return [varying[k] if k == place else special() for k in range(3)]


def vector_math(operation: str, kind: str):
    def build(tree, position):
        a, b, c = vectors(tree, position, kind)
        arguments = {"Vector": a, "Vector_001": b, "Vector_002": c, "Scale": 0.7}
        node = add(tree, "ShaderNodeVectorMath", arguments, operation=operation)
        return next(output for output in node.outputs if output.enabled)

    return build


def mapping(vector_type: str, kind: str):
    def build(tree, position):
        location, rotation, scale = vectors(tree, position, kind)
        arguments = {
            "Vector": position,
            "Location": location,
            "Rotation": rotation,
            "Scale": scale,
        }
        return add(tree, "ShaderNodeMapping", arguments, vector_type=vector_type).outputs[0]

    return build


def mapping_to_nothing(vector_type: str):
    def build(tree, position):
        arguments = {"Vector": position, "Location": (0.5, -0.5, 2.0), "Scale": (0.0, 0.0, 0.0)}
        return add(tree, "ShaderNodeMapping", arguments, vector_type=vector_type).outputs[0]

    return build


def vector_rotate(rotation_type: str, kind: str, invert: bool):
    def build(tree, position):
        center, axis, rotation = vectors(tree, position, kind)
        angle = add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs["Y"]
        arguments = {
            "Vector": position,
            "Center": center,
            "Axis": axis,
            "Angle": angle if kind == "varying" else 0.9,
            "Rotation": rotation,
        }
        node = add(
            tree, "ShaderNodeVectorRotate", arguments, rotation_type=rotation_type, invert=invert
        )
        return node.outputs[0]

    return build


def normal_node(output: str):
    def build(tree, position):
        node = add(tree, "ShaderNodeNormal", {"Normal": position})
        node.outputs["Normal"].default_value = (0.6, -0.48, 0.64)
        return node.outputs[output]

    return build


def texture_mapping(vector_type: str, axes: str, scale: tuple[float, float, float]):
    """A gradient around z behind the mapping that the texture node itself holds."""
    translation, rotation = RANDOM.uniform(-0.5, 0.5, 3), RANDOM.uniform(-3, 3, 3)

    def build(tree, position):
        node = add(tree, "ShaderNodeTexGradient", {"Vector": position}, gradient_type="RADIAL")
        held = node.texture_mapping
        held.vector_type, held.scale = vector_type, scale
        held.translation, held.rotation = translation, rotation
        held.mapping_x, held.mapping_y, held.mapping_z = axes.split()
        return node.outputs["Color"]

    return build


KINDS = ("varying", "whole", "special", "special", "special")
CASES = [
    *((name, vector_math(name, kind)) for name in VECTOR_OPERATIONS for kind in KINDS),
    *((name, mapping(name, kind)) for name in MAPPING_TYPES for kind in KINDS),
    *((name, mapping_to_nothing(name)) for name in MAPPING_TYPES),
    *(
        (name, vector_rotate(name, kind, invert))
        for name in ROTATION_TYPES
        for kind in ("varying", "special", "special")
        for invert in (False, True)
    ),
    *(
        (f"TEXTURE_{name}", texture_mapping(name, axes, scale))
        for name in MAPPING_TYPES
        for axes, scale in (
            ("X Y Z", (1.0, 1.0, 1.0)),
            ("X Y Z", (0.4, -0.7, 1.3)),
            ("Z X Y", (0.4, 0.8, 0.5)),
            ("X Y Z", (0.0, 0.7, -1e-6)),
            ("Y NONE X", (1.5, 0.6, 0.9)),
        )
    ),
    *(("NORMAL_NODE", normal_node(output)) for output in ("Normal", "Dot")),
]


@pytest.fixture(scope="module")
def pictures():
    return compared([build for _, build in CASES])


@pytest.mark.parametrize("name", list(dict.fromkeys(name for name, _ in CASES)))
def test_vector_node_is_that_of_cycles(pictures, name):
    for (case, _), seen, expected in zip(CASES, *pictures, strict=True):
        if case == name:
            assert greatest_difference(seen, expected) <= TOLERANCE
