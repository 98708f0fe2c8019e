"""Hard lights: Lambert radiance and shadows as Cycles has them, pixel by pixel."""

from math import radians

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint_picture import BACKENDS, check_geometry, check_radiance, interior, render_pair

KEY = (3.0, -2.0, 4.5)
NEWER = {"exposure": 0.5} if hasattr(cycles.bpy.types.Light, "exposure") else {}
LIGHTS = {
    "point": ("POINT", {"energy": 400.0, "color": (1.0, 0.7, 0.4)}),
    "point_negative": ("POINT", {"energy": -400.0, "color": (1.0, 0.7, 0.4)}),
    "point_exposure": ("POINT", {"energy": 300.0, **NEWER}),
    "sun": ("SUN", {"energy": 2.5, "color": (0.5, 0.8, 1.0)}),
    "spot_hard": ("SPOT", {"energy": 900.0, "spot_size": radians(40), "spot_blend": 0.0}),
    "spot_soft": ("SPOT", {"energy": 900.0, "spot_size": radians(50), "spot_blend": 0.5}),
    "spot_full": ("SPOT", {"energy": 900.0, "spot_size": radians(170), "spot_blend": 1.0}),
    "point_through": ("POINT", {"energy": 400.0, "use_shadow": False}),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("light", LIGHTS)
def test_lambert_and_shadow(light, backend):
    kind, properties = LIGHTS[light]
    scene = cycles.empty_scene(128, 128)
    build.still_life(scene)
    build.add_camera(scene)
    build.add_light(scene, kind, KEY, **properties)
    pair = render_pair(scene, backend, f"light-{light}")
    inside = interior(pair)
    check_geometry(pair, inside)
    edge = spot_edge(pair, scene.objects["Light"])
    check_radiance(pair, inside & ~edge)
    if edge.any():
        check_radiance(pair, inside & edge, 2e-3)


def spot_edge(pair, light) -> np.ndarray:
    """Where a spot's smoothstep t²(3 − 2t) starts, 0 < t < 0.1: there 2 δt/t, its relative error
    from the rounding of a float32 cosine of 2e-7, which the blend makes δt = 2e-7/((1 − outer)
    blend) = 4e-6 of a 50° spot, is near and above 1e-4.
    """
    if light.data.type != "SPOT" or not light.data.spot_blend:
        return np.zeros(pair.cycles["Depth"].shape, bool)
    place = np.array(light.matrix_world)
    towards = pair.cycles["Position"] - place[:3, 3]
    cosine = -(towards @ place[:3, 2]) / np.linalg.norm(towards, axis=-1)
    outer = np.cos(light.data.spot_size / 2)
    step = (cosine - outer) / ((1 - outer) * light.data.spot_blend)
    return (step > 0) & (step < 0.1)


@pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (-1.5, 1.5, 2.0)])
@pytest.mark.parametrize("backend", BACKENDS)
def test_scaled_and_mirrored_light_object(backend, scale):
    """A cone is as wide as its object's scale across it by the scale along it; a mirrored one
    shines along its own -z.
    """
    scene = cycles.empty_scene(96, 96)
    build.still_life(scene)
    build.add_camera(scene)
    spot = build.add_light(scene, "SPOT", KEY, energy=900.0, spot_size=radians(45), spot_blend=0.0)
    spot.scale = scale
    pair = render_pair(scene, backend, "light-scaled-spot")
    check_radiance(pair, interior(pair))


@pytest.mark.parametrize("backend", BACKENDS)
def test_lights_add_up(backend):
    """Two lights at once give the sum of Cycles' pictures of each (one sample of Cycles sees one
    light only).
    """
    scene = cycles.empty_scene(96, 96)
    build.still_life(scene)
    build.add_camera(scene)
    sun = build.add_light(scene, "SUN", KEY, energy=1.5)
    point = build.add_light(scene, "POINT", (-3, -3, 4), energy=200.0)
    pair = render_pair(scene, backend, "light-sum")
    total = 0
    for light in (sun, point):
        other = point if light is sun else sun
        other.hide_render = True
        total = total + cycles.render_cycles(scene)["Combined"]
        other.hide_render = False
    pair.cycles["Combined"] = total
    check_radiance(pair, interior(pair) & (total[..., 0] > 0))
