// Instances with odd matrices, and which rays see them.
#include <cmath>

#include "brute.h"
#include "bvh/outline.h"
#include "bvh/tlas.h"
#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

struct Placed {
  Mesh mesh;
  BruteScene scene;
  Placed(Mesh m, const std::vector<Affine>& matrices) : mesh(std::move(m)) {
    scene.geometries = {mesh.view()};
    for (const Affine& a : matrices) scene.instances.push_back({0, kCamera | kMirror | kShadow, a});
  }
};

/// Rays at random points of random triangles of random instances.
std::vector<Ray> aimed(const Placed& p, Random& random, int count, double distance) {
  std::vector<Ray> rays;
  for (int k = 0; k < count; ++k) {
    const Affine& m = p.scene.instances[random.below(p.scene.instances.size())].world_from_object;
    const size_t t = random.below(p.mesh.count());
    const double u = random.uniform(), v = random.uniform(0, 1 - u);
    const Vec3d object =
        (1 - u - v) * p.mesh.corner(t, 0) + u * p.mesh.corner(t, 1) + v * p.mesh.corner(t, 2);
    const Vec3d o = m.t + distance * random.on_sphere();
    rays.push_back(ray(o, point(m, object) - o, 0, HUGE_VAL, 1u << random.below(3)));
  }
  return rays;
}

/// Compares every ray; returns the share of hits.
double compare(const Placed& p, const std::vector<Ray>& rays) {
  const auto accel = build(p.scene.geometries, p.scene.instances);
  int hits = 0;
  for (const Ray& r : rays) {
    const Hit h = closest(*accel, r);
    uint8_t blocked;
    accel->occluded(&r, &blocked, 1);
    const std::vector<Truth> truth = brute(p.scene, r);
    CHECK(agrees(truth, h) && agrees(truth, blocked != 0));
    hits += h.instance != Hit::kNone;
  }
  return double(hits) / double(rays.size());
}

Affine scaled(Vec3d s, Vec3d t = {}) { return {{s.x, 0, 0}, {0, s.y, 0}, {0, 0, s.z}, t}; }

Tree tree_of(const Mesh& mesh, BuildQuality quality) {
  const GeometryView geometry = mesh.view();
  std::vector<Source> sources;
  sources.push_back({&geometry, 0, nullptr, 1, nullptr, {}});
  ThreadPool pool(1);
  const std::atomic<bool> cancel{false};
  return make_tree(sources, quality, pool, cancel);
}

/// Checks that a turned mesh is within its box in the world, and that this is no wider than it by
/// more than a twentieth.
void check_world_box(const Mesh& mesh, const Tree& tree, const Affine& m) {
  BoxD exact;
  for (size_t t = 0; t < mesh.count(); ++t)
    for (size_t k = 0; k < 3; ++k) exact.add(point(m, mesh.corner(t, k)));
  const BoxD box = world_box(tree, m);
  for (int axis = 0; axis < 3; ++axis) {
    const double slack = 0.05 * (exact.hi[axis] - exact.lo[axis]);
    CHECK(box.lo[axis] <= exact.lo[axis] && exact.lo[axis] <= box.lo[axis] + slack);
    CHECK(box.hi[axis] >= exact.hi[axis] && exact.hi[axis] >= box.hi[axis] - slack);
  }
}

}  // namespace

TEST(instances, boxes_in_the_world_fit) {
  Random random(45);
  for (const Mesh& mesh : {icosphere(3, 1, {3, 0, 0}), bumpy_sphere(30, 60),
                           box_grid(8, 1, {0, 2, 0}), soup(random, 3, 1, 1)})
    for (BuildQuality quality : kQualities) {
      const Tree tree = tree_of(mesh, quality);
      for (int k = 0; k < 50; ++k) check_world_box(mesh, tree, random_affine(random, 2));
    }
}

