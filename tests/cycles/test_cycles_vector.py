"""The pass Vector against Cycles, at the pixels' centres."""

from types import SimpleNamespace

import numpy as np
import pytest

import cycles_reference as cycles
from glint.addon.export import export_scene
from glint.addon.render.neighbours import with_neighbours
from glint.engine import Settings, render
from small_scenes import add, cube, moved
from test_cycles_motion import build_scene, key, straighten

bpy = cycles.bpy
PIXELS = 1e-3


def zooming(scene) -> None:
    key(scene.camera.data, "lens", 40.0, 60.0)
    straighten()


def parallel(scene) -> None:
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 6.0


def shifted(scene) -> None:
    scene.camera.data.shift_x, scene.camera.data.shift_y = 0.3, -0.1
    scene.render.resolution_x, scene.camera.data.sensor_fit = 64, "VERTICAL"


def instanced(scene) -> None:
    """A cube on each of the four corners of a plane that turns."""
    bpy.ops.mesh.primitive_plane_add(size=2.0)
    corners = bpy.context.object
    child = add(scene, "child", cube(), moved(0, 0, 0, 0.3, 0.2, 0.4))
    child.parent, corners.instance_type = corners, "VERTS"
    key(corners, "rotation_euler", (0.0, 0.0, 0.0), (0.3, 0.0, 1.0))
    straighten()


def panorama(kind: str):
    def change(scene) -> None:
        data = scene.camera.data
        data.type = "PANO"
        (data if hasattr(data, "panorama_type") else data.cycles).panorama_type = kind

    return change


CHANGES = {
    "slide-turn": ("slide-turn", lambda scene: None),
    "stretch": ("stretch", lambda scene: None),
    "shape": ("shape", lambda scene: None),
    "camera": ("camera-too", lambda scene: None),
    "zoom": ("camera-too", zooming),
    "parallel": ("slide-turn", parallel),  # not with a camera that moves: Cycles' is a perspective
    "shifted": ("camera-too", shifted),
    "instances": ("camera-too", instanced),
    "equirectangular": ("camera-too", panorama("EQUIRECTANGULAR")),
    "fisheye": ("camera-too", panorama("FISHEYE_EQUISOLID")),
    "cylinder": ("camera-too", panorama("CENTRAL_CYLINDRICAL")),
}


def glints(scene) -> dict[str, np.ndarray]:
    engine = SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )
    depsgraph = bpy.context.evaluated_depsgraph_get()
    [read], notes = with_neighbours((export_scene(depsgraph).scene,), engine, depsgraph)
    assert notes == ()
    return render(read, Settings(samples=1, passes=frozenset({"Vector", "Position"}))).passes


@pytest.mark.parametrize("name", CHANGES)
def test_cycles_has_the_same_vectors(name: str) -> None:
    base, change = CHANGES[name]
    scene = build_scene(base, "CENTER")
    change(scene)
    scene.render.use_motion_blur = False
    scene.frame_set(2)
    bpy.context.view_layer.use_pass_vector = True
    glint, truth = glints(scene), cycles.render_cycles(scene)
    same = np.abs(glint["Position"] - truth["Position"]).max(-1) < 1e-3
    assert same.mean() > 0.99
    assert np.abs(truth["Vector"]).max() > 1
    assert np.abs(glint["Vector"] - truth["Vector"])[same].max() < PIXELS


def test_cycles_has_none_with_motion_blur() -> None:
    scene = build_scene("slide-turn", "CENTER")
    bpy.context.view_layer.use_pass_vector = True
    assert not cycles.render_cycles(scene)["Vector"].any()
