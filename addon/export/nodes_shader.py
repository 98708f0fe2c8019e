"""Shader nodes other than Principled, and our own Blinn-Phong node, as closures."""

from __future__ import annotations

from .evaluator import CLOSURE_NODES, Closure, LobeKey, NodeView, add_closures, scale_closure
from .fresnel import dielectric_albedo, normal_reflectance
from .graph import BLINN_PHONG, source
from .roughness import Highlight, dielectric_highlights, highlights, layer_albedo, specular_albedo
from .terms import Sum, add, complement, constant, is_constant, multiply, scale

MIRROR_ROUGHNESS = 0.05
"""Up to here a glossy lobe is an ideal mirror: GGX's α = 0.0025 blurs a reflection by 0.14°, a pixel or two of usual pictures."""


def diffuse_closure(color: Sum) -> Closure:
    """Lambert's lobe and its share of the ambient light: in a uniform world both reflect `color` of it."""
    return {LobeKey("DIFFUSE"): color, LobeKey("AMBIENT"): color}


def glossy_closure(color: Sum, roughness: float, multiscatter: bool) -> Closure:
    """A metal-like lobe that reflects `color` at every angle."""
    if roughness <= MIRROR_ROUGHNESS:
        return {LobeKey("MIRROR"): color}
    if multiscatter:
        color = _scattered(color, specular_albedo(roughness, multiscatter=False))
    ambient = scale(color, specular_albedo(roughness, multiscatter))
    return _highlight_closure(color, highlights(roughness, "MULTI_GGX" if multiscatter else "GGX"), ambient)


def _scattered(color: Sum, once: float) -> Sum:
    """What comes back of a rough surface that reflects `color` at each bounce and sends the share `once` out after the first.

    Within 4 % of Cycles for greys from 0.1 to 1 and roughness 0.5 and 0.8. Textures count as 0.6, a usual metal's reflectance.
    """
    if not is_constant(color):
        return scale(color, once + (1 - once) * 0.6)
    return add(scale(color, once), scale(multiply(color, color), 1 - once))


def _highlight_closure(color: Sum, lobes: tuple[Highlight, ...], ambient: Sum) -> Closure:
    return {**{LobeKey("SPECULAR", exponent=p): scale(color, s) for p, s in lobes}, LobeKey("AMBIENT"): ambient}


def coat_closure(tint: Sum, roughness: float, ior: float) -> Closure:
    """A dielectric interface's reflection: Fresnel's where it is smooth, its mean where it is rough."""
    if ior == 1.0:
        return {}
    if roughness <= MIRROR_ROUGHNESS:
        return {LobeKey("MIRROR", ior=ior, fresnel=True): tint}
    f0 = normal_reflectance(ior)
    return _highlight_closure(scale(tint, f0), dielectric_highlights(roughness, f0), scale(tint, layer_albedo(roughness, ior)))


def glass_closure(view: NodeView, reflected: Sum, refracted: Sum, roughness: float, ior: float) -> Closure:
    """Both sides of a dielectric interface."""
    if roughness > MIRROR_ROUGHNESS:
        view.note("Rough refraction is rendered clear in {}")
    return add_closures(coat_closure(reflected, roughness, ior), {LobeKey("REFRACTION", ior=ior, fresnel=True): refracted})


def is_multiscatter(view: NodeView) -> bool:
    return getattr(view.node, "distribution", "MULTI_GGX") == "MULTI_GGX"


def sound_ior(view: NodeView) -> float:
    """The node's index of refraction, kept above 0."""
    return max(view.constant("IOR", 1.5), 1e-3)


def note_bump(view: NodeView, *names: str) -> None:
    """One note where a node's normals are bent by something."""
    if any(view.is_linked(name) for name in names):
        view.note("Normal maps and bumps are not rendered: {} keep the mesh's normals; bake them to geometry")


def _diffuse(view: NodeView) -> Closure:
    note_bump(view, "Normal")
    return diffuse_closure(view.color("Color"))


def _as_diffuse(view: NodeView) -> Closure:
    view.note(f"The {view.node.bl_label} shader is rendered as diffuse in {{}}")
    return _diffuse(view)


def _glossy(view: NodeView) -> Closure:
    note_bump(view, "Normal")
    return glossy_closure(view.color("Color"), view.constant("Roughness"), is_multiscatter(view))


def _metallic(view: NodeView) -> Closure:
    note_bump(view, "Normal")
    if view.node.fresnel_type != "F82":
        view.note("The Metallic shader's physical conductor is rendered by its base colour in {}: choose F82 Tint")
    return glossy_closure(view.color("Base Color"), view.constant("Roughness"), is_multiscatter(view))


def _glass(view: NodeView) -> Closure:
    note_bump(view, "Normal")
    color = view.color("Color")
    return glass_closure(view, color, color, view.constant("Roughness"), sound_ior(view))


def _refraction(view: NodeView) -> Closure:
    note_bump(view, "Normal")
    if view.constant("Roughness") > MIRROR_ROUGHNESS:
        view.note("Rough refraction is rendered clear in {}")
    return {LobeKey("REFRACTION", ior=sound_ior(view)): view.color("Color")}


