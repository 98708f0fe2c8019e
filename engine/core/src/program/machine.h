// What the operations of programs (op_*.h) are written in: they take their arguments and give their
// outputs a group of lanes at a time.
#pragma once
#include "program/program.h"
#include "shading/stage_inputs.h"
#include "simd/lanes.h"

namespace glint {
namespace {

/// A program at work on a block of points. slots: kBlock numbers each.
struct Machine {
  const InputTables& tables;
  const ProgramShape& program;
  const ProgramPoints& points;
  RayKind kind;
  size_t count;
  double* slots;
  const RayQueries* queries;
};

/// Where an argument is: numbers of one point after the other, or a constant for all (step 0).
struct Source {
  const double* at;
  size_t step, stride;  // stride: between the parts of a vector
};

/// The arguments, outputs and settings of one instruction, in the table's order.
struct Operands {
  static constexpr size_t kMostArguments = 16, kMostOutputs = 6;
  Source argument[kMostArguments];
  double* output[kMostOutputs];  // null: nobody reads it
  const int32_t* settings;

  Doubles number(size_t i, size_t k) const { return load(argument[i].at + argument[i].step * k); }
  Three vector(size_t i, size_t k) const {
    const Source& s = argument[i];
    const double* p = s.at + s.step * k;
    return {load(p), load(p + s.stride), load(p + 2 * s.stride)};
  }
  bool wants(size_t i) const { return output[i] != nullptr; }
  void put(size_t i, size_t k, Doubles v) const {
    if (output[i]) store(output[i] + k, v);
  }
  void put(size_t i, size_t k, const Three& v) const {
    put(i, k, v.x);
    if (!output[i]) return;
    store(output[i] + kBlock + k, v.y);
    store(output[i] + 2 * kBlock + k, v.z);
  }
};

/// body(k) for the first lane k of each group.
template <class Body>
inline void each_group(const Machine& m, Body body) {
  for (size_t k = 0; k < m.count; k += kLanes) body(k);
}

}  // namespace
}  // namespace glint
