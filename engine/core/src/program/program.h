// Programs as the stages run them (engine/program/program.py has the format). Plain data.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace glint {

/// Points that a program runs over at once: their slots stay in the second-level cache.
constexpr size_t kBlock = 64;

/// Settings that refer to something: an attribute's name as GlintAttribute has it (-1: the active
/// UV map), a texture's number, the place in `tables` of a table: how many numbers, and these.
struct ProgramShape {
  const int32_t* code;
  size_t words;
  const double* constants;  // kPad of each
  const double* tables;
  uint32_t slots;
};

/// The points, a number a point. Those beyond the last repeat one before.
struct ProgramPoints {
  uint32_t instance[kBlock], primitive[kBlock];
  double weights[3][kBlock];  // barycentric, of meshes
};

/// Constants as programs read them.
std::vector<double> spread_constants(const double* constants, size_t count);

}  // namespace glint
