"""Nodes of a volume: what fills a thing, or the world, at a point inside. There is no surface: its
normal is the direction from which the point is seen, as in Cycles' worlds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....engine.program.graph import Value
from ....engine.program.operations_input import Space, VectorType
from ....engine.scene import Texture
from ..materials.terms import GREY
from .bare import BareReader
from .objects import SPACE_SCALE, SPACE_START
from .reader import READERS, NodeInputs, Outputs, TreeReader

if TYPE_CHECKING:
    from ..geometry.volumes import Grid, Volume

OfVoxels = Callable[[np.ndarray], np.ndarray]
"""(x, y, z) float32 to (x, y, z, 3) float32."""
_LAYERS = 3
"""Of a grid of numbers that a tile of its texture holds: its fourth channel is the next tile's
first.
"""


class VolumeReader(BareReader):
    """Reads the tree of a volume, which has its object's place and properties but not its mesh's
    attributes: they are 0 in Cycles too. volume: of a Volume object, the grids that are its
    attributes.
    """

    gives_light_alone = False

    def __init__(
        self, *read: Any, is_world: bool = False, volume: Volume | None = None, **more: Any
    ) -> None:
        super().__init__(*read, **more)
        self.is_world, self._volume = is_world, volume

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        if name == "instance_value" and not self.is_world:
            return TreeReader.apply(self, name, *arguments, **settings)
        if name == "attribute" and self._volume is not None:
            found = self.grid(str(settings["attribute"]).removeprefix(GREY))
            if found is not None:
                return self._filled(found), self.graph.constant(1.0)
        return super().apply(name, *arguments, **settings)

    def generated(self) -> Value:
        """Coordinates from 0 to 1 in the texture space of the object's mesh; of a world the
        place.
        """
        place = self.apply("object_position", shift=0)[0]
        if self.is_world:
            return place
        scale, start = (
            self.apply("instance_value", attribute=name)[0] for name in (SPACE_SCALE, SPACE_START)
        )
        scaled = self.apply("product", place, scale)[0]
        return self.apply("scaled_sum", scaled, self.graph.constant(1.0), start)[0]

    def normal(self) -> Value:
        return self.apply("normal")[0]

    def ray_depth(self) -> None:
        """Points inside do not know how often a ray bounced."""

    def grid(self, name: str, of: OfVoxels | None = None, recipe: tuple = ()) -> Value | None:
        """What a grid of the Volume object is at the point, between its voxels straight along each
        axis, 0 beyond them; a number or a vector, None where it has no such grid.  of: the vector
        that each number stands for, which is what is straight between voxels; None where they are
        no numbers.  recipe: all that this depends on.
        """
        found = self._volume.grid(name) if self._volume is not None else None
        if found is None or (of is not None and found.values.ndim == 4):
            return None
        layers = 1 if found.values.ndim == 4 or of is not None else _LAYERS
        columns = math.ceil(math.sqrt(_tiles(found, layers)))
        key = ("VDB", self._volume.key, name, recipe)

        def tiles() -> Texture:
            made = found if of is None else replace(found, values=of(found.values))
            return _texture(name, made, layers, columns)

        texture = self.images.made(key, tiles)
        return self._mixed(found, texture, layers, columns)

    def _mixed(self, grid: Grid, texture: int, layers: int, columns: int) -> Value:
        do, apply, constant = self.arithmetic(), self.apply, self.graph.constant
        size = grid.values.shape[:3]
        axes = np.linalg.inv(np.vstack([grid.object_from_index, [0, 0, 0, 1]]))
        start = axes[:3, 3] - grid.low
        at = constant(tuple(start))
        for k, part in enumerate(apply("separate_xyz", apply("object_position", shift=0)[0])):
            at = apply("scaled_sum", constant(tuple(axes[:3, k])), part, at)[0]
        most = tuple(float(n - 1) for n in size)
        at = apply("bounded", at, constant((0.0,) * 3), constant(most))[0]
        x, y, z = apply("separate_xyz", at)
        height = math.ceil(_tiles(grid, layers) / columns) * size[1]

        def texel(tile: Value) -> tuple[Value, ...]:
            row = do("FLOOR", do("DIVIDE", do("ADD", tile, 0.5), float(columns)))
            column = do("SUBTRACT", tile, do("MULTIPLY", row, float(columns)))
            u = do("DIVIDE", do("ADD", do("MULTIPLY_ADD", column, float(size[0]), x), 0.5),
                   float(columns * size[0]))  # fmt: skip
            v = do("DIVIDE", do("ADD", do("MULTIPLY_ADD", row, float(size[1]), y), 0.5),
                   float(height))  # fmt: skip
            place = apply("combine_xyz", u, v, constant(0.0))[0]
            return apply("image", place, texture=texture)

        last = float(max(_tiles(grid, layers) - 1, 0))
        tile = do("MINIMUM", do("FLOOR", do("DIVIDE", z, float(layers))), last)
        beyond = do("SUBTRACT", z, do("MULTIPLY", tile, float(layers)))
        color, fourth = texel(tile)
        if layers == 1:
            other, _ = texel(do("MINIMUM", do("ADD", tile, 1.0), last))
            less = do("SUBTRACT", 1.0, beyond)
            rest = apply("scaled_sum", color, less, constant((0.0,) * 3))[0]
            return apply("scaled_sum", other, beyond, rest)[0]
        total = constant(0.0)
        for k, part in enumerate((*apply("separate_xyz", color), fourth)):
            apart = do("ABSOLUTE", do("SUBTRACT", beyond, float(k)))
            total = do("MULTIPLY_ADD", do("MAXIMUM", do("SUBTRACT", 1.0, apart), 0.0), part, total)
        return total

    def _filled(self, value: Value) -> Value:
        return value if value.width == 3 else self.apply("combine_xyz", value, value, value)[0]

    def thinned(self) -> Value | None:
        """How much thinner a Volume object is for its size, None where it is not: as long as the
        diagonal of its object's space gets in the world, as in Cycles.
        """
        if self._volume is None or not self._volume.is_scaled:
            return None
        unit = self.graph.constant((1 / math.sqrt(3),) * 3)
        spaces = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}
        turned = self.apply("transform_vector", unit, vector_type=VectorType.VECTOR, **spaces)[0]
        return self.arithmetic()("DIVIDE", 1.0, self.apply("vector_length", turned)[0])


def _tiles(grid: Grid, layers: int) -> int:
    """How many tiles hold the layers of a grid."""
    return grid.values.shape[2] if layers == 1 else math.ceil((grid.values.shape[2] - 1) / layers)


def _texture(name: str, grid: Grid, layers: int, columns: int) -> Texture:
    """A grid as tiles of its layers, a row of them after the other."""
    x, y = grid.values.shape[:2]
    count = _tiles(grid, layers)
    rows = math.ceil(count / columns)
    pixels = np.zeros((rows, y, columns, x, 4), np.float32)
    for tile in range(count):
        row, column = divmod(tile, columns)
        if layers == 1:
            pixels[row, :, column, :, :3] = grid.values[:, :, tile].transpose(1, 0, 2)
            continue
        part = grid.values[:, :, tile * layers : tile * layers + 4].transpose(1, 0, 2)
        pixels[row, :, column, :, : part.shape[2]] = part
    return Texture(name, pixels.reshape(rows * y, columns * x, 4), extension="EXTEND")


def _volume_info(view: NodeInputs) -> Outputs:
    """Grids of the names that Blender's simulations give them."""
    reader, zero = view.reader, view.reader.graph.constant(0.0)

    def told(name: str) -> Value:
        found = reader.grid(name) if isinstance(reader, VolumeReader) else None
        return zero if found is None else found

    color = told("color")
    return {
        "Color": color if color.width == 3 else view.vector_of(color),
        "Density": told("density"),
        "Flame": told("flame"),
        "Temperature": told("temperature"),
    }


READERS["ShaderNodeVolumeInfo"] = _volume_info
