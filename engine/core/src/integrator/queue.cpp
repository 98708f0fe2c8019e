#include "integrator/queue.h"

#include <algorithm>
#include <numeric>

namespace glint {

void Queue::reserve(size_t count) {
  if (count <= columns_.rows()) return;
  columns_.reserve(std::max({size_t(64), 2 * size_, count}));
  tags_.resize(columns_.rows());
}

void Queue::push(const Ray& ray, const Path& path) {
  const size_t k = size_++;
  reserve(size_);
  put(kO, k, ray.o);
  put(kD, k, ray.d);
  put(kT, k, path.T);
  put(kStart, k, path.start);
  columns_[kTMin][k] = ray.t_min;
  columns_[kTMax][k] = ray.t_max;
  columns_[kFrom][k] = path.from;
  columns_[kShare][k] = path.share;
  tags_[k] = int64_t(path.slot) | int64_t(path.depth) << RayTag::kDepth |
             int64_t(path.straight) << RayTag::kStraight | path.refractions;
  if (path.widest < HUGE_VAL)
    tags_[k] |= int64_t(1 + std::clamp(std::ilogb(path.widest), 0, 60)) << RayTag::kWidth;
  if (path.transmitted) tags_[k] |= int64_t(1) << RayTag::kTransmitted;
  if (path.skyless) tags_[k] |= int64_t(1) << RayTag::kSkyless;
  if (path.wants_data) want_data(k);
}

void Queue::append(const Queue& from, size_t k) {
  reserve(size_ + 1);
  for (size_t c = 0; c < kColumns; ++c) columns_[c][size_] = from.columns_[c][k];
  tags_[size_++] = from.tags_[k];
  if (exits) hits_.push_back(from.hits_[k]);
}

void Queue::give_refracted(Queue& to) {
  const size_t count = size_;
  size_ = 0;
  for (size_t k = 0; k < count; ++k) (is_refracted(k) ? to : *this).append(*this, k);
}

void Queue::start_at_camera(size_t count) {
  if (count > columns_.rows()) {
    reserve(count);
    for (size_t c = 0; c < kColumns; ++c)
      std::fill_n(columns_[c], columns_.rows(), (c >= kT && c < kT + 3) || c == kShare ? 1.0 : 0.0);
  }
  size_ = count;
  for (; numbered_ < count; ++numbered_) tags_[numbered_] = int64_t(numbered_);
}

Rays Queue::rays() const {
  const Columns& c = columns_;
  return {{c[kO], c[kO + 1], c[kO + 2]},
          {c[kD], c[kD + 1], c[kD + 2]},
          c[kTMin],
          c[kTMax],
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
