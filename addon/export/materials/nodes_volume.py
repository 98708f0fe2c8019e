"""Volume shaders to `engine.scene.Medium`: what they absorb, scatter and give out a unit of length,
as Cycles has it, everywhere or from place to place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ....engine.program.graph import Value
from ....engine.program.program import compile_program
from ....engine.scene import Material, Medium, World
from ..shader_nodes.spectra import blackbody_colors, blackbody_table
from .closures import Closure, LobeKey, add_closures
from .evaluator import CLOSURE_NODES, Evaluator, NodeView
from .graph import Place
from .terms import RGB, Sum, complement, constant, constant_value, is_constant, multiply

T = TypeVar("T", Material, World)
VOLUMES = ("ABSORPTION", "SCATTERING")
"""Kinds of closures that surfaces have not."""
_MOST = 1e30
"""Per unit of length; what is denser counts as that."""
_BOLTZMANN = 5.670373e-8 * 1e-6 / math.pi
"""Cycles' brightness of black bodies, times the fourth power of their temperature."""
_HOTTEST = 1e9
"""Kelvin of a voxel that count."""


def medium_of(place: Place, evaluator: Evaluator, step: float) -> Medium | None:
    """What a Volume socket gets; None for nothing. step: of one that varies."""
    return medium_of_closure(evaluator.closure(place), evaluator, step)


def medium_of_closure(given: Closure, evaluator: Evaluator, step: float) -> Medium | None:
    closure = {k: v for k, v in given.items() if k.kind in (*VOLUMES, "EMISSION")}
    thinned = evaluator.thinned()
    if thinned is not None:
        closure = {k: multiply(v, thinned) for k, v in closure.items()}
    if any(key.anisotropy_output >= 0 or not is_constant(v) for key, v in closure.items()):
        return _varying(closure, evaluator, step)
    absorption, emission = _BLACK, _BLACK
    scattering: list[tuple[RGB, float]] = []
    for key, terms in closure.items():
        value = tuple(x if math.isfinite(x) else 0.0 for x in constant_value(terms))
        if key.kind == "ABSORPTION":
            absorption = _added(absorption, value)
        elif key.kind == "SCATTERING":
            scattering.append((_kept(value), key.anisotropy))
        else:
            emission = _added(emission, value)
    total = _BLACK
    for value, _ in scattering:
        total = _added(total, value)
    medium = Medium(_kept(absorption), total, emission, _mean_anisotropy(scattering, evaluator))
    return medium if any((*medium.extinction, *medium.emission)) else None


def _varying(closure: Closure, evaluator: Evaluator, step: float) -> Medium:
    """One that its tree makes from place to place."""
    do, sums = evaluator.expressions.apply, dict[str, Value]()
    one, none = evaluator.expressions.constant(1.0), evaluator.expressions.constant(_BLACK)
    scattering: list[tuple[Value, Value]] = []
    for key, terms in closure.items():
        value = evaluator.expressions.value_of(terms)
        if key.kind == "SCATTERING":
            value = evaluator.expressions.bounded(value, 0.0, _MOST)
            scattering.append((value, _anisotropy_value(key, evaluator)))
        sums[key.kind] = do("scaled_sum", value, one, sums.get(key.kind, none))
    absorption, total, emission = (
        sums.get(kind, none) for kind in ("ABSORPTION", "SCATTERING", "EMISSION")
    )
    values = {
        "absorption": absorption,
        "scattering": total,
        "emission": emission,
        "anisotropy": _varying_anisotropy(scattering, evaluator),
    }
    varied = [value for value in values.values() if value.constant is None]
    if not varied:  # what was told apart comes to the same
        return Medium(*(_kept(v.constant) for v in (absorption, total)), emission.constant)
    given = {
        name: (value.constant if value.width == 3 else value.constant[0])
        for name, value in values.items()
        if value.constant is not None
    }
    for name in given.keys() & {"absorption", "scattering"}:
        given[name] = _kept(given[name])
    outputs = {
        f"{name}_output": varied.index(value)
        for name, value in values.items()
        if value.constant is None
    }
    program = compile_program(evaluator.expressions.graph, varied)
    return Medium(**given, **outputs, program=program, step=step)


