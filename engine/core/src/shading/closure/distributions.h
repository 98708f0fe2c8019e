// Distributions of half vectors, how they are drawn from, and what is times them: masking and
// Fresnel factors (semantics/lobes.md). A lobe's exponent p is that of a power; of another
// distribution that of a power which is as wide.
#pragma once
#include "shading/closure/rows.h"
#include "shading/stage_math.h"

namespace glint {
namespace {

/// The angle between a unit vector and a half vector of any length.
class Slope {
 public:
  Slope(const Three& n, const Three& h) : cosine(dot(n, h)), sharp(cosine > 0) {
    const Three s = cross(n, h);
    sine2 = dot(s, s);
  }
  Doubles length2() const { return cosine * cosine + sine2; }
  /// log(1 + tan^2), worked out where somebody asks.
  Doubles log() {
    if (!known_) log_ = logarithm_of_one_and(sine2, cosine * cosine);
    known_ = true;
    return log_;
  }
  Doubles cosine, sine2;  // the latter squared; both times the length of the half vector
  Mask sharp;             // below a right angle

 private:
  bool known_ = false;
  Doubles log_;
};

/// max(0, cos)^p with 0^0 = 1 (Blinn-Phong, notes 4.13).
inline Doubles highlight(Slope& at, Doubles p) {
  return choose(p == 0, splat(1), where(at.sharp, exponential(-0.5 * p * at.log())));
}

/// One over the square of the width alpha of the GGX lobe, or Beckmann's, that is as wide as a
/// power (Walter, Marschner, Li, Torrance 2007, section 5.2).
inline Doubles over_width2(Doubles p) { return 0.5 * (p + 2); }

/// GGX's density of half vectors over that of the normal (Trowbridge, Reitz 1975; Walter and others
/// 2007). sine2: of the half vector, stretched or not.
inline Doubles ggx(const Slope& at, Doubles sine2, Doubles p) {
  const Doubles share = at.length2() / (at.cosine * at.cosine + over_width2(p) * sine2);
  return where(at.sharp, share * share);
}

/// Beckmann's density of half vectors over that of the normal (Beckmann, Spizzichino 1963).
/// slopes2: the square of the half vector's part along the surface, stretched or not.
inline Doubles beckmann(Slope& at, Doubles slopes2, Doubles p) {
  const Doubles tangent2 = smaller(slopes2 / (at.cosine * at.cosine), splat(1e30));
  return where(at.sharp, exponential(2 * smaller(at.log(), splat(70)) - over_width2(p) * tangent2));
}

/// Where a rough lobe is seen from: v, or the nearest direction that is not behind n.
inline Three seen_from(const Three& n, const Three& v) {
  const Doubles cosine = dot(n, v);
  const Mask behind = cosine < 0;
  return any(behind) ? choose(behind, unit(v - cosine * n), v) : v;
}

/// How densely `sample_visible_normal` draws half vectors h, over their density and times pi
/// alpha^2 / (4 v.h): nv, vh, cosines with `seen_from`'s v; rest2: of v what lies along the
/// surface, squared and stretched as alpha^2 is.
inline Doubles visible_share(Doubles nv, Doubles vh, Doubles rest2, Doubles p) {
  return 2 * vh / (nv + root(nv * nv + rest2 / over_width2(p)));
}

/// A half vector as densely as they are seen from v in GGX of widths ax along t1 and ay along t2
/// (Heitz 2018, Sampling the GGX Distribution of Visible Normals). x, y: a place of the unit disc.
/// v: as `seen_from` has it.
inline Three sample_visible_normal(const Three& n, const Three& t1, const Three& t2, Doubles ax,
                                   Doubles ay, const Three& v, Doubles x, Doubles y) {
  Three s = unit({ax * dot(v, t1), ay * dot(v, t2), larger(dot(v, n), splat(0))});
  s.z = choose(nonzero(s), s.z, splat(1));
  const Doubles across = root(s.x * s.x + s.y * s.y), one = splat(1), none = splat(0);
  const Mask slants = across > 0;
  const Doubles size = choose(slants, across, one), cosine = choose(slants, -s.y / size, one),
                sine = choose(slants, s.x / size, none);
  // the disc's lower part is foreshortened as the hemisphere is seen
  const Doubles bent = 0.5 * (1 + s.z), x2 = x * x,
                up = (1 - bent) * root(larger(1 - x2, none)) + bent * y,
                out = root(larger(1 - x2 - up * up, none));
  const Three h = x * Three{cosine, sine, none} +
                  up * Three{-s.z * sine, s.z * cosine, s.x * sine - s.y * cosine} + out * s;
  return unit(larger(h.z, none) * n + ax * h.x * t1 + ay * h.y * t2);
}

/// Ashikhmin and Shirley's density of half vectors over that of the normal, a power (2000), whose
/// slopes are stretched where slopes2 is: as of Beckmann's.
inline Doubles ashikhmin_shirley(Slope& at, Doubles slopes2, Doubles p) {
  const Doubles log = logarithm_of_one_and(slopes2, at.cosine * at.cosine);
  return where(at.sharp, exponential(-0.5 * ((p + 4) * log - 4 * at.log())));
}

/// The squared cosine of half vectors that are drawn from a power p, or from a distribution other
/// than GGX that is as wide; share: of the lobe that is nearer to the normal, below 1.
inline Doubles drawn_cosine2(Doubles share, Doubles p, Doubles distribution) {
  const Doubles log = logarithm_of_one_and(share, 1 - share),
                more = choose(distribution > 0, splat(2), splat(1)),
                power = exponential(-2 * log / (p + more));
  return choose(distribution == MicrofacetRow::kBeckmann, 1 / (1 + log / over_width2(p)), power);
}

/// What a highlight is times beside its power (semantics/lobes.md): cosines n.l, n.v and v.h, one
/// light and one direction of view a lane.
class Gloss {
 public:
  Gloss(Doubles nl, Doubles nv, Doubles vh) : nl_(nl), nv_(nv), vh_(vh) {}

