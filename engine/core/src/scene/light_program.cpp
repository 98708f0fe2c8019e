#include "scene/light_program.h"

#include <cmath>
#include <limits>

#include "scene/scene.h"

namespace glint {
namespace {

/// Outward on a ball; where a point stands for it, or a disc that faces whoever looks, to him.
Vec3d normal_of(const Light& light, Vec3d d, Vec3d end) {
  if (light.kind == GLINT_AREA) return light.axis;
  const Vec3d out = end - light.center;
  const bool ball = !light.endless() && !(light.flags & GLINT_SOFT_FALLOFF) && any(out);
  return ball ? unit(out) : -d;
}

}  // namespace

void LightProgram::put(const Light& light, size_t i, Vec3d from, Vec3d d, Vec3d end) {
  const Anchor& anchor = scene_.anchor;
  const Vec3d x = light.endless() ? anchor.point(-d) : end, n = normal_of(light, d, end);
  for (int c = 0; c < 3; ++c) {
    points_.x[c][i] = x[c];
    points_.g[c][i] = n[c];
    points_.n[c][i] = n[c];
    points_.d[c][i] = d[c];
  }
  points_.outside[i] = -1;
  points_.length[i] = light.endless() ? double(std::numeric_limits<float>::max())
                                      : length(end - from) / anchor.scale;
}

void LightProgram::run(const Light& light, RayKind kind, size_t count) {
  slots_.resize(size_t(scene_.programs.most_slots) * kBlock);
  InputTables tables = scene_.input_tables();
  tables.instances = &light.space;  // number 0, as all points have it
  stages_.program({tables, light.program, &points_, kind, count, slots_.data(), nullptr});
}

Vec3d LightProgram::share(const Light& light, size_t i) const {
  const auto channel = [&](size_t c) {
    const double value = slots_[light.slot + c * kBlock + i];
    return std::isfinite(value) ? value : 0;
  };
  return {channel(0), channel(1), channel(2)};
}

}  // namespace glint
