// Ambient light on surfaces that see light lower (semantics/shadows.md).
#pragma once
#include "shading/closure/distributions.h"
#include "shading/stage_terminator.h"

namespace glint {
namespace {

/// What ambient light does not bring to surfaces that see light lower. ambient: the world's.
class TakenAmbient {
 public:
  TakenAmbient(Doubles lowering, Doubles seen, const double (&ambient)[3])
      : lowering_(lowering), seen_(seen), ambient_(splat3(ambient)) {}

  /// Adds a highlight, as MicrofacetRow has it.
  void add(const Three& Tk, Doubles exponent, Doubles masking2, Doubles fresnel,
           Doubles distribution) {
    const Mask good = masking2 > 0;
    if (!any(good & nonzero(Tk))) return;
    const Three given =
        where(good, of_even_light(seen_, exponent, masking2, fresnel, distribution) * Tk);
    gloss_ = gloss_ + ambient_ * given;
    left_ = left_ + mean_lowered_gloss(lowering_, seen_, masking2) * (ambient_ * given);
  }

  /// Of what AMBIENT lobes give back.
  Three of(const Three& given) const {
    const Doubles mean = mean_lowered(lowering_);
    const auto channel = [&](Doubles all, Doubles gloss, Doubles left) {
      const Doubles whole = larger(all, gloss), rest = left + mean * (whole - gloss);
      return where(lowering_ > 1, all - all * choose(whole > 0, rest / whole, mean));
    };
    return {channel(given.x, gloss_.x, left_.x), channel(given.y, gloss_.y, left_.y),
            channel(given.z, gloss_.z, left_.z)};
  }

 private:
  Doubles lowering_, seen_;
  Three ambient_, gloss_{}, left_{};
};

}  // namespace
}  // namespace glint
