"""Worlds beside Cycles: what is seen where nothing is hit, pixel by pixel, and the light that the
sky gives, against many of Cycles' samples.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import BACKENDS, render_glint, render_pair
from small_scenes import add, add_camera, ball, cube, lambert, moved, plane

ROWS = 64


def sky_directions() -> np.ndarray:
    """(ROWS, 2 ROWS, 3) unit vectors to the texels of an environment image."""
    v, u = np.meshgrid(
        (np.arange(ROWS) + 0.5) / ROWS, (np.arange(2 * ROWS) + 0.5) / (2 * ROWS), indexing="ij"
    )
    up, around = np.pi * (v - 0.5), 2 * np.pi * (0.5 - u)
    return np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], -1)


def gradient() -> np.ndarray:
    return (0.5 + 0.5 * sky_directions()[..., 2:]) * np.array([0.5, 0.7, 1.0])


def sun_and_sky() -> np.ndarray:
    towards = np.array([0.5, -0.6, 0.62]) / np.linalg.norm([0.5, -0.6, 0.62])
    along = sky_directions()
    sky = np.where(along[..., 2:] > 0, (0.25, 0.45, 0.9), (0.12, 0.1, 0.08))
    return sky + np.where((along @ towards)[..., None] > 0.997, (90.0, 80.0, 65.0), 0.0)


def studio() -> np.ndarray:
    along = sky_directions()
    around, up = np.arctan2(along[..., 1], along[..., 0]), np.arcsin(along[..., 2])
    values = np.full(along.shape, 0.02)
    for middle, height, wide, tall, color in (
        (0.6, 0.5, 0.5, 0.25, (9.0, 9.0, 9.0)),
        (-2.2, 0.3, 0.25, 0.5, (6.0, 3.0, 2.0)),
        (2.6, 1.0, 0.6, 0.2, (2.0, 4.0, 8.0)),
    ):
        off = np.abs((around - middle + np.pi) % (2 * np.pi) - np.pi)
        values[(off < wide) & (np.abs(up - height) < tall)] = color
    return values


def spots() -> np.ndarray:
    """Soft lights of all sizes and colours, as in a photograph."""
    numbers, along = np.random.default_rng(0), sky_directions()
    values = np.zeros(along.shape)
    for _ in range(40):
        middle = numbers.normal(size=3)
        height = np.exp(numbers.uniform(3, 60) * (along @ (middle / np.linalg.norm(middle)) - 1))
        values += height[..., None] * numbers.uniform(0, 1, 3) * numbers.uniform(0.1, 3)
    return values


SKIES = {"gradient": gradient, "sun": sun_and_sky, "studio": studio, "spots": spots}


class WorldTree:
    """The node tree of a scene's new world."""

    def __init__(self, scene) -> None:
        scene.world = bpy.data.worlds.new("sky")
        cycles.use_nodes(scene.world)
        self.tree = scene.world.node_tree
        self.tree.nodes.clear()
        self.background = self.add("ShaderNodeBackground")
        output = self.add("ShaderNodeOutputWorld")
        self.link(self.background.outputs[0], output.inputs["Surface"])

    def add(self, kind: str, **properties):
        node = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(node, name, value)
        return node

    def link(self, start, end) -> None:
        self.tree.links.new(start, end)

    def shine(self, socket) -> None:
        self.link(socket, self.background.inputs["Color"])

    def environment(self, values: np.ndarray, **properties):
        rows, columns = values.shape[:2]
        picture = bpy.data.images.new("sky", columns, rows, float_buffer=True)
        rgba = np.ones((rows, columns, 4), np.float32)
        rgba[..., :3] = values
        picture.pixels.foreach_set(rgba.reshape(-1))
        picture.pack()
        return self.add("ShaderNodeTexEnvironment", image=picture, **properties)


def image_seen(world: WorldTree, **properties) -> None:
    numbers = np.random.default_rng(1).uniform(0, 1, (16, 32, 3))
    world.shine(world.environment(numbers, **properties).outputs[0])


def turned_image(world: WorldTree) -> None:
    texture = world.environment(np.random.default_rng(1).uniform(0, 1, (16, 32, 3)))
    mapping, where = world.add("ShaderNodeMapping"), world.add("ShaderNodeTexCoord")
    mapping.inputs["Rotation"].default_value = (0.3, -0.2, 1.1)
    world.link(where.outputs["Generated"], mapping.inputs["Vector"])
    world.link(mapping.outputs[0], texture.inputs["Vector"])
    world.shine(texture.outputs[0])


def by_coordinate(node_type: str, name: str):
    def build(world: WorldTree) -> None:
        world.shine(world.add(node_type).outputs[name])

    return build


def noise(world: WorldTree) -> None:
    texture = world.add("ShaderNodeTexNoise")
    texture.inputs["Scale"].default_value = 3.0
    world.shine(texture.outputs["Color"])


def blackbody(world: WorldTree) -> None:
    """By height."""
    up = world.add("ShaderNodeSeparateXYZ")
    math = world.add("ShaderNodeMath", operation="MULTIPLY_ADD")
    math.inputs[1].default_value, math.inputs[2].default_value = 4000.0, 4500.0
    warm = world.add("ShaderNodeBlackbody")
    world.link(world.add("ShaderNodeTexCoord").outputs["Generated"], up.inputs[0])
    world.link(up.outputs["Z"], math.inputs[0])
    world.link(math.outputs[0], warm.inputs[0])
    world.shine(warm.outputs[0])


