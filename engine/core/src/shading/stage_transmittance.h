// What surfaces let through of shadow rays (SEMANTICS.md, shadows).
#pragma once
#include "shading/stage_inputs.h"
#include "shading/stage_rows.h"
#include "shading/stage_surface.h"

namespace glint {
namespace {

/// Hits of a group of rays; lanes beyond their end repeat the first.
struct Met {
  uint32_t instance[kLanes], primitive[kLanes];
  bool together;  // on one triangle
  Met(const TransmittanceStage& s, size_t k, size_t count) {
    for (size_t lane = 0; lane < kLanes; ++lane) {
      const size_t row = lane < count ? k + lane : k;
      instance[lane] = s.instance[row], primitive[lane] = s.primitive[row];
    }
    together = same(instance) && same(primitive);
  }
};

inline const GroupShape& group_of(const TransmittanceStage& s, uint32_t instance) {
  return s.shapes[s.tables.instances[instance].group];
}

/// Their triangles; points for hits on other things.
inline Spread triangles(const TransmittanceStage& s, const Met& at) {
  Gathered all{};
  for (size_t lane = 0; lane < (at.together ? 1 : kLanes); ++lane) {
    const GroupShape& group = group_of(s, at.instance[lane]);
    all.instance[lane] = s.tables.instances + at.instance[lane];
    all.same_instance = all.same_instance && all.instance[lane] == all.instance[0];
    if (group.triangles)
      gather_rows(group.vertices, group.triangles + 3 * size_t(at.primitive[lane]), lane,
                  all.corners);
  }
  if (at.together) {
    const auto vertex = [&](size_t v) {
      return Three{splat(all.corners[3 * v][0]), splat(all.corners[3 * v + 1][0]),
                   splat(all.corners[3 * v + 2][0])};
    };
    return Spread(Matrices(*all.instance[0]), {vertex(0), vertex(1), vertex(2)});
  }
  if (!all.same_instance) spread_matrices(all);
  return Spread(all.same_instance ? Matrices(*all.instance[0]) : Matrices(all),
                {rows3(all.corners), rows3(all.corners + 3), rows3(all.corners + 6)});
}

inline bool follow_each_other(const uint32_t (&row)[kLanes]) {
  bool all = true;
  for (uint32_t lane = 1; lane < kLanes; ++lane) all = all && row[lane] == row[0] + lane;
  return all;
}

/// The rays of hits from row k on. A ray may be there several times.
inline Chosen rays_of(const TransmittanceStage& s, size_t k, size_t end) {
  Chosen ray = chosen(s.number, k, end);
  ray.together = follow_each_other(ray.row);
  return ray;
}

/// Where on their meshes they are, seen from the points that the rays left.
inline OnMesh on_mesh(const TransmittanceStage& s, size_t k, const Chosen& ray, const Met& at) {
  Chosen from = ray;
  for (size_t lane = 0; lane < kLanes; ++lane) from.row[lane] = s.point[ray.row[lane]];
  from.together = follow_each_other(from.row);
  const Three origin = gather3(s.origin, from),
              d = s.end[0] ? unit(gather3(s.end, ray) - origin) : gather3(s.to, ray);
  const Weights b = solve_weights(origin, d, triangles(s, at), load(s.u + k), load(s.v + k));
  OnMesh p;
  p.weights[0] = b.a, p.weights[1] = b.b, p.weights[2] = b.c;
  find_primitives(
      s.tables, [&](size_t lane) { return at.instance[lane]; },
      [&](size_t lane) { return at.primitive[lane]; }, p);
  return p;
}

inline bool constant(const TransmittanceStage& s) {
  bool constant = true;
  for (uint32_t i = 0; i < s.lobe_count; ++i)
    constant = constant && (s.lobes[i].kind != GLINT_TRANSPARENT || s.lobes[i].constant);
  return constant;
}

/// The sum of the TRANSPARENT lobes.
inline Three transparency(const TransmittanceStage& s, const OnMesh& p) {
  Three sum{};
  Reads reads;
  for (uint32_t i = 0; i < s.lobe_count; ++i)
    if (s.lobes[i].kind == GLINT_TRANSPARENT)
      sum = sum + coefficient(s.tables, p, s.lobes[i], reads);
  return sum;
}

inline Doubles clamped_share(Doubles x) { return larger(smaller(x, splat(1)), splat(0)); }

void transmit(const TransmittanceStage& s) {
  const bool alike = constant(s);
  for (size_t k = s.first, end = s.first + s.count; k < end; k += kLanes) {
    const Chosen ray = rays_of(s, k, end);
    const Three share =
        transparency(s, alike ? OnMesh{} : on_mesh(s, k, ray, Met(s, k, ray.count)));
    store(s.share[0] + k, clamped_share(share.x)), store(s.share[1] + k, clamped_share(share.y)),
        store(s.share[2] + k, clamped_share(share.z));
  }
}

}  // namespace
}  // namespace glint
