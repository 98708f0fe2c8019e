"""Scenes with much of one thing, whose renders are mostly what comes before the first ray: Glint
beside Cycles, four samples, all light.

    python tests/bench/crowded.py [--scenes NAME …] [--engines GLINT CYCLES] [--rounds 3]
    [--size 480 270]

Processor seconds of a whole render, the least of so many in one process, which has drawn the scene
once before and forgets its images in between; megabytes are of the peak above what the process held
before its first render. Of Glint's are told apart the export, the lights that Python finds (glowing
meshes, openings of rooms), the checks and packing, and the hash of the scene's stamp; "core" is the
rest, BVHs and rays, with the wall seconds of the BVHs in brackets. With --size 16 9 there are few
rays. With --hash the picture's hash.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from stages import TESTS, require_core, run_worker, status_megabytes

sys.path.append(str(TESTS / "blender"))

SAMPLES = 4
IMAGE_SIDE = 4096
PARTS = ("export", "lights", "packing", "stamp")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", default=list(CROWDED), choices=CROWDED)
    parser.add_argument("--engines", nargs="+", default=["GLINT", "CYCLES"])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--size", nargs=2, type=int, default=(480, 270))
    parser.add_argument("--hash", action="store_true", help="tell the hash of Glint's picture")
    parser.add_argument("--worker", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        scene, engine, folder = options.worker
        CROWDED[scene](open_empty(), Path(folder))
        result = measure(engine, options.rounds, options.size)
        print("RESULT " + json.dumps(result), flush=True)
        os._exit(0)  # Blender takes seconds to free a hundred thousand objects
    require_core()
    columns = ("Glint s", *PARTS, "core (BVHs)", "Cycles s", "ratio", "Glint MB", "Cycles MB")
    print(f"| scene | {' | '.join((*columns, 'ratio'))} |\n|{'---|' * (len(columns) + 2)}")
    asked = ["--rounds", str(options.rounds), "--size", *map(str, options.size)]
    with tempfile.TemporaryDirectory() as folder:
        for scene in options.scenes:
            found = {
                engine: run_worker(__file__, *asked, "--worker", scene, engine, folder)
                for engine in options.engines
            }
            print(row_of(scene, found), flush=True)
            if options.hash and "GLINT" in found:
                print(f"<!-- {scene} {found['GLINT']['hash']} -->", flush=True)
    return 0


def row_of(scene: str, found: dict[str, dict]) -> str:
    glint, cycles = (found.get(engine, {}) for engine in ("GLINT", "CYCLES"))
    own = sum(glint.get(part, 0.0) for part in PARTS)
    core = f"{glint.get('total', 0) - own:.2f} ({glint.get('build', 0):.2f})"
    cells = [f"{glint.get('total', 0):.2f}", *(f"{glint.get(part, 0):.2f}" for part in PARTS), core]
    for name, digits in (("total", 2), ("megabytes", 0)):
        mine, theirs = glint.get(name, 0), cycles.get(name, 0)
        cells += [f"{mine:.0f}"] if name == "megabytes" else []
        cells += [f"{theirs:.{digits}f}", f"{mine / theirs:.2f}" if theirs else ""]
    return f"| {scene} | {' | '.join(cells)} |"


def measure(engine: str, rounds: int, size: tuple[int, int]) -> dict:
    """Of the quickest of so many renders of the present scene."""
    import bpy

    import front_scenes

    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    if engine == "GLINT":
        require_core()
        scene.render.engine, scene.glint.final.samples = "GLINT", SAMPLES
        front_scenes.forget_between_renders()
    else:
        front_scenes.choose_cycles(scene, SAMPLES, False, 0)
    bpy.context.evaluated_depsgraph_get()
    before = status_megabytes("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts again from here
    parts = timed_parts() if engine == "GLINT" else Counter()
    rows = []
    for _ in range(rounds + 1):
        parts.clear()
        began = time.process_time()
        bpy.ops.render.render()
        rows.append({"total": time.process_time() - began, **parts})
        peak = rows[0].setdefault("megabytes", status_megabytes("VmHWM") - before)
    best = min(rows[1:], key=lambda row: row["total"])
    found = {**best, "first": rows[0]["total"], "megabytes": peak}
    if engine == "GLINT":
        from glint.addon.render import statistics

        found["build"] = statistics.of_last_render(scene.name).traced["build"]
        found["hash"] = hashlib.sha256(front_scenes.last_picture(scene).tobytes()).hexdigest()[:16]
    return found


def timed_parts() -> Counter:
    """Processor seconds of parts of Glint's renders, which are added up in it from now on."""
    from glint.addon.render import final, stamp
    from glint.engine import backends
    from glint.engine.native import render

    found: Counter = Counter()

    def timed(module, name: str, part: str, clock: Callable[[], float]) -> None:
        function = getattr(module, name)

        def told(*arguments, **named):
            began = clock()
            try:
                return function(*arguments, **named)
            finally:
                found[part] += clock() - began

        setattr(module, name, told)

    # threads of the export and of the core count; the stamp's is one beside them
    timed(final, "export_scene", "export", time.process_time)
    timed(backends, "lit_scene", "lights", time.process_time)
    timed(backends, "check", "packing", time.thread_time)
    timed(render, "pack_scene", "packing", time.thread_time)
    timed(stamp, "value_fingerprint", "stamp", time.thread_time)
    return found


