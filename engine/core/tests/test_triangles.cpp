// Triangles against brute force in long double; ties; open ends; odd directions.
#include <algorithm>
#include <cmath>
#include <limits>

#include "brute.h"
#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

InstanceView at(uint32_t geometry, const Affine& m = {}) {
  return {geometry, kCamera | kMirror | kShadow, m};
}

/// Rays of all sorts through a region of half width `half`.
Ray any_ray(Random& random, double half) {
  const Vec3d o = random.in_box(2 * half);
  Vec3d d = random.below(4) ? random.in_box(half) - o : random.on_sphere();
  if (random.below(8) == 0) d[int(random.below(3))] = 0;
  const double t = random.below(3) ? HUGE_VAL : random.uniform(0.2, 2);
  return ray(o, d, random.below(3) ? 0 : random.uniform(0, 1), t);
}

void compare(const BruteScene& scene, const Accel& accel, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  std::vector<uint8_t> blocked(rays.size());
  accel.closest(rays.data(), hits.data(), rays.size());
  accel.occluded(rays.data(), blocked.data(), rays.size());
  for (size_t k = 0; k < rays.size(); ++k) {
    const std::vector<Truth> truth = brute(scene, rays[k]);
    CHECK(agrees(truth, hits[k]));
    CHECK(agrees(truth, blocked[k] != 0));
    CHECK((hits[k].instance != Hit::kNone) == (blocked[k] != 0));
  }
}

}  // namespace

TEST(triangles, soups_against_brute_force) {
  Random random(10);
  for (double half : {1e-3, 1.0, 1e3})
    for (size_t n : {1, 7, 100, 700}) {
      const Mesh mesh = soup(random, n, half, half * (n < 50 ? 1 : 0.2));
      const BruteScene scene{{mesh.view()}, {at(0)}};
      std::vector<Ray> rays;
      for (int k = 0; k < 1500; ++k) rays.push_back(any_ray(random, half));
      compare(scene, *build(scene.geometries, scene.instances), rays);
    }
}

TEST(triangles, distance_and_weights_are_those_of_double) {
  Random random(11);
  const Mesh mesh = icosphere(4, 1, {0.5, -0.25, 2});
  const auto accel = build(mesh);
  for (int k = 0; k < 20000; ++k) {
    const Ray r = ray(random.in_box(4), random.on_sphere());
    const Hit h = closest(*accel, r);
    if (h.instance == Hit::kNone) continue;
    const V a(mesh.corner(h.primitive, 0)), b(mesh.corner(h.primitive, 1)),
        c(mesh.corner(h.primitive, 2));
    const V n = cross(b - a, c - a);
    const Real det = dot(n, V(r.d)), cosine = std::fabs(det) / std::sqrt(dot(n, n));
    if (cosine < 0.01L || std::min({h.u, h.v, 1 - h.u - h.v}) < 1e-3f) continue;
    // Each coordinate is below 8; the solution loses what the cosine and the triangle's size (0.06)
    // take.
    const Real t = dot(n, a - V(r.o)) / det, room = 64 * 0x1p-53L * 8 / cosine;
    CHECK(std::fabs(t - Real(h.t)) <= room);
    const V p = V(r.o) + t * V(r.d),
            q = (1 - Real(h.u) - Real(h.v)) * a + Real(h.u) * b + Real(h.v) * c;
    CHECK(std::sqrt(dot(p - q, p - q)) <= room + 4 * 0x1p-24L * 0.2L);  // u and v are floats
  }
}

TEST(triangles, the_interval_is_open) {
  Mesh mesh;
  mesh.add(mesh.add({-1, -1, 0}), mesh.add({1, -1, 0}), mesh.add({0, 1, 0}));
  const auto accel = build(mesh);
  const double next = std::nextafter(2.0, 3.0), before = std::nextafter(2.0, 1.0);
  const double nan = std::nan("");
  const struct {
    double t_min, t_max;
    bool hit;
  } cases[] = {{0, 2, false},  {0, next, true}, {2, 9, false},   {before, 9, true},
               {-3, 1, false}, {nan, 9, false}, {0, nan, false}, {9, 0, false}};
  for (const auto& c : cases) {
    const Ray r = ray({0, 0, 2}, {0, 0, -1}, c.t_min, c.t_max);
    uint8_t blocked = 7;
    accel->occluded(&r, &blocked, 1);
    CHECK((closest(*accel, r).instance == 0) == c.hit && (blocked == 1) == c.hit);
  }
  CHECK(closest(*accel, ray({0, 0, -2}, {0, 0, -1}, -5)).t == -2);
}

