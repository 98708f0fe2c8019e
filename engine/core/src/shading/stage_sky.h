// What comes from a dome, by direction and by normal (glint.h). Letters: l direction, n normal.
#pragma once
#include "program/functions_trig.h"
#include "shading/stage_math.h"
#include "shading/stage_rows.h"
#include "shading/stages.h"

namespace glint {
namespace {

/// What comes from a dome in the direction l, over the density of its directions there, and one
/// over that.
struct SkyCell {
  Three color;
  Doubles spread;
};
/// Where a direction is on a dome's maps, 0 to 1.
struct SkyPlace {
  Doubles around, upward;
};
inline SkyPlace sky_place(const DomeCells& dome, const Three& l) {
  const Doubles x = dot(l, splat3(dome.axes[0])), y = dot(l, splat3(dome.axes[1])),
                z = dot(l, splat3(dome.axes[2]));
  return {0.5 - atan2(y, x) / (2 * kCircle), 0.5 + atan2(z, root(x * x + y * y)) / kCircle};
}

/// The integer part of a place on an axis of so many cells.
inline Doubles cell_of(Doubles at, size_t cells) {
  const double last = cells > 0 ? double(cells - 1) : 0;
  return larger(smaller(down(at), splat(last)), splat(0));
}

inline SkyCell sky_cell(const DomeCells& dome, const Three& l) {
  const SkyPlace at = sky_place(dome, l);
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
  const SkyPlace at = sky_place(dome, n);
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

/// How densely, a steradian, points on openings lie in the unit direction l from x, for each of the
/// directions that are taken beside them.
inline Doubles opening_density(const Openings& openings, const Three& x, const Three& l) {
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

/// What the directions of a sample and its points on openings give together, times how many
/// directions there are.
inline Three given_beside_openings(const DomeStage& s, size_t k, const Three& n) {
  const Three x = load3(s.x, k);
  Three given{};
  const auto add = [&](const Three& l, const Three& color, const Doubles& spread) {
    const Doubles less = 1 + opening_density(*s.openings, x, l) * spread;
    given = given + (larger(dot(l, n), splat(0)) / less) * color;
  };
  for (size_t i = 0; i < s.directions; ++i) {
    const double* const row = s.drawn + kDomeColumns * i;
    add(splat3(row), splat3(row + 3), splat(row[6]));
  }
  for (size_t j = 0; j < s.opening_point_count; ++j) {
    const OpeningPoint& on = s.opening_points[j];
    const Three l = unit(splat3(on.at) - x);
    const SkyCell cell = sky_cell(*s.dome, l);
    add(l, where(dot(l, splat3(on.normal)) > 0, cell.spread) * cell.color, cell.spread);
  }
  return given;
}

void dome(const DomeStage& s) {
  for (size_t k = 0; k < s.count; k += kLanes) {
    if (!any(load(s.lit + k))) continue;
    const Three n = load3(s.n, k);
    Three given{};
    for (size_t i = 0; i < s.directions; ++i) {
      const double* const row = s.drawn + kDomeColumns * i;
      given = given + larger(dot(splat3(row), n), splat(0)) * splat3(row + 3);
    }
    if (s.openings->count) given = given_beside_openings(s, k, n);
    const Three rest = unhidden(*s.dome, n) - splat(1.0 / double(s.directions)) * given;
    store3(s.rest, k, load3(s.diffuse, k) * rest);
  }
}

}  // namespace
}  // namespace glint
