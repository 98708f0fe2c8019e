"""Noise and White Noise Texture nodes."""

from __future__ import annotations

from ....engine.program.graph import Value
from ....engine.program.operations_noise import NoiseType
from .reader import READERS, NodeInputs, Outputs, texture_vector


def _dimensions(view: NodeInputs) -> int:
    return int(view.node.noise_dimensions[0])


def _point(view: NodeInputs) -> Value:
    """Where the texture looks; in one dimension at W alone."""
    if _dimensions(view) == 1:
        return view.reader.graph.constant((0.0, 0.0, 0.0))
    return texture_vector(view)


def _number(view: NodeInputs, name: str, otherwise: float) -> Value:
    """An input that some Blenders lack."""
    has = name in view.node.inputs
    return view.value(name) if has else view.reader.graph.constant(otherwise)


def _noise(view: NodeInputs) -> Outputs:
    node = view.node
    kind = NoiseType[getattr(node, "noise_type", "FBM")]
    numbers = (
        _number(view, name, otherwise)
        for name, otherwise in (
            ("W", 0.0),
            ("Scale", 5.0),
            ("Detail", 2.0),
            ("Roughness", 0.5),
            ("Lacunarity", 2.0),
            ("Offset", 0.0),
            ("Gain", 1.0),
            ("Distortion", 0.0),
        )
    )
    value, color = view.apply(
        "noise_texture",
        _point(view),
        *numbers,
        dimensions=_dimensions(view),
        noise_type=kind,
        normalize=int(getattr(node, "normalize", True)),
    )
    return {"Fac": value, "Factor": value, "Color": color}


def _white_noise(view: NodeInputs) -> Outputs:
    value, color = view.apply(
        "white_noise",
        _point(view),
        _number(view, "W", 0.0),
        dimensions=_dimensions(view),
    )
    return {"Value": value, "Color": color}


READERS.update({"ShaderNodeTexNoise": _noise, "ShaderNodeTexWhiteNoise": _white_noise})
