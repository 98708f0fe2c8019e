"""Motion blur of objects, shapes and lights against Cycles at many samples."""

from types import SimpleNamespace

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint.addon.render.motion import with_motion
from glint_picture import render_glint

bpy = cycles.bpy
SIDE = 48
CYCLES_SAMPLES = 512
STILLS = 16


def key(thing, path: str, first, last) -> None:
    """From frame 1 to 3, evenly."""
    for frame, value in ((1, first), (3, last)):
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=frame)


def straighten() -> None:
    for action in bpy.data.actions:
        slots = action.layers[0].strips[0].channelbags[0] if hasattr(action, "layers") else action
        for curve in slots.fcurves:
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"


def sliding_and_turning(scene):
    for number, thing in enumerate(o for o in scene.objects if o.type == "MESH"):
        if number % 2 == 0:
            place, turn = thing.location.copy(), thing.rotation_euler.copy()
            key(thing, "location", place, (place.x + 0.7, place.y - 0.2, place.z + 0.3))
            key(thing, "rotation_euler", turn, (turn.x, turn.y + 0.5, turn.z + 1.2))


def stretching(scene):
    for thing in (o for o in scene.objects if o.type == "MESH"):
        key(thing, "scale", thing.scale.copy(), (1.6 * thing.scale.x, thing.scale.y, -0.0 + 0.5))
        key(thing, "rotation_euler", (0.0, 0.0, 0.0), (0.4, 0.0, 0.9))


def shape(scene):
    for thing in [o for o in scene.objects if o.type == "MESH"][:2]:
        thing.shape_key_add(name="Basis")
        bent = thing.shape_key_add(name="Bent")
        for point in bent.data:
            x, y, z = point.co
            point.co = (x + 0.6 * z, y + 0.4 * np.sin(2 * x), 1.3 * z)
        key(bent, "value", 0.0, 1.0)


def camera_and_things(scene):
    sliding_and_turning(scene)
    camera = scene.camera
    place = camera.location.copy()
    key(camera, "location", place, (place.x + 0.5, place.y, place.z + 0.2))


def lamp(scene):
    light = build.add_light(scene, "AREA", (2.0, -2.0, 4.5), energy=400.0)
    light.data.size = 0.7
    place = light.location.copy()
    key(light, "location", place, (place.x - 2.5, place.y + 1.0, place.z))


MOTIONS = {
    "slide-turn": sliding_and_turning,
    "stretch": stretching,
    "shape": shape,
    "camera-too": camera_and_things,
    "lamp": lamp,
}


def build_scene(name: str, position: str, steps: int = 1):
    scene = cycles.empty_scene(SIDE, SIDE)
    build.still_life(scene)
    build.add_camera(scene)
    if name != "lamp":
        build.add_light(scene, "SUN", (3.0, -2.0, 4.5), energy=2.0)
    bpy.context.view_layer.update()
    MOTIONS[name](scene)
    for thing in scene.objects:
        thing.cycles.motion_steps = steps
    straighten()
    scene.frame_set(2)
    render = scene.render
    render.use_motion_blur, render.motion_blur_shutter = True, 1.0
    render.motion_blur_position = position
    return scene


def compare(scene, **settings) -> tuple[float, np.ndarray, np.ndarray]:
    """The error relative to the mean, and both pictures."""
    engine = SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )
    depsgraph = bpy.context.evaluated_depsgraph_get()
    film = render_glint(
        scene,
        "NATIVE",
        edit=lambda read: with_motion((read,), engine, depsgraph)[0][0],
        **{"samples": 256, "filter_width": 0.0, **settings},
    )
    glint = film.passes["Combined"][..., :3].astype(np.float64)
    truth = cycles.render_cycles(scene, CYCLES_SAMPLES)["Combined"][..., :3].astype(np.float64)
    return np.sqrt(((glint - truth) ** 2).mean()) / truth.mean(), glint, truth


@pytest.mark.parametrize(
    ("name", "position", "steps"),
    [
        ("slide-turn", "CENTER", 1),
        ("slide-turn", "START", 3),
        ("stretch", "END", 2),
        ("shape", "CENTER", 1),
        ("shape", "START", 2),
        ("camera-too", "CENTER", 1),
    ],
)
def test_motion_of_objects(name, position, steps):
    scene = build_scene(name, position, steps)
    assert compare(scene)[0] <= 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slide-turn", "camera-too"])
def test_a_shutter_curve(name):
    """One that opens slowly; the picture of one that is open all the time is another."""
    scene = build_scene(name, "CENTER")
    evenly = compare(scene)[1]
    curve = scene.render.motion_blur_shutter_curve
    first, last = curve.curves[0].points[:2]
    first.location, last.location = (0.0, 0.0), (1.0, 1.0)
    first.handle_type = last.handle_type = "VECTOR"
    curve.update()
    scene.update_tag()
    error, _, truth = compare(scene)
    assert error <= 0.02
    assert np.sqrt(((evenly - truth) ** 2).mean()) / truth.mean() > 2 * error


@pytest.mark.slow
def test_a_lamp_that_moves():
    """Cycles' lamps stand still while the shutter is open: the truth is the mean of its pictures of
    still scenes.
    """
    scene = build_scene("lamp", "CENTER")
    _, glint, still = compare(scene, light_samples=4)
    scene.render.use_motion_blur = False
    truth = np.zeros_like(glint)
    for k in range(STILLS):
        time = 1.5 + (k + 0.5) / STILLS
        scene.frame_set(int(time), subframe=time - int(time))
        truth += cycles.render_cycles(scene, 256)["Combined"][..., :3] / STILLS
    assert np.sqrt(((glint - truth) ** 2).mean()) / truth.mean() <= 0.02
    assert np.sqrt(((still - truth) ** 2).mean()) / truth.mean() > 0.04
