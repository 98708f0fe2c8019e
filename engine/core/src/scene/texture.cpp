#include "scene/texture.h"

#include <array>

#include "math/math.h"

namespace glint {
namespace {

using Codes = std::array<double, 256>;

const Codes& linear_codes() {
  static const Codes codes = [] {
    Codes t;
    for (int i = 0; i < 256; ++i) t[size_t(i)] = i / 255.0;
    return t;
  }();
  return codes;
}

/// The sRGB curve (IEC 61966-2-1).
double linear_of(double code) {
  return code <= kSrgbToe ? code / 12.92 : exponential(2.4 * logarithm((code + 0.055) / 1.055));
}

const Codes& srgb_codes() {
  static const Codes codes = [] {
    Codes t;
    for (int i = 0; i < 256; ++i) t[size_t(i)] = linear_of(i / 255.0);
    return t;
  }();
  return codes;
}

/// At k / kCurveSteps; linear in between it is off by 2e-8.
const double* srgb_curve() {
  static const std::array<double, kCurveSteps + 2> curve = [] {
    std::array<double, kCurveSteps + 2> t;
    for (size_t i = 0; i < t.size(); ++i)
      t[i] = exponential(2.4 * logarithm((double(i) / kCurveSteps + 0.055) / 1.055));
    return t;
  }();
  return curve.data();
}

}  // namespace

TextureShape shape_of(const GlintTexture& t) {
  const bool is_srgb = t.encoding == GLINT_SRGB, is_filtered = t.interpolation != GLINT_CLOSEST;
  const double* const linear = linear_codes().data();
  return {t.pixels,       is_srgb && !is_filtered ? srgb_codes().data() : linear,
          linear,         is_srgb && is_filtered ? srgb_curve() : nullptr,
          t.width,        t.height,
          t.type,         t.extension,
          t.interpolation};
}

}  // namespace glint
