// Rays one by one, handed to the kernels by component.
#include "bvh/accel.h"

#include <algorithm>

#include "bvh/bvh.h"

namespace glint {
namespace {

constexpr size_t kBatch = 128;

/// Up to kBatch rays of one visibility.
struct Columns {
  double values[8][kBatch];

  /// Takes rays from `rays` on while they look for the same visibility.
  Rays fill(const Ray* rays, size_t count) {
    size_t n = 0;
    for (; n < std::min(count, kBatch) && rays[n].visibility == rays[0].visibility; ++n) {
      for (int k = 0; k < 3; ++k) {
        values[k][n] = rays[n].o[k];
        values[3 + k][n] = rays[n].d[k];
      }
      values[6][n] = rays[n].t_min;
      values[7][n] = rays[n].t_max;
    }
    return {{values[0], values[1], values[2]},
            {values[3], values[4], values[5]},
            values[6],
            values[7],
            n,
            rays[0].visibility};
  }
};

}  // namespace

Scratch::Scratch() : stacks_(std::make_unique_for_overwrite<RayStacks>()) {}
Scratch::~Scratch() = default;

void Accel::closest(const Ray* rays, Hit* hits, size_t count, Scratch& scratch) const {
  Columns columns;
  double t[kBatch];
  uint32_t instance[kBatch], primitive[kBatch];
  float u[kBatch], v[kBatch];
  for (size_t first = 0; first < count;) {
    const Rays batch = columns.fill(rays + first, count - first);
    closest(batch, Hits{t, instance, primitive, u, v}, scratch);
    for (size_t k = 0; k < batch.count; ++k)
      hits[first + k] = {t[k], instance[k], primitive[k], u[k], v[k]};
    first += batch.count;
  }
}

void Accel::occluded(const Ray* rays, uint8_t* blocked, size_t count, Scratch& scratch) const {
  Columns columns;
  for (size_t first = 0; first < count;) {
    const Rays batch = columns.fill(rays + first, count - first);
    occluded(batch, blocked + first, scratch);
    first += batch.count;
  }
}

void Accel::closest(const Ray* rays, Hit* hits, size_t count) const {
  Scratch scratch;
  closest(rays, hits, count, scratch);
}

void Accel::occluded(const Ray* rays, uint8_t* blocked, size_t count) const {
  Scratch scratch;
  occluded(rays, blocked, count, scratch);
}

}  // namespace glint
