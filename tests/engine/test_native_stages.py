"""The core's stages, which run over whole batches: the same bits from every instruction set, and
materials in one tile that do not mix.
"""

from __future__ import annotations

import functools
import hashlib
from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES, ball_mesh, camera, checker, gloss, grid_mesh, surface
from glint import engine
from glint.engine import scene as s
from native_tools import (
    IDENTITY,
    NO_WORLD,
    assert_instruction_sets_agree,
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

pytestmark = needs_core

PARTS = frozenset(engine.PASSES) - {"Combined", "Fallbacks"}


@functools.cache
def hashes() -> str:
    """A line a scene: Combined alone, and with all passes."""
    lines = []
    for name, make in (*SCENES.items(), ("gloss", gloss)):
        scene, plan = make(), engine.Settings(samples=2, light_samples=3, max_bounces=4)
        for passes in (frozenset(), PARTS):
            film = engine.render(scene, replace(plan, passes=passes))
            bits = b"".join(
                np.ascontiguousarray(film.passes[key]).tobytes() for key in sorted(film.passes)
            )
            lines.append(f"{name} {len(film.passes)} {hashlib.sha256(bits).hexdigest()}")
    return "\n".join(lines)


def test_same_bits_from_every_instruction_set() -> None:
    assert_instruction_sets_agree(hashes)


def test_highlights_and_lobes_of_the_view_are_those_of_the_reference() -> None:
    core, truth = color(gloss(), light_samples=2), color(gloss(), light_samples=2, backend="NUMPY")
    assert np.abs(core - truth).max() < 1e-4 * truth.mean()


def test_materials_of_one_batch_keep_to_themselves() -> None:
    """A checkerboard of six materials, one face a pixel: each pixel is that of a scene with its
    material alone.
    """
    size = 24
    x, y = np.meshgrid(np.linspace(-1, 1, size + 1), np.linspace(-1, 1, size + 1))
    vertices = np.stack([x, y, 0 * x], -1).reshape(-1, 3).astype(np.float32)
    row, column = np.divmod(np.arange(size * size), size)
    first = row * (size + 1) + column
    quads = np.stack([first, first + 1, first + size + 2, first + size + 1], -1)
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]).astype(np.uint32)
    uv = s.Attribute("map", s.POINT, (vertices[:, :2] * 0.5 + 0.5).astype(np.float32))
    slots = np.tile((5 * row + column) % 6, 2).astype(np.uint16)
    mesh = s.Mesh("board", vertices, triangles, material_slots=slots, attributes=(uv,))
    materials = (
        surface("dull", (0.8, 0.2, 0.1), ambient=0.3),
        surface("shiny", (0.1, 0.3, 0.5), specular=0.6, exponent=12),
        s.Material(
            "two highlights",
            (
                s.Lobe("SPECULAR", constant(0.3), 9.0),
                s.Lobe("SPECULAR", constant(0.2, 0.1, 0.4), 70.0),
            ),
        ),
        s.Material(
            "picture",
            (s.Lobe("DIFFUSE", (s.Input(texture=0),)), s.Lobe("AMBIENT", (s.Input(texture=0),))),
        ),
        s.Material("mirror", (s.Lobe("MIRROR", constant(0.4)), s.Lobe("DIFFUSE", constant(0.2)))),
        s.Material(
            "veil",
            (s.Lobe("TRANSPARENT", constant(0.3, 0.6, 0.9)), s.Lobe("EMISSION", constant(0.1))),
        ),
    )
    lights = (lamp("POINT", (0.3, -0.2, 1.5), strength=30.0), lamp("SUN", strength=0.5))
    world = s.World((0.2, 0.3, 0.4), (0.5, 0.6, 0.7))
    board = s.Scene(
        view_from_above(size),
        (mesh,),
        (placed(0, tuple(range(6))),),
        materials,
        (checker(),),
        lights,
        world,
    )
    plan = engine.Settings(samples=1, light_samples=1, max_bounces=1)
    together = engine.render(board, plan).combined
    for k in range(6):
        alone = engine.render(replace(board, instances=(placed(0, (k,) * 6),)), plan).combined
        mine = (slots[: size * size] == k).reshape(size, size)
        assert together[mine].tobytes() == alone[mine].tobytes(), materials[k].name


def test_instances_of_one_batch_keep_to_themselves() -> None:
    """Balls that nearly touch, each with a matrix of its own: every one looks as it does alone."""
    count = 6
    matrices = np.repeat(IDENTITY[None], count * count, 0)
    row, column = np.divmod(np.arange(count * count), count)
    matrices[:, :, :3] *= np.linspace(0.14, 0.155, count * count)[:, None, None]
    matrices[::2, :, :3] = matrices[::2, :, :3] @ np.diag([1, -1, 1.5])
    matrices[:, 0, 3], matrices[:, 1, 3] = (column - 2.5) / 3.2, (row - 2.5) / 3.2
    white = (surface("white", 0.8, specular=0.5),)
    base = s.Scene(
        view_from_above(48),
        (ball_mesh(6),),
        (s.Instances("balls", 0, matrices, (0,)),),
        white,
        (),
        (lamp("SUN"),),
    )
    plan = engine.Settings(samples=1, passes=frozenset({"Normal", "Depth"}))
    together = engine.render(base, plan)
    for k in range(0, count * count, 5):
        alone = engine.render(
            replace(base, instances=(s.Instances("ball", 0, matrices[k : k + 1], (0,)),)), plan
        )
        seen = alone.passes["Depth"][..., 0] < 1e9
        assert seen.any()
        for name in ("Normal", "Combined"):
            # The anchor's scale is a power of two that the whole scene decides: bits can differ,
            # rounding to float32 apart.
            assert np.abs(together.passes[name][seen] - alone.passes[name][seen]).max() <= 2.0**-22


