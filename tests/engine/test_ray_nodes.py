"""Operations that ask the scene for rays: closed forms, one tracer beside the other, the same bits
whatever the work, and contexts without a scene.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine_scenes import SCENES, at, box_mesh
from glint.engine import render
from glint.engine import scene as s
from glint.engine import settings as engine_settings
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.graph import Graph, Value
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from native_tools import constant, draw, lamp, needs_core, square, view_from_above
from test_occlusion_pass import SPREAD, WIDE, floor_and, upright, x_and_y

BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
AO = {"samples": 16, "inside": 0, "only_local": 0, "of_world": 0}
FEW = {"samples": 4}


def occlusion(
    distance: float | None = 2.0, lobe: str = "EMISSION", normal=None, **settings
) -> s.Material:
    """A lobe in the grey that the operation gives; a distance of None is the world's."""
    graph = Graph()
    if normal is None:
        normal = graph.apply(BY_NAME["normal"])[0]
    elif not isinstance(normal, Value):
        normal = graph.constant(normal)
    chosen = {**AO, **settings, "of_world": distance is None}
    reach = graph.constant(distance or 0.0)
    (value,) = graph.apply(BY_NAME["ambient_occlusion"], reach, normal, **chosen)
    return shown(graph, value, lobe)


def shown(graph: Graph, value: Value, lobe: str = "EMISSION") -> s.Material:
    color = (
        graph.apply(BY_NAME["combine_xyz"], value, value, value)[0] if value.width == 1 else value
    )
    program = compile_program(graph, [color])
    return s.Material("asks", (s.Lobe(lobe, (s.Input(output=0),)),), program=program)


def floor_of(material: s.Material, *others, **more) -> s.Scene:
    scene = floor_and(*others, **more)
    return replace(scene, materials=(material, *scene.materials[1:]))


