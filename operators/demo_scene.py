"""The demo scene: a small still life that shows what Glint is for.

A glossy knot on a plinth, a mirror ball and pearls (true spheres), a twisted tower of instances,
letters, a textured stage that mirrors a little; a hard sun, a soft area light and a spot. Built
through the data API alone, so it works headless and inside an operator; nothing is random.
"""

from __future__ import annotations

from math import cos, pi, radians, sin

import bmesh
import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..addon.export.geometry.shapes import mark_sphere

CORAL, TEAL, BRASS = (0.80, 0.115, 0.075), (0.03, 0.30, 0.32), (0.83, 0.55, 0.22)
CHAMPAGNE, IVORY, SLATE, INK = (
    (0.97, 0.83, 0.68),
    (0.80, 0.76, 0.68),
    (0.125, 0.175, 0.235),
    (0.035, 0.045, 0.06),
)


def build_demo_scene() -> None:
    """Fills the current scene, which should be empty, and makes it ready to render at 960×540 in
    engine Glint where that is registered.
    """
    scene = bpy.context.scene
    _build_set(scene)
    _build_knot(scene)
    _build_spheres(scene)
    _build_tower(scene)
    _build_letters(scene)
    _build_lights(scene)
    _build_camera(scene)
    _set_render(scene)


# --- what is seen


def _build_set(scene) -> None:
    """The backdrop, the round stage and the plinth."""
    _add(scene, "Backdrop", _sweep_mesh("Backdrop"), _matte("Backdrop", SLATE))
    stage = _disc_mesh("Stage", radius=4.6, height=0.14, segments=160)
    _add(scene, "Stage", stage, _stage_material())
    plinth = _disc_mesh("Plinth", radius=1.0, height=0.30, segments=96)
    _add(
        scene, "Plinth", plinth, _glossy("Plinth", INK, roughness=0.35), location=(0.0, 0.35, 0.14)
    )


def _build_knot(scene) -> None:
    _add(
        scene,
        "Knot",
        _knot_mesh("Knot"),
        _glossy("Coral", CORAL, roughness=0.22),
        location=(0.0, 0.35, 1.83),
        turn=(radians(82), 0, radians(14)),
    )


def _build_spheres(scene) -> None:
    """True spheres: a mirror ball, a brass ball and an arc of pearls that grow along it."""
    _add(
        scene,
        "Mirror Ball",
        _ball_mesh("Mirror Ball", 1.02),
        _mirror("Mirror", CHAMPAGNE),
        location=(2.62, 0.75, 1.16),
    )
    _add(
        scene,
        "Brass Ball",
        _ball_mesh("Brass Ball", 0.46),
        _polished("Brass", BRASS),
        location=(-1.42, -1.05, 0.60),
    )
    pearl, material = _ball_mesh("Pearl", 1.0), _glossy("Pearl", IVORY, roughness=0.15)
    for k in range(10):
        angle, radius = radians(-66 + 6.3 * k + 0.12 * k * k), 0.10 + 0.013 * k
        center = (3.45 * sin(angle), 0.1 - 3.45 * cos(angle), 0.14 + radius)
        _add(scene, f"Pearl {k}", pearl, material if k == 0 else None, location=center).scale = (
            radius,
        ) * 3


def _build_tower(scene) -> None:
    """Twenty instances of one bevelled slab, each turned and a little smaller than the one
    below.
    """
    slab, material = _slab_mesh("Slab"), _glossy("Teal", TEAL, roughness=0.3)
    for k in range(20):
        size = 1.0 - 0.022 * k
        item = _add(scene, f"Slab {k:02d}", slab, material if k == 0 else None)
        item.matrix_world = (
            Matrix.Translation((-2.72, 0.95, 0.205 + 0.128 * k))
            @ Matrix.Rotation(radians(20 + 6.5 * k), 4, "Z")
            @ Matrix.Diagonal((size, size, 1.0, 1.0))
        )


def _build_letters(scene) -> None:
    text = bpy.data.curves.new("Letters", "FONT")
    text.body, text.size, text.extrude, text.bevel_depth = "Glint", 0.62, 0.055, 0.012
    text.align_x = "CENTER"
    text.materials.append(_glossy("Letters", IVORY, roughness=0.3))
    _add(scene, "Letters", text, location=(1.78, -2.12, 0.16), turn=(radians(90), 0, radians(16)))


