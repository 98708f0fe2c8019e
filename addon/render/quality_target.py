"""A final render for a target error: the settings are found on squares of the frame before, and the
picture is checked on others after.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ... import engine
from ...engine.analysis.target import Forecast, Target, choose_settings, displayed, reached_error
from ..export.images.colorspace import openimageio


@dataclass(frozen=True)
class Display:
    """Scene-linear colours as the display shows them: Blender's view transform, look, exposure and
    gamma. Curves and white balance are not in it. config: OpenColorIO's file.
    """

    device: str
    view: str
    look: str
    exposure: float
    gamma: float
    config: str

    def __call__(self, colors: np.ndarray) -> np.ndarray:
        """(..., 3) linear → (..., 3) float64 in 0 to 1. Raises RuntimeError where the transform is
        not known.
        """
        oiio = openimageio()
        if oiio is None:
            raise RuntimeError("this Blender has no OpenImageIO to apply its view transform with")
        exposed = np.asarray(colors * 2.0**self.exposure, np.float32).reshape(1, -1, 3)
        source = oiio.ImageBuf(oiio.ImageSpec(exposed.shape[1], 1, 3, oiio.FLOAT))
        source.set_pixels(oiio.ROI(), exposed)
        shown = oiio.ImageBufAlgo.ociodisplay(
            source,
            self.device,
            self.view,
            fromspace="scene_linear",
            looks=self.look,
            unpremult=False,
            colorconfig=self.config,
        )
        if shown.has_error:
            raise RuntimeError(
                f"the view transform {self.view!r} cannot be applied: {shown.geterror()}"
            )
        pixels = np.clip(np.nan_to_num(shown.get_pixels(oiio.FLOAT).astype(float)), 0, 1)
        return (pixels ** (1 / self.gamma)).reshape(colors.shape)


@dataclass(frozen=True)
class QualityTarget:
    """What a render is to reach, and on which display."""

    target: Target
    display: Callable[[np.ndarray], np.ndarray]

    def choose(
        self, scene: engine.Scene, settings: engine.Settings, should_stop: Callable[[], bool]
    ) -> Forecast | None:
        return choose_settings(scene, settings, self.target, self.display, should_stop=should_stop)

    def told(
        self,
        scene: engine.Scene,
        forecast: Forecast,
        film: engine.Film,
        should_stop: Callable[[], bool],
    ) -> str:
        """What was asked for, chosen, predicted and reached, in words."""
        reached = reached_error(scene, forecast, film, should_stop) if film.complete else None
        seconds = film.stats.get("build", 0.0) + film.stats.get("trace", 0.0)
        end = (
            f"reached {self.target.text(reached)} in {seconds:.2f} s"
            if reached is not None
            else "stopped before it was reached"
        )
        return f"{forecast.line}; {end}"


def quality_target_of(scene: bpy.types.Scene) -> tuple[QualityTarget | None, list[str]]:
    """The target of the scene's final renders, None where the settings are the user's own; and what
    there is to say about it.
    """
    settings = scene.glint
    if settings.target == "NONE":
        return None, []
    value = settings.target_levels if settings.target == "LEVELS" else settings.target_rmse / 100
    display, notes = displayed, []
    if settings.target == "LEVELS":
        display, notes = _display_or_srgb(scene)
    return QualityTarget(Target(settings.target, value), display), notes


def _display_or_srgb(
    scene: bpy.types.Scene,
) -> tuple[Callable[[np.ndarray], np.ndarray], list[str]]:
    display = display_of(scene)
    try:
        display(np.full((1, 3), 0.5))
    except RuntimeError as error:
        return displayed, [f"Visible errors are those of the sRGB curve alone: {error}"]
    return display, []


def display_of(scene: bpy.types.Scene) -> Display:
    """The display that the scene is managed for."""
    view = scene.view_settings
    look = "" if view.look == "None" else view.look
    own = Path(bpy.utils.system_resource("DATAFILES", path="colormanagement")) / "config.ocio"
    config = os.environ.get("OCIO") or str(own)
    return Display(
        scene.display_settings.display_device,
        view.view_transform,
        look,
        view.exposure,
        max(view.gamma, 1e-3),
        config,
    )
