"""Switch to Glint: the scene's settings of Cycles or Eevee become Glint's, what will look different
is listed with links to the objects, and the way back leaves everything as it was.

Of the scene only `render.engine` and `scene.glint` are written, so the other engine's settings are
untouched whatever happens. Blender reads the annotations as they are, so this module must not make
them strings.
"""

import json
import logging
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import bpy
from bpy.props import CollectionProperty, EnumProperty, IntProperty, PointerProperty, StringProperty

from ..addon.export.approximations import approximated_nodes
from ..addon.render.result import unrendered_outputs
from ..addon.ui.lines import draw_text
from ..addon.ui.panel import EnginePanel
from .after_previews import AfterPreviews
from .carried_settings import NAMES, carried, without_counterpart
from .scene_copy import read_job

log = logging.getLogger(__name__)

_KINDS = (
    ("DIFFERENT", "Looks Different", "Drawn otherwise than in the engine before"),
    ("UNLIKE", "Settings Without a Counterpart", "Settings of the engine before"),
    ("NEARLY", "Nearly the Same", "Drawn otherwise in details"),
    ("CARRIED", "Taken Over", "A setting that follows from one of the engine before"),
    ("KEPT", "Kept", "A setting that was chosen in Glint"),
)
_ICONS = {
    "DIFFERENT": "ERROR",
    "UNLIKE": "INFO",
    "NEARLY": "INFO",
    "CARRIED": "CHECKMARK",
    "KEPT": "LOCKED",
}
_WHEN = "As of switching, or of List Again: edits since are not in it"
_BUTTON = 28
"""Pixels of the button beside a line, on a screen of scale 1."""


class GlintSwitchRow(bpy.types.PropertyGroup):
    """A line of the report. names: of the things that it is about, as JSON."""

    kind: EnumProperty(items=_KINDS)
    text: StringProperty()
    names: StringProperty(default="[]")


class GlintSwitch(bpy.types.PropertyGroup):
    """`scene.glint_switch`. engine: where the scene came from, "" where it did not.  carried: what
    was written into Glint's settings, as JSON.
    """

    engine: StringProperty()
    carried: StringProperty(default="{}")
    rows: CollectionProperty(type=GlintSwitchRow)


def switch_to_glint(scene: bpy.types.Scene, view_layer: str) -> None:
    """Carry the settings over, choose Glint and fill `scene.glint_switch.rows`. The scene's engine
    is one of `NAMES`.
    """
    state, engine = scene.glint_switch, scene.render.engine
    state.rows.clear()
    unlike = without_counterpart(scene)
    settings = _carry(scene, NAMES[engine])
    scene.render.engine, state.engine = "GLINT", engine
    for text in unlike:
        _add(state, "UNLIKE", text)
    for kind, text in settings:
        _add(state, kind, text)
    list_differences(scene, view_layer)


def list_differences(scene: bpy.types.Scene, view_layer: str) -> None:
    """Make the rows that are about the scene's things anew, which edits change; those about the
    settings of the engine that it came from stay as they are.
    """
    state = scene.glint_switch
    for number in reversed(range(len(state.rows))):
        if state.rows[number].kind in ("DIFFERENT", "NEARLY"):
            state.rows.remove(number)
    for text, names in _differences(scene, view_layer, state.engine):
        _add(state, "DIFFERENT", text, names)
    for text, names in _nearly(scene):
        _add(state, "NEARLY", text, names)


def switch_back(scene: bpy.types.Scene) -> None:
    """Choose the engine that the scene came from."""
    state = scene.glint_switch
    scene.render.engine, state.engine = state.engine, ""
    state.rows.clear()


def _add(state: GlintSwitch, kind: str, text: str, names: Iterable[str] = ()) -> None:
    row = state.rows.add()
    row.kind, row.text, row.names = kind, text, json.dumps(list(names))


def _carry(scene: bpy.types.Scene, engine: str) -> list[tuple[str, str]]:
    """Write what follows from the engine's settings, but no setting that somebody chose; gives a
    kind and a line for each.
    """
    before = json.loads(scene.glint_switch.carried)
    written, lines = dict(before), []
    for item in carried(scene):
        group = getattr(scene.glint, item.group)
        present = getattr(group, item.name)
        if group.is_property_set(item.name) and present != before.get(item.key):
            lines.append(("KEPT", f"{item.label} {_shown(present)}, as set in Glint"))
            continue
        setattr(group, item.name, item.value)
        written[item.key] = getattr(group, item.name)
        lines.append(("CARRIED", f"{item.label} {_shown(item.value)} ({engine}: {item.source})"))
    scene.glint_switch.carried = json.dumps(written)
    return lines


