"""Shadow Terminator of objects: where coarse smooth bodies turn dark, and shadows on them."""

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint_picture import BACKENDS, render_glint, render_pair

bmesh = pytest.importorskip("bmesh")
LOW, HIGH = (3.0, -3.5, 1.6), (3.0, -3.5, 6.0)


def coarse_ball(sun, make=lambda: build.lambert((0.6, 0.6, 0.6))):
    """A smooth ball of 8 by 6 faces, a post before it that throws its shadow on it, and a floor."""
    scene = cycles.empty_scene(112, 112)
    build.add_camera(scene)
    build.add_light(scene, "SUN", sun, energy=2.0, use_shadow=True)
    build.add(scene, "Floor", build.plane(5.0, build.lambert((0.8, 0.8, 0.8))))
    ball = build.ball(8, 6, True, make())
    thing = build.add(scene, "Ball", ball, build.moved(0, 0, 1.2, 1.2, 1.2, 1.2))
    post = build.cube(build.lambert((0.7, 0.2, 0.1)))
    build.add(scene, "Post", post, build.moved(1.0, -1.35, 0.9, 0.06, 0.06, 0.9))
    return scene, thing


def set_offset(thing, kind: str, value: float) -> None:
    """Blender 4.2 has them in Cycles' settings."""
    name = f"shadow_terminator_{kind}_offset"
    if hasattr(thing, name):
        setattr(thing, name, value)
    else:
        setattr(thing.cycles, name.replace("shading_", ""), value)


def wrong(pair, tolerance: float = 5e-3) -> np.ndarray:
    """(h, w) bool: pixels that are another colour."""
    theirs, ours = pair.colors()
    return np.abs(ours - theirs).max(-1) > tolerance


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("sun", [LOW, HIGH], ids=("low", "high"))
@pytest.mark.parametrize("offset", [0.0, 0.02, 0.1, 0.5, 1.0])
def test_geometry_offset(offset, sun, backend):
    """Shadows start where they do in Cycles."""
    scene, ball = coarse_ball(sun)
    set_offset(ball, "geometry", offset)
    pair = render_pair(scene, backend, f"terminator-geometry-{offset}")
    assert wrong(pair).sum() == 0


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("sun", [LOW, HIGH, (2.0, 1.0, 1.5)], ids=("low", "high", "across"))
@pytest.mark.parametrize("offset", [0.0, 0.1, 0.5])
def test_geometry_offset_of_hollows(offset, sun, backend):
    """Faces of a coarse bowl are lifted too, and throw shadows on themselves where light comes from
    behind them.
    """
    scene = cycles.empty_scene(112, 112)
    build.add_camera(scene, (1.0, -3.0, 4.0), (0, 0, -0.3), lens=60)
    build.add_light(scene, "SUN", sun, energy=2.0, use_shadow=True)
    mesh = build.ball(8, 6, True, build.lambert((0.6, 0.6, 0.6)))
    half = bmesh.new()
    half.from_mesh(mesh)
    upper = [v for v in half.verts if v.co.z > 0.1]
    bmesh.ops.delete(half, geom=upper, context="VERTS")
    half.to_mesh(mesh)
    half.free()
    bowl = build.add(scene, "Bowl", mesh, build.moved(0, 0, 0, 1.2, 1.2, 1.2))
    set_offset(bowl, "geometry", offset)
    pair = render_pair(scene, backend, f"terminator-bowl-{offset}")
    theirs, _ = pair.colors()
    assert 0.05 < (theirs.max(-1) > 0.01).mean() < 0.9
    assert wrong(pair).sum() <= 1


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("offset", [0.3, 1.0])
def test_shading_offset(offset, backend):
    scene, ball = coarse_ball(LOW)
    set_offset(ball, "shading", offset)
    pair = render_pair(scene, backend, f"terminator-shading-{offset}")
    assert wrong(pair, 1e-4).sum() == 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_shading_offset_of_gloss(backend):
    """By how much it dims a highlight, whose shape is Blinn and Phong's here."""
    both = []
    for offset in (0.0, 0.6):
        scene, ball = coarse_ball(LOW, lambda: build.metal(0.6))
        set_offset(ball, "shading", offset)
        both.append(render_pair(scene, backend, "terminator-gloss").colors())
    (theirs, ours), (theirs_low, ours_low) = both  # edges of shadows are elsewhere
    seen = np.min([picture.min(-1) for pair in both for picture in pair], 0) > 0.01
    ratios = [low[seen] / full[seen] for low, full in ((theirs_low, theirs), (ours_low, ours))]
    assert (ratios[0] < 0.9).mean() > 0.05
    assert np.abs(ratios[0] - ratios[1]).max() < 1e-3


@pytest.mark.parametrize("backend", BACKENDS)
def test_shading_offset_of_mirrors(backend):
    """They dim what they show aslant."""
    scene, ball = coarse_ball(LOW, lambda: build.mirror((0.9, 0.8, 0.7)))
    for name in ("Floor", "Post"):
        cycles.bpy.data.objects.remove(cycles.bpy.data.objects[name])
    cycles.set_world(scene, (0.3, 0.5, 0.7))
    set_offset(ball, "shading", 0.6)
    pair = render_pair(scene, backend, "terminator-mirror", bounces=1, world_light="CONSTANT")
    theirs, ours = pair.colors()
    ball = pair.cycles["Depth"] < 1e9
    assert np.ptp(theirs[ball, 0]) > 0.1
    assert (np.abs(theirs - ours).max(-1)[ball] > 1e-3).mean() < 0.01


