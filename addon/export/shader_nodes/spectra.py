"""Nodes that turn temperatures and wavelengths into colours of the working space, as Cycles
does."""

from __future__ import annotations

import numpy as np

from ....engine.program.graph import Value
from ..images.colorspace import from_rec709, rgb_from_xyz
from .reader import READERS, NodeInputs, Outputs

_COLD = (5.413294490189271, -0.20319390035873933, -0.0822535242887164)
_HOT = (0.8262954810464208, 0.9945080501520986, 1.566307710274283)
_STARTS = (0.0, 800.0, 965.0, 1167.0, 1449.0, 1902.0, 3315.0, 6365.0, 12000.0)
"""Kelvins from which each row of the fit holds. Below 800 K and from 12000 K on a black body keeps
its colour."""
_RED = (
    (1.61919106e03, 5.02995757e00, -2.05010916e-03),
    (2.48845471e03, 3.22621544e00, -1.11330907e-03),
    (3.34143193e03, 1.76486769e00, -4.86551192e-04),
    (4.09461742e03, 7.25731635e-01, -1.27446582e-04),
    (4.67028036e03, 1.26703442e-01, 2.91258199e-05),
    (4.59509185e03, 1.50345020e-01, 2.87495649e-05),
    (3.78717450e03, 3.99075871e-01, 9.35907826e-06),
)
_GREEN = (
    (-4.88999748e02, -7.55807526e-02, 6.04330754e-04),
    (-7.55994277e02, 4.78306139e-01, 3.16730098e-04),
    (-1.02363977e03, 9.36662319e-01, 1.20223470e-04),
    (-1.26571316e03, 1.27054498e00, 4.87340896e-06),
    (-1.42529332e03, 1.43972784e00, -4.01150431e-05),
    (-1.17554822e03, 1.30408023e00, -2.16378048e-05),
    (-5.00799571e02, 1.09098763e00, -4.59832026e-06),
)
_BLUE = (
    (-4.07936148e-03, -9.70622247e-05, -4.85742887e-08, 5.96945309e-11),
    (2.89312858e-02, -1.98503712e-04, 5.55021075e-08, 2.40430366e-11),
    (9.10767778e-02, -3.56632824e-04, 1.89878968e-07, -1.40949732e-11),
    (1.56723440e-01, -4.93211319e-04, 2.84822009e-07, -3.61460868e-11),
    (-2.22783266e-02, -2.50542825e-04, 1.75359352e-07, -1.97075738e-11),
    (-7.38077418e-01, 3.86216271e-04, -1.64216008e-08, -1.61997957e-13),
    (-7.52335691e-01, 4.24098264e-04, -2.73078809e-08, 6.72650283e-13),
)
"""Cycles' fit of a black body's colour in Rec. 709: a / T + b + c T of red and green, a cubic of
blue.
"""


def _constant_row(color: tuple[float, ...]) -> list[float]:
    return [x for channel in color for x in (0.0, channel, 0.0, 0.0, 0.0)]


def blackbody_table() -> tuple[float, ...]:
    """What `piecewise` reads."""
    rows = [_constant_row(_COLD)]
    for red, green, blue in zip(_RED, _GREEN, _BLUE, strict=True):
        rows.append([*red, 0.0, 0.0, *green, 0.0, 0.0, 0.0, *blue])
    rows.append(_constant_row(_HOT))
    working = [(from_rec709() @ np.reshape(row, (3, 5))).ravel().tolist() for row in rows]
    return tuple(x for start, row in zip(_STARTS, working, strict=True) for x in (start, *row))


def blackbody_colors(kelvin: np.ndarray) -> np.ndarray:
    """(n,) float64 temperatures to (n, 3) colours, by the same table."""
    rows = np.array(blackbody_table()).reshape(-1, 16)
    row = rows[np.searchsorted(rows[1:, 0], kelvin, "right"), 1:].reshape(-1, 3, 5)
    over = np.where(kelvin > 0, 1 / np.where(kelvin > 0, kelvin, 1.0), 0.0)
    powers = np.stack([over, *(kelvin**k for k in range(4))], -1)
    return (row * powers[:, None]).sum(-1)


