// How many words the instructions of programs have, and what each is.
#pragma once
#include <cstdint>
#include <cstring>

namespace glint {

/// outputs, arguments: widths, a digit each. settings: what each refers to, a an attribute, i an
/// image, t a table, or the largest number that it may be, counted in characters from 0 on; - is
/// any. reads_surface: knows more of the point than the ray that meets it.
struct OperationLayout {
  const char *name, *outputs, *arguments, *settings;
  bool reads_surface;
  size_t words() const {
    return 1 + std::strlen(outputs) + std::strlen(arguments) + std::strlen(settings);
  }
};

constexpr OperationLayout kLayouts[] = {
#define GLINT_OPERATION(name, outputs, arguments, settings, reads_surface) \
  {#name, outputs, arguments, settings, reads_surface},
#include "program/operations.inc"
#undef GLINT_OPERATION
};
constexpr int32_t kOperationCount = sizeof(kLayouts) / sizeof(kLayouts[0]);

}  // namespace glint
