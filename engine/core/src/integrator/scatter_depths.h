// Where on rays media scatter light from: places that all pixels choose alike (semantics/media.md).
#pragma once
#include <vector>

#include "integrator/media.h"

namespace glint {

/// Where a light, or its point, is.
struct LightPlace {
  bool endless;
  Vec3d center;
  double nearness;  // nearer than that it seems no brighter
};

/// Rungs along some rays, and for a light how much of what it gives to the media comes from each.
/// Letters: t along a ray, s from its point nearest to the light, D how far that is, and v = s / (D
/// + sqrt(D^2 + s^2)), in which the light of a lamp is spread nearly evenly.
class ScatterDepths {
 public:
  /// Along the rays from where they begin to look on to `ends`.
  void build(const MediaSpans& spans, const Rays& rays, const double* ends);
  /// Whether anything is scattered along ray k.
  bool any(size_t k) const { return first_[k] < first_[k + 1]; }
  bool any() const { return !rungs_.empty(); }
  /// For a light, or one of its points; null: for light from everywhere.
  void aim(const Light* light, const LightPlace& place, const Rays& rays);

  /// spread: one over how densely places fall there; 0 where there is none.
  struct Place {
    double t, spread;
  };
  /// Of ray k, where a share of all lies before it.
  Place at(size_t k, double share) const;

 private:
  /// first, last: how much light it scatters at its ends.
  struct Rung {
    double from, to, first, last;
  };
  /// A rung as the light has it: its ends as t and as what places are chosen in, t or v; how dense
  /// these are there; the sum of the weights up to here.
  struct Aimed {
    double from, to, first, last, low, high, total;
  };
  struct Nearest {
    double t, D;
  };

  void add_rungs(const std::vector<MediaSpans::Piece>& pieces);
  void add_rung(const MediaSpans::Piece& piece, double from, double to, Vec3d before);
  double left_of(int channel, double depth);
  void aim_at(size_t k, const Light::Part& lit, const LightPlace& place, Vec3d o, Vec3d d);

  std::vector<MediaSpans::Piece> pieces_;
  std::vector<Rung> rungs_;
  std::vector<Aimed> aimed_;
  std::vector<uint32_t> first_;  // of each ray's rungs
  Vec3d depth_, left_{1, 1, 1};  // the last optical depths asked for, and what is left behind them
  std::vector<Nearest> nearest_;
  bool endless_ = true;
};

}  // namespace glint
