// Surfaces that send rays on, and what stages do not do for a hit: holdouts, data passes, lights
// that are seen (notes 4.12-4.17).
#pragma once
#include "film/film.h"
#include "integrator/batch.h"
#include "integrator/media.h"
#include "integrator/motion_vectors.h"
#include "integrator/plan.h"
#include "scene/camera.h"

namespace glint {

/// Rays that leave the surfaces of a batch: those that go straight on, and those one bounce deeper.
struct Leaving {
  Queue& straight;
  Queue& bounced;
};

/// What of the light behind them mirrors and glass send on, with what Fresnel says; clear: of the
/// latter what is not rough.
struct Gives {
  Vec3d mirrored, refracted, clear;
};

class Shader {
 public:
  Shader(const Scene& scene, const RenderPlan& plan, const Stages& stages)
      : scene_(scene),
        plan_(plan),
        stages_(stages),
        camera_(scene),
        motion_vectors_(scene, plan.neighbours) {}

  /// Sends on the rays of some points of the batch, of different paths, whose material the vary
  /// stage has seen. straight_alone: but for mirrored and refracted ones.
  void pass_on(const Batch& batch, uint32_t sample, const uint32_t* rows, size_t count,
               const Leaving& next, RayCounts& counts, bool straight_alone = false) const;
  /// The same of all rays, whatever they weigh, but those of rough glass.
  void send_all(const Batch& batch, const uint32_t* rows, size_t count, const Leaving& next) const;
  /// What goes straight through the surface of a point that the vary stage has seen, if it lets
  /// any through; or what the lobes of another such kind come to.
  Vec3d passed(const Batch& batch, size_t k, int kind = GLINT_TRANSPARENT) const;
  Gives gives(const Batch& batch, size_t k) const;
  /// Takes highlights away, and gives DIFFUSE lobes what those of dielectrics kept of their light.
  void dull(const Batch& batch) const;
  /// Data passes of a point that the vary stage has seen, unless the surface lets most through.
  void record_transparent(const Batch& batch, size_t k, Film& film, uint32_t pixel) const;
  /// Data passes of a hit that lets nothing through.
  void record(const Batch& batch, size_t k, Film& film, uint32_t pixel) const;
  /// Adds the visible shapes of lights that ray k meets before its hit. media: before these, with
  /// the rays' weights `clear` of them; or null.
  void seen_lights(Batch& batch, size_t k, const MediaSpans* media, const Vec3d* clear) const;

 private:
  void record(Film& film, uint32_t pixel, const Surface& s, const Material& material,
              Vec3d d) const;
  Vec3d transparency(const Batch& batch, size_t k, const Material& material) const;

  const Scene& scene_;
  const RenderPlan& plan_;
  const Stages& stages_;
  CameraRays camera_;
  MotionVectors motion_vectors_;
};

}  // namespace glint