def _anisotropy_value(key: LobeKey, evaluator: Evaluator) -> Value:
    if key.anisotropy_output >= 0:
        return evaluator.expressions.value_at(key.anisotropy_output)
    return evaluator.expressions.constant(key.anisotropy)


def _varying_anisotropy(scattering: list[tuple[Value, Value]], evaluator: Evaluator) -> Value:
    """The scattered light's; of several kinds of scattering the mean, by how much each is."""
    expressions = evaluator.expressions
    kinds = list(dict.fromkeys(g for _, g in scattering))
    if len(kinds) < 2:
        return kinds[0] if kinds else expressions.constant(0.0)
    evaluator.note(_SEVERAL)
    do, total, whole = expressions.math, expressions.constant(0.0), expressions.constant(0.0)
    for value, g in scattering:
        weight = expressions.apply("vector_average", value)
        total, whole = do("MULTIPLY_ADD", weight, g, total), do("ADD", weight, whole)
    return do("DIVIDE", total, whole)


def with_step_rate(media: Sequence[T], scene: Any) -> tuple[T, ...]:
    """Materials or worlds with the steps of their media as Cycles' settings of the scene scale
    them.
    """
    rate = getattr(getattr(scene, "cycles", None), "volume_step_rate", 1.0)
    if rate == 1.0:
        return tuple(media)
    return tuple(
        replace(one, medium=replace(one.medium, step=one.medium.step * rate))
        if one.medium is not None and one.medium.program is not None
        else one
        for one in media
    )


STEP = 1 / 32
"""How far apart rays look at volumes that vary, of the mean side of the box round a thing."""
_BLACK: RGB = (0.0, 0.0, 0.0)
_SEVERAL = "Volumes that scatter in several ways have their mean anisotropy in {}"


def _added(a: RGB, b: RGB) -> RGB:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _kept(value: RGB) -> RGB:
    return tuple(min(max(x, 0.0), _MOST) for x in value)


def _mean_anisotropy(scattering: list[tuple[RGB, float]], evaluator: Evaluator) -> float:
    """The scattered light's; of several kinds of scattering the mean."""
    if len({g for value, g in scattering if any(value)}) > 1:
        evaluator.note(_SEVERAL)
    total = sum(sum(value) for value, _ in scattering)
    return sum(sum(value) * g for value, g in scattering) / total if total > 0 else 0.0


def _density(view: NodeView) -> Sum:
    return view.amount("Density", 1.0)


def _absorption(view: NodeView) -> Closure:
    less = complement(view.color("Color"))
    return {LobeKey("ABSORPTION"): multiply(less, _density(view))}


def _scatter(view: NodeView) -> Closure:
    return {_scattering(view): multiply(view.color("Color"), _density(view))}


def _coefficients(view: NodeView) -> Closure:
    return add_closures(
        {LobeKey("ABSORPTION"): view.reflectance("Absorption Coefficients")},
        {_scattering(view): view.reflectance("Scatter Coefficients")},
        {LobeKey("EMISSION"): view.color("Emission Coefficients")},
    )


def _principled(view: NodeView) -> Closure:
    """Absorbs what it does not scatter, but for the share that the square root of the absorption's
    colour says.
    """
    color = _times_grid(view, view.reflectance("Color"), "Color Attribute")
    density = _times_grid(view, _density(view), "Density Attribute")
    less = _untinted(view, view.reflectance("Absorption Color"))
    dark = view.evaluator.clamped(complement(color), 0.0, math.inf)
    return add_closures(
        {LobeKey("ABSORPTION"): multiply(dark, less, density)},
        {_henyey_greenstein_key(view): multiply(color, density)},
        {LobeKey("EMISSION"): multiply(view.color("Emission Color"), _emission(view))},
        {LobeKey("EMISSION"): _glow(view)},
    )


def _untinted(view: NodeView, tint: Sum) -> Sum:
    """One less its square root, at least 0."""
    if is_constant(tint):
        return constant(tuple(max(1 - math.sqrt(max(x, 0.0)), 0.0) for x in constant_value(tint)))
    expressions = view.evaluator.expressions
    parts = [
        expressions.math("SUBTRACT", 1.0, expressions.math("SQRT", part))
        for part in expressions.parts(expressions.value_of(tint))
    ]
    less = expressions.bounded(expressions.apply("combine_xyz", *parts), 0.0, math.inf)
    return expressions.sum_of(less)


