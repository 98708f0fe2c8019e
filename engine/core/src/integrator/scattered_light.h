// Light that reaches the eye from media: what they scatter of the lights, once, and what they give
// of themselves.
#pragma once
#include <vector>

#include "integrator/lit_batch.h"
#include "integrator/scatter_depths.h"

namespace glint {

/// Rays that cross media: of which their spans are, and their weights before these dim them.
struct CrossedMedia {
  Batch& batch;
  const MediaSpans& spans;
  const Vec3d* clear;
};

class ScatteredLight : LightContext {
 public:
  explicit ScatteredLight(LitBatch& lit) : LightContext(lit), lit_(lit) {}

  /// Adds what media before the hits give of themselves.
  void add_glow(const CrossedMedia& media);
  /// Adds what they scatter of the lights, and to `gathering` the rays along which light bounced
  /// there. pixels: of the region, of each ray.
  void add(const CrossedMedia& media, const std::vector<uint32_t>& pixels, uint32_t sample,
           Queue& gathering);

 private:
  void find_ends(const Batch& batch);
  void place_points(const Batch& batch);
  void bounce(const CrossedMedia& media, const std::vector<uint32_t>& pixels, uint32_t sample,
              Queue& gathering);
  void add_light(const CrossedMedia& media, const Light& light, uint32_t sample);
  void add_sample(const CrossedMedia& media, const Light& light, const LampSample& lamp,
                  double share, double count);

  LitBatch& lit_;
  ScatterDepths depths_;
  Columns columns_{6};             // a point on each ray, and its weight
  std::vector<double> at_, ends_;  // where these are; ends of the rays
  std::vector<int64_t> scatters_;  // mask: of those that there are
  std::vector<MediaSpans::Piece> pieces_;
};

}  // namespace glint
