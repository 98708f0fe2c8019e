#include "shapes.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>

namespace glint::test {

uint64_t Random::bits() {
  uint64_t z = state += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}
double Random::uniform(double a, double b) { return a + (b - a) * double(bits() >> 11) * 0x1p-53; }
size_t Random::below(size_t n) { return size_t(bits() % n); }
Vec3d Random::in_box(double half) {
  const double x = uniform(-half, half), y = uniform(-half, half), z = uniform(-half, half);
  return {x, y, z};
}
Vec3d Random::on_sphere() {
  for (;;) {
    const Vec3d p = in_box(1);
    if (dot(p, p) <= 1 && dot(p, p) > 1e-6) return normalize(p);
  }
}

GeometryView Mesh::view() const {
  GeometryView g;
  g.vertices = vertices.data();
  g.vertex_count = vertices.size() / 3;
  g.triangles = triangles.data();
  g.primitive_count = count();
  return g;
}
Vec3d Mesh::corner(size_t triangle, size_t k) const {
  const float* p = &vertices[3 * size_t(triangles[3 * triangle + k])];
  return {double(p[0]), double(p[1]), double(p[2])};
}
uint32_t Mesh::add(Vec3d p) {
  vertices.insert(vertices.end(), {float(p.x), float(p.y), float(p.z)});
  return uint32_t(vertices.size() / 3 - 1);
}
void Mesh::add(uint32_t a, uint32_t b, uint32_t c) { triangles.insert(triangles.end(), {a, b, c}); }

namespace {

struct Sphere {
  std::vector<Vec3d> points;
  std::vector<std::array<uint32_t, 3>> faces;
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;

  Sphere() {
    const double g = 0.5 + 0.5 * std::sqrt(5.0);
    for (double s : {-1.0, 1.0})
      for (double h : {-g, g}) points.insert(points.end(), {{s, h, 0}, {0, s, h}, {h, 0, s}});
    for (Vec3d& p : points) p = normalize(p);
    for (uint32_t a = 0; a < 12; ++a)  // faces: triples of neighbours
      for (uint32_t b = a + 1; b < 12; ++b)
        for (uint32_t c = b + 1; c < 12; ++c)
          if (near(a, b) && near(b, c) && near(c, a)) faces.push_back({a, b, c});
  }
  bool near(uint32_t a, uint32_t b) const { return length(points[a] - points[b]) < 1.2; }
  uint32_t middle(uint32_t a, uint32_t b) {
    const auto [at, fresh] =
        middles.insert({{std::min(a, b), std::max(a, b)}, uint32_t(points.size())});
    if (fresh) points.push_back(normalize(points[a] + points[b]));
    return at->second;
  }
  void split() {
    std::vector<std::array<uint32_t, 3>> finer;
    for (const auto [a, b, c] : faces) {
      const uint32_t x = middle(a, b), y = middle(b, c), z = middle(c, a);
      finer.insert(finer.end(), {{a, x, z}, {b, y, x}, {c, z, y}, {x, y, z}});
    }
    faces = finer;
  }
};

}  // namespace

Mesh icosphere(int level, double radius, Vec3d center) {
  Sphere sphere;
  for (int k = 0; k < level; ++k) sphere.split();
  Mesh mesh;
  for (Vec3d p : sphere.points) mesh.add(center + radius * p);
  for (const auto [a, b, c] : sphere.faces) mesh.add(a, b, c);
  return mesh;
}

Mesh box_grid(int n, double half, Vec3d center) {
  Mesh mesh;
  std::map<std::array<int, 3>, uint32_t> known;
  auto vertex = [&](std::array<int, 3> at) {
    const auto [entry, fresh] = known.insert({at, uint32_t(known.size())});
    if (fresh)
      mesh.add(center + Vec3d((2.0 * at[0] / n - 1) * half, (2.0 * at[1] / n - 1) * half,
                              (2.0 * at[2] / n - 1) * half));
    return entry->second;
  };
  for (size_t axis = 0; axis < 3; ++axis)
    for (int side : {0, n})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          auto at = [&](int u, int v) {
            std::array<int, 3> p{};
            p[axis] = side;
            p[(axis + 1) % 3] = i + u;
            p[(axis + 2) % 3] = j + v;
            return vertex(p);
          };
          const uint32_t a = at(0, 0), b = at(1, 0), c = at(1, 1), d = at(0, 1);
          mesh.add(a, b, c);
          mesh.add(a, c, d);
        }
  return mesh;
}

