// Shadow rays on their way through surfaces that let light through (semantics/shadows.md).
#pragma once
#include <atomic>
#include <vector>

#include "integrator/batch.h"
#include "integrator/plan.h"
#include "integrator/waiting_rays.h"

namespace glint {

/// What gets through of the light of a sample, a row of `shadow` for each of the `count` rays that
/// it was found to send: each surface on the way of a ray lets its clamped transparency through.
/// The nearest layers of some rays are found at a time and read material by material; each ray
/// multiplies them in their order.
class TransparentShadows {
 public:
  // By how much the optical momentum of light across its way may change that still comes straight:
  // as thin lenses and uneven panes bend it, and balls and bottles do not.
  static constexpr double kMostBent = 0.2;
  static constexpr double kAlike = 1e-6;  // of products of indices that come to 1

  TransparentShadows(const Scene& scene, const Stages& stages, const std::atomic<bool>& cancel,
                     Scratch& scratch);

  /// Of rays of which nothing is known. shape: of the light. starts: of the
  /// rays, 0. opacity: as of the scene's light.
  /// visibility: of what they meet.
  void trace(const ShadowRays& sent, LightShape shape, const Opacity* opacity, const double* starts,
             size_t count, double* const (&shadow)[3], RayCounts& counts,
             uint32_t visibility = kShadow);
  /// Of rays of which it is known whether anything is on their way.
  void follow(const ShadowRays& sent, LightShape shape, const uint8_t* blocked, size_t count,
              double* const (&shadow)[3], RayCounts& counts, uint32_t visibility);

 private:
  static constexpr size_t kAtOnce = 256;  // rays, as many as go down as a beam

  /// A layer on the way of a ray: where it is among the hits and in the columns of the stage.
  struct Layer {
    uint32_t hit, material, row;
  };

  /// As TransmittanceStage has them; narrows, turns: where some material is dense.
  struct LayerColumns {
    std::vector<uint32_t> number, instance, primitive;
    std::vector<float> u, v;
    Columns shares{3}, turns{3};
    std::vector<double> narrows, solids;
  };

  void begin(const ShadowRays& sent, LightShape shape, size_t count, double* const (&shadow)[3],
             const Opacity* opacity, uint32_t visibility);
  void wait(uint32_t number, double t_min);
  void go_on(RayCounts& counts);
  void pass(const Rays& rays, RayCounts& counts);
  void list_layers(const Rays& rays);
  void sort_layers();
  void place_solids(const Rays& rays);
  void read_shares(const Rays& rays);
  void multiply(size_t ray);
  void narrow(size_t count);

  const Scene& scene_;
  const Stages& stages_;
  const std::atomic<bool>& cancel_;
  Scratch& scratch_;
  TransmittanceStage stage_{};
  const ShadowRays* sent_ = nullptr;
  const Opacity* opacity_ = nullptr;
  uint32_t visibility_ = kShadow;
  double* shadow_[3] = {};
  WaitingRays waiting_;
  // Of the rays that are passed at once:
  uint32_t ray_number_[kAtOnce];
  std::vector<Hit> hits_;  // as accel.h's Layers has them
  uint8_t found_[kAtOnce], blocked_[kAtOnce];
  std::vector<Layer> layers_;                   // ray by ray
  uint32_t end_[kAtOnce];                       // of each ray's layers
  std::vector<uint32_t> materials_, first_of_;  // those met; by material, its first row
  LayerColumns columns_;                        // of the layers, material by material
  // By how much the layers of each ray narrow its light, where some material is dense, and change
  // its optical momentum; whether that counts.
  std::vector<double> narrowed_;
  std::vector<Vec3d> bent_;
  bool bends_ = false;
  std::vector<double> slots_;  // of programs
};

}  // namespace glint