def _build_lights(scene) -> None:
    """A warm hard sun, a large cool area light and a spot that lifts the objects from the
    backdrop.
    """
    sun = _add_light(
        scene, "Sun", "SUN", (-4.0, -5.5, 7.0), (0.0, 0.0, 1.0), 1.9, (1.0, 0.92, 0.80)
    )
    sun.angle = 0.0
    area = _add_light(
        scene, "Softbox", "AREA", (4.6, -3.4, 5.2), (0.2, 0.2, 0.9), 330.0, (0.80, 0.90, 1.0)
    )
    area.shape, area.size, area.size_y = "RECTANGLE", 2.6, 1.8
    spot = _add_light(
        scene, "Rim", "SPOT", (-3.6, 4.6, 5.6), (0.0, 0.2, 1.2), 900.0, (1.0, 0.80, 0.62)
    )
    spot.spot_size, spot.spot_blend, spot.shadow_soft_size = radians(52), 0.35, 0.0
    world = bpy.data.worlds.new("Demo World")
    _use_nodes(world)
    background = next(n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (0.55, 0.68, 0.85, 1.0)
    background.inputs["Strength"].default_value = 0.16
    scene.world = world


def _build_camera(scene) -> None:
    data = bpy.data.cameras.new("Camera")
    data.lens, data.clip_start, data.clip_end = 52.0, 0.1, 200.0
    camera = _add(scene, "Camera", data)
    camera.matrix_world = _looking_at((0.7, -11.6, 4.5), (0.0, 0.0, 1.08))
    scene.camera = camera


def _set_render(scene) -> None:
    """960×540, Standard view transform, Glint as it is to begin with where it is registered."""
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 960, 540, 100
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
    if hasattr(scene, "glint"):
        render.engine = "GLINT"


# --- objects


def _add(scene, name: str, data, material=None, location=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    """An object of `data` in the scene; `material` becomes the only one of the data."""
    item = bpy.data.objects.new(name, data)
    item.location, item.rotation_euler = location, turn
    if material is not None:
        data.materials.append(material)
    scene.collection.objects.link(item)
    return item


def _add_light(scene, name: str, kind: str, location, target, energy: float, color):
    light = bpy.data.lights.new(name, kind)
    light.energy, light.color = energy, color
    _add(scene, name, light).matrix_world = _looking_at(location, target)
    return light


def _looking_at(location, target) -> Matrix:
    direction = Vector(target) - Vector(location)
    return Matrix.Translation(location) @ direction.to_track_quat("-Z", "Y").to_matrix().to_4x4()


# --- meshes


def _grid_mesh(name: str, points: np.ndarray, wrap: tuple[bool, bool]):
    """A smooth quad mesh over (rows, columns, 3) points; wrap closes rows and columns."""
    rows, columns = points.shape[:2]
    i, j = np.meshgrid(
        np.arange(rows - (not wrap[0])), np.arange(columns - (not wrap[1])), indexing="ij"
    )
    after_i, after_j = (i + 1) % rows, (j + 1) % columns
    faces = np.stack(
        [
            i * columns + j,
            after_i * columns + j,
            after_i * columns + after_j,
            i * columns + after_j,
        ],
        -1,
    ).reshape(-1, 4)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], faces.tolist())
    mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), bool))
    return mesh


def _knot_mesh(name: str):
    """A trefoil knot: a tube of varying thickness round a closed curve, framed by the curve's own
    normal towards the axis.
    """
    t = np.linspace(0, 2 * pi, 288, endpoint=False)
    ring = np.linspace(0, 2 * pi, 40, endpoint=False)
    curve = 0.44 * np.stack(
        [np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -1.1 * np.sin(3 * t)], -1
    )
    tangent = np.roll(curve, -1, 0) - np.roll(curve, 1, 0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, tangent)
    thickness = (0.285 + 0.045 * np.cos(3 * t))[:, None, None]
    tube = np.cos(ring)[None, :, None] * side[:, None] + np.sin(ring)[None, :, None] * up[:, None]
    return _grid_mesh(name, curve[:, None] + thickness * tube, (True, True))


def _sweep_mesh(name: str):
    """Floor, quarter-circle cove and wall as one smooth sheet."""
    bend = [(5.5 + 4.0 * sin(a), 4.0 - 4.0 * cos(a)) for a in np.linspace(0, pi / 2, 33)]
    profile = [(-26.0, 0.0), (-10.0, 0.0), *bend, (9.5, 9.0), (9.5, 18.0)]
    points = np.array([[(x, y, z) for x in np.linspace(-30, 30, 9)] for y, z in profile])
    return _grid_mesh(name, points[:, ::-1], (False, False))


def _disc_mesh(name: str, radius: float, height: float, segments: int):
    """A round slab with a bevelled rim and planar UVs, its foot at z = 0."""
    shape = bmesh.new()
    bmesh.ops.create_cone(
        shape, cap_ends=True, segments=segments, radius1=radius, radius2=radius, depth=height
    )
    bmesh.ops.translate(shape, verts=shape.verts, vec=(0, 0, height / 2))
    rim = [e for e in shape.edges if all(v.co.z > height / 2 for v in e.verts)]
    bmesh.ops.bevel(shape, geom=rim, offset=0.03, segments=3, profile=0.5, affect="EDGES")
    uv = shape.loops.layers.uv.new("UVMap")
    for face in shape.faces:
        face.smooth = len(face.verts) == 4 and abs(face.normal.z) < 0.999
        for loop in face.loops:
            loop[uv].uv = (0.5 + loop.vert.co.x / (2 * radius), 0.5 + loop.vert.co.y / (2 * radius))
    return _to_mesh(name, shape)