Mesh bumpy_sphere(int rows, int columns) {
  Mesh mesh;
  const double pi = 3.14159265358979323846;
  for (int i = 0; i <= rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const double a = pi * i / rows, b = 2 * pi * j / columns;
      const double r = 1 + 0.05 * std::sin(9 * a) * std::cos(7 * b) +
                       0.01 * std::sin(41 * a + 3) * std::sin(37 * b);
      mesh.add(r * Vec3d(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)));
    }
  auto at = [columns](int i, int j) { return uint32_t(i * columns + j % columns); };
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) {
      mesh.add(at(i, j), at(i + 1, j), at(i + 1, j + 1));
      mesh.add(at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
  return mesh;
}

Mesh soup(Random& random, size_t count, double half, double size) {
  Mesh mesh;
  for (size_t k = 0; k < count; ++k) {
    const Vec3d c = random.in_box(half);
    const uint32_t a = mesh.add(c + random.in_box(size)), b = mesh.add(c + random.in_box(size));
    mesh.add(a, b, mesh.add(c + random.in_box(size)));
  }
  return mesh;
}

void MixedShapes::add_round_and_square(Random& random, int count, double size) {
  for (int k = 0; k < count; ++k) {
    const Vec3d at = random.in_box(2), c = random.in_box(2), x = size * random.on_sphere(),
                y = size * random.on_sphere();
    centers_.insert(centers_.end(), {float(at.x), float(at.y), float(at.z)});
    radii_.push_back(0.05f);
    for (Vec3d p : {c + x, c + y, c - x, c - y}) {
      indices_.push_back(uint32_t(indices_.size()));
      corners_.insert(corners_.end(), {float(p.x), float(p.y), float(p.z)});
    }
    offsets_.push_back(uint32_t(indices_.size()));
  }
}

void MixedShapes::add_shapes() {
  GeometryView spheres, polygons;
  spheres.kind = GeometryView::kSpheres;
  spheres.vertices = centers_.data();
  spheres.radii = radii_.data();
  spheres.vertex_count = spheres.primitive_count = radii_.size();
  polygons.kind = GeometryView::kPolygons;
  polygons.vertices = corners_.data();
  polygons.vertex_count = indices_.size();
  polygons.offsets = offsets_.data();
  polygons.indices = indices_.data();
  polygons.primitive_count = offsets_.size() - 1;
  geometries.push_back(spheres);
  geometries.push_back(polygons);
}

void MixedShapes::place(uint32_t geometry, const Affine& world_from_object) {
  InstanceView i;
  i.geometry = geometry;
  i.world_from_object = world_from_object;
  instances.push_back(i);
}

Affine translation(Vec3d t) {
  Affine m;
  m.t = t;
  return m;
}

Affine random_affine(Random& random, double half) {
  const Vec3d x = random.in_box(1), y = random.in_box(1), z = random.in_box(1);
  return {x, y, z, random.in_box(half)};
}

Ray ray(Vec3d o, Vec3d d, double t_min, double t_max, uint32_t visibility) {
  return {o, d, t_min, t_max, visibility};
}

std::unique_ptr<Accel> build(const std::vector<GeometryView>& geometries,
                             const std::vector<InstanceView>& instances, int threads,
                             BuildQuality quality) {
  const std::atomic<bool> cancel{false};
  std::unique_ptr<Accel> wanted;
  for (BuildQuality q : kQualities) {
    std::unique_ptr<Accel> accel = Accel::build(geometries, instances, threads, cancel, q);
    const std::string problem = accel->validate();
    if (!problem.empty()) {
      std::fprintf(stderr, "the tree of quality %d is wrong: %s\n", int(q), problem.c_str());
      std::exit(1);
    }
    if (q == quality) wanted = std::move(accel);
  }
  return wanted;
}
std::unique_ptr<Accel> build(const Mesh& mesh, const Affine& m, int threads, BuildQuality quality) {
  InstanceView i;
  i.world_from_object = m;
  return build({mesh.view()}, {i}, threads, quality);
}

Hit closest(const Accel& accel, const Ray& r) {
  Hit h;
  accel.closest(&r, &h, 1);
  return h;
}

bool same(const Hit& a, const Hit& b) {
  return std::memcmp(&a.t, &b.t, sizeof a.t) == 0 && a.instance == b.instance &&
         a.primitive == b.primitive && std::memcmp(&a.u, &b.u, sizeof a.u) == 0 &&
         std::memcmp(&a.v, &b.v, sizeof a.v) == 0;
}

int differences(const Accel& accel, std::vector<Ray> rays, uint32_t visibility) {
  for (Ray& r : rays) r.visibility = visibility;
  std::vector<Hit> hits(rays.size());
  std::vector<uint8_t> blocked(rays.size());
  accel.closest(rays.data(), hits.data(), rays.size());
  accel.occluded(rays.data(), blocked.data(), rays.size());
  int count = 0;
  for (size_t k = 0; k < rays.size(); ++k) {
    Hit hit;
    uint8_t stopped = 0;
    accel.closest(&rays[k], &hit, 1);
    accel.occluded(&rays[k], &stopped, 1);
    count += !same(hit, hits[k]) || stopped != blocked[k] ||
             (hit.instance != Hit::kNone) != (stopped != 0);
  }
  return count;
}

}  // namespace glint::test
