"""Materials as they were compiled, each by itself, and joined to those of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from ....engine.scene import Lobe, Material, Texture
from ..geometry.meshes import MeshSource
from ..images.cache import TextureKey
from ..report import Report
from .displacing import Displacement
from .wanted import Wanted


class MaterialKey(NamedTuple):
    """Of a material, or of none. uid: its session uid, 0 for none.  volume: `Volume.key` of the
    Volume object that wears it.
    """

    uid: int = 0
    volume: tuple | None = None


@dataclass(frozen=True, eq=False)
class Compiled:
    """A material whose inputs name places of `textures`, (key, texture) in the order in which
    compiling met them.

    tree: address of the material's own node tree, 0 without one.  reads_memory: an image whose
    pixels only Blender has. displacement: how it moves vertices. report: of compiling it.
    surface: round the Volume object that it is compiled for.
    """

    material: Material
    tree: int
    reads_memory: bool
    textures: tuple[tuple[TextureKey, Texture], ...]
    wanted: Wanted
    displacement: Displacement | None
    report: Report
    surface: MeshSource | None = None

    def asks_as(self, other: Compiled) -> bool:
        """Whether it reads the same of meshes, and moves them alike."""
        return (self.wanted, self.displacement) == (other.wanted, other.displacement)


class MaterialCache:
    """Materials as they were compiled last. For exports that want the same AOVs."""

    def __init__(self) -> None:
        self.compiled: dict[MaterialKey, Compiled] = {}
        self._joined: tuple[tuple[Compiled, ...], tuple[Material, ...], tuple[Texture, ...]] = (
            (),
            (),
            (),
        )

    def joined(
        self, used: tuple[Compiled, ...]
    ) -> tuple[tuple[Material, ...], tuple[Texture, ...]]:
        """Materials and textures of a scene; the very same values for the same materials."""
        if self._joined[0] != used:
            self._joined = used, *_joined(used)
        return self._joined[1:]

    def forget(self, gone: Sequence[MaterialKey]) -> None:
        self.compiled = {key: kept for key, kept in self.compiled.items() if key not in gone}


def _joined(used: tuple[Compiled, ...]) -> tuple[tuple[Material, ...], tuple[Texture, ...]]:
    numbers: dict[TextureKey, int] = {}
    textures: list[Texture] = []
    materials: list[Material] = []
    for compiled in used:
        for key, texture in compiled.textures:
            if key not in numbers:
                numbers[key] = len(textures)
                textures.append(texture)
        own = [numbers[key] for key, _ in compiled.textures]
        materials.append(
            _with_textures(compiled.material, {-1: -1, **dict(enumerate(own))})
            if own
            else compiled.material
        )
    return _without_unused(materials, textures)


def _without_unused(
    materials: list[Material], textures: list[Texture]
) -> tuple[tuple[Material, ...], tuple[Texture, ...]]:
    """Materials and textures with only the textures that a lobe reads, renumbered: some were only
    made for their mean.
    """
    every = [*materials, *(m.aovs for m in materials if m.aovs is not None)]
    used = sorted(
        {factor.texture for m in every for lobe in m.lobes for factor in lobe.factors}
        | {texture for m in every if m.program for texture in m.program.textures}
        | {k for m in every if m.medium and m.medium.program for k in m.medium.program.textures}
    )
    used = [texture for texture in used if texture >= 0]
    numbers = {-1: -1, **{old: new for new, old in enumerate(used)}}

    kept = tuple(_with_textures(material, numbers) for material in materials)
    return kept, tuple(textures[old] for old in used)


def _with_textures(material: Material, numbers: dict[int, int]) -> Material:
    """The material with other numbers of textures."""

    def renumbered(lobe: Lobe) -> Lobe:
        return replace(
            lobe,
            factors=tuple(
                replace(factor, texture=numbers[factor.texture]) for factor in lobe.factors
            ),
        )

    return replace(
        material,
        lobes=tuple(renumbered(lobe) for lobe in material.lobes),
        program=material.program.with_textures(numbers) if material.program else None,
        aovs=_with_textures(material.aovs, numbers) if material.aovs is not None else None,
        medium=material.medium.with_textures(numbers) if material.medium is not None else None,
    )
