// Rays with layers yet to be found, as of media and of surfaces that let shadow rays through.
#pragma once
#include <algorithm>
#include <utility>
#include <vector>

#include "bvh/accel.h"
#include "integrator/columns.h"

namespace glint {

/// They are traced round by round, some at a time. Those that have to go on wait again, in place of
/// earlier ones.
class WaitingRays {
 public:
  /// None waits; there is room for so many.
  void begin(size_t most) {
    columns_.reserve(most);
    number_.resize(columns_.rows());
    count_ = 0;
  }
  void drop() { count_ = 0; }

  /// A ray of that number, which is in a row of columns.
  void add(uint32_t number, const double* const (&o)[3], const double* const (&d)[3], size_t row,
           double t_min, double t_max) {
    const size_t k = count_++;
    number_[k] = number;
    for (size_t c = 0; c < 3; ++c) {
      columns_[c][k] = o[c][row];
      columns_[3 + c][k] = d[c][row];
    }
    columns_[6][k] = t_min;
    columns_[7][k] = t_max;
  }

  /// body(rays) until none waits, of which `number` has the numbers.
  template <size_t AtOnce, class Body>
  void trace(uint32_t (&number)[AtOnce], uint32_t visibility, const Opacity* opacity, Body body) {
    while (count_ > 0)
      for (size_t k = 0, count = std::exchange(count_, 0); k < count; k += AtOnce) {
        const size_t some = std::min(count - k, AtOnce);
        std::copy_n(number_.data() + k, some, number);
        const auto at = [&](size_t column) { return columns_[column] + k; };
        body(Rays{
            {at(0), at(1), at(2)}, {at(3), at(4), at(5)}, at(6), at(7), some, visibility, opacity});
      }
  }

 private:
  Columns columns_{8};
  size_t count_ = 0;
  std::vector<uint32_t> number_;
};

}  // namespace glint
