"""Light that bounces along the paths of the pixels: closed forms, the path tracer's means, one
tracer beside the other, and that neither threads nor borders nor instruction sets change a bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bounced_scenes import ALBEDO, HERE, lamp, matt, room
from engine_scenes import checker, look_at
from glint import engine
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer, explanation_lines, summary
from glint.engine.explained import Ray
from glint.engine.film import LIGHTING, PARTS
from glint.engine.lights.interleaving import SIDE
from glint.engine.native import packing_settings
from glint.engine.native import render as native_render
from glint.engine.reference import stage, trace
from glint.engine.sampling import interleaving_classes
from native_tools import assert_instruction_sets_agree, constant, needs_core, view_from_above
from path_tracer import trace_paths
from test_bump_shadow import bumpy
from test_fibres import TANGENT, of_strands
from test_path_tracer import box, glowing, level, placed

pytestmark = needs_core
BACKENDS = ("NATIVE", "NUMPY")
CLASSES = SIDE * SIDE
"""Of pixels in a block, each with samples of its own."""


def film(scene: s.Scene, bounces: int, backend: str = "NATIVE", **more) -> engine.Film:
    plan = {"samples": 16, "light_samples": 2, "filter_width": 0.0, "soft_light": "DEALT"}
    chosen = {**plan, "backend": backend, "diffuse_bounces": bounces, **more}
    return engine.render(scene, engine.Settings(**chosen))


def color(scene: s.Scene, bounces: int, backend: str = "NATIVE", **more) -> np.ndarray:
    return film(scene, bounces, backend, **more).combined[..., :3].astype(np.float64)


def noise_of(values: np.ndarray) -> np.ndarray:
    """(3,) the standard error of the mean of (h, w, 3) what dealt samples are off by: pixels of a
    class see the same, others what is left of one sequence.
    """
    rows, columns, _ = values.shape
    classes = interleaving_classes((0, columns), (0, rows), SIDE)
    means = [values.reshape(-1, 3)[classes == k].mean(0) for k in range(CLASSES)]
    return np.std(means, axis=0, ddof=1) / np.sqrt(CLASSES)


# --- closed forms


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_bounce_in_a_ball_brings_its_power_of_the_albedo(backend: str) -> None:
    """A lamp in the middle of a matt ball: all see as much of it, and all of the ball. The first
    bounce has no noise, the second the roulette's: of numbers that are spread evenly as many go on
    as their share says but for one, of the third's but for chance.
    """
    samples = 4 if backend == "NUMPY" else 64
    one = ALBEDO * 100 / (4 * np.pi**2)
    pictures = [color(room(lamp()), n, backend, samples=samples) for n in range(4)]
    added = np.diff([np.zeros_like(pictures[0]), *pictures], axis=0)
    for bounces in (0, 1):
        np.testing.assert_allclose(
            added[bounces], np.broadcast_to(one * ALBEDO**bounces, (8, 8, 3)), rtol=1e-5
        )
    goes_on, drawn = ALBEDO.max(), CLASSES * samples
    off = {2: 1 / (drawn * goes_on), 3: 4 * np.sqrt((goes_on**-2 - 1) / drawn)}
    for bounces, most in off.items():
        mean = added[bounces].mean((0, 1)) / (one * ALBEDO**bounces)
        assert (np.abs(mean - 1) <= most + 1e-5).all(), bounces


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_between_two_planes_comes_back_every_other_time(backend: str) -> None:
    """A sun lights the floor alone, as if there were no roof."""
    planes = (level("floor", 1e5, 0), matt((0.5,) * 3)), (level("roof", 1e5, 1), matt((0.6,) * 3))
    sun = lamp("SUN", strength=np.pi)
    scene = placed(view_from_above(8, 0.5, 0.5), *planes, lights=(sun,))
    floor, roof = scene.instances
    scene = replace(scene, instances=(floor, replace(roof, visible_shadow=False)))
    samples = 4
    means = [color(scene, n, backend, samples=samples).mean() for n in range(4)]
    straight = 0.5
    np.testing.assert_allclose(means[:2], straight, rtol=1e-5)
    np.testing.assert_allclose(means[2], means[3], rtol=1e-5)
    thrown = straight * 0.6 * 0.5
    assert abs(means[2] - straight - thrown) <= thrown / (CLASSES * samples * 0.6) + 1e-5


def test_a_ball_spreads_what_glows_in_it_evenly() -> None:
    """An integrating sphere: from each point the cosine finds all others alike, so that a bounce
    brings the same everywhere, wherever the light falls first. A black box glows there, which takes
    little of what bounces.
    """
    size, glow = 0.02, 100.0
    scene = room(more=(box(size),), materials=(glowing(glow),))
    scene = replace(scene, camera=replace(scene.camera, resolution=(16, 16)))
    area = 6 * (2 * size) ** 2
    one, passed = ALBEDO * glow * area / (4 * np.pi), 1 - area / (4 * np.pi)
    pictures = [color(scene, n, samples=256) for n in range(4)]
    for bounces, added in enumerate(np.diff(pictures, axis=0), 1):
        truth, noise = one * (passed * ALBEDO) ** bounces, noise_of(added)
        assert (np.abs(added.mean((0, 1)) - truth) <= 4 * noise).all(), bounces
        assert (noise < 0.04 * truth).all(), bounces


@pytest.mark.parametrize("backend", BACKENDS)
def test_thin_fog_in_a_ball_scatters_what_its_wall_throws_where_it_is_asked_for(
    backend: str,
) -> None:
    """The wall is as bright all over, so that fog adds its share of that along each ray, however
    it scatters.
    """
    share = np.array([2e-3, 1e-3, 5e-4])
    fog = s.World(medium=s.Medium(scattering=tuple(share), anisotropy=0.4))
    scene = replace(room(lamp()), world=fog)
    samples = 4 if backend == "NUMPY" else 256
    more = {"samples": samples, "passes": frozenset({"Volume Direct", "Volume Indirect"})}
    without, with_it = (film(scene, 1, backend, volume_bounces=n, **more) for n in (0, 1))
    assert not without.passes["Volume Indirect"].any()
    given = with_it.passes["Volume Indirect"].astype(float)
    added = with_it.combined[..., :3].astype(float) - without.combined[..., :3]
    cells = (np.arange(8) + 0.5) / 4 - 1
    x, y = np.meshgrid(cells, cells)
    z = -1 / np.sqrt(x * x + y * y + 1)  # of the unit ray from (0, 0, 0.3)
    way = -0.3 * z + np.sqrt((0.3 * z) ** 2 + 1 - 0.09)
    truth = share * ALBEDO * 100 / (4 * np.pi**2) * way.mean()
    noise = noise_of(given)
    assert (np.abs(given.mean((0, 1)) - truth) <= 4 * noise + 4e-3 * truth).all()
    assert (noise < {"NATIVE": 0.02, "NUMPY": 0.1}[backend] * truth).all()
    np.testing.assert_allclose(given.mean((0, 1)), added.mean((0, 1)), rtol=0.01)
    np.testing.assert_allclose(
        with_it.passes["Volume Direct"], without.passes["Volume Direct"], rtol=1e-6
    )


def test_thin_fog_in_a_ball_lights_its_wall() -> None:
    """As much as it takes of a small lamp's light on its way of 1; and it dims what bounces by that
    and by the ways to there, 4/3 in the mean.
    """
    share = np.array([2e-3, 1e-3, 5e-4])
    fog = s.World(medium=s.Medium(scattering=tuple(share)))
    clear = room(lamp(radius=0.01))
    plan = {"samples": 1024, "passes": frozenset({"Diffuse Indirect"})}
    given, before = (
        film(scene, 1, **plan).passes["Diffuse Indirect"].astype(float)
        for scene in (replace(clear, world=fog), clear)
    )
    taken = share * 100 / (4 * np.pi**2)
    off = (given - before).mean((0, 1)) - taken * (1 - ALBEDO * (1 + 4 / 3))
    assert (np.abs(off) <= 4 * noise_of(given) + 0.015 * taken).all()
    assert (noise_of(given) < 0.02 * taken).all()


# --- beside the path tracer


def corner(*things: tuple[s.Geometry, s.Material], size: int = 12, **more) -> s.Scene:
    """A floor and two walls, with a soft lamp, and things before them."""
    grey, red = matt((0.7, 0.7, 0.7)), matt((0.7, 0.2, 0.1))
    sides = []
    for axis in range(3):
        flat = level(f"side {axis}", 1.0, -1.0)
        sides.append(replace(flat, vertices=np.roll(flat.vertices, axis + 1, 1)))
    view = s.Camera(
        "PERSPECTIVE", look_at((3, 2.6, 2.2), (-0.3,) * 3), (-0.36, 0.36) * 2, (size,) * 2
    )
    bulb = lamp("POINT", (0.8, 0.3, 0.9), radius=0.25, color=(1.0, 0.9, 0.7))
    look = (grey, red, grey)
    scene = placed(view, *zip(sides, look, strict=True), *things)
    return replace(scene, **{"lights": (bulb,), **more})


SKY = s.Light("sky", "DOME", HERE, radiance=np.full((4, 8, 3), 0.4, np.float32))
SKIES = {"lights": (*corner().lights, SKY), "world": s.World(background=(0.4,) * 3)}


BODY = box(0.4), matt((0.3, 0.5, 0.8))


@cache
def truth(bounces: int) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard errors. Paths meet the sky, where lamps are asked for: a bounce later."""
    by_lamp = trace_paths(corner(BODY), 256, bounces=bounces, filter_width=0.0)
    sky = corner(BODY, **{**SKIES, "lights": (SKY,)})
    by_sky = trace_paths(sky, 256, seed=1, bounces=bounces + 1, filter_width=0.0)
    return by_lamp[0] + by_sky[0], np.hypot(by_lamp[1], by_sky[1])


