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

/// Sums that no pass shows, for what is resolved: the light of catchers with all things there and
/// as if they were alone, and what they show where nothing shades them; how much of what camera
/// rays meet is asked how open it is; and of the surfaces that mirrors, and those that clear glass
/// shows, the light and the colour. What lights would give to what camera rays meet if nothing hid
/// them, matt and glossy; and what of Diffuse and Glossy Direct is not of lights there: even and
/// subsurface light, what mirrors show of what gives light. And the light of photons, which is not
/// resolved: a part of Diffuse Indirect.
enum : int {
  kCaughtLight = GLINT_PASS_COUNT,
  kCaughtAlone,
  kUnshaded,
  kUnhidden,
  kMirroredLight,
  kMirroredColor,
  kRefractedLight,
  kRefractedColor,
  kUnshadowedDiffuse,
  kUnshadowedGloss,
  kOtherDiffuse,
  kOtherGloss,
  kPhotonLight,
  kSumCount
};

}  // namespace glint