  /// masking2: alpha squared, 0 for none. fresnel, distribution: as MicrofacetRow has them.  Edged:
  /// some lobe of the scene may have the weight of edges.
  template <bool Edged = false>
  Doubles factor(Doubles masking2, Doubles fresnel, Doubles distribution = Doubles{}) {
    if (bits((masking2 != masking2_) | (distribution != distribution_))) {
      const Doubles rest = 1 - masking2, down = nl_ * root(masking2 + rest * nv_ * nv_) +
                                                nv_ * root(masking2 + rest * nl_ * nl_);
      masking2_ = masking2;
      distribution_ = distribution;
      masking_ = choose(masking2 > 0, 2 * nl_ / down, splat(1));
      const Mask is_beckmann = distribution == MicrofacetRow::kBeckmann;
      if (any(is_beckmann))
        masking_ =
            choose(is_beckmann, beckmanns(masking2 * (1 - nv_ * nv_), masking2 * (1 - nl_ * nl_)),
                   masking_);
      const Mask is_power = distribution == MicrofacetRow::kAshikhminShirley;
      if (any(is_power)) masking_ = choose(is_power, ashikhmin_shirleys(masking2), masking_);
    }
    return with_fresnel<Edged>(masking_, fresnel);
  }

  /// The same of a lobe that is stretched: of the directions v and l what the squares of their
  /// parts along the surface are times alpha^2.
  Doubles stretched_factor(Doubles masking2, Doubles fresnel, Doubles distribution, Doubles v,
                           Doubles l) {
    const Doubles down =
        nl_ * root(nv_ * nv_ + masking2 * v) + nv_ * root(nl_ * nl_ + masking2 * l);
    Doubles masking = choose(masking2 > 0, 2 * nl_ / down, splat(1));
    const Mask is_beckmann = distribution == MicrofacetRow::kBeckmann;
    if (any(is_beckmann))
      masking = choose(is_beckmann, beckmanns(masking2 * v, masking2 * l), masking);
    const Mask is_power = distribution == MicrofacetRow::kAshikhminShirley;
    if (any(is_power)) masking = choose(is_power, ashikhmin_shirleys(masking2), masking);
    return with_fresnel<true>(masking, fresnel);
  }