_USUAL = {
    "Density Attribute": "density",
    "Color Attribute": "",
    "Temperature Attribute": "temperature",
}
"""What Principled Volume has of its own: meshes have no such attributes."""


def _times_grid(view: NodeView, terms: Sum, name: str) -> Sum:
    """Times the grid of a Volume object that an input names, at least 0, where there is one."""
    place = view.input(name)
    wanted = place.socket.default_value if place is not None else ""
    grid = view.evaluator.grid(wanted) if wanted else None
    if grid is not None:
        expressions = view.evaluator.expressions
        return multiply(terms, expressions.sum_of(expressions.bounded(grid, 0.0, math.inf)))
    if wanted and wanted != _USUAL[name]:
        view.note(f"The {name} of Principled Volume is not read: {{}} go without it")
    return terms


def default_volume(evaluator: Evaluator) -> Closure:
    """What Volume objects without a material are made of, as in Cycles: Principled Volume."""
    grid, expressions = evaluator.grid("density"), evaluator.expressions
    half = multiply(constant(0.5), expressions.sum_of(grid) if grid is not None else constant(1.0))
    return {LobeKey("SCATTERING"): half, LobeKey("ABSORPTION"): half}


def _emission(view: NodeView) -> Sum:
    return view.amount("Emission Strength")


def _glow(view: NodeView) -> Sum:
    """Of a black body."""
    amounts = view.number("Blackbody Intensity")
    even = view.number("Temperature", 1000.0)
    if is_constant(amounts) and is_constant(even):
        heat = _glow_of_voxels(view, constant_value(amounts)[0], constant_value(even)[0])
        if heat is not None:
            return multiply(view.color("Blackbody Tint", 1.0), heat)
    kelvins = _times_grid(view, even, "Temperature Attribute")
    if not (is_constant(amounts) and is_constant(kelvins)):
        return _varying_glow(view, amounts, kelvins)
    amount, kelvin = constant_value(amounts)[0], constant_value(kelvins)[0]
    if not (amount > 0 and kelvin > 0):
        return ()
    brightness = _BOLTZMANN * (1 + (kelvin**4 - 1) * amount)
    expressions = view.evaluator.expressions
    color = expressions.apply(
        "piecewise", expressions.constant(kelvin), table=blackbody_table()
    ).constant
    tinted = multiply(view.color("Blackbody Tint", 1.0), constant(color or (1.0,) * 3))
    return multiply(tinted, constant(brightness))


def _glow_of_voxels(view: NodeView, amount: float, scale: float) -> Sum | None:
    """The same of the temperatures that a grid tells, voxel by voxel and straight between these, as
    Cycles mixes them; None where there is no such grid of numbers.
    """

    def glow(values: np.ndarray) -> np.ndarray:
        kelvin = np.clip(values.reshape(-1).astype(np.float64) * scale, 0.0, _HOTTEST)
        shines = (kelvin > 0) & (amount > 0)
        brightness = np.where(shines, _BOLTZMANN * (1 + (kelvin**4 - 1) * amount), 0.0)
        color = np.zeros((len(kelvin), 3), np.float32)
        color[shines] = blackbody_colors(kelvin[shines]) * brightness[shines, None]
        return np.minimum(color, np.float32(1e37)).reshape(*values.shape, 3)

    place = view.input("Temperature Attribute")
    name = place.socket.default_value if place is not None else ""
    made = view.evaluator.grid(name, glow, ("glow", amount, scale)) if name else None
    return None if made is None else view.evaluator.expressions.sum_of(made)


