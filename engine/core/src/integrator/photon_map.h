// Light of lamps by way of mirrors and glass, as photons on what is matt (Jensen 1996, Global
// illumination using photon maps). What they come to is known at some of them and read from these
// (Christensen 1999, Faster photon map global illumination).
#pragma once
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "math/vec.h"
#include "system/thread_pool.h"

namespace glint {

/// Where light of a lamp arrives. normal: the face's, on the side that it comes to. flux: over pi,
/// of anchored areas; of a node the irradiance there, over pi.
struct Photon {
  Vec3d x;
  Vec3f normal, flux;
  double radius = 0;  // within which it counts
  uint32_t bundle = 0;
};

/// The photons of one lamp by way of one caster. ends: of those from each place of the lamp, one
/// after the other.
struct PhotonBundle {
  int group = -1;  // of lights, as the lamp's
  size_t first = 0;
  std::vector<size_t> ends;
};

/// Cells of one size, each with the photons that count in it.
class PhotonCells {
 public:
  PhotonCells(const std::vector<Photon>& photons, int exponent,
              const std::vector<uint32_t>& numbers);
  /// Those of the cell that x is in, in their order.
  std::pair<const uint32_t*, const uint32_t*> at(Vec3d x) const;

 private:
  double over_;                 // of a cell's side, which is a power of two
  std::vector<uint64_t> keys_;  // open addressing
  std::vector<uint32_t> begin_, end_, photons_;
};

class PhotonMap {
 public:
  PhotonMap(std::vector<Photon> photons, std::vector<PhotonBundle> bundles, ThreadPool& pool);

  /// What a bundle comes to at a point: sums over nodes, by weight.
  struct Found {
    uint32_t bundle;
    double weight;
    Vec3d sum;
    /// Irradiance over pi. It ends gently where nodes do.
    Vec3d light() const { return (1 / std::max(weight, 0.5)) * sum; }
  };
  /// On the side of the normal.
  void find(Vec3d x, Vec3d normal, std::vector<Found>& found) const;
  int group(const Found& found) const { return bundles_[found.bundle].group; }

 private:
  void add_nodes(const std::vector<Photon>& photons, uint32_t number, size_t step,
                 ThreadPool& pool);

  std::vector<PhotonBundle> bundles_;
  std::vector<Photon> nodes_;
  std::vector<PhotonCells> cells_;  // by size
};

}  // namespace glint
