// Spheres and polygons.
#include <cmath>

#include "brute.h"
#include "bvh/tlas.h"
#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

struct Spheres {
  std::vector<float> centers, radii;
  GeometryView view() const {
    GeometryView g;
    g.kind = GeometryView::kSpheres;
    g.vertices = centers.data();
    g.vertex_count = radii.size();
    g.radii = radii.data();
    g.primitive_count = radii.size();
    return g;
  }
  void add(Vec3d c, double r) {
    centers.insert(centers.end(), {float(c.x), float(c.y), float(c.z)});
    radii.push_back(float(r));
  }
};

struct Polygons {
  std::vector<float> vertices;
  std::vector<uint32_t> offsets{0}, indices;
  GeometryView view() const {
    GeometryView g;
    g.kind = GeometryView::kPolygons;
    g.vertices = vertices.data();
    g.vertex_count = vertices.size() / 3;
    g.offsets = offsets.data();
    g.indices = indices.data();
    g.primitive_count = offsets.size() - 1;
    return g;
  }
  void corner(Vec3d p) {
    indices.push_back(uint32_t(vertices.size() / 3));
    vertices.insert(vertices.end(), {float(p.x), float(p.y), float(p.z)});
  }
  void close() { offsets.push_back(uint32_t(indices.size())); }
};

void compare(const BruteScene& scene, Random& random, int count, double half) {
  const auto accel = build(scene.geometries, scene.instances);
  int hits = 0;
  for (int k = 0; k < count; ++k) {
    const Vec3d o = random.in_box(2 * half), at = random.in_box(half);
    const Ray r = ray(o, at - o, 0, k % 3 ? HUGE_VAL : 1);
    const Hit h = closest(*accel, r);
    uint8_t blocked;
    accel->occluded(&r, &blocked, 1);
    const std::vector<Truth> truth = brute(scene, r);
    CHECK(agrees(truth, h) && agrees(truth, blocked != 0) &&
          (h.instance != Hit::kNone) == (blocked != 0));
    hits += h.instance != Hit::kNone;
  }
  CHECK(hits > count / 200);
}

std::vector<InstanceView> placed(const std::vector<Affine>& matrices) {
  std::vector<InstanceView> list(matrices.size());
  for (size_t k = 0; k < matrices.size(); ++k) list[k].world_from_object = matrices[k];
  return list;
}

/// A star with `points` points around c in the plane of x and y: concave.
void star(Polygons& p, int points, Vec3d c, Vec3d x, Vec3d y) {
  for (int k = 0; k < 2 * points; ++k) {
    const double a = 3.14159265358979 * k / points, r = k % 2 ? 0.35 : 1;
    p.corner(c + (r * std::cos(a)) * x + (r * std::sin(a)) * y);
  }
  p.close();
}

}  // namespace

TEST(shapes, spheres_against_brute_force) {
  Random random(30);
  for (size_t n : {1, 5, 300}) {
    Spheres spheres;
    for (size_t k = 0; k < n; ++k) {
      const double radius = random.uniform(0.01, n > 10 ? 0.1 : 0.5) + (n == 1 ? 0.5 : 0);
      spheres.add(random.in_box(1), radius);
    }
    Affine turned;  // a similarity: turned, mirrored, twice as large
    turned.x = {0, 2, 0};
    turned.y = {2, 0, 0};
    turned.z = {0, 0, 2};
    turned.t = {0.25, 0, 0};
    compare({{spheres.view()}, placed({{}})}, random, rounds(2000), 1);
    compare({{spheres.view()}, placed({turned})}, random, rounds(2000), 1);
    compare({{spheres.view()}, placed({{}, translation({3, 0, 0})})}, random, rounds(2000), 1);
    for (int k = 0; k < 5; ++k)
      compare({{spheres.view()}, placed({random_affine(random, 0.3)})}, random, rounds(1000), 0.5);
  }
}

TEST(shapes, inside_a_sphere) {
  Spheres spheres;
  spheres.add({0, 0, 0}, 1);
  const auto accel = build({spheres.view()}, placed({{}}));
  CHECK(closest(*accel, ray({0, 0, 0}, {0, 0, 2})).t == 0.5);
  CHECK(closest(*accel, ray({0, 0, 0.5}, {0, 0, 1})).t == 0.5);
  CHECK(closest(*accel, ray({0, 0, 3}, {0, 0, -1}, 2)).t == 4);  // the near side is at the open end
  CHECK(closest(*accel, ray({0, 0, 3}, {0, 0, -1}, 0, 2)).instance == Hit::kNone);
}

