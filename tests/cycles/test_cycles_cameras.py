"""Cameras: depth, position, normal and Lambert radiance under every projection that Blender's
camera panel offers.
"""

import pytest

import cycles_reference as cycles
import small_scenes as build
from glint_picture import BACKENDS, check_geometry, check_radiance, interior, render_pair

CAMERAS = {
    "perspective": ((112, 112), {}, {}),
    "wide": ((112, 112), {"lens": 20.0}, {}),
    "ortho": ((112, 80), {"type": "ORTHO", "ortho_scale": 6.0}, {}),
    "ortho_shift": (
        (80, 112),
        {"type": "ORTHO", "ortho_scale": 6.0, "shift_x": 0.1, "shift_y": -0.2},
        {},
    ),
    "shift": ((112, 80), {"shift_x": 0.25, "shift_y": -0.15}, {}),
    "fit_horizontal": ((80, 112), {"sensor_fit": "HORIZONTAL", "lens": 30.0}, {}),
    "fit_vertical": (
        (112, 80),
        {"sensor_fit": "VERTICAL", "sensor_height": 18.0, "lens": 30.0},
        {},
    ),
    "fit_vertical_shift": (
        (112, 80),
        {
            "sensor_fit": "VERTICAL",
            "sensor_height": 18.0,
            "lens": 25.0,
            "shift_x": 0.2,
            "shift_y": 0.1,
        },
        {},
    ),
    "portrait": ((72, 128), {"shift_y": 0.1}, {}),
    "pixel_aspect_x": ((112, 80), {"shift_x": 0.1, "shift_y": 0.1}, {"pixel_aspect_x": 2.0}),
    "pixel_aspect_y": ((112, 80), {"shift_x": -0.1}, {"pixel_aspect_y": 1.5}),
    "ortho_pixel_aspect": (
        (112, 80),
        {"type": "ORTHO", "ortho_scale": 6.0, "shift_y": 0.1},
        {"pixel_aspect_y": 1.5},
    ),
    "percentage": ((150, 131), {}, {"resolution_percentage": 67}),
    "clip": ((112, 112), {"clip_start": 6.0, "clip_end": 9.5}, {}),
}


def build_view(width, height, camera, settings):
    scene = cycles.empty_scene(width, height)
    build.still_life(scene)
    item = build.add_camera(scene, **camera)
    build.add_light(scene, "SUN", (3.0, -2.0, 4.5), energy=2.0)
    for name, value in settings.items():
        setattr(scene.render, name, value)
    return scene, item


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", CAMERAS)
def test_projection(name, backend):
    size, camera, settings = CAMERAS[name]
    scene, _ = build_view(*size, camera, settings)
    pair = render_pair(scene, backend, f"camera-{name}")
    inside = interior(pair)
    check_geometry(pair, inside)
    check_radiance(pair, inside)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("crop", [False, True])
def test_border(crop, backend):
    """A border is the same pixels of the full frame, cropped or not."""
    scene, _ = build_view(
        120, 90, {"shift_x": 0.1}, {"use_border": True, "use_crop_to_border": crop}
    )
    render = scene.render
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = (
        0.22,
        0.81,
        0.13,
        0.77,
    )
    pair = render_pair(scene, backend, f"camera-border-{crop}")
    assert pair.glint["Combined"].shape == pair.cycles["Combined"].shape
    inside = interior(pair)
    check_geometry(pair, inside)
    check_radiance(pair, inside)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("scale", [(1.0, 2.5, 1.0), (3.0, 3.0, 3.0), (-1.0, 1.0, 1.0)])
def test_scaled_camera_object(scale, backend):
    """Cameras under scale, also mirrored: Blender's picture, whatever it makes of the scale."""
    scene, item = build_view(96, 96, {}, {})
    item.scale = scale
    pair = render_pair(scene, backend, f"camera-scale-{'-'.join(map(str, scale))}")
    inside = interior(pair)
    check_geometry(pair, inside)
    check_radiance(pair, inside)
