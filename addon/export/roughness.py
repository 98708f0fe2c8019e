"""Cycles' microfacets, as its `roughness` has them, to the Blinn-Phong lobes that stand for them, and back.

Measured against Cycles 5.0.1 by tests/cycles/fit_roughness.py, which also says what is minimised. Two lobes, a narrow and a wide one,
stand for one microfacet lobe of constant reflectance F0: its direct light is `F0 · Σ s_k · max(0, n·h)^p_k · E/π`. One power falls far
below GGX's tail, which a display shows nearly as bright as its peak; two follow it. What two leave is mostly the gain at grazing view.
`HIGHLIGHTS` has the residuals.

A dielectric is fitted with its Fresnel reflectance, which grows from F0 when seen straight to 1 at grazing view, as a lobe in units of
F0 = 0.04.

p·α² and s·α² with α = roughness² vary slowly and settle below 0.2, so they are tabled; between the rows they follow powers of roughness.
"""

from __future__ import annotations

import functools

import numpy as np

from .fresnel import fresnel, normal_reflectance

Highlight = tuple[float, float]
"""Exponent and scale of one lobe."""

ROUGHNESS = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
"""Rows of the tables below."""

HIGHLIGHTS = {
    "GGX": np.array([
        [1.58818, 1.60598, 1.74445, 1.98292, 2.27322, 2.58956, 2.90891, 3.33605, 4.83043],
        [0.19714, 0.20020, 0.21338, 0.22995, 0.23934, 0.23332, 0.20755, 0.16080, 0.09028],
        [0.10748, 0.10150, 0.11172, 0.13318, 0.15401, 0.16611, 0.15873, 0.12019, 0.05532],
        [0.00292, 0.00336, 0.00587, 0.01207, 0.02355, 0.04189, 0.06771, 0.10373, 0.15730],
        [0.19826, 0.18386, 0.16580, 0.15874, 0.16685, 0.18399, 0.20664, 0.22894, 0.24834],
    ]),
    "MULTI_GGX": np.array([
        [1.58781, 1.60142, 1.73131, 1.97051, 2.28495, 2.65538, 3.04788, 3.51699, 4.67637],
        [0.19755, 0.20238, 0.22192, 0.25561, 0.29687, 0.33459, 0.35340, 0.33394, 0.23478],
        [0.10739, 0.10030, 0.10768, 0.12797, 0.15641, 0.19468, 0.24283, 0.30155, 0.40388],
        [0.00292, 0.00336, 0.00598, 0.01329, 0.02977, 0.06302, 0.12303, 0.22776, 0.42193],
        [0.19878, 0.18687, 0.17268, 0.16628, 0.16827, 0.17461, 0.18635, 0.20055, 0.21514],
    ]),
    "DIELECTRIC": np.array([
        [1.58534, 1.60124, 1.74106, 1.96210, 2.21701, 2.48835, 2.75716, 3.06200, 3.83861],
        [0.21407, 0.21782, 0.23387, 0.25492, 0.27204, 0.27758, 0.26515, 0.22989, 0.16146],
        [0.10678, 0.10037, 0.11313, 0.13663, 0.15841, 0.16963, 0.15863, 0.11125, 0.04585],
        [0.00314, 0.00362, 0.00652, 0.01351, 0.02630, 0.04642, 0.07434, 0.11233, 0.17259],
        [0.25435, 0.24241, 0.22686, 0.21631, 0.21235, 0.21372, 0.22065, 0.23036, 0.24090],
    ]),
}  # fmt: skip
"""Per kind of microfacets: p·α² and s·α² of the narrow lobe, the same of the wide one, and the relative root-mean-square residual in
display values (x^(1/2.2)) that the fit leaves. One lobe leaves 0.48, 0.41, 0.26 of MULTI_GGX at 0.2, 0.5, 0.7 and
0.50, 0.44, 0.28 of DIELECTRIC. GGX scatters once, MULTI_GGX as often as it takes (Blender's default)."""

ALBEDO = np.array([0.9940, 0.9765, 0.9407, 0.8819, 0.8026, 0.7079, 0.6046, 0.5027, 0.4095])
"""Share of a uniform world that GGX reflects at F = 1, averaged over the view with the cosine; 1 for MULTI_GGX."""

DIELECTRIC_ALBEDO = np.array([0.0883, 0.0806, 0.0708, 0.0606, 0.0511, 0.0425, 0.0349, 0.0283, 0.0228])
"""The same share for Principled's dielectric lobe of IOR 1.5; 0.0919 where it is smooth."""

