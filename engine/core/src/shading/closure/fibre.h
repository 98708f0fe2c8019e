// FIBRE lobes: what strands give back of light, and directions sampled from it
// (semantics/lobes.md). Letters: l direction to the light, v to the viewer, n shading normal, t
// tangent, d ray, k number of a group of points.
#pragma once
#include <initializer_list>

#include "shading/closure/lobe_row.h"
#include "shading/stage_math.h"

namespace glint {
namespace {

/// What is times a FIBRE lobe that fans light out less than all round: u^(q - 1), u half of one
/// plus the cosine from the viewer's side, or from the other.
inline Doubles fan(Doubles turned, Doubles q, Doubles behind) {
  const Doubles u = 0.5 * (1 + behind * smaller(larger(turned, splat(-1)), splat(1)));
  const Doubles power = exponential((1 - q) * logarithm_of_one_and(1 - u, u));
  return choose(q > 0, root(kCircle * (2 * q + 0.5) / 8) * where(u > 0, power), splat(1));
}

/// How l and v lie to a FIBRE lobe's tangent t, which leans by the tangent `tilt`.
struct FibreAngles {
  Doubles to_l, to_v, across_l, across_v;  // sines and cosines off the plane across t
  Doubles along, across;  // half of both angles together, leant, has the tangent along / across
  Doubles turned;         // cosine of the angle round t from v to l
  FibreAngles(const Three& t, Doubles tilt, const Three& v, const Three& l)
      : to_l(dot(t, l)),
        to_v(dot(t, v)),
        across_l(root(larger(1 - to_l * to_l, splat(0)))),
        across_v(root(larger(1 - to_v * to_v, splat(0)))),
        along((to_l + to_v) + tilt * (across_l + across_v)),
        across((across_l + across_v) - tilt * (to_l + to_v)) {
    const Doubles both = across_l * across_v;
    turned = where(both > 0, (dot(l, v) - to_l * to_v) / both);
  }
};

/// The tangent of a lobe, as long as the fibre is thick; 0 where there is none.
inline Three fibre_tangent(const LitPoints& s, size_t k, int kind, int number) {
  return LobeRow(s, k, kind, number).three(FibreRow::kTangent);
}

/// The modified Bessel function of order 0, I0(x) of x >= 0, times e^-x and times the exponential
/// of `off` (Abramowitz and Stegun 9.8.1, 9.8.2: within 2e-7).
inline Doubles scaled_bessel(Doubles x, Doubles off) {
  const Mask small = x < 3.75;
  const Doubles t = choose(small, x, splat(0)) * (1 / 3.75), t2 = t * t,
                s = 3.75 / choose(small, splat(3.75), x);
  const Doubles
      near =
          1 + t2 * (3.5156229 +
                    t2 * (3.0899424 +
                          t2 * (1.2067492 + t2 * (0.2659732 + t2 * (0.0360768 + t2 * 0.0045813))))),
      far = 0.39894228 +
            s * (0.01328592 +
                 s * (0.00225319 +
                      s * (-0.00157565 +
                           s * (0.00916281 +
                                s * (-0.02057706 +
                                     s * (0.02635537 + s * (-0.01647633 + s * 0.00392377)))))));
  return exponential(choose(small, off - x, off)) *
         choose(small, near, far / root(choose(small, splat(1), x)));
}

/// How light is spread along a fibre (d'Eon and others 2011, as Chiang and others 2016 have it),
/// for a variance of 4 / p: its integral over all l, times the cosine off the plane across t, is 1.
inline Doubles spread_along(const FibreAngles& at, Doubles tilt, Doubles p) {
  const Doubles size = 1 / (1 + tilt * tilt), turned = size * (1 - tilt * tilt),
                by = size * (2 * tilt), v = 0.25 * p, to_v = at.to_v * turned + at.across_v * by,
                both = at.across_l * magnitude(at.across_v * turned - at.to_v * by);
  const Doubles whole = v / (1 - exponential(-2 * larger(v, splat(0x1p-12)))),
                wide = 0.5 + v * (0.5 + v * (1.0 / 6));
  return choose(v < 0x1p-12, wide, whole) *
         scaled_bessel(v * both, v * smaller(both - at.to_l * to_v - 1, splat(0)));
}

/// What a FIBRE_DIFFUSE lobe gives back of light along l (Kajiya and Kay). cosine: n.l.
__attribute__((noinline)) Doubles eval_matt_fibre(const LitPoints& s, size_t k, int number,
                                                  const Three& l, Doubles cosine) {
  const Doubles to_l = dot(unit(fibre_tangent(s, k, GLINT_FIBRE_DIFFUSE, number)), l);
  return where(cosine > 0, (2 / kCircle) * root(larger(1 - to_l * to_l, splat(0))));
}

/// The same of a FIBRE_SPECULAR or FIBRE_TRANSMISSION lobe.
__attribute__((noinline)) Doubles eval_fibre(const LitPoints& s, size_t k, int kind, int number,
                                             const Three& l, Doubles cosine) {
  const LobeRow row(s, k, kind, number);
  const bool behind = kind == GLINT_FIBRE_TRANSMISSION;
  const Doubles tilt = row.number(FibreRow::kTilt);
  const FibreAngles at(unit(fibre_tangent(s, k, kind, number)), tilt, -load3(s.d, k), l);
  const Doubles fanned = fan(at.turned, row.number(FibreRow::kFan), splat(behind ? -1 : 1));
  return where(behind ? cosine < 0 : cosine > 0,
               fanned * spread_along(at, tilt, row.number(FibreRow::kExponent)));
}

/// How far light from l goes through the fibres of a group of points that let it through: chords of
/// cylinders; 0 where it comes from before, or nothing does.
inline Doubles way_through(const LitPoints& s, size_t k, const Three& l) {
  const Doubles behind = larger(-dot(load3(s.n, k), l), splat(0));
  Doubles way = splat(0);
  for (int number = 0; number < s.lobes.layout->of[GLINT_FIBRE_TRANSMISSION].count; ++number) {
    const Three t = fibre_tangent(s, k, GLINT_FIBRE_TRANSMISSION, number);
    const Mask here = nonzero(t);
    if (!bits(here)) continue;
    const Doubles thick = length(t), along = dot(unit(t), l),
                  chord = thick * behind / larger(1 - along * along, splat(1.0 / 64));
    way = choose(here & (chord < 0x1p60), larger(way, chord), way);
  }
  return way;
}

/// Directions sampled from one FIBRE lobe that is not matt: along the strand the tangent of half
/// the angle to the mirrored cone is Student's of two degrees of freedom, round it that of half the
/// angle to the viewer, or to behind, Cauchy's. Both have closed inverses, and tails above any
/// power of a cosine, so that no weight is without bound (docs/decisions/0068-strands-by-paths.md).
struct FibreSampler {
  Three t, v;
  Doubles tilt, way, along2, round2;  // way: -1 for behind.  squares of both widths

