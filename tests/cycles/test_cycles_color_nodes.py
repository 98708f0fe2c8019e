"""Nodes that compute with colours against Cycles: every setting, random inputs."""

from __future__ import annotations

import numpy as np
import pytest

from cycles_reference import bpy
from glint.engine.program.operations_color import BlendType
from node_tiles import add, compared, greatest_difference

RANDOM = np.random.default_rng(8)


def number(low=0.0, high=1.0) -> float:
    return float(np.float32(RANDOM.uniform(low, high)))


def color(low=0.0, high=1.0) -> tuple[float, ...]:
    return (*(number(low, high) for _ in range(3)), 1.0)


def part(tree, position, axis=0):
    """One of the position's coordinates, from -3 to 3, brought to about 0 to 1."""
    value = add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs[axis]
    shrunk = {"Value": value, "Value_001": 0.3, "Value_002": 0.5}
    return add(tree, "ShaderNodeMath", shrunk, operation="MULTIPLY_ADD").outputs[0]


def parts(tree, position):
    """The position brought to about 0 to 1, as a colour."""
    inputs = {name: part(tree, position, axis) for axis, name in enumerate("XYZ")}
    return add(tree, "ShaderNodeCombineXYZ", inputs).outputs[0]


def output(node, name):
    return next(socket for socket in node.outputs if socket.identifier == name)


def blend(kind: str, clamps: bool, low: float, high: float):
    def build(tree, position):
        inputs = {"Factor_Float": number(0, 1.2), "A_Color": parts(tree, position)}
        inputs["B_Color"] = color(low, high)
        node = add(
            tree,
            "ShaderNodeMix",
            inputs,
            data_type="RGBA",
            blend_type=kind,
            clamp_result=clamps,
            clamp_factor=clamps,
        )
        return output(node, "Result_Color")

    return build


def mixed(kind: str, mode: str):
    def build(tree, position):
        node = tree.nodes.new("ShaderNodeMix")
        node.data_type, node.factor_mode = kind, mode
        given = {
            "Factor_Float": part(tree, position),
            "Factor_Vector": parts(tree, position),
            "A_Float": number(-2, 2),
            "B_Float": part(tree, position, 1),
            "A_Vector": color(-2, 2)[:3],
            "B_Vector": parts(tree, position),
        }
        for socket in node.inputs:
            value = given.get(socket.identifier)
            if isinstance(value, bpy.types.NodeSocket):
                tree.links.new(value, socket)
            elif value is not None:
                socket.default_value = value
        return output(node, f"Result_{kind.title()}")

    return build


def plain(kind: str, result: int = 0, **given):
    """A node with a colour from the position and these inputs."""

    def build(tree, position):
        node = tree.nodes.new(kind)
        for name, value in given.items():
            node.inputs[name.replace("_", " ")].default_value = value
        entry = next(s for s in node.inputs if s.type in ("RGBA", "VECTOR"))
        tree.links.new(parts(tree, position), entry)
        return node.outputs[result]

    return build


def separated(mode: str, result: int):
    def build(tree, position):
        inputs = {"Color": parts(tree, position)}
        return add(tree, "ShaderNodeSeparateColor", inputs, mode=mode).outputs[result]

    return build


def combined(mode: str):
    def build(tree, position):
        inputs = {
            name: part(tree, position, axis) for axis, name in enumerate(("Red", "Green", "Blue"))
        }
        return add(tree, "ShaderNodeCombineColor", inputs, mode=mode).outputs[0]

    return build


def ramp(interpolation: str, result: str, mode: str = "RGB"):
    def build(tree, position):
        node = add(tree, "ShaderNodeValToRGB", {"Fac": part(tree, position)})
        node.color_ramp.color_mode, node.color_ramp.interpolation = mode, interpolation
        for place in (0.3, 0.55, 0.9):
            node.color_ramp.elements.new(place).color = (*color()[:3], number())
        return node.outputs[result]

    return build


def curves(kind: str, extend: str):
    def build(tree, position):
        is_float = kind == "ShaderNodeFloatCurve"
        entry = part(tree, position) if is_float else parts(tree, position)
        name = {"ShaderNodeRGBCurve": "Color", "ShaderNodeVectorCurve": "Vector"}.get(kind, "Value")
        node = add(tree, kind, {name: entry, "Fac": 0.8, "Factor": 0.8})
        node.mapping.extend = extend
        for curve in node.mapping.curves:
            curve.points.new(number(0.2, 0.4), number())
            curve.points.new(number(0.5, 0.8), number())
        node.mapping.update()
        return node.outputs[0]

    return build