TEST(instances, a_ball_holds_an_object) {
  for (const Mesh& mesh :
       {icosphere(3, 1, {3, 0, 0}), bumpy_sphere(30, 60), box_grid(8, 1, {0, 2, 0})}) {
    const TreeView tree = tree_of(mesh, BuildQuality::kBalanced).view();
    double farthest = 0;
    for (size_t t = 0; t < mesh.count(); ++t)
      for (size_t k = 0; k < 3; ++k)
        farthest = std::max(
            farthest,
            length(mesh.corner(t, k) - Vec3d(tree.center[0], tree.center[1], tree.center[2])));
    CHECK(farthest < tree.ball && tree.ball < 1.01 * farthest);
  }
}

TEST(instances, odd_matrices_against_brute_force) {
  Random random(40);
  for (int round = 0; round < 20; ++round) {
    std::vector<Affine> matrices;
    for (int k = 0; k < 1 + round % 4; ++k)
      matrices.push_back(random_affine(random, 2));  // mirrored and sheared as it comes
    const Placed p(icosphere(1, 1, {0.3, 0, 0}), matrices);
    CHECK(compare(p, aimed(p, random, 500, 5)) > 0.99);
  }
}

TEST(instances, scales) {
  Random random(41);
  const Vec3d scales[] = {
      {1e-6, 1e-6, 1e-6}, {1e6, 1e6, 1e6}, {1, 1, 1e-6}, {1, -1e-3, 1}, {-1, 1, 1e3}};
  for (Vec3d s : scales)
    for (int copies : {1, 2}) {
      std::vector<Affine> matrices{scaled(s)};
      if (copies == 2) matrices.push_back(scaled(s, {0, 0, 8 * s.z}));
      const Placed p(icosphere(1, 1, {}), matrices);
      CHECK(compare(p, aimed(p, random, 500, 4 * max_abs(s))) > 0.98);
    }
}

// A flattened object is hit, on both sides, whether it shares its mesh or not.
TEST(instances, flattened) {
  for (int axis = 0; axis < 3; ++axis)
    for (int copies : {1, 2, 3}) {
      Vec3d s(1, 1, 1), o, d;
      s[axis] = 0;
      o[axis] = 3;
      d[axis] = -1;
      o[(axis + 1) % 3] = 0.1;
      o[(axis + 2) % 3] = 0.2;
      std::vector<Affine> matrices(size_t(copies), scaled(s));
      if (copies > 1) matrices[1] = translation({9, 9, 9});
      const Placed p(icosphere(2, 1, {}), matrices);
      const auto accel = build(p.scene.geometries, p.scene.instances);
      for (Vec3d from : {o, o + 6.0 * d}) {
        const Hit h = closest(*accel, ray(from, from[axis] > 0 ? d : -d));
        CHECK(h.instance == 0 && std::fabs(h.t - 3) < 1e-12);
      }
    }
}

// Flat not along an axis of the object: two columns are parallel, or so close to it that an inverse
// would be noise.
TEST(instances, flattened_by_shear) {
  for (double thickness : {0.0, 1e-16, 1e-13})
    for (int copies : {1, 2}) {
      std::vector<Affine> matrices{{{1, 0, 0}, {0.5, thickness, 0}, {0, 0, 1}, {}}};
      if (copies == 2) matrices.push_back(translation({9, 9, 9}));
      const Placed p(icosphere(2, 1, {}), matrices);
      const auto accel = build(p.scene.geometries, p.scene.instances);
      for (double side : {-3.0, 3.0}) {
        const Hit h = closest(*accel, ray({0.1, side, 0.2}, {1e-3, -side, 1e-3}));
        CHECK(h.instance == 0 && std::fabs(h.t - 1) < 1e-12);
      }
    }
}

TEST(instances, a_line_or_a_point_is_no_surface) {
  const Placed line(icosphere(1, 1, {}),
                    {scaled({1, 0, 0}), scaled({0, 0, 0}), translation({5, 0, 0})});
  const auto accel = build(line.scene.geometries, line.scene.instances);
  CHECK(closest(*accel, ray({0.1, 0.2, 3}, {0, 0, -1})).instance == Hit::kNone);
  CHECK(closest(*accel, ray({5, 0.1, 3}, {0, 0, -1})).instance == 2);
}