SMALLEST = 0.03
"""Below it a lobe is narrower than 0.05° and roughness no longer matters: p stays under 3e6."""


def highlights(roughness: float, kind: str = "MULTI_GGX") -> tuple[Highlight, Highlight]:
    """(exponent p, scale s) of the narrow and of the wide lobe for Blender's `roughness` (0 to 1, clamped); k_s = F0 · s.

    kind: a key of `HIGHLIGHTS`.
    """
    return _pairs(_row(kind, roughness))


def dielectric_highlights(roughness: float, f0: float) -> tuple[Highlight, Highlight]:
    """The same for a dielectric of normal reflectance `f0`: the larger it is, the less Fresnel's rise matters and the more it is GGX."""
    rise = min(1.0, 0.04 / 0.96 * (1 - f0) / max(f0, 1e-6))
    return _pairs(_row("DIELECTRIC", roughness) ** rise * _row("GGX", roughness) ** (1 - rise))


def specular_albedo(roughness: float, multiscatter: bool = True) -> float:
    """Share of a uniform white world that the lobe reflects for F0 = 1 (no Fresnel): the ambient coefficient of the lobe per F0."""
    if multiscatter:
        return 1.0
    return float(np.interp(_clamped(roughness), [0.0, *ROUGHNESS], [1.0, *ALBEDO]))


def layer_albedo(roughness: float, ior: float) -> float:
    """Share of a uniform white world that Principled's dielectric lobe reflects, Fresnel included: 0.092 at roughness 0, 0.061 at 0.5,
    0.023 at 1 for IOR 1.5. GGX's share of F0 plus what is left of Fresnel's rise; within 0.006 of Cycles up to IOR 2.5, 0.015 up to 4
    (but 0.04 for MULTI_GGX at IOR 4 and roughness 1)."""
    return normal_reflectance(ior) * specular_albedo(roughness, multiscatter=False) + _grazing_share(roughness, ior)


def layer_loss(roughness: float, ior: float, multiscatter: bool, world: bool = False) -> float:
    """What Principled's dielectric lobe keeps from the diffuse layer below: of a uniform world, or of lamps, which seldom shine at
    grazing angles (0.63 of Fresnel's rise; within 0.006 of Cycles for IOR 1.45 to 4).

    Multiple scattering passes on what is not reflected (a white furnace gives 1), single scattering loses the rough share of F0 too.
    """
    straight = specular_albedo(roughness, multiscatter=False) if multiscatter else 1.0
    return normal_reflectance(ior) * straight + (1.0 if world else 0.63) * _grazing_share(roughness, ior)


@functools.lru_cache(maxsize=1024)
def _grazing_share(roughness: float, ior: float) -> float:
    """The mean of F - F0 over a uniform world, and the share of it that roughness leaves."""
    cosines = (np.arange(32) + 0.5) / 32
    smooth = np.mean([2 * c * fresnel(c, ior) for c in cosines]) - normal_reflectance(ior)
    left = (DIELECTRIC_ALBEDO - 0.04 * ALBEDO) / (0.0919 - 0.04)
    return float(smooth * np.interp(_clamped(roughness), [0.0, *ROUGHNESS], [1.0, *left]))


def sheen_albedo(roughness: float) -> float:
    """Share of a uniform white world that Principled's sheen reflects at weight 1 and white tint; measured, with what lamps see of it."""
    return float(np.interp(_clamped(roughness), [0.0, 0.1, 0.3, 0.5, 0.8, 1.0], [0.0, 0.0017, 0.035, 0.1185, 0.3133, 0.4473]))


@functools.lru_cache(maxsize=1024)
def _row(kind: str, roughness: float) -> np.ndarray:
    """(4,) exponent and scale of the narrow lobe, of the wide lobe."""
    roughness = _clamped(roughness)
    return np.array([_between(row, roughness) / roughness**4 for row in HIGHLIGHTS[kind][:4]])


def _pairs(row: np.ndarray) -> tuple[Highlight, Highlight]:
    narrow_p, narrow_s, wide_p, wide_s = (float(x) for x in row)
    return (narrow_p, narrow_s), (wide_p, wide_s)


def _between(row: np.ndarray, roughness: float) -> float:
    """A row's value: constant below the first, powers of roughness in between, so that what falls from row to row falls everywhere."""
    return float(np.exp(np.interp(np.log(roughness), np.log(ROUGHNESS), np.log(row))))


def _clamped(roughness: float) -> float:
    """NaN counts as Blender's default of 0.5."""
    return min(max(roughness, SMALLEST), 1.0) if roughness == roughness else 0.5
