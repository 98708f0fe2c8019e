"""How each shader node is drawn: exactly as Cycles does, nearly so, or not, and told. What the
export has a reader or lobes for and is in none of these tables is exact, as the checks against
Cycles show.
"""

from __future__ import annotations

LOBES = "GGX is drawn as Blinn-Phong lobes (decision 0034)"
LEFT_OUT = f"{LOBES}; anisotropy and thin film are left out"

APPROXIMATED: dict[str, str] = {
    "ShaderNodeBsdfPrincipled": f"{LEFT_OUT}; subsurface and diffuse roughness as diffuse; the "
    "coat has the normal of what lies below it",
    "ShaderNodeBsdfDiffuse": "Roughness is left out",
    "ShaderNodeBsdfAnisotropic": LEFT_OUT,
    "ShaderNodeBsdfGlossy": LEFT_OUT,
    "ShaderNodeBsdfMetallic": f"{LEFT_OUT}; physical conductors by their base colour, edges white",
    "ShaderNodeBsdfGlass": f"{LEFT_OUT}; an edge seen through it is as blurred as in Cycles within "
    "6 % of its height",
    "ShaderNodeBsdfRefraction": "blurred as Glass",
    "ShaderNodeBsdfSheen": "Microfiber within 5 % of its brightest point, Ashikhmin on average "
    "within a tenth of it",
    "ShaderNodeBsdfTranslucent": "as diffuse",
    "ShaderNodeSubsurfaceScattering": "as diffuse",
    "ShaderNodeBsdfToon": "as diffuse",
    "ShaderNodeBsdfVelvet": "as diffuse",
    "ShaderNodeBsdfHair": "highlights round the strand; Offset is left out",
    "ShaderNodeBsdfHairPrincipled": "highlights and light that passes round the strand; a matt "
    "share stands for light from strand to strand",
    "ShaderNodeHoldout": "black; the object's own holdout is exact",
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
    "ShaderNodeRaycast": "attributes where it ends are 0; it meets nothing in the light that "
    "things give to others by glowing or bouncing",
    "ShaderNodePointInfo": "zeros, as of what is no point cloud",
    "ShaderNodeBump": "Filter Width is a tenth of a pixel; at the edges of patterns 1 % of the "
    "pixels differ",
    **dict.fromkeys(
        ("ShaderNodeDisplacement", "ShaderNodeVectorDisplacement"),
        "Displacement and Bump shows the slopes of the surface, in Cycles times the object's scale",
    ),
    "ShaderNodeLightPath": "scattered light comes from points, so no ray is a diffuse one; rough "
    "reflections count as singular; in worlds and lights depths are constants",
    "ShaderNodeTexSky": "Hosek/Wilkie as Preetham's at its brightness, within 6 % of each channel",
    "ShaderNodeWireframe": "not in pixels",
    "ShaderNodeVectorCurve": "within 2e-4",
    "ShaderNodeParticleInfo": "as where there are no particles",
}
"""bl_idname -> how, and how far from Cycles."""

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
    **dict.fromkeys(
        (
            "GeometryNodeMenuSwitch",
            "GeometryNodeRepeatInput",
            "GeometryNodeRepeatOutput",
            "NodeClosureInput",
            "NodeClosureOutput",
            "NodeCombineBundle",
            "NodeEvaluateClosure",
            "NodeJoinBundle",
            "NodeSeparateBundle",
            "FunctionNodeInputBool",
            "FunctionNodeInputInt",
            "FunctionNodeInputMenu",
            "FunctionNodeInputVector",
        ),
        f"exact: {INSIDE}",
    ),
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
    "ShaderNodeVolumeInfo": "the socket's own value",
}
"""Nodes that take something else in their place, which a warning says where they count."""
