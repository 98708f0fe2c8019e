// Light from clusters of lamps (semantics/many_lamps.md). Letters: c cluster, n shading normal, l
// direction to the cluster's middle, d distance.
#pragma once
#include "shading/stage_light.h"

namespace glint {
namespace {

/// Points see clusters from so many radii as one.
constexpr double kFar2 = 16;

/// Of kLanes points: how far along the tree they know all that they get, from how many radii^2 they
/// see a cluster as one, and which of them do so with the present one or have to look within it.
struct ClusterWalk {
  Doubles until, far2;
  Mask far, near;
};

/// Light of a cluster is even over lobes as wide as it: exponents are at most (d / radius)^2.
inline ClusterWalk begin_walk(const ShareStage& s, size_t k) {
  const LitPoints& points = *s.points;
  Doubles far2 = splat(kFar2);
  const Doubles never = splat(__builtin_inf());  // looks at each lamp
  for (int number = 0; number < points.lobes.highlights; ++number) {
    const Microfacet lobe(points, k, number);
    far2 = choose(nonzero(lobe.k), larger(lobe.exponent, far2), far2);
    Mask apart{};
    if (points.lobes.turns) apart |= nonzero(lobe.normal(Three{}));
    if (points.lobes.stretches) apart |= Stretch(lobe, Three{}).some;
    far2 = choose(apart & nonzero(lobe.k), never, far2);
  }
  if (points.lobes.other_count > 0)
    each_lobe_of(points, k,
                 {GLINT_TOON_DIFFUSE, GLINT_TOON_SPECULAR, GLINT_FIBRE_DIFFUSE,
                  GLINT_FIBRE_SPECULAR, GLINT_FIBRE_TRANSMISSION},
                 [&](int, int, Doubles size) { far2 = choose(size > 0, never, far2); });
  if (points.lowering) far2 = choose(load(points.lowering + k) > 1, never, far2);
  return {choose(load(s.lit + k), splat(0), splat(__builtin_inf())), far2, Mask{}, Mask{}};
}

/// Whether a cluster's lamps may lie on both sides of the plane that is `up` below its middle.
inline Mask is_cut(const LampCluster& c, Doubles up) { return ~(up * up > c.radius2); }

/// Whether that holds where a normal is bent, for the plane `up` across it or that across what it
/// was bent from: the side of each lamp decides what bumps hide.
inline Mask is_cut_at_bump(const LampCluster& c, const LitPoints& s, size_t k, const Three& to,
                           Doubles up) {
  const Three m = load3(s.unbent, k);
  return nonzero(m) & (is_cut(c, up) | is_cut(c, dot(m, to)));
}

/// Looks at cluster number `at`.
inline void look(const ShareStage& s, size_t at, size_t k, ClusterWalk& walk) {
  const LampCluster& c = s.clusters[at];
  const LitPoints& points = *s.points;
  const Mask open = walk.until <= double(at);
  const Three to = splat3(c.center) - load3(points.x, k);
  const Doubles z = dot(load3(points.n, k), to);
  Mask far = open & (dot(to, to) >= c.radius2 * walk.far2);
  if (c.next == at + 1) far &= ~is_cut(c, z);  // a lamp alone is known point by point
  if (points.unbent[0]) far &= ~is_cut_at_bump(c, points, k, to, z);
  walk.until = choose(far, splat(double(c.next)), walk.until);
  walk.near = open & ~far;
  walk.far = far & ((z > 0) | is_cut(c, z));
}

/// What the places of a cluster's lamps add to n l, in one channel.
inline Doubles beside(const LampCluster& c, int channel, const Three& n, const Three& l,
                      Doubles cosine, Doubles near) {
  const double *D = c.dipole[channel], *Q = c.quadrupole[channel];
  const Three Ql = {Q[0] * l.x + Q[1] * l.y + Q[2] * l.z, Q[1] * l.x + Q[3] * l.y + Q[4] * l.z,
                    Q[2] * l.x + Q[4] * l.y + Q[5] * l.z};
  const Doubles first = dot(n, splat3(D)) - 3 * (cosine * dot(l, splat3(D))),
                second = cosine * (7.5 * dot(l, Ql) - c.trace[channel]) - 3 * dot(n, Ql);
  return near * (first + near * second);
}

/// n l, by channel, of the light of a cluster whose middle is in the direction l.
inline Three cluster_cosines(const LampCluster& c, const Three& n, const Three& l, Doubles cosine,
                             Doubles d) {
  Three all = {cosine, cosine, cosine};
  if (c.moments == 0) return all;
  const Doubles near = 1 / d;
  all.x = cosine + beside(c, 0, n, l, cosine, near);
  if (c.moments == 1) return {all.x, all.x, all.x};
  all.y = cosine + beside(c, 1, n, l, cosine, near);
  all.z = cosine + beside(c, 2, n, l, cosine, near);
  return all;
}

/// How far n l of a cluster's lamps is from that of its middle: they are as if spread evenly so far
/// to either side.
inline Doubles half_height(const LampCluster& c, const Three& n, Doubles d) {
  Doubles sum = splat(0);
  for (int channel = 0; channel < c.moments; ++channel) {
    const double* const Q = c.quadrupole[channel];
    const Three Qn = {Q[0] * n.x + Q[1] * n.y + Q[2] * n.z, Q[1] * n.x + Q[3] * n.y + Q[4] * n.z,
                      Q[2] * n.x + Q[4] * n.y + Q[5] * n.z};
    sum = sum + dot(n, Qn);
  }
  if (c.moments == 1) sum = 3 * sum;
  return root(smaller(larger(sum, splat(0)), splat(c.radius2))) / d;
}

/// The mean of max(0, X), X spread evenly from x - a to x + a.
inline Doubles mean_above(Doubles x, Doubles a) {
  const Doubles over = larger(x + a, splat(0));
  return choose(x < a, where(over > 0, over * over / (4 * a)), larger(x, splat(0)));
}

/// How a point sees the middle of a cluster: n l of each channel, and of what is above the point's
/// horizon which share that is of the lamps, a direction at its height, and n l of that.
struct SeenCluster {
  Three cosines;
  Doubles share;
  Three l;
  Doubles cosine;
};

inline SeenCluster see_cluster(const LampCluster& c, const Three& n, const Three& off, Doubles d2) {
  const Three l = unit(off);
  const Doubles d = root(d2), cosine = dot(n, l), zero = splat(0), one = splat(1);
  const Three x = cluster_cosines(c, n, l, cosine, d);
  SeenCluster seen = {{larger(x.x, zero), larger(x.y, zero), larger(x.z, zero)}, one, l, cosine};
  const Mask cut = is_cut(c, dot(n, off));
  if (!any(cut)) return seen;
  const Doubles a = half_height(c, n, d);
  seen.cosines =
      choose(cut, Three{mean_above(x.x, a), mean_above(x.y, a), mean_above(x.z, a)}, seen.cosines);
  const Mask partly = cut & (cosine < a);
  const Doubles over = larger(cosine + a, zero);
  seen.share = choose(partly, where(over > 0, over / (2 * a)), one);
  seen.cosine = choose(partly, 0.5 * over, cosine);
  const Doubles aside = root((1 - seen.cosine * seen.cosine) / (1 - cosine * cosine));
  seen.l = choose(partly, aside * (l - cosine * n) + seen.cosine * n, l);
  return seen;
}

/// Adds what a cluster gives to the points that see it as one, and tells it alone in three rows of
/// kLanes.
template <bool Bent>
__attribute__((flatten)) inline void add_cluster(const ShareStage& to, const LampCluster& c,
                                                 Mask far, size_t k, double* given) {
  const LitPoints& s = *to.points;
  const LightSample& light = to.samples[c.first].light;
  const Three center = splat3(c.center), color = splat3(c.color);
  const Three n = load3(s.n, k), off = center - load3(s.x, k);
  const Doubles d2 = dot(off, off);
  const Three I = inverse_square(light, d2) * color;
  const SeenCluster from = see_cluster(c, n, off, d2);
  Three diffuse = I * (from.cosines * load3(s.diffuse, k)), specular{};
  if (s.lobes.highlights > 0 || s.lobes.other_count > 0) {
    const Highlights seen = highlights<false, Bent>(s, k, n, from.l, from.cosine, nullptr);
    specular = where(far & (from.share > 0), (from.share * I) * seen.light);
    if (s.lobes.other_count > 0)
      diffuse = diffuse + where(from.share > 0, (from.share * I) * seen.matt);
  }
  const BumpShadow bump = bump_shadow<Bent>(s, k, n, from.l);
  if (bump.some) {
    diffuse = where(~bump.hidden, bump.share * diffuse);
    specular = where(~bump.hidden, specular);
  }
  diffuse = where(far, diffuse);
  const Three both = diffuse + specular;
  store(to.total + k,
        load(to.total + k) + (magnitude(both.x) + magnitude(both.y) + magnitude(both.z)));
  store3(to.diffuse, k, load3(to.diffuse, k) + diffuse);
  store3(to.specular, k, load3(to.specular, k) + specular);
  store(given, both.x);
  store(given + kLanes, both.y);
  store(given + 2 * kLanes, both.z);
}

}  // namespace
}  // namespace glint
