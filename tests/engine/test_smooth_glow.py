"""Coarse smooth meshes that glow or scatter light: shadow rays start at a lifted point there, far
from the point that is shaded, and what belongs to that one must not be taken from the other.
"""

from __future__ import annotations

import numpy as np
import pytest

import random_scenes
from engine_scenes import look_at
from glint import engine
from glint.engine import scene as s
from test_core_against_reference import relative_error

pytestmark = pytest.mark.skipif(
    "NATIVE" not in engine.available_backends(), reason="the core's library is not built"
)
GLOW = s.Lobe("EMISSION", (s.Input((1.0, 0.6, 0.3)),))
GLOSS = s.Lobe("SPECULAR", (s.Input((0.7, 0.7, 0.7)),), exponent=20.0)
MATT = s.Lobe("DIFFUSE", (s.Input((0.6, 0.6, 0.6)),))


def soup(seed: int, *lobes: s.Lobe, twice: bool = False) -> s.Scene:
    """Smooth triangles between random points under a lamp, each twice in one place if wanted."""
    mesh = random_scenes._soup(np.random.default_rng(seed), smooth=True)
    if twice:
        faces = np.concatenate([mesh.triangles, mesh.triangles])
        mesh = s.Mesh("soup", mesh.vertices, faces, normals=mesh.normals)
    half = 0.4
    camera = s.Camera(
        "PERSPECTIVE", look_at((0.5, -6, 2), (0, 0, 0)), (-half, half, -half, half), (24, 24)
    )
    lamp = s.Light("lamp", "POINT", look_at((2, -3, 4), (0, 0, 0)), strength=300.0)
    return s.Scene(
        camera,
        (mesh,),
        (s.Instances("soup", 0, np.eye(3, 4)[None], (0,)),),
        (s.Material("m", lobes),),
        lights=(lamp,),
    )


AT_EDGES = 1
"""Pixels that a shadow's edge may change: the core's shadow rays start 2^-21 of the coordinates off
the surface, and in one sample of one of these scenes an edge lies between that and float64's start.
"""


def off(scene: s.Scene, **settings) -> int:
    """Pixels in which the tracers differ."""
    pictures = (
        engine.render(scene, engine.Settings(samples=2, max_bounces=0, backend=backend, **settings))
        for backend in ("NATIVE", "NUMPY")
    )
    return int((relative_error(*(p.combined for p in pictures)) > 1e-4).sum())


@pytest.mark.parametrize("twice", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_what_glows_lights_itself_alike(seed, twice):
    scene = soup(seed, MATT, GLOSS, GLOW, twice=twice)
    assert off(scene, diffuse_bounces=0) == 0


@pytest.mark.slow
@pytest.mark.parametrize("twice", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_what_is_lit_lights_itself_alike(seed, twice):
    scene = soup(seed, MATT, twice=twice)
    assert off(scene, diffuse_bounces=1, light_samples=4) <= AT_EDGES
