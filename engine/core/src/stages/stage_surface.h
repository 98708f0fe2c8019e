// From hits on triangles to points (notes 4.7-4.9, 2.7). Letters: o d ray, a b c corners, e1 e2 edges, n normals of the vertices.
#pragma once
#include "lanes.h"
#include "stages.h"

namespace glint {
namespace {

/// What a group of hits reads, a row a lane; the rows of lanes without a triangle hold another lane's.
struct alignas(64) Gathered {
  float corners[9][kLanes], normals[9][kLanes];
  double m[12][kLanes], normal[9][kLanes], mirror[kLanes];
  const InstanceShape* instance[kLanes];
  uint32_t on_mesh = 0, smooth = 0;  // lanes
  bool same_instance = true;
};

inline uint32_t material_of(const GroupShape& group, uint32_t primitive) {
  if (!group.slots) return group.material;
  const uint32_t slot = group.slots[primitive], last = group.material_count - 1;
  return group.materials[slot < last ? slot : last];
}

inline void gather_rows(const float* values, const uint32_t* rows, size_t lane, float (&out)[9][kLanes]) {
  for (size_t v = 0; v < 3; ++v) {
    const float* p = values + 3 * size_t(rows[v]);
    out[3 * v][lane] = p[0], out[3 * v + 1][lane] = p[1], out[3 * v + 2][lane] = p[2];
  }
}

/// Looks up the lanes of group k. False when none of them is on a mesh.
inline bool look_up(const SurfaceStage& s, size_t k, Gathered& at) {
  const size_t lanes = s.count - k < kLanes ? s.count - k : kLanes;
  size_t first = kLanes;
  for (size_t lane = 0; lane < lanes; ++lane) {
    const uint32_t instance = s.instance[k + lane], primitive = s.primitive[k + lane];
    s.points.material[k + lane] = instance == kNoMaterial ? s.missed : kNoMaterial;
    if (instance == kNoMaterial) continue;
    const InstanceShape& shape = s.instances[instance];
    const GroupShape& group = s.groups[shape.group];
    if (!group.triangles) continue;
    if (first == kLanes) first = lane;
    s.points.material[k + lane] = material_of(group, primitive);
    at.on_mesh |= 1u << lane, at.instance[lane] = &shape;
    at.same_instance = at.same_instance && &shape == at.instance[first];
    gather_rows(group.vertices, group.triangles + 3 * size_t(primitive), lane, at.corners);
    if (!group.normals) continue;
    at.smooth |= 1u << lane;
    gather_rows(group.normals, group.normal_rows + 3 * size_t(primitive), lane, at.normals);
  }
  if (first == kLanes) return false;
  for (size_t lane = 0; at.on_mesh != kAllLanes && lane < kLanes; ++lane) {
    if (at.on_mesh >> lane & 1) continue;
    at.instance[lane] = at.instance[first];
    for (int i = 0; i < 9; ++i) at.corners[i][lane] = at.corners[i][first];
  }
  for (size_t lane = 0; at.smooth != 0 && at.smooth != kAllLanes && lane < kLanes; ++lane)
    if (!(at.smooth >> lane & 1))
      for (int i = 0; i < 9; ++i) at.normals[i][lane] = 0;
  return true;
}

inline void spread_matrices(Gathered& at) {
  for (size_t lane = 0; lane < kLanes; ++lane) {
    const InstanceShape& shape = *at.instance[lane];
    for (int i = 0; i < 12; ++i) at.m[i][lane] = shape.m[i];
    for (int i = 0; i < 9; ++i) at.normal[i][lane] = shape.normal[i];
    at.mirror[lane] = shape.mirrors ? -1.0 : 1.0;
  }
}

struct Linear {
  Three x, y, z;
};
inline Three operator*(const Linear& m, const Three& v) { return v.x * m.x + v.y * m.y + v.z * m.z; }
inline Three rows3(const double (*p)[kLanes]) { return {load(p[0]), load(p[1]), load(p[2])}; }
inline Three rows3(const float (*p)[kLanes]) { return {load(p[0]), load(p[1]), load(p[2])}; }

struct Matrices {
  Linear m, normal;
  Three t;
  Doubles mirror;
  explicit Matrices(Gathered& at) {
    if (at.same_instance) {
      const InstanceShape& shape = *at.instance[0];
      const double *p = shape.m, *q = shape.normal;
      m = {splat3(p), splat3(p + 3), splat3(p + 6)}, t = splat3(p + 9), normal = {splat3(q), splat3(q + 3), splat3(q + 6)};
      mirror = splat(shape.mirrors ? -1.0 : 1.0);
    } else {
      spread_matrices(at);
      m = {rows3(at.m), rows3(at.m + 3), rows3(at.m + 6)}, t = rows3(at.m + 9);
      normal = {rows3(at.normal), rows3(at.normal + 3), rows3(at.normal + 6)}, mirror = load(at.mirror);
    }
  }
};

struct Weights {
  Doubles a, b, c;
};

/// In double; the accelerator's own where the ray grazes the plane or the triangle is a needle.
inline Weights solve_weights(const Three& o, const Three& d, const Three& a, const Three& e1, const Three& e2, Doubles hit_u,
                             Doubles hit_v) {
  const Three q = cross(d, e2), s = o - a;
  const Doubles f = 1 / dot(e1, q);
  Doubles u = f * dot(s, q), v = f * dot(d, cross(s, e1));
  const Mask good = (magnitude(u - hit_u) <= 1e-3) & (magnitude(v - hit_v) <= 1e-3);
  u = choose(good, u, hit_u), v = choose(good, v, hit_v);
  u = smaller(larger(u, splat(0)), splat(1)), v = smaller(larger(v, splat(0)), 1 - u);
  return {1 - u - v, u, v};
}

inline Three blend(const Weights& b, const float (&n)[9][kLanes]) {
  const Three a = rows3(n), c = rows3(n + 3), e = rows3(n + 6);
  return {finite_or_zero(b.a * a.x + b.b * c.x + b.c * e.x), finite_or_zero(b.a * a.y + b.b * c.y + b.c * e.y),
          finite_or_zero(b.a * a.z + b.b * c.z + b.c * e.z)};
}

/// A vertex's share of Hanika's shadow origin (surface.h): x moved towards the vertex' tangent plane.
inline Three towards_plane(Doubles weight, const Three& vertex, const Three& x, const Three& n) {
  return (weight * larger(dot(vertex - x, n), splat(0))) * n;
}

/// x moved out to the tangent planes, and never below the face: normals of a thin thing may point there by their rounding.
inline Three shadow_origin(const Three& x, const Three& g, const Three (&corners)[3], const Weights& b, const Linear& normal,
                           const float (&n)[9][kLanes], Doubles side) {
  const Doubles weights[3] = {b.a, b.b, b.c};
  Three sum{};
  for (int k = 0; k < 3; ++k) sum = sum + towards_plane(weights[k], corners[k], x, side * unit(normal * rows3(n + 3 * k)));
  return x + (sum - smaller(dot(sum, g), splat(0)) * g);
}

inline void place_group(const SurfaceStage& s, size_t k, Gathered& at) {
  const Matrices to_world(at);
  const Three d = load3(s.d, k), o = load3(s.start, k);
  const Three corner = rows3(at.corners), a = to_world.m * corner + to_world.t;
  const Three e1 = to_world.m * (rows3(at.corners + 3) - corner), e2 = to_world.m * (rows3(at.corners + 6) - corner);
  const Weights b = solve_weights(o, d, a, e1, e2, load(s.u + k), load(s.v + k));
  const Three x = a + (b.b * e1 + b.c * e2), corners[3] = {a, a + e1, a + e2};
  Three g = to_world.mirror * unit(cross(e1, e2));
  g = choose(nonzero(g), g, -unit(d));  // a triangle squeezed to a line, met by rounding: it faces the viewer
  const Mask outside = dot(g, d) <= 0;
  const Doubles side = choose(outside, splat(1), splat(-1));
  g = side * g;
  Three n = g, origin = x;
  if (at.smooth) {
    const Three blended = unit(to_world.normal * blend(b, at.normals));
    n = choose(nonzero(blended), side * blended, g);
    origin = shadow_origin(x, g, corners, b, to_world.normal, at.normals, side);
  }
  const PointColumns& p = s.points;
  store3(p.x, k, x), store3(p.g, k, g);
  if (p.n[0] != p.g[0]) store3(p.n, k, n), store3(p.origin, k, origin);
  store(p.offset + k, rounding(larger(max_abs(corners[0]), larger(max_abs(corners[1]), max_abs(corners[2])))));
  store(p.weights[0] + k, b.b), store(p.weights[1] + k, b.c), store(p.outside + k, outside);
}

void surface(const SurfaceStage& s) {
  for (size_t k = 0; k < s.count; k += kLanes) {
    Gathered at;
    if (look_up(s, k, at)) place_group(s, k, at);
  }
}

}  // namespace
}  // namespace glint
