"""Procedural textures of node programs against Cycles: every setting, random inputs.

A case is a tile of one picture: tilted quads with a material each, seen by an orthographic
camera. The texture reads Position as vector and its z as W; the reference reads the same float32
positions from the Position pass, so both see the same coordinates to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export.materials.graph import Place
from glint.addon.export.shader_nodes import READERS, TreeReader
from glint.engine.program.execute import noise, patterns
from glint.engine.program.execute.run import run
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program

TILE = 12
EXTENT = 6.0  # of the whole grid, units
TOLERANCE = 1e-4
# Distortion and colours read noise 100 to 200 units off, where float32 keeps steps of 2^-16.
# Where half of one moves the texture by more than the tolerance, Cycles' own rounding decides:
# up to four of them (distortion, offset, octaves) are allowed.
FLOAT32_STEP, ROUNDINGS = 2.0**-17, 4
# The first sines of Magic are of 5 (x + y + z), up to 30 π, where float32 keeps steps of 2^-17,
# too; each depth multiplies what half a step does to them by up to three times the distortion.
MAGIC_STEEPNESS = 15.0
GABOR = "ShaderNodeTexGabor"


@dataclass(frozen=True)
class Case:
    """A node as Blender has it and the function that means it."""

    node: str
    properties: dict[str, Any]
    inputs: dict[str, Any]  # socket -> number, three numbers of a colour
    output: str
    function: Any
    arguments: tuple[str, ...]  # sockets in the order of the function's arguments
    settings: dict[str, int]
    result: int


def dims(value: int) -> dict[str, str]:
    return {"noise_dimensions": f"{value}D"}


def white_noise_cases() -> list[Case]:
    return [
        Case(
            "ShaderNodeTexWhiteNoise",
            dims(d),
            {},
            output,
            noise.white_noise,
            ("Vector", "W"),
            {"dimensions": d},
            result,
        )
        for d in (1, 2, 3, 4)
        for result, output in enumerate(("Value", "Color"))
    ]


def noise_cases(random) -> list[Case]:
    sockets = (
        "Vector",
        "W",
        "Scale",
        "Detail",
        "Roughness",
        "Lacunarity",
        "Offset",
        "Gain",
        "Distortion",
    )
    cases = []
    for d in (1, 2, 3, 4):
        for kind in noise.NoiseType:
            for result, output in enumerate(("Fac", "Color")):
                for sample in range(3):
                    inputs = {
                        "Scale": random.uniform(0.5, 4),
                        "Detail": (0.0, 2.0, 3.4)[sample],
                        "Roughness": random.uniform(0.2, 0.7),
                        "Lacunarity": random.uniform(1.5, 2.5),
                        "Offset": random.uniform(0, 1),
                        "Gain": random.uniform(0.5, 2),
                        "Distortion": (0.0, random.uniform(-1, 1), 0.3)[sample],
                    }
                    properties = {**dims(d), "noise_type": kind.name, "normalize": sample != 1}
                    settings = {
                        "dimensions": d,
                        "noise_type": int(kind),
                        "normalize": int(sample != 1),
                    }
                    cases.append(
                        Case(
                            "ShaderNodeTexNoise",
                            properties,
                            inputs,
                            output,
                            noise.noise_texture,
                            sockets,
                            settings,
                            result,
                        )
                    )
    return cases


def color(random) -> tuple[float, ...]:
    return tuple(float(np.float32(c)) for c in random.uniform(0, 1, 3))


def checker_cases(random) -> list[Case]:
    sockets = ("Vector", "Color1", "Color2", "Scale")
    return [
        Case(
            "ShaderNodeTexChecker",
            {},
            {"Color1": color(random), "Color2": color(random), "Scale": random.uniform(0.5, 5)},
            output,
            patterns.checker_texture,
            sockets,
            {},
            result,
        )
        for result, output in enumerate(("Color", "Fac"))
        for _ in range(3)
    ]


def gradient_cases() -> list[Case]:
    return [
        Case(
            "ShaderNodeTexGradient",
            {"gradient_type": kind.name},
            {},
            output,
            patterns.gradient_texture,
            ("Vector",),
            {"gradient_type": int(kind)},
            result,
        )
        for kind in patterns.GradientType
        for result, output in enumerate(("Color", "Fac"))
    ]


def wave_cases(random) -> list[Case]:
    sockets = (
        "Vector",
        "Scale",
        "Distortion",
        "Detail",
        "Detail Scale",
        "Detail Roughness",
        "Phase Offset",
    )
    cases = []
    for kind in patterns.WaveType:
        for direction in patterns.WaveDirection:
            for profile in patterns.WaveProfile:
                inputs = {
                    "Scale": random.uniform(0.2, 1.5),
                    "Distortion": random.uniform(-2, 2),
                    "Detail": random.uniform(0, 4),
                    "Detail Scale": random.uniform(0.5, 2),
                    "Detail Roughness": random.uniform(0.2, 0.8),
                    "Phase Offset": random.uniform(-4, 4),
                }
                last = direction == patterns.WaveDirection.ALL
                properties = {
                    "wave_type": kind.name,
                    "wave_profile": profile.name,
                    "bands_direction": "DIAGONAL" if last else direction.name,
                    "rings_direction": "SPHERICAL" if last else direction.name,
                }
                settings = {
                    "wave_type": int(kind),
                    "direction": int(direction),
                    "profile": int(profile),
                }
                cases.append(
                    Case(
                        "ShaderNodeTexWave",
                        properties,
                        inputs,
                        "Fac",
                        patterns.wave_texture,
                        sockets,
                        settings,
                        1,
                    )
                )
    return cases


def magic_cases(random) -> list[Case]:
    return [
        Case(
            "ShaderNodeTexMagic",
            {"turbulence_depth": depth},
            {"Scale": random.uniform(0.2, 2), "Distortion": distortion},
            output,
            patterns.magic_texture,
            ("Vector", "Scale", "Distortion"),
            {"depth": depth},
            result,
        )
        for depth in range(11)
        for result, output in enumerate(("Color", "Fac"))
        for distortion in (0.0, random.uniform(0.5, 2))
    ]


def brick_cases(random) -> list[Case]:
    sockets = (
        "Vector",
        "Color1",
        "Color2",
        "Mortar",
        "Scale",
        "Mortar Size",
        "Mortar Smooth",
        "Bias",
        "Brick Width",
        "Row Height",
        "offset",
        "squash",
    )
    cases = []
    for sample in range(12):
        inputs = {
            "Color1": color(random),
            "Color2": color(random),
            "Mortar": color(random),
            "Scale": random.uniform(1, 4),
            "Mortar Size": random.uniform(0.02, 0.12),
            "Mortar Smooth": (0.0, random.uniform(0.1, 1))[sample % 2],
            "Bias": random.uniform(-1, 1),
            "Brick Width": random.uniform(0.3, 1),
            "Row Height": random.uniform(0.2, 0.5),
        }
        frequencies = {"offset_frequency": 1 + sample % 3, "squash_frequency": 1 + sample // 3}
        properties = {
            **frequencies,
            "offset": random.uniform(0, 1),
            "squash": random.uniform(0.5, 1.5),
        }
        for result, output in enumerate(("Color", "Fac")):
            cases.append(
                Case(
                    "ShaderNodeTexBrick",
                    properties,
                    inputs,
                    output,
                    patterns.brick_texture,
                    sockets,
                    frequencies,
                    result,
                )
            )
    return cases


def gabor_cases(random) -> list[Case]:
    """None in Blender 4.2, which has no such node."""
    if not hasattr(bpy.types, GABOR):
        return []
    sockets = (
        "Vector", "Scale", "Frequency", "Anisotropy", "Orientation 2D", "Orientation 3D",
    )  # fmt: skip
    cases = []
    for dimensions in (2, 3):
        for result, output in enumerate(("Value", "Phase", "Intensity")):
            for anisotropy in (0.0, random.uniform(0, 1), 1.0):
                inputs = {
                    "Scale": random.uniform(0.3, 1.5),
                    "Frequency": random.uniform(0.5, 4),
                    "Anisotropy": anisotropy,
                    "Orientation 2D": random.uniform(-4, 4),
                    "Orientation 3D": color(random),
                }
                properties = {"gabor_type": f"{dimensions}D"}
                settings = {"dimensions": dimensions}
                cases.append(
                    Case(
                        GABOR,
                        properties,
                        inputs,
                        output,
                        patterns.gabor_texture,
                        sockets,
                        settings,
                        result,
                    )
                )
    return cases


def all_cases() -> list[Case]:
    random = np.random.default_rng(4)
    return [
        *white_noise_cases(),
        *noise_cases(random),
        *checker_cases(random),
        *gradient_cases(),
        *wave_cases(random),
        *magic_cases(random),
        *brick_cases(random),
        *gabor_cases(random),
    ]


def material(case: Case):
    """A new material that emits the case's output."""
    made = bpy.data.materials.new(case.node)
    cycles.use_nodes(made)
    tree = made.node_tree
    tree.nodes.clear()
    texture, geometry, split, emission, end = (
        tree.nodes.new(kind)
        for kind in (
            case.node,
            "ShaderNodeNewGeometry",
            "ShaderNodeSeparateXYZ",
            "ShaderNodeEmission",
            "ShaderNodeOutputMaterial",
        )
    )
    for name, value in case.properties.items():
        setattr(texture, name, value)
    for socket in texture.inputs:
        value = case.inputs.get(socket.identifier)
        if value is not None:
            is_color = socket.type == "RGBA"
            socket.default_value = (*value, 1.0) if is_color else value
    tree.links.new(geometry.outputs["Position"], split.inputs[0])
    if "Vector" in texture.inputs:
        tree.links.new(geometry.outputs["Position"], texture.inputs["Vector"])
    if "W" in texture.inputs:
        tree.links.new(split.outputs["Z"], texture.inputs["W"])
    output = next(o for o in texture.outputs if o.identifier == case.output)
    tree.links.new(output, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], end.inputs["Surface"])
    return made


