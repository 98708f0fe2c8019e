// Operations on colours, and those that read tables.
#pragma once
#include "program/functions.h"
#include "program/machine.h"
#include "program/safe_functions.h"

namespace glint {
namespace {

inline Three three(Doubles a) { return {a, a, a}; }

/// of(x) or of(x, y) for each channel.
template <class Of>
inline Three each_channel(const Three& a, Of of) {
  return {of(a.x), of(a.y), of(a.z)};
}
template <class Of>
inline Three each_channel(const Three& a, const Three& b, Of of) {
  return {of(a.x, b.x), of(a.y, b.y), of(a.z, b.z)};
}

inline Three mixed(Doubles t, const Three& a, const Three& b) { return (1 - t) * a + t * b; }

inline Doubles highest(const Three& c) { return larger(c.x, larger(c.y, c.z)); }
inline Doubles lowest(const Three& c) { return smaller(c.x, smaller(c.y, c.z)); }
inline Doubles unit_range(Doubles x) { return smaller(larger(x, splat(0)), splat(1)); }

/// Hue in sixths, from -1 to 5.
inline Doubles hue_sector(const Three& c, Doubles high, Doubles span) {
  const Doubles down = choose(span != 0, span, splat(1));
  const Doubles r = (high - c.x) / down, g = (high - c.y) / down, b = (high - c.z) / down;
  return choose(c.x == high, b - g, choose(c.y == high, 2 + r - b, 4 + g - r));
}

inline Three rgb_to_hsv(const Three& c) {
  const Doubles high = highest(c), span = high - lowest(c);
  const Doubles s = where(high != 0, span / choose(high != 0, high, splat(1)));
  const Doubles h = where(s != 0, hue_sector(c, high, span) / 6);
  return {choose(h < 0, h + 1, h), s, high};
}

inline Three hsv_to_rgb(const Three& hsv) {
  const Doubles s = hsv.y, v = hsv.z, h = choose(hsv.x == 1, splat(0), hsv.x) * 6;
  const Doubles i = down(h), f = h - i;
  const Doubles p = v * (1 - s), q = v * (1 - s * f), t = v * (1 - s * (1 - f));
  Three found{v, p, q};
  found = choose(i == 0, Three{v, t, p}, found);
  found = choose(i == 1, Three{q, v, p}, found);
  found = choose(i == 2, Three{p, v, t}, found);
  found = choose(i == 3, Three{p, q, v}, found);
  found = choose(i == 4, Three{t, p, v}, found);
  return choose(s != 0, found, three(v));
}

inline Three rgb_to_hsl(const Three& c) {
  const Doubles high = highest(c), low = lowest(c), span = high - low, total = high + low;
  const Doubles light = smaller(splat(1), total / 2);
  const Doubles under = choose(light > 0.5, 2 - high - low, total);
  const Mask grey = span == 0;
  const Doubles s = where(~grey, span / choose(grey, splat(1), under));
  const Doubles sector = hue_sector(c, high, span);
  const Doubles h = choose((c.x == high) & (c.y < c.z), sector + 6, sector) / 6;
  return {where(~grey, h), s, light};
}

inline Three hsl_to_rgb(const Three& hsl) {
  const Doubles h = hsl.x * 6, light = hsl.z;
  const Doubles chroma = (1 - magnitude(2 * light - 1)) * hsl.y;
  const auto part = [&](Doubles x) { return (unit_range(x) - 0.5) * chroma + light; };
  return {part(magnitude(h - 3) - 1), part(2 - magnitude(h - 2)), part(2 - magnitude(h - 4))};
}

/// engine/program/operations_color.py's BlendType.
enum class Blend : int32_t {
  kMix,
  kDarken,
  kMultiply,
  kBurn,
  kLighten,
  kScreen,
  kDodge,
  kAdd,
  kOverlay,
  kSoftLight,
  kLinearLight,
  kDifference,
  kExclusion,
  kSubtract,
  kDivide,
  kHue,
  kSaturation,
  kColor,
  kValue
};

inline Doubles burnt(Doubles t, Doubles a, Doubles b) {
  const Doubles under = 1 - t + t * b;
  const Doubles found = 1 - (1 - a) / choose(under <= 0, splat(1), under);
  return where(~(under <= 0), unit_range(found));
}

inline Doubles dodged(Doubles t, Doubles a, Doubles b) {
  const Doubles under = 1 - t * b;
  const Doubles found = smaller(a / choose(under <= 0, splat(1), under), splat(1));
  return where(a != 0, choose(under <= 0, splat(1), found));
}

inline Doubles overlaid(Doubles t, Doubles a, Doubles b) {
  return choose(a < 0.5, a * (1 - t + 2 * t * b), 1 - (1 - t + 2 * t * (1 - b)) * (1 - a));
}

inline Doubles divided(Doubles t, Doubles a, Doubles b) {
  return choose(b != 0, (1 - t) * a + t * a / choose(b != 0, b, splat(1)), a);
}

/// Blends of channels by themselves.
inline Doubles blended(Blend kind, Doubles t, Doubles a, Doubles b) {
  const auto to = [&](Doubles c) { return (1 - t) * a + t * c; };
  switch (kind) {
    case Blend::kDarken: return to(smaller(a, b));
    case Blend::kMultiply: return to(a * b);
    case Blend::kBurn: return burnt(t, a, b);
    case Blend::kLighten: return to(larger(a, b));
    case Blend::kScreen: return 1 - (1 - t + t * (1 - b)) * (1 - a);
    case Blend::kDodge: return dodged(t, a, b);
    case Blend::kAdd: return to(a + b);
    case Blend::kOverlay: return overlaid(t, a, b);
    case Blend::kSoftLight:
      return (1 - t) * a + t * ((1 - a) * b * a + a * (1 - (1 - b) * (1 - a)));
    case Blend::kLinearLight: return a + t * (2 * b - 1);
    case Blend::kDifference: return to(magnitude(a - b));
    case Blend::kExclusion: return larger(to(a + b - 2 * a * b), splat(0));
    case Blend::kSubtract: return to(a - b);
    case Blend::kDivide: return divided(t, a, b);
    default: return to(b);
  }
}

/// Blends in HSV.
inline Three blended_hsv(Blend kind, Doubles t, const Three& a, const Three& b) {
  const Three p = rgb_to_hsv(a), q = rgb_to_hsv(b);
  if (kind == Blend::kHue) return choose(q.y != 0, mixed(t, a, hsv_to_rgb({q.x, p.y, p.z})), a);
  if (kind == Blend::kColor) return choose(q.y != 0, mixed(t, a, hsv_to_rgb({q.x, q.y, p.z})), a);
  if (kind == Blend::kSaturation)
    return choose(p.y != 0, hsv_to_rgb({p.x, (1 - t) * p.y + t * q.y, p.z}), a);
  return hsv_to_rgb({p.x, p.y, (1 - t) * p.z + t * q.z});
}

/// Between which rows of a table a place is: where they begin, and the share of the second.
struct TableRows {
  Whole first, second;
  Doubles t;
};

/// A table: rows of `columns` numbers after the first `head` of them.
struct Table {
  const double* head;
  const double* rows;
  size_t columns;
  double last;  // number of the last row

