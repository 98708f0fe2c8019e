"""Materials as the notes' coefficients at points of the surface: k_a, k_d, k_s and the rest, each
the product of a lobe's factors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..closures import CLOSURES, KINDS
from ..cryptomatte import id_bits
from ..evaluation.attributes import Attributes
from ..evaluation.geometry import Geometry
from ..evaluation.materials import DEFAULT, MaterialPoints
from ..evaluation.surface import Spot, Surface
from ..linear.columns import add_at, dot, pick, unit
from ..scene import Lobe, Material, Scene
from .bumps import bump_of, lifted
from .closures import Term, taken
from .closures.microfacet import LEAST_WIDTH
from .closures.stretching import stretched
from .coefficients import THROWN_EXPONENT, Coefficients
from .scene_queries import SceneQueries
from .terminator import lowered

Array = np.ndarray

_SUMMED = {
    "AMBIENT": "ambient",
    "DIFFUSE": "diffuse",
    "TRANSLUCENT": "translucent",
    "EMISSION": "emission",
    "TRANSPARENT": "transparent",
    "HOLDOUT": "holdout",
}


class _Found:
    """The lobes of n points so far, material by material."""

    def __init__(self, count: int) -> None:
        self.sums = {name: np.zeros((3, count)) for name in _SUMMED.values()}
        kinds = ("GLOSSY", "MATT", "MIRROR", "THROWN", "REFRACTION", "FIBRE")
        self._terms: dict[str, list[Term]] = {kind: [] for kind in kinds}
        self._below: Array | None = None  # Σ k, Σ |k|, Σ |k| radius

    def add_below(self, lobe: Lobe, index: Array, k: Array, outputs: list[Array]) -> None:
        """What of a DIFFUSE lobe's light comes out elsewhere."""
        if self._below is None:
            self._below = np.zeros((3, *self.sums["diffuse"].shape))
        radius = np.array(lobe.radius, np.float64)[:, None]
        if lobe.radius_output >= 0:
            given = outputs[lobe.radius_output]
            radius = np.where(np.isfinite(given), np.maximum(given, 0.0), 0.0)
        size = np.abs(k)
        for total, part in zip(self._below, (k, size, size * radius), strict=True):
            add_at(total, index, part)

    def add_fibre(
        self, lobe: Lobe, index: Array, k: Array, outputs: list[Array], surface: Surface
    ) -> None:
        """Of fibres where there are some; elsewhere a matt or a glossy one, or nothing."""
        t = _tangents(lobe, outputs, len(index))
        here, bare = t.any(0), ~t.any(0)
        term = Term(index, np.broadcast_to(k, t.shape), lobe, _numbers(lobe, outputs), t)
        if lobe.kind == "FIBRE_DIFFUSE":
            add_at(self.sums["diffuse"], index[bare], term.k[:, bare])
        elif lobe.kind == "FIBRE_SPECULAR" and bare.any():
            p = taken(term.exponent, bare)
            numbers = {"exponent": p, "masking": 0.0, "ior": 1.0}
            highlight, low = Lobe("SPECULAR"), _lowering(surface, index[bare])
            wide = (p + 2) / 8 * term.k[:, bare]
            self._terms["GLOSSY"].append(Term(index[bare], wide, highlight, numbers, lowering=low))
        self._terms["FIBRE"].append(term.take(here))

    def add_term(
        self,
        lobe: Lobe,
        index: Array,
        k: Array,
        outputs: list[Array],
        normal: Array | None,
        surface: Surface,
    ) -> None:
        """A lobe that needs a ray or a highlight. normal: (3, m) as of `Term`."""
        term = Term(index, k, lobe, _numbers(lobe, outputs), normal=normal)
        if term.has_width:
            term = _as_wide(term)
        low = _lowering(surface, index)
        if lobe.kind == "MIRROR":
            self._terms["THROWN"].append(_thrown(replace(term, lowering=low)))
        row = CLOSURES[lobe.kind]
        if row.counts == "GLOSSY" and not row.passes:
            term = replace(term, lowering=low)
        elif lobe.kind == "MIRROR" and low is not None:
            seen = dot(term.normals(surface), pick(surface.v, index))
            term = replace(term, k=lowered(low, seen) * term.k)
        if lobe.kind == "SPECULAR" and lobe.stretch_output >= 0:
            along = outputs[lobe.stretch_output]
            term = replace(term, stretch=stretched(term.normals(surface), along))
        if lobe.outside:
            term = term.take(np.flatnonzero(surface.outside[index]))
        self._terms[lobe.kind if row.passes else row.counts].append(term)

    def coefficients(self) -> Coefficients:
        found = Coefficients(
            **self.sums,
            highlights=self._terms["GLOSSY"],
            mirrors=self._terms["MIRROR"],
            thrown=self._terms["THROWN"],
            refractions=self._terms["REFRACTION"],
            sheens=self._terms["MATT"],
            fibres=sorted(self._terms["FIBRE"], key=lambda term: KINDS.index(term.lobe.kind)),
        )
        if self._below is None:
            return found
        below, size, spread = self._below
        return replace(found, below=below, radius=spread / np.where(size > 0, size, 1.0))