def seen(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    """(h, w) of 64 samples at the pixels' centres: 1024 directions."""
    assert scene.problems() == []
    plan = {"samples": 64, "filter_width": 0.0, **settings}
    picture = draw(scene, backend=backend, **plan).combined
    assert np.isfinite(picture).all()
    np.testing.assert_array_equal(picture[..., 0], picture[..., 2])
    return picture[..., 0].astype(float)


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_near_and_nothing_open(backend: str) -> None:
    assert (seen(floor_of(occlusion()), backend, **FEW) == 1).all()
    around = (box_mesh(), at(linear=5.0))
    assert not seen(floor_of(occlusion(1e4), around), backend, **FEW).any()
    assert (seen(floor_of(occlusion(3.0), around), backend, **FEW) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("height", [0.5, 1.2])
@pytest.mark.parametrize("distance", [2.0, None])
def test_a_ceiling_within_reach(backend: str, height: float, distance: float | None) -> None:
    """Directions of a cosine below h / D get by: the square of that."""
    ceiling = (square(WIDE), at((0, 0, height)))
    found = seen(floor_of(occlusion(distance), ceiling, reach=2.0), backend)
    np.testing.assert_allclose(found, (height / 2) ** 2, atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_low_wall(backend: str) -> None:
    """Of an endless strip half of 1 - cos of its elevation."""
    found = seen(floor_of(occlusion(1e4), (square(1.0), upright(1.5, 1.0))), backend)
    away = 1.5 - x_and_y()[0]
    np.testing.assert_allclose(found, 1 - (1 - away / np.hypot(away, 1.0)) / 2, atol=SPREAD)


@needs_core
@pytest.mark.parametrize("samples", [1, 3, 16, 128])
def test_samples_of_the_node_are_those_of_a_sample_of_the_picture(samples: int) -> None:
    """Directions go on where the sample before ended: only how many there are in all counts."""
    wall = (square(1.0), upright(1.5, 1.0))
    away = 1.5 - x_and_y()[0]
    expected = 1 - (1 - away / np.hypot(away, 1.0)) / 2
    error = np.abs(seen(floor_of(occlusion(1e4, samples=samples), wall)) - expected)
    assert error.max() < 2 * (64 * samples) ** -0.75
    ends = seen(floor_of(occlusion(1e4, samples=128), wall), samples=1)
    np.testing.assert_allclose(seen(floor_of(occlusion(1e4, samples=2), wall)), ends, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_inside_looks_below(backend: str) -> None:
    below = (square(WIDE), at((0, 0, -1.0)))
    found = seen(floor_of(occlusion(inside=1), below), backend)
    np.testing.assert_allclose(found, 0.25, atol=SPREAD)
    assert (seen(floor_of(occlusion(), below), backend, **FEW) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_only_local_knows_the_own_instance_alone(backend: str) -> None:
    """Whether it casts shadows or not; of things at one place too."""
    ceiling = (square(WIDE), at((0, 0, 1.0)))
    local = occlusion(only_local=1)
    assert (seen(floor_of(local, ceiling), backend, **FEW) == 1).all()
    both = s.Mesh(
        "both",
        np.concatenate([square(WIDE).vertices, square(WIDE).vertices + np.float32([0, 0, 1])]),
        np.concatenate([square().triangles, square().triangles + 4]),
    )
    scene = floor_of(local, (square(WIDE), at((0, 0, 1.0))))
    own = replace(scene.instances[0], visible_shadow=False)
    view = view_from_above(8, 1.0, 0.9)
    for order in ((0, 1), (1, 0)):
        blocks = tuple((own, scene.instances[1])[k] for k in order)
        here = replace(scene, camera=view, geometries=(both, scene.geometries[1]), instances=blocks)
        np.testing.assert_allclose(seen(here, backend), 0.25, atol=SPREAD)
    two = s.Instances("two", 0, np.concatenate([at(), at((0, 0, 1.0))]), (0,))
    alone = replace(scene, camera=view, geometries=(square(WIDE),), instances=(two,))
    assert (seen(alone, backend, **FEW) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_only_local_on_solids(backend: str) -> None:
    """A ball under another of the same instance, and between them one of another."""
    centers = np.array([[0, 0, -1.0], [0, 0, 2.0]], np.float32)
    pair = s.Spheres("pair", centers, np.ones(2, np.float32))
    scene = floor_of(occlusion(1e4, only_local=1))
    view = view_from_above(8, 0.05, 0.9)
    own = s.Instances("own", 0, at(), (0,))
    other = s.Instances("other", 1, at((0, 0, 0.5), 0.3), (1,), visible_camera=False)
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    scene = replace(scene, camera=view, geometries=(pair, ball), instances=(other, own))
    np.testing.assert_allclose(seen(scene, backend), 1 - 1 / 2.0**2, atol=SPREAD)
    for local, far in ((0, 0.2), (1, 1.0)):
        scene = replace(scene, materials=(cast(DISTANCE, only_local=local), scene.materials[1]))
        np.testing.assert_allclose(seen(scene, backend, samples=1), far, atol=0.01)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_given_normal_counts(backend: str) -> None:
    """Half of the sky over an upright normal is below the floor; any length will do."""
    for normal in ((1.0, 0.0, 0.0), (1e-9, 0.0, 0.0)):
        found = seen(floor_of(occlusion(1e4, normal=normal)), backend)
        np.testing.assert_allclose(found, 1.0, atol=SPREAD)  # a floor has nothing below
    below = (square(WIDE), at((0, 0, -1.0)))
    found = seen(floor_of(occlusion(1e6, normal=(1.0, 0.0, 0.0)), below), backend)
    np.testing.assert_allclose(found, 0.5, atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_odd_input_finds_nothing_near(backend: str) -> None:
    ceiling = (square(WIDE), at((0, 0, 1.0)))
    for distance in (0.0, -1.0, np.nan):
        assert (seen(floor_of(occlusion(distance), ceiling), backend, **FEW) == 1).all()
    for normal in ((0.0, 0.0, 0.0), (np.nan, np.inf, 0.0)):
        found = seen(floor_of(occlusion(normal=normal), ceiling), backend, **FEW)
        assert (found == 1).all()
    assert not seen(floor_of(occlusion(np.inf), ceiling), backend, **FEW).any()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_tiny_and_huge(backend: str, size: float) -> None:
    base = floor_of(occlusion(2.0 * size), (square(WIDE), at((0, 0, 1.0))))
    blocks = tuple(
        replace(block, world_from_object=block.world_from_object * size) for block in base.instances
    )
    scene = replace(base, camera=view_from_above(8, size, 10 * size), instances=blocks)
    np.testing.assert_allclose(seen(scene, backend), 0.25, atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_clear_hides_and_what_casts_no_shadow_does_not(backend: str) -> None:
    """As in Cycles."""
    veil = s.Material("veil", (s.Lobe("TRANSPARENT", constant(1.0)),))
    scene = floor_of(occlusion(), (square(WIDE), at((0, 0, 1.0))))
    scene = replace(scene, materials=(scene.materials[0], veil))
    np.testing.assert_allclose(seen(scene, backend), 0.25, atol=SPREAD)
    free = replace(scene.instances[1], visible_shadow=False)
    scene = replace(scene, instances=(scene.instances[0], free))
    assert (seen(scene, backend, **FEW) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_shadow_rays_find_nothing_near(backend: str) -> None:
    """A veil as clear as it is open, between two plates: seen it lets a quarter through, to light
    all, as in Cycles; and no program runs for the rays of another.
    """
    veil = occlusion(2.0, "TRANSPARENT")
    scene = floor_and((square(WIDE), at((0, 0, 1.0))), (square(WIDE), at((0, 0, 2.0))), half=0.1)
    blocks = [
        scene.instances[0],
        replace(scene.instances[1], visible_camera=True),
        replace(scene.instances[2], visible_camera=False, materials=(2,)),
    ]
    clear = s.Material("clear", (s.Lobe("TRANSPARENT", constant(1.0)),))
    white = s.Material("white", (s.Lobe("DIFFUSE", constant(1.0)),))
    sun = lamp("SUN", strength=np.pi)
    scene = replace(scene, instances=tuple(blocks), materials=(white, veil, clear), lights=(sun,))
    lit = replace(scene, instances=(blocks[0], replace(blocks[1], visible_camera=False), blocks[2]))
    base = seen(lit, backend, **FEW)
    assert base.min() > 0.1
    np.testing.assert_allclose(seen(scene, backend), 0.25 * base, atol=SPREAD)


@needs_core
@pytest.mark.parametrize("name", sorted(SCENES))
@pytest.mark.parametrize("local", [0, 1])
def test_one_tracer_beside_the_other(name: str, local: int) -> None:
    """Every material shines as open as it is; rays that graze an edge may go either way."""
    base = SCENES[name]()
    asks = occlusion(2.0, only_local=local, samples=8)
    scene = replace(base, materials=(asks,) * len(base.materials))
    assert scene.problems() == []
    passes = ("Cost",)
    native, reference = (
        draw(scene, *passes, backend=b, samples=2, filter_width=0.0, max_bounces=2)
        for b in ("NATIVE", "NUMPY")
    )
    difference = np.abs(native.combined - reference.combined).max(-1)
    assert (difference > 1e-5).mean() < 5e-3
    apart = native.passes["Cost"] != reference.passes["Cost"]
    assert apart.mean() < 5e-3
    assert native.passes["Cost"].max() >= 8
    assert native.stats["shadow rays"] == pytest.approx(reference.stats["shadow rays"], rel=1e-3)


@needs_core
def test_the_same_bits_whatever_the_work() -> None:
    scene = asking_scene()
    settings = {"samples": 4, "filter_width": 1.5, "max_bounces": 2}
    width, height = scene.camera.resolution
    whole = draw(scene, **settings).combined
    np.testing.assert_array_equal(draw(scene, threads=1, **settings).combined, whole)
    region = (width // 4, height // 4, width // 2, height - 3)
    part = whole[region[1] : region[3], region[0] : region[2]]
    np.testing.assert_array_equal(draw(scene, region=region, **settings).combined, part)


def asking_scene() -> s.Scene:
    """The first material reads what its rays meet."""
    base = SCENES["flat_and_smooth"]()
    reads = cast(0, (0.3, -0.2, 1.0), name="raycast_attribute", attribute="told")
    mixed = (occlusion(2.0), occlusion(1.0, only_local=1, inside=1))
    others = tuple(mixed[k % 2] for k in range(1, len(base.materials)))
    things = tuple(_coloured(g, 4) if isinstance(g, s.Mesh) else g for g in base.geometries)
    return replace(base, materials=(reads, *others), geometries=things)


@needs_core
def test_the_same_bits_with_any_instruction_set() -> None:
    code = (
        "import hashlib, sys; sys.path[:0] = sys.argv[1:3]\n"
        "import glint_tree, test_ray_nodes as t\n"
        "bits = t.draw(t.asking_scene(), samples=2).combined.tobytes()\n"
        "print(hashlib.sha256(bits).hexdigest())"
    )
    here = Path(__file__).resolve().parent
    command = [sys.executable, "-c", code, str(here.parent), str(here)]
    found = set()
    # the core takes the best that the machine has where it lacks one
    for isa in ("sse42", "avx2", "avx512"):
        env = {**os.environ, "GLINT_ISA": isa}
        run = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
        found.add(run.stdout)
    assert len(found) == 1


@needs_core
def test_who_does_not_ask_pays_nothing() -> None:
    scene = SCENES["flat_and_smooth"]()
    assert scene.most_asked == 0 and asking_scene().most_asked == 16
    before = draw(scene, samples=2)
    spare = replace(scene, materials=(*scene.materials, occlusion()))
    after = draw(spare, samples=2)
    np.testing.assert_array_equal(before.combined, after.combined)
    assert before.stats["shadow rays"] == after.stats["shadow rays"]


@needs_core
def test_a_pixel_is_explained_as_it_is_drawn() -> None:
    scene = floor_of(occlusion(), (square(1.0), upright(1.5, 1.0)))
    settings = engine_settings.Settings(samples=1, filter_width=0.0)
    explainer, picture = PixelExplainer(scene, settings), render(scene, settings).combined
    for x, y in ((0, 0), (7, 3)):
        np.testing.assert_allclose(explainer.pixel(x, y).color, picture[y, x, :3], rtol=1e-6)


@needs_core
def test_pixels_that_stop_early_have_looked_round() -> None:
    """One sample of few directions is alike all over a face: pixels take 16 before they stop."""
    scene = floor_of(occlusion(1e4, samples=1), (square(1.0), upright(1.5, 1.0)))
    film = draw(scene, "Samples", samples=64, error_threshold=1.0)
    assert film.passes["Samples"].min() >= 16


@pytest.mark.parametrize("backend", BACKENDS)
def test_things_hide_where_they_are_in_a_moment(backend: str) -> None:
    """A ceiling that rises evenly from 0.5 to 1.5: the mean of a quarter of its height squared."""
    scene = floor_of(occlusion(), (square(WIDE), at((0, 0, 1.0))))
    keys = np.stack([at((0, 0, z)) for z in (0.5, 1.5)])
    moving = replace(
        scene, instances=(scene.instances[0], replace(scene.instances[1], motion=keys))
    )
    found = seen(moving, backend)
    np.testing.assert_allclose(found, (1.5**3 - 0.5**3) / 3 / 4, atol=2 * SPREAD)


# --- bevels


def bevelled(radius: float = 0.4, samples: int = 16) -> s.Material:
    graph = Graph()
    (normal,) = graph.apply(BY_NAME["bevel"], graph.constant(radius), samples=samples)
    return shown(graph, normal)


def edge(up: bool = True) -> s.Mesh:
    """A half plane z = 0, x < 0, and one that falls, or rises, from its end: an endless edge."""
    w, z = 50.0, -50.0 if up else 50.0
    points = [[-w, -w, 0], [0, -w, 0], [0, w, 0], [-w, w, 0], [0, -w, z], [0, w, z]]
    triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    return s.Mesh("edge", np.array(points, np.float32), np.array(triangles, np.uint32))


def bevel_at(away: np.ndarray, radius: float, up: bool = True) -> np.ndarray:
    """(k, 3) normals on the half plane so far from the edge, by a fine grid over both planes."""
    line = (np.arange(400) + 0.5) / 200 - 1
    x, y = radius * np.array(np.meshgrid(line, line))
    top = np.clip(radius - np.hypot(x, y), 0, None) ** 3
    found = []
    for d in away:
        z = np.abs(x)  # each depth twice
        side = np.clip(radius - np.sqrt(d * d + y * y + z * z), 0, None) ** 3
        found.append([side.sum() / 2 * (1 if up else -1), 0, (top * (x < d)).sum()])
    return np.array(found) / np.linalg.norm(found, axis=1, keepdims=True)


def edge_scene(material: s.Material, up: bool = True, **instance) -> s.Scene:
    view = view_from_above(8, 0.25, 1.0)
    view.world_from_camera[0, 3] = -0.25
    block = s.Instances("edge", 0, at(), (0,), **instance)
    return s.Scene(view, (edge(up),), (block,), (material,), world=s.World())


def normals_of(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    assert scene.problems() == []
    plan = {"samples": 64, "filter_width": 0.0, **settings}
    picture = draw(scene, backend=backend, **plan).combined[..., :3].astype(float)
    assert np.isfinite(picture).all()
    return picture


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("up", [True, False])
def test_an_edge_is_round(backend: str, up: bool) -> None:
    """Both ways; pixels are means of unit normals, a little short."""
    found = normals_of(edge_scene(bevelled(0.4, 64), up), backend, samples=16)
    away = 0.25 - x_and_y(0.25)[0][0]
    np.testing.assert_allclose(
        found, np.broadcast_to(bevel_at(away, 0.4, up), found.shape), atol=0.02
    )


@needs_core
def test_more_rays_are_nearer() -> None:
    away = 0.25 - x_and_y(0.25)[0][0]
    truth = bevel_at(away, 0.4)
    errors = [
        np.sqrt(((normals_of(edge_scene(bevelled(0.4, n))) - truth) ** 2).mean())
        for n in (4, 16, 128)
    ]
    assert errors[0] < 0.06 and errors[1] < errors[0] / 2 and errors[2] < errors[1] / 2


@pytest.mark.parametrize("backend", BACKENDS)
def test_where_nothing_is_near_bevels_keep_the_normal(backend: str) -> None:
    for radius in (0.01, 0.0, -1.0, np.nan, np.inf):
        found = normals_of(edge_scene(bevelled(radius)), backend, **FEW)
        np.testing.assert_allclose(
            found[:, :-1], np.broadcast_to([0, 0, 1.0], (8, 7, 3)), atol=1e-6
        )


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ball_stays_one(backend: str) -> None:
    """Its mean normal is its own, from without and within; and so on a mesh's smooth normals."""
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    for height in (4.0, 0.5):
        scene = s.Scene(
            view_from_above(8, 0.4, height),
            (ball,),
            (s.Instances("ball", 0, at(), (0,)),),
            (bevelled(0.3, 128),),
            world=s.World(),
        )
        plain = replace(scene, materials=(shown_normal(),))
        few = {"samples": 16}  # of 128 rays each: the core's means are 1e-4 apart
        apart = normals_of(scene, backend, **few) - normals_of(plain, backend, **few)
        assert np.abs(apart).max() < 0.01


def shown_normal() -> s.Material:
    graph = Graph()
    return shown(graph, graph.apply(BY_NAME["normal"])[0])


@pytest.mark.parametrize("backend", BACKENDS)
def test_others_make_no_edge(backend: str) -> None:
    """Nor do they hide it, wherever they are; what is unseen by other rays has one as well."""
    alone = normals_of(edge_scene(bevelled()), backend, **FEW)
    scene = edge_scene(bevelled(), visible_shadow=False, visible_mirror=False)
    wall = s.Instances("wall", 1, upright(-0.2, 1.0), (0,), visible_camera=False)
    copy = s.Instances("copy", 0, at(), (0,), visible_camera=False)
    for order in (lambda own: (wall, copy, own), lambda own: (own, copy, wall)):
        mixed = replace(
            scene, geometries=(edge(), square(1.0)), instances=order(scene.instances[0])
        )
        np.testing.assert_allclose(normals_of(mixed, backend, **FEW), alone, atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("linear", [np.diag([1, -1, 1.0]), 1e-5, 1e5])
def test_bevels_of_mirrored_tiny_and_huge_things(backend: str, linear) -> None:
    size = linear if np.isscalar(linear) else 1.0
    scene = edge_scene(bevelled(0.4 * size))
    view = view_from_above(8, 0.25 * size, size)
    view.world_from_camera[0, 3] = -0.25 * size
    block = replace(scene.instances[0], world_from_object=at(linear=linear))
    found = normals_of(replace(scene, camera=view, instances=(block,)), backend, **FEW)
    np.testing.assert_allclose(found, normals_of(edge_scene(bevelled()), backend, **FEW), atol=1e-4)


# --- rays


def cast(
    output: int,
    direction=(0.0, 0.0, 1.0),
    length: float = 5.0,
    position=None,
    name: str = "raycast",
    **settings,
) -> s.Material:
    graph = Graph()
    place = graph.apply(BY_NAME["position"], shift=0)[0]
    chosen = {"only_local": 0, "from_point": position is None, **settings}
    if position is not None:
        place = graph.apply(
            BY_NAME["scaled_sum"], place, graph.constant(1.0), graph.constant(position)
        )[0]
    found = graph.apply(
        BY_NAME[name], place, graph.constant(direction), graph.constant(length), **chosen
    )
    return shown(graph, found[output])


HIT, OWN, DISTANCE, POSITION, NORMAL = range(5)
CEILING = (square(WIDE), at((0, 0, 1.5)))


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_a_ray_tells(backend: str) -> None:
    def found(output: int, **more) -> np.ndarray:
        return normals_of(floor_of(cast(output, **more), CEILING), backend, samples=1)

    x, y = x_and_y()
    for more, there in (({}, True), ({"length": 1.0}, False), ({"only_local": 1}, False)):
        np.testing.assert_allclose(found(HIT, **more), there)
        assert not found(OWN, **more).any()
        far = 1.5 if there else more.get("length", 5.0)
        np.testing.assert_allclose(found(DISTANCE, **more), far, rtol=1e-5)
        place = np.stack([x, y, 1.5 + 0 * x], -1) * there
        np.testing.assert_allclose(found(POSITION, **more), place, atol=1e-5)
        np.testing.assert_allclose(
            found(NORMAL, **more), np.broadcast_to([0, 0, -1.0 * there], place.shape)
        )
    np.testing.assert_allclose(found(DISTANCE, direction=(0.0, 0.0, 3.0)), 0.5, rtol=1e-5)
    np.testing.assert_allclose(found(HIT, direction=(0.0, 0.0, 0.25)), 0)
    assert not found(HIT, direction=(0.0, 0.0, -1.0)).any()


def _coloured(thing: s.Mesh | s.Strands, channels: int) -> s.Mesh | s.Strands:
    """With an attribute that is (x, y, 2, 0.25) at its vertices, as far as it has channels."""
    rows = np.concatenate([thing.vertices[:, :2], np.full((len(thing.vertices), 2), (2, 0.25))], 1)
    told = s.Attribute("told", s.POINT, rows[:, :channels].astype(np.float32))
    return replace(thing, attributes=(*thing.attributes, told))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("channels", [2, 3, 4])
def test_what_a_ray_reads_where_it_ends(backend: str, channels: int) -> None:
    """Of what it meets alone: nothing of a mesh without the attribute, of a sphere, or where it
    meets nothing. A strand that is wider than the view is read along its axis.
    """
    x, y = x_and_y()
    ask = {"name": "raycast_attribute", "attribute": "told"}

    def found(output: int, geometry=None, **more) -> np.ndarray:
        scene = floor_of(cast(output, **ask, **more), (geometry or ceiling, CEILING[1]))
        return normals_of(scene, backend, samples=1)

    ceiling = _coloured(square(WIDE), channels)
    wanted = np.stack([x, y, 2 + 0 * x], -1)
    wanted[..., channels:] = 0
    np.testing.assert_allclose(found(0), wanted, atol=1e-5)
    np.testing.assert_allclose(found(1), 0.25 if channels == 4 else 1.0, atol=1e-6)
    ends = np.float32([[-WIDE, 0, 6], [WIDE, 0, 6]])
    rod = s.Strands("rod", ends, np.full(2, 4, np.float32), np.zeros(1, np.uint32))
    along = np.stack([x, 0 * x, 2 + 0 * x], -1)
    along[..., channels:] = 0
    np.testing.assert_allclose(found(0, _coloured(rod, channels)), along, atol=1e-4)
    ball = s.Spheres("ball", np.array([[0, 0, 0]], np.float32), np.array([WIDE], np.float32))
    for output in (0, 1):
        assert not found(output, square(WIDE)).any()
        assert not found(output, ball).any()
        assert not found(output, length=1.0).any()
        assert not found(output, only_local=1).any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_from_elsewhere(backend: str) -> None:
    """Down from above the ceiling, and on from below it."""
    for start, far, own in ((2.0, 0.5, 0), (1.0, 1.0, 1)):
        more = {"position": (0.0, 0.0, start), "direction": (0.0, 0.0, -1.0)}
        for output, expected in ((DISTANCE, far), (OWN, own), (HIT, 1)):
            scene = floor_of(cast(output, **more), CEILING)
            found = normals_of(scene, backend, samples=1)
            np.testing.assert_allclose(found, expected, rtol=1e-5)
    local = cast(DISTANCE, position=(0.0, 0.0, 2.0), direction=(0.0, 0.0, -1.0), only_local=1)
    found = normals_of(floor_of(local, CEILING), backend, samples=1)
    np.testing.assert_allclose(found, 2.0, rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_unseen_by_some_rays_stops_these(backend: str) -> None:
    """Not what no rays see."""
    scene = floor_of(cast(HIT), CEILING)
    unseen = dict.fromkeys(("visible_camera", "visible_mirror", "visible_shadow"), False)
    for seen_by in ("visible_mirror", "visible_shadow", None):
        there = seen_by is not None
        more = {**unseen, **({seen_by: True} if there else {})}
        block = replace(scene.instances[1], **more)
        some = replace(scene, instances=(scene.instances[0], block))
        np.testing.assert_allclose(normals_of(some, backend, samples=1), there)


@pytest.mark.parametrize("backend", BACKENDS)
def test_odd_rays_meet_nothing(backend: str) -> None:
    for more in (
        {"direction": (0.0, 0.0, 0.0)},
        {"direction": (np.nan, np.inf, 0.0)},
        {"length": 0.0},
        {"length": -1.0},
        {"length": np.nan},
        {"position": (np.inf, np.nan, 0.0), "direction": (0.0, 0.0, -1.0)},
        {"position": (1e300, 0.0, 0.0)},
    ):
        picture = normals_of(floor_of(cast(HIT, **more), CEILING), backend, samples=1)
        assert not picture.any(), more
    for more in ({"length": np.inf}, {"direction": (0.0, 0.0, 1e-200)}, {"length": 1e300}):
        found = normals_of(floor_of(cast(NORMAL, **more), CEILING), backend, samples=1)
        assert np.isin(found, (0.0, -1.0)).all()


@needs_core
@pytest.mark.parametrize("name", sorted(SCENES))
@pytest.mark.parametrize("kind", ["bevel", "cast", "cast-local"])
def test_both_tracers_bevel_and_cast(name: str, kind: str) -> None:
    base = SCENES[name]()
    local = int(kind == "cast-local")
    direction = (0.3, -0.2, -1.0) if local else (0.3, -0.2, 1.0)
    material = bevelled(0.3) if kind == "bevel" else cast(NORMAL, direction, only_local=local)
    scene = replace(base, materials=(material,) * len(base.materials))
    native, reference = (
        draw(scene, "Cost", backend=b, samples=2, filter_width=0.0, max_bounces=2)
        for b in ("NATIVE", "NUMPY")
    )
    difference = np.abs(native.combined - reference.combined).max(-1)
    assert (difference > 1e-3).mean() < 5e-3
    assert (native.passes["Cost"] != reference.passes["Cost"]).mean() < 5e-3
