// Camera rays, and sums on their way to the film.
#pragma once
#include "lanes.h"
#include "stages.h"

namespace glint {
namespace {

void camera(const CameraStage& c) {
  const Three mx = splat3(c.u), my = splat3(c.v), mz = splat3(c.w);
  const double* w = c.window;
  for (size_t k = 0; k < c.count; k += kLanes) {
    const Doubles i = c.first_column + load(c.column + k), j = c.first_row + load(c.row + k);
    const Doubles u = w[0] + (i + 0.5 + load(c.dx + k)) * (w[1] - w[0]) / c.width, v = w[2] + (j + 0.5 + load(c.dy + k)) * (w[3] - w[2]) / c.height;
    const Three across = u * mx + v * my;
    const Three towards = c.parallel ? -mz : across - mz, d = unit(towards);
    if (c.parallel) store3(c.o, k, splat(c.scale) * across);
    store3(c.d, k, d);
    const Doubles step = dot(towards, d) * c.scale;  // anchored length of one unit of depth along the ray
    store(c.t_min + k, c.clip_start * step * (1 - 0x1p-50));  // the bounds themselves count, the ray's interval is open
    store(c.t_max + k, c.clip_end * step * (1 + 0x1p-50));
  }
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
