"""A session of the viewport without a window: real spaces and depsgraphs, a region and matrices
made up, pictures not uploaded.
"""

import time
from dataclasses import replace
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from export_support import Shader, link, quad, scene  # noqa: F401
from glint import engine
from glint.addon.export import collector as walked
from glint.addon.render import statistics
from glint.addon.ui import properties
from glint.addon.viewport import draw, redraws, session, status
from glint.addon.viewport.surroundings import Surroundings
from glint.engine.scene import Light, World

SIZE = (64, 48)
LONGEST = 60.0


@pytest.fixture
def settings():
    properties.register()
    yield
    properties.unregister()


@pytest.fixture
def view(scene, settings, monkeypatch):  # noqa: F811
    """Two quads, a sun and a point light; what Blender hands to a render engine for a 3D view that
    looks at them.
    """
    monkeypatch.setattr(session, "Picture", lambda *_: SimpleNamespace(draw=lambda *_: None))
    for x in (-1.5, 0.5):
        quad(f"Quad {x}").location = (x, 0, 0)
    for kind in ("POINT", "SUN"):
        lamp = link(bpy.data.objects.new(kind, bpy.data.lights.new(kind, kind)))
        lamp.location, lamp.data.energy = (0, 0, 3), 30
    scene.glint.viewport.samples = 2
    camera = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    camera.location = (0.5, 0.5, 6)
    link(camera)
    bpy.context.view_layer.update()
    space = next(
        area.spaces[0]
        for screen in bpy.data.screens
        for area in screen.areas
        if area.type == "VIEW_3D"
    )
    space.shading.use_scene_lights_render = space.shading.use_scene_world_render = True
    projection = camera.calc_matrix_camera(
        bpy.context.evaluated_depsgraph_get(), x=SIZE[0], y=SIZE[1]
    )
    region = SimpleNamespace(width=SIZE[0], height=SIZE[1], as_pointer=lambda: 1)
    matrices = {"window_matrix": projection, "view_matrix": camera.matrix_world.inverted()}
    looks = SimpleNamespace(
        view_perspective="PERSP", use_clip_planes=False, use_box_clip=False, **matrices
    )
    return SimpleNamespace(space_data=space, region=region, region_data=looks)


class Watcher:
    """A session, updated and drawn as Blender would."""

    def __init__(self, view) -> None:
        self.view, self.session, self.told = view, session.Session(), []
        self.engine = SimpleNamespace(update_stats=lambda _, text: self.told.append(text))
        self.edit(lambda: None, updates=True)

    def edit(self, change, updates=True):
        """Waits for the last picture after a change. updates: whether Blender tells the engine of
        it.
        """
        change()
        heard = []
        if updates:
            handler = lambda _, depsgraph: heard.append(self.session.update(self.view, depsgraph))  # noqa: E731
            bpy.app.handlers.depsgraph_update_post.append(handler)
            bpy.context.view_layer.update()
            bpy.app.handlers.depsgraph_update_post.remove(handler)
            if not heard:
                self.session.update(self.view, bpy.context.evaluated_depsgraph_get())
        deadline = time.monotonic() + LONGEST
        self.draw()
        while self.session.busy or self.session.has_news:
            assert time.monotonic() < deadline, "no picture came"
            time.sleep(0.005)
            self.draw()
        return self.session.live.newest.film

    def draw(self):
        self.session.draw(self.engine, self.view, bpy.context.evaluated_depsgraph_get())

    def expected(self):
        shown, settings, _ = self.session.shown_scene
        return engine.render(shown, settings)


@pytest.fixture
def watcher(view):
    made = Watcher(view)
    yield made
    made.session.close()


def same(film, truth):
    return all(film.passes[name].tobytes() == truth.passes[name].tobytes() for name in truth.passes)


def test_edits_end_in_the_bits_of_a_render(watcher):
    sun, point, quads = (
        bpy.data.lights["SUN"],
        bpy.data.objects["POINT"],
        [o for o in bpy.data.objects if o.type == "MESH"],
    )
    edits = [
        lambda: setattr(sun, "energy", 2.0),
        lambda: setattr(point, "location", (1, 1, 2)),
        lambda: setattr(quads[0], "location", (-1.2, 0.1, 0.3)),
        lambda: setattr(quads[1], "hide_viewport", True),
        lambda: setattr(quads[1], "hide_viewport", False),
        lambda: setattr(quads[0], "scale", (1, 0, 0)),
        lambda: setattr(quads[0], "scale", (1, 2, 1)),
    ]
    for edit in edits:
        film = watcher.edit(edit)
        assert same(film, watcher.expected())
    assert watcher.told[-1].startswith("Glint: 2 samples, ") and "error" not in watcher.told[-1], (
        "two samples tell no error"
    )


