// Batches against the same rays one by one: a traversal may group rays as it likes, the answers are
// the same bits.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "check.h"
#include "kernels.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

/// Triangles (baked and instanced, mirrored and sheared), spheres and polygons; some instances
/// hidden from shadow rays.
struct Mixed : MixedShapes {
  Random random{60};
  Mesh bumpy = bumpy_sphere(60, 120), small = icosphere(2, 0.2, {}), boxes = box_grid(8, 0.5, {}),
       clutter = soup(random, 1500, 1.5, 0.1);

  Mixed() {
    for (const Mesh* mesh : {&bumpy, &small, &boxes, &clutter}) add(*mesh);
    add_round_and_square(random, 200, 0.1);
    add_shapes();
    for (uint32_t g : {0u, 2u, 2u, 3u, 4u, 5u, 5u})
      place(g, g == 2 || g == 5 ? random_affine(random, 1) : Affine{});
    for (int k = 0; k < 60; ++k) place(1, random_affine(random, 3));
    for (size_t k = 0; k < instances.size(); k += 7) instances[k].visibility = kCamera;
  }
};

/// 8 by 8 rays from one point, a little apart, or to one point, or side by side, or side by side
/// along a diagonal: no axis is the longest, or for every second ray, or as if from one point that
/// they begin behind, as after a mirror.
void add_block(std::vector<Ray>& rays, Random& random, int kind) {
  const Vec3d eye = random.in_box(4), target = random.in_box(1.5), d = target - eye;
  const double step = std::pow(10, random.uniform(-5, -1));
  const Vec3d x = step * random.on_sphere(), y = step * random.on_sphere();
  const double t_min = random.below(3) ? 0 : random.uniform(0, 1),
               t_max = random.below(3) ? HUGE_VAL : random.uniform(0.5, 2);
  const double first = random.below(2) ? 1 : 1.001, second = random.below(2) ? 1 : 0.5;
  for (int k = 0; k < 64; ++k) {
    const Vec3d shift = double(k % 8) * x + double(k / 8) * y;
    if (kind == 0) rays.push_back(ray(eye, d + shift, t_min, t_max));
    else if (kind == 1) rays.push_back(ray(target + shift, eye - target - shift, 0, 1));
    else if (kind == 2) rays.push_back(ray(eye + shift, d, t_min, t_max));
    else if (kind == 3)
      rays.push_back(ray(eye + random.uniform(0.1, 0.2) * (d + shift), d + shift, t_min, t_max));
    else
      rays.push_back(ray(eye + shift, {std::copysign(1, d.x), std::copysign(second, d.y),
                                       std::copysign(k % 2 ? 1 : first, d.z)}));
  }
}

/// Odd rays among good ones.
void spoil(std::vector<Ray>& rays, Random& random) {
  const double inf = HUGE_VAL, nan = std::nan("");
  for (Ray& r : rays) {
    switch (random.below(60)) {
      case 0: r.d = {0, 0, 0}; break;
      case 1: r.d.x = nan; break;
      case 2: r.o.y = inf; break;
      case 3: r.t_max = nan; break;
      case 4: r.t_min = -3; break;
      case 5: r.d = -r.d; break;
      case 6: r.d = random.on_sphere(); break;
      case 7:
        r.t_min = 1;
        r.t_max = 0.5;
        break;
      case 8: r.d = 1e200 * r.d; break;
      case 9: r.d[int(random.below(3))] = 0; break;
      case 10:
        r.o = r.o + 1e7 * r.d;
        r.d = -r.d;
        break;
      default: break;
    }
  }
}

std::vector<Ray> blocks(int count, bool odd, uint64_t seed) {
  Random random(seed);
  std::vector<Ray> rays;
  for (int k = 0; k < count; ++k) add_block(rays, random, k % 5);
  if (odd) spoil(rays, random);
  return rays;
}

/// Answers of every instruction set against the first one's.
int other_bits(const Mixed& scene, const std::vector<Ray>& rays) {
  std::vector<Hit> first;
  int count = 0;
  for (const std::string& isa : kernels_here()) {
    CHECK(kernel_for(isa.c_str()) == isa);
    ask_for_isa(isa.c_str());
    const auto accel = build(scene.geometries, scene.instances);
    ask_for_isa(nullptr);
    std::vector<Hit> hits(rays.size());
    accel->closest(rays.data(), hits.data(), rays.size());
    if (first.empty()) first = hits;
    for (size_t k = 0; k < rays.size(); ++k) count += !same(hits[k], first[k]);
  }
  return count;
}

}  // namespace

