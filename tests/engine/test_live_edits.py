"""Scenes that take over from the one before: whatever changed, exact pictures have the bits of a
render, the others show the same.
"""

import random
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Scene, Settings, available_backends, render
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.scene import (
    EVERYTHING,
    Attribute,
    Camera,
    Input,
    Instances,
    Light,
    Lobe,
    Material,
    Mesh,
    Spheres,
    World,
)

pytestmark = pytest.mark.skipif("NATIVE" not in available_backends(), reason="no core here")
SETTINGS = Settings(
    samples=2, threads=1, backend="NATIVE", passes=frozenset({"Depth", "Object Index", "Normal"})
)


def sheet(seed, rows=6):
    """A bumpy sheet of triangles in the unit square."""
    r = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, rows))
    vertices = np.stack([u, v, 0.2 * r.random(u.shape)], -1).reshape(-1, 3).astype(np.float32)
    k = np.arange(rows * rows).reshape(rows, rows)
    a, b, c, d = k[:-1, :-1].ravel(), k[:-1, 1:].ravel(), k[1:, 1:].ravel(), k[1:, :-1].ravel()
    return Mesh(
        f"Sheet {seed}",
        vertices,
        np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.uint32),
    )


def balls(seed):
    r = np.random.default_rng(seed)
    return Spheres(
        f"Balls {seed}", r.random((9, 3)).astype(np.float32), np.full(9, 0.1, np.float32)
    )


def matrix(r, flat=False):
    linear = np.linalg.qr(np.random.default_rng(r.randrange(1 << 30)).normal(size=(3, 3)))[
        0
    ] * r.uniform(0.5, 1.5)
    if flat:
        linear[:, 2] = 0
    return np.concatenate([linear, [[r.uniform(-2, 2)], [r.uniform(-2, 2)], [r.uniform(-2, 1)]]], 1)


def camera(x=0.0, size=(48, 36)):
    return Camera(
        "PERSPECTIVE",
        np.array([[1.0, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 6]]),
        (-0.5, 0.5, -0.375, 0.375),
        size,
        0.1,
        100.0,
    )


def first_scene(r):
    """Meshes and spheres that stand once, some several times, one flattened."""
    geometries = (*(sheet(k) for k in range(4)), balls(4), balls(5))
    once = [Instances(f"{g}", g, matrix(r)[None], (g % 2,), 10 + g) for g in (0, 1, 2, 4)]
    several = [
        Instances(f"many {g}", g, np.stack([matrix(r) for _ in range(3)]), (g % 2,), 10 + g)
        for g in (3, 5)
    ]
    materials = tuple(
        Material(f"{k}", (Lobe("DIFFUSE", (Input((0.5 + 0.3 * k, 0.5, 0.9)),)),)) for k in range(2)
    )
    lights = (
        Light("Sun", "SUN", np.eye(4)[:3], strength=2.0),
        Light("Point", "POINT", np.eye(4)[:3] + [[0, 0, 0, 2]] * 3, strength=150.0, radius=0.2),
    )
    return Scene(camera(), geometries, (*once, *several), materials, lights=lights)


def _with(values, k, value):
    return (*values[:k], value, *values[k + 1 :])


def move(scene, r):
    k = r.randrange(len(scene.instances))
    group = scene.instances[k]
    places = group.world_from_object.copy()
    places[r.randrange(len(places))] = matrix(r, flat=r.random() < 0.1)
    return replace(
        scene, instances=_with(scene.instances, k, replace(group, world_from_object=places))
    )


def move_back(scene, r):
    first = first_scene(random.Random(0)).instances
    k = r.randrange(len(scene.instances))
    names = {group.name: group for group in first}
    return replace(
        scene,
        instances=_with(scene.instances, k, names.get(scene.instances[k].name, scene.instances[k])),
    )


def edit(scene, r):
    k = r.randrange(len(scene.geometries))
    new = (
        sheet(r.randrange(1000))
        if isinstance(scene.geometries[k], Mesh)
        else balls(r.randrange(1000))
    )
    return replace(scene, geometries=_with(scene.geometries, k, new))


def add(scene, r):
    group = Instances("new", r.randrange(len(scene.geometries)), matrix(r)[None], (0,))
    k = r.randrange(len(scene.instances) + 1)
    return replace(scene, instances=(*scene.instances[:k], group, *scene.instances[k:]))


def add_geometry(scene, r):
    """In front of the others, whose numbers change."""
    shifted = tuple(replace(group, geometry=group.geometry + 1) for group in scene.instances)
    new = Instances("front", 0, matrix(r)[None], ())
    return replace(
        scene, geometries=(sheet(r.randrange(1000)), *scene.geometries), instances=(new, *shifted)
    )


def remove(scene, r):
    k = r.randrange(len(scene.instances))
    return (
        replace(scene, instances=(*scene.instances[:k], *scene.instances[k + 1 :]))
        if len(scene.instances) > 3
        else scene
    )