def render(cases: list[Case]) -> tuple[np.ndarray, np.ndarray]:
    """Colours and positions (cases, pixels, 3) that Cycles gives."""
    side = int(np.ceil(np.sqrt(len(cases))))
    scene = cycles.empty_scene(side * TILE, side * TILE)
    scene.render.film_transparent = False
    edges = np.linspace(-EXTENT / 2, EXTENT / 2, side + 1)
    vertices = [(x, y, 0.37 * x - 0.61 * y + 0.1) for y in edges for x in edges]
    corners = [i * (side + 1) + j for i in range(side) for j in range(side)]
    mesh = bpy.data.meshes.new("Tiles")
    mesh.from_pydata(vertices, [], [(c, c + 1, c + side + 2, c + side + 1) for c in corners])
    for index, case in enumerate(cases):
        mesh.materials.append(material(case))
        mesh.polygons[index].material_index = index
    scene.collection.objects.link(bpy.data.objects.new("Tiles", mesh))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", EXTENT
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.camera.location = (0.0, 0.0, 20.0)
    scene.collection.objects.link(scene.camera)
    passes = cycles.render_cycles(scene)

    def tiles(picture: np.ndarray) -> np.ndarray:
        split = picture[:, :, :3].reshape(side, TILE, side, TILE, 3).swapaxes(1, 2)
        return split.reshape(side * side, TILE * TILE, 3)[: len(cases)].astype(np.float64)

    return tiles(passes["Combined"]), tiles(passes["Position"])