def far_curve(kind: str, extend: str, ends: tuple[float, float]):
    """Curves that begin and end there, of numbers far beyond."""

    def build(tree, position):
        far = add(
            tree,
            "ShaderNodeVectorMath",
            {"Vector": position, "Vector_001": (1.0, -2.0, 3.0)},
            operation="MULTIPLY",
        ).outputs[0]
        entry = part(tree, far) if kind == "ShaderNodeFloatCurve" else parts(tree, far)
        name = {"ShaderNodeRGBCurve": "Color", "ShaderNodeVectorCurve": "Vector"}.get(kind, "Value")
        node = add(tree, kind, {name: entry, "Fac": 1.0, "Factor": 1.0})
        node.mapping.extend, node.mapping.use_clip = extend, False
        for curve in node.mapping.curves:
            curve.points[0].location, curve.points[1].location = (ends[0], 0.2), (ends[1], 0.7)
        node.mapping.update()
        return node.outputs[0]

    return build


def mapped(interpolation: str, clamp: bool, turned: bool):
    def build(tree, position):
        inputs = {"Value": part(tree, position), "From Min": 0.2, "From Max": 0.7}
        inputs |= {"To Min": -0.5, "To Max": 1.5, "Steps": 3.0}
        if turned:
            inputs |= {"From Min": 0.7, "From Max": 0.2}
        node = tree.nodes.new("ShaderNodeMapRange")
        node.interpolation_type, node.clamp = interpolation, clamp
        for socket in node.inputs:
            if socket.name in inputs and socket.type == "VALUE":
                value = inputs[socket.name]
                if isinstance(value, bpy.types.NodeSocket):
                    tree.links.new(value, socket)
                else:
                    socket.default_value = value
        return node.outputs["Result"]

    return build


def mapped_vector(interpolation: str, clamp: bool):
    """The second channel's source range is empty."""

    def build(tree, position):
        inputs = {
            "Vector": parts(tree, position),
            "From_Min_FLOAT3": (0.1, 0.4, 0.7),
            "From_Max_FLOAT3": (0.8, 0.4, 0.2),
            "To_Min_FLOAT3": (-0.5, 1.5, 0.0),
            "To_Max_FLOAT3": (1.5, 0.5, 2.0),
            "Steps_FLOAT3": (3.0, 4.0, 5.0),
        }
        kind = "ShaderNodeMapRange"
        settings = {"data_type": "FLOAT_VECTOR", "interpolation_type": interpolation}
        return output(add(tree, kind, inputs, clamp=clamp, **settings), "Vector")

    return build


def bright(amount: float, contrast: float):
    def build(tree, position):
        node = tree.nodes.new("ShaderNodeBrightContrast")
        node.inputs[1].default_value, node.inputs[2].default_value = amount, contrast
        tree.links.new(parts(tree, position), node.inputs["Color"])
        return node.outputs[0]

    return build


def spectral(kind: str, low: float, high: float):
    """By a number from low to high over the tile."""

    def build(tree, position):
        scaled = {"Value": part(tree, position), "Value_001": high - low, "Value_002": low}
        value = add(tree, "ShaderNodeMath", scaled, operation="MULTIPLY_ADD").outputs[0]
        return add(tree, kind, {"Temperature": value, "Wavelength": value}).outputs[0]

    return build


RANGES = ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP")
CASES = {
    **{
        f"mix {kind} {clamps}": blend(kind, clamps, low, high)
        for kind in BlendType.__members__
        for clamps, low, high in ((False, -0.3, 1.6), (True, 0.0, 1.0))
    },
    **{
        f"mix {kind} {mode}": mixed(kind, mode)
        for kind, mode in (
            ("FLOAT", "UNIFORM"),
            ("VECTOR", "UNIFORM"),
            ("VECTOR", "NON_UNIFORM"),
        )
    },
    **{
        f"blackbody {low} {high}": spectral("ShaderNodeBlackbody", low, high)
        for low, high in ((-500, 1500), (700, 2500), (1500, 14000), (5000, 7000))
    },
    **{
        f"wavelength {low} {high}": spectral("ShaderNodeWavelength", low, high)
        for low, high in ((350, 420), (360, 800), (430, 650), (700, 820))
    },
    "invert": plain("ShaderNodeInvert"),
    "gamma": plain("ShaderNodeGamma", Gamma=2.3),
    "gamma 0": plain("ShaderNodeGamma", Gamma=0.0),
    "hue saturation": plain("ShaderNodeHueSaturation", Hue=0.7, Saturation=1.4, Value=0.8),
    "bright": bright(0.2, 0.7),
    "dark": bright(-0.4, -0.3),
    **{
        f"map range vector {kind} {clamp}": mapped_vector(kind, clamp)
        for kind in RANGES
        for clamp in (False, True)
    },
    "rgb to bw": plain("ShaderNodeRGBToBW"),
    **{
        f"separate {mode} {k}": separated(mode, k)
        for mode in ("RGB", "HSV", "HSL")
        for k in range(3)
    },
    **{f"combine {mode}": combined(mode) for mode in ("RGB", "HSV", "HSL")},
    **{
        f"ramp {kind} {result}": ramp(kind, result)
        for kind in ("LINEAR", "CONSTANT", "EASE", "CARDINAL", "B_SPLINE")
        for result in ("Color", "Alpha")
    },
    "ramp in HSV": ramp("LINEAR", "Color", "HSV"),
    "ramp in HSL": ramp("LINEAR", "Color", "HSL"),
    **{
        f"{kind} {extend}": curves(kind, extend)
        for kind in ("ShaderNodeRGBCurve", "ShaderNodeVectorCurve", "ShaderNodeFloatCurve")
        for extend in ("EXTRAPOLATED", "HORIZONTAL")
    },
    **{
        f"{kind} {extend} from {ends}": far_curve(kind, extend, ends)
        for kind in ("ShaderNodeRGBCurve", "ShaderNodeVectorCurve", "ShaderNodeFloatCurve")
        for extend, ends in (("EXTRAPOLATED", (0.3, 0.6)), ("HORIZONTAL", (-0.5, 2.0)))
    },
    **{
        f"map range {kind} {clamp} {turned}": mapped(kind, clamp, turned)
        for kind in RANGES
        for clamp in (False, True)
        for turned in (False, True)
    },
}