def test_partial_tiles_and_single_pixels() -> None:
    """Regions of every width from 1 to 17: the last group of a batch is full of lanes that no pixel
    has.
    """
    scene = s.Scene(
        camera(size=(40, 9)),
        (grid_mesh(4),),
        (placed(),),
        (material(s.Lobe("DIFFUSE")),),
        (),
        (lamp("POINT"),),
    )
    plan = engine.Settings(samples=2)
    whole = engine.render(scene, plan).combined
    for width in range(1, 18):
        part = engine.render(scene, replace(plan, region=(3, 1, 3 + width, 8))).combined
        assert part.tobytes() == np.ascontiguousarray(whole[1:8, 3 : 3 + width]).tobytes(), width


@pytest.mark.parametrize("veiled", [False, True])
def test_lobes_that_read_images_keep_to_themselves(veiled: bool) -> None:
    """Ten reads of two images by lobes that share some: their sum is that of pictures with one lobe
    each, also on surfaces let through.
    """
    textures = (
        checker(),
        replace(checker(), pixels=np.ascontiguousarray(checker().pixels[::-1, :, ::-1])),
    )
    shifts = [((1, 0, 0.1 * k), (0, 1, 0)) for k in range(5)]
    reads = [
        s.Input((0.1 + 0.01 * k,) * 3, texture=k % 2, uv_transform=shifts[k // 2])
        for k in range(10)
    ]
    lobes = [s.Lobe("EMISSION", (reads[k],)) for k in (*range(10), 3, 0, 9)]
    veil = (s.Lobe("TRANSPARENT", constant(0.25)),) * veiled

    def picture(*chosen: s.Lobe) -> np.ndarray:
        scene = s.Scene(
            view_from_above(16, half=4.0),
            (square(),),
            (placed(),),
            (material(*chosen, *veil),),
            textures,
            (),
            NO_WORLD,
        )
        return color(scene)

    alone = sum(picture(lobe) for lobe in lobes)
    assert alone.min() >= 0 and np.ptp(alone) > 0.1
    assert np.abs(picture(*lobes) - alone).max() < 1e-5


def turned(angle: float, scale: float, position: tuple[float, float, float]) -> np.ndarray:
    """(1, 3, 4) world_from_object: a turn about y, a scale and a shift."""
    c, n = np.cos(angle), np.sin(angle)
    return np.column_stack([scale * np.array([[c, 0, n], [0, 1, 0], [-n, 0, c]]), position])[None]


def test_rays_of_a_path_bring_their_light_in_order() -> None:
    """What is refracted brings 1e17 and takes it away again before what is mirrored adds 1: in
    another order the 1 is lost to rounding.
    """
    splitter = material(
        s.Lobe("REFRACTION", constant(1.0), ior=1.0), s.Lobe("MIRROR", constant(1.0))
    )
    again = replace(splitter, name="again")
    glows = [
        s.Material(f"glow {value}", (s.Lobe("EMISSION", constant(value)),))
        for value in (1e17, -1e17, 1.0)
    ]
    out_of_sight = {"visible_camera": False}
    sheets = (
        placed(0, (0,)),
        s.Instances("tilted", 0, turned(np.pi / 4, 0.4, (0, 0, -2)), (1,)),
        s.Instances("below", 0, turned(0, 1, (0, 0, -5)), (2,)),
        s.Instances("beside", 0, turned(np.pi / 2, 1, (6, 0, -2)), (3,)),
        placed(0, (1,), z=1.0, **out_of_sight),
        placed(0, (4,), z=2.0, **out_of_sight),
    )
    scene = s.Scene(
        view_from_above(16), (square(),), sheets, (splitter, again, *glows), (), (), NO_WORLD
    )
    assert np.array_equal(color(scene, max_bounces=2), np.ones((16, 16, 3)))


def veils(layers: int) -> tuple[s.Mesh, tuple[s.Material, ...], tuple[s.Instances, ...]]:
    """Bumpy sheets over each other, each turned or mirrored; their faces let through an image, a
    tint times alpha, a half, or nothing.
    """
    mesh = grid_mesh(7, extent=1.2, height=lambda x, y: 0.1 * np.sin(9 * x + 5 * y))
    tint = np.random.default_rng(3).uniform(0.2, 1, (len(mesh.vertices), 4)).astype(np.float32)
    slots = (
        np.random.default_rng(4)
        .choice(4, len(mesh.triangles), p=(0.4, 0.3, 0.2, 0.1))
        .astype(np.uint16)
    )
    mesh = replace(
        mesh,
        attributes=(*mesh.attributes, s.Attribute("tint", s.POINT, tint)),
        material_slots=slots,
    )
    bounded = s.Input(
        (2.0, 2.5, 3.0), attribute="tint", offset=(-1.0, -0.8, -1.5), low=0.2, high=0.9
    )
    by_alpha = s.Input((0.5, 0.9, 0.7), texture=0, channel="ALPHA", complement=True)
    materials = (
        s.Material("image", (s.Lobe("TRANSPARENT", (s.Input((0.9, 0.8, 0.7), texture=0),)),)),
        s.Material(
            "tinted", (s.Lobe("TRANSPARENT", (bounded, by_alpha)), s.Lobe("DIFFUSE", constant(0.0)))
        ),
        s.Material("half", (s.Lobe("TRANSPARENT", constant(0.5)),)),
        s.Material("opaque", (s.Lobe("DIFFUSE", constant(0.0)),)),
    )
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    linears = [np.eye(3), quarter, np.diag([-1.0, 1.0, 1.3])]
    return (
        mesh,
        materials,
        tuple(placed(0, (0, 1, 2, 3), z=1.0 + k, linear=linears[k]) for k in range(layers)),
    )


@pytest.mark.parametrize("layers", [1, 3])
def test_light_through_veils_is_what_is_seen_through_them(layers: int) -> None:
    """The sun overhead through sheets of several materials, and a white world through the same
    sheets. The view lies beside their middle: along the edges of the diagonal rounding chooses the
    face.
    """
    mesh, materials, sheets = veils(layers)
    view, white = view_from_above(48), s.World(background=(1, 1, 1))
    view.world_from_camera[0, 3] = 0.0007
    seen = color(s.Scene(view, (mesh,), sheets, materials, (checker(),), (), white))
    hidden = tuple(replace(sheet, visible_camera=False) for sheet in sheets)
    floor = s.Scene(
        view,
        (mesh, square()),
        (placed(1, (4,)),),
        (*materials, material(s.Lobe("DIFFUSE"))),
        (checker(),),
        (lamp("SUN"),),
        NO_WORLD,
    )
    lit = color(replace(floor, instances=(*hidden, placed(1, (4,))))) / color(floor)
    assert len(np.unique(seen.round(4))) > 300 and (seen == 0).any()
    assert np.abs(lit - seen).max() < 1e-5


def test_ambient_lobes_of_a_black_world_change_nothing() -> None:
    """The picture is that of a world whose light is too faint to count, for which they stay; lobes
    beside them read the same image.
    """
    read, other = (s.Input(texture=0),), (s.Input((0.5, 0.4, 0.3), texture=0),)
    lobes = (
        s.Lobe("DIFFUSE", read),
        s.Lobe("AMBIENT", other),
        s.Lobe("SPECULAR", other, 8.0),
        s.Lobe("AMBIENT", read),
    )
    scene = s.Scene(
        view_from_above(16),
        (square(),),
        (placed(),),
        (material(*lobes),),
        (checker(),),
        (lamp("POINT", strength=50.0),),
    )
    black, faint = color(scene), color(replace(scene, world=s.World((1e-300, 1e-300, 1e-300))))
    assert black.max() > 0.1
    assert black.tobytes() == faint.tobytes()


def test_only_lights_with_an_extent_are_visible() -> None:
    for radius, visible in ((0.0, False), (0.3, True)):
        light = lamp("POINT", radius=radius, visible_camera=True)
        film = draw(
            s.Scene(
                view_from_above(),
                (square(),),
                (placed(),),
                (material(s.Lobe("DIFFUSE")),),
                (),
                (light,),
                NO_WORLD,
            )
        )
        assert ("feature: visible lights" in film.stats) == visible


def test_bounded_inputs_are_those_of_the_reference() -> None:
    """An image and an attribute, each beyond its bounds somewhere and within them elsewhere."""
    mesh, *_ = veils(0)
    inputs = (
        s.Input((4.0, 3.0, 5.0), texture=0, offset=(-1.0, -0.5, -2.0), low=0.0, high=1.0),
        s.Input(
            (2.0, 2.0, 2.0),
            attribute="tint",
            offset=(-1.0, -1.2, -0.8),
            low=0.1,
            high=0.7,
            complement=True,
        ),
    )
    glow = material(
        s.Lobe("EMISSION", inputs),
        s.Lobe("EMISSION", (s.Input((-1.0, 0.2, 3.0), low=0.0, high=1.5),)),
    )
    scene = s.Scene(view_from_above(24), (mesh,), (placed(),), (glow,), (checker(),), (), NO_WORLD)
    core, truth = color(scene), color(scene, backend="NUMPY")
    assert len(np.unique(truth.round(4))) > 100
    assert np.abs(core - truth).max() < 1e-5
