"""The table of bad input, row by row, from a Blender scene to the pixel. Tests of the parts live
elsewhere:

NaN, Inf transform   test_a_transform_that_is_no_place; blender/test_export_instances:
test_places_that_are_not_finite_are_named NaN, Inf vertex      test_bad_faces.py;
blender/test_export_meshes: test_faces_with_vertices_that_are_not_finite_are_counted_out NaN, Inf
light       test_a_light_with_no_power, test_a_colour_channel_that_is_no_number;
blender/test_export_lights NaN, Inf colour      test_a_colour_channel_that_is_no_number;
blender/test_export_materials, _world: test_values_that_are_not_finite_… NaN, Inf camera
test_a_camera_nowhere_is_an_error; blender/test_export_camera: test_bad_cameras_are_errors power
3e38, negative test_the_largest_power_saturates, test_negative_power_…; blender/test_export_lights:
test_odd_powers_are_kept image                test_images_that_cannot_be_read_are_magenta;
blender/test_export_images: test_what_cannot_be_read_… circles of links
test_a_circle_of_nodes_counts_as_the_default; blender/test_export_materials: test_circles_… 256
nested groups    test_the_depth_of_256_groups; blender/test_export_materials: test_nested_groups
material slots       test_no_material_is_…, test_a_slot_that_is_not_there_…;
blender/test_export_materials, _meshes no light, no world   test_nothing_that_shines;
blender/test_addon_render: test_a_black_picture_says_why 2^32, no memory
test_more_triangles_than_an_index_counts, test_blender_lives_on_…; engine/test_native_render:
test_memory_… cancel               test_a_cancel_stops_within_few_rays; engine/test_native_render:
test_cancel_…; _reference_render: test_should_stop_…
"""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

import extreme_scenes as extreme
import small_scenes as build
from blender_process import REGISTER_TREE, Blender
from cycles_reference import bpy
from glint import engine
from glint.addon.export import export_scene
from glint.addon.export.camera import ExportError
from glint.engine import scene as s
from glint.engine.native.render import render_native
from glint_picture import BACKENDS, render_glint

NAN, INF = float("nan"), float("inf")
SIDE = 32


def notes() -> tuple[str, ...]:
    return export_scene(bpy.context.evaluated_depsgraph_get(), width=SIDE, height=SIDE).notes


def floor_scene():
    """A floor that fills the view of a camera above, under a sun in the zenith of E = π; a pixel is
    the albedo.
    """
    scene = extreme.new_scene(SIDE)
    build.add(scene, "Floor", build.plane(50.0, extreme.grey()))
    build.add_light(scene, "SUN", (0, 0, 1), energy=pi)
    build.add_camera(scene, (0, 0, 9), (0, 0, 0))
    return scene


def diffuse_of(scene):
    """(node tree, Diffuse node) of the floor."""
    tree = scene.objects["Floor"].data.materials[0].node_tree
    return tree, next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfDiffuse")