def residuals(bounces: int, **more) -> tuple[np.ndarray, np.ndarray]:
    """(h, w, 3) by how much the core's picture is off, and the truth's standard errors."""
    mean, error = truth(bounces)
    return color(corner(BODY, **SKIES), bounces, **more) - mean, error


@pytest.mark.parametrize("kind", ["DEALT", "RESOLVED"])
@pytest.mark.parametrize("bounces", [0, 1, 3])
def test_the_mean_is_the_path_tracers(bounces: int, kind: str) -> None:
    """But for the noise of both."""
    off, errors = residuals(bounces, samples=64, soft_light=kind)
    dealt, _ = residuals(bounces, samples=64)
    own = np.sqrt((errors**2).sum((0, 1))) / off[..., 0].size
    noise = np.hypot(noise_of(dealt), own)
    assert (np.abs(off.mean((0, 1))) <= 4 * noise).all()
    assert (noise < 0.01 * truth(bounces)[0].mean((0, 1))).all()


@pytest.mark.parametrize("kind", ["DEALT", "RESOLVED"])
def test_more_samples_are_nearer_to_the_path_tracer(kind: str) -> None:
    """Squares of what they are off by, beyond the truth's own noise."""
    errors = []
    for samples in (1, 4, 16, 64):
        off, noise = residuals(3, samples=samples, soft_light=kind)
        errors.append((off**2).mean() - (noise**2).mean())
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.5 * errors[1]
    assert errors[3] < 0.5 * errors[2] + 0.2 * (truth(3)[1] ** 2).mean()


