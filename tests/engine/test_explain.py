"""Explain Pixel: the terms add up to the picture, and each is what the notes' formula gives."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import ALBEDO, inside, matt, room
from glint.engine import OCCLUSION, SceneError, Settings, render
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Medium,
    Mesh,
    Scene,
    Spheres,
    World,
)
from test_subsurface import LIGHTS, hills, skin


def lobe(kind, value, **more):
    return Lobe(kind, (Input((value, value * 0.5, value * 0.25)),), **more)


def placed(x, y, z):
    return np.array([[[1.0, 0, 0, x], [0, 1, 0, y], [0, 0, 1, z]]])


def lamp(name, kind, at, **more):
    return Light(name, kind, np.concatenate([np.eye(3), np.array(at, float)[:, None]], 1), **more)


PLASTIC = Material(
    "Plastic", (lobe("AMBIENT", 0.5), lobe("DIFFUSE", 0.8), lobe("SPECULAR", 0.3, exponent=20.0))
)
MIRROR = Material("Mirror", (lobe("DIFFUSE", 0.2), lobe("MIRROR", 0.7)))
GLASS = Material(
    "Glass",
    (lobe("MIRROR", 0.9, ior=1.5, fresnel=True), lobe("REFRACTION", 0.9, ior=1.5, fresnel=True)),
)
HAZE = Medium((0.02, 0.05, 0.1), (0.02, 0.02, 0.03), anisotropy=0.3)
VEIL = Material("Veil", (lobe("TRANSPARENT", 0.6), lobe("DIFFUSE", 0.3), lobe("EMISSION", 0.05)))

FLOOR = Mesh(
    "Floor",
    np.array([[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
)
BALL = Spheres("Ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
LOOKING_DOWN = np.array([[1.0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 1, 6]])

SCENE = Scene(
    Camera("PERSPECTIVE", LOOKING_DOWN, (-0.5, 0.5, -0.5, 0.5), (24, 24), 0.1, 100.0),
    (FLOOR, BALL),
    (
        Instances("Floor", 0, placed(0, 0, 0), (0,)),
        Instances("Mirror Ball", 1, placed(-1.2, 0, 1), (1,)),
        Instances("Glass Ball", 1, placed(1.2, 0, 1.2), (2,)),
        Instances("Veil", 0, placed(4, 0, 2.5), (3,)),
    ),
    (PLASTIC, MIRROR, GLASS, VEIL),
    lights=(
        lamp("Sun", "SUN", (0, 0, 0), angle=0.1),
        lamp("Point", "POINT", (2, -2, 4), strength=300.0),
        lamp(
            "Area", "AREA", (-2, 2, 5), strength=200.0, size_x=1.0, size_y=2.0, visible_mirror=True
        ),
    ),
    world=World((0.1, 0.2, 0.3), (0.05, 0.06, 0.07)),
)
SETTINGS = Settings(samples=1, light_samples=3, max_bounces=3, backend="NUMPY")


BALLS = [(6, 16), (5, 17), (18, 17), (17, 16)]
"""Pixels that show the two balls."""


@pytest.mark.parametrize("illumination", ["PHYSICAL", "CLASSIC"])
def test_the_tree_adds_up_to_the_picture(illumination):
    """The reference's own pixels, to the rounding of a float32."""
    settings = replace(SETTINGS, illumination=illumination)
    picture, explainer = render(SCENE, settings).combined, PixelExplainer(SCENE, settings)
    for x, y in [*BALLS, (0, 0), (12, 12), (20, 3), (8, 20)]:
        np.testing.assert_allclose(
            explainer.pixel(x, y).color, picture[y, x, :3], rtol=2**-22, atol=1e-12
        )


def test_holdouts_tell_of_what_is_behind_them():
    """And as other things of what mirrors show of them."""
    held = tuple(replace(i, holdout=i.name in ("Veil", "Glass Ball")) for i in SCENE.instances)
    scene = replace(SCENE, instances=held)
    picture, explainer = render(scene, SETTINGS).combined, PixelExplainer(scene, SETTINGS)
    for x, y in [*BALLS, (12, 12), (20, 3), (22, 8)]:
        np.testing.assert_allclose(
            explainer.pixel(x, y).color, picture[y, x, :3], rtol=2**-22, atol=1e-12
        )
    told = "\n".join(explanation_lines(explainer.pixel(20, 3)))
    assert "it is a holdout: the camera sees nothing of it" in told and "transparent ray" in told