def test_warnings_are_counted_in_the_status_line_and_kept_for_the_panel(watcher):
    told = statistics.of_views(bpy.context.scene.name)
    assert told == () and "warning" not in watcher.told[-1]
    odd = Shader("Odd")
    odd.link(odd.node("ShaderNodeSqueeze"), "Value", odd.shader, "Color")
    watcher.edit(lambda: None)
    [note] = statistics.of_views(bpy.context.scene.name)
    assert "'Odd'" in note and watcher.told[-1].endswith(
        ", 1 warning: Render Properties, Statistics"
    )
    watcher.edit(odd.quad.data.materials.clear)
    assert statistics.of_views(bpy.context.scene.name) == () and "warning" not in watcher.told[-1]


def test_a_view_says_that_the_slow_tracer_draws_it(watcher, monkeypatch):
    assert "Python" not in watcher.told[-1]
    final = bpy.context.scene.glint.final
    final.backend = "NUMPY"
    watcher.edit(lambda: None)
    assert watcher.told[-1].endswith("s, Python tracer")
    final.backend = "NATIVE"
    monkeypatch.setattr(engine, "available_backends", lambda: ("NUMPY",))
    monkeypatch.setattr(engine, "native_error", lambda: "no library")
    watcher.edit(lambda: None)
    assert watcher.told[-1].endswith("Python tracer, 1 warning: Render Properties, Statistics")
    [note] = statistics.of_views(bpy.context.scene.name)
    assert "(no library)" in note


def test_a_view_without_light_says_so(watcher):
    shown, shading = bpy.context.scene, watcher.view.space_data.shading
    shown.world = None
    watcher.edit(lambda: setattr(shading, "use_scene_lights_render", False))
    [note] = statistics.of_views(shown.name)
    assert "no light" in note and "1 warning" in watcher.told[-1]
    watcher.edit(lambda: setattr(shading, "use_scene_lights_render", True))
    assert statistics.of_views(shown.name) == ()


def test_what_a_camera_does_not_do_is_told_where_a_view_looks_through_it(watcher):
    eye = bpy.data.objects["Eye"]
    bpy.context.scene.camera, eye.data.dof.use_dof = eye, True
    eye.data.dof.focus_distance = 0
    watcher.edit(lambda: None)
    assert statistics.of_views(bpy.context.scene.name) == ()
    watcher.view.region_data.view_perspective = "CAMERA"
    watcher.edit(lambda: setattr(eye.data, "lens", 40.0))
    assert any(
        "focused on its own place" in note for note in statistics.of_views(bpy.context.scene.name)
    )


def test_a_view_through_the_camera_has_its_depth_of_field(watcher):
    dof, thing = bpy.data.cameras["Eye"].dof, link(bpy.data.objects.new("Focus", None))
    dof.aperture_fstop, dof.focus_distance = 0.05, 3.0
    bpy.context.scene.camera = bpy.data.objects["Eye"]
    watcher.view.region_data.view_perspective = "CAMERA"
    watcher.edit(lambda: None)
    assert watcher.session.shown_scene[0].camera.lens is None
    edits = [
        lambda: setattr(dof, "use_dof", True),
        lambda: setattr(dof, "focus_distance", 2.0),
        lambda: setattr(dof, "focus_object", thing),
        lambda: setattr(thing, "location", (0.0, 0.0, 2.5)),
    ]
    for edit, focus in zip(edits, (3.0, 2.0, 6.0, 3.5), strict=True):
        film = watcher.edit(edit)
        assert watcher.session.shown_scene[0].camera.lens.focus == pytest.approx(focus)
        pictures = (f.passes["Combined"] for f in (film, watcher.expected()))
        np.testing.assert_allclose(*pictures, rtol=1e-5)
    watcher.view.region_data.view_perspective = "PERSP"
    watcher.edit(lambda: None, updates=False)
    assert watcher.session.shown_scene[0].camera.lens is None


