// Rays without a picture: the accelerator behind the C API, in world space and in the caller's
// arrays.
#pragma once
#include <memory>
#include <string>

#include "bvh/accel.h"
#include "glint.h"
#include "scene/scene.h"

namespace glint {

/// What is wrong with the tables and arrays, one sentence a line; empty when they are sound.
std::string accel_problems(const GlintAccelData& data);

/// The same for GlintRaysF32 and GlintRaysF64.
template <class Rays>
std::string rays_problems(const Rays& rays);

}  // namespace glint

struct GlintAccel {
  glint::Anchor anchor;
  GlintAccelStats stats{};
  std::unique_ptr<glint::Accel> accel;

  /// `data` has no problems.
  GlintAccel(const GlintAccelData& data, glint::BuildQuality quality, uint32_t threads);
};
