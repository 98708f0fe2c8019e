"""Settings: they survive a file, and they arrive in the engine."""

from blender_process import REGISTER_TREE, Blender
from glint.engine.settings import DECLARED, OFFERED


def _another(name: str) -> int | float | str:
    """A value of a setting that is neither the engine's default nor what is offered."""
    declared, offered = DECLARED[name], getattr(OFFERED, name)
    if declared.choices:
        names = [choice for choice, _, _ in declared.choices]
        return next(choice for choice in names if choice not in (declared.default, offered))
    return declared.default + (1 if declared.is_whole() else 0.25)


VALUES = {name: _another(name) for name, declared in DECLARED.items() if declared.label}


def test_settings_and_switches_survive_saving_and_loading(tmp_path):
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + f"""
scene = bpy.context.scene
for name, value in {VALUES}.items():
    setattr(scene.glint.final, name, value)
scene.glint.viewport.samples = 2
bpy.context.view_layer.glint.use_pass_mirror = True
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "settings.blend"))
bpy.ops.wm.read_homefile(use_factory_startup=True)
fresh = bpy.context.scene.glint.final.samples
bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "settings.blend"))
scene = bpy.context.scene
answer({{
    "fresh": fresh,
    "final": {{name: getattr(scene.glint.final, name) for name in {list(VALUES)}}},
    "viewport": scene.glint.viewport.samples,
    "mirror": bpy.context.view_layer.glint.use_pass_mirror,
    "shadow": bpy.context.view_layer.glint.use_pass_shadow,
}})
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer == {
        "fresh": 8,
        "final": VALUES,
        "viewport": 2,
        "mirror": True,
        "shadow": False,
    }


def test_many_samples_are_drawn_or_refused(tmp_path):
    """None is cut in silence."""
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
from glint.addon.ui.properties import settings_from
told, final = [], bpy.context.scene.glint.final
for samples in (100_000, 10**9):
    final.samples = samples
    settings = settings_from(final, bpy.context.scene)
    told.append([settings.samples, settings.problems()])
final.samples, final.light_samples = 1, 5000
settings = settings_from(final, bpy.context.scene)
answer([*told, [settings.light_samples, settings.problems()]])
"""
    )
    (many, fine), (most, problems), lights = run.answer
    assert (many, fine) == (100_000, []) and lights == [5000, []]
    assert len(problems) == 1 and problems[0].startswith(
        f"samples × light_samples is {2 * most}: use at most"
    )


def test_settings_arrive_in_the_engine(tmp_path):
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + f"""
import dataclasses
from glint.addon.ui.properties import settings_from
scene = bpy.context.scene
for name, value in {VALUES}.items():
    setattr(scene.glint.final, name, value)
scene.render.filter_size = 2.5
settings = settings_from(scene.glint.final, scene, {{"Combined", "Depth"}}, (1, 2, 3, 4))
given = {{**dataclasses.asdict(settings), "passes": sorted(settings.passes)}}
scene.glint.final.threads = 0
scene.render.threads_mode, scene.render.threads = "FIXED", 3
fixed = settings_from(scene.glint.final, scene).threads
scene.render.threads_mode = "AUTO"
answer({{"given": given, "fixed": fixed, "auto": settings_from(scene.glint.final, scene).threads, "problems": settings.problems()}})
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    expected = {**VALUES, "filter_width": 2.5, "crypto_ids": 6}
    expected |= {"passes": ["Depth"], "region": [1, 2, 3, 4]}
    assert run.answer == {"given": expected, "fixed": 3, "auto": 0, "problems": []}


def test_the_defaults_are_the_engines(tmp_path):
    """One home for defaults: what Blender offers untouched is `engine.settings.OFFERED`, in the
    single precision of its properties.
    """
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
from glint import engine
from glint.addon.ui.properties import settings_from
scene = bpy.context.scene
import numpy
single = lambda settings: {
    name: float(numpy.float32(value)) if isinstance(value, float) else value
    for name, value in vars(settings).items()
}
groups = scene.glint.final, scene.glint.viewport
answer([single(settings_from(group, scene)) == single(engine.settings.OFFERED) for group in groups])
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer == [True, True]


def test_unregistering_leaves_nothing_behind(tmp_path):
    run = Blender(tmp_path).run(
        "before = {name for name in dir(bpy.types)}\n"
        + REGISTER_TREE
        + """
def joined():
    blenders = [panel for panel in bpy.types.Panel.__subclasses__() if not panel.__name__.startswith("GLINT_")]
    return sum("GLINT" in getattr(panel, "COMPAT_ENGINES", ()) for panel in blenders)
during = joined()
glint.unregister()
glint.register()
again = joined()
glint.unregister()
left = [name for name in dir(bpy.types) if "glint" in name.lower() and name not in before]
answer({"left": left, "joined": during == again > 20, "after": joined(), "scene": hasattr(bpy.types.Scene, "glint")})
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    assert run.answer == {"left": [], "joined": True, "after": 0, "scene": False}