def test_a_view_through_a_panoramic_camera_shows_its_picture_in_the_frame(watcher):
    """The picture's edges are where Blender draws the frame's: here it fills the view."""
    eye, scene = bpy.data.objects["Eye"], bpy.context.scene  # noqa: F811
    scene.camera, eye.data.type = eye, "PANO"
    here = eye.data if hasattr(eye.data, "panorama_type") else eye.data.cycles
    here.panorama_type = "FISHEYE_EQUIDISTANT"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    watcher.view.region_data.view_perspective = "CAMERA"
    film = watcher.edit(lambda: None)
    camera = watcher.session.shown_scene[0].camera
    assert camera.kind == "PANORAMA" and camera.panorama.projection == "FISHEYE_EQUIDISTANT"
    np.testing.assert_allclose(camera.window, (0, 1, 0, 1), atol=1e-6)
    assert watcher.session.shown_scene[2].frame is not None
    assert film.passes["Combined"][0, 0].tolist() == [0, 0, 0, 1]  # beyond its circle
    assert film.passes["Combined"][24, 32, :3].any()
    # half as much of the frame in the view, on the right of it
    projection = np.array(watcher.view.region_data.window_matrix)
    projection[0] = 2 * projection[0] - projection[3]
    watcher.view.region_data.window_matrix = projection
    watcher.edit(lambda: None, updates=False)
    window = watcher.session.shown_scene[0].camera.window
    assert window[1] - window[0] == pytest.approx(0.5) and window[2:] == camera.window[2:]
    here.panorama_type = "MIRRORBALL"
    watcher.edit(lambda: None)
    assert watcher.session.shown_scene[0].camera.panorama.projection == "MIRROR_BALL"


def test_the_status_line_tells_errors_in_levels(watcher):
    bpy.context.scene.glint.viewport.samples = 4
    watcher.edit(lambda: None, updates=False)
    assert ", error " in watcher.told[-1] and "e+" not in watcher.told[-1]
    assert [status.error_clause(error) for error in (None, 8e-7, 0.123, 99.0, 256.0)] == [
        "", ", error under 0.01/255", ", error 0.12/255", ", error 99/255", ", error 256/255"
    ]  # fmt: skip


def test_only_what_can_be_seen_asks_for_another_picture(watcher):
    quads, scene = [o for o in bpy.data.objects if o.type == "MESH"], bpy.context.scene  # noqa: F811
    unseen = [
        lambda: quads[0].select_set(not quads[0].select_get()),
        lambda: setattr(scene.view_settings, "exposure", 1.5),
        lambda: setattr(scene.cursor, "location", (1, 2, 3)),
        lambda: link(bpy.data.objects.new("Empty", None)),
    ]
    seen = [
        lambda: setattr(quads[0], "pass_index", 3),
        lambda: setattr(quads[1], "visible_shadow", False),
        lambda: setattr(bpy.data.lights["SUN"], "use_shadow", False),
        lambda: setattr(bpy.data.lights["SUN"], "angle", 0.3),
        lambda: setattr(scene.render, "film_transparent", True),
        lambda: quads[0].data.materials.append(bpy.data.materials.new("New")),
        lambda: quads[0].data.transform(np.diag((2, 1, 1, 1))),
        lambda: setattr(scene.glint.viewport, "light_samples", 3),
    ]
    for edits, expected in ((unseen, False), (seen, True)):
        for number, edit in enumerate(edits):
            before = watcher.session.requests
            watcher.edit(edit)
            assert (watcher.session.requests > before) == expected, f"edit {number}"
            assert same(watcher.session.live.newest.film, watcher.expected())


def test_a_selection_asks_for_nothing_where_materials_read_objects(watcher):
    shader = Shader("Personal")
    shader.link(shader.node("ShaderNodeObjectInfo"), "Color", shader.shader, "Color")
    watcher.edit(lambda: None)
    assert any(group.values for group in watcher.session.content.instances)
    before = watcher.session.requests
    watcher.edit(lambda: shader.quad.select_set(not shader.quad.select_get()))
    assert watcher.session.requests == before
    watcher.edit(lambda: setattr(shader.quad, "color", (1, 0, 0, 1)))
    assert watcher.session.requests > before
    assert same(watcher.session.live.newest.film, watcher.expected())