def expected(case: Case, positions: np.ndarray) -> np.ndarray:
    """Colours (pixels, 3) by the reference at the positions (pixels, 3)."""
    values = {**case.properties, **case.inputs, "Vector": positions.T, "W": positions[:, 2]}

    def argument(name: str) -> np.ndarray:
        value = np.asarray(values.get(name, 0.0), np.float64)
        if name in ("Vector", "W"):
            return value
        # Blender keeps sockets and properties in float32.
        wide = value.astype(np.float32).astype(np.float64)
        return (
            np.repeat(wide[:, None], len(positions), 1)
            if wide.ndim
            else np.full(len(positions), wide)
        )

    result = case.function(*(argument(name) for name in case.arguments), **case.settings)[
        case.result
    ]
    return np.broadcast_to(result.T if result.ndim == 2 else result[:, None], positions.shape)


def tolerance(case: Case, positions: np.ndarray) -> float:
    """Largest difference allowed in a tile; above TOLERANCE only for noise and magic, which are
    continuous.
    """
    if case.function is noise.noise_texture:
        step = FLOAT32_STEP / case.inputs["Scale"]
    elif case.function is patterns.magic_texture:
        step = FLOAT32_STEP / case.inputs["Scale"] / MAGIC_STEEPNESS
    else:
        return TOLERANCE
    moved = expected(case, positions + step) - expected(case, positions)
    return max(TOLERANCE, ROUNDINGS * float(np.abs(moved).max()))


@pytest.fixture(scope="module")
def rendered():
    cases = all_cases()
    colors, positions = render(cases)
    return cases, colors, positions


NODES = sorted({case.node for case in all_cases()})


@pytest.mark.parametrize("node", NODES)
def test_texture_is_that_of_cycles(rendered, node):
    """Every pixel of every tile agrees; noise may differ as far as float32 moves it."""
    wrong, tried = [], 0
    for case, seen, positions in zip(*rendered, strict=True):
        if case.node != node:
            continue
        tried += 1
        # Cycles' film takes no negative light.
        truth = np.maximum(expected(case, positions), 0.0)
        distance = np.abs(truth - np.maximum(seen, 0.0)).max()
        if distance > tolerance(case, positions):
            wrong.append((case.properties, case.inputs, case.output, float(distance)))
    assert tried
    assert not wrong, f"{len(wrong)} of {tried} cases differ:\n" + "\n".join(map(str, wrong))


@pytest.mark.parametrize("node", sorted(set(NODES) & set(READERS)))
def test_program_of_the_node_is_the_function(node):
    """Nodes are read with every setting and socket in its place."""
    positions = np.random.default_rng(5).uniform(-3, 3, (40, 3))
    points = SimpleNamespace(position=lambda shift: positions.T)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for case in all_cases():
        if case.node != node:
            continue
        notes: list[str] = []
        graph = Graph()
        emission = next(n for n in material(case).node_tree.nodes if n.type == "EMISSION")
        value = TreeReader(graph, None, notes.append).value(Place(emission.inputs["Color"]))
        found = run(compile_program(graph, [value]), points, len(positions))[0]
        np.testing.assert_allclose(found.T, expected(case, positions), rtol=1e-12, atol=1e-12)
        assert not notes