  FibreSampler(const LitPoints& s, size_t k, int kind, int number)
      : t(unit(fibre_tangent(s, k, kind, number))),
        v(-load3(s.d, k)),
        way(splat(kind == GLINT_FIBRE_TRANSMISSION ? -1 : 1)) {
    const LobeRow row(s, k, kind, number);
    tilt = row.number(FibreRow::kTilt);
    along2 = 1 / (row.number(FibreRow::kExponent) + 1);
    const Doubles q = row.number(FibreRow::kFan);
    round2 = 1 / (2 * choose(q > 0, q, splat(1)) + 1);
  }

  /// Unit, at the point (x, y) of the unit disc; 0 where it leads beyond the strand's end.
  Three sample(Doubles x, Doubles y) const {
    const Doubles to_v = dot(t, v), across_v = root(larger(1 - to_v * to_v, splat(0))),
                  u = smaller(larger(x * x + y * y, splat(0x1p-40)), splat(1 - 0x1p-40)),
                  tan = root(along2 / (2 * u * (1 - u))) * (2 * u - 1),
                  size = 1 / ((1 + tan * tan) * (1 + tilt * tilt)),
                  sine = size * (2 * tan * (1 - tilt * tilt) - 2 * tilt * (1 - tan * tan)),
                  cosine = size * ((1 - tan * tan) * (1 - tilt * tilt) + 4 * tan * tilt),
                  to_l = sine * across_v - cosine * to_v,
                  across_l = cosine * across_v + sine * to_v,
                  aside = choose(magnitude(y) > 0x1p-40, y, splat(0x1p-40)),
                  turn = root(round2) * (root(u) + x) / aside;
    Three e1, e2;
    frame(t, e1, e2);
    const Mask seen = across_v > 0x1p-20;
    e1 = choose(seen, (1 / choose(seen, across_v, splat(1))) * (v - to_v * t), e1);
    e2 = cross(t, e1);
    const Doubles part = way * across_l / (1 + turn * turn);
    return where(across_l > 0, to_l * t + part * ((1 - turn * turn) * e1 + 2 * turn * e2));
  }

