"""Blender materials to `engine.scene.Material`: a sum of lobes each, and what the meshes that wear
them must bring along.
"""

from __future__ import annotations

import functools
import operator
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ....engine.closures import KINDS
from ....engine.program.graph import Value
from ....engine.program.table import BY_NAME
from ....engine.scene import Lobe, Material, Medium, Texture
from ..cache import ExportCache
from ..geometry.meshes import MeshSource
from ..geometry.volumes import Volume
from ..images.decoded import Decoded
from ..images.images import Images
from ..report import Report
from ..shader_nodes import TreeReader
from ..shader_nodes.volume import VolumeReader
from ..unsupported import is_corrected, note_material
from . import (  # noqa: F401  (they fill the evaluator's tables)
    nodes_color,
    nodes_hair,
    nodes_principled,
    nodes_shader,
    nodes_sheen,
    nodes_texture,
    nodes_toon,
)
from .aovs import Aov, aov_material
from .closures import Closure, LobeKey, add_closures, scale_closure, without_normals
from .compiled import Compiled, MaterialKey
from .displacing import Displacement, compile_displacement, method_of, wanted_objects
from .evaluator import NOT_FINITE, Evaluator, is_finite
from .expressions import Expressions
from .graph import end_of, images_behind, is_fed, node_tree, read_tree
from .multiscatter import GRAZING, share_of
from .nodes_principled import plastic_closure
from .nodes_shader import diffuse_closure, glossy_closure
from .nodes_volume import STEP, VOLUMES, default_volume, medium_of, medium_of_closure
from .required import RequiredAttributes, read_by
from .terms import complement, constant, constant_value, factors_of, multiply
from .varying import Ior, Roughness


class Materials:
    """The materials of one scene, each compiled once, most of them by exports before."""

    def __init__(
        self,
        cache: ExportCache,
        decoded: Decoded | None = None,
        aovs: tuple[Aov, ...] = (),
    ) -> None:
        self.aovs = aovs
        self._cache, self._decoded = cache, decoded
        self._numbers: dict[MaterialKey, int] = {}
        self._at: dict[int, int] = {}  # numbers by addresses, which are quick to ask for
        self._used: list[Compiled] = []

    def index(self, material: Any) -> int:
        """Index of an evaluated Blender material; of Blender's default surface for None."""
        address = material.as_pointer() if material is not None else 0
        if address not in self._at:
            self._at[address] = self._number(MaterialKey(_uid(material), aovs=self.aovs), material)
        return self._at[address]

    def volume(self, material: Any, volume: Volume) -> tuple[int, MeshSource | None]:
        """Index of an evaluated Blender material, None for none, as a Volume object wears it, and
        what surrounds all that is in it.
        """
        number = self._number(MaterialKey(_uid(material), volume.key, self.aovs), material, volume)
        return number, self._used[number].surface

    def numbered(self, key: MaterialKey, material: Any) -> Compiled | None:
        """Number a material after those before it; None where it is neither known nor given."""
        if key not in self._cache.materials.compiled and material is None:
            return None
        return self._used[self._number(key, material)]

    @property
    def sources(self) -> tuple[tuple[MaterialKey, Compiled], ...]:
        """All of them in their order."""
        return tuple(zip(self._numbers, self._used, strict=True))

    @property
    def report(self) -> Report:
        """Of compiling them."""
        report = Report()
        for compiled in self._used:
            report.add(compiled.report)
        return report

    def joined(self) -> tuple[tuple[Material, ...], tuple[Texture, ...]]:
        """Materials and textures of the scene."""
        return self._cache.materials.joined(tuple(self._used))

    def required(self, indices: tuple[int, ...]) -> RequiredAttributes:
        """What the materials with these indices read from a mesh."""
        found = (self._used[index].required for index in indices)
        return functools.reduce(operator.or_, found, RequiredAttributes())

    @property
    def sampled(self) -> RequiredAttributes:
        """What rays of the materials read of all meshes."""
        names = (name for compiled in self._used for name in compiled.required.everywhere)
        return RequiredAttributes(attributes=frozenset(names))

    def displacements(self, indices: tuple[int, ...]) -> tuple[Displacement | None, ...]:
        """How the materials with these indices move vertices; empty where none does."""
        found = tuple(self._used[index].displacement for index in indices)
        return found if any(found) else ()

    def _number(self, key: MaterialKey, material: Any, volume: Volume | None = None) -> int:
        if key not in self._numbers:
            known = self._cache.materials.compiled
            if key not in known:
                known[key] = self._compiled(material, volume, key.aovs)
            self._numbers[key] = len(self._used)
            self._used.append(known[key])
        return self._numbers[key]

    def _compiled(self, material: Any, volume: Volume | None, aovs: tuple[Aov, ...]) -> Compiled:
        self._cache.work["materials"] += 1
        report, surface, moves = Report(), None, None
        images = Images(report, self._decoded, self._cache.images)
        if volume is not None:
            result, surface = compile_volume(material, volume, images, report)
        elif material is None:
            result = default_material()
        else:
            result = compile_material(material, images, report)
            if aovs:
                result = replace(result, aovs=aov_material(material, aovs, images, report))
            moves = compile_displacement(material, images, report)
        tree = node_tree(material.original) if material is not None else None
        return Compiled(
            result,
            tree.as_pointer() if tree is not None else 0,
            images.reads_memory,
            tuple(zip(images.keys, images.textures, strict=True)),
            wanted_by(result) | wanted_objects(moves),
            moves,
            report,
            surface,
        )


