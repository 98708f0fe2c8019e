// Beams that are told to be surely_empty.
#include <cmath>

#include "bvh/traverse/empty_tile_culling.h"
#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

/// A camera whose window is cut into cells; perspective, or parallel with all directions alike.
struct Camera {
  Vec3d eye, x, y, ahead;
  bool parallel;
  Camera(Vec3d from, Vec3d at, double width, bool is_parallel) : eye(from), parallel(is_parallel) {
    ahead = unit(at - from);
    x = unit(cross(ahead, std::fabs(ahead.z) < 0.9 ? Vec3d{0, 0, 1} : Vec3d{1, 0, 0}));
    y = cross(x, ahead);
    const double half = 0.5 * width / (parallel ? 1 : length(at - from));
    x = half * x;
    y = half * y;
  }
  Vec3d origin(double u, double v) const { return parallel ? eye + u * x + v * y : eye; }
  Vec3d direction(double u, double v) const {
    return parallel ? ahead : unit(ahead + u * x + v * y);
  }
  TileFrustum frustum(double u0, double v0, double u1, double v1) const {
    return {{origin(u0, v0), origin(u1, v0), origin(u1, v1), origin(u0, v1)},
            {direction(u0, v0), direction(u1, v0), direction(u1, v1), direction(u0, v1)}};
  }
};

constexpr int kCells = 16;
constexpr int kViews = rounds(6);

/// Cells of the window that are surely_empty, after rays of all of these have missed: at corners,
/// along edges, inside.
int empty_cells(const Accel& accel, const Camera& c, Random& random) {
  int count = 0;
  for (int i = 0; i < kCells; ++i)
    for (int j = 0; j < kCells; ++j) {
      const double u = 2.0 * i / kCells - 1, v = 2.0 * j / kCells - 1, size = 2.0 / kCells;
      if (!accel.surely_empty(c.frustum(u, v, u + size, v + size))) continue;
      ++count;
      for (int k = 0; k < 24; ++k) {
        const double s = k < 4   ? k & 1
                         : k < 8 ? 0
                                 : random.uniform(),
                     t = k < 4 ? k >> 1 : random.uniform();
        CHECK(closest(accel, ray(c.origin(u + size * s, v + size * t),
                                 c.direction(u + size * s, v + size * t)))
                  .instance == Hit::kNone);
      }
    }
  return count;
}

}  // namespace

TEST(empty_tiles, no_ray_of_an_empty_frustum_hits) {
  Random random(81);
  const Mesh ball = bumpy_sphere(24, 48), rubble = soup(random, 300, 1, 0.1);
  MixedShapes shapes;
  shapes.add(ball);
  shapes.add_round_and_square(random, 40, 0.1);
  shapes.add_shapes();
  for (int k = 0; k < 12; ++k) shapes.place(0, random_affine(random, 3));
  for (uint32_t g : {1u, 2u}) shapes.place(g, translation(random.in_box(1)));
  for (double away : {3.0, 300.0, 1e6}) {
    for (bool parallel : {false, true}) {
      int surely_empty = 0;
      for (int k = 0; k < kViews; ++k) {
        const Camera camera(away * random.on_sphere(), random.in_box(0.2), 4, parallel);
        for (const Mesh* mesh : {&ball, &rubble})
          surely_empty += empty_cells(*build(*mesh), camera, random);
        empty_cells(*build(shapes.geometries, shapes.instances), camera, random);
      }
      CHECK(surely_empty >
            2 * kViews * kCells * kCells / 4);  // the window is twice as wide as what stands there
    }
  }
}