  /// A steradian.
  Doubles pdf(const Three& l) const {
    const FibreAngles at(t, tilt, v, l);
    const Doubles a2 = at.along * at.along, c2 = at.across * at.across, far = 2 * along2 * c2 + a2,
                  c = way * smaller(larger(at.turned, splat(-1)), splat(1)),
                  round = root(round2) / (kCircle * (round2 * (1 + c) + (1 - c)));
    return where((at.across > 0) & (at.across_l > 0),
                 round * along2 * at.across * (c2 + a2) / (2 * far * root(far) * at.across_l));
  }
};

/// Where a ray goes on from strands.
struct FibreSample {
  Three l;
  Doubles pdf, left;  // a steradian, of all lobes; what is left of the number that chose one
};

inline Doubles size_of(const Three& k) { return magnitude(k.x) + magnitude(k.y) + magnitude(k.z); }

/// body(kind, number, |k|) for the lobes of some kinds at a group of points.
template <class Body>
inline void each_lobe_of(const LitPoints& s, size_t k, std::initializer_list<int> kinds,
                         Body body) {
  for (const int kind : kinds)
    for (int number = 0; number < s.lobes.layout->of[kind].count; ++number)
      body(kind, number, size_of(LobeRow(s, k, kind, number).k()));
}

/// One lobe's, chosen by how much each gives back; what is even gives evenly over the front's half
/// of the sphere. number: of [0, 1), that chooses.
inline FibreSample sample_fibre(const OnwardStage& stage, size_t k, const Three& n,
                                Doubles number) {
  const LitPoints& s = *stage.points;
  const auto each_round = [&](auto body) {
    each_lobe_of(s, k, {GLINT_FIBRE_SPECULAR, GLINT_FIBRE_TRANSMISSION}, body);
  };
  Doubles even = size_of(load3(s.diffuse, k)), round = splat(0);
  Mask others{};
  each_round([&](int, int, Doubles weight) { round = round + weight; });
  each_lobe_of(s, k, {GLINT_FIBRE_DIFFUSE},
               [&](int, int, Doubles weight) { even = even + weight; });
  each_lobe_of(s, k,
               {GLINT_SHEEN, GLINT_TOON_DIFFUSE, GLINT_TOON_SPECULAR, GLINT_OREN_NAYAR,
                GLINT_OREN_NAYAR_MULTIPLE},
               [&](int, int, Doubles weight) { others |= weight > 0; });
  even = stage.fibres_alone ? splat(0) : even + where(others, round);
  even = choose(even + round > 0, even, splat(1));
  const Doubles total = even + round;
  const Doubles x = load(stage.disc[0] + k), y = load(stage.disc[1] + k),
                rest = larger(1 - x * x - y * y, Doubles{}), at = number * total;
  Three t1, t2;
  frame(n, t1, t2);
  FibreSample drawn{rest * n + root(1 + rest) * (x * t1 + y * t2), splat(0),
                    where(even > 0, at / even)};
  Doubles before = even;
  each_round([&](int kind, int i, Doubles weight) {
    const Mask here = (at >= before) & (weight > 0);
    if (bits(here)) {
      drawn.l = choose(here, FibreSampler(s, k, kind, i).sample(x, y), drawn.l);
      drawn.left = choose(here, smaller((at - before) / weight, splat(1 - 0x1p-53)), drawn.left);
    }
    before = before + weight;
  });
  drawn.pdf = where(dot(n, drawn.l) > 0, even * splat(1 / (2 * kCircle)));
  each_round([&](int kind, int i, Doubles weight) {
    if (bits(weight > 0))
      drawn.pdf = drawn.pdf + where(weight > 0, weight * FibreSampler(s, k, kind, i).pdf(drawn.l));
  });
  drawn.pdf = drawn.pdf / total;
  return drawn;
}

}  // namespace
}  // namespace glint
