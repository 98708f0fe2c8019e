#include "integrator/queue.h"

#include <algorithm>
#include <numeric>

namespace glint {

void Queue::reserve(size_t count) {
  if (count <= columns_.rows()) return;
  columns_.reserve(std::max({size_t(64), 2 * size_, count}));
  tags_.resize(columns_.rows());
}

void Queue::push(const Ray& ray, Path path) {
  const size_t k = size_++;
  reserve(size_);
  path.o = ray.o;
  path.d = ray.d;
  path.t_min = ray.t_min;
  path.t_max = ray.t_max;
  const RayEnd at = end();
#define RAY_COLUMN(name, width, first, kept) set_row(at.name, k, path.name);
#include "shading/path_state.inc"
  at.tags[k] = std::bit_cast<int64_t>(PathBits(path));
}

void Queue::append(const Queue& from, size_t k) {
  reserve(size_ + 1);
  for (size_t c = 0; c < columns_.count(); ++c) columns_[c][size_] = from.columns_[c][k];
  tags_[size_++] = from.tags_[k];
  if (exits) hits_.push_back(from.hits_[k]);
}

void Queue::give_refracted(Queue& to) {
  const size_t count = size_;
  size_ = 0;
  for (size_t k = 0; k < count; ++k) (refracted(k) ? to : *this).append(*this, k);
}

void Queue::start_at_camera(size_t count) {
  if (count > columns_.rows()) {
    reserve(count);
    RayEnd at = end();
#define RAY_COLUMN(name, width, first, kept) \
  for (double* column : columns_of(at.name)) std::fill_n(column, columns_.rows(), first);
#include "shading/path_state.inc"
  }
  size_ = count;
  for (; numbered_ < count; ++numbered_) tags_[numbered_] = int64_t(numbered_);
}

Rays Queue::rays() const {
  const RayColumns at = columns();
  return {{at.o[0], at.o[1], at.o[2]},
          {at.d[0], at.d[1], at.d[2]},
          at.t_min,
          at.t_max,
          size(),
          visibility};
}

std::vector<Queue> split(const Queue& queue, size_t limit) {
  std::vector<uint32_t> order(queue.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return queue.slot(a) < queue.slot(b); });
  Queue none(queue.visibility);
  none.past = queue.past;
  none.exits = queue.exits;
  std::vector<Queue> pieces(1, none);
  for (size_t begin = 0, end; begin < order.size(); begin = end) {
    for (end = begin + 1; end < order.size() && queue.slot(order[end]) == queue.slot(order[begin]);)
      ++end;
    if (pieces.back().size() > 0 && pieces.back().size() + (end - begin) > limit)
      pieces.push_back(none);
    for (size_t k = begin; k < end; ++k) {
      if (pieces.back().size() == limit) pieces.push_back(none);
      pieces.back().append(queue, order[k]);
    }
  }
  return pieces;
}

size_t PathCuts::leading(const Queue& queue, const uint32_t* rows, size_t count) {
  if (queue.visibility == kCamera) return count;
  if (++list_ == 0) {
    seen_.clear();
    list_ = 1;
  }
  size_t k = 0;
  for (; k < count; ++k) {
    const uint32_t slot = queue.slot(rows[k]);
    if (slot >= seen_.size()) seen_.resize(slot + 1);
    if (seen_[slot] == list_) break;
    seen_[slot] = list_;
  }
  return k;
}

}  // namespace glint
