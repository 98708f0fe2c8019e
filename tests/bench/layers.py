"""Transparent layers: Glint's processor time beside Cycles', one thread, direct light only.

    python tests/bench/layers.py [--scenes fur beads tree] [--sizes 120x68 240x135] [--samples 4]
                                 [--rounds 3] [--out out/layers]

fur: 34 shells round a ball, each with an image whose alpha is 0 or 1, the same noise cut at the
shell's height. beads: 125 balls of constant alpha 0.4. tree: 800 cards with a leaf in the alpha of
their image. One sun with shadows, as many transparent layers as there are, Cycles' own roulette of
paths as it is. In one process per scene and size the engines render in turn; the least processor
time of the rounds counts, a first render of each does not. What an engine takes for a scene of a
camera and a sun, of the same size and samples, is subtracted: Blender's own share and the engine's
fixed one. Cycles sends all samples through the pixels' centres, Glint spreads them over the pixels:
the pictures' means, which the table shows, agree only so far.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path

import numpy as np

from ray_tables import table
from stages import choose_engine, choose_samples, require_core, run_worker

ENGINES = ("GLINT", "CYCLES")
SHELLS, FUR_HEIGHT, NOISE_TEXELS = 34, 0.3, 256
BEADS_A_SIDE, BEAD_ALPHA = 5, 0.4
LEAVES, LEAF_TEXELS = 800, 128
MOST_LAYERS = 1024
"""Cycles' limit on transparent bounces; no ray of these scenes meets as many."""


def main() -> int:
    options = parse_arguments()
    if options.worker:
        print(
            "RESULT " + json.dumps(measure_scene(*options.worker, options.samples, options.rounds))
        )
        return 0
    try:
        require_core()
    except RuntimeError as error:
        print(f"layers.py: {error}", file=sys.stderr)
        return 1
    results = {size: measured(size, options) for size in options.sizes}
    text = layers_table(results)
    print(text)
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    (out / "layers.txt").write_text(text + "\n")
    (out / "layers.json").write_text(json.dumps(results, indent=1))
    return 0


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    scenes = [name for name in BUILDERS if name != "empty"]
    parser.add_argument("--scenes", nargs="+", default=scenes, choices=scenes)
    parser.add_argument("--sizes", nargs="+", default=["120x68", "240x135"], metavar="WxH")
    parser.add_argument("--samples", type=int, default=4)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--out", default="out/layers")
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    return parser.parse_args()


def measured(size: str, options) -> dict[str, dict]:
    """Scene → engine → processor seconds and mean of the picture; with the empty scene."""
    common = ("--samples", str(options.samples), "--rounds", str(options.rounds))
    return {
        name: run_worker(__file__, *common, "--worker", name, size)
        for name in ("empty", *options.scenes)
    }


def measure_scene(name: str, size: str, samples: int, rounds: int) -> dict[str, dict[str, float]]:
    """In this process: engine → the least processor seconds of a render, and the picture's mean."""
    import cycles_reference

    scene = cycles_reference.empty_scene(*(int(pixels) for pixels in size.split("x")))
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    add_sun_and_camera(scene)
    BUILDERS[name](scene)
    choose_engine(scene, "GLINT", samples)
    seconds = {engine: [] for engine in ENGINES}
    for turn in range(rounds + 1):
        for engine in ENGINES:
            taken = timed_render(scene, engine, samples)
            if turn:  # the first loads libraries and kernels
                seconds[engine].append(taken)
    return {e: {"seconds": min(seconds[e]), "mean": mean(scene, e, samples)} for e in ENGINES}


def timed_render(scene, engine: str, samples: int) -> float:
    """Processor seconds of all threads within one render."""
    import bpy

    choose(scene, engine, samples)
    bpy.context.evaluated_depsgraph_get()
    before = time.process_time()
    bpy.ops.render.render()
    return time.process_time() - before


def mean(scene, engine: str, samples: int) -> float:
    """Mean of the picture's colours, from a render of its own."""
    import cycles_reference

    choose(scene, engine, samples)
    return float(cycles_reference.render_passes(scene)["Combined"][..., :3].mean())


def choose(scene, engine: str, samples: int) -> None:
    scene.render.engine = engine
    choose_samples(scene, engine, samples)
    scene.cycles.transparent_max_bounces = MOST_LAYERS


def add_sun_and_camera(scene) -> None:
    import bpy

    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 3.0, 0.0
    sun.rotation_euler = (math.radians(40), 0.0, math.radians(30))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -5.0, 0.0), (math.pi / 2, 0.0, 0.0)
    for thing in (sun, camera):
        scene.collection.objects.link(thing)
    scene.camera = camera


def add_fur(scene) -> None:
    """The base ball with shells round it; shell k holds what noise is above its height."""
    noise = np.random.default_rng(34).random((NOISE_TEXELS, NOISE_TEXELS))
    for k in range(SHELLS):
        radius = 1.0 + FUR_HEIGHT * k / SHELLS
        shell = ball(scene, f"Shell {k}", radius, segments=48, rings=24)
        shell.data.materials.append(cut_out(f"Fur {k}", noise >= k / SHELLS, (0.6, 0.4, 0.2)))


