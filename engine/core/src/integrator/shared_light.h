// Many samples of lamps, or of media that glow, that share the shadow rays of a pixel's sample
// (semantics/many_lamps.md): all of them light a point, and some are asked for their shadows,
// which stand for those of all.
#pragma once
#include <optional>
#include <vector>

#include "integrator/lamp_tree.h"
#include "integrator/lit_batch.h"

namespace glint {

/// Their samples, those whose lamps far points see in clusters last, from `clustered` on.
struct SharedSamples {
  std::vector<LampSample> lamps;
  std::vector<const Light*> lights;  // of each
  std::vector<uint32_t> groups;      // and its light group, the number of these for none
  size_t clustered = 0;
  std::vector<LampCluster> clusters;
  std::vector<double> color_sums;  // as ShareStage has them
};

/// Of each point: what they give of diffuse and of specular light, and all channels of both; of the
/// samples that are asked, their light and what got through of it; what gloss gives back of light
/// as if it were matt. The first, third and fourth also three for each light group, none where
/// nobody asks.
struct SharedSums {
  Columns columns{17}, group_columns{0};
  double *diffuse[3] = {}, *specular[3] = {}, *total = nullptr;
  double *asked[3] = {}, *passed[3] = {}, *ones = nullptr, *gloss[3] = {};
  std::vector<double*> group_total, group_asked, group_passed;

  void clear(size_t points, size_t groups);
};

/// Rays that wait to be traced together: the last one's sample, and the request of each.
struct WaitingShadows {
  size_t number = 0;
  std::vector<uint32_t> requests;
  size_t count() const { return requests.size(); }
};

/// The samples that points ask for shadows: as they are chosen, and by sample, whose ends are.
struct ShadowRequests {
  std::vector<double> contributions;
  std::vector<uint32_t> reaching, ends;
  std::vector<ShadowRequest> chosen, sorted;
  std::vector<int64_t> asks;    // mask: points that ask the present sample
  std::vector<uint32_t> place;  // of those: the request
  WaitingShadows waiting;

  void sort(size_t count, size_t samples);
};

class SharedLight : LightContext {
 public:
  enum Kind { kLamps, kMedia };
  SharedLight(Kind kind, LitBatch& lit);

  bool takes_part(const Light& light) const { return on_ && takes_part_[light.number]; }
  bool on() const { return on_; }
  /// Adds them all to the points of a batch. few: these take few samples.
  void add(const Batch& batch, uint32_t sample, bool few);

 private:
  void list_samples(const Batch& batch, uint32_t sample);
  void list_samples_of(const Light& light, uint32_t sample);
  void find_clusters();
  void choose(const Batch& batch, uint32_t sample);
  bool are_alike(size_t a, size_t b) const;
  void ask(const Batch& batch, size_t number, uint32_t begin, uint32_t end);
  void trace(const Batch& batch);
  void add_to_sums(const Batch& batch) const;
  void share_groups(const Batch& batch, size_t k, Vec3d open) const;
  uint32_t parts() const;
  uint32_t rays_of(const Batch& batch) const;

  const Kind kind_;
  LitBatch& lit_;
  /// What samples_ are of: a pixel's sample, few_, and near_'s numbers.
  struct Listed {
    uint32_t sample;
    bool few;
    const int64_t* near;
    bool operator==(const Listed&) const = default;
  };
  bool on_ = false, few_ = false, varies_ = false;  // varies_: from sample to sample
  std::optional<Listed> listed_;
  std::vector<uint8_t> takes_part_;  // of the scene's lights
  uint32_t rays_ = 0;                // of a point and sample
  size_t group_count_ = 0;           // of lights, with none; 0 where nobody asks
  SharedSamples samples_;
  SharedSums sums_;
  ShadowRequests requests_;
  LitPoints white_{}, shining_{};  // points that ask samples, and directions drawn for them
  std::vector<int64_t> near_;      // mask of points that do not see lamps in clusters
  std::vector<std::vector<int64_t>> receives_;  // masks, of lamps that light but some
};

}  // namespace glint
