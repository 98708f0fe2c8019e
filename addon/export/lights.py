"""Blender's lights to `engine.scene.Light`. Strength is Blender's number for a normalised light,
whatever the light's own settings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...engine.program.program import Program, compile_program
from ...engine.scene import Light, Openings, Texture
from .camera import crossed, inverse_axes
from .images.images import Images
from .instances import Flags
from .materials.closures import LobeKey
from .materials.evaluator import Evaluator
from .materials.graph import end_of, images_behind, read_tree
from .materials.terms import RGB
from .report import Report
from .shader_nodes.lamp import Lamp, LampReader
from .shader_nodes.reader import FARTHEST, INFINITE
from .unsupported import note_light

BLACK = (0.0, 0.0, 0.0)
_SAME_LENGTH = 1e-5
"""Relative difference of axis lengths that float32 matrices have by rounding."""
MOST_PORTALS = 256
"""The first ones count."""
_ASLANT = 1e-3
"""Cosine of two axes from which on they stand aslant on each other."""


@dataclass(frozen=True)
class Emission:
    """What a light's nodes multiply its colour by: color, times what the program gives, if there is
    one. is_shared: it is the same for lights of equal `Lamp.key`.
    """

    color: RGB = (1.0, 1.0, 1.0)
    program: Program | None = None
    textures: tuple[Texture, ...] = ()
    is_shared: bool = True


class Lights:
    """The lights of one scene, in the order in which they came."""

    def __init__(self, images: Images, report: Report) -> None:
        self.lights: list[Light] = []
        self._portals: list[np.ndarray] = []
        self.images, self.report = images, report

    def add(
        self, name: str, data: Any, matrices: np.ndarray, flags: Flags, light_group: int = -1
    ) -> None:
        """An evaluated light data-block at every place of `matrices` (k, 3, 4). flags: of its
        object; what sees that, it lights.
        """
        if getattr(data.cycles, "is_portal", False) and data.type == "AREA":
            self._portals += [_portal(data, matrix) for matrix in matrices]
            return
        self._note_approximations(name, data)
        note_light(name, data, self.report)
        trees: dict[tuple, Emission] = {}
        for matrix in matrices:
            light = self._place(name, data, matrix, flags, light_group, trees)
            if light is not None:
                self.lights.append(light)

    @property
    def openings(self) -> Openings | None:
        """The portals that have an area."""
        rows = np.array(self._portals).reshape(-1, 4, 3)
        area = np.linalg.norm(np.cross(rows[:, 1], rows[:, 2]), axis=1)
        good = np.flatnonzero((area > 0) & np.isfinite(area))[:MOST_PORTALS]
        shares = area[good] / area[good].sum() if len(good) else area
        return Openings(*rows[good].swapaxes(0, 1), shares) if len(good) else None

    def _place(
        self,
        name: str,
        data: Any,
        matrix: np.ndarray,
        flags: Flags,
        light_group: int,
        trees: dict[tuple, Emission],
    ) -> Light | None:
        """trees: what the light's nodes emit at places before, by `Lamp.key`."""
        frame, sizes = light_frame(matrix)
        if frame is None and data.type == "POINT":
            frame = np.concatenate([np.eye(3), matrix[:, 3:]], 1)
        if frame is None:
            self.report.note(
                "Lights that are scaled to nothing are left out ({}): clear their scale", name
            )
            return None
        shape = _shape(data, sizes)
        if data.type == "SPOT" and not _same(sizes[0], sizes[1]):
            self.report.note(
                "The cones of spot lights stay round ({}): give the light one scale along x and y",
                name,
            )
        if data.type == "AREA" and _is_sheared(matrix, sizes):
            self.report.note(
                "Area lights that their parents' scale shears keep right angles ({}): clear the "
                "parents' scale or apply it",
                name,
            )
        if not all(_is_small(x) for x in shape.values() if isinstance(x, float)):
            self.report.note(
                "Lights whose size, cone or spread is not finite are left out ({}): set it anew",
                name,
            )
            return None
        strength = light_strength(data, shape)
        if not math.isfinite(strength):
            self.report.note(
                "Lights whose power is not finite are left out ({}): set their power", name
            )
            return None
        emission = Emission()
        if read_tree(data).tree is not None:
            lamp = _lamp(data, frame, matrix, shape)
            emission = trees.get(lamp.key) or self._emission(name, data, lamp)
            if emission.is_shared:
                trees[lamp.key] = emission
        color = self._color(name, data, emission)
        if not strength or not any(color):
            self.report.note(
                "Lights without power or of black colour shed no light ({}): set them, or hide the "
                "lights",
                name,
            )
        return Light(
            name,
            data.type,
            frame,
            color,
            strength,
            cast_shadow=data.use_shadow,
            visible_camera=flags.camera,
            visible_mirror=flags.mirror,
            visible_transmission=flags.transmission,
            receivers=flags.receivers,
            blockers=flags.blockers,
            lights_matt=flags.diffuse,
            lights_gloss=flags.mirror,
            lights_media=flags.media,
            program=emission.program,
            textures=emission.textures,
            light_group=light_group,
            **shape,
        )

    def _color(self, name: str, data: Any, emission: Emission) -> RGB:
        """Colour times temperature times what the light's nodes emit everywhere; a channel that is
        not finite counts as 0.
        """
        color = list(data.color)
        if FARTHEST in map(abs, color):
            self.report.note(INFINITE, name)
        if getattr(data, "use_temperature", False):
            color = [a * b for a, b in zip(color, data.temperature_color, strict=True)]
        color = [a * b for a, b in zip(color, emission.color, strict=True)]
        if not all(map(math.isfinite, color)):
            self.report.note(
                "Lights have a colour that is not finite ({}): its bad channels are black; set it "
                "anew",
                name,
            )
        return tuple(x if math.isfinite(x) else 0.0 for x in color)

    def _emission(self, name: str, data: Any, lamp: Lamp) -> Emission:
        """What the light's node tree multiplies its colour by."""
        read = read_tree(data)
        surface = end_of(read.tree, "Surface")
        if surface is None:
            self.report.note(
                "Lights without an output node shed no light ({}): add a Light Output", name
            )
            return Emission(BLACK)
        readers: list[LampReader] = []

        def reader(*given: Any) -> LampReader:
            readers.append(LampReader(*given, lamp=lamp))
            return readers[-1]

        evaluator = Evaluator(name, self.images, self.report, reader)
        self.images.expect(images_behind(surface))
        terms = evaluator.closure(surface).get(LobeKey("EMISSION"), ())
        value = evaluator.expressions.value_of(terms)
        if value.constant is not None:
            return Emission(value.constant)
        program = compile_program(evaluator.expressions.graph, [value])
        textures = tuple(self.images.textures[k] for k in program.textures)
        own = program.with_textures({k: i for i, k in enumerate(program.textures)})
        is_shared = not any(one.is_turned for one in readers)
        return Emission(program=own, textures=textures, is_shared=is_shared)

    def _note_approximations(self, name: str, data: Any) -> None:
        if data.type == "AREA" and not data.size * _size_up(data):
            self.report.note(
                "Area lights without a size ({}) shine here, but not in Cycles: give them one", name
            )


