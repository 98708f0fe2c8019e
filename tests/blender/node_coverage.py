"""How each shader node is drawn: exactly as Cycles does, nearly so, or not, and told. What the
export has a reader or lobes for and is in none of these tables is exact, as the checks against
Cycles show.
"""

from __future__ import annotations

from glint.addon.export.approximations import APPROXIMATED
from glint.addon.export.materials.graph import INLINED

__all__ = ["APPROXIMATED", "NOTED", "STRUCTURE"]

INSIDE = "Blender takes it out of the tree before it is read"
STRUCTURE: dict[str, str] = {
    "ShaderNodeOutputMaterial": "exact",
    "ShaderNodeOutputWorld": "exact",
    "ShaderNodeOutputLight": "exact",
    "ShaderNodeOutputAOV": "exact",
    "ShaderNodeGroup": "exact, to any depth",
    "NodeGroupInput": "exact",
    "NodeGroupOutput": "exact",
    "NodeReroute": "exact",
    "NodeFrame": "exact",
    **dict.fromkeys(INLINED, f"exact: {INSIDE}"),
}
"""Nodes that hold trees together."""

NOTED: dict[str, str] = {
    "ShaderNodeBsdfRayPortal": "diffuse",
    "ShaderNodeEeveeSpecular": "diffuse; black in Cycles",
    "ShaderNodeOutputLineStyle": "Freestyle's alone",
    "ShaderNodeUVAlongStroke": "Freestyle's alone",
    "ShaderNodeRadialTiling": "the socket's own value",
    "ShaderNodeScript": "the socket's own value; OSL is not run",
    "ShaderNodeShaderToRGB": "the socket's own value; Eevee's alone",
    "ShaderNodeSqueeze": "the socket's own value",
    "ShaderNodeTexPointDensity": "the socket's own value",
}
"""Nodes that take something else in their place, which a warning says where they count."""
