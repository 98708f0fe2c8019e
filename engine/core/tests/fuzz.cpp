// fuzz [cases] [seconds] [first seed]: feeds the C door arbitrary sizes, indices and floats. It must refuse with a text or answer soundly:
// finite pixels, hits that exist and lie in their interval, the same verdict from closest and any hit. Run it under the sanitizers.
#include <algorithm>
#include <chrono>
#include <cinttypes>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "fuzz_input.h"

#if defined(__linux__)
extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*)());
#endif

namespace glint::fuzz {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

struct Tally {
  uint64_t refused = 0, renders = 0, accels = 0, rays = 0, hits = 0;
};

uint64_t current_seed = 0;

void name_seed() { std::fprintf(stderr, "seed %" PRIu64 " ends the process\n", current_seed); }

/// Crashes name their seed too. The sanitizers have a hook of their own.
void watch_crashes() {
#if defined(__linux__)
  if (__sanitizer_set_death_callback) return __sanitizer_set_death_callback(name_seed);
#endif
  for (int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGILL})
    std::signal(signal, [](int number) {
      name_seed();
      std::_Exit(128 + number);
    });
}

void expect(bool good, const char* what) {
  if (good) return;
  std::fprintf(stderr, "seed %" PRIu64 ": %s\n", current_seed, what);
  std::exit(1);
}

/// A caller's buffer for errors, of any size, with a mark behind it.
struct ErrorBuffer {
  explicit ErrorBuffer(Dice& dice) : size(dice.chance(0.2) ? dice.below(4) : 64 + dice.below(4000)), bytes(size + 1, '#') {}
  char* data() { return size ? bytes.data() : nullptr; }
  /// After a refusal: a text that ends in time and says something.
  void check() const {
    expect(bytes[size] == '#', "the error text runs over its buffer");
    expect(size < 2 || (std::memchr(bytes.data(), 0, size) != nullptr && bytes[0] != 0), "refused without a text");
  }
  size_t size;
  std::string bytes;
};

// --- renders ---

size_t pixels_of(const GlintRenderSettings& s) { return size_t(s.region[2] - s.region[0]) * (s.region[3] - s.region[1]); }

/// The picture of the first wave that was there, which is to stay as it is whatever comes after.
class Kept {
 public:
  void look(GlintRender* render, const GlintRenderSettings& s) {
    if (picture_) return;
    const size_t size = 4 * pixels_of(s);
    picture_ = glint_render_picture(render, GLINT_PASS_COMBINED, size);
    if (picture_) copy_.assign(values(), values() + size);
  }
  ~Kept() {
    if (!picture_) return;
    expect(std::equal(copy_.begin(), copy_.end(), values()), "a later wave was drawn into the picture of an earlier one");
    glint_picture_free(picture_);
  }

 private:
  const float* values() const { return glint_picture_values(picture_); }
  GlintPicture* picture_ = nullptr;
  std::vector<float> copy_;
};

void check_pixels(GlintRender* render, const GlintRenderSettings& s) {
  static constexpr int channels[GLINT_PASS_COUNT] = {4, 3, 3, 3, 3, 3, 3, 3, 1, 3, 3, 3, 1, 1, 1, 1, 1, 1, 1, 1};
  for (int pass = 0; pass < GLINT_PASS_COUNT; ++pass) {
    const size_t size = pixels_of(s) * size_t(channels[pass]);
    expect(!glint_render_picture(render, pass, size + 1), "a picture of the wrong size");
    GlintPicture* picture = glint_render_picture(render, pass, size);
    if (!picture) {
      expect(!(s.passes >> pass & 1), "there is no picture of a pass that was asked for");
      continue;
    }
    const float* values = glint_picture_values(picture);
    const bool finite = std::all_of(values, values + size, [](float x) { return std::isfinite(x); });
    expect(finite, ("a number of pass " + std::to_string(pass) + " is not finite").c_str());
    glint_picture_free(picture);
  }
}

