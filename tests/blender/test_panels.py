"""What the user sees: which panels a tab has, in which order, what they offer, and that those
without effect say so.
"""

import ast
import re
from pathlib import Path

import pytest

from blender_process import REGISTER_TREE, Blender

PROGRAM = (
    REGISTER_TREE
    + """
from types import SimpleNamespace

import blf
import bl_ui
from cycles import ui as cycles_ui
from glint.addon.ui import panel as panel_base, panels

# a program without windows has no width: between a panel's edges, less the margin, of an editor
# of 275 pixels, or of one in a window of 1280
width, narrow = 213, 157
panel_base.row_width = lambda region: width
panel_base.draw_text = lambda layout, lines, *rest, **look: [layout.label(text=line) for line in lines]
blf.size(0, 12)
cut, drawn_panels = {}, set()

class Layout:
    \"\"\"Writes down what is drawn, and what Blender would cut there.\"\"\"
    use_property_decorate = True
    def __init__(self, share=0.4, is_split=False):
        self.drawn, self.share, self.is_split = [], share, is_split
    def prop(self, owner, name, text=None, **options):
        getattr(owner, name)
        self.drawn.append([name, self.use_property_decorate])
        if not hasattr(owner, "bl_rna"):
            return
        known = owner.bl_rna.properties[name]
        self.shown(known.name if text is None else text, known.type == "BOOLEAN")
    def shown(self, text, is_switch=False):
        # less a switch's box, a dot's place
        room = (width - (18 if self.use_property_decorate else 0)) * (0.6 if is_switch else self.share) - (20 if is_switch else 2)
        if blf.dimensions(0, text)[0] > room:
            cut[text] = [blf.dimensions(0, text)[0], room]
    def split(self, factor):
        inner = Layout(factor, is_split=True)
        inner.drawn, inner.use_property_decorate = self.drawn, False
        return inner
    def prop_search(self, owner, name, *rest, text="", **options):
        self.drawn.append([name, False])
        self.shown(text)
    def operator(self, name, **options):
        return SimpleNamespace()
    def template_curve_mapping(self, *given):
        pass
    template_preview = template_curve_mapping
    def template_node_view(self, tree, node, socket):
        self.drawn.append([socket.name, False])
    def label(self, text="", **options):
        if self.is_split:
            self.shown(text)
        else:
            self.drawn.append([text, False])
    def separator(self):
        pass
    def column(self, heading="", **options):
        self.shown(heading)
        return self
    row = column

def offered(panel, context):
    mixins = tuple(base for base in panel.__bases__ if base is not bpy.types.Panel)
    drawer = type("Drawer", mixins, {key: value for key, value in vars(panel).items() if not key.startswith("__")})()
    drawer.layout = Layout()
    drawer.draw(context)
    return drawer.layout.drawn

class Shown(SimpleNamespace):
    \"\"\"What a tab shows: nothing but what is named.\"\"\"
    def __getattr__(self, name):
        return None

def order(tab, engine, classes, **shown):
    \"\"\"Labels of the panels with headers, as Blender has them: by their order, then as registered.\"\"\"
    every = [panel for module in bl_ui._modules_loaded for panel in module.classes]
    context = Shown(engine=engine, scene=scene, view_layer=bpy.context.view_layer, **shown)
    found = [
        panel for panel in (*every, *classes)
        if issubclass(panel, bpy.types.Panel) and getattr(panel, "bl_space_type", "") == "PROPERTIES"
        and getattr(panel, "bl_context", "") == tab and not getattr(panel, "bl_parent_id", "")
        and not hasattr(panel, "_property_type")  # of custom properties
        and "HIDE_HEADER" not in getattr(panel, "bl_options", ())
        and engine in getattr(panel, "COMPAT_ENGINES", {engine})
        and getattr(panel, "poll", bool)(context)
    ]
    return [panel.bl_label for panel in sorted(found, key=lambda panel: getattr(panel, "bl_order", 0))]

eevee = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"
engines = {"GLINT": panels._CLASSES, "CYCLES": cycles_ui.classes, eevee: ()}

def orders(tab, **shown):
    return [order(tab, engine, classes, **shown) for engine, classes in engines.items()]

def all_of(tab):
    # children too
    every = (*panels._blender_panels(), *panels._CLASSES)
    return sorted({panel.bl_label for panel in every if getattr(panel, "bl_context", "") == tab})

scene = bpy.context.scene
scene.render.engine = "GLINT"
light = bpy.data.lights["Light"]
light.use_nodes = True
camera = scene.camera.data
camera.type = "PANO"
context = SimpleNamespace(scene=scene, camera=camera, volume=bpy.data.volumes.new("Cloud"), engine="GLINT", view_layer=bpy.context.view_layer, light=light,
                          material=bpy.data.materials["Material"], world=scene.world,
                          object=bpy.data.objects["Cube"])
properties = {name: prop for group in (scene.glint, scene.glint.final, scene.view_layers[0].glint)
              for name, prop in group.bl_rna.properties.items() if name != "rna_type"}
def reasons(panel, change, back):
    change()
    said = [text for text, _ in offered(panel, context)]
    back()
    return said

final, layer = scene.glint.final, bpy.context.view_layer
def vector(on):
    layer.use_pass_vector = scene.render.use_motion_blur = on

why = {
    "none": [text for panel in (panels.GLINT_RENDER_PT_sampling, panels.GLINT_RENDER_PT_light_paths, panels.GLINT_RENDER_PT_sampling_final,
                                panels.GLINT_RENDER_PT_performance, panels.view_layer_panels.GLINT_VIEWLAYER_PT_data)
             for text, _ in offered(panel, context) if " " in text],
    "classic": reasons(panels.GLINT_RENDER_PT_sampling, lambda: setattr(final, "illumination", "CLASSIC"),
                       lambda: setattr(final, "illumination", "PHYSICAL")),
    "target": reasons(panels.GLINT_RENDER_PT_sampling_final, lambda: setattr(scene.glint, "target", "RMSE"),
                      lambda: setattr(scene.glint, "target", "NONE")),
    "python": reasons(panels.GLINT_RENDER_PT_performance, lambda: setattr(final, "backend", "NUMPY"),
                      lambda: setattr(final, "backend", "NATIVE")),
    "bounces": reasons(panels.GLINT_RENDER_PT_light_paths, lambda: setattr(final, "max_bounces", 0),
                       lambda: setattr(final, "max_bounces", 12)),
    "vector": reasons(panels.view_layer_panels.GLINT_VIEWLAYER_PT_data, lambda: vector(True), lambda: vector(False)),
}
bpy.context.view_layer.use_pass_ambient_occlusion = True
ours = [panel for panel in panels._CLASSES if issubclass(panel, panel_base.EnginePanel)
        and panel.draw.__module__.startswith("glint") and panel is not panels.GLINT_RENDER_PT_statistics]
owner = camera if hasattr(camera, "panorama_type") else camera.cycles
panoramas = {}
for kind in owner.bl_rna.properties["panorama_type"].enum_items.keys():
    owner.panorama_type = kind
    panoramas[kind] = len(offered(panels.data_panels.GLINT_CAMERA_PT_panorama, context))
for kind in ("SUN", "SPOT", "AREA", "POINT"):
    light.type = kind
    context.light = bpy.data.lights["Light"]
    for panel in ours:
        if panel.__name__ == "GLINT_LIGHT_PT_beam_shape" and kind in ("POINT", "SUN"):
            continue
        offered(panel, context)
        drawn_panels.add(panel.__name__)
at_first, cut, width = cut, {}, narrow
for panel in ours:
    if panel.__name__.startswith(("GLINT_RENDER_PT_sampling", "GLINT_RENDER_PT_light_paths", "GLINT_RENDER_PT_simplify")):
        offered(panel, context)
in_small_window, width = cut, 213
answer({
    "panoramas": panoramas, "narrow": in_small_window, "spherical": scene.render.use_spherical_stereo, "cut": at_first, "drawn": sorted(drawn_panels),
    "why": why,
    "orders": {
        "render": orders("render"),
        "view layer": orders("view_layer"),
        "object": orders("object", object=bpy.data.objects["Cube"]),
        "material": orders("material", material=bpy.data.materials["Material"], object=bpy.data.objects["Cube"]),
        "world": orders("world", world=scene.world),
        "light": orders("data", light=light, object=bpy.data.objects["Light"]),
        "camera": orders("data", camera=camera, object=scene.camera),
        "mesh": orders("data", mesh=bpy.data.meshes["Cube"], object=bpy.data.objects["Cube"]),
    },
    "override": offered(panels.view_layer_panels.GLINT_VIEWLAYER_PT_override, context),
    "simplify": offered(panels.GLINT_RENDER_PT_simplify_render, context),
    "light": offered(panels.data_panels.GLINT_LIGHT_PT_light, context),
    "material": offered(panels.data_panels.GLINT_MATERIAL_PT_settings,
                        SimpleNamespace(material=bpy.data.materials["Material"])),
    "material surface": offered(panels.data_panels.GLINT_MATERIAL_PT_settings_surface,
                                SimpleNamespace(material=bpy.data.materials["Material"])),
    "lighting": offered(panels.GLINT_VIEW3D_PT_shading_lighting, SimpleNamespace(space_data=SimpleNamespace(shading=SimpleNamespace(
        use_scene_lights_render=True, use_scene_world_render=True)))),
    "pass": offered(panels.GLINT_VIEW3D_PT_shading_render_pass, context),
    "tabs": {tab: all_of(tab) for tab in ("data", "material", "world", "object")},
    "volume": offered(panels.data_panels.GLINT_VOLUME_PT_render, context),
    "light nodes": offered(panels.data_panels.GLINT_LIGHT_PT_nodes, context),
    "culling": offered(panels.data_panels.GLINT_OBJECT_PT_culling, context),
    "world rays": offered(panels.data_panels.GLINT_WORLD_PT_ray_visibility, context),
    "of things": {thing.name: sorted(panel.bl_label for panel in panels._CLASSES if getattr(panel, "bl_context", "") == "object"
                                    and panel.poll(Shown(engine="GLINT", scene=scene, object=thing)))
                  for thing in (bpy.data.objects["Cube"], scene.camera, bpy.data.objects["Light"], bpy.data.objects.new("Empty", None))},
    "menus of two": [[name, [item.name for item in prop.enum_items]] for name, prop in properties.items()
                     if prop.type == "ENUM" and [item.name for item in prop.enum_items] == ["On", "Off"]],
    "drawn names": sorted({name for panel in ours if panel.__name__ != "GLINT_LIGHT_PT_beam_shape" for name, _ in offered(panel, context)}),
    "checkboxes": {name: [prop.default, properties[name.removeprefix("use_")].default]
                   for name, prop in properties.items() if prop.type == "BOOLEAN" and name.removeprefix("use_") in properties},
    "switched": [setattr(final, "use_subsurface", False), final.subsurface, setattr(final, "use_subsurface", True), final.subsurface],
    "names": {name: prop.name for name, prop in properties.items()},
    "tracers": {item.identifier: item.name for item in properties["backend"].enum_items},
    "descriptions": [prop.description for prop in properties.values()] + [item.description for prop in properties.values()
        if prop.type == "ENUM" for item in prop.enum_items],
})
"""  # noqa: E501 - a script for another Blender
)


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    run = Blender(tmp_path_factory.mktemp("panels")).run(PROGRAM)
    assert run.returncode == 0, run.output
    return run.answer


