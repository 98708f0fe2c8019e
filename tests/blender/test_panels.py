"""What the user sees: which panels a tab has, in which order, what they offer, and that those
without effect say so.
"""

import re

import pytest

from blender_process import REGISTER_TREE, Blender

PROGRAM = (
    REGISTER_TREE
    + """
from types import SimpleNamespace

from glint.addon.ui import panels

class Layout:
    \"\"\"Writes down what is drawn.\"\"\"
    use_property_decorate = True
    def __init__(self):
        self.drawn = []
    def prop(self, owner, name, **options):
        getattr(owner, name)
        self.drawn.append([name, self.use_property_decorate])
    def template_node_view(self, tree, node, socket):
        self.drawn.append([socket.name, False])
    def label(self, text="", **options):
        self.drawn.append([text, False])
    def separator(self):
        pass
    def column(self, **options):
        return self
    row = column

def offered(panel, context):
    mixins = tuple(base for base in panel.__bases__ if base is not bpy.types.Panel)
    drawer = type("Drawer", mixins, {key: value for key, value in vars(panel).items() if not key.startswith("__")})()
    drawer.layout = Layout()
    drawer.draw(context)
    return drawer.layout.drawn

def roots(tab):
    ours = [panel for panel in panels._CLASSES if getattr(panel, "bl_context", "") == tab]
    blenders = [panel for panel in panels._blender_panels() if getattr(panel, "bl_context", "") == tab]
    # as registered
    found = [panel for panel in (*blenders, *ours) if not getattr(panel, "bl_parent_id", "")]
    return [panel.bl_label for panel in sorted(found, key=lambda panel: getattr(panel, "bl_order", 0))]

def all_of(tab):
    # children too
    every = (*panels._blender_panels(), *panels._CLASSES)
    return sorted({panel.bl_label for panel in every if getattr(panel, "bl_context", "") == tab})

scene = bpy.context.scene
scene.render.engine = "GLINT"
light = bpy.data.lights["Light"]
light.use_nodes = True
context = SimpleNamespace(scene=scene, engine="GLINT", view_layer=bpy.context.view_layer, light=light,
                          material=bpy.data.materials["Material"], world=scene.world,
                          object=bpy.data.objects["Cube"])
lines = {}
for name in panels._WITHOUT_EFFECT:
    panel = getattr(bpy.types, name, None)
    if panel is None:  # before 5.0 light linking is a panel of Cycles' own
        continue
    first = panel.draw._draw_funcs[0]
    told = {}
    for engine in ("GLINT", "CYCLES"):
        asker = SimpleNamespace(layout=Layout())
        first(asker, SimpleNamespace(engine=engine))
        told[engine] = asker.layout.drawn
    lines[name] = told
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
    "none": [text for panel in (panels.GLINT_RENDER_PT_sampling, panels.GLINT_RENDER_PT_sampling_final,
                                panels.GLINT_RENDER_PT_performance, panels.GLINT_VIEWLAYER_PT_passes)
             for text, _ in offered(panel, context) if " " in text],
    "classic": reasons(panels.GLINT_RENDER_PT_sampling, lambda: setattr(final, "illumination", "CLASSIC"),
                       lambda: setattr(final, "illumination", "PHYSICAL")),
    "target": reasons(panels.GLINT_RENDER_PT_sampling_final, lambda: setattr(scene.glint, "target", "RMSE"),
                      lambda: setattr(scene.glint, "target", "NONE")),
    "python": reasons(panels.GLINT_RENDER_PT_performance, lambda: setattr(final, "backend", "NUMPY"),
                      lambda: setattr(final, "backend", "NATIVE")),
    "vector": reasons(panels.GLINT_VIEWLAYER_PT_passes, lambda: vector(True), lambda: vector(False)),
}
answer({
    "why": why,
    "render": roots("render"),
    "view layer": roots("view_layer"),
    "override": offered(panels.GLINT_VIEWLAYER_PT_override, context),
    "simplify": offered(panels.GLINT_RENDER_PT_simplify_render, context),
    "light": offered(panels.GLINT_LIGHT_PT_light, context),
    "material": offered(panels.GLINT_MATERIAL_PT_settings,
                        SimpleNamespace(material=bpy.data.materials["Material"])),
    "lighting": offered(panels.GLINT_VIEW3D_PT_shading_lighting, SimpleNamespace(space_data=SimpleNamespace(shading=SimpleNamespace(
        use_scene_lights_render=True, use_scene_world_render=True)))),
    "pass": offered(panels.GLINT_VIEW3D_PT_shading_render_pass, context),
    "tabs": {tab: all_of(tab) for tab in ("data", "material", "world")},
    "light nodes": offered(panels.GLINT_LIGHT_PT_nodes, context),
    "world rays": offered(panels.GLINT_WORLD_PT_ray_visibility, context),
    "lines": lines,
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


def test_panels_stand_in_the_order_of_cycles(told):
    own = ["Sampling", "Simplify", "Motion Blur", "Film", "Performance", "Statistics"]
    assert told["render"] == [*own, "Grease Pencil", "Freestyle", "Color Management"]
    assert [
        label
        for label in told["view layer"]
        if label in ("View Layer", "Passes", "Filter", "Override")
    ] == [
        "View Layer",
        "Passes",
        "Filter",
        "Override",
    ]


def test_what_works_is_offered(told):
    assert ["material_override", False] in told["override"]
    assert told["simplify"] == [
        ["simplify_subdivision_render", False],
        ["simplify_child_particles_render", False],
    ]
    assert told["material"] == [
        ["pass_index", True],
        ["displacement_method", True],
        ["use_transparent_shadow", True],
    ]
    assert told["lighting"] == [["use_scene_lights_render", True], ["use_scene_world_render", True]]
    assert [name for name, _ in told["pass"]] == ["viewport_pass"]


def test_what_is_read_can_be_set(told):
    """The lens, a light's nodes, volumes, bumps, mist, indices and what sees the world."""
    assert {"Depth of Field", "Aperture", "Nodes"} <= set(told["tabs"]["data"])
    material = {"Surface", "Volume", "Volume Steps", "Displacement", "Settings"}
    assert material <= set(told["tabs"]["material"])
    world = {"Surface", "Volume", "Volume Steps", "Mist Pass", "Ray Visibility"}
    assert world <= set(told["tabs"]["world"])
    assert told["light nodes"] == [["Surface", False]]
    assert [name for name, _ in told["world rays"]] == [
        "camera",
        "diffuse",
        "glossy",
        "transmission",
    ]


def test_light_settings_have_dots_for_keyframes(told):
    values = {name: dot for name, dot in told["light"] if name != "type"}
    assert values.keys() >= {"color", "energy", "shadow_soft_size", "use_shadow"} and all(
        values.values()
    ), values


def test_panels_without_effect_say_so_with_glint_only(told):
    for name, drawn in told["lines"].items():
        assert drawn["GLINT"][0][0].startswith("No effect in Glint"), name
        assert drawn["CYCLES"] == [], name


def test_what_is_grey_says_why(told):
    why = told["why"]
    assert why["none"] == []
    assert "Classic illumination has none of these" in why["classic"]
    assert "Quality Target finds the first three" in why["target"]
    assert "Of the native tracer alone" in why["python"]
    assert "Vector is empty with Motion Blur" in why["vector"]


def test_names_and_tooltips_say_what_to_choose(told):
    names = {"target": "Quality Target", "cutoff": "Ray Cutoff", "error_threshold": "Threshold"}
    assert {name: told["names"][name] for name in names} == names
    assert told["tracers"] == {"NATIVE": "Native", "NUMPY": "Python (reference)"}
    assert [
        text for text in told["descriptions"] if re.search(r"[Mm]easured|\d \d{3}|: 0\.\d", text)
    ] == []
