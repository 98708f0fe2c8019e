"""How bright the sky of Hosek and Wilkie is over Preetham's, as Cycles 5.0 draws both: the mean of
each channel above the horizon.
"""

from __future__ import annotations

import numpy as np

_TURBIDITY = (2.0, 2.2, 2.5, 3.0, 4.0, 6.0, 8.0, 10.0)
_ELEVATION = (0.0, 3.0, 8.0, 15.0, 30.0, 50.0, 70.0, 90.0)
"""Degrees of the sun."""
_OVER_PREETHAM = (
    np.array(
        [
            [  # red
                [36, 61, 78, 86, 94, 98, 111, 115],
                [47, 81, 102, 111, 114, 112, 119, 121],
                [61, 105, 131, 137, 131, 120, 120, 119],
                [77, 137, 167, 166, 144, 122, 113, 111],
                [97, 188, 227, 215, 166, 128, 110, 107],
                [129, 236, 272, 240, 172, 123, 103, 99],
                [168, 243, 273, 240, 175, 137, 112, 99],
                [331, 200, 213, 206, 181, 181, 160, 107],
            ],
            [  # green
                [30, 63, 92, 108, 119, 125, 135, 125],
                [39, 81, 118, 135, 140, 139, 142, 128],
                [49, 103, 147, 162, 156, 145, 141, 124],
                [63, 132, 182, 190, 168, 143, 132, 115],
                [83, 175, 234, 231, 184, 142, 121, 104],
                [124, 230, 283, 260, 188, 134, 106, 89],
                [189, 255, 292, 266, 195, 144, 108, 79],
                [434, 226, 241, 239, 208, 180, 138, 82],
            ],
            [  # blue
                [26, 64, 100, 113, 114, 128, 148, 122],
                [33, 80, 124, 138, 133, 141, 154, 123],
                [42, 99, 150, 162, 149, 146, 152, 117],
                [53, 123, 180, 188, 161, 145, 141, 106],
                [73, 159, 223, 221, 174, 142, 127, 95],
                [126, 220, 276, 257, 190, 141, 114, 81],
                [235, 276, 308, 283, 210, 156, 119, 76],
                [693, 303, 301, 285, 241, 199, 151, 81],
            ],
        ]
    )
    / 1000
)  # fmt: skip
"""Over black ground: a row for each turbidity, a column for each elevation."""
_OF_GROUND = (0.11, 0.08, 0.14, 0.23, 0.44, 0.71, 0.95, 1.01)
"""What white ground adds, by elevation."""


def over_preetham(turbidity: float, elevation: float, albedo: float) -> tuple[float, ...]:
    """Red, green and blue. turbidity: from 2 to 10, beyond them the same. elevation: of the sun, in
    radians. albedo: of the ground.
    """
    degrees = np.degrees(elevation)
    ground = 1 + albedo * np.interp(degrees, _ELEVATION, _OF_GROUND)
    columns = [
        [np.interp(degrees, _ELEVATION, row) for row in channel] for channel in _OVER_PREETHAM
    ]
    return tuple(float(ground * np.interp(turbidity, _TURBIDITY, column)) for column in columns)
