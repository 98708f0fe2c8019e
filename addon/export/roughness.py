"""GGX roughness, as Cycles has it, to the Blinn-Phong lobe that stands for it, and back.

Measured against Cycles 5.0.1 by tests/cycles/fit_roughness.py, which also says what is minimised: over exponent p and scale s, the
squared difference between `F0 · s · max(0, n·h)^p · E/π` and Cycles' direct light of a GGX lobe of constant reflectance F0, over half
angles of 0° to 70° between light and view. One lobe with one scale cannot follow GGX's long tail and its gain at grazing view; what
remains, as a share of the root mean square of the radiance, is 0.31 up to roughness 0.5 and grows to 0.47 (multiscatter 0.42) at 1: see
`RESIDUAL`.

A dielectric in Principled (F from F0 at normal view to 1 at grazing) fits best with F0 times 1.04, 1.03, 0.95, 0.79, 0.63 of the
MULTI_GGX scale at roughness 0.1, 0.3, 0.5, 0.7, 1; `multiscatter=False` is nearer to that, so use it for dielectrics.

With α = roughness² both p·α² and s·α² vary slowly and settle below 0.2, so they are tabled and interpolated linearly; the measured
rows between the table's differ by less than 1.3 % in p and 0.9 % in s.
"""

from __future__ import annotations

import numpy as np

ROUGHNESS = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
"""Rows of the tables below; index 0 of each: GGX (single scattering), index 1: MULTI_GGX (Blender's default)."""

WIDTH = np.array([
    [2.2532, 2.2184, 2.1356, 2.0079, 1.8340, 1.5933, 1.2635, 0.8306, 0.3125],
    [2.2532, 2.2171, 2.1302, 1.9971, 1.8337, 1.6417, 1.3972, 1.0716, 0.6538],
])  # fmt: skip
"""p · α²."""

HEIGHT = np.array([
    [0.28150, 0.28036, 0.27790, 0.27509, 0.27130, 0.26309, 0.24791, 0.22847, 0.21156],
    [0.28212, 0.28371, 0.28948, 0.30562, 0.33689, 0.37959, 0.42131, 0.45678, 0.49245],
])  # fmt: skip
"""s · α²."""

ALBEDO = np.array([0.9941, 0.9763, 0.9402, 0.8814, 0.8018, 0.7075, 0.6046, 0.5027, 0.4098])
"""Share of a uniform world that the single-scattering lobe reflects at F = 1, averaged over the view with the cosine; 1 for MULTI_GGX."""

RESIDUAL = np.array([
    [0.3070, 0.3085, 0.3122, 0.3182, 0.3308, 0.3549, 0.3910, 0.4318, 0.4705],
    [0.3081, 0.3148, 0.3273, 0.3359, 0.3345, 0.3311, 0.3460, 0.3812, 0.4242],
])  # fmt: skip
"""Relative root-mean-square difference from Cycles that the fit leaves."""

DIELECTRIC_ROUGHNESS = np.array([0.1, 0.3, 0.5, 0.7, 1.0])
DIELECTRIC_ALBEDO = np.array([1.0, 0.876, 0.659, 0.462, 0.248])
"""Share of a uniform world that Principled's dielectric lobe (IOR 1.5) reflects, relative to that of a smooth surface."""

SMALLEST = 0.03
"""Below it a lobe is narrower than 0.05° and roughness no longer matters: p stays under 3e6."""


def exponent_from_roughness(roughness: float, multiscatter: bool = True) -> float:
    """The Phong exponent p that stands for Blender's `roughness` (0 to 1, clamped): 2.8e6 at 0.03 and below, 0.65 at 1."""
    roughness = _clamped(roughness)
    return float(np.interp(roughness, ROUGHNESS, WIDTH[int(multiscatter)]) / roughness**4)


def specular_scale(roughness: float, multiscatter: bool = True) -> float:
    """s in k_s = F0 · s: the lobe's height at n = h in units of a white diffuser's radiance."""
    roughness = _clamped(roughness)
    return float(np.interp(roughness, ROUGHNESS, HEIGHT[int(multiscatter)]) / roughness**4)


def specular_albedo(roughness: float, multiscatter: bool = True) -> float:
    """Share of a uniform white world that the lobe reflects for F0 = 1 (no Fresnel): the ambient coefficient of the lobe per F0."""
    if multiscatter:
        return 1.0
    return float(np.interp(_clamped(roughness), [0.0, *ROUGHNESS], [1.0, *ALBEDO]))


def dielectric_albedo(roughness: float, f0: float = 0.04) -> float:
    """Share of a uniform white world that Principled's dielectric lobe of normal reflectance `f0` reflects, Fresnel included: 0.092
    at roughness 0, 0.061 at 0.5, 0.023 at 1 for IOR 1.5. Principled's diffuse part keeps the rest (measured: a white furnace gives 1)."""
    smooth = f0 + (1.0 - f0) * 0.054  # the mean Fresnel reflectance, within 0.002 for IOR 1.3 to 2
    return smooth * float(np.interp(_clamped(roughness), DIELECTRIC_ROUGHNESS, DIELECTRIC_ALBEDO))


def roughness_from_exponent(exponent: float, multiscatter: bool = True) -> float:
    """The inverse of `exponent_from_roughness`: 1 for exponents below its range, 0.03 above."""
    dense = np.linspace(SMALLEST, 1.0, 4096)
    widths = np.interp(dense, ROUGHNESS, WIDTH[int(multiscatter)])
    exponents = np.log(widths) - 4 * np.log(dense)
    return float(np.interp(-np.log(max(exponent, 1e-9)), -exponents, dense))


def _clamped(roughness: float) -> float:
    """NaN counts as Blender's default of 0.5."""
    return min(max(roughness, SMALLEST), 1.0) if roughness == roughness else 0.5
