"""Motion blur of strands and points that move within their objects against Cycles."""

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from test_cycles_motion import compare, give_velocity
from test_cycles_vector import before_a_camera, points, pushed, strands

bpy = cycles.bpy
PUSH = 0.15


def matt(thing, rgb) -> None:
    material = bpy.data.materials.new("Matt")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*rgb, 1.0)
    tree.links.new(shader.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    thing.data.materials.append(material)


def straight_strands():
    """Straight, as chords lie up to a tenth of a radius off; ends, which are closed here and open
    there, are out of the picture, and their shadows too.
    """
    data = strands()
    x, z = np.repeat(np.linspace(-1.2, 1.2, 6), 5), np.tile(np.linspace(-2.8, 2.8, 5), 6)
    places = np.column_stack([x, np.zeros(30), z]).astype(np.float32)
    data.attributes["position"].data.foreach_set("vector", places.ravel())
    return data


def bent_strands(amplitude: float):
    """The same in waves, so strong that each is cut to several segments between two keys."""
    data = straight_strands()
    places = np.empty(90, np.float32)
    data.attributes["position"].data.foreach_get("vector", places)
    places[0::3] += amplitude * np.sin(3 * places[2::3])
    data.attributes["position"].data.foreach_set("vector", places)
    return data


def swept(make, first: str, position: str, steps: int, push: float = PUSH):
    """What leans over while the shutter is open, in a sun, before a wall that it throws shadows
    on.
    """
    scene, thing = before_a_camera(make)
    scene.camera.data.ortho_scale = 2.4
    scene.cycles_curves.shape = "THICK"
    scene.cycles_curves.subdivisions = 5
    matt(thing, (0.8, 0.5, 0.3))
    pushed(thing, push, first)
    bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0.6, 0), rotation=(np.pi / 2, 0, 0))
    matt(bpy.context.object, (0.2, 0.3, 0.4))
    build.add_light(scene, "SUN", (2.0, -3.0, 3.0), energy=3.0)
    thing.cycles.motion_steps = steps
    scene.frame_set(2)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    scene.render.motion_blur_position = position
    return scene


@pytest.mark.parametrize(("position", "steps"), [("CENTER", 1), ("START", 2)])
def test_strands(position, steps):
    error, glint, truth = compare(swept(straight_strands, "", position, steps))
    assert error <= 0.02
    assert glint.std() > 0.1 * glint.mean() and truth.mean() > 0.05


@pytest.mark.parametrize("amplitude", [0.1, 0.3])
def test_bent_strands(amplitude):
    assert compare(swept(lambda: bent_strands(amplitude), "", "CENTER", 1))[0] <= 0.02


def test_points():
    scene = swept(points, "GeometryNodeMeshToPoints", "CENTER", 1)
    assert compare(scene)[0] <= 0.02


@pytest.mark.parametrize(
    ("make", "first"), [(straight_strands, ""), (points, "GeometryNodeMeshToPoints")]
)
def test_velocities(make, first):
    """Of what simulations and caches bring, which no other frame is asked for."""

    def flying():
        data = make()
        give_velocity(data, 14.0, 0.0, 5.0)
        return data

    scene = swept(flying, first, "CENTER", 1, push=0.0)
    assert compare(scene)[0] <= 0.02


def test_without_their_own_motion_the_picture_is_another():
    scene = swept(straight_strands, "", "CENTER", 1)
    thing = scene.objects["Thing"]
    thing.cycles.use_deform_motion = False
    thing.update_tag()
    error, still, _ = compare(scene)
    thing.cycles.use_deform_motion = True
    thing.update_tag()
    moving = compare(scene)[1]
    assert error <= 0.02
    assert np.sqrt(((moving - still) ** 2).mean()) > 0.1 * still.mean()
