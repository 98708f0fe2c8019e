// One sample of one light as points see it, by the light's shape (notes 4.15, 4.16, light.h).
// Letters: x point, l direction to the light, d distance, z cosine at the light.
#pragma once
#include "shading/stage_rectangle.h"
#include "shading/stage_sky.h"

namespace glint {
namespace {

/// The sample as points see it: unit direction l, intensity color * factor, where the shadow
/// segment ends, one over the density of the samples (a steradian) there, and where all this is
/// sound.
struct Sample {
  Three l, end;
  Doubles factor, spread;
  Mask good;
};

/// kOpenSky: its color is in place of the stage's.
struct SkySample : Sample {
  Three color;
};

/// 1 / (4 pi^2 d^2) in world units from the squared anchored distance.
inline Doubles inverse_square(const LightStage& s, Doubles d2) {
  return smaller(s.scale2 / ((4 * kCircle * kCircle) * d2), splat(1e100));
}

/// The share of a spot's intensity at the cosine z from its axis.
inline Doubles spot(const LightStage& s, const Three& l) {
  const Doubles z = -dot(l, splat3(s.axis));
  if (!(s.spot_width > 0)) return where(z > s.spot_cosine, splat(1));
  const Doubles t = smaller(larger((z - s.spot_cosine) / s.spot_width, splat(0)), splat(1));
  return t * t * (3 - 2 * t);
}

/// What an area light with a spread shines in the direction that is seen as l: what its slats let
/// through.
inline Doubles between_slats(const LightStage& s, const Three& l) {
  const Three axis = splat3(s.axis);
  const Doubles z = -dot(l, axis), tangent = length(l + z * axis) / z;
  return larger(s.tan_spread - tangent, splat(0)) * s.even_spread;
}

/// The direction at the disc point of the cone round `axis` with 1 - cos(half angle) = versine,
/// uniform in solid angle.
inline Three in_cone(const LightStage& s, const Three& axis, Doubles versine) {
  Three t1, t2;
  frame(axis, t1, t2);
  const Doubles cosine = 1 - (s.x * s.x + s.y * s.y) * versine;
  const Doubles sine = root(larger(versine * (1 + cosine), splat(0)));  // over the disc's radius
  return unit(cosine * axis + sine * (splat(s.x) * t1 + splat(s.y) * t2));
}

inline Sample sample_direction(const LightStage& s, const Three&) {
  return {splat3(s.l), splat3(s.l), splat(s.factor), splat(s.spread), ~Mask{}};
}

/// The balance heuristic of directions and points on openings.
inline void beside_openings(const LightStage& s, const Three& x, Sample& sample) {
  const Doubles less = 1 + opening_density(*s.openings, x, sample.l) * sample.spread;
  sample.factor = sample.factor / less;
  sample.spread = sample.spread / less;
}

inline SkySample open_sky_at(const LightStage& s, const Three& x, const Three& l) {
  const SkyCell cell = sky_cell(*s.dome, l);
  SkySample sample{{l, l, s.factor * cell.spread, cell.spread, ~Mask{}}, cell.color};
  beside_openings(s, x, sample);
  return sample;
}

inline SkySample sample_open_sky(const LightStage& s, const Three& x) {
  if (s.through) {
    SkySample sample = open_sky_at(s, x, unit(splat3(s.end) - x));
    sample.good &= dot(sample.l, splat3(s.axis)) > 0;
    return sample;
  }
  SkySample sample{{splat3(s.l), splat3(s.l), splat(s.factor), splat(s.spread), ~Mask{}},
                   splat3(s.color)};
  beside_openings(s, x, sample);
  return sample;
}

inline Sample sky_at(const LightStage& s, const Three& l) {
  return {l, l, splat(s.factor), splat(s.spread), ~Mask{}};
}

/// In the direction l, wherever the light is.
inline Sample direction_at(const LightStage& s, const Three&, const Three& l) {
  const Three off = l + splat3(s.axis);  // of length^2 2 (1 - cos)
  return {l, l, splat(s.factor), splat(s.spread), 0.5 * dot(off, off) <= s.versine};
}

/// The common point, seen from no nearer than the disc that it stands for.
inline Sample sample_mesh(const LightStage& s, const Three& x) {
  const Three q = splat3(s.end), n = splat3(s.axis), to = q - x, l = unit(to);
  const Doubles z = -dot(l, n), d2 = larger(dot(to, to), splat(s.near2)),
                spread = s.spread * magnitude(z) / d2;
  return {l, q + choose(z > 0, splat(s.size), splat(-s.size)) * n, s.factor * spread, spread,
          ~Mask{}};
}

/// A point in a medium, which shines alike to all sides. Within the ball that it stands for, what
/// comes from there is finite and in the mean over an even medium what comes from all of it.
inline Sample sample_medium(const LightStage& s, const Three& x) {
  const Three q = splat3(s.end), to = q - x;
  const Doubles d2 = dot(to, to), within = (6 - 5 * (d2 / s.near2)) / s.near2,
                spread = s.spread * choose(d2 < s.near2, within, 1 / d2);
  return {unit(to), q, s.factor * spread, spread, d2 > 0};
}

inline Sample sample_point(const LightStage& s, const Three& x) {
  const Three end = splat3(s.center), to = end - x;
  return {unit(to), end, s.physical ? inverse_square(s, dot(to, to)) : splat(1), Doubles{},
          ~Mask{}};
}

/// The cone that a sphere subtends: from inside all directions, whatever way a spotlight shines.
struct SphereCone {
  Three to, axis;
  Doubles d2, versine;
  Mask outside;
  SphereCone(const LightStage& s, const Three& x) : to(splat3(s.center) - x), d2(dot(to, to)) {
    const double r2 = s.radius * s.radius;
    axis = choose(d2 > 0, unit(to), Three{Doubles{}, Doubles{}, splat(1)});
    outside = d2 > r2;
    const Doubles sine2 = choose(outside, r2 / d2, splat(1));
    versine = choose(outside, sine2 / (1 + root(1 - sine2)), splat(2));
  }
};

inline Sample sphere_at(const LightStage& s, const Three& x, const SphereCone& cone,
                        const Three& l) {
  const double r2 = s.radius * s.radius;
  const Doubles b = dot(cone.to, l), half = root(larger(r2 - (cone.d2 - b * b), splat(0)));
  const Three end = x + choose(cone.outside, b - half, b + half) * l;
  const Doubles factor = choose(cone.outside, inverse_square(s, cone.d2) * 2 / (2 - cone.versine),
                                4 * inverse_square(s, splat(r2)));
  const Doubles even = s.physical ? factor : splat(1);
  return {l, end, s.spot ? choose(cone.outside, even * spot(s, l), even) : even,
          (2 * kCircle) * cone.versine, ~Mask{}};
}

inline Sample sample_sphere(const LightStage& s, const Three& x) {
  const SphereCone cone(s, x);
  return sphere_at(s, x, cone, in_cone(s, cone.axis, cone.versine));
}

inline Sample sphere_at(const LightStage& s, const Three& x, const Three& l) {
  const SphereCone cone(s, x);
  Sample at = sphere_at(s, x, cone, l);
  const Three off = l - cone.axis;
  at.good &= 0.5 * dot(off, off) <= cone.versine;
  return at;
}

/// Where a disc across `towards` is lit from: at its point `end`, which is seen in the direction l.
inline Sample disc_at(const LightStage& s, const Three& x, const Three& towards, const Three& end,
                      const Three& l) {
  const Three to = end - x;
  const Doubles z = larger(dot(l, towards), splat(0)), d2 = dot(to, to);
  return {l, end, s.physical ? z * inverse_square(s, d2) : splat(1),
          (kCircle * s.radius * s.radius) * z / d2, nonzero(towards)};
}

inline Sample sample_disc(const LightStage& s, const Three& x) {
  const Three towards = unit(splat3(s.center) - x);
  Three t1, t2;
  frame(towards, t1, t2);
  const Three end = splat3(s.center) + splat(s.radius) * (splat(s.x) * t1 + splat(s.y) * t2);
  return disc_at(s, x, towards, end, unit(end - x));
}

inline Sample disc_at(const LightStage& s, const Three& x, const Three& l) {
  const Way to = way(splat3(s.center) - x);
  const Doubles t = to.length / dot(l, to.d);
  const Three end = x + t * l, off = end - splat3(s.center);
  Sample at = disc_at(s, x, to.d, end, l);
  at.good &= (t > 0) & (dot(off, off) <= s.radius * s.radius);
  return at;
}

/// Whether a point of its plane is on the area light.
inline Mask on_light(const LightStage& s, const Three& end) {
  const Three off = end - splat3(s.center);
  const Doubles a = dot(off, splat3(s.across)), b = dot(off, splat3(s.upward));
  return s.ellipse ? a * a + b * b <= 1 : (magnitude(a) <= 1) & (magnitude(b) <= 1);
}

inline Sample plane_at(const LightStage& s, const Three& x, const Three& end, const Three& l) {
  const Three to = end - x;
  const Doubles z = -dot(l, splat3(s.axis)), d2 = dot(to, to);
  return {l, end, s.physical ? 4 * z * inverse_square(s, d2) : splat(1), s.area * z / d2, z > 0};
}

inline Sample sample_plane(const LightStage& s, const Three& x) {
  return plane_at(s, x, splat3(s.end), unit(splat3(s.end) - x));
}

inline Sample plane_at(const LightStage& s, const Three& x, const Three& l) {
  const Doubles t = dot(splat3(s.center) - x, splat3(s.axis)) / dot(l, splat3(s.axis));
  const Three end = x + t * l;
  Sample at = plane_at(s, x, end, l);
  at.good &= (t > 0) & on_light(s, end);
  return at;
}

/// Even over the solid angle where the rectangle is seen large, over its area elsewhere: there the
/// two are nearly the same, and rays that end in one point are faster. Of one with a spread only a
/// square round the foot of the point is seen.
struct SeenRectangle {
  Three right, up, axis;
  Rectangle seen;
  Mask large, some;
  SeenRectangle(const LightStage& s, const Three& p)
      : right(splat3(s.right)), up(splat3(s.up)), axis(splat3(s.axis)) {
    const Three to = splat3(s.center) - p;
    const Doubles x = dot(to, right) / s.size, y = dot(to, up) / s.size,
                  z = -dot(to, axis) / s.size;
    large = (dot(to, to) < s.near2) & (z > 1e-30);
    seen = {x - s.half[0], x + s.half[0], y - s.half[1], y + s.half[1], z};
    some = ~Mask{};
    if (s.tan_spread > 0) cut(s.tan_spread * z);
  }

