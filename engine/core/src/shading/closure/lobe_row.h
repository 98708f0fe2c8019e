// A row of a lobe, as closures read it.
#pragma once
#include "shading/stages.h"
#include "simd/lanes.h"

namespace glint {
namespace {

/// Row `number` of a kind at group k of points. Columns are those of the kind's row (rows.h).
class LobeRow {
 public:
  LobeRow(const LitPoints& s, size_t k, int kind, int number)
      : first_(s.lobes.columns + size_t(s.lobes.layout->row(kind, number)) * s.lobes.stride + k),
        stride_(s.lobes.stride) {}
  Doubles number(int column) const { return load(first_ + size_t(column) * stride_); }
  Three three(int column) const { return {number(column), number(column + 1), number(column + 2)}; }
  Three k() const { return three(0); }

 private:
  const double* first_;
  size_t stride_;
};

}  // namespace
}  // namespace glint
