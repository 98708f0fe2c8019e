"""The export that keeps what did not change: after any sequence of edits it gives what a full
export gives, bit for bit.
"""

import copy
import dataclasses
import random

import bpy
import numpy as np
import pytest

from export_support import Shader, link, mesh_object, quad, scene, use_nodes  # noqa: F401
from glint.addon.export import collector as walked
from glint.addon.export import export_scene
from glint.addon.export.geometry.shapes import mark_sphere
from glint.addon.export.materials import materials
from glint.addon.export.sync import incremental
from glint.addon.export.sync.incremental import LiveExport
from glint.engine.scene import Camera, Mesh, SceneDelta

CAMERA = Camera("PERSPECTIVE", np.eye(4)[:3], (-1, 1, -1, 1), (4, 4))


class Follower:
    """A LiveExport that is told every update of the depsgraph, as in a viewport."""

    def __init__(self, passes=frozenset()) -> None:
        self.live, self.passes, self.scene, self.reads = LiveExport(), passes, None, 0
        self.heard: list[tuple] = []

    def __enter__(self):
        bpy.app.handlers.depsgraph_update_post.append(self._update)
        bpy.app.handlers.frame_change_post.append(self._update)
        self._update(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
        return self

    def __exit__(self, *_):
        bpy.app.handlers.depsgraph_update_post.remove(self._update)
        bpy.app.handlers.frame_change_post.remove(self._update)

    def _update(self, _scene, depsgraph):
        self.heard = [(update.id.id_type, update.id.name) for update in depsgraph.updates]
        before = copy.deepcopy(self.scene)
        known = self.scene
        self.scene = self.live.update(depsgraph, CAMERA, passes=self.passes)
        if known is not None:
            delta = self.live.delta(self.passes)
            assert delta == SceneDelta.between(known, self.scene, delta)
            named_alone(delta, before, self.scene)

    def check(self):
        bpy.context.view_layer.update()
        full = export_scene(bpy.context.evaluated_depsgraph_get(), passes=self.passes)
        assert same(self.scene, dataclasses.replace(full.scene, camera=CAMERA), "scene")
        assert set(self.live.notes(self.passes)) == {
            note for note in full.notes if "camera" not in note
        }


def named_alone(delta, before, after):
    """Values that the delta does not name are to the last bit what they were.

    before: a copy, in which nothing follows what is written into the arrays of the scene.
    """
    for name in ("geometries", "instances", "materials", "textures", "lights"):
        named = getattr(delta, name)
        pairs = zip(getattr(before, name), getattr(after, name), strict=named is not None)
        for k, (one, two) in enumerate(pairs if named is not None else ()):
            assert k in named or same(one, two, f"{name}[{k}]")
    assert delta.world or same(before.world, after.world, "world")


def same(one, two, where):
    """Equal to the last bit; says where not."""
    assert type(one) is type(two), f"{where}: {type(one)} and {type(two)}"
    if isinstance(one, np.ndarray):
        assert one.dtype == two.dtype and one.shape == two.shape, where
        assert one.tobytes() == two.tobytes(), where
    elif isinstance(one, tuple):
        assert len(one) == len(two), f"{where}: {len(one)} and {len(two)}"
        assert all(
            same(a, b, f"{where}[{k}]") for k, (a, b) in enumerate(zip(one, two, strict=True))
        )
    elif isinstance(one, dict):
        same(tuple(one), tuple(two), where)
        same(tuple(one.values()), tuple(two.values()), where)
    elif dataclasses.is_dataclass(one):
        for name in (field.name for field in dataclasses.fields(one)):
            same(getattr(one, name), getattr(two, name), f"{where}.{name}")
    else:
        assert one == two or (one != one and two != two), f"{where}: {one!r} and {two!r}"
    return True


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


def test_notes_last_as_long_as_what_they_are_about(scene):  # noqa: F811
    odd = Shader("Odd")
    velvet = odd.node("ShaderNodeTexWhiteNoise")
    odd.link(velvet, "Color", odd.shader, "Color")
    use_nodes(odd.material)
    plain, lamp = (
        quad("Plain"),
        link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))),
    )
    with Follower() as follower:
        follower.check()
        told = follower.live.notes()
        assert any("'Odd'" in note for note in told), told
        plain.location = (1, 0, 0)
        follower.check()
        plain.hide_viewport = True
        follower.check()
        lamp.data.energy = 7
        follower.check()
        assert follower.live.notes() == told
        odd.material.node_tree.links.clear()
        follower.check()
        assert not any("'Odd'" in note and "Noise" in note for note in follower.live.notes())


