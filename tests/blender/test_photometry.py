"""Files of photometric webs: closed forms, and what is wrong with a file."""

from __future__ import annotations

import numpy as np
import pytest

from glint.addon.export.photometry import WATTS_PER_CANDELA, PhotometryError, read_web

pytestmark = pytest.mark.once


def file(polar, azimuth, candelas, tilt="TILT=NONE", kind=1, factors=(1.0, 1.0, 1.0)) -> str:
    rows = [" ".join(map(str, row)) for row in (polar, azimuth, *np.atleast_2d(candelas))]
    multiplier, ballast, lamp = factors
    head = f"1 1000 {multiplier} {len(polar)} {len(azimuth)} {kind} 2 0 0 0\n{ballast} {lamp} 75"
    return "\n".join(["IESNA:LM-63-2002", "[MANUFAC] none", tilt, head, *rows])


def test_numbers_between_angles_are_a_parabolas():
    """Catmull-Rom splines give polynomials of the second degree back."""
    polar = np.arange(0, 181, 15)
    web = read_web(file(polar, (0,), 3 + polar**2, factors=(2.0, 0.5, 0.25)))
    asked = np.linspace(15, 164, 50)
    found = web.at(np.full(50, 77.0), asked) / WATTS_PER_CANDELA
    np.testing.assert_allclose(found, (3 + asked**2) / 4, rtol=1e-12)


def test_beyond_the_angles_it_is_dark():
    web = read_web(file((0, 30, 60), (0,), (5, 4, 3)))
    np.testing.assert_array_equal(web.at(np.zeros(2), np.array([60.0, 90.0])), 0)
    table = web.table()
    assert table.shape == (1024, 1)
    assert (table[: int(1023 / 3)] > 0).all() and (table[int(1023 / 3) + 1 :] == 0).all()


@pytest.mark.parametrize(
    ("azimuth", "mirrored"),
    [((0, 45, 90), (0, 180, 360)), ((0, 90, 180), (0, 360)), ((90, 180, 270), (0, 360))],
)
def test_parts_of_the_turn_are_mirrored(azimuth, mirrored):
    candelas = np.random.default_rng(2).uniform(1, 9, (len(azimuth), 3))
    web = read_web(file((0, 45, 90), azimuth, candelas))
    first, low, high = azimuth[0], mirrored[0], mirrored[-1]
    for number, angle in enumerate(azimuth):
        for seen in (angle - first, high - low - (angle - first)):
            place = np.flatnonzero(web.azimuth == seen)[0]
            np.testing.assert_allclose(web.power[place], candelas[number] * WATTS_PER_CANDELA)


def test_tilts_are_passed_over():
    given = file((0, 90), (0,), (7, 7), tilt="TILT=INCLUDE\n1\n2\n0 90\n1 0.5")
    np.testing.assert_allclose(read_web(given).at(np.zeros(1), np.ones(1)), 7 * WATTS_PER_CANDELA)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "TILT=NONE",
        "TILT=INCLUDE\n1 nan 3",
        "TILT=NONE\n1 2 3 -4 1e300 1 2 0 0 0 1 1 1",
        file((0, 90), (0,), (1, 1), kind=3),
        file((0, 90), (0,), (1, np.inf)),
        file((0, 90, 45), (0,), (1, 1, 1)),
        file((0, 200), (0,), (1, 1)),
        file((0, 90), (10, 20), ((1, 1), (1, 1))),
        file((0, 90), (0, 100, 150), ((1, 1), (1, 1), (1, 1))),
        file((0, 90), (0,), (1,)),
    ],
)
def test_what_is_wrong_is_told(text):
    with pytest.raises(PhotometryError):
        read_web(text)
