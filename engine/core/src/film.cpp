#include "film.h"

#include <cstring>
#include <limits>

namespace glint {
namespace {

constexpr double kNoDepth = 1e10;

/// Largest finite floats stand for what does not fit, 0 for infinity minus infinity.
float to_float(double x) {
  constexpr double top = std::numeric_limits<float>::max();
  return std::isnan(x) ? 0 : float(std::clamp(x, -top, top));
}

}  // namespace

int channels_of(int pass) {
  if (pass < 0 || pass >= GLINT_PASS_COUNT) return 0;
  if (pass == GLINT_PASS_COMBINED) return 4;
  return pass == GLINT_PASS_DEPTH || pass == GLINT_PASS_OBJECT_INDEX || pass == GLINT_PASS_MATERIAL_INDEX ? 1 : 3;
}

Film::Film(Region region, uint32_t passes) : region_(region), passes_(passes | 1u << GLINT_PASS_COMBINED) {
  for (int part = 0; part < GLINT_PASS_DEPTH; ++part) at_[part] = -1;
  at_[GLINT_PASS_COMBINED] = 0;
  for (int part = GLINT_PASS_DIFFUSE; part < GLINT_PASS_DEPTH; ++part)
    if (wants(part)) at_[part] = int(stride_), stride_ += 3;
  size_t pixels = size_t(region.width()) * region.height();
  sums_.assign(pixels * stride_, 0.0);
  for (int pass = 0; pass < GLINT_PASS_COUNT; ++pass)
    if (wants(pass)) pictures_[pass].assign(pixels * size_t(channels_of(pass)), pass == GLINT_PASS_DEPTH ? float(kNoDepth) : 0.0f);
}

void Film::store(int pass, uint32_t pixel, const double* values) {
  int count = channels_of(pass);
  if (!wants(pass)) return;
  for (int i = 0; i < count; ++i) pictures_[pass][size_t(pixel) * size_t(count) + size_t(i)] = to_float(values[i]);
}

void Film::set_data(uint32_t pixel, const FirstHit& hit) {
  double object = hit.object, material = hit.material;
  store(GLINT_PASS_DEPTH, pixel, &hit.depth);
  store(GLINT_PASS_POSITION, pixel, &hit.position.x);
  store(GLINT_PASS_NORMAL, pixel, &hit.normal.x);
  store(GLINT_PASS_UV, pixel, &hit.uv.x);
  store(GLINT_PASS_OBJECT_INDEX, pixel, &object);
  store(GLINT_PASS_MATERIAL_INDEX, pixel, &material);
}

void Film::publish(uint32_t samples) {
  size_t pixels = size_t(region_.width()) * region_.height();
  for (int pass = 0; pass < GLINT_PASS_DEPTH; ++pass) {
    if (at_[pass] < 0) continue;
    float* out = pictures_[pass].data();
    bool combined = pass == GLINT_PASS_COMBINED;
    for (size_t k = 0; k < pixels; ++k) {
      const double* p = sums_.data() + k * stride_ + at_[pass];
      for (int i = 0; i < 3; ++i) *out++ = to_float(p[i] / samples);
      if (combined) *out++ = to_float(1 - p[3] / samples);
    }
  }
}

bool Film::read(int pass, float* out, uint64_t size) const {
  if (pass < 0 || pass >= GLINT_PASS_COUNT || !out) return false;
  const std::vector<float>& picture = pictures_[pass];
  if (picture.empty() || picture.size() != size) return false;
  std::memcpy(out, picture.data(), size * sizeof(float));
  return true;
}

}  // namespace glint