def _lowering(surface: Surface, index: Array) -> Array | None:
    low = surface.lowering[index]
    return low if (low > 1).any() else None


def _thrown(term: Term) -> Term:
    """A mirror as the highlight by which it throws light on to what is matt: of GGX as wide as that
    (Walter, Marschner, Li, Torrance 2007, Microfacet models for refraction).
    """
    p, masking = THROWN_EXPONENT, (2 / (THROWN_EXPONENT + 2)) ** 0.5
    lobe = replace(term.lobe, kind="SPECULAR", masking=masking, distribution="BLINN_PHONG")
    thrown = replace(term, lobe=lobe, k=(p + 2) / 8 * term.k, is_thrown=True)
    return thrown.with_numbers(exponent=p, masking=masking)


def _as_wide(term: Term) -> Term:
    """A highlight with a width α by the exponent of a power that is as wide, and with k over 4 α²:
    what its density of half vectors, over that of the normal, is times.
    """
    masking = np.maximum(term.masking, LEAST_WIDTH)
    p = 2 / (masking * masking) - 2
    return replace(term, k=0.125 * (p + 2) * term.k).with_numbers(exponent=p, masking=masking)


def _lifts(material: Material) -> bool:
    """Whether normals are lifted where its microfacets have them."""
    return material.program is not None and material.bump_shadowing in ("CHIANG", "GGX")


