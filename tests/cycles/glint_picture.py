"""Glint's picture of the current Blender scene, and its comparison with Cycles' away from edges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import cycles_reference as cycles
from cycles_reference import bpy, oiio
from glint.addon.export import export_scene
from glint.engine import Film, Settings, available_backends, render

OUT = Path(__file__).resolve().parents[2] / "out"
BACKENDS = ("NATIVE", "NUMPY")
PASSES = frozenset({"Depth", "Position", "Normal", "Diffuse", "Shadow"})


@dataclass
class Pair:
    """Both pictures of one scene. cycles, glint: name → (h, w[, c]) float32 of the same region."""

    name: str
    cycles: dict[str, np.ndarray]
    glint: dict[str, np.ndarray]

    def colors(self) -> tuple[np.ndarray, np.ndarray]:
        return self.cycles["Combined"][..., :3], self.glint["Combined"][..., :3]


def render_glint(scene, backend: str, edit=None, **settings) -> Film:
    """Exports and traces `scene` with one sample through the pixels' centres. edit: engine.Scene →
    engine.Scene before tracing.
    """
    if backend not in available_backends():
        raise RuntimeError(
            f"the {backend} tracer does not load here, and the checks against Cycles need it"
        )
    factor = scene.render.resolution_percentage / 100
    width, height = int(scene.render.resolution_x * factor), int(scene.render.resolution_y * factor)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    export = export_scene(
        depsgraph, width=width, height=height, passes=PASSES, has_light_groups=True
    )
    options = {
        "samples": 1,
        "light_samples": 1,
        "passes": PASSES,
        "region": export.region,
        "backend": backend,
        **settings,
    }
    return render(edit(export.scene) if edit else export.scene, Settings(**options))


def render_pair(scene, backend: str, name: str, bounces: int = 0, **options) -> Pair:
    """Both pictures; Cycles' is cut to the border where there is one."""
    film = render_glint(scene, backend, max_bounces=bounces, **options)
    reference = cycles.render_cycles(scene, bounces=bounces)
    cut = {pass_name: _cut(values, scene) for pass_name, values in reference.items()}
    return Pair(
        f"{name}-{backend.lower()}",
        cut,
        {pass_name: np.squeeze(values) for pass_name, values in film.passes.items()},
    )


def _cut(values: np.ndarray, scene) -> np.ndarray:
    """The border's part of a full frame: Blender rounds its edges down."""
    render_settings, (height, width) = scene.render, values.shape[:2]
    full = (int(render_settings.resolution_y), int(render_settings.resolution_x))
    if not render_settings.use_border or (height, width) != full:
        return values
    x0, x1 = (
        int(edge * width) for edge in (render_settings.border_min_x, render_settings.border_max_x)
    )
    y0, y1 = (
        int(edge * height) for edge in (render_settings.border_min_y, render_settings.border_max_y)
    )
    return values[y0:y1, x0:x1]


# --- edges


def spread(values: np.ndarray, largest: bool) -> np.ndarray:
    """Maximum (or minimum) over the 3×3 neighbourhood; edge pixels repeat."""
    padded = np.pad(values, [(1, 1), (1, 1)] + [(0, 0)] * (values.ndim - 2), mode="edge")
    height, width = values.shape[:2]
    shifted = [padded[i : i + height, j : j + width] for i in range(3) for j in range(3)]
    return (np.maximum if largest else np.minimum).reduce(shifted)


def same_around(mask: np.ndarray) -> np.ndarray:
    """Where all nine pixels have the same truth value."""
    return spread(mask, True) == spread(mask, False)


def surface_interior(passes: dict[str, np.ndarray], bend: float = 0.35) -> np.ndarray:
    """Pixels whose nine neighbours hit one surface: all hit, normals within `bend`, no depth step
    that the slopes do not explain.
    """
    hit = passes["Depth"] < 1e9
    depth = np.where(hit, passes["Depth"], 0.0).astype(float)
    normal = passes["Normal"]
    turned = (spread(normal, True) - spread(normal, False)).max(-1)
    padded = np.pad(depth, 1, mode="edge")
    curvature = np.maximum(
        np.abs(padded[1:-1, 2:] + padded[1:-1, :-2] - 2 * depth),
        np.abs(padded[2:, 1:-1] + padded[:-2, 1:-1] - 2 * depth),
    )
    return (
        hit
        & same_around(hit)
        & (turned < bend)
        & (spread(curvature, True) < 0.02 * np.maximum(depth, 1e-6))
    )


def shadow_interior(passes: dict[str, np.ndarray]) -> np.ndarray:
    """Pixels whose nine neighbours are all lit or all dark."""
    return same_around(is_lit(passes["Combined"][..., :3]))


