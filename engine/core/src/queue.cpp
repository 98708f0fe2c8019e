#include "queue.h"

#include <algorithm>
#include <numeric>

namespace glint {

std::vector<Queue> split(const Queue& queue, size_t limit) {
  std::vector<uint32_t> order(queue.size());
  std::iota(order.begin(), order.end(), 0u);
  auto pixel = [&](uint32_t k) { return queue.paths[k].pixel; };
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return pixel(a) < pixel(b); });
  std::vector<Queue> pieces(1);
  for (size_t begin = 0, end; begin < order.size(); begin = end) {
    for (end = begin + 1; end < order.size() && pixel(order[end]) == pixel(order[begin]);) ++end;
    if (pieces.back().size() > 0 && pieces.back().size() + (end - begin) > limit) pieces.emplace_back();
    for (size_t k = begin; k < end; ++k) {
      if (pieces.back().size() == limit) pieces.emplace_back();
      pieces.back().push(queue.rays[order[k]], queue.paths[order[k]]);
    }
  }
  return pieces;
}

}  // namespace glint
