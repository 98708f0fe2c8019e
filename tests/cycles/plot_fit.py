"""Draws docs/ggx_fit.png: by how much the Blinn-Phong lobes that stand for GGX are brighter or
darker than it, by roughness and the angle between the normal and the half vector; and prints the
share of the energy, weighed by the cosine, that they have.

    python tests/cycles/plot_fit.py
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import glint_tree  # noqa: E402, F401  (makes the package importable as glint)
from glint.addon.export.materials.roughness import highlights  # noqa: E402
from glint.engine.analysis import plot  # noqa: E402

TARGET = HERE.parents[1] / "docs/ggx_fit.png"
CELL, LEFT, TOP = (7, 6), 70, 40
MOST = 0.2
"""The error that has the strongest colour."""
ANGLES = np.arange(0, 86)
ROUGHNESS = np.linspace(0.1, 1.0, 46)


def ggx(roughness: float, cosine: np.ndarray) -> np.ndarray:
    """π D / 4."""
    a2 = roughness**4
    return a2 / (4 * (cosine * cosine * (a2 - 1) + 1) ** 2)


def lobes(roughness: float, cosine: np.ndarray) -> np.ndarray:
    return sum(size * cosine**exponent for exponent, size in highlights(roughness))


def color_of(error: np.ndarray) -> np.ndarray:
    """(..., 3) red where the lobes are brighter, blue where they are darker, white in between."""
    share = np.clip(error / MOST, -1, 1)[..., None]
    red, blue = np.array([0.85, 0.15, 0.1]), np.array([0.1, 0.25, 0.85])
    return np.where(share > 0, 1 + share * (red - 1), 1 - share * (blue - 1))


def main() -> None:
    cosine = np.cos(np.radians(ANGLES))
    error = np.stack([lobes(r, cosine) / ggx(r, cosine) - 1 for r in ROUGHNESS])
    cells = color_of(error).repeat(CELL[1], 0).repeat(CELL[0], 1)
    height, width = cells.shape[:2]
    image = plot.canvas(width + LEFT + 90, height + TOP + 40, (1.0, 1.0, 1.0))
    image[TOP : TOP + height, LEFT : LEFT + width] = cells
    black = (0.1, 0.1, 0.1)
    title = "lobes over GGX - 1, by roughness and angle of n and h"
    plot.draw_text(image, title, (LEFT, 14), black)
    for angle in range(0, 86, 15):
        plot.draw_text(image, f"{angle}", (LEFT + CELL[0] * angle - 4, TOP + height + 10), black)
    for k in range(0, len(ROUGHNESS), 5):
        plot.draw_text(image, f"{ROUGHNESS[k]:.1f}", (LEFT - 36, TOP + CELL[1] * k - 3), black)
    for k, value in enumerate((-0.2, -0.1, 0.0, 0.1, 0.2)):
        top = TOP + 24 * k
        image[top : top + 18, LEFT + width + 16 : LEFT + width + 34] = color_of(np.array(value))
        plot.draw_text(image, f"{100 * value:+.0f} %", (LEFT + width + 40, top + 5), black)
    TARGET.write_bytes(plot.png_bytes(image))
    for roughness in ROUGHNESS[::5]:
        print(f"{roughness:.1f}  {energy(roughness):.4f}")


def energy(roughness: float) -> float:
    """∫ of the lobes over that of GGX, over the hemisphere of half vectors with the cosine."""
    angle = np.linspace(0, np.pi / 2, 20001)
    cosine, weight = np.cos(angle), np.sin(angle) * np.cos(angle)
    return float(
        (lobes(roughness, cosine) * weight).sum() / (ggx(roughness, cosine) * weight).sum()
    )


if __name__ == "__main__":
    main()