def _shown(value: float | str) -> str:
    """A choice as On or Off, a number with four digits."""
    return value.title() if isinstance(value, str) else f"{value:.4g}"


def _differences(
    scene: bpy.types.Scene, view_layer: str, engine: str
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Sentences and the names that they are about: the notes that a render would give, and what
    such materials mean that need none.
    """
    try:
        job = read_job(scene, view_layer)
    except RuntimeError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        yield f"What will look different is not known, as the scene cannot be read: {reason}", ()
        return
    unrendered = unrendered_outputs(scene, scene.view_layers[view_layer])
    for note in dict.fromkeys((*job.notes, *unrendered)):
        yield str(note), getattr(note, "names", ())
    for sentence, is_meant in _MEANINGS:
        names = tuple(material.name for material in job.scene.materials if is_meant(material))
        if names:
            yield sentence, names
    if engine != "CYCLES":
        yield from _unlike_eevees_objects(scene)


def _unlike_eevees_objects(scene: bpy.types.Scene) -> Iterator[tuple[str, tuple[str, ...]]]:
    hidden = tuple(thing.name for thing in scene.objects if not thing.visible_glossy)
    if hidden:
        yield "Mirrors do not show objects whose Ray Visibility says so, as in Cycles", hidden
    probes = tuple(thing.name for thing in scene.objects if thing.type == "LIGHT_PROBE")
    if probes:
        yield "Light probes have no effect: reflections and bounced light are traced", probes


def _is_glass(material: Any) -> bool:
    return any(lobe.kind == "REFRACTION" for lobe in material.lobes)


def _scatters(material: Any) -> bool:
    return material.medium is not None and material.medium.scatters


_MEANINGS: tuple[tuple[str, Callable[[Any], bool]], ...] = (
    (
        "Glass throws no caustics: panes let light pass, balls cast shadows; put a light where one "
        "is missed",
        _is_glass,
    ),
    ("Light is scattered once in volumes: raise the density of thick ones", _scatters),
)
"""What is missed without a note, and of which materials."""


def _nearly(scene: bpy.types.Scene) -> list[tuple[str, list[str]]]:
    """Of the nodes that the scene's objects show."""
    found: dict[str, list[str]] = {}
    for block in _blocks(scene):
        for label, how in approximated_nodes(block).items():
            found.setdefault(f"{label}: {how}", []).append(block.name)
    return list(found.items())


def _blocks(scene: bpy.types.Scene) -> list[Any]:
    """The world, lights and materials of a scene, once each."""
    blocks = {scene.world: None}
    for thing in scene.objects:
        blocks.update((slot.material, None) for slot in thing.material_slots)
        if thing.type == "LIGHT":
            blocks[thing.data] = None
    blocks.pop(None, None)
    return list(blocks)


def objects_of(scene: bpy.types.Scene, names: Iterable[str]) -> list[bpy.types.Object]:
    """The scene's objects of these names, and those whose data or materials have them."""
    wanted = set(names)
    return [
        thing
        for thing in scene.objects
        if thing.name in wanted
        or (thing.data is not None and thing.data.name in wanted)
        or any(slot.material and slot.material.name in wanted for slot in thing.material_slots)
    ]


class GLINT_OT_switch_to_glint(AfterPreviews, bpy.types.Operator):
    """Render this scene with Glint: take over the settings of the present engine, and list what
    will look different. Materials and the engine's own settings stay as they are
    """

    bl_idname = "glint.switch_to_glint"
    bl_label = "Switch to Glint"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and context.scene.render.engine in NAMES

    def execute(self, context: bpy.types.Context) -> set[str]:
        switch_to_glint(context.scene, context.view_layer.name)
        rows = context.scene.glint_switch.rows
        different = sum(row.kind in ("DIFFERENT", "UNLIKE") for row in rows)
        self.report({"INFO"}, f"{different} things to know: Render properties → What Changes")
        return {"FINISHED"}


class _Switched(AfterPreviews):
    """Of a scene that came from another engine."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and context.scene.glint_switch.engine != ""


class GLINT_OT_switch_back(_Switched, bpy.types.Operator):
    """Render this scene with the engine that it came from, whose settings are as they were"""

    bl_idname = "glint.switch_back"
    bl_label = "Switch Back"

    def execute(self, context: bpy.types.Context) -> set[str]:
        wanted = context.scene.glint_switch.engine
        try:
            switch_back(context.scene)
        except TypeError:
            self.report({"ERROR"}, f"This Blender has no engine {wanted}: enable its add-on")
            return {"CANCELLED"}
        return {"FINISHED"}


class GLINT_OT_list_changed(_Switched, bpy.types.Operator):
    """Make the list for the scene as it is now: what edits made look different since is added, what
    they mended is left out
    """

    bl_idname = "glint.list_changed"
    bl_label = "List Again"

    def execute(self, context: bpy.types.Context) -> set[str]:
        list_differences(context.scene, context.view_layer.name)
        return {"FINISHED"}


class GLINT_OT_select_changed(bpy.types.Operator):
    """Select the objects that this line is about"""

    bl_idname = "glint.select_changed"
    bl_label = "Select"
    bl_options = {"REGISTER", "UNDO"}

    row: IntProperty(name="Row", description="Line of the report", min=0, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and context.mode == "OBJECT"

    def execute(self, context: bpy.types.Context) -> set[str]:
        rows = context.scene.glint_switch.rows
        if self.row >= len(rows):
            self.report({"ERROR"}, f"There are {len(rows)} lines")
            return {"CANCELLED"}
        layer = context.view_layer
        found = objects_of(context.scene, json.loads(rows[self.row].names))
        shown = [thing for thing in found if thing.visible_get(view_layer=layer)]
        if not shown:
            self.report({"WARNING"}, "None of the objects is visible in this view layer")
            return {"CANCELLED"}
        for thing in context.selected_objects:
            thing.select_set(False)
        for thing in shown:
            thing.select_set(True)
        layer.objects.active = shown[0]
        return {"FINISHED"}


class GLINT_RENDER_PT_switched(EnginePanel, bpy.types.Panel):
    bl_label = "What Changes"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.scene.glint_switch.engine != ""

    def draw(self, context):
        column, state = self.layout.column(), context.scene.glint_switch
        column.operator("glint.compare_cycles", icon="IMAGE_REFERENCE")
        column.operator(GLINT_OT_list_changed.bl_idname, icon="FILE_REFRESH")
        draw_text(column, [_WHEN], context.region)
        for kind, title, _ in _KINDS:
            rows = [(k, row) for k, row in enumerate(state.rows) if row.kind == kind]
            if rows:
                column.label(text=title, icon=_ICONS[kind])
            for number, row in rows:
                _draw_row(column, row, number, context)


def _draw_row(
    column: bpy.types.UILayout, row: GlintSwitchRow, number: int, context: bpy.types.Context
) -> None:
    line = column.row()
    has_objects = bool(objects_of(context.scene, json.loads(row.names)))
    beside = _BUTTON if has_objects else 0
    draw_text(line.column(align=True), [row.text], context.region, "• ", beside)
    if has_objects:
        select = line.operator(
            GLINT_OT_select_changed.bl_idname, text="", icon="RESTRICT_SELECT_OFF", emboss=False
        )
        select.row = number


def _draw_switch(self: bpy.types.Panel, context: bpy.types.Context) -> None:
    """Below the choice of the engine."""
    scene = context.scene
    if scene.render.engine in NAMES:
        self.layout.operator(GLINT_OT_switch_to_glint.bl_idname, icon="FORWARD")
    elif scene.render.engine == "GLINT" and scene.glint_switch.engine:
        back = f"Back to {NAMES[scene.glint_switch.engine]}"
        self.layout.operator(GLINT_OT_switch_back.bl_idname, text=back, icon="LOOP_BACK")


_CLASSES = (
    GlintSwitchRow,
    GlintSwitch,
    GLINT_OT_switch_to_glint,
    GLINT_OT_switch_back,
    GLINT_OT_list_changed,
    GLINT_OT_select_changed,
    GLINT_RENDER_PT_switched,
)


_register, _unregister = bpy.utils.register_classes_factory(_CLASSES)


def register() -> None:
    _register()
    bpy.types.Scene.glint_switch = PointerProperty(name="Glint Switch", type=GlintSwitch)
    bpy.types.RENDER_PT_context.append(_draw_switch)


def unregister() -> None:
    bpy.types.RENDER_PT_context.remove(_draw_switch)
    del bpy.types.Scene.glint_switch
    _unregister()
