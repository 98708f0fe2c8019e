"""The core against the reference where gloss, metals and glass take part in bounced light: what
gather rays meet of varnish, and what rough reflections and refractions show.
"""

from __future__ import annotations

import numpy as np
import pytest

from engine_scenes import at, box_mesh, constant, grid_mesh, light, look_at
from glint.engine import scene as s
from native_tools import needs_core
from surface_scenes import assert_tracers_agree

pytestmark = needs_core

DOME = s.Light(
    "sky", "DOME", np.eye(4)[:3], radiance=np.full((2, 4, 3), (0.3, 0.35, 0.5), np.float32)
)
LAMP = light("POINT", (-1.5, -2.0, 3.0), strength=300.0, radius=0.2)


def varnished(color: float) -> s.Material:
    """As a Principled BSDF of defaults is exported: matt, less of it aslant, below gloss of GGX's
    shape in lobes of three widths.
    """
    gloss = (
        s.Lobe("SPECULAR", constant(k), exponent=p, ior=1.5, fresnel=True, masking=0.25)
        for p, k in ((0.7, 0.044), (9.9, 0.594), (50.4, 3.15))
    )
    return s.Material(
        "varnish",
        (
            s.Lobe("AMBIENT", constant(color)),
            s.Lobe("DIFFUSE", constant(color)),
            s.Lobe("DIFFUSE", constant(-0.17 * color), exponent=2.3),
            *gloss,
        ),
    )


def glass(exponent: float | None) -> s.Material:
    rough = {} if exponent is None else {"exponent": exponent}
    back = "MIRROR" if exponent is None else "SPECULAR"
    lobes = (
        s.Lobe(kind, constant(1.0), ior=1.45, fresnel=True, **rough)
        for kind in ("REFRACTION", back)
    )
    return s.Material("glass", tuple(lobes))


METAL = s.Material("metal", (s.Lobe("SPECULAR", constant(0.8), exponent=60.0, masking=0.2),))
THINGS = {
    "varnish": varnished(0.6),
    "metal": METAL,
    "glass": glass(None),
    "rough glass": glass(200.0),
}


def still_life(thing: s.Material) -> s.Scene:
    """A ball of it and a box of varnish on a floor of varnish, which are near one another."""
    camera = s.Camera(
        "PERSPECTIVE", look_at((0, -5, 2), (0, 0, 0.5)), (-0.4, 0.4, -0.3, 0.3), (12, 9)
    )
    ball = s.Spheres("ball", np.array([[0, 0, 0.7]], np.float32), np.array([0.7], np.float32))
    placed = (
        s.Instances("floor", 0, at((0, 0, 0), 3.0), (0,)),
        s.Instances("ball", 1, at(), (1,)),
        s.Instances("box", 2, at((1.3, 0.4, 0.5), 0.5), (2,)),
    )
    materials = (varnished(0.77), thing, varnished(0.4))
    geometries = (grid_mesh(), ball, box_mesh())
    # the sky is a light of its own: as Blender's export has it, the world gives nothing else
    return s.Scene(camera, geometries, placed, materials, lights=(LAMP, DOME))


@pytest.mark.parametrize("name", THINGS)
def test_both_tracers_draw_the_same(name: str) -> None:
    scene = still_life(THINGS[name])
    assert_tracers_agree(scene, "Diffuse", "Specular", "Mirror", diffuse_bounces=1, max_bounces=3)


@pytest.mark.parametrize("how", [{"reflections": "ALL"}, {"soft_light": "RESOLVED"}])
def test_both_tracers_draw_the_same_in_other_ways(how: dict) -> None:
    scene = still_life(THINGS["varnish"])
    assert_tracers_agree(scene, "Diffuse", "Specular", diffuse_bounces=1, max_bounces=3, **how)
