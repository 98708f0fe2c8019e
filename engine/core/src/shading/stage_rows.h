// Groups of rows out of columns, and rows at the end of columns.
#pragma once
#include "simd/lanes.h"

namespace glint {
namespace {

/// The rows of a group of points.
struct Chosen {
  size_t count;
  uint32_t row[kLanes];
  bool together = false;  // rows that follow each other, in all lanes
};

/// The group that begins at number i of a list of rows; lanes beyond its end repeat row i.
inline Chosen chosen(const uint32_t* rows, size_t i, size_t count) {
  Chosen at{count - i < kLanes ? count - i : kLanes, {}};
  for (size_t lane = 0; lane < kLanes; ++lane) at.row[lane] = rows[lane < at.count ? i + lane : i];
  at.together = at.row[kLanes - 1] - at.row[0] == kLanes - 1;
  return at;
}

inline uint32_t lanes_of(const Chosen& at) { return (1u << at.count) - 1; }

inline Doubles gather(const double* column, const Chosen& at) {
  if (at.together) return load(column + at.row[0]);
  return each_lane([&](size_t lane) { return column[at.row[lane]]; });
}
inline Mask gather(const int64_t* column, const Chosen& at) {
  if (at.together) return load(column + at.row[0]);
  return each_lane<Mask>([&](size_t lane) { return column[at.row[lane]]; });
}
__attribute__((always_inline)) inline Three gather3(const double* const (&columns)[3],
                                                    const Chosen& at) {
  return {gather(columns[0], at), gather(columns[1], at), gather(columns[2], at)};
}
inline Three gather3(const double* column, size_t stride, const Chosen& at) {
  return {gather(column, at), gather(column + stride, at), gather(column + 2 * stride, at)};
}
inline void scatter(double* column, const Chosen& at, Doubles v) {
  if (at.together) return store(column + at.row[0], v);
  for (size_t lane = 0; lane < at.count; ++lane) column[at.row[lane]] = v[lane];
}
inline void scatter3(double* const (&columns)[3], const Chosen& at, const Three& v) {
  scatter(columns[0], at, v.x);
  scatter(columns[1], at, v.y);
  scatter(columns[2], at, v.z);
}
__attribute__((always_inline)) inline void scatter3(double* column, size_t stride, const Chosen& at,
                                                    const Three& v) {
  scatter(column, at, v.x);
  scatter(column + stride, at, v.y);
  scatter(column + 2 * stride, at, v.z);
}

/// Numbers of some lanes go to the end of columns.
struct Appender {
  uint32_t lanes;
  size_t at;
  template <class Number, class Vector>
  __attribute__((always_inline)) void operator()(Number* column, Vector v) const {
    if (lanes == kAllLanes) return store(column + at, v);
    size_t to = at;
    for (uint32_t m = lanes; m; m &= m - 1) column[to++] = v[__builtin_ctz(m)];
  }
  __attribute__((always_inline)) void operator()(double* const (&columns)[3],
                                                 const Three& v) const {
    (*this)(columns[0], v.x);
    (*this)(columns[1], v.y);
    (*this)(columns[2], v.z);
  }
  __attribute__((always_inline)) void operator()(double* column, size_t stride,
                                                 const Three& v) const {
    (*this)(column, v.x);
    (*this)(column + stride, v.y);
    (*this)(column + 2 * stride, v.z);
  }
  void number(uint32_t* column, uint32_t first) const {
    size_t to = at;
    for (uint32_t m = lanes; m; m &= m - 1) column[to++] = first + uint32_t(__builtin_ctz(m));
  }
};

}  // namespace
}  // namespace glint
