"""The tables of addon/export/roughness.py are still what Cycles measures."""

import numpy as np
import pytest

import fit_roughness
from glint.addon.export import roughness as table

GRID = np.linspace(0, 1, 500)


@pytest.mark.parametrize("kind", table.HIGHLIGHTS)
@pytest.mark.parametrize("roughness", [0.25, 0.45, 0.85])
def test_fit_is_as_good_as_documented(roughness, kind):
    """Between the table's rows, so that its interpolation is measured too; 2 % of the residual for that and for the sampling."""
    lobes = fit_roughness.measure_lobes(roughness, kind)
    left = fit_roughness.residual(lobes, table.highlights(roughness, kind))
    assert left < 1.02 * np.interp(roughness, table.ROUGHNESS, table.HIGHLIGHTS[kind][4])


@pytest.mark.parametrize("roughness", [0.25, 0.5, 0.9])
def test_the_blinn_phong_nodes_likeness_has_the_roughness_of_its_exponent(roughness):
    """To the 5 % that addon/nodes.py speaks of: its α² = 2.25/(p + 1.9) for the exponent of the single lobe nearest to GGX."""
    lobes = fit_roughness.measure_lobes(roughness)
    ((exponent, _),) = fit_roughness.fit_lobes(lobes, [[2.2 / roughness**4, 0.28 / roughness**4]], 1.0)
    assert (2.25 / (exponent + 1.9)) ** 0.25 == pytest.approx(roughness, rel=0.05)


@pytest.mark.parametrize("roughness", [0.2, 0.5])
def test_two_lobes_leave_less_than_two_thirds_of_what_one_leaves(roughness):
    """On a display, where the best single lobe leaves 0.4 to 0.5."""
    lobes = fit_roughness.measure_lobes(roughness)
    one = fit_roughness.fit_lobes(lobes, [[2.2 / roughness**4, 0.28 / roughness**4]], 1.0)
    assert fit_roughness.residual(lobes, table.highlights(roughness, "GGX")) < 2 / 3 * fit_roughness.residual(lobes, one)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_albedo(roughness):
    """To 0.003: a sample count of a few per normal, 9216 normals."""
    assert abs(fit_roughness.measure_albedo(roughness, "GGX", 8) - table.specular_albedo(roughness, False)) < 0.003
    assert abs(fit_roughness.measure_albedo(roughness, "DIELECTRIC", 8) - table.layer_albedo(roughness, 1.5)) < 0.001


@pytest.mark.parametrize("kind", table.HIGHLIGHTS)
def test_smooth_falling_and_not_negative(kind):
    """Exponents and the peak fall with roughness, without a jump; no lobe takes light away."""
    lobes = np.array([table.highlights(r, kind) for r in GRID])
    for falling in (lobes[:, 0, 0], lobes[:, 1, 0], lobes[..., 1].sum(1), lobes[:, 0, 1]):
        assert (np.diff(falling) <= 0).all()
    assert (lobes > 0).all()
    assert np.isfinite(lobes).all()
    assert (lobes[:, 0, 0] > lobes[:, 1, 0]).all()
    assert np.abs(np.diff(np.log(lobes), axis=0)[GRID[1:] > 0.2]).max() < 0.06


def test_nonsense_counts_as_the_default():
    assert table.highlights(float("nan")) == table.highlights(0.5)