def test_offsets_of_the_shadow_terminator_are_told():
    low = tuple(replace(i, shading_offset=0.6, geometry_offset=0.0) for i in SCENE.instances)
    scene = replace(SCENE, instances=low)
    picture, explainer = render(scene, SETTINGS).combined, PixelExplainer(scene, SETTINGS)
    for x, y in [*BALLS, (0, 0), (20, 3)]:
        np.testing.assert_allclose(
            explainer.pixel(x, y).color, picture[y, x, :3], rtol=2**-22, atol=1e-12
        )
    told = "\n".join(explanation_lines(explainer.pixel(0, 0)))
    assert "the object's Shading Offset leaves 0." in told


def every(ray):
    yield ray
    for after in ray.follow:
        yield from every(after)


def test_all_kinds_of_rays_and_blockers_are_told():
    explainer = PixelExplainer(SCENE, SETTINGS)
    rays = [found for x, y in [*BALLS, (8, 12)] for found in every(explainer.pixel(x, y))]
    assert {ray.kind for ray in rays} == {"camera", "mirror", "refraction", "transparent"}
    assert {"", "Mirror Ball", "Veil"} <= {
        term.blocker for ray in rays if ray.hit for term in ray.hit.lights
    }


def test_the_shape_of_a_light_and_the_surroundings_are_told():
    turned = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, -3]])
    lights = (
        Light(
            "Panel",
            "AREA",
            np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]),
            size_x=1,
            size_y=2,
            strength=8,
            visible_camera=True,
        ),
    )
    camera = replace(SCENE.camera, world_from_camera=turned, resolution=(3, 1))
    explainer = PixelExplainer(replace(SCENE, camera=camera, instances=(), lights=lights), SETTINGS)
    ray = explainer.pixel(1, 0)
    assert ray.hit is None and [name for name, _ in ray.shapes] == ["Panel"]
    np.testing.assert_allclose(ray.shapes[0][1], [8 / (np.pi * 2)] * 3)
    np.testing.assert_allclose(ray.color, np.add(ray.shapes[0][1], SCENE.world.background))
    assert "sees the light 'Panel'" in "\n".join(explanation_lines(ray))


def test_a_point_light_over_a_floor_in_closed_form():
    """Straight below a lamp 2 above the floor: n·l = 1, I = c/(4π² d²), L = k_a I_a + k_d I + k_s I
    (n·h)^p.
    """
    scene = replace(
        SCENE,
        instances=SCENE.instances[:1],
        lights=(lamp("Lamp", "POINT", (0, -1, 2), strength=40.0),),
    )
    scene = replace(scene, camera=replace(scene.camera, resolution=(1, 1)))
    ray = PixelExplainer(scene, SETTINGS).pixel(0, 0)
    (term,) = ray.hit.lights
    intensity = 40.0 / (4 * np.pi**2 * 4)
    assert (
        ray.hit.thing == "Floor"
        and ray.hit.material == "Plastic"
        and ray.hit.depth == pytest.approx(6)
    )
    assert sum(ray.hit.barycentric) == pytest.approx(1)
    assert (term.n_dot_l, term.n_dot_h, term.distance, term.blocker) == (
        pytest.approx(1),
        pytest.approx(1),
        pytest.approx(2),
        "",
    )
    np.testing.assert_allclose(term.intensity, [intensity] * 3)
    np.testing.assert_allclose(ray.hit.ambient, np.array([0.5, 0.25, 0.125]) * [0.1, 0.2, 0.3])
    np.testing.assert_allclose(term.diffuse, np.array([0.8, 0.4, 0.2]) * intensity)
    np.testing.assert_allclose(term.specular, np.array([0.3, 0.15, 0.075]) * intensity)
    np.testing.assert_allclose(
        ray.color, np.add(ray.hit.ambient, np.add(term.diffuse, term.specular))
    )


def test_a_blocker_has_its_name_and_distance():
    ball = Instances("Blocker", 1, placed(0, -1, 3), ())
    scene = replace(
        SCENE, instances=(SCENE.instances[0], ball), lights=(lamp("Lamp", "POINT", (0, -1, 5)),)
    )
    below = np.array([[1.0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 1, 1]])
    scene = replace(scene, camera=replace(scene.camera, world_from_camera=below, resolution=(1, 1)))
    (term,) = PixelExplainer(scene, SETTINGS).pixel(0, 0).hit.lights
    assert (
        term.blocker == "Blocker"
        and term.blocker_distance == pytest.approx(2)
        and term.shadow == (0, 0, 0)
    )


