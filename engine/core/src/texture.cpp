#include "texture.h"

#include <array>

#include "math.h"

namespace glint {
namespace {

/// The sRGB curve (IEC 61966-2-1) of the 256 codes.
const std::array<double, 256>& srgb_table() {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> t;
    for (int i = 0; i < 256; ++i) {
      double c = i / 255.0;
      t[size_t(i)] = c <= 0.04045 ? c / 12.92 : exponential(2.4 * logarithm((c + 0.055) / 1.055));
    }
    return t;
  }();
  return table;
}

/// Keeps a coordinate where its texels are, so that its product with the size fits an integer.
double reduce(double x, int extension) {
  if (!std::isfinite(x)) return 0;
  if (extension == GLINT_REPEAT) return x - std::floor(x);
  if (extension == GLINT_MIRRORED) return x - 2 * std::floor(0.5 * x);
  return std::clamp(x, -2.0, 3.0);
}

/// The stored index for index i of an endless row of texels; -1 outside a clipped image.
int64_t wrap(int64_t i, int64_t size, int extension) {
  if (extension == GLINT_EXTEND) return std::clamp<int64_t>(i, 0, size - 1);
  if (extension == GLINT_CLIP) return i >= 0 && i < size ? i : -1;
  int64_t period = extension == GLINT_MIRRORED ? 2 * size : size;
  i = ((i % period) + period) % period;
  return i < size ? i : 2 * size - 1 - i;
}

Rgba mix(const Rgba& a, const Rgba& b, double t) { return {(1 - t) * a.color + t * b.color, (1 - t) * a.alpha + t * b.alpha}; }

}  // namespace

Rgba Texture::texel(int64_t column, int64_t row) const {
  column = wrap(column, data_.width, data_.extension), row = wrap(row, data_.height, data_.extension);
  if (column < 0 || row < 0) return {};
  size_t at = 4 * (size_t(row) * data_.width + size_t(column));
  if (data_.type == GLINT_FLOAT32) {
    const float* p = static_cast<const float*>(data_.pixels) + at;
    return {{p[0], p[1], p[2]}, p[3]};
  }
  const uint8_t* p = static_cast<const uint8_t*>(data_.pixels) + at;
  if (data_.encoding == GLINT_LINEAR_ENCODING) return {{p[0] / 255.0, p[1] / 255.0, p[2] / 255.0}, p[3] / 255.0};
  const std::array<double, 256>& t = srgb_table();
  return {{t[p[0]], t[p[1]], t[p[2]]}, p[3] / 255.0};
}

Rgba Texture::lookup(double u, double v) const {
  double x = reduce(u, data_.extension) * data_.width, y = reduce(v, data_.extension) * data_.height;
  if (data_.interpolation == GLINT_CLOSEST) return texel(int64_t(std::floor(x)), int64_t(std::floor(y)));
  double left = std::floor(x - 0.5), below = std::floor(y - 0.5), s = x - 0.5 - left, t = y - 0.5 - below;
  int64_t i = int64_t(left), j = int64_t(below);
  return mix(mix(texel(i, j), texel(i + 1, j), s), mix(texel(i, j + 1), texel(i + 1, j + 1), s), t);
}

}  // namespace glint
