// Shadow rays on their way through surfaces that let light through (SEMANTICS.md, S).
#pragma once
#include <atomic>
#include <vector>

#include "integrator/batch.h"
#include "integrator/plan.h"

namespace glint {

class TransparentShadows {
 public:
  TransparentShadows(const Scene& scene, const Stages& stages, const std::atomic<bool>& cancel,
                     Scratch& scratch)
      : scene_(scene),
        stages_(stages),
        cancel_(cancel),
        scratch_(scratch),
        slots_(size_t(scene.most_slots) * kBlock) {}

  /// What gets through of the light of a sample, a row of `shadow` for each of the `count` rays
  /// that it was found to send: each surface on the way of a blocked one lets its clamped
  /// transparency through.
  void follow(const Batch& batch, const LightStage& light, const uint8_t* blocked, size_t count,
              double* const (&shadow)[3], RayCounts& counts);

 private:
  void start(const LightStage& light, const uint8_t* blocked, size_t count);
  void find_hits(RayCounts& counts);
  uint32_t material_at(size_t k) const;
  size_t pass(const TransmittanceStage& stage, uint32_t material);
  size_t step(TransmittanceStage& stage);
  const double* place_shapes(const TransmittanceStage& stage);

  const Scene& scene_;
  const Stages& stages_;
  const std::atomic<bool>& cancel_;
  Scratch& scratch_;
  Columns rays_{TransmittedRay::kColumns};
  size_t open_ = 0;                                      // rows of the rest: rays with light left
  std::vector<uint32_t> number_, instance_, primitive_;  // number_: of the ray in the sample
  std::vector<float> u_, v_;
  std::vector<double> slots_, shapes_;  // of programs; as TransmittanceStage has them
};

}  // namespace glint
