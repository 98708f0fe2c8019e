// Numbers near the ends of float and double: rays alone and in packets come to one answer, and to
// the right one where there is one.
#include <algorithm>
#include <cmath>

#include "brute.h"
#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

/// y = z, from y = 0 up to a corner far away.
Mesh slope(double far) {
  Mesh mesh;
  mesh.add(mesh.add({0, far, far}), mesh.add({-1, 0, 0}), mesh.add({1, 0, 0}));
  return mesh;
}

}  // namespace

// Depths worked out from the corner far away have the rounding of its distance: rays that are past
// the triangle then hit it in front.
TEST(extremes, a_corner_far_away_does_not_blur_the_near_end) {
  Random random(80);
  for (double far : {1e6, 1e10, 1e20, 1e30}) {
    const auto accel = build(slope(far));
    std::vector<Ray> rays;
    for (int k = 0; k < 640; ++k) {
      const double x = random.uniform(-0.5, 0.5), y = random.uniform(0.5, 5),
                   above = k % 3 ? 2 : -2;
      rays.push_back(ray({x, y, y + above}, {0, 0, -1}));
      const Hit h = closest(*accel, rays.back());
      CHECK((h.instance == 0) == (above > 0) &&
            (above < 0 || std::fabs(h.t - above) <= 16 * 0x1p-53 * 8));
    }
    CHECK(differences(*accel, rays, kCamera) == 0);
  }
}

// Products of three such coordinates are infinite in float, and their differences NaN.
TEST(extremes, some_corners_far_away) {
  Random random(81);
  for (double far : {1e13, 1e19, 1e25, 1e30, 3e38}) {
    Mesh mesh = soup(random, 60, 1, 0.5);
    for (int k = 0; k < 12; ++k)
      mesh.vertices[random.below(mesh.vertices.size())] = float(random.uniform(-1, 1) * far);
    const BruteScene scene{{mesh.view()}, {{0, kCamera, {}}}};
    const auto accel = build(scene.geometries, scene.instances);
    std::vector<Ray> rays;
    for (int k = 0; k < 640; ++k) {
      const double away = random.below(4) ? 1 : random.uniform(0, 1) * std::min(far, 1e30);
      rays.push_back(
          ray(away * random.in_box(2), k / 64 % 2 ? Vec3d{0.3, -0.2, 1} : random.on_sphere()));
      CHECK(agrees(brute(scene, rays.back()), closest(*accel, rays.back())));
    }
    CHECK(differences(*accel, rays, kCamera) == 0);
  }
}

// What is hit so far away that no double holds t is not hit.
TEST(extremes, no_hit_is_farther_away_than_the_largest_number) {
  const auto accel = build(slope(4));
  std::vector<Ray> rays;
  for (int k = 0; k < 64; ++k)
    rays.push_back(ray({0, 1, 1 + 0.25 * (k + 1)}, {0, 0, -0x1.8p-1022}));
  for (const Ray& r : rays)
    CHECK((closest(*accel, r).instance == 0) == std::isfinite((r.o.z - 1) / 0x1.8p-1022));
  CHECK(differences(*accel, rays, kCamera) == 0);
}

// Rays that end before the first box by less than the smallest float: their depth is -0, and
// nothing is left to visit.
TEST(extremes, rays_that_end_at_minus_zero) {
  Mesh mesh;
  mesh.add(mesh.add({0, 0, 0}), mesh.add({1e-45, 0, 0}), mesh.add({0, 1e-45, 0}));
  const auto accel = build(mesh);
  std::vector<Ray> rays;
  for (int k = 1; k <= 640; ++k)
    rays.push_back(ray({1e-46, 1e-46, 1e-44}, {0, 0, -1}, 0, k * 2e-47));
  for (const Ray& r : rays) CHECK((closest(*accel, r).instance == 0) == (r.t_max > 1e-44));
  CHECK(differences(*accel, rays, kCamera) == 0);
}
