"""Shader nodes other than Principled, and our own Blinn-Phong node, as closures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from .anisotropy import Brush
from .closures import Closure, LobeKey, add_closures, scale_closure
from .evaluator import CLOSURE_NODES, NodeView
from .fresnel import EDGE_MEAN, dielectric_albedo, normal_reflectance
from .glass_albedo import scattered_until_out
from .graph import BLINN_PHONG, source
from .multiscatter import share_at
from .rough_diffuse import roughened
from .roughness import (
    World,
    dielectric_world,
    glass_exponent,
    scattered,
    scattered_narrow,
    scattered_wide,
    world_of,
)
from .subsurface import WALKS_IOR, note_constants, subsurface
from .terms import ONE, ZERO, Sum, add, complement, constant, is_constant, multiply, scale
from .thin_film import Film, film_of
from .varying import Ior, Of, Roughness


def diffuse_closure(color: Sum) -> Closure:
    """Lambert's lobe and its share of the ambient light: in a uniform world both reflect `color` of
    it.
    """
    return {LobeKey("DIFFUSE"): color, LobeKey("AMBIENT"): color}


@dataclass(frozen=True)
class Edge:
    """How metals look at grazing angles: white (Schlick), and some 8 degrees before that by `lack`
    darker. mirrored: all of a mirror; None where nothing is lacking.
    """

    lack: Sum = ZERO
    mirrored: Sum | None = None


WHITE = Edge()


def glossy_closure(
    color: Sum, again: Sum, roughness: Roughness, edge: Edge | None = WHITE
) -> Closure:
    """A metal-like lobe that reflects `color`. again: which share of it scatters more than once.
    edge: None for the same colour at all angles.
    """
    mirrored = color if edge is None or edge.mirrored is None else edge.mirrored
    mirror = {LobeKey("MIRROR"): mirrored}
    if edge is not None and edge.mirrored is None:
        mirror[LobeKey("MIRROR", schlick=True)] = complement(color)
    if roughness.is_mirror():
        return add_closures(mirror)
    if roughness.varies:
        return add_closures(
            scale_closure(mirror, roughness.mirrored()),
            scale_closure(_rough_glossy(color, again, roughness, edge), roughness.rough()),
        )
    return _rough_glossy(color, again, roughness, edge)


def _rough_glossy(color: Sum, again: Sum, roughness: Roughness, edge: Edge | None) -> Closure:
    world, rest = WorldShares(roughness, "METAL"), ZERO if edge is None else complement(color)
    lack = ZERO if edge is None else edge.lack
    brighter = add(ONE, multiply(again, roughness.number(Of(scattered_narrow))))
    spread, once = multiply(color, again), multiply(color, complement(again))
    always, grazing = (
        add(spread, multiply(once, world.a0), multiply(rest, world.b0)),
        add(multiply(once, world.a1), multiply(rest, world.b1)),
    )
    return add_closures(
        _highlight(multiply(color, brighter), roughness),
        _highlight(multiply(rest, brighter), roughness, schlick=True),
        _highlight(scale(multiply(lack, brighter), -1.0), roughness, edge=True),
        _matt(multiply(spread, roughness.number(Of(scattered_wide))), world),
        _seen("AMBIENT", add(always, scale(lack, -EDGE_MEAN)), grazing, world),
    )


class WorldShares:
    """`roughness.World`'s shares of a roughness that may vary, as sums, and its exponent as
    `LobeKey` takes it. ior: of a dielectric.
    """

    def __init__(self, roughness: Roughness, kind: str, ior: float = Ior.NOMINAL) -> None:
        a0, a1, b0, b1, q = (Of(_share_of_world, (kind, ior, name)) for name in _SHARES)
        self.a0, self.a1, self.b0, self.b1 = map(roughness.number, (a0, a1, b0, b1))
        self.exponent = roughness.exponent(q)


_SHARES = ("a0", "a1", "b0", "b1", "q")


def _share_of_world(kind: str, ior: float, name: str, roughness: float) -> float:
    return getattr(_world(roughness, kind, ior), name)


def _world(roughness: float, kind: str, ior: float) -> World:
    return world_of(roughness, kind) if kind == "METAL" else dielectric_world(roughness, ior, kind)


def _highlight(weight: Sum, roughness: Roughness, **more: Any) -> Closure:
    return {LobeKey("SPECULAR", **roughness.microfacets(), **more): weight}


def _seen(kind: str, always: Sum, grazing: Sum, world: WorldShares) -> Closure:
    """always + grazing (1 - n·v)^q."""
    return {LobeKey(kind): always, LobeKey(kind, **world.exponent): grazing}


def _matt(color: Sum, world: WorldShares) -> Closure:
    """What of a colour the world's shares leave, of what shines."""
    less, grazing = complement(world.a0), scale(world.a1, -1.0)
    seen = _seen("DIFFUSE", multiply(color, less), multiply(color, grazing), world)
    return {replace(key, follows=True): terms for key, terms in seen.items()}


