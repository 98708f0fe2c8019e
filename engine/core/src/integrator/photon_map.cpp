#include "integrator/photon_map.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "math/math.h"

namespace glint {
namespace {

constexpr double kThin = 0.25;   // of a photon's reach, how far off its plane it lights
constexpr double kAlike = 0.5;   // cosine between the normals of what a photon lights
constexpr int kFinest = -16;     // exponent of two of the smallest cells: their numbers fit 21 bits
constexpr uint64_t kNone = ~uint64_t(0);

/// Whether a photon lights surfaces of that normal in that direction from it.
bool is_alike(const Photon& photon, Vec3d to, double distance2, Vec3d normal) {
  const Vec3d n(photon.normal);
  const double off = dot(to, n);
  return dot(n, normal) > kAlike && off * off <= kThin * kThin * distance2;
}

uint64_t key_of(int64_t x, int64_t y, int64_t z) {
  constexpr int64_t half = int64_t(1) << 20, mask = 2 * half - 1;
  return uint64_t((x + half) & mask) | uint64_t((y + half) & mask) << 21 |
         uint64_t((z + half) & mask) << 42;
}

size_t slot_of(uint64_t key, size_t size) {
  return size_t(key * 0x9e3779b97f4a7c15u >> 32) & (size - 1);
}

/// A tree of medians over photons (Bentley 1975), to find the nearest ones.
class PhotonTree {
 public:
  PhotonTree(const std::vector<Photon>& photons, PhotonRange range)
      : photons_(photons), order_(range.second - range.first), axis_(order_.size()) {
    std::iota(order_.begin(), order_.end(), uint32_t(range.first));
    split(0, order_.size());
  }

  /// The distance to the count-th nearest photon on the same surface; infinity where there are
  /// fewer.
  double reach(uint32_t photon, uint32_t count) const {
    double heap[64];
    Search search{photons_[photon], photon, count, heap, 0};
    look(search, 0, order_.size());
    return search.found < count ? kInfinity : std::sqrt(heap[0]);
  }

 private:
  struct Search {
    const Photon& from;
    uint32_t number, count;
    double* heap;  // squares of distances, the largest first
    uint32_t found;
    double most() const { return found < count ? kInfinity : heap[0]; }
    void add(double distance2) {
      if (found == count) std::pop_heap(heap, heap + found--);
      heap[found++] = distance2;
      std::push_heap(heap, heap + found);
    }
  };

  void split(size_t first, size_t last) {
    if (last - first < 2) return;
    Vec3d low = photons_[order_[first]].x, high = low;
    for (size_t k = first; k < last; ++k) {
      low = min(low, photons_[order_[k]].x);
      high = max(high, photons_[order_[k]].x);
    }
    const Vec3d size = high - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const size_t middle = (first + last) / 2;
    std::nth_element(order_.begin() + ptrdiff_t(first), order_.begin() + ptrdiff_t(middle),
                     order_.begin() + ptrdiff_t(last), [&](uint32_t a, uint32_t b) {
                       const double p = photons_[a].x[axis], q = photons_[b].x[axis];
                       return p != q ? p < q : a < b;
                     });
    axis_[middle] = uint8_t(axis);
    split(first, middle);
    split(middle + 1, last);
  }

  void look(Search& search, size_t first, size_t last) const {
    if (first >= last) return;
    const size_t middle = (first + last) / 2;
    const uint32_t number = order_[middle];
    const Photon& here = photons_[number];
    const Vec3d to = here.x - search.from.x;
    const double distance2 = dot(to, to);
    if (number != search.number && distance2 < search.most() &&
        is_alike(search.from, to, distance2, Vec3d(here.normal)))
      search.add(distance2);
    if (last - first == 1) return;
    const double off = to[axis_[middle]];
    const bool left = off >= 0;
    left ? look(search, first, middle) : look(search, middle + 1, last);
    if (off * off < search.most())
      left ? look(search, middle + 1, last) : look(search, first, middle);
  }