def under_a_sky(offset, make):
    scene = cycles.empty_scene(48, 48)
    build.add_camera(scene, (3.6, -4.8, 2.6), (0, 0, 0), lens=70)
    cycles.set_world(scene, (1.0, 1.0, 1.0))
    ball = build.ball(8, 6, True, make())
    thing = build.add(scene, "Ball", ball, build.moved(0, 0, 0, 1.2, 1.2, 1.2))
    set_offset(thing, "shading", offset)
    return scene


@pytest.mark.parametrize("kind", ["matt", "metal"])
def test_shading_offset_of_a_constant_world(kind):
    """How much less of it is given back, on the average: metal shows it aslant."""
    paint = {
        "matt": lambda: build.lambert((0.8, 0.8, 0.8)),
        "metal": lambda: build.metal(0.5, (0.8, 0.8, 0.8)),
    }[kind]
    theirs, ours = [], []
    for offset in (0.0, 0.5):
        scene = under_a_sky(offset, paint)
        film = render_glint(scene, "NATIVE", world_light="CONSTANT")
        reference = cycles.render_cycles(scene, 256, bounces=1)
        seen = reference["Depth"] < 1e9
        theirs.append(reference["Combined"][seen, 0].mean())
        ours.append(film.passes["Combined"][seen, 0].mean())
    assert theirs[1] / theirs[0] < 0.65
    assert ours[1] / ours[0] == pytest.approx(theirs[1] / theirs[0], rel=0.02)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.8])
def test_shading_offset_of_metal_aslant(backend, roughness):
    """What it leaves of a constant world, by how aslant metal is seen: it mirrors light that stands
    as low.
    """
    eye = np.array([36.0, -48.0, 26.0])
    theirs, ours = [], []
    for offset in (0.0, 0.5):
        scene = cycles.empty_scene(40, 40)
        build.add_camera(scene, tuple(eye), (0, 0, 0), lens=700)
        cycles.set_world(scene, (1.0, 1.0, 1.0))
        ball = build.ball(48, 32, True, build.metal(roughness, (0.8, 0.8, 0.8)))
        thing = build.add(scene, "Ball", ball, build.moved(0, 0, 0, 1.2, 1.2, 1.2))
        set_offset(thing, "shading", offset)
        film = render_glint(scene, backend, world_light="CONSTANT")
        reference = cycles.render_cycles(scene, 128, bounces=1)
        theirs.append(reference["Combined"][..., 0])
        ours.append(film.passes["Combined"][..., 0])
    place = np.nan_to_num(reference["Position"], posinf=0, neginf=0)
    cosine = place @ eye / np.linalg.norm(eye) / 1.2
    bins = [(cosine > low) & (cosine <= low + 0.2) for low in (0.3, 0.5, 0.7, 0.85)]
    left, found = (
        np.array([low[some].mean() / full[some].mean() for some in bins])
        for full, low in (theirs, ours)
    )
    assert np.ptp(left) > (0.5 if roughness < 0.4 else 0.04)
    np.testing.assert_allclose(found, left, atol=0.04)


def test_shading_offset_of_what_is_thrown_on():
    """A ball lights the floor round it by less."""
    theirs, ours = [], []
    for offset in (0.0, 0.5):
        scene = cycles.empty_scene(48, 48)
        build.add_camera(scene, (4.2, -5.6, 2.4), (0, 0, 0.8))
        build.add_light(scene, "SUN", (3, -2, 5), energy=3.0)
        build.add(scene, "Floor", build.plane(5.0, build.lambert((0.8, 0.8, 0.8))))
        ball = build.ball(8, 6, True, build.lambert((0.8, 0.8, 0.8)))
        thing = build.add(scene, "Ball", ball, build.moved(0, 0, 1.2, 1.2, 1.2, 1.2))
        set_offset(thing, "shading", offset)
        film = render_glint(
            scene, "NATIVE", samples=64, light_samples=4, diffuse_bounces=2, soft_light="DEALT"
        )
        cycles.make_exact(scene, 256, 0, 2)
        scene.cycles.diffuse_bounces = 2
        reference = cycles.render_passes(scene)
        place = reference["Position"]
        near = (np.abs(place[..., 2]) < 1e-3) & (np.abs(place[..., :2]).max(-1) < 1.3)
        theirs.append(reference["Combined"][near, :3].mean())
        ours.append(film.passes["Combined"][near, :3].mean())
    assert theirs[1] / theirs[0] < 0.96
    assert ours[1] / ours[0] == pytest.approx(theirs[1] / theirs[0], abs=0.015)


@pytest.mark.parametrize("backend", BACKENDS)
def test_geometry_offset_of_a_face_that_bends_on_one_side(backend):
    """The tangent plane of its first corner is the face itself: half of a parabola lifts it."""
    scene = cycles.empty_scene(32, 32)
    build.add_camera(scene, (0, 0, 4), (0, 0.001, 0), lens=60)
    build.add_light(scene, "SUN", (-1.0, 0.0, -0.2), energy=2.0, use_shadow=True)
    turn = np.arange(3) * 2 * np.pi / 3
    rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1)
    leaning = np.array([0, 0, 0.6]) + 0.8 * rim * [[0], [1], [1]]
    faces = build.mesh("face", rim.tolist(), [(0, 1, 2)], True, build.lambert((0.6, 0.6, 0.6)))
    faces.normals_split_custom_set(leaning.tolist())
    build.add(scene, "Face", faces, build.moved(0, 0, 0, 1, 1, 1))
    pair = render_pair(scene, backend, "terminator-bent")
    assert wrong(pair, 1e-3).sum() == 0
