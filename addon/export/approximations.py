"""Shader nodes that are drawn nearly as in Cycles, which no note tells of: for the manual's table
and for those who come from another engine.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .materials.graph import end_of, is_blinn_phong, node_tree, reached

AGAIN = "light that is scattered between microfacets looks like the highlight, or matt"
BY_VIEW = "thin film by the angle of view"
FILM = f"{AGAIN}; {BY_VIEW}"

APPROXIMATED: dict[str, str] = {
    "ShaderNodeBsdfPrincipled": f"{FILM}; subsurface as its node",
    "ShaderNodeBsdfAnisotropic": AGAIN,
    "ShaderNodeBsdfGlossy": AGAIN,
    "ShaderNodeBsdfMetallic": f"{FILM}; physical conductors by their colours "
    "seen straight and at 82 degrees",
    "ShaderNodeBsdfGlass": "rough glass keeps its light within 4 % in an even world, at an IOR "
    f"of 2 all but up to a fifth; {BY_VIEW}; an edge seen through it is as blurred as in Cycles "
    "within 3 % of its height",
    "ShaderNodeBsdfRefraction": "blurred as Glass",
    "ShaderNodeBsdfSheen": "Microfiber within 5 % of its brightest point, Ashikhmin on average "
    "within a tenth of it",
    "ShaderNodeBsdfTranslucent": "under a sky steep bumps darken it up to 8 % more, as much as "
    "under lamps",
    "ShaderNodeSubsurfaceScattering": "all methods by Christensen and Burley's profile; without "
    "Anisotropy and Roughness; as diffuse in the light that things give to others by bouncing, and "
    "in blurred reflections",
    "ShaderNodeBsdfToon": "what it throws on is as from diffuse; Glossy shows lights, what "
    "glows and the sky, and of other things their light alone, no shapes",
    "ShaderNodeBsdfVelvet": "as diffuse",
    "ShaderNodeBsdfHair": "highlights round the strand",
    "ShaderNodeBsdfHairPrincipled": "lobes round the strand's tangent",
    **dict.fromkeys(
        (
            "ShaderNodeVolumeAbsorption",
            "ShaderNodeVolumeScatter",
            "ShaderNodeVolumePrincipled",
            "ShaderNodeVolumeCoefficients",
        ),
        "see Volumes",
    ),
    "ShaderNodeAmbientOcclusion": "1 in the light that things give to others by glowing or by "
    "light that bounces off them; Bump sees no slope of it",
    "ShaderNodeBevel": "as in Cycles with many Samples, in blurred reflections too; the mesh's "
    "normal in the light that things give to others by glowing or bouncing",
    "ShaderNodeRaycast": "it meets nothing in the light that things give to others by glowing or "
    "bouncing",
    "ShaderNodeBump": "at the edges of patterns 1 % of the pixels differ",
    **dict.fromkeys(
        ("ShaderNodeDisplacement", "ShaderNodeVectorDisplacement"),
        "Displacement and Bump shows the slopes of the surface, in Cycles times the object's scale",
    ),
    "ShaderNodeLightPath": "rough reflections count as singular, and of worlds as diffuse; in "
    "worlds and lights depths end at one bounce or are constants",
    "ShaderNodeTexSky": "Hosek/Wilkie as Preetham's at its brightness, within 6 % of each channel",
    "ShaderNodeVectorCurve": "within 2e-4",
    "ShaderNodeParticleInfo": "as where there are no particles",
}
"""bl_idname -> how, and how far from Cycles."""


def approximated_nodes(block: Any) -> dict[str, str]:
    """Name of a node's type -> how it is drawn, of the nodes that a material, world or light shows
    and that are drawn nearly, not exactly, as in Cycles.
    """
    tree = node_tree(block)
    end = end_of(tree, "Surface")
    found = _behind(end.node) if end is not None else ()
    return {
        node.bl_label: APPROXIMATED[node.bl_idname]
        for node in found
        if node.bl_idname in APPROXIMATED
    }


def _behind(output: Any) -> Iterator[Any]:
    """The nodes that feed an output, and all nodes of the groups among them."""

    def next_to(node: Any) -> list[Any]:
        inner = getattr(node, "node_tree", None)
        inside = inner.nodes if inner is not None and not is_blinn_phong(inner) else ()
        return [*inside, *(link.from_node for socket in node.inputs for link in socket.links)]

    return reached(output, next_to)
