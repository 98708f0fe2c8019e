#include "integrator/photon_map.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "math/math.h"

namespace glint {
namespace {

constexpr double kThin = 0.25;  // of a photon's reach, how far off its plane it lights
constexpr double kAlike = 0.5;  // cosine between the normals of what a photon lights
constexpr int kFinest = -16;    // exponent of two of the smallest cells: their numbers fit 21 bits
constexpr uint64_t kNone = ~uint64_t(0);
// How many others say how far a photon's light reaches: fewer where those of many places of a lamp
// meet, as these are even by themselves. About so many nodes count at a point.
constexpr uint32_t kOfOne = 32, kOfMany = 8, kNodes = 8;

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
  PhotonTree(const std::vector<Photon>& photons, size_t first, size_t last)
      : photons_(photons), order_(last - first), axis_(order_.size()) {
    std::iota(order_.begin(), order_.end(), uint32_t(first));
    split(0, order_.size());
  }

  /// The distance to the count-th nearest photon on the same surface; infinity where there are
  /// fewer.
  double reach(uint32_t photon, uint32_t count) const {
    double heap[kOfOne + 1] = {};
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

/// Sets the radii of photons [first, last): how far the count-th nearest is, or of what fewer come
/// near the farthest of these; 0 for one alone.
void find_radii(std::vector<Photon>& photons, size_t first, size_t last, uint32_t count,
                ThreadPool& pool) {
  constexpr size_t kChunk = 1024;
  const PhotonTree tree(photons, first, last);
  each_chunk(last - first, kChunk, pool, [&](size_t k) {
    double reach = kInfinity;
    for (uint32_t some = count; some > 0 && reach == kInfinity; some /= 2)
      reach = tree.reach(uint32_t(first + k), some);
    photons[first + k].radius = reach == kInfinity ? 0 : reach;
  });
}

/// Those of photons [first, last), by size.
std::vector<PhotonCells> cells_of(const std::vector<Photon>& photons, size_t first, size_t last) {
  std::map<int, std::vector<uint32_t>> by_size;
  for (size_t k = first; k < last; ++k) {
    int exponent = 0;
    std::frexp(photons[k].radius, &exponent);
    if (photons[k].radius > 0) by_size[std::max(exponent, kFinest)].push_back(uint32_t(k));
  }
  std::vector<PhotonCells> cells;
  for (const auto& [exponent, numbers] : by_size) cells.emplace_back(photons, exponent, numbers);
  return cells;
}

/// What a photon counts at a point: 1 - d^2 / r^2 within its radius r, a kernel of Epanechnikov.
double weight_of(const Photon& photon, Vec3d x, Vec3d normal) {
  const Vec3d to = x - photon.x;
  const double distance2 = dot(to, to), reach2 = photon.radius * photon.radius;
  if (!(distance2 < reach2) || !is_alike(photon, to, reach2, normal)) return 0;
  return 1 - distance2 / reach2;
}

/// add(photon, weight) for those that count at a point.
template <class Add>
void each_at(const std::vector<Photon>& photons, const std::vector<PhotonCells>& cells, Vec3d x,
             Vec3d normal, Add add) {
  for (const PhotonCells& of_size : cells) {
    const auto [first, last] = of_size.at(x);
    for (const uint32_t* i = first; i != last; ++i)
      if (const double weight = weight_of(photons[*i], x, normal); weight > 0)
        add(photons[*i], weight);
  }
}

}  // namespace

PhotonMap::PhotonMap(std::vector<Photon> photons, std::vector<PhotonBundle> bundles,
                     ThreadPool& pool)
    : bundles_(std::move(bundles)) {
  for (uint32_t number = 0; number < bundles_.size(); ++number) {
    PhotonBundle& bundle = bundles_[number];
    const size_t last = bundle.ends.back(), places = bundle.ends.size();
    const bool many = places > 1 && last - bundle.first >= kOfOne * places;
    if (!many) bundle.ends = {last};  // few tell more together
    const uint32_t count = many ? kOfMany : kOfOne;
    size_t begin = bundle.first;
    for (const size_t end : bundle.ends) {
      find_radii(photons, begin, end, count, pool);
      begin = end;
    }
    add_nodes(photons, number, count * bundle.ends.size() / kNodes, pool);
  }
  cells_ = cells_of(nodes_, 0, nodes_.size());
}

/// One of so many photons of a bundle each.
void PhotonMap::add_nodes(const std::vector<Photon>& photons, uint32_t number, size_t step,
                          ThreadPool& pool) {
  constexpr size_t kChunk = 256;
  const size_t from = bundles_[number].first, end = bundles_[number].ends.back(),
               first = nodes_.size();
  const std::vector<PhotonCells> cells = cells_of(photons, from, end);
  for (size_t k = from + step / 2; k < end; k += step) {
    nodes_.push_back(photons[k]);
    nodes_.back().bundle = number;
  }
  each_chunk(nodes_.size() - first, kChunk, pool, [&](size_t k) {
    Photon& node = nodes_[first + k];
    Vec3d sum;
    each_at(photons, cells, node.x, Vec3d(node.normal), [&](const Photon& photon, double weight) {
      sum += (2 * weight / (kPi * photon.radius * photon.radius)) * Vec3d(photon.flux);
    });
    node.flux = Vec3f(sum);
  });
  find_radii(nodes_, first, nodes_.size(), kNodes, pool);
}

void PhotonMap::find(Vec3d x, Vec3d normal, std::vector<Found>& found) const {
  found.clear();
  each_at(nodes_, cells_, x, normal, [&](const Photon& node, double weight) {
    auto at = std::find_if(found.begin(), found.end(),
                           [&](const Found& one) { return one.bundle == node.bundle; });
    if (at == found.end()) at = found.insert(at, {node.bundle, 0, {}});
    at->weight += weight;
    at->sum += weight * Vec3d(node.flux);
  });
}

PhotonCells::PhotonCells(const std::vector<Photon>& photons, int exponent,
                         const std::vector<uint32_t>& numbers)
    : over_(std::ldexp(1.0, -exponent)) {
  std::vector<std::pair<uint64_t, uint32_t>> entries;
  for (const uint32_t k : numbers) {
    const Photon& photon = photons[k];
    int64_t low[3], high[3];
    for (int c = 0; c < 3; ++c) {  // of the disc, as thick as it counts
      const double n = double(photon.normal[c]), across = std::sqrt(std::max(0.0, 1 - n * n)),
                   reach = std::min(1.0, across + kThin * std::fabs(n)) * photon.radius;
      low[c] = int64_t(std::floor((photon.x[c] - reach) * over_));
      high[c] = int64_t(std::floor((photon.x[c] + reach) * over_));
    }
    for (int64_t z = low[2]; z <= high[2]; ++z)
      for (int64_t y = low[1]; y <= high[1]; ++y)
        for (int64_t x = low[0]; x <= high[0]; ++x) entries.emplace_back(key_of(x, y, z), k);
  }
  std::sort(entries.begin(), entries.end());
  size_t cells = 0, size = 2;
  for (size_t k = 0; k < entries.size(); ++k)
    cells += k == 0 || entries[k].first != entries[k - 1].first;
  while (size < 2 * cells) size *= 2;
  keys_.assign(size, kNone);
  begin_.resize(size);
  end_.resize(size);
  for (size_t k = 0; k < entries.size();) {
    const uint64_t key = entries[k].first;
    size_t slot = slot_of(key, size);
    while (keys_[slot] != kNone) slot = (slot + 1) & (size - 1);
    keys_[slot] = key;
    begin_[slot] = uint32_t(k);
    for (; k < entries.size() && entries[k].first == key; ++k)
      photons_.push_back(entries[k].second);
    end_[slot] = uint32_t(k);
  }
}

std::pair<const uint32_t*, const uint32_t*> PhotonCells::at(Vec3d x) const {
  const auto cell = [&](double along) { return int64_t(std::floor(along * over_)); };
  const uint64_t key = key_of(cell(x.x), cell(x.y), cell(x.z));
  size_t slot = slot_of(key, keys_.size());
  while (keys_[slot] != key) {
    if (keys_[slot] == kNone) return {nullptr, nullptr};
    slot = (slot + 1) & (keys_.size() - 1);
  }
  return {photons_.data() + begin_[slot], photons_.data() + end_[slot]};
}

}  // namespace glint
