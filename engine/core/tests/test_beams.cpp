// Beams (kernel_beam.h) and packets against the same rays one by one, with every instruction set:
// the same bits, however near a ray comes to an edge or two surfaces to each other.
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "check.h"
#include "kernels.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

constexpr int kSide = 16;  // of a beam of 256 rays

/// Rays from `eye` about `target`, `step` apart.
void add_beam(std::vector<Ray>& rays, Vec3d eye, Vec3d target, double step, Random& random,
              double t_min = 0, double t_max = HUGE_VAL) {
  const Vec3d d = target - eye, x = step * random.on_sphere(), y = step * random.on_sphere();
  for (int k = 0; k < kSide * kSide; ++k)
    rays.push_back(ray(eye, d + double(k % kSide) * x + double(k / kSide) * y, t_min, t_max));
}

/// Rays from `eye` through points on edges and corners of triangles that follow each other from
/// `first` on, some of them off by no more than rounding; or, where they do not go on from there,
/// from beyond those points to `eye`.
void add_aimed_beam(std::vector<Ray>& rays, const Mesh& mesh, Vec3d eye, size_t first, bool on,
                    Random& random) {
  for (int k = 0; k < kSide * kSide; ++k) {
    const size_t triangle = (first + size_t(k / 20)) % mesh.count();
    const size_t corner = random.below(3);
    const Vec3d a = mesh.corner(triangle, corner), b = mesh.corner(triangle, (corner + 1) % 3);
    const double along = random.below(2) ? 0 : random.uniform();
    const double off = random.below(2) ? 0 : std::pow(10, random.uniform(-17, -5));
    const Vec3d d = a + along * (b - a) + off * random.on_sphere() - eye;
    const double beyond = random.uniform(1.01, 1.3);
    rays.push_back(on ? ray(eye, d) : ray(eye + beyond * d, -beyond * d, 0, 1));
  }
}

/// Triangles whose third corner is nearly between the other two.
Mesh slivers(Random& random, size_t count) {
  Mesh mesh;
  for (size_t k = 0; k < count; ++k) {
    const Vec3d a = random.in_box(1), b = a + 0.5 * random.on_sphere();
    const double off = std::pow(10, random.uniform(-9, -2));
    const Vec3d c = a + random.uniform() * (b - a) + off * random.on_sphere();
    mesh.add(mesh.add(a), mesh.add(b), mesh.add(c));
  }
  return mesh;
}

/// Walls that lie in one another or a few roundings apart.
Mesh walls(Random& random) {
  Mesh mesh;
  for (int wall = 0; wall < 12; ++wall) {
    const double depth = wall < 4 ? 0.5 : 0.5 + wall * 0x1p-24, turn = wall % 2 ? 0.3 : 0;
    for (int k = 0; k < 8; ++k) {
      const Vec3d p = random.in_box(1), q = random.in_box(1), r = random.in_box(1);
      const auto on = [&](Vec3d v) { return Vec3d{v.x, v.y, depth + turn * v.x}; };
      mesh.add(mesh.add(on(p)), mesh.add(on(q)), mesh.add(on(r)));
    }
  }
  return mesh;
}

Mesh scaled(Mesh mesh, double scale, Vec3d offset) {
  for (size_t k = 0; k < mesh.vertices.size(); ++k)
    mesh.vertices[k] = float(double(mesh.vertices[k]) * scale + offset[int(k % 3)]);
  return mesh;
}

/// Rays from a surface to `light`, from `off` off it, as those that hits of rays from `eye` send.
void add_shadow_beam(std::vector<Ray>& rays, const Accel& accel, Vec3d eye, Vec3d target,
                     Vec3d light, double step, double off, Random& random) {
  std::vector<Ray> seen;
  add_beam(seen, eye, target, step, random);
  for (const Ray& r : seen) {
    const Hit hit = closest(accel, r);
    const double t = hit.instance == Hit::kNone ? 1 : hit.t;
    const Vec3d o = r.o + (t * (1 - off)) * r.d, to = light - o;
    const double length = std::sqrt(dot(to, to));
    if (off > 1e-7) rays.push_back(ray(o, to, 0, 1));
    else rays.push_back(ray(o, (1 / length) * to, 0, length * (1 - 1e-7)));
  }
}

/// Rays from about `from` to `light`, in single precision: their ends are off it, and some behind.
void add_rounded_beam(std::vector<Ray>& rays, Vec3d from, Vec3d light, double step,
                      Random& random) {
  const auto rounded = [](Vec3d v) {
    return Vec3d{double(float(v.x)), double(float(v.y)), double(float(v.z))};
  };
  const Vec3d x = step * random.on_sphere(), y = step * random.on_sphere();
  const double end = random.below(2) ? 1 : 1 + 3e-6;
  for (int k = 0; k < kSide * kSide; ++k) {
    const Vec3d o = rounded(from + double(k % kSide) * x + double(k / kSide) * y);
    rays.push_back(ray(o, rounded(light - o), 0, end));
  }
}