# --- both tracers


MATT = s.Lobe("DIFFUSE", constant(0.4, 0.3, 0.2))
CLEAR = s.Lobe("TRANSPARENT", constant(0.5, 0.6, 0.7))
SHINE = s.Lobe("SPECULAR", constant(0.3), 30.0, masking=0.25)
FOG = s.Medium((0.1, 0.2, 0.3), (0.3, 0.2, 0.1), anisotropy=0.3)
CHECKED = s.Lobe("DIFFUSE", (s.Input(texture=0, uv="UVMap"),))


def thing(*lobes: s.Lobe, **more) -> s.Scene:
    """The corner with a box of a material."""
    return corner((box(0.4), s.Material("thing", lobes, **more)))


def linked() -> s.Scene:
    """Two lamps, each for some things; others are not met by what bounces."""
    scene = thing(MATT)
    (bulb,) = scene.lights
    other = replace(lamp("AREA", (0.0, 0.5, 0.9), size_x=0.5, size_y=0.5), receivers=0b10)
    floor, wall, side, body = scene.instances
    instances = (
        replace(floor, light_set=1),
        wall,
        replace(side, visible_diffuse=False),
        replace(body, light_set=1, blockers=0b1, shading_offset=0.5),
    )
    return replace(scene, lights=(replace(bulb, blockers=0b10), other), instances=instances)


