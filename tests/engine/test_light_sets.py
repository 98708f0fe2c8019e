"""Lights that light but some instances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import HERE, added, ball, drawn, lamp, matt, mixed, room, wall_over_ground
from glint.engine.scene import (
    EVERYTHING,
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Polygons,
    Scene,
)
from glint.engine.scene.problems import scene_problems

BACKENDS = ("NATIVE", "NUMPY")
GLOSS = Material(
    "gloss", (Lobe("DIFFUSE", (Input((0.4, 0.5, 0.6)),)), Lobe("SPECULAR", exponent=40.0))
)
SUN = replace(
    lamp("SUN", strength=1.0),
    world_from_light=np.array([[0, 0, 1.0, 0], [1, 0, 0, 0], [0, 1, 0, 0]]),
)
SKY = Light("sky", "DOME", HERE, radiance=np.ones((4, 8, 3), np.float32))


def sets(scene: Scene, *numbers: int) -> Scene:
    blocks = zip(scene.instances, numbers, strict=True)
    return replace(
        scene, instances=tuple(replace(block, light_set=number) for block, number in blocks)
    )


def lit_by(scene: Scene, *lights: Light) -> Scene:
    return replace(scene, lights=lights)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "light", [lamp(at=(4, 0, 3), radius=0.2), SUN, SKY], ids=lambda light: light.kind
)
def test_what_a_light_is_not_for_it_does_not_light(light: Light, backend: str) -> None:
    """Matt and glossy surfaces, directions drawn from highlights and the rest of a sky too."""
    scene = wall_over_ground()
    scene = replace(scene, materials=(GLOSS, GLOSS))
    one, none = (
        drawn(lit_by(sets(scene, 0, k), replace(light, receivers=0b10)), 0, backend, samples=4)
        for k in (1, 63)
    )
    assert (none == 0).all()
    whole = drawn(lit_by(scene, light), 0, backend, samples=4)
    assert (one == whole).all()
    assert whole.min() > 0


def test_each_instance_is_lit_by_its_own_lights() -> None:
    """The sum of the pictures with each light alone on black is the picture with both."""
    scene = sets(mixed(), 0, 63, 2, 1)
    lights = tuple(
        replace(light, receivers=receivers)
        for light, receivers in zip(scene.lights, (0b1, EVERYTHING ^ 0b1, 1 << 63), strict=True)
    )
    pictures = [drawn(lit_by(scene, light), 0, samples=4) for light in lights]
    together = drawn(lit_by(scene, *lights), 0, samples=4)
    assert np.abs(together - sum(pictures)).max() < 1e-5 * together.max()
    assert all(picture.max() > 0 for picture in pictures)
    assert (together != drawn(scene, 0, samples=4)).any()


def test_both_tracers_draw_the_same() -> None:
    scene = sets(mixed(), 0, 1, 0, 1)
    first, *others = scene.lights
    scene = lit_by(scene, replace(first, receivers=0b10), *others)
    native, exact = (drawn(scene, 1, backend, samples=4) for backend in BACKENDS)
    off = np.abs(native - exact).max(2) / np.maximum(exact.max(2), 1e-3)
    assert np.median(off) < 1e-6
    assert (off > 1e-4).mean() < 0.01


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_a_light_is_not_for_throws_none_of_it_on(backend: str) -> None:
    """A ground, between which and what it would light nothing stands: the wall gets nothing from
    it, and as much from itself.
    """
    sun = lamp("SUN", strength=2.0)
    thrown = added(lit_by(wall_over_ground(), sun), backend, samples=16)
    assert thrown.min() > 0.01
    scene = sets(wall_over_ground(), 5, 0)
    none = added(lit_by(scene, replace(sun, receivers=EVERYTHING ^ 1 << 5)), backend, samples=16)
    assert not none.any()
    alone = replace(sun, receivers=1 << 5)
    np.testing.assert_array_equal(added(lit_by(scene, alone), backend, samples=16), thrown)


@pytest.mark.parametrize("light_set", [-1, 64, 0.5])
def test_a_set_beyond_the_bits_is_told(light_set) -> None:
    assert any("light_set" in text for text in scene_problems(sets(room(lamp()), light_set)))


@pytest.mark.parametrize("receivers", [-1, 1 << 64, 1.0])
def test_receivers_beyond_the_bits_are_told(receivers) -> None:
    scene = room(lamp(receivers=receivers))
    assert any("receivers" in text for text in scene_problems(scene))


def test_shadows_are_as_they_were() -> None:
    """What a light is not for still hides it from the others."""
    scene = mixed()
    light = lamp(at=(0, 1, 3))
    whole = drawn(lit_by(scene, light), 0, samples=4)
    part = drawn(lit_by(sets(scene, 0, 1, 0, 0), replace(light, receivers=0b10)), 0, samples=4)
    floor = (part > 0).all(2)
    assert floor.any()
    assert (part[floor] <= whole[floor] * (1 + 1e-6)).all()


def lids(*materials: Material) -> Scene:
    """A mesh, polygons and a ball that no camera ray sees, between a floor and what is above."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0)], np.float32)
    side = Mesh("side", corners, np.array([(0, 1, 2)], np.uint32))
    face = Polygons("face", corners, np.array([0, 3], np.uint32), np.arange(3, dtype=np.uint32))
    floor = Instances("floor", 0, 4.0 * HERE[None], (0,))
    places = [np.column_stack([np.eye(3), (x, 0, 1)])[None] for x in (-1.0, 0.0, 1.0)]
    above = [
        Instances(f"lid {k}", k, place, (1,), visible_camera=False)
        for k, place in enumerate(places)
    ]
    camera = Camera(
        "ORTHOGRAPHIC", np.column_stack([np.eye(3), (0, 0, 5)]), (-1, 1, -1, 1), (16, 16)
    )
    return Scene(
        camera, (side, face, ball(0.4)), (floor, *above), (matt((0.5, 0.6, 0.7)), *materials)
    )


