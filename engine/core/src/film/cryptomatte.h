// Cryptomatte (Friedman and Jones 2015): which things a pixel shows, and how much of it each
// covers.
#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "film/passes.h"

namespace glint {

/// What a path's camera ray met: the bits of the ids of each pass, and the share of the path that
/// stays there.
struct CryptoMeeting {
  uint32_t path, ids[3];
  double weight;
};

/// Sums of the shares that things have of each pixel, for each of the three passes. One thread a
/// tile at a time.
class Cryptomatte {
 public:
  static constexpr Passes kPasses = pass_bit(GLINT_PASS_CRYPTO_OBJECT) |
                                    pass_bit(GLINT_PASS_CRYPTO_MATERIAL) |
                                    pass_bit(GLINT_PASS_CRYPTO_ASSET);
  /// A thing in the pixel of a slot.
  struct Share {
    uint32_t slot, id;
    double weight;
  };

  explicit Cryptomatte(Passes passes = 0, uint32_t ids = 0)
      : passes_(passes & kPasses), ids_(ids) {}
  bool on() const { return passes_ != 0; }
  size_t ids() const { return ids_; }
  static float as_float(uint32_t id) { return std::bit_cast<float>(id); }

  void set_tiles(size_t count) {
    for (int k = 0; k < 3; ++k)
      if (wants(k)) shares_[k].resize(count);
  }

  /// Adds meetings, whose `path` is by now the slot in the tile, by slots upward and within one in
  /// the order of its samples.
  void add(size_t tile, const std::vector<CryptoMeeting>& meetings);

  /// keep(slot, begin, end) for each slot of the tile that has shares: the largest first, of equal
  /// ones the lower id.
  template <class Keep>
  void each_pixel(int pass, size_t tile, Keep keep) {
    const std::vector<Share>& all = shares_[pass - GLINT_PASS_CRYPTO_OBJECT][tile];
    std::vector<Share> some;
    for (size_t first = 0, last; first < all.size(); first = last) {
      for (last = first; last < all.size() && all[last].slot == all[first].slot;) ++last;
      some.assign(all.begin() + std::ptrdiff_t(first), all.begin() + std::ptrdiff_t(last));
      rank(some);
      keep(all[first].slot, some.data(), some.data() + some.size());
    }
  }

 private:
  bool wants(int number) const { return passes_ >> (GLINT_PASS_CRYPTO_OBJECT + number) & 1; }
  static void rank(std::vector<Share>& shares);

  Passes passes_;
  uint32_t ids_;
  std::vector<std::vector<Share>> shares_[3];  // a list a tile, by slots upward
};

}  // namespace glint