  const std::vector<Photon>& photons_;
  std::vector<uint32_t> order_;
  std::vector<uint8_t> axis_;
};

}  // namespace

PhotonMap::PhotonMap(std::vector<Photon> photons, const std::vector<PhotonRange>& ranges,
                     ThreadPool& pool)
    : photons_(std::move(photons)) {
  for (const PhotonRange& range : ranges) find_radii(range, pool);
  std::map<int, std::vector<uint32_t>> by_size;
  for (uint32_t k = 0; k < photons_.size(); ++k) {
    int exponent = 0;
    std::frexp(photons_[k].radius, &exponent);
    by_size[std::max(exponent, kFinest)].push_back(k);
  }
  for (const auto& [exponent, of_size] : by_size) levels_.push_back(level_of(exponent, of_size));
}

/// Of what few others come near the light is spread as far as the farthest of them.
void PhotonMap::find_radii(PhotonRange range, ThreadPool& pool) {
  constexpr size_t kChunk = 1024;
  const PhotonTree tree(photons_, range);
  each_chunk(range.second - range.first, kChunk, pool, [&](size_t k) {
    const uint32_t number = uint32_t(range.first + k);
    double reach = kInfinity;
    for (uint32_t count = kNeighbours; count > 0 && reach == kInfinity; count /= 2)
      reach = tree.reach(number, count);
    photons_[number].radius = reach == kInfinity ? 0 : reach;
  });
}

double PhotonMap::share_of(const Photon& photon, Vec3d x, Vec3d normal) {
  const Vec3d to = x - photon.x;
  const double distance2 = dot(to, to), reach2 = photon.radius * photon.radius;
  if (!(distance2 < reach2) || !is_alike(photon, to, reach2, normal)) return 0;
  return 2 / (kPi * reach2) * (1 - distance2 / reach2);
}

PhotonMap::Level PhotonMap::level_of(int exponent, const std::vector<uint32_t>& photons) const {
  const double over = std::ldexp(1.0, -exponent);
  std::vector<std::pair<uint64_t, uint32_t>> entries;
  for (const uint32_t k : photons) {
    const Photon& photon = photons_[k];
    int64_t low[3], high[3];
    for (int c = 0; c < 3; ++c) {  // of the disc, as thick as it lights
      const double n = photon.normal[c];
      const double reach = std::min(
          1.0, std::sqrt(std::max(0.0, 1 - n * n)) + kThin * std::fabs(n)) * photon.radius;
      low[c] = int64_t(std::floor((photon.x[c] - reach) * over));
      high[c] = int64_t(std::floor((photon.x[c] + reach) * over));
    }
    for (int64_t z = low[2]; z <= high[2]; ++z)
      for (int64_t y = low[1]; y <= high[1]; ++y)
        for (int64_t x = low[0]; x <= high[0]; ++x) entries.emplace_back(key_of(x, y, z), k);
  }
  std::sort(entries.begin(), entries.end());
  Level level;
  level.exponent = exponent;
  size_t cells = 0;
  for (size_t k = 0; k < entries.size(); ++k)
    cells += k == 0 || entries[k].first != entries[k - 1].first;
  size_t size = 2;
  while (size < 2 * cells) size *= 2;
  level.keys.assign(size, kNone);
  level.begin.resize(size);
  level.end.resize(size);
  for (size_t k = 0; k < entries.size();) {
    const uint64_t key = entries[k].first;
    size_t slot = slot_of(key, size);
    while (level.keys[slot] != kNone) slot = (slot + 1) & (size - 1);
    level.keys[slot] = key;
    level.begin[slot] = uint32_t(k);
    while (k < entries.size() && entries[k].first == key) level.photons.push_back(entries[k++].second);
    level.end[slot] = uint32_t(k);
  }
  return level;
}

std::pair<const uint32_t*, const uint32_t*> PhotonMap::Level::at(Vec3d x) const {
  const double over = std::ldexp(1.0, -exponent);
  const uint64_t key = key_of(int64_t(std::floor(x.x * over)), int64_t(std::floor(x.y * over)),
                              int64_t(std::floor(x.z * over)));
  size_t slot = slot_of(key, keys.size());
  while (keys[slot] != key) {
    if (keys[slot] == kNone) return {nullptr, nullptr};
    slot = (slot + 1) & (keys.size() - 1);
  }
  return {photons.data() + begin[slot], photons.data() + end[slot]};
}

}  // namespace glint
