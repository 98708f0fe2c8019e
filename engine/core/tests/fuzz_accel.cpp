#include <algorithm>
#include <cmath>
#include <thread>

#include "fuzz_cases.h"

namespace glint::fuzz {
namespace {

struct F32 {
  using Real = float;
  using Rays = GlintRaysF32;
  using Hits = GlintHitsF32;
  static constexpr auto closest = glint_accel_closest_f32;
  static constexpr auto occluded = glint_accel_occluded_f32;
};
struct F64 {
  using Real = double;
  using Rays = GlintRaysF64;
  using Hits = GlintHitsF64;
  static constexpr auto closest = glint_accel_closest_f64;
  static constexpr auto occluded = glint_accel_occluded_f64;
};

template <class Type>
typename Type::Rays rays(Dice& dice, Arena& arena) {
  using Real = typename Type::Real;
  typename Type::Rays r{};
  r.count = dice.chance(0.1) ? 0 : dice.chance(0.1) ? 1000 + dice.below(3000) : 1 + dice.below(200);
  auto numbers = [&](uint32_t& stride, uint32_t row, double factor) {
    stride = dice.chance(0.3) ? 0 : row + uint32_t(row == 3 ? dice.below(3) : 0);
    const size_t size = r.count == 0 ? 0 : stride * (r.count - 1) + row;
    return arena.fill<Real>(size, [&] { return Real(factor * dice.number()); });
  };
  r.origins = numbers(r.origin_stride, 3, 2);
  r.directions = numbers(r.direction_stride, 3, 1);
  if (dice.chance(0.5)) r.t_min = numbers(r.t_min_stride, 1, 1);
  if (dice.chance(0.5)) r.t_max = numbers(r.t_max_stride, 1, 4);
  r.visibility = uint32_t(1 + dice.below(7));
  r.threads = uint32_t(dice.below(4));
  if (dice.wildness > 0 && dice.chance(0.05)) r.visibility = uint32_t(dice.bits());
  if (dice.wildness > 0 && dice.chance(0.05)) r.origin_stride = uint32_t(dice.below(3));
  if (dice.wildness > 0 && dice.chance(0.03)) r.directions = nullptr;
  return r;
}

template <class Type>
struct Answers {
  using Real = typename Type::Real;
  explicit Answers(size_t n) : t(n), u(n), v(n), instance(n), primitive(n), blocked(n) {}
  typename Type::Hits room() {
    return {t.data(), instance.data(), primitive.data(), u.data(), v.data()};
  }
  std::vector<Real> t;
  std::vector<float> u, v;
  std::vector<int32_t> instance, primitive;
  std::vector<uint8_t> blocked;
};

/// How many primitives the geometry of every placement has.
std::vector<uint64_t> primitives_of(const GlintAccelData& data) {
  std::vector<uint64_t> counts;
  for (uint64_t i = 0; i < data.instances_count; ++i)
    counts.insert(counts.end(), data.instances[i].row_count,
                  data.geometries[data.instances[i].geometry].primitive_count);
  return counts;
}

template <class Type>
void check_hits(const Answers<Type>& a, const typename Type::Rays& r,
                const std::vector<uint64_t>& primitives, Tally& tally) {
  using Real = typename Type::Real;
  for (size_t k = 0; k < r.count; ++k) {
    const bool hit = a.instance[k] >= 0;
    expect(a.blocked[k] == hit, "closest and any hit disagree");
    if (!hit) {
      expect(a.instance[k] == -1 && a.primitive[k] == -1 && std::isinf(a.t[k]) && a.u[k] == 0 &&
                 a.v[k] == 0,
             "a miss is marked badly");
      continue;
    }
    ++tally.hits;
    expect(size_t(a.instance[k]) < primitives.size(), "a placement that does not exist");
    expect(a.primitive[k] >= 0 && uint64_t(a.primitive[k]) < primitives[size_t(a.instance[k])],
           "a primitive that does not exist");
    const Real low = r.t_min ? std::max(r.t_min[k * r.t_min_stride], Real(0)) : Real(0);
    const Real high = r.t_max ? r.t_max[k * r.t_max_stride] : Real(INFINITY);
    expect(a.t[k] >= low && a.t[k] <= high, "a hit outside of its interval");
    expect(a.u[k] >= 0 && a.v[k] >= 0 && a.u[k] + a.v[k] <= 1.000001f,
           "barycentric weights outside of the triangle");
  }
}

/// Others ask the same at the same time.
template <class Type>
void ask_at_once(const GlintAccel* handle, const typename Type::Rays& r,
                 const Answers<Type>& first) {
  std::vector<std::thread> others;
  for (int k = 0; k < 3; ++k)
    others.emplace_back([&] {
      Answers<Type> a(r.count);
      const typename Type::Hits room = a.room();
      expect(Type::closest(handle, &r, &room, nullptr, 0) == 0,
             "one of several at once is refused");
      expect(a.t == first.t && a.primitive == first.primitive && a.instance == first.instance,
             "answers differ where several ask at once");
    });
  for (std::thread& other : others) other.join();
}

template <class Type>
void ask(const GlintAccel* handle, const GlintAccelData& data, Dice& dice, Tally& tally) {
  Arena arena;
  const typename Type::Rays r = rays<Type>(dice, arena);
  Answers<Type> a(r.count);
  ErrorBuffer error(dice);
  const typename Type::Hits room = a.room();
  if (Type::closest(handle, &r, &room, error.data(), error.size) != 0) {
    ++tally.refused;
    return error.check();
  }
  expect(Type::occluded(handle, &r, a.blocked.data(), error.data(), error.size) == 0,
         "any hit refuses what closest takes");
  check_hits(a, r, primitives_of(data), tally);
  if (dice.chance(0.1)) ask_at_once<Type>(handle, r, a);
  tally.rays += r.count;
}

}  // namespace

void try_accel(Dice& dice, Tally& tally) {
  Arena arena;
  const GlintAccelData data = accel(dice, arena);
  ErrorBuffer error(dice);
  GlintAccel* handle =
      glint_accel_create(dice.chance(0.01) ? nullptr : &data, int32_t(dice.below(4)),
                         uint32_t(dice.below(4)), error.data(), error.size);
  if (!handle) {
    ++tally.refused;
    return error.check();
  }
  const GlintAccelStats stats = glint_accel_stats(handle);
  expect(stats.primitives + stats.dropped <= 1000000, "more primitives than were given");
  for (int k = 0; k < 3; ++k)
    dice.chance(0.5) ? ask<F32>(handle, data, dice, tally) : ask<F64>(handle, data, dice, tally);
  glint_accel_destroy(handle);
  ++tally.accels;
}

}  // namespace glint::fuzz