TEST(triangles, directions_of_any_length) {
  const Mesh mesh = icosphere(2, 1, {});
  const auto accel = build(mesh);
  for (double length : {1e-290, 1e-40, 1e-5, 1.0, 1e5, 1e40, 1e290}) {
    const Hit one = closest(*accel, ray({0.1, 0.2, 5}, {0, 0.01, -1}));
    const Hit h = closest(*accel, ray({0.1, 0.2, 5}, length * Vec3d{0, 0.01, -1}));
    CHECK(h.primitive == one.primitive && std::fabs(h.t * length / one.t - 1) < 1e-14);
  }
}

TEST(triangles, rays_that_are_none_hit_nothing) {
  const auto accel = build(icosphere(2, 1, {}));
  const double inf = HUGE_VAL, nan = std::nan("");
  const Vec3d bad[] = {{0, 0, 0}, {nan, 0, 1}, {inf, 0, 0}, {0, -inf, 1}};
  for (Vec3d d : bad) CHECK(closest(*accel, ray({0, 0, 0}, d)).instance == Hit::kNone);
  CHECK(closest(*accel, ray({nan, 0, 0}, {0, 0, 1})).instance == Hit::kNone);
  CHECK(closest(*accel, ray({inf, 0, 0}, {-1, 0, 0})).instance == Hit::kNone);
}

TEST(triangles, coincident_faces_give_the_lower_number) {
  Random random(12);
  const Mesh base = soup(random, 60, 1, 0.4);
  for (int round = 0; round < 10; ++round) {
    Mesh mesh;
    mesh.vertices = base.vertices;
    std::vector<uint32_t> which;
    for (uint32_t k = 0; k < 60; ++k)
      for (int copy = 0; copy < 20; ++copy) which.push_back(k);
    for (size_t k = which.size(); k > 1; --k) std::swap(which[k - 1], which[random.below(k)]);
    std::vector<uint32_t> first(60, Hit::kNone);
    for (uint32_t k = 0; k < which.size(); ++k) {
      const uint32_t* t = &base.triangles[3 * which[k]];
      const size_t turn = random.below(3);  // the same triangle from another corner
      mesh.add(t[turn], t[(turn + 1) % 3], t[(turn + 2) % 3]);
      first[which[k]] = std::min(first[which[k]], k);
    }
    const auto accel = build(mesh);
    for (int k = 0; k < 500; ++k) {
      const Hit h = closest(*accel, ray(random.in_box(2), random.on_sphere()));
      if (h.instance == 0) CHECK(h.primitive == first[which[h.primitive]]);
    }
  }
}

TEST(triangles, coincident_objects_give_the_lower_instance) {
  Random random(13);
  const Mesh mesh = icosphere(3, 1, {});
  const Affine m = random_affine(random, 1);
  for (bool shared : {false, true}) {
    const std::vector<GeometryView> views{mesh.view(), mesh.view(), mesh.view()};
    std::vector<InstanceView> instances;
    for (uint32_t k = 0; k < 3; ++k) instances.push_back(at(shared ? 0 : 2 - k, m));
    const auto accel = build(views, instances);
    int hits = 0;
    for (int k = 0; k < 2000; ++k) {
      const Hit h = closest(*accel, ray(m.t, random.on_sphere()));
      CHECK(h.instance == 0);
      hits += h.instance == 0;
    }
    CHECK(hits == 2000);
  }
}

TEST(triangles, slivers_and_extremes_against_brute_force) {
  Random random(14);
  Mesh mesh;
  for (int k = 0; k < 400; ++k) {
    const Vec3d c = random.in_box(1), e = random.in_box(0.5), thin = random.in_box(1e-7);
    const double s = std::pow(10, random.uniform(-6, 0));
    mesh.add(mesh.add(c), mesh.add(c + s * e),
             mesh.add(k % 2 ? c + 0.5 * s * e + s * thin : c + s * random.in_box(1)));
  }
  const BruteScene scene{{mesh.view()}, {at(0)}};
  std::vector<Ray> rays;
  for (int k = 0; k < 3000; ++k) {
    const size_t t = random.below(mesh.count());
    const Vec3d target =
                    0.4 * mesh.corner(t, 0) + 0.3 * mesh.corner(t, 1) + 0.3 * mesh.corner(t, 2),
                o = random.in_box(2);
    rays.push_back(ray(o, target - o));
  }
  compare(scene, *build(scene.geometries, scene.instances), rays);
}
