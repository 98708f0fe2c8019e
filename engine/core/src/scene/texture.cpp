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

double decoded(const double* curve, double code) {
  if (code <= kSrgbToe) return code / 12.92;
  const double at = code * kCurveSteps, first = std::floor(at);
  const double* c = curve + size_t(first);
  return c[0] + (at - first) * (c[1] - c[0]);
}

/// Keeps a coordinate where its texels are, so that its product with the size fits an integer.
double reduce(double x, int extension) {
  if (!std::isfinite(x)) return 0;
  if (extension == GLINT_REPEAT) return x - std::floor(x);
  if (extension == GLINT_MIRROR_EXTENSION) return x - 2 * std::floor(0.5 * x);
  return std::clamp(x, -2.0, 3.0);
}

/// The stored index for index i of an endless row of texels; -1 outside a clipped image. i is at
/// most one period off, as `reduce` leaves it.
int64_t wrap(int64_t i, int64_t size, int extension) {
  if (extension == GLINT_EXTEND) return std::clamp<int64_t>(i, 0, size - 1);
  if (extension == GLINT_CLIP) return i >= 0 && i < size ? i : -1;
  const int64_t period = extension == GLINT_MIRROR_EXTENSION ? 2 * size : size;
  i += i < 0 ? period : i >= period ? -period : 0;
  return i < size ? i : 2 * size - 1 - i;
}

Rgba mix(const Rgba& a, const Rgba& b, double t) {
  return {(1 - t) * a.color + t * b.color, (1 - t) * a.alpha + t * b.alpha};
}

}  // namespace

Texture::Texture(const GlintTexture& data)
    : data_(data),
      decode_(data.encoding == GLINT_SRGB && data.interpolation == GLINT_CLOSEST
                  ? srgb_codes().data()
                  : linear_codes().data()),
      curve_(data.encoding == GLINT_SRGB && data.interpolation != GLINT_CLOSEST ? srgb_curve()
                                                                                : nullptr) {}

TextureShape Texture::shape() const {
  const GlintTexture& t = data_;
  return {t.pixels, decode_, linear_codes().data(), curve_,         t.width,
          t.height, t.type,  t.extension,           t.interpolation};
}

/// The two texels next to a coordinate and the way between them.
struct Texture::Axis {
  int64_t first, second;
  double way;
};

Texture::Axis Texture::axis(double x, uint32_t size) const {
  const double at = reduce(x, data_.extension) * size;
  if (data_.interpolation == GLINT_CLOSEST)
    return {wrap(int64_t(std::floor(at)), size, data_.extension), 0, 0};
  const double first = std::floor(at - 0.5);
  return {wrap(int64_t(first), size, data_.extension),
          wrap(int64_t(first) + 1, size, data_.extension), at - 0.5 - first};
}

Rgba Texture::texel(int64_t column, int64_t row) const {
  if (column < 0 || row < 0) return {};
  const size_t at = 4 * (size_t(row) * data_.width + size_t(column));
  if (data_.type == GLINT_FLOAT32) {
    const float* p = static_cast<const float*>(data_.pixels) + at;
    return {{p[0], p[1], p[2]}, p[3]};
  }
  const uint8_t* p = static_cast<const uint8_t*>(data_.pixels) + at;
  return {{decode_[p[0]], decode_[p[1]], decode_[p[2]]}, p[3] / 255.0};
}

/// The four texels round a coordinate, with the weights of a uniform cubic B-spline.
struct Texture::CubicAxis {
  int64_t at[4];
  double weight[4];
};

Texture::CubicAxis Texture::cubic_axis(double x, uint32_t size) const {
  const double at = reduce(x, data_.extension) * size, first = std::floor(at - 0.5),
               w = at - 0.5 - first, rest = 1 - w, w2 = w * w, w3 = w2 * w;
  CubicAxis axis{
      {},
      {rest * rest * rest / 6, (3 * w3 - 6 * w2 + 4) / 6, (3 * (w2 - w3) + 3 * w + 1) / 6, w3 / 6}};
  const bool turns = data_.extension == GLINT_REPEAT || data_.extension == GLINT_MIRROR_EXTENSION;
  const int64_t period = data_.extension == GLINT_MIRROR_EXTENSION ? 2 * int64_t(size) : size;
  for (int k = 0; k < 4; ++k) {
    int64_t i = int64_t(first) + k - 1;
    if (turns) i = (i % period + period) % period;
    axis.at[k] = wrap(i, size, data_.extension);
  }
  return axis;
}

Rgba Texture::cubic(double u, double v) const {
  const CubicAxis x = cubic_axis(u, data_.width), y = cubic_axis(v, data_.height);
  Rgba sum{};
  for (int j = 0; j < 4; ++j) {
    Rgba row{};
    for (int i = 0; i < 4; ++i) {
      const Rgba t = texel(x.at[i], y.at[j]);
      row = {row.color + x.weight[i] * t.color, row.alpha + x.weight[i] * t.alpha};
    }
    sum = {sum.color + y.weight[j] * row.color, sum.alpha + y.weight[j] * row.alpha};
  }
  return sum;
}

Rgba Texture::linear(double u, double v) const {
  const Axis x = axis(u, data_.width), y = axis(v, data_.height);
  return mix(mix(texel(x.first, y.first), texel(x.second, y.first), x.way),
             mix(texel(x.first, y.second), texel(x.second, y.second), x.way), y.way);
}

Rgba Texture::lookup(double u, double v) const {
  if (data_.interpolation == GLINT_CLOSEST)
    return texel(axis(u, data_.width).first, axis(v, data_.height).first);
  Rgba found = data_.interpolation == GLINT_CUBIC ? cubic(u, v) : linear(u, v);
  if (curve_)
    found.color = {decoded(curve_, found.color.x), decoded(curve_, found.color.y),
                   decoded(curve_, found.color.z)};
  return found;
}

}  // namespace glint