// At distance/radius 1e4 the textbook's discriminant loses all digits (NUMERICS: spheres).
TEST(shapes, far_spheres) {
  Random random(31);
  for (double radius : {1e-4, 1.0, 1e3}) {
    Spheres spheres;
    spheres.add({0, 0, 0}, radius);
    const auto accel = build({spheres.view()}, placed({{}}));
    const double r = double(spheres.radii[0]);
    int wrong = 0;
    for (int k = 0; k < rounds(100000); ++k) {
      const Vec3d n = random.on_sphere(), side = normalize(cross(n, random.on_sphere())),
                  o = (1e4 * radius) * n;
      const double b = random.uniform(0, 2) * r;
      const Ray ray_k = ray(o, b * side - o);
      const Hit h = closest(*accel, ray_k);
      const V d(ray_k.d), f(o);
      const Real dd = dot(d, d), along = -dot(f, d) / dd;
      const V nearest = f + along * d;
      const Real rest = Real(r) * Real(r) - dot(nearest, nearest);
      if (std::fabs(rest) < 1e-9L * Real(r * r))
        continue;  // double's rounding at 1e4 radii is 1e-12
      const Real t = along - std::sqrt(std::max(rest, Real(0)) / dd);
      wrong += rest > 0 ? std::fabs(Real(h.t) - t) * 1e4L > 1e-9L * Real(r) / std::sqrt(rest)
                        : h.instance != Hit::kNone;
    }
    CHECK(wrong == 0);
  }
}

TEST(shapes, bad_spheres_and_polygons_are_counted) {
  Spheres spheres;
  spheres.add({0, 0, 0}, 1);
  spheres.add({0, 0, 0}, 0);
  spheres.add({0, 0, 0}, -1);
  spheres.add({std::nan(""), 0, 0}, 1);
  spheres.add({0, 0, 0}, std::nan(""));
  const AccelStats stats = build({spheres.view()}, placed({{}}))->stats();
  CHECK(stats.primitives == 1 && stats.dropped == 4);
  Affine flat;
  flat.z = {0, 0, 0};
  CHECK(build({spheres.view()}, placed({flat}))->stats().dropped == 5);
  Polygons polygons;
  star(polygons, 5, {}, {1, 0, 0}, {0, 1, 0});
  polygons.corner({0, 0, 0});
  polygons.corner({1, 0, 0});
  polygons.close();
  polygons.corner({0, 0, 0});
  polygons.corner({1, 1, 1});
  polygons.corner({2, 2, 2});
  polygons.close();
  polygons.corner({0, 0, 0});
  polygons.corner({1, 0, 0});
  polygons.corner({0, std::nan(""), 0});
  polygons.close();
  CHECK(build({polygons.view()}, placed({{}}))->stats().dropped == 3);
}

TEST(shapes, polygons_against_brute_force) {
  Random random(32);
  for (int n : {1, 4, 200}) {
    Polygons polygons;
    for (int k = 0; k < n; ++k) {
      const Vec3d x = random.on_sphere(), y = normalize(cross(x, random.on_sphere()));
      const double s = n > 10 ? 0.2 : 0.8;
      star(polygons, 3 + k % 5, random.in_box(n > 10 ? 1 : 0.2), s * x, s * y);
    }
    const int rays = rounds(n > 10 ? 400 : 2000);
    compare({{polygons.view()}, placed({{}})}, random, rays, 1);
    compare({{polygons.view()}, placed({random_affine(random, 0.2)})}, random, rays / 2, 1);
    compare({{polygons.view()}, placed({{}, translation({3, 0, 0})})}, random, rays, 1);
  }
}