def test_the_text_names_what_counts():
    text = "\n".join(explanation_lines(PixelExplainer(SCENE, SETTINGS).pixel(6, 16)))
    for words in (
        "camera ray",
        "mirror ray",
        "n·l",
        "n·h",
        "k_a I_a",
        "'Sun'",
        "barycentric",
        "Mirror Ball",
    ):
        assert words in text, text


def test_the_first_line_says_in_plain_words_what_lights_a_pixel():
    """Two equal lamps and a third of half the strength at the same place, no ambient light: 40, 40
    and 20 %.
    """
    lamps = [
        lamp(name, "POINT", (0, -1, 2), strength=strength)
        for name, strength in (("A", 40.0), ("B", 20.0), ("C", 40.0))
    ]
    down = np.array([[1.0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 1, 1]])
    scene = replace(SCENE, instances=SCENE.instances[:1], lights=tuple(lamps), world=World())
    scene = replace(scene, camera=replace(scene.camera, world_from_camera=down, resolution=(1, 1)))
    first, second, *_ = explanation_lines(PixelExplainer(scene, SETTINGS).pixel(0, 0))
    assert first == "'Floor' with the material 'Plastic': lit by A 40 %, C 40 %, B 20 %"
    assert second.startswith("camera ray")


def test_the_first_line_says_what_blocks_and_what_is_mirrored():
    ball = Instances("Blocker", 1, placed(0, -1, 3), ())
    scene = replace(
        SCENE, instances=(SCENE.instances[0], ball), lights=(lamp("Lamp", "POINT", (0, -1, 5)),)
    )
    below = np.array([[1.0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 1, 1]])
    scene = replace(scene, camera=replace(scene.camera, world_from_camera=below, resolution=(1, 1)))
    dark = explanation_lines(PixelExplainer(scene, SETTINGS).pixel(0, 0))[0]
    assert (
        dark
        == "'Floor' with the material 'Plastic': lit by ambient light 100 %; Lamp is blocked by "
        "'Blocker'"
    )
    bare = PixelExplainer(replace(SCENE, instances=SCENE.instances[:3]), SETTINGS)
    assert " (mirrored) " in explanation_lines(bare.pixel(6, 16))[0]
    black = replace(scene, world=World())
    assert (
        ": no light comes from here; "
        in explanation_lines(PixelExplainer(black, SETTINGS).pixel(0, 0))[0]
    )


def test_what_media_leave_is_told_and_adds_up():
    """Fog everywhere, and glass of a colour."""
    tinted = replace(GLASS, medium=Medium((0.1, 0.2, 0.4), (0.1, 0.1, 0.2), (0.01, 0.0, 0.0)))
    materials = tuple(tinted if m is GLASS else m for m in SCENE.materials)
    scene = replace(SCENE, materials=materials, world=replace(SCENE.world, medium=HAZE))
    settings = Settings(samples=1, light_samples=1, max_bounces=3, backend="NUMPY")
    explainer = PixelExplainer(scene, settings)
    for x, y in ((4, 4), (16, 11), (17, 12)):
        picture = render(scene, replace(settings, region=(x, y, x + 1, y + 1))).combined
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[0, 0, :3], rtol=1e-5)
        assert 0 < ray.passed[2] < ray.passed[0] < 1
        text = "\n".join(explanation_lines(ray))
        for words in ("leave (", "scatter of the light 'Point'"):
            assert "media on its way " + words in text
        assert "in volumes" in text


def test_a_pixel_outside_is_refused():
    with pytest.raises(SceneError, match="outside the frame of 24 by 24"):
        PixelExplainer(SCENE, SETTINGS).pixel(24, 0)


def test_what_moves_is_told_in_pixels():
    """The ball of the scene goes up and to the right, the camera stays."""
    others = []
    for x in (-0.25, 0.5):
        blocks = tuple(
            replace(
                block, world_from_object=block.world_from_object + placed(x, x, 0) - placed(0, 0, 0)
            )
            if block.name == "Floor"
            else block
            for block in SCENE.instances
        )
        others.append(replace(SCENE, instances=blocks))
    moving, settings = replace(SCENE, neighbours=tuple(others)), Settings(samples=1)
    ray = PixelExplainer(moving, settings).pixel(0, 0)
    film = render(moving, replace(settings, passes=frozenset({"Vector"})))
    assert ray.hit.thing == "Floor"
    np.testing.assert_allclose(ray.hit.moved, film.passes["Vector"][0, 0], rtol=1e-6)
    np.testing.assert_allclose(ray.hit.moved, [-1, -1, -2, -2], atol=1e-5)
    text = "\n".join(explanation_lines(ray))
    assert "since the frame before it moved 1 pixels to the right and 1 up" in text
    assert PixelExplainer(SCENE, settings).pixel(0, 0).hit.moved is None


