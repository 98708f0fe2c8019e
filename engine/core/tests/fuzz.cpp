// fuzz [cases] [seconds] [first seed]: feeds the C API arbitrary sizes, indices and floats. It
// must refuse with a text or answer soundly: finite pixels, hits that exist and lie in their
// interval, the same verdict from closest and any hit; also where memory and threads run out, where
// others cancel or ask at the same time, and where a scene takes over from another. Run it under
// the sanitizers.
#include <cinttypes>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "fuzz_cases.h"
#include "fuzz_shortage.h"

#if defined(__linux__)
extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*)());
#endif

namespace glint::fuzz {

void expect(bool good, const char* what) {
  if (good) return;
  std::fprintf(stderr, "seed %" PRIu64 ": %s\n", current_seed, what);
  std::exit(1);
}

namespace {

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
  expect(!glint_accel_create(&data, GLINT_BUILD_FAST, 1, error, sizeof error) &&
             std::strstr(error, "2^31"),
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
