// Arbitrary input for the C API, reproducible from a seed.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "glint.h"

namespace glint::fuzz {

/// Numbers, most of them sound. `wildness`: the share that is not.
class Dice {
 public:
  explicit Dice(uint64_t seed) : state_(seed) { wildness = below(2) ? 0 : below(2) ? 0.005 : 0.2; }
  uint64_t bits();
  size_t below(size_t n) { return size_t(bits() % n); }
  bool chance(double p) { return double(bits() >> 11) * 0x1p-53 < p; }
  double uniform(double a, double b) { return a + double(bits() >> 11) * 0x1p-53 * (b - a); }
  /// In [-2, 2], or with the chance `wildness` NaN, infinite, denormal, zero, or any size.
  double number();
  /// An index below n, or with a small chance in wild cases any number.
  uint32_t index(size_t n);
  double wildness;

 private:
  uint64_t state_;
};

/// Memory that lives as long as a case. Every array has exactly its size, so that a sanitizer sees
/// the first byte beyond.
class Arena {
 public:
  template <class T>
  T* make(size_t count) {
    T* array = new T[count]();
    kept_.push_back({array, [](void* p) { delete[] static_cast<T*>(p); }});
    return array;
  }
  template <class T>
  T* fill(size_t count, const std::function<T()>& value) {
    T* array = make<T>(count);
    for (size_t k = 0; k < count; ++k) array[k] = value();
    return array;
  }
  /// A copy of a table; with a small chance null where it is empty.
  template <class T>
  const T* table(const std::vector<T>& rows) {
    T* array = make<T>(rows.size());
    for (size_t k = 0; k < rows.size(); ++k) array[k] = rows[k];
    return rows.empty() ? nullptr : array;
  }

 private:
  std::vector<std::unique_ptr<void, void (*)(void*)>> kept_;
};

GlintSceneData scene(Dice& dice, Arena& arena);
/// What a sound scene may have become a moment later: most arrays are the same ones.
GlintSceneData varied(Dice& dice, Arena& arena, const GlintSceneData& before);
GlintAccelData accel(Dice& dice, Arena& arena);
GlintRenderSettings settings(Dice& dice, Arena& arena, const GlintSceneData& scene);

}  // namespace glint::fuzz
