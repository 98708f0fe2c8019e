// Rays on their way, with what each carries to its pixel.
#pragma once
#include <vector>

#include "accel/accel.h"
#include "vec.h"

namespace glint {

/// T: the weight to the pixel.  start: where the ray starts exactly, before it was moved clear of its surface; surfaces are met from there.
/// from: ray parameter up to which visible lights were already counted.
struct Path {
  Vec3d T, start;
  double from = 0;
  uint32_t pixel = 0;
  uint8_t depth = 0, straight = 0;  // mirror and refraction rays so far; transparent ones in a row
  bool wants_data = false;
};

struct Queue {
  std::vector<Ray> rays;
  std::vector<Path> paths;

  size_t size() const { return rays.size(); }
  void clear() { rays.clear(), paths.clear(); }
  void push(const Ray& ray, const Path& path) { rays.push_back(ray), paths.push_back(path); }
};

/// Cuts a queue into pieces of at most `limit` rays, in order. All rays of a pixel stay in one piece unless it alone has more than `limit`:
/// then its pieces hold its own first `limit`, the next `limit`, … So the cut of a pixel does not depend on other pixels.
std::vector<Queue> split(const Queue& queue, size_t limit);

}  // namespace glint
