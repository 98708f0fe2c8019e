#include "queue.h"

#include <algorithm>
#include <numeric>

namespace glint {

void Queue::push(const Ray& ray, const Path& path) {
  size_t k = size();
  if (k >= columns.rows()) columns.reserve(std::max<size_t>(64, 2 * k));
  put(kO, k, ray.o), put(kD, k, ray.d), put(kT, k, path.T), put(kStart, k, path.start);
  columns[kTMin][k] = ray.t_min, columns[kTMax][k] = ray.t_max, columns[kFrom][k] = path.from;
  slots.push_back(path.slot), depths.push_back(path.depth), straights.push_back(path.straight), wants_data.push_back(path.wants_data);
}

void Queue::start_at_camera(size_t count) {
  wants_data.assign(count, false);
  const size_t before = slots.size();
  if (before == count) return;
  slots.resize(count), depths.assign(count, 0), straights.assign(count, 0);
  for (size_t k = before; k < count; ++k) slots[k] = uint32_t(k);
  if (count <= columns.rows()) return;
  columns.reserve(count);
  for (size_t c = 0; c < kColumns; ++c) std::fill_n(columns[c], columns.rows(), c >= kT && c < kT + 3 ? 1.0 : 0.0);
}

Rays Queue::rays() const {
  const Columns& c = columns;
  return {{c[kO], c[kO + 1], c[kO + 2]}, {c[kD], c[kD + 1], c[kD + 2]}, c[kTMin], c[kTMax], size(), visibility};
}

std::vector<Queue> split(const Queue& queue, size_t limit) {
  std::vector<uint32_t> order(queue.size());
  std::iota(order.begin(), order.end(), 0u);
  auto slot = [&](uint32_t k) { return queue.slots[k]; };
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return slot(a) < slot(b); });
  std::vector<Queue> pieces(1, Queue(queue.visibility));
  for (size_t begin = 0, end; begin < order.size(); begin = end) {
    for (end = begin + 1; end < order.size() && slot(order[end]) == slot(order[begin]);) ++end;
    if (pieces.back().size() > 0 && pieces.back().size() + (end - begin) > limit) pieces.emplace_back(queue.visibility);
    for (size_t k = begin; k < end; ++k) {
      if (pieces.back().size() == limit) pieces.emplace_back(queue.visibility);
      pieces.back().push(queue.ray(order[k]), queue.path(order[k]));
    }
  }
  return pieces;
}

}  // namespace glint
