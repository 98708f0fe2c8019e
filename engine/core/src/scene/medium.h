// What light passes through, and what encloses it.
#pragma once
#include <cstdint>

#include "math/vec.h"

namespace glint {

/// As GlintMedium has it, for lengths of anchored space.
struct Medium {
  Vec3d extinction, scattering, emission;
  double anisotropy = 0;
};

/// An instance with a medium inside, of which nothing is beyond the box.
struct Enclosure {
  uint32_t instance, medium;
  Vec3d low, high;
};

}  // namespace glint