def test_an_image_without_its_file_is_told_as_long_as_a_material_shows_it(scene, tmp_path):  # noqa: F811
    """Whichever of them is edited or goes."""
    image = bpy.data.images.new("Gone", 2, 2)
    image.source, image.filepath = "FILE", str(tmp_path / "gone.png")
    shaders = [Shader(name) for name in ("One", "Two")]
    for shader in shaders:
        texture = shader.node("ShaderNodeTexImage")
        texture.image = image
        shader.link(texture, "Color", shader.shader, "Color")
    with Follower() as follower:

        def is_told():
            follower.check()
            return any("gone.png" in note for note in follower.live.notes())

        assert is_told()
        shaders[0].shader.inputs["Roughness"].default_value = 0.25
        assert is_told()
        bpy.data.objects.remove(shaders[0].quad)
        assert is_told()
        bpy.data.objects.remove(shaders[1].quad)
        assert not is_told()


@pytest.fixture
def world(scene):  # noqa: F811
    """Plain and modified meshes, shared data, textures, an empty that instances a collection,
    lights, a world with nodes.
    """
    material = Shader("Textured")
    image = bpy.data.images.new("Image", 4, 4)
    image.pixels.foreach_set(np.random.default_rng(1).random(64, np.float32))
    texture = material.node("ShaderNodeTexImage")
    texture.image = image
    material.link(texture, "Color", material.shader, "Color")
    material.quad.name = "Textured"
    plain = bpy.data.materials.new("Plain")
    plain.use_nodes = False
    shared = quad("Shared", plain, material.material)
    link(bpy.data.objects.new("Twin", shared.data))
    modified = quad("Modified", material.material)
    modified.data.uv_layers.new(name="UVMap")
    modified.modifiers.new("Subdivide", "SUBSURF").levels = 1
    quad("Personal", personal())
    instanced = bpy.data.collections.new("Instanced")
    inner = mesh_object("Inner", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    inner.data.materials.append(personal())
    bpy.context.scene.collection.objects.unlink(inner)
    instanced.objects.link(inner)
    for name in ("EmptyA", "EmptyB"):
        empty = link(bpy.data.objects.new(name, None))
        empty.instance_type, empty.instance_collection = "COLLECTION", instanced
    child = quad("Child")
    child.parent = shared
    quad("Scatter").modifiers.new("Scatter", "NODES").node_group = scattering()
    for kind in ("POINT", "SUN", "AREA"):
        link(bpy.data.objects.new(kind.title(), bpy.data.lights.new(kind.title(), kind)))
    scene.world = bpy.data.worlds.new("World")
    use_nodes(scene.world)
    tree = scene.world.node_tree
    tree.links.new(
        tree.nodes.new("ShaderNodeBackground").outputs[0],
        tree.nodes.new("ShaderNodeOutputWorld").inputs[0],
    )
    bpy.context.view_layer.update()
    return scene


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


@pytest.mark.parametrize("edit", EDITS)
def test_one_edit(world, edit):
    with Follower() as follower:
        for seed in range(3):
            edit(random.Random(seed))
            follower.check()


@pytest.mark.parametrize("seed", range(12))
def test_any_sequence_of_edits(world, seed):
    r = random.Random(seed)
    with Follower(frozenset({"UV"}) if seed % 2 else frozenset()) as follower:
        for _ in range(12):
            for _ in range(r.randrange(1, 4)):
                r.choice(EDITS)(r)
            follower.check()


@pytest.mark.parametrize("edit", [move, light, color, node_value, surround, cast])
def test_what_is_no_geometry_reads_no_mesh(world, edit, monkeypatch):
    with Follower() as follower:
        follower.check()
        before = {id(geometry) for geometry in follower.scene.geometries}
        monkeypatch.setattr(walked, "read_shape", lambda *_: pytest.fail("a mesh was read"))
        monkeypatch.setattr(
            "glint.addon.export.collector.read_attributes",
            lambda *_: pytest.fail("an attribute was read"),
        )
        edit(random.Random(1))
        bpy.context.view_layer.update()
        assert {id(geometry) for geometry in follower.scene.geometries} <= before


def test_the_nodes_of_a_lamp_are_followed(world):
    """Edited, moved with their light, and with an image of which the pixels change."""
    lamp = bpy.data.objects["Point"]
    with Follower() as follower:
        follower.check()
        lamp.data.use_nodes = True
        tree = lamp.data.node_tree
        emission = next(node for node in tree.nodes if node.type == "EMISSION")
        texture, falloff = (
            tree.nodes.new(f"ShaderNode{name}") for name in ("TexImage", "LightFalloff")
        )
        texture.image = bpy.data.images.new("slide", 2, 2, float_buffer=True)
        tree.links.new(falloff.outputs["Linear"], emission.inputs["Strength"])
        follower.check()
        assert any(light.program is not None for light in follower.scene.lights)
        tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
        follower.check()
        falloff.inputs["Smooth"].default_value = 3
        follower.check()
        lamp.location.x += 1
        follower.check()
        lamp.scale = (1, 2, 3)
        follower.check()
        texture.image.pixels[:] = [0.25] * 16
        texture.image.update_tag()
        follower.check()


def test_an_edited_material_walks_over_nothing(world, monkeypatch):
    unlink_or_link(random.Random(0))
    with Follower() as follower:
        follower.check()
        before = follower.scene
        with monkeypatch.context() as patched:
            patched.setattr(
                incremental, "walk", lambda *_: pytest.fail("the instances were walked over")
            )
            node_value(random.Random(1))
            bpy.context.view_layer.update()
        assert (
            follower.scene.materials != before.materials
            and follower.scene.instances is before.instances
        )
        follower.check()


def test_an_edited_node_value_compiles_its_material_alone(scene, monkeypatch):  # noqa: F811
    """Of three materials with programs; and nothing is compiled where nothing changed."""
    noises = []
    for k in range(3):
        shader = Shader(f"noise {k}")
        noise = shader.node("ShaderNodeTexNoise")
        shader.link(noise, "Color", shader.shader, "Color")
        noises.append(noise)
    compiled = []
    known = materials.compile_material

    def counted(material, *given):
        compiled.append(material.name)
        return known(material, *given)

    monkeypatch.setattr(materials, "compile_material", counted)
    with Follower() as follower:
        assert sorted(compiled) == ["noise 0", "noise 1", "noise 2"]
        compiled.clear()
        before = follower.scene
        noises[1].inputs["Scale"].default_value = 11.0
        bpy.context.view_layer.update()
        assert compiled == ["noise 1"]
        changed = [
            one.name
            for one, two in zip(before.materials, follower.scene.materials, strict=True)
            if one != two
        ]
        assert changed == ["noise 1"]
        assert follower.scene.geometries[0] is before.geometries[0]
        compiled.clear()
        scene.objects[0].location.x += 1.0
        bpy.context.view_layer.update()
        assert compiled == []
        follower.check()


@pytest.mark.skipif(bpy.app.version < (5, 2), reason="the node reads none before Blender 5.2")
def test_attributes_that_rays_read_are_those_of_all_meshes(scene):  # noqa: F811
    """Whichever is met first, and after the name is another."""
    quad("Other")
    shader = Shader("asks")
    for name in ("first", "second"):
        for thing in scene.objects:
            if thing.type == "MESH":
                rows = thing.data.attributes.new(name, "FLOAT_COLOR", "POINT").data
                rows.foreach_set("color", np.linspace(0, 1, 4 * len(rows), dtype=np.float32))
    node = shader.node("ShaderNodeRaycast")
    node.sample_attribute_items.new("RGBA", "Sampled")
    shader.link(node, "Sampled", shader.shader, "Color")
    named = next(s for s in node.inputs if s.name == "Sampled")
    with Follower() as follower:
        for name in ("first", "second", "none", "", "first"):
            named.default_value = name
            shader.material.update_tag()
            bpy.context.view_layer.update()
            follower.check()
            meshes = [g for g in follower.scene.geometries if isinstance(g, Mesh)]
            assert len(meshes) > 1
            read = [[a.name for a in mesh.attributes] for mesh in meshes]
            assert all(names == ([name] if name in ("first", "second") else []) for names in read)


def number(r):
    bpy.data.objects["Shared"].pass_index += 1


def push(r):
    bpy.data.objects["Shared"].location.x += 0.25


def dress(r):
    """Another material in a slot of the object, not of its mesh."""
    slot = bpy.data.objects["Twin"].material_slots[0]
    slot.link = "OBJECT"
    slot.material = bpy.data.materials[
        "Textured" if slot.material == bpy.data.materials["Plain"] else "Plain"
    ]


@pytest.mark.parametrize(
    "edit",
    [cast, number, dress, edit_vertex, push, hide, surround, swap_material, film, unlink_or_link],
)
def test_an_edited_material_hides_no_other_edit(world, edit):
    unlink_or_link(random.Random(0))
    with Follower() as follower:
        for seed in range(3):
            node_value(random.Random(seed))
            edit(random.Random(seed))
            follower.check()


@pytest.mark.parametrize("kind", ["MESH", "CURVE"])
def test_data_that_several_objects_share_outlive_each_of_them(scene, kind, monkeypatch):  # noqa: F811
    """Whichever of them brought the shape first, an edit is heard of through those that are left;
    and if Blender puts what was edited at the same address again.
    """
    if kind == "MESH":  # each curve object has a temporary mesh of its own
        monkeypatch.setattr(walked, "mesh_key", lambda mesh: (mesh.name,))
    data = bpy.data.curves.new("Shared", "CURVE") if kind == "CURVE" else quad("Model").data
    if kind == "CURVE":
        data.splines.new("POLY").points.add(2)
        data.splines[0].points[1].co = data.splines[0].points[2].co = (1, 1, 0, 1)
        data.bevel_depth = 0.1
    for model in list(scene.collection.objects)[1:]:
        bpy.data.objects.remove(model)
    names = [f"User {k}" for k in range(3)]
    for name in names:
        link(bpy.data.objects.new(name, data))
    with Follower() as follower:
        follower.check()
        for number, name in enumerate(names[:2]):
            bpy.data.objects.remove(bpy.data.objects[name])
            follower.check()
            if kind == "CURVE":
                data.bevel_depth = 0.2 + number
            else:
                data.vertices[0].co.z = 0.2 + number
                data.update()
            follower.check()
