"""Edits of a Blender scene, each with a random generator, as a user might make them."""

import bpy
import numpy as np

from export_support import quad, use_nodes
from glint.addon.export.geometry.shapes import mark_sphere


def scattering():
    """Geometry nodes that leave a mesh as it is and instance a cone at a point beside it."""
    group = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = (
        "NodeGroupInput",
        "GeometryNodePoints",
        "GeometryNodeMeshCone",
        "GeometryNodeInstanceOnPoints",
        "GeometryNodeJoinGeometry",
        "NodeGroupOutput",
    )
    given, point, cone, scatter, join, result = map(group.nodes.new, kinds)
    point.inputs["Position"].default_value = (1, 2, 0)
    ends = [
        (point, scatter, "Points"),
        (cone, scatter, "Instance"),
        (scatter, join, 0),
        (given, join, 0),
        (join, result, 0),
    ]
    for source, to, name in ends:
        group.links.new(source.outputs[0], to.inputs[name])
    return group


def personal():
    """A material that reads the object's colour, random number and a property."""
    made = bpy.data.materials.new("Personal")
    use_nodes(made)
    tree = made.node_tree
    tree.nodes.clear()
    info, tint, add, shader, end = (
        tree.nodes.new(f"ShaderNode{kind}")
        for kind in ("ObjectInfo", "Attribute", "VectorMath", "BsdfDiffuse", "OutputMaterial")
    )
    tint.attribute_type, tint.attribute_name = "INSTANCER", "tint"
    for start, ends in (
        (info.outputs["Color"], add.inputs[0]),
        (tint.outputs["Color"], add.inputs[1]),
        (add.outputs[0], shader.inputs["Color"]),
        (info.outputs["Random"], shader.inputs["Roughness"]),
        (info.outputs["Random"], shader.inputs["Normal"]),
        (shader.outputs[0], end.inputs["Surface"]),
    ):
        tree.links.new(start, ends)
    return made


def _vector(r):
    return [r.uniform(-3, 3) for _ in range(3)]


def _some_object(r, *kinds):
    return r.choice(
        [
            thing
            for thing in sorted(bpy.context.scene.objects, key=lambda o: o.name)
            if not kinds or thing.type in kinds
        ]
    )


def move(r):
    _some_object(r).location = _vector(r)


def turn(r):
    _some_object(r).rotation_euler = _vector(r)


def scale_to_nothing(r):
    _some_object(r, "MESH").scale = r.choice([(0, 0, 1), (1, 1, 1), (-1, 1, 1)])


def edit_vertex(r):
    mesh = _some_object(r, "MESH").data
    r.choice(mesh.vertices).co = _vector(r)
    mesh.update()


def add_triangle(r):
    mesh = r.choice(sorted(bpy.data.meshes, key=lambda m: m.name))
    mesh.clear_geometry()
    mesh.from_pydata([_vector(r) for _ in range(5)], [], [(0, 1, 2), (2, 3, 4)])
    mesh.update()


def subdivide(r):
    bpy.data.objects["Modified"].modifiers[0].levels = r.randrange(3)


def smooth(r):
    mesh = r.choice(sorted(bpy.data.meshes, key=lambda m: m.name))
    mesh.polygons.foreach_set("use_smooth", np.full(len(mesh.polygons), r.random() < 0.5))
    mesh.update()


def color(r):
    bpy.data.materials["Plain"].diffuse_color = (*[r.random() for _ in range(3)], 1)


def node_value(r):
    node = next(
        node
        for node in bpy.data.materials["Textured"].node_tree.nodes
        if node.type == "BSDF_DIFFUSE"
    )
    node.inputs["Color"].default_value = (*[r.random() for _ in range(3)], 1)


def unlink_or_link(r):
    tree = bpy.data.materials["Textured"].node_tree
    texture, shader = (
        next(node for node in tree.nodes if node.type == kind)
        for kind in ("TEX_IMAGE", "BSDF_DIFFUSE")
    )
    if shader.inputs["Color"].is_linked:
        tree.links.remove(shader.inputs["Color"].links[0])
    else:
        tree.links.new(texture.outputs["Color"], shader.inputs["Color"])


def paint(r):
    image = bpy.data.images["Image"]
    image.pixels.foreach_set(np.random.default_rng(r.randrange(99)).random(64, np.float32))
    image.update_tag()


def recolor(r):
    bpy.data.images["Image"].colorspace_settings.name = r.choice(["sRGB", "Non-Color"])


def reload(r):
    """Drops what was painted."""
    bpy.data.images["Image"].reload()


def interpolate(r):
    tree = bpy.data.materials["Textured"].node_tree
    next(node for node in tree.nodes if node.type == "TEX_IMAGE").interpolation = r.choice(
        ["Linear", "Closest"]
    )