def hair(**more) -> s.Scene:
    points = np.float32([(-0.3, 0, -0.9), (-0.2, 0.1, 0.6), (0.4, -0.2, -0.9), (0.3, 0.2, 0.5)])
    strands = s.Strands("hair", points, np.full(4, 0.15, np.float32), np.uint32([0, 2]))
    fibre = s.Lobe("FIBRE_DIFFUSE", constant(0.5, 0.4, 0.3))
    return corner((strands, s.Material("hair", (fibre,))), **more)


def fibres() -> s.Scene:
    """Strands that let light pass, before others that dim it, in fog."""
    scene = hair()
    lobes = (
        s.Lobe("FIBRE_SPECULAR", constant(0.3), 5.0, fibre_output=0),
        s.Lobe("FIBRE_TRANSMISSION", constant(0.4, 0.3, 0.2), 3.0, fibre_output=0),
        s.Lobe("TRANSPARENT", constant(0.3, 0.2, 0.1)),
    )
    *matt, hairs = scene.materials
    own = of_strands(*(replace(lobe, fibre_output=0) for lobe in hairs.lobes), *lobes)
    *shapes, strands = scene.geometries
    ways = np.repeat(np.diff(strands.vertices.reshape(2, 2, 3), axis=1), 2, 1).reshape(4, 3)
    along = s.Attribute(
        TANGENT,
        s.POINT,
        np.float32(np.column_stack([ways / np.linalg.norm(ways, axis=1)[:, None], np.zeros(4)])),
    )
    strands = replace(strands, attributes=(along,))
    world = replace(scene.world, medium=FOG)
    return replace(scene, geometries=(*shapes, strands), materials=(*matt, own), world=world)


def caught() -> s.Scene:
    scene = thing(MATT)
    floor, *others = scene.instances
    return replace(scene, instances=(replace(floor, catcher=True), *others))


def textured() -> s.Scene:
    scene = thing(CHECKED, CLEAR)
    uv = s.Attribute("UVMap", s.POINT, np.float32(box().vertices[:, :2]))
    *sides, body = scene.geometries
    body = replace(body, attributes=(uv,))
    return replace(scene, geometries=(*sides, body), textures=(checker(4),))


def grouped() -> s.Scene:
    scene = thing(MATT, SHINE, s.Lobe("EMISSION", constant(2.0, 1.0, 0.5)))
    groups = tuple(replace(x, light_group=k) for k, x in enumerate(SKIES["lights"]))
    glow = tuple(replace(x, light_group=2) for x in scene.instances)
    return replace(scene, lights=groups, instances=glow, light_groups=("bulb", "sky", "glow"))


