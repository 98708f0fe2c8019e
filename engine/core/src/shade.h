// Surfaces that send rays on, and what stages do not do for a hit: holdouts, data passes, lights that are seen (notes 4.12-4.17).
#pragma once
#include "batch.h"
#include "camera.h"
#include "film.h"
#include "plan.h"

namespace glint {

/// Rays that leave the surfaces of a batch: those that go straight on, and those one bounce deeper.
struct Leaving {
  Queue& straight;
  Queue& bounced;
};

class Shader {
 public:
  Shader(const Scene& scene, const RenderPlan& plan) : scene_(scene), plan_(plan), camera_(scene) {}

  /// Sends on the rays of point k of the batch, whose material the vary stage has seen. Data passes go to pixel `pixel` of the film unless
  /// the surface lets most through.
  void pass_on(const Batch& batch, size_t k, Film& film, uint32_t pixel, const Leaving& next, RayCounts& counts) const;
  /// A hit on a holdout; alpha lost is added to `lost`.
  void hold_out(const Batch& batch, size_t k, Film& film, uint32_t pixel, double& lost) const;
  /// Data passes of a hit that lets nothing through.
  void record(const Batch& batch, size_t k, Film& film, uint32_t pixel) const;
  /// Adds the visible shapes of lights that ray k meets before its hit.
  void seen_lights(Batch& batch, size_t k) const;

 private:
  struct Incidence;
  struct Passing;
  void add_lobe(const Incidence& at, const Lobe& lobe, Vec3d k, Passing& sum, const Leaving& next, RayCounts& counts) const;
  void go_on(const Incidence& at, const Passing& sum, double t, const Leaving& next, RayCounts& counts) const;
  void refraction(const Incidence& at, Vec3d k, double relative_ior, const Leaving& next, RayCounts& counts) const;
  bool push(const Incidence& at, Vec3d d, Vec3d k, Queue& next) const;
  void record(Film& film, uint32_t pixel, const Surface& s, const Material& material, Vec3d d) const;

  const Scene& scene_;
  const RenderPlan& plan_;
  CameraRays camera_;
};

}  // namespace glint
