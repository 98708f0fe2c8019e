// Image lookup: four neighbours, sixteen or the closest texel, centres at (i + 0.5) / width. The
// codes of sRGB bytes are filtered as they are, and the curve is undone afterwards, as in Cycles.
// A coordinate that is not finite reads as 0. Letters: u v of the unit square, i index in an
// endless row of texels.
#pragma once
#include "shading/stages.h"
#include "simd/lanes.h"

namespace glint {
namespace {

inline Doubles clamped(Doubles x, double low, double high) {
  return choose(x < low, splat(low), choose(x > high, splat(high), x));
}

inline Doubles reduce(Doubles x, int extension) {
  x = finite_or_zero(x);
  if (extension == GLINT_REPEAT) return x - down(x);
  if (extension == GLINT_MIRROR_EXTENSION) return x - 2 * down(0.5 * x);
  return clamped(x, -2, 3);
}

inline Whole wrap(Doubles i, double size, int extension) {
  if (extension == GLINT_EXTEND) return whole(clamped(i, 0, size - 1));
  if (extension == GLINT_CLIP) return whole(choose((i >= 0) & (i < size), i, splat(-1)));
  const double period = extension == GLINT_MIRROR_EXTENSION ? 2 * size : size;
  i = i + choose(i < 0, splat(period), choose(i >= period, splat(-period), splat(0)));
  return whole(choose(i < size, i, 2 * size - 1 - i));
}

/// The two texels next to a coordinate and the way between them.
struct Axis {
  Whole first, second;
  Doubles way;
};

inline Axis axis_of(const TextureShape& t, Doubles x, double size) {
  const Doubles at = reduce(x, t.extension) * size;
  if (t.interpolation == GLINT_CLOSEST)
    return {wrap(down(at), size, t.extension), Whole{}, Doubles{}};
  const Doubles first = down(at - 0.5);
  return {wrap(first, size, t.extension), wrap(first + 1, size, t.extension), at - 0.5 - first};
}

/// Texels of a group, as colours or as their alpha.
struct Texels {
  size_t at[kLanes];  // of the first channel
  Mask inside = ~Mask{};
  Texels(const TextureShape& t, Whole column, Whole row) {
    for (size_t lane = 0; lane < kLanes; ++lane)
      at[lane] = 4 * (size_t(row[lane]) * t.width + size_t(column[lane]));
    if (t.extension != GLINT_CLIP) return;
    for (size_t lane = 0; lane < kLanes; ++lane) {
      const bool out = column[lane] < 0 || row[lane] < 0;
      inside[lane] = out ? 0 : -1;
      at[lane] = out ? 0 : at[lane];
    }
  }
};

inline Doubles channel(const TextureShape& t, const Texels& texels, size_t c, const double* codes) {
  const auto number = [&](size_t lane) {
    return double(static_cast<const float*>(t.pixels)[texels.at[lane] + c]);
  };
  const auto decoded = [&](size_t lane) {
    return codes[static_cast<const uint8_t*>(t.pixels)[texels.at[lane] + c]];
  };
  const Doubles v = t.type == GLINT_FLOAT32 ? each_lane(number) : each_lane(decoded);
  return t.extension == GLINT_CLIP ? where(texels.inside, v) : v;
}

inline Three colors(const TextureShape& t, const Texels& at) {
  return {channel(t, at, 0, t.decode), channel(t, at, 1, t.decode), channel(t, at, 2, t.decode)};
}
inline Doubles alphas(const TextureShape& t, const Texels& at) {
  return channel(t, at, 3, t.linear);
}

template <class Value>
inline Value mix(const Value& a, const Value& b, Doubles t) {
  return (1 - t) * a + t * b;
}

/// The sRGB curve undone.
inline Doubles decoded(const double* curve, Doubles code) {
  const Doubles at = code * double(kCurveSteps), first = down(at);
  const Whole step = whole(first);
  const Doubles low = read_at(curve, step), high = read_at(curve + 1, step),
                curved = low + (at - first) * (high - low);
  const Mask in_toe = code <= kSrgbToe;
  return bits(in_toe) ? choose(in_toe, code / 12.92, curved) : curved;
}

inline Three filtered_colors(const TextureShape& t, const Three& c) {
  return t.curve ? Three{decoded(t.curve, c.x), decoded(t.curve, c.y), decoded(t.curve, c.z)} : c;
}
inline Doubles filtered_colors(const TextureShape&, Doubles alpha) { return alpha; }

/// The four texels round a coordinate, and their weights: those of a uniform cubic B-spline.
struct CubicAxis {
  Whole at[4];
  Doubles weight[4];
};

inline CubicAxis cubic_axis(const TextureShape& t, Doubles x, double size) {
  const Doubles at = reduce(x, t.extension) * size, first = down(at - 0.5), w = at - 0.5 - first,
                rest = 1 - w, w2 = w * w, w3 = w2 * w;
  CubicAxis axis{
      {},
      {rest * rest * rest / 6, (3 * w3 - 6 * w2 + 4) / 6, (3 * (w2 - w3) + 3 * w + 1) / 6, w3 / 6}};
  const bool turns = t.extension == GLINT_REPEAT || t.extension == GLINT_MIRROR_EXTENSION;
  const double period = t.extension == GLINT_MIRROR_EXTENSION ? 2 * size : size;
  for (size_t k = 0; k < 4; ++k) {
    Doubles i = first + (double(k) - 1);
    if (turns) i = i - period * down(i / period);  // images may be smaller than four texels
    axis.at[k] = wrap(i, size, t.extension);
  }
  return axis;
}

template <auto read>
inline auto sample_cubic(const TextureShape& t, Doubles u, Doubles v) {
  const CubicAxis x = cubic_axis(t, u, t.width), y = cubic_axis(t, v, t.height);
  const auto row = [&](size_t j) {
    auto sum = x.weight[0] * read(t, {t, x.at[0], y.at[j]});
    for (size_t i = 1; i < 4; ++i) sum = sum + x.weight[i] * read(t, {t, x.at[i], y.at[j]});
    return sum;
  };
  auto sum = y.weight[0] * row(0);
  for (size_t j = 1; j < 4; ++j) sum = sum + y.weight[j] * row(j);
  return filtered_colors(t, sum);
}

/// Codes of bytes over 255, to the bits of the division: the first part of 1/255 is so short that
/// its product is exact.
constexpr double kShortOver255 = 0x1.01010101p-8, kRestOver255 = 0x1.010101010101p-48;
constexpr bool is_division() {
  for (int i = 0; i < 256; ++i)
    if (i * kShortOver255 + i * kRestOver255 != i / 255.0) return false;
  return true;
}
static_assert(is_division());

/// The four bytes of a group's texels, the first lowest.
inline Whole words_at(const TextureShape& t, Whole column, Whole row) {
  return read_at(static_cast<const int32_t*>(t.pixels), row * int32_t(t.width) + column);
}

inline Doubles byte_of(Whole words, int number) {
  const Doubles code = __builtin_convertvector(words >> 8 * number & 255, Doubles);
  return code * kShortOver255 + code * kRestOver255;
}

/// Four neighbours of an image of bytes, as `Texels` and `channel` have them.
struct Quad {
  Whole words[4];
  Doubles x, y;
  Quad(const TextureShape& t, const Axis& u, const Axis& v)
      : words{words_at(t, u.first, v.first), words_at(t, u.second, v.first),
              words_at(t, u.first, v.second), words_at(t, u.second, v.second)},
        x(u.way),
        y(v.way) {}
  Doubles channel(int c) const {
    return mix(mix(byte_of(words[0], c), byte_of(words[1], c), x),
               mix(byte_of(words[2], c), byte_of(words[3], c), x), y);
  }
};
inline Three quad_colors(const Quad& q) { return {q.channel(0), q.channel(1), q.channel(2)}; }
inline Doubles quad_alphas(const Quad& q) { return q.channel(3); }

/// Whether a Quad can be read of an image: one of bytes, of fewer than 2^31 texels, without an
/// edge beyond which nothing is.
inline bool is_plain(const TextureShape& t) {
  return t.type == GLINT_UINT8 && t.interpolation == GLINT_LINEAR && t.extension != GLINT_CLIP &&
         uint64_t(t.width) * t.height < (uint64_t(1) << 31);
}

/// What `read`, colors or alphas, makes of the texels at a coordinate.
template <auto read, auto read_quad>
inline auto sample(const TextureShape& t, Doubles u, Doubles v) {
  if (t.interpolation == GLINT_CUBIC) return sample_cubic<read>(t, u, v);
  const Axis x = axis_of(t, u, t.width), y = axis_of(t, v, t.height);
  if (is_plain(t)) return filtered_colors(t, read_quad(Quad(t, x, y)));
  if (t.interpolation == GLINT_CLOSEST) return read(t, {t, x.first, y.first});
  return filtered_colors(
      t, mix(mix(read(t, {t, x.first, y.first}), read(t, {t, x.second, y.first}), x.way),
             mix(read(t, {t, x.first, y.second}), read(t, {t, x.second, y.second}), x.way), y.way));
}

inline Three sample_color(const TextureShape& t, Doubles u, Doubles v) {
  return sample<colors, quad_colors>(t, u, v);
}
inline Doubles sample_alpha(const TextureShape& t, Doubles u, Doubles v) {
  return sample<alphas, quad_alphas>(t, u, v);
}

}  // namespace
}  // namespace glint