SCENES: dict[str, Callable[[], s.Scene]] = {
    "matt": lambda: thing(MATT),
    "mirror": lambda: thing(s.Lobe("MIRROR", constant(0.8)), MATT),
    "glass": lambda: thing(
        s.Lobe("MIRROR", ior=1.5, fresnel=True), s.Lobe("REFRACTION", ior=1.5, fresnel=True)
    ),
    "rough gloss": lambda: thing(MATT, SHINE),
    "rough gloss under a sky": lambda: corner(
        (box(0.4), s.Material("thing", (MATT, SHINE))), **SKIES
    ),
    "leaf": lambda: thing(MATT, s.Lobe("TRANSLUCENT", constant(0.2, 0.4, 0.1))),
    "bumps": lambda: corner((box(0.4), bumpy((MATT, SHINE), "GGX"))),
    "groups": grouped,
    "textures": textured,
    "strands": hair,
    "fibres": fibres,
    "fog": lambda: replace(thing(MATT), world=s.World(medium=FOG)),
    "skin": lambda: thing(replace(MATT, radius=(0.2, 0.1, 0.05)), SHINE),
    "catcher": caught,
    "linked": linked,
    "sky": lambda: corner((box(0.4), s.Material("m", (MATT, CLEAR))), **SKIES),
}
PLAN = {"samples": 2, "max_bounces": 2, "reflections": "ALL", "volume_bounces": 1}
PASSES = frozenset({*PARTS, *LIGHTING})
EDGES = 2 / 144
"""Share of the pixels where rounding says what a ray meets."""


@cache
def passes(name: str, bounces: int, backend: str = "NATIVE") -> dict[str, np.ndarray]:
    found = film(SCENES[name](), bounces, backend, passes=PASSES, **PLAN)
    return {key: values.astype(np.float64) for key, values in found.passes.items()}


@pytest.mark.parametrize(
    ("name", "bounces"),
    [*((name, 3) for name in SCENES), *(("matt", n) for n in (0, 1, 2)), ("strands", 1)],
)
def test_both_tracers_draw_the_same(name: str, bounces: int) -> None:
    core, reference = (passes(name, bounces, backend) for backend in BACKENDS)
    assert core.keys() == reference.keys()
    for key, values in reference.items():
        near = 1e-4 * (np.abs(values) + np.abs(values).mean() + 1e-6)
        assert (np.abs(core[key] - values) > near).any(-1).mean() <= EDGES, key


@pytest.mark.parametrize("bounces", [0, 2])
def test_so_they_do_for_catchers_in_fog(bounces: int) -> None:
    """Fog before and behind them is lit, and shaded by all things."""
    scene = SCENES["catcher"]()
    fog = s.Medium(scattering=(0.05, 0.1, 0.2), anisotropy=0.2)
    scene = replace(scene, world=replace(scene.world, medium=fog))
    core, reference = (color(scene, bounces, backend, **PLAN) for backend in BACKENDS)
    near = 1e-4 * (reference + reference.mean())
    assert (np.abs(core - reference) > near).any(-1).mean() <= EDGES