def test_ambient_occlusion_is_told_where_it_is_asked_for():
    settings = Settings(samples=1, passes=frozenset({OCCLUSION}))
    film = render(SCENE, settings).passes[OCCLUSION]
    explainer, shares = PixelExplainer(SCENE, settings), set()
    for y in range(film.shape[0]):
        hit = explainer.pixel(2, y).hit
        if hit is not None:
            np.testing.assert_allclose(hit.open, film[y, 2], rtol=1e-6)
            shares.add(round(hit.open[0], 6))
    assert len(shares) > 1
    text = "\n".join(explanation_lines(explainer.pixel(2, 0)))
    assert "of an even sky it sees" in text
    assert PixelExplainer(SCENE, Settings(samples=1)).pixel(2, 0).hit.open is None


SOFT = Scene(
    replace(SCENE.camera, resolution=(16, 16)),
    (FLOOR, BALL),
    SCENE.instances[:2],
    (
        Material("Satin", (lobe("DIFFUSE", 0.5), lobe("SPECULAR", 0.5, exponent=20.0))),
        matt((0.6, 0.3, 0.1)),
    ),
    lights=(lamp("Big", "AREA", (2, 2, 3), strength=200.0, size_x=3.0, size_y=2.0),),
)
DEALT = {
    "lamp": (SOFT, {"light_samples": 2}),
    "sky": (replace(SOFT, lights=(replace(LIGHTS["sky"], name="Sky"),)), {"light_samples": 2}),
    "reflections": (SOFT, {"reflections": "ALL", "max_bounces": 2}),
    "bounced light": (
        replace(
            room(lamp("Bulb", "POINT", (0.2, 0, 0), radius=0.1, strength=100.0)),
            camera=inside(size=16),
        ),
        {"light_samples": 2, "diffuse_bounces": 2},
    ),
    "skin": (hills(skin((0.2, 0.1, 0.05)), LIGHTS["area"]), {"light_samples": 2}),
    "haze": (replace(SOFT, world=World(medium=HAZE)), {"light_samples": 2}),
}
BLOCK = [(x, y) for y in range(4, 8) for x in range(8, 12)]
"""Pixels that deal samples among themselves."""


@functools.cache
def dealt_and_shared(name: str) -> tuple[np.ndarray, np.ndarray]:
    scene, more = DEALT[name]
    settings = Settings(samples=1, backend="NUMPY", **more)
    return tuple(
        render(scene, replace(settings, soft_light=kind)).combined for kind in ("DEALT", "SHARED")
    )


@pytest.mark.parametrize("soft_light", ["DEALT", "RESOLVED"])
@pytest.mark.parametrize("name", DEALT)
def test_each_pixel_is_explained_by_its_own_run_of_samples(name, soft_light):
    """Before light is averaged over pixels."""
    scene, more = DEALT[name]
    settings = Settings(backend="NUMPY", **more)
    picture, shared = dealt_and_shared(name)
    explainer = PixelExplainer(scene, replace(settings, samples=4, soft_light=soft_light))
    # the first sample of each is the same before light is averaged
    block = BLOCK if soft_light == "DEALT" else BLOCK[::5]
    for x, y in block:
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x, :3], rtol=1e-5, atol=1e-9)
        told = "light is averaged over 4 x 4 pixels of this surface: Resolved"
        lines = [line for line in explanation_lines(ray) if told in line]
        assert len(lines) == (soft_light == "RESOLVED")
    assert np.abs(picture - shared).max() > 0.01 * shared[..., :3].max()


def test_nothing_is_averaged_where_all_light_is_hard():
    hard = replace(SOFT, materials=(matt(ALBEDO),) * 2, lights=(lamp("Point", "POINT", (2, 2, 3)),))
    settings = Settings(samples=1, soft_light="RESOLVED", backend="NUMPY")
    ray, picture = PixelExplainer(hard, settings).pixel(9, 5), render(hard, settings).combined
    np.testing.assert_allclose(ray.color, picture[5, 9, :3], rtol=1e-6)
    assert "averaged" not in "\n".join(explanation_lines(ray))
