"""Blender materials to `engine.scene.Material`: a sum of lobes each, and what the meshes that wear
them must bring along.
"""

from __future__ import annotations

import functools
import operator
from dataclasses import replace
from typing import Any

import numpy as np

from ....engine.program.graph import Value
from ....engine.program.table import BY_NAME
from ....engine.scene import LOBES, Lobe, Material, Medium, Texture
from ..geometry.meshes import MeshSource
from ..geometry.volumes import Volume
from ..images.images import Images
from ..report import Report
from ..shader_nodes import TreeReader
from ..shader_nodes.volume import VolumeReader
from ..unheard import is_corrected, note_material
from . import nodes_color, nodes_hair, nodes_principled, nodes_shader, nodes_texture  # noqa: F401  (they fill the evaluator's tables)
from .aovs import Aov, aov_material
from .displacing import Displacement, compile_displacement, method_of, wanted_objects
from .evaluator import (
    NOT_FINITE,
    PASSED,
    Closure,
    Evaluator,
    LobeKey,
    add_closures,
    is_finite,
    scale_closure,
    without_normals,
)
from .expressions import Expressions
from .graph import Place, images_behind, output_of, read_tree, socket_named
from .nodes_principled import plastic_closure
from .nodes_shader import diffuse_closure, glossy_closure
from .nodes_volume import STEP, VOLUMES, default_volume, medium_of, medium_of_closure
from .terms import complement, constant, constant_value, factors_of, multiply
from .varying import Ior, Roughness
from .wanted import Wanted, read_by


class Materials:
    """The materials of one scene, each compiled once."""

    def __init__(self, images: Images, report: Report, aovs: tuple[Aov, ...] = ()) -> None:
        self.materials: list[Material] = []
        self.aovs = aovs
        self.images, self.report = images, report
        self._indices: dict[int, int] = {}
        self._wanted: list[Wanted] = []
        self._displacements: list[Displacement | None] = []
        self._surfaces: dict[int, MeshSource | None] = {}  # of Volume objects, by their materials

    def index(self, material: Any) -> int:
        """Index of an evaluated Blender material; of Blender's default surface for None."""
        key = material.as_pointer() if material is not None else 0
        if key not in self._indices:
            self._indices[key] = len(self.materials)
            compiled = (
                compile_material(material, self.images, self.report)
                if material is not None
                else default_material()
            )
            if self.aovs and material is not None:
                given = aov_material(material, self.aovs, self.images, self.report)
                compiled = replace(compiled, aovs=given)
            self.materials.append(compiled)
            moves = compile_displacement(material, self.images, self.report)
            self._wanted.append(wanted_by(compiled) | wanted_objects(moves))
            self._displacements.append(moves)
        return self._indices[key]

    def volume(self, material: Any, volume: Volume) -> tuple[int, MeshSource | None]:
        """Index of an evaluated Blender material, None for none, as a Volume object wears it, and
        what surrounds all that is in it.
        """
        key = (material.as_pointer() if material is not None else 0, volume.key)
        if key not in self._indices:
            number = self._indices[key] = len(self.materials)
            compiled, self._surfaces[number] = compile_volume(
                material, volume, self.images, self.report
            )
            self.materials.append(compiled)
            self._wanted.append(wanted_by(compiled))
            self._displacements.append(None)
        return self._indices[key], self._surfaces[self._indices[key]]

    def wanted(self, indices: tuple[int, ...]) -> Wanted:
        """What the materials with these indices read from a mesh."""
        return functools.reduce(operator.or_, (self._wanted[index] for index in indices), Wanted())

    @property
    def sampled(self) -> Wanted:
        """What rays of the materials read of all meshes."""
        names = (name for wanted in self._wanted for name in wanted.everywhere)
        return Wanted(attributes=frozenset(names))

    def displacements(self, indices: tuple[int, ...]) -> tuple[Displacement | None, ...]:
        """How the materials with these indices move vertices; empty where none does."""
        found = tuple(self._displacements[index] for index in indices)
        return found if any(found) else ()


def default_material() -> Material:
    """Blender's surface for things without a material: grey, diffuse before 5.0 and a default
    Principled from then on, as in Cycles.
    """
    import bpy

    grey = constant(0.8)
    closure = (
        diffuse_closure(grey)
        if bpy.app.version < (5, 0, 0)
        else plastic_closure(grey, constant(1.0), Roughness(0.5), Ior(1.5), True)
    )
    return Material("default_surface", lobes_of(closure))  # as Cycles calls it