def light_frame(matrix: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """The right-handed orthonormal frame (3, 4) of a light, its -z where the light shines, and the
    lengths (3,) of the matrix's columns.

    The frame is None where an axis has no length.
    """
    axes, lengths = matrix[:, :3], np.linalg.norm(matrix[:, :3], axis=0)
    if not (lengths > 0).all():
        return None, lengths
    z = axes[:, 2] / lengths[2]
    x = axes[:, 0] / lengths[0]
    x = x - z * (x @ z)
    if not np.linalg.norm(x) > 1e-6:
        return None, lengths
    x = x / np.linalg.norm(x)
    return np.array([x, crossed(z, x), z, matrix[:, 3]]).T.copy(), lengths


def _portal(data: Any, matrix: np.ndarray) -> np.ndarray:
    """(4, 3) rows of `Openings`: the sky is on the side to which the lamp does not shine. Round
    ones are what bounds them.
    """
    frame, lengths = light_frame(matrix)
    if frame is None:
        return np.zeros((4, 3))
    half = data.size * lengths[0] / 2, _size_up(data) * lengths[1] / 2
    return np.stack([frame[:, 3], half[0] * frame[:, 0], half[1] * frame[:, 1], frame[:, 2]])


def _is_small(length: float) -> bool:
    """Whether it is finite, also as Blender keeps numbers that are not: as the largest there is."""
    return math.isfinite(length) and abs(length) < FARTHEST


def _is_sheared(matrix: np.ndarray, lengths: np.ndarray) -> bool:
    """Whether axes of these lengths stand aslant on each other."""
    axes = matrix[:, :3] / lengths
    return bool(np.abs(axes.T @ axes - np.eye(3)).max() > _ASLANT)


def _lamp(data: Any, frame: np.ndarray, matrix: np.ndarray, shape: dict[str, Any]) -> Lamp:
    """The light as its nodes see it; a POINT that is scaled to nothing has its own axes."""
    axes = matrix[:, :3]
    object_from_light = normals_to_world = np.eye(3)
    if np.linalg.det(axes) != 0:
        back = inverse_axes(axes)
        object_from_light, normals_to_world = back @ frame[:, :3], back.T
    return Lamp(
        data.type,
        object_from_light,
        (shape.get("size_x", 0.0), shape.get("size_y", 0.0)),
        shape.get("spot_size", 0.0),
        frame[:, :3].T if data.type == "SPOT" else None,
        normals_to_world,
    )


def _shape(data: Any, lengths: np.ndarray) -> dict[str, Any]:
    """The fields of `Light` that say how large it is. Radii are world lengths, whatever the
    object's scale, as in Cycles.
    """
    if data.type == "SUN":
        return {"angle": data.angle}
    if data.type == "AREA":
        shape = "ELLIPSE" if data.shape in ("DISK", "ELLIPSE") else "RECTANGLE"
        return {
            "shape": shape,
            "size_x": data.size * float(lengths[0]),
            "size_y": _size_up(data) * float(lengths[1]),
            "spread": data.spread,
        }
    soft = {
        "radius": data.shadow_soft_size,
        "soft_falloff": bool(getattr(data, "use_soft_falloff", False)),
    }
    return (
        {**soft, "spot_size": _cone(data.spot_size, lengths), "spot_blend": data.spot_blend}
        if data.type == "SPOT"
        else soft
    )


def _size_up(data: Any) -> float:
    """An area light's size along y."""
    return data.size if data.shape in ("SQUARE", "DISK") else data.size_y


def _cone(angle: float, lengths: np.ndarray) -> float:
    """The full angle of a spot whose cone is scaled with its object, as in Cycles; where x and y
    differ, of a round cone that is as large.

    The cone's edge is exact; what is between a blended edge and the axis follows the cosine of the
    unscaled cone in Cycles.
    """
    across = math.sqrt(lengths[0] * lengths[1])
    if _same(across, lengths[2]):
        return angle
    # Blender's float32 half circle is a little more
    return 2 * math.atan2(math.sin(angle / 2) * across, math.cos(angle / 2) * lengths[2])


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= _SAME_LENGTH * max(a, b)


def light_strength(data: Any, shape: dict[str, Any]) -> float:
    """Power times 2^exposure; where the light is not normalised, times the area by which
    normalising would divide.
    """
    strength = data.energy * 2.0 ** getattr(data, "exposure", 0.0)
    return strength if getattr(data, "normalize", True) else strength * _area(data.type, shape)


def _area(kind: str, shape: dict[str, Any]) -> float:
    """Cycles' measure of a light: its surface in m², or the sun's projected solid angle; that of a
    light of no extent is a convention.
    """
    if kind == "SUN":
        return math.pi * math.sin(shape["angle"] / 2) ** 2 or 1.0
    if kind == "AREA":
        return (
            shape["size_x"]
            * shape["size_y"]
            * (math.pi / 4 if shape["shape"] == "ELLIPSE" else 1.0)
        )
    return 4 * math.pi * shape["radius"] ** 2 or 4.0
