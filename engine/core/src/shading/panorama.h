// Where the points of a panorama's picture look, and where directions are in it
// (semantics/camera.md). Vectors are along the camera's axes: right, up, backward.
#pragma once
#include "glint.h"
#include "program/functions.h"
#include "simd/lanes.h"

namespace glint {
namespace {

/// Where a point looks, and whether anything is to be seen there at all.
struct Look {
  Three d;  // unit; forward where nothing is seen
  Mask seen;
};

inline Doubles mixed(const double* ends, Doubles share) {
  return ends[0] + (ends[1] - ends[0]) * share;
}
inline Doubles share_between(const double* ends, Doubles at) {
  return (at - ends[0]) / (ends[1] - ends[0]);
}

/// An angle off the view towards (x, y), which is `size` long; upward where that is zero.
inline Three turned_off(Doubles angle, Doubles x, Doubles y, Doubles size) {
  const Mask aside = size > 0;
  const Doubles s = sin(angle);
  return {where(aside, x / size * s), choose(aside, y / size, splat(1)) * s, -cos(angle)};
}

inline Look look_through_fisheye(const GlintCamera& c, Doubles u, Doubles v) {
  const bool distant = c.projection == GLINT_FISHEYE_EQUIDISTANT;
  const Doubles x = (u - 0.5) * (distant ? 2 : c.sensor[0]),
                y = (v - 0.5) * (distant ? 2 : c.sensor[1]);
  const Doubles r = root(x * x + y * y);
  if (distant) return {turned_off(r * (0.5 * c.fov), x, y, r), r <= 1};
  if (c.projection == GLINT_FISHEYE_EQUISOLID) {
    const Doubles half = r / (2 * c.lens);
    const Mask seen = half <= sin(splat(0.25 * c.fov));
    return {turned_off(2 * asin(where(seen, half)), x, y, r), seen};
  }
  const double* k = c.polynomial;
  const Doubles angle = -(k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * k[4]))));
  return {turned_off(angle, x, y, r), magnitude(angle) <= 0.5 * c.fov};
}

/// Of the point (u, v) of the picture.
inline Look look_of(const GlintCamera& c, Doubles u, Doubles v) {
  constexpr double quarter = 1.57079632679489661923;
  switch (c.projection) {
    case GLINT_EQUIRECTANGULAR: {
      const Doubles longitude = mixed(c.longitude, u), latitude = mixed(c.latitude, v),
                    level = cos(latitude);
      return {{level * sin(longitude), sin(latitude), -(level * cos(longitude))}, ~Mask{}};
    }
    case GLINT_MIRROR_BALL: {
      const Doubles x = 2 * u - 1, y = 2 * v - 1, square = 1 - x * x - y * y;
      const Mask seen = square >= 0;
      const Doubles h = root(where(seen, square));
      return {{2 * h * x, 2 * h * y, 1 - 2 * h * h}, seen};
    }
    case GLINT_EQUIANGULAR_CUBEMAP_FACE:
      return {unit({tan((u - 0.5) * quarter), tan((v - 0.5) * quarter), splat(-1)}), ~Mask{}};
    case GLINT_CENTRAL_CYLINDRICAL: {
      const Doubles longitude = mixed(c.longitude, u);
      return {unit({sin(longitude), mixed(c.heights, v), -cos(longitude)}), ~Mask{}};
    }
    default: return look_through_fisheye(c, u, v);
  }
}

/// The same with a direction where nothing is seen.
inline Look sound_look_of(const GlintCamera& c, Doubles u, Doubles v) {
  const Look look = look_of(c, u, v);
  const Mask good = look.seen & (look.d.x - look.d.x == 0) & (look.d.y - look.d.y == 0) &
                    (look.d.z - look.d.z == 0);
  return {choose(good, look.d, {splat(0), splat(0), splat(-1)}), good};
}

struct PicturePoint {
  Doubles u, v;
};

/// Newton's method from the polynomial's linear part.
inline Doubles distance_of(const double* k, Doubles angle) {
  Doubles r = (angle - k[0]) / k[1];
  for (int step = 0; step < 20; ++step) {
    const Doubles value = k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * k[4])));
    const Doubles slope = k[1] + r * (2 * k[2] + r * (3 * k[3] + r * (4 * k[4])));
    r += (angle - value) / slope;
  }
  return r;
}

inline PicturePoint fisheye_point(const GlintCamera& c, const Three& d) {
  const Doubles across = root(d.x * d.x + d.y * d.y), angle = atan2(across, -d.z);
  Doubles r;
  double width = 1, height = 1;
  if (c.projection == GLINT_FISHEYE_EQUIDISTANT) r = angle / c.fov;
  else {
    width = c.sensor[0];
    height = c.sensor[1];
    r = c.projection == GLINT_FISHEYE_EQUISOLID ? 2 * c.lens * sin(0.5 * angle)
                                                : distance_of(c.polynomial, -angle);
  }
  const Mask aside = across > 0;
  return {0.5 + where(aside, r * (d.x / across)) / width,
          0.5 + where(aside, r * (d.y / across)) / height};
}

/// The point of the picture that looks along d, which is unit.
inline PicturePoint picture_point(const GlintCamera& c, const Three& d) {
  constexpr double two_over_pi = 0.63661977236758134308;
  switch (c.projection) {
    case GLINT_EQUIRECTANGULAR:
      return {share_between(c.longitude, atan2(d.x, -d.z)),
              share_between(c.latitude, atan2(d.y, root(d.x * d.x + d.z * d.z)))};
    case GLINT_MIRROR_BALL: {
      const Doubles size = 2 * root(larger(0.5 * (1 - d.z), splat(0)));
      return {0.5 + 0.5 * where(size > 0, d.x / size), 0.5 + 0.5 * where(size > 0, d.y / size)};
    }
    case GLINT_EQUIANGULAR_CUBEMAP_FACE:
      return {0.5 + atan2(d.x, -d.z) * two_over_pi, 0.5 + atan2(d.y, -d.z) * two_over_pi};
    case GLINT_CENTRAL_CYLINDRICAL:
      return {share_between(c.longitude, atan2(d.x, -d.z)),
              share_between(c.heights, d.y / root(d.x * d.x + d.z * d.z))};
    default: return fisheye_point(c, d);
  }
}

}  // namespace
}  // namespace glint
