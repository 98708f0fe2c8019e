// Rays on their way, with what each carries to its pixel, by component.
#pragma once
#include <vector>

#include "accel/accel.h"
#include "columns.h"
#include "vec.h"

namespace glint {

/// T: the weight to the pixel.  start: where the ray starts exactly, before it was moved clear of its surface; surfaces are met from there.
/// from: ray parameter up to which visible lights were already counted.  slot: number of its camera ray (Paths).
struct Path {
  Vec3d T, start;
  double from = 0;
  uint32_t slot = 0;
  uint8_t depth = 0, straight = 0;  // mirror and refraction rays so far; transparent ones in a row
  bool wants_data = false;
};

/// Rays that look for the same visibility: kCamera at depth 0, else kMirror.
class Queue {
 public:
  explicit Queue(uint32_t visibility_ = kMirror) : visibility(visibility_) {}

  size_t size() const { return slots.size(); }
  void clear() { slots.clear(), depths.clear(), straights.clear(), wants_data.clear(); }
  void push(const Ray& ray, const Path& path);
  /// `count` rays from o = start = 0 with weight 1, but for what was written there after an earlier call; directions, bounds and who wants
  /// data are to be filled in. Nothing is ever pushed here.
  void start_at_camera(size_t count);

  Ray ray(size_t k) const { return {at(kO, k), at(kD, k), columns[kTMin][k], columns[kTMax][k], visibility}; }
  Path path(size_t k) const {
    return {at(kT, k), at(kStart, k), columns[kFrom][k], slots[k], depths[k], straights[k], wants_data[k] != 0};
  }
  Rays rays() const;

  static constexpr size_t kO = 0, kD = 3, kT = 6, kStart = 9, kTMin = 12, kTMax = 13, kFrom = 14, kColumns = 15;
  uint32_t visibility;
  Columns columns{kColumns};
  std::vector<uint32_t> slots;
  std::vector<uint8_t> depths, straights, wants_data;

 private:
  Vec3d at(size_t column, size_t k) const { return {columns[column][k], columns[column + 1][k], columns[column + 2][k]}; }
  void put(size_t column, size_t k, Vec3d v) { columns[column][k] = v.x, columns[column + 1][k] = v.y, columns[column + 2][k] = v.z; }
};

/// Cuts a queue into pieces of at most `limit` rays, in order. All rays of a path stay in one piece unless it alone has more than `limit`:
/// then its pieces hold its own first `limit`, the next `limit`, … So the cut of a path does not depend on other paths.
std::vector<Queue> split(const Queue& queue, size_t limit);

}  // namespace glint
