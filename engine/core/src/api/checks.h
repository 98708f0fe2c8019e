// What is checked at the API boundary, and how it is told. Comparisons are written to fail for NaN.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <string>

#include "glint.h"

namespace glint {

constexpr uint64_t kMaxCount = 0xfffffffe;       // 32-bit numbers with one value to spare
constexpr uint64_t kMaxPlacements = 0x7fffffff;  // numbered by an int32 that is -1 for none

/// Collects sentences; after 20 only their number matters.
class Report {
 public:
  void add(bool good, const char* format, ...) __attribute__((format(printf, 3, 4))) {
    if (good || ++count_ > 20) return;
    char line[256];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (!text_.empty()) text_ += '\n';
    text_ += line;
  }
  std::string text() const {
    return count_ > 20 ? text_ + "\nand " + std::to_string(count_ - 20) + " more" : text_;
  }
  bool good() const { return count_ == 0; }

 private:
  std::string text_;
  int count_ = 0;
};

using ull = unsigned long long;

/// Whether these are the bits of a finite float.
inline bool is_id(uint32_t bits) { return (bits >> 23 & 0xff) != 0xff; }
inline bool within(int32_t x, int32_t last) { return x >= 0 && x <= last; }
inline bool range(uint64_t first, uint64_t count, uint64_t size) {
  return first <= size && count <= size - first;
}
inline bool all_finite(const double* x, int count) {
  for (int i = 0; i < count; ++i)
    if (!std::isfinite(x[i])) return false;
  return true;
}

/// One more than the largest of the numbers.
inline uint64_t end_of(const uint32_t* x, uint64_t count) {
  uint32_t top = 0;
  for (uint64_t i = 0; i < count; ++i) top = std::max(top, x[i]);
  return count ? uint64_t(top) + 1 : 0;
}

// geometry_check.cpp
void check_geometry(const GlintSceneData& d, const GlintGeometry& g, ull number, Report& report);
/// Geometry and rows of every group of placements; all of them together have 32-bit numbers.
void check_placements(const GlintInstances* groups, uint64_t count, uint64_t geometry_count,
                      uint64_t row_count, Report& report);

// material_check.cpp
void check_textures(const GlintSceneData& d, Report& report);
void check_materials(const GlintSceneData& d, Report& report);
void check_media(const GlintSceneData& d, Report& report);
void check_sky(const GlintSceneData& d, Report& report);
void check_light(const GlintSceneData& d, uint64_t i, Report& report);

}  // namespace glint
