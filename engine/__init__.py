"""Glint's engine: `render(scene, settings) -> Film`, and rays without a picture: `Accelerator`.
Knows nothing of Blender.
"""

from __future__ import annotations

import numpy as np

from .accelerator import Accelerator, Hits
from .analysis.explain import PixelExplainer, explanation_lines
from .backends import available_backends, check, native_error, render
from .cryptomatte import crypto_metadata, manifests
from .errors import NO_THREAD, SceneError
from .explained import Ray
from .film import (
    AOV,
    BY_SURFACE,
    CATCHER,
    CRYPTOMATTES,
    DENOISING,
    LIGHT_GROUP,
    OCCLUSION,
    PARTS,
    PASSES,
    Film,
)
from .kept import KeptRender
from .linear import affine_inverse, determinant
from .live import LiveRender, Task, Wave
from .sampling import TILE_SIDE
from .scene import Scene
from .scene.viewing import pixel_bounds_of_box
from .settings import Settings

__all__ = [
    "AOV",
    "BY_SURFACE",
    "CATCHER",
    "CRYPTOMATTES",
    "DENOISING",
    "LIGHT_GROUP",
    "NO_THREAD",
    "OCCLUSION",
    "PARTS",
    "PASSES",
    "TILE_SIDE",
    "Accelerator",
    "Film",
    "Hits",
    "KeptRender",
    "LiveRender",
    "PixelExplainer",
    "Ray",
    "Scene",
    "SceneError",
    "Settings",
    "Task",
    "Wave",
    "affine_inverse",
    "available_backends",
    "check",
    "crypto_metadata",
    "determinant",
    "explanation_lines",
    "manifests",
    "native_error",
    "pixel_bounds_of_box",
    "render",
]

np.ones((256, 256)) @ np.ones((256, 256))
"""OpenBLAS, which multiplies NumPy's matrices, takes 32 MB at its first product and keeps them; on
some processors products of small matrices do without. Asked when memory is short it spins for ever
instead of failing, so it is asked here.
"""