/// Mirrors and glass one behind the other can ask for millions of rays: after a while such a render is cancelled, and has to end soon.
void run(GlintRender* render, const GlintRenderSettings& s, Dice& dice, Kept& kept) {
  constexpr double kPatience = 15, kLongest = 60;  // seconds
  bool cancel = dice.chance(0.2);
  Dice pace = dice;  // how often it is thrown depends on the machine, and what comes after must not
  const auto start = Clock::now();
  GlintProgress progress{};
  do {
    progress = glint_render_wait(render, uint32_t(pace.below(30)));
    expect(progress.fraction >= 0 && progress.fraction <= 1, "the fraction is not between 0 and 1");
    kept.look(render, s);
    if (progress.state == GLINT_HELD) glint_render_resume(render);
    cancel |= seconds_since(start) > kPatience;
    if (cancel) glint_render_cancel(render);
    expect(seconds_since(start) < kLongest, "a small render takes a minute, although it was cancelled");
  } while (progress.state < GLINT_DONE);
  expect(progress.state != GLINT_FAILED, glint_render_error(render));
  expect(cancel || progress.state == GLINT_DONE, "the render ended early");
  if (progress.state == GLINT_DONE) check_pixels(render, s);
  glint_render_stats(render);
}

void try_render(Dice& dice, Tally& tally) {
  Arena arena;
  const GlintSceneData data = scene(dice, arena);
  ErrorBuffer error(dice);
  GlintScene* handle = glint_scene_create(dice.chance(0.01) ? nullptr : &data, error.data(), error.size);
  if (!handle) return ++tally.refused, error.check();
  for (size_t k = 1 + dice.below(2); k > 0; --k) {
    const GlintRenderSettings s = settings(dice, arena, data);
    ErrorBuffer why(dice);
    GlintRender* render = glint_render_start(handle, &s, why.data(), why.size);
    if (!render) {
      ++tally.refused, why.check();
      continue;
    }
    Kept kept;
    if (dice.chance(0.9)) run(render, s, dice, kept), ++tally.renders;
    glint_render_destroy(render);
  }
  glint_scene_destroy(handle);
}

// --- queries ---

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
  r.origins = numbers(r.origin_stride, 3, 2), r.directions = numbers(r.direction_stride, 3, 1);
  if (dice.chance(0.5)) r.t_min = numbers(r.t_min_stride, 1, 1);
  if (dice.chance(0.5)) r.t_max = numbers(r.t_max_stride, 1, 4);
  r.visibility = uint32_t(1 + dice.below(7)), r.threads = uint32_t(dice.below(4));
  if (dice.wildness > 0 && dice.chance(0.05)) r.visibility = uint32_t(dice.bits());
  if (dice.wildness > 0 && dice.chance(0.05)) r.origin_stride = uint32_t(dice.below(3));
  if (dice.wildness > 0 && dice.chance(0.03)) r.directions = nullptr;
  return r;
}

template <class Type>
struct Answers {
  using Real = typename Type::Real;
  explicit Answers(size_t n) : t(n), u(n), v(n), instance(n), primitive(n), blocked(n) {}
  typename Type::Hits room() { return {t.data(), instance.data(), primitive.data(), u.data(), v.data()}; }
  std::vector<Real> t;
  std::vector<float> u, v;
  std::vector<int32_t> instance, primitive;
  std::vector<uint8_t> blocked;
};

/// How many primitives the geometry of every placement has.
std::vector<uint64_t> primitives_of(const GlintAccelData& data) {
  std::vector<uint64_t> counts;
  for (uint64_t i = 0; i < data.instances_count; ++i)
    counts.insert(counts.end(), data.instances[i].row_count, data.geometries[data.instances[i].geometry].primitive_count);
  return counts;
}

template <class Type>
void check_hits(const Answers<Type>& a, const typename Type::Rays& r, const std::vector<uint64_t>& primitives, Tally& tally) {
  using Real = typename Type::Real;
  for (size_t k = 0; k < r.count; ++k) {
    const bool hit = a.instance[k] >= 0;
    expect(a.blocked[k] == hit, "closest and any hit disagree");
    if (!hit) {
      expect(a.instance[k] == -1 && a.primitive[k] == -1 && std::isinf(a.t[k]) && a.u[k] == 0 && a.v[k] == 0, "a miss is marked badly");
      continue;
    }
    ++tally.hits;
    expect(size_t(a.instance[k]) < primitives.size(), "a placement that does not exist");
    expect(a.primitive[k] >= 0 && uint64_t(a.primitive[k]) < primitives[size_t(a.instance[k])], "a primitive that does not exist");
    const Real low = r.t_min ? std::max(r.t_min[k * r.t_min_stride], Real(0)) : Real(0);
    const Real high = r.t_max ? r.t_max[k * r.t_max_stride] : Real(INFINITY);
    expect(a.t[k] >= low && a.t[k] <= high, "a hit outside of its interval");
    expect(a.u[k] >= 0 && a.v[k] >= 0 && a.u[k] + a.v[k] <= 1.000001f, "barycentric weights outside of the triangle");
  }
}