def colors(scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    """(h, w, 3); all finite."""
    picture = render_glint(scene, backend, **settings).combined
    assert np.isfinite(picture).all()
    return picture[..., :3]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("varies", [False, True])
@pytest.mark.parametrize(("number", "factor"), [(NAN, 0.0), (INF, 1.0), (-INF, 0.0)])
def test_numbers_of_nodes_that_no_float_holds(number, factor, varies, backend):
    """Blender cuts infinity to the largest float: times 1e30 it is beyond those. What mixes colours
    is kept between 0 and 1.
    """
    scene = floor_scene()
    tree, diffuse = diffuse_of(scene)
    huge, mix = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeMixRGB")
    huge.operation = "MULTIPLY_ADD"
    huge.inputs[0].default_value, huge.inputs[1].default_value = number, 1e30
    if varies:
        place = tree.nodes.new("ShaderNodeNewGeometry")
        tree.links.new(place.outputs["Backfacing"], huge.inputs[2])
    else:
        huge.inputs[2].default_value = 0.0
    mix.inputs["Color1"].default_value = (0.5, 0.25, 0.125, 1.0)
    mix.inputs["Color2"].default_value = (0.25, 0.5, 0.75, 1.0)
    tree.links.new(huge.outputs[0], mix.inputs[0])
    tree.links.new(mix.outputs[0], diffuse.inputs["Color"])
    wanted = (0.25, 0.5, 0.75) if factor else (0.5, 0.25, 0.125)
    assert np.abs(colors(scene, backend) - wanted).max() < 1e-6
    assert sum("not finite" in note for note in notes()) == int(np.isnan(number))


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
def test_a_transform_that_is_no_place(bad):
    clean = render_glint(extreme.still_life(), "NATIVE").combined
    scene = extreme.still_life()
    build.add(scene, "Lost", build.cube(extreme.grey()), build.moved(0.0, bad, 20.0))
    assert np.array_equal(render_glint(scene, "NATIVE").combined, clean)
    assert sum("'Lost'" in note for note in notes()) == 1


def test_a_place_as_far_as_numbers_go():
    """Blender cuts an infinite location to the largest float."""
    clean = render_glint(extreme.still_life(), "NATIVE").combined
    scene = extreme.still_life()
    build.add(scene, "Far", build.cube(extreme.grey())).location = (0.0, INF, 20.0)
    assert np.array_equal(render_glint(scene, "NATIVE").combined, clean)


@pytest.mark.parametrize("bad", [NAN, INF])
def test_a_light_with_no_power(bad):
    clean = render_glint(extreme.still_life(), "NATIVE").combined
    scene = extreme.still_life()
    build.add_light(scene, "POINT", (0, 0, 30), energy=bad).name = "Broken"
    assert np.array_equal(render_glint(scene, "NATIVE").combined, clean)
    assert sum("'Broken'" in note for note in notes()) == 1


@pytest.mark.parametrize("where", ["light", "material"])
def test_a_colour_channel_that_is_no_number(where):
    scene = floor_scene()
    if where == "light":
        scene.objects["Light"].data.color = (1.0, NAN, 1.0)
    else:
        diffuse_of(scene)[1].inputs["Color"].default_value = (0.8, NAN, 0.8, 1.0)
    picture = colors(scene)
    assert (picture[..., 1] == 0).all()
    assert np.abs(picture[..., [0, 2]] - 0.8).max() < 1e-6


@pytest.mark.parametrize("bad", [NAN, INF])
def test_a_camera_nowhere_is_an_error(bad):
    scene = floor_scene()
    scene.camera.matrix_world = build.moved(bad, 0.0, 9.0)
    with pytest.raises(ExportError, match=r"'Camera'.*not finite"):
        render_glint(scene, "NATIVE")


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["SUN", "POINT"])
def test_the_largest_power_saturates(kind, backend):
    """Twenty lamps of 3e38, of which a point is near the floor: more than float32 holds."""
    scene = floor_scene()
    for _ in range(20):
        build.add_light(scene, kind, (0, 0, 0.05), energy=3e38)
    film = render_glint(scene, backend)
    assert np.isfinite(film.combined).all()
    assert film.combined[..., :3].max() == np.finfo(np.float32).max
    assert film.combined[..., :3].min() > 1e30
    for light in bpy.data.lights:
        light.energy *= -1
    assert np.isfinite(render_glint(scene, backend).combined).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_negative_power_takes_light_away(backend):
    pictures = []
    for sign in (1.0, -1.0):
        scene = extreme.still_life()
        scene.objects["Light"].data.energy *= sign
        pictures.append(colors(scene, backend))
    assert np.array_equal(pictures[0], -pictures[1])
    assert pictures[0].max() > 0


@pytest.mark.parametrize("content", [None, b"", b"\x89PNG\r\n\x1a\n" + b"\0" * 40])
def test_images_that_cannot_be_read_are_magenta(content, tmp_path):
    path = tmp_path / "picture.png"
    if content is not None:
        path.write_bytes(content)
    scene = floor_scene()
    tree, diffuse = diffuse_of(scene)
    image = bpy.data.images.new("Broken", 1, 1)
    image.source, image.filepath = "FILE", str(path)
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], diffuse.inputs["Color"])
    assert np.abs(colors(scene) - (1.0, 0.0, 1.0)).max() < 1e-6
    assert sum("picture.png" in note for note in notes()) == 1


def test_a_circle_of_nodes_counts_as_the_default():
    """The circle's socket has its own value, which Gamma 1 and Invert by nothing hand on."""
    scene = floor_scene()
    tree, diffuse = diffuse_of(scene)
    first, second = tree.nodes.new("ShaderNodeGamma"), tree.nodes.new("ShaderNodeGamma")
    for node in (first, second):
        node.inputs["Color"].default_value = (0.25, 0.5, 0.75, 1.0)
    tree.links.new(first.outputs[0], second.inputs["Color"])
    tree.links.new(second.outputs[0], first.inputs["Color"])
    tree.links.new(first.outputs[0], diffuse.inputs["Color"])
    assert np.abs(colors(scene) - (0.25, 0.5, 0.75)).max() < 1e-6
    assert sum("circle" in note for note in notes()) == 1


