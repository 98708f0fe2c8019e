"""Surfaces and media of special kinds: the same bits by every instruction set, number of threads
and border, with light groups and passes and without, and one tracer beside the other.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from engine_scenes import grid_mesh
from glint.engine import scene as s
from glint.engine.program.graph import Graph
from glint.engine.program.operations_vector import VectorMeasure
from glint.engine.program.program import Program, compile_program
from glint.engine.program.table import BY_NAME
from native_tools import (
    assert_instruction_sets_agree,
    constant,
    draw,
    lamp,
    placed,
    square,
    view_from_above,
)

CLEAR = s.Lobe("TRANSPARENT", constant(0.9), ior=1.33)
MATT = s.Lobe("DIFFUSE", constant(0.4, 0.3, 0.2))
GLOSS = {"exponent": 60.0, "masking": 0.3}
TURN = 0.7
AXES = np.array(
    [[np.cos(TURN), 0, np.sin(TURN)], [0, 1, 0], [-np.sin(TURN), 0, np.cos(TURN)]]
)  # fmt: skip

LIGHTS = (
    lamp("SUN", axes=AXES, strength=2.0, angle=0.1, light_group=0),
    lamp("POINT", (-1.0, 0.5, 1.5), strength=60.0, radius=0.2, light_group=1),
)
GROUPS = ("sun", "lamp")
PASSES = ("Diffuse", "Specular", "Shadow", "Emission", "Diffuse Direct", "Diffuse Indirect")
PASSES += (
    "Diffuse Color",
    "Glossy Direct",
    "Glossy Color",
    "Transmission Color",
    "Normal",
    "Depth",
)
OPTIONS = {"samples": 2, "light_samples": 2, "max_bounces": 3}
BOUNCED = ("subsurface", "toon", "rough")
REGION = (3, 2, 9, 11)


def by_view() -> Program:
    """Stripes of colours by n·v, as thin films have them."""
    graph = Graph()
    normal, incoming = (graph.apply(BY_NAME[name])[0] for name in ("normal", "incoming"))
    cosine = graph.apply(
        BY_NAME["vector_measure"], incoming, normal, measure=VectorMeasure.DOT_PRODUCT
    )[0]
    table = tuple(float(abs(np.sin(k * k / 7))) for k in range(64))
    return compile_program(
        graph, [graph.apply(BY_NAME["ramp"], cosine, interpolates=1, table=table)[0]]
    )


def named() -> Program:
    """A colour of each point times one of each placement."""
    graph = Graph()
    point = graph.apply(BY_NAME["attribute"], attribute="Col", shift=0)[0]
    placement = graph.apply(BY_NAME["instance_value"], attribute="Tint")[0]
    none = graph.constant((0.0, 0.0, 0.0))
    share = graph.apply(BY_NAME["separate_xyz"], placement)[0]
    return compile_program(graph, [graph.apply(BY_NAME["scaled_sum"], point, share, none)[0]])


BY_PROGRAM = (s.Input(output=0),)
LOOKS = {
    "subsurface": s.Material(
        "skin", (s.Lobe("DIFFUSE", constant(0.8, 0.5, 0.3), radius=(0.03, 0.02, 0.0)),)
    ),
    "gas": s.Material(
        "gas",
        (s.Lobe("TRANSPARENT", constant(1.0)),),
        medium=s.Medium((0.3, 0.2, 0.1), emission=(1.0, 2.0, 0.5)),
    ),
    "toon": s.Material(
        "toon",
        (
            s.Lobe("TOON_DIFFUSE", constant(0.5, 0.3, 0.2), size=0.4, smooth=0.2),
            s.Lobe("TOON_SPECULAR", constant(0.2), size=0.2, smooth=0.05),
        ),
    ),
    "edge": s.Material(
        "metal",
        (
            s.Lobe("SPECULAR", constant(0.8, 0.5, 0.3), **GLOSS),
            s.Lobe("SPECULAR", constant(0.2, 0.5, 0.7), schlick=True, **GLOSS),
            s.Lobe("SPECULAR", constant(-0.4, -0.2, -0.1), edge=True, **GLOSS),
        ),
    ),
    "rough": s.Material(
        "clay",
        (
            MATT,
            s.Lobe("OREN_NAYAR", constant(0.3)),
            s.Lobe("OREN_NAYAR_MULTIPLE", constant(0.1, 0.2, 0.3)),
        ),
    ),
    "hole": s.Material("hole", (s.Lobe("HOLDOUT", constant(0.3)), CLEAR)),
    "dense": s.Material("dense", (CLEAR, s.Lobe("SPECULAR", constant(0.2), **GLOSS))),
    "film": s.Material(
        "film",
        (s.Lobe("MIRROR", BY_PROGRAM), s.Lobe("SPECULAR", BY_PROGRAM, **GLOSS), MATT),
        program=by_view(),
    ),
    "points": s.Material("points", (s.Lobe("DIFFUSE", BY_PROGRAM),), program=named()),
}


@cache
def scene_of(name: str, in_groups: bool) -> s.Scene:
    """A bumpy closed body, or a cloud of points, twice, over a floor."""
    sheet = grid_mesh(12, 1.0)
    u, v = np.pi * sheet.vertices[:, 0], np.pi / 2 * sheet.vertices[:, 1]
    r = 0.6 + 0.05 * np.sin(3 * u)
    points = np.stack([r * np.cos(v) * np.cos(u), r * np.cos(v) * np.sin(u), r * np.sin(v)], -1)
    body: s.Geometry = s.Mesh("body", points.astype(np.float32), sheet.triangles)
    if name == "points":
        places = np.float32([[-0.4, 0, 0], [0.4, 0.1, 0.2], [0, -0.5, 0.1]])
        colors = s.Attribute("Col", s.FACE, np.float32(np.eye(3, 4) * 0.6 + 0.2))
        body = s.Spheres("cloud", places, np.float32([0.4, 0.3, 0.2]), attributes=(colors,))
    matrices = np.stack([np.eye(3, 4), np.eye(3, 4)])
    matrices[1, :, 3] = (0.5, 0.6, -0.2)
    tints = np.float32([[0.9, 0, 0, 1], [0.4, 0, 0, 1]])
    group = 1 if in_groups else -1
    things = s.Instances("body", 0, matrices, (0,), values={"Tint": tints}, light_group=group)
    floor = s.Material("floor", (MATT, s.Lobe("SPECULAR", constant(0.1), fresnel=True, ior=1.5)))
    lights = LIGHTS if in_groups else tuple(replace(x, light_group=-1) for x in LIGHTS)
    return s.Scene(
        view_from_above(),
        (body, square()),
        (things, placed(1, (1,), z=-0.7)),
        (LOOKS[name], floor),
        lights=lights,
        light_groups=GROUPS if in_groups else (),
    )


def picture(name: str, whole: bool, **more) -> dict[str, np.ndarray]:
    """Its passes; whole: in light groups, with all of them."""
    names = PASSES if whole else ()
    bounces = {"diffuse_bounces": int(name in BOUNCED)}
    return dict(draw(scene_of(name, whole), *names, **OPTIONS | bounces | more).passes)


def hashes() -> str:
    """Of all, in a line."""
    found = []
    for name in LOOKS:
        passes = picture(name, True)
        parts = b"".join(passes[key].tobytes() for key in sorted(passes))
        found.append(f"{name} {hashlib.sha256(parts).hexdigest()[:16]}")
    return "; ".join(found)


def test_instruction_sets_change_nothing() -> None:
    assert_instruction_sets_agree(hashes)


@pytest.mark.parametrize("whole", [False, True], ids=["plain", "with parts"])
@pytest.mark.parametrize("name", LOOKS)
def test_threads_and_borders_change_nothing(name: str, whole: bool) -> None:
    alone, shared, part = (
        picture(name, whole, **x) for x in ({"threads": 1}, {"threads": 3}, {"region": REGION})
    )
    assert alone.keys() == part.keys() and len(alone) >= (len(PASSES) + 2 if whole else 1)
    x, y, right, top = REGION
    for key, values in alone.items():
        np.testing.assert_array_equal(shared[key], values, key)
        np.testing.assert_array_equal(part[key], values[y:top, x:right], key)


@pytest.mark.parametrize("name", LOOKS)
def test_parts_change_no_picture(name: str) -> None:
    whole = picture(name, True)["Combined"]
    if name in BOUNCED:  # whose points stand for others of their group
        plain = draw(scene_of(name, True), **OPTIONS | {"diffuse_bounces": 1}).passes["Combined"]
    else:
        plain = picture(name, False)["Combined"]
    np.testing.assert_allclose(whole, plain, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", LOOKS)
def test_both_tracers_draw_the_same(name: str) -> None:
    """But for pixels of which rounding says which surface is met."""
    core, truth = (picture(name, True, backend=x) for x in ("NATIVE", "NUMPY"))
    assert core.keys() == truth.keys()
    for key, values in truth.items():
        wide = 1e-4 * (np.abs(values) + np.abs(values[values < 1e9]).max(initial=1e-6))
        assert (np.abs(core[key] - values) > wide).any(-1).mean() <= 0.01, key