template <class Type>
void ask(const GlintAccel* handle, const GlintAccelData& data, Dice& dice, Tally& tally) {
  Arena arena;
  const typename Type::Rays r = rays<Type>(dice, arena);
  Answers<Type> a(r.count);
  ErrorBuffer error(dice);
  const typename Type::Hits room = a.room();
  if (Type::closest(handle, &r, &room, error.data(), error.size) != 0) return ++tally.refused, error.check();
  expect(Type::occluded(handle, &r, a.blocked.data(), error.data(), error.size) == 0, "any hit refuses what closest takes");
  check_hits(a, r, primitives_of(data), tally);
  tally.rays += r.count;
}

void try_accel(Dice& dice, Tally& tally) {
  Arena arena;
  const GlintAccelData data = accel(dice, arena);
  ErrorBuffer error(dice);
  GlintAccel* handle = glint_accel_create(dice.chance(0.01) ? nullptr : &data, uint32_t(dice.below(4)), error.data(), error.size);
  if (!handle) return ++tally.refused, error.check();
  const GlintAccelStats stats = glint_accel_stats(handle);
  expect(stats.primitives + stats.dropped <= 1000000, "more primitives than were given");
  for (int k = 0; k < 3; ++k) dice.chance(0.5) ? ask<F32>(handle, data, dice, tally) : ask<F64>(handle, data, dice, tally);
  glint_accel_destroy(handle);
  ++tally.accels;
}

// --- what no random case would be ---

/// 2^32 placements from tables of some megabytes.
void too_many_placements() {
  constexpr size_t n = 1 << 16;
  std::vector<GlintInstances> groups(n);
  for (GlintInstances& g : groups) g.row_count = n, g.flags = 7;
  const std::vector<double> matrices(12 * n, 1.0);
  const GlintGeometry nothing{};
  const GlintAccelData data{&nothing, groups.data(), matrices.data(), 1, n, n};
  char error[200] = "";
  expect(!glint_accel_create(&data, 1, error, sizeof error) && std::strstr(error, "2^31"), "2^32 placements are not refused");
}

void nulls() {
  char error[200] = "";
  expect(glint_accel_closest_f32(nullptr, nullptr, nullptr, error, sizeof error) == -1 && error[0], "null is not refused");
  expect(glint_accel_occluded_f64(nullptr, nullptr, nullptr, nullptr, 0) == -1, "null is not refused");
  expect(!glint_scene_create(nullptr, error, sizeof error) && !glint_render_start(nullptr, nullptr, error, sizeof error), "null scene");
  glint_accel_destroy(nullptr), glint_scene_destroy(nullptr), glint_render_destroy(nullptr);
  expect(std::strlen(glint_isa()) > 0, "no name of an instruction set");
}

}  // namespace
}  // namespace glint::fuzz

int main(int argc, char** argv) {
  using namespace glint::fuzz;
  const uint64_t cases = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1000;
  const double seconds = argc > 2 ? std::strtod(argv[2], nullptr) : 60;
  const uint64_t first = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  const auto start = Clock::now();
  watch_crashes();
  nulls(), too_many_placements();
  Tally tally;
  uint64_t done = 0;
  for (; done < cases && seconds_since(start) < seconds; ++done) {
    current_seed = first + done;
    Dice dice(current_seed);
    dice.chance(0.5) ? try_render(dice, tally) : try_accel(dice, tally);
  }
  std::printf("%" PRIu64 " cases, %.0f a second: %" PRIu64 " refused, %" PRIu64 " renders, %" PRIu64 " accelerators, %" PRIu64
              " rays, %" PRIu64 " hits\n",
              done, double(done) / seconds_since(start), tally.refused, tally.renders, tally.accels, tally.rays, tally.hits);
  return 0;
}
