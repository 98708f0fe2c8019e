"""Light of lamps that mirrors and glass throw onto what is matt, sharply, beside closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import BACKENDS, GROUND, HERE, ball, drawn, lamp, matt, quad
from glint.engine.scene import Camera, Input, Instances, Light, Lobe, Material, Scene

ALBEDO = 0.5
TINT = (0.9, 0.6, 0.3)
IOR = 1.45
MIRROR = Material("mirror", (Lobe("MIRROR", (Input(TINT),)),))
GLASS = Material(
    "glass", (Lobe("REFRACTION", fresnel=True, ior=IOR), Lobe("MIRROR", fresnel=True, ior=IOR))
)
PHOTONS = {"NATIVE": 1 << 16, "NUMPY": 1 << 12}


def over_ground(thing, material: Material, light: Light, half: float = 1.5, size: int = 31) -> Scene:
    """A thing that the camera, high above, does not see, and what it throws on a matt ground."""
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 20.0)])
    camera = Camera("ORTHOGRAPHIC", frame, (-half, half, -half, half), (size, size))
    placed = (
        Instances("ground", 0, HERE[None], (0,)),
        Instances("thing", 1, HERE[None], (1,), visible_camera=False),
    )
    return Scene(camera, (GROUND, thing), placed, (matt((ALBEDO,) * 3), material), lights=(light,))


def thrown(scene: Scene, backend: str, **more) -> np.ndarray:
    """What photons add."""
    settings = {"samples": 1, "soft_light": "DEALT", "reflective_caustics": "ON", **more}
    count = PHOTONS[backend]
    with_them = drawn(scene, 1, backend, photons=count, **settings)
    return with_them - drawn(scene, 0, backend, **settings)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_mirror_throws_the_light_of_a_lamp_behind_it(backend: str) -> None:
    """As bright as a lamp mirrored in it, and as wide as it is seen from there."""
    mirror = quad((-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2))
    scene = over_ground(mirror, MIRROR, lamp("POINT", (0, 0, 1)))
    found = thrown(scene, backend)
    at = np.linspace(-1.5, 1.5, 63)[1::2]
    x, y = np.meshgrid(at, at)
    far2 = x * x + y * y + 9.0
    cosine = 3.0 / np.sqrt(far2)
    expected = ALBEDO * 100.0 / (4 * np.pi**2 * far2) * cosine
    inner = (abs(x) < 1.3) & (abs(y) < 1.3)
    ratio = found / (expected[..., None] * TINT)
    print(ratio[inner].mean(0), ratio[inner].std(0))
    np.testing.assert_allclose(ratio[inner], 1, atol=0.03)
