#include "brute.h"

#include <cstdlib>

namespace glint::test {
namespace {

constexpr Real kFloat = 0x1p-24L, kDouble = 0x1p-53L;

V world(const Affine& m, const float* p) {
  return Real(p[0]) * V(m.x) + Real(p[1]) * V(m.y) + Real(p[2]) * V(m.z) + V(m.t);
}
Real size(V a) { return std::sqrt(dot(a, a)); }

/// Linear part inverted by cofactors; columns.
struct Inverse {
  V x, y, z;
  Real det;
  explicit Inverse(const Affine& m) {
    const V a(m.x), b(m.y), c(m.z);
    det = dot(a, cross(b, c));
    x = cross(b, c);
    y = cross(c, a);
    z = cross(a, b);
  }
  V operator()(V p) const { return Real(1) / det * V(dot(x, p), dot(y, p), dot(z, p)); }
};

struct Caster {
  const GeometryView& g;
  const InstanceView& i;
  uint32_t number;
  const Ray& ray;
  std::vector<Truth>& out;
  V o = V(ray.o), d = V(ray.d);
  Real extent = largest_coordinate();

  /// Close to the ends of the ray nothing is certain.
  void keep(Truth t) const {
    if (t.inside > -t.room && t.t + t.t_room > Real(ray.t_min) &&
        t.t - t.t_room < Real(ray.t_max)) {
      if (t.t - t.t_room <= Real(ray.t_min) || t.t + t.t_room >= Real(ray.t_max)) t.inside = 0;
      out.push_back(t);
    }
  }
  V vertex(size_t k) const { return world(i.world_from_object, g.vertices + 3 * k); }

  /// Bound of the rounding of a point: 8 ulps of what is added up on the way to it, in object space
  /// and in the world.
  Real blur(Real distance) const {
    const Affine& m = i.world_from_object;
    return 8 * kFloat *
           (size(V(m.t)) + 3 * extent * (size(V(m.x)) + size(V(m.y)) + size(V(m.z))) + size(o) +
            distance);
  }
  Real largest_coordinate() const {
    Real e = 0;
    for (size_t k = 0; k < 3 * g.vertex_count; ++k) e = std::max(e, Real(std::fabs(g.vertices[k])));
    return e;
  }

  void triangle(uint32_t primitive) const {
    const uint32_t* t = g.triangles + 3 * size_t(primitive);
    const V a = vertex(t[0]), b = vertex(t[1]) - a, c = vertex(t[2]) - a, n = cross(b, c),
            s = o - a;
    const Real det = -dot(n, d);
    if (!(std::fabs(det) > 0)) return squeezed(primitive, a, b, c);
    const V q = cross(s, d);
    const Real at = dot(n, s) / det, u = dot(q, c) / det, v = -dot(q, b) / det;
    const Real edge = std::max({size(b), size(c), size(c - b)}), length_d = size(d);
    const Real e = blur(std::fabs(at) * length_d + edge);
    const Real room = 4 * e * length_d * edge / std::fabs(det);
    keep({number, primitive, at, std::min({u, v, 1 - u - v}), room,
          2 * e * size(n) / std::fabs(det) + room * edge / length_d, u, v});
  }

  /// A triangle seen from its edge, or squeezed to a line: it may or may not be hit by rays that
  /// come within rounding of one of its edges.
  void squeezed(uint32_t primitive, V a, V b, V c) const {
    const Real edge = std::max({size(b), size(c), size(c - b)}), dd = dot(d, d);
    const V corners[3] = {a, a + b, a + c};
    for (int k = 0; k < 3; ++k) {
      const V p = corners[k] - o, e = corners[(k + 1) % 3] - corners[k];
      const V across = e - dot(e, d) / dd * d, from = p - dot(p, d) / dd * d;  // seen along the ray
      const Real s =
          dot(across, across) > 0
              ? std::min(std::max(-dot(from, across) / dot(across, across), Real(0)), Real(1))
              : 0;
      const Real at = dot(p + s * e, d) / dd;
      if (size(from + s * across) <= 4 * blur(std::fabs(at) * std::sqrt(dd) + edge))
        out.push_back({number, primitive, at, 0, HUGE_VALL, 2 * edge / std::sqrt(dd), 0, 0});
    }
  }

