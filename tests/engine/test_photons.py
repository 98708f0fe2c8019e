"""Light of lamps that mirrors and glass throw onto what is matt, sharply, beside closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import GROUND, HERE, ball, drawn, lamp, matt, quad
from glint.engine import Settings, render
from glint.engine.errors import SceneError
from glint.engine.film import light_group_pass
from glint.engine.scene import Camera, Input, Instances, Light, Lobe, Material, Scene

ALBEDO = 0.5
TINT = (0.9, 0.6, 0.3)
IOR = 1.45
MIRROR = Material("mirror", (Lobe("MIRROR", (Input(TINT),)),))
GLASS = Material(
    "glass", (Lobe("REFRACTION", fresnel=True, ior=IOR), Lobe("MIRROR", fresnel=True, ior=IOR))
)
PHOTONS = 1 << 16


def over_ground(
    thing, material: Material, light: Light, half: float = 1.5, size: int = 31
) -> Scene:
    """A thing that the camera, high above, does not see, and what it throws on a matt ground. Light
    passes this from below.
    """
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 20.0)])
    camera = Camera("ORTHOGRAPHIC", frame, (-half, half, -half, half), (size, size))
    placed = (
        Instances("ground", 0, HERE[None], (0,), visible_shadow=False),
        Instances("thing", 1, HERE[None], (1,), visible_camera=False),
    )
    return Scene(camera, (GROUND, thing), placed, (matt((ALBEDO,) * 3), material), lights=(light,))


CHOSEN = {"samples": 1, "soft_light": "DEALT", "reflective_caustics": "ON"}


def thrown(scene: Scene, photons: int = PHOTONS, **more) -> np.ndarray:
    """What photons add."""
    settings = {**CHOSEN, **more}
    return drawn(scene, 1, photons=photons, **settings) - drawn(scene, 0, **settings)


def bare(scene: Scene, *lights: Light) -> Scene:
    """The ground alone."""
    return replace(
        scene, geometries=scene.geometries[:1], instances=scene.instances[:1], lights=lights
    )


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


MIRROR_ABOVE = quad((-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2))
UP = {
    "point": lamp("POINT", (0, 0, 1)),
    "ball": lamp("POINT", (0, 0, 1), radius=0.2),
    "spot": turned(lamp("SPOT", (0, 0, 1), spot_size=1.0, spot_blend=0.5), 0.2, 0, 1),
    "sun": turned(lamp("SUN", strength=2.0), 0.1, 0, 1),
    "wide sun": turned(lamp("SUN", strength=2.0, angle=0.1), 0.0, 0, 1),
    "area": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.3), 0.2, 0, 1),
    "disc": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.5, shape="ELLIPSE"), 0, 0, 1),
    "beam": turned(lamp("AREA", (0, 0, 1), size_x=0.5, size_y=0.5, spread=2.0), 0, 0, 1),
}


@pytest.mark.parametrize("name", UP)
def test_a_mirror_throws_the_light_of_a_lamp_behind_it(name: str) -> None:
    """As bright as a lamp mirrored in it, point by point but for blotches of a few percent."""
    scene = over_ground(MIRROR_ABOVE, MIRROR, UP[name])
    found = thrown(scene)
    behind = bare(scene, mirrored(UP[name]))
    expected = drawn(behind, 0, samples=1, light_samples=256, soft_light="SHARED") * TINT
    at = np.abs(np.linspace(-1.5, 1.5, 63)[1::2])
    inner = np.maximum(*np.meshgrid(at, at)) < 0.6
    assert expected[inner].min() > 0
    np.testing.assert_allclose(found[inner].mean(0), expected[inner].mean(0), rtol=0.02)
    off = np.abs(found - expected)[inner].mean() / expected[inner].mean()
    assert off < 0.04


def test_a_mirrors_patch_ends_where_the_mirror_does() -> None:
    scene = over_ground(MIRROR_ABOVE, MIRROR, turned(lamp("SUN", strength=2.0), 0, 0, 1))
    found = thrown(scene)[15, :, 0]
    at = np.abs(np.linspace(-1.5, 1.5, 63)[1::2])
    assert found[at < 0.95].min() > 0.9 * found[15] > 0
    assert found[at > 1.05].max() == 0


def falling(x: np.ndarray) -> np.ndarray:
    """What passes a unit ball of glass of light that falls x off its axis, with no reflection."""
    cosine = np.sqrt(1 - x**2)
    inner = np.sqrt(IOR**2 - x**2)
    s = ((cosine - inner) / (cosine + inner)) ** 2
    p = ((IOR**2 * cosine - inner) / (IOR**2 * cosine + inner)) ** 2
    return ((1 - s) ** 2 + (1 - p) ** 2) / 2


def landing(x: np.ndarray, height: float) -> np.ndarray:
    """Where on the ground that light goes, its middle so high above."""
    outer, inner = np.arcsin(x), np.arcsin(x / IOR)
    leaves, turn = outer + np.pi - 2 * inner, 2 * (outer - inner)
    return np.sin(leaves) - np.tan(turn) * (height + np.cos(leaves))


def test_a_glass_ball_gathers_the_suns_light() -> None:
    """All that passes it once and lands in the picture, most of it in a patch as wide as half the
    ball.
    """
    clear = replace(GLASS, lobes=GLASS.lobes[:1])  # mirrors nothing, also inside
    sun = turned(lamp("SUN", strength=2.0), 0, 0, -1)
    scene = over_ground(ball(1.0, (0.0, 0.0, 2.0)), clear, sun, half=3.0, size=121)
    found = thrown(scene, 1 << 17)[..., 0]
    x = (np.arange(4000) + 0.5) / 4000
    at = np.linspace(-3.0, 3.0, 243)[1::2]
    far = np.hypot(*np.meshgrid(at, at))
    for radius in (0.5, 1.5, 2.8):
        lands = np.abs(landing(x, 2.0)) < radius
        arrives = ALBEDO * 2.0 / np.pi * np.pi * np.mean(2 * x * falling(x) * lands)
        assert found[far < radius].sum() * (6.0 / 121) ** 2 == pytest.approx(arrives, rel=0.03)


def test_photons_go_where_the_settings_say() -> None:
    """No mirrors' without reflective caustics, no glass's without refractive ones."""
    up = over_ground(MIRROR_ABOVE, MIRROR, UP["point"])
    clear = replace(GLASS, lobes=GLASS.lobes[:1])
    down = turned(lamp("SUN", strength=2.0), 0, 0, -1)
    through = over_ground(ball(0.5, (0.0, 0.0, 1.0)), clear, down)
    assert thrown(up, refractive_caustics="OFF").max() > 0
    assert thrown(up, reflective_caustics="OFF").max() == 0
    assert thrown(through, reflective_caustics="OFF").max() > 0
    assert thrown(through, refractive_caustics="OFF").max() == 0


def test_lights_that_do_not_light_the_mirror_throw_nothing() -> None:
    scene = over_ground(MIRROR_ABOVE, MIRROR, UP["point"])
    assert thrown(replace(scene, lights=(replace(UP["point"], lights_gloss=False),))).max() == 0
    linked = replace(UP["point"], receivers=1)
    placed = tuple(replace(thing, light_set=k) for k, thing in enumerate(scene.instances))
    assert thrown(replace(scene, instances=placed, lights=(linked,))).max() == 0
    linked = replace(linked, receivers=3)
    assert thrown(replace(scene, instances=placed, lights=(linked,))).max() > 0


def test_parts_and_groups_have_the_light_of_photons() -> None:
    lamps = (replace(UP["point"], light_group=0), replace(UP["area"], light_group=1))
    scene = over_ground(MIRROR_ABOVE, MIRROR, lamps[0])
    scene = replace(scene, lights=lamps, light_groups=("a", "b"))
    names = ("Diffuse Direct", "Diffuse Indirect", "Diffuse Color", "Diffuse")
    for soft_light in ("DEALT", "RESOLVED"):
        chosen = {"samples": 4, "diffuse_bounces": 1, "soft_light": soft_light}
        settings = Settings(photons=PHOTONS, passes=frozenset(names), **chosen)
        passes = render(scene, settings).passes
        whole = passes["Combined"][..., :3]
        parts = (passes[names[0]] + passes[names[1]]) * passes[names[2]]
        np.testing.assert_allclose(parts, whole, rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(passes["Diffuse"], whole, rtol=1e-4, atol=1e-6)
        groups = [passes[light_group_pass(name)] for name in scene.light_groups]
        assert min(group.max() for group in groups) > 0
        np.testing.assert_allclose(sum(groups), whole, rtol=1e-4, atol=1e-6)


def test_same_bits_with_any_threads_and_regions() -> None:
    lamps = (UP["point"], UP["area"], UP["wide sun"])
    scene = replace(over_ground(MIRROR_ABOVE, MIRROR, lamps[0]), lights=lamps)
    settings = Settings(samples=2, diffuse_bounces=2, soft_light="RESOLVED", photons=20000)
    whole = render(scene, settings).passes["Combined"]
    for threads in (1, 3):
        again = render(scene, replace(settings, threads=threads)).passes["Combined"]
        np.testing.assert_array_equal(again, whole)
    part = render(scene, replace(settings, region=(5, 7, 20, 16))).passes["Combined"]
    np.testing.assert_array_equal(part, whole[7:16, 5:20])


def test_photons_change_nothing_where_nothing_shines() -> None:
    scene = over_ground(MIRROR_ABOVE, matt((0.8,) * 3), UP["point"])
    np.testing.assert_array_equal(
        drawn(scene, 1, photons=PHOTONS, **CHOSEN), drawn(scene, 1, **CHOSEN)
    )


def test_the_reference_refuses_photons() -> None:
    scene = over_ground(MIRROR_ABOVE, MIRROR, UP["point"])
    with pytest.raises(SceneError, match="NumPy tracer follows none"):
        drawn(scene, 1, "NUMPY", photons=1)
