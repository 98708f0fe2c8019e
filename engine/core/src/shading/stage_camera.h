// Camera rays, and sums on their way to the film.
#pragma once
#include "shading/stages.h"
#include "simd/lanes.h"

namespace glint {
namespace {

template <bool HasLens, bool Moves>
void camera_of(const CameraStage& c) {
  Three mx = splat3(c.u), my = splat3(c.v), mz = splat3(c.w);
  const auto column = [&](size_t k, size_t number) {
    return Three{load(c.frame[number] + k), load(c.frame[number + 4] + k),
                 load(c.frame[number + 8] + k)};
  };
  for (size_t k = 0; k < c.count; k += kLanes) {
    if constexpr (Moves) {
      mx = column(k, 0);
      my = column(k, 1);
      mz = column(k, 2);
    }
    Three across = load(c.across + k) * mx + load(c.upward + k) * my;
    Three towards = c.parallel ? -mz : across - mz;
    if constexpr (HasLens) {
      const Three beside = load(c.lens_x + k) * mx + load(c.lens_y + k) * my;
      towards = towards - splat(c.bend) * beside;
      across = c.parallel ? across + beside : beside;
    }
    const Three d = unit(towards);
    if constexpr (Moves) {
      const Three away = column(k, 3) - splat3(c.origin);
      across = c.parallel || HasLens ? across + away : away;
    }
    if (Moves || HasLens || c.parallel) store3(c.o, k, splat(c.scale) * across);
    store3(c.d, k, d);
    const Doubles step =
        dot(towards, d) * c.scale;  // anchored length of one unit of depth along the ray
    store(c.t_min + k,
          c.clip_start * step *
              (1 - 0x1p-50));  // the bounds themselves count, the ray's interval is open
    store(c.t_max + k, c.clip_end * step * (1 + 0x1p-50));
  }
}

void camera(const CameraStage& c) {
  if (c.frame[0]) c.lens_x ? camera_of<true, true>(c) : camera_of<false, true>(c);
  else c.lens_x ? camera_of<true, false>(c) : camera_of<false, false>(c);
}

void add(double* to, const double* from, size_t count) {
  for (size_t k = 0; k < count; k += kLanes) store(to + k, load(to + k) + load(from + k));
}

void mean(const double* sums, double samples, float* out, size_t count) {
  constexpr double top = 3.4028234663852886e38;
  for (size_t k = 0; k < count; k += kLanes) {
    const Doubles x = load(sums + k) / samples;
    store(out + k, where(x == x, smaller(larger(x, splat(-top)), splat(top))));
  }
}

}  // namespace
}  // namespace glint
