"""The picture: named passes of float32, row 0 at the bottom (as in Blender and in the notes)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

PASSES = {
    "Combined": 4,
    "Depth": 1,
    "Position": 3,
    "Normal": 3,
    "UV": 3,
    "Object Index": 1,
    "Material Index": 1,
    "Diffuse": 3,
    "Specular": 3,
    "Ambient": 3,
    "Shadow": 3,
    "Mirror": 3,
    "Emission": 3,
    "Environment": 3,
    "Error": 1,
    "Samples": 1,
    "Cost": 1,
    "Grazing": 1,
    "Gap": 1,
    "Fallbacks": 1,
    "Mist": 1,
    "Crypto Object": 12,
    "Crypto Material": 12,
    "Crypto Asset": 12,
    "Denoising Normal": 3,
    "Denoising Albedo": 3,
    "Denoising Depth": 1,
    "Shadow Catcher": 3,
    "Diffuse Direct": 3,
    "Diffuse Indirect": 3,
    "Diffuse Color": 3,
    "Glossy Direct": 3,
    "Glossy Indirect": 3,
    "Glossy Color": 3,
    "Transmission Direct": 3,
    "Transmission Indirect": 3,
    "Transmission Color": 3,
    "Volume Direct": 3,
    "Volume Indirect": 3,
    "Vector": 4,
    "Ambient Occlusion": 3,
}
"""Pass name -> channels, with the settings' own numbers of them (`channels_of`).
`semantics/passes.md` says what each holds.
"""

CRYPTOMATTES = ("Crypto Object", "Crypto Material", "Crypto Asset")
"""Passes of an id and its coverage, again and again, the largest coverage first."""

DENOISING = ("Denoising Normal", "Denoising Albedo", "Denoising Depth")
"""Passes that denoisers are told, beside the picture."""

SEEN = ("Mist", *CRYPTOMATTES, *DENOISING)
"""Passes that are means over the samples of what camera rays see."""

CATCHER = "Shadow Catcher"
"""The pass of what shadow catchers show; with it Combined has nothing of them."""

OCCLUSION = "Ambient Occlusion"
"""The pass of how much of an even sky is open over what camera rays meet."""

BY_SURFACE = tuple(
    f"{surface} {what}"
    for surface in ("Diffuse", "Glossy", "Transmission")
    for what in ("Direct", "Indirect", "Color")
)
"""Light by the kind of surface that gives it back first, straight from where it is made and by way
of others, and what of it that surface gives back, which both are told without.
"""

VOLUME = ("Volume Direct", "Volume Indirect")
"""The same of what media scatter to the camera, whole."""

LIGHTING = (*BY_SURFACE, *VOLUME)

PARTS = ("Diffuse", "Specular", "Ambient", "Shadow", "Mirror", "Emission", "Environment")
"""The passes whose sum is the colour of Combined."""

EFFORTS = ("Fallbacks",)
"""Passes that tell how a machine came to the picture, not what is in it: they differ between
tracers and instruction sets.
"""

NO_DEPTH = 1e10
"""Depth where a camera ray hits nothing, as Blender writes it; Gap where nothing lies behind its
hit.
"""

FIRST_ESTIMATE = 4
"""Samples that every pixel takes before its error is estimated (semantics/stopping.md)."""

UNKNOWN_ERROR = 256.0
"""Error of a pixel with too few samples for an estimate: beyond all levels."""


def empty_value(name: str) -> float:
    """What a pass holds where no camera ray hits anything."""
    return {"Depth": NO_DEPTH, "Gap": NO_DEPTH, "Mist": 1.0, "Shadow Catcher": 1.0}.get(name, 0.0)


AOV = "AOV "
"""What names of AOVs' passes begin with."""


def aov_pass(name: str) -> str:
    """The pass of an AOV: its colour and how much of the pixel gives it one."""
    return AOV + name


LIGHT_GROUP = "Light Group "
"""What names of light groups' passes begin with."""


def light_group_pass(name: str) -> str:
    """The pass of a light group: what of Combined its lights, glowing surfaces and surroundings
    give.
    """
    return LIGHT_GROUP + name


def channels_of(name: str, crypto_ids: int) -> int:
    """Of a pass in a picture whose Cryptomatte passes tell so many ids of a pixel."""
    return 2 * crypto_ids if name in CRYPTOMATTES else PASSES[name]


@dataclass(frozen=True, eq=False)
class Film:
    """A picture or a wave of it.

    passes: name -> (h, w, c) float32, of the settings' region or the whole frame.
    samples: how many samples a pixel holds, where refinement did not stop it before.
    complete: False when the render was stopped early.
    stats: seconds per stage ("build", "trace"), and counts ("triangles", "instances", "rays",
    "bytes", …). notes: what the tracer had to leave out, one sentence each; of the whole picture,
    waves have none.
    """

    passes: dict[str, np.ndarray]
    samples: int
    complete: bool = True
    stats: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def combined(self) -> np.ndarray:
        """(h, w, 4) float32, premultiplied alpha."""
        return self.passes["Combined"]