TEST(shapes, polygons_in_the_planes_of_the_axes) {
  for (int axis = 0; axis < 3; ++axis) {
    Polygons polygons;
    Vec3d c, x, y;
    c[axis] = 0.5;
    x[(axis + 1) % 3] = 1;
    y[(axis + 2) % 3] = 1;
    star(polygons, 4, c, x, y);
    const auto accel = build({polygons.view()}, placed({{}}));
    Vec3d o = 0.1 * x + 0.05 * y, out = 0.7 * x + 0.7 * y, d;
    d[axis] = 2;
    CHECK(closest(*accel, ray(o, d)).t == 0.25);
    CHECK(closest(*accel, ray(o, -d)).instance == Hit::kNone);
    CHECK(closest(*accel, ray(out, d)).instance == Hit::kNone);  // between two points of the star
  }
}

// Newell's plane through the middle, and the corners moved onto it along z: a box of the corners
// would lose hits.
TEST(shapes, a_bent_polygon_is_its_plane) {
  Polygons p;
  const double z_of[6] = {0.25, 0, 0.25, 0.25, 0.25, 0},
               xy[6][2] = {{0, 0}, {0.5, 0}, {1, 0}, {1, 1}, {0.5, 1}, {0, 1}};
  for (int k = 0; k < 6; ++k) p.corner({xy[k][0], xy[k][1], z_of[k]});
  p.close();
  V n, middle;  // by hand, in long double
  std::vector<V> corners;
  for (size_t k = 0; k < 6; ++k)
    corners.push_back(
        V(Real(p.vertices[3 * k]), Real(p.vertices[3 * k + 1]), Real(p.vertices[3 * k + 2])));
  for (size_t k = 0; k < 6; ++k) {
    n += cross(corners[k], corners[(k + 1) % 6]);
    middle += Real(1) / 6 * corners[k];
  }
  const auto accel = build({p.view()}, placed({{}}));
  for (double x : {0.001, 0.3, 0.999})
    for (double y : {0.001, 0.6, 0.999}) {
      const Real z = middle.z - (n.x * (Real(x) - middle.x) + n.y * (Real(y) - middle.y)) / n.z;
      const Hit h = closest(*accel, ray({x, y, 9}, {0, 0, -1}));
      CHECK(h.instance == 0 && std::fabs(Real(h.t) - (9 - z)) < 1e-14L);
    }
}

// One outline that runs around a hole and back along the same cut: odd-even leaves the hole open.
TEST(shapes, holes) {
  Polygons p;
  const double outer[5][2] = {{-2, -2}, {2, -2}, {2, 2}, {-2, 2}, {-2, -2}},
               inner[5][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, -1}};
  for (const auto& c : outer) p.corner({c[0], c[1], 0});
  for (const auto& c : inner) p.corner({c[0], c[1], 0});
  p.close();
  const auto accel = build({p.view()}, placed({{}}));
  CHECK(closest(*accel, ray({0.1, 0.2, 1}, {0, 0, -1})).instance == Hit::kNone);
  for (Vec3d o : {Vec3d{1.5, 0.1, 1}, Vec3d{-1.5, 0.1, 1}, Vec3d{0.1, 1.5, 1}, Vec3d{0.1, -1.5, 1}})
    CHECK(closest(*accel, ray(o, {0, 0, -1})).t == 1);
}

TEST(shapes, a_tile_may_pass_by_the_tree_of_one_kind_and_meet_the_others) {
  const Mesh ball = icosphere(2, 0.5, {-2, 0, 0});
  const float center[3] = {2, 0, 0}, radius = 0.5f;
  GeometryView sphere;
  sphere.kind = GeometryView::kSpheres;
  sphere.vertices = center;
  sphere.radii = &radius;
  sphere.vertex_count = sphere.primitive_count = 1;
  InstanceView first, second;
  second.geometry = 1;
  const auto accel = build({ball.view(), sphere}, {first, second});
  for (const double x : {-2.0, 2.0, 0.0}) {
    std::vector<Ray> rays;
    for (int k = 0; k < 64; ++k)
      rays.push_back(ray({x + 0.01 * (k % 8), -5, 0.01 * (k / 8)}, {0, 1, 0}));
    std::vector<Hit> hits(rays.size());
    accel->closest(rays.data(), hits.data(), rays.size());
    for (const Hit& hit : hits) CHECK(hit.instance == (x < 0 ? 0u : x > 0 ? 1u : Hit::kNone));
  }
}