def normal_map(space: str):
    """A normal that is bent by a colour."""

    def build(world: WorldTree) -> None:
        bent = world.add("ShaderNodeNormalMap", space=space)
        bent.inputs["Strength"].default_value = 0.6
        bent.inputs["Color"].default_value = (0.9, 0.3, 0.6, 1.0)
        world.shine(bent.outputs[0])

    return build


def by_ray(world: WorldTree) -> None:
    """Another world for the camera."""
    mix = world.add("ShaderNodeMix", data_type="RGBA")
    sockets = {socket.identifier: socket for socket in mix.inputs}
    sockets["A_Color"].default_value = (0.8, 0.2, 0.1, 1)
    sockets["B_Color"].default_value = (0.1, 0.3, 0.9, 1)
    path = world.add("ShaderNodeLightPath")
    world.link(path.outputs["Is Camera Ray"], sockets["Factor_Float"])
    world.shine(next(s for s in mix.outputs if s.identifier == "Result_Color"))


SEEN = {
    "image": image_seen,
    "closest": lambda world: image_seen(world, interpolation="Closest"),
    "mirror_ball": lambda world: image_seen(world, projection="MIRROR_BALL"),
    "turned": turned_image,
    "noise": noise,
    "blackbody": blackbody,
    "by_ray": by_ray,
    "object_normals": normal_map("OBJECT"),
    "flipped_normals": normal_map("BLENDER_WORLD"),
    **{
        name: by_coordinate("ShaderNodeTexCoord", name)
        for name in ("Generated", "Normal", "Object", "Reflection", "Camera", "Window")
    },
    **{
        name: by_coordinate("ShaderNodeNewGeometry", name)
        for name in ("Position", "True Normal", "Incoming")
    },
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_picture_behind_the_scene_is_cycles(kind, backend):
    """By window coordinates, through a camera that is turned and shifted."""
    scene = cycles.empty_scene(64, 48)
    camera = add_camera(scene, location=(0.7, -3.5, 0.6), target=(0.4, 0, 0.2))
    camera.data.type, camera.data.shift_x = kind, 0.2
    by_coordinate("ShaderNodeTexCoord", "Window")(WorldTree(scene))
    pair = render_pair(scene, backend, f"window-{kind}", world_light="CONSTANT")
    found, wanted = (p["Combined"][..., :3] for p in (pair.glint, pair.cycles))
    assert wanted.std() > 0.1
    np.testing.assert_allclose(found, wanted, atol=2e-3)


@pytest.mark.parametrize("name", SEEN)
def test_what_is_seen_is_cycles(name):
    """By the camera, and by it in a mirror."""
    scene = cycles.empty_scene(64, 48)
    mirror = bpy.data.materials.new("mirror")
    cycles.use_nodes(mirror)
    tree = mirror.node_tree
    tree.nodes.clear()
    glossy = tree.nodes.new("ShaderNodeBsdfGlossy")
    glossy.inputs["Roughness"].default_value = 0.0
    tree.links.new(glossy.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    add(scene, "ball", ball(64, 32, True, mirror), moved(0, 0, 0))
    add_camera(scene, location=(0.7, -3.5, 0.6), target=(0.4, 0, 0.2))
    SEEN[name](WorldTree(scene))
    scene.world.cycles.sampling_method = "NONE"  # it lights nothing
    pair = render_pair(scene, "NATIVE", name, bounces=1, world_light="CONSTANT")
    found, wanted = (p["Combined"][..., :3] for p in (pair.glint, pair.cycles))
    error = np.abs(found - wanted).max(-1)
    assert wanted.std() > 0.01
    sky = pair.cycles["Depth"] > 1e6
    assert sky.mean() > 0.3
    assert np.percentile(error[sky], 99) <= 1e-3, np.sort(error[sky])[-5:]
    assert np.percentile(error[~sky], 95) <= 5e-3, np.sort(error[~sky])[-80:]


@pytest.mark.slow
@pytest.mark.parametrize("name", SKIES)
def test_the_light_of_an_image_is_cycles(name):
    scene = cycles.empty_scene(32, 21)
    add(scene, "floor", plane(8, lambert((0.6, 0.6, 0.6))))
    add(scene, "ball", ball(64, 32, True, lambert((0.7, 0.3, 0.2))), moved(1.2, 0, 1))
    add(scene, "cube", cube(lambert((0.3, 0.5, 0.7))), moved(-1.2, 0.3, 0.8, 0.8, 0.8, 0.8))
    add_camera(scene, location=(0.5, -6, 3.0), target=(0, 0, 0.8))
    world = WorldTree(scene)
    world.shine(world.environment(SKIES[name]()).outputs[0])
    film = render_glint(scene, "NATIVE", max_bounces=0, samples=64, light_samples=2, filter_width=0)
    wanted = cycles.render_cycles(scene, 1024)["Combined"][..., :3]
    error = film.passes["Combined"][..., :3] - wanted
    assert np.sqrt(np.mean(error**2)) <= 0.02 * wanted.mean()
