"""Inputs of shaders that are set beyond what is drawn as in Cycles. Drivers, scripts and linked
numbers go there; of Blender's own fields those without an end.

Negative strengths of what shines, and negative weights, roughnesses and densities are within:
they take light away, or count as 0, as in Cycles.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from .graph import source
from .terms import Sum, constant_value, is_constant

_COLOR = (-math.inf, 1.0)
"""What light gets more of at each bounce has no end."""
RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "ShaderNodeBsdfPrincipled": {
        "IOR": (0.9, 1000.0),
        "Coat Weight": (-math.inf, 1.0),
        "Transmission Weight": (-math.inf, 1.0),
    },
    "ShaderNodeBsdfGlass": {"IOR": (0.9, math.inf), "Color": _COLOR},
    "ShaderNodeBsdfRefraction": {"IOR": (0.25, math.inf), "Color": _COLOR},
    "ShaderNodeBsdfAnisotropic": {"Color": _COLOR},
    "ShaderNodeBsdfTranslucent": {"Color": _COLOR},
    "ShaderNodeBsdfTransparent": {"Color": _COLOR},
    "ShaderNodeBsdfToon": {"Size": (0.05, math.inf)},
    "ShaderNodeVolumeAbsorption": {"Color": _COLOR},
    "ShaderNodeVolumeScatter": {"Color": (0.0, 1.0), "Anisotropy": (-0.99, 0.99)},
}
"""Shader -> input -> from where to where."""
_ROUGH = {"ShaderNodeBsdfGlass"}
"""Shaders that are as in Cycles beyond these ends too, where they are smooth."""
_HELD = ("ShaderNodeValue", "ShaderNodeRGB")
"""Nodes that hold what they give."""


def beyond(view: Any) -> Iterator[str]:
    """Sentences about the inputs of a shader that are constants beyond its ranges, {} for the
    materials. view: a NodeView.
    """
    node = view.node
    for name, (low, high) in RANGES.get(node.bl_idname, {}).items():
        if name not in node.inputs or (name == "IOR" and _is_smooth(view)):
            continue
        value = _constant(view, name)
        if value is not None and not low <= min(value) <= max(value) <= high:
            yield (
                f"'{name}' of {node.bl_label} is beyond its range in {{}}, where it is drawn "
                f"otherwise than in Cycles: {_remedy(low, high)}"
            )


def _remedy(low: float, high: float) -> str:
    if math.isinf(high):
        return f"set it to {low:g} or more"
    return f"set it to {high:g} or less" if math.isinf(low) else f"set it to {low:g} to {high:g}"


def _is_smooth(view: Any) -> bool:
    rough = _constant(view, "Roughness") if view.node.bl_idname in _ROUGH else None
    return rough is not None and max(rough) <= 0


def _constant(view: Any, name: str) -> tuple[float, ...] | None:
    """What an input is set to; None where it is computed, which nothing here should cause."""
    socket, place = view.node.inputs[name], source(view.input(name))
    if place is None or (place.socket.is_output and place.node.bl_idname not in _HELD):
        return None
    found: Sum = view.color(name) if socket.type == "RGBA" else view.number(name)
    return constant_value(found) if is_constant(found) else None
