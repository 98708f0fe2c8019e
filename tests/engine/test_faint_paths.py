"""What bounced rays bring little of takes a quarter of the samples of the sky, of what glows and of
bounced light, and stays as bright.
"""

from __future__ import annotations

import functools
import hashlib

import numpy as np
import pytest

from glint.engine import Film, Settings, render
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from native_tools import (
    assert_instruction_sets_agree,
    constant,
    material,
    needs_core,
    placed,
    square,
    view_from_above,
)

pytestmark = needs_core

BACKENDS = ("NATIVE", "NUMPY")
PAPER = material(s.Lobe("DIFFUSE", constant(0.8, 0.8, 0.8)))
LIT = material(s.Lobe("EMISSION", constant(3.0, 2.0, 1.0)))
SKY = s.Light(
    "sky", "DOME", np.eye(3, 4), radiance=np.array([[[0.4] * 3], [[1.0] * 3]], np.float32)
)


def mirrored(share: float, *lights: s.Light, glows: bool = False) -> s.Scene:
    """A mirror that shows `share` of paper over it, which is lit from below past the mirror."""
    hidden = {"visible_camera": False}
    things = [
        placed(0, (0,), visible_shadow=False, visible_diffuse=False),
        placed(0, (1,), z=20.0, **hidden),
        placed(1, (1,), z=19.0, **hidden),
    ]
    if glows:
        things.append(placed(1, (2,), z=17.0, visible_mirror=False, **hidden))
    mirror = material(s.Lobe("MIRROR", constant(share, share, share)))
    return s.Scene(
        view_from_above(8),
        (square(), square(0.3, "small")),
        tuple(things),
        (mirror, PAPER, LIT),
        (),
        lights,
        s.World(),
    )


def drawn(scene: s.Scene, **settings) -> Film:
    chosen = {"samples": 64, "light_samples": 1, "filter_width": 0.0, "max_bounces": 2}
    return render(scene, Settings(**chosen | settings))


def color(film: Film) -> np.ndarray:
    return film.passes["Combined"][..., :3].astype(np.float64)


@pytest.mark.parametrize("glows", [False, True])
def test_faint_images_are_as_bright_for_a_quarter_of_the_shadow_rays(glows: bool) -> None:
    lights = () if glows else (SKY,)
    clear, faint = (drawn(mirrored(share, *lights, glows=glows)) for share in (0.5, 0.05))
    assert color(clear).min() > 0
    # where few directions of a sample find none hidden, it takes the sky for open
    far = 0.005 if glows else 0.02
    np.testing.assert_allclose(color(faint).mean((0, 1)) * 10, color(clear).mean((0, 1)), rtol=far)
    ratio = faint.stats["shadow rays"] / clear.stats["shadow rays"]
    assert 0.24 < ratio < 0.26


def test_what_bounces_little_less_than_a_sixteenth_is_whole() -> None:
    """As bright and as noisy as the same image of another strength."""
    whole, other = (color(drawn(mirrored(share, SKY), samples=3)) for share in (0.0626, 0.5))
    np.testing.assert_allclose(whole / 0.0626, other / 0.5, rtol=1e-5)
    parts = color(drawn(mirrored(0.0624, SKY), samples=3))
    assert np.abs(parts / 0.0624 - other / 0.5).max() > 1e-3


@pytest.mark.parametrize("samples", [1, 6])
def test_both_tracers_draw_the_same_of_them(samples: int) -> None:
    """By the sky and what glows; bounced light on either side of the mirror."""
    few = {"samples": samples, "diffuse_bounces": 2, "max_bounces": 3}
    scene = mirrored(0.05, SKY, glows=True)
    core, truth = (color(drawn(scene, backend=b, **few)) for b in BACKENDS)
    wrong = np.abs(core - truth) > 1e-4 * (truth.max() + np.abs(truth))
    assert wrong.any(2).mean() <= 0.02  # an edge may turn
    assert truth.min() > 0


def test_explain_pixel_adds_up_to_them() -> None:
    scene = mirrored(0.05, SKY, glows=True)
    settings = Settings(samples=1, light_samples=1, filter_width=0.0, max_bounces=2)
    picture = render(scene, settings).passes["Combined"]
    explainer = PixelExplainer(scene, settings)
    for x, y in ((1, 1), (4, 4), (6, 2)):
        found = explainer.pixel(x, y).color
        np.testing.assert_allclose(found, picture[y, x, :3], rtol=1e-4, atol=1e-6)


@functools.cache
def hashes(threads: int = 3) -> str:
    picture = color(drawn(mirrored(0.05, SKY, glows=True), threads=threads))
    return hashlib.sha256(picture.tobytes()).hexdigest()


def test_instruction_sets_and_threads_change_nothing() -> None:
    assert assert_instruction_sets_agree(hashes) == hashes(1)