def is_lit(colors: np.ndarray) -> np.ndarray:
    """(h, w) bool: more than what rounding leaves of light and shadow, of either sign."""
    return np.abs(colors.sum(-1)) > 1e-12


def interior(pair: Pair, bend: float = 0.35) -> np.ndarray:
    """Pixels away from edges of surfaces in both pictures; at least a fifth of the picture, or the
    check would be empty.
    """
    inside = surface_interior(pair.cycles, bend) & surface_interior(pair.glint, bend)
    assert inside.mean() > 0.2, (
        f"{pair.name}: only {inside.mean():.1%} of the pixels are away from edges"
    )
    return inside


# --- verdicts


def check_geometry(pair: Pair, inside: np.ndarray, tolerance: float = 1e-4) -> None:
    """Depth, Position (relative to the distance) and Normal agree to `tolerance` where `inside`;
    hits agree away from edges.
    """
    hits = [p["Depth"] < 1e9 for p in (pair.cycles, pair.glint)]
    both = same_around(hits[0]) & same_around(hits[1])
    verdict(pair, "hit", (hits[0] != hits[1]) & both, 0)
    depth = pair.cycles["Depth"].astype(float)
    verdict(pair, "Depth", np.abs(pair.glint["Depth"] - depth) / depth * inside, tolerance)
    scale = np.maximum(np.abs(pair.cycles["Position"]).max(-1), depth)
    verdict(
        pair,
        "Position",
        np.abs(pair.glint["Position"] - pair.cycles["Position"]).max(-1) / scale * inside,
        tolerance,
    )
    verdict(
        pair,
        "Normal",
        np.abs(pair.glint["Normal"] - pair.cycles["Normal"]).max(-1) * inside,
        tolerance,
    )


def check_radiance(
    pair: Pair, inside: np.ndarray, tolerance: float = 1e-4, floor: float = 1e-6
) -> None:
    """Shadow pixels agree exactly and lit ones to a relative `tolerance`. floor: what counts as
    zero, relative to the brightest pixel.
    """
    truth, picture = (c.astype(float) for c in pair.colors())
    inside = inside & shadow_interior(pair.cycles) & shadow_interior(pair.glint)
    lit, lit_here = is_lit(truth), is_lit(picture)
    assert lit[inside].mean() > 0.05, f"{pair.name}: nearly nothing is lit, so nothing is checked"
    verdict(pair, "shadow", (lit != lit_here) & inside, 0)
    error = np.abs(picture - truth) / np.maximum(
        np.abs(truth), floor * np.abs(truth).max() / tolerance
    )
    verdict(pair, "radiance", error.max(-1) * inside, tolerance)


def verdict(pair: Pair, what: str, error: np.ndarray, tolerance: float) -> None:
    """Fails, and writes image, reference and error to out/, when any pixel's error is above
    `tolerance` or not a number.
    """
    wrong = ~(error <= tolerance)
    if not wrong.any():
        return
    paths = dump(pair, what, error)
    row, column = np.unravel_index(np.argmax(np.where(np.isnan(error), np.inf, error)), error.shape)
    raise AssertionError(
        f"{pair.name}: {what} is off on {wrong.sum()} of {error.size} pixels, by up to "
        f"{np.nanmax(error.astype(float)):.3g} (allowed "
        f"{tolerance:g}) at column {column}, row {row} from the bottom; see "
        f"{', '.join(str(p) for p in paths)}"
    )


def dump(pair: Pair, what: str, error: np.ndarray) -> list[Path]:
    """Writes out/<name>-<what>-{glint,cycles,difference}.exr and returns the paths."""
    OUT.mkdir(exist_ok=True)
    key = what if what in pair.cycles else "Combined"
    images = {"glint": pair.glint[key], "cycles": pair.cycles[key], "difference": error}
    return [
        write_exr(OUT / f"{pair.name}-{what}-{label}.exr", image) for label, image in images.items()
    ]


def write_exr(path: Path, image: np.ndarray) -> Path:
    """Writes (h, w[, c]), row 0 at the bottom, as 32-bit EXR."""
    pixels = np.ascontiguousarray(np.flipud(image.astype(np.float32)).reshape(*image.shape[:2], -1))
    height, width, channels = pixels.shape
    output = oiio.ImageOutput.create(str(path))
    output.open(str(path), oiio.ImageSpec(width, height, channels, oiio.FLOAT))
    output.write_image(pixels)
    output.close()
    return path


def with_lobes(table):
    """An `edit` for render_glint: materials named in `table` get its lobes, the others keep
    theirs.
    """

    def edit(scene):
        return replace(
            scene,
            materials=tuple(replace(m, lobes=table.get(m.name, m.lobes)) for m in scene.materials),
        )

    return edit