def hide(scene, r):
    k = r.randrange(len(scene.instances))
    kinds = ("shadow", "camera", "mirror", "diffuse", "media")
    group = scene.instances[k]
    flag = r.choice([*(f"visible_{kind}" for kind in kinds), "holdout", "catcher"])
    changed = replace(group, **{flag: not getattr(group, flag)})
    return replace(scene, instances=_with(scene.instances, k, changed))


def lamp(scene, r):
    return replace(
        scene, lights=_with(scene.lights, 1, replace(scene.lights[1], strength=r.uniform(0, 300)))
    )


def paint(scene, r):
    lobes = (Lobe("DIFFUSE", (Input((r.random(), r.random(), r.random())),)),)
    return replace(scene, materials=_with(scene.materials, 0, Material("0", lobes)))


def move_lamp(scene, r):
    k = r.randrange(2)
    lamp = replace(
        scene.lights[k],
        world_from_light=np.eye(4)[:3] + [[0, 0, 0, r.uniform(-3, 3)]] * 3,
        cast_shadow=r.random() < 0.8,
    )
    return replace(scene, lights=_with(scene.lights, k, lamp))


def surround(scene, r):
    return replace(scene, world=World((r.random(), 0.1, 0.1), (0.1, r.random(), 0.3)))


def smooth(scene, r):
    """The same vertices and triangles, other normals."""
    k = next(k for k, geometry in enumerate(scene.geometries) if isinstance(geometry, Mesh))
    mesh = scene.geometries[k]
    normals = (
        np.random.default_rng(r.randrange(1 << 30))
        .normal(size=mesh.vertices.shape)
        .astype(np.float32)
    )
    return replace(
        scene,
        geometries=_with(
            scene.geometries, k, replace(mesh, normals=Attribute("normal", "POINT", normals))
        ),
    )


def look(scene, r):
    return replace(scene, camera=camera(r.uniform(-1, 1) if r.random() < 0.7 else 200.0))


def link(scene, r):
    """Lights that light but some of the groups, or have shadows of some."""
    k, name = r.randrange(len(scene.lights)), r.choice(["receivers", "blockers"])
    light = replace(scene.lights[k], **{name: r.choice([EVERYTHING, 0b01, 0b10, 0b11])})
    groups = scene.instances
    if groups:
        n = r.randrange(len(groups))
        groups = _with(groups, n, replace(groups[n], light_set=r.randrange(3)))
    return replace(scene, lights=_with(scene.lights, k, light), instances=groups)


def light_less(scene, r):
    """Lamps that do not light some kind of lobe, or media."""
    k, name = r.randrange(len(scene.lights)), r.choice(["matt", "gloss", "media"])
    flag = {f"lights_{name}": not getattr(scene.lights[k], f"lights_{name}")}
    return replace(scene, lights=_with(scene.lights, k, replace(scene.lights[k], **flag)))


def shine(scene, r):
    """What glows, with a highlight."""
    glow = Lobe("EMISSION", (Input((r.random(), 0.3, 0.1)),))
    lobes = (Lobe("DIFFUSE"), Lobe("SPECULAR", exponent=20.0), *([glow] * r.randrange(2)))
    return replace(scene, materials=_with(scene.materials, 1, Material("1", lobes)))


EDITS = [
    move,
    move,
    move_back,
    edit,
    add,
    add_geometry,
    remove,
    hide,
    lamp,
    move_lamp,
    paint,
    surround,
    smooth,
    look,
    link,
    light_less,
    shine,
]
SHADING = [lamp, move_lamp, paint, surround, smooth, link, light_less]


def shown(live, scene, exact, settings=SETTINGS):
    films = []
    live.render(scene, settings, exact, lambda: False, lambda film, final: films.append(film))
    return films[-1]


def assert_same_bits(film, truth, what):
    for name in truth.passes:
        assert film.passes[name].tobytes() == truth.passes[name].tobytes(), f"{what}: {name}"


def assert_same_hits(film, truth, what):
    """Rays that start elsewhere in float32 see the same objects and depths, but for a few at
    edges.
    """
    same = np.abs(film.passes["Depth"] - truth.passes["Depth"]) <= 1e-4 * truth.passes["Depth"]
    same &= film.passes["Object Index"] == truth.passes["Object Index"]
    assert (~same).sum() <= 4, f"{what}: {(~same).sum()} pixels see something else"


@pytest.mark.parametrize("seed", range(12))
def test_any_sequence_of_edits(seed):
    from glint.engine.native.live import NativeLive

    r, live, done = random.Random(seed), NativeLive(), []
    scene = first_scene(random.Random(0))
    try:
        for _ in range(14):
            for _ in range(r.randrange(1, 3)):
                change = r.choice(EDITS)
                scene = change(scene, r)
                done.append(change.__name__)
            truth, what = render(scene, SETTINGS), ", ".join(done)
            if r.random() < 0.7:
                assert_same_hits(shown(live, scene, False), truth, what)
            if r.random() < 0.6:
                assert_same_bits(shown(live, scene, True), truth, what)
    finally:
        live.close()