def unseen(scene: Scene) -> Scene:
    """The same where no shadow ray sees what is above the floor."""
    floor, *above = scene.instances
    hidden = (replace(lid, visible_shadow=False, visible_diffuse=False) for lid in above)
    return replace(scene, instances=(floor, *hidden))


SOLID = matt((0.5, 0.5, 0.5))
HALF = replace(SOLID, lobes=(*SOLID.lobes, Lobe("TRANSPARENT", (Input((0.5, 0.4, 0.3)),))))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("material", [SOLID, HALF], ids=["solid", "glassy"])
@pytest.mark.parametrize(
    "light",
    [
        lamp(at=(0.5, 0, 3), radius=0.2),
        lamp(at=(0.5, 0, 3)),
        lamp("SUN", at=(0, 0, 3)),
        SKY,
    ],
    ids=lambda light: f"{light.kind} {light.radius}",
)
def test_what_is_no_blocker_casts_no_shadow(light: Light, material: Material, backend: str) -> None:
    """The same bits as if no shadow ray saw it."""
    scene = lids(material)
    passed = replace(light, blockers=EVERYTHING ^ 1 << 63 ^ 1 << 5)
    one, other, whole = (
        drawn(lit_by(s, light), 0, backend, samples=4)
        for s, light in (
            (sets(scene, 0, 63, 5, 5), passed),
            (unseen(scene), light),
            (scene, light),
        )
    )
    assert (one == other).all()
    assert (one >= whole).all()
    assert (one > whole).any()


def test_shadows_of_one_light_are_not_those_of_another() -> None:
    """The sum of the pictures with each light alone is the picture with both, with glass too."""
    scene = sets(mixed(), 0, 1, 2, 3)
    lights = tuple(
        replace(light, blockers=blockers)
        for light, blockers in zip(scene.lights, (0b1, EVERYTHING ^ 0b10, 0b1100), strict=True)
    )
    pictures = [drawn(lit_by(scene, light), 0, samples=4) for light in lights]
    together = drawn(lit_by(scene, *lights), 0, samples=4)
    assert np.abs(together - sum(pictures)).max() < 1e-5 * together.max()
    native, exact = (drawn(lit_by(scene, *lights), 1, backend, samples=1) for backend in BACKENDS)
    off = np.abs(native - exact).max(2) / np.maximum(exact.max(2), 1e-3)
    assert np.median(off) < 1e-6
    assert (off > 1e-4).mean() < 0.01


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_bounces_passes_what_is_no_blocker_on_its_way_from_the_lamp(backend: str) -> None:
    """A lamp in a shade that lets its light through lights a room as if there were no shade, where
    no bounced ray meets that.
    """
    light = lamp(at=(0, 0, 0.5), blockers=EVERYTHING ^ 0b10)
    shaded = room(light, more=(ball(0.2, (0, 0, 0.5)),), materials=(SOLID,))
    hidden = replace(shaded.instances[1], visible_diffuse=False)
    shaded = replace(shaded, instances=(shaded.instances[0], hidden))
    bare = replace(shaded, instances=shaded.instances[:1])
    one, other = (added(scene, backend, samples=4) for scene in (sets(shaded, 0, 1), sets(bare, 0)))
    np.testing.assert_allclose(one, other, rtol=1e-5)
    assert one.min() > 0.01
    assert np.abs(added(shaded, backend, samples=4)).max() < 1e-9  # all of it stays in the shade