def _transparent(view: NodeView) -> Closure:
    return {LobeKey("TRANSPARENT"): view.color("Color")}


def _emission(view: NodeView) -> Closure:
    return {LobeKey("EMISSION"): multiply(view.color("Color"), view.number("Strength"))}


def _mix(view: NodeView) -> Closure:
    first, second = view.closure("Shader"), view.closure("Shader_001")
    ior = _fresnel_factor(view)
    if ior is not None and _only_rays(second):
        return _fresnel_mix(first, second, ior)
    factor = view.factor("Fac" if view.input("Fac") else "Factor", 0.5)
    return add_closures(scale_closure(first, complement(factor)), scale_closure(second, factor))


def _fresnel_factor(view: NodeView) -> float | None:
    """The index of refraction of the Fresnel node that drives a Mix Shader, where it is a constant."""
    place = view.input("Fac") or view.input("Factor")
    found = source(place) if place else None
    if found is None or not found.socket.is_output or found.node.mute or found.node.bl_idname != "ShaderNodeFresnel":
        return None
    terms = NodeView(view.evaluator, found).number("IOR", 1.5)
    return max(terms[0].value[0], 1e-3) if terms and is_constant(terms) else None


def _only_rays(closure: Closure) -> bool:
    return bool(closure) and all(key.kind == "MIRROR" and not key.fresnel for key in closure)


def _fresnel_mix(first: Closure, mirror: Closure, ior: float) -> Closure:
    """F times an ideal mirror plus (1 - F) times the rest: exact for refraction, by the 45° value for other lobes."""
    rest = constant(1 - dielectric_albedo(ior))
    closures: list[Closure] = [{LobeKey("MIRROR", ior=ior, fresnel=True): weight for weight in mirror.values()}]
    for key, weight in first.items():
        exact = key.kind == "REFRACTION" and not key.fresnel and key.ior == ior
        closures.append({LobeKey("REFRACTION", ior=ior, fresnel=True): weight} if exact else {key: multiply(weight, rest)})
    return add_closures(*closures)


def _add(view: NodeView) -> Closure:
    return add_closures(view.closure("Shader"), view.closure("Shader_001"))


def _blinn_phong(view: NodeView) -> Closure:
    """The notes' coefficients as they stand, under an alpha."""
    exponent = min(max(view.constant("Exponent", 32.0), 0.0), 1e9)
    surface = {
        LobeKey("AMBIENT"): view.color("Ambient"),
        LobeKey("DIFFUSE"): view.color("Diffuse"),
        LobeKey("SPECULAR", exponent=exponent): view.color("Specular"),
        LobeKey("MIRROR"): view.color("Mirror"),
        LobeKey("EMISSION"): view.color("Emission"),
    }
    return under_alpha(surface, view.factor("Alpha", 1.0))


def under_alpha(surface: Closure, alpha: Sum) -> Closure:
    """alpha times the surface, and what lies behind for the rest."""
    return add_closures(scale_closure(surface, alpha), {LobeKey("TRANSPARENT"): complement(alpha)})


def _holdout(view: NodeView) -> Closure:
    view.note("The Holdout shader is rendered black in {}: use the object's holdout flag")
    return {}


def _unknown(view: NodeView) -> Closure:
    """Something with a colour is drawn as diffuse, anything else as Blender's default grey."""
    node = view.node
    view.note(f"Node '{node.bl_label}' is not supported: {{}} are rendered diffuse where it counts; use Principled or Blinn-Phong")
    color = next((view.color(name) for name in ("Color", "Base Color", "Diffuse Color") if view.input(name)), None)
    return diffuse_closure(color if color is not None else constant(0.8))


def _volume(view: NodeView) -> Closure:
    view.note("Volumes are not rendered: {}")
    return {}


CLOSURE_NODES.update(
    {
        "unknown": _unknown,
        "ShaderNodeBsdfDiffuse": _diffuse,
        "ShaderNodeBsdfTranslucent": _as_diffuse,
        "ShaderNodeSubsurfaceScattering": _as_diffuse,
        "ShaderNodeBsdfSheen": _as_diffuse,
        "ShaderNodeBsdfVelvet": _as_diffuse,
        "ShaderNodeBsdfToon": _as_diffuse,
        "ShaderNodeBsdfGlossy": _glossy,
        "ShaderNodeBsdfAnisotropic": _glossy,
        "ShaderNodeBsdfMetallic": _metallic,
        "ShaderNodeBsdfGlass": _glass,
        "ShaderNodeBsdfRefraction": _refraction,
        "ShaderNodeBsdfTransparent": _transparent,
        "ShaderNodeEmission": _emission,
        "ShaderNodeBackground": _emission,
        "ShaderNodeMixShader": _mix,
        "ShaderNodeAddShader": _add,
        "ShaderNodeHoldout": _holdout,
        "ShaderNodeVolumePrincipled": _volume,
        "ShaderNodeVolumeAbsorption": _volume,
        "ShaderNodeVolumeScatter": _volume,
        BLINN_PHONG: _blinn_phong,
    }
)