@pytest.mark.parametrize("seed", range(6))
def test_any_sequence_of_edits_to_the_shading(seed):
    """What an earlier first wave found out serves, whichever light samples it had."""
    from glint.engine.native.live import NativeLive

    r, live, scene = random.Random(seed), NativeLive(), first_scene(random.Random(0))
    try:
        for _ in range(12):
            scene = r.choice(SHADING)(scene, r)
            settings = replace(
                SETTINGS,
                light_samples=r.choice([1, 3]),
                diffuse_bounces=r.choice([0, 2]),
                passes=SETTINGS.passes | {"Cost"},
            )
            assert_same_bits(
                shown(live, scene, True, settings), render(scene, settings), f"seed {seed}"
            )
    finally:
        live.close()


def test_a_lamp_that_moves_a_little_casts_new_shadows():
    """It reaches almost the same points, most of which were kept with other shadows."""
    from glint.engine.native.live import NativeLive

    live, scene = NativeLive(), first_scene(random.Random(0))
    try:
        for step in range(8):
            places = np.eye(4)[:3] + [[0, 0, 0, 2 + 0.1 * step], [0, 0, 0, 1.5], [0, 0, 0, 2]]
            scene = replace(
                scene,
                lights=_with(scene.lights, 1, replace(scene.lights[1], world_from_light=places)),
            )
            assert_same_bits(shown(live, scene, True), render(scene, SETTINGS), f"step {step}")
    finally:
        live.close()


@pytest.mark.parametrize(
    "shape",
    [
        lambda step: {"size_x": 1.0 + step},
        lambda step: {"size_x": 1.0, "spread": np.pi / (1 + step)},
    ],
    ids=["size", "spread"],
)
def test_a_rectangle_of_another_shape_casts_new_shadows(shape):
    """Its first point lies in the middle of the solid angle, not of the rectangle."""
    from glint.engine.native.live import NativeLive

    live, scene, settings = (
        NativeLive(),
        first_scene(random.Random(0)),
        replace(SETTINGS, light_samples=2),
    )
    frame = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    try:
        for step in range(4):
            light = Light(
                "Area",
                "AREA",
                np.c_[frame, [2.0, 1.5, 2.0]],
                strength=150.0,
                size_y=2.0,
                **shape(step),
            )
            scene = replace(scene, lights=_with(scene.lights, 1, light))
            assert_same_bits(
                shown(live, scene, True, settings), render(scene, settings), f"step {step}"
            )
    finally:
        live.close()


def compute(scene, r):
    """A node's value: one material has the program of another, with other constants."""
    graph = Graph()
    place = graph.apply(BY_NAME["position"], shift=0)[0]
    size = graph.constant((r.random(), 0.5, 0.7))
    program = compile_program(graph, list(graph.apply(BY_NAME["product"], place, size)))
    lobe = Lobe("DIFFUSE", (Input(output=0, low=0.0, high=1.0),))
    painted = Material("0", (lobe,), program=program)
    return replace(scene, materials=_with(scene.materials, 0, painted))


@pytest.mark.parametrize("change", [lamp, paint, surround, compute])
def test_what_is_shaded_anew_traces_no_ray(change):
    from glint.engine.native.live import NativeLive

    live, scene, settings = (
        NativeLive(),
        first_scene(random.Random(0)),
        replace(SETTINGS, samples=1),
    )
    try:
        first = shown(live, scene, True, settings)
        assert first.stats["camera rays"] == 48 * 36 and first.stats["shadow rays"] > 0
        film = shown(live, change(scene, random.Random(1)), True, settings)
        assert film.stats["camera rays"] == film.stats["shadow rays"] == film.stats["build"] == 0
        elsewhere = replace(scene.lights[1], world_from_light=np.eye(4)[:3] + [[0, 0, 0, 1]] * 3)
        moved = shown(
            live, replace(scene, lights=_with(scene.lights, 1, elsewhere)), True, settings
        )
        assert moved.stats["camera rays"] == 0 and moved.stats["shadow rays"] > 0
    finally:
        live.close()


def test_a_quick_picture_has_the_light_that_bounces():
    """All of it, at once and after each edit of a lamp."""
    from glint.engine.native.live import NativeLive

    settings = replace(SETTINGS, diffuse_bounces=2)
    live, scene = NativeLive(), first_scene(random.Random(0))
    fewer = replace(scene, lights=scene.lights[:1])
    try:
        assert (render(scene, settings).combined != render(scene, SETTINGS).combined).any()
        for wanted, exact in ((scene, False), (scene, True), (fewer, False), (fewer, True)):
            assert_same_bits(
                shown(live, wanted, exact, settings), render(wanted, settings), f"exact: {exact}"
            )
    finally:
        live.close()
