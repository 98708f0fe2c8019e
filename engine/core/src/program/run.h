// Runs a program over a block of points, an operation at a time.
#pragma once
#include "program/machine.h"
#include "program/op_color.h"
#include "program/op_gabor.h"
#include "program/op_input.h"
#include "program/op_math.h"
#include "program/op_noise.h"
#include "program/op_pattern.h"
#include "program/op_rays.h"
#include "program/op_vector.h"
#include "program/op_voronoi.h"

namespace glint {
namespace {

struct OperationRow {
  void (*run)(const Machine&, const Operands&);
  const char *outputs, *arguments;  // widths, a digit each
  size_t settings;
};

constexpr OperationRow kOperations[] = {
#define GLINT_OPERATION(name, outputs, arguments, settings, reads_surface) \
  {op::name, outputs, arguments, sizeof(settings) - 1},
#include "program/operations.inc"
#undef GLINT_OPERATION
};

/// The operands of the instruction whose words after its code begin at `word`; leaves `word` at the
/// next instruction.
inline Operands operands(const Machine& m, const OperationRow& row, const int32_t*& word) {
  Operands at;
  for (size_t i = 0; row.outputs[i]; ++i, ++word)
    at.output[i] = *word < 0 ? nullptr : m.slots + size_t(*word) * kBlock;
  for (size_t i = 0; row.arguments[i]; ++i, ++word)
    at.argument[i] = *word < 0 ? Source{m.program.constants + size_t(~*word) * kPad, 0, kPad}
                               : Source{m.slots + size_t(*word) * kBlock, 1, kBlock};
  at.settings = word;
  word += row.settings;
  return at;
}

void run_program(const ProgramStage& s) {
  const Machine m{s.tables, *s.program, *s.points, s.kind, s.count, s.slots, s.queries};
  const int32_t* word = m.program.code;
  for (const int32_t* const end = word + m.program.words; word < end;) {
    const OperationRow& row = kOperations[*word++];
    row.run(m, operands(m, row, word));
  }
}

}  // namespace
}  // namespace glint
