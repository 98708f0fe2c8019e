// Letters: o origin, d direction, n normal, p point, as in the rest of the core.
#include "ray_sets.h"

#include <cstdio>
#include <cstring>
#include <fstream>
#include <numeric>
#include <stdexcept>

namespace glint::bench {
namespace {

constexpr double kOffset = 1e-4, kFar = 1e30;

template <class T>
void read(std::ifstream& file, T* to, size_t count) {
  file.read(reinterpret_cast<char*>(to), std::streamsize(count * sizeof(T)));
}

World read_world(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  char magic[8] = {};
  uint64_t counts[2] = {};
  float view[13] = {};
  read(file, magic, 8);
  read(file, counts, 2);
  read(file, view, 13);
  if (!file || std::memcmp(magic, "GLINTRAY", 8) != 0)
    throw std::runtime_error(path + ": not a mesh of this benchmark");
  World world;
  world.mesh.vertices.resize(3 * counts[0]);
  world.mesh.triangles.resize(3 * counts[1]);
  read(file, world.mesh.vertices.data(), 3 * counts[0]);
  read(file, world.mesh.triangles.data(), 3 * counts[1]);
  if (!file) throw std::runtime_error(path + ": shorter than its header says");
  auto vec = [&](int k) {
    return Vec3d{double(view[k]), double(view[k + 1]), double(view[k + 2])};
  };
  world.view = {vec(0), vec(3), vec(6), double(view[9]), vec(10)};
  return world;
}

/// A random rotation, `scale` and a place in the unit box.
Affine scattered(test::Random& random, double scale) {
  const Vec3d a = random.on_sphere();
  const Frame frame(a);
  return {scale * a, scale * frame.t1, scale * frame.t2, random.in_box(1)};
}

/// So many copies of a ball of 70 000 triangles, which fill the picture together.
World copies(size_t count) {
  World world;
  world.mesh = test::bumpy_sphere(132, 264);
  test::Random random(5);
  for (size_t k = 0; k < count; ++k) {
    Affine placed = scattered(random, 0.75);
    placed.t = 0.5 * placed.t;
    world.instances.push_back(placed);
  }
  return world;
}

World instances(size_t count) {
  World world;
  world.mesh = test::icosphere(3, 1, {});
  test::Random random(3);
  const double scale = 0.9 / std::cbrt(double(std::max<size_t>(1, count)));
  for (size_t k = 0; k < count; ++k) world.instances.push_back(scattered(random, scale));
  world.view.eye = {2.6, -3.5, 1.8};
  world.view.half_width = 0.35;
  return world;
}

RaySet primary_rays(const View& view, uint32_t size) {
  const Vec3d forward = normalize(view.target - view.eye),
              right = normalize(cross(forward, view.up)), up = cross(right, forward);
  RaySet rays;
  for (uint32_t k = 0; k < size * size; ++k) {
    uint32_t column, row;
    pixel_of(k, column, row);
    const double x = (2 * (column + 0.5) / size - 1) * view.half_width,
                 y = (1 - 2 * (row + 0.5) / size) * view.half_width;
    rays.add(view.eye, forward + x * right + y * up, 0, kFar);
  }
  return rays;
}

/// Unit, towards the side that the ray comes from.
Vec3d facing_normal(const World& world, uint32_t instance, uint32_t primitive, Vec3d d) {
  Vec3d corners[3];
  for (size_t k = 0; k < 3; ++k) {
    corners[k] = world.mesh.corner(primitive, k);
    if (!world.instances.empty()) corners[k] = point(world.instances[instance], corners[k]);
  }
  const Vec3d n = normalize(cross(corners[1] - corners[0], corners[2] - corners[0]));
  return dot(n, d) > 0 ? -n : n;
}

Vec3d cosine_direction(test::Random& random, Vec3d n) {
  const double z = random.uniform(), angle = random.uniform(0, 6.283185307179586), r = std::sqrt(z);
  const Frame frame(n);
  return r * std::cos(angle) * frame.t1 + r * std::sin(angle) * frame.t2 + std::sqrt(1 - z) * n;
}

std::vector<uint32_t> shuffled(size_t count) {
  std::vector<uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  test::Random random(11);
  for (size_t k = count; k > 1; --k) std::swap(order[k - 1], order[random.below(k)]);
  return order;
}

}  // namespace

void pixel_of(uint32_t k, uint32_t& column, uint32_t& row) {
  column = k & 3;
  row = (k >> 2) & 3;
  for (uint32_t bit = 2, rest = k >> 4; rest; ++bit, rest >>= 2) {
    column |= (rest & 1) << bit;
    row |= ((rest >> 1) & 1) << bit;
  }
}

World load_world(const std::string& name) {
  const size_t colon = name.find(':');
  const std::string kind = name.substr(0, colon),
                    numbers = colon == std::string::npos ? "" : name.substr(colon + 1);
  World world;
  unsigned a = 0, b = 0;
  const int found = std::sscanf(numbers.c_str(), "%ux%u", &a, &b);
  if (kind == "icosphere" && found == 1) world.mesh = test::icosphere(int(a), 1, {});
  else if (kind == "bumpy" && found == 2) world.mesh = test::bumpy_sphere(int(a), int(b));
  else if (kind == "instances" && found == 1) world = instances(a);
  else if (kind == "copies" && found == 1) world = copies(a);
  else world = read_world(name);
  world.mesh.vertices.reserve(world.mesh.vertices.size() +
                              1);  // Embree reads 16 bytes at the last vertex
  return world;
}

void RaySet::add(Vec3d from, Vec3d along, double near, double far) {
  for (int k = 0; k < 3; ++k) {
    o[k].push_back(double(float(from[k])));
    d[k].push_back(double(float(along[k])));
  }
  t_min.push_back(double(float(near)));
  t_max.push_back(double(float(far)));
}

Rays RaySet::view(size_t first, size_t count) const {
  auto at = [&](const std::vector<double>& column) { return column.data() + first; };
  return {{at(o[0]), at(o[1]), at(o[2])},
          {at(d[0]), at(d[1]), at(d[2])},
          at(t_min),
          at(t_max),
          count,
          visibility};
}

RaySet RaySet::permuted(const std::vector<uint32_t>& order) const {
  RaySet rays;
  rays.visibility = visibility;
  for (uint32_t k : order) rays.add(origin(k), direction(k), t_min[k], t_max[k]);
  return rays;
}

FrameRays make_rays(const World& world, const Accel& accel, uint32_t size) {
  FrameRays frame;
  frame.primary = primary_rays(world.view, size);
  frame.shadow.visibility = frame.shadow_from_light.visibility = kShadow;
  frame.mirror.visibility = frame.diffuse.visibility = kMirror;
  HitArrays hits(frame.primary.size());
  Scratch scratch;
  accel.closest(frame.primary.view(0, frame.primary.size()), hits.from(0), scratch);
  test::Random random(7);
  for (size_t k = 0; k < frame.primary.size(); ++k) {
    if (hits.instance[k] == Hit::kNone) continue;
    const Vec3d d = frame.primary.direction(k),
                n = facing_normal(world, hits.instance[k], hits.primitive[k], d);
    const Vec3d p = frame.primary.origin(k) + hits.t[k] * d + kOffset * n;
    frame.shadow.add(p, world.view.light - p, 0, 1);
    frame.shadow_from_light.add(world.view.light, p - world.view.light, 0, 1);
    frame.mirror.add(p, d - 2 * dot(d, n) * n, 0, kFar);
    frame.diffuse.add(p, cosine_direction(random, n), 0, kFar);
  }
  frame.diffuse = frame.diffuse.permuted(shuffled(frame.diffuse.size()));
  return frame;
}

}  // namespace glint::bench