def coat_closure(
    weight: Sum,
    roughness: Roughness,
    ior: Ior,
    multiscatter: bool = True,
    tint: Sum = ONE,
    both_sides: bool = True,
) -> Closure:
    """A dielectric interface's reflection, by Fresnel; tint: of the reflectance at normal
    incidence, not of that at grazing angles. both_sides: from behind as from the front, as layers
    are in Cycles.
    """
    if ior.number == 1.0:
        return {}
    key = LobeKey("MIRROR", fresnel=True, both_sides=both_sides, **ior.key)
    mirror = {key: multiply(weight, tint)}
    if roughness.is_mirror():
        return mirror
    rough = scale_closure(_rough_coat(roughness, ior, multiscatter, tint), weight)
    if not roughness.varies:
        return rough
    return add_closures(
        scale_closure(mirror, roughness.mirrored()), scale_closure(rough, roughness.rough())
    )


def _rough_coat(roughness: Roughness, ior: Ior, multiscatter: bool, tint: Sum) -> Closure:
    world = WorldShares(roughness, "DIELECTRIC", ior.number)
    again = _scattered_again(ior, multiscatter)
    tinted = multiply(tint, ior.f0)
    highlight = _dielectric_highlights(
        tint, roughness, ior, roughness.number(Of(_brighter, (again,)))
    )
    wide = roughness.number(Of(_spread, (again,)))
    return add_closures(
        highlight,
        _matt(multiply(tinted, wide), world),
        _reflected("AMBIENT", tinted, world, roughness, again),
    )


def _scattered_again(ior: Ior, multiscatter: bool) -> Of:
    """Of roughness: what comes back of the light that is not sent out at once."""
    f0 = normal_reflectance(ior.number)
    return Of(scattered, (f0 + (1 - f0) / 21 if multiscatter else 0.0,))


def _brighter(again: Of, roughness: float) -> float:
    return 1 + again(roughness) * scattered_narrow(roughness)


def _spread(again: Of, roughness: float) -> float:
    return again(roughness) * scattered_wide(roughness)


def _dielectric_highlights(tint: Sum, roughness: Roughness, ior: Ior, brighter: Sum) -> Closure:
    """F = a F_ior + b, so that it is the tint times F0 at normal incidence and 1 at grazing
    angles.
    """
    if tint == ONE:
        return _highlight(brighter, roughness, fresnel=True, **ior.key)
    tinted = multiply(tint, ior.f0)
    white = multiply(complement(tinted), brighter)
    if normal_reflectance(ior.number) > 0.5:
        # a and b all but cancel: F is F0 or less, but where light all but grazes the surface
        return _highlight(multiply(tinted, brighter), roughness)
    b = multiply(ior.over_rest(multiply(complement(tint), scale(ior.f0, -1.0))), brighter)
    return add_closures(
        _highlight(ior.over_rest(white), roughness, fresnel=True, **ior.key),
        _highlight(b, roughness),
    )


def _reflected(kind: str, f0: Sum, world: WorldShares, roughness: Roughness, again: Of) -> Closure:
    """What of a uniform world a dielectric layer reflects; again: the share of what is not sent out
    at once.
    """
    return _seen(kind, *_shares(f0, world, roughness, again), world)


def _shares(f0: Sum, world: WorldShares, roughness: Roughness, again: Of) -> tuple[Sum, Sum]:
    """The same, always and times (1 - n·v)^q."""
    scattered_on = roughness.number(again)
    rest, once = complement(f0), multiply(f0, complement(scattered_on))
    more = multiply(f0, scattered_on)
    always = add(more, multiply(once, world.a0), multiply(rest, world.b0))
    return always, add(multiply(once, world.a1), multiply(rest, world.b1))


