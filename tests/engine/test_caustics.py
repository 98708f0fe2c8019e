"""Light that mirrors and gloss throw onto what is matt, and what glass bends on its way, beside
closed forms, in both tracers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import BACKENDS, GROUND, HERE, added, ball, drawn, lamp, matt, wall_over_ground
from glint.engine.scene import Camera, Input, Instances, Light, Lobe, Material, Mesh, Scene, World
from test_bounced_gloss import METAL, thrown

SUN = 2.0
MATT = Lobe("DIFFUSE", (Input((0.5,) * 3),))
COLOR = (0.4, 0.6, 0.8)
IOR = 1.45
ABOVE = lamp("SUN", strength=SUN)
GLASS = Material("glass", (Lobe("TRANSPARENT", ior=IOR), Lobe("REFRACTION", ior=IOR)))


# --- what shines throws light


def added_to_wall(backend: str, *lobes: Lobe, **settings) -> np.ndarray:
    """(3,) by a ground of these lobes in the sun."""
    scene = wall_over_ground(lamp("SUN", strength=SUN))
    scene = replace(scene, materials=(Material("ground", lobes), scene.materials[1]))
    samples = {"NATIVE": 64, "NUMPY": 16}[backend]
    return added(scene, backend, samples=samples, **settings).mean((0, 1))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("fresnel", [False, True])
def test_a_mirror_throws_light_as_a_wide_highlight_does(fresnel: bool, backend: str) -> None:
    """GGX of an exponent of 2, all of whose light from above a flat mirror goes up again."""
    mirror = Lobe("MIRROR", (Input(COLOR),), fresnel=fresnel, ior=IOR)
    size = tuple((2 + 2) / 8 * c for c in COLOR)
    wide = replace(METAL, factors=(Input(size),), exponent=2.0, masking=float(np.sqrt(2 / (2 + 2))))
    wide = replace(wide, fresnel=fresnel, ior=IOR)
    plain = added_to_wall(backend, MATT)
    k = np.arange(4000) + 0.5
    down = np.sqrt(k / 4000) * np.sin(k * np.pi * (3 - np.sqrt(5)))  # of directions from the wall
    share = [thrown(replace(wide, factors=(Input((c,) * 3),)), down[down > 0]) / 0.5 for c in size]
    assert min(share) > (0.01 if fresnel else 0.3)
    more = added_to_wall(backend, MATT, mirror) / plain - 1
    np.testing.assert_allclose(more, share, rtol=0.03)


@pytest.mark.parametrize("backend", BACKENDS)
def test_without_reflective_caustics_nothing_that_shines_throws_light(backend: str) -> None:
    off = {"reflective_caustics": "OFF"}
    plain = added_to_wall(backend, MATT, **off)
    np.testing.assert_array_equal(added_to_wall(backend, MATT), plain)
    shine = METAL, Lobe("MIRROR", (Input(COLOR),)), Lobe("TOON_SPECULAR", size=0.5)
    for lobe in shine:
        np.testing.assert_allclose(added_to_wall(backend, MATT, lobe, **off), plain, rtol=1e-6)
        assert (added_to_wall(backend, MATT, lobe) > 1.02 * plain).all()


# --- what is bent does not arrive


def over_ground(*things: Mesh, light: Light, world: World | None = None) -> Scene:
    """Things of glass, which the camera does not see, between a matt ground and a light; the middle
    of a pixel is at each tenth of a unit.
    """
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 9.0)])
    camera = Camera("ORTHOGRAPHIC", frame, (-1.55, 1.55, -0.05, 0.05), (31, 1))
    placed = [Instances("ground", 0, HERE[None], (0,))]
    placed += [
        Instances(f"{k}", k, HERE[None], (1,), visible_camera=False)
        for k in range(1, 1 + len(things))
    ]
    scene = Scene(camera, (GROUND, *things), tuple(placed), (matt((0.5,) * 3), GLASS))
    return replace(scene, lights=(light,), **({"world": world} if world else {}))


def lit(backend: str, *things: Mesh, light: Light = ABOVE, **more) -> np.ndarray:
    """(31,) how much of the light arrives."""
    bare, found = (
        drawn(over_ground(*some, light=light), 0, backend, samples=1, **more)[0, :, 0]
        for some in ((), things)
    )
    assert bare.min() > 0
    return found / bare


def sides(*faces: tuple[tuple[float, float, float], ...]) -> Mesh:
    """Squares, seen counterclockwise from outside."""
    corners = np.array(faces, np.float32).reshape(-1, 3)
    first = 4 * np.arange(len(faces), dtype=np.uint32)[:, None]
    triangles = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]]).astype(np.uint32)
    return Mesh("sides", corners, triangles)


def wedge(slope: float) -> Mesh:
    """Its lower side is level."""
    top = tuple((x, y, 4 + slope * x) for x, y in ((-5, -5), (5, -5), (5, 5), (-5, 5)))
    bottom = ((-5, 5, 1), (5, 5, 1), (5, -5, 1), (-5, -5, 1))
    return sides(top, bottom)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ball_casts_a_shadow_but_in_its_middle(backend: str) -> None:
    """Where its two sides bend light by no more than 0.2 together."""
    x = np.abs(np.linspace(-1.5, 1.5, 31))
    inner = np.sqrt(IOR**2 - np.minimum(x, 1) ** 2) - np.sqrt(1 - np.minimum(x, 1) ** 2)
    straight = (2 * inner * np.minimum(x, 1) <= 0.2) | (x > 1)
    assert 3 <= straight[x < 1].sum() <= 7
    sure = np.abs(x - 1) > 0.01  # of the ball's very edge
    found = lit(backend, ball(1.0, (0.0, 0.0, 2.0)))
    np.testing.assert_allclose(found[sure], straight[sure], atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_panes_and_weak_wedges_let_light_pass(backend: str) -> None:
    """However aslant it comes; a prism does not."""
    turned = lamp("SUN", strength=SUN)
    c, s = np.cos(0.9), np.sin(0.9)
    turned.world_from_light[:, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    for slope, light, passes in (
        (0.0, lamp("SUN", strength=SUN), 1),
        (0.0, turned, 1),
        (0.3, lamp("SUN", strength=SUN), 1),
        (0.6, lamp("SUN", strength=SUN), 0),
    ):
        found = lit(backend, wedge(slope), light=light)
        np.testing.assert_allclose(found[10:21], passes, atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_that_stays_inside_is_not_said_to_be_bent(backend: str) -> None:
    """The ground is under water, whose waves are as steep as a prism."""
    found = lit(backend, sides(*[tuple(map(tuple, wedge(0.6).vertices[:4]))]))
    np.testing.assert_allclose(found[10:21], 1 / IOR**2, rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_of_the_sky_passes_a_ball(backend: str) -> None:
    """What comes elsewhere from it is as bright."""
    world = World((1.0, 1.0, 1.0))
    sky = replace(lamp("DOME", strength=1.0), radiance=np.ones((4, 8, 3), np.float32))
    scenes = (
        over_ground(*some, light=sky, world=world) for some in ((), (ball(1.0, (0.0, 0.0, 2.0)),))
    )
    bare, found = (drawn(scene, 0, backend, samples=4, light_samples=16) for scene in scenes)
    np.testing.assert_allclose(found, bare, rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_without_refractive_caustics_glass_casts_whole_shadows(backend: str) -> None:
    """And what is but transparent none."""
    found = lit(backend, wedge(0.0), refractive_caustics="OFF")
    assert found[10:21].max() == 0
    scene = over_ground(wedge(0.0), light=lamp("SUN", strength=SUN))
    film = Material("film", (Lobe("TRANSPARENT", (Input((0.5,) * 3),)),))
    scene = replace(scene, materials=(scene.materials[0], film))
    on, off = (
        drawn(scene, 0, backend, samples=1, refractive_caustics=choice) for choice in ("ON", "OFF")
    )
    np.testing.assert_array_equal(on, off)
    assert on.min() > 0
