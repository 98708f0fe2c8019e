// Light from one sample of one light (notes 4.13-4.16, light.h). Letters: x point, l direction to the light, d distance, z cosine at the
// light, g n geometric and shading normal, v to the viewer.
#pragma once
#include "stage_math.h"
#include "stage_rectangle.h"
#include "stage_rows.h"
#include "stages.h"

namespace glint {
namespace {

constexpr double kCircle = 3.14159265358979323846;

/// The sample as points see it: unit direction l, intensity color * factor, where the shadow segment ends, and where all this is sound.
struct Sample {
  Three l, end;
  Doubles factor;
  Mask good;
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

/// Two unit vectors that make a frame with n (vec.h).
inline void frame(const Three& n, Three& t1, Three& t2) {
  const Doubles s = with_sign(splat(1), n.z), a = -1 / (s + n.z), b = n.x * n.y * a;
  t1 = {1 + s * n.x * n.x * a, s * b, -s * n.x};
  t2 = {b, s + n.y * n.y * a, -n.y};
}

/// The direction at the disc point of the cone round `axis` with 1 - cos(half angle) = versine, uniform in solid angle.
inline Three in_cone(const LightStage& s, const Three& axis, Doubles versine) {
  Three t1, t2;
  frame(axis, t1, t2);
  const Doubles cosine = 1 - (s.x * s.x + s.y * s.y) * versine;
  const Doubles sine = root(larger(versine * (1 + cosine), splat(0)));  // over the disc's radius
  return unit(cosine * axis + sine * (splat(s.x) * t1 + splat(s.y) * t2));
}

inline Sample sample_direction(const LightStage& s, const Three&) { return {splat3(s.l), splat3(s.l), splat(s.factor), ~Mask{}}; }

inline Sample sample_point(const LightStage& s, const Three& x) {
  const Three end = splat3(s.center), to = end - x;
  return {unit(to), end, s.physical ? inverse_square(s, dot(to, to)) : splat(1), ~Mask{}};
}

inline Sample sample_sphere(const LightStage& s, const Three& x) {
  const Three to = splat3(s.center) - x, c = unit(to);
  const double r2 = s.radius * s.radius;
  const Doubles d2 = dot(to, to), d = root(d2), sine2 = choose(d2 > r2, r2 / d2, splat(1)), cosine = root(1 - sine2);
  const Three l = in_cone(s, c, sine2 / (1 + cosine));
  const Doubles b = dot(to, l), half = root(larger(r2 - (d2 - b * b), splat(0)));
  const Three end = x + choose(d > s.radius, b - half, b + half) * l;
  return {l, end, s.physical ? inverse_square(s, d2) * 2 / (1 + cosine) : splat(1), nonzero(c)};
}

inline Sample sample_disc(const LightStage& s, const Three& x) {
  const Three towards = unit(splat3(s.center) - x);
  Three t1, t2;
  frame(towards, t1, t2);
  const Three end = splat3(s.center) + splat(s.radius) * (splat(s.x) * t1 + splat(s.y) * t2), to = end - x, l = unit(to);
  const Doubles factor = s.physical ? larger(dot(l, towards), splat(0)) * inverse_square(s, dot(to, to)) : splat(1);
  return {l, end, factor, nonzero(towards)};
}

inline Sample sample_plane(const LightStage& s, const Three& x) {
  const Three end = splat3(s.end), to = end - x, l = unit(to);
  const Doubles z = -dot(l, splat3(s.axis));
  return {l, end, s.physical ? 4 * z * inverse_square(s, dot(to, to)) : splat(1), z > 0};
}

/// Even over the solid angle where the rectangle is seen large, over its area elsewhere: there the two are nearly the same, and rays that
/// end in one point are faster.
inline Sample sample_rectangle(const LightStage& s, const Three& p) {
  const Sample even = sample_plane(s, p);
  const Three to = splat3(s.center) - p, right = splat3(s.right), up = splat3(s.up), axis = splat3(s.axis);
  const Doubles x = dot(to, right) / s.size, y = dot(to, up) / s.size, z = -dot(to, axis) / s.size;
  const Mask large = (dot(to, to) < s.near2) & (z > 1e-30);
  if (!any(large)) return even;
  const Rectangle seen = {x - s.half[0], x + s.half[0], y - s.half[1], y + s.half[1], z};
  const RectanglePoint q = rectangle_point(seen, 0.5 * (s.a + 1), 0.5 * (s.b + 1));
  const Three l = q.x * right + q.y * up - z * axis;
  return {choose(large, unit(l), even.l), choose(large, p + splat(s.size) * l, even.end),
          choose(large, q.solid_angle * s.factor, even.factor), large | even.good};
}

template <int Shape>
inline Sample sample(const LightStage& s, const Three& x) {
  Sample sample = Shape == kDirection         ? sample_direction(s, x)
                  : Shape == kPointSource     ? sample_point(s, x)
                  : Shape == kSphereSource    ? sample_sphere(s, x)
                  : Shape == kDiscSource      ? sample_disc(s, x)
                  : Shape == kRectangleSource ? sample_rectangle(s, x)
                                              : sample_plane(s, x);
  if (s.spot) sample.factor = sample.factor * spot(s, sample.l);
  if (s.share > 1) sample.factor = sample.factor / s.share;
  sample.good &= sample.factor != 0;
  return sample;
}

__attribute__((always_inline)) inline Three highlights(const LightStage& s, size_t k, const Three& n, const Three& l) {
  const Slope at = slope(n, l - load3(s.d, k));
  Three sum{};
  for (int term = 0; term < s.max_specular; ++term) {
    const double* column = s.specular + 4 * size_t(term) * s.stride + k;
    const Three Tk = {load(column), load(column + s.stride), load(column + 2 * s.stride)};
    if (!any(nonzero(Tk))) continue;
    sum = sum + highlight(at, load(column + 3 * s.stride)) * Tk;
  }
  return sum;
}

/// How far along g a ray starts that leaves to the back of its face: beyond the face, but not where Hanika's start is above it already.
/// There the face is out of its way, and beyond the face it would start within the body.
inline Doubles below(const LightStage& s, size_t k, const Three& origin, const Three& g, Doubles offset) {
  if (s.origin[0] == s.points_x[0]) return -offset;  // no smooth faces
  return choose(dot(origin - load3(s.points_x, k), g) > 0x1p-25 * offset, splat(0), -offset);
}

/// The open segment from the point to the sample; its far end stops short of what the sample lies on.
template <int Shape>
inline void shadow_ray(const LightStage& s, size_t k, const Sample& sample, const Appender& append) {
  const Three origin = load3(s.origin, k), g = load3(s.g, k);
  const Doubles offset = load(s.offset + k);
  const Three towards = Shape == kDirection ? sample.l : sample.end - origin;
  // Off the surface along its normal, and back along the ray that found it: there it is free, whatever stands on the surface.
  const Three o = origin + choose(dot(g, towards) < 0, below(s, k, origin, g, offset), offset) * g - offset * load3(s.d, k);
  append(s.o, o);
  if (s.end_out[0]) append(s.end_out, sample.end);
  if (Shape == kDirection) return append(s.to, sample.l), append(s.t_max, splat(__builtin_inf()));
  const Way to = way(sample.end - o);
  append(s.to, to.d);
  append(s.t_max, to.length - rounding(larger(max_abs(sample.end), max_abs(o))));
}

template <int Shape>
size_t light_from(const LightStage& s) {
  const Three color = splat3(s.color);
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(s.lit + k);
    if (!any(lit)) continue;
    const Three n = load3(s.n, k);
    const Sample at = sample<Shape>(s, load3(s.points_x, k));
    const Doubles cosine = dot(n, at.l);
    Mask reached = lit & at.good & (cosine > 0);
    if (!any(reached)) continue;
    const Three I = at.factor * color, diffuse = cosine * (I * load3(s.diffuse, k));
    Three specular{};
    if (s.max_specular > 0) specular = I * highlights(s, k, n, at.l);
    reached &= nonzero(diffuse) | nonzero(specular);
    const uint32_t lanes = bits(reached);
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(s.point, uint32_t(k));
    append(s.diffuse_out, s.specular_out[0] ? diffuse : diffuse + specular);
    if (s.specular_out[0]) append(s.specular_out, specular);
    if (s.casts_shadow) shadow_ray<Shape>(s, k, at, append);
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

size_t light(const LightStage& s) {
  switch (s.shape) {
    case kDirection: return light_from<kDirection>(s);
    case kPointSource: return light_from<kPointSource>(s);
    case kSphereSource: return light_from<kSphereSource>(s);
    case kDiscSource: return light_from<kDiscSource>(s);
    case kRectangleSource: return light_from<kRectangleSource>(s);
    default: return light_from<kPlaneSource>(s);
  }
}

/// Zero is added where the ray is blocked, so that -0 turns to 0 alone and in company.
void sum(const LightSum& s) {
  for (size_t k = 0; k < s.count;) {
    const uint32_t first = s.point[k];
    if (s.count - k >= kLanes && s.point[k + kLanes - 1] - first == kLanes - 1) {
      const Mask open = each_lane<Mask>([&](size_t lane) { return s.blocked[k + lane] ? int64_t(0) : int64_t(-1); });
      for (size_t c = 0; c < 3; ++c) store(s.total[c] + first, load(s.total[c] + first) + where(open, load(s.given[c] + k)));
      k += kLanes;
    } else {
      for (size_t c = 0; c < 3; ++c) s.total[c][first] = s.total[c][first] + (s.blocked[k] ? 0 : s.given[c][k]);
      ++k;
    }
  }
}

void sum_parts(const LightParts& s) {
  const auto add = [](double* const (&columns)[3], const Chosen& at, const Three& c) {
    if (columns[0]) scatter3(columns, at, gather3(columns, at) + c);
  };
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Chosen at = chosen(s.point, k, s.count);
    const Three diffuse = load3(s.diffuse, k), specular = s.specular[0] ? load3(s.specular, k) : Three{}, full = diffuse + specular;
    const Doubles open = each_lane([&](size_t lane) { return s.blocked[k + lane] ? 0.0 : 1.0; });
    const Three lit = full * (s.shadow[0] ? load3(s.shadow, k) : Three{open, open, open});
    add(s.sums.total, at, lit), add(s.sums.diffuse, at, diffuse), add(s.sums.specular, at, specular);
    add(s.sums.shadow, at, lit - full);
  }
}

}  // namespace
}  // namespace glint
