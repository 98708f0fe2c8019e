// Sets of passes, a bit each.
#pragma once
#include <cstdint>

#include "glint.h"

namespace glint {

using Passes = uint64_t;
constexpr Passes pass_bit(int pass) { return Passes(1) << pass; }

/// Light by the kind of surface that gives it back first, and what of it this does.
constexpr int kFirstLighting = GLINT_PASS_DIFFUSE_DIRECT,
              kLastLighting = GLINT_PASS_VOLUME_INDIRECT;
constexpr Passes kLightingPasses = pass_bit(kLastLighting + 1) - pass_bit(kFirstLighting);

/// Sums that no pass shows, which light is resolved over: what catchers show where nothing shades
/// them, and how much of what camera rays meet is asked how open it is.
enum : int { kCaughtColor = GLINT_PASS_COUNT, kOpenColor, kSumCount };

}  // namespace glint
