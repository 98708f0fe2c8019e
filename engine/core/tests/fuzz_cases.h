// One case of the fuzzer each: what it gives to the C API must be refused with a text or answered
// soundly.
#pragma once
#include <chrono>
#include <cstring>
#include <string>

#include "fuzz_input.h"

namespace glint::fuzz {

using Clock = std::chrono::steady_clock;
inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Tally {
  uint64_t refused = 0, renders = 0, taken_over = 0, short_of = 0, accels = 0, rays = 0, hits = 0;
};

inline uint64_t current_seed = 0;

/// Ends the process, and names the seed, where it is not.
void expect(bool good, const char* what);

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

void try_render(Dice& dice, Tally& tally);
/// Scene and render with the n-th allocation or thread refused, whichever it is: a text, a failed
/// render or a sound one.
void try_shortage(Dice& dice, Tally& tally);
void try_accel(Dice& dice, Tally& tally);

}  // namespace glint::fuzz