def below_coat(base: Sum, tint: Sum, roughness: Roughness, ior: Ior, multiscatter: bool) -> Closure:
    """A diffuse layer under a dielectric one, which by Cycles keeps what it reflects of a uniform
    world in the direction of view; of an even world just what its AMBIENT lobes show, where it
    scatters until light is out.
    """
    f0, again = multiply(tint, ior.f0), _scattered_again(ior, multiscatter)

    def left(kind: str, table: str) -> Closure:
        world = WorldShares(roughness, table, ior.number)
        always, grazing = _shares(f0, world, roughness, again)
        through, less = multiply(base, complement(always)), scale(multiply(base, grazing), -1.0)
        return _seen(kind, through, less, world)

    if multiscatter:
        return add_closures(left("DIFFUSE", "LAYER"), left("AMBIENT", "DIELECTRIC"))
    return add_closures(left("DIFFUSE", "LAYER_ONCE"), left("AMBIENT", "LAYER_ONCE"))


def kept_by_layer(roughness: Roughness, ior: Ior) -> tuple[Sum, Sum, Sum]:
    """What a dielectric layer that scatters until light is out keeps from all that lies below it:
    always, times (1 - n·v)^q, and q.
    """
    world = WorldShares(roughness, "LAYER", ior.number)
    shares = _shares(ior.f0, world, roughness, _scattered_again(ior, True))
    return *shares, roughness.number(Of(_share_of_world, ("LAYER", ior.number, "q")))


def glass_closure(reflected: Sum, refracted: Sum, roughness: Roughness, ior: Ior) -> Closure:
    """Both sides of a dielectric interface that scatters light once."""
    coat = coat_closure(reflected, roughness, ior, multiscatter=False, both_sides=False)
    return add_closures(
        {replace(k, outside=k.kind == "SPECULAR"): terms for k, terms in coat.items()},
        refracting(refracted, roughness, ior, fresnel=True),
    )


def glass_of(
    view: NodeView, reflected: Sum, refracted: Sum, roughness: Roughness, ior: Ior
) -> Closure:
    """The glass of a node, which scatters light as often as that says; with its film, if there is
    one, which mirrors alike on both sides.
    """
    film = film_of(view, ior, is_glass=True)
    if film is None:
        closure = glass_closure(reflected, refracted, roughness, ior)
    else:
        closure = _filmed_glass(film, reflected, refracted, roughness, ior)
    if not is_multiscatter(view):
        return closure
    return scale_closure(closure, scattered_until_out(view, roughness, ior))


def _filmed_glass(
    film: Film, reflected: Sum, refracted: Sum, roughness: Roughness, ior: Ior
) -> Closure:
    through = multiply(refracted, complement(film.reflected))
    return add_closures(
        glossy_closure(film.tinted(reflected), ZERO, roughness, edge=None),
        refracting(through, roughness, ior),
    )


def refracting(color: Sum, roughness: Roughness, ior: Ior, fresnel: bool = False) -> Closure:
    """What is seen through a surface: clear up to the roughness of a mirror, blurred beyond."""
    kind = {"fresnel": fresnel, **ior.key}
    if roughness.is_mirror():
        return {LobeKey("REFRACTION", **kind): color}
    width = roughness.exponent(Of(glass_exponent))
    blurred = LobeKey("REFRACTION", distribution="GGX", **width, **kind)
    if not roughness.varies:
        return {blurred: color}
    return add_closures(
        {LobeKey("REFRACTION", **kind): multiply(color, roughness.mirrored())},
        {blurred: multiply(color, roughness.rough())},
    )


def is_multiscatter(view: NodeView) -> bool:
    return getattr(view.node, "distribution", "MULTI_GGX") == "MULTI_GGX"


def bend(view: NodeView) -> None:
    """The node's shading normal is one that the material is to have."""
    view.evaluator.bend(view.input("Normal"))


_OTHERS = ("BECKMANN", "ASHIKHMIN_SHIRLEY")
"""Distributions of half vectors other than GGX."""


def note_left_out(view: NodeView, names: dict[str, str]) -> None:
    """A note for each input, by name and in words, that is not 0 and has no effect here."""
    for name, word in names.items():
        if view.input(name) and view.number(name):
            view.note(f"The {word} of {view.node.bl_label} is not rendered: {{}} go without it")


def distributed(view: NodeView, closure: Closure) -> Closure:
    """The closure with the node's distribution of half vectors."""
    distribution = getattr(view.node, "distribution", "GGX")
    if distribution not in _OTHERS:
        return closure
    return {
        replace(key, distribution=distribution) if key.distribution == "GGX" else key: weight
        for key, weight in closure.items()
    }


def _diffuse(view: NodeView) -> Closure:
    bend(view)
    color = view.reflectance("Color")
    return roughened(view, diffuse_closure(color), "Roughness", color)


def _translucent(view: NodeView) -> Closure:
    """What Lambert's lobe throws back to all sides, thrown on behind the surface."""
    bend(view)
    color = view.reflectance("Color")
    return {LobeKey("TRANSLUCENT"): color, LobeKey("AMBIENT"): color}