// A small object far away, and shared: the ray is rounded close to it, not at the camera.
TEST(instances, far_and_small) {
  Random random(42);
  const Mesh mesh = icosphere(3, 1, {});
  for (double distance : {1e2, 1e4, 1e7}) {
    const Placed p(mesh, {translation(distance * Vec3d(0.6, 0.64, 0.48)),
                          translation(distance * Vec3d(-0.48, 0.6, 0.64))});
    const auto accel = build(p.scene.geometries, p.scene.instances);
    int wrong = 0;
    for (int k = 0; k < 3000; ++k) {
      const Vec3d c = p.scene.instances[size_t(k % 2)].world_from_object.t,
                  side = cross(normalize(c), random.on_sphere());
      const double b = random.uniform(0, 1.5);
      if (std::fabs(b - 1) < 0.03) continue;  // the mesh is up to 0.01 inside the sphere
      const Vec3d o(0.1, 0.2, 0.3);
      const Hit h = closest(*accel, ray(o, c + b * normalize(side) - o));
      wrong += b < 1 ? h.instance != uint32_t(k % 2) || std::fabs(h.t * length(c) - distance) > 1.1
                     : h.instance != Hit::kNone;
    }
    CHECK(wrong == 0);
  }
}

TEST(instances, meshes_far_smaller_than_the_world_have_trees_of_their_own) {
  const Vec3d center{0, 0, 2e-3};
  const Mesh ball = icosphere(4, 1e-3, center);
  for (const double half : {1e-2, 2e4}) {
    Mesh ground;
    for (Vec3d p : {Vec3d{-half, -half, 0}, Vec3d{half, -half, 0}, Vec3d{0, half, 0}})
      ground.add(p);
    ground.add(0, 1, 2);
    BruteScene scene;
    scene.geometries = {ball.view(), ground.view()};
    for (uint32_t k = 0; k < 2; ++k) scene.instances.push_back({k, kAnyRay, Affine{}});
    const std::atomic<bool> cancel{false};
    const TopLevelBvh accel(scene.geometries, scene.instances, 1, cancel, BuildQuality::kBalanced,
                            {});
    CHECK((accel.object(0) != nullptr) == (half > 1));
    CHECK(!accel.object(1));
    Random random(45);
    for (int k = 0; k < 1000; ++k) {
      const Vec3d to = center + 1.1e-3 * random.on_sphere(), o{0, -5e-3, 3e-3};
      const Ray r = ray(o, to - o);
      CHECK(agrees(brute(scene, r), closest(accel, r)));
    }
  }
}

TEST(instances, visibility) {
  Random random(43);
  for (bool shared : {true, false}) {
    std::vector<Mesh> meshes;
    for (int k = 0; k < 12; ++k) meshes.push_back(icosphere(1, 1, {}));
    BruteScene scene;
    for (const Mesh& m : meshes) scene.geometries.push_back(m.view());
    for (uint32_t k = 0; k < 12; ++k)
      scene.instances.push_back(
          {shared ? 0 : k, uint32_t(random.below(8)), translation(random.in_box(2))});
    const auto accel = build(scene.geometries, scene.instances);
    for (int k = 0; k < 3000; ++k) {
      const Vec3d o = random.in_box(4);
      const Ray r = ray(o, random.in_box(2) - o, 0, HUGE_VAL, 1u << random.below(3));
      const std::vector<Truth> truth = brute(scene, r);
      uint8_t blocked;
      accel->occluded(&r, &blocked, 1);
      CHECK(agrees(truth, closest(*accel, r)) && agrees(truth, blocked != 0));
    }
  }
}

TEST(instances, thousands_of_copies) {
  Random random(44);
  std::vector<Affine> matrices;
  for (int k = 0; k < 5000; ++k) {
    Affine m = random_affine(random, 1);
    m.x = 0.02 * m.x;
    m.y = 0.02 * m.y;
    m.z = 0.02 * m.z;
    matrices.push_back(m);
  }
  const Placed p(icosphere(0, 1, {}), matrices);
  CHECK(compare(p, aimed(p, random, 20, 3)) == 1);
}