def test_the_depth_of_256_groups():
    scene, inner = floor_scene(), None
    for depth in range(256):
        tree = bpy.data.node_groups.new(f"Group {depth}", "ShaderNodeTree")
        tree.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
        given, result = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
        source = given.outputs[0]
        if inner is not None:
            group = tree.nodes.new("ShaderNodeGroup")
            group.node_tree = inner
            tree.links.new(source, group.inputs[0])
            source = group.outputs[0]
        tree.links.new(source, result.inputs[0])
        inner = tree
    tree, diffuse = diffuse_of(scene)
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = inner
    group.inputs[0].default_value = (0.1, 0.2, 0.3, 1.0)
    tree.links.new(group.outputs[0], diffuse.inputs["Color"])
    assert np.abs(colors(scene) - (0.1, 0.2, 0.3)).max() < 1e-6


@pytest.mark.parametrize("slots", [(), (None,)])
def test_no_material_is_blenders_default_surface(slots):
    """Grey 0.8, a default Principled from 5.0 on."""
    pictures = []
    for materials in (slots, None):
        scene = floor_scene()
        data = scene.objects["Floor"].data
        data.materials.clear()
        for material in (default_surface(),) if materials is None else materials:
            data.materials.append(material)
        pictures.append(colors(scene))
    assert np.abs(pictures[0] - pictures[1]).max() < 1e-6
    assert pictures[0].min() > 0.5


def default_surface():
    if bpy.app.version < (5, 0, 0):
        return extreme.grey()
    material, tree, output = build.new_material("Default")
    tree.links.new(
        tree.nodes.new("ShaderNodeBsdfPrincipled").outputs["BSDF"], output.inputs["Surface"]
    )
    return material


def test_a_slot_that_is_not_there_is_the_last():
    scene = floor_scene()
    data = scene.objects["Floor"].data
    data.materials.append(extreme.grey(0.6))
    data.attributes.new("material_index", "INT", "FACE").data.foreach_set(
        "value", np.full(len(data.polygons), 77, np.int32)
    )
    assert np.abs(colors(scene) - 0.6).max() < 1e-6


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_that_shines(backend):
    """Black, and opaque where there is something or the film is."""
    scene = extreme.still_life()
    bpy.data.objects.remove(scene.objects["Light"])
    scene.world = None
    picture = render_glint(scene, backend).combined
    assert (picture[..., :3] == 0).all()
    assert 0.2 < picture[..., 3].mean() < 0.95
    scene.render.film_transparent = False
    assert (render_glint(scene, backend).combined == (0, 0, 0, 1)).all()


def test_more_triangles_than_an_index_counts():
    """2^40 of them, past the checks that would look at each: an error, and the next picture is
    drawn.
    """
    scene = floor_scene()
    given = export_scene(bpy.context.evaluated_depsgraph_get(), width=SIDE, height=SIDE).scene
    triangles = np.broadcast_to(given.geometries[0].triangles[:1], (2**40, 3))
    huge = replace(given, geometries=(s.Mesh("huge", given.geometries[0].vertices, triangles),))
    with pytest.raises(MemoryError, match=r"\d [GT]i?B"):
        render_native(huge, engine.Settings(samples=1))
    assert colors(scene).min() > 0


def test_blender_lives_on_after_a_lack_of_memory(tmp_path):
    """The operator fails with a message that says how much; the next render of the same process
    succeeds.
    """
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
from glint import engine
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x = scene.render.resolution_y = 16
scene.glint.final.samples = 1
scene.glint.final.backend = "NUMPY"
whole, said = engine.render, ""

def greedy(*arguments, **more):
    import numpy as np
    return np.empty((2**20, 2**20, 16))

engine.render = greedy
try:
    bpy.ops.render.render()
except RuntimeError as error:
    said = str(error)
engine.render = whole
answer({"said": said, "then": sorted(bpy.ops.render.render())})
"""
    )
    assert run.returncode == 0, run.output
    assert "memory" in run.answer["said"]
    assert "TiB" in run.answer["said"]
    assert run.answer["then"] == ["FINISHED"]


def test_a_cancel_stops_within_few_rays():
    """100 ms are more than 100 000 of these rays on the slowest core there is: at most so many are
    traced after the word, in one of three tries, as a busy machine may keep it waiting.
    """
    scene = extreme.still_life()
    samples = 1 << 14
    film = render_glint(scene, "NATIVE", samples=1)
    rays = film.stats["rays"]
    export = export_scene(
        bpy.context.evaluated_depsgraph_get(), width=extreme.SIDE, height=extreme.SIDE
    )
    settings = engine.Settings(samples=samples, light_samples=1, threads=2)
    late = []
    for _ in range(3):
        told = [0.0]
        film = engine.render(
            export.scene,
            settings,
            should_stop=lambda told=told: told[-1] > 4 / samples,
            on_progress=told.append,
        )
        assert not film.complete
        late.append(film.stats["rays"] - told[-1] * samples * rays)
    assert min(late) < 1e5 + rays