# --- scenes


def open_empty():
    """An empty file with a grey-blue sky."""
    import bpy

    import glint
    import made_scenes

    glint.register()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    made_scenes.sky(scene, (0.3, 0.4, 0.5))
    return scene


def seen(scene, has_lamp: bool = True):
    from small_scenes import add_camera, add_light

    add_camera(scene, (5.5, -7.0, 5.0), (0.0, 0.0, 0.0))
    if has_lamp:
        add_light(scene, "AREA", (2.0, -3.0, 5.0), energy=900.0, size=1.0)


def sculpt(scene, folder: Path) -> None:
    """One mesh of a million triangles."""
    from made_scenes import floor, principled
    from small_scenes import add, ball, moved

    mesh = ball(1000, 500, material=principled("clay", (0.7, 0.5, 0.4), Roughness=0.6))
    points = np.empty((len(mesh.vertices), 3), np.float32)
    places = mesh.attributes["position"].data
    places.foreach_get("vector", points.reshape(-1))
    x, y, z = points.T
    bumps = 0.1 * np.sin(9 * x) * np.cos(7 * y + 2 * z) + 0.01 * np.sin(71 * x + 67 * y) * np.cos(
        73 * z
    )
    places.foreach_set("vector", (points * (1 + bumps)[:, None]).astype(np.float32).reshape(-1))
    mesh.update()
    add(scene, "sculpt", mesh, moved(0, 0, 0, 2, 2, 2))
    floor(scene)
    scene.objects["floor"].location.z = -2
    seen(scene)


