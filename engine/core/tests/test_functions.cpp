// The elementary functions: the same bits from every instruction set.
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "check.h"
#include "glint.h"
#include "program/functions_table.h"

namespace {

constexpr size_t kCount = 1000003;  // no multiple of any number of lanes

/// SplitMix64.
struct Bits {
  uint64_t state;
  uint64_t next() {
    uint64_t z = state += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }
  double uniform() { return double(next() >> 11) * 0x1p-53; }
};

/// One in four any pattern of bits, one a quarter of an integer, the others of all usual sizes.
std::vector<double> arguments(uint64_t seed) {
  Bits random{seed};
  std::vector<double> x(kCount);
  for (double& a : x) {
    const uint64_t kind = random.next() % 4;
    const double size = kind == 2 ? 2 : 1500, value = size * (2 * random.uniform() - 1);
    a = kind == 0   ? __builtin_bit_cast(double, random.next())
        : kind == 1 ? std::round(value) / 4
                    : value;
  }
  const double special[] = {0.,        -0.,      1,         -1,  0.5,  5e-324,
                            0x1p-1022, HUGE_VAL, -HUGE_VAL, NAN, 1e30, 0x1p20};
  for (size_t k = 0; k < 4000; ++k) x[random.next() % kCount] = special[k % 12];
  return x;
}

/// The bits of numbers, those of any NaN the same.
std::vector<uint64_t> bits_of(const std::vector<double>& numbers) {
  std::vector<uint64_t> bits(numbers.size());
  for (size_t k = 0; k < bits.size(); ++k)
    bits[k] = __builtin_bit_cast(uint64_t, std::isnan(numbers[k]) ? double(NAN) : numbers[k]);
  return bits;
}

}  // namespace

/// This file is compiled for the least machine, the library for all.
TEST(functions, the_same_bits_from_every_instruction_set) {
  const std::vector<double> x = arguments(1), y = arguments(2);
  std::vector<double> out(kCount);
  for (const glint::NamedFunction& f : glint::kNamedFunctions) {
    if (!f.name) continue;
    f.apply(x.data(), y.data(), out.data(), kCount);
    const std::vector<uint64_t> least = bits_of(out);
    for (const char* isa : {"sse42", "avx2", "avx512"}) {
      glint::test::ask_for_isa(isa);
      CHECK(glint_function(f.name, x.data(), y.data(), out.data(), kCount) == 0);
      const bool same = bits_of(out) == least;
      if (!same) std::fprintf(stderr, "%s differs with %s\n", f.name, isa);
      CHECK(same);
    }
    glint::test::ask_for_isa(nullptr);
  }
}
