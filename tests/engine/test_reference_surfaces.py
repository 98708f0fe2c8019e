"""The reference's surfaces: textures, attributes, materials, normals under odd matrices, spheres,
polygons, data passes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine_scenes import at, ball_mesh, camera, checker, constant, grid_mesh, look_at
from glint import engine
from glint.engine import scene as s
from glint.engine.evaluation.textures import Image
from glint.engine.reference.shapes import meet_ball
from test_reference_support import ROUNDING, color, floor, geometry_of, material, values

DOWN = s.Camera("ORTHOGRAPHIC", look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), (-1, 1, -1, 1), (8, 8))
GLOW = s.Lobe("EMISSION", constant(1.0))
FLOATS = st.floats(-3, 3)
LUMINANCE = np.array([[0.2126], [0.7152], [0.0722]])


def texel(texture: s.Texture, i: int, j: int) -> np.ndarray:
    """RGBA of column i, row j extended, as it is stored, from 0 to 1; one at a time, from the
    definition.
    """
    height, width = texture.pixels.shape[:2]
    if texture.extension == "CLIP" and not (0 <= i < width and 0 <= j < height):
        return np.zeros(4)
    place = []
    for k, size in ((i, width), (j, height)):
        if texture.extension == "REPEAT":
            place.append(k % size)
        elif texture.extension == "MIRROR":
            place.append(k % size if (k // size) % 2 == 0 else size - 1 - k % size)
        else:
            place.append(min(max(k, 0), size - 1))
    raw = texture.pixels[place[1], place[0]].astype(float)
    return raw / 255 if texture.pixels.dtype == np.uint8 else raw


@settings(max_examples=60, deadline=None)
@given(
    FLOATS,
    FLOATS,
    st.sampled_from(["REPEAT", "EXTEND", "CLIP", "MIRROR"]),
    st.sampled_from(["LINEAR", "CLOSEST"]),
    st.sampled_from(["SRGB", "LINEAR"]),
    st.booleans(),
)
def test_textures_read_as_defined(u, v, extension, interpolation, encoding, floats) -> None:
    texture = replace(
        checker(5), extension=extension, interpolation=interpolation, encoding=encoding
    )
    texture = replace(texture, pixels=np.ascontiguousarray(texture.pixels[:, :3]))
    if floats:
        texture = replace(texture, pixels=texture.pixels.astype(np.float32) / 7)
    x, y = u * 3, v * 5
    if interpolation == "CLOSEST":
        expected = texel(texture, int(np.floor(x)), int(np.floor(y)))
    else:
        i, j = int(np.floor(x - 0.5)), int(np.floor(y - 0.5))
        fx, fy = x - 0.5 - i, y - 0.5 - j
        corners = [(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy]
        expected = sum(w * texel(texture, i + k % 2, j + k // 2) for k, w in enumerate(corners))
    if encoding == "SRGB" and not floats:
        expected[:3] = [
            c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in expected[:3]
        ]
    assert np.allclose(
        Image(texture).read(np.array([u]), np.array([v]))[:, 0], expected, rtol=1e-13, atol=1e-15
    )


def seen(factor: s.Input, mesh: s.Mesh, textures=()) -> np.ndarray:
    """(8, 8, 3): the factor as emission on a mesh over [-1, 1]²."""
    scene = s.Scene(
        DOWN,
        (mesh,),
        (s.Instances("m", 0, at(), (0,)),),
        (material(s.Lobe("EMISSION", (factor,))),),
        tuple(textures),
    )
    return color(scene)


def uv_of_pixels() -> tuple[np.ndarray, np.ndarray]:
    k = (np.arange(8) + 0.5) / 8
    return np.meshgrid(k, k)


def test_channels_transform_complement_and_second_map() -> None:
    mesh, texture = grid_mesh(1, 1.0), checker(8)
    halved = s.Attribute("second", s.POINT, mesh.attributes[0].values / 2)
    mesh = replace(mesh, attributes=(mesh.attributes[0], halved))
    u, v = uv_of_pixels()

    def image(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return Image(texture).read(u.ravel(), v.ravel()).T.reshape(8, 8, 4)

    rgba = image(u, v)
    cases = [
        (s.Input(texture=0), rgba[..., :3]),
        (s.Input((0.5, 1.0, 2.0), texture=0), rgba[..., :3] * (0.5, 1.0, 2.0)),
        (s.Input(texture=0, channel="ALPHA"), rgba[..., 3:]),
        (s.Input(texture=0, channel="LUMINANCE"), rgba[..., :3] @ LUMINANCE),
        (s.Input(texture=0, complement=True), 1 - rgba[..., :3]),
        (
            s.Input((3.0, 3.0, 3.0), texture=0, offset=(-1.0, -1.2, 0.1), low=0.1, high=0.9),
            np.clip(rgba[..., :3] * 3 + (-1.0, -1.2, 0.1), 0.1, 0.9),
        ),
        (s.Input(texture=0, high=0.5, complement=True), 1 - np.minimum(rgba[..., :3], 0.5)),
        (s.Input(texture=0, uv="second"), image(u / 2, v / 2)[..., :3]),
        (
            s.Input(texture=0, uv="none such"),
            np.broadcast_to(Image(texture).read(np.zeros(1), np.zeros(1))[:3, 0], (8, 8, 3)),
        ),
        (
            s.Input(texture=0, uv_transform=((2, 0.5, 0.1), (-0.3, 1, 0.2))),
            image(2 * u + 0.5 * v + 0.1, -0.3 * u + v + 0.2)[..., :3],
        ),
    ]
    for factor, expected in cases:
        # UV maps are float32
        assert np.allclose(seen(factor, mesh, [texture]), expected, atol=1e-6), factor


def test_factors_multiply_and_lobes_add() -> None:
    lobes = (
        s.Lobe("EMISSION", constant(0.5) + constant(0.25)),
        s.Lobe("EMISSION", constant(0.1)),
        s.Lobe("EMISSION", ()),
    )
    assert np.allclose(color(floor(*lobes)), 0.125 + 0.1 + 1.0, rtol=ROUNDING)


def test_attributes_on_points_corners_and_faces() -> None:
    mesh, generator = grid_mesh(2, 1.0), np.random.default_rng(1)
    n = len(mesh.triangles)
    sizes = {s.POINT: len(mesh.vertices), s.CORNER: 3 * n, s.FACE: n}
    colors = [
        s.Attribute(domain, domain, generator.random((count, 4), np.float32))
        for domain, count in sizes.items()
    ]
    corners = np.arange(3 * n, dtype=np.uint32).reshape(n, 3)
    mesh = replace(mesh, attributes=(*mesh.attributes, *colors), corners=corners)
    k = (np.arange(8) + 0.5) / 4 - 1
    x, y = np.meshgrid(k, k)
    for attribute in colors:
        expected = np.zeros((8, 8, 4))
        for t, triangle in enumerate(mesh.triangles):
            a, b, c = mesh.vertices[triangle, :2].astype(float)
            beta, gamma = np.linalg.solve(
                np.stack([b - a, c - a], 1), np.stack([x.ravel(), y.ravel()]) - a[:, None]
            ).reshape(2, 8, 8)
            inside = (beta >= 0) & (gamma >= 0) & (beta + gamma <= 1)
            rows = {s.POINT: triangle, s.CORNER: corners[t], s.FACE: [t] * 3}[attribute.domain]
            weights = np.stack([1 - beta - gamma, beta, gamma], -1)
            mixed = weights @ attribute.values[rows].astype(float)
            expected[inside & ~expected.any(-1)] = mixed[inside & ~expected.any(-1)]
        assert np.allclose(
            seen(s.Input(attribute=attribute.name), mesh), expected[..., :3], rtol=1e-12
        )
        alpha = s.Input(attribute=attribute.name, attribute_channel="ALPHA", complement=True)
        assert np.allclose(seen(alpha, mesh), 1 - expected[..., 3:], rtol=1e-12)
        grey = s.Input(attribute=attribute.name, attribute_channel="LUMINANCE")
        assert np.allclose(seen(grey, mesh), expected[..., :3] @ LUMINANCE, rtol=1e-12)
    assert seen(s.Input(attribute="none such"), mesh).max() == 0


def test_slots_without_a_material() -> None:
    """Beyond the end the last slot; no material at all is white 0.8 with ambient 0.8."""
    mesh = replace(grid_mesh(1, 1.0), material_slots=np.array([0, 7], np.uint16))
    materials = tuple(
        s.Material(str(k), (s.Lobe("EMISSION", constant(v)),), k)
        for k, v in enumerate((1.0, 2.0), 1)
    )
    scene = s.Scene(
        DOWN,
        (mesh,),
        (s.Instances("m", 0, at(), (0, 1)),),
        materials,
        world=s.World(ambient=(0.5,) * 3),
    )
    found = values(scene)
    assert set(np.unique(found["Combined"][..., 0])) == {1.0, 2.0}
    assert set(np.unique(found["Material Index"])) == {1.0, 2.0}
    bare = replace(scene, instances=(s.Instances("m", 0, at(), ()),), materials=())
    assert np.allclose(color(bare), 0.4, rtol=1e-15)


SHEAR = np.array([[1, 0.5, 0], [0, 1, -0.4], [0.2, 0, 1]])
MATRICES = [np.eye(3), np.diag([1, 1, -1]), np.diag([0.3, 2, 1]), SHEAR, np.diag([-1, -2, -0.7])]


@pytest.mark.parametrize("matrix", MATRICES, ids=str)
def test_normals_under_odd_matrices(matrix: np.ndarray) -> None:
    """Flat: perpendicular to the face in the world. Smooth: (M⁻¹)ᵀ n (section 6.2). Both on the
    viewer's side, front or back.
    """
    mesh = ball_mesh(10)
    for smooth in (True, False):
        shape = mesh if smooth else replace(mesh, normals=None)
        view = camera((1.5, -6, 3), half=0.6, size=(24, 24))
        scene = s.Scene(
            view, (shape,), (s.Instances("m", 0, at((0, 0, 0), matrix), (0,)),), (material(GLOW),)
        )
        found = values(scene)
        hit = found["Depth"][..., 0] < 1e9
        normal, position = found["Normal"][hit], found["Position"][hit]
        assert np.allclose(np.linalg.norm(normal, axis=-1), 1, rtol=1e-14)
        flat = values(replace(scene, geometries=(replace(mesh, normals=None),)))["Normal"][hit]
        assert ((flat * (position - view.world_from_camera[:, 3])).sum(-1) <= 0).all()
        if smooth:
            radial = position @ np.linalg.inv(matrix).T @ np.linalg.inv(matrix)
            assert ((normal * radial).sum(-1) > 0.9 * np.linalg.norm(radial, axis=-1)).all()
        assert hit.any()


def test_interpolated_normals_exactly() -> None:
    """n = (M⁻¹)ᵀ (α n_a + β n_b + γ n_c), normalised, at the weights of section 2.7."""
    vertices = np.array([[-3, -3, 0], [3, -3, 0], [0, 4, 0]], np.float32)
    normals = np.array([[-0.6, 0, 0.8], [0.6, 0, 0.8], [0, 0.6, 0.8]], np.float32)
    mesh = s.Mesh(
        "t", vertices, np.array([[0, 1, 2]], np.uint32), normals=s.Attribute("n", s.POINT, normals)
    )
    matrix = np.array([[1, 0.3, 0], [0, 0.8, 0.1], [0.1, 0, 1.2]])
    scene = s.Scene(
        DOWN, (mesh,), (s.Instances("m", 0, at((0, 0, 0), matrix), (0,)),), (material(GLOW),)
    )
    found = values(scene)
    position = found["Position"].reshape(-1, 3)
    a, b, c = vertices.astype(float)
    local = position @ np.linalg.inv(matrix).T
    weights = np.linalg.lstsq(np.stack([b - a, c - a], 1), (local - a).T, rcond=None)[0]
    mixed = np.stack([1 - weights.sum(0), *weights], -1) @ normals.astype(float)
    expected = mixed @ np.linalg.inv(matrix)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    assert np.allclose(found["Normal"].reshape(-1, 3), expected, atol=1e-13)


def test_flattened_objects_are_lit_on_both_sides() -> None:
    sun = s.Light("sun", "SUN", look_at((0, 0, 9), (0, 0, 0), (0, 1, 0)), strength=np.pi)
    ball = s.Spheres("b", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    for shape, scales in ((ball_mesh(), (0.0, 1e-6)), (ball, (1e-6,))):
        for scale_z in scales:
            flat = (s.Instances("m", 0, at((0, 0, 0), np.diag([3, 3, scale_z])), (0,)),)
            for eye, expected in (((0, 0, 5), 0.5), ((0, 0, -5), 0.0)):
                view = replace(DOWN, world_from_camera=look_at(eye, (0, 0, 0), (0, 1, 0)))
                scene = s.Scene(
                    view, (shape,), flat, (material(s.Lobe("DIFFUSE", constant(0.5))),), (), (sun,)
                )
                assert np.allclose(color(scene), expected, atol=1e-5)


def test_squeezed_and_broken_things_are_left_out_and_named() -> None:
    mesh = grid_mesh(1, 1.0)
    broken = replace(
        mesh,
        name="broken",
        vertices=np.where(np.arange(4)[:, None] == 1, np.nan, mesh.vertices).astype(np.float32),
    )
    line = s.Instances("line", 0, at((0, 0, 1), np.diag([1, 0, 0])), (0,))
    scene = s.Scene(
        DOWN,
        (mesh, broken),
        (line, s.Instances("half", 1, at(), (0,))),
        (material(GLOW),),
        world=s.World(),
    )
    film = engine.render(scene, engine.Settings(samples=1, backend="NUMPY"))
    assert np.isfinite(film.combined).all()
    assert 0 < (film.combined[..., 0] > 0).mean() < 1
    assert [note.split(":")[0] for note in film.notes] == ["'line'", "'half'"]


def test_true_spheres_exactly() -> None:
    """Depth, position and normal of the quadratic's nearer root, under a matrix that makes it an
    ellipsoid.
    """
    matrix = np.array([[0.9, 0.3, 0], [0, 0.5, 0.1], [0.2, 0, 0.7]])
    ball = s.Spheres("b", np.array([[0.1, -0.2, 0.3]], np.float32), np.array([0.8], np.float32))
    scene = s.Scene(
        DOWN, (ball,), (s.Instances("b", 0, at((0.1, 0, 0), matrix), (0,)),), (material(GLOW),)
    )
    found = values(scene)
    hit = found["Depth"][..., 0] < 1e9
    assert 5 < hit.sum() < 60
    inverse = np.linalg.inv(matrix)
    local = (found["Position"][hit] - [0.1, 0, 0]) @ inverse.T - ball.centers[0].astype(float)
    assert np.allclose(np.linalg.norm(local, axis=-1), np.float64(ball.radii[0]), rtol=1e-13)
    normal = local @ inverse
    assert np.allclose(
        found["Normal"][hit], normal / np.linalg.norm(normal, axis=-1, keepdims=True), atol=1e-12
    )
    assert (found["Normal"][hit][:, 2] > 0).all()


def test_far_spheres_keep_their_outline() -> None:
    """At distance / radius 1e8: inside is where the ray passes nearer than the radius, all pixels
    (Haines' form; b² − ac errs by 1).
    """
    ball = s.Spheres("b", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    view = s.Camera(
        "PERSPECTIVE",
        look_at((0, -1e8, 0), (0, 0, 0)),
        (-1.1e-8, 1.1e-8, -1.1e-8, 1.1e-8),
        (64, 64),
    )
    found = values(s.Scene(view, (ball,), (s.Instances("b", 0, at(), (0,)),), (material(GLOW),)))
    k = ((np.arange(64) + 0.5) / 32 - 1) * 1.1e-8
    u, v = np.meshgrid(k, k)
    miss = 1e8 * np.sqrt((u * u + v * v) / (1 + u * u + v * v))
    assert np.array_equal(found["Depth"][..., 0] < 1e9, miss < 1)


def test_a_ray_from_the_sphere_itself_has_both_roots() -> None:
    balls = geometry_of(s.Spheres("b", np.zeros((1, 3), np.float32), np.ones(1, np.float32))).balls
    o, d = np.array([[0.0], [0.0], [1.0]]), np.array([[0.0], [0.0], [-1.0]])
    assert np.allclose(meet_ball(balls, np.zeros(1, np.intp), o, d)[:, 0], [0, 2], rtol=1e-15)


def test_polygons_by_the_odd_even_rule() -> None:
    """A ring with a bridge: the hole is outside; a star drawn in one stroke is hollow in the
    middle. Crossings are counted downwards.
    """
    outer = [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9), (-0.9, -0.9)]
    ring = outer + [(-0.4, -0.4), (-0.4, 0.4), (0.4, 0.4), (0.4, -0.4), (-0.4, -0.4)]
    star = [(np.sin(4 * np.pi * k / 5), np.cos(4 * np.pi * k / 5)) for k in range(5)]
    x, y = (k * 2 - 1 for k in uv_of_pixels())
    for outline in (ring, star):
        vertices = np.array([(*p, 0.2) for p in outline], np.float32)
        polygon = s.Polygons(
            "p",
            vertices,
            np.array([0, len(outline)], np.uint32),
            np.arange(len(outline), dtype=np.uint32),
        )
        found = values(
            s.Scene(DOWN, (polygon,), (s.Instances("p", 0, at(), (0,)),), (material(GLOW),))
        )
        lit = found["Combined"][..., 0] > 0
        odd = np.zeros_like(lit)
        for (ax, ay), (bx, by) in zip(outline, outline[1:] + outline[:1], strict=True):
            if ax != bx:
                odd ^= ((ax > x) != (bx > x)) & (ay + (x - ax) / (bx - ax) * (by - ay) < y)
        assert np.array_equal(lit, odd)
        assert not lit[3:5, 3:5].any()
        assert lit.any()
        assert np.allclose(found["Position"][lit][:, 2], np.float64(np.float32(0.2)), rtol=1e-15)


def test_data_passes() -> None:
    mesh = grid_mesh(1, 1.0)
    placed = (
        s.Instances("clear", 0, at((0, 0, 2)), (1,), object_index=3),
        s.Instances("m", 0, at((0, 0, 1)), (0,), object_index=7),
    )
    clear = s.Material("clear", (s.Lobe("TRANSPARENT", constant(0.9, 0.9, 0.1)),), 2)
    half = s.Camera(
        "ORTHOGRAPHIC", DOWN.world_from_camera * (2, 2, 2, 1), (-1, 1, -0.5, 0.5), (4, 2)
    )
    found = values(s.Scene(half, (mesh,), placed, (s.Material("m", (GLOW,), 5), clear)))
    assert np.array_equal(found["Object Index"][0, :, 0], [0, 7, 7, 0])
    assert np.array_equal(found["Material Index"][0, :, 0], [0, 5, 5, 0])
    # world units, though the camera is scaled by 2
    assert np.allclose(found["Depth"][0, :, 0], [1e10, 4, 4, 1e10])
    assert np.allclose(found["Position"][0, 1], [-0.5, -0.5, 1])
    assert np.allclose(found["UV"][0], [[0, 0, 0], [0.25, 0.25, 1], [0.75, 0.25, 1], [0, 0, 0]])
    opaque = replace(clear, lobes=(s.Lobe("TRANSPARENT", constant(0.9, 0.4, 0.1)),))
    found = values(s.Scene(half, (mesh,), placed, (s.Material("m", (GLOW,), 5), opaque)))
    assert np.array_equal(found["Object Index"][0, :, 0], [0, 3, 3, 0])
    bare = values(
        s.Scene(half, (replace(mesh, attributes=()),), placed[1:], (s.Material("m", (GLOW,), 5),))
    )
    assert not bare["UV"].any()


def test_holdout_and_flags() -> None:
    mesh, world = grid_mesh(1, 1.0), s.World(background=(0.5,) * 3)
    below = s.Instances("m", 0, at(), (0,))
    held = s.Scene(
        DOWN,
        (mesh,),
        (s.Instances("h", 0, at((1, 0, 1)), (0,), holdout=True), below),
        (material(GLOW),),
        world=world,
    )
    film = values(held)["Combined"]
    assert np.array_equal(film[0, :, 3], [1, 1, 1, 1, 0, 0, 0, 0])
    assert np.array_equal(film[0, :, 0], [1, 1, 1, 1, 0, 0, 0, 0])
    hidden = replace(held, instances=(replace(below, visible_camera=False),))
    assert np.allclose(values(hidden)["Environment"], 0.5)


def test_mirrors_see_what_their_flag_says_and_the_part_is_theirs() -> None:
    mirror = material(s.Lobe("MIRROR", constant(0.5)))
    lamp = s.Material("lamp", (GLOW,))
    for flags, expected in (
        ({"visible_camera": False}, 0.5),
        ({"visible_camera": False, "visible_mirror": False}, 0.1),
    ):
        placed = (
            s.Instances("floor", 0, at(), (0,)),
            s.Instances("lamp", 0, at((0, 0, 2)), (1,), **flags),
        )
        scene = s.Scene(
            DOWN,
            (grid_mesh(1, 4.0),),
            placed,
            (mirror, lamp),
            world=s.World(background=(0.2,) * 3, transparent=True),
        )
        found = values(scene)
        assert np.allclose(found["Mirror"], expected)
        assert np.array_equal(found["Combined"][..., :3], found["Mirror"])
        assert (found["Combined"][..., 3] == 1).all()


def test_the_surface_at_the_point_itself_casts_no_shadow_on_it() -> None:
    """Normals that lean inwards, as in a bowl: a light below the triangle's plane but above the
    shading normal's is not shadowed by it, but for rays that start lifted above it.
    """
    angle = np.arange(3) * 2 * np.pi / 3
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    leaning = s.Attribute("n", s.POINT, (np.array([0, 0, 0.6]) - 0.8 * rim).astype(np.float32))
    mesh = s.Mesh("bowl", rim.astype(np.float32), np.array([[0, 1, 2]], np.uint32), normals=leaning)
    sun = s.Light("sun", "SUN", look_at((-1, 0, -0.2), (0, 0, 0)))
    scene = s.Scene(
        DOWN,
        (mesh,),
        (s.Instances("b", 0, at(), (0,), geometry_offset=0.0),),
        (material(s.Lobe("DIFFUSE", constant(1.0))),),
        (),
        (sun,),
    )
    found = values(scene)
    assert found["Diffuse"].max() > 0
    assert not found["Shadow"].any()
    lifted = replace(scene, instances=(replace(scene.instances[0], geometry_offset=0.1),))
    assert values(lifted)["Shadow"].any()


def test_smooth_coarse_meshes_do_not_shadow_themselves() -> None:
    """Lifted starts: on a convex smooth ball under a sun nothing is taken away where n·l > 0, up
    to the grazing rim.
    """
    sun = s.Light("sun", "SUN", look_at((2, -1, 1), (0, 0, 0)), strength=3.0)
    view = camera((0.5, -4, 1.5), half=0.35, size=(48, 48))
    scene = s.Scene(
        view,
        (ball_mesh(5),),
        (s.Instances("b", 0, at(), (0,)),),
        (material(s.Lobe("DIFFUSE", constant(1.0))),),
        (),
        (sun,),
    )
    found = values(scene)
    shadowed = (found["Shadow"] < 0).any(-1) & (
        found["Diffuse"] > 0.1 * found["Diffuse"].max()
    ).any(-1)
    assert shadowed.sum() == 0
    assert (found["Diffuse"] > 0).any()