TEST(packets, coherent_rays_get_the_answers_of_single_rays) {
  const Mixed scene;
  const auto accel = build(scene.geometries, scene.instances);
  for (uint32_t visibility : {uint32_t(kCamera), uint32_t(kShadow)})
    CHECK(differences(*accel, blocks(rounds(200), false, 61), visibility) == 0);
}

TEST(packets, odd_rays_disturb_nobody) {
  const Mixed scene;
  const auto accel = build(scene.geometries, scene.instances);
  CHECK(differences(*accel, blocks(rounds(300), true, 62), kCamera) == 0);
}

TEST(packets, batches_of_any_size) {
  const Mixed scene;
  const auto accel = build(scene.geometries, scene.instances);
  const std::vector<Ray> rays = blocks(128, false, 63);
  for (size_t n : {0, 1, 2, 7, 8, 9, 63, 65, 1023, 8191})
    CHECK(differences(*accel, {rays.end() - long(n), rays.end()}, kCamera) == 0);
}

TEST(packets, every_instruction_set) {
  const Mixed scene;
  CHECK(other_bits(scene, blocks(rounds(300), true, 64)) == 0);
}

// Through the middle of a triangle float is certain; through its corner, and where faces coincide,
// it is not. Rays alone and in a tile.
TEST(packets, fallbacks_are_counted) {
  const Vec3d corners[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (const size_t faces : {1, 2, 300}) {
    Mesh mesh;
    for (Vec3d p : corners) mesh.add(p);
    for (size_t k = 0; k < faces; ++k) mesh.add(0, 1, 2);
    const auto accel = build(mesh);
    for (const size_t count : {1, 64}) {
      for (const Vec3d target : {Vec3d{0.25, 0.25, 0}, Vec3d{0, 0, 0}}) {
        const std::vector<double> zero(count), down(count, -1.0), x(count, target.x),
            y(count, target.y), z(count, 3.0);
        const std::vector<double> end(count, HUGE_VAL);
        std::vector<double> t(count);
        std::vector<uint32_t> instance(count), primitive(count);
        std::vector<float> u(count), v(count);
        std::vector<uint8_t> fallbacks(count, 77);
        Scratch scratch;
        accel->closest(
            {{x.data(), y.data(), z.data()},
             {zero.data(), zero.data(), down.data()},
             zero.data(),
             end.data(),
             count,
             kCamera},
            {t.data(), instance.data(), primitive.data(), u.data(), v.data(), fallbacks.data()},
            scratch);
        const size_t expected = target.x > 0 ? faces - 1 : faces;
        for (uint8_t n : fallbacks) CHECK(n == std::min<size_t>(expected, 255));
      }
    }
  }
}

// Sheets that cross each other at angles of 1e-7: float knows no order of theirs, double does. Rays
// that spread, and rays that meet.
TEST(packets, sheets_too_close_for_float_keep_their_order) {
  Random random(67);
  Mesh mesh;
  for (uint32_t k = 0; k < 64; ++k) {
    const double tilt_x = random.uniform(-1e-7, 1e-7), tilt_y = random.uniform(-1e-7, 1e-7),
                 z = random.uniform(-1e-7, 1e-7);
    for (Vec3d p : {Vec3d{-3, -3, 0}, Vec3d{3, -3, 0}, Vec3d{0, 4, 0}})
      mesh.add({p.x, p.y, z + tilt_x * p.x + tilt_y * p.y});
    mesh.add(3 * k, 3 * k + 1, 3 * k + 2);
  }
  const auto accel = build(mesh);
  std::vector<Ray> rays;
  for (int block = 0; block < 40; ++block) {
    const Vec3d eye = random.in_box(0.3) + Vec3d{0, 0, 2}, at = random.in_box(0.5),
                x = 1e-3 * random.on_sphere();
    const double end = block % 4 < 2 ? HUGE_VAL : 1;
    for (int k = 0; k < 64; ++k) {
      const Vec3d target{at.x + k % 8 * x.x + k / 8 * x.y, at.y + k % 8 * x.y + k / 8 * x.z,
                         block % 8 < 4 ? -0.5 : 0};
      rays.push_back(block % 2 ? ray(target, eye - target, 0, end)
                               : ray(eye, target - eye, 0, end));
    }
  }
  CHECK(differences(*accel, rays, kCamera) == 0);
}

// A tilted box far from the origin, where coordinates are 6e-5 apart in float: rays outwards from a
// tenth of that above a face hit nothing, those from as much below hit that face. In tiles that go
// together, and in all directions.
TEST(packets, rays_know_the_side_of_the_surface_that_they_leave) {
  Random random(66);
  const Vec3d center{1000, -500, 200};
  const Frame frame(normalize(Vec3d{0.3, 0.5, 0.8}));
  Mesh mesh = box_grid(64, 1, {});
  for (size_t k = 0; k < mesh.vertices.size(); k += 3) {
    float* v = &mesh.vertices[k];
    const Vec3d p = center + double(v[0]) * frame.t1 + double(v[1]) * frame.t2 +
                    double(v[2]) * normalize(cross(frame.t1, frame.t2));
    v[0] = float(p.x);
    v[1] = float(p.y);
    v[2] = float(p.z);
  }
  const auto accel = build(mesh);
  int wrong = 0;
  for (int block = 0; block < rounds(400); ++block) {
    const size_t t = random.below(mesh.count());
    const Vec3d a = mesh.corner(t, 0), b = mesh.corner(t, 1), c = mesh.corner(t, 2),
                n = normalize(cross(b - a, c - a));
    const Vec3d up = dot(n, a - center) > 0 ? n : -n,
                shared = normalize(up + 0.5 * random.on_sphere());
    const double side = block % 2 ? 6e-6 : -6e-6;
    std::vector<Ray> rays;
    for (int k = 0; k < 64; ++k) {
      const double u = random.uniform(0.2, 0.4), v = random.uniform(0.2, 0.4);
      const Vec3d d = block % 4 < 2 ? normalize(shared + 0.01 * random.on_sphere())
                                    : normalize(up + 0.8 * random.on_sphere());
      rays.push_back(ray(a + u * (b - a) + v * (c - a) + side * up, d));
    }
    std::vector<Hit> hits(rays.size());
    std::vector<uint8_t> blocked(rays.size());
    accel->closest(rays.data(), hits.data(), rays.size());
    accel->occluded(rays.data(), blocked.data(), rays.size());
    for (size_t k = 0; k < rays.size(); ++k)
      wrong += side > 0 ? hits[k].instance != Hit::kNone || blocked[k]
                        : hits[k].primitive != t || !blocked[k] || !(hits[k].t < 1e-4);
    wrong += differences(*accel, rays, kCamera);
  }
  CHECK(wrong == 0);
}

/// A tile of rays that begin on one triangle, or off its plane by up to 1e-4 of its size to either
/// side: to a point, side by side, or as if from one. That point may be next to the plane too.
void add_departures(std::vector<Ray>& rays, const Mesh& mesh, Random& random, size_t block) {
  const size_t t = random.below(mesh.count());
  const Vec3d a = mesh.corner(t, 0), e1 = mesh.corner(t, 1) - a, e2 = mesh.corner(t, 2) - a,
              normal = cross(e1, e2);
  const double size = length(e1) + length(e2),
               off = size * std::pow(10, random.uniform(-17, -4)) * (block % 2 ? 1 : -1);
  const double height = size * std::pow(10, random.uniform(-8, 2)) * (random.below(2) ? 1 : -1);
  const Vec3d n = normalize(normal),
              point = a + 2 * random.uniform() * e1 + 2 * random.uniform() * e2 + height * n;
  for (int k = 0; k < 64; ++k) {
    const double u = random.uniform(0.1, 0.4), v = random.uniform(0.1, 0.4);
    const Vec3d o = a + u * e1 + v * e2 + off * n;
    if (block % 3 == 0) rays.push_back(ray(o, point - o, block % 4 ? 0 : 1e-6, 1));
    else if (block % 3 == 1) rays.push_back(ray(o, point - a));
    else rays.push_back(ray(o, o - point));
  }
}

// Float does not know on which side of the triangle such rays begin. Fat and thin ones, flat ones
// far from the origin, and crossing ones.
TEST(packets, rays_that_begin_on_a_triangle_get_the_answers_of_single_rays) {
  Random random(69);
  for (const Mesh& mesh :
       {box_grid(4, 1, {}), box_grid(8, 1, {1000, 3, -200}), bumpy_sphere(8, 200),
        icosphere(2, 1e-3, {0, 0, 1}), icosphere(1, 1e4, {}), soup(random, 60, 1, 2)}) {
    const auto accel = build(mesh);
    std::vector<Ray> rays;
    for (int block = 0; block < rounds(600); ++block)
      add_departures(rays, mesh, random, size_t(block));
    CHECK(differences(*accel, rays, kCamera) == 0);
  }
}

// Each mesh is closed and the tiles are aimed at its corners from inside; so every ray ends there,
// from a common point or side by side.
TEST(packets, no_leaks_at_corners) {
  Random random(65);
  for (double radius : {1e-3, 1.0, 1e4}) {
    for (const Mesh& mesh : {icosphere(4, radius, {}), box_grid(32, radius, {})}) {
      const auto accel = build(mesh);
      std::vector<Ray> rays;
      for (int block = 0; block < rounds(300); ++block) {
        const size_t t = random.below(mesh.count());
        const Vec3d eye = 0.3 * radius * random.in_box(1);
        for (size_t k = 0; k < 64; ++k) {
          const Vec3d p = mesh.corner((t + k / 3) % mesh.count(), k % 3),
                      q = mesh.corner((t + k / 3) % mesh.count(), (k + 1) % 3);
          const Vec3d at = k % 2 ? p : 0.5 * (p + q),
                      o = block % 2 ? eye : eye + (1e-3 * radius * double(k)) * random.in_box(0.1);
          rays.push_back(ray(o, at - o));
        }
      }
      std::vector<Hit> hits(rays.size());
      std::vector<uint8_t> blocked(rays.size());
      accel->closest(rays.data(), hits.data(), rays.size());
      accel->occluded(rays.data(), blocked.data(), rays.size());
      int leaks = 0;
      for (size_t k = 0; k < rays.size(); ++k)
        leaks += hits[k].instance == Hit::kNone || !blocked[k];
      CHECK(leaks == 0);
      CHECK(differences(*accel, rays, kCamera) == 0);
    }
  }
}

/// Tiles of rays that are aimed at edges from `distance` away: from one point, to one point,
/// and side by side. Of every other one just 40 rays are alive.
std::vector<Ray> edge_blocks(const Mesh& mesh, double distance, Random& random) {
  std::vector<Ray> rays;
  for (int block = 0; block < rounds(150); ++block) {
    const size_t first = random.below(mesh.count() - 4);
    const Vec3d d = -distance * random.on_sphere(), eye = mesh.corner(first, 0) - d;
    for (size_t k = 0; k < 64; ++k) {
      const size_t t = first + random.below(4), j = random.below(3);
      const Vec3d p = mesh.corner(t, j),
                  at = p + random.uniform(0, 1) * (mesh.corner(t, (j + 1) % 3) - p);
      if (block % 3 == 0) rays.push_back(ray(eye, at - eye));
      else if (block % 3 == 1) rays.push_back(ray(at + (at - eye), 2.0 * (eye - at), 0, 1));
      else rays.push_back(ray(at - d, d));
      if (block % 2 && k * 5 % 8 > 4) rays.back().t_max = 0;
    }
  }
  return rays;
}

// Slanted rays from far away, which are aimed at edges of triangles: float knows no sides there.
// Large triangles, and small ones; in the world, and by way of an instance.
TEST(packets, edges_far_away_are_left_to_single_rays) {
  Random random(68);
  std::vector<InstanceView> two(2);
  two[1].world_from_object = translation({0, 0, 30});
  for (int cells : {4, 128})
    for (double distance : {4.0, 20.0, 1e3, 1e6}) {
      const Mesh mesh = box_grid(cells, 1, {});
      const std::vector<Ray> rays = edge_blocks(mesh, distance, random);
      CHECK(differences(*build(mesh), rays, kCamera) == 0);
      CHECK(differences(*build({mesh.view()}, two), rays, kCamera) == 0);
    }
}