@pytest.mark.skipif("NATIVE" not in engine.available_backends(), reason="no core here")
def test_a_brighter_lamp_traces_nothing(watcher):
    bpy.context.scene.glint.viewport.samples = 1
    # what is dealt over pixels is not remembered
    bpy.context.scene.glint.final.soft_light = "SHARED"
    watcher.edit(lambda: None, updates=False)
    film = watcher.edit(lambda: setattr(bpy.data.lights["POINT"], "energy", 99))
    assert film.stats["camera rays"] == film.stats["shadow rays"] == 0
    assert same(film, watcher.expected())


def test_the_shading_popover(watcher):
    shading = watcher.view.space_data.shading
    watcher.edit(lambda: setattr(shading, "use_scene_lights_render", False), updates=False)
    assert {light.kind for light in watcher.session.shown_scene[0].lights} <= {"DOME"}
    watcher.edit(lambda: setattr(shading, "use_scene_world_render", False), updates=False)
    ambient = np.array(watcher.session.shown_scene[0].world.ambient)
    assert (ambient > 0).all()
    watcher.edit(
        lambda: setattr(shading, "studiolight_intensity", 2 * shading.studiolight_intensity),
        updates=False,
    )
    np.testing.assert_allclose(watcher.session.shown_scene[0].world.ambient, 2 * ambient)
    watcher.edit(
        lambda: (
            setattr(shading, "use_scene_lights_render", True),
            setattr(shading, "use_scene_world_render", True),
        ),
        updates=False,
    )
    assert len(watcher.session.shown_scene[0].lights) == 2


def test_kinds_of_objects_that_the_view_leaves_out(watcher):
    space = watcher.view.space_data
    watcher.edit(lambda: setattr(space, "show_object_viewport_mesh", False), updates=False)
    assert watcher.session.shown_scene[0].instances == ()
    watcher.edit(lambda: setattr(bpy.data.objects["SUN"], "location", (1, 0, 0)))
    assert watcher.session.shown_scene[0].instances == (), "a move brings nothing back"
    watcher.edit(lambda: setattr(space, "show_object_viewport_mesh", True), updates=False)
    assert len(watcher.session.shown_scene[0].instances) == 2


def test_the_border_of_the_view(watcher):
    space = watcher.view.space_data
    (
        space.render_border_min_x,
        space.render_border_max_x,
        space.render_border_min_y,
        space.render_border_max_y,
    ) = 0.25, 0.75, 0.5, 1.0
    film = watcher.edit(lambda: setattr(space, "use_render_border", True), updates=False)
    shown, settings, view = watcher.session.shown_scene
    assert view.border == (16, 24, 48, 48)
    assert same(film, engine.render(shown, replace(settings, region=view.border)))


def test_the_clipping_region(watcher):
    """A box that leaves the left half of the view: there the picture is as it was, elsewhere it
    shows the surroundings.
    """
    bpy.context.scene.glint.final.soft_light = "DEALT"  # no pixel gets light of beyond the edge
    before = watcher.edit(lambda: None, updates=False).combined
    looks, middle = watcher.view.region_data, 0.5
    planes = [
        (-1, 0, 0, middle),
        (0, 0, 0, 0),
        (0, 1, 0, 99),
        (0, 0, 1, 99),
        (0, 0, 0, 0),
        (0, 0, 0, 0),
    ]
    after = watcher.edit(
        lambda: vars(looks).update(use_clip_planes=True, clip_planes=planes), updates=False
    ).combined
    assert before[:, 32:, :3].any()
    assert (after[:, :32] == before[:, :32]).all()
    assert (
        after[:, 33:, :3] == np.array(watcher.session.shown_scene[0].world.background, np.float32)
    ).all()


