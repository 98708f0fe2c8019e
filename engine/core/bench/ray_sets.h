// What the comparison with Embree traces: a world of one mesh, once or as many instances, and the
// rays that a Whitted-style engine shoots.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "../tests/shapes.h"
#include "bvh/accel.h"

namespace glint::bench {

/// A pinhole and a point light, in world space.
struct View {
  Vec3d eye{1.9, -2.6, 1.3}, target{0, 0, 0}, up{0, 0, 1};
  double half_width = 0.3;  // of the square picture, at distance 1
  Vec3d light{-3, -1.5, 3};
};

struct World {
  test::Mesh mesh;
  std::vector<Affine> instances;  // empty: the mesh as it is
  View view;
  size_t triangles() const { return mesh.count() * std::max<size_t>(1, instances.size()); }
};

/// `icosphere:LEVEL`, `bumpy:ROWSxCOLUMNS`, `instances:COUNT` (of icosphere:3, scattered in a box,
/// any orientation), `copies:COUNT` (of bumpy:132x264, so large that few fill the picture), or the
/// path of a file: 8 bytes "GLINTRAY", uint64 vertices, uint64 triangles, 13 float32 (eye, target,
/// up, half width, light), then float32 vertices and uint32 triangles, all little-endian. Throws
/// std::runtime_error with the reason.
World load_world(const std::string& name);

/// Rays by component. The numbers are float32, so that every tracer gets the same ones.
class RaySet {
 public:
  void add(Vec3d o, Vec3d d, double t_min, double t_max);
  size_t size() const { return t_min.size(); }
  Rays view(size_t first, size_t count) const;
  /// In the order of `order`.
  RaySet permuted(const std::vector<uint32_t>& order) const;
  Vec3d origin(size_t k) const { return {o[0][k], o[1][k], o[2][k]}; }
  Vec3d direction(size_t k) const { return {d[0][k], d[1][k], d[2][k]}; }
  std::vector<double> o[3], d[3], t_min, t_max;
  uint32_t visibility = kCamera;
};

/// Closest hits with room of their own.
struct HitArrays {
  explicit HitArrays(size_t count)
      : t(count), instance(count), primitive(count), u(count), v(count) {}
  Hits from(size_t first) {
    return {&t[first], &instance[first], &primitive[first], &u[first], &v[first]};
  }
  std::vector<double> t;
  std::vector<uint32_t> instance, primitive;
  std::vector<float> u, v;
};

/// The rays of one frame. Secondary rays start from the primary hits, off the surface by 1e-4 along
/// the geometric normal, misses left out.
struct FrameRays {
  RaySet primary;  // one a pixel, through its centre, in nested blocks: 4x4 pixels by rows, 2x2 of
                   // those, 2x2 of those, ...
  RaySet shadow;   // any hit, from the surface to the light
  RaySet shadow_from_light;  // the same segments the other way
  RaySet mirror;             // reflected about the geometric normal
  RaySet diffuse;  // one a hit, cosine-weighted round the geometric normal, in random order
};

/// Pixel of the k-th primary ray: the bits of k are row and column within 4x4, then turn by turn.
void pixel_of(uint32_t k, uint32_t& column, uint32_t& row);

/// `size` x `size` pixels, size a power of two from 4 on. Reproducible: the random numbers have
/// fixed seeds.
FrameRays make_rays(const World& world, const Accel& accel, uint32_t size);

}  // namespace glint::bench
