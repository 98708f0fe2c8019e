// fuzz [cases] [seconds] [first seed]: feeds the C door arbitrary sizes, indices and floats. It
// must refuse with a text or answer soundly: finite pixels, hits that exist and lie in their
// interval, the same verdict from closest and any hit; also where memory and threads run out, where
// others cancel or ask at the same time, and where a scene takes over from another. Run it under
// the sanitizers.
#include <algorithm>
#include <chrono>
#include <cinttypes>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

#include "fuzz_input.h"
#include "fuzz_shortage.h"

#if defined(__linux__)
extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*)());
#endif

namespace glint::fuzz {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Tally {
  uint64_t refused = 0, renders = 0, taken_over = 0, short_of = 0, accels = 0, rays = 0, hits = 0;
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
  explicit ErrorBuffer(Dice& dice)
      : size(dice.chance(0.2) ? dice.below(4) : 64 + dice.below(4000)), bytes(size + 1, '#') {}
  char* data() { return size ? bytes.data() : nullptr; }
  /// After a refusal: a text that ends in time and says something.
  void check() const {
    expect(bytes[size] == '#', "the error text runs over its buffer");
    expect(size < 2 || (std::memchr(bytes.data(), 0, size) != nullptr && bytes[0] != 0),
           "refused without a text");
  }
  size_t size;
  std::string bytes;
};

// --- renders ---

size_t pixels_of(const GlintRenderSettings& s) {
  return size_t(s.region[2] - s.region[0]) * (s.region[3] - s.region[1]);
}

/// The picture of the first wave that was there, which is to stay as it is whatever comes after.
class Kept {
 public:
  Kept() = default;
  Kept(const Kept&) = delete;
  Kept& operator=(const Kept&) = delete;
  void look(GlintRender* render, const GlintRenderSettings& s) {
    if (picture_) return;
    const size_t size = 4 * pixels_of(s);
    picture_ = glint_render_picture(render, GLINT_PASS_COMBINED, size);
    if (picture_) copy_.assign(values(), values() + size);
  }
  ~Kept() {
    if (!picture_) return;
    expect(std::equal(copy_.begin(), copy_.end(), values()),
           "a later wave was drawn into the picture of an earlier one");
    glint_picture_free(picture_);
  }

