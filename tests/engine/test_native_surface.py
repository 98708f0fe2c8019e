"""Surfaces of the native core against closed forms: highlights, mirrors, glass, transparency."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import look_at
from glint.engine import scene as s
from native_tools import (
    IDENTITY,
    color,
    constant,
    draw,
    lamp,
    material,
    needs_core,
    placed,
    square,
    view_from_above,
)
from surface_scenes import ROUNDING, SUN, P, agree, balls, on_ball, plane

pytestmark = needs_core


def test_lambert_sphere_under_the_sun() -> None:
    """4.12: k_d I max(0, n·l), the terminator included."""
    tilt = 1.1
    axes = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    radius = float(np.float32(0.9))
    picture = color(
        balls(
            s.Lobe("DIFFUSE", constant(0.8, 0.6, 0.4)),
            lights=(lamp("SUN", axes=axes, strength=np.pi),),
        )
    )
    n, _ = on_ball(radius)
    truth = np.maximum(0, n @ axes[:, 2])[..., None] * [0.8, 0.6, 0.4]
    # x and y of the normal are exact; z = sqrt(R² - x² - y²) loses nothing here, so only the last
    # rounding is left.
    assert np.abs(picture - truth).max() <= ROUNDING


@pytest.mark.parametrize("exponent", [0.0, 1.0, 7.5, 100.0, 1e4])
def test_blinn_phong(exponent: float) -> None:
    """4.13 on a sphere: k_s I max(0, n·h)^p where n·l > 0."""
    tilt = 0.7
    axes = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    scene = balls(
        s.Lobe("SPECULAR", constant(0.5), exponent=exponent),
        lights=(lamp("SUN", axes=axes, strength=np.pi),),
    )
    n, inside = on_ball(float(np.float32(0.9)))
    h = axes[:, 2] + [0, 0, 1]
    cosine = n @ (h / np.linalg.norm(h))
    truth = np.where(inside & (n @ axes[:, 2] > 0), 0.5 * np.maximum(0, cosine) ** exponent, 0)
    # float64 pow of a rounded cosine is itself off by p ulps.
    assert np.abs(color(scene)[..., 0] - truth).max() <= 0.5 * (ROUNDING + exponent * 2**-52)


FRESNEL = [
    (0.3, ""),
    (1.0, ""),
    (0.0, "schlick"),
    (0.0, "fresnel"),
    (0.09, "fresnel"),
    (0.3, "edge"),
]


@pytest.mark.parametrize(
    ("distribution", "masking", "fresnel"),
    [
        *(("BLINN_PHONG", *case) for case in FRESNEL),
        *((name, *case) for name in s.DISTRIBUTIONS[1:] for case in FRESNEL if case[0] > 0),
    ],
)
def test_masking_and_fresnel_of_a_highlight(
    distribution: str, masking: float, fresnel: str
) -> None:
    """Times Smith's shadowing and masking, 1 at normal incidence, and Schlick's weight, a
    dielectric's reflectance or what a metal's edge lacks between v and h. GGX, BECKMANN: π D / 4
    (Walter, Marschner, Li, Torrance 2007, equations 25, 27 and 33). ASHIKHMIN_SHIRLEY: theirs
    (2000) of one exponent, as Cycles has it.
    """
    tilt = 1.3
    axes = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    lobe = s.Lobe(
        "SPECULAR",
        constant(0.5),
        3.0,
        1.5,
        masking=masking,
        distribution=distribution,
        **({fresnel: True} if fresnel else {}),
    )
    scene = balls(lobe, lights=(lamp("SUN", axes=axes, strength=np.pi),))
    n, inside = on_ball(float(np.float32(0.9)))
    h = (axes[:, 2] + [0, 0, 1]) / np.linalg.norm(axes[:, 2] + [0, 0, 1])
    nl, nv, vh = np.maximum(n @ axes[:, 2], 1e-300), n[..., 2], h[2]
    tangents = [np.sqrt(np.maximum(1 / np.maximum(c, 1e-9) ** 2 - 1, 0)) for c in (nl, nv)]
    # Heitz 2014, G2 = 1 / (1 + the two)
    lambdas = [(np.sqrt(1 + masking**2 * t**2) - 1) / 2 for t in tangents]
    if distribution == "BECKMANN":
        with np.errstate(divide="ignore"):
            a = [1 / (masking * t) for t in tangents]
        ones = [(3.535 * x + 2.181 * x**2) / (1 + 2.276 * x + 2.577 * x**2) for x in a]
        lambdas = [np.where(x < 1.6, 1 / one - 1, 0) for x, one in zip(a, ones, strict=True)]
    factor = 1 / (1 + sum(lambdas)) / np.maximum(nv, 1e-9) if masking else 1.0
    if distribution == "ASHIKHMIN_SHIRLEY":
        factor = (1 - masking**2 / 2) * nl / (vh * np.maximum(np.maximum(nv, nl), 1e-9))
    beyond = np.sqrt(1 - (1 - vh**2) / 1.5**2)
    across, along = (
        (vh - 1.5 * beyond) / (vh + 1.5 * beyond),
        (1.5 * vh - beyond) / (1.5 * vh + beyond),
    )
    factor = (
        factor
        * {
            "": 1.0,
            "schlick": (1 - vh) ** 5,
            "edge": vh * (1 - vh) ** 6 / (1 / 7 * (6 / 7) ** 6),
            "fresnel": (across**2 + along**2) / 2,
        }[fresnel]
    )
    nh = np.maximum(0, n @ h)
    if distribution == "GGX":
        alpha2 = masking**2
        spread = alpha2 / (4 * (nh**2 * (alpha2 - 1) + 1) ** 2) * (nh > 0)
    elif distribution == "BECKMANN":
        c2 = np.maximum(nh, 1e-6) ** 2
        spread = np.exp(-(1 - c2) / (c2 * masking**2)) / (4 * masking**2 * c2**2)
    elif distribution == "ASHIKHMIN_SHIRLEY":
        spread = np.maximum(nh, 0) ** (2 / masking**2 - 2) / (4 * masking**2) * (nh > 0)
    else:
        spread = nh**3
    truth = np.where(inside & (n @ axes[:, 2] > 0), 0.5 * spread * factor, 0)
    for backend in ("NATIVE", "NUMPY"):
        np.testing.assert_allclose(
            color(scene, backend=backend)[..., 0], truth, rtol=2e-6, atol=1e-9
        )


def test_highlights_of_different_reflectance_add_up() -> None:
    """Lobes share what they have in common, and nothing else."""
    axes = np.array([[np.cos(1.3), 0, np.sin(1.3)], [0, 1, 0], [-np.sin(1.3), 0, np.cos(1.3)]])
    lights = (lamp("SUN", axes=axes, strength=np.pi),)
    kinds = ({}, {"schlick": True}, {"fresnel": True}, {"fresnel": True, "ior": 2.5}, {})
    kinds = (*kinds, {"edge": True})
    lobes = [s.Lobe("SPECULAR", constant(0.2), 3.0, masking=0.3, **kind) for kind in kinds]
    alone = sum(color(balls(lobe, lights=lights)).astype(np.float64) for lobe in lobes)
    np.testing.assert_allclose(color(balls(*lobes, lights=lights)), alone, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("kind", ["AMBIENT", "DIFFUSE"])
def test_lobes_that_depend_on_the_view(kind: str) -> None:
    """Times (1 - n·v)^exponent, beside one that does not."""
    n, inside = on_ball(float(np.float32(0.9)))
    scene = balls(
        s.Lobe(kind, constant(0.5)),
        s.Lobe(kind, constant(0.4), exponent=2.5),
        world=s.World(ambient=(0.7,) * 3),
    )
    light = n[..., 2] if kind == "DIFFUSE" else 0.7
    truth = np.where(inside, (0.5 + 0.4 * (1 - n[..., 2]) ** 2.5) * light, 0)
    for backend in ("NATIVE", "NUMPY"):
        np.testing.assert_allclose(
            color(scene, backend=backend)[..., 0], truth, rtol=2e-6, atol=1e-9
        )


def test_highlight_only_where_the_light_is_above() -> None:
    """Erratum to 4.13: a light below the surface gives no highlight, even at exponent 0."""
    below = lamp("SUN", axes=np.diag([1.0, -1, -1]), strength=np.pi)
    assert color(plane(s.Lobe("SPECULAR", exponent=0.0), lights=(below,))).max() == 0


def test_exponent_zero_is_constant_over_the_lit_side() -> None:
    """0^0 = 1: even where n·h < 0, as a shading normal bent away from the viewer has it."""
    n, to_light = np.array([0.96, 0.0, -0.28]), np.array([0.28, 0.96, 0.0])
    mesh = square()
    mesh = s.Mesh(
        "bent",
        mesh.vertices,
        mesh.triangles,
        normals=s.Attribute("n", s.POINT, np.tile(n.astype(np.float32), (4, 1))),
    )
    assert n @ to_light > 0 > n @ (to_light + [0, 0, 1])
    sun = lamp(
        "SUN",
        axes=np.column_stack([(0.96, -0.28, 0), (0, 0, 1), to_light]),
        strength=np.pi,
        cast_shadow=False,
    )
    for exponent, value in ((0.0, 1.0), (1.0, 0.0)):
        picture = color(plane(s.Lobe("SPECULAR", exponent=exponent), lights=(sun,), mesh=mesh))
        assert np.abs(picture - value).max() <= ROUNDING, exponent


def test_ambient_and_emission_need_no_light() -> None:
    world = s.World(ambient=(0.2, 0.3, 0.4))
    scene = plane(
        s.Lobe("AMBIENT", constant(0.5)),
        s.Lobe("EMISSION", constant(1.0, 2.0, 3.0)),
        lights=(),
        world=world,
    )
    agree(color(scene), np.broadcast_to([1.1, 2.15, 3.2], (16, 16, 3)))


def test_factors_multiply_and_complement() -> None:
    factors = (s.Input((0.5, 0.25, 1.0)), s.Input((0.2, 0.4, 0.6), complement=True))
    agree(
        color(plane(s.Lobe("EMISSION", factors), lights=())),
        np.broadcast_to([0.4, 0.15, 0.4], (16, 16, 3)),
    )


def test_surface_without_material_is_white() -> None:
    scene = plane(world=s.World(ambient=(0.5, 0.5, 0.5)))
    scene = s.Scene(
        scene.camera, scene.geometries, (placed(materials=()),), (), (), (SUN,), scene.world
    )
    agree(color(scene), np.full((16, 16, 3), 0.8 + 0.4))


def test_slots_beyond_the_end_use_the_last_material() -> None:
    mesh = square()
    mesh = s.Mesh("two", mesh.vertices, mesh.triangles, material_slots=np.array([0, 7], np.uint16))
    glow = tuple(s.Material(f"{k}", (s.Lobe("EMISSION", constant(k)),), 10 + k) for k in (1, 2, 3))
    scene = s.Scene(view_from_above(), (mesh,), (placed(materials=(2, 1)),), glow)
    film = draw(scene, "Material Index")
    first = P[..., 1] <= P[..., 0]  # on the diagonal the lower triangle wins
    assert np.array_equal(film.combined[..., 0], np.where(first, 3, 2))
    assert np.array_equal(film.passes["Material Index"][..., 0], np.where(first, 13, 12))


def test_mirror_sees_what_is_above() -> None:
    """4.17: the plane mirrors a square at z = 4 that only mirror rays see; the perspective eye sees
    it twice as far as the floor.
    """
    camera = s.Camera(
        "PERSPECTIVE", np.column_stack([np.eye(3), (0, 0, 2)]), (-0.5, 0.5, -0.5, 0.5), (16, 16)
    )
    glow = s.Material("glow", (s.Lobe("EMISSION", constant(0.5, 1.0, 2.0)),))
    mirror = material(s.Lobe("MIRROR", constant(0.5)))
    instances = (placed(), placed(1, (1,), z=4.0, visible_camera=False))
    scene = s.Scene(
        camera,
        (square(), square(1.0)),
        instances,
        (mirror, glow),
        (),
        (),
        s.World(background=(0.1, 0.1, 0.1)),
    )
    seen = (np.abs(P[..., :2] * 0.5 * 6) < 1).all(-1)[..., None]
    truth = np.where(seen, [0.25, 0.5, 1.0], 0.05)
    film = draw(scene, "Mirror", "Environment", max_bounces=1)
    agree(film.combined[..., :3], truth)
    assert np.array_equal(film.passes["Mirror"], film.combined[..., :3])
    assert film.passes["Environment"].max() == 0
    assert draw(scene, max_bounces=0).combined[..., :3].max() == 0


@pytest.mark.parametrize("bounces", [1, 2, 5, 9])
def test_mirror_corridor(bounces: int) -> None:
    """Two facing mirrors of reflectance k that glow by e: e (1 + k + … + k^bounces)."""
    mirror = material(s.Lobe("MIRROR", constant(0.5)), s.Lobe("EMISSION", constant(1.0)))
    scene = s.Scene(view_from_above(), (square(),), (placed(), placed(z=20.0)), (mirror,))
    agree(color(scene, max_bounces=bounces), np.full((16, 16, 3), 2 - 0.5**bounces))


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize(("cutoff", "bounces"), [(0.25, 2), (0.2, 2), (0.1, 3), (0.6, 0), (0.0, 9)])
def test_bounces_of_little_weight_are_cut_off(cutoff: float, bounces: int, backend: str) -> None:
    """The corridor again: rays weigh k, k², k³ … and those below the cutoff are not traced."""
    mirror = material(s.Lobe("MIRROR", constant(0.5)), s.Lobe("EMISSION", constant(1.0)))
    scene = s.Scene(view_from_above(), (square(),), (placed(), placed(z=20.0)), (mirror,))
    film = draw(scene, "Cost", max_bounces=9, cutoff=cutoff, backend=backend)
    agree(film.combined[..., :3], np.full((16, 16, 3), 2 - 0.5**bounces))
    assert (film.passes["Cost"] == 1 + bounces).all()


def fresnel(cosine: np.ndarray, ior: float) -> np.ndarray:
    """The textbook form by the two angles (Hecht, Optics, section 4.6)."""
    a = np.arccos(cosine)
    b = np.arcsin(np.sin(a) / ior)
    return (np.sin(a - b) ** 2 / np.sin(a + b) ** 2 + np.tan(a - b) ** 2 / np.tan(a + b) ** 2) / 2


def test_fresnel_mirror_and_refraction_share_the_light() -> None:
    """A water surface in a white furnace: F + (1 − F) = 1; each alone against the textbook."""
    camera = s.Camera(
        "PERSPECTIVE", look_at((0, -3, 1.0), (0, 0, 0)), (-0.15, 0.15, -0.15, 0.15), (16, 16)
    )
    white = s.World(background=(1.0, 1.0, 1.0))
    mirror, beyond = (
        s.Lobe("MIRROR", ior=1.33, fresnel=True),
        s.Lobe("REFRACTION", ior=1.33, fresnel=True),
    )
    both = color(plane(mirror, beyond, lights=(), world=white, camera=camera))
    assert np.abs(both - 1).max() <= 2 * ROUNDING
    film = draw(plane(mirror, lights=(), world=white, camera=camera), "Position")
    to_eye = np.array([0, -3, 1.0]) - film.passes["Position"]
    F = fresnel(to_eye[..., 2] / np.linalg.norm(to_eye, axis=-1), 1.33)  # noqa: N806
    # Position is float32: a relative 2^-24 of the cosine; dF/dcos stays below 3 here.
    assert np.abs(film.combined[..., 0] - F).max() <= 4 * ROUNDING
    agree(
        color(plane(s.Lobe("REFRACTION", ior=1.33), lights=(), world=white, camera=camera)),
        np.ones((16, 16, 3)),
    )


def test_snell_through_a_slab() -> None:
    """A ray bent by a thick plate of glass comes out parallel, shifted by t sin(a − b)/cos(b): the
    stripe it meets moves so far.
    """
    angle = 0.6
    camera = s.Camera(
        "ORTHOGRAPHIC",
        look_at((0, -10 * np.tan(angle), 10), (0, 0, 0)),
        (-0.4, 0.4, -0.4, 0.4),
        (16, 16),
    )
    glass = material(s.Lobe("REFRACTION", ior=1.5))
    ramp = s.Attribute("map", s.POINT, np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32))
    mesh = square(4.0)
    pixels = np.zeros((2, 2, 4), np.float32)
    pixels[1], pixels[..., 3] = 1, 1
    texture = s.Texture("ramp", pixels, extension="EXTEND")
    floor = s.Material("floor", (s.Lobe("EMISSION", (s.Input(texture=0),)),))
    thick = 0.7
    under = placed(0, (1,), z=-2.0)
    slab = (placed(0, (0,), z=0.0), placed(0, (0,), z=-thick, linear=np.diag([1.0, -1, -1])))
    mesh = s.Mesh("m", mesh.vertices, mesh.triangles, attributes=(ramp,))
    bent, straight = (
        color(s.Scene(camera, (mesh,), (*extra, under), (glass, floor), (texture,)))[..., 0]
        for extra in (slab, ())
    )
    inner = np.arcsin(np.sin(angle) / 1.5)
    # Rays run to +y while they sink; the texture rises by 2/8 per unit of y (v runs over 8 units,
    # half of them blend).
    shift = -thick * (np.tan(angle) - np.tan(inner)) * 2 / 8
    assert np.abs((bent - straight) - shift).max() <= 4 * ROUNDING


def test_ball_of_glass_bends_rays_twice() -> None:
    """Parallel rays through a ball: in at the angle a, out after the central angle π − 2b, turned
    by 2(a − b); a ramp lies below.
    """
    radius, ior, depth = 0.875, 1.5, 3.0
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.array([radius], np.float32))
    pixels = np.zeros((1, 2, 4), np.float32)
    pixels[0, 1] = 1
    floor = s.Material("floor", (s.Lobe("EMISSION", (s.Input(texture=0),)),))
    textures = (s.Texture("ramp", pixels, extension="EXTEND"),)
    glass = material(s.Lobe("REFRACTION", ior=ior))
    instances = (placed(0, (0,)), placed(1, (1,), z=-depth))
    picture = color(
        s.Scene(view_from_above(), (ball, square(8.0)), instances, (glass, floor), textures)
    )
    x, r = P[..., 0], np.hypot(P[..., 0], P[..., 1])
    inner = r < 0.7 * radius
    a = np.arcsin(np.where(inner, r, 0) / radius)
    b = np.arcsin(np.sin(a) / ior)
    turn, polar = 2 * (a - b), a + np.pi - 2 * b
    r_floor = radius * np.sin(polar) - (radius * np.cos(polar) + depth) * np.tan(turn)
    # u = (x + 8) / 16 and the ramp rises from 0 to 1 between the texel centres 0.25 and 0.75.
    truth = (((r_floor * x / np.where(r > 0, r, 1)) + 8) / 16 - 0.25) / 0.5
    assert np.abs(picture[..., 0] - truth)[inner].max() <= ROUNDING


def test_total_reflection_and_leaving_index() -> None:
    """From inside (the mesh seen from behind) the index is 1/ior: nothing beyond the critical
    angle, F = 1 there.
    """
    for tilt, passes in ((0.6, True), (0.8, False)):  # the critical angle of 1.5 is 0.7297
        eye = (0, -10 * np.sin(tilt), -10 * np.cos(tilt))
        camera = s.Camera("ORTHOGRAPHIC", look_at(eye, (0, 0, 0)), (-0.5, 0.5, -0.5, 0.5), (4, 4))
        white = s.World(background=(1.0, 1.0, 1.0))
        through = color(plane(s.Lobe("REFRACTION", ior=1.5), lights=(), world=white, camera=camera))
        assert np.array_equal(through, np.full((4, 4, 3), float(passes)))
        mirrored = color(
            plane(s.Lobe("MIRROR", ior=1.5, fresnel=True), lights=(), world=white, camera=camera)
        )
        assert (mirrored.min() == 1) == (not passes)


def test_transparency_shows_what_is_behind() -> None:
    """Compositing of section 3: α c_f + (1 − α) c_b."""
    veil = material(s.Lobe("EMISSION", constant(0.25)), s.Lobe("TRANSPARENT", constant(0.75)))
    glow = s.Material("glow", (s.Lobe("EMISSION", constant(0.8, 0.4, 0.2)),))
    scene = s.Scene(
        view_from_above(),
        (square(),),
        (placed(z=1.0), placed(z=2.0), placed(0, (1,))),
        (veil, glow),
    )
    truth = 0.25 + 0.75 * (0.25 + 0.75 * np.array([0.8, 0.4, 0.2]))
    agree(color(scene, max_bounces=0), np.broadcast_to(truth, (16, 16, 3)))


@pytest.mark.parametrize("k", [0.875, 1.0])
def test_transparent_rays_end_black_after_128(k: float) -> None:
    """Surfaces that let everything through do not count."""
    clear = material(s.Lobe("TRANSPARENT", constant(k)))
    for sheets, seen in ((128, k**128), (129, float(k == 1))):
        matrices = np.repeat(IDENTITY[None], sheets, 0)
        matrices[:, 2, 3] = np.linspace(-3, 3, sheets)
        stack = s.Instances("sheets", 0, matrices, (0,))
        scene = s.Scene(
            view_from_above(4),
            (square(),),
            (stack,),
            (clear,),
            (),
            (),
            s.World(background=(1, 1, 1)),
        )
        assert np.allclose(color(scene), np.full((4, 4, 3), seen), rtol=1e-6, atol=0), sheets


def test_shadow_through_transparency() -> None:
    """The clamped transparency of every sheet between, colour by colour; above 1 counts as 1."""
    foil = s.Material(
        "foil",
        (
            s.Lobe("TRANSPARENT", constant(0.5, 0.25, 0.0)),
            s.Lobe("TRANSPARENT", constant(0.25, 0.0, 0.0)),
        ),
    )
    bright = s.Material("bright", (s.Lobe("TRANSPARENT", constant(3.0)),))
    sheets = [placed(0, (k,), z=z, visible_camera=False) for k, z in ((1, 1.0), (1, 2.0), (2, 3.0))]
    floor = material(s.Lobe("DIFFUSE", constant(1.0)))
    scene = s.Scene(
        view_from_above(), (square(),), (placed(), *sheets), (floor, foil, bright), (), (SUN,)
    )
    agree(color(scene), np.broadcast_to([0.5625, 0.0625, 0.0], (16, 16, 3)))


def test_film_transparent_and_holdout_lose_alpha() -> None:
    veil = s.Material("veil", (s.Lobe("TRANSPARENT", constant(0.5, 0.25, 0.75)),))
    world = s.World(background=(1, 1, 1), transparent=True)
    instances = (placed(0, (0,), z=1.0), placed(1, (1,), holdout=True))
    materials = veil, material(s.Lobe("DIFFUSE"))
    scene = s.Scene(view_from_above(), (square(), square(0.5)), instances, materials, world=world)
    picture = draw(scene, samples=3, filter_width=0.0).combined
    assert np.array_equal(picture[..., :3], np.zeros((16, 16, 3)))
    agree(picture[..., 3], np.full((16, 16), 0.5))
    seen = draw(
        s.Scene(
            view_from_above(),
            (square(), square(0.5)),
            instances,
            materials,
            world=s.World(background=(1, 1, 1)),
        )
    ).combined
    hole = (np.abs(P[..., :2]) < 0.5).all(-1)
    agree(seen[..., 3], np.where(hole, 0.5, 1.0))
    assert np.array_equal(seen[..., 0], np.where(hole, 0, 0.5))


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_a_holdout_lets_through_what_its_surface_does(backend: str) -> None:
    """A quarter of what is behind; the rest is a hole."""
    lobes = s.Lobe("TRANSPARENT", constant(0.25)), s.Lobe("DIFFUSE"), s.Lobe("MIRROR")
    world = s.World(background=(1, 0.5, 0.25))
    given = s.Scene(
        view_from_above(),
        (square(),),
        (placed(holdout=True),),
        (material(*lobes),),
        lights=(lamp("SUN"),),
        world=world,
    )
    picture = draw(given, backend=backend).combined
    agree(picture, np.broadcast_to([0.25, 0.125, 0.0625, 0.25], (16, 16, 4)))
    fog = s.Medium(absorption=(0.1, 0.2, 0.3))
    clear = s.Material("fog", (s.Lobe("TRANSPARENT"),), medium=fog)
    bare = replace(given, materials=(clear,))
    shown = replace(bare, instances=(placed(),))
    assert (draw(bare, backend=backend).combined == draw(shown, backend=backend).combined).all()


@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_mirrors_see_a_holdout_as_it_is(backend: str) -> None:
    mirror = material(s.Lobe("MIRROR"))
    hole = placed(0, (1,), z=12.0, holdout=True)
    glow = s.Material("glow", (s.Lobe("EMISSION"),))
    picture = draw(
        s.Scene(view_from_above(), (square(),), (placed(), hole), (mirror, glow)), backend=backend
    ).combined
    assert np.array_equal(picture, np.ones((16, 16, 4)))
