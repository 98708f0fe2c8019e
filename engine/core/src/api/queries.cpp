// Rays in the caller's arrays, answered block by block on several threads.
#include "api/queries.h"

#include <algorithm>
#include <cmath>

#include "api/guard.h"
#include "math/math.h"
#include "system/thread_pool.h"

namespace glint {
namespace {

constexpr size_t kBlock = 1024;  // rays that go down together; 72 kB of them stay in a core's cache
constexpr size_t kSamples = 64;  // placements, and primitives of each, that tell where the scene is

// --- where the scene is ---

void grow(Extent& world, const Extent& box, const Affine& m) {
  for (int k = 0; !box.empty() && k < 8; ++k)
    if (const Vec3d p = point(m, box.corner(k)); finite(p)) world.grow(p);
}

/// A vertex that the primitive uses; NaN for a polygon without corners.
Vec3d vertex_of(const GlintGeometry& g, size_t primitive) {
  if (g.kind == GLINT_SPHERES) return vertex(g, primitive);
  if (g.kind == GLINT_STRANDS) return vertex(g, g.indices[primitive]);
  if (g.kind == GLINT_MESH) return vertex(g, g.triangles[3 * primitive]);
  if (g.offsets[primitive] == g.offsets[primitive + 1]) return {std::nan(""), 0, 0};
  return vertex(g, g.indices[g.offsets[primitive]]);
}

/// At most about kSamples numbers below `count`, evenly spread.
size_t stride_of(size_t count) { return std::max<size_t>(1, count / kSamples); }

/// What tells where a scene is: vertices in world space, and the placements' own origins.
struct Sample {
  std::vector<Vec3d> points, origins;

  Sample(const GlintAccelData& data, const std::vector<InstanceView>& instances) {
    for (size_t i = 0; i < instances.size(); i += stride_of(instances.size())) {
      const GlintGeometry& g = data.geometries[instances[i].geometry];
      const Affine& m = instances[i].world_from_object;
      for (size_t k = 0; k < g.primitive_count; k += stride_of(g.primitive_count)) {
        const Vec3d p = point(m, vertex_of(g, k));
        if (finite(p)) points.push_back(p);
      }
      origins.push_back(m.t);
    }
  }
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Half of the points are nearer to `p` than this; where that is 0, the farthest.
double radius_about(const std::vector<Vec3d>& points, Vec3d p) {
  std::vector<double> far;
  for (Vec3d q : points) far.push_back(max_abs(q - p));
  const double middle = median(far);
  return middle > 0 ? middle : *std::max_element(far.begin(), far.end());
}

/// The middle of the scene and the power of two that brings half of it within 1. Medians, so that a
/// stray vertex at 1e38 moves neither. The origin of a placement close to the middle is as good and
/// keeps that mesh's vertices to the bit.
Anchor anchor_of(const Sample& sample, const Extent& box) {
  Anchor anchor;
  if (sample.points.empty()) return anchor;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (Vec3d p : sample.points) values.push_back(p[axis]);
    anchor.origin[axis] = median(std::move(values));
  }
  double radius = radius_about(sample.points, anchor.origin);
  if (radius == 0)
    radius = std::max(max_abs(box.low - anchor.origin),
                      max_abs(box.high - anchor.origin));  // one primitive, or a fan
  auto nearer = [&](Vec3d a, Vec3d b) {
    return max_abs(a - anchor.origin) < max_abs(b - anchor.origin);
  };
  const Vec3d own = *std::min_element(sample.origins.begin(), sample.origins.end(), nearer);
  if (max_abs(own - anchor.origin) <= 4 * radius) anchor.origin = own;
  if (radius > 0 && radius < kInfinity)
    anchor.scale = power_of_two(-std::clamp(std::ilogb(radius), -200, 200));
  return anchor;
}

// --- building ---

std::vector<InstanceView> instance_views(const GlintAccelData& data) {
  std::vector<InstanceView> views;
  for (uint64_t i = 0; i < data.instances_count; ++i) {
    const GlintInstances& g = data.instances[i];
    for (uint64_t row = g.first_row; row < g.first_row + g.row_count; ++row)
      views.push_back({g.geometry, g.flags & kAnyRay, affine(data.world_from_object + 12 * row)});
  }
  return views;
}

Extent world_bounds(const GlintAccelData& data, const std::vector<InstanceView>& instances) {
  std::vector<Extent> boxes;
  for (uint64_t i = 0; i < data.geometry_count; ++i) boxes.push_back(extent_of(data.geometries[i]));
  Extent world;
  for (const InstanceView& i : instances) grow(world, boxes[i.geometry], i.world_from_object);
  return world;
}

// --- answering ---

/// Rays of one block by component, anchored. Directions are scaled like positions, so that t stays
/// the caller's.
struct Block {
  double o[3][kBlock], d[3][kBlock], t_min[kBlock], t_max[kBlock], t[kBlock];

