"""Motion blur of objects, shapes and lights against Cycles at many samples."""

from types import SimpleNamespace

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint.addon.export import export_scene
from glint.addon.render.motion import with_motion
from glint.engine import Settings, render
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


def give_velocity(data, *vector) -> None:
    """Of all its points, units a second."""
    values = np.tile(np.array(vector, np.float32), len(data.attributes["position"].data))
    data.attributes.new("velocity", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", values)


def velocity(scene):
    for number, thing in enumerate(o for o in scene.objects if o.type == "MESH"):
        if number % 2 == 0:
            give_velocity(thing.data, 12.0, -5.0, 9.0)


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
    "velocity": velocity,
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


def engine_of(scene) -> SimpleNamespace:
    """What turns to other frames, as a render engine does."""
    return SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )


def compare(scene, **settings) -> tuple[float, np.ndarray, np.ndarray]:
    """The error relative to the mean, and both pictures."""
    engine = engine_of(scene)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    film = render_glint(
        scene,
        "NATIVE",
        edit=lambda read: with_motion((read,), engine, depsgraph)[0][0],
        **{"samples": 256, "filter_width": 0.0, **settings},
    )
    glint = film.passes["Combined"][..., :3].astype(np.float64)
    truth = blurred(scene, CYCLES_SAMPLES)
    return np.sqrt(((glint - truth) ** 2).mean()) / truth.mean(), glint, truth


def blurred(scene, samples: int) -> np.ndarray:
    return cycles.render_cycles(scene, samples)["Combined"][..., :3].astype(np.float64)


def blurred_by_stills(scene, count: int, samples: int = 64) -> np.ndarray:
    """From frame 1.5 to 2.5."""
    scene.render.use_motion_blur = False
    truth = np.zeros(3)
    for k in range(count):
        time = 1.5 + (k + 0.5) / count
        scene.frame_set(int(time), subframe=time - int(time))
        truth = truth + blurred(scene, samples) / count
    return truth


@pytest.mark.parametrize(
    ("name", "position", "steps"),
    [
        ("slide-turn", "CENTER", 1),
        ("slide-turn", "START", 3),
        ("stretch", "END", 2),
        ("shape", "CENTER", 1),
        ("shape", "START", 2),
        ("velocity", "CENTER", 2),
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
    truth = blurred_by_stills(scene, STILLS, 256)
    assert np.sqrt(((glint - truth) ** 2).mean()) / truth.mean() <= 0.02
    assert np.sqrt(((still - truth) ** 2).mean()) / truth.mean() > 0.04


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sizes", "axes"),
    [((0, 0, 1), 3), ((1, 0, 1), 3), ((-1, 0, 1), 3), ((1, 0, 1), 2), ((0, 0, 0), 3)],
)
def test_what_is_scaled_to_nothing_at_the_frame_itself(sizes, axes):
    """A glowing box that slides, shrinks and grows, along all its axes or but two. What is nothing
    at two keys turns over in Cycles on the way to the third: there the truth is the mean of still
    pictures.
    """
    scene = cycles.empty_scene(SIDE, SIDE)
    build.add_camera(scene)
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 3.0
    scene.camera.location, scene.camera.rotation_euler = (0, 0, 5), (0, 0, 0)
    bpy.ops.mesh.primitive_cube_add(size=1)
    box = bpy.context.object
    glow = bpy.data.materials.new("Glow")
    cycles.use_nodes(glow)
    nodes = glow.node_tree.nodes
    nodes.clear()
    shader, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    glow.node_tree.links.new(shader.outputs[0], output.inputs[0])
    box.data.materials.append(glow)
    for frame, size in enumerate(sizes, 1):
        box.scale = (1.0,) * (3 - axes) + (size,) * axes
        box.location, box.rotation_euler = (0.9 * (frame - 2), 0, 0), (0, 0, 0.5)
        for path in ("scale", "location"):
            box.keyframe_insert(path, frame=frame)
    straighten()
    scene.frame_set(2)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    scene.render.motion_blur_position = "CENTER"
    depsgraph = bpy.context.evaluated_depsgraph_get()
    read = export_scene(depsgraph, width=SIDE, height=SIDE, keeps_collapsed=True).scene
    (moving,), notes = with_motion((read,), engine_of(scene), depsgraph)
    assert bool(notes) == (not any(sizes)) == (not moving.instances)
    film = render(moving, Settings(samples=1024, filter_width=0.0))
    truth = blurred_by_stills(scene, 64) if sizes == (0, 0, 1) else blurred(scene, 2048)
    assert any(sizes) == (truth.mean() > 0)
    off = np.sqrt(((film.combined[..., :3] - truth) ** 2).mean())
    assert off <= 0.02 * max(truth.max(), 1e-9)
