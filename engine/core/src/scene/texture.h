// Image lookup: four neighbours, sixteen or the closest texel. The codes of sRGB bytes are filtered
// as they are, and the curve is undone afterwards, as in Cycles.
#pragma once
#include "glint.h"
#include "math/vec.h"
#include "shading/stages.h"

namespace glint {

struct Rgba {
  Vec3d color;
  double alpha = 0;
};

class Texture {
 public:
  explicit Texture(const GlintTexture& data);
  /// At (u, v) of the unit square, texel centres at (i + 0.5) / width. A coordinate that is not
  /// finite reads as 0.
  Rgba lookup(double u, double v) const;
  /// The same for the stages.
  TextureShape shape() const;

 private:
  struct Axis;
  Axis axis(double x, uint32_t size) const;
  struct CubicAxis;
  CubicAxis cubic_axis(double x, uint32_t size) const;
  Rgba linear(double u, double v) const;
  Rgba cubic(double u, double v) const;
  Rgba texel(int64_t column, int64_t row) const;

  GlintTexture data_;
  const double* decode_;  // colours of the codes of a uint8 image, as they are filtered
  const double* curve_;   // of filtered colours, null for none
};

}  // namespace glint
