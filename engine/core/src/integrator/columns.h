// Columns of doubles in one block, as the stages want them.
#pragma once
#include <algorithm>
#include <vector>

#include "shading/stages.h"

namespace glint {

/// `count` columns of a common length, aligned to cache lines. Columns begin an odd number of lines
/// apart, so that row k of all of them is not one set of the cache.
class Columns {
 public:
  explicit Columns(size_t count = 0) : count_(count) {}

  /// Room for `rows` rows, to the next multiple of kPad. Growing keeps what is there; addresses
  /// change.
  void reserve(size_t rows) {
    size_t lines = ((rows + kPad - 1) / kPad) | 1;
    if (lines <= lines_ && !block_.empty()) return;
    std::vector<Line> block(count_ * lines);
    for (size_t c = 0; c < count_; ++c)
      std::copy_n(block_.data() + c * lines_, lines_, block.data() + c * lines);
    block_.swap(block);
    lines_ = lines;
  }
  size_t rows() const { return lines_ * kPad; }
  size_t stride() const { return lines_ * kPad; }
  double* operator[](size_t c) { return block_[c * lines_].values; }
  const double* operator[](size_t c) const { return block_[c * lines_].values; }

 private:
  struct alignas(64) Line {
    double values[kPad];
  };
  static_assert(sizeof(Line) == 64);
  size_t count_, lines_ = 0;
  std::vector<Line> block_;
};

}  // namespace glint
