"""A dozen and more small scenes that together use every feature of the engine; plain values,
nothing random that is not seeded.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from glint.engine import scene as s

SCENES: dict[str, Callable[[], s.Scene]] = {}
"""name -> function that makes the scene."""


def scene(function: Callable[[], s.Scene]) -> Callable[[], s.Scene]:
    """Lists a scene under its function's name."""
    SCENES[function.__name__] = function
    return function


def look_at(eye, target, up=(0.0, 0.0, 1.0)) -> np.ndarray:
    """(3, 4) world_from_frame with -z from eye towards target."""
    e = np.asarray(eye, float)
    w = e - np.asarray(target, float)
    w /= np.linalg.norm(w)
    u = np.cross(up, w)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(w, u), w, e], 1)


def camera(
    eye=(2.1, -4.3, 2.7),
    target=(0.0, 0.0, 0.4),
    half=0.42,
    size=(64, 48),
    kind="PERSPECTIVE",
    shift=(0.0, 0.0),
    **more,
) -> s.Camera:
    half_y = half * size[1] / size[0]
    window = (-half + shift[0], half + shift[0], -half_y + shift[1], half_y + shift[1])
    return s.Camera(kind, look_at(eye, target), window, size, **more)


def at(position=(0.0, 0.0, 0.0), linear=1.0) -> np.ndarray:
    """(1, 3, 4) world_from_object from a translation and a 3x3 matrix or a scale."""
    matrix = np.zeros((1, 3, 4))
    matrix[0, :, :3] = linear * np.eye(3) if np.isscalar(linear) else linear
    matrix[0, :, 3] = position
    return matrix


def constant(*rgb: float) -> tuple[s.Input, ...]:
    return (s.Input(value=rgb if len(rgb) == 3 else rgb * 3),)


def surface(
    name="surface", diffuse=0.8, ambient=None, specular=None, exponent=40.0, lobes=(), index=0
) -> s.Material:
    """Diffuse with optional ambient, highlight and further lobes."""
    terms = [s.Lobe("DIFFUSE", constant(*np.atleast_1d(diffuse)))]
    if ambient is not None:
        terms.append(s.Lobe("AMBIENT", constant(ambient)))
    if specular is not None:
        terms.append(s.Lobe("SPECULAR", constant(specular), exponent=exponent))
    return s.Material(name, (*terms, *lobes), index)


