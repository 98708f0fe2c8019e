// Columns of doubles in one block, as the stages want them.
#pragma once
#include <algorithm>
#include <span>
#include <vector>

#include "math/vec.h"
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
  size_t count() const { return count_; }
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

/// The columns of a member of width 1 or more.
template <class Number>
std::span<Number*> columns_of(Number*& column) {
  return {&column, 1};
}
template <class Number, size_t width>
std::span<Number*> columns_of(Number* (&columns)[width]) {
  return columns;
}

/// What such a member has of a row.
template <int width>
using Row = std::conditional_t<width == 1, double, Vec3d>;
template <int width>
constexpr Row<width> all_of(double number) {
  if constexpr (width == 1) return number;
  else return {number, number, number};
}

inline double row(const double* column, size_t k) { return column[k]; }
inline Vec3d row(const double* const (&columns)[3], size_t k) {
  return {columns[0][k], columns[1][k], columns[2][k]};
}
inline void set_row(double* column, size_t k, double v) { column[k] = v; }
inline void set_row(double* const (&columns)[3], size_t k, Vec3d v) {
  columns[0][k] = v.x;
  columns[1][k] = v.y;
  columns[2][k] = v.z;
}

}  // namespace glint