  void spheres() const {
    const Inverse inverse(i.world_from_object);
    const V lo = inverse(o - V(i.world_from_object.t)), ld = inverse(d);
    for (uint32_t k = 0; k < g.primitive_count; ++k) sphere(k, lo, ld, inverse.det);
  }
  void sphere(uint32_t k, V lo, V ld, Real det) const {
    const float* c = g.vertices + 3 * size_t(k);
    const V f = lo - V(Real(c[0]), Real(c[1]), Real(c[2]));
    const Real r = g.radii[k], dd = dot(ld, ld), b = -dot(f, ld) / dd;
    const V nearest = f + b * ld;
    const Real inside = r - size(nearest),
               half = std::sqrt(std::max(r * r - dot(nearest, nearest), Real(0)) / dd);
    const Affine& m = i.world_from_object;
    const Real scale = std::cbrt(
        std::fabs(det));  // of a similarity: only then the sphere is rounded in world space
    const Real room =
        8 * kFloat * (size(V(m.t)) / scale + size(V(Real(c[0]), Real(c[1]), Real(c[2]))) + r) +
        64 * kDouble * size(lo);
    const Real t_room = std::sqrt(2 * room * (r + room) / dd);
    for (Real t : {b - half, b + half})
      keep({number, k, t, inside, room, t_room + 64 * kDouble * std::fabs(t)});
  }

  void polygon(uint32_t k) const {
    V n, center;
    const uint32_t first = g.offsets[k], last = g.offsets[k + 1];
    std::vector<V> p;
    for (uint32_t c = first; c < last; ++c) {
      p.push_back(vertex(g.indices[c]));
      center += p.back();
    }
    center = Real(1) / Real(p.size()) * center;
    for (size_t c = 0; c < p.size(); ++c) n += cross(p[c] - center, p[(c + 1) % p.size()] - center);
    n = Real(1) / size(n) * n;
    const Real cosine = dot(n, d), t = dot(n, center - o) / cosine;
    if (!(std::fabs(t) < HUGE_VALL)) return;
    const Real e = blur(std::fabs(t) * size(d)), t_room = 4 * e / std::fabs(cosine);
    keep({number, k, t, inside(p, n, o + t * d), e + t_room * size(d), t_room});
  }

  /// Distance to the nearest edge, positive inside by the winding of angles (the polygons of the
  /// tests do not cross themselves).
  static Real inside(const std::vector<V>& p, V n, V x) {
    Real angle = 0, nearest = HUGE_VALL;
    for (size_t k = 0; k < p.size(); ++k) {
      const V a = p[k] - x, b = p[(k + 1) % p.size()] - x, edge = b - a;
      angle += std::atan2(dot(n, cross(a, b)), dot(a, b));
      const Real s = std::min(std::max(-dot(a, edge) / dot(edge, edge), Real(0)), Real(1));
      nearest = std::min(nearest, size(a + s * edge));
    }
    return std::fabs(angle) > 3 ? nearest : -nearest;
  }

  void cast() const {
    if (g.kind == GeometryView::kSpheres) return spheres();
    for (uint32_t k = 0; k < g.primitive_count; ++k)
      g.kind == GeometryView::kMesh ? triangle(k) : polygon(k);
  }
};

}  // namespace

std::vector<Truth> brute(const BruteScene& scene, const Ray& ray) {
  std::vector<Truth> out;
  for (uint32_t k = 0; k < scene.instances.size(); ++k) {
    const InstanceView& i = scene.instances[k];
    if (!(i.visibility & ray.visibility)) continue;
    Caster{scene.geometries[i.geometry], i, k, ray, out}.cast();
  }
  return out;
}

bool agrees(const std::vector<Truth>& truth, const Hit& hit) {
  bool found = hit.instance == Hit::kNone;
  const Real t = found ? HUGE_VALL : Real(hit.t);
  for (const Truth& a : truth) {
    const Real off = std::max(std::fabs(a.u - Real(hit.u)), std::fabs(a.v - Real(hit.v)));
    found |= a.instance == hit.instance && a.primitive == hit.primitive &&
             std::fabs(a.t - t) <= a.t_room && off <= a.room + kFloat;
    if (a.inside > a.room && a.t + a.t_room < t) return false;
  }
  return found;
}

bool agrees(const std::vector<Truth>& truth, bool blocked) {
  bool certain = false;
  for (const Truth& a : truth) certain |= a.inside > a.room;
  return blocked ? !truth.empty() : !certain;
}

}  // namespace glint::test
