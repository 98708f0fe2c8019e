"""What Explain Pixel tells of a ray: the terms of the notes' formulas in numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class LightTerm:
    """One sample of a light at a point. Colours are RGB; directions are unit, in the world.

    to_light: l.  n_dot_l, n_dot_h: cosines.  intensity: I.  distance: to the light's sample,
    infinite for a sun. shadow: S.  blocker: name of the first thing in between, "" for none;
    blocker_distance: how far it is. diffuse, specular: k_d I max(0, n·l) and k_s I max(0, n·h)^p,
    before the shadow. Directions drawn from narrow highlights are samples too, without diffuse
    light; both kinds have a share of the highlight. group: name of its light group, "" for none.
    bump_shadow: the share that matt lobes get for the bumps that the normal is of; 0 where these
    hide all.  lowered: what is left of it where the surface sees light lower than it stands, 1 for
    all.  behind: it lights the other side of the surface, which lets it through.
    """

    light: str
    sample: int
    to_light: Numbers
    n_dot_l: float
    n_dot_h: float
    intensity: Numbers
    distance: float
    shadow: Numbers
    blocker: str
    blocker_distance: float
    diffuse: Numbers
    specular: Numbers
    group: str = ""
    bump_shadow: float = 1.0
    lowered: float = 1.0
    behind: bool = False


@dataclass(frozen=True)
class Bounce:
    """How a path goes on from what is matt: it has bounced `before` times of `most`; of rays there
    the share `share` goes on, those whose number `number` of [0, 1) is below it.
    """

    before: int
    most: int
    share: float
    number: float

    @property
    def ends(self) -> bool:
        """Whether the path does not go on."""
        return self.before == self.most or not self.number < self.share


@dataclass(frozen=True)
class Hit:
    """Where a ray meets a surface, world space.

    thing: name of the object. place: which row of its matrices. primitive: which triangle, sphere,
    polygon or segment of hair. barycentric: weights of a triangle's corners or of a segment's ends,
    zeros elsewhere. depth: ray parameter; of camera rays the depth along the view. normal: n,
    turned to the viewer. ambient, emission: k_a I_a and k_e. holdout: nothing is seen here. hole:
    what HOLDOUT lobes take of the camera's ray. caught: of a shadow catcher that the camera sees,
    the share of its light that other things leave to it; None elsewhere. moved: (4,) pixels, as the
    pass Vector has them; None where the scene has no neighbours. shared: of how many shadow rays of
    a sample how many samples of lamps have a share; zeros where each has its own. shared_media: the
    same of points of glowing media; zeros without such. resolved: side of the blocks of pixels over
    which the picture averages what light is met here, 1 where it does not. photons: how many the
    picture follows, whose light is not in here; 0 of all but what the camera sees. open: the share
    of an even sky, as the pass Ambient Occlusion has it of one sample; None where it is not asked
    for. bounce: how light goes on from here along the path; None where it does not bounce.
    """

    thing: str
    place: int
    primitive: int
    material: str
    barycentric: Numbers
    depth: float
    position: Numbers
    normal: Numbers
    geometric_normal: Numbers
    ambient: Numbers
    emission: Numbers
    lights: tuple[LightTerm, ...]
    holdout: bool = False
    hole: Numbers = (0.0, 0.0, 0.0)
    caught: Numbers | None = None
    moved: Numbers | None = None
    shared: tuple[int, int] = (0, 0)
    shared_media: tuple[int, int] = (0, 0)
    resolved: int = 1
    photons: int = 0
    open: Numbers | None = None
    bounce: Bounce | None = None

    @property
    def light(self) -> tuple[float, ...]:
        """k_a I_a + k_e + Σ (diffuse + specular) S."""
        total = [a + e for a, e in zip(self.ambient, self.emission, strict=True)]
        for term in self.lights:
            for c, shadow in enumerate(term.shadow):
                total[c] += (term.diffuse[c] + term.specular[c]) * shadow
        return tuple(total)


@dataclass(frozen=True)
class Ray:
    """A ray and those that follow from it.

    kind: camera, or lens for one through a point of the camera's, mirror, refraction, reflection
    (by a rough surface), bounce (by which light bounces along a path), subsurface (to where light
    that went below a surface comes out) or transparent (the same ray beyond a surface). weight: T.
    origin, direction: world. hit: None for the surroundings, of which it sees `background`. passed:
    what media leave of it on its way, which `shapes` have in them. media: what these scatter of
    lights, by their names, and "" what they give of themselves. shapes: (name, radiance) of the
    lights whose shape it sees. own: what it brings to the pixel itself, T times its terms; color:
    with all that follow from it. cells: in how many parts it sees media that vary. held: what
    share is left of what it finds, where that is more than a ray may bring.
    """

    kind: str
    depth: int
    weight: Numbers
    origin: Numbers
    direction: Numbers
    hit: Hit | None
    background: Numbers
    shapes: tuple[tuple[str, Numbers], ...]
    own: Numbers
    color: Numbers
    follow: tuple[Ray, ...]
    passed: Numbers = (1.0, 1.0, 1.0)
    media: tuple[tuple[str, Numbers], ...] = ()
    cells: int = 0
    held: float = 1.0

    def times(self, share: Numbers) -> Ray:
        """What a pixel gets of it that gets so much, red, green and blue, of what it brings."""
        weight, own, color = (
            tuple(k * value for k, value in zip(share, values, strict=True))
            for values in (self.weight, self.own, self.color)
        )
        follow = tuple(ray.times(share) for ray in self.follow)
        return replace(self, weight=weight, own=own, color=color, follow=follow)