TEST(empty_tiles, a_ray_to_a_vertex_may_hit_it) {
  Random random(82);
  for (double offset : {0.0, 1e4}) {
    const Vec3d middle{offset, offset, offset};
    for (Mesh mesh : {bumpy_sphere(12, 24), box_grid(4, 1, {})}) {
      for (float& p : mesh.vertices) p += float(offset);
      const auto accel = build(mesh);
      for (size_t k = 0; k < mesh.vertices.size(); k += 3) {
        const Vec3d vertex{double(mesh.vertices[k]), double(mesh.vertices[k + 1]),
                           double(mesh.vertices[k + 2])};
        for (int turn = 0; turn < 8; ++turn) {
          const bool parallel = turn % 2 == 1;
          // The vertex lies in the middle of the window, and each of four frusta has it in a
          // corner; many have nothing else.
          const double away = 4 + 1e5 * random.uniform();
          const Camera c(middle + away * random.on_sphere(), vertex, 1e-3, parallel);
          for (int quarter = 0; quarter < 4; ++quarter) {
            const double u = quarter & 1 ? -1 : 0, v = quarter & 2 ? -1 : 0;
            CHECK(!accel->surely_empty(c.frustum(u, v, u + 1, v + 1)));
          }
        }
      }
    }
  }
}

TEST(empty_tiles, trees_of_any_size_are_found) {
  for (double size : {1e-37, 1e-25, 1.0, 1e25, 1e37}) {
    const Mesh ball = icosphere(3, size, {}), other = icosphere(3, size, {4 * size, 0, 0});
    MixedShapes shapes;
    shapes.add(ball);
    shapes.add(other);
    shapes.place(0, {});
    shapes.place(0, translation({0, 4 * size, 0}));
    shapes.place(1, {});  // two that have a tree of their own
    const auto accel = build(shapes.geometries, shapes.instances);
    const Camera camera({0, 0, 9 * size}, {}, 4 * size, false);
    CHECK(!accel->surely_empty(camera.frustum(-0.1, -0.1, 0.1, 0.1)) &&
          accel->surely_empty(camera.frustum(-1, -1, -0.8, -0.8)));
    for (const Vec3d& at : {Vec3d{}, Vec3d{4 * size, 0, 0}, Vec3d{0, 4 * size, 0}})
      CHECK(closest(*accel, ray(camera.eye, at - camera.eye)).instance != Hit::kNone);
  }
}

TEST(empty_tiles, a_gap_is_seen) {
  const Mesh ball = icosphere(3, 1, {});
  std::vector<InstanceView> pair(2);
  pair[0].world_from_object = translation({-2, 0, 0});
  pair[1].world_from_object = translation({2, 0, 0});
  Mesh both = icosphere(3, 1, {-2, 0, 0});
  const Mesh other = icosphere(3, 1, {2, 0, 0});
  for (uint32_t row : other.triangles)
    both.triangles.push_back(row + uint32_t(both.vertices.size() / 3));
  both.vertices.insert(both.vertices.end(), other.vertices.begin(), other.vertices.end());
  const auto placed = build({ball.view()}, pair), baked = build(both);
  for (bool parallel : {false, true}) {
    const Camera camera({0, -20, 0}, {}, 1.8, parallel);  // 0.9 to each side: the gap reaches to 1
    CHECK(placed->surely_empty(camera.frustum(-1, -1, 1, 1)) &&
          baked->surely_empty(camera.frustum(-1, -1, 1, 1)));
    CHECK(!placed->surely_empty(camera.frustum(-1.3, -1, 1, 1)) &&
          !baked->surely_empty(camera.frustum(-1, -1, 1.3, 1)));
  }
}

TEST(empty_tiles, what_is_not_known_is_not_empty) {
  const auto accel = build(icosphere(2, 1, {5, 0, 0}));
  const Vec3d o{}, d{0, 0, 1};
  CHECK(!accel->surely_empty(TileFrustum({o, o, o, o}, {d, d, d, d})));  // no width
  const double nan = std::nan("");
  CHECK(!accel->surely_empty(
      TileFrustum({o, o, o, o}, {{nan, 0, 1}, {1, 0, nan}, {1, 1, 1}, {0, 1, 1}})));
}
