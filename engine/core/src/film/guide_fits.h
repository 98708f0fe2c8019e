// Light at edges as far as it goes straight along with what is seen there (Moon, Carr, Yoon 2014).
#pragma once
#include <array>
#include <cmath>
#include <cstddef>

namespace glint {
namespace {

// So many guides: of what is seen of surfaces how much, the normal, the place, the colour.
constexpr int kGuides = 8;
// Slopes that so little of the light speaks for are flat: what rounding leaves has none.
constexpr double kFlatter = 1e-3;

/// A number for each of three channels, and one for their sum: two pairs, which every processor
/// has registers for.
struct Four {
  using Pair = double __attribute__((vector_size(2 * sizeof(double))));
  Pair low, high;
  Four() : low{}, high{} {}
  Four(double a, double b, double c, double d) : low{a, b}, high{c, d} {}
  double operator[](int n) const { return n < 2 ? low[n] : high[n - 2]; }
  Four& operator+=(const Four& o) {
    low += o.low;
    high += o.high;
    return *this;
  }
  Four& operator-=(const Four& o) {
    low -= o.low;
    high -= o.high;
    return *this;
  }
  Four& operator*=(const Four& o) {
    low *= o.low;
    high *= o.high;
    return *this;
  }
  Four& operator/=(const Four& o) {
    low /= o.low;
    high /= o.high;
    return *this;
  }
};
inline Four every(double x) { return {x, x, x, x}; }
inline Four operator+(Four a, const Four& b) { return a += b; }
inline Four operator-(Four a, const Four& b) { return a -= b; }
inline Four operator*(Four a, const Four& b) { return a *= b; }
inline Four operator*(double a, Four b) { return b *= every(a); }
inline Four root(const Four& a) {
  return {std::sqrt(a[0]), std::sqrt(a[1]), std::sqrt(a[2]), std::sqrt(a[3])};
}

/// The fits of the values of four to guides that least squares say, at the guides of one pixel and
/// their slopes from there. The last guide, the colour, is each one's own.
class GuideFits {
 public:
  static constexpr int kColor = kGuides - 1;
  using Guides = std::array<double, kColor>;

  void add(double weight, const Guides& guides, const Four& color, const Four& value) {
    for (int i = 0; i < kColor; ++i) {
      const double own = weight * guides[size_t(i)];
      for (int j = 0; j <= i; ++j) a_[i][j] += own * guides[size_t(j)];
      x_[i] += own * value;
    }
    const Four own = weight * color;
    for (int j = 0; j < kColor; ++j) last_[j] += guides[size_t(j)] * own;
    last_[kColor] += own * color;
    x_[kColor] += own * value;
  }
  /// By Cholesky's decomposition; 0 of nothing.
  void solve() {
    const double all = a_[0][0];
    if (!(all > 0)) return;
    for (int i = 1; i < kColor; ++i) a_[i][i] += kFlatter * all;
    last_[kColor] += every(kFlatter * all);
    for (int i = 0; i < kColor; ++i)
      for (int j = 0; j <= i; ++j) {
        for (int k = 0; k < j; ++k) a_[i][j] -= a_[i][k] * a_[j][k];
        a_[i][j] = i == j ? std::sqrt(a_[i][j]) : a_[i][j] / a_[j][j];
      }
    for (int j = 0; j < kColor; ++j) {
      for (int k = 0; k < j; ++k) last_[j] -= a_[j][k] * last_[k];
      last_[j] /= every(a_[j][j]);
      last_[kColor] -= last_[j] * last_[j];
    }
    last_[kColor] = root(last_[kColor]);
    for (int i = 0; i < kColor; ++i) {
      for (int k = 0; k < i; ++k) x_[i] -= a_[i][k] * x_[k];
      x_[i] /= every(a_[i][i]);
      x_[kColor] -= last_[i] * x_[i];
    }
    x_[kColor] /= last_[kColor];
    x_[kColor] /= last_[kColor];
    for (int i = kColor; i-- > 0;) {
      for (int k = i + 1; k < kColor; ++k) x_[i] -= a_[k][i] * x_[k];
      x_[i] -= last_[i] * x_[kColor];
      x_[i] /= every(a_[i][i]);
    }
  }
  Four at(const Guides& guides, const Four& color) const {
    Four sum;
    for (int i = 0; i < kColor; ++i) sum += guides[size_t(i)] * x_[i];
    return sum + x_[kColor] * color;
  }
  const Four& here() const { return x_[0]; }

 private:
  double a_[kColor][kColor] = {};
  Four last_[kGuides], x_[kGuides];
};

}  // namespace
}  // namespace glint
