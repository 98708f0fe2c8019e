// Camera rays, and sums on their way to the film.
#pragma once
#include "shading/panorama.h"
#include "shading/stages.h"
#include "simd/lanes.h"

namespace glint {
namespace {

/// Where a ray of the camera begins, and where it goes.
struct CameraRay {
  Three o, d;  // d: unit
};

/// From an eye that stands aside of every direction; to the right of the camera where it is up.
inline CameraRay from_eye(const GlintCamera& c, const Three& up, const Three& right,
                          const CameraRay& ray) {
  const Three side = cross(ray.d, up);
  Doubles offset = splat(c.eye_offset);
  if (c.pole_merge[1] > 0) {
    constexpr double quarter = 1.57079632679489661923;
    const Doubles elevation = magnitude(asin(larger(smaller(dot(up, ray.d), splat(1)), splat(-1))));
    const Doubles share = (elevation - c.pole_merge[0]) / (c.pole_merge[1] - c.pole_merge[0]);
    const Doubles faded = offset * cos(quarter * smaller(larger(share, splat(0)), splat(1)));
    offset =
        where(elevation <= c.pole_merge[1], choose(elevation > c.pole_merge[0], faded, offset));
  }
  const Three aside = offset * unit(choose(nonzero(side), side, right));
  return {ray.o + aside, unit(ray.d - splat(1 / c.convergence) * aside)};
}

template <bool HasLens, bool Moves, bool HasEye>
void camera_of(const CameraStage& c) {
  Three mx = splat3(c.u), my = splat3(c.v), mz = splat3(c.w);
  Doubles latest{}, earliest = splat(__builtin_inf());
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
    if (HasEye && !HasLens) across = Three{};
    if constexpr (Moves) {
      const Three away = column(k, 3) - splat3(c.origin);
      across = c.parallel || HasLens ? across + away : away;
    }
    CameraRay ray{across, d};
    if constexpr (HasEye) ray = from_eye(*c.eye, splat3(c.eye->eye_up), mx, ray);
    if (Moves || HasLens || HasEye || c.parallel) store3(c.o, k, splat(c.scale) * ray.o);
    store3(c.d, k, ray.d);
    const Doubles step =
        dot(towards, d) * c.scale;  // anchored length of one unit of depth along the ray
    // The bounds themselves count, the ray's interval is open.
    const Doubles t_min = c.clip_start * step * (1 - 0x1p-50),
                  t_max = c.clip_end * step * (1 + 0x1p-50);
    store(c.t_min + k, t_min);
    store(c.t_max + k, t_max);
    latest = larger(t_min, latest);
    earliest = smaller(t_max, earliest);
  }
  *c.latest = latest[0];
  *c.earliest = earliest[0];
  for (int j = 1; j < kLanes; ++j) {
    *c.latest = latest[j] > *c.latest ? latest[j] : *c.latest;
    *c.earliest = earliest[j] < *c.earliest ? earliest[j] : *c.earliest;
  }
}

/// Through the point (x, y) of a lens across the ray, sharp at the distance of its focus.
inline CameraRay through_lens(const Three& d, Doubles x, Doubles y, double bend) {
  const Three forward = {splat(0), splat(0), splat(-1)}, across = forward + d.z * d;
  const Three towards = unit(choose(nonzero(across), across, {splat(0), splat(1), splat(0)}));
  const Three o = x * towards + y * unit(cross(d, towards));
  return {o, unit(d - splat(bend) * o)};
}

void panorama(const CameraStage& c) {
  const GlintCamera& view = *c.panorama;
  Three mx = splat3(c.u), my = splat3(c.v), mz = splat3(c.w);
  const bool moves = c.frame[0], beside = c.lens_x || c.eye;
  const auto column = [&](size_t k, size_t number) {
    return Three{load(c.frame[number] + k), load(c.frame[number + 4] + k),
                 load(c.frame[number + 8] + k)};
  };
  const auto world = [&](const Three& p) { return p.x * mx + p.y * my + p.z * mz; };
  for (size_t k = 0; k < c.count; k += kLanes) {
    const Look look = sound_look_of(view, load(c.across + k), load(c.upward + k));
    CameraRay ray{{splat(0), splat(0), splat(0)}, look.d};
    if (c.lens_x) ray = through_lens(look.d, load(c.lens_x + k), load(c.lens_y + k), c.bend);
    if (c.eye)
      ray = from_eye(view, {splat(0), splat(1), splat(0)}, {splat(1), splat(0), splat(0)}, ray);
    if (moves) {
      mx = column(k, 0);
      my = column(k, 1);
      mz = column(k, 2);
    }
    Three o = world(ray.o);
    if (moves) o = o + (column(k, 3) - splat3(c.origin));
    if (moves || beside) store3(c.o, k, splat(c.scale) * o);
    const Three towards = world(ray.d), d = unit(towards);
    store3(c.d, k, d);
    const Doubles step = dot(towards, d) * c.scale;  // anchored length of one unit of distance
    store(c.t_min + k, c.clip_start * step * (1 - 0x1p-50));
    store(c.t_max + k, choose(look.seen, c.clip_end * step * (1 + 0x1p-50), splat(-1)));
  }
}

void camera(const CameraStage& c) {
  if (c.panorama) return panorama(c);
  const auto choose_of = [&](auto has_eye) {
    constexpr bool kEye = decltype(has_eye)::value;
    if (c.frame[0]) c.lens_x ? camera_of<true, true, kEye>(c) : camera_of<false, true, kEye>(c);
    else c.lens_x ? camera_of<true, false, kEye>(c) : camera_of<false, false, kEye>(c);
  };
  c.eye ? choose_of(std::true_type{}) : choose_of(std::false_type{});
}

void add(double* to, const double* from, size_t count) {
  for (size_t k = 0; k < count; k += kLanes) store(to + k, load(to + k) + load(from + k));
}

void mean(const double* sums, double samples, float* out, size_t count) {
  constexpr double top = 3.4028234663852886e38;
  for (size_t k = 0; k < count; k += kLanes) {
    const Doubles x = load(sums + k) / samples;
    narrow(out + k, where(x == x, smaller(larger(x, splat(-top)), splat(top))));
  }
}

}  // namespace
}  // namespace glint