def _varying_glow(view: NodeView, amounts: Sum, kelvins: Sum) -> Sum:
    """The same from place to place."""
    expressions = view.evaluator.expressions
    do = expressions.math
    amount, kelvin = (
        expressions.parts(expressions.value_of(terms))[0] for terms in (amounts, kelvins)
    )
    square = do("MULTIPLY", kelvin, kelvin)
    brightness = do("MULTIPLY_ADD", do("MULTIPLY_ADD", square, square, -1.0), amount, 1.0)
    shines = do("MULTIPLY", do("GREATER_THAN", amount, 0.0), do("GREATER_THAN", kelvin, 0.0))
    brightness = do("MULTIPLY", do("MULTIPLY", brightness, shines), _BOLTZMANN)
    color = expressions.apply("piecewise", kelvin, table=blackbody_table())
    glow = expressions.apply("product", color, expressions.vector(brightness))
    return multiply(view.color("Blackbody Tint", 1.0), expressions.sum_of(glow))


def _sound(anisotropy: float) -> float:
    """Kept where light is scattered at all."""
    return min(max(anisotropy, -1 + 1e-3), 1 - 1e-3)


def _scattering(view: NodeView) -> LobeKey:
    """With the mean cosine that stands for the node's phase function."""
    phase = getattr(view.node, "phase", "HENYEY_GREENSTEIN")
    if phase == "HENYEY_GREENSTEIN":
        return _henyey_greenstein_key(view)
    name = phase.replace("_", "-").title()
    view.note(
        f"The phase function {name} is rendered as Henyey-Greenstein with the same mean in {{}}"
    )
    return LobeKey("SCATTERING", anisotropy=_sound(_PHASES[phase](view)))


def _henyey_greenstein_key(view: NodeView) -> LobeKey:
    """That of the node's anisotropy, which may vary."""
    terms, expressions = view.number("Anisotropy"), view.evaluator.expressions
    if is_constant(terms):
        return LobeKey("SCATTERING", anisotropy=_sound(constant_value(terms)[0]))
    value = expressions.parts(expressions.value_of(terms))[0]
    if value.constant is not None:
        return LobeKey("SCATTERING", anisotropy=_sound(value.constant[0]))
    return LobeKey("SCATTERING", anisotropy_output=expressions.output(value))


def _fournier_forand(view: NodeView) -> float:
    """The anisotropy that sends as much back."""
    backward = min(max(view.constant("Backscatter", 0.1), 0.0), 0.5)
    low, high = 0.0, 1.0
    for _ in range(50):
        g = (low + high) / 2
        low, high = (g, high) if _sent_back(g) > backward else (low, g)
    return low


def _sent_back(g: float) -> float:
    """Which share of the light Henyey and Greenstein scatter back."""
    return (1 - g) / (2 * g) * ((1 + g) / math.sqrt(1 + g * g) - 1) if g > 0 else 0.5


def _draine(view: NodeView) -> float:
    return draine_mean(_sound(view.constant("Anisotropy")), max(view.constant("Alpha", 0.5), 0.0))


def draine_mean(g: float, alpha: float) -> float:
    """Mean cosine of Draine's phase function (Draine 2003)."""
    return g * (1 + alpha * (3 + 2 * g * g) / 5) / (1 + alpha * (1 + 2 * g * g) / 3)


def _mie(view: NodeView) -> float:
    """Of droplets of 5 to 50 μm, as mixed of Henyey-Greenstein and Draine by Jendersie and d'Eon
    (2023, An Approximate Mie Scattering Function for Fog and Cloud Rendering).
    """
    d = min(max(view.constant("Diameter", 20.0), 5.0), 50.0)
    narrow = math.exp(-0.0990567 / (d - 1.67154))
    wide = math.exp(-2.20679 / (d + 3.91029) - 0.428934)
    alpha = math.exp(3.62489 - 8.29288 / (d + 5.52825))
    share = math.exp(-0.599085 / (d - 0.641583) - 0.665888)
    return (1 - share) * narrow + share * draine_mean(wide, alpha)


_PHASES: dict[str, Any] = {
    "FOURNIER_FORAND": _fournier_forand,
    "DRAINE": _draine,
    "RAYLEIGH": lambda view: 0.0,
    "MIE": _mie,
}

CLOSURE_NODES.update(
    {
        "ShaderNodeVolumePrincipled": _principled,
        "ShaderNodeVolumeAbsorption": _absorption,
        "ShaderNodeVolumeScatter": _scatter,
        "ShaderNodeVolumeCoefficients": _coefficients,
    }
)