/// What who made a beam's rays knows of them; nothing (`earliest` 0) where they do not begin at one
/// point, each before all others end.
RayEnds ends_of(const Ray* rays) {
  RayEnds ends{0, HUGE_VAL};
  for (const Ray* r = rays; r != rays + kSide * kSide; ++r) {
    if (any(r->o - rays->o) || !(r->t_min >= 0)) return {};
    ends.latest = std::max(ends.latest, r->t_min);
    ends.earliest = std::min(ends.earliest, r->t_max);
  }
  return ends.latest < ends.earliest ? ends : RayEnds{};
}

/// Rays that get another answer in a beam than alone, or are blocked without a hit or hit without
/// being blocked. found: the hits, where they are none of these.
int wrong_in_beams(const Accel& accel, const std::vector<Ray>& rays, uint32_t visibility,
                   std::vector<Hit>* found = nullptr, const Opacity* opacity = nullptr) {
  std::vector<double> columns[8], t(rays.size());
  std::vector<uint32_t> instance(rays.size()), primitive(rays.size());
  std::vector<float> u(rays.size()), v(rays.size());
  std::vector<uint8_t> blocked(rays.size());
  for (const Ray& r : rays) {
    const double values[8] = {r.o.x, r.o.y, r.o.z, r.d.x, r.d.y, r.d.z, r.t_min, r.t_max};
    for (int c = 0; c < 8; ++c) columns[c].push_back(values[c]);
  }
  Scratch scratch;
  const auto some = [&](size_t first, size_t count) {
    const auto column = [&](int c) { return columns[c].data() + first; };
    return Rays{{column(0), column(1), column(2)},
                {column(3), column(4), column(5)},
                column(6),
                column(7),
                count,
                visibility,
                opacity};
  };
  for (size_t k = 0; k < rays.size(); k += kSide * kSide) {  // where beams fail, others wait
    Rays all = some(k, kSide * kSide);
    const RayEnds ends = ends_of(&rays[k]);
    all.ends = ends.earliest > 0 && k / (kSide * kSide) % 2 == 0 ? &ends : nullptr;
    accel.closest(all, Hits{&t[k], &instance[k], &primitive[k], &u[k], &v[k]}, scratch);
    accel.occluded(all, &blocked[k], scratch);
  }
  int count = 0;
  for (size_t k = 0; k < rays.size(); ++k) {
    Hit hit;
    uint8_t stopped = 0;
    accel.closest(some(k, 1), Hits{&hit.t, &hit.instance, &hit.primitive, &hit.u, &hit.v}, scratch);
    accel.occluded(some(k, 1), &stopped, scratch);
    count += !same(hit, {t[k], instance[k], primitive[k], u[k], v[k]}) || stopped != blocked[k] ||
             (hit.instance != Hit::kNone) != (stopped != 0);
    if (found) found->push_back(hit);
  }
  return count;
}

/// The same in tiles of 64, and with every instruction set; and rays that these answer in other
/// ways.
int wrong_in_any_width(const Mesh& mesh, const std::vector<Ray>& rays) {
  std::vector<Hit> first;
  int count = 0;
  for (const std::string& isa : kernels_here()) {
    ask_for_isa(isa.c_str());
    const auto accel = build(mesh);
    std::vector<Hit> hits;
    count += wrong_in_beams(*accel, rays, kCamera, &hits);
    for (size_t k = 0; k + 64 <= rays.size(); k += 256)
      count += differences(*accel, {rays.begin() + long(k), rays.begin() + long(k + 64)}, kCamera);
    if (first.empty()) first = hits;
    for (size_t k = 0; k < rays.size(); ++k) count += !same(hits[k], first[k]);
  }
  ask_for_isa(nullptr);
  return count;
}

/// The same of rays about a mesh `scale` large.
int differences_about(const Mesh& mesh, double scale, Vec3d center, uint64_t seed) {
  Random random(seed);
  const auto accel = build(mesh);
  std::vector<Ray> rays;
  for (int k = 0; k < rounds(30); ++k) {
    const Vec3d eye = center + scale * random.in_box(k % 3 ? 1.8 : 1);
    const double near = k % 5 ? 0 : random.uniform(0, 1),
                 far = k % 4 ? HUGE_VAL : random.uniform(0.6, 1.4);
    const double step = std::pow(10, random.uniform(-6, -1.3));
    add_beam(rays, eye, center + scale * random.in_box(0.7), scale * step, random, near, far);
    for (bool on : {true, false, false})
      add_aimed_beam(rays, mesh, eye, random.below(mesh.count()), on, random);
    const Vec3d light = center + scale * random.in_box(1.8);
    for (double off : {0.0, 1e-9, 1e-6, 1e-3})
      add_shadow_beam(rays, *accel, eye, center + scale * random.in_box(0.7), light, scale * step,
                      off, random);
  }
  return wrong_in_any_width(mesh, rays);
}

}  // namespace

TEST(beams, smooth_meshes) {
  CHECK(differences_about(bumpy_sphere(60, 120), 1, {}, 1) == 0);
  CHECK(differences_about(icosphere(2, 1, {}), 1, {}, 2) == 0);
  CHECK(differences_about(box_grid(8, 1, {}), 1, {}, 3) == 0);
}

