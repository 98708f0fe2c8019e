// Letters: o d ray, m world_from_object, b barycentric weights.
#include "scene/surface.h"

#include "math/math.h"
#include "scene/scene.h"

namespace glint {
namespace {

struct Line {
  Vec3d o, d;
};

/// Object-space ray through m; false when m has no inverse.
bool to_object(const Affine& m, const Line& ray, Vec3d& o, Vec3d& d) {
  Vec3d x = cross(m.y, m.z), y = cross(m.z, m.x), z = cross(m.x, m.y), p = ray.o - m.t;
  double f = 1 / dot(m.x, x);
  o = f * Vec3d{dot(x, p), dot(y, p), dot(z, p)};
  d = f * Vec3d{dot(x, ray.d), dot(y, ray.d), dot(z, ray.d)};
  return finite(o) && finite(d);
}

/// The point of the sphere where the ray meets it nearest to t, brought back to the radius.
Vec3d on_sphere(Vec3d o, Vec3d d, double t, Vec3d center, double radius) {
  double scale = length(d);
  Vec3d n = (1 / scale) * d, f = center - o;
  double b = dot(f, n);
  Vec3d miss = f - b * n;
  double root = std::sqrt(std::max(0.0, radius * radius - dot(miss, miss))), near = b - root,
         far = b + root;
  double at = std::fabs(near - t * scale) <= std::fabs(far - t * scale) ? near : far;
  return unit(o + at * n - center);
}

void place_on_sphere(const Affine& m, const NormalMatrix& to_world, const GlintGeometry& geometry,
                     const Line& ray, const Hit& hit, Surface& s) {
  Vec3d center = vertex(geometry, hit.primitive), o, d, n{0, 0, 1};
  double radius = geometry.radii[hit.primitive];
  s.x = ray.o + hit.t * ray.d;
  if (to_object(m, ray, o, d)) {
    n = on_sphere(o, d, hit.t, center, radius);
    s.x = point(m, center + radius * n);
  }
  s.g = to_world(n);
  s.offset =
      rounding(max_abs(point(m, center)) + radius * (max_abs(m.x) + max_abs(m.y) + max_abs(m.z)));
}

/// Where p, near the hull of the spheres about two ends, lies on it: the centre of the sphere among
/// those between them that touches it there, and how far along that is.
struct OnStrand {
  Vec3d center;
  double radius, along;
};

OnStrand on_strand(Vec3d p, Vec3d a, Vec3d b, double ra, double rb) {
  const Vec3d axis = b - a;
  const double L = length(axis), sine = (ra - rb) / L, square = 1 - sine * sine;
  if (!(L > 0 && square > 0)) return ra >= rb ? OnStrand{a, ra, 0} : OnStrand{b, rb, 1};
  const double at = (dot(p - a, axis) / L - ra * sine) / square,
               along = std::clamp(at / L, 0.0, 1.0);
  return {a + along * axis, ra + along * (rb - ra), along};
}

void place_on_strand(const Affine& m, const NormalMatrix& to_world, const GlintGeometry& geometry,
                     const Line& ray, const Hit& hit, Surface& s) {
  const size_t first = geometry.indices[hit.primitive];
  const Vec3d a = vertex(geometry, first), b = vertex(geometry, first + 1);
  const double ra = geometry.radii[first], rb = geometry.radii[first + 1];
  Vec3d o, d, n{0, 0, 1};
  s.x = ray.o + hit.t * ray.d;
  if (to_object(m, ray, o, d)) {
    const Vec3d p = o + hit.t * d;
    const OnStrand at = on_strand(p, a, b, ra, rb);
    n = unit(p - at.center);
    s.x = point(m, at.center + at.radius * n);
    s.weights[0] = 1 - at.along;
    s.weights[1] = at.along;
  }
  s.g = to_world(n);
  // Ends so far away that their steps are as wide as the strand count for nothing: hits are worked
  // out in double.
  const double width = std::max(ra, rb) * (max_abs(m.x) + max_abs(m.y) + max_abs(m.z)),
               ends = std::max(max_abs(point(m, a)), max_abs(point(m, b)));
  s.offset = std::min(rounding(ends + width), std::max(width / 64, rounding(max_abs(s.x) + width)));
}

/// Newell's normal in object space; `reach` becomes the corners' largest coordinate after m.
Vec3d newell(const Affine& m, const GlintGeometry& geometry, size_t primitive, Vec3d& first,
             double& reach) {
  size_t begin = geometry.offsets[primitive], end = geometry.offsets[primitive + 1];
  first = vertex(geometry, geometry.indices[begin]);
  Vec3d sum, last;
  for (size_t k = begin; k < end; ++k) {
    Vec3d p = vertex(geometry, geometry.indices[k]), e = p - first;
    sum += cross(last, e);
    last = e;
    reach = std::max(reach, max_abs(point(m, p)));
  }
  return sum;
}

void place_on_polygon(const Affine& m, const NormalMatrix& to_world, const GlintGeometry& geometry,
                      const Line& ray, const Hit& hit, Surface& s) {
  Vec3d first;
  double reach = 0;
  s.g = to_world(newell(m, geometry, hit.primitive, first, reach));
  double t = dot(point(m, first) - ray.o, s.g) / dot(ray.d, s.g);
  s.x = ray.o + (std::fabs(t - hit.t) <= 1e-3 * std::fabs(hit.t) ? t : hit.t) * ray.d;
  s.offset = rounding(reach);
}

}  // namespace

Surface surface_at(const Scene& scene, Vec3d o, Vec3d d, const Hit& hit) {
  const Line ray{o, d};
  Surface s;
  s.instance = hit.instance;
  s.primitive = hit.primitive;
  const GlintGeometry& geometry = scene.instances.geometry(scene.instances.group(hit.instance));
  const Affine m = scene.instances.matrix(hit.instance);
  const NormalMatrix to_world = scene.instances.normal_matrix(hit.instance);
  if (geometry.kind == GLINT_SPHERES) place_on_sphere(m, to_world, geometry, ray, hit, s);
  else if (geometry.kind == GLINT_STRANDS) place_on_strand(m, to_world, geometry, ray, hit, s);
  else place_on_polygon(m, to_world, geometry, ray, hit, s);
  s.n = s.g;
  s.outside = dot(s.g, d) <= 0;
  if (!s.outside) {
    s.g = -s.g;
    s.n = -s.n;
  }
  return s;
}

Vec3d uv_at(const Scene& scene, const Surface& s) {
  const GlintGeometry& geometry = scene.instances.geometry(scene.instances.group(s.instance));
  const GlintAttribute* a = scene.instances.attributes.data() + geometry.first_attribute;
  const GlintAttribute* const end = a + geometry.attribute_count;
  while (a != end && a->channels != 2) ++a;
  if (a == end) return {};
  const uint32_t* const rows = a->domain == GLINT_CORNER ? geometry.corners : geometry.triangles;
  Vec3d uv{0, 0, 1};
  for (int c = 0; c < 2; ++c) {
    const auto part = [&](size_t v) {
      const size_t row = 3 * size_t(s.primitive) + v;
      return s.weights[v] * a->values[2 * (a->domain == GLINT_FACE ? s.primitive : rows[row]) + c];
    };
    const double sum = part(0) + part(1) + part(2);
    uv[c] = std::isfinite(sum) ? sum : 0;
  }
  return uv;
}

void set_point(ProgramPoints& points, size_t i, const Scene& scene, const Surface& s, Vec3d start,
               Vec3d d, int64_t tag) {
  points.instance[i] = s.instance;
  points.primitive[i] = s.primitive;
  points.outside[i] = s.outside ? -1 : 0;
  for (int c = 0; c < 3; ++c) {
    points.weights[c][i] = s.weights[c];
    points.x[c][i] = s.x[c];
    points.g[c][i] = s.g[c];
    points.n[c][i] = s.n[c];
    points.d[c][i] = d[c];
  }
  points.length[i] = length(s.x - start) / scene.anchor.scale;
  points.tags[i] = tag;
  points.offset[i] = s.offset;
}

}  // namespace glint
