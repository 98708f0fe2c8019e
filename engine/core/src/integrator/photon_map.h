// Light of lamps by way of mirrors and glass, as photons on what is matt (Jensen 1996, Global
// illumination using photon maps).
#pragma once
#include <cstdint>
#include <vector>

#include "math/vec.h"
#include "session/thread_pool.h"

namespace glint {

/// Where light of a lamp arrives. normal: the face's, on the side that it comes to. flux: over pi,
/// of anchored areas.
struct Photon {
  Vec3d x;
  Vec3f normal, flux;
  double radius = 0;  // within which it lights
  int32_t group = -1;  // of lights
};

/// Photons of one lamp by way of one caster, one after the other.
using PhotonRange = std::pair<size_t, size_t>;

class PhotonMap {
 public:
  /// Radii are those of the photons to be.
  PhotonMap(std::vector<Photon> photons, const std::vector<PhotonRange>& ranges, ThreadPool& pool);

  bool empty() const { return photons_.empty(); }
  size_t size() const { return photons_.size(); }

  /// add(photon, share) for the photons that light the point x on the side of the normal, in their
  /// order level by level; share: of its flux an area.
  template <class Add>
  void each_at(Vec3d x, Vec3d normal, Add add) const {
    for (const Level& level : levels_) {
      const auto [first, last] = level.at(x);
      for (const uint32_t* i = first; i != last; ++i) {
        const Photon& photon = photons_[*i];
        const double share = share_of(photon, x, normal);
        if (share > 0) add(photon, share);
      }
    }
  }

 private:
  static constexpr uint32_t kNeighbours = 32;  // that say how far a photon's light reaches

  /// Of its flux an area at a point: a kernel of Epanechnikov.
  static double share_of(const Photon& photon, Vec3d x, Vec3d normal);

  /// Cells of one size, each with the photons whose light reaches into it.
  struct Level {
    int exponent;  // of two, that is a cell's side
    std::vector<uint64_t> keys;  // open addressing; kNone: empty
    std::vector<uint32_t> begin, end, photons;
    std::pair<const uint32_t*, const uint32_t*> at(Vec3d x) const;
  };
  void find_radii(PhotonRange range, ThreadPool& pool);
  Level level_of(int exponent, const std::vector<uint32_t>& photons) const;

  std::vector<Photon> photons_;
  std::vector<Level> levels_;
};

}  // namespace glint
