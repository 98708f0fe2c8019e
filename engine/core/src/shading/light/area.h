// Area lights: points that are uniform over their area, and rectangles by solid angle.
#pragma once
#include "shading/light/rectangle.h"
#include "shading/light/shape.h"

namespace glint {
namespace {

struct Area : ShapeTraits {
  static constexpr LightShape kShape = LightShape::kArea;

  static SeenSample sample(const LightSample& s, const Three& x) {
    return at(s, x, splat3(s.area.end), unit(splat3(s.area.end) - x));
  }

  static SeenSample towards(const LightSample& s, const Three& x, const Three& l) {
    const Doubles t = dot(splat3(s.center) - x, splat3(s.axis)) / dot(l, splat3(s.axis));
    const Three end = x + t * l;
    SeenSample seen = at(s, x, end, l);
    seen.good &= (t > 0) & is_on(s, end);
    return seen;
  }

  /// Of one with a spread: what its slats let through.
  static void share(const LightSample& s, SeenSample& at) {
    if (s.area.tan_spread > 0) {
      const Three axis = splat3(s.axis);
      const Doubles z = -dot(at.l, axis), tangent = length(at.l + z * axis) / z;
      at.factor = at.factor * (larger(s.area.tan_spread - tangent, splat(0)) * s.area.even_spread);
    }
    ShapeTraits::share(s, at);
  }

 protected:
  /// Whether a point of its plane is on the light.
  static Mask is_on(const LightSample& s, const Three& end) {
    const Three off = end - splat3(s.center);
    const Doubles a = dot(off, splat3(s.area.across)), b = dot(off, splat3(s.area.upward));
    return s.ellipse ? a * a + b * b <= 1 : (magnitude(a) <= 1) & (magnitude(b) <= 1);
  }

 private:
  static SeenSample at(const LightSample& s, const Three& x, const Three& end, const Three& l) {
    const Three to = end - x;
    const Doubles z = -dot(l, splat3(s.axis)), d2 = dot(to, to);
    return {l, end, s.physical ? 4 * z * inverse_square(s, d2) : splat(1), s.area.area * z / d2,
            z > 0};
  }
};

/// Uniform over the solid angle where the rectangle is seen large, over its area elsewhere: there
/// the two are nearly the same, and rays that end in one point are faster.
struct SolidRectangle : Area {
  static constexpr LightShape kShape = LightShape::kRectangle;

  static SeenSample sample(const LightSample& s, const Three& x) {
    SeenSample at = Area::sample(s, x);
    const Part r(s, x);
    if (any(r.large)) {
      const RectanglePlace& own = s.area.rectangle;
      const RectanglePoint q = rectangle_point(r.seen, 0.5 * (own.a + 1), 0.5 * (own.b + 1));
      const Three l = q.x * r.right + q.y * r.up - r.seen.z * r.axis, end = x + splat(own.size) * l;
      const Mask on = s.ellipse ? r.some & is_on(s, end) : r.some;
      at.l = choose(r.large, unit(l), at.l);
      at.end = choose(r.large, end, at.end);
      at.factor = choose(r.large, q.solid_angle * s.factor, at.factor);
      at.inverse_pdf = choose(r.large, q.solid_angle, at.inverse_pdf);
      at.good = (r.large & on) | (~r.large & at.good);
    }
    return at;
  }

  static SeenSample towards(const LightSample& s, const Three& x, const Three& l) {
    SeenSample at = Area::towards(s, x, l);
    const Part r(s, x);
    if (any(r.large & at.good)) {
      const Doubles solid_angle = r.seen.solid_angle();
      at.factor = choose(r.large, solid_angle * s.factor, at.factor);
      at.inverse_pdf = choose(r.large, solid_angle, at.inverse_pdf);
    }
    return at;
  }

 private:
  /// What x sees of it: with a spread only a square round the foot of the point.
  struct Part {
    Three right, up, axis;
    Rectangle seen;
    Mask large, some;
    Part(const LightSample& s, const Three& p)
        : right(splat3(s.area.rectangle.right)),
          up(splat3(s.area.rectangle.up)),
          axis(splat3(s.axis)) {
      const RectanglePlace& own = s.area.rectangle;
      const Three to = splat3(s.center) - p;
      const Doubles x = dot(to, right) / own.size, y = dot(to, up) / own.size,
                    z = -dot(to, axis) / own.size;
      large = (dot(to, to) < own.near2) & (z > 1e-30);
      seen = {x - own.half[0], x + own.half[0], y - own.half[1], y + own.half[1], z};
      some = ~Mask{};
      if (s.area.tan_spread > 0) cut(s.area.tan_spread * z);
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
};

}  // namespace
}  // namespace glint