def test_better_pictures_wait_for_their_redraw_and_the_last_does_not(watcher, monkeypatch):
    monkeypatch.setattr(session.timer.redraws, "seconds", 1e9)
    film = watcher.edit(lambda: None, updates=False)
    assert film.samples == 2, "drawn at once: nothing better will come"
    one, wave = watcher.session, watcher.session.live.newest
    refined = replace(wave, number=wave.number + 1, final=False)

    state = {"error": None, "busy": False, "close": one.live.close}

    def shows(newest) -> None:
        monkeypatch.setattr(one, "live", SimpleNamespace(newest=newest, **state))

    shows(refined)
    assert one.has_news and not one.wants_redraw
    other = replace(wave.task, tag=replace(wave.task.tag, request=wave.task.tag.request + 1))
    shows(replace(refined, task=other))
    assert one.wants_redraw, "the first of another request"
    shows(replace(refined, final=True))
    assert one.wants_redraw
    monkeypatch.setattr(session.timer.redraws, "seconds", 0.0)
    shows(refined)
    assert one.wants_redraw, "redraws take no time here"


def test_a_coarse_picture_then_all_pixels_then_the_exact_one(watcher, monkeypatch):
    asked, live = [], watcher.session.live
    monkeypatch.setattr(session.Pacer, "divisor", lambda *_: 2)
    for name in ("start", "go_on"):
        do = getattr(live, name)
        monkeypatch.setattr(live, name, lambda tasks, do=do: (asked.extend(tasks), do(tasks)))
    quads = [thing for thing in bpy.data.objects if thing.type == "MESH"]
    film = watcher.edit(lambda: setattr(quads[0], "location", (-1.1, 0, 0)))
    told = [
        (task.tag.stage, task.scene.camera.resolution, task.settings.samples, task.exact)
        for task in asked
    ]
    assert told == [
        ("DRAFT", (32, 24), 1, False),
        ("FULL", SIZE, 1, False),
        ("FULL", SIZE, 2, True),
    ]
    assert same(film, watcher.expected())


@pytest.mark.parametrize(
    ("prefers_whole", "slows", "first"),
    [(False, True, "DRAFT"), (True, True, "FULL"), (True, False, "DRAFT")],
)
def test_while_things_move_all_but_the_first_picture_waits_for_the_redraw(
    watcher, monkeypatch, prefers_whole, slows, first
):
    monkeypatch.setattr(session.Pacer, "divisor", lambda *_: 2)
    monkeypatch.setattr(session.Pacer, "prefers_whole", lambda *_: prefers_whole)
    monkeypatch.setattr(session.Motion, "slows", lambda *_: slows)
    monkeypatch.setattr(session.timer.redraws, "follows", lambda _: True)
    one = watcher.session
    session.timer.look()
    watcher.view.region_data.view_matrix = watcher.view.region_data.view_matrix.copy()
    watcher.view.region_data.view_matrix.translation.x += 0.1
    watcher.draw()
    assert one.live.wait(lambda wave: wave.task.tag.request == one.requests, LONGEST)
    assert one.busy and not one.live.busy, "more is to come, later"
    assert one.live.newest.task.tag.stage == first
    monkeypatch.setattr(session.timer.redraws, "clock", lambda: 0.0)
    session.timer.look()
    assert not one.live.busy, "Blender may have something newer"
    monkeypatch.setattr(session.timer.redraws, "clock", lambda: redraws.LOOK)
    session.timer.look()
    film = watcher.edit(lambda: None, updates=False)
    assert film.samples == 2 and same(film, watcher.expected())


def test_a_last_picture_that_comes_while_the_timer_looks_is_looked_for_again(monkeypatch):
    class Session:
        region, busy, has_news = 0, True, False

        @property
        def wants_redraw(self):
            told, self.busy, self.has_news = self.has_news, False, True
            return told

        def go_on(self):
            pass

    drawn = []
    monkeypatch.setattr(session.timer, "_sessions", [Session()])
    monkeypatch.setattr(session.timer, "_redraw", drawn.append)
    assert session.timer.look() is not None and not drawn
    assert session.timer.look() is not None and drawn == [{0}]


def test_an_edit_is_traced_before_blender_draws(watcher):
    one = watcher.session
    bpy.data.objects["Quad 0.5"].location.x += 0.1
    bpy.context.view_layer.update()
    before = one.requests
    one.update(watcher.view, bpy.context.evaluated_depsgraph_get())
    assert one.live.wait(lambda wave: wave.task.tag.request == before + 1, LONGEST)
    watcher.draw()
    assert one.requests == before + 1 and one.answered == one.requests, (
        "the draw asks for nothing new"
    )
    watcher.view.region_data.view_perspective = "CAMERA"
    one.update(watcher.view, bpy.context.evaluated_depsgraph_get())
    assert one.requests == before + 1, "the camera may have moved as well"