GeometryView strands(const std::vector<float>& vertices, const std::vector<float>& radii,
                     const std::vector<uint32_t>& starts) {
  GeometryView v;
  v.kind = GeometryView::kStrands;
  v.vertices = vertices.data();
  v.vertex_count = radii.size();
  v.radii = radii.data();
  v.indices = starts.data();
  v.primitive_count = starts.size();
  return v;
}

TEST(shapes, strands_are_the_same_to_tiles_and_to_single_rays) {
  Random rng(11);
  std::vector<float> vertices, radii;
  std::vector<uint32_t> starts;
  for (uint32_t strand = 0; strand < 300; ++strand) {
    Vec3d p{rng.uniform(-1, 1), rng.uniform(-1, 1), 0};
    for (uint32_t k = 0; k < 6; ++k) {
      for (int axis = 0; axis < 3; ++axis) vertices.push_back(float(p[axis]));
      radii.push_back(0.02f * float(5 - k));
      if (k < 5) starts.push_back(6 * strand + k);
      p += Vec3d{rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), 0.2};
    }
  }
  vertices[3 * 6 * 7] = std::nanf("");
  const GeometryView hair = strands(vertices, radii, starts);
  InstanceView near, far, flat;
  far.world_from_object = {{1.2, 0.3, 0}, {0, 0.7, 0.1}, {0.2, 0, 1}, {0.5, 3, 0}};
  flat.world_from_object = {{1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {0, 0, -1}};
  const auto accel = build({hair}, {near, far, flat});
  CHECK(accel->validate().empty());
  CHECK(accel->stats().dropped == starts.size() + 1);
  size_t met = 0;
  for (int tile = 0; tile < 40; ++tile) {
    const Vec3d eye{0.2, -5, 1}, at{rng.uniform(-1, 1), rng.uniform(0, 3), rng.uniform(0, 1)};
    std::vector<Ray> rays;
    for (int k = 0; k < 64; ++k)
      rays.push_back(ray(eye, at + Vec3d{0.01 * (k % 8), 0, 0.01 * (k / 8)} - eye));
    std::vector<Hit> hits(rays.size());
    accel->closest(rays.data(), hits.data(), rays.size());
    for (size_t k = 0; k < rays.size(); ++k) {
      const Hit alone = closest(*accel, rays[k]);
      CHECK(alone.instance == hits[k].instance && alone.primitive == hits[k].primitive);
      CHECK(alone.t == hits[k].t && alone.u == hits[k].u);
      CHECK(alone.instance == Hit::kNone || (alone.u >= 0 && alone.u <= 1));
      met += alone.instance != Hit::kNone;
    }
  }
  CHECK(met > 500);
}

TEST(shapes, boxes_lie_along_hair_that_is_combed) {
  Random rng(12);
  std::vector<float> vertices, radii;
  std::vector<uint32_t> starts;
  for (uint32_t strand = 0; strand < 4000; ++strand) {
    const Vec3d root{rng.uniform(-1, 1), rng.uniform(-1, 1), 0};
    for (uint32_t k = 0; k < 3; ++k) {
      const Vec3d bend{rng.uniform(-0.01, 0.01), rng.uniform(-0.01, 0.01), 0},
          p = root + 0.2 * double(k) * Vec3d(1, 1, 1) + bend;
      for (int axis = 0; axis < 3; ++axis) vertices.push_back(float(p[axis]));
      radii.push_back(2e-3f);
      if (k < 2) starts.push_back(3 * strand + k);
    }
  }
  const GeometryView hair = strands(vertices, radii, starts);
  InstanceView here;
  const auto accel = build({hair}, {here});
  CHECK(accel->validate().empty());
  CHECK(static_cast<const TopLevelBvh&>(*accel).object(0)->turns);
  size_t met = 0;
  for (size_t k = 0; k < starts.size(); k += 7) {
    const float* p = &vertices[3 * starts[k]];
    const Vec3d middle{0.5 * (double(p[0]) + double(p[3])), 0.5 * (double(p[1]) + double(p[4])),
                       0.5 * (double(p[2]) + double(p[5]))};
    const Vec3d d{rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
    met += closest(*accel, ray(middle - d, d)).instance != Hit::kNone;
  }
  CHECK(met == (starts.size() + 6) / 7);
}