def grid_mesh(cells=1, extent=3.0, height=lambda x, y: 0 * x, smooth=False, name="grid") -> s.Mesh:
    """A square grid over [-extent, extent]² with the UV map "UVMap" over the unit square."""
    x, y = np.meshgrid(*[np.linspace(-extent, extent, cells + 1)] * 2)
    vertices = np.stack([x, y, height(x, y)], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1, 1)
    quads = corner + np.array([0, 1, cells + 2, cells + 1])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)
    uv = s.Attribute(
        "UVMap", s.POINT, ((vertices[:, :2] + extent) / (2 * extent)).astype(np.float32)
    )
    normals = (
        s.Attribute("normals", s.POINT, vertex_normals(vertices, triangles)) if smooth else None
    )
    return s.Mesh(name, vertices, triangles, normals=normals, attributes=(uv,))


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(v, 3) float32 unit normals, the area-weighted mean of the faces round each vertex."""
    a, b, c = (vertices[triangles[:, k]].astype(float) for k in range(3))
    face = np.cross(b - a, c - a)
    total = np.zeros((len(vertices), 3))
    for k in range(3):
        np.add.at(total, triangles[:, k], face)
    return (total / np.linalg.norm(total, axis=1, keepdims=True)).astype(np.float32)


def box_mesh(name="box") -> s.Mesh:
    """The cube [-1, 1]³, 12 triangles, flat."""
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([t for q in quads for t in (q[:3], [q[0], q[2], q[3]])], np.uint32)
    return s.Mesh(name, vertices, triangles)


def ball_mesh(rings=12, smooth=True, name="ball") -> s.Mesh:
    """A unit sphere of triangles."""
    theta, phi = np.linspace(0, np.pi, rings + 1)[1:-1], np.arange(2 * rings) * np.pi / rings
    circle = [
        np.outer(np.sin(theta), np.cos(phi)),
        np.outer(np.sin(theta), np.sin(phi)),
        np.outer(np.cos(theta), np.ones_like(phi)),
    ]
    ring = np.stack(circle, -1)
    vertices = np.concatenate([[[0, 0, 1]], ring.reshape(-1, 3), [[0, 0, -1]]]).astype(np.float32)
    n, last, triangles = 2 * rings, len(vertices) - 1, []
    for k in range(n):
        m = (k + 1) % n
        triangles += [[0, 1 + k, 1 + m], [last, last - n + m, last - n + k]]
        for r in range(rings - 2):
            a, b = 1 + r * n, 1 + (r + 1) * n
            triangles += [[a + k, b + k, b + m], [a + k, b + m, a + m]]
    normals = (
        s.Attribute("normals", s.POINT, vertices / np.linalg.norm(vertices, axis=1, keepdims=True))
        if smooth
        else None
    )
    return s.Mesh(name, vertices, np.array(triangles, np.uint32), normals=normals)


def light(kind, eye=(1.7, -2.2, 4.1), target=(0.0, 0.0, 0.3), strength=400.0, **more) -> s.Light:
    return s.Light(kind.lower(), kind, look_at(eye, target), strength=strength, **more)


def checker(size=8, encoding="SRGB", extension="REPEAT", interpolation="LINEAR") -> s.Texture:
    """Coloured squares with a gradient in alpha."""
    i, j = np.mgrid[:size, :size]
    pixels = np.zeros((size, size, 4), np.uint8)
    pixels[..., 0] = 255 * ((i + j) % 2)
    pixels[..., 1] = 30 * i
    pixels[..., 2] = 200 - 20 * j
    pixels[..., 3] = (255 * i) // (size - 1)
    return s.Texture("checker", pixels, encoding, extension, interpolation)


FLOOR = s.Instances("floor", 0, at(), (0,), object_index=1)
GREY_WORLD = s.World(ambient=(0.05, 0.07, 0.1), background=(0.2, 0.3, 0.5))


def stage(*geometries, instances=(), materials=(), lights=(), **more) -> s.Scene:
    """A floor (geometry 0, material 0) and whatever stands on it."""
    more.setdefault("camera", camera())
    more.setdefault("world", GREY_WORLD)
    return s.Scene(
        geometries=(grid_mesh(4), *geometries),
        instances=(FLOOR, *instances),
        materials=(surface("floor", (0.6, 0.55, 0.5), ambient=0.6), *materials),
        lights=lights or (light("SUN", strength=3.0),),
        **more,
    )


@scene
def flat_and_smooth() -> s.Scene:
    """Flat and smooth meshes under a sun: interpolated normals, lifted shadow starts."""
    placed = (
        s.Instances("ball", 1, at((-0.8, 0, 0.9), 0.9), (1,), object_index=2),
        s.Instances("facets", 2, at((1.1, 0.3, 0.8), 0.8), (1,)),
    )
    return stage(
        ball_mesh(),
        ball_mesh(6, smooth=False),
        instances=placed,
        materials=(surface(ambient=0.5, specular=0.4),),
    )


@scene
def hard_lights() -> s.Scene:
    """Point, sun and spot without extent, one of them throwing no shadow."""
    lights = (
        light("POINT", (1.5, -1.9, 2.2), color=(1, 0.7, 0.5)),
        light("SUN", (-2, -1, 3), strength=1.5, cast_shadow=False),
        light("SPOT", (0.4, -2.4, 3.1), spot_size=0.6, spot_blend=0.35, strength=900),
    )
    placed = (s.Instances("box", 1, at((0.1, 0.2, 0.6), 0.55), (1,)),)
    return stage(
        box_mesh(),
        instances=placed,
        materials=(surface(specular=0.3, exponent=120),),
        lights=lights,
    )


@scene
def soft_lights() -> s.Scene:
    """Every soft light, shapes seen by the camera and by a mirror."""
    seen = {"visible_camera": True, "visible_mirror": True, "visible_transmission": True}
    lights = (
        light("POINT", (1.5, 0.9, 1.9), radius=0.3, strength=200, **seen),
        light("POINT", (-1.6, -1.2, 2.3), radius=0.25, soft_falloff=True, strength=150),
        light("SPOT", (0.4, -2.4, 3.1), radius=0.1, spot_size=0.9, spot_blend=0.5, strength=300),
        light("SUN", (-2, -1, 3), strength=1.0, angle=0.2),
        light("AREA", (-1.5, 1.8, 2.4), size_x=1.2, size_y=0.5, strength=120, **seen),
        light("AREA", (2.5, -0.2, 1.4), shape="ELLIPSE", size_x=0.6, size_y=0.9, strength=60),
    )
    mirror = surface("mirror", 0.1, lobes=(s.Lobe("MIRROR", constant(0.8)),))
    placed = (s.Instances("ball", 1, at((0.1, 0.2, 0.7), 0.7), (1,)),)
    return stage(ball_mesh(), instances=placed, materials=(mirror,), lights=lights)


@scene
def mirrors() -> s.Scene:
    """Two mirrors that see each other, and a coarse smooth one whose reflections meet its own
    surface.
    """
    metal = s.Material("metal", (s.Lobe("MIRROR", constant(0.9, 0.8, 0.6)),), 3)
    wall = np.array([[0.2, 0, -1], [0, 1, 0], [1, 0, 0.2]])
    placed = (
        s.Instances("left", 1, at((-1.6, 0.3, 1.0), wall * 0.35), (1,)),
        s.Instances("right", 1, at((1.9, 0.6, 1.0), wall * 0.35), (1,)),
        s.Instances("ball", 2, at((0, 0, 0.6), 0.6), (1,)),
    )
    return stage(grid_mesh(), ball_mesh(7), instances=placed, materials=(metal,))


@scene
def glass() -> s.Scene:
    """A refracting true sphere and a box, with Fresnel reflection and total reflection inside.

    The box floats a little: were its lower face in the floor's plane, rounding would say which of
    the two a ray inside meets first.
    """
    lobes = (
        s.Lobe("REFRACTION", constant(0.9, 1, 0.95), ior=1.5, fresnel=True),
        s.Lobe("MIRROR", constant(1.0), ior=1.5, fresnel=True),
    )
    spheres = s.Spheres(
        "drops", np.array([[-0.7, 0, 0.7]], np.float32), np.array([0.7], np.float32)
    )
    placed = (
        s.Instances("drops", 1, at(), (1,)),
        s.Instances("box", 2, at((0.9, 0.3, 0.52), 0.5), (1,)),
    )
    return stage(spheres, box_mesh(), instances=placed, materials=(s.Material("glass", lobes),))


@scene
def alpha() -> s.Scene:
    """Cut-out and coloured transparency, transparent shadows, film transparent."""
    by_alpha = s.Input(texture=0, channel="ALPHA")
    seen_through = s.Input(texture=0, channel="ALPHA", complement=True)
    leaf = s.Material(
        "leaf",
        (s.Lobe("DIFFUSE", (s.Input(texture=0), by_alpha)), s.Lobe("TRANSPARENT", (seen_through,))),
    )
    foil = s.Material("foil", (s.Lobe("TRANSPARENT", constant(0.9, 0.5, 0.3)),))
    upright = np.array([[1, 0, 0], [0, 0.2, -1], [0, 1, 0.2]]) * 0.3
    placed = (
        s.Instances("leaf", 1, at((-0.7, 0, 0.9), upright), (1,)),
        s.Instances("foil", 1, at((0.9, -0.2, 0.9), upright), (2,)),
        s.Instances("behind", 1, at((0.2, 0.9, 0.9), upright), (1,)),
    )
    world = s.World(ambient=(0.1,) * 3, background=(0.3, 0.2, 0.1), transparent=True)
    return stage(
        grid_mesh(), instances=placed, materials=(leaf, foil), textures=(checker(),), world=world
    )


def _textured(**texture) -> s.Scene:
    transform = ((2.3, 0.4, -0.31), (-0.2, 1.7, 0.23))
    picture = s.Material(
        "picture",
        (s.Lobe("DIFFUSE", (s.Input((0.9, 0.8, 1.0), 0, uv="UVMap", uv_transform=transform),)),),
    )
    base = stage(textures=(checker(**texture),))
    return s.Scene(**{**base.__dict__, "materials": (picture,)})


@scene
def texture_repeat() -> s.Scene:
    return _textured()


@scene
def texture_mirror_closest() -> s.Scene:
    return _textured(extension="MIRROR", interpolation="CLOSEST")


@scene
def texture_clip() -> s.Scene:
    return _textured(extension="CLIP", encoding="LINEAR")


@scene
def texture_extend() -> s.Scene:
    return _textured(extension="EXTEND")


@scene
def attributes() -> s.Scene:
    """Colours on corners and faces, several materials in one mesh, a map the mesh lacks."""
    box = box_mesh()
    n = len(box.triangles)
    generator = np.random.default_rng(7)
    corner = s.Attribute("corner", s.CORNER, generator.random((3 * n, 4), np.float32))
    face = s.Attribute("face", s.FACE, generator.random((n, 4), np.float32))
    corners = np.arange(3 * n, dtype=np.uint32).reshape(n, 3)
    slots = (np.arange(n) % 3).astype(np.uint16)
    mesh = s.Mesh("box", box.vertices, box.triangles, corners, slots, None, (corner, face))
    painted = [
        s.Material(
            a,
            (
                s.Lobe("DIFFUSE", (s.Input(attribute=a),)),
                s.Lobe("AMBIENT", (s.Input(attribute=a),)),
            ),
            k,
        )
        for k, a in enumerate(("corner", "face", "missing"), 4)
    ]
    return stage(
        mesh,
        instances=(s.Instances("box", 1, at((0, 0, 0.9), 0.8), (1, 2, 3)),),
        materials=tuple(painted),
    )


@scene
def odd_matrices() -> s.Scene:
    """Mirrored, sheared, stretched, flattened and many: one mesh, seven placements."""
    linear = np.stack(
        [
            np.diag([0.3, 0.3, -0.3]),
            np.diag([0.1, 0.5, 0.3]),
            np.array([[0.3, 0.2, 0], [0, 0.3, 0.1], [0.1, 0, 0.3]]),
            np.diag([0.3, 0.3, 0.0]),
            np.diag([-0.2, -0.3, -0.4]),
            np.diag([0.3, 1e-6, 0.3]),
            0.3 * np.eye(3),
        ]
    )
    matrices = np.concatenate([linear, np.zeros((7, 3, 1))], 2)
    matrices[:, 0, 3] = [-1.8, -1.1, -0.4, 0.3, 1.0, 1.6, 0.2]
    matrices[:, 1, 3] = [0, 0.1, 0, 0, 0.1, 0.4, -1.2]
    matrices[:, 2, 3] = [0.6, 0.6, 0.6, 0.9, 0.6, 0.7, 0.4]
    placed = s.Instances("many", 1, matrices, (1,), object_index=5)
    return stage(
        ball_mesh(8),
        instances=(placed,),
        materials=(surface(ambient=0.3, specular=0.5, exponent=25),),
    )


@scene
def round_and_plane() -> s.Scene:
    """True spheres, some of them squashed by their matrix, and a concave polygon."""
    centers = np.array([[-1, 0, 0.5], [0, 0.7, 0.4], [0.3, -0.9, 0.25]], np.float32)
    spheres = s.Spheres("drops", centers, np.array([0.5, 0.4, 0.25], np.float32))
    angle, radius = np.arange(10) * np.pi / 5, np.where(np.arange(10) % 2, 0.8, 0.35)
    star = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], -1).astype(
        np.float32
    )
    polygons = s.Polygons(
        "star", star, np.array([0, 10], np.uint32), np.arange(10, dtype=np.uint32)
    )
    upright = np.array([[1, 0, 0], [0, 0.1, -1], [0, 1, 0.1]])
    placed = (
        s.Instances("drops", 1, at(), (1,)),
        s.Instances("squashed", 1, at((1.2, 0.3, 0.1), np.diag([0.5, 0.8, 1.4])), (1,)),
        s.Instances("star", 2, at((0.8, 0.9, 0.9), upright), (1,)),
    )
    return stage(
        spheres,
        polygons,
        instances=placed,
        materials=(surface(ambient=0.4, specular=0.6, exponent=60),),
    )


@scene
def strands() -> s.Scene:
    """Hair: a bent chain that tapers and dims what lies behind it, coloured along the
    way, seen in a mirror too, and a field of straight ones that is placed twice, once sheared. Thin
    ones in mirrors turn with the last bits of where the rays leave these.
    """
    turn = np.linspace(0, 5, 24)
    helix = np.stack([np.cos(turn), np.sin(turn), 0.4 * turn], 1).astype(np.float32)
    colors = (0.6 + 0.4 * np.sin(turn[:, None] + np.arange(4))).astype(np.float32)
    chain = s.Strands(
        "helix",
        helix,
        np.linspace(0.4, 0.3, 24, dtype=np.float32),
        np.arange(23, dtype=np.uint32),
        attributes=(
            s.Attribute("Col", s.POINT, colors),
            s.Attribute("Each", s.FACE, np.linspace(0.2, 1, 46, dtype=np.float32).reshape(23, 2)),
        ),
    )
    roots = np.random.default_rng(6).uniform(-1, 1, (60, 3)) * (1.2, 1.2, 0)
    tips = roots + np.random.default_rng(7).normal(0, 0.3, (60, 3)) + (0, 0, 0.8)
    field = s.Strands(
        "field",
        np.stack([roots, tips], 1).reshape(-1, 3).astype(np.float32),
        np.tile(np.array([0.1, 0.04], np.float32), 60),
        2 * np.arange(60, dtype=np.uint32),
        np.arange(60, dtype=np.uint16) % 2,
    )
    sheared = np.array([[1.2, 0.5, 0.0], [0.0, 0.6, 0.2], [0.0, 0.1, 1.4]])
    colored = s.Material(
        "colored",
        (
            s.Lobe("DIFFUSE", (s.Input(attribute="Col"),)),
            s.Lobe("AMBIENT", constant(0.5)),
            s.Lobe("TRANSPARENT", (s.Input((0.3, 0.3, 0.3), attribute="Col"),)),
        ),
    )
    mirror = grid_mesh(extent=1.5, name="mirror")
    upright = np.array([[1.0, 0, 0], [0, -0.5, -1.0], [0, 1.0, -0.5]])
    return stage(
        mirror,
        chain,
        field,
        instances=(
            s.Instances("mirror", 1, at((0, 2.2, 1.2), upright), (1,)),
            s.Instances("helix", 2, at((-1.0, 0.2, 0.4), 0.9), (2,)),
            s.Instances("near", 3, at((0.6, -1.2, 0.0), 0.7), (3, 4), visible_mirror=False),
            s.Instances("far", 3, at((0.9, 0.8, 0.0), 0.6 * sheared), (3,), visible_mirror=False),
        ),
        materials=(
            surface("mirror", (0.1, 0.1, 0.15), lobes=(s.Lobe("MIRROR", constant(0.7)),)),
            colored,
            surface("gold", (0.8, 0.6, 0.2), specular=0.4, exponent=30),
            surface("red", (0.8, 0.1, 0.1)),
        ),
        lights=(
            light("SUN", (1.7, -2.2, 4.1), strength=3.0, angle=0.05),
            light("SUN", (3, 1, 4), strength=1.0),
        ),
    )


@scene
def who_sees_what() -> s.Scene:
    """Visibility flags, a holdout, and a mirror that sees what the camera does not."""
    mirror = s.Material("mirror", (s.Lobe("MIRROR", constant(0.9)),))
    ball = {"geometry": 1, "materials": (1,)}
    placed = (
        s.Instances(
            "no camera", world_from_object=at((-0.9, -0.4, 0.4), 0.4), visible_camera=False, **ball
        ),
        s.Instances(
            "no mirror", world_from_object=at((0, -0.5, 0.4), 0.4), visible_mirror=False, **ball
        ),
        s.Instances(
            "no shadow", world_from_object=at((0.9, -0.4, 0.4), 0.4), visible_shadow=False, **ball
        ),
        s.Instances("hole", world_from_object=at((1.7, 0.5, 0.4), 0.4), holdout=True, **ball),
        s.Instances(
            "back",
            2,
            at((0, 1.2, 0.9), np.array([[1, 0, 0], [0, 0.1, -1], [0, 1, 0.1]]) * 0.5),
            (2,),
        ),
    )
    return stage(
        ball_mesh(), grid_mesh(), instances=placed, materials=(surface(ambient=0.5), mirror)
    )


@scene
def parallel_oblique() -> s.Scene:
    """A shifted parallel camera with clip planes that cut the box."""
    view = camera(half=2.2, kind="ORTHOGRAPHIC", shift=(0.3, -0.2), clip_start=3.6, clip_end=7.5)
    return stage(
        box_mesh(),
        instances=(s.Instances("box", 1, at((0, 0, 0.7), 0.7), (1,)),),
        materials=(surface(ambient=0.4),),
        camera=view,
    )


@scene
def far_and_emitting() -> s.Scene:
    """Everything a hundred kilometres away, with emission and a shifted perspective."""
    far = np.array([1e5, -2e5, 3e4])
    glow = surface("glow", 0.2, lobes=(s.Lobe("EMISSION", constant(0.3, 0.6, 1.5)),), index=9)
    floor = s.Instances("floor", 0, at(far), (0,))
    ball = s.Instances("ball", 1, at(far + [0, 0, 0.9], 0.8), (1,))
    return s.Scene(
        camera(far + [2.1, -4.3, 2.7], far + [0, 0, 0.4], shift=(0.15, -0.1)),
        (grid_mesh(4), ball_mesh()),
        (floor, ball),
        (surface(ambient=0.5), glow),
        (),
        (light("POINT", far + [1.7, -2.2, 4.1], far),),
        GREY_WORLD,
    )


@scene
def clipped_lamps() -> s.Scene:
    """Visible lights in front of, between and behind the clip planes."""
    view = camera(clip_start=2.5, clip_end=6.5)
    seen = {"visible_camera": True, "radius": 0.25, "strength": 60}
    along = np.array([2.1, -4.3, 2.7]) - np.array([0, 0, 0.4])
    lights = tuple(
        light("POINT", np.array([0.3 * k - 0.6, 0, 0.4]) + share * along, **seen)
        for k, share in enumerate((0.7, 0.3, -0.1, -0.6))
    )
    return stage(camera=view, lights=lights)


def gloss() -> s.Scene:
    """Highlights with masking and Fresnel, and lobes that depend on the view, constant and
    textured, beside plain ones.
    """

    def shaped(k: tuple[s.Input, ...]) -> tuple[s.Lobe, ...]:
        return (
            s.Lobe("DIFFUSE", k),
            s.Lobe("DIFFUSE", (s.Input((-0.2, -0.1, -0.3)), *k), exponent=2.5),
            s.Lobe("AMBIENT", k, exponent=4.0),
            s.Lobe("SPECULAR", k, 30.0, masking=0.25),
            s.Lobe("SPECULAR", k, 30.0, masking=0.25, schlick=True),
            s.Lobe("SPECULAR", k, 5.0, ior=1.5, masking=0.25, fresnel=True),
        )

    materials = (
        s.Material("shaped", shaped(constant(0.8, 0.5, 0.3))),
        s.Material("textured", shaped((s.Input(texture=0),))),
        surface("plain", specular=0.5),
    )
    placed = tuple(
        s.Instances(m.name, 1, at((x, 0, 0.8), 0.6), (k,))
        for k, (m, x) in enumerate(zip(materials, (-1.2, 0.0, 1.2), strict=True), 1)
    )
    world = s.World(ambient=(0.3, 0.4, 0.5), background=(0.1, 0.2, 0.3))
    return stage(
        ball_mesh(), instances=placed, materials=materials, textures=(checker(),), world=world
    )
