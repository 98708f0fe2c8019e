// No ray through a closed mesh, whichever edge or corner it is aimed at (NUMERICS: at most 0
// leaks).
#include <cmath>

#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

constexpr int kRays = rounds(120000);

/// A point of the mesh where leaks would be: a corner, the middle of an edge, or anywhere on an
/// edge.
Vec3d target(const Mesh& mesh, Random& random) {
  const size_t t = random.below(mesh.count()), k = random.below(3);
  const Vec3d a = mesh.corner(t, k), b = mesh.corner(t, (k + 1) % 3);
  const double s = random.below(3) ? random.below(2) ? 0 : 0.5 : random.uniform();
  return a + s * (b - a);
}

/// Rays that begin inside and see nothing.
int leaks(const Mesh& mesh, const std::vector<InstanceView>& instances, Vec3d center, double radius,
          uint64_t seed) {
  Random random(seed);
  const auto accel = build({mesh.view()}, instances);
  const Affine& m = instances[0].world_from_object;
  std::vector<Ray> rays;
  for (int k = 0; k < kRays; ++k) {
    const Vec3d o = point(m, center + (k % 2 ? 0.3 * radius : 0.0) * random.in_box(1)),
                p = point(m, target(mesh, random));
    rays.push_back(ray(o, p - o));
  }
  std::vector<Hit> hits(rays.size());
  std::vector<uint8_t> blocked(rays.size());
  accel->closest(rays.data(), hits.data(), rays.size());
  accel->occluded(rays.data(), blocked.data(), rays.size());
  int count = 0;
  for (size_t k = 0; k < rays.size(); ++k) count += hits[k].instance == Hit::kNone || !blocked[k];
  return count;
}

const Vec3d kPlaces[] = {{0, 0, 0}, {1000, 1000, 1000}};

}  // namespace

TEST(watertight, icospheres) {
  for (Vec3d center : kPlaces)
    for (double radius : {1e-3, 1.0, 1e4})
      CHECK(leaks(icosphere(3, radius, center), {InstanceView{}}, center, radius, 20) == 0);
}

TEST(watertight, grids) {
  for (Vec3d center : kPlaces)
    for (double radius : {1e-3, 1.0, 1e4})
      CHECK(leaks(box_grid(64, radius, center), {InstanceView{}}, center, radius, 21) == 0);
}

TEST(watertight, instances) {
  Random random(22);
  InstanceView far_away;
  far_away.world_from_object = translation({1e9, 0, 0});
  for (int k = 0; k < 6; ++k) {
    InstanceView i;
    i.world_from_object = random_affine(random, k % 2 ? 1e3 : 1);
    CHECK(leaks(icosphere(3, 1, {}), {i, far_away}, {}, 1, 23) == 0);
    CHECK(leaks(box_grid(16, 1, {}), {i, far_away}, {}, 1, 24) == 0);
    CHECK(leaks(box_grid(16, 1, {}), {i}, {}, 1, 25) == 0);
  }
}

TEST(watertight, along_the_axes_through_corners) {
  const int n = 16;
  const Mesh mesh = box_grid(n, 1, {});
  const auto accel = build(mesh);
  int leaks = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n; ++j)
        for (double sign : {-1.0, 1.0}) {
          Vec3d o, d;
          o[(axis + 1) % 3] = 2.0 * i / n - 1;
          o[(axis + 2) % 3] = 2.0 * j / n - 1;
          d[axis] = sign;
          d[(axis + 1) % 3] = i % 2 ? 0.0 : -0.0;
          leaks += closest(*accel, ray(o, d)).instance == Hit::kNone;
        }
  CHECK(leaks == 0);
}

// From outside: a ray at an edge that two faces turn towards it must stop there, not on the far
// side.
TEST(watertight, from_outside) {
  Random random(26);
  for (Vec3d center : kPlaces) {
    const Mesh mesh = icosphere(3, 1, center);
    const auto accel = build(mesh);
    int leaks = 0;
    for (int k = 0; k < 4 * kRays; ++k) {
      const Vec3d p = target(mesh, random), n = normalize(p - center),
                  o = p + 3.0 * normalize(n + 0.9 * random.on_sphere());
      if (dot(normalize(o - p), n) < 0.3) continue;
      const double t = closest(*accel, ray(o, p - o)).t;
      leaks += !(t < 1.001);
    }
    CHECK(leaks == 0);
  }
}
