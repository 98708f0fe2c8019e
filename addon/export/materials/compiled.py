"""Materials as they were compiled, each by itself, and joined to those of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from ....engine.scene import Lobe, Material, Texture
from ..geometry.meshes import MeshSource
from ..images.cache import TextureKey
from ..report import Report
from .aovs import Aov
from .displacing import Displacement
from .required import RequiredAttributes


class MaterialKey(NamedTuple):
    """Of a material, or of none. uid: its session uid, 0 for none.  volume: `Volume.key` of the
    Volume object that uses it.  aovs: that it is compiled for.
    """

    uid: int = 0
    volume: tuple | None = None
    aovs: tuple[Aov, ...] = ()


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
    required: RequiredAttributes
    displacement: Displacement | None
    report: Report
    surface: MeshSource | None = None

    def asks_as(self, other: Compiled) -> bool:
        """Whether it reads the same of meshes, and moves them alike."""
        return (self.required, self.displacement) == (other.required, other.displacement)


class MaterialCache:
    """Materials as they were compiled last."""

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
    """With only the textures that something reads, in the order in which they were met: some were
    only made for their mean.
    """
    textures = {key: texture for compiled in used[::-1] for key, texture in compiled.textures}
    met = dict.fromkeys(key for compiled in used for key, _ in compiled.textures)
    places = [_places_read(compiled.material) for compiled in used]
    read = {c.textures[k][0] for c, own in zip(used, places, strict=True) for k in own}
    kept = [key for key in met if key in read]
    numbers = {key: number for number, key in enumerate(kept)}
    materials = tuple(
        _with_textures(c.material, {-1: -1, **{k: numbers[c.textures[k][0]] for k in own}})
        if own
        else c.material
        for c, own in zip(used, places, strict=True)
    )
    return materials, tuple(textures[key] for key in kept)


def _places_read(material: Material) -> set[int]:
    """Which of its textures its lobes and programs read, those for AOVs too."""
    every = [material, *([material.aovs] if material.aovs is not None else [])]
    programs = [m.program for m in every]
    programs += [m.medium.program for m in every if m.medium is not None]
    factors = {factor.texture for m in every for lobe in m.lobes for factor in lobe.factors}
    return factors.union(*(p.textures for p in programs if p is not None)) - {-1}


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
