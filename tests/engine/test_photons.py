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


def turned(light: Light, *axis: float) -> Light:
    """Shining along that axis, in the plane of x and z."""
    x, _, z = np.array(axis) / np.linalg.norm(axis)
    light.world_from_light[:, :3] = [[-z, 0, -x], [0, 1, 0], [x, 0, -z]]
    return light


def mirrored(light: Light) -> Light:
    """In the mirror at z = 2."""
    frame = light.world_from_light.copy()
    frame[2] *= -1
    frame[2, 3] += 4.0
    frame[:, 1] *= -1  # right-handed
    return replace(light, world_from_light=frame)


UP = {
    "point": lamp("POINT", (0, 0, 1)),
    "ball": lamp("POINT", (0, 0, 1), radius=0.2),
    "spot": turned(lamp("SPOT", (0, 0, 1), spot_size=1.0, spot_blend=0.5), 0.2, 0, 1),
    "sun": turned(lamp("SUN", strength=2.0), 0.3, 0, 1),
    "wide sun": turned(lamp("SUN", strength=2.0, angle=0.3), 0.0, 0, 1),
    "area": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.3), 0.2, 0, 1),
    "disc": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.5, shape="ELLIPSE"), 0, 0, 1),
    "beam": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.5, spread=1.0), 0, 0, 1),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", UP)
def test_a_mirror_throws_the_light_of_a_lamp_behind_it(name: str, backend: str) -> None:
    """As bright as a lamp mirrored in it."""
    mirror = quad((-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2))
    scene = over_ground(mirror, MIRROR, UP[name])
    found = thrown(scene, backend)
    bare = replace(scene, geometries=scene.geometries[:1], instances=scene.instances[:1])
    bare = replace(bare, lights=(mirrored(UP[name]),))
    expected = drawn(bare, 0, samples=1, light_samples=256, soft_light="SHARED") * TINT
    at = np.abs(np.linspace(-1.5, 1.5, 63)[1::2])
    inner = np.maximum(*np.meshgrid(at, at)) < 0.6
    assert expected[inner].min() > 0 or name in ("spot", "beam")
    mean = found[inner].mean(0) / expected[inner].mean(0)
    print(name, mean, np.abs(found - expected)[inner].mean() / expected[inner].mean())
    np.testing.assert_allclose(mean, 1, rtol=0.02)
