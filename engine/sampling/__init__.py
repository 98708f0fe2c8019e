"""Where samples lie: `patterns.py` has the points that all pixels share, imported from here;
`lens.py` and `motion.py` place them in a camera's lens and in the shutter's time.
"""

from .patterns import (
    LOBE_LEVELS,
    MOST_LOBE_POINTS,
    MOST_TABLED,
    blackman_harris,
    chosen,
    concentric_disc,
    dome_points,
    lens_square,
    light_points,
    lobe_points,
    node_points,
    occlusion_points,
    pixel_offsets,
    scatter_offsets,
    scatter_share,
    shared_shutter_times,
    shutter_times,
    sobol_points,
    tabled,
    walk_points,
)

__all__ = [
    "LOBE_LEVELS",
    "MOST_LOBE_POINTS",
    "MOST_TABLED",
    "blackman_harris",
    "chosen",
    "concentric_disc",
    "dome_points",
    "lens_square",
    "light_points",
    "lobe_points",
    "node_points",
    "occlusion_points",
    "pixel_offsets",
    "scatter_offsets",
    "scatter_share",
    "shared_shutter_times",
    "shutter_times",
    "sobol_points",
    "tabled",
    "walk_points",
]
