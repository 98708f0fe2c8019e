"""Lights in highlights beside things that mirrors do not show, or that cast no shadow: drawn
directions meet what mirrors show.
"""

from __future__ import annotations

import functools
import hashlib
from dataclasses import replace

import numpy as np
import pytest

from glint.engine import scene as s
from native_tools import (
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

BACKENDS = ("NATIVE", "NUMPY")
LID = 1.2
"""How high a black square lies over the floor; the camera does not see it."""
HIDDEN = {"mirror": {"visible_mirror": False}, "shadow": {"visible_shadow": False}}
GLOW = material(s.Lobe("EMISSION", constant(5.0, 4.0, 3.0)))


def sky() -> s.Light:
    radiance = np.random.default_rng(3).uniform(0.5, 1.5, (8, 16, 3)).astype(np.float32)
    return s.Light("sky", "DOME", np.eye(3, 4), radiance=radiance)


LIGHTS = {
    "sky": sky(),
    "sphere": lamp("POINT", (0.2, 0.1, 2.5), strength=80.0, radius=0.5),
    "sun": lamp("SUN", strength=3.0, angle=1.5),
    "panel": lamp("AREA", (0.1, 0.0, 2.0), strength=30.0, size_x=2.0, size_y=2.0),
}


def under_a_lid(
    name: str,
    exponent: float = 300.0,
    lid: s.Material | None = None,
    matt: float = 0.1,
    **flags: bool,
) -> s.Scene:
    """A floor, a lid that covers what it mirrors, and a light above both; "glow": a square that
    glows.
    """
    floor = material(
        s.Lobe("SPECULAR", constant(0.8, 0.7, 0.5), exponent), s.Lobe("DIFFUSE", constant(matt))
    )
    black = lid or material(s.Lobe("DIFFUSE", constant(0.0)))
    blocks = [
        placed(),
        placed(1, (1,), z=LID, visible_camera=False, **flags),
    ]
    if name == "glow":
        blocks.append(placed(1, (2,), z=3.0, visible_camera=False))
    lights = () if name == "glow" else (LIGHTS[name],)
    return s.Scene(
        view_from_above(12),
        (square(), square(3.0)),
        tuple(blocks),
        (floor, black, GLOW),
        (),
        lights,
        s.World(),
    )


@pytest.mark.parametrize("hidden", HIDDEN)
@pytest.mark.parametrize("name", [*LIGHTS, "glow"])
def test_both_tracers_draw_the_same(name: str, hidden: str) -> None:
    """Behind a lid that is solid, and one of coloured glass; lamps by themselves and shared."""
    clear = material(s.Lobe("TRANSPARENT", constant(0.9, 0.5, 0.2)))
    for lid, shared in ((None, 0), (clear, 0), (None, 1)):
        scene = under_a_lid(name, lid=lid, **HIDDEN[hidden])
        if shared and name in ("sphere", "panel"):
            scene = replace(scene, lights=(scene.lights[0],) * 3)
        films = [
            draw(
                scene,
                "Specular",
                "Shadow",
                samples=2,
                light_samples=3,
                mesh_light="ON",
                lamp_shadows=shared,
                backend=backend,
            )
            for backend in BACKENDS
        ]
        for passed in ("Combined", "Specular", "Shadow"):
            one, other = (np.asarray(film.passes[passed], float) for film in films)
            assert np.abs(one - other).max() <= 2e-5 * max(np.abs(other).max(), 1e-3)


@functools.cache
def hashes() -> str:
    """Of pictures of all lights."""
    names = [*LIGHTS, "glow"]
    scenes = [under_a_lid(name, visible_mirror=False) for name in names]
    pictures = [color(scene, samples=3, light_samples=3).tobytes() for scene in scenes]
    return hashlib.sha256(b"".join(pictures)).hexdigest()


def test_instruction_sets_change_nothing() -> None:
    assert_instruction_sets_agree(hashes)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", [*LIGHTS, "glow"])
def test_highlights_shine_through_what_mirrors_do_not_show(name: str, backend: str) -> None:
    """As if the lid were not there; and what casts no shadow hides lights where mirrors show it."""
    samples = {"NATIVE": 16, "NUMPY": 4}[backend]  # of the same points in all three
    size = {"samples": samples, "light_samples": 8, "mesh_light": "ON", "backend": backend}
    free = under_a_lid(name, 1e5, matt=0.0)
    free = replace(free, instances=(free.instances[0], *free.instances[2:]))
    seen, through, covered = (
        color(scene, **size).mean()
        for scene in (
            free,
            under_a_lid(name, 1e5, matt=0.0, visible_mirror=False),
            under_a_lid(name, 1e5, matt=0.0, visible_shadow=False),
        )
    )
    assert seen > 0
    assert through == pytest.approx(seen, rel=0.05)
    assert covered < 0.1 * seen