 private:
  void cut(const Doubles& reach) {
    large |= (seen.z > 1e-30) &
             ((seen.x0 < -reach) | (seen.x1 > reach) | (seen.y0 < -reach) | (seen.y1 > reach));
    seen.x0 = larger(seen.x0, -reach);
    seen.x1 = smaller(seen.x1, reach);
    seen.y0 = larger(seen.y0, -reach);
    seen.y1 = smaller(seen.y1, reach);
    some = (seen.x0 < seen.x1) & (seen.y0 < seen.y1);
  }
};

inline Sample sample_rectangle(const LightStage& s, const Three& p) {
  const Sample even = sample_plane(s, p);
  const SeenRectangle r(s, p);
  if (!any(r.large)) return even;
  const RectanglePoint q = rectangle_point(r.seen, 0.5 * (s.a + 1), 0.5 * (s.b + 1));
  const Three l = q.x * r.right + q.y * r.up - r.seen.z * r.axis, end = p + splat(s.size) * l;
  const Mask on = s.ellipse ? r.some & on_light(s, end) : r.some;
  return {choose(r.large, unit(l), even.l), choose(r.large, end, even.end),
          choose(r.large, q.solid_angle * s.factor, even.factor),
          choose(r.large, q.solid_angle, even.spread), (r.large & on) | (~r.large & even.good)};
}

inline Sample rectangle_at(const LightStage& s, const Three& p, const Three& l) {
  Sample at = plane_at(s, p, l);
  const SeenRectangle r(s, p);
  if (!any(r.large & at.good)) return at;
  const Doubles solid_angle = r.seen.solid_angle();
  at.factor = choose(r.large, solid_angle * s.factor, at.factor);
  at.spread = choose(r.large, solid_angle, at.spread);
  return at;
}

inline void share(const LightStage& s, Sample& sample) {
  if (s.spot && s.shape != kSphereSource) sample.factor = sample.factor * spot(s, sample.l);
  if (s.tan_spread > 0) sample.factor = sample.factor * between_slats(s, sample.l);
  if (s.share > 1) sample.factor = sample.factor / s.share;
  sample.good &= sample.factor != 0;
}

template <int Shape>
inline auto lone_sample(const LightStage& s, const Three& x) {
  if constexpr (Shape == kOpenSky) return sample_open_sky(s, x);
  else if constexpr (Shape == kMeshSource) return sample_mesh(s, x);
  else if constexpr (Shape == kMediumSource) return sample_medium(s, x);
  else if constexpr (Shape == kPointSource) return sample_point(s, x);
  else if constexpr (Shape == kSphereSource) return sample_sphere(s, x);
  else if constexpr (Shape == kDiscSource) return sample_disc(s, x);
  else if constexpr (Shape == kPlaneSource) return sample_plane(s, x);
  else if constexpr (Shape == kRectangleSource) return sample_rectangle(s, x);
  else return sample_direction(s, x);
}

template <int Shape>
inline auto sample(const LightStage& s, const Three& x) {
  auto at = lone_sample<Shape>(s, x);
  share(s, at);
  return at;
}

template <int Shape>
inline auto lone_sample_at(const LightStage& s, const Three& x, const Three& l) {
  if constexpr (Shape == kSky) return sky_at(s, l);
  else if constexpr (Shape == kOpenSky) return open_sky_at(s, x, l);
  else if constexpr (Shape == kDirection) return direction_at(s, x, l);
  else if constexpr (Shape == kSphereSource) return sphere_at(s, x, l);
  else if constexpr (Shape == kDiscSource) return disc_at(s, x, l);
  else if constexpr (Shape == kRectangleSource) return rectangle_at(s, x, l);
  else return plane_at(s, x, l);
}

/// The sample that the direction l would be; not good where it misses the light.
template <int Shape>
inline auto sample_at(const LightStage& s, const Three& x, const Three& l) {
  auto at = lone_sample_at<Shape>(s, x, l);
  share(s, at);
  return at;
}

}  // namespace
}  // namespace glint