@pytest.fixture(scope="module")
def rendered():
    seen, expected = compared(list(CASES.values()))
    return dict(zip(CASES, zip(seen, expected, strict=True), strict=True))


@pytest.mark.parametrize("case", CASES)
def test_node_is_cycles(case, rendered):
    """Up to 1e-4 but for the pixels next to a jump, where float32 decides."""
    seen, expected = rendered[case]
    error = np.abs(seen - expected).max(-1)
    assert np.mean(error > 1e-4) <= 0.02, f"{np.sort(error)[-5:]}"


@pytest.mark.parametrize("factor", [1.0, 0.4])
@pytest.mark.parametrize(
    "kind", ["ShaderNodeRGBCurve", "ShaderNodeVectorCurve", "ShaderNodeFloatCurve"]
)
def test_constants_beyond_the_ends_of_curves(kind, factor):
    """Cycles works them out by itself, and goes beyond the ends but for a Float Curve."""

    def curve(value):
        def build(tree, position):
            names = {"ShaderNodeRGBCurve": "Color", "ShaderNodeVectorCurve": "Vector"}
            given = {"ShaderNodeFloatCurve": value, "ShaderNodeRGBCurve": (value, 0.3, 2.0, 1.0)}
            inputs = {names.get(kind, "Value"): given.get(kind, (value, 0.3, 2.0))}
            return add(tree, kind, inputs | {"Fac": factor, "Factor": factor}).outputs[0]

        return build

    seen, expected = compared([curve(value) for value in (-1.5, 0.3, 2.5)])
    assert greatest_difference(seen, expected) <= 1e-4


_SOURCES = {
    "ShaderNodeMath": lambda x: {0: x, 1: 0.0},
    "ShaderNodeGamma": lambda x: {"Color": (x, x, x, 1.0), "Gamma": 1.0},
    "ShaderNodeCombineXYZ": lambda x: {"X": x, "Y": x, "Z": x},
    "ShaderNodeCombineColor": lambda x: {"Red": x, "Green": x, "Blue": x},
    "ShaderNodeSeparateColor": lambda x: {"Color": (x, x, x, 1.0)},
    "ShaderNodeRGBToBW": lambda x: {"Color": (x, x, x, 1.0)},
}


@pytest.mark.parametrize("steps", [0, 1])
@pytest.mark.parametrize("kind", [*_SOURCES, "ShaderNodeRGB"])
def test_constants_of_nodes_beyond_the_ends_of_a_float_curve(kind, steps):
    """Of some Cycles goes beyond the ends, whatever lies between."""

    def curve(value):
        def build(tree, position):
            node = add(tree, kind, _SOURCES[kind](value) if kind in _SOURCES else {})
            if kind == "ShaderNodeRGB":
                node.outputs[0].default_value = (value, value, value, 1.0)
            source = node.outputs[0]
            for _ in range(steps):
                between = add(tree, "ShaderNodeMath", {1: 0.0})
                tree.links.new(source, between.inputs[0])
                source = between.outputs[0]
            found = add(tree, "ShaderNodeFloatCurve", {"Factor": 1.0})
            tree.links.new(source, found.inputs["Value"])
            return found.outputs[0]

        return build

    seen, expected = compared([curve(value) for value in (-1.5, 0.3, 2.5)])
    assert greatest_difference(seen, expected) <= 1e-4


@pytest.mark.parametrize("extend", ["EXTRAPOLATED", "HORIZONTAL"])
def test_curves_without_width_are_steps(extend):
    """Where Cycles gives one end everywhere, or no number."""
    ends = [far_curve("ShaderNodeFloatCurve", extend, (x, x)) for x in (-20.0, 0.5, 20.0)]
    _, (after, step, before) = compared(ends)
    assert np.isin(np.round(step, 6), (0.2, 0.7)).all()
    assert np.abs(after - 0.7).max() < 1e-6 and np.abs(before - 0.2).max() < 1e-6
