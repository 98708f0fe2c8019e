// Small vectors and affine maps. Letters: o origin, d direction, p point, n normal, t ray
// parameter, m matrix.
#pragma once
#include <algorithm>
#include <cmath>

namespace glint {

template <class T>
struct Vec3 {
  T x{}, y{}, z{};
  Vec3() = default;
  constexpr Vec3(T a, T b, T c) : x(a), y(b), z(c) {}
  template <class U>
  explicit constexpr Vec3(const Vec3<U>& v) : x(T(v.x)), y(T(v.y)), z(T(v.z)) {}
  constexpr T& operator[](int i) {
    return i == 0 ? x : i == 1 ? y : z;
  }  // not (&x)[i]: Clang miscompiles that
  constexpr T operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

template <class T>
constexpr Vec3<T> operator+(Vec3<T> a, Vec3<T> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
constexpr Vec3<T> operator-(Vec3<T> a, Vec3<T> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
constexpr Vec3<T> operator*(Vec3<T> a, Vec3<T> b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}
template <class T>
constexpr Vec3<T> operator*(T s, Vec3<T> a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
constexpr Vec3<T> operator*(Vec3<T> a, T s) {
  return s * a;
}
template <class T>
constexpr Vec3<T> operator-(Vec3<T> a) {
  return {-a.x, -a.y, -a.z};
}
template <class T>
constexpr Vec3<T>& operator+=(Vec3<T>& a, Vec3<T> b) {
  return a = a + b;
}
template <class T>
constexpr T dot(Vec3<T> a, Vec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
constexpr Vec3<T> cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
T length(Vec3<T> a) {
  return std::sqrt(dot(a, a));
}
/// The zero vector stays zero.
template <class T>
Vec3<T> normalize(Vec3<T> a) {
  T l = length(a);
  return l > T(0) ? (T(1) / l) * a : a;
}
template <class T>
bool finite(Vec3<T> a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}
template <class T>
bool any(Vec3<T> a) {
  return a.x != 0 || a.y != 0 || a.z != 0;
}
template <class T>
T mean(Vec3<T> a) {
  return (a.x + a.y + a.z) / 3;
}
template <class T>
Vec3<T> abs(Vec3<T> a) {
  return {std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)};
}
template <class T>
Vec3<T> max(Vec3<T> a, Vec3<T> b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}
template <class T>
Vec3<T> min(Vec3<T> a, Vec3<T> b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
template <class T>
T max_abs(Vec3<T> a) {
  return std::max({std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)});
}

/// The direction of any finite non-zero vector, however short or long; otherwise the zero vector.
inline Vec3d unit(Vec3d a) {
  double m = max_abs(a);
  if (!(m > 0 && m <= 1e308)) return {};
  if (!(m > 1e-100 && m < 1e100)) a = Vec3d{a.x / m, a.y / m, a.z / m};
  return normalize(a);
}

/// p -> x*p.x + y*p.y + z*p.z + t: columns of a (3, 4) matrix.
struct Affine {
  Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, t{0, 0, 0};
};
inline Vec3d direction(const Affine& m, Vec3d v) { return v.x * m.x + v.y * m.y + v.z * m.z; }
inline Vec3d point(const Affine& m, Vec3d p) { return direction(m, p) + m.t; }

/// From the rows of a (3, 4) matrix, 12 numbers.
inline Affine affine(const double* m) {
  return {{m[0], m[4], m[8]}, {m[1], m[5], m[9]}, {m[2], m[6], m[10]}, {m[3], m[7], m[11]}};
}
inline bool finite(const Affine& m) {
  return finite(m.x) && finite(m.y) && finite(m.z) && finite(m.t);
}

/// Takes normals where m takes points, up to a positive factor: the cofactors of m / max|m| times
/// the sign of its determinant, 0 counting as +1, so that outside stays outside. Zero when m has
/// rank 1 or less.
struct NormalMatrix {
  Vec3d x, y, z;  // columns
  NormalMatrix(Vec3d a, Vec3d b, Vec3d c) : x(a), y(b), z(c) {}
  explicit NormalMatrix(const Affine& m) {
    double s = std::max({max_abs(m.x), max_abs(m.y), max_abs(m.z)});
    if (!(s > 0)) return;
    Vec3d a{m.x.x / s, m.x.y / s, m.x.z / s}, b{m.y.x / s, m.y.y / s, m.y.z / s},
        c{m.z.x / s, m.z.y / s, m.z.z / s};
    x = cross(b, c);
    y = cross(c, a);
    z = cross(a, b);
    if (dot(a, x) < 0) {
      x = -x;
      y = -y;
      z = -z;
    }
  }
  Vec3d operator()(Vec3d n) const { return unit(n.x * x + n.y * y + n.z * z); }
};

/// Two unit vectors that make a right-handed frame with the unit vector n (Duff et al. 2017,
/// Building an Orthonormal Basis, Revisited).
struct Frame {
  Vec3d t1, t2;
  explicit Frame(Vec3d n) {
    double s = std::copysign(1.0, n.z), a = -1 / (s + n.z), b = n.x * n.y * a;
    t1 = {1 + s * n.x * n.x * a, s * b, -s * n.x};
    t2 = {b, s + n.y * n.y * a, -n.y};
  }
};

}  // namespace glint
