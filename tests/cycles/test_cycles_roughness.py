"""The table of addon/export/roughness.py is still what Cycles measures."""

import numpy as np
import pytest

import fit_roughness
from glint.addon.export import roughness as table


@pytest.mark.parametrize("multiscatter", [False, True], ids=("GGX", "MULTI_GGX"))
@pytest.mark.parametrize("roughness", [0.15, 0.45, 0.85])
def test_fit_is_as_good_as_documented(roughness, multiscatter):
    """Between the table's rows, so that its interpolation is measured too; 2 % of the residual for that and for the sampling."""
    lobes = fit_roughness.measure_lobes(roughness, "MULTI_GGX" if multiscatter else "GGX")
    exponent, scale = table.exponent_from_roughness(roughness, multiscatter), table.specular_scale(roughness, multiscatter)
    left = fit_roughness.residual(lobes, exponent, scale)
    assert left < 1.02 * np.interp(roughness, table.ROUGHNESS, table.RESIDUAL[int(multiscatter)])


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_albedo(roughness):
    """To 0.003: a sample count of a few per normal, 9216 normals."""
    assert abs(fit_roughness.measure_albedo(roughness, "GGX", 8) - table.specular_albedo(roughness, False)) < 0.003


def test_round_trip():
    for roughness in np.linspace(0.03, 1, 50):
        exponent = table.exponent_from_roughness(roughness)
        assert abs(table.roughness_from_exponent(exponent) - roughness) < 1e-5


def test_monotone_and_clamped():
    grid = np.linspace(0, 1, 500)
    for multiscatter in (False, True):
        exponents = [table.exponent_from_roughness(r, multiscatter) for r in grid]
        scales = [table.specular_scale(r, multiscatter) for r in grid]
        for values in (exponents, scales):
            assert (np.diff(values) <= 0).all()
            assert np.isfinite(values).all()
    assert table.roughness_from_exponent(0.0) == 1.0
    assert table.roughness_from_exponent(1e12) == pytest.approx(table.SMALLEST)
    assert table.exponent_from_roughness(float("nan")) == table.exponent_from_roughness(0.5)
