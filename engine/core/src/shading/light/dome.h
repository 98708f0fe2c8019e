// Domes: what comes from their maps, by direction and by normal (glint.h); directions, and points
// on openings that these show them through. Letters: l direction, n normal.
#pragma once
#include "program/functions_trig.h"
#include "shading/light/shape.h"

namespace glint {
namespace {

/// What comes from a dome in a direction, over the pdf of its directions there, and one over that.
struct DomeCell {
  Three color;
  Doubles inverse_pdf;
};
/// Where a direction is on a dome's maps, 0 to 1.
struct MapPlace {
  Doubles around, upward;
};
inline MapPlace map_place(const DomeCells& dome, const Three& l) {
  const Doubles x = dot(l, splat3(dome.axes[0])), y = dot(l, splat3(dome.axes[1])),
                z = dot(l, splat3(dome.axes[2]));
  return {0.5 - atan2(y, x) / (2 * kCircle), 0.5 + atan2(z, root(x * x + y * y)) / kCircle};
}

/// The integer part of a place on an axis of so many cells.
inline Doubles cell_of(Doubles at, size_t cells) {
  const double last = cells > 0 ? double(cells - 1) : 0;
  return larger(smaller(down(at), splat(last)), splat(0));
}

inline DomeCell dome_cell(const DomeCells& dome, const Three& l) {
  const MapPlace at = map_place(dome, l);
  const Mask row = __builtin_convertvector(cell_of(at.upward * double(dome.rows), dome.rows), Mask),
             column = __builtin_convertvector(
                 cell_of(at.around * double(dome.columns), dome.columns), Mask);
  const auto part = [&](size_t c) {
    return each_lane([&](size_t lane) {
      return double(dome.cells[4 * (size_t(row[lane]) * dome.columns + size_t(column[lane])) + c]);
    });
  };
  return {{part(0), part(1), part(2)}, part(3)};
}

/// The irradiance over pi of surfaces with the normal n that nothing hides the dome from.
inline Three unhidden(const DomeCells& dome, const Three& n) {
  const size_t rows = dome.irradiance_rows - 1, columns = dome.irradiance_columns - 1;
  const MapPlace at = map_place(dome, n);
  const Doubles x = at.around * double(columns), y = at.upward * double(rows),
                left = cell_of(x, columns), low = cell_of(y, rows), a = x - left, b = y - low;
  const Mask i = __builtin_convertvector(left, Mask), j = __builtin_convertvector(low, Mask);
  const auto corner = [&](size_t right, size_t high, size_t c) {
    return each_lane([&](size_t lane) {
      const size_t row = size_t(j[lane]) + (rows > 0 ? high : 0),
                   column = size_t(i[lane]) + (columns > 0 ? right : 0);
      return double(dome.irradiance[3 * (row * dome.irradiance_columns + column) + c]);
    });
  };
  const auto part = [&](size_t c) {
    const Doubles p = corner(0, 0, c), q = corner(0, 1, c), below = p + a * (corner(1, 0, c) - p);
    return below + b * (q + a * (corner(1, 1, c) - q) - below);
  };
  return {part(0), part(1), part(2)};
}

/// The pdf, a steradian, of points on openings in the unit direction l from x, for each of the
/// directions that are taken besides.
inline Doubles opening_pdf(const Openings& openings, const Three& x, const Three& l) {
  Doubles total{};
  for (size_t i = 0; i < openings.count; ++i) {
    const Opening& on = openings.rows[i];
    const Three n = splat3(on.normal), to = splat3(on.center) - x;
    const Doubles z = dot(n, l), down = choose(z > 0, z, splat(1)), t = dot(n, to) / down;
    const Three off = t * l - to;
    const Mask here = (z > 0) & (t > 0) & (magnitude(dot(off, splat3(on.across))) <= 1) &
                      (magnitude(dot(off, splat3(on.along))) <= 1);
    total = total + where(here, on.density * t * t / down);
  }
  return total;
}

/// Directions alone.
struct Dome : ShapeTraits {
  static constexpr LightShape kShape = LightShape::kDome;

  static SeenSample sample(const LightSample& s, const Three&) {
    return {splat3(s.dome.l), splat3(s.dome.l), splat(s.factor), splat(s.inverse_pdf), ~Mask{}};
  }
  static SeenCell towards(const LightSample& s, const Three&, const Three& l) {
    const DomeCell cell = dome_cell(*s.dome_cells, l);
    return {{l, l, splat(s.factor), cell.inverse_pdf, ~Mask{}}, cell.color};
  }

  using ShapeTraits::color;
  static Three color(const LightSample&, const SeenCell& at) { return at.color; }
  using ShapeTraits::share;
  static void share(const LightSample& s, SeenCell& at) {
    ShapeTraits::share(s, at);
    at.factor = at.factor * at.inverse_pdf;
  }
  static double draws(const LightSample& s) { return 1 / double(s.dome_cells->every); }
};

/// Directions and points on openings, weighed by the balance heuristic.
struct OpenDome : Dome {
  static constexpr LightShape kShape = LightShape::kOpenDome;

  static SeenCell sample(const LightSample& s, const Three& x) {
    if (s.through) {
      SeenCell at = towards(s, x, unit(splat3(s.dome.end) - x));
      at.good &= dot(at.l, splat3(s.axis)) > 0;
      return at;
    }
    return beside_openings(s, x, splat3(s.dome.l), splat(s.factor),
                           {splat3(s.color), splat(s.inverse_pdf)});
  }
  static SeenCell towards(const LightSample& s, const Three& x, const Three& l) {
    const DomeCell cell = dome_cell(*s.dome_cells, l);
    return beside_openings(s, x, l, s.factor * cell.inverse_pdf, cell);
  }
  static void share(const LightSample& s, SeenCell& at) { ShapeTraits::share(s, at); }

 private:
  static SeenCell beside_openings(const LightSample& s, const Three& x, const Three& l,
                                  const Doubles& factor, const DomeCell& cell) {
    const Doubles less = 1 + opening_pdf(*s.openings, x, l) * cell.inverse_pdf;
    return {{l, l, factor / less, cell.inverse_pdf / less, ~Mask{}}, cell.color};
  }
};

}  // namespace
}  // namespace glint
