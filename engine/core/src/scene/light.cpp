// Letters: x shaded point, l direction to the light, q point on the light, d distance, z cosine at
// the light.
#include "scene/light.h"

#include "math/math.h"
#include "scene/anchor.h"
#include "scene/programs.h"
#include "scene/surface.h"

namespace glint {
namespace {

constexpr double kHuge =
    1e100;  // beyond any float: intensities saturate here instead of overflowing to NaN later

constexpr double kLeastWide =
    8;  // exponents from here on draw directions beside points of lights that may be all around

/// The share of a mesh light's point, of `count` a sample of a pixel, over the square of the least
/// distance from which it is seen (MERGED of engine/lights/mesh_lights.py).
double merged(uint32_t count) { return 64 * kPi * count; }

constexpr double kLeastSpread = 1e-4, kFullSpread = 0.5 * kPi - 5e-5;  // half angles

constexpr double kNear = 4;  // half diagonals of a rectangle within which it is seen large

double saturate(double x) { return std::clamp(x, -kHuge, kHuge); }

double half(double angle) { return 0.5 * std::clamp(angle, 0.0, 2 * kPi); }

double area_of(const GlintLight& g) {
  return g.size_x * g.size_y * (g.flags & GLINT_ELLIPSE ? kPi / 4 : 1);
}

bool sound(const GlintLight& g) {
  bool good = finite(affine(g.world_from_light)) && any(affine(g.world_from_light).z);
  for (double x : {g.color[0], g.color[1], g.color[2], g.strength, g.radius, g.angle, g.spot_size,
                   g.spot_blend, g.size_x, g.size_y, g.spread})
    good = good && std::isfinite(x);
  return good;
}

/// By how much wider lobes may be for directions to be drawn from them.
double wider(const LightPolicy& policy) { return policy.power_heuristic ? 1.0 / 8 : 1; }

void set(double (&to)[3], const Vec3d& v) {
  for (int c = 0; c < 3; ++c) to[c] = v[c];
}

}  // namespace

Vec3d direction_in_cone(Vec3d axis, double versine, const LightPoint& p) {
  Frame frame(axis);
  double r2 = p.x * p.x + p.y * p.y, cosine = 1 - r2 * versine;
  double s = std::sqrt(std::max(0.0, versine * (1 + cosine)));  // sine / r
  return unit(cosine * axis + s * (p.x * frame.t1 + p.y * frame.t2));
}

Light::Light(const GlintLight& g, const Anchor& anchor, const ProgramTable& programs)
    : kind(g.kind), flags(g.flags), excluded_sets(g.excluded_sets), passed_sets(g.passed_sets) {
  Affine m = affine(g.world_from_light);
  placed = anchor.matrix(m);
  level = g.level;
  group = g.light_group - 1;
  first_emitter = size_t(g.first_emitter);
  emitter_count = size_t(g.emitter_count);
  if (g.program > 0) {
    const Vec3d columns[4] = {placed.x, placed.y, placed.z, placed.t};
    for (int k = 0; k < 12; ++k) space.m[k] = columns[k / 3][k % 3];
    program = programs.of(g.program);
    slot = size_t(g.program_slot) * kBlock;
  }
  color = Vec3d{saturate(g.color[0] * g.strength), saturate(g.color[1] * g.strength),
                saturate(g.color[2] * g.strength)};
  center = anchor.point(m.t);
  axis = unit(-m.z);
  right = 0.5 * anchor.scale * g.size_x * m.x;
  up = 0.5 * anchor.scale * g.size_y * m.y;
  radius = anchor.scale * g.radius;
  scale2 = anchor.scale * anchor.scale;
  double alpha = half(g.angle), s = sine(0.5 * alpha);
  versine = 2 * s * s;
  spot_cosine = cosine(half(g.spot_size));
  spot_sine = sine(half(g.spot_size));
  spot_blend = g.spot_blend;
  double shape = 0;  // the c / shape of the visible radiance
  if (is_dome() || is_tabled()) extended = true;
  if (kind == GLINT_SUN) {
    extended = alpha > 0;
    shape = kPi * sine(alpha) * sine(alpha);
  }
  if (kind == GLINT_AREA) {
    extended = g.size_x > 0 || g.size_y > 0;
    if (const double h = std::max(half(g.spread), kLeastSpread); h < kFullSpread) {
      const double h2 = h * h;
      tan_spread = sine(h) / cosine(h);
      even_spread =
          1 / (h2 < 0.01 ? h * h2 / 3 * (1 + h2 * (2.0 / 5 + h2 * (17.0 / 105))) : tan_spread - h);
    }
    shape = kPi * area_of(g);
  }
  if (kind == GLINT_POINT_LIGHT || kind == GLINT_SPOT) {
    extended = g.radius > 0;
    shape = 4 * kPi * kPi * g.radius * g.radius;
  }
  if (shape > 0)
    seen = Vec3d{saturate(color.x / shape), saturate(color.y / shape), saturate(color.z / shape)};
}

/// The share of a spot's intensity at the cosine z from its axis; 1 for other lights.
double Light::spot(double z) const {
  if (kind != GLINT_SPOT) return 1;
  double width = (1 - spot_cosine) * spot_blend;
  if (!(width > 0)) return z > spot_cosine ? 1 : 0;
  double t = std::clamp((z - spot_cosine) / width, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

double Light::along(Vec3d d, bool physical) const {
  const double z = dot(d, axis);
  if (!(tan_spread > 0)) return spot(z);
  const double tangent = length(d - z * axis) / z;
  return std::max(tan_spread - tangent, 0.0) * (physical ? even_spread : 1 / tan_spread);
}

/// With an area: a strip without a width has none.
bool Light::has_extent() const { return kind == GLINT_AREA && length(right) * length(up) > 0; }

LightShape Light::shape(bool soft, bool physical) const {
  if (kind == GLINT_SUN) return LightShape::kSun;
  if (kind == GLINT_AREA)
    return soft && physical && has_extent() && (tan_spread > 0 || !(flags & GLINT_ELLIPSE))
               ? LightShape::kRectangle
               : LightShape::kArea;
  return !soft                        ? LightShape::kPoint
         : flags & GLINT_SOFT_FALLOFF ? LightShape::kDisc
                                      : LightShape::kSphere;
}

LightPolicy Light::policy() const {
  return {casts_shadow(),
          lights_matt(),
          lights_gloss(),
          lights_gloss(),
          is_mesh() && lights_matt(),
          false,
          0};
}

LightSample Light::sample(const LightPoint& p, uint32_t count, bool physical,
                          const LightPolicy& policy) const {
  if (is_dome()) return dome_sample(p, count, policy);
  return is_tabled() ? tabled_sample(p, count, policy) : lamp_sample(p, count, physical, policy);
}

/// Of lights that may be all around.
LightSample Light::wide_sample(LightShape shape, const LightPoint& p, uint32_t count,
                               const LightPolicy& policy) const {
  LightSample s{};
  s.shape = shape;
  s.physical = true;
  s.count = count;
  const double least = kLeastWide * wider(policy);
  s.draws = {policy.most_exponent >= least, 0, least, disc_place(p.x, p.y)};
  return s;
}

LightSample Light::dome_sample(const LightPoint& p, uint32_t count,
                               const LightPolicy& policy) const {
  LightSample s = wide_sample(LightShape::kDome, p, count, policy);
  s.factor = 1;
  s.inverse_pdf = p.drawn[6];
  s.dome_cells = p.dome;
  std::copy_n(p.drawn, 3, s.dome.l);
  std::copy_n(p.drawn + 3, 3, s.color);
  return s;
}

LightSample Light::tabled_sample(const LightPoint& p, uint32_t count,
                                 const LightPolicy& policy) const {
  LightSample s =
      wide_sample(is_mesh() ? LightShape::kMesh : LightShape::kMedium, p, count, policy);
  const double* const row = p.drawn;
  const Vec3d q = point(placed, {row[0], row[1], row[2]});
  s.factor = 1 / kPi;
  s.inverse_pdf = scale2 * row[12];
  set(s.center, q);
  for (int c = 0; c < 3; ++c) s.color[c] = saturate(row[6 + c]);
  if (is_medium()) {
    s.medium.near2 = scale2 * row[13] * row[13];
    s.draws.on = false;
    return s;
  }
  set(s.axis, unit(direction(placed, {row[3], row[4], row[5]})));
  for (int c = 0; c < 3; ++c) s.back[c] = saturate(row[9 + c]);
  s.mesh = {s.inverse_pdf / merged(count), rounding(max_abs(q) + std::sqrt(scale2) * row[13])};
  return s;
}

LightSample Light::lamp_sample(const LightPoint& p, uint32_t count, bool physical,
                               const LightPolicy& policy) const {
  const bool soft = extended && count > 1;
  const LightPoint q = soft ? p : LightPoint{};
  LightSample s{};
  s.shape = shape(soft, physical);
  s.physical = physical;
  s.ellipse = flags & GLINT_ELLIPSE;
  set(s.center, center);
  set(s.axis, axis);
  set(s.color, color);
  s.factor = physical ? (soft ? 2 / (2 - versine) : 1) / kPi : 1;
  s.inverse_pdf = 2 * kPi * versine;
  s.count = soft ? count : 1;
  s.scale2 = scale2;
  s.spot = {kind == GLINT_SPOT, spot_cosine, (1 - spot_cosine) * spot_blend};
  s.draws = lobe_draws(q, soft, policy);
  if (kind == GLINT_SUN) {
    s.sun.versine = versine;
    set(s.sun.l, soft ? direction_in_cone(-axis, versine, p) : -axis);
  } else if (kind == GLINT_AREA) {
    s.area = area_place(q, physical);
    if (s.shape == LightShape::kRectangle)
      s.factor = scale2 / ((s.ellipse ? kPi : 4) * kPi * kPi * length(right) * length(up));
  } else if (soft) {
    s.round = {radius, q.x, q.y};
  }
  return s;
}

/// Of what is seen; suns have none.
double Light::area() const {
  return kind != GLINT_AREA ? kPi * radius * radius
                            : (flags & GLINT_ELLIPSE ? kPi : 4) * length(right) * length(up);
}

/// Directions are drawn from lobes whose solid angle 8 pi / (p + 1), seen straight, is less than
/// the light's, about area / (d^2 + area / (2 pi)).
LobeDraws Light::lobe_draws(const LightPoint& p, bool soft, const LightPolicy& policy) const {
  const double size = area(), least = wider(policy) * (endless() ? 4 / versine - 1 : 3);
  return {soft && (endless() || size > 0) && policy.most_exponent >= least,
          endless() ? 0 : wider(policy) * (8 * kPi / size), least, disc_place(p.x, p.y)};
}

AreaPlace Light::area_place(const LightPoint& p, bool physical) const {
  const double x = length(right), y = length(up), size = std::sqrt(x * x + y * y);
  const bool ellipse = flags & GLINT_ELLIPSE;
  AreaPlace place{};
  set(place.end, center + (ellipse ? p.x : p.a) * right + (ellipse ? p.y : p.b) * up);
  place.area = area();
  place.tan_spread = tan_spread;
  place.even_spread = physical ? even_spread : 1 / tan_spread;
  RectanglePlace& whole = place.rectangle;
  for (int c = 0; c < 3; ++c) {
    place.across[c] = right[c] / (x * x);
    place.upward[c] = up[c] / (y * y);
    whole.right[c] = right[c] / x;
    whole.up[c] = up[c] / y;
  }
  whole.size = size;
  whole.half[0] = x / size;
  whole.half[1] = y / size;
  whole.near2 = kNear * kNear * size * size;
  whole.a = p.a;
  whole.b = p.b;
  return place;
}

Light::Part Light::lit_part(Vec3d o, Vec3d d) const {
  if (kind == GLINT_SPOT && spot_cosine > 0)
    return within_cone(o - center + radius / std::max(spot_sine, 1e-30) * axis, d,
                       spot_cosine * spot_cosine);
  if (kind != GLINT_AREA) return {-kInfinity, kInfinity};
  const double height = dot(o - center, axis), rise = dot(d, axis), at = -height / rise;
  if (rise == 0) return {height > 0 ? -kInfinity : kInfinity, kInfinity};
  return {rise > 0 ? at : -kInfinity, rise < 0 ? at : kInfinity};
}

/// Of the line from o, which counts from the cone's tip.
Light::Part Light::within_cone(Vec3d o, Vec3d d, double cosine2) const {
  const double height = dot(o, axis), rise = dot(d, axis), a = rise * rise - cosine2 * dot(d, d),
               b = rise * height - cosine2 * dot(o, d), c = height * height - cosine2 * dot(o, o),
               q = -(b + std::copysign(std::sqrt(std::max(b * b - a * c, 0.0)), b)), x = q / a,
               y = c / q;
  if (std::isnan(x) || std::isnan(y) || a == 0) return {-kInfinity, kInfinity};
  const double first = std::min(x, y), last = std::max(x, y);
  if (a > 0) return {rise > 0 ? last : -kInfinity, rise > 0 ? kInfinity : first};
  if (b * b < a * c || height + 0.5 * (first + last) * rise <= 0) return {kInfinity, -kInfinity};
  return {first, last};
}

bool Light::is_cut(Vec3d x, Vec3d n) const {
  if (!any(color) || is_dome()) return false;
  if (kind == GLINT_SUN) {
    const double z = dot(n, axis), v = std::min(versine, 1.0);
    return z * z < v * (2 - v);
  }
  const Vec3d to = center - x;
  const double z = dot(n, to), a = std::fabs(dot(n, right)), b = std::fabs(dot(n, up));
  if (is_mesh() || is_medium()) return std::fabs(z) < a + b + radius * std::fabs(dot(n, axis));
  if (kind != GLINT_AREA) return z * z < radius * radius;
  return dot(to, axis) < 0 && z * z < (flags & GLINT_ELLIPSE ? a * a + b * b : (a + b) * (a + b));
}

EmitterHit Light::emitter_hit(const GlintEmitter& e, Vec3d x, Vec3d origin, Vec3d q, Vec3d l,
                              uint32_t count) const {
  const Vec3d n = unit(direction(placed, {e.normal[0], e.normal[1], e.normal[2]}));
  const double z = -dot(l, n), share = scale2 * e.spread, d2 = dot(q - x, q - x),
               near2 = share / merged(count),
               inverse_pdf = share * std::fabs(z) / std::max(d2, near2),
               whole = share * std::fabs(z) / std::max(d2, kNearest * near2),
               apart = rounding(max_abs(q) + std::sqrt(scale2) * e.reach);
  const double* const light = z > 0 ? e.front : e.back;
  return {{saturate(light[0]), saturate(light[1]), saturate(light[2])},
          q + std::copysign(apart, any(origin - x) ? dot(origin - q, n) : z) * n,
          inverse_pdf / (kPi * count),
          inverse_pdf,
          whole,
          z > 0};
}

double Light::meets_sphere(Vec3d o, Vec3d d) const {
  Vec3d f = center - o;
  double b = dot(f, d);
  Vec3d miss = f - b * d;  // the centre's offset from the ray: no cancellation of large squares
                           // (Haines, RTG ch. 7)
  double inside = radius * radius - dot(miss, miss);
  if (!(inside > 0)) return -1;
  double root = std::sqrt(inside);
  return dot(f, f) > radius * radius ? b - root : b + root;
}

double Light::meets_area(Vec3d o, Vec3d d) const {
  double t = dot(center - o, axis) / dot(d, axis);
  if (!(t > 0 && t < kInfinity)) return -1;
  Vec3d q = o + t * d - center;
  double a = dot(q, right) / dot(right, right), b = dot(q, up) / dot(up, up);
  bool within = flags & GLINT_ELLIPSE ? a * a + b * b <= 1 : std::fabs(a) <= 1 && std::fabs(b) <= 1;
  return within ? t : -1;
}

double Light::meets(Vec3d o, Vec3d d) const {
  if (!any(seen)) return -1;
  if (kind == GLINT_AREA) return meets_area(o, d);
  if (kind != GLINT_SUN) return meets_sphere(o, d);
  Vec3d off = d + axis;  // |d - l|^2 = 2 (1 - cos)
  return 0.5 * dot(off, off) <= versine ? kInfinity : -1;
}

Vec3d Light::seen_point(Vec3d o, Vec3d d, double meets) const {
  if (endless()) return {};
  const Vec3d to = center - o;
  const bool disc = kind != GLINT_AREA && flags & GLINT_SOFT_FALLOFF && dot(d, to) > 0;
  return o + (disc ? dot(to, to) / dot(d, to) : meets) * d;
}

Vec3d Light::radiance(Vec3d o, Vec3d d, bool physical) const {
  if (kind == GLINT_AREA && !(dot(d, axis) < 0)) return {};
  const Vec3d to = center - o;
  const bool inside = dot(to, to) <= radius * radius && !(flags & GLINT_SOFT_FALLOFF);
  return (inside ? 1.0 : along(-1.0 * d, physical)) * (physical ? seen : color);
}

LightTable place_lights(const GlintSceneData& data, const Anchor& anchor,
                        const ProgramTable& programs) {
  LightTable t;
  t.emitters.assign(data.emitters, data.emitters + data.emitter_count);
  t.emitter_corners = data.emitter_corners;
  uint32_t meshes = 0, media = 0;
  for (size_t i = 0; i < data.light_count; ++i) {
    const GlintLight& g = data.lights[i];
    if (sound(g)) {
      t.rows.emplace_back(g, anchor, programs);
      t.rows.back().number = uint32_t(t.rows.size() - 1);
      t.rows.back().table_number = g.kind == GLINT_MEDIUM_LIGHT ? media : meshes;
    } else ++t.dropped;
    meshes += g.kind == GLINT_MESH_LIGHT;
    media += g.kind == GLINT_MEDIUM_LIGHT;
  }
  return t;
}

}  // namespace glint
