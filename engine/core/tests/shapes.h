// Meshes and rays for the tests and the benchmark.
#pragma once
#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "bvh/accel.h"

namespace glint::test {

/// Small reproducible numbers (splitmix64).
struct Random {
  uint64_t state;
  explicit Random(uint64_t seed) : state(seed) {}
  uint64_t bits();
  double uniform(double a = 0, double b = 1);
  size_t below(size_t n);
  Vec3d in_box(double half);
  Vec3d on_sphere();
};

struct Mesh {
  std::vector<float> vertices;
  std::vector<uint32_t> triangles;
  GeometryView view() const;
  size_t count() const { return triangles.size() / 3; }
  Vec3d corner(size_t triangle, size_t k) const;
  uint32_t add(Vec3d p);
  void add(uint32_t a, uint32_t b, uint32_t c);
};

/// Closed: an icosahedron split `level` times.
Mesh icosphere(int level, double radius, Vec3d center);
/// Closed: a box of n x n squares a side.
Mesh box_grid(int n, double half, Vec3d center);
/// Closed: latitudes and longitudes with a bumpy radius round 1; 2 rows columns triangles.
Mesh bumpy_sphere(int rows, int columns);
/// Triangles with random corners.
Mesh soup(Random& random, size_t count, double half, double size);

Affine translation(Vec3d t);

/// What a build is made from, of all kinds: meshes of the caller's, squares as polygons, spheres.
/// It holds the arrays that its views show.
class MixedShapes {
 public:
  /// Adds `count` spheres and as many squares, `size` across, within a box of half side 2.
  void add_round_and_square(Random& random, int count, double size);
  void add(const Mesh& mesh) { geometries.push_back(mesh.view()); }
  /// After add_round_and_square: the spheres and the polygons as two geometries.
  void add_shapes();
  void place(uint32_t geometry, const Affine& world_from_object);
  std::vector<GeometryView> geometries;
  std::vector<InstanceView> instances;

 private:
  std::vector<float> centers_, radii_, corners_;
  std::vector<uint32_t> offsets_{0}, indices_;
};
/// Random columns with entries in [-1, 1], translation within `half`.
Affine random_affine(Random& random, double half);

Ray ray(Vec3d o, Vec3d d, double t_min = 0, double t_max = HUGE_VAL, uint32_t visibility = kCamera);

constexpr BuildQuality kQualities[] = {BuildQuality::kFast, BuildQuality::kBalanced,
                                       BuildQuality::kFine};

/// Builds with every quality, checks validate(), and ends the test when it complains. Returns the
/// one of `quality`.
std::unique_ptr<Accel> build(const std::vector<GeometryView>& geometries,
                             const std::vector<InstanceView>& instances, int threads = 2,
                             BuildQuality quality = BuildQuality::kBalanced);
std::unique_ptr<Accel> build(const Mesh& mesh, const Affine& m = {}, int threads = 2,
                             BuildQuality quality = BuildQuality::kBalanced);
Hit closest(const Accel& accel, const Ray& r);

/// All bits of two hits.
bool same(const Hit& a, const Hit& b);
/// How many rays get another answer in a batch than alone, or are blocked without a hit or hit
/// without being blocked.
int differences(const Accel& accel, std::vector<Ray> rays, uint32_t visibility);

}  // namespace glint::test
