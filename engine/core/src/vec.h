// Small vectors and affine maps. Letters: o origin, d direction, p point, n normal, t ray parameter, m matrix.
#pragma once
#include <cmath>

namespace glint {

template <class T>
struct Vec3 {
  T x{}, y{}, z{};
  Vec3() = default;
  constexpr Vec3(T x, T y, T z) : x(x), y(y), z(z) {}
  template <class U>
  explicit constexpr Vec3(const Vec3<U>& v) : x(T(v.x)), y(T(v.y)), z(T(v.z)) {}
  constexpr T& operator[](int i) { return (&x)[i]; }
  constexpr T operator[](int i) const { return (&x)[i]; }
};

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

template <class T> constexpr Vec3<T> operator+(Vec3<T> a, Vec3<T> b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class T> constexpr Vec3<T> operator-(Vec3<T> a, Vec3<T> b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <class T> constexpr Vec3<T> operator*(Vec3<T> a, Vec3<T> b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
template <class T> constexpr Vec3<T> operator*(T s, Vec3<T> a) { return {s * a.x, s * a.y, s * a.z}; }
template <class T> constexpr Vec3<T> operator*(Vec3<T> a, T s) { return s * a; }
template <class T> constexpr Vec3<T> operator-(Vec3<T> a) { return {-a.x, -a.y, -a.z}; }
template <class T> constexpr Vec3<T>& operator+=(Vec3<T>& a, Vec3<T> b) { return a = a + b; }
template <class T> constexpr T dot(Vec3<T> a, Vec3<T> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class T> constexpr Vec3<T> cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T> T length(Vec3<T> a) { return std::sqrt(dot(a, a)); }
/// The zero vector stays zero.
template <class T> Vec3<T> normalize(Vec3<T> a) {
  T l = length(a);
  return l > T(0) ? (T(1) / l) * a : a;
}
template <class T> bool finite(Vec3<T> a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

/// p -> x*p.x + y*p.y + z*p.z + t: columns of a (3, 4) matrix.
struct Affine {
  Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, t{0, 0, 0};
};
inline Vec3d direction(const Affine& m, Vec3d v) { return v.x * m.x + v.y * m.y + v.z * m.z; }
inline Vec3d point(const Affine& m, Vec3d p) { return direction(m, p) + m.t; }

}  // namespace glint
