"""Scenes that Hypothesis makes up: what there is of each kind is drawn, so that a failing scene
shrinks to a small one; coordinates and colours come from a seed, so that no two surfaces lie in one
plane by accident and rounding alone says which is met.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st

from engine_scenes import checker, look_at, vertex_normals
from glint.engine import Settings
from glint.engine import scene as s
from glint.engine.closures import KINDS
from glint.engine.program.graph import Graph
from glint.engine.program.program import Program, compile_program
from glint.engine.program.table import BY_NAME

SIZE = (16, 12)
LAMPS = ("POINT", "SUN", "SPOT", "AREA", "DOME")
GEOMETRIES = ("flat", "smooth", "spheres", "polygons", "strands")
FLAT_CAMERAS = ("PERSPECTIVE", "ORTHOGRAPHIC")
"""Panoramas need a projection of their own; tests of theirs draw it."""
SEEN_BY = ("camera", "mirror", "shadow", "transmission", "diffuse", "media")
PATTERNS = ("noise", "position", "uv", "attribute")

Dice = np.random.Generator
flags = st.booleans()
mostly = st.sampled_from((True, True, True, True, False))
few = st.integers(1, 3)
sets = st.sampled_from((s.EVERYTHING, s.EVERYTHING, 0b10))


def rgb(dice: Dice, most: float = 1.0) -> tuple[float, float, float]:
    return tuple(float(x) for x in most * dice.random(3))


@st.composite
def factors(draw: Any, dice: Dice, textures: int, most: float) -> tuple[s.Input, ...]:
    """A colour, times a texture or an attribute, or one minus that."""
    more: dict[str, Any] = {}
    varying = draw(st.sampled_from(("", "texture", "attribute")))
    if varying == "texture" and textures:
        transform = np.column_stack([np.eye(2) + dice.normal(0, 0.5, (2, 2)), dice.random(2)])
        more["texture"] = draw(st.integers(0, textures - 1))
        more["channel"] = draw(st.sampled_from(s.CHANNELS))
        more["uv_transform"] = tuple(tuple(float(x) for x in row) for row in transform)
        more["complement"] = draw(flags)
    elif varying == "attribute":
        more["attribute"] = draw(st.sampled_from(("Col", "missing")))
    return (s.Input(rgb(dice, most), **more),)


@st.composite
def lobes(draw: Any, dice: Dice, textures: int, program: bool) -> s.Lobe:
    kind = draw(st.sampled_from(KINDS))
    share = 0.6 if kind in ("MIRROR", "REFRACTION", "TRANSPARENT") else 1.0
    given = draw(factors(dice, textures, share))
    if program and draw(flags):
        given = (*given, s.Input(output=0))
    glossy, toon = kind == "SPECULAR", kind.startswith("TOON")
    below = kind == "DIFFUSE" and draw(flags)
    masked = (glossy or toon) and draw(flags)
    wide = (masked and glossy) or kind == "REFRACTION"
    distributions = [d for d in s.DISTRIBUTIONS if glossy or d != "ASHIKHMIN_SHIRLEY"]
    distribution = draw(st.sampled_from(distributions)) if wide else "BLINN_PHONG"
    fresnel = kind in ("MIRROR", "REFRACTION", "SPECULAR") and draw(flags)
    schlick = masked and glossy and not fresnel and draw(flags)
    first = (
        float(10 ** dice.uniform(0, 2.5))
        if glossy
        else float(dice.uniform(0.05, 0.9))
        if toon
        else float(draw(st.integers(0, 3)))
    )
    numbers = first, float(dice.uniform(0.1, 0.9)) if masked else 0.0
    names = {"SHEEN": ("width", "lean")}.get(kind, ("exponent", "masking"))
    names = ("size", "smooth") if toon else names
    return s.Lobe(
        kind,
        given,
        ior=float(dice.uniform(1.1, 1.8)),
        fresnel=fresnel,
        schlick=schlick,
        distribution=distribution,
        edge=masked and glossy and not (fresnel or schlick) and draw(flags),
        **dict(zip(names, numbers, strict=True)),
        radius=rgb(dice, 0.3) if below else (0.0, 0.0, 0.0),
    )


def pattern(dice: Dice, kind: str) -> Program:
    """A program whose output is a colour that varies over the surface."""
    graph = Graph()

    def apply(name: str, *arguments, **settings):
        return graph.apply(BY_NAME[name], *arguments, **settings)

    if kind == "uv":
        found = apply("uv", attribute="", shift=0)[0]
    elif kind == "attribute":
        found = apply("attribute", attribute="Col", shift=0)[0]
    else:
        found = apply("object_position", shift=0)[0]
    if kind == "noise":
        numbers = (0.0, *dice.uniform(1, 3, 2), 0.5, 2.0, 0.0, 1.0, 0.3)
        found = apply(
            "noise_texture",
            found,
            *(graph.constant(float(x)) for x in numbers),
            dimensions=3,
            noise_type=0,
            normalize=1,
        )[1]
    ends = (graph.constant((0.0,) * 3), graph.constant((1.0,) * 3))
    return compile_program(graph, [apply("bounded", found, *ends)[0]])


@st.composite
def media(draw: Any, dice: Dice, most: float = 1.0) -> s.Medium | None:
    """Mostly none."""
    if draw(mostly):
        return None
    parts = ("absorption", "scattering", "emission")
    given = {part: rgb(dice, most) for part in parts if draw(flags)}
    return s.Medium(anisotropy=draw(st.sampled_from((0.0, 0.6, -0.3))), **given)


@st.composite
def materials(draw: Any, dice: Dice, textures: int) -> s.Material:
    kind = draw(st.sampled_from(("", *PATTERNS)))
    program = pattern(dice, kind) if kind else None
    some = draw(st.lists(lobes(dice, textures, bool(kind)), min_size=1, max_size=4))
    return s.Material("m", tuple(some), program=program, medium=draw(media(dice)))


def _soup(dice: Dice, smooth: bool) -> s.Mesh:
    """Triangles between random points, with a UV map and a colour."""
    count = int(dice.integers(4, 20))
    points = dice.normal(0, 0.7, (count, 3)).astype(np.float32)
    chosen = {tuple(sorted(dice.choice(count, 3, replace=False))) for _ in range(count)}
    triangles = np.array(sorted(chosen), np.uint32)
    uv = s.Attribute("UVMap", s.POINT, dice.random((count, 2)).astype(np.float32))
    color = s.Attribute("Col", s.FACE, dice.random((len(triangles), 4)).astype(np.float32))
    normals = None
    if smooth:
        with np.errstate(invalid="ignore"):  # points that no triangle has
            normals = s.Attribute("normals", s.POINT, _known(vertex_normals(points, triangles)))
    return s.Mesh("soup", points, triangles, normals=normals, attributes=(uv, color))


def _known(normals: np.ndarray) -> np.ndarray:
    """Some normal for each point that has none."""
    lost = ~np.isfinite(normals).all(1)
    normals[lost] = (0.0, 0.0, 1.0)
    return normals


def geometry(dice: Dice, kind: str) -> s.Geometry:
    if kind == "spheres":
        radii = (0.1 + 0.5 * dice.random(4)).astype(np.float32)
        return s.Spheres("balls", dice.normal(0, 0.7, (4, 3)).astype(np.float32), radii)
    if kind == "polygons":
        angle, radius = np.arange(9) * 2 * np.pi / 9, dice.uniform(0.2, 0.9, 9)
        level = np.full(9, dice.uniform(0.1, 0.5))  # at 0 a pattern of places is rounding alone
        flat = np.stack([radius * np.cos(angle), radius * np.sin(angle), level], 1)
        return s.Polygons(
            "star",
            flat.astype(np.float32),
            np.array([0, 9], np.uint32),
            np.arange(9, dtype=np.uint32),
        )
    if kind == "strands":
        radii = (0.2 * dice.random(12)).astype(np.float32)
        starts = np.delete(np.arange(11, dtype=np.uint32), (3, 7))  # three chains of four
        return s.Strands("hair", dice.normal(0, 0.7, (12, 3)).astype(np.float32), radii, starts)
    return _soup(dice, kind == "smooth")


@st.composite
def instances(draw: Any, dice: Dice, number: int, materials: int) -> s.Instances:
    count = draw(few)
    rows = np.concatenate(
        [np.eye(3) + dice.normal(0, 0.3, (count, 3, 3)), dice.normal(0, 1.2, (count, 3, 1))], 2
    )
    seen = {f"visible_{by}": draw(mostly) for by in SEEN_BY}
    moved = np.stack([rows, rows + dice.normal(0, 0.2, rows.shape)])
    return s.Instances(
        f"i{number}",
        number,
        rows,
        (draw(st.integers(0, materials - 1)),),
        holdout=not draw(mostly),
        light_set=draw(st.integers(0, 1)),
        receivers=draw(sets),
        blockers=draw(sets),
        catcher=not draw(mostly),
        motion=None if draw(mostly) else moved,
        geometry_offset=draw(st.sampled_from((0.1, 0.1, 0.1, 0.0, 0.5))),
        shading_offset=draw(st.sampled_from((0.0, 0.0, 0.0, 0.4, 1.0))),
        **seen,
    )


@st.composite
def lights(draw: Any, dice: Dice) -> s.Light:
    kind = draw(st.sampled_from(LAMPS))
    frame = look_at(dice.normal(0, 1, 3) + (0, 0, 5), dice.normal(0, 0.5, 3))
    soft = draw(flags)
    map_ = (0.2 * dice.random((8, 16, 3))).astype(np.float32) if kind == "DOME" else None
    return s.Light(
        "lamp",
        kind,
        frame,
        rgb(dice),
        {"SUN": 3.0, "DOME": 1.0}.get(kind, 300.0),
        radius=0.2 if soft else 0.0,
        soft_falloff=draw(flags),
        angle=0.05 if soft else 0.0,
        spot_size=1.0,
        spot_blend=draw(st.sampled_from((0.0, 0.3))),
        shape=draw(st.sampled_from(s.LIGHT_SHAPES)),
        size_x=0.8,
        size_y=0.5,
        spread=draw(st.sampled_from((np.pi, 1.0, 0.05))),
        cast_shadow=draw(mostly),
        visible_camera=draw(flags),
        visible_mirror=draw(flags),
        visible_transmission=draw(flags),
        radiance=map_,
        receivers=draw(sets),
        blockers=draw(sets),
        lights_matt=draw(mostly),
        lights_gloss=draw(mostly),
        lights_media=draw(mostly),
    )


@st.composite
def textures(draw: Any, dice: Dice) -> s.Texture:
    is_float = draw(flags)
    pixels = checker(4).pixels
    if is_float:
        pixels = dice.random((3, 5, 4)).astype(np.float32)
    return s.Texture(
        "picture",
        pixels,
        "LINEAR" if is_float else draw(st.sampled_from(s.ENCODINGS)),
        draw(st.sampled_from(s.EXTENSIONS)),
        draw(st.sampled_from(s.INTERPOLATIONS)),
    )


@st.composite
def scenes(draw: Any) -> s.Scene:
    dice = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    pictures = tuple(draw(st.lists(textures(dice), max_size=2)))
    surfaces = tuple(draw(st.lists(materials(dice, len(pictures)), min_size=1, max_size=3)))
    kinds = draw(st.lists(st.sampled_from(GEOMETRIES), min_size=1, max_size=3))
    placed = tuple(draw(instances(dice, k, len(surfaces))) for k in range(len(kinds)))
    lamps = draw(st.lists(lights(dice), min_size=1, max_size=3))
    world = s.World(rgb(dice), rgb(dice), draw(flags), medium=draw(media(dice, 0.1)))
    kind = draw(st.sampled_from(FLAT_CAMERAS))
    half = 0.4 if kind == "PERSPECTIVE" else 2.4
    camera = s.Camera(
        kind,
        look_at((0.5, -6, 2), (0, 0, 0)),
        (-half, half, -0.75 * half, 0.75 * half),
        SIZE,
        lens=None if draw(mostly) else s.Lens(0.1, 6.0, draw(st.sampled_from((0, 5))), 0.3, 1.5),
    )
    return s.Scene(
        camera,
        tuple(geometry(dice, kind) for kind in kinds),
        placed,
        surfaces,
        pictures,
        _with_one_sky(lamps),
        world,
    )


def _with_one_sky(lamps: list[s.Light]) -> tuple[s.Light, ...]:
    """A scene has one DOME light at most."""
    skies = [lamp for lamp in lamps if lamp.kind == "DOME"]
    return tuple(lamp for lamp in lamps if lamp.kind != "DOME" or lamp is skies[0])


@st.composite
def settings(draw: Any) -> Settings:
    return Settings(
        samples=draw(st.sampled_from((1, 1, 2))),
        light_samples=draw(few),
        max_bounces=draw(st.integers(0, 3)),
        illumination=draw(st.sampled_from(("PHYSICAL", "PHYSICAL", "CLASSIC"))),
        reflections=draw(st.sampled_from(("OFF", "METALS", "ALL"))),
        diffuse_bounces=draw(st.sampled_from((0, 0, 1, 2))),
        soft_light=draw(st.sampled_from(("SHARED", "DEALT"))),
        world_light=draw(st.sampled_from(("OCCLUDED", "CONSTANT"))),
        mesh_light=draw(st.sampled_from(("ON", "OFF"))),
    )
