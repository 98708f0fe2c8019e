// Rays that go on from lit points along directions of their lobes: bounces to light that others
// throw back, and reflections of rough surfaces.
#pragma once
#include <vector>

#include "integrator/lit_batch.h"

namespace glint {

class OnwardRays : LightContext {
 public:
  explicit OnwardRays(LitBatch& lit) : LightContext(lit), lit_(lit) {}

  /// Whether light bounces on at what the rays of a queue meet.
  bool bounces(const Queue& queue) const { return queue.past.bounced < plan.bounces; }
  /// The same of FIBRE_SPECULAR and FIBRE_TRANSMISSION lobes.
  bool bounces_from_fibres(const Queue& queue) const {
    return queue.past.bounced < plan.fibre_bounces;
  }
  /// Adds to `gathering` the rays along which light came that bounced. pixels: of the region, of
  /// each point of the batch.
  void bounce(const Batch& batch, const std::vector<uint32_t>& pixels, uint32_t sample,
              Queue& gathering);
  /// Adds to `glossy` the rays that rough surfaces reflect towards others.
  void reflect(const Batch& batch, uint32_t sample, Queue& glossy);
  /// Directions that what is matt draws to a lamp's points, with the cosine's pdf: how many.
  size_t draw_diffuse(const Batch& batch, const LampSample& lamp);

 private:
  OnwardStage stage(const int64_t* lit) const {
    return {&lit_.points, lit,    {disc_[0].data(), disc_[1].data()}, lit_.rays, false,
            false,        nullptr};
  }
  void place_all(const Batch& batch, double x, double y);
  const double* choices(const Batch& batch, const double* const (&at)[RenderPlan::kBounceParts]);
  void push_reflected(const Batch& batch, size_t k, Queue& glossy);

  LitBatch& lit_;
  std::vector<uint8_t> place_;             // RenderPlan::bounce_part of each point
  std::vector<double> disc_[2], choices_;  // as OnwardStage has them
};

}  // namespace glint
