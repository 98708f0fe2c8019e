// Operations that ask the scene for rays. Letters: n normal, t1 t2 across it, d direction.
#pragma once
#include "program/op_input.h"

namespace glint {
namespace {
namespace op {

constexpr int32_t kMostAsked = 128;  // rays of a point and sample

/// Two unit vectors across n, as the pass Ambient Occlusion has them (integrator/occlusion.cpp).
struct AcrossNormal {
  Three t1, t2;
  explicit AcrossNormal(const Three& n) {
    const Three t = cross(Three{splat(1), splat(2), splat(3)}, n);
    t1 = unit(choose(nonzero(t), t, cross(Three{splat(1), Doubles{}, Doubles{}}, n)));
    t2 = cross(n, t1);
  }
};

/// Row j of those of a sample that takes `each`.
inline NodePoint node_point(const RayQueries& queries, uint64_t each, uint64_t j) {
  const double* const at =
      queries.table + NodePoint::kColumns * ((queries.sample * each + j) % queries.rows);
  return {{at[0], at[1]}, {at[2], at[3]}, at[4] >= 2 ? 2 : at[4] >= 1 ? 1 : 0};
}

/// How high the unit half ball is over a point of the disc.
inline double height_over(const double (&p)[2]) {
  const double rest = 1 - p[0] * p[0] - p[1] * p[1];
  return rest > 0 ? __builtin_sqrt(rest) : 0;
}

inline int32_t asked_samples(const Operands& at) {
  const int32_t given = at.settings[0];
  return given < 1 ? 1 : given > kMostAsked ? kMostAsked : given;
}

/// Rays of a group of points. Nobody asks for those of lanes beyond the last point.
inline void ask(const Machine& m, size_t k, const Three& o, const Three& d, Doubles reach,
                AskedRays& rays) {
  put3(rays.o, k, o);
  put3(rays.d, k, d);
  store(rays.t_max + k, where(valid_lanes(k, m.count), reach));
}

/// Beside the surface, on the side to which d leaves.
inline Three beside(const Machine& m, size_t k, const Three& d) {
  const Three g = point3(m.points.g, k);
  const Doubles offset = load(m.points.offset + k);
  return point3(m.points.x, k) + choose(dot(g, d) < 0, -offset, offset) * g;
}

inline void ambient_occlusion(const Machine& m, const Operands& at) {
  const RayQueries* const queries = m.queries;
  if (!queries) return each_group(m, [&](size_t k) { at.put(0, k, splat(1)); });
  const int32_t each = asked_samples(at);
  const bool inside = at.settings[1] != 0, of_world = at.settings[3] != 0;
  double n[3][kBlock], t1[3][kBlock], t2[3][kBlock], reach[kBlock], hidden[kBlock];
  each_group(m, [&](size_t k) {
    const Three given = unit(finite_or_zero(at.vector(1, k)));
    const AcrossNormal across(inside ? -given : given);
    put3(n, k, inside ? -given : given);
    put3(t1, k, across.t1);
    put3(t2, k, across.t2);
    const Doubles distance = of_world ? splat(queries->reach) : at.number(0, k);
    store(reach + k, where(nonzero(given) & (distance > 0), m.tables.view->scale * distance));
    store(hidden + k, Doubles{});
  });
  AskedRays rays;
  uint8_t blocked[kBlock];
  for (int32_t j = 0; j < each; ++j) {
    const NodePoint p = node_point(*queries, uint64_t(each), uint64_t(j));
    const Doubles x = splat(p.even[0]), y = splat(p.even[1]), z = splat(height_over(p.even));
    each_group(m, [&](size_t k) {
      const Three d = x * point3(t1, k) + y * point3(t2, k) + z * point3(n, k);
      ask(m, k, beside(m, k, d), d, load(reach + k), rays);
    });
    queries->blocked(queries->self, m.points, m.count, rays,
                     at.settings[2] != 0 ? AskedOf::kOwn : AskedOf::kShadows, blocked);
    for (size_t k = 0; k < m.count; ++k) hidden[k] += blocked[k];
  }
  each_group(m, [&](size_t k) { at.put(0, k, 1 - load(hidden + k) / double(each)); });
}

/// What rays met of a bevel, of each point.
struct BevelSum {
  double n[3][kBlock] = {};

