"""The picture as it grows: parts of the colour per wave, sums over the samples, passes at the
end.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..film import (
    BY_SURFACE,
    CATCHER,
    CRYPTOMATTES,
    DENOISING,
    LIGHTING,
    OCCLUSION,
    PARTS,
    PASSES,
    SEEN,
    VOLUME,
    aov_pass,
    empty_value,
    light_group_pass,
)
from . import catchers
from .resolve import (
    ALONE,
    CAUGHT,
    COLORS,
    IMAGES,
    LIGHTS,
    MIRRORED,
    OTHERS,
    PHOTON_LIGHT,
    REFRACTED,
    SHARP,
    UNHIDDEN,
    UNSHADED,
    UNSHADOWED,
    Guides,
    Seen,
    resolved,
    uneven,
)

Array = np.ndarray

HEALTH = ("Error", "Samples", "Cost", "Fallbacks")
"""Passes that grow with every sample and belong to no part."""
_OTHERS = ("Combined", *PARTS, *HEALTH, *SEEN, CATCHER, OCCLUSION, *LIGHTING)
DATA = tuple(name for name in PASSES if name not in _OTHERS)
GLOWS = ("Emission", "Environment")
"""What gives light itself."""
LARGEST = float(np.finfo(np.float32).max)


class Tile:
    """One sample of n pixels. parts: (3, n) per part that anything was added to. lost: (n,) alpha.
    cost: (n,) rays. soft_light, cut: (n,) bool, whether a light of more than one sample reached
    them, and whether their horizon cuts one. data: (channels, n) for the passes named. wanted: (n,)
    bool, pixels whose data is still to come. clear: (n,) what is seen and no mist before it.
    aovs: (4 each, n) colours and what of the sample has them. wants_aovs: (n,) bool, pixels whose
    ray has met nothing that hides what is behind. groups: (3 each, n) light of light groups. met:
    of each Cryptomatte pass, pixels, bits of ids and coverages, (m,) each, of what was met.
    brought: (2, n) the largest channel of what rough surfaces reflect, and of the rest; before: the
    sums of these over earlier samples.
    """

    def __init__(self, count: int, data: frozenset[str], aovs: int = 0, groups: int = 0):
        self._count = count
        self.parts: dict[str, Array] = {}
        self.lost, self.cost = np.zeros(count), np.zeros(count)
        self.soft_light, self.cut = np.zeros((2, count), bool)
        self.data = {name: np.full((PASSES[name], count), empty_value(name)) for name in data}
        self.wanted = np.full(count, bool(data))
        self.aovs, self.wants_aovs = np.zeros((4 * aovs, count)), np.full(count, aovs > 0)
        self.groups = np.zeros((3 * groups, count))
        self.clear = np.zeros(count)
        self.brought, self.before = np.zeros((2, 2, count))
        self.guides = np.zeros((7, count))
        self.shown = {name: np.zeros((7, count)) for name in IMAGES}
        self.is_rough_glass = np.zeros(count, bool)
        self.denoising = {name: np.zeros((PASSES[name], count)) for name in DENOISING}
        self.met: dict[str, list[tuple[Array, Array, Array]]] = {name: [] for name in CRYPTOMATTES}

    def take(self, found: Tile, share: Array) -> None:
        """So much (3, n) of what another tile of the same pixels has."""
        every = np.arange(self._count)
        for name, columns in found.parts.items():
            self.add(name, every, share * columns)
        for group in range(len(found.groups) // 3):
            part = found.groups[3 * group : 3 * group + 3]
            self.add_to_groups(group, every, share * part)
        self.cost += found.cost
        self.soft_light |= found.soft_light
        self.cut |= found.cut

    def light(self) -> dict[str, Array]:
        """Copies of the sums of light, by part, and "" of light groups."""
        return {name: sums.copy() for name, sums in ({"": self.groups} | self.parts).items()}

    def hold(self, before: dict[str, Array], share: Callable[[Array], Array]) -> None:
        """Leaves of what was added since these copies the share (n,) of that light (3, n)."""
        added = sum(
            (self.parts[name] - before.get(name, 0.0) for name in PARTS if name in self.parts),
            np.zeros((3, self._count)),
        )
        left = share(added)
        colors = [LIGHTS[name] for name in IMAGES]
        for name, sums in ({"": self.groups} | self.parts).items():
            if name in colors:
                continue
            earlier = before.get(name, 0.0)
            sums[...] = np.where(left < 1, earlier + left * (sums - earlier), sums)

    def guide(self, pixel: Array, values: Array, image: str = "") -> None:
        """Adds what tells pixels' surfaces apart (7, m), as `resolve.Guides` reads it; image: of
        those that mirrors or glass show.
        """
        for total, value in zip(self.shown.get(image, self.guides), values, strict=True):
            total += np.bincount(pixel, value, self._count)

    def denoise(self, pixel: Array, **values: Array) -> None:
        """Adds what denoisers are told ("Albedo" for "Denoising Albedo"), (channels, m) each."""
        for name, found in values.items():
            for total, value in zip(self.denoising[f"Denoising {name}"], found, strict=True):
                total += np.bincount(pixel, value, self._count)

    def see(self, pixel: Array, clear: Array, weight: Array, ids: dict[str, Array]) -> None:
        """Surfaces that m camera rays meet: what is seen of them in no mist, what of the ray stays
        there, and the bits of their ids for each Cryptomatte pass.
        """
        self.clear += np.bincount(pixel, clear, self._count)
        some = weight > 0
        for name, bits in ids.items():
            self.met[name].append((pixel[some], bits[some], weight[some]))

    def add(self, part: str, pixel: Array, values: Array) -> None:
        """values (3, m) to pixels (m,), in their order: a pixel's sum does not depend on its
        neighbours.
        """
        if part not in self.parts:
            self.parts[part] = np.zeros((3, self._count))
        for total, value in zip(self.parts[part], values, strict=True):
            total += np.bincount(pixel, value, self._count)

    def add_to_groups(self, group: Array | int, pixel: Array, values: Array) -> None:
        """Light (3, m) of light groups, (m,) or one number, -1 for none, to pixels (m,)."""
        if not len(self.groups):
            return
        own = np.broadcast_to(group, (len(pixel),))
        for number in np.unique(own[own >= 0]):
            some = np.flatnonzero(own == number)
            for total, value in zip(self.groups[3 * number :][:3], values, strict=True):
                total += np.bincount(pixel[some], value[some], self._count)

    def lose(self, pixel: Array, weight: Array) -> None:
        """Alpha that is lost with the weights (3, m)."""
        self.lost += np.bincount(pixel, (weight[0] + weight[1] + weight[2]) / 3, len(self.lost))

    def color(self) -> Array:
        """(3, n) the sum of the parts."""
        total = np.zeros((3, self._count))
        for name in PARTS:
            if name in self.parts:
                total += self.parts[name]
        return total

    def charge(self, pixel: Array) -> None:
        """Rays traced for pixels (m,)."""
        self.cost += np.bincount(pixel, minlength=self._count)

    def record(self, pixel: Array, **data: Array) -> None:
        """Data passes by name ("Object_Index" for "Object Index"), (channels, m) each."""
        self.wanted[pixel] = False
        for name in self.data.keys() - {"Gap"}:
            self.data[name][:, pixel] = data[name.replace(" ", "_")]


class Picture:
    """Sums over samples of the passes that are asked for, float64, (channels, pixels)."""

    def __init__(
        self,
        width: int,
        height: int,
        passes: frozenset[str],
        crypto_ids: int,
        aovs: tuple[str, ...],
        light_groups: tuple[str, ...] = (),
        resolved: int = 1,
        transparent: bool = False,
    ):
        """resolved: side of the blocks of pixels over which light is averaged, 1 for none.
        transparent: no surroundings are seen.
        """
        self._shape, self._passes, self._side = (height, width), passes, resolved
        count = width * height
        kept = [name for name in PARTS if name in passes]
        kept += (*LIGHTING, PHOTON_LIGHT) if passes.intersection(LIGHTING) or resolved > 1 else ()
        kept += [name for name in (CATCHER, OCCLUSION) if name in passes or resolved > 1]
        kept += (CAUGHT, ALONE, UNSHADED, UNHIDDEN) if resolved > 1 else ()
        kept += (*UNSHADOWED.values(), *OTHERS.values()) if resolved > 1 else ()
        kept += [name for image in IMAGES for name in (image, LIGHTS[image]) if resolved > 1]
        self._catches = CATCHER if CATCHER in passes else "alpha" if transparent else "color"
        self._guides = np.zeros((7, count))
        self._shown = {name: np.zeros((7, count)) for name in IMAGES}
        self._halves = {name: np.zeros(count) for name in kept if name not in PARTS}
        self._sharp = {name: np.zeros(count) for name in SHARP}
        self._added: dict[str, Array] = {}
        self._more, self._rest = np.zeros(count), np.zeros((4, count))
        told = (*COLORS, UNHIDDEN, *UNSHADOWED.values(), *GLOWS)
        self._finely = {name: np.zeros((3, count)) for name in told}
        self._fine_guides = np.zeros((7, count))
        self._glow = np.zeros((4, count))  # what more of what gives light itself adds
        self._parts = {name: np.zeros((3, count)) for name in kept}
        self._color, self._lost = np.zeros((3, count)), np.zeros(count)
        self._data = {name: np.zeros((PASSES[name], count)) for name in DATA if name in passes}
        self.samples, self._cost = np.zeros(count), np.zeros(count)
        self._aovs, self._aov_names = np.zeros((4 * len(aovs), count)), aovs
        self._groups, self._group_names = np.zeros((3 * len(light_groups), count)), light_groups
        self._clear, self._crypto_ids = np.zeros(count), crypto_ids
        self.brought = np.zeros((2, count))
        self._denoising = {
            name: np.zeros((PASSES[name], count)) for name in DENOISING if name in passes
        }
        self._shares = {name: _no_shares() for name in CRYPTOMATTES if name in passes}

    def keep(self, here: slice | Array, tile: Tile) -> None:
        """Adds a finished tile, of these pixels."""
        if self._side > 1:
            self._note_halves(here)
            self._note_surfaces(here, tile)
        self._color[:, here] += tile.color()
        self._lost[here] += tile.lost
        self._cost[here] += tile.cost
        self.samples[here] += 1
        self._clear[here] += tile.clear
        self.brought[:, here] += tile.brought
        self._aovs[:, here] += tile.aovs
        self._groups[:, here] += tile.groups
        for name, total in self._denoising.items():
            total[:, here] += tile.denoising[name]
        for name, shares in self._shares.items():
            numbers = np.arange(len(self.samples))[here]
            met = [(numbers[pixel], bits, weight) for pixel, bits, weight in tile.met[name]]
            self._shares[name] = _summed([shares, *met])
        for name, total in self._parts.items():
            if name in tile.parts:
                total[:, here] += tile.parts[name]
        for name, values in tile.data.items():
            self._data[name][:, here] = values

    def see(self, here: Array, tile: Tile) -> None:
        """Adds what camera rays beyond the samples of these pixels show, but for light."""
        self._more[here] += 1
        self._fine_guides[:, here] += tile.guides
        self._rest[:3, here] += tile.color()
        self._rest[3, here] += tile.lost
        self._cost[here] += tile.cost
        for name, total in self._finely.items():
            if name in tile.parts:
                total[:, here] += tile.parts[name]

    def uneven(self) -> Array:
        """(pixels,) bool: such as more of these would tell more about."""
        seen, whole = self._seen(0.0), self._color / np.maximum(self.samples, 1)
        return uneven(seen, whole.reshape(3, *self._shape)).ravel()

    def _seen(self, more: float = 1.0) -> Seen:
        """What camera rays show; more: 0 of the samples alone."""
        count = np.maximum(self.samples, 1) + more * self._more
        lights = [self._parts[name] for name in LIGHTS if name not in (CAUGHT, OCCLUSION)]
        rest = np.concatenate([self._color - sum(lights), self._lost[None]])
        shape = (-1, *self._shape)
        colors = {
            name: (self._parts[name] + more * self._finely[name]) / count
            for name in (*COLORS, UNHIDDEN, *UNSHADOWED.values())
        }
        samples = np.maximum(self.samples, 1).reshape(self._shape)
        return Seen(
            Guides.of(
                (self._guides + more * self._fine_guides).reshape(shape), count.reshape(self._shape)
            ),
            {name: Guides.of(sums.reshape(shape), samples) for name, sums in self._shown.items()},
            {name: color.reshape(shape) for name, color in colors.items()},
            ((rest + more * self._rest) / count).reshape(shape),
            count.reshape(self._shape),
        )

    def _note_halves(self, here: slice | Array) -> None:
        """Before pixels take another sample: where they have as many as a power of 2."""
        taken = self.samples[here]
        count = taken.astype(int)
        some = np.arange(len(self.samples))[here][(count > 0) & (count & (count - 1) == 0)]
        for name, half in self._halves.items():
            half[some] = self._parts[name][:, some].sum(0)

    def _note_surfaces(self, here: slice | Array, tile: Tile) -> None:
        self._guides[:, here] += tile.guides
        for name, total in self._shown.items():
            total[:, here] += tile.shown[name]
        for name, total in self._sharp.items():
            if SHARP[name] in tile.parts:
                total[here] += tile.parts[SHARP[name]].sum(0)

    def resolve(self) -> None:
        """What averaging the light of pixels adds to their means so far."""
        if self._side == 1:
            return
        samples = np.maximum(self.samples, 1).reshape(self._shape)
        seen, finely = self._seen(0.0), self._seen() if self._more.any() else None
        parts = {name: sums.reshape(3, *self._shape) for name, sums in self._parts.items()}
        halves = {name: half.reshape(self._shape) for name, half in self._halves.items()}
        sharp = {name: color.reshape(self._shape) for name, color in self._sharp.items()}
        added = resolved(self._side, seen, finely, parts, halves, sharp, samples)
        more = added.pop(CAUGHT, 0.0)
        if parts[UNSHADED].any():
            added[CATCHER] = self._shadows(parts, samples, more)
        self._added = {name: values.reshape(3, -1) for name, values in added.items()}
        if finely is not None:
            self._glow = (finely.rest - seen.rest).reshape(4, -1)

    def _shadows(self, parts: dict[str, Array], samples: Array, more: Array | float) -> Array:
        """(3, h, w) what catchers get that get so much more of light: their shadows are as dark as
        what they have then says, where the samples' were so by their own ratios, each of a few
        points.
        """
        left = catchers.ratio(parts[CAUGHT] / samples + more, parts[ALONE] / samples)
        if self._catches != CATCHER:
            left = catchers.light_left(left)[None]
        return (parts[UNSHADED] * (left - 1.0) - parts[CATCHER]) / samples

    def _gets_more(self) -> Array | float:
        """What resolving adds to the colour."""
        beside = (OCCLUSION,) if self._catches == "color" else (OCCLUSION, CATCHER)
        return sum(added for name, added in self._added.items() if name not in beside)

    def color_and_loss(self) -> Array:
        """(4, pixels) mean so far of the colour and of the alpha lost."""
        sums = np.concatenate([self._color, self._lost[None]])
        mean = sums / np.maximum(self.samples, 1)
        mean[:3] += self._gets_more()
        mean += self._glow
        if self._catches == "alpha" and CATCHER in self._added:
            mean[3] += self._added[CATCHER].mean(0)
        return mean

    def means(self) -> dict[str, Array]:
        """The passes so far, float64, (channels, pixels); pixels without a sample are black and
        transparent.
        """
        samples = np.maximum(self.samples, 1)
        color = self.color_and_loss()
        color[3] = np.where(self.samples > 0, 1 - color[3], 0.0)
        health = {
            "Samples": self.samples[None],
            "Cost": self._cost[None],
            "Fallbacks": np.zeros_like(self._cost[None]),
            "Mist": 1 - self._clear[None] / samples,
        }
        for name, empty in ((CATCHER, 1.0), (OCCLUSION, 0.0)):
            if name in self._passes:
                health[name] = empty + self._parts[name] / samples + self._added.get(name, 0.0)
        chosen = {name: values for name, values in health.items() if name in self._passes}
        return (
            {"Combined": color}
            | {
                name: total / samples + self._added_to(name)
                for name, total in self._parts.items()
                if name in PARTS
            }
            | self._lighting(samples)
            | self._data
            | chosen
            | {name: total / samples for name, total in self._denoising.items()}
            | {name: self._ranked(name) for name in self._shares}
            | {
                aov_pass(name): self._aovs[4 * k : 4 * k + 4] / samples
                for k, name in enumerate(self._aov_names)
            }
            | {
                light_group_pass(name): self._resolved(self._groups[3 * k : 3 * k + 3] / samples)
                for k, name in enumerate(self._group_names)
            }
        )

    def _resolved(self, group: Array) -> Array:
        """A light group's (3, pixels), which gets as much more as Combined does."""
        own = self._color / np.maximum(self.samples, 1)
        more = (self._gets_more() + self._glow[:3]) / np.where(own > 0, own, 1.0)
        return group * np.where(own > 0, 1 + more, 1.0)

    def _added_to(self, part: str) -> Array | float:
        """To a part of Combined, so that they sum to it: diffuse light and that of media to
        Diffuse, glossy light to Specular, what passes through to Mirror, what shadows take of
        surroundings to Environment.
        """
        kinds = {"Diffuse": ("Diffuse", "Volume", "Other Diffuse"), "Specular": ("Glossy",)}
        kinds["Mirror"] = ("Transmission", "Mirrored", "Refracted", "Other Gloss")
        kinds["Environment"] = ("Shadow",) if self._catches == "color" else ()
        own = [name for name in self._added if name.startswith(kinds.get(part, ()))]
        more = sum(self._added[name] for name in own)
        if part not in GLOWS:
            return more
        sums, count = self._parts[part], np.maximum(self.samples, 1)
        return more + (sums + self._finely[part]) / (count + self._more) - sums / count

    def _lighting(self, samples: Array) -> dict[str, Array]:
        """Direct and indirect light over its colour, which is 1 where it is 0 and there is
        light.
        """
        found: dict[str, Array] = {}
        is_known = VOLUME[0] in self._parts

        def resolved(name: str) -> Array | float:
            return self._parts.get(name, 0.0) + samples * self._added.get(name, 0.0)

        shown = {"Glossy Indirect": MIRRORED, "Transmission Indirect": REFRACTED}
        shown["Diffuse Indirect"] = PHOTON_LIGHT
        for k in range(0, len(BY_SURFACE) if is_known else 0, 3):
            direct, indirect, color = (resolved(name) for name in BY_SURFACE[k : k + 3])
            direct = direct + resolved(OTHERS.get(BY_SURFACE[k], ""))
            indirect = indirect + resolved(shown.get(BY_SURFACE[k + 1], ""))
            over = np.where(color != 0, color, samples)
            bare = (color == 0) & ((direct != 0) | (indirect != 0))
            told = direct / over, indirect / over, np.where(bare, 1.0, color / samples)
            found |= dict(zip(BY_SURFACE[k : k + 3], told, strict=True))
        volume = VOLUME if is_known else ()
        found |= {name: self._parts[name] / samples + self._added.get(name, 0.0) for name in volume}
        return {name: values for name, values in found.items() if name in self._passes}

    def _ranked(self, name: str) -> Array:
        """(2 ids, pixels): ids and coverages in turn, the largest coverage first, of equal ones the
        id with the lower bits.
        """
        pixel, bits, weight = self._shares[name]
        order = np.lexsort((bits, -weight, pixel))
        pixel, bits, weight = pixel[order], bits[order], weight[order]
        rank = np.arange(len(pixel)) - np.searchsorted(pixel, pixel)
        kept = rank < self._crypto_ids
        pixel, rank = pixel[kept], rank[kept]
        ranked = np.zeros((2 * self._crypto_ids, len(self.samples)))
        ranked[2 * rank, pixel] = bits[kept].astype(np.uint32).view(np.float32)
        ranked[2 * rank + 1, pixel] = weight[kept] / self.samples[pixel]
        return ranked

    def images(self, passes: dict[str, Array], shown: tuple[slice, slice]) -> dict[str, Array]:
        """Passes (c, pixels) as float32 images of the rows and columns that are shown."""
        return {name: self._image(values, shown) for name, values in passes.items()}

    def _image(self, values: Array, shown: tuple[slice, slice]) -> Array:
        """(c, pixels) -> (h, w, c) float32, saturated."""
        image = np.clip(values, -LARGEST, LARGEST).astype(np.float32)
        return np.ascontiguousarray(image.T.reshape(*self._shape, len(values))[shown])


Shares = tuple[Array, Array, Array]


def _no_shares() -> Shares:
    return np.zeros(0, np.intp), np.zeros(0, np.uint32), np.zeros(0)


def _summed(shares: list[Shares]) -> Shares:
    """Pixels, bits of ids and coverages: one row for each pixel and id."""
    pixel, bits, weight = (np.concatenate(columns) for columns in zip(*shares, strict=True))
    key, row = np.unique(pixel.astype(np.int64) << 32 | bits, return_inverse=True)
    total = np.bincount(row, weight, len(key))
    return (key >> 32).astype(np.intp), (key & 0xFFFFFFFF).astype(np.uint32), total