  Table(const Machine& m, int32_t at, size_t head_size, size_t width)
      : head(m.program.tables + at + 1),
        rows(head + head_size),
        columns(width),
        last(double((size_t(m.program.tables[at]) - head_size) / width) - 1) {}

  /// Of places from 0 to 1.
  TableRows rows_at(Doubles place) const {
    const Doubles x = finite_or_zero(place) * last, first = ::glint::down(x);
    const auto begin = [&](Doubles row) { return whole(row) * int32_t(columns); };
    return {begin(first), begin(smaller(first + 1, splat(last))), x - first};
  }
  Doubles between(const TableRows& at, size_t column) const {
    return (1 - at.t) * read_at(rows + column, at.first) + at.t * read_at(rows + column, at.second);
  }
  /// A column at places from 0 to 1.
  Doubles at(Doubles place, size_t column, bool interpolates) const {
    const TableRows found = rows_at(place);
    return interpolates ? between(found, column) : read_at(rows + column, found.first);
  }
  double slope_before(size_t c) const { return (rows[columns + c] - rows[c]) * last; }
  double slope_after(size_t c) const {
    const double* end = rows + size_t(last) * columns;
    return (end[c] - (end - columns)[c]) * last;
  }
};

namespace op {

inline void rgb_to_bw(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three c = at.vector(0, k);
    at.put(0, k, 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z);
  });
}

inline void mix_color(const Machine& m, const Operands& at) {
  const Blend kind = Blend(at.settings[0]);
  each_group(m, [&](size_t k) {
    const Doubles t = at.number(0, k);
    const Three a = at.vector(1, k), b = at.vector(2, k);
    at.put(0, k,
           kind >= Blend::kHue
               ? blended_hsv(kind, t, a, b)
               : each_channel(a, b, [&](Doubles x, Doubles y) { return blended(kind, t, x, y); }));
  });
}

inline void mix_vector(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three t = at.vector(0, k);
    at.put(0, k, (Three{splat(1), splat(1), splat(1)} - t) * at.vector(1, k) + t * at.vector(2, k));
  });
}

inline void mix_number(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Doubles t = at.number(0, k);
    at.put(0, k, (1 - t) * at.number(1, k) + t * at.number(2, k));
  });
}

inline void gamma(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Doubles power = at.number(1, k);
    at.put(0, k, each_channel(at.vector(0, k), [&](Doubles x) {
             const Mask positive = x > 0;
             const Doubles found = choose(positive, pow(choose(positive, x, splat(1)), power), x);
             return choose(power == 0, splat(1), found);
           }));
  });
}

inline void bright_contrast(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Doubles contrast = at.number(2, k), add = at.number(1, k) - contrast * 0.5;
    at.put(0, k, each_channel(at.vector(0, k), [&](Doubles x) {
             return larger((1 + contrast) * x + add, splat(0));
           }));
  });
}