class Shader(MaterialPoints):
    """Evaluates the materials of a scene."""

    def __init__(self, scene: Scene, attributes: Attributes, geometry: Geometry):
        super().__init__(scene, attributes, geometry)
        self._first_rod = geometry.first_rod
        self.reads_surfaces = any(
            m.program is not None or any(x.kind == "TRANSPARENT" and x.ior != 1 for x in m.lobes)
            for m in scene.materials
        )

    def is_transparent(self, material: Array) -> Array:
        """(n,) bool: has a TRANSPARENT lobe."""
        return np.array(
            [any(lobe.kind == "TRANSPARENT" for lobe in m.lobes) for m in self.materials]
        )[material]

    def pass_index(self, material: Array) -> Array:
        """(n,) Blender's material index; 0 for the default one."""
        return np.array([m.index for m in self.materials])[material]

    def crypto_bits(self, material: Array) -> Array:
        """(n,) uint32, of the ids of Cryptomatte; 0 for the default one."""
        bits = [id_bits(m.name) for m in self.materials[:-1]]
        return np.array([*bits, 0], np.uint32)[material]

    def coefficients(
        self, surface: Surface, kind: str, queries: SceneQueries | None = None
    ) -> Coefficients:
        """All lobes at each point. kind: of the rays that meet them, as `points.light_path` has it.

        queries: how programs ask the scene for rays, here and below.
        """
        found = _Found(len(surface.primitive))

        def add(lobe: Lobe, index: Array, k: Array, outputs: list[Array]) -> None:
            if lobe.exponent > 0 and CLOSURES[lobe.kind].by_view:
                n = self._lifted(surface, index, pick(surface.n, index))
                seen = dot(n, pick(surface.v, index))
                k = k * (1 - np.clip(seen, 0.0, 1.0)) ** _numbers(lobe, outputs)["exponent"]
            if CLOSURES[lobe.kind].of_fibre:
                found.add_fibre(lobe, index, k, outputs, surface)
            elif lobe.kind in _SUMMED:
                add_at(found.sums[_SUMMED[lobe.kind]], index, k)
                if lobe.goes_below:
                    found.add_below(lobe, index, k, outputs)
            else:
                normal, k = self._turned(lobe, surface, index, k, outputs)
                found.add_term(lobe, index, k, outputs, normal, surface)

        self._each_lobe(surface, kind, add, queries=queries)
        return found.coefficients()

    def bent(self, surface: Surface, kind: str, queries: SceneQueries | None = None) -> Surface:
        """The surface with the shading normals that materials' programs give it."""
        if not any(self.materials[k].normal_output >= 0 for k in np.unique(surface.material)):
            return surface
        n, unbent, bump = surface.n.copy(), surface.unbent.copy(), surface.bump.copy()
        strands = surface.primitive >= self._first_rod
        for material, index in self._by_material(surface):
            if material.normal_output < 0:
                continue
            outputs = self._outputs(material, surface, index, kind, queries)
            mesh = pick(surface.n, index)
            n[:, index] = _normal(outputs, material.normal_output, mesh)
            if material.bump_shadowing == "NONE":
                continue
            base, here = _normal(outputs, material.base_normal_output, mesh), pick(n, index)
            is_bent = (here != base).any(0) & ~strands[index]
            unbent[:, index] = np.where(is_bent, base, 0.0)
            bump[index] = bump_of(material.bump_shadowing, dot(base, here))
        return replace(surface, n=n, unbent=unbent, bump=bump)

    def lifted(self, surface: Surface) -> tuple[Array, Array]:
        """(3, n) normals of TRANSLUCENT lobes, and (n,) `Surface.bump` of these."""
        n, bump = surface.n.copy(), surface.bump.copy()
        for material, index in self._by_material(surface):
            index = index[surface.primitive[index] < self._first_rod]
            if not (_lifts(material) and len(index)):
                continue
            m = pick(surface.unbent, index)
            n[:, index] = self._lifted(surface, index, pick(n, index))
            bent = np.where(m.any(0), bump_of(material.bump_shadowing, dot(m, n[:, index])), 0.0)
            bump[index] = bent
        return n, bump

    def _lifted(self, surface: Surface, index: Array, n: Array) -> Array:
        """(3, m) normals n of points of one material as microfacets have them."""
        if not len(index) or not _lifts(self.materials[surface.material[index[0]]]):
            return n
        strands = surface.primitive[index] >= self._first_rod
        return np.where(strands, n, lifted(n, pick(surface.g, index), pick(surface.v, index)))

    def _turned(
        self, lobe: Lobe, surface: Surface, index: Array, k: Array, outputs: list[Array]
    ) -> tuple[Array | None, Array]:
        """A lobe's normals, None for those of the points, and k (3, m): 0 where microfacets are
        turned away from the viewer.
        """
        material = self.materials[surface.material[index[0]]] if len(index) else DEFAULT
        shines = lobe.is_glossy or lobe.kind in ("MIRROR", "REFRACTION")
        is_micro = shines and material.program is not None and material.bump_shadowing != "NONE"
        if CLOSURES[lobe.kind].normal == "POINT" or not (is_micro or lobe.normal_output >= 0):
            return None, k
        n, v = pick(surface.n, index), pick(surface.v, index)
        n = _normal(outputs, lobe.normal_output, n)
        if not is_micro:
            return n, k
        n = self._lifted(surface, index, n)
        return n, np.where(dot(n, v) > 0, np.broadcast_to(k, n.shape), 0.0)

    def aovs(
        self, surface: Surface, kind: str, count: int, queries: SceneQueries | None = None
    ) -> Array:
        """(4 count, n): colours that the points give to AOVs, and 1 where they give one."""
        found = np.zeros((4 * count, len(surface.primitive)))
        for material, index in self._by_material(surface):
            given = material.aovs
            outputs = self._outputs(given, surface, index, kind, queries) if given else []
            for lobe in given.lobes if given else ():
                first = 4 * lobe.aov
                k = self._product(lobe, surface, index, outputs)
                found[first : first + 3, index] += k
                found[first + 3, index] = 1
        return found

    def transmittance(self, spot: Spot, kind: str = "shadow") -> Array:
        """(n, 4): what passes straight through, the clamped sum of the TRANSPARENT lobes, and by
        how much light is narrowed.

        spot: a `Surface` where `reads_surfaces`.  kind: as of `points.light_path`.
        """
        total = np.zeros((len(spot.primitive), 3))
        size, narrow = np.zeros((2, len(spot.primitive)))

        def add(lobe: Lobe, index: Array, k: Array, outputs: list[Array]) -> None:
            total[index] += k.T
            given = np.maximum(k.sum(0), 0.0)
            size[index] += given
            if isinstance(spot, Surface):
                square = np.asarray(_numbers(lobe, outputs)["ior"]) ** 2
                given = given * np.where(spot.outside[index], square, 1 / square)
            narrow[index] += given

        self._each_lobe(spot, kind, add, ("TRANSPARENT",))
        passed = np.clip(total, 0.0, 1.0)
        share = np.where(size > 0, narrow / np.where(size > 0, size, 1.0), 1.0)
        return np.concatenate([passed, share[:, None]], 1)

    def _each_lobe(
        self,
        spot: Spot,
        kind: str,
        add: Callable[[Lobe, Array, Array, list[Array]], None],
        kinds: tuple[str, ...] = (),
        queries: SceneQueries | None = None,
    ) -> None:
        for material, index in self._by_material(spot):
            lobes = [lobe for lobe in material.lobes if not kinds or lobe.kind in kinds]
            outputs = self._outputs(material, spot, index, kind, queries) if lobes else []
            for lobe in lobes:
                add(lobe, index, self._product(lobe, spot, index, outputs), outputs)