def add_beads(scene) -> None:
    """Balls of one constant alpha in a cube."""
    material = covered("Bead", (0.2, 0.5, 0.8))
    mix = material.node_tree.nodes["Mix Shader"]
    mix.inputs[0].default_value = BEAD_ALPHA
    places = np.linspace(-1.0, 1.0, BEADS_A_SIDE)
    mesh = ball(scene, "Bead", 0.2, segments=32, rings=16, link=False).data
    mesh.materials.append(material)
    for k, place in enumerate((x, y, z) for x in places for y in places for z in places):
        add_object(scene, f"Bead {k}", mesh).location = place


def add_tree(scene) -> None:
    """Square cards of random places within an ellipsoid and random turns, one mesh."""
    import bpy

    random = np.random.default_rng(800)
    centres = random.normal(size=(LEAVES, 3))
    centres *= random.random((LEAVES, 1)) ** (1 / 3) / np.linalg.norm(centres, axis=1)[:, None]
    sides = np.linalg.qr(random.normal(size=(LEAVES, 3, 3)))[0][:, :2] * 0.15  # (n, 2 sides, 3)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    points = centres[:, None] * (1.2, 1.2, 1.0) + np.einsum("cs,nsx->ncx", corners, sides)
    mesh = bpy.data.meshes.new("Leaves")
    mesh.from_pydata(
        points.reshape(-1, 3).tolist(), [], np.arange(4 * LEAVES).reshape(-1, 4).tolist()
    )
    uv = np.tile((corners + 1) / 2, (LEAVES, 1))
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", uv.astype(np.float32).ravel())
    y, x = (np.mgrid[:LEAF_TEXELS, :LEAF_TEXELS] + 0.5) / LEAF_TEXELS * 2 - 1
    leaf = np.abs(x) < 0.6 * (1 - y**2)
    mesh.materials.append(cut_out("Leaf", leaf, (0.1, 0.5, 0.1)))
    add_object(scene, "Leaves", mesh)


def ball(scene, name: str, radius: float, segments: int, rings: int, link: bool = True):
    """A ball of flat faces with the UV map of its parallels; linked to the scene, or not."""
    import bmesh
    import bpy

    mesh = bpy.data.meshes.new(name)
    shape = bmesh.new()
    shape.loops.layers.uv.new("UVMap")
    bmesh.ops.create_uvsphere(
        shape, u_segments=segments, v_segments=rings, radius=radius, calc_uvs=True
    )
    shape.to_mesh(mesh)
    shape.free()
    return add_object(scene, name, mesh) if link else bpy.data.objects.new(name, mesh)


def add_object(scene, name: str, mesh):
    import bpy

    thing = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(thing)
    return thing


def covered(name: str, color: tuple[float, float, float]):
    """A material of node "Mix Shader": 0 lets all light through, 1 is diffuse."""
    import bpy

    import cycles_reference

    material = bpy.data.materials.new(name)
    cycles_reference.use_nodes(material)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    mix = nodes.new("ShaderNodeMixShader")
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (*color, 1.0)
    links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[1])
    links.new(diffuse.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def cut_out(name: str, there: np.ndarray, color: tuple[float, float, float]):
    """A material that is there where an image's alpha says so. there: (rows, columns) bool."""
    import bpy

    image = bpy.data.images.new(name, there.shape[1], there.shape[0], alpha=True)
    pixels = np.ones((*there.shape, 4), np.float32)
    pixels[..., 3] = there
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    material = covered(name, color)
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    mix = material.node_tree.nodes["Mix Shader"]
    material.node_tree.links.new(texture.outputs["Alpha"], mix.inputs[0])
    return material


def layers_table(results: dict[str, dict]) -> str:
    """Seconds less those of the empty scene, and their ratio, a row per scene and size."""
    headings = ("scene, size", "Glint s", "Cycles s", "Glint / Cycles", "empty G", "empty C")
    rows = [(*headings, "with empty", "mean G", "mean C")]
    for size, of_scenes in results.items():
        empty = {e: of_scenes["empty"][e]["seconds"] for e in ENGINES}
        for name, result in of_scenes.items():
            if name == "empty":
                continue
            whole = {e: result[e]["seconds"] for e in ENGINES}
            own = {e: whole[e] - empty[e] for e in ENGINES}
            numbers = [own["GLINT"], own["CYCLES"], own["GLINT"] / own["CYCLES"], *empty.values()]
            numbers.append(whole["GLINT"] / whole["CYCLES"])
            means = [f"{result[e]['mean']:.5f}" for e in ENGINES]
            rows.append((f"{name}, {size}", *(f"{value:.3f}" for value in numbers), *means))
    return table(rows)


BUILDERS = {"empty": lambda _: None, "fur": add_fur, "beads": add_beads, "tree": add_tree}


if __name__ == "__main__":
    sys.exit(main())