  template <class Given>
  Rays fill(const Given& rays, size_t first, size_t count, const Anchor& anchor) {
    const Vec3d none{};
    rows(o, rays.origins, rays.origin_stride, first, count, anchor.scale, anchor.origin);
    rows(d, rays.directions, rays.direction_stride, first, count, anchor.scale, none);
    numbers(t_min, rays.t_min, rays.t_min_stride, first, count, 0);
    numbers(t_max, rays.t_max, rays.t_max_stride, first, count, kInfinity);
    size_t unsound = 0;
    for (size_t k = 0; k < count; ++k) unsound += !sound(k, anchor.scale);
    if (unsound > 0) silence(count, anchor.scale);
    for (size_t k = 0; k < count; ++k) t_min[k] = t_min[k] > 0 ? t_min[k] : 0;
    return {{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, t_min, t_max, count, rays.visibility};
  }

  /// to = scale * (from - origin), component by component. The usual stride is known to the
  /// compiler, which then reads vectors.
  template <class Number>
  static void rows(double (&to)[3][kBlock], const Number* from, size_t stride, size_t first,
                   size_t count, double scale, Vec3d origin) {
    from += first * stride;
    const double x = origin.x, y = origin.y, z = origin.z;
    auto read = [&](size_t step) {
      for (size_t k = 0; k < count; ++k) {
        to[0][k] = scale * (double(from[k * step]) - x);
        to[1][k] = scale * (double(from[k * step + 1]) - y);
        to[2][k] = scale * (double(from[k * step + 2]) - z);
      }
    };
    if (stride == 3) read(3);
    else read(stride);
  }

  template <class Number>
  static void numbers(double* to, const Number* from, size_t stride, size_t first, size_t count,
                      double otherwise) {
    if (from && stride == 1) std::copy_n(from + first, count, to);
    else if (from && stride > 1)
      for (size_t k = 0; k < count; ++k) to[k] = double(from[(first + k) * stride]);
    else std::fill_n(to, count, from ? double(*from) : otherwise);
  }

  /// False for NaN anywhere. No branches: this is a loop over vectors.
  bool sound(size_t k, double scale) const {
    const double size = std::fabs(d[0][k]) + std::fabs(d[1][k]) + std::fabs(d[2][k]);
    const double far = std::fabs(o[0][k]) + std::fabs(o[1][k]) + std::fabs(o[2][k]);
    return (size >= 1e-150 * scale) & (size <= 1e150 * scale) & (far < kInfinity) &
           (t_min[k] < kInfinity) & (t_max[k] > 0);
  }

  /// Rays that cannot hit become sound ones with an empty interval: the kernels see finite numbers
  /// only.
  void silence(size_t count, double scale) {
    for (size_t k = 0; k < count; ++k) {
      if (sound(k, scale)) continue;
      for (int axis = 0; axis < 3; ++axis) {
        o[axis][k] = 0;
        d[axis][k] = 1;
      }
      t_min[k] = 0;
      t_max[k] = -1;
    }
  }
};

/// What a thread works with. Not on its stack, which may be small.
struct Workspace {
  Block block;
  Scratch scratch;
};

/// Calls body(workspace, first, count) for runs of rays, on all threads.
template <class Body>
void in_blocks(uint64_t count, uint32_t wanted, const Body& body) {
  const size_t blocks = count / kBlock + (count % kBlock != 0);
  ThreadPool pool(int(std::min(size_t(thread_count(wanted)), std::max<size_t>(blocks, 1))));
  std::atomic<size_t> next{0};
  pool.run(pool.size(), [&](size_t) {
    const auto workspace = std::make_unique_for_overwrite<Workspace>();
    for (size_t k; (k = next++) < blocks;)
      body(*workspace, k * kBlock, std::min<size_t>(kBlock, count - k * kBlock));
  });
}

/// t to the caller's type, and what a miss leaves.
template <class Number>
void finish(const double* t, const int32_t* instance, int32_t* primitive, float* u, float* v,
            Number* t_out, size_t count) {
  for (size_t k = 0; k < count; ++k) t_out[k] = instance[k] < 0 ? Number(kInfinity) : Number(t[k]);
  for (size_t k = 0; k < count; ++k) primitive[k] = instance[k] < 0 ? -1 : primitive[k];
  for (size_t k = 0; k < count; ++k) u[k] = instance[k] < 0 ? 0 : u[k];
  for (size_t k = 0; k < count; ++k) v[k] = instance[k] < 0 ? 0 : v[k];
}

template <class Given, class Room>
void closest(const GlintAccel& accel, const Given& rays, const Room& room) {
  in_blocks(rays.count, rays.threads, [&](Workspace& work, size_t first, size_t count) {
    int32_t *instance = room.instance + first, *primitive = room.primitive + first;
    float *u = room.u + first, *v = room.v + first;
    auto number = [](int32_t* p) {
      return reinterpret_cast<uint32_t*>(p);
    };  // Hit::kNone reads as -1
    double* const t = work.block.t;
    const Rays anchored = work.block.fill(rays, first, count, accel.anchor);
    accel.accel->closest(anchored, Hits{t, number(instance), number(primitive), u, v},
                         work.scratch);
    finish(t, instance, primitive, u, v, room.t + first, count);
  });
}

template <class Given>
void occluded(const GlintAccel& accel, const Given& rays, uint8_t* blocked) {
  in_blocks(rays.count, rays.threads, [&](Workspace& work, size_t first, size_t count) {
    accel.accel->occluded(work.block.fill(rays, first, count, accel.anchor), blocked + first,
                          work.scratch);
  });
}

template <class Given, class Answer>
int32_t answered(const GlintAccel* accel, const Given* rays, bool room, char* error, size_t size,
                 const Answer& answer) {
  return guarded<int32_t>(-1, error, size, [&]() -> int32_t {
    if (!accel || !rays) {
      tell(error, size, "no accelerator or no rays");
      return -1;
    }
    const std::string problems = rays_problems(*rays);
    if (!problems.empty()) {
      tell(error, size, problems.c_str());
      return -1;
    }
    if (!room && rays->count > 0) {
      tell(error, size, "no room for the answers");
      return -1;
    }
    answer();
    return 0;
  });
}

template <class Room>
bool has_room(const Room* hits) {
  return hits && hits->t && hits->instance && hits->primitive && hits->u && hits->v;
}

}  // namespace
}  // namespace glint

GlintAccel::GlintAccel(const GlintAccelData& data, glint::BuildQuality quality, uint32_t threads) {
  std::vector<glint::InstanceView> instances = glint::instance_views(data);
  const glint::Extent box = glint::world_bounds(data, instances);
  anchor = glint::anchor_of(glint::Sample(data, instances), box);
  for (glint::InstanceView& i : instances) i.world_from_object = anchor.matrix(i.world_from_object);
  stats.instances = instances.size();
  const std::atomic<bool> never{false};
  accel = glint::Accel::build(glint::geometry_views(data.geometries, data.geometry_count),
                              std::move(instances), glint::thread_count(threads), never, quality);
  const glint::AccelStats built = accel->stats();
  for (int k = 0; k < 3; ++k) {
    stats.low[k] = box.low[k];
    stats.high[k] = box.high[k];
  }
  stats.build_seconds = built.seconds;
  stats.primitives = built.primitives;
  stats.dropped = built.dropped;
  stats.bytes = built.bytes;
  stats.nodes = built.nodes;
}

GlintAccel* glint_accel_create(const GlintAccelData* data, int32_t acceleration, uint32_t threads,
                               char* error, size_t error_size) {
  return glint::guarded<GlintAccel*>(nullptr, error, error_size, [&]() -> GlintAccel* {
    std::string problems = data ? glint::accel_problems(*data) : "no data";
    if (acceleration < GLINT_BUILD_FAST || acceleration > GLINT_BUILD_FINE)
      problems = "unknown acceleration";
    if (!problems.empty()) {
      glint::tell(error, error_size, problems.c_str());
      return nullptr;
    }
    return new GlintAccel(*data, glint::BuildQuality(acceleration), threads);
  });
}

void glint_accel_destroy(GlintAccel* accel) { delete accel; }
GlintAccelStats glint_accel_stats(const GlintAccel* accel) { return accel->stats; }

int32_t glint_accel_closest_f32(const GlintAccel* accel, const GlintRaysF32* rays,
                                const GlintHitsF32* hits, char* error, size_t size) {
  return glint::answered(accel, rays, glint::has_room(hits), error, size,
                         [&] { glint::closest(*accel, *rays, *hits); });
}

int32_t glint_accel_closest_f64(const GlintAccel* accel, const GlintRaysF64* rays,
                                const GlintHitsF64* hits, char* error, size_t size) {
  return glint::answered(accel, rays, glint::has_room(hits), error, size,
                         [&] { glint::closest(*accel, *rays, *hits); });
}

int32_t glint_accel_occluded_f32(const GlintAccel* accel, const GlintRaysF32* rays,
                                 uint8_t* blocked, char* error, size_t size) {
  return glint::answered(accel, rays, blocked != nullptr, error, size,
                         [&] { glint::occluded(*accel, *rays, blocked); });
}

int32_t glint_accel_occluded_f64(const GlintAccel* accel, const GlintRaysF64* rays,
                                 uint8_t* blocked, char* error, size_t size) {
  return glint::answered(accel, rays, blocked != nullptr, error, size,
                         [&] { glint::occluded(*accel, *rays, blocked); });
}
