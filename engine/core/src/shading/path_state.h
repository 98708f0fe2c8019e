// What path_state.inc is made into: columns of rays, and the bits of their tags. Plain data only:
// nothing here may emit code.
#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace glint {

/// Of as many numbers a row as `width`.
template <int width>
using Column = std::conditional_t<width == 1, double*, double* [width]>;

/// Rays of a queue.
struct RayColumns {
#define RAY_COLUMN(name, width, first, kept) Column<width> name;
#include "shading/path_state.inc"
  int64_t* tags;  // RayTag
};

/// The points where rays end; null where nothing needs a column.
struct PointColumns {
#define POINT_COLUMN(name, width, needed, zeroed) Column<width> name;
#define POINT_NUMBERS(type, name) type* name;
#include "shading/path_state.inc"
};

struct ClosureColumns {
#define CLOSURE_COLUMN(name, width, needed, zeroed) Column<width> name;
#include "shading/path_state.inc"
  int passing_columns;  // PassingTerm's
  size_t stride;        // from a column of `specular` or `passing` to the next
};

/// What stages read and write of a batch.
struct BatchColumns : RayColumns, PointColumns, ClosureColumns {};

/// Sums of a batch, a column a channel; null where a part was not asked for. total: Combined.
struct SumColumns {
#define SUM_COLUMN(name, pass, needed, beyond) Column<3> name;
#include "shading/path_state.inc"
};

/// The end of a queue that has room for what is added.
struct RayEnd : RayColumns {
  size_t* size;
};

/// What a ray carries beside its columns.
struct PathBits {
#define PATH_BITS(name, constant, bits) uint64_t name : bits = 0;
#include "shading/path_state.inc"
};

/// Those from one to another.
constexpr int64_t bit_range(int first, int last) {
  return int64_t(~uint64_t(0) >> (63 - last) & ~uint64_t(0) << first);
}

/// Where these are in the ray's tag.
struct TagPlaces {
  enum : int {
#define PATH_BITS(name, constant, bits) constant, constant##Last = constant + bits - 1,
#include "shading/path_state.inc"
    kBits
  };
};
static_assert(TagPlaces::kBits == 64 && sizeof(PathBits) == 8);

struct RayTag {
#define PATH_BITS(name, constant, bits) \
  static constexpr int constant = TagPlaces::constant, constant##Last = TagPlaces::constant##Last;
#include "shading/path_state.inc"
  static constexpr int64_t kWants = bit_range(kWantsData, kWantsAovs);
  /// What rays keep of those that they come from.
  static constexpr int64_t kPast = bit_range(kSlot, kSlotLast) | bit_range(kWidth, kTransmitted);
  static constexpr int64_t kAllRefractions = bit_range(kRefractions, kRefractionsLast),
                           kMostRefractions = kAllRefractions >> kRefractions,
                           kGlass = bit_range(kRefracted, kRefractionsLast);
};

}  // namespace glint