_OBSERVER = """
14 0 65, 22 1 105, 42 1 201, 76 2 362, 143 4 679, 232 6 1102, 435 12 2074, 776 22 3713,
1344 40 6456, 2148 73 10391, 2839 116 13856, 3285 168 16230, 3483 230 17471, 3481 298 17826,
3362 380 17721, 3187 480 17441, 2908 600 16692, 2511 739 15281, 1954 910 12876,
1421 1126 10419, 956 1390 8130, 580 1693 6162, 320 2080 4652, 147 2586 3533, 49 3230 2720,
24 4073 2123, 93 5030 1582, 291 6082 1117, 633 7100 782, 1096 7932 573, 1655 8620 422,
2257 9149 298, 2904 9540 203, 3597 9803 134, 4334 9950 87, 5121 10000 57, 5945 9950 39,
6784 9786 27, 7621 9520 21, 8425 9154 18, 9163 8700 17, 9786 8163 14, 10263 7570 11,
10567 6949 10, 10622 6310 8, 10456 5668 6, 10026 5030 3, 9384 4412 2, 8544 3810 2, 7514 3210 1,
6424 2650 0, 5419 2170 0, 4479 1750 0, 3608 1382 0, 2835 1070 0, 2187 816 0, 1649 610 0,
1212 446 0, 874 320 0, 636 232 0, 468 170 0, 329 119 0, 227 82 0, 158 57 0, 114 41 0, 81 29 0,
58 21 0, 41 15 0, 29 10 0, 20 7 0, 14 5 0, 10 4 0, 7 2 0, 5 2 0, 3 1 0, 2 1 0, 2 1 0, 1 0 0,
1 0 0, 1 0 0, 0 0 0
"""
"""x, y, z of the CIE 1931 observer from 380 to 780 nm, every 5 nm, in ten thousandths."""
_MATCHING = np.array([row.split() for row in _OBSERVER.split(",")], np.float64) / 1e4
_FIRST, _LAST, _STEP = 380.0, 780.0, 5.0
WAVELENGTHS = np.arange(_FIRST, _LAST + 1)
"""Of `matching`, nanometres."""
_BRIGHTEST = 2.52
"""Cycles divides by this, so that no channel exceeds 1."""


def matching() -> np.ndarray:
    """(m, 3) x, y, z of the CIE 1931 observer at `WAVELENGTHS`."""
    given = np.arange(_FIRST, _LAST + 1, _STEP)
    return np.column_stack([np.interp(WAVELENGTHS, given, c) for c in _MATCHING.T])


def _wavelength_table() -> tuple[float, ...]:
    """What `curves` reads."""
    colors = _MATCHING @ rgb_from_xyz().T / _BRIGHTEST
    return (_FIRST, _LAST, *colors.reshape(-1).tolist())


def at_least_black(view: NodeInputs, color: Value) -> Value:
    constant = view.reader.graph.constant
    return view.apply("bounded", color, constant((0.0,) * 3), constant((np.inf,) * 3))[0]


def _blackbody(view: NodeInputs) -> Outputs:
    color = view.apply("piecewise", view.value("Temperature"), table=blackbody_table())[0]
    return {"Color": at_least_black(view, color)}


def _wavelength(view: NodeInputs) -> Outputs:
    """Black beyond the table, which Cycles carries on a step below its first row."""
    do, length = view.math, view.value("Wavelength")
    one = view.reader.graph.constant(1.0)
    color = view.apply("curves", one, view.vector_of(length), extends=1, table=_wavelength_table())[
        0
    ]
    seen = do("GREATER_THAN", length, _FIRST - _STEP)
    seen = do("MULTIPLY", seen, do("LESS_THAN", length, _LAST))
    return {"Color": at_least_black(view, view.apply("product", color, view.vector_of(seen))[0])}


READERS["ShaderNodeBlackbody"] = _blackbody
READERS["ShaderNodeWavelength"] = _wavelength
