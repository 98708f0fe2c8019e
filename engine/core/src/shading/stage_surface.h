// From hits on triangles to points (notes 4.7-4.9, 2.7). Letters: o d ray, a b c corners, e1 e2
// edges, n normals of the vertices.
#pragma once
#include "shading/stages.h"
#include "simd/lanes.h"

namespace glint {
namespace {

/// What a group of hits reads, a row a lane; the rows of lanes without a triangle hold another
/// lane's.
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

inline void gather_rows(const float* values, const uint32_t* rows, size_t lane,
                        float (&out)[9][kLanes]) {
  for (size_t v = 0; v < 3; ++v) {
    const float* p = values + 3 * size_t(rows[v]);
    out[3 * v][lane] = p[0];
    out[3 * v + 1][lane] = p[1];
    out[3 * v + 2][lane] = p[2];
  }
}

/// Looks up the lanes of group k. False when none of them is on a mesh.
inline bool look_up(const SurfaceStage& s, size_t k, Gathered& at) {
  const size_t lanes = s.count - k < kLanes ? s.count - k : kLanes;
  size_t first = kLanes;
  for (size_t lane = 0; lane < lanes; ++lane) {
    const uint32_t instance = s.instance[k + lane], primitive = s.primitive[k + lane];
    s.material[k + lane] = instance == kNoMaterial ? s.missed : kNoMaterial;
    if (instance == kNoMaterial) continue;
    const InstanceShape& shape = s.instances[instance];
    const GroupShape& group = s.groups[shape.group];
    if (!group.triangles) continue;
    if (first == kLanes) first = lane;
    s.material[k + lane] = material_of(group, primitive);
    at.on_mesh |= 1u << lane;
    at.instance[lane] = &shape;
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
inline Three operator*(const Linear& m, const Three& v) {
  return v.x * m.x + v.y * m.y + v.z * m.z;
}
inline Three rows3(const double (*p)[kLanes]) { return {load(p[0]), load(p[1]), load(p[2])}; }
inline Three rows3(const float (*p)[kLanes]) { return {widen(p[0]), widen(p[1]), widen(p[2])}; }

inline Three vertex_of(const float* values, uint32_t row) {
  const float* p = values + 3 * size_t(row);
  return {splat(p[0]), splat(p[1]), splat(p[2])};
}

struct Matrices {
  Linear m, normal;
  Three t;
  Doubles mirror;
  explicit Matrices(const InstanceShape& shape) {
    const double *p = shape.m, *q = shape.normal;
    m = {splat3(p), splat3(p + 3), splat3(p + 6)};
    t = splat3(p + 9);
    normal = {splat3(q), splat3(q + 3), splat3(q + 6)};
    mirror = splat(shape.mirrors ? -1.0 : 1.0);
  }
  /// After spread_matrices.
  explicit Matrices(const Gathered& at) {
    m = {rows3(at.m), rows3(at.m + 3), rows3(at.m + 6)};
    t = rows3(at.m + 9);
    normal = {rows3(at.normal), rows3(at.normal + 3), rows3(at.normal + 6)};
    mirror = load(at.mirror);
  }
};

/// A corner of each triangle of a group in anchored space, and the edges that leave it.
struct Spread {
  Three a, e1, e2;
  Spread() = default;
  Spread(const Matrices& to_world, const Three (&corners)[3])
      : a(to_world.m * corners[0] + to_world.t),
        e1(to_world.m * (corners[1] - corners[0])),
        e2(to_world.m * (corners[2] - corners[0])) {}
};

/// What else there is of them, in anchored space but for `normals`. g: unit or 0, outward. upright:
/// unit normals of the vertices.
struct Face : Spread {
  Three g, normals[3], upright[3];
  Linear normal;
  Doubles offset;
  bool smooth = false;

  Face() = default;
  Face(const Matrices& to_world, const Three (&corners)[3])
      : Spread(to_world, corners), normal(to_world.normal) {
    g = to_world.mirror * unit(cross(e1, e2));
    offset = rounding(larger(max_abs(a), larger(max_abs(a + e1), max_abs(a + e2))));
  }
  void bend(const Three (&n)[3]) {
    smooth = true;
    for (int k = 0; k < 3; ++k) {
      normals[k] = n[k];
      upright[k] = unit(normal * n[k]);
    }
  }
};

struct Weights {
  Doubles a, b, c;
};

/// In double; the accelerator's own where the ray grazes the plane or the triangle is a needle.
inline Weights solve_weights(const Three& o, const Three& d, const Spread& face, Doubles hit_u,
                             Doubles hit_v) {
  const Three q = cross(d, face.e2), s = o - face.a;
  const Doubles f = 1 / dot(face.e1, q);
  Doubles u = f * dot(s, q), v = f * dot(d, cross(s, face.e1));
  const Mask good = (magnitude(u - hit_u) <= 1e-3) & (magnitude(v - hit_v) <= 1e-3);
  u = choose(good, u, hit_u);
  v = choose(good, v, hit_v);
  u = smaller(larger(u, splat(0)), splat(1));
  v = smaller(larger(v, splat(0)), 1 - u);
  return {1 - u - v, u, v};
}

inline Three blend(const Weights& b, const Three (&n)[3]) {
  const Three &a = n[0], &c = n[1], &e = n[2];
  return {finite_or_zero(b.a * a.x + b.b * c.x + b.c * e.x),
          finite_or_zero(b.a * a.y + b.b * c.y + b.c * e.y),
          finite_or_zero(b.a * a.z + b.b * c.z + b.c * e.z)};
}

/// How much lower than a corner's tangent plane the face is where two other corners' heights over
/// the plane weigh so much, and the plane is moved out to the higher of these.
inline Doubles below_plane(Doubles first, Doubles second, Doubles b, Doubles c) {
  const Doubles top = larger(larger(first, second), splat(0));
  return larger(top - (b * first + c * second), splat(0));
}

/// How far over a face the surface may be that its normals tell of: the least of what the three
/// tangent planes have there, or half of a parabola's.
inline Doubles bulge(const Face& face, const Weights& b, Doubles side) {
  const Three* const n = face.upright;
  const auto over = [&](const Three& edge, int k) { return side * dot(edge, n[k]); };
  const Three e3 = face.e2 - face.e1;
  const Doubles ab = over(face.e1, 0), ac = over(face.e2, 0), ba = -over(face.e1, 1),
                bc = over(e3, 1), ca = -over(face.e2, 2), cb = -over(e3, 2);
  const Doubles least =
      smaller(below_plane(ab, ac, b.b, b.c),
              smaller(below_plane(ba, bc, b.a, b.c), below_plane(ca, cb, b.a, b.b)));
  const Doubles parabola = -(b.a * b.b * (ab + ba) + b.a * b.c * (ac + ca) + b.b * b.c * (bc + cb));
  return larger(least, 0.5 * parabola);
}

/// x moved out by that along the normal, and never below the face: normals of a thin thing may
/// point there by their rounding.
inline Three shadow_origin(const Three& x, const Three& g, const Face& face, const Weights& b,
                           Doubles side) {
  const Three lift = bulge(face, b, side) * side *
                     (b.a * face.upright[0] + b.b * face.upright[1] + b.c * face.upright[2]);
  return x + (lift - smaller(dot(lift, g), splat(0)) * g);
}

inline void place_group(const SurfaceStage& s, size_t k, const Face& face) {
  const Three d = load3(s.d, k), o = load3(s.start, k);
  const Weights b = solve_weights(o, d, face, widen(s.u + k), widen(s.v + k));
  const Three x = face.a + (b.b * face.e1 + b.c * face.e2);
  const Mask flat = nonzero(face.g);
  Three g = face.g;
  if (!all(flat))
    g = choose(flat, g,
               -unit(d));  // a triangle squeezed to a line, met by rounding: it faces the viewer
  const Mask outside = dot(g, d) <= 0;
  const Doubles side = choose(outside, splat(1), splat(-1));
  g = side * g;
  const PointColumns& p = s;
  store3(p.x, k, x);
  store3(p.g, k, g);
  if (face.smooth) {
    const Three blended = unit(face.normal * blend(b, face.normals));
    store3(p.n, k, choose(nonzero(blended), side * blended, g));
    store3(p.origin, k, shadow_origin(x, g, face, b, side));
    if (p.behind[0]) store3(p.behind, k, shadow_origin(x, -g, face, b, -side));
  } else if (p.n[0] != p.g[0]) {
    store3(p.n, k, g);
    store3(p.origin, k, x);
    if (p.behind[0]) store3(p.behind, k, x);
  }
  store(p.offset + k, face.offset);
  store(p.weights[0] + k, b.b);
  store(p.weights[1] + k, b.c);
  store(p.outside + k, outside);
}

/// The face of a group whose lanes may be on different triangles.
inline Face face_of(Gathered& at) {
  if (!at.same_instance) spread_matrices(at);
  const Three corners[3] = {rows3(at.corners), rows3(at.corners + 3), rows3(at.corners + 6)};
  Face face(at.same_instance ? Matrices(*at.instance[0]) : Matrices(at), corners);
  if (at.smooth) face.bend({rows3(at.normals), rows3(at.normals + 3), rows3(at.normals + 6)});
  return face;
}

/// The face of a group that is on one triangle.
inline Face face_of(const InstanceShape& instance, const GroupShape& group, uint32_t primitive) {
  const uint32_t *t = group.triangles + 3 * size_t(primitive),
                 *n = group.normal_rows + 3 * size_t(primitive);
  const float *x = group.vertices, *y = group.normals;
  Face face(Matrices(instance), {vertex_of(x, t[0]), vertex_of(x, t[1]), vertex_of(x, t[2])});
  if (y) face.bend({vertex_of(y, n[0]), vertex_of(y, n[1]), vertex_of(y, n[2])});
  return face;
}

/// The triangle that whole groups are on: often that of the group before.
struct Known {
  Face face;
  uint32_t instance = kNoMaterial, primitive = 0, material = 0;

  void look_up(const SurfaceStage& s, uint32_t i, uint32_t p) {
    if (i == instance && p == primitive) return;
    const InstanceShape& shape = s.instances[i];
    const GroupShape& group = s.groups[shape.group];
    face = face_of(shape, group, p);
    material = material_of(group, p);
    instance = i;
    primitive = p;
  }
};

inline bool on_one_mesh(const SurfaceStage& s, uint32_t instance) {
  return s.groups[s.instances[instance].group].triangles != nullptr;
}

inline void set_material(const SurfaceStage& s, size_t k, uint32_t material) {
  for (size_t lane = 0; lane < kLanes; ++lane) s.material[k + lane] = material;
}

void surface(const SurfaceStage& s) {
  Known known;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const uint32_t instance = s.instance[k], primitive = s.primitive[k];
    const bool alike = s.count - k >= kLanes && same(s.instance + k);
    if (alike && instance == kNoMaterial) {
      set_material(s, k, s.missed);
    } else if (alike && same(s.primitive + k) && on_one_mesh(s, instance)) {
      known.look_up(s, instance, primitive);
      set_material(s, k, known.material);
      place_group(s, k, known.face);
    } else {
      Gathered at;
      if (look_up(s, k, at)) place_group(s, k, face_of(at));
    }
  }
}

}  // namespace
}  // namespace glint
