"""Direct light is told over what lights would give if nothing hid them: bumps and highlights, of
which surfaces and not lights make the differences, stay as they are while shadows are averaged
(semantics/resolve.md, What lights give).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import lamp
from glint import engine
from glint.engine import scene as s
from glint.engine.film import LIGHTING, PARTS
from native_tools import needs_core, view_from_above
from test_path_tracer import placed

pytestmark = needs_core
SIZE = 32
PASSES = frozenset({"Diffuse Direct", "Glossy Direct"})
LAMP = lamp("POINT", (0.5, 0.3, 3.0), radius=0.6)


def bumps(across: int, tilt: float = 0.15) -> s.Mesh:
    """An even square whose normals, not its faces, are tilted at random, `across` of them across:
    nothing hides anything.
    """
    line = np.linspace(-1, 1, across + 1)
    x, y = (corner.ravel() for corner in np.meshgrid(np.arange(across), np.arange(across)))
    corners = np.stack([[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]], -1)
    flat = np.stack([line[corners[0]], line[corners[1]], np.zeros_like(corners[0], float)], -1)
    at = np.arange(len(x), dtype=np.uint32)[:, None] * 4
    triangles = np.stack([at + (0, 1, 2), at + (0, 2, 3)], 1).reshape(-1, 3)
    tilts = np.random.default_rng(7).uniform(-tilt, tilt, (len(x), 2))
    normals = np.concatenate([tilts, np.ones((len(x), 1))], 1)
    normals = np.repeat(normals / np.linalg.norm(normals, axis=1, keepdims=True), 4, 0)
    return s.Mesh(
        f"{across} bumps",
        flat.reshape(-1, 3).astype(np.float32),
        triangles.astype(np.uint32),
        normals=s.Attribute("normals", "POINT", normals.astype(np.float32)),
    )


def surface(exponent: float) -> s.Material:
    matt, gloss = (s.Input((share,) * 3) for share in (0.4, 0.5))
    return s.Material(
        "surface", (s.Lobe("DIFFUSE", (matt,)), s.Lobe("SPECULAR", (gloss,), exponent=exponent))
    )


def bumpy(across: int, light: s.Light = LAMP, exponent: float = 80.0, size: int = SIZE) -> s.Scene:
    """Seen from above, pixels as far apart as the bumps where both are as many."""
    view = view_from_above(size)
    return placed(view, (bumps(across), surface(exponent)), lights=(light,))


def hidden(scene: s.Scene, size: float = 0.5) -> s.Scene:
    """By a square in the middle, in the way of the lamp, which the camera does not see."""
    corners = size * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    corners[:, 2] = 1.0
    square = s.Mesh("square", corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    above = s.Instances("above", 1, np.eye(3, 4)[None], (0,), visible_camera=False)
    return replace(
        scene, geometries=(*scene.geometries, square), instances=(*scene.instances, above)
    )


def draw(scene: s.Scene, kind: str = "RESOLVED", samples: int = 8, **more) -> engine.Film:
    chosen = {"light_samples": 2, "passes": PASSES, "filter_width": 0.0} | more
    return engine.render(scene, engine.Settings(samples=samples, soft_light=kind, **chosen))


def error(film: engine.Film, exact: engine.Film, name: str = "Combined") -> float:
    """Relative RMSE."""
    found, truth = (x.passes[name][..., :3].astype(float) for x in (film, exact))
    return float(np.sqrt(((found - truth) ** 2).mean() / (truth**2).mean()))


# --- what surfaces make stays


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_bumps_as_wide_as_pixels_stay(backend: str) -> None:
    """Nothing hides the lamp: both kinds of light have the contrast of the bumps."""
    scene = bumpy(SIZE)
    exact, found = draw(scene, "DEALT", 1024), draw(scene, backend=backend)
    for name in sorted(PASSES):
        truth, seen = (film.passes[name][..., 0].astype(float) for film in (exact, found))
        bumps_of = truth - truth.mean()
        contrast = (seen * bumps_of).sum() / (bumps_of**2).sum()
        assert abs(contrast - 1) < 0.03, name


@pytest.mark.parametrize("covered", [False, True])
@pytest.mark.parametrize("exponent", [20.0, 80.0, 300.0])
@pytest.mark.parametrize("across", [48, 96])
def test_smaller_ones_are_as_all_camera_rays_show_them(
    across: int, exponent: float, covered: bool
) -> None:
    """Of 8 samples a pixel has few bumps; 24 more camera rays, which ask for no shadows, leave two
    thirds of the error, in a shadow nine tenths.
    """
    scene = bumpy(across, exponent=exponent)
    scene, most = (hidden(scene), 0.93) if covered else (scene, 0.7)
    exact = draw(scene, "DEALT", 2048, filter_width=1.5)
    few, found = (draw(scene, filter_width=1.5, visibility_samples=rays) for rays in (1, 4))
    assert error(found, exact) < most * error(few, exact)
    assert error(found, exact, "Glossy Direct") < most * error(few, exact, "Glossy Direct")


def test_shadows_on_them_are_averaged() -> None:
    """Nearer to the truth than the samples, in wide light behind a square."""
    scene = hidden(bumpy(48, exponent=20.0))
    exact, dealt, found = (
        draw(scene, kind, samples, filter_width=1.5, visibility_samples=4)
        for kind, samples in (("DEALT", 2048), ("DEALT", 8), ("RESOLVED", 8))
    )
    assert error(found, exact) < 0.8 * error(dealt, exact)


def test_even_gloss_asks_for_no_more_rays() -> None:
    """Where lights give the same to all that is seen."""
    far = lamp("POINT", (0.0, 0.0, 400.0), radius=8.0, strength=1e6)
    view = view_from_above(SIZE, half=0.75)
    tilted, even = (
        draw(
            placed(view, (bumps(96, tilt), surface(20.0)), lights=(far,)),
            filter_width=1.5,
            visibility_samples=4,
        ).stats["camera rays"]
        for tilt in (0.15, 0.0)
    )
    assert even == 8 * SIZE**2
    assert tilted > 20 * SIZE**2


# --- one tracer beside the other


@pytest.mark.parametrize("covered", [False, True])
@pytest.mark.parametrize("rays", [1, 4])
def test_both_tracers_draw_the_same(rays: int, covered: bool) -> None:
    scene = bumpy(24, exponent=20.0, size=16)
    scene = hidden(scene) if covered else scene
    chosen = {"filter_width": 1.5, "visibility_samples": rays, "diffuse_bounces": 1}
    passes = frozenset({*PARTS, *LIGHTING})
    core, reference = (
        draw(scene, backend=backend, passes=passes, **chosen) for backend in ("NATIVE", "NUMPY")
    )
    for name in ("Combined", *sorted(passes)):
        found, expected = core.passes[name].astype(float), reference.passes[name].astype(float)
        floor = 0.01 * np.abs(expected).mean() + 1e-12
        assert (np.abs(found - expected) <= 5e-4 * (np.abs(expected) + floor)).all(), name