inline void invert(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Doubles t = at.number(0, k);
    at.put(0, k,
           each_channel(at.vector(1, k), [&](Doubles x) { return t * (1 - x) + (1 - t) * x; }));
  });
}

inline void hue_saturation(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three color = at.vector(4, k), hsv = rgb_to_hsv(color);
    const Doubles turned = hsv.x + at.number(0, k) + 0.5, t = at.number(3, k);
    const Three found = hsv_to_rgb(
        {turned - down(turned), unit_range(hsv.y * at.number(1, k)), hsv.z * at.number(2, k)});
    at.put(0, k, each_channel(t * found + (1 - t) * color, [](Doubles x) {
             return larger(x, splat(0));
           }));
  });
}

inline void separate_color(const Machine& m, const Operands& at) {
  const int mode = at.settings[0];
  each_group(m, [&](size_t k) {
    const Three c = at.vector(0, k);
    const Three parts = mode == 1 ? rgb_to_hsv(c) : mode == 2 ? rgb_to_hsl(c) : c;
    at.put(0, k, parts.x);
    at.put(1, k, parts.y);
    at.put(2, k, parts.z);
  });
}

inline void combine_color(const Machine& m, const Operands& at) {
  const int mode = at.settings[0];
  each_group(m, [&](size_t k) {
    const Three c{at.number(0, k), at.number(1, k), at.number(2, k)};
    at.put(0, k, mode == 1 ? hsv_to_rgb(c) : mode == 2 ? hsl_to_rgb(c) : c);
  });
}

inline void map_range(const Machine& m, const Operands& at) {
  enum { kLinear, kStepped, kSmooth, kSmoother };
  const int kind = at.settings[0];
  each_group(m, [&](size_t k) {
    const Doubles from = at.number(1, k), span = at.number(2, k) - from;
    Doubles t = (at.number(0, k) - from) / choose(span != 0, span, splat(1));
    if (kind == kStepped) {
      const Doubles steps = at.number(5, k), over = choose(steps > 0, steps, splat(1));
      t = where(steps > 0, down(t * (steps + 1)) / over);
    } else if (kind != kLinear) {
      t = unit_range(t);
      t = kind == kSmooth ? t * t * (3 - 2 * t) : t * t * t * (t * (t * 6 - 15) + 10);
    }
    const Doubles to = at.number(3, k);
    at.put(0, k, where(span != 0, to + t * (at.number(4, k) - to)));
  });
}

inline void ramp(const Machine& m, const Operands& at) {
  const bool interpolates = at.settings[0] != 0;
  const Table table(m, at.settings[1], 0, 4);
  each_group(m, [&](size_t k) {
    const Doubles place = unit_range(finite_or_zero(at.number(0, k)));
    const auto column = [&](size_t c) { return table.at(place, c, interpolates); };
    if (at.wants(0)) at.put(0, k, Three{column(0), column(1), column(2)});
    if (at.wants(1)) at.put(1, k, column(3));
  });
}

inline void lookup(const Machine& m, const Operands& at) {
  const size_t last = size_t(at.settings[0]);
  const Table table(m, at.settings[1], 0, last + 1);
  each_group(m, [&](size_t k) {
    const TableRows rows = table.rows_at(unit_range(finite_or_zero(at.number(0, k))));
    for (size_t c = 0; c < 4; ++c)
      if (at.wants(c)) at.put(c, k, c <= last ? table.between(rows, c) : splat(0));
  });
}

inline void curves(const Machine& m, const Operands& at) {
  const bool extends = at.settings[0] != 0;
  const Table table(m, at.settings[1], 2, 3);
  const double low = table.head[0], span = table.head[1] - low;
  each_group(m, [&](size_t k) {
    const Three color = at.vector(1, k);
    const auto mapped = [&](Doubles x, size_t c) {
      const Doubles place = (x - low) / span;
      Doubles found = table.at(unit_range(place), c, true);
      if (!extends) return found;
      found = found + where(place < 0, table.slope_before(c) * place);
      return found + where(place > 1, table.slope_after(c) * (place - 1));
    };
    at.put(0, k,
           mixed(at.number(0, k), color,
                 {mapped(color.x, 0), mapped(color.y, 1), mapped(color.z, 2)}));
  });
}

inline void piecewise(const Machine& m, const Operands& at) {
  constexpr size_t kWidth = 16;
  const Table table(m, at.settings[0], 0, kWidth);
  each_group(m, [&](size_t k) {
    const Doubles x = at.number(0, k), over = where(x != 0, 1 / choose(x != 0, x, splat(1)));
    Doubles row = splat(0);
    for (size_t r = 1; r <= size_t(table.last); ++r)
      row = choose(x >= table.rows[r * kWidth], splat(double(r)), row);
    const auto part = [&](size_t c) {
      return each_lane([&](size_t lane) { return table.rows[size_t(row[lane]) * kWidth + c]; });
    };
    const auto channel = [&](size_t c) {
      return part(c) * over +
             (((part(c + 4) * x + part(c + 3)) * x + part(c + 2)) * x + part(c + 1));
    };
    at.put(0, k, Three{channel(1), channel(6), channel(11)});
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
