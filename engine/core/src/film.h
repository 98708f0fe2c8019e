// Sums of samples per pixel, and the picture they make after each wave.
#pragma once
#include <cstdint>
#include <vector>

#include "../include/glint.h"
#include "vec.h"

namespace glint {

struct Region {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  uint32_t width() const { return x1 - x0; }
  uint32_t height() const { return y1 - y0; }
};

/// What the data passes hold of a camera ray's first sample.
struct FirstHit {
  double depth = 0;
  Vec3d position, normal, uv;
  int32_t object = 0, material = 0;
};

/// Channels of a pass, 0 for no such pass.
int channels_of(int pass);

class Film {
 public:
  Film(Region region, uint32_t passes);

  bool wants(int pass) const { return passes_ >> pass & 1; }
  bool wants_data() const { return passes_ >> GLINT_PASS_DEPTH; }
  bool wants_light_parts() const { return wants(GLINT_PASS_DIFFUSE) || wants(GLINT_PASS_SPECULAR) || wants(GLINT_PASS_SHADOW); }

  /// Adds to Combined and to the part. One thread a pixel; the order of calls for a pixel is part of the picture's bits.
  void add(uint32_t pixel, int part, Vec3d c) { add_only(pixel, GLINT_PASS_COMBINED, c), add_only(pixel, part, c); }
  void add_only(uint32_t pixel, int pass, Vec3d c) {
    int at = at_[pass];
    if (at < 0) return;
    double* p = sums_.data() + size_t(pixel) * stride_ + at;
    p[0] += c.x, p[1] += c.y, p[2] += c.z;
  }
  void lose_alpha(uint32_t pixel, double amount) { sums_[size_t(pixel) * stride_ + 3] += amount; }
  void set_data(uint32_t pixel, const FirstHit& hit);

  /// Makes the sums of `samples` samples the picture that `read` gives.
  void publish(uint32_t samples);
  /// False when the pass was not asked for or the size differs.
  bool read(int pass, float* out, uint64_t size) const;

 private:
  void store(int pass, uint32_t pixel, const double* values);

  Region region_;
  uint32_t passes_;
  size_t stride_ = 4;            // doubles a pixel: Combined's colour, lost alpha, then three for each part
  int at_[GLINT_PASS_DEPTH];     // where a part starts, -1 for none
  std::vector<double> sums_;
  std::vector<float> pictures_[GLINT_PASS_COUNT];
};

}  // namespace glint
