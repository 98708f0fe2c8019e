"""Why a pixel has its colour: its rays with the notes' terms in numbers (sections 4.12-4.17), by
the float64 reference.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from ..errors import SceneError
from ..explained import Bounce, Hit, LightTerm, Ray
from ..scene import Scene
from ..scene.problems import scene_problems
from ..settings import Settings


class PixelExplainer:
    """Explains pixels of one scene, which is made ready once. Raises SceneError for a scene or
    settings that are not sound.
    """

    def __init__(self, scene: Scene, settings: Settings) -> None:
        problems = settings.problems() + scene_problems(scene)
        if problems:
            raise SceneError("\n".join(problems))
        # two fifths of the engine's lines: Blender starts without them
        from ..reference.explain import Explainer

        self._resolution = scene.camera.resolution
        self._explainer = Explainer(scene, settings)

    def pixel(self, x: int, y: int) -> Ray:
        """The ray through the centre of pixel (x, y) of the full frame, counted from the bottom
        left, and all that follow from it.

        Its `color` is what a picture of one sample has there before light is averaged over pixels.
        Raises SceneError for a pixel outside.
        """
        width, height = self._resolution
        if not (0 <= x < width and 0 <= y < height):
            raise SceneError(f"pixel ({x}, {y}) is outside the frame of {width} by {height}")
        return self._explainer.pixel(x, y)


def explanation_lines(ray: Ray) -> tuple[str, ...]:
    """What a pixel shows in plain words, then the tree of rays, two spaces a generation."""
    return (summary(ray), *_ray_lines(ray, 0))


def summary(ray: Ray) -> str:
    """One sentence: what the pixel shows, which lights make which share of its luminance, and what
    keeps others from it.
    """
    if not any(ray.weight):
        return "Nothing is seen here: the pixel is beyond the picture of the lens"
    what = (
        f"'{ray.hit.thing}' with the material '{ray.hit.material}'"
        if ray.hit
        else "Nothing but the surroundings"
    )
    if ray.hit and ray.hit.holdout:
        return f"{what} is a holdout: the camera sees nothing of it"
    if ray.hit and any(ray.hit.hole):
        what = f"{what} leaves a hole of {_rgb(ray.hit.hole)}"
    if ray.hit and ray.hit.caught:
        what = f"{what} catches shadows: {_rgb(ray.hit.caught)} of its light is left"
    shares = _listed_shares(_contributions(ray))
    lit = f": lit by {shares}" if shares else ": no light comes from here"
    blocked = (
        [f"{light} is blocked by {thing}" for light, thing in _blocked(ray.hit)] if ray.hit else []
    )
    lens = ["other samples look through other points of the lens"] if ray.kind == "lens" else []
    return "; ".join([what + lit, *blocked, *lens, *_sharing(ray.hit)])


def _sharing(hit: Hit | None) -> list[str]:
    """What is told where lights share shadow rays."""
    if hit is None:
        return []
    return [
        f"each sample of the picture looks for the shadows of {rays} of {samples} {of}, here all "
        "are looked for"
        for (rays, samples), of in (
            (hit.shared, "samples of lamps (Lamp Shadows)"),
            (hit.shared_media, "points of glowing media"),
        )
        if samples
    ]


def _contributions(ray: Ray, way: str = "") -> Iterator[tuple[str, float]]:
    """(source, luminance) of all that a ray and those after it bring. way: by which the first of
    them left the camera's line.
    """
    yield from ((name + way, _luminance(ray.weight, radiance)) for name, radiance in ray.shapes)
    for name, light in ray.media:
        yield (f"{name} in volumes" if name else "volumes") + way, _luminance(ray.weight, light)
    weight = tuple(sent * left for sent, left in zip(ray.weight, ray.passed, strict=True))
    yield "the surroundings" + way, _luminance(weight, ray.background)
    if ray.hit is not None and not (ray.hit.holdout or ray.hit.caught):
        yield "ambient light" + way, _luminance(weight, ray.hit.ambient)
        yield f"the glow of '{ray.hit.thing}'" + way, _luminance(weight, ray.hit.emission)
        for term in ray.hit.lights:
            for part in (term.diffuse, term.specular):
                side = " (from behind)" if term.behind else ""
                yield term.light + side + way, _luminance(weight, part, term.shadow)
    for after in ray.follow:
        yield from _contributions(after, way or _WAYS.get(after.kind, ""))


_WAYS = {
    "mirror": " (mirrored)",
    "reflection": " (reflected by a rough surface)",
    "refraction": " (refracted)",
    "bounce": " (thrown on by other surfaces)",
    "subsurface": " (from below the surface)",
}
_LUMINANCE = (0.2126, 0.7152, 0.0722)
_NAMED = 4
"""Sources that a sentence names at most."""


def _luminance(*factors: tuple[float, ...]) -> float:
    """Of the product of RGB colours."""
    return sum(
        weight * math.prod(channels) for weight, *channels in zip(_LUMINANCE, *factors, strict=True)
    )


def _listed_shares(contributions: Iterator[tuple[str, float]]) -> str:
    """'Sun 60 %, Softbox 30 %', the largest first; "" without any light."""
    sums: dict[str, float] = {}
    for name, luminance in contributions:
        sums[name] = sums.get(name, 0.0) + luminance
    total = sum(map(abs, sums.values()))
    if not 0 < total < math.inf:
        return ""
    shares = sorted(
        ((100 * value / total, name) for name, value in sums.items()),
        key=lambda share: -abs(share[0]),
    )
    named = [(share, name) for share, name in shares[:_NAMED] if abs(share) >= 1]
    rest = 100 - sum(abs(share) for share, _ in named)
    return ", ".join(
        [f"{name} {share:.0f} %" for share, name in named]
        + ([f"others {rest:.0f} %"] if rest >= 1 else [])
    )


def _blocked(hit: Hit) -> list[tuple[str, str]]:
    """(light, thing) for the lights of which nothing comes through, the first thing in their
    way.
    """
    by_light: dict[str, list[LightTerm]] = {}
    for term in hit.lights:
        by_light.setdefault(term.light, []).append(term)
    dark = {
        light: terms
        for light, terms in by_light.items()
        if not any(any(term.shadow) for term in terms)
    }
    return [(light, f"'{terms[0].blocker}'") for light, terms in dark.items() if terms[0].blocker]


def _ray_lines(ray: Ray, level: int) -> Iterator[str]:
    pad = "  " * level
    yield (
        f"{pad}{ray.kind} ray, T = {_rgb(ray.weight)}: brings {_rgb(ray.color)}, "
        f"{_rgb(ray.own)} "
        "of it by itself"
    )
    yield f"{pad}  from {_rgb(ray.origin)} along {_rgb(ray.direction)}"
    if any(left != 1 for left in ray.passed):
        yield f"{pad}  media on its way leave {_rgb(ray.passed)} of it"
    if ray.held != 1:
        yield f"{pad}  Clamp Indirect leaves {ray.held:.3g} of what it finds"
    if ray.cells:
        yield f"{pad}  media that vary are looked at {ray.cells} times on its way"
    for name, light in ray.media:
        what = f"scatter of the light '{name}'" if name else "give of themselves"
        yield f"{pad}  media on its way {what}: {_rgb(light)}"
    for name, radiance in ray.shapes:
        yield f"{pad}  sees the light '{name}': {_rgb(radiance)}"
    if ray.kind == "subsurface":
        yield f"{pad}  a probe found where light comes out that went below the surface"
    if ray.hit is None:
        yield f"{pad}  meets nothing: the surroundings are {_rgb(ray.background)}"
    else:
        yield from (f"{pad}  {line}" for line in _hit_lines(ray.hit))
    for after in ray.follow:
        yield from _ray_lines(after, level + 1)


def _hit_lines(hit: Hit) -> Iterator[str]:
    place = f" ({hit.place + 1}. instance)" if hit.place else ""
    yield (
        f"meets '{hit.thing}'{place}, primitive {hit.primitive}, at {hit.depth:.6g}; "
        "barycentric "
        f"{_rgb(hit.barycentric)}"
    )
    yield f"x = {_rgb(hit.position)}, n = {_rgb(hit.normal)}, material '{hit.material}'"
    if hit.moved is not None:
        came, rose, goes, rises = (-pixels for pixels in hit.moved)
        yield (
            f"since the frame before it moved {came:.6g} pixels to the right and {rose:.6g} up, to "
            f"the next one it moves {goes:.6g} and {rises:.6g}"
        )
    if hit.open is not None:
        yield f"of an even sky it sees {_rgb(hit.open)} (Ambient Occlusion, one sample)"
    if hit.holdout:
        yield "it is a holdout: the camera sees nothing of it"
        return
    if any(hit.hole):
        yield f"its Holdout shader leaves a hole: {_rgb(hit.hole)} of the ray"
    if hit.resolved > 1:
        yield (
            f"light is averaged over {hit.resolved} x {hit.resolved} pixels of this surface: "
            "Resolved; here is what this pixel finds by itself"
        )
    if hit.photons:
        yield "what photons bring here by way of mirrors and glass is not told"
    if hit.caught:
        yield (
            "it catches shadows: with what stands there it has "
            f"{_rgb(hit.caught)} of the light that it has alone"
        )
    yield f"k_a I_a = {_rgb(hit.ambient)}"
    if any(hit.emission):
        yield f"k_e = {_rgb(hit.emission)}"
    yield from (line for term in hit.lights for line in _light_lines(term))
    if hit.bounce is not None:
        yield from _bounce_lines(hit.bounce)


def _bounce_lines(bounce: Bounce) -> Iterator[str]:
    """How the path goes on, where that is not plain."""
    if bounce.before == bounce.most:
        times = "once" if bounce.most == 1 else f"{bounce.most} times"
        yield f"from here light bounces {times} to the pixel: Diffuse Bounces has no more"
    elif bounce.before:
        way = "is not: the path ends here" if bounce.ends else "is, and T is divided by the chance"
        yield (
            f"a ray goes on with a chance of {bounce.share:.6g}, where the sample's number is "
            f"below that: {bounce.number:.6g} {way}"
        )


def _light_lines(term: LightTerm) -> Iterator[str]:
    number = f" (sample {term.sample + 1})" if term.sample else ""
    number += " on the other side" if term.behind else ""
    cosines = f"n·l = {term.n_dot_l:.6g}, n·h = {term.n_dot_h:.6g}"
    group = f" in the light group '{term.group}'" if term.group else ""
    yield (
        f"'{term.light}'{number}{group}: {cosines}, I = {_rgb(term.intensity)}, distance "
        f"{term.distance:.6g}"
    )
    if term.n_dot_l <= 0:
        yield "  it shines from behind"
        return
    if term.bump_shadow == 0:
        yield "  it shines from behind the surface that is bumped"
        return
    blocked = (
        f", blocked by '{term.blocker}' at {term.blocker_distance:.6g}" if term.blocker else ""
    )
    yield (
        f"  k_d I n·l = {_rgb(term.diffuse)}, k_s I (n·h)^p = {_rgb(term.specular)}, S = "
        f"{_rgb(term.shadow)}{blocked}"
    )
    if term.bump_shadow != 1:
        yield f"  bumps leave {term.bump_shadow:.6g} of it to what is matt"
    if term.lowered != 1:
        yield f"  the object's Shading Offset leaves {term.lowered:.6g} of light from there"


def _rgb(values: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