 private:
  /// What takes the place of masking in Ashikhmin and Shirley's model (2000).
  Doubles ashikhmin_shirleys(Doubles masking2) const {
    const Doubles down = vh_ * larger(nv_, nl_);
    return where(down > 0, (1 - 0.5 * masking2) * nl_ / down);
  }
  /// Beckmann's masking, both over n.v, by Walter, Marschner, Li, Torrance 2007, equation 27. v2,
  /// l2: of each direction alpha^2 times the square of its part along the surface.
  Doubles beckmanns(Doubles v2, Doubles l2) const {
    const auto lambda = [](Doubles cosine, Doubles along2) {
      const Doubles a = cosine / root(along2), above = 1 + a * (-1.259 + 0.396 * a),
                    below = a * (3.535 + 2.181 * a);
      return where(a < 1.6, above / below);
    };
    const Doubles down = nv_ * (1 + lambda(nv_, v2) + lambda(nl_, l2));
    return where(down > 0, 1 / down);
  }
  /// Lobes of one shader share their reflectance.
  template <bool Edged>
  Doubles with_fresnel(Doubles result, Doubles fresnel) {
    if (bits(fresnel != fresnel_)) {
      fresnel_ = fresnel;
      reflectance_ = choose(fresnel < 0, schlick_weight(vh_), splat(1));
      const Mask edge = fresnel == MicrofacetRow::kEdge;
      if (Edged && bits(edge)) reflectance_ = choose(edge, edge_weight(), reflectance_);
      const Mask dielectric = fresnel > 0;
      if (any(dielectric)) {
        const Doubles ior = choose(dielectric, fresnel, splat(1));
        reflectance_ = choose(dielectric, fresnel_reflectance(vh_, ior), reflectance_);
      }
    }
    return result * reflectance_;
  }
  /// What metals lack some 8 degrees off the surface, where it is 1 (Kutz, Hasan, Edmondson 2021).
  Doubles edge_weight() const { return 823543.0 / 46656 * vh_ * (1 - vh_) * schlick_weight(vh_); }

  Doubles nl_, nv_, vh_, masking2_ = splat(0), distribution_ = splat(0), masking_ = splat(1);
  Doubles fresnel_ = splat(0), reflectance_ = splat(1);
};

/// About what a highlight of GGX's masking gives back of even light, seen at this cosine: a power
/// as it does straight from above and where it mirrors, ever less slanting the wider the lobe; GGX
/// within 13 % of the integral, Ashikhmin and Shirley's on average within 7 %.
template <bool Edged = true>
inline Doubles of_even_light(Doubles seen, Doubles p, Doubles masking2, Doubles fresnel,
                             Doubles distribution) {
  const Doubles cosine = root(seen * seen + 2 * (1 - seen * seen) / (p + 8));
  const Mask is_ggx = distribution == MicrofacetRow::kGgx,
             is_power = distribution == MicrofacetRow::kAshikhminShirley;
  Doubles power{}, whole{};
  if (!all(is_ggx | is_power))
    power = 8 / (p + 2 + 8 / (4 + p * p)) * cosine *
            Gloss(cosine, cosine, cosine).factor<Edged>(masking2, fresnel);
  if (!any(is_ggx | is_power)) return power;
  const Doubles width2 = 1 / over_width2(p), above = 1 / (1 + width2 * (1.2 + 1.05 * root(width2)));
  const Doubles reflected = Gloss(cosine, cosine, cosine).factor<Edged>(splat(0), fresnel);
  whole = 4 * width2 * (above + (1 - above) * (0.7 * (1 - seen) * (1 - seen))) * reflected;
  if (any(is_power))
    whole = choose(is_power, 4 * width2 * (1 - 0.79 * root(width2)) * reflected, whole);
  return choose(is_ggx | is_power, whole, power);
}

}  // namespace
}  // namespace glint
