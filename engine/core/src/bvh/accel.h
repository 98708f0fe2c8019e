// The accelerator: a tree per geometry, a tree over instances, closest and any hit for
// batches of rays. All world quantities are doubles in anchored space (scene/anchor.h): camera at
// the origin, scene radius about one.
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "math/vec.h"

namespace glint {

enum Visibility : uint32_t {
  kCamera = 1,
  kMirror = 2,
  kShadow = 4,
  kTransmission = 32,
  kDiffuse = 64,
  kAnyRay = kCamera | kMirror | kShadow | kTransmission | kDiffuse
};

/// Borrowed arrays; they outlive the accelerator. Object space, float32.
struct GeometryView {
  enum Kind { kMesh, kSpheres, kPolygons, kStrands } kind = kMesh;
  const float* vertices = nullptr;  // mesh, polygons: 3 per vertex; spheres: centres
  size_t vertex_count = 0;
  const uint32_t* triangles = nullptr;  // mesh: 3 per triangle
  const float* radii = nullptr;         // spheres; strands: of vertices
  const uint32_t* offsets = nullptr;    // polygons: primitive_count + 1
  const uint32_t* indices = nullptr;    // polygons; strands: first vertex of each segment
  size_t primitive_count = 0;
};

struct InstanceView {
  uint32_t geometry = 0;
  uint32_t visibility = kAnyRay;
  Affine world_from_object;
};

struct Ray {
  Vec3d o, d;                   // d need not be unit; t counts in lengths of d
  double t_min = 0, t_max = 0;  // open interval; t_max may be infinity
  uint32_t visibility = kCamera;
};

/// Where surfaces let rays through, as far as that is known without shading: hits are passed where
/// nothing is seen of them.
struct Opacity {
  enum Kind : uint8_t {
    kClear,
    kVaried,
    kSolid,
    kMapped
  };  // lets all through and gives nothing, some, nothing; depends on the place
  const uint8_t* of_instance;  // a Kind each
  const void* maps;
  /// What the triangle of an instance is at the weights u and v; never kMapped.
  uint8_t (*at)(const void* maps, uint32_t instance, uint32_t primitive, double u, double v);
  /// Closest hits: past triangles that dim, too. Layers: solid surfaces are among them, and stop no
  /// ray.
  bool onward = false;
  /// Closest hits on spheres, strands and polygons, too, are passed where their instance is clear.
  bool alone = false;
};

/// What is known of rays that begin at one point by who made them: 0 <= t_min <= latest < earliest
/// <= t_max.
struct RayEnds {
  double latest, earliest;
};

/// Many rays by component, `count` numbers each, all looking for the same visibility: what the
/// kernels read.
struct Rays {
  const double* o[3];
  const double* d[3];
  const double* t_min;
  const double* t_max;
  size_t count;
  uint32_t visibility;
  const Opacity* opacity = nullptr;  // null: surfaces are met wherever they are
  const RayEnds* ends = nullptr;     // null: they may begin anywhere
};

struct Hit {
  static constexpr uint32_t kNone = 0xffffffffu;
  double t = 0;
  uint32_t instance = kNone;  // index into the instances given to build
  uint32_t primitive = 0;     // triangle, sphere, polygon or segment of the geometry
  float u = 0, v = 0;  // triangles: barycentric weights of the second and third vertex; strands:
                       // how far along (u)
};

/// Room for the hits of Rays, by component.
struct Hits {
  double* t;
  uint32_t* instance;
  uint32_t* primitive;
  float* u;
  float* v;
  /// Null, or how often a ray needed double precision to decide about a triangle; stays at 255. A
  /// measure of work: it depends on the rays that a ray is traced with and on the instruction set.
  uint8_t* fallbacks = nullptr;
};

/// The surfaces that dim rays: of each ray the nearest ones, in the order in which `closest` would
/// meet them one after the other. Those at one distance are all there.
struct Layers {
  static constexpr uint32_t kMost = 16;
  Hit* hits;                          // kMost a ray
  uint8_t* count;                     // kMost + 1: there are more
  const uint8_t* left_out = nullptr;  // not 0 for instances that are none; null for none of them
};

struct AccelStats {
  size_t bytes = 0, nodes = 0, primitives = 0,
         dropped = 0;  // dropped: primitives with a non-finite vertex or no extent
  size_t built = 0;    // primitives whose trees were not taken over
  double seconds = 0;
};

/// How much time a build takes, and how little the rays: hits are the same. kFine: triangles may be
/// in several leaves.
enum class BuildQuality { kFast, kBalanced, kFine };

class TileFrustum;
struct RayStacks;

/// Memory that one thread's rays need on their way, for one call at a time. Not on the stack: see
/// RayStacks.
class Scratch {
 public:
  Scratch();
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  RayStacks& stacks() { return *stacks_; }

 private:
  std::unique_ptr<RayStacks> stacks_;
};

class Accel;

/// An accelerator whose trees serve where nothing has changed since.
struct AccelBase {
  static constexpr uint32_t kNone = 0xffffffffu;
  std::shared_ptr<const Accel> accel;
  std::vector<uint32_t>
      geometry;  // of each geometry its number in `accel`, kNone for one that is not there
  bool same_space = false;  // world space is the same
  bool exact = true;  // else meshes that moved leave the world's trees, and their hits differ in
                      // the last bits
};

class Accel {
 public:
  virtual ~Accel() = default;
  /// Null when `cancel` became true. Throws std::bad_alloc.
  static std::unique_ptr<Accel> build(std::vector<GeometryView> geometries,
                                      std::vector<InstanceView> instances, int threads,
                                      const std::atomic<bool>& cancel,
                                      BuildQuality quality = BuildQuality::kBalanced,
                                      const AccelBase& base = {});
  virtual void closest(const Rays& rays, const Hits& hits, Scratch& scratch) const = 0;
  /// blocked[k] = 1 when anything lies inside the open interval of ray k; 2 when rays.opacity says
  /// that it is a triangle that lets nothing through.
  virtual void occluded(const Rays& rays, uint8_t* blocked, Scratch& scratch) const = 0;
  /// The same with the layers on the way of each ray; those of a ray with blocked[k] = 2 may be
  /// missing. Needs rays.opacity.
  virtual void find_layers(const Rays& rays, const Layers& layers, uint8_t* blocked,
                           Scratch& scratch) const = 0;
  /// Closest and any hit for rays one by one, each with a visibility of its own.
  void closest(const Ray* rays, Hit* hits, size_t count, Scratch& scratch) const;
  void occluded(const Ray* rays, uint8_t* blocked, size_t count, Scratch& scratch) const;
  /// With memory of their own, for a few.
  void closest(const Ray* rays, Hit* hits, size_t count) const;
  void occluded(const Ray* rays, uint8_t* blocked, size_t count) const;
  /// Whether certainly nothing lies on any ray of the frustum.
  virtual bool surely_empty(const TileFrustum& frustum) const = 0;
  /// Empty when every primitive lies in its boxes and every node is reached once; else what is
  /// wrong.
  virtual std::string validate() const = 0;
  virtual AccelStats stats() const = 0;
};

}  // namespace glint