def _subsurface(view: NodeView) -> Closure:
    bend(view)
    note_left_out(view, {"Anisotropy": "anisotropy"})
    note_constants(view, {"IOR": WALKS_IOR, "Roughness": 1.0})
    color, names = view.reflectance("Color"), ("Radius", "Scale")
    return subsurface(view, diffuse_closure(color), ONE, names, color, view.node.falloff)


def _as_diffuse(view: NodeView) -> Closure:
    view.note(f"The {view.node.bl_label} shader is rendered as diffuse in {{}}")
    bend(view)
    return diffuse_closure(view.reflectance("Color"))


def _glossy(view: NodeView) -> Closure:
    bend(view)
    color = view.reflectance("Color")
    brush = Brush(view, view.roughness(otherwise=0.0), is_signed=True)
    again = share_at(view, color, brush.roughness) if is_multiscatter(view) else ZERO
    closure = glossy_closure(color, again, brush.roughness, edge=None)
    return distributed(view, brush.on(closure))


def _glass(view: NodeView) -> Closure:
    bend(view)
    color, roughness, ior = view.reflectance("Color"), view.roughness(), view.ior()
    return distributed(view, glass_of(view, color, color, roughness, ior))


def _refraction(view: NodeView) -> Closure:
    bend(view)
    color, roughness, ior = view.reflectance("Color"), view.roughness(), view.ior()
    return distributed(view, refracting(color, roughness, ior))


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
    """The index of refraction of the Fresnel node that drives a Mix Shader, where it is a
    constant.
    """
    place = view.input("Fac") or view.input("Factor")
    found = source(place) if place else None
    if found is None or not found.socket.is_output or found.node.bl_idname != "ShaderNodeFresnel":
        return None
    terms = NodeView(view.evaluator, found).number("IOR", 1.5)
    return max(terms[0].value[0], 1e-3) if terms and is_constant(terms) else None


def _only_rays(closure: Closure) -> bool:
    return bool(closure) and all(
        key.kind == "MIRROR" and not (key.fresnel or key.schlick) for key in closure
    )


def _fresnel_mix(first: Closure, mirror: Closure, ior: float) -> Closure:
    """F times an ideal mirror plus (1 - F) times the rest: exact for refraction, by the 45° value
    for other lobes.
    """
    rest = constant(1 - dielectric_albedo(ior))
    closures: list[Closure] = [
        {
            LobeKey("MIRROR", ior=ior, fresnel=True, normal=key.normal): weight
            for key, weight in mirror.items()
        }
    ]
    for key, weight in first.items():
        exact = (
            key.kind == "REFRACTION" and not key.fresnel and key.ior == ior and key.ior_output < 0
        )
        closures.append(
            {replace(key, fresnel=True): weight} if exact else {key: multiply(weight, rest)}
        )
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
    return {LobeKey("HOLDOUT"): ONE}


def _empty_group(view: NodeView) -> Closure:
    view.note("Groups without an output are black in {}: choose their node group anew")
    return {}


def _unknown(view: NodeView) -> Closure:
    """Something with a colour is drawn as diffuse, anything else as Blender's default grey."""
    node = view.node
    view.note(
        f"Node '{node.bl_label}' is not supported: {{}} are rendered diffuse where it counts; use "
        "Principled or Blinn-Phong"
    )
    color = next(
        (view.color(name) for name in ("Color", "Base Color", "Diffuse Color") if view.input(name)),
        None,
    )
    return diffuse_closure(color if color is not None else constant(0.8))


CLOSURE_NODES.update(
    {
        "unknown": _unknown,
        "ShaderNodeGroup": _empty_group,
        "ShaderNodeBsdfDiffuse": _diffuse,
        "ShaderNodeBsdfTranslucent": _translucent,
        "ShaderNodeSubsurfaceScattering": _subsurface,
        "ShaderNodeBsdfVelvet": _as_diffuse,
        "ShaderNodeBsdfGlossy": _glossy,
        "ShaderNodeBsdfAnisotropic": _glossy,
        "ShaderNodeBsdfGlass": _glass,
        "ShaderNodeBsdfRefraction": _refraction,
        "ShaderNodeBsdfTransparent": _transparent,
        "ShaderNodeEmission": _emission,
        "ShaderNodeBackground": _emission,
        "ShaderNodeMixShader": _mix,
        "ShaderNodeAddShader": _add,
        "ShaderNodeHoldout": _holdout,
        BLINN_PHONG: _blinn_phong,
    }
)
