"""Checker, Gradient, Wave, Magic, Brick and Gabor Texture nodes."""

from __future__ import annotations

from ....engine.program.graph import Value
from ....engine.program.operations_pattern import (
    GradientType,
    WaveDirection,
    WaveProfile,
    WaveType,
)
from .reader import READERS, NodeInputs, Outputs, texture_vector


def _values(view: NodeInputs, *names: str) -> list[Value]:
    """Where the texture looks, and the inputs of these names."""
    return [texture_vector(view), *(view.value(name) for name in names)]


def _color_and_factor(outputs: tuple[Value, ...]) -> Outputs:
    return dict(zip(("Color", "Fac"), outputs, strict=True))


def _checker(view: NodeInputs) -> Outputs:
    values = _values(view, "Color1", "Color2", "Scale")
    return _color_and_factor(view.apply("checker_texture", *values))


def _gradient(view: NodeInputs) -> Outputs:
    kind = GradientType[view.node.gradient_type]
    return _color_and_factor(view.apply("gradient_texture", *_values(view), gradient_type=kind))


def _wave(view: NodeInputs) -> Outputs:
    node = view.node
    kind = WaveType[node.wave_type]
    along = node.bands_direction if kind == WaveType.BANDS else node.rings_direction
    values = _values(
        view, "Scale", "Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset"
    )
    outputs = view.apply(
        "wave_texture",
        *values,
        wave_type=kind,
        direction=WaveDirection.__members__.get(along, WaveDirection.ALL),
        profile=WaveProfile[node.wave_profile],
    )
    return _color_and_factor(outputs)


def _magic(view: NodeInputs) -> Outputs:
    values = _values(view, "Scale", "Distortion")
    return _color_and_factor(view.apply("magic_texture", *values, depth=view.node.turbulence_depth))


def _brick(view: NodeInputs) -> Outputs:
    node, constant = view.node, view.reader.graph.constant
    values = _values(
        view, "Color1", "Color2", "Mortar", "Scale", "Mortar Size", "Mortar Smooth", "Bias",
        "Brick Width", "Row Height",
    )  # fmt: skip
    outputs = view.apply(
        "brick_texture",
        *values,
        constant(node.offset),
        constant(node.squash),
        offset_frequency=node.offset_frequency,
        squash_frequency=node.squash_frequency,
    )
    return _color_and_factor(outputs)


def _gabor(view: NodeInputs) -> Outputs:
    values = _values(view, "Scale", "Frequency", "Anisotropy", "Orientation 2D", "Orientation 3D")
    dimensions = {"2D": 2, "3D": 3}[view.node.gabor_type]
    outputs = view.apply("gabor_texture", *values, dimensions=dimensions)
    return dict(zip(("Value", "Phase", "Intensity"), outputs, strict=True))


READERS.update(
    {
        "ShaderNodeTexChecker": _checker,
        "ShaderNodeTexGradient": _gradient,
        "ShaderNodeTexWave": _wave,
        "ShaderNodeTexMagic": _magic,
        "ShaderNodeTexBrick": _brick,
        "ShaderNodeTexGabor": _gabor,
    }
)