@pytest.mark.parametrize("blockers", [-1, 1 << 64, 1.0])
def test_blockers_beyond_the_bits_are_told(blockers) -> None:
    assert any("blockers" in text for text in scene_problems(room(lamp(blockers=blockers))))


GLOW = Material("glow", (Lobe("EMISSION", (Input((3.0, 2.0, 1.0)),)),))
GLOWING = {"mesh_light": "ON", "samples": 4}


def panels(*links: dict) -> Scene:
    """Unseen panels that glow over a glossy floor with a ball on it; links: fields of each."""
    scene = lids(GLOSS, GLOW)
    floor, _, _, ball_on_it = scene.instances
    thing = replace(ball_on_it, world_from_object=ball_on_it.world_from_object - [0, 0, 0, 0.7])
    thing = replace(thing, visible_camera=True, light_set=1)
    above = [
        Instances(
            f"panel {k}",
            0,
            np.column_stack([np.diag([0.8, 0.8, -0.8]), (0.8 * k - 0.5, 0.4, 1.5 + k)])[None],
            (2,),
            visible_camera=False,
            visible_mirror=False,
            **link,
        )
        for k, link in enumerate(links)
    ]
    return replace(scene, instances=(floor, thing, *above))


@pytest.mark.parametrize("bounces", [0, 2])
@pytest.mark.parametrize("backend", BACKENDS)
def test_what_glows_lights_what_it_is_for(backend: str, bounces: int) -> None:
    """Two panels, one of them for nothing: as the other alone."""
    one, none, all_ = (
        drawn(panels(*links), bounces, backend, **GLOWING)
        for links in (({},), ({}, {"receivers": 1 << 9}), ({}, {}))
    )
    assert (one == none).all()
    assert (all_ > 1.1 * one).any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_glows_shines_through_what_is_no_blocker(backend: str) -> None:
    """The ball casts no shadow in its light, and does in that of the other panel."""
    free = panels({"blockers": 0b1})
    floor, thing, panel = free.instances
    unseen_ball = replace(free, instances=(floor, replace(thing, visible_shadow=False), panel))
    one, other, dark = (
        drawn(scene, 0, backend, **GLOWING) for scene in (free, unseen_ball, panels({}))
    )
    assert np.abs(one - other).max() <= 1e-7 * other.max()
    assert (one > dark).any()


def test_linked_panels_are_the_same_in_both_tracers_and_add_up() -> None:
    """Each alone, and together: a table of its own for each."""
    links = ({"receivers": 0b1}, {"blockers": 0b1}, {"receivers": 0b10, "blockers": 0b10})
    native, exact = (drawn(panels(*links), 1, backend, **GLOWING) for backend in BACKENDS)
    off = np.abs(native - exact).max(2) / np.maximum(exact.max(2), 1e-3)
    assert np.median(off) < 1e-6
    assert (off > 1e-4).mean() < 0.01
    nothing = {"receivers": 1 << 9}
    alone = [
        drawn(panels(*(link if n == k else nothing for n, link in enumerate(links))), 0, **GLOWING)
        for k in range(3)
    ]
    together = drawn(panels(*links), 0, **GLOWING)
    assert np.abs(together - sum(alone)).max() < 1e-5 * together.max()
    assert all(picture.max() > 0 for picture in alone)


def test_links_of_instances_are_checked() -> None:
    assert any("receivers" in text for text in scene_problems(panels({"receivers": -1})))
