// Letters: x shaded point, l direction to the light, q point on the light, d distance, z cosine at the light.
#include "light.h"

#include "math.h"
#include "scene.h"

namespace glint {
namespace {

constexpr double kHuge = 1e100;  // beyond any float: intensities saturate here instead of overflowing to NaN later

double saturate(double x) { return std::clamp(x, -kHuge, kHuge); }

/// The direction at the disc point (x, y) of the cone round `axis` with 1 - cos(half angle) = versine, uniform in solid angle.
Vec3d in_cone(Vec3d axis, double versine, const LightPoint& p) {
  Frame frame(axis);
  double r2 = p.x * p.x + p.y * p.y, cosine = 1 - r2 * versine;
  double s = std::sqrt(std::max(0.0, versine * (1 + cosine)));  // sine / r
  return unit(cosine * axis + s * (p.x * frame.t1 + p.y * frame.t2));
}

double half(double angle) { return 0.5 * std::clamp(angle, 0.0, 2 * kPi); }

double area_of(const GlintLight& g) { return g.size_x * g.size_y * (g.flags & GLINT_ELLIPSE ? kPi / 4 : 1); }

}  // namespace

Light::Light(const GlintLight& g, const Anchor& anchor) : kind(g.kind), flags(g.flags) {
  Affine m = affine(g.world_from_light);
  color = Vec3d{saturate(g.color[0] * g.strength), saturate(g.color[1] * g.strength), saturate(g.color[2] * g.strength)};
  center = anchor.point(m.t), axis = unit(-m.z);
  right = 0.5 * anchor.scale * g.size_x * m.x, up = 0.5 * anchor.scale * g.size_y * m.y;
  radius = anchor.scale * g.radius, scale2 = anchor.scale * anchor.scale;
  double alpha = half(g.angle), s = sine(0.5 * alpha);
  versine = 2 * s * s;
  spot_cosine = cosine(half(g.spot_size)), spot_blend = g.spot_blend;
  double shape = 0;  // the c / shape of the visible radiance
  if (kind == GLINT_SUN) extended = alpha > 0, shape = kPi * sine(alpha) * sine(alpha);
  if (kind == GLINT_AREA) extended = g.size_x > 0 || g.size_y > 0, shape = kPi * area_of(g);
  if (kind == GLINT_POINT_LIGHT || kind == GLINT_SPOT) extended = g.radius > 0, shape = 4 * kPi * kPi * g.radius * g.radius;
  if (shape > 0) seen = Vec3d{saturate(color.x / shape), saturate(color.y / shape), saturate(color.z / shape)};
}

/// 1 / (4 pi^2 d^2) in world units from the squared anchored distance.
double Light::inverse_square(double d2) const { return std::min(scale2 / (4 * kPi * kPi * d2), kHuge); }

/// The share of a spot's intensity at the cosine z from its axis; 1 for other lights.
double Light::spot(double z) const {
  if (kind != GLINT_SPOT) return 1;
  double width = (1 - spot_cosine) * spot_blend;
  if (!(width > 0)) return z > spot_cosine ? 1 : 0;
  double t = std::clamp((z - spot_cosine) / width, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

bool Light::sample_point(Vec3d x, LightSample& s, bool physical) const {
  Vec3d to = center - x;
  s.l = unit(to), s.end = center;
  s.factor = (physical ? inverse_square(dot(to, to)) : 1) * spot(-dot(s.l, axis));
  return true;
}

bool Light::sample_sphere(Vec3d x, const LightPoint& p, LightSample& s, bool physical) const {
  Vec3d to = center - x, c = unit(to);
  if (!any(c)) return false;
  double d2 = dot(to, to), d = std::sqrt(d2), r2 = radius * radius;
  double sine2 = d2 > r2 ? r2 / d2 : 1, cosine = std::sqrt(1 - sine2);
  s.l = in_cone(c, sine2 / (1 + cosine), p);
  double b = dot(to, s.l), root = std::sqrt(std::max(0.0, r2 - (d2 - b * b)));
  s.end = x + (d > radius ? b - root : b + root) * s.l;
  s.factor = (physical ? inverse_square(d2) * 2 / (1 + cosine) : 1) * spot(-dot(s.l, axis));
  return true;
}

bool Light::sample_disc(Vec3d x, const LightPoint& p, LightSample& s, bool physical) const {
  Vec3d towards = unit(center - x);
  if (!any(towards)) return false;
  Frame frame(towards);
  s.end = center + radius * (p.x * frame.t1 + p.y * frame.t2);
  Vec3d to = s.end - x;
  s.l = unit(to);
  s.factor = (physical ? std::max(0.0, dot(s.l, towards)) * inverse_square(dot(to, to)) : 1) * spot(-dot(s.l, axis));
  return true;
}

bool Light::sample_sun(const LightPoint& p, bool soft, LightSample& s, bool physical) const {
  s.l = soft ? in_cone(-axis, versine, p) : -axis;
  s.factor = physical ? (soft ? 2 / (2 - versine) : 1) / kPi : 1;
  return true;
}

bool Light::sample_area(Vec3d x, const LightPoint& p, LightSample& s, bool physical) const {
  bool ellipse = flags & GLINT_ELLIPSE;
  s.end = center + (ellipse ? p.x : p.a) * right + (ellipse ? p.y : p.b) * up;
  Vec3d to = s.end - x;
  s.l = unit(to);
  double z = -dot(s.l, axis);
  s.factor = physical ? 4 * z * inverse_square(dot(to, to)) : 1;
  return z > 0;
}

bool Light::sample(Vec3d x, const LightPoint& p, uint32_t count, bool physical, LightSample& s) const {
  bool soft = extended && count > 1, good = false;
  if (kind == GLINT_SUN) good = sample_sun(p, soft, s, physical);
  else if (kind == GLINT_AREA) good = sample_area(x, soft ? p : LightPoint{}, s, physical);
  else if (!soft) good = sample_point(x, s, physical);
  else good = flags & GLINT_SOFT_FALLOFF ? sample_disc(x, p, s, physical) : sample_sphere(x, p, s, physical);
  s.factor /= soft ? count : 1;
  return good && any(s.l) && s.factor != 0;
}

double Light::meets_sphere(Vec3d o, Vec3d d) const {
  Vec3d f = center - o;
  double b = dot(f, d);
  Vec3d miss = f - b * d;  // the centre's offset from the ray: no cancellation of large squares (Haines, RTG ch. 7)
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

Vec3d Light::radiance(Vec3d d, bool physical) const {
  if (kind == GLINT_AREA && !(dot(d, axis) < 0)) return {};
  return spot(-dot(d, axis)) * (physical ? seen : color);
}

}  // namespace glint
