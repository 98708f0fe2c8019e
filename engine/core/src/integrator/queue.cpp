#include "integrator/queue.h"

#include <algorithm>
#include <numeric>

namespace glint {

void Queue::reserve(size_t count) {
  if (count <= columns_.rows()) return;
  columns_.reserve(std::max({size_t(64), 2 * size_, count}));
  tags_.resize(columns_.rows());
  tags = tags_.data();
  size_t next = 0;
#define RAY_COLUMN(name, width, first, kept) \
  for (double*& column : columns_of(name)) column = columns_[next++];
#include "shading/path_state.inc"
}

void Queue::push(const Ray& ray, Path path) {
  const size_t k = size_++;
  reserve(size_);
  path.o = ray.o;
  path.d = ray.d;
  path.t_min = ray.t_min;
  path.t_max = ray.t_max;
#define RAY_COLUMN(name, width, first, kept) set_row(name, k, path.name);
#include "shading/path_state.inc"
  tags[k] = std::bit_cast<int64_t>(PathBits(path));
}

void Queue::append(const Queue& other, size_t k) {
  reserve(size_ + 1);
  for (size_t c = 0; c < columns_.count(); ++c) columns_[c][size_] = other.columns_[c][k];
  tags_[size_++] = other.tags_[k];
  if (exits) hits_.push_back(other.hits_[k]);
}

void Queue::give_refracted(Queue& to) {
  const size_t count = size_;
  size_ = 0;
  for (size_t k = 0; k < count; ++k) (refracted(k) ? to : *this).append(*this, k);
}

void Queue::start_at_camera(size_t count) {
  if (count > columns_.rows()) {
    reserve(count);
#define RAY_COLUMN(name, width, first, kept) \
  for (double* column : columns_of(name)) std::fill_n(column, columns_.rows(), first);
#include "shading/path_state.inc"
  }
  size_ = count;
  for (; numbered_ < count; ++numbered_) tags_[numbered_] = int64_t(numbered_);
}

Rays Queue::rays() const {
  return {{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, t_min, t_max, size(), visibility};
}

std::vector<Queue> split(const Queue& queue, size_t limit) {
  std::vector<uint32_t> order(queue.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return queue.slot(a) < queue.slot(b); });
  std::vector<Queue> pieces;
  const auto open = [&] {
    Queue& piece = pieces.emplace_back(queue.visibility);
    piece.past = queue.past;
    piece.exits = queue.exits;
  };
  open();
  for (size_t begin = 0, end; begin < order.size(); begin = end) {
    for (end = begin + 1; end < order.size() && queue.slot(order[end]) == queue.slot(order[begin]);)
      ++end;
    if (pieces.back().size() > 0 && pieces.back().size() + (end - begin) > limit) open();
    for (size_t k = begin; k < end; ++k) {
      if (pieces.back().size() == limit) open();
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
