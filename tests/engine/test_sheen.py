"""SHEEN lobes: cosine lobes that are stretched and lean, in closed form and in both tracers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.reference.closures.sheen import sheen
from native_tools import lamp, needs_core
from surface_scenes import SUN, agree, balls, on_ball, plane

WIDTHS_AND_LEANS = [(1.0, 0.0), (0.5, 0.1), (0.1, 0.0), (0.3, 0.9)]


def lobe(width: float, lean: float, k: float = 0.7, **more) -> s.Lobe:
    return s.Lobe("SHEEN", (s.Input((k, k / 2, k / 4)),), width=width, lean=lean, **more)


def hemisphere(count: int = 800) -> tuple[np.ndarray, np.ndarray]:
    """(3, m) directions above z = 0 and the solid angle that each stands for."""
    z, turn = np.meshgrid((np.arange(count) + 0.5) / count, 2 * np.pi * np.arange(count) / count)
    z = z.ravel() ** 3  # denser at grazing angles
    size = 3 * ((np.arange(count) + 0.5) / count) ** 2
    weight = np.tile(size, count) * 2 * np.pi / count**2
    turn, across = turn.ravel(), np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z]), weight


@pytest.mark.parametrize(("width", "lean"), WIDTHS_AND_LEANS)
@pytest.mark.parametrize("nv", [0.99, 0.6, 0.1])
def test_it_reflects_all_of_a_uniform_world(width: float, lean: float, nv: float) -> None:
    """However it is stretched: the integral over the hemisphere is pi."""
    directions, weight = hemisphere()
    n = np.zeros_like(directions)
    n[2] = 1
    v = np.broadcast_to(np.array([[np.sqrt(1 - nv * nv)], [0.0], [nv]]), directions.shape)
    total = (sheen(n, v, directions, width, lean) * weight).sum()
    assert abs(total / np.pi - 1) < 0.01


def test_width_one_without_lean_is_lambert() -> None:
    scene = balls(lobe(1.0, 0.0))
    matt = balls(s.Lobe("DIFFUSE", (s.Input((0.7, 0.35, 0.175)),)))
    for backend in ("NATIVE", "NUMPY"):
        found, expected = (
            render(each, Settings(samples=1, backend=backend)).passes["Combined"]
            for each in (scene, matt)
        )
        np.testing.assert_allclose(found, expected, atol=1e-6)


@needs_core
@pytest.mark.parametrize(("width", "lean"), WIDTHS_AND_LEANS)
def test_a_ball_under_a_sun(width: float, lean: float) -> None:
    """Seen and lit from above l = v, so l lies along v: l_x = sin, n·l = cos."""
    n, inside = on_ball(0.9)
    film = render(balls(lobe(width, lean, 1.0)), Settings(samples=1, filter_width=0.0))
    cosine = n[..., 2][inside]
    square = (width * np.sqrt(1 - cosine**2) - lean * cosine) ** 2 + cosine**2
    agree(film.passes["Combined"][..., 0][inside], cosine * width**2 / square**2, 3e-6)


def scenes() -> dict[str, s.Scene]:
    dome = s.Light("sky", "DOME", np.eye(4)[:3], radiance=sky())
    lights = {
        "point": (lamp("POINT", strength=900.0, radius=0.0),),
        "ball": (lamp("POINT", strength=900.0, radius=0.5),),
        "area": (lamp("AREA", strength=900.0, size_x=2.0, size_y=1.0),),
        "sun": (SUN, lamp("SUN", strength=1.0, angle=0.2)),
        "sky": (dome,),
    }
    shine = s.Lobe("SPECULAR", (s.Input((0.3,) * 3),), 60.0, masking=0.2)
    matt = s.Lobe("DIFFUSE", (s.Input((0.2, 0.3, 0.4)),))
    made = {
        name: balls(lobe(0.3, 0.1), matt, shine, lights=chosen, world=s.World(ambient=(0.1,) * 3))
        for name, chosen in lights.items()
    }
    made["bare"] = balls(lobe(0.2, 0.05), lights=lights["ball"])
    glow = plane(lobe(0.3, 0.1), matt, lights=())
    return made | {"no light": glow}


def sky() -> np.ndarray:
    rows = np.linspace(0.1, 2.0, 16)[:, None, None]
    return np.broadcast_to(rows, (16, 32, 3)).astype(np.float32).copy()


@needs_core
@pytest.mark.parametrize("name", scenes())
def test_both_tracers_draw_the_same(name: str) -> None:
    passes = frozenset({"Diffuse", "Specular", "Shadow", "Denoising Albedo"})
    films = [
        render(scenes()[name], Settings(samples=4, passes=passes, backend=backend))
        for backend in ("NATIVE", "NUMPY")
    ]
    for each in films[0].passes:
        found, expected = (film.passes[each] for film in films)
        np.testing.assert_allclose(found, expected, rtol=2e-4, atol=2e-5, err_msg=each)


@needs_core
def test_numbers_of_a_program() -> None:
    graph = Graph()
    normal = graph.apply(BY_NAME["normal"])[0]
    x, y, _ = graph.apply(BY_NAME["separate_xyz"], normal)
    program = compile_program(graph, [x, y])
    scene = balls(lobe(0.8, 0.5, width_output=0, lean_output=1))
    material = replace(scene.materials[0], program=program)
    scene = replace(scene, materials=(material,))
    native, exact = (
        render(scene, Settings(samples=1, backend=backend)).passes["Combined"]
        for backend in ("NATIVE", "NUMPY")
    )
    np.testing.assert_allclose(native, exact, rtol=1e-4, atol=1e-5)
    assert np.isfinite(native).all() and native[..., 0].std() > 0.05


def test_explained_pixels_have_the_colours_of_the_picture() -> None:
    scene, settings = scenes()["ball"], Settings(samples=1)
    picture = render(scene, settings).passes["Combined"]
    explainer = PixelExplainer(scene, settings)
    for x, y in ((8, 8), (5, 9)):
        np.testing.assert_allclose(explainer.pixel(x, y).color, picture[y, x, :3], rtol=1e-3)


@needs_core
def test_threads_and_borders_change_no_bit() -> None:
    scene = scenes()["area"]
    whole = render(scene, Settings(samples=8, threads=1)).passes["Combined"]
    assert (whole == render(scene, Settings(samples=8, threads=3)).passes["Combined"]).all()
    part = render(scene, Settings(samples=8, region=(3, 4, 11, 12))).passes["Combined"]
    assert (whole[4:12, 3:11] == part).all()
