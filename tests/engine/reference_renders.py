"""Reference renders: the bits that the core draws of the engine's own scenes, kept as hashes, with
pictures to look at when one differs.

The hashes hold on every machine, instruction set and number of threads. `renew_references.py`
beside this file renews them.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from engine_scenes import SCENES
from glint import engine
from glint.engine.scene import Mesh, Scene

HERE = Path(__file__).resolve().parent

HASHES = HERE / "reference_hashes.json"
PICTURES = HERE / "reference_pictures"
SETTINGS = engine.Settings(
    samples=4,
    light_samples=3,
    max_bounces=4,
    passes=frozenset(engine.PASSES) - {"Combined", "Fallbacks"},
)

Array = np.ndarray


def rounded(value: Any) -> Any:
    """A scene's value with every float64 in it rounded to float32's digits: the last bits of
    NumPy's sines and norms differ between machines, and are not what these renders are about.
    """
    if isinstance(value, np.ndarray):
        return value.astype(np.float32).astype(np.float64) if value.dtype == np.float64 else value
    if isinstance(value, float):
        return float(np.float32(value))
    if isinstance(value, tuple):
        return tuple(rounded(item) for item in value)
    if is_dataclass(value):
        return replace(
            value, **{field.name: rounded(getattr(value, field.name)) for field in fields(value)}
        )
    return value


def draw(name: str, settings: engine.Settings = SETTINGS) -> dict[str, Array]:
    """All passes of one scene, (h, w, c) float32; what looks round is drawn by itself, as its rays
    would count as the picture's.
    """
    scene = SCENES[name]()
    moving = replace(scene, neighbours=(elsewhere(scene, -1.0), elsewhere(scene, 2.0)))
    told, apart = rounded(moving), settings.passes & {engine.OCCLUSION}
    passes = engine.render(told, replace(settings, passes=settings.passes - apart)).passes
    beside = engine.render(told, replace(settings, passes=apart)).passes if apart else {}
    return passes | {name: beside[name] for name in apart}


def elsewhere(scene: Scene, share: float) -> Scene:
    """Another frame, in which all that stands there has moved and meshes have grown."""
    step = np.zeros((3, 4))
    step[:, 3] = 0.125 * share, 0.25 * share, -0.5 * share
    grown = np.float32(1 + 0.125 * share)
    return replace(
        scene,
        geometries=tuple(
            replace(g, vertices=g.vertices * grown) if isinstance(g, Mesh) else g
            for g in scene.geometries
        ),
        instances=tuple(
            replace(block, world_from_object=block.world_from_object + step)
            for block in scene.instances
        ),
    )


def hashes_of(passes: dict[str, Array]) -> dict[str, str]:
    """Pass name -> the first 16 digits of the SHA-256 of its little-endian float32 rows, bottom row
    first.
    """
    return {
        name: hashlib.sha256(array.astype("<f4").tobytes()).hexdigest()[:16]
        for name, array in sorted(passes.items())
    }


def kept_hashes() -> dict[str, dict[str, str]]:
    """Scene name -> pass name -> hash."""
    return json.loads(HASHES.read_text(encoding="utf-8")) if HASHES.exists() else {}


def kept_picture(name: str) -> Array | None:
    """(h, w, 4) Combined of the last renewal, or None."""
    path = PICTURES / f"{name}.exr"
    return read_exr(path) if path.exists() else None


def read_exr(path: Path) -> Array:
    """(h, w, c) float32, bottom row first."""
    image = oiio.ImageInput.open(str(path))
    if image is None:
        raise OSError(f"{path} cannot be read: {oiio.geterror()}")
    try:
        return np.ascontiguousarray(image.read_image("float")[::-1])
    finally:
        image.close()


def write_exr(path: Path, picture: Array) -> None:
    """Lossless float32."""
    height, width, channels = picture.shape
    spec = oiio.ImageSpec(width, height, channels, "float")
    spec.attribute("compression", "zip")
    path.parent.mkdir(parents=True, exist_ok=True)
    image = oiio.ImageOutput.create(str(path))
    if (
        image is None
        or not image.open(str(path), spec)
        or not image.write_image(np.ascontiguousarray(picture[::-1]))
        or not image.close()
    ):
        raise OSError(f"{path} cannot be written: {oiio.geterror()}")


def difference(name: str, passes: dict[str, Array], folder: Path) -> str:
    """What differs from the kept render, in words; "" when nothing does. Writes both pictures and
    their difference into `folder`.
    """
    kept, found = kept_hashes().get(name), hashes_of(passes)
    if found == kept:
        return ""
    if kept is None:
        return f"{name}: there is no reference render of this scene"
    changed = [key for key in sorted({*kept, *found}) if kept.get(key) != found.get(key)]
    return (
        f"{name}: other bits in {', '.join(changed)}; {_how_much(name, passes['Combined'], folder)}"
    )


def _how_much(name: str, picture: Array, folder: Path) -> str:
    kept = kept_picture(name)
    write_exr(folder / f"{name}_now.exr", picture)
    if kept is None or kept.shape != picture.shape:
        return f"its Combined is in {folder}, and there is no kept picture of that size"
    apart = np.abs(picture.astype(float) - kept)
    if not apart.any():
        return "Combined has the same bits"
    write_exr(folder / f"{name}_kept.exr", kept)
    write_exr(folder / f"{name}_difference.exr", apart.astype(np.float32))
    relative = apart / np.maximum(np.abs(kept), 1e-3 * np.abs(kept).max() + 1e-30)
    pixels = apart.any(-1)
    size = (
        f"by {apart.max():.3g} at most, {relative.max():.3g} relative to the pixel, "
        f"{apart.mean():.3g} on average"
    )
    return (
        f"Combined differs in {pixels.sum()} of {pixels.size} pixels, {size}; both and the "
        f"difference are in {folder}"
    )


def renew(folder: Path) -> list[str]:
    """Draws all scenes, writes what has changed, and says what that was."""
    drawn = {name: draw(name) for name in SCENES}
    changes = [text for name, passes in drawn.items() if (text := difference(name, passes, folder))]
    hashes = {name: hashes_of(passes) for name, passes in drawn.items()}
    for name, passes in drawn.items():
        kept = kept_picture(name)
        if kept is None or not np.array_equal(
            kept.view(np.uint32), passes["Combined"].view(np.uint32)
        ):
            write_exr(PICTURES / f"{name}.exr", passes["Combined"])
    for path in PICTURES.glob("*.exr"):
        if path.stem not in drawn:
            path.unlink()
    HASHES.write_text(json.dumps(hashes, indent=1) + "\n", encoding="utf-8")
    return changes
