// Rays from so far away, and shapes so small, large or thin, that float or double rounds away most
// of them: whatever is hit there, it is the same alone and in packets, and is found again within
// ends that are next to it.
#include <cmath>

#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

struct Answer {
  Hit hit;
  uint8_t blocked;
};

std::vector<Answer> ask(const Accel& accel, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  std::vector<uint8_t> blocked(rays.size());
  accel.closest(rays.data(), hits.data(), rays.size());
  accel.occluded(rays.data(), blocked.data(), rays.size());
  std::vector<Answer> answers;
  for (size_t k = 0; k < rays.size(); ++k) answers.push_back({hits[k], blocked[k]});
  return answers;
}

bool same(const Answer& a, const Answer& b) {
  return test::same(a.hit, b.hit) && a.blocked == b.blocked;
}

bool sound(const Answer& a, const Ray& r) {
  const bool hit = a.hit.instance != Hit::kNone;
  return hit == (a.blocked != 0) && (!hit || (a.hit.t > r.t_min && a.hit.t < r.t_max));
}

/// Checks a batch of rays against each of them alone, and with ends at their hits. At least one is
/// to hit.
void check_steady(const Accel& accel, const std::vector<Ray>& rays) {
  const std::vector<Answer> answers = ask(accel, rays);
  std::vector<Ray> between = rays, before = rays;
  int hits = 0, bad = 0;
  for (size_t k = 0; k < rays.size(); ++k) {
    bad += !sound(answers[k], rays[k]) || !same(answers[k], ask(accel, {rays[k]})[0]);
    if (answers[k].hit.instance == Hit::kNone) continue;
    const double t = answers[k].hit.t;
    ++hits;
    before[k].t_max = t;
    between[k].t_min = std::nextafter(t, 0);
    between[k].t_max = std::nextafter(t, HUGE_VAL);
  }
  const std::vector<Answer> again = ask(accel, between), nearer = ask(accel, before);
  for (size_t k = 0; k < rays.size(); ++k)
    bad += !same(again[k], answers[k]) || !sound(nearer[k], before[k]);
  CHECK(bad == 0);
  CHECK(hits > 0);
}

/// A tile of rays from one side, or from one point, `distance` away.
std::vector<Ray> tile(Random& random, double distance, bool parallel) {
  const Vec3d side = parallel ? Vec3d{0, 0, 1} : random.on_sphere(), eye = distance * side;
  std::vector<Ray> rays;
  for (int k = 0; k < 64; ++k) {
    const Vec3d target = random.in_box(0.5);
    rays.push_back(parallel ? ray(target + eye, -side) : ray(eye, target - eye));
  }
  return rays;
}

}  // namespace

TEST(steady, rays_from_far_away) {
  Random random(91);
  const Mesh mesh = soup(random, 60, 1, 1);
  const InstanceView one{0, kCamera, random_affine(random, 0)},
      other{0, kCamera, random_affine(random, 0)};
  const auto accel = build(mesh), placed = build({mesh.view()}, {one, other});
  for (double distance : {1e8, 1e12, 1e15, 1e19, 1e40, 1e80, 1e120})
    for (int k = 0; k < 20; ++k) {
      if (distance < 1e16) {
        check_steady(*accel, tile(random, distance, false));
        check_steady(*placed, tile(random, distance, false));
      }
      check_steady(*accel, tile(random, distance, true));
    }
}

TEST(steady, small_beside_large) {
  for (double size : {1e-9, 1e-12, 1e-15, 1e-20, 1e-30}) {
    Random random(92);
    Mesh mesh = soup(random, 60, size, size);
    mesh.add(mesh.add({-5, -5, 5}), mesh.add({5, -5, 5}), mesh.add({0, 5, 5}));
    const auto accel = build(mesh);
    for (int k = 0; k < 20; ++k) {
      std::vector<Ray> rays;
      const Vec3d eye = random.in_box(2 * size);
      for (int j = 0; j < 64; ++j)
        rays.push_back(ray(eye, random.in_box(size) - eye, 0, random.uniform(0.5, 2)));
      check_steady(*accel, rays);
    }
  }
}

TEST(steady, needles) {
  Random random(93);
  Mesh mesh = soup(random, 60, 1, 1);
  for (size_t k = 2; k < mesh.vertices.size(); k += 3) mesh.vertices[k] *= 1e11f;
  const auto accel = build(mesh);
  for (int k = 0; k < 50; ++k) {
    std::vector<Ray> rays;
    const Vec3d eye = 1e9 * random.in_box(1);
    for (int j = 0; j < 64; ++j)
      rays.push_back(ray(eye, random.in_box(1) + Vec3d{0, 0, 1e10 * random.uniform(-1, 1)} - eye));
    check_steady(*accel, rays);
  }
}

TEST(steady, spheres_that_double_rounds_away) {
  std::vector<float> centers, radii;
  for (int k = 0; k < 20; ++k) {
    centers.insert(centers.end(), {k == 7 ? 1e19f : float(k), 0, 0});
    radii.push_back(0.25f);
  }
  const GeometryView spheres{.kind = GeometryView::kSpheres,
                             .vertices = centers.data(),
                             .vertex_count = 20,
                             .radii = radii.data(),
                             .primitive_count = 20};
  check_steady(*build({spheres}, {{0, kCamera, {}}}),
               {ray({double(1e19f), 0, 0}, {-1, 0, 0}), ray({double(1e19f), 0, 0}, {0, 1, 0.5})});
}

TEST(steady, polygons_from_their_corners) {
  Random random(94);
  MixedShapes shapes;
  shapes.add_round_and_square(random, 200, 0.5);
  shapes.add_shapes();
  shapes.place(1, {});
  const auto accel = build(shapes.geometries, shapes.instances);
  const GeometryView& squares = shapes.geometries[1];
  std::vector<Ray> rays;
  for (size_t k = 0; k < squares.vertex_count; ++k)
    for (int j = 0; j < 20; ++j) {
      const float* p = squares.vertices + 3 * k;
      rays.push_back(ray({p[0], p[1], p[2]}, random.on_sphere()));
    }
  check_steady(*accel, rays);
}
