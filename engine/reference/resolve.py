"""Light that is sampled at other points by each pixel of a block, averaged over the pixels that
show the same surface (semantics/resolve.md).

Sources: Keller, Heidrich 2001, Interleaved sampling; Wald, Kollig, Benthin, Keller, Slusallek
2002, Interactive global illumination using fast ray tracing (the discontinuity buffer); Lee 1980,
Digital image enhancement and noise filtering by use of local statistics.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..film import BY_SURFACE, FIRST_ESTIMATE, OCCLUSION, VOLUME

Array = np.ndarray

ALIKE = 0.9
"""Cosine between normals from which on nothing is shared any more."""
FLAT = 0.04
"""The same of the way between points along one's normal, squared, over its length."""
SURE = 1.98
"""Two estimates of one variance, each of the 25 pixels of a block, differ by more in one of twenty
cases by chance: the quantile of Fisher's F for 24 and 24 degrees of freedom.
"""
SURER = 5.54
"""Those of the 16 classes differ by more in one of a thousand: the quantile for 15 and 15."""
SURE_FIT = 1.46
"""As `SURE`, of what a fit leaves of the 81 of a wide block, and of these: for 73 and 80."""
GUIDES = 8
"""Light at edges goes straight along with so many: of what is seen of surfaces how much, the
normal, the place, the colour.
"""
FLATTER = 1e-3
"""Slopes that so little of the light speaks for are flat: what rounding leaves has none."""
EVEN = 1 / 50
"""Colours, what is seen beside them and unit normals that differ by no more look the same."""
WIDE = ("Diffuse Indirect", VOLUME[1])
"""What is averaged over blocks of twice the side, over which bounces are dealt; all of it
of one sample.
"""
UNSHADOWED = {"Diffuse Direct": "Unshadowed Diffuse", "Glossy Direct": "Unshadowed Gloss"}
"""What lights would give to what camera rays meet if nothing hid them, which their light is told
over.
"""
OTHERS = {"Diffuse Direct": "Other Diffuse", "Glossy Direct": "Other Gloss"}
"""What of these passes is not of lights there: even and subsurface light, what mirrors show of what
gives light.
"""
GLOSS = ("Glossy Direct", "Glossy Indirect", OTHERS["Glossy Direct"])
"""What is told apart from noise together."""
CAUGHT, ALONE, UNSHADED = "Caught Light", "Light Alone", "Unshaded"
"""The light of catchers with all things there and as if they were alone, and what they show where
nothing shades them.
"""
UNHIDDEN = "Unhidden"
"""How much of what camera rays meet is asked how open it is."""
MIRRORED, REFRACTED = "Mirrored Light", "Refracted Light"
"""What surfaces give back of light that mirrors and clear glass show."""
PHOTON_LIGHT = "Photon Light"
"""That of photons at what camera rays meet, a part of Diffuse Indirect that is not resolved."""
IMAGES = {MIRRORED: "Glossy Color", REFRACTED: "Transmission Color"}
"""The same, with what mirrors and glass give back of it."""
COLORS = tuple(name for name in BY_SURFACE if name.endswith("Color"))
SURFACE_COLORS = {name: COLORS[k // 3] for k, name in enumerate(BY_SURFACE) if name not in COLORS}
"""The colour of the surfaces that give light back."""
LIGHTS = (
    SURFACE_COLORS
    | {other: SURFACE_COLORS[name] for name, other in OTHERS.items()}
    | {MIRRORED: "Mirrored Surfaces", REFRACTED: "Refracted Surfaces"}
    | {CAUGHT: ALONE, OCCLUSION: UNHIDDEN}
    | dict.fromkeys(VOLUME, "")
)
"""What is resolved, each by itself, and what it is told without."""
SHARP = {"Glossy Color": "Mirrored Color", "Transmission Color": "Clear Color"}
"""What of a colour mirrors or clear glass have: they show what gives light itself as it is."""


def reach(side: int) -> int:
    """Pixels to each side of one that what is added to it depends on: half a block of which it
    takes in light, and whether that repeats in the next one.
    """
    return side // 2 + side


@dataclass(frozen=True, eq=False)
class Guides:
    """What tells pixels' surfaces apart. normal: (h, w, 3) unit. place: (h, w, 3). surface: (h, w)
    1 where there is one, else 0. share: (h, w) how much of the rays stays at surfaces. along: (h,
    w) how long the mean of their normals is, times that.
    """

    normal: Array
    place: Array
    surface: Array
    share: Array
    along: Array

    @staticmethod
    def of(sums: Array, samples: Array) -> Guides:
        """sums: (7, h, w) of the surfaces that camera rays meet, times what of the ray stays there:
        the normal, the place, and 1. samples: (h, w).
        """
        normal, place, share = np.moveaxis(sums[:3], 0, -1), np.moveaxis(sums[3:6], 0, -1), sums[6]
        size = np.linalg.norm(normal, axis=-1)
        surface = (share > 0) & (size > 0) & np.isfinite(size)
        normal = np.where(surface[..., None], normal, 0.0) / np.where(surface, size, 1.0)[..., None]
        place = np.where(surface[..., None], place, 0.0) / np.where(surface, share, 1.0)[..., None]
        shares = (np.where(surface, part, 0.0) / samples for part in (share, size))
        return Guides(normal, place, surface.astype(float), *shares)

    def covered(self, times: Array) -> Guides:
        """Those of so many times (h, w) as much of the rays."""
        return replace(self, share=self.share * times, along=self.along * times)

    def alike(self, x: int, y: int) -> Array:
        """(h, w) how surely the pixel so far to the right and up shows the same surface, 0 to 1."""
        normal, place, surface = (_moved(a, x, y) for a in (self.normal, self.place, self.surface))
        cosine = (self.normal * normal).sum(-1)
        way = place - self.place
        off = np.maximum((way * self.normal).sum(-1) ** 2, (way * normal).sum(-1) ** 2)
        most = FLAT * (way**2).sum(-1)
        flat = np.where(most > off, (most - off) / np.where(most > 0, most, 1.0), most == 0)
        alike = np.clip((cosine - ALIKE) / (1 - ALIKE), 0.0, 1.0)
        return alike * flat * self.surface * surface


def _moved(image: Array, x: int, y: int) -> Array:
    """What lies so far to the right and up of each pixel, 0 beyond the image."""
    height, width = image.shape[:2]
    found = np.zeros_like(image)
    rows = slice(max(-y, 0), height - max(y, 0)), slice(max(y, 0), height + min(y, 0))
    columns = slice(max(-x, 0), width - max(x, 0)), slice(max(x, 0), width + min(x, 0))
    found[rows[0], columns[0]] = image[rows[1], columns[1]]
    return found


@dataclass(frozen=True, eq=False)
class Seen:
    """What camera rays show. shown: by name of `IMAGES` the surfaces that samples show there.
    colors: (3, h, w) means by name, of `COLORS`, UNHIDDEN and `UNSHADOWED`. rest: (4, h, w) of the
    picture but for light that is resolved, and of lost alpha. rays: (h, w) how many.
    """

    guides: Guides
    shown: dict[str, Guides]
    colors: dict[str, Array]
    rest: Array
    rays: Array


def uneven(seen: Seen, whole: Array) -> Array:
    """(h, w) bool: pixels that show with those round them more than one surface of one colour, or
    bumps, so that what their samples miss of it may be seen. whole: (3, h, w) the picture.
    """
    guides, inside = seen.guides, np.ones(whole.shape[1:])
    found = (guides.surface > 0) & (guides.along < guides.share * np.sqrt(1 - EVEN**2))

    def moved(values: Array, x: int, y: int) -> Array:
        return np.moveaxis(_moved(np.moveaxis(values, 0, -1), x, y), -1, 0)

    for x, y in ((x, y) for y in (-1, 0, 1) for x in (-1, 0, 1)):
        surface = guides.surface + _moved(guides.surface, x, y) > 0
        apart = surface & (guides.alike(x, y) == 0)

        def differ(values: Array, of: Array, x: int = x, y: int = y) -> Array:
            size = np.maximum(np.abs(of).max(0), np.abs(moved(of, x, y)).max(0))
            return (np.abs(values - moved(values, x, y)) > EVEN * size).any(0)

        for name in (*COLORS, UNHIDDEN):
            apart |= differ(seen.colors[name], seen.colors[name])
        apart |= differ(seen.rest[:3], whole) | differ(seen.rest[3:], np.ones_like(whole))
        found |= apart & (_moved(inside, x, y) > 0)
    return found


def resolved(
    side: int,
    seen: Seen,
    finely: Seen | None,
    parts: dict[str, Array],
    halves: dict[str, Array],
    sharp: dict[str, Array],
    samples: Array,
) -> dict[str, Array]:
    """(3, h, w) by what there is of `LIGHTS`: what is added to the mean of a pixel's samples.
    finely: what samples and further camera rays show together; None where there are none. parts:
    (3, h, w) sums. halves: (h, w) of the first half of the samples, the sums of channels. sharp:
    (h, w) by pass of colour what `SHARP` names of it, the sum of the channels.
    """
    told = Told(side, seen, finely or seen, parts, halves, sharp, samples)
    return {name: told.added(name) for name in LIGHTS if name in parts and parts[name].any()}


@dataclass(frozen=True, eq=False)
class Told:
    """What samples and camera rays tell of the light of pixels: as the arguments of `resolved`."""

    side: int
    seen: Seen
    finely: Seen
    parts: dict[str, Array]
    halves: dict[str, Array]
    sharp: dict[str, Array]
    samples: Array

    def added(self, name: str) -> Array:
        """(3, h, w) to the means of that light."""
        of_color, around = LIGHTS[name], self._around(name in WIDE)
        if name in IMAGES:  # known of samples alone, but for how much of the pixel has them
            guides, times = self.seen.shown[name], np.ones_like(self.seen.guides.surface)
            if self.finely is not self.seen:
                times = _over(*(s.colors[IMAGES[name]].sum(0) for s in (self.finely, self.seen)))
            fine_guides = guides.covered(times)
            one = self._light(name, self._mean(of_color), self._mean(of_color) * times)
        else:
            guides, fine_guides = self.seen.guides, self.finely.guides
            one = self._light(name, *self._told_over(name))
        if of_color:
            weights = _weights(guides, around)
        else:
            weights = [share * _moved(np.ones_like(guides.surface), x, y) for x, y, share in around]
        predicted = _resolved(self.side, guides, around, weights, one)
        if name not in VOLUME:
            wide = self._around(True)
            _resolve_edges(predicted, guides, fine_guides, wide, weights, one)
        return predicted.added(one.light)

    def _around(self, is_wide: bool) -> list[tuple[int, int, float]]:
        return list(_block(2 * self.side if is_wide else self.side))

    def _mean(self, name: str) -> Array:
        """(3, h, w) of samples; 1 of no name."""
        if not name:
            return np.ones((3, *self.samples.shape))
        return self.parts[name] / self.samples

    def _told_over(self, name: str) -> tuple[Array, Array]:
        """What a light is told over, (3, h, w): as the samples and as all camera rays say."""
        if name in UNSHADOWED:
            return self._mean(UNSHADOWED[name]), self._unshadowed(name)
        color = self._mean(LIGHTS[name])
        return color, self.finely.colors.get(LIGHTS[name], color)

    def _light(self, name: str, color: Array, own_color: Array) -> Resolving:
        """That light, told over these (3, h, w)."""
        of_color, surface, own_surface = LIGHTS[name], color, own_color
        if name in UNSHADOWED:
            surface, own_surface = self._mean(of_color), self.finely.colors[of_color]
        images = np.zeros_like(self.seen.guides.surface)
        if of_color in SHARP:
            images = np.clip(_over(self.sharp[of_color], self.parts[of_color].sum(0)), 0.0, 1.0)
        together = [other for other in (GLOSS if name in GLOSS else (name,)) if other in self.parts]
        return Resolving(
            light=self._mean(name),
            white=np.sum([self.parts[other] for other in together], 0).sum(0) / self.samples,
            color=color,
            own_color=own_color,
            tint=surface.sum(0),
            own_tint=own_surface.sum(0),
            noise=self._noise(together, of_color),
            images=images,
            is_wide=name in WIDE,
        )

    def _unshadowed(self, name: str) -> Array:
        """(3, h, w) what lights would give if nothing hid them, which that light of them is told
        over: as all camera rays say, but for what is noise, of more rays than samples so much less.
        In its place is the mean of the block, over the colour of surfaces.
        """
        light, of_color = UNSHADOWED[name], LIGHTS[name]
        mean, color, own_color = self._mean(light), self._mean(of_color), self.finely.colors
        one = Resolving(
            light=mean,
            white=mean.sum(0),
            color=color,
            own_color=own_color[of_color],
            tint=color.sum(0),
            own_tint=own_color[of_color].sum(0),
            noise=self._noise([light], of_color),
            images=np.zeros_like(self.seen.guides.surface),
            is_wide=False,
            noise_share=self.seen.rays / self.finely.rays,
        )
        block = self._around(False)
        weights = _weights(self.seen.guides, block)
        predicted = _resolved(self.side, self.seen.guides, block, weights, one)
        beside = [
            weight * (_moved(one.tint, x, y) > 0)
            for weight, (x, y, _) in zip(weights, block, strict=True)
            if x or y
        ]
        taken = np.where(np.sum(beside, 0) > 0, predicted.taken, 0.0)
        found = taken * predicted.fine + (1 - taken) * own_color[light]
        return np.where(np.isfinite(found), found, own_color[light])

    def _noise(self, names: list[str], of_color: str) -> Array | None:
        """(h, w) about how far the mean of these lights over their colour is off: half of what the
        halves of the samples differ by. None of few samples: halves of one each tell nothing.
        """
        if self.samples.max() < FIRST_ESTIMATE:
            return None
        count, first = self.samples, _half(self.samples)
        light = np.sum([self.parts[name] for name in names], 0).sum(0)
        half = np.sum([self.halves[name] for name in names], 0)
        color, half_color = 3.0 * count, 3.0 * first
        if of_color:
            color, half_color = self.parts[of_color].sum(0), self.halves[of_color]
        second, rest = color - half_color, count - first
        known = (count > 1) & (half_color > 0) & (second > 0)
        apart = half / np.where(known, half_color, 1.0)
        apart -= (light - half) / np.where(known, second, 1.0)
        return np.where(known, apart * np.sqrt(np.maximum(first * rest, 0)) / count, 0.0)


@dataclass(frozen=True, eq=False)
class Prediction:
    """The light of pixels (3, h, w) as guides and colours predict it: coarse from their samples',
    fine from those of all camera rays. taken: (h, w) how much of that is taken in place of their
    own. known: (3, h, w) bool.
    """

    coarse: Array
    fine: Array
    taken: Array
    known: Array

    def added(self, light: Array) -> Array:
        """(3, h, w) to the pixels' own: what stays of it is scaled where the fine prediction is
        below the coarse one, and raised by the difference where it is above.
        """
        less = self.coarse > self.fine
        part = self.fine / np.where(less, self.coarse, 1.0)
        stays = np.where(less, light * part, light + (self.fine - self.coarse))
        more = self.taken * self.fine + (1 - self.taken) * stays - light
        return np.where(self.known & np.isfinite(more), more, 0.0)


@dataclass(frozen=True, eq=False)
class Resolving:
    """One kind of light. light: (3, h, w) means. color: of what it is told over; own_color: of all
    camera rays. tint, own_tint: (h, w) the channels of the colour of its surfaces. white: (h, w)
    sum of the channels of what is looked at: of gloss what lights and other surfaces give it
    together, as one hides the other. noise: as `Told._noise`, of that; None where all may be.
    images: (h, w) how much of the light is of sharp images, of what gives light, which have no
    points. is_wide: it is averaged over blocks of twice the side. noise_share: (h, w) how much of
    the noise of samples is left of what a pixel tells.
    """

    light: Array
    white: Array
    color: Array
    own_color: Array
    tint: Array
    own_tint: Array
    noise: Array | None
    images: Array
    is_wide: bool
    noise_share: Array | float = 1.0


def _half(samples: Array) -> Array:
    """The largest power of 2 below a number of samples; 1 of one."""
    return np.exp2(np.floor(np.log2(np.maximum(samples - 1, 1))))


def _block(side: int) -> Iterator[tuple[int, int, float]]:
    """The pixels of a block round one, and their shares: each class of pixels counts once."""
    half = side // 2
    for y in range(-half, half + 1):
        for x in range(-half, half + 1):
            yield x, y, (0.5 if abs(x) == half else 1.0) * (0.5 if abs(y) == half else 1.0)


def _weights(guides: Guides, block: list[tuple[int, int, float]]) -> list[Array]:
    """(h, w) of each pixel of a block, how surely it shows the same surface, times its share."""
    return [share * guides.alike(x, y) for x, y, share in block]


def _over(a: Array, b: Array) -> Array:
    return np.where(b > 0, a / np.where(b > 0, b, 1.0), 0.0)


def _resolved(
    side: int,
    guides: Guides,
    block: list[tuple[int, int, float]],
    weights: list[Array],
    one: Resolving,
) -> Prediction:
    """Where pixels of a block are alike; weights: (h, w) how much, of each of these."""
    light, color, noise, images = one.light, one.color, one.noise, one.images

    def over_block(values: Array) -> Array:
        """(3, h, w) sums over each pixel's block."""
        columns = np.moveaxis(values, 0, -1)
        total = np.zeros_like(columns)
        for weight, (x, y, _) in zip(weights, block, strict=True):
            total += weight[..., None] * _moved(columns, x, y)
        return np.moveaxis(total, -1, 0)

    lights, colors, tint = over_block(light), over_block(color), one.tint
    white = _over(one.white, tint)
    mean = _over(*(over_block(values[None])[0] for values in (one.white, tint)))
    apart, changed, chance = (np.zeros_like(white) for _ in range(3))
    square = tint**2
    noises, halved = (np.zeros_like(white), 0.0) if noise is None else (noise, 1.0)
    change = np.full_like(white, -1.0) if one.is_wide else _change(side, guides, white)
    for weight, (x, y, _) in zip(weights, block, strict=True):
        own = weight * _moved(square, x, y)
        off, off_by_chance = (_moved(white, x, y) - mean) ** 2, _moved(noises, x, y) ** 2
        moved = _moved(change, x, y)
        apart += own * off
        changed += own * np.where(
            moved < 0, halved * np.maximum(off - SURE * off_by_chance, 0.0), moved
        )
        chance += own * off_by_chance
    sure = halved * np.maximum(apart - SURE * one.noise_share * chance, 0.0)
    if not one.is_wide:
        along = _along_lines(block, weights, white, tint)
        beyond = np.maximum(apart - SURE * along, apart - SURER * chance)
        sure = np.minimum(sure, np.maximum(changed, beyond))
    stays = images * apart + (1 - images) * sure
    repeats = np.where(apart > stays, 1 - stays / np.where(apart > 0, apart, 1.0), 0.0)
    ratio = _over(lights, colors)
    return Prediction(ratio * color, ratio * one.own_color, repeats, colors > 0)


def _along_lines(
    block: list[tuple[int, int, float]], weights: list[Array], white: Array, tint: Array
) -> Array:
    """(h, w) how far light over its colour, `white`, changes with a step in the direction in which
    that is least, over each pixel's block: as far as it lies apart where it has no direction, next
    to nothing along stripes.
    """
    least = np.full_like(white, np.inf)
    for step in ((1, 0), (0, 1), (1, 1), (1, -1)):
        known = _moved(tint, *step) > 0
        off = np.where(known, (white - _moved(white, *step)) ** 2 / 2, 0.0)
        total, some, all_ = (np.zeros_like(white) for _ in range(3))
        for weight, (x, y, _) in zip(weights, block, strict=True):
            own = weight * _moved(tint**2, x, y)
            total += own * _moved(off, x, y)
            some += own * _moved(known.astype(float), x, y)
            all_ += own
        least = np.minimum(least, np.where(some > 0, total * _over(all_, some), np.inf))
    return least


def _resolve_edges(
    predicted: Prediction,
    guides: Guides,
    finely: Guides,
    block: list[tuple[int, int, float]],
    weights: list[Array],
    one: Resolving,
) -> None:
    """Sets the prediction where surfaces meet: of pixels to which fewer of their own block are
    alike than guides may tell apart of the wider `block`. Their light is what a fit to the guides
    of that block, by least squares, is at their own (Moon, Carr, Yoon 2014, Adaptive rendering
    based on weighted local regression). finely: the guides of all camera rays. weights: as
    `_resolved`, of their own blocks.
    """
    light, color, noise, images = one.light, one.color, one.noise, one.images
    tint, own_tint = one.tint, one.own_tint
    share = np.array([share for _, _, share in block])
    seen = (finely.surface > 0) & (own_tint > 0) & (GUIDES * sum(weights) < share.sum())
    y, x = np.nonzero(seen)
    if not len(y):
        return

    def around(values: Array) -> Array:
        """(81, n, …) of the blocks round these pixels."""
        return np.stack([_moved(values, i, j)[y, x] for i, j, _ in block])

    weight = share[:, None] * around(guides.surface)
    share_here = finely.share[y, x]
    turn_here = (finely.along[..., None] * finely.normal)[y, x] / share_here[:, None]
    middle = len(block) // 2
    part = around(guides.share)
    turn = around(guides.along[..., None] * guides.normal) - part[..., None] * turn_here
    way = part[..., None] * (around(guides.place) - finely.place[y, x])
    whole = (weight * part**2).sum(0)
    way *= np.sqrt(_over(whole, (weight * (way**2).sum(-1)).sum(0)))[:, None]
    tints = around(tint)

    def scale_of(colors: Array) -> Array:
        """(n,) times which they are as large as the share that is of surfaces."""
        return np.sqrt(_over(whole, (weight * around(colors) ** 2).sum(0)))

    full_color, full_tint = scale_of(color.sum(0)), scale_of(tint)

    def fitted(values: Array, colors: Array, own: Array, full: Array) -> tuple[Array, Array]:
        """What is seen at the pixels, (n,), and at those of their blocks, (81, n), of values (h, w)
        and colours times `full` (n,); own: the pixels'.
        """
        tinted = full * (around(colors) - part * own[y, x] / share_here)
        g = np.concatenate([part[..., None], turn, way, tinted[..., None]], -1)
        a = np.einsum("kn,kni,knj->nij", weight, g, g)
        a[:, range(1, GUIDES), range(1, GUIDES)] += FLATTER * a[:, :1, 0]
        b = np.einsum("kn,kni,kn->ni", weight, g, around(values))
        lit = a[:, 0, 0] > 0
        a[~lit] = np.eye(GUIDES)
        slopes = np.linalg.solve(a, b[..., None])[..., 0]
        return slopes[:, 0] * share_here, np.einsum("kni,ni->kn", g, slopes)

    white = one.white
    apart = (weight * (around(white) - fitted(white, tint, own_tint, full_tint)[1]) ** 2).sum(0)
    sure = np.zeros_like(apart)
    if noise is not None:
        chance = (weight * (around(noise) * tints) ** 2).sum(0)
        sure = np.maximum(1 - SURE_FIT * _over(chance, apart), 0.0)
    stays = images[y, x] + (1 - images[y, x]) * sure
    for c in range(3):
        fine, everywhere = fitted(light[c], color[c], one.own_color[c], full_color)
        most = np.maximum((around(light[c]) * (weight > 0)).max(0), 0.0)
        predicted.fine[c, y, x] = np.clip(fine, 0.0, most)
        predicted.coarse[c, y, x] = np.clip(everywhere[middle], 0.0, most)
    predicted.taken[y, x] = np.where(apart > 0, 1 - stays, 0.0)
    predicted.known[:, y, x] = one.own_color[:, y, x] > 0


def _change(side: int, guides: Guides, values: Array) -> Array:
    """(h, w) how far each pixel is from the mean of those a block to either side of it, squared, on
    the axis on which it is farther; below 0 where none of these shows the same surface.
    """
    found = np.full_like(values, -1.0)
    for x, y in ((side, 0), (0, side)):
        after, before = guides.alike(x, y), guides.alike(-x, -y)
        total = after + before
        mean = (after * _moved(values, x, y) + before * _moved(values, -x, -y)) / np.where(
            total > 0, total, 1.0
        )
        found = np.maximum(found, np.where(total > 0, (values - mean) ** 2, -1.0))
    return found
