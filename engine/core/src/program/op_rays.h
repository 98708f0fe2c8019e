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

/// Of a sample that takes `each`, point j of the unit disc and the height of the half ball over it.
struct DiscPoint {
  Doubles x, y, height;
  DiscPoint(const RayQueries& queries, uint64_t each, uint64_t j) {
    const double* const at = queries.disc + 2 * ((queries.sample * each + j) % queries.disc_count);
    x = splat(at[0]);
    y = splat(at[1]);
    height = root(larger(1 - x * x - y * y, splat(0)));
  }
};

/// Rays of a group of points along d as far as `reach`, from beside the surface on the side to
/// which they leave. Nobody asks for those of lanes beyond the last point.
inline void ask(const Machine& m, size_t k, const Three& d, Doubles reach, AskedRays& rays) {
  const Three g = point3(m.points.g, k);
  const Doubles offset = load(m.points.offset + k), beside = choose(dot(g, d) < 0, -offset, offset);
  put3(rays.o, k, point3(m.points.x, k) + beside * g);
  put3(rays.d, k, d);
  store(rays.t_max + k, where(valid_lanes(k, m.count), reach));
}

inline void ambient_occlusion(const Machine& m, const Operands& at) {
  const RayQueries* const queries = m.queries;
  if (!queries) return each_group(m, [&](size_t k) { at.put(0, k, splat(1)); });
  const int32_t each = at.settings[0] < 1            ? 1
                       : at.settings[0] > kMostAsked ? kMostAsked
                                                     : at.settings[0];
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
    const DiscPoint p(*queries, uint64_t(each), uint64_t(j));
    each_group(m, [&](size_t k) {
      const Three d = p.x * point3(t1, k) + p.y * point3(t2, k) + p.height * point3(n, k);
      ask(m, k, d, load(reach + k), rays);
    });
    queries->blocked(queries->self, m.points, m.count, rays,
                     at.settings[2] != 0 ? AskedOf::kOwn : AskedOf::kAll, blocked);
    for (size_t k = 0; k < m.count; ++k) hidden[k] += blocked[k];
  }
  each_group(m, [&](size_t k) { at.put(0, k, 1 - load(hidden + k) / double(each)); });
}

}  // namespace op
}  // namespace
}  // namespace glint
