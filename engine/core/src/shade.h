// Surfaces that vary, or send rays on: what they add to the film, what lights need of them, which rays leave (notes 4.12-4.17).
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

  /// The material of ray k of the batch, one of its `others`. Data passes go to pixel `pixel` of the film, alpha lost to `lost`.
  void hit(Batch& batch, size_t k, Film& film, uint32_t pixel, double& lost, const Leaving& next, RayCounts& counts) const;
  /// Data passes of a hit that lets nothing through.
  void record(const Batch& batch, size_t k, Film& film, uint32_t pixel) const;
  /// Adds the visible shapes of lights that ray k meets before its hit.
  void seen_lights(Batch& batch, size_t k) const;

 private:
  struct Incidence;
  struct Lobes;
  void add_lobe(const Incidence& at, const Lobe& lobe, Vec3d k, Lobes& sum, const Leaving& next, RayCounts& counts) const;
  void go_on(const Incidence& at, const Lobes& sum, double t, const Leaving& next, RayCounts& counts) const;
  void refraction(const Incidence& at, Vec3d k, double relative_ior, const Leaving& next, RayCounts& counts) const;
  bool push(const Incidence& at, Vec3d d, Vec3d k, Queue& next) const;
  void record(Film& film, uint32_t pixel, const Surface& s, const Material& material, Vec3d d) const;

  const Scene& scene_;
  const RenderPlan& plan_;
  CameraRays camera_;
};

}  // namespace glint