def test_a_drawing_shows_what_it_has_just_asked_for(watcher, monkeypatch):
    monkeypatch.setattr(session.timer.redraws, "seconds", LONGEST)
    monkeypatch.setattr(redraws, "LONGEST_WAIT", LONGEST)
    for k in range(3):
        bpy.data.lights["POINT"].energy = 10 * k
        bpy.context.view_layer.update()
        watcher.session.update(watcher.view, bpy.context.evaluated_depsgraph_get())
        watcher.draw()
        assert watcher.session.answered == watcher.session.requests
    watcher.edit(lambda: None, updates=False)


def test_surroundings_leave_all_else():
    lights = (Light("Lamp", "POINT", np.eye(3, 4)), Light("Sky", "DOME", np.eye(3, 4)))
    plain, studio = engine.Scene(None, lights=lights, world=World((1, 1, 1))), World()
    assert Surroundings().around(plain) is plain
    assert Surroundings(False).around(plain).lights == lights[1:]
    around = Surroundings(True, studio).around(plain)
    assert around.world is studio and around.lights == lights[:1]


def test_heat_grows_with_what_it_shows():
    colors = draw.as_colors(np.array([[[0.0], [4.0], [8.0], [80.0]]], np.float32), "Error")
    brightness = colors[0, :, :3].sum(1)
    assert (
        (np.diff(brightness[:3]) > 0).all()
        and brightness[2] == brightness[3]
        and (colors[..., 3] == 1).all()
    )
    grey = draw.as_colors(np.full((1, 1, 1), 3.0, np.float32), "Depth")
    assert (grey[0, 0] == (3, 3, 3, 1)).all()


def test_views_of_one_scene_read_it_once(view, monkeypatch):
    """As the four of a quad view: Blender tells each of every evaluation."""
    reads = []
    read = walked.read_shape
    monkeypatch.setattr(
        walked,
        "read_shape",
        lambda data, *others: reads.append(data.name) or read(data, *others),
    )
    views = [session.Session() for _ in range(4)]
    handler = lambda _, depsgraph: [one.update(view, depsgraph) for one in views]  # noqa: E731
    try:
        handler(None, bpy.context.evaluated_depsgraph_get())
        assert len(reads) == 2
        bpy.app.handlers.depsgraph_update_post.append(handler)
        mesh = next(thing.data for thing in bpy.data.objects if thing.type == "MESH")
        for k in range(3):
            mesh.vertices[0].co.z = k + 1.0
            mesh.update()
            bpy.context.view_layer.update()
            contents = [one.content for one in views]
            assert len(reads) == 3 + k
            assert all(a.geometries == contents[0].geometries for a in contents), (
                "the very same arrays"
            )
            assert any(geometry.vertices[0, 2] == k + 1.0 for geometry in contents[3].geometries)
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(handler)
        for one in views:
            one.close()


def test_a_light_group_is_shown_and_followed(watcher, scene):  # noqa: F811
    """By name; lamps keep theirs when they move, and who is in it may change without an update."""
    shown = []
    original = session.as_colors

    def noted(values, name):
        shown.append((name, np.array(values)))
        return original(values, name)

    session.as_colors = noted
    try:
        layer, sun = bpy.context.view_layer, bpy.data.objects["SUN"]
        layer.lightgroups.add(name="Key")
        scene.glint.viewport_pass, scene.glint.viewport_light_group = "Light Group", "Key"
        watcher.edit(lambda: None)
        name, values = shown[-1]
        assert name == "Light Group Key" and not values.any()

        def join():
            sun.lightgroup = "Key"

        film = watcher.edit(join, updates=False)
        _, lit = shown[-1]
        assert lit.max() > 0 and (lit <= film.passes["Combined"][..., :3] + 1e-6).all()

        def turn():
            sun.rotation_euler.x += 0.5

        film = watcher.edit(turn)
        _, turned = shown[-1]
        assert turned.max() > 0 and (turned != lit).any()
        assert watcher.session.content.light_groups == ("Key",)
        scene.glint.viewport_light_group = "Gone"
        watcher.edit(lambda: None)
        assert shown[-1][0] == "Combined" and watcher.session.content.light_groups == ()
    finally:
        session.as_colors = original
