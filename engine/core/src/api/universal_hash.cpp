// NH, the universal hash of UMAC (Black, Halevi, Krawczyk, Krovetz and Rogaway 1999, UMAC: Fast and
// secure message authentication), four times with shifted keys (Toeplitz).
#include <algorithm>
#include <array>

#include "glint.h"

namespace {

constexpr uint64_t kBlock = GLINT_HASH_BLOCK, kHalf = kBlock / 2;
constexpr int kSums = GLINT_HASH_SUMS;

/// Key number k: the upper half of SplitMix64's number k + 1 (Steele, Lea and Flood 2014).
constexpr uint32_t key(uint64_t k) {
  uint64_t z = (k + 1) * 0x9E3779B97F4A7C15;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EB;
  return uint32_t((z ^ (z >> 31)) >> 32);
}

constexpr std::array<uint32_t, kBlock + kSums> kKeys = [] {
  std::array<uint32_t, kBlock + kSums> keys{};
  for (uint64_t k = 0; k < keys.size(); ++k) keys[k] = key(k);
  return keys;
}();

uint64_t hash(const uint32_t* words, const uint32_t* keys) {
  uint64_t sum = 0;
  for (uint64_t k = 0; k < kHalf; ++k)
    sum += uint64_t{words[k] + keys[k]} * uint64_t{words[kHalf + k] + keys[kHalf + k]};
  return sum;
}

}  // namespace

void glint_universal_hash(const uint32_t* words, uint64_t count, uint64_t* sums) {
  for (uint64_t first = 0; first < count; first += kBlock) {
    const uint32_t* block = words + first;
    uint32_t padded[kBlock];
    if (count - first < kBlock) {
      std::fill(std::copy(block, words + count, padded), padded + kBlock, 0u);
      block = padded;
    }
    for (int number = 0; number < kSums; ++number) *sums++ = hash(block, kKeys.data() + number);
  }
}
