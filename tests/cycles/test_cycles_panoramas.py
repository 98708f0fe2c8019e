"""Panoramas: depth, position and what is outside of the picture, of every type that Cycles has."""

from math import radians

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint_picture import render_glint, render_pair

PANORAMAS = {
    "equirectangular": ((96, 48), {}, {"panorama_type": "EQUIRECTANGULAR"}),
    "part of a sphere": (
        (96, 64),
        {"shift_x": 0.1, "shift_y": -0.05},
        {
            "panorama_type": "EQUIRECTANGULAR",
            "latitude_min": radians(-40),
            "latitude_max": radians(75),
            "longitude_min": radians(-100),
            "longitude_max": radians(60),
        },
    ),
    "fisheye equidistant": (
        (72, 72),
        {},
        {"panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": radians(220)},
    ),
    "fisheye equisolid": (
        (96, 64),
        {"sensor_width": 30.0},
        {"panorama_type": "FISHEYE_EQUISOLID", "fisheye_lens": 9.0, "fisheye_fov": radians(190)},
    ),
    "fisheye equisolid upright": (
        (64, 96),
        {"sensor_fit": "VERTICAL", "sensor_height": 28.0, "shift_y": 0.1},
        {"panorama_type": "FISHEYE_EQUISOLID"},
    ),
    "fisheye lens polynomial": (
        (96, 64),
        {},
        {"panorama_type": "FISHEYE_LENS_POLYNOMIAL", "fisheye_fov": radians(160)},
    ),
    "mirror ball": ((72, 72), {}, {"panorama_type": "MIRRORBALL"}),
    "cubemap face": ((64, 64), {}, {"panorama_type": "EQUIANGULAR_CUBEMAP_FACE"}),
    "cylinder": (
        (96, 48),
        {},
        {
            "panorama_type": "CENTRAL_CYLINDRICAL",
            "central_cylindrical_range_u_min": radians(-120),
            "central_cylindrical_range_u_max": radians(150),
            "central_cylindrical_range_v_min": -1.5,
            "central_cylindrical_range_v_max": 1.0,
            "central_cylindrical_radius": 1.3,
        },
    ),
}


def set_panorama(data, values) -> None:
    """Blender 5 keeps these at the camera, those before it among Cycles' own."""
    data.type = "PANO"
    for name, value in values.items():
        here = data if hasattr(data, name) else data.cycles
        if not hasattr(here, name):
            pytest.skip(f"this Blender has no {name}")
        try:
            setattr(here, name, value)
        except TypeError:
            pytest.skip(f"this Blender has no {name} {value}")


def build_room(name: str, **settings):
    """A camera amid a few objects, some of which its clip distances cut."""
    size, camera, panorama = PANORAMAS[name]
    scene = cycles.empty_scene(*size)
    build.still_life(scene)
    clip = {"clip_start": 0.2, "clip_end": 4.0}
    item = build.add_camera(scene, (1.0, -1.6, 2.4), (0.3, 0.2, 0.6), **clip, **camera)
    set_panorama(item.data, panorama)
    build.add_light(scene, "SUN", (3.0, -2.0, 4.5), energy=2.0)
    for key, value in settings.items():
        setattr(scene.render, key, value)
    return scene


def off_by(pair, name: str) -> float:
    """At most, as a share of the distance, where both tracers see something."""
    distance = pair.cycles["Depth"]
    both = (distance < 1e9) & (pair.glint["Depth"] < 1e9)
    wrong = np.abs(pair.glint[name] - pair.cycles[name])
    size = wrong if wrong.ndim == 2 else np.sqrt((wrong**2).sum(-1))
    return float((size[both] / distance[both]).max())


@pytest.mark.parametrize("name", PANORAMAS)
def test_panorama(name):
    pair = render_pair(build_room(name), "NATIVE", f"panorama-{name}")
    hit = pair.cycles["Depth"] < 1e9
    assert hit.mean() > 0.15 and (hit == (pair.glint["Depth"] < 1e9)).mean() > 0.998
    assert off_by(pair, "Depth") <= 1e-4
    assert off_by(pair, "Position") <= 1e-4


def test_border():
    edges = {"border_min_x": 0.2, "border_max_x": 0.7, "border_min_y": 0.1, "border_max_y": 0.9}
    room = build_room("fisheye equisolid", use_border=True, use_crop_to_border=True, **edges)
    pair = render_pair(room, "NATIVE", "panorama-border")
    assert pair.cycles["Depth"].shape == pair.glint["Depth"].shape
    assert off_by(pair, "Position") <= 1e-4


@pytest.mark.parametrize("transparent", [False, True])
def test_beyond_the_lens_it_is_black(transparent):
    """And opaque, also where the film is transparent."""
    room = build_room("fisheye equidistant")
    room.render.film_transparent = transparent
    cycles.set_world(room, (0.3, 0.4, 0.5))
    pair = render_pair(room, "NATIVE", "panorama-beyond")
    dark = pair.cycles["Combined"][..., :3].sum(-1) == 0
    y, x = np.mgrid[:72, :72] - 35.5
    beyond = x * x + y * y > 36**2
    assert dark[beyond].all() and (pair.cycles["Combined"][beyond][..., 3] == 1).all()
    assert (pair.glint["Combined"][beyond] == (0, 0, 0, 1)).all()
    alpha = pair.glint["Combined"][~beyond][..., 3]
    assert (alpha == 1).all() if not transparent else (alpha < 1).any()


@pytest.mark.parametrize("name", ["equirectangular", "fisheye equisolid"])
def test_depth_of_field(name):
    room = build_room(name)
    room.render.resolution_percentage = 50
    room.camera.data.dof.use_dof = True
    room.camera.data.dof.focus_distance, room.camera.data.dof.aperture_fstop = 2.0, 0.05
    glint = render_glint(room, "NATIVE", samples=256, filter_width=0.0).passes["Combined"]
    truth = cycles.render_cycles(room, 2048)["Combined"]
    wrong = (glint[..., :3] - truth[..., :3]).astype(np.float64)
    assert np.sqrt((wrong**2).mean()) / truth[..., :3].mean() <= 0.02