def compile_material(material: Any, images: Images, report: Report) -> Material:
    """One Blender material as lobes."""
    reader = functools.partial(TreeReader, material_index=material.pass_index)
    evaluator = Evaluator(material.name, images, report, reader)
    read = read_tree(material)
    tree = read.tree
    closure = (
        _surface(tree, evaluator, method_of(material))
        if tree is not None
        else _viewport_surface(material, evaluator)
    )
    normal, base, is_bumped = evaluator.normals(closure)
    kinds = {key.kind for key in closure}
    is_bumped = is_bumped or any(key.normal_output >= 0 for key in closure)
    note_material(material, kinds, is_bumped, report)
    passed = passed_by_light(closure, evaluator)
    closure = {key: terms for key, terms in closure.items() if key.kind != PASSED}
    if getattr(material, "use_transparent_shadow", True):
        closure = add_closures(closure, passed)
    lobes = lobes_of(evaluator.settled(without_normals(closure)))
    medium = _inside(tree, material, images, report)
    return evaluator.expressions.with_program(
        Material(
            material.name,
            lobes,
            material.pass_index,
            normal_output=normal,
            medium=medium,
            bump_shadowing=bump_shadowing(material) if is_bumped else "NONE",
            base_normal_output=base if is_bumped else -1,
        )
    )


def bump_shadowing(material: Any) -> str:
    """How Cycles of this Blender hides light by bumps (`engine.scene.BUMP_SHADOWING`)."""
    import bpy

    if not is_corrected(material):
        return "SIDES"
    return "GGX" if bpy.app.version >= (4, 5, 0) else "CHIANG"


def compile_volume(
    material: Any, volume: Volume, images: Images, report: Report
) -> tuple[Material, MeshSource | None]:
    """What fills a Volume object, which has no surface of its own, and what surrounds it; None
    where nothing does. material: None for none.
    """
    name = material.name if material is not None else "default_volume"
    number = material.pass_index if material is not None else 0
    reader = functools.partial(VolumeReader, material_index=number, volume=volume)
    evaluator = Evaluator(name, images, report, reader)
    if material is None:
        closure = default_volume(evaluator)
    else:
        tree = read_tree(material).tree
        output = output_of(tree) if tree is not None else None
        place = Place(socket_named(output.inputs, "Volume")) if output is not None else None
        closure = {}
        if place is not None and place.socket.is_linked:
            images.expect(images_behind(place))
            closure = evaluator.closure(place)
    medium = medium_of_closure(closure, evaluator, STEP)
    surface = volume.surface(medium.emits) if medium is not None else None
    if volume.lacks_all:
        report.note(
            "Volume objects without the grids that their materials read show nothing: {}; name one "
            "of their own there",
            volume.name,
        )
    if surface is not None and medium.program is not None:
        sides = np.ptp(surface.mesh.vertices.astype(np.float64), 0).mean()
        rate = getattr(getattr(material, "cycles", None), "volume_step_rate", 1.0)
        step = volume.step_size or volume.voxel()
        medium = replace(medium, step=max(float(step / sides) * rate, 1e-6))
    lobes = lobes_of({LobeKey("TRANSPARENT"): constant(1.0)})
    return Material(name, lobes, number, medium=medium if surface else None), surface


def passed_by_light(closure: Closure, evaluator: Evaluator) -> Closure:
    """Light passes glass straight on: what refracts is transparent to rays towards lights; and so
    does what hair lets through to strands behind.

    A pane lets through what it does in the world; of the light that a body bends, caustics, as much
    arrives on average.
    """
    passed: Closure = {}
    for key, terms in closure.items():
        if key.kind in ("REFRACTION", PASSED):
            share = evaluator.expressions.sum_of(_passing(key, evaluator.expressions))
            clear = LobeKey("TRANSPARENT", between_fibres=key.kind == PASSED)
            passed = add_closures(passed, {clear: multiply(evaluator.limited(terms), share)})
    return passed


def _passing(key: LobeKey, expressions: Expressions) -> Value:
    """The share of light that a refracting lobe passes on straight: of rays to lights what Fresnel
    leaves of them, which a ray that goes out of a pane meets at the angle at which it came in.
    """
    do, math = expressions.apply, expressions.math
    shadow = expressions.graph.apply(BY_NAME["light_path"])[1]
    if not key.fresnel:
        return shadow
    ior = (
        expressions.value_at(key.ior_output)
        if key.ior_output >= 0
        else expressions.constant(key.ior)
    )
    turned = math("SUBTRACT", math("DIVIDE", 1.0, ior), ior)
    outer = math("ADD", ior, math("MULTIPLY", do("backfacing"), turned))
    reflected = do("fresnel", outer, do("normal"))
    return math("MULTIPLY", shadow, math("SUBTRACT", 1.0, reflected))


