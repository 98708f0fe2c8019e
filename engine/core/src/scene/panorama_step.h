// How far shifted reads of programs go in panoramas.
#pragma once
#include "glint.h"

namespace glint {

/// A tenth of a pixel in the middle of a panorama, at the distance 1; where nothing is seen there,
/// of a whole turn's pixel.
double panorama_step(const GlintCamera& camera);

}  // namespace glint
