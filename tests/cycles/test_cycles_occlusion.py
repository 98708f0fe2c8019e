"""The pass Ambient Occlusion against Cycles at many samples."""

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint.addon.export import export_scene
from glint.engine import Settings, render
from test_cycles_seen_passes import scene_of_things

bpy = cycles.bpy
PASS = "Ambient Occlusion"
DIRECTIONS = CYCLES_SAMPLES = 1024


def still_life():
    scene = cycles.empty_scene(32, 32)
    build.still_life(scene)
    build.add_camera(scene)
    return scene


SCENES = {
    "still-life": (still_life, 10.0),
    "near": (still_life, 0.7),
    "veils": (scene_of_things, 1),
}


@pytest.mark.parametrize("name", SCENES)
def test_cycles_has_the_same_openness(name: str) -> None:
    """Each pixel of Cycles' is off by up to half of 1 / √N in the root mean square."""
    make, distance = SCENES[name]
    scene = make()
    scene.world.light_settings.distance = distance
    bpy.context.view_layer.use_pass_ambient_occlusion = True
    export = export_scene(bpy.context.evaluated_depsgraph_get())
    assert export.scene.world.occlusion_distance == pytest.approx(distance)
    assert not any("Occlusion" in note for note in export.notes)
    settings = Settings(samples=64, light_samples=2, filter_width=0.0, passes=frozenset({PASS}))
    glint = render(export.scene, settings).passes[PASS]
    truth = cycles.render_cycles(scene, CYCLES_SAMPLES)[PASS]
    assert 0.1 < truth.mean() < 1 and truth.std() > 0.02
    assert abs((glint - truth).mean()) < 1e-3
    assert np.sqrt(((glint - truth) ** 2).mean()) < 0.5 / np.sqrt(CYCLES_SAMPLES)