def _uid(material: Any) -> int:
    """A number of its own: of what is in no file, as in previews, its address."""
    if material is None:
        return 0
    return material.original.session_uid or material.as_pointer()


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
    return Material("default_surface", lobes_of(without_normals(closure)))  # as Cycles calls it


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
    closure, normal, base, is_bumped = evaluator.normals(closure)
    kinds = {key.kind for key in closure}
    note_material(material, kinds, is_bumped, report)
    passed = passed_by_light(closure, evaluator)
    if getattr(material, "use_transparent_shadow", True):
        closure = add_closures(closure, passed)
    elif not _is_bounds(tree):
        closure = _opaque_to_light(closure, evaluator)
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
        read = read_tree(material)
        place, closure = end_of(read.tree, "Volume"), {}
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
    """Light passes glass straight on: what refracts is transparent to rays towards lights.

    A pane lets through what it does in the world; of the light that a body bends, caustics, as much
    arrives on average.
    """
    passed: Closure = {}
    for key, terms in closure.items():
        if key.kind == "REFRACTION":
            share = evaluator.expressions.sum_of(_passing(key, evaluator.expressions))
            clear = LobeKey("TRANSPARENT", ior=key.ior, ior_output=key.ior_output)
            passed = add_closures(passed, {clear: multiply(evaluator.limited(terms), share)})
    return passed


def _opaque_to_light(closure: Closure, evaluator: Evaluator) -> Closure:
    """The closure without what rays to lights pass, but for those in directions of lobes, which
    Cycles follows to lights as it does to things.
    """
    expressions = evaluator.expressions
    _, shadow, bounced, scattered = expressions.graph.apply(BY_NAME["light_path"])
    of_lobes = expressions.math("ADD", bounced, scattered)
    share = expressions.sum_of(
        expressions.math("MAXIMUM", expressions.math("SUBTRACT", 1.0, shadow), of_lobes)
    )
    return {
        key: multiply(evaluator.limited(terms), share) if key.kind == "TRANSPARENT" else terms
        for key, terms in closure.items()
    }


def _is_bounds(tree: Any) -> bool:
    """Whether a surface is but where a volume ends."""
    end = end_of(tree, "Surface")
    return end is not None and not is_fed(end)


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
    place = end_of(tree, "Volume")
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
    ends = (end_of(tree, name) for name in ("Surface", "Volume", "Displacement"))
    surface, volume, displacement = ends
    if surface is None:
        evaluator.note("Materials without an output node are black: {}; add a Material Output")
        return {}
    if method == "BUMP":
        evaluator.displace(displacement)
    else:
        evaluator.displace_vertices(displacement, bumps=method == "BOTH")
    if is_fed(volume) and not is_fed(surface):
        return {LobeKey("TRANSPARENT"): constant(1.0)}
    if not is_fed(surface):
        evaluator.note(
            "Materials without a surface are black: {}; link a shader to Surface of the output, or "
            "choose the node group that is missing"
        )
        return {}
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
    roughness = Roughness(material.roughness)
    again = share_of(constant_value(color), roughness, GRAZING)
    closures = (
        scale_closure(glossy_closure(color, again, roughness), metallic),
        scale_closure(diffuse_closure(color), complement(metallic)),
    )
    return add_closures(*closures)


def lobes_of(closure: Closure) -> tuple[Lobe, ...]:
    """The lobes of a closure in the order of `engine.closures`; none of weight 0."""
    ordered = sorted(closure.items(), key=lambda item: _order(item[0]))
    return tuple(_lobe(key, factors_of(term)) for key, terms in ordered for term in terms)


def _order(key: LobeKey) -> tuple:
    (first, its_output), _, (last, output_of_last) = key.parameters
    weights = first, last, key.schlick, key.edge, its_output, output_of_last
    beside = key.normal_output, key.stretch_output, key.radius, key.radius_output
    return KINDS.index(key.kind), *weights, *beside


def _lobe(key: LobeKey, factors: tuple) -> Lobe:
    shape = {given.name: getattr(key, given.name) for given in fields(Lobe)}
    return Lobe(**{**shape, "factors": factors})


def wanted_by(material: Material) -> RequiredAttributes:
    """The attributes that a material's inputs name."""
    inputs = [factor for lobe in material.lobes for factor in lobe.factors]
    uv_maps = frozenset(factor.uv for factor in inputs if factor.texture >= 0)
    attributes = frozenset(factor.attribute for factor in inputs if factor.attribute)
    own = RequiredAttributes(uv_maps, attributes) | read_by(material.program)
    if material.medium is not None:
        own |= read_by(material.medium.program)
    return own | wanted_by(material.aovs) if material.aovs is not None else own