def test_no_panel_or_operator_is_forgotten():
    """Each class that derives from one of Blender's is named where classes are registered."""
    root = Path(__file__).resolve().parents[2]
    trees = [
        ast.parse(path.read_text())
        for package in ("addon", "operators")
        for path in (root / package).rglob("*.py")
    ]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    classes = {
        node.name
        for node in nodes
        if isinstance(node, ast.ClassDef)
        and any(ast.unparse(base).startswith("bpy.types.") for base in node.bases)
    }
    named = {node.id for node in nodes if isinstance(node, ast.Name)}
    named |= {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    assert len(classes) > 60
    assert classes - named == set()


def test_panels_stand_in_the_order_of_cycles(told):
    """In every tab; where Blender's own stand as in Eevee, in the order of that: Override of view
    layers, Depth of Field.
    """
    for tab, (ours, cycles, eevee) in told["orders"].items():
        other = eevee if tab in ("view layer", "camera") else cycles
        shared = [label for label in ours if label in other]
        assert shared == [label for label in other if label in ours], tab
    assert told["orders"]["world"][0][:3] == ["Preview", "Surface", "Volume"]
    assert "Statistics" in told["orders"]["render"][0]


def test_no_panel_of_cycles_is_missing(told):
    """But for those of what Glint has not, a light's Settings, which stand with it as they did
    before Blender 5.0, and an object's Shading, of which 4.2 has but the light group with Glint.
    """
    missing = {
        label
        for ours, cycles, _ in told["orders"].values()
        for label in cycles
        if label not in ours
    }
    assert missing <= {"Subdivision", "Bake", "Settings", "Shading"}


def test_what_works_is_offered(told):
    assert ["material_override", False] in told["override"]
    assert told["simplify"] == [
        ["simplify_subdivision_render", False],
        ["simplify_child_particles_render", False],
    ]
    assert told["material"] == [["pass_index", False]]
    assert [name for name, _ in told["material surface"]] == [
        "displacement_method",
        "use_transparent_shadow",
        "use_bump_map_correction",
    ]
    assert told["lighting"] == [["use_scene_lights_render", True], ["use_scene_world_render", True]]
    assert [name for name, _ in told["pass"]] == ["viewport_pass"]


def test_what_is_read_can_be_set(told):
    """The lens, a light's nodes, volumes, bumps, mist, indices and what sees the world."""
    assert {"Depth of Field", "Aperture", "Nodes"} <= set(told["tabs"]["data"])
    material = {"Surface", "Volume", "Displacement", "Settings"}
    assert material <= set(told["tabs"]["material"])
    world = {"Surface", "Volume", "Mist Pass", "Ray Visibility", "Settings", "Light Group"}
    assert world <= set(told["tabs"]["world"])
    assert told["light nodes"] == [["Surface", False]]
    of_objects = {"Visibility", "Ray Visibility", "Culling", "Shadow Terminator"}
    assert of_objects <= set(told["tabs"]["object"])
    assert [name for name, _ in told["culling"]][:2] == ["use_camera_cull", "use_distance_cull"]
    assert [name for name, _ in told["world rays"]] == [
        "camera",
        "diffuse",
        "glossy",
        "transmission",
        "scatter",
    ]


def test_objects_have_the_panels_of_what_they_are(told):
    """What rays neither see nor are lit by has none of the settings of rays."""
    rays = {"Ray Visibility", "Culling", "Light Group"}
    things = {name: set(labels) for name, labels in told["of things"].items()}
    assert things["Cube"] == rays | {"Visibility", "Shadow Terminator", "Motion Blur"}
    assert things["Light"] == rays | {"Visibility", "Motion Blur"}
    assert things["Camera"] == {"Visibility"}
    assert things["Empty"] == {"Visibility", "Motion Blur"}


def test_each_panorama_has_its_settings(told):
    panoramas = told["panoramas"]
    kinds = {"EQUIRECTANGULAR": 5, "FISHEYE_EQUISOLID": 3, "FISHEYE_LENS_POLYNOMIAL": 7}
    assert kinds.items() <= panoramas.items()
    assert told["spherical"], "Blender's panel shows no Spherical Stereo"
    without_settings = {kind for kind, count in panoramas.items() if count == 1}
    assert without_settings <= {"MIRRORBALL", "EQUIANGULAR_CUBEMAP_FACE"}


def test_no_name_is_cut_where_the_editor_is_as_wide_as_at_first(told):
    assert len(told["drawn"]) > 30
    assert told["cut"] == {}


def test_no_name_of_sampling_is_cut_in_a_small_window(told):
    assert told["narrow"] == {}


def test_volume_objects_have_their_settings(told):
    assert {"space", "step_size", "clipping"} <= {name for name, _ in told["volume"]}


def test_light_settings_have_dots_for_keyframes(told):
    values = {name: dot for name, dot in told["light"] if name != "type"}
    assert values.keys() >= {"color", "energy", "shadow_soft_size", "use_shadow"} and all(
        values.values()
    ), values


def test_what_is_grey_says_why(told):
    why = told["why"]
    assert why["none"] == []
    assert "Classic illumination has none of these" in why["classic"]
    assert "Quality Target finds the first two" in why["target"]
    assert "Of the native tracer alone" in why["python"]
    assert "Rough Reflections need Bounces of Render" in why["bounces"]
    assert "Vector is empty with Motion Blur" in why["vector"]


def test_names_and_tooltips_say_what_to_choose(told):
    names = {"target": "Quality Target", "cutoff": "Ray Cutoff", "error_threshold": "Threshold"}
    assert {name: told["names"][name] for name in names} == names
    assert told["tracers"] == {"NATIVE": "Native", "NUMPY": "Python (reference)"}
    assert [
        text for text in told["descriptions"] if re.search(r"[Mm]easured|\d \d{3}|: 0\.\d", text)
    ] == []


def test_on_and_off_are_checkboxes(told):
    menus = {name for name, _ in told["menus of two"]}
    drawn = set(told["drawn names"])
    assert menus and not menus & drawn
    assert {f"use_{name}" for name in menus} <= drawn
    assert told["switched"] == [None, "OFF", None, "ON"]
    resets = told["checkboxes"]
    assert resets.keys() == {f"use_{name}" for name in menus}
    assert all(is_on == (choice == "ON") for is_on, choice in resets.values()), resets