def _ball_mesh(name: str, radius: float):
    """A fine smooth sphere, with the mark by which Glint takes it for a true one."""
    shape = bmesh.new()
    bmesh.ops.create_uvsphere(shape, u_segments=96, v_segments=48, radius=radius)
    for face in shape.faces:
        face.smooth = True
    mesh = _to_mesh(name, shape)
    mark_sphere(mesh)
    return mesh


def _slab_mesh(name: str):
    """A flat box, 1.5 × 0.62 × 0.128, with round edges."""
    shape = bmesh.new()
    bmesh.ops.create_cube(shape, size=1.0, matrix=Matrix.Diagonal((1.5, 0.62, 0.128, 1.0)))
    bmesh.ops.bevel(
        shape, geom=list(shape.edges), offset=0.03, segments=4, profile=0.5, affect="EDGES"
    )
    return _to_mesh(name, shape)


def _to_mesh(name: str, shape):
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    return mesh


# --- materials


def _stage_material():
    """A checker of two warm greys, printed as an image, with a faint mirror over it."""
    material, tree, output = _new_material("Stage")
    image = tree.nodes.new("ShaderNodeTexImage")
    image.image = _checker_image("Stage Checker")
    diffuse, mix = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeMixShader")
    glossy = _glossy_node(tree, (0.9, 0.95, 1.0), 0.0)
    mix.inputs[0].default_value = 0.13
    tree.links.new(image.outputs["Color"], diffuse.inputs["Color"])
    tree.links.new(diffuse.outputs["BSDF"], mix.inputs[1])
    tree.links.new(glossy.outputs["BSDF"], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return material


def _checker_image(name: str, size: int = 1024, cells: int = 16):
    """A checker with thin dark joints and two inlaid rings, sRGB bytes, packed into the file."""
    axis = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(axis, axis)
    odd = ((u * cells).astype(int) + (v * cells).astype(int)) % 2
    edge = np.minimum(
        np.abs(u * cells - np.round(u * cells)), np.abs(v * cells - np.round(v * cells))
    )
    radius = np.hypot(u - 0.5, v - 0.5)
    rings = (np.abs(radius - 0.475) < 0.006) | (np.abs(radius - 0.458) < 0.003)
    color = np.where(odd[..., None] == 1, (0.80, 0.76, 0.70), (0.33, 0.35, 0.38))
    color = np.where((edge < 0.02)[..., None], (0.22, 0.22, 0.23), color)
    color = np.where((radius > 0.446)[..., None], (0.22, 0.24, 0.27), color)
    color = np.where(rings[..., None], (0.86, 0.66, 0.38), color)
    pixels = np.concatenate([color, np.ones((size, size, 1))], -1).astype(np.float32)
    image = bpy.data.images.new(name, size, size)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def _glossy(name: str, color, roughness: float):
    """A dielectric: colour below, highlights above."""
    material, tree, output = _new_material(name)
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value, shader.inputs["Roughness"].default_value = (
        (*color, 1.0),
        roughness,
    )
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return material


def _matte(name: str, color):
    material, tree, output = _new_material(name)
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1.0)
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return material


def _mirror(name: str, color):
    material, tree, output = _new_material(name)
    tree.links.new(_glossy_node(tree, color, 0.0).outputs["BSDF"], output.inputs["Surface"])
    return material


def _polished(name: str, color):
    """A metal that both mirrors and shows soft highlights."""
    material, tree, output = _new_material(name)
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.45
    for slot, roughness in ((1, 0.0), (2, 0.32)):
        tree.links.new(_glossy_node(tree, color, roughness).outputs["BSDF"], mix.inputs[slot])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return material


def _glossy_node(tree, color, roughness: float):
    shader = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    shader.inputs["Color"].default_value, shader.inputs["Roughness"].default_value = (
        (*color, 1.0),
        roughness,
    )
    return shader


def _new_material(name: str):
    """(material, its node tree, its output node), all else removed."""
    material = bpy.data.materials.new(name)
    _use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    return material, tree, tree.nodes.new("ShaderNodeOutputMaterial")


def _use_nodes(owner) -> None:
    """From 5.0 on materials and worlds are born with nodes, and the switch is deprecated."""
    if bpy.app.version < (5, 0):
        owner.use_nodes = True