def test_so_they_do_where_nothing_is_dealt(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with samples beyond all tables: pixels mix what wide lobes reflect, with all its light."""
    for module in (packing_settings, stage, trace):
        monkeypatch.setattr(module, "interleaving", lambda scene, settings: 1)
    wide = s.Material("wide", (MATT, replace(SHINE, exponent=10.0)))
    scene = replace(thing(MATT), materials=(wide,) * 4)
    core, reference = (color(scene, 2, backend, **PLAN) for backend in BACKENDS)
    near = 1e-4 * (reference + reference.mean())
    assert (np.abs(core - reference) > near).any(-1).mean() <= EDGES


@pytest.mark.parametrize("name", SCENES)
def test_bounces_change_what_they_are_for(name: str) -> None:
    """So that no scene passes where there are none."""
    most = passes(name, 3)["Combined"][..., :3]
    least = film(SCENES[name](), 0, **PLAN).combined[..., :3]
    assert most.mean() > 1.02 * least.mean()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", ["mirror", "rough gloss", "groups", "strands", "skin"])
def test_passes_and_groups_sum_to_the_picture(name: str, backend: str) -> None:
    found = passes(name, 3, backend)
    combined = found["Combined"][..., :3]
    near = {"rtol": 0, "atol": 2e-6 * combined.max()}
    np.testing.assert_allclose(sum(found[part] for part in PARTS), combined, **near)
    light = found["Emission"] + found["Environment"]
    for surface in ("Diffuse", "Glossy", "Transmission"):
        given = found[f"{surface} Direct"] + found[f"{surface} Indirect"]
        light = light + found[f"{surface} Color"] * given
    np.testing.assert_allclose(light, combined, **near)


def test_light_groups_sum_to_the_picture() -> None:
    scene = SCENES["groups"]()
    found = passes("groups", 3)
    combined = found["Combined"][..., :3]
    groups = [found[f"Light Group {name}"] for name in scene.light_groups]
    assert all(group.any() for group in groups)
    np.testing.assert_allclose(sum(groups), combined, rtol=0, atol=2e-6 * combined.max())


@pytest.mark.parametrize("backend", BACKENDS)
def test_diffuse_indirect_is_what_bounces_add_where_nothing_mirrors(backend: str) -> None:
    none, all_ = (passes("matt", n, backend) for n in (0, 3))
    added = (all_["Combined"] - none["Combined"])[..., :3]
    thrown = all_["Diffuse Color"] * all_["Diffuse Indirect"]
    np.testing.assert_allclose(thrown, added, rtol=0, atol=1e-5 * all_["Combined"].max())
    assert not none["Diffuse Indirect"].any()
    np.testing.assert_allclose(all_["Diffuse Direct"], none["Diffuse Direct"], rtol=1e-6)


# --- one pixel explained


def rays_of(ray: Ray) -> Iterator[Ray]:
    yield ray
    for after in ray.follow:
        yield from rays_of(after)


EXPLAINED = ("matt", "mirror", "rough gloss", "leaf", "strands", "fibres", "fog", "skin", "catcher")


@pytest.mark.parametrize(
    ("name", "how"), [*((name, "DEALT") for name in EXPLAINED), ("sky", "SHARED")]
)
def test_an_explained_pixel_adds_up(name: str, how: str) -> None:
    scene, plan = SCENES[name](), {**PLAN, "samples": 1, "soft_light": how}
    picture = color(scene, 2, "NUMPY", **plan)
    settings = engine.Settings(**plan, light_samples=2, diffuse_bounces=2, filter_width=0.0)
    explainer = PixelExplainer(scene, settings)
    for x, y in ((5, 5), (6, 7), (2, 6), (9, 3)):
        np.testing.assert_allclose(
            explainer.pixel(x, y).color, picture[y, x], rtol=1e-5, atol=1e-9, err_msg=f"{x}, {y}"
        )


def test_an_explained_pixel_tells_where_light_bounces() -> None:
    settings = engine.Settings(samples=1, diffuse_bounces=2, soft_light="RESOLVED")
    explainer = PixelExplainer(SCENES["matt"](), settings)
    trees = [explainer.pixel(x, y) for y in range(3, 9) for x in range(3, 9)]
    ways = set()
    for tree in trees:
        text = "\n".join(explanation_lines(tree))
        for ray in rays_of(tree):
            bounces = [after for after in ray.follow if after.kind == "bounce"]
            assert len(bounces) <= 1
            if ray.hit is None:
                continue
            told = ray.hit.bounce
            assert told is not None and told.before == ray.depth and told.most == 2
            # a ray below the surface, as bent normals have it, goes nowhere
            assert not (bounces and told.ends)
            for after in bounces:
                np.testing.assert_allclose(after.origin, ray.hit.position, atol=1e-5)
                assert np.dot(after.direction, ray.hit.geometric_normal) > 0
            ways.add((told.before, told.ends))
            if told.before == 1:
                assert f"a ray goes on with a chance of {told.share:.6g}" in text
                assert ("is not: the path ends here" in text) == told.ends
            if told.before == 2:
                assert "from here light bounces 2 times to the pixel: Diffuse Bounces" in text
    assert ways == {(0, False), (1, False), (1, True), (2, True)}
    shares = [summary(tree) for tree in trees]
    assert any("(thrown on by other surfaces)" in line for line in shares)


# --- the same bits


MIXED = ("mirror", "groups", "strands", "leaf", "fog")


def hashes() -> str:
    """Of pictures of all, by this process's kernels."""
    found = b"".join(
        film(SCENES[name](), 3, soft_light="RESOLVED", **PLAN).combined.tobytes() for name in MIXED
    )
    return hashlib.sha256(found).hexdigest()


def test_instruction_sets_change_nothing() -> None:
    assert_instruction_sets_agree(hashes)


@pytest.mark.parametrize("kind", ["DEALT", "RESOLVED"])
@pytest.mark.parametrize("name", MIXED)
def test_threads_and_borders_change_nothing(name: str, kind: str) -> None:
    scene = replace(SCENES[name](), camera=replace(SCENES[name]().camera, resolution=(40, 36)))
    plan = {**PLAN, "soft_light": kind, "passes": frozenset({"Diffuse Indirect"})}
    x0, y0, x1, y1 = 5, 3, 38, 29
    alone, threads, part = (
        film(scene, 3, **plan, **more)
        for more in ({"threads": 1}, {"threads": 3}, {"region": (x0, y0, x1, y1)})
    )
    for key in ("Combined", "Diffuse Indirect"):
        whole = alone.passes[key]
        np.testing.assert_array_equal(threads.passes[key], whole, key)
        np.testing.assert_array_equal(part.passes[key], whole[y0:y1, x0:x1], key)


# --- the core's boundary


ROWS = np.zeros((1, 4, 3))
UNSOUND = {
    "no table": {"bounce_points": 0},
    "no levels": {"bounce_levels": 0},
    "too many levels": {"bounce_levels": 65},
    "no samples": {"bounce_count": 0},
    "beside the disc": ROWS + (0.8, 0.8, 0.0),
    "never goes on": ROWS + (0.0, 0.0, 1.0),
    "a share below none": ROWS + (0.0, 0.0, -0.1),
    "no number": ROWS + (np.nan, 0.0, 0.0),
    "no share": ROWS + (0.0, 0.0, np.nan),
}


def drawn_with(changes: dict | np.ndarray, monkeypatch: pytest.MonkeyPatch) -> engine.Film:
    """A picture by a table of bounces that Python would not make."""
    if isinstance(changes, np.ndarray):
        levels, count, _ = changes.shape
        changes = {
            "bounce_points": changes.ctypes.data,
            "bounce_levels": levels,
            "bounce_count": count,
        }

    def pack(*arguments, **more):
        found = packing_settings.pack_settings(*arguments, **more)
        for name, value in changes.items():
            setattr(found.data, name, value)
        return found

    monkeypatch.setattr(native_render, "pack_settings", pack)
    return film(room(lamp()), 2, samples=2)


@pytest.mark.parametrize("name", UNSOUND)
def test_unsound_tables_are_refused(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(engine.SceneError, match="no points for bounces of light, or points that"):
        drawn_with(UNSOUND[name], monkeypatch)


def test_a_table_of_few_begins_again(monkeypatch: pytest.MonkeyPatch) -> None:
    assert np.isfinite(drawn_with(ROWS, monkeypatch).combined).all()