def _inside(tree: Any, material: Any, images: Images, report: Report) -> Medium | None:
    """What its volume is."""
    output = output_of(tree) if tree is not None else None
    place = Place(socket_named(output.inputs, "Volume")) if output is not None else None
    if place is None or not place.socket.is_linked:
        return None
    images.expect(images_behind(place))
    reader = functools.partial(VolumeReader, material_index=material.pass_index)
    rate = getattr(getattr(material, "cycles", None), "volume_step_rate", 1.0)
    return medium_of(place, Evaluator(material.name, images, report, reader), STEP * rate)


def _surface(tree: Any, evaluator: Evaluator, method: str) -> Closure:
    """What the active output shows, as in Cycles: black without one; what is but the bounds of a
    volume lets everything through. method: of its displacement.
    """
    output = output_of(tree)
    if output is None:
        evaluator.note("Materials without an output node are black: {}; add a Material Output")
        return {}
    socket, volume = (socket_named(output.inputs, name) for name in ("Surface", "Volume"))
    displacement = Place(socket_named(output.inputs, "Displacement"))
    if method == "BUMP":
        evaluator.displace(displacement)
    else:
        evaluator.displace_vertices(displacement, bumps=method == "BOTH")
    if volume.is_linked and not socket.is_linked:
        return {LobeKey("TRANSPARENT"): constant(1.0)}
    if not socket.is_linked:
        evaluator.note(
            "Materials without a surface are black: {}; link a shader to Surface of the output, or "
            "choose the node group that is missing"
        )
        return {}
    surface = Place(socket)
    evaluator.images.expect(images_behind(surface))
    closure = evaluator.closure(surface)
    if any(key.kind in VOLUMES for key in closure):
        evaluator.note("Volume shaders on surfaces show nothing: link those of {} to Volume")
    return {key: terms for key, terms in closure.items() if key.kind not in VOLUMES}


def _viewport_surface(material: Any, evaluator: Evaluator) -> Closure:
    """A material without nodes: its viewport colour, metallic and roughness, as Principled would
    take them.
    """
    if not is_finite((*material.diffuse_color, material.metallic, material.roughness)):
        evaluator.note(NOT_FINITE)
    color, metallic = constant(tuple(material.diffuse_color)[:3]), constant(material.metallic)
    closures = (
        scale_closure(
            glossy_closure(color, constant_value(color), Roughness(material.roughness), True),
            metallic,
        ),
        scale_closure(diffuse_closure(color), complement(metallic)),
    )
    return add_closures(*closures)


def lobes_of(closure: Closure) -> tuple[Lobe, ...]:
    """The lobes of a closure in the order of `engine.scene.LOBES`; none of weight 0."""
    ordered = sorted(
        closure.items(),
        key=lambda item: (
            LOBES.index(item[0].kind),
            item[0].exponent,
            item[0].ior,
            item[0].schlick,
            item[0].exponent_output,
            item[0].ior_output,
            item[0].normal_output,
            item[0].stretch_output,
        ),
    )
    return tuple(_lobe(key, factors_of(term)) for key, terms in ordered for term in terms)


def _lobe(key: LobeKey, factors: tuple) -> Lobe:
    return Lobe(
        key.kind,
        factors,
        key.exponent,
        key.ior,
        key.fresnel,
        key.schlick,
        key.masking,
        key.exponent_output,
        key.masking_output,
        key.ior_output,
        key.fibre_output,
        key.normal_output,
        key.stretch_output,
        key.between_fibres,
    )


def wanted_by(material: Material) -> Wanted:
    """The attributes that a material's inputs name."""
    inputs = [factor for lobe in material.lobes for factor in lobe.factors]
    uv_maps = frozenset(factor.uv for factor in inputs if factor.texture >= 0)
    attributes = frozenset(factor.attribute for factor in inputs if factor.attribute)
    own = Wanted(uv_maps, attributes) | read_by(material.program)
    if material.medium is not None:
        own |= read_by(material.medium.program)
    return own | wanted_by(material.aovs) if material.aovs is not None else own


def without_unused(
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

    kept = tuple(with_textures(material, numbers) for material in materials)
    return kept, tuple(textures[old] for old in used)


def with_textures(material: Material, numbers: dict[int, int]) -> Material:
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
        aovs=with_textures(material.aovs, numbers) if material.aovs is not None else None,
        medium=material.medium.with_textures(numbers) if material.medium is not None else None,
    )