def _tangents(lobe: Lobe, outputs: list[Array], count: int) -> Array:
    """(3, m) of a FIBRE lobe; 0 where there is no fibre."""
    if lobe.fibre_output < 0:
        return np.zeros((3, count))
    given = np.broadcast_to(outputs[lobe.fibre_output], (3, count))
    return np.where(np.isfinite(given), given, 0.0)


def _normal(outputs: list[Array], output: int, mesh: Array) -> Array:
    """(3, m) a normal of the material's program, unit; the mesh's where it gives none."""
    if output < 0:
        return mesh
    given = unit(np.where(np.isfinite(outputs[output]), outputs[output], 0.0))
    return np.where(given.any(0), given, mesh)


def _numbers(lobe: Lobe, outputs: list[Array]) -> dict[str, Array | float]:
    """The parameters of a lobe by name: its own, or what the program gives from 0 to that; an index
    of refraction that the program gives is none beyond its range, where the lobe's own stands.
    """
    found: dict[str, Array | float] = {}
    for p in CLOSURES[lobe.kind].parameters:
        own = getattr(lobe, p.name)
        output = getattr(lobe, f"{p.name}_output") if p.varies else -1
        if output < 0:
            found[p.name] = own
        elif p.low > 0:
            given = outputs[output][0]
            found[p.name] = np.where((given >= p.low) & (given <= p.high), given, own)
        else:
            given = np.where(np.isfinite(outputs[output][0]), outputs[output][0], 0.0)
            found[p.name] = np.clip(given, 0.0, own)
    return found