  /// Of a ray of the row p along the axis of this number, from the disc of this radius across it.
  void add(const ProgramPoints& points, const AskedHits& hits, const double (&axes)[3][3][kBlock],
           const double* radius, const NodePoint& p) {
    const int axis = p.axis;
    const double off = 1 - __builtin_sqrt(p.dense[0] * p.dense[0] + p.dense[1] * p.dense[1]);
    for (size_t i = 0; i < hits.count; ++i) {
      const uint32_t k = hits.point[i];
      double total = 0, own = 0, far2 = 0;
      for (int a = 0; a < 3; ++a) {
        double cosine = 0;
        for (int c = 0; c < 3; ++c) cosine += axes[a][c][k] * hits.g[c][i];
        const double density = (a == 0 ? 0.5 : 0.25) * (cosine < 0 ? -cosine : cosine);
        total += density * density;
        if (a == axis) own = density;
        const double away = hits.x[a][i] - points.x[a][k];
        far2 += away * away;
      }
      const double near = 1 - __builtin_sqrt(far2) / radius[k], share = near / off;
      if (!(near > 0 && off > 0 && total > 0)) continue;
      const double weight = (hits.outside[i] ? 1 : -1) * own / total * (share * share * share);
      for (int c = 0; c < 3; ++c) n[c][k] += weight * hits.n[c][i];
    }
  }
};

/// The mean of (1 - r / radius)^3 n over the surface of the object within the radius, r the
/// distance: rays along the normal and two axes across it, from a disc to the other side of the
/// ball (Veach 1997, the power heuristic).
inline void bevel(const Machine& m, const Operands& at) {
  const RayQueries* const queries = m.queries;
  if (!queries) return normal(m, at);
  const int32_t each = asked_samples(at);
  double axes[3][3][kBlock], radius[kBlock];
  each_group(m, [&](size_t k) {
    const Three g = point3(m.points.g, k);
    const AcrossNormal across(g);
    put3(axes[0], k, g);
    put3(axes[1], k, across.t1);
    put3(axes[2], k, across.t2);
    const Doubles given = finite_or_zero(m.tables.view->scale * at.number(0, k));
    store(radius + k, where(given > 0, given));
  });
  AskedRays rays;
  BevelSum sum;
  for (int32_t j = 0; j < each; ++j) {
    const NodePoint p = node_point(*queries, uint64_t(each), uint64_t(j));
    const int axis = p.axis;
    const double height = height_over(p.dense);
    each_group(m, [&](size_t k) {
      const Three w = point3(axes[axis], k), u = point3(axes[(axis + 1) % 3], k),
                  v = point3(axes[(axis + 2) % 3], k);
      const Doubles r = load(radius + k);
      const Three o = point3(m.points.x, k) +
                      r * (splat(p.dense[0]) * u + splat(p.dense[1]) * v + splat(height) * w);
      ask(m, k, o, -w, 2 * height * r, rays);
    });
    sum.add(m.points, queries->crossings(queries->self, m.points, m.count, rays), axes, radius, p);
  }
  each_group(m, [&](size_t k) {
    const Three outward = unit(point3(sum.n, k)),
                found = choose(load(m.points.outside + k), outward, -outward);
    at.put(0, k, choose(nonzero(outward), found, point3(m.points.n, k)));
  });
}

/// Where the rays of `raycast` end. Settings: only_local, from_point. speed: of t, in anchored
/// space, to lengths of the direction.
inline AskedHits end_of_rays(const Machine& m, const Operands& at, AskedRays& rays, double* speed) {
  const ProgramView& view = *m.tables.view;
  const bool leaves = at.settings[1] != 0;
  each_group(m, [&](size_t k) {
    const Three from = at.vector(0, k), along = finite_or_zero(at.vector(1, k)), d = unit(along);
    const Doubles size = length(along), reach = size * (view.scale * at.number(2, k));
    const Three o = leaves ? beside(m, k, d) : splat(view.scale) * (from - splat3(view.origin));
    const Doubles sum = o.x + o.y + o.z;
    const Mask sound = nonzero(d) & (sum == sum) & (max_abs(o) < 1e15) & (size > 0) & (reach > 0);
    ask(m, k, o, d, where(sound, reach), rays);
    store(speed + k, where(sound, 1 / choose(sound, view.scale * size, splat(1))));
  });
  return m.queries->nearest(m.queries->self, m.points, m.count, rays,
                            at.settings[0] != 0 ? AskedOf::kOwn : AskedOf::kAny);
}

inline void raycast(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    at.put(0, k, Doubles{});
    at.put(1, k, Doubles{});
    at.put(2, k, at.number(2, k));
    at.put(3, k, Three{});
    at.put(4, k, Three{});
  });
  if (!m.queries) return;
  const ProgramView& view = *m.tables.view;
  AskedRays rays;
  double speed[kBlock];
  const AskedHits hits = end_of_rays(m, at, rays, speed);
  const bool leaves = at.settings[1] != 0;
  for (size_t i = 0; i < hits.count; ++i) {
    const uint32_t k = hits.point[i];
    if (at.wants(0)) at.output[0][k] = 1;
    if (at.wants(1)) at.output[1][k] = hits.instance[i] == m.points.instance[k] ? 1 : 0;
    double far = 0;
    for (size_t c = 0; c < 3; ++c)
      far += (hits.x[c][i] - (leaves ? m.points.x[c][k] : rays.o[c][k])) * rays.d[c][k];
    if (at.wants(2)) at.output[2][k] = far * speed[k];
    for (size_t c = 0; at.wants(3) && c < 3; ++c)
      at.output[3][c * kBlock + k] = hits.x[c][i] / view.scale + view.origin[c];
    for (size_t c = 0; at.wants(4) && c < 3; ++c) at.output[4][c * kBlock + k] = hits.n[c][i];
  }
}

/// The hits from number i on, as places on meshes; lanes beyond the last hit repeat it.
inline OnMesh on_hits(const Machine& m, const AskedHits& hits, size_t i) {
  const auto row = [&](size_t lane) { return i + lane < hits.count ? i + lane : hits.count - 1; };
  OnMesh p;
  for (size_t c = 0; c < 2; ++c)
    p.weights[c + 1] = each_lane([&](size_t lane) { return hits.weights[c][row(lane)]; });
  p.weights[0] = 1 - p.weights[1] - p.weights[2];
  find_primitives(
      m.tables, [&](size_t lane) { return hits.instance[row(lane)]; },
      [&](size_t lane) { return hits.primitive[row(lane)]; }, p);
  return p;
}

/// Settings: those of raycast, and the attribute.
inline void raycast_attribute(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    at.put(0, k, Three{});
    at.put(1, k, Doubles{});
  });
  if (!m.queries) return;
  AskedRays rays;
  double speed[kBlock];
  const AskedHits hits = end_of_rays(m, at, rays, speed);
  for (size_t i = 0; i < hits.count; i += kLanes) {
    const OnMesh p = on_hits(m, hits, i);
    const Three color = read_color(m.tables, p, at.settings[2], GLINT_COLOR);
    const Doubles alpha = read_color(m.tables, p, at.settings[2], GLINT_ALPHA).x;
    const Doubles part[3] = {color.x, color.y, color.z};
    for (size_t lane = 0; lane < kLanes && i + lane < hits.count; ++lane) {
      const uint32_t k = hits.point[i + lane];
      for (size_t c = 0; at.wants(0) && c < 3; ++c) at.output[0][c * kBlock + k] = part[c][lane];
      if (at.wants(1)) at.output[1][k] = alpha[lane];
    }
  }
}

}  // namespace op
}  // namespace
}  // namespace glint