def image(folder: Path, number: int, side: int, kind: str):
    """A soft colourful picture with some grain, read from its file."""
    import bpy

    path = folder / f"image {number} {side}.{kind}"
    if not path.exists():
        made = bpy.data.images.new(path.stem, side, side)
        random = np.random.default_rng(number)
        coarse = random.random((side // 64, side // 64, 4), dtype=np.float32)
        pixels = np.kron(coarse, np.ones((64, 64, 1), np.float32))
        pixels += 0.1 * random.random((side, side, 1), dtype=np.float32)
        pixels[..., 3] = 1
        made.pixels.foreach_set(pixels.reshape(-1))
        made.filepath_raw, made.file_format = str(path), "JPEG" if kind == "jpg" else "PNG"
        made.save()
        bpy.data.images.remove(made)
    return bpy.data.images.load(str(path), check_existing=True)


def tile(name: str, side: int, scale: float, waves: float, material):
    """A square of 2 side² triangles with a UV map."""
    import bpy

    x, y = np.meshgrid(*[np.linspace(-scale, scale, side + 1)] * 2, indexing="ij")
    z = 0.1 * scale * np.sin(waves * x) * np.cos(waves * y)
    row, column = np.meshgrid(*[np.arange(side)] * 2, indexing="ij")
    first = (row * (side + 1) + column).ravel()
    quads = np.stack([first, first + side + 1, first + side + 2, first + 1], -1)
    mesh = bpy.data.meshes.new(name)
    points = np.stack([x, y, z], -1).reshape(-1, 3)
    mesh.from_pydata(points, [], quads)
    uv = (points[quads.ravel(), :2] / scale + 1) / 2
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uv.astype(np.float32).ravel())
    mesh.shade_smooth()
    mesh.materials.append(material)
    return mesh


def textured(name: str, picture, **values):
    """A material of a Principled BSDF, its tree and that, and a node of the image."""
    from made_scenes import principled

    material = principled(name, **values)
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = picture
    shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
    return material, tree, shader, node


def textures(scene, folder: Path) -> None:
    """Sixteen images of 4096 × 4096 pixels, half of them JPEG and half PNG."""
    from small_scenes import add, moved

    for k in range(16):
        picture = image(folder, k, IMAGE_SIDE, ("jpg", "png")[k % 2])
        material, tree, shader, node = textured(f"m{k}", picture)
        tree.links.new(node.outputs[0], shader.inputs["Base Color"])
        place = moved((k % 4) * 2 - 3, (k // 4) * 2 - 3, 0)
        add(scene, f"tile{k}", tile(f"tile{k}", 20, 0.9, 3, material), place)
    seen(scene)


def objects(scene, folder: Path) -> None:
    """50 000 of ten meshes and materials."""
    import bpy

    from made_scenes import principled
    from small_scenes import cube

    meshes = [cube(principled(f"m{k}", (k / 10, 0.5, 0.5))) for k in range(10)]
    places = np.random.default_rng(1).uniform(-3, 3, (50_000, 3))
    for k, place in enumerate(places):
        item = bpy.data.objects.new(f"o{k}", meshes[k % 10])
        item.location, item.scale = place, (0.01, 0.01, 0.01)
        scene.collection.objects.link(item)
    seen(scene)


def instances(scene, folder: Path) -> None:
    """A hundred thousand, by geometry nodes."""
    from made_scenes import principled
    from test_export_instances import scatter

    _, part = scatter(100_000)
    part.data.materials.append(principled("leaf", (0.2, 0.6, 0.2)))
    for vertex in part.data.vertices:
        vertex.co *= 0.006
    seen(scene)


def pile(scene, folder: Path) -> None:
    """A hundred thousand balls that lie on and in each other, by geometry nodes."""
    import bpy

    from made_scenes import floor, principled
    from small_scenes import add, ball

    part = add(scene, "ball", ball(16, 12, material=principled("ball", (0.7, 0.3, 0.2))))
    part.location = (0, 0, -50)
    count, random = 100_000, np.random.default_rng(2)
    points = random.normal(0, 1, (count, 3)) * (1.2, 1.2, 0.5)
    points[:, 2] = np.abs(points[:, 2])
    cloud = bpy.data.meshes.new("places")
    cloud.from_pydata(points, [], [])
    holder = add(scene, "places", cloud)
    tree = bpy.data.node_groups.new("Pile", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    start, end, place, what = (
        tree.nodes.new(name)
        for name in (
            "NodeGroupInput",
            "NodeGroupOutput",
            "GeometryNodeInstanceOnPoints",
            "GeometryNodeObjectInfo",
        )
    )
    what.inputs["Object"].default_value = part
    what.inputs["As Instance"].default_value = True
    place.inputs["Scale"].default_value = (0.03, 0.03, 0.03)
    tree.links.new(start.outputs[0], place.inputs["Points"])
    tree.links.new(what.outputs["Geometry"], place.inputs["Instance"])
    tree.links.new(place.outputs[0], end.inputs[0])
    holder.modifiers.new("Pile", "NODES").node_group = tree
    floor(scene)
    seen(scene)


def lamps(scene, folder: Path, count: int) -> None:
    """So many point lamps over a wavy floor."""
    from made_scenes import principled
    from small_scenes import add, add_light

    clay = principled("clay", (0.7, 0.5, 0.4), Roughness=0.6)
    add(scene, "floor", tile("floor", 100, 4.0, 3.0, clay))
    for place in np.random.default_rng(1).uniform(-4, 4, (count, 3)):
        add_light(scene, "POINT", (*place[:2], 1 + abs(place[2])), energy=2000 / count)
    seen(scene, has_lamp=False)


def fur(scene, folder: Path) -> None:
    """10 000 particles of hair on a ball, each with nine children."""
    import bpy

    from made_scenes import new_material
    from small_scenes import add, ball

    material, tree, output = new_material("fur")
    shader = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    body = add(scene, "body", ball(64, 32, material=material))
    body.modifiers.new("fur", "PARTICLE_SYSTEM")
    hair = body.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length, hair.hair_step = "HAIR", 10_000, 0.5, 5
    hair.child_type, hair.rendered_child_count = "SIMPLE", 9
    hair.root_radius, hair.tip_radius = 0.5, 0.1
    bpy.context.view_layer.update()
    seen(scene)


def car(scene, folder: Path) -> None:
    """35 meshes of 440 000 triangles together, 23 materials of images with bump and normal maps and
    anisotropic gloss.
    """
    from small_scenes import add, moved

    made = []
    for k in range(23):
        picture = image(folder, 100 + k % 6, 1024, "png")
        picture.colorspace_settings.name = "Non-Color"
        values = {"Roughness": 0.2 + 0.02 * k, "Metallic": float(k % 2)}
        material, tree, shader, node = textured(f"paint{k}", picture, color=(k / 23, 0.5, 0.3))
        for name, value in values.items():
            shader.inputs[name].default_value = value
        if k % 2:
            bend = tree.nodes.new("ShaderNodeNormalMap")
            tree.links.new(node.outputs[0], bend.inputs["Color"])
        else:
            bend = tree.nodes.new("ShaderNodeBump")
            tree.links.new(node.outputs[0], bend.inputs["Height"])
        tree.links.new(bend.outputs[0], shader.inputs["Normal"])
        if k % 5 == 0:
            shader.inputs["Anisotropic"].default_value = 0.5
        if k % 7 == 0:
            shader.inputs["Coat Weight"].default_value = 1.0
        made.append(material)
    for k in range(35):
        part = tile(f"part{k}", 79, 0.6, 3 + k / 10, made[k % 23])
        add(scene, f"part{k}", part, moved((k % 6) - 3, (k // 6) - 3, 0))
    seen(scene)


CROWDED: dict[str, Callable] = {
    "sculpt": sculpt,
    "textures": textures,
    "objects": objects,
    "instances": instances,
    "pile": pile,
    **{f"lamps {count}": partial(lamps, count=count) for count in (2, 200, 2000)},
    "car": car,
    "fur": fur,
}

if __name__ == "__main__":
    sys.exit(main())