def swap_material(r):
    slot = r.choice([slot for thing in bpy.context.scene.objects for slot in thing.material_slots])
    slot.material = r.choice([*sorted(bpy.data.materials, key=lambda m: m.name), None])


def light(r):
    lamp = r.choice(sorted(bpy.data.lights, key=lambda m: m.name))
    lamp.energy, lamp.color = r.random(), [r.random() for _ in range(3)]
    if lamp.type == "POINT":
        lamp.shadow_soft_size = r.choice([0.0, 0.5])


def surround(r):
    world = bpy.context.scene.world
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (
        *[r.random() for _ in range(3)],
        1,
    )


def hide(r):
    thing = _some_object(r)
    thing.hide_viewport = not thing.hide_viewport


def exclude(r):
    bpy.data.objects[r.choice(["EmptyA", "EmptyB"])].instance_type = r.choice(
        ["NONE", "COLLECTION"]
    )


def add(r):
    quad(f"New{r.randrange(1000)}", r.choice(sorted(bpy.data.materials, key=lambda m: m.name)))


def delete(r):
    things = [thing for thing in bpy.context.scene.objects if thing.name.startswith("New")]
    if things:
        bpy.data.objects.remove(things[0])


def step(r):
    bpy.context.scene.frame_set(bpy.context.scene.frame_current + 1)


def cast(r):
    thing = _some_object(r)
    thing.visible_shadow = not thing.visible_shadow


def film(r):
    bpy.context.scene.render.film_transparent = not bpy.context.scene.render.film_transparent


def move_inner(r):
    """What both empties instance."""
    bpy.data.objects["Inner"].location = _vector(r)


def move_scatter(r):
    """A mesh that stands there itself and instances another beside it."""
    bpy.data.objects["Scatter"].location = _vector(r)


def parent(r):
    bpy.data.objects["Child"].parent = r.choice(
        [None, *(bpy.data.objects[name] for name in ("Shared", "Modified", "EmptyA", "Point"))]
    )


def constrain(r):
    child = bpy.data.objects["Child"]
    if child.constraints:
        child.constraints.clear()
    else:
        child.constraints.new("COPY_LOCATION").target = bpy.data.objects["Twin"]


def see_lamp(r):
    thing = _some_object(r, "LIGHT")
    thing.visible_glossy = not thing.visible_glossy


def see(r):
    """Any of the Ray Visibility and masking switches of a thing."""
    thing, by = _some_object(r), ("diffuse", "glossy", "transmission", "volume_scatter", "camera")
    switch = r.choice([*(f"visible_{name}" for name in by), "is_holdout", "is_shadow_catcher"])
    setattr(thing, switch, not getattr(thing, switch))


def see_world(r):
    """Where the Cycles add-on is on."""
    flags = getattr(bpy.context.scene.world, "cycles_visibility", None)
    switch = r.choice(["diffuse", "glossy", "scatter", "camera", "transmission"])
    if flags is not None:
        setattr(flags, switch, not getattr(flags, switch))


def kind_of_lamp(r):
    r.choice(sorted(bpy.data.lights, key=lambda m: m.name)).type = r.choice(
        ["POINT", "SUN", "SPOT", "AREA"]
    )


def squeeze_lamp(r):
    _some_object(r, "LIGHT").scale = r.choice([(0, 0, 0), (1, 1, 1), (2, 1, 1)])


def lose(r):
    """A place that is no number."""
    _some_object(r, "MESH").location.x = r.choice([float("nan"), 1.0])


def mark(r):
    """Four corners of a square lie on a sphere."""
    mesh = _some_object(r, "MESH").data
    mark_sphere(mesh, "glint_sphere" not in mesh.attributes)


def tint(r):
    thing = _some_object(r, "MESH", "EMPTY")
    thing["tint"], thing.color = r.random(), (*(r.random() for _ in range(3)), 1.0)
    thing.update_tag()


def repaint_object(r):
    _some_object(r, "MESH", "EMPTY").color = (*(r.random() for _ in range(3)), 1.0)


def select(r):
    thing = _some_object(r)
    thing.select_set(not thing.select_get())


EDITS = [
    move,
    move_inner,
    move_scatter,
    turn,
    scale_to_nothing,
    lose,
    parent,
    constrain,
    edit_vertex,
    add_triangle,
    subdivide,
    smooth,
    color,
    node_value,
    unlink_or_link,
    paint,
    recolor,
    reload,
    interpolate,
    swap_material,
    light,
    kind_of_lamp,
    squeeze_lamp,
    see_lamp,
    see,
    see_world,
    surround,
    hide,
    exclude,
    add,
    delete,
    select,
    step,
    cast,
    film,
    mark,
    tint,
    repaint_object,
]