 private:
  const float* values() const { return glint_picture_values(picture_); }
  GlintPicture* picture_ = nullptr;
  std::vector<float> copy_;
};

/// Numbers of a pass; of AOVs and light groups those of as many as have a picture.
size_t size_of(GlintRender* render, const GlintRenderSettings& s, int pass) {
  static constexpr size_t channels[GLINT_PASS_COUNT] = {4, 3, 3, 3, 3, 3, 3, 3, 1, 3, 3, 3, 1, 1, 1,
                                                        1, 1, 1, 1, 1, 1, 0, 0, 0, 4, 3, 3, 1, 3, 3,
                                                        3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 4, 3, 3};
  const bool crypto = pass >= GLINT_PASS_CRYPTO_OBJECT && pass <= GLINT_PASS_CRYPTO_ASSET;
  size_t size = pixels_of(s) * (crypto ? 2 * s.crypto_ids : channels[pass]);
  if (pass != GLINT_PASS_AOV && pass != GLINT_PASS_LIGHT_GROUPS) return size;
  for (size_t count = 1; count <= 3; ++count)
    if (GlintPicture* const found = glint_render_picture(render, pass, count * size)) {
      glint_picture_free(found);
      return count * size;
    }
  return size;
}

void check_pixels(GlintRender* render, const GlintRenderSettings& s) {
  for (int pass = 0; pass < GLINT_PASS_COUNT; ++pass) {
    const size_t size = size_of(render, s, pass);
    expect(!glint_render_picture(render, pass, size + 1), "a picture of the wrong size");
    GlintPicture* picture = glint_render_picture(render, pass, size);
    if (!picture) {
      expect(!(s.passes >> pass & 1), "there is no picture of a pass that was asked for");
      continue;
    }
    const float* values = glint_picture_values(picture);
    const bool finite =
        std::all_of(values, values + size, [](float x) { return std::isfinite(x); });
    expect(finite, ("a number of pass " + std::to_string(pass) + " is not finite").c_str());
    glint_picture_free(picture);
  }
}

/// The scenes of a moving render's samples, which live as long as it does. data: of the first one,
/// null where all samples are to be of that.
struct Moments {
  GlintScene* first = nullptr;
  const GlintSceneData* data = nullptr;
  Arena* arena = nullptr;
  std::vector<GlintScene*> made{};
  Moments(GlintScene* scene) : first(scene) {}
  Moments(GlintScene* scene, const GlintSceneData& of, Arena& in)
      : first(scene), data(&of), arena(&in) {}
  Moments(const Moments&) = delete;
  Moments& operator=(const Moments&) = delete;
  ~Moments() {
    for (GlintScene* scene : made) glint_scene_destroy(scene);
  }
};

/// The next sample's scene: another one or, where that is refused, the first again.
bool give(GlintRender* render, const GlintRenderSettings& s, Moments& moments, Dice& dice) {
  ErrorBuffer error(dice);
  if (moments.data && dice.chance(0.7)) {
    const GlintSceneData data = varied(dice, *moments.arena, *moments.data);
    GlintScene* const base = moments.made.empty() ? moments.first : moments.made.back();
    if (GlintScene* next =
            glint_scene_create_like(base, &data, dice.chance(0.5), error.data(), error.size)) {
      moments.made.push_back(next);
      if (glint_render_move(render, next, &s, error.data(), error.size) == 0) return true;
    }
    error.check();
  }
  return glint_render_move(render, moments.first, &s, nullptr, 0) == 0;
}

/// Mirrors and glass one behind the other can ask for millions of rays: after a while such a render
/// is cancelled, and has to end soon. Gives whether it came to its end. is_short: memory or threads
/// may run out.
bool run(GlintRender* render, const GlintRenderSettings& s, Moments& moments, Dice& dice,
         Kept& kept, bool is_short = false) {
  constexpr double kPatience = 15, kLongest = 60;  // seconds
  bool cancel = dice.chance(0.2);
  const bool by_another = cancel && dice.chance(0.5);
  const auto delay = std::chrono::microseconds(dice.below(3000));
  std::thread other;
  if (by_another)
    other = std::thread([=] {
      std::this_thread::sleep_for(delay);
      glint_render_cancel(render);
    });
  Dice moved = dice,
       pace = dice;  // how often it is thrown depends on the machine, and what comes after must not
  const auto start = Clock::now();
  GlintProgress progress{};
  do {
    progress = glint_render_wait(render, uint32_t(pace.below(30)));
    expect(progress.fraction >= 0 && progress.fraction <= 1, "the fraction is not between 0 and 1");
    kept.look(render, s);
    if (progress.state == GLINT_HELD) glint_render_resume(render);
    if (progress.state == GLINT_MOVING && !cancel && !give(render, s, moments, moved)) {
      expect(is_short, "the scene of the first sample is refused for another one");
      glint_render_cancel(render);
      cancel = true;
    }
    cancel |= seconds_since(start) > kPatience;
    if (cancel && !by_another) glint_render_cancel(render);
    expect(seconds_since(start) < kLongest,
           "a small render takes a minute, although it was cancelled");
  } while (progress.state < GLINT_DONE);
  if (other.joinable()) other.join();
  expect(is_short || progress.state != GLINT_FAILED, glint_render_error(render));
  expect(progress.state != GLINT_FAILED ||
             std::strcmp(glint_render_error(render), "out of memory") == 0,
         glint_render_error(render));
  expect(cancel || is_short || progress.state == GLINT_DONE, "the render ended early");
  if (progress.state == GLINT_DONE && !is_short) check_pixels(render, s);
  glint_render_stats(render);
  return progress.state == GLINT_DONE;
}

/// One render of a scene; the first of its pictures goes to `kept`, which may outlive the scene.
void draw(Moments moments, const GlintRenderSettings& s, Dice& dice, Tally& tally, Kept& kept) {
  ErrorBuffer why(dice);
  GlintRender* render = glint_render_start(moments.first, &s, why.data(), why.size);
  if (!render) {
    ++tally.refused;
    return why.check();
  }
  if (dice.chance(0.9)) {
    run(render, s, moments, dice, kept);
    ++tally.renders;
  }
  glint_render_destroy(render);
}

/// Combined of a whole render without anything that disturbs it; empty where it is not to be had.
std::vector<float> picture_of(GlintScene* scene, const GlintRenderSettings& s, Dice& dice) {
  std::vector<float> values;
  GlintRender* render = glint_render_start(scene, &s, nullptr, 0);
  if (!render) return values;
  Kept none;
  Dice calm = dice;
  calm.wildness = 0;
  Moments still(scene);
  const bool done = run(render, s, still, calm, none);
  GlintPicture* picture =
      done ? glint_render_picture(render, GLINT_PASS_COMBINED, 4 * pixels_of(s)) : nullptr;
  if (picture)
    values.assign(glint_picture_values(picture), glint_picture_values(picture) + 4 * pixels_of(s));
  if (picture) glint_picture_free(picture);
  glint_render_destroy(render);
  return values;
}

/// A scene that takes over from `base`, and another one from that; those that are exact draw what a
/// scene of its own draws, to the bit.
void reuse_from(GlintScene* base, const GlintSceneData& before, Dice& dice, Arena& arena,
                Tally& tally) {
  const GlintSceneData data = varied(dice, arena, before);
  const bool exact = dice.chance(0.5);
  ErrorBuffer error(dice);
  GlintScene* handle = glint_scene_create_like(base, &data, exact, error.data(), error.size);
  if (!handle) {
    ++tally.refused;
    return error.check();
  }
  ++tally.taken_over;
  const GlintRenderSettings s = settings(dice, arena, data);
  if (GlintScene* own = exact ? glint_scene_create(&data, nullptr, 0) : nullptr) {
    const std::vector<float> one = picture_of(handle, s, dice), other = picture_of(own, s, dice);
    const bool both = !one.empty() && !other.empty();
    const bool same =
        !both || std::memcmp(one.data(), other.data(), one.size() * sizeof(float)) == 0;
    expect(same, "a scene that took over exactly draws other bits");
    glint_scene_destroy(own);
  } else {
    Kept kept;
    draw({handle, data, arena}, s, dice, tally, kept);
  }
  if (dice.chance(0.3)) reuse_from(handle, data, dice, arena, tally);
  glint_scene_destroy(handle);
}

void try_render(Dice& dice, Tally& tally) {
  Arena arena;
  const GlintSceneData data = scene(dice, arena);
  ErrorBuffer error(dice);
  GlintScene* handle =
      glint_scene_create(dice.chance(0.01) ? nullptr : &data, error.data(), error.size);
  if (!handle) {
    ++tally.refused;
    return error.check();
  }
  Kept kept[2];  // beyond the scene's own life
  for (size_t k = 1 + dice.below(2); k > 0; --k)
    draw({handle, data, arena}, settings(dice, arena, data), dice, tally, kept[k - 1]);
  if (dice.chance(0.3)) reuse_from(handle, data, dice, arena, tally);
  glint_scene_destroy(handle);
}

/// Scene and render with the n-th allocation or thread refused, whichever it is: a text, a failed
/// render or a sound one.
void try_shortage(Dice& dice, Tally& tally) {
  Arena arena;
  const GlintSceneData data = scene(dice, arena);
  const GlintRenderSettings s = settings(dice, arena, data);
  Dice later = dice;
  char error[200] = "";
  GlintScene* handle;
  GlintRender* render = nullptr;
  {
    const bool of_threads = dice.chance(0.3);
    const size_t number = dice.below(of_threads ? 4 : dice.chance(0.5) ? 50 : 1000);
    const Shortage shortage(of_threads, number, dice.chance(0.5));
    {
      const Inside core;
      handle = glint_scene_create(&data, error, sizeof error);
      if (handle) render = glint_render_start(handle, &s, error, sizeof error);
    }
    Kept kept;
    if (render) {
      Moments still(handle);
      run(render, s, still, later, kept, true);
      ++tally.renders;
    }
    tally.short_of += shortage.refused();
  }
  expect(render || error[0], "refused without a text");
  glint_render_destroy(render);
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

void try_accel(Dice& dice, Tally& tally) {
  Arena arena;
  const GlintAccelData data = accel(dice, arena);
  ErrorBuffer error(dice);
  GlintAccel* handle = glint_accel_create(dice.chance(0.01) ? nullptr : &data,
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

// --- what no random case would be ---

/// 2^32 placements from tables of some megabytes.
void too_many_placements() {
  constexpr size_t n = 1 << 16;
  std::vector<GlintInstances> groups(n);
  for (GlintInstances& g : groups) {
    g.row_count = n;
    g.flags = 7;
  }
  const std::vector<double> matrices(12 * n, 1.0);
  const GlintGeometry nothing{};
  const GlintAccelData data{&nothing, groups.data(), matrices.data(), 1, n, n};
  char error[200] = "";
  expect(!glint_accel_create(&data, 1, error, sizeof error) && std::strstr(error, "2^31"),
         "2^32 placements are not refused");
}

void nulls() {
  char error[200] = "";
  expect(glint_accel_closest_f32(nullptr, nullptr, nullptr, error, sizeof error) == -1 && error[0],
         "null is not refused");
  expect(glint_accel_occluded_f64(nullptr, nullptr, nullptr, nullptr, 0) == -1,
         "null is not refused");
  expect(!glint_scene_create(nullptr, error, sizeof error) &&
             !glint_render_start(nullptr, nullptr, error, sizeof error),
         "null scene");
  glint_accel_destroy(nullptr);
  glint_scene_destroy(nullptr);
  glint_render_destroy(nullptr);
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
  spare_this_thread();
  nulls();
  too_many_placements();
  Tally tally;
  uint64_t done = 0;
  for (; done < cases && seconds_since(start) < seconds; ++done) {
    current_seed = first + done;
    Dice dice(current_seed);
    dice.chance(0.1)   ? try_shortage(dice, tally)
    : dice.chance(0.5) ? try_render(dice, tally)
                       : try_accel(dice, tally);
  }
  std::printf("%" PRIu64 " cases, %.0f a second: %" PRIu64 " refused, %" PRIu64 " renders, %" PRIu64
              " scenes taken over, %" PRIu64 " short of something, %" PRIu64
              " accelerators, %" PRIu64 " rays, %" PRIu64 " hits\n",
              done, double(done) / seconds_since(start), tally.refused, tally.renders,
              tally.taken_over, tally.short_of, tally.accels, tally.rays, tally.hits);
  return 0;
}