TEST(beams, soup) {
  Random random(4);
  CHECK(differences_about(soup(random, 3000, 1, 0.2), 1, {}, 5) == 0);
  CHECK(differences_about(soup(random, 40, 1, 3), 1, {}, 6) == 0);
}

TEST(beams, slivers) {
  Random random(7);
  CHECK(differences_about(slivers(random, 2000), 1, {}, 8) == 0);
}

TEST(beams, surfaces_in_one_another) {
  Random random(9);
  CHECK(differences_about(walls(random), 1, {}, 10) == 0);
}

TEST(beams, tiny_huge_and_far) {
  const Mesh mesh = bumpy_sphere(30, 60);
  for (double scale : {1e-9, 1e-4, 1e4, 1e8})
    CHECK(differences_about(scaled(mesh, scale, {}), scale, {}, 11) == 0);
  const Vec3d away{1000, -300, 50};
  CHECK(differences_about(scaled(mesh, 1, away), 1, away, 12) == 0);
}

/// Two meshes of which rays see one, spheres and squares behind other trees' hits.
TEST(beams, several_trees_and_what_is_hidden) {
  Random random(13);
  MixedShapes scene;
  const Mesh round = bumpy_sphere(40, 80), boxes = box_grid(6, 0.8, {});
  scene.add(round);
  scene.add(boxes);
  scene.add_round_and_square(random, 200, 0.2);
  scene.add_shapes();
  for (uint32_t g = 0; g < 4; ++g) scene.place(g, Affine{});
  scene.instances[0].visibility = kMirror | kShadow;
  const auto accel = build(scene.geometries, scene.instances);
  std::vector<Ray> rays;
  for (int k = 0; k < rounds(40); ++k)
    add_beam(rays, random.in_box(3), random.in_box(0.7), std::pow(10, random.uniform(-4, -1.3)),
             random);
  for (int k = 0; k < rounds(40); ++k)
    add_shadow_beam(rays, *accel, random.in_box(3), random.in_box(0.7), random.in_box(3), 0.01,
                    1e-6, random);
  for (uint32_t visibility : {kCamera, kMirror})
    CHECK(wrong_in_beams(*accel, rays, visibility) == 0);
}

/// Few copies, so large that beams go into them as beams; some where others are, some that cameras
/// do not see or rays pass.
TEST(beams, large_instances) {
  Random random(15);
  for (const std::string& isa : kernels_here()) {
    ask_for_isa(isa.c_str());
    for (int scene_number = 0; scene_number < rounds(12); ++scene_number) {
      MixedShapes scene;
      const Mesh mesh = scene_number % 3 ? bumpy_sphere(12, 24) : box_grid(3, 1, {});
      scene.add(mesh);
      for (uint32_t k = 0; k < 4; ++k) {
        const Affine place = k == 3 ? scene.instances[scene_number % 3].world_from_object
                                    : random_affine(random, random.uniform(0.2, 3));
        scene.place(0, place);
      }
      scene.instances[1].visibility = kMirror | kShadow;
      const uint8_t kinds[] = {Opacity::kSolid, Opacity::kSolid, Opacity::kClear, Opacity::kSolid};
      const auto accel = build(scene.geometries, scene.instances);
      std::vector<Ray> rays;
      for (int k = 0; k < 20; ++k)
        add_beam(rays, random.in_box(k % 3 ? 3 : 1), random.in_box(1),
                 std::pow(10, random.uniform(-5, -2)), random, k % 5 ? 0 : random.uniform(),
                 k % 4 ? HUGE_VAL : random.uniform(0.6, 1.4));
      const Opacity opacity{kinds, nullptr, nullptr};
      for (uint32_t visibility : {kCamera, kMirror}) {
        CHECK(wrong_in_beams(*accel, rays, visibility) == 0);
        CHECK(wrong_in_beams(*accel, rays, visibility, nullptr, &opacity) == 0);
      }
    }
  }
  ask_for_isa(nullptr);
}

/// Lights on a surface, or less from it than rays' ends are apart.
TEST(beams, lights_at_a_surface) {
  Random random(14);
  for (const Mesh& mesh : {bumpy_sphere(20, 40), box_grid(3, 1, {}), slivers(random, 300)}) {
    const auto accel = build(mesh);
    std::vector<Ray> rays;
    for (int k = 0; k < rounds(300); ++k) {
      const size_t triangle = random.below(mesh.count());
      const Vec3d a = mesh.corner(triangle, 0), b = mesh.corner(triangle, 1),
                  c = mesh.corner(triangle, 2);
      const double u = random.uniform(), v = random.below(3) ? random.uniform(0, 1 - u) : 0;
      const double off = random.below(4) ? std::pow(10, random.uniform(-9, -5)) : 0;
      const Vec3d light = a + u * (b - a) + v * (c - a) + off * random.on_sphere();
      const Vec3d along[] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}, random.on_sphere()};
      add_rounded_beam(rays, light + random.uniform(0.1, 2) * along[k % 4], light,
                       std::pow(10, random.uniform(-6, -2)), random);
    }
    CHECK(wrong_in_beams(*accel, rays, kCamera) == 0);
  }
}
